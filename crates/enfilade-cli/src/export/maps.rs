//! `enfilade export -o MAP.pgm`: a storey as robots take it.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::bail;
use enfilade::cpg::World;
use enfilade_export::{FloorMap, FloorMapOptions};
use enfilade_report::{Storey, find_storeys};

use crate::export::{Export, check_rooms, read_valid};
use crate::formats::Format;
use crate::output::{Outputs, Written, refuse_stream, write_whole};
use crate::screen::print_json;

/// The files of a map beside its picture: what each is, and how its name ends.
const BESIDE: [&str; 3] = ["yaml", "labels.pgm", "rooms.json"];

#[derive(serde::Serialize)]
struct MapReport {
    storey: String,
    floor: f64,
    width: usize,
    height: usize,
    resolution: f64,
    files: Vec<Written>,
}

pub(super) fn run(args: &Export, outputs: &mut Outputs) -> anyhow::Result<()> {
    refuse_stream("-o", &args.output, "several files")?;
    if args.cells {
        bail!("--cells applies only to a .csv file; leave it out");
    }
    outputs.write("-o", Format::FloorMap, &args.output)?;
    let world = read_valid(args)?;
    check_rooms(&world)?;
    let storeys = find_storeys(&world);
    let storey = chosen(&storeys, args.storey.as_deref())?;
    let options = FloorMapOptions {
        floor: storey.floor,
        resolution: args.resolution.unwrap_or(0.05),
        ..FloorMapOptions::default()
    };
    let map = FloorMap::new(&world, &options)?;
    let written = write(args, &world, &map)?;
    let report = MapReport {
        storey: storey.name.clone(),
        floor: storey.floor,
        width: map.width,
        height: map.height,
        resolution: map.resolution,
        files: written,
    };
    if args.json {
        return print_json(outputs.printed(), &report);
    }
    let mut out = outputs.printed();
    for file in &report.files {
        writeln!(out, "{file}")?;
    }
    let others: Vec<&str> = names(&storeys).filter(|n| *n != storey.name).collect();
    if args.storey.is_none() && !others.is_empty() {
        writeln!(
            out,
            "storey {}; --storey chooses another: {}",
            storey.name,
            others.join(", ")
        )?;
    }
    Ok(())
}

/// Returns the storeys with floors to drive on, by name.
fn names(storeys: &[Storey]) -> impl Iterator<Item = &str> {
    let floors = storeys.iter().filter(|s| !s.is_between);
    floors.map(|s| s.name.as_str())
}

fn chosen<'s>(storeys: &'s [Storey], name: Option<&str>) -> anyhow::Result<&'s Storey> {
    let mut floors = storeys.iter().filter(|s| !s.is_between);
    let found = match name {
        Some(name) => floors.find(|s| s.name == name),
        None => floors.next(),
    };
    match (found, name) {
        (Some(storey), _) => Ok(storey),
        (None, Some(name)) => bail!(
            "--storey {name}: there is no such storey; the world has {}",
            names(storeys).collect::<Vec<_>>().join(", ")
        ),
        (None, None) => bail!("no room of the world has a floor, so there is no map"),
    }
}

fn write(args: &Export, world: &World, map: &FloorMap) -> anyhow::Result<Vec<Written>> {
    let image = args.output.file_name().unwrap_or_default();
    let contents = [
        map.yaml(&image.to_string_lossy()).into_bytes(),
        map.labels_pgm(),
        map.rooms_json(world).into_bytes(),
    ];
    let beside = BESIDE.map(|ending| beside(&args.output, ending));
    let first = (args.output.clone(), map.occupancy_pgm());
    let files = std::iter::once(first).chain(beside.into_iter().zip(contents));
    files
        .map(|(path, bytes)| {
            write_whole(&path, &bytes)?;
            Ok(Written::new(&path, &bytes))
        })
        .collect()
}

/// Returns the name of a file beside a map.
fn beside(map: &Path, ending: &str) -> PathBuf {
    map.with_extension(ending)
}
