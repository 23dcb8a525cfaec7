//! `enfilade decimate`: runs the Delaunay builder step by step, under a person's control.
//!
//! Gjørup 1999, §4.2.3 leaves the last portals to a person who goes back and forth through the record of the
//! decimation and overrules it: with commands from standard input, one per line, so that a script can do the same
//! (`walk`), or in a window (`view/reviewing`).

mod walk;

use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use enfilade::bake::{BakeContext, Method, Silent};
use enfilade::internals::bake::delaunay::{Review, Session};

use self::walk::Walk;
use crate::bake::{begin, settings};
use crate::formats::Format;
use crate::output::Outputs;
use crate::reviewed::Reviewed;
use crate::screen::Warned;
#[cfg(feature = "view")]
use crate::view::{ReviewOptions, open_review};
use enfilade_cli::input::{import_scene, is_stream, names_of};
use enfilade_cli::memory::held_memory;

/// Shows how the Delaunay builder removes portals, one by one, and lets you overrule it.
#[derive(clap::Args)]
pub(crate) struct Decimate {
    /// Scene files, or a baked world; `-` for standard input.
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// Read commands from standard input: `n [K]` forwards, `b [K]` back, `g N` to a step, `l` lists the steps ahead,
    /// `keep` and `join` decide about the next portal for good, `undo` goes back to before the last decision, `redo`
    /// makes it again, `save FILE.toml`, `bake FILE.glb`, `help`, `q`.
    #[arg(long)]
    steps: bool,
    /// Begin after this many steps; at the decimation's own stop if not given.
    #[arg(long, value_name = "N")]
    at: Option<usize>,
    /// Bake the rooms left at that step; `-` for standard output. With --window: when F3 asks for it.
    #[arg(short, long, value_name = "OUT.glb")]
    output: Option<PathBuf>,
    /// Print JSON for machines: the steps, the rooms left and the baked world.
    #[arg(long, conflicts_with = "steps")]
    json: bool,
    #[cfg(feature = "view")]
    #[command(flatten)]
    window: ReviewOptions,
    #[command(flatten)]
    options: settings::BakeOptions,
}

impl Decimate {
    /// Returns `true` if a person decides about the steps, in the window or from standard input.
    fn is_at_leisure(&self) -> bool {
        #[cfg(feature = "view")]
        let has_window = self.window.window;
        #[cfg(not(feature = "view"))]
        let has_window = false;
        self.steps || has_window
    }
}

pub(crate) fn run(args: &Decimate) -> anyhow::Result<()> {
    if args.steps && args.options.inputs(&args.inputs).any(|p| is_stream(p)) {
        bail!("--steps reads commands from standard input; give files to read, not '-'");
    }
    let began = Some(Instant::now());
    // At the steps, people take the time that they need; each bake has its own limit.
    let is_at_leisure = args.is_at_leisure();
    if !is_at_leisure {
        begin(&args.options, &args.inputs)?;
    }
    let mut outputs = Outputs::reading(args.options.inputs(&args.inputs))?;
    // Choices that are read are extended, and may be saved to the same file.
    let mut choices = Outputs::reading(args.inputs.iter().chain(&args.options.detail))?;
    if let Some(path) = &args.output {
        outputs.write("-o", Format::World, path)?;
        choices.write("-o", Format::World, path)?;
    }
    #[cfg(feature = "view")]
    let window = {
        let (input, output) = (args.inputs[0].as_path(), args.output.as_deref());
        let known = args.options.delaunay.choices.as_deref();
        args.window.begin(input, output, known, &mut choices)?
    };
    let mut settings = settings::resolve(&args.options)?;
    settings.bake.config.method = Some(Method::Delaunay);
    let mut imported = import_scene(&args.inputs, &args.options.detail, &settings.import)?;
    imported.scene.rooms.extend_from_slice(&settings.bake.names);
    outputs.read(&imported.report.references)?;
    choices.read(&imported.report.references)?;
    let scene = &imported.scene;
    let mut config = settings.bake.config_for(scene);
    config.budget.began = began.filter(|_| !is_at_leisure);
    config.costs.cost.check(&scene.materials)?;
    let context = BakeContext::new(&Silent, None).measured_by(held_memory);
    let session = Session::begin(scene, &config, &context);
    let session = session.with_context(|| names_of(&args.inputs))?;
    let n = session.decimation.steps.len();
    if let Some(at) = args.at.filter(|&at| at > n) {
        bail!("--at {at} is past the last step; there are {n}");
    }
    let mut out = outputs.printed();
    let mut review = Review::new(session, config);
    if let Some(at) = args.at {
        review.go_to(at);
    }
    let reviewed = Reviewed::new(scene, review, outputs, choices);
    #[cfg(feature = "view")]
    if let Some(window) = window {
        return open_review(&args.window, window, reviewed);
    }
    if args.json {
        return reviewed.print_json(out, args.output.as_deref());
    }
    let mut walk = Walk(reviewed);
    if args.steps {
        walk.show(&mut out)?;
        for line in io::stdin().lock().lines() {
            if !walk.obey(&line?, &mut out)? {
                break;
            }
        }
        if !walk.0.is_saved() {
            writeln!(
                Warned,
                "the last decisions were not saved; use `save FILE.toml` before the end"
            )?;
        }
    } else {
        walk.list(&mut out, 0..n)?;
        walk.show(&mut out)?;
    }
    if let Some(path) = &args.output {
        walk.bake(path, &mut out)?;
    }
    out.flush().context("cannot write to standard output")
}
