//! Scans: points on surfaces with the places of the scanner, in E57, LAS, LAZ, and from PLY.

#[cfg(feature = "scans")]
mod files;
#[cfg(feature = "scans")]
mod las_head;

use enfilade_geom::{DMat4, DVec3};
use enfilade_source::{Scan, ScanOptions};

use crate::ImportError;
use crate::builder::Builder;
use crate::sources::{Told, add, limits};

#[cfg(feature = "scans")]
pub(crate) use files::{read_e57, read_las};

/// Refuses scans in E57: this build has no reader.
#[cfg(not(feature = "scans"))]
pub(crate) fn read_e57(_: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    Err(builder.malformed("file", crate::not_built("E57", "scans")))
}

/// Refuses clouds of points in LAS and LAZ: this build has no reader.
#[cfg(not(feature = "scans"))]
pub(crate) fn read_las(_: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    Err(builder.malformed("file", crate::not_built("LAS", "scans")))
}

/// Edge of the voxels of a scan: walls are at least two of them thick. [Units: wu]
const SCAN_STEP: f64 = 0.05;
/// Farthest points from the stations that matter, along an axis. [Units: wu]
const SCAN_REACH: f64 = 12.0;
/// Pieces of surface smaller than this are noise: half the width of the narrowest doorway. [Units: wu]
const SCAN_PIECE: f64 = 0.3;

/// Reads the points of a scan. Without a place of the scanner, the file has no surface, and this is noted.
///
/// `station_of` is empty if the file does not say which station saw which point.
pub(crate) fn read_points(
    points: Vec<DVec3>,
    station_of: Vec<u16>,
    mut stations: Vec<DVec3>,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    // Options are in meters of the scene, with y up.
    let from_scene = builder.base.inverse();
    let given = builder.options.stations.iter();
    stations.extend(given.map(|p| from_scene.transform_point3(*p)));
    if stations.is_empty() {
        let text = "a cloud of points without faces; give the place of the scanner as --station X,Y,Z, so that its surface can be \
                    made";
        builder.note("element vertex", text);
        return Ok(());
    }
    if stations.len() > 1 && station_of.is_empty() {
        let problem = format!(
            "{} stations, and no property 'station' of the points that tells which saw each; give each scan a file of its own",
            stations.len()
        );
        return Err(builder.malformed("element vertex", problem));
    }
    let scan = Scan {
        station_of: match station_of.is_empty() {
            true => vec![0; points.len()],
            false => station_of,
        },
        points,
        stations,
    };
    add_scan(&scan, builder)
}

/// Adds the surface of a scan in the space of the input.
fn add_scan(scan: &Scan, builder: &mut Builder<'_>) -> Result<(), ImportError> {
    let meters = builder.base.transform_vector3(DVec3::X).length();
    let options = ScanOptions {
        step: SCAN_STEP / meters,
        reach: SCAN_REACH / meters,
        least_piece: SCAN_PIECE / meters,
    };
    let limits = limits(builder);
    let step = scan.step(&options, &limits);
    let surface = scan.surface(&options, &limits);
    let surface = surface.map_err(|e| builder.failed(e))?;
    let text = format!(
        "a scan of {} points, stations: {}; what no station saw is matter",
        scan.points.len(),
        scan.stations.len()
    );
    let told = Told {
        text,
        enlarged: None,
    };
    add(builder, surface, DMat4::IDENTITY, step, told)
}
