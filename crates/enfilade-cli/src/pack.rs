//! `enfilade pack` and `enfilade unpack`: a world in pieces, for loading what comes into view.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use enfilade::cpg::wire::decode_glb;
use enfilade::geom::shown;
use enfilade::internals::stream::first_picture;
use enfilade::stream::{HEAD, PackedPlace, PackedWorld};
use enfilade::whole;
use enfilade_report::WalkPage;

use crate::formats::Format;
use crate::output::{Outputs, Written, check_folder, refuse_stream, write_whole};
use crate::report::title_of;
use crate::screen::print_json;
use crate::walk_page;
use enfilade_cli::input::{name_of, read};

/// Cuts a world into pieces, so that a program loads only what comes into view: a small head, one piece per set of cells, per
/// mesh and per picture, compressed without loss.
#[derive(clap::Args)]
pub(crate) struct Pack {
    /// World written by `enfilade bake`; `-` for standard input.
    input: PathBuf,
    /// Folder for the packed world, or its file with --one-file. A packed world that is there is replaced.
    #[arg(short, long, value_name = "OUT.enf", required_unless_present = "app")]
    output: Option<PathBuf>,
    /// Write a folder for any host of static files instead: index.html, the walk, with its parts, and the packed world,
    /// world.enf. The page opens other packed worlds, too: index.html#world=ADDRESS. A folder of this kind that is there is
    /// replaced.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["output", "one_file", "walk"])]
    app: Option<PathBuf>,
    /// Write one file instead of a folder, for servers of ranges.
    #[arg(long)]
    one_file: bool,
    /// Also write a first-person walk for the browser, which loads what comes into view: index.html and its parts in the folder,
    /// or NAME-walk.html beside the file. Any server of files will do, such as `enfilade serve`.
    #[arg(long)]
    walk: bool,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// Puts the world file together again from a packed world, byte for byte.
#[derive(clap::Args)]
pub(crate) struct Unpack {
    /// Packed world: a folder, one file, or the address of one on a server.
    input: PathBuf,
    /// World file to write; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct PackReport {
    file: String,
    /// Sizes in bytes.
    original: u64,
    packed: u64,
    head: u64,
    pieces: usize,
    largest_piece: u64,
}

/// Name of the packed world beside the page of `--app`.
const WORLD: &str = "world.enf";
/// File by which a folder of `--app` is known.
const APP: &str = "walk-code.bin";

pub(crate) fn pack(args: &Pack) -> anyhow::Result<()> {
    let mut outputs = Outputs::reading([&args.input])?;
    let place = args.app.as_ref().or(args.output.as_ref());
    let place = place.context("give -o or --app")?;
    let packed = match &args.app {
        Some(folder) => pack_app(args, folder)?,
        None if args.one_file => pack_file(args, place, &mut outputs)?,
        None => pack_folder(args, place)?,
    };
    report(args, place, &packed, &outputs)
}

/// A packed world and the file of which it was made.
struct Packing {
    packed: PackedWorld,
    glb: Vec<u8>,
}

impl Packing {
    fn of(args: &Pack) -> anyhow::Result<Self> {
        let glb = read(&args.input)?;
        let packed = PackedWorld::pack(&glb).with_context(|| name_of(&args.input))?;
        Ok(Self { packed, glb })
    }
}

/// Writes the page of the walk and the packed world into one folder.
fn pack_app(args: &Pack, folder: &Path) -> anyhow::Result<Packing> {
    refuse_stream("--app", folder, "a folder")?;
    check_folder("--app", folder, APP)?;
    let Packing { packed, glb } = Packing::of(args)?;
    let pieces = packed.files()?.to_vec().into_iter();
    let mut files: Vec<(PathBuf, Vec<u8>)> = pieces
        .map(|(name, bytes)| (Path::new(WORLD).join(name), bytes))
        .collect();
    let page = walk(args, format!("{WORLD}/"), &glb)?.files();
    files.extend(page.into_iter().map(|(name, bytes)| (name.into(), bytes)));
    write_folder(folder, files)?;
    Ok(Packing { packed, glb })
}

fn pack_file(args: &Pack, place: &Path, outputs: &mut Outputs) -> anyhow::Result<Packing> {
    outputs.write("-o", Format::Packed, place)?;
    if args.walk {
        let page = walk_page::beside(place)?;
        outputs.write("--walk", Format::Page, &page)?;
    }
    let Packing { packed, glb } = Packing::of(args)?;
    write_whole(place, &packed.one_file()?)?;
    if args.walk {
        let page = walk_page::beside(place)?;
        let walk = walk(args, walk_page::address(&page, place)?, &glb)?;
        write_whole(&page, walk.html().as_bytes())?;
    }
    Ok(Packing { packed, glb })
}

fn pack_folder(args: &Pack, place: &Path) -> anyhow::Result<Packing> {
    Format::Packed.check("-o", place)?;
    check_folder("-o", place, HEAD)?;
    let Packing { packed, glb } = Packing::of(args)?;
    let mut files = packed.files()?.to_vec();
    if args.walk {
        // The page is in the folder of its world.
        files.extend(walk(args, "./".into(), &glb)?.files());
    }
    write_folder(place, files)?;
    Ok(Packing { packed, glb })
}

fn write_folder<P: AsRef<Path>>(place: &Path, files: Vec<(P, Vec<u8>)>) -> anyhow::Result<()> {
    whole::write_folder(place, files).with_context(|| {
        format!(
            "cannot write {}; choose another place, or free space there",
            place.display()
        )
    })
}

fn report(
    args: &Pack,
    place: &Path,
    Packing { packed, glb }: &Packing,
    outputs: &Outputs,
) -> anyhow::Result<()> {
    let head = packed.head.encode()?.len() as u64;
    let sizes = packed.head.catalog.pieces();
    let report = PackReport {
        file: place.display().to_string(),
        original: glb.len() as u64,
        packed: head + packed.body().len() as u64,
        head,
        pieces: sizes.len(),
        largest_piece: sizes.iter().map(|p| p.n_packed).max().unwrap_or(0),
    };
    if args.json {
        return print_json(outputs.printed(), &report);
    }
    let mb = |n: u64| n as f64 / 1e6;
    let mut out = outputs.printed();
    writeln!(
        out,
        "packed {:.2} MB into {:.2} MB ({:.0} %); the head takes {:.2} MB",
        mb(report.original),
        mb(report.packed),
        100.0 * report.packed as f64 / report.original.max(1) as f64,
        mb(report.head)
    )?;
    writeln!(
        out,
        "{} pieces; the largest takes {:.2} MB",
        report.pieces,
        mb(report.largest_piece)
    )?;
    writeln!(out, "wrote {}", shown(&report.file))?;
    Ok(())
}

/// Returns the walk through the world at an address, with its first picture.
fn walk(args: &Pack, address: String, glb: &[u8]) -> anyhow::Result<WalkPage> {
    let world = decode_glb(glb)?;
    let mut walk = walk_page::of(address, title_of(&args.input), &world)?;
    walk.first = first_picture(&world)?;
    Ok(walk)
}

pub(crate) fn unpack_world(args: &Unpack) -> anyhow::Result<()> {
    let mut outputs = Outputs::reading([&args.input])?;
    outputs.write("-o", Format::World, &args.output)?;
    let packed = PackedPlace::read_all(&args.input)?;
    let glb = packed.unpack().with_context(|| name_of(&args.input))?;
    write_whole(&args.output, &glb)?;
    let written = Written::new(&args.output, &glb);
    if args.json {
        return print_json(outputs.printed(), &written);
    }
    writeln!(outputs.printed(), "{written}")?;
    Ok(())
}
