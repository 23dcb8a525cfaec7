//! `enfilade portals`: makes portal textures ahead.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use enfilade::geom::shown;
use enfilade_render::{
    AdapterChoice, PortalTextureMaking, PortalTextureOptions, PortalTextureProgress, Style,
};

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, write_whole};
use crate::progress::StageBar;
use crate::render::{light, light_lamps, open};
use crate::screen::{Warned, print_json};
use enfilade_cli::input::name_of;
use enfilade_cli::values::bytes;

/// Makes the pictures that stand for what lies behind far portals, from wherever a walker may be, so that a program loads them
/// instead of drawing them as it goes. Doors stand as in the model.
#[derive(clap::Args)]
pub(crate) struct Portals {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// File for the textures; `-` for standard output.
    #[arg(short, long, value_name = "OUT.ptx")]
    output: PathBuf,
    /// Largest size of the file: a number and K, M, G or T. The textures wanted from most places are made first.
    #[arg(long, value_name = "BYTES", default_value = "64M", value_parser = bytes)]
    max_bytes: u64,
    /// Width and height of each texture, in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = PortalTextureOptions::default().side, value_parser = clap::value_parser!(u32).range(16..=1024))]
    side: u32,
    /// No shadows, no ambient occlusion, no lamps, the same daylight everywhere: for views that are as plain.
    #[arg(long)]
    plain: bool,
    /// Adapter to draw with: `best`, `gpu`, `software`, or part of a name.
    #[arg(long, default_value = "best", value_name = "NAME")]
    adapter: AdapterChoice,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The printed report.
#[derive(serde::Serialize)]
struct PortalsReport {
    /// `None` for standard output. As text: JSON cannot hold other names.
    file: Option<String>,
    bytes: usize,
    /// Places that were looked from.
    places: usize,
    doorways: usize,
    textures: usize,
    /// Textures for which the budget had no room.
    left_out: usize,
    /// Textures that would show special portals, and are drawn as geometry.
    special: usize,
    seconds: f64,
    adapter: String,
}

pub(crate) fn run(args: &Portals) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::reading([&args.world])?;
    outputs.write("-o", Format::PortalTextures, &args.output)?;
    let start = Instant::now();
    let (world, mut studio) = open(&args.world, &args.adapter)?;
    if !args.plain {
        light(&mut studio, &world)?;
        light_lamps(&mut studio, &world)?;
    }
    studio.add_portal_textures(PortalTextureOptions {
        side: args.side,
        ..PortalTextureOptions::default()
    })?;
    let making = PortalTextureMaking {
        style: Style {
            dark_corners: !args.plain,
            shadows: !args.plain,
            daylight: !args.plain,
            ..Style::default()
        },
        max_bytes: args.max_bytes,
        ..PortalTextureMaking::default()
    };
    let bar = StageBar::new();
    let made = studio.make_portal_textures(&world, &making, &mut |now| {
        show(&bar, now, args.max_bytes);
        ControlFlow::Continue(())
    });
    bar.finish();
    let made = made.with_context(|| name_of(&args.world))?;
    write_whole(&args.output, &made.bytes)?;
    if made.n_textures == 0 {
        let why = if world.graph.portals.is_empty() {
            "the world has no portals"
        } else if made.n_places == 0 {
            "the world has no floor to stand on"
        } else if made.n_left_out > 0 {
            "the budget has no room for any; raise --max-bytes"
        } else {
            "no portal is so far from a place to stand that --side pixels suffice"
        };
        let name = name_of(&args.world);
        writeln!(Warned, "enfilade: {name}: without textures: {why}")?;
    }
    let file =
        (!enfilade_cli::input::is_stream(&args.output)).then(|| args.output.display().to_string());
    let report = PortalsReport {
        file,
        bytes: made.bytes.len(),
        places: made.n_places,
        doorways: made.n_doorways,
        textures: made.n_textures,
        left_out: made.n_left_out,
        special: made.n_special,
        seconds: start.elapsed().as_secs_f64(),
        adapter: studio.gpu.name(),
    };
    if args.json {
        return print_json(outputs.printed(), &report);
    }
    print(outputs.printed(), &report)
}

/// Shows the progress: of places, then of textures, or of the budget if that is used up before.
fn show(bar: &StageBar, now: PortalTextureProgress, max_bytes: u64) {
    match now {
        PortalTextureProgress::Looking { done, all } => {
            if done == 0 {
                bar.start("looking for portals", all as u64);
            }
            bar.set(done as u64);
        }
        PortalTextureProgress::Drawing { done, all, n_bytes } => {
            if done == 0 {
                bar.start("drawing textures", STEPS);
            }
            let shares = [done as f64 / all as f64, n_bytes as f64 / max_bytes as f64];
            let share = shares[0].max(shares[1]).min(1.0);
            bar.set((share * STEPS as f64) as u64);
        }
        _ => {}
    }
}

/// Steps of a bar of shares.
const STEPS: u64 = 1000;

fn print(mut out: Box<dyn Write>, report: &PortalsReport) -> anyhow::Result<()> {
    let r = report;
    writeln!(
        out,
        "{} textures of {} doorways, for {} places where a walker may stand",
        r.textures, r.doorways, r.places
    )?;
    if r.left_out > 0 {
        writeln!(
            out,
            "{} more, wanted from fewer places, are left out: --max-bytes has no room for them",
            r.left_out
        )?;
    }
    if r.special > 0 {
        writeln!(
            out,
            "{} would show mirrors or other special portals, and stay geometry",
            r.special
        )?;
    }
    let file = r.file.as_deref().unwrap_or("to standard output");
    writeln!(
        out,
        "wrote {} ({:.2} MB) in {:.1} s, {}",
        shown(file),
        r.bytes as f64 / 1e6,
        r.seconds,
        r.adapter
    )?;
    out.flush().context("cannot write to standard output")
}
