//! `enfilade decimate`: the Delaunay builder step by step, with a person in the loop.
//!
//! Gjørup 1999, §4.2.3 leaves the last portals to a person who goes through the record of the
//! decimation, back and forth, and overrules it. Commands come from standard input, a line each, so
//! that a script can do the same.

use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::bake::delaunay::{DelaunayConfig, Session, bake_session};
use enfilade::bake::{BakeContext, Silent};
use enfilade::cpg::wire::encode_glb;
use enfilade::geom::scene::Scene;
use enfilade::import::import;

use crate::bake::delaunay::choices_text;
use crate::bake::{print_summary, settings};
use crate::output::{check_target, write_atomically};

/// Shows how the Delaunay builder removes portals, one by one, and lets it be overruled.
#[derive(clap::Args)]
pub(crate) struct Decimate {
    /// Scene files, or a baked world.
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// Reads commands from standard input: `n [K]` forwards, `b [K]` back, `g N` to a step, `l` lists
    /// the steps ahead, `keep` and `join` decide about the next portal for good, `save FILE.toml`,
    /// `bake FILE.glb`, `q`.
    #[arg(long)]
    steps: bool,
    /// Begin after this many steps; where it stops by itself if not given.
    #[arg(long, value_name = "N")]
    at: Option<usize>,
    /// Bake the rooms that are left then.
    #[arg(short, long, value_name = "OUT.glb")]
    output: Option<PathBuf>,
    #[command(flatten)]
    options: settings::BakeOptions,
}

pub(crate) fn run(args: &Decimate) -> anyhow::Result<()> {
    if let Some(path) = &args.output {
        check_target(path)?;
    }
    let settings = settings::resolve(&args.options)?;
    let config = args.options.delaunay.resolve(&settings.watershed)?;
    let imported = import(&args.inputs, &args.options.detail, &settings.import)?;
    let scene = &imported.scene;
    let session = Session::begin(scene, &config, &BakeContext::new(&Silent, None))?;
    let n = session.decimation.steps.len();
    if let Some(at) = args.at.filter(|&at| at > n) {
        bail!("--at {at} is past the last step; there are {n}");
    }
    let mut walk = Walk {
        scene,
        at: args.at.unwrap_or(session.decimation.stop),
        session,
        config,
    };
    let mut out = io::stdout().lock();
    if args.steps {
        walk.show(&mut out)?;
        for line in io::stdin().lock().lines() {
            if !walk.obey(&line?, &mut out)? {
                break;
            }
        }
    } else {
        walk.list(&mut out, 0..n)?;
        walk.show(&mut out)?;
    }
    if let Some(path) = &args.output {
        walk.bake(path, &mut out)?;
    }
    Ok(())
}

struct Walk<'a> {
    scene: &'a Scene,
    session: Session,
    config: DelaunayConfig,
    /// Steps taken.
    at: usize,
}

/// Steps that `l` shows.
const AHEAD: usize = 10;

impl Walk<'_> {
    /// Does what a line says; false to end.
    fn obey(&mut self, line: &str, out: &mut impl Write) -> anyhow::Result<bool> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let n = self.session.decimation.steps.len();
        let count = || words.get(1).map_or(Ok(1), |w| w.parse::<usize>());
        match words.first().copied() {
            None => {}
            Some("q") => return Ok(false),
            Some("n" | "b" | "g") if count().is_err() => {
                writeln!(out, "'{}' is not a number of steps", words[1])?;
            }
            Some("n") => self.at = self.at.saturating_add(count()?).min(n),
            Some("b") => self.at = self.at.saturating_sub(count()?),
            Some("g") => self.at = count()?.min(n),
            Some("l") => self.list(out, self.at..(self.at + AHEAD).min(n))?,
            Some(choice @ ("keep" | "join")) => self.choose(choice == "keep", out)?,
            Some("save") if words.len() == 2 => {
                write_atomically(
                    Path::new(words[1]),
                    choices_text(&self.config.choices).as_bytes(),
                )?;
                writeln!(out, "wrote {}", words[1])?;
            }
            Some("bake") if words.len() == 2 => self.bake(Path::new(words[1]), out)?,
            Some(other) => writeln!(
                out,
                "'{other}' is no command: n [K], b [K], g N, l, keep, join, save FILE.toml, \
                 bake FILE.glb, q"
            )?,
        }
        self.show(out)?;
        Ok(true)
    }

    /// Overrules what the next step does, and decimates anew up to where it then stops.
    fn choose(&mut self, keep: bool, out: &mut impl Write) -> io::Result<()> {
        let Some(step) = self.session.decimation.steps.get(self.at) else {
            return writeln!(out, "no portal is left to decide about");
        };
        let choices = &mut self.config.choices;
        if keep {
            choices.keep.push(step.position);
        } else {
            choices.join.push(step.position);
        }
        self.session.decimate(&self.config);
        self.at = self.session.decimation.stop;
        Ok(())
    }

    fn list(&self, out: &mut impl Write, range: std::ops::Range<usize>) -> io::Result<()> {
        let d = &self.session.decimation;
        for i in range {
            let s = &d.steps[i];
            let p = s.position;
            let kind = if s.is_mouth { "  a branch" } else { "" };
            let stop = if i == d.stop { "  <- stops here" } else { "" };
            writeln!(
                out,
                "{:>6}  weight {:>8.3}  cell {} into {}  at {:.2} {:.2} {:.2}{kind}{stop}",
                i + 1,
                s.weight,
                s.from,
                s.into,
                p.x,
                p.y,
                p.z
            )?;
        }
        Ok(())
    }

    fn show(&self, out: &mut impl Write) -> io::Result<()> {
        let d = &self.session.decimation;
        write!(
            out,
            "{} of {} steps, {} cells left; stops by itself after {}",
            self.at,
            d.steps.len(),
            d.n_cells - self.at,
            d.stop
        )?;
        match d.steps.get(self.at) {
            None => writeln!(out, "; no portal is left"),
            Some(s) => {
                let p = s.position;
                writeln!(
                    out,
                    "; next weighs {:.3}, at {:.2} {:.2} {:.2}",
                    s.weight, p.x, p.y, p.z
                )
            }
        }
    }

    fn bake(&self, path: &Path, out: &mut impl Write) -> anyhow::Result<()> {
        let context = BakeContext::new(&Silent, None);
        let baked = bake_session(self.scene, &self.session, self.at, &self.config, &context)?;
        let bytes =
            encode_glb(&baked.world).context("the baked world breaks an invariant (a bug)")?;
        write_atomically(path, &bytes)?;
        print_summary(out, &baked.world)?;
        writeln!(out, "wrote {}", path.display())?;
        Ok(())
    }
}
