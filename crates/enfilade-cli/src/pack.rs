//! `enfilade pack` and `enfilade unpack`: a world in pieces, for loading what comes into view.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context;
use enfilade::cpg::wire::decode_glb;
use enfilade::geom::shown;
use enfilade::internals::stream::first_picture;
use enfilade::stream::{HEAD, PackedPlace, PackedWorld};
use enfilade::whole;
use enfilade_report::WalkPage;

use crate::formats::Format;
use crate::output::{Outputs, Written, check_folder, write_whole};
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
    #[arg(short, long, value_name = "OUT.enf")]
    output: PathBuf,
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

pub(crate) fn pack(args: &Pack) -> anyhow::Result<()> {
    let mut outputs = Outputs::reading([&args.input])?;
    if args.one_file {
        outputs.write("-o", Format::Packed, &args.output)?;
        if args.walk {
            let page = walk_page::beside(&args.output)?;
            outputs.write("--walk", Format::Page, &page)?;
        }
    } else {
        Format::Packed.check("-o", &args.output)?;
        check_folder(&args.output, HEAD)?;
    }
    let glb = read(&args.input)?;
    let packed = PackedWorld::pack(&glb).with_context(|| name_of(&args.input))?;
    if args.one_file {
        write_whole(&args.output, &packed.one_file()?)?;
        if args.walk {
            let page = walk_page::beside(&args.output)?;
            let walk = walk(args, walk_page::address(&page, &args.output)?, &glb)?;
            write_whole(&page, walk.html().as_bytes())?;
        }
    } else {
        let mut files = packed.files()?.to_vec();
        if args.walk {
            // The page is in the folder of its world.
            files.extend(walk(args, "./".into(), &glb)?.files());
        }
        whole::write_folder(&args.output, files).with_context(|| {
            format!(
                "cannot write {}; choose another place, or free space there",
                args.output.display()
            )
        })?;
    }
    let head = packed.head.encode()?.len() as u64;
    let sizes = packed.head.catalog.pieces();
    let report = PackReport {
        file: args.output.display().to_string(),
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
