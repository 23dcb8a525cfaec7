//! Reads clouds of points in E57, LAS and LAZ.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;

use e57::{CartesianCoordinate, E57Reader};
use enfilade_geom::DVec3;
use enfilade_source::Scan;

use super::{add_scan, las_head, read_points};
use crate::ImportError;
use crate::builder::Builder;
use crate::caught::caught;

/// Reads the scans of an E57 file, each with the pose of its scanner. The third axis is up.
pub(crate) fn read_e57(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("E57");
    let cloud = guarded(builder, |builder| e57_scan(bytes, builder))?;
    match cloud.stations.is_empty() {
        true => Ok(()),
        false => add_scan(&cloud, builder),
    }
}

fn e57_scan(bytes: &[u8], builder: &mut Builder<'_>) -> Result<Scan, ImportError> {
    let file = Cursor::new(bytes);
    let mut reader = E57Reader::new(file).map_err(|e| damaged(builder, "file", &e))?;
    let (mut points, mut station_of, mut stations) = (Vec::new(), Vec::new(), Vec::new());
    for (i, cloud) in reader.pointclouds().iter().enumerate() {
        let place = format!("scan {i}");
        builder.charge_vertices(&place, cloud.records)?;
        let Some(pose) = &cloud.transform else {
            builder.note(
                place,
                "a scan without a pose, so that its station is not known; left out",
            );
            continue;
        };
        let Ok(station) = u16::try_from(stations.len()) else {
            return Err(builder.malformed(place, "more than 65,535 scans; split the file"));
        };
        let at = &pose.translation;
        stations.push(DVec3::new(at.x, at.y, at.z));
        let all = reader
            .pointcloud_simple(cloud)
            .map_err(|e| damaged(builder, &place, &e))?;
        for point in all {
            builder.spend(&place, 4)?;
            let point = point.map_err(|e| damaged(builder, &place, &e))?;
            // A direction alone met nothing: the sky, or a surface as black as it.
            if let CartesianCoordinate::Valid { x, y, z } = point.cartesian {
                points.push(DVec3::new(x, y, z));
                station_of.push(station);
            }
        }
    }
    if builder.options.up.is_none() {
        points.iter_mut().chain(&mut stations).for_each(turn);
    }
    Ok(Scan {
        points,
        station_of,
        stations,
    })
}

/// Turns a point from the third axis up to the second axis up.
fn turn(p: &mut DVec3) {
    *p = DVec3::new(p.x, p.z, -p.y);
}

/// Calls a reader of a dependency, whose panics on damaged files become errors.
fn guarded<T>(
    builder: &mut Builder<'_>,
    read: impl FnOnce(&mut Builder<'_>) -> Result<T, ImportError>,
) -> Result<T, ImportError> {
    let read = caught(|| read(builder));
    read.unwrap_or_else(|| Err(builder.malformed("file", "is damaged; export it anew")))
}

/// Points read at a time, and the bytes that they take at most.
const BATCH: u64 = 1 << 16;
const BATCH_BYTES: u64 = 16 << 20;

/// Reads a cloud of points in LAS or LAZ. The third axis is up; the options give the places of the scanner.
pub(crate) fn read_las(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("LAS");
    let (points, sources) = guarded(builder, |builder| las_points(bytes, builder))?;
    let n = builder.options.stations.len();
    let known: BTreeSet<u16> = sources.iter().copied().collect();
    if n > 1 && known.len() != n {
        let problem = format!(
            "its points have {} sources (point source id), and {n} stations are given; give one --station for each source, in \
             ascending order of their ids",
            known.len()
        );
        return Err(builder.malformed("points", problem));
    }
    let station_of = match n {
        0 | 1 => Vec::new(),
        _ => {
            let known: BTreeMap<u16, u16> = known.into_iter().zip(0..).collect();
            sources.iter().map(|s| known[s]).collect()
        }
    };
    read_points(points, station_of, Vec::new(), builder)
}

/// Returns the points of LAS or LAZ, and their sources.
fn las_points(
    bytes: &[u8],
    builder: &mut Builder<'_>,
) -> Result<(Vec<DVec3>, Vec<u16>), ImportError> {
    let damaged = |builder: &Builder<'_>, e: &las::Error| {
        builder.malformed("file", format!("{e}; is it cut off?"))
    };
    if let Some(problem) = las_head::problem(bytes) {
        return Err(builder.malformed("file", problem));
    }
    // The reader needs bytes of its own.
    let mut reader =
        las::Reader::new(Cursor::new(bytes.to_vec())).map_err(|e| damaged(builder, &e))?;
    let n = reader.header().number_of_points();
    builder.charge_vertices("points", n)?;
    let n_batch = BATCH.min(BATCH_BYTES / las_head::point_length(bytes));
    let (mut points, mut sources) = (Vec::new(), Vec::new());
    while (points.len() as u64) < n {
        // Each point takes about half a microsecond to unpack.
        builder.spend("points", 5 * n_batch)?;
        let batch = reader
            .read_points(n_batch)
            .map_err(|e| damaged(builder, &e))?;
        if batch.is_empty() {
            let problem = format!("ends after {} of {n} points; is it cut off?", points.len());
            return Err(builder.malformed("points", problem));
        }
        let xyz = batch.x().zip(batch.y()).zip(batch.z());
        points.extend(xyz.map(|((x, y), z)| DVec3::new(x, y, z)));
        sources.extend(batch.point_source_id());
    }
    if builder.options.up.is_none() {
        points.iter_mut().for_each(turn);
    }
    Ok((points, sources))
}

fn damaged(builder: &Builder<'_>, place: &str, e: &e57::Error) -> ImportError {
    builder.malformed(place, format!("{e}; is the file cut off?"))
}
