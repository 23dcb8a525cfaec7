//! `enfilade decimate`: runs the Delaunay builder step by step, under a person's control.
//!
//! Gjørup 1999, §4.2.3 leaves the last portals to a person who goes back and forth through the record of the
//! decimation and overrules it. Commands come from standard input, one per line, so that a script can do the same.

use std::io::{self, BufRead, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use enfilade::bake::delaunay::{JOINED, Session, Step};
use enfilade::bake::{BakeConfig, BakeContext, BakeOutput, Method, Silent, bake_session};
use enfilade::cpg::wire::encode_glb;
use enfilade::geom::scene::Scene;

use crate::bake::delaunay::choices_text;
use crate::bake::{Summary, begin, print_summary, settings};
use crate::formats::Format;
use crate::output::{Outputs, Written, refuse_stream, write_whole};
use crate::screen::{Warned, print_json, write_lines};
use enfilade_cli::input::{import_scene, is_stream, names_of};
use enfilade_cli::memory::held_memory;

/// Shows how the Delaunay builder removes portals, one by one, and lets you overrule it.
#[derive(clap::Args)]
pub(crate) struct Decimate {
    /// Scene files, or a baked world; `-` for standard input.
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// Read commands from standard input: `n [K]` forwards, `b [K]` back, `g N` to a step, `l` lists the steps ahead,
    /// `keep` and `join` decide about the next portal for good, `undo` reverts the last decision, `save FILE.toml`,
    /// `bake FILE.glb`, `help`, `q`.
    #[arg(long)]
    steps: bool,
    /// Begin after this many steps; at the decimation's own stop if not given.
    #[arg(long, value_name = "N")]
    at: Option<usize>,
    /// Bake the rooms left at that step; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: Option<PathBuf>,
    /// Print JSON for machines: the steps, the rooms left and the baked world.
    #[arg(long, conflicts_with = "steps")]
    json: bool,
    #[command(flatten)]
    options: settings::BakeOptions,
}

pub(crate) fn run(args: &Decimate) -> anyhow::Result<()> {
    if args.steps && args.options.inputs(&args.inputs).any(|p| is_stream(p)) {
        bail!("--steps reads commands from standard input; give files to read, not '-'");
    }
    let began = Some(Instant::now());
    // At the steps, people take the time that they need; each bake has its own limit.
    if !args.steps {
        begin(&args.options, &args.inputs)?;
    }
    let mut outputs = Outputs::reading(args.options.inputs(&args.inputs))?;
    // Choices that are read are extended, and may be saved to the same file.
    let mut choices = Outputs::reading(args.inputs.iter().chain(&args.options.detail))?;
    if let Some(path) = &args.output {
        outputs.write("-o", Format::World, path)?;
        choices.write("-o", Format::World, path)?;
    }
    let mut settings = settings::resolve(&args.options)?;
    settings.bake.config.method = Some(Method::Delaunay);
    let mut imported = import_scene(&args.inputs, &args.options.detail, &settings.import)?;
    imported.scene.rooms.extend_from_slice(&settings.bake.names);
    outputs.read(&imported.report.references)?;
    choices.read(&imported.report.references)?;
    let scene = &imported.scene;
    let mut config = settings.bake.config_for(scene);
    config.budget.began = began.filter(|_| !args.steps);
    config.costs.cost.check(&scene.materials)?;
    let context = BakeContext::new(&Silent, None).measured_by(held_memory);
    let session = Session::begin(scene, &config, &context);
    let session = session.with_context(|| names_of(&args.inputs))?;
    let n = session.decimation.steps.len();
    if let Some(at) = args.at.filter(|&at| at > n) {
        bail!("--at {at} is past the last step; there are {n}");
    }
    let mut out = outputs.printed();
    let mut walk = Walk {
        scene,
        at: args.at.unwrap_or(session.decimation.stop),
        session,
        config,
        made: Vec::new(),
        is_saved: true,
        outputs,
        choices,
    };
    if args.json {
        return walk.print_json(out, args.output.as_deref());
    }
    if args.steps {
        walk.show(&mut out)?;
        for line in io::stdin().lock().lines() {
            if !walk.obey(&line?, &mut out)? {
                break;
            }
        }
        if !walk.is_saved {
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

/// The weight of a step's portal, or a word where it is not a ratio.
fn weight_of(step: &Step) -> String {
    match step.weight {
        f64::INFINITY => "kept by decision".to_owned(),
        w if w <= JOINED => "joined by decision".to_owned(),
        w if w < 0.0 => "a crevice".to_owned(),
        w if step.is_mouth => format!("weight {w:.3}, a branch"),
        w => format!("weight {w:.3}"),
    }
}

/// The output of `--json`.
#[derive(serde::Serialize)]
struct WalkReport {
    steps: Vec<StepReport>,
    /// Steps taken, and steps until the decimation stops by itself.
    at: usize,
    stop: usize,
    cells_indoors: usize,
    others: usize,
    /// The world baked with `-o`.
    baked: Option<Baked>,
}

#[derive(serde::Serialize)]
struct StepReport {
    /// In words.
    weight: String,
    from: usize,
    into: usize,
    position: [f64; 3],
}

#[derive(serde::Serialize)]
struct Baked {
    #[serde(flatten)]
    written: Written,
    #[serde(flatten)]
    summary: Summary,
    notes: Vec<String>,
}

struct Walk<'a> {
    scene: &'a Scene,
    session: Session,
    config: BakeConfig,
    /// Steps taken.
    at: usize,
    /// Decisions of this walk in order, `true` to keep.
    made: Vec<bool>,
    /// The decisions are in a file.
    is_saved: bool,
    /// Files that no world may overwrite, and files that no choices may overwrite.
    outputs: Outputs,
    choices: Outputs,
}

const HELP: &str = "\
n [K]           K steps forwards, one if not given
b [K]           back
g N             to after step N
l               lists the steps ahead
keep, join      decides about the next portal, for good: it stays, or it goes first
undo            takes the last decision of this walk back
save FILE.toml  writes all decisions; `bake --method delaunay --choices FILE.toml` applies them
bake FILE.glb   writes a world of the cells that are left now
q               ends";

/// Refuses standard output, which the replies of a walk go to.
fn in_walk(option: &str, path: &Path) -> anyhow::Result<()> {
    refuse_stream(option, path, "a file beside the replies")
}

/// Steps listed by `l`.
const AHEAD: usize = 10;

impl Walk<'_> {
    /// Executes a command line; returns `false` to end.
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
            Some("g") if words.len() < 2 => writeln!(out, "'g' needs the number of a step")?,
            Some("n") => self.at = self.at.saturating_add(count()?).min(n),
            Some("b") => self.at = self.at.saturating_sub(count()?),
            Some("g") => self.at = count()?.min(n),
            Some("l") => self.list(out, self.at..(self.at + AHEAD).min(n))?,
            Some(choice @ ("keep" | "join")) => self.choose(choice == "keep", out)?,
            Some("undo") => self.undo(out)?,
            // A failed write is reported, and does not end the walk.
            Some("save") if words.len() == 2 => match self.save(Path::new(words[1])) {
                Ok(()) => writeln!(
                    out,
                    "wrote {0}; `enfilade bake --method delaunay --choices {0}` applies it",
                    words[1]
                )?,
                Err(error) => writeln!(out, "{error:#}")?,
            },
            Some("bake") if words.len() == 2 => {
                let path = Path::new(words[1]);
                let allowed = in_walk("bake", path)
                    .and_then(|()| self.outputs.clone().write("bake", Format::World, path));
                if let Err(error) = allowed.and_then(|()| self.bake(path, out)) {
                    writeln!(out, "{error:#}")?;
                }
            }
            Some(file @ ("save" | "bake")) => {
                writeln!(out, "'{file}' needs the name of one file to write")?;
            }
            Some("help" | "h" | "?") => write_lines(out, &HELP)?,
            Some(other) => writeln!(out, "'{other}' is not a command; `help` lists them")?,
        }
        self.show(out)?;
        Ok(true)
    }

    /// Overrules the next step, and decimates again up to the new stop.
    fn choose(&mut self, keep: bool, out: &mut impl Write) -> io::Result<()> {
        let Some(step) = self.session.decimation.steps.get(self.at) else {
            return writeln!(out, "no portal is left to decide about");
        };
        let p = step.position;
        let choices = &mut self.config.delaunay.choices;
        if keep {
            choices.keep.push(p);
        } else {
            choices.join.push(p);
        }
        self.made.push(keep);
        self.decided();
        writeln!(
            out,
            "{} the portal at {:.2} {:.2} {:.2}",
            if keep { "keeps" } else { "joins" },
            p.x,
            p.y,
            p.z
        )
    }

    fn undo(&mut self, out: &mut impl Write) -> io::Result<()> {
        let choices = &mut self.config.delaunay.choices;
        let taken = match self.made.pop() {
            Some(true) => choices.keep.pop(),
            Some(false) => choices.join.pop(),
            None => return writeln!(out, "no decision of this walk is left to take back"),
        };
        self.decided();
        let p = taken.unwrap_or_default();
        writeln!(
            out,
            "took back the decision at {:.2} {:.2} {:.2}",
            p.x, p.y, p.z
        )
    }

    /// Decimates again, up to the new stop.
    fn decided(&mut self) {
        self.is_saved = false;
        self.session.decimate(&self.config);
        self.at = self.session.decimation.stop;
    }

    fn save(&mut self, path: &Path) -> anyhow::Result<()> {
        in_walk("save", path)?;
        self.choices.clone().write("save", Format::Choices, path)?;
        write_whole(path, choices_text(&self.config.delaunay.choices).as_bytes())?;
        self.is_saved = true;
        Ok(())
    }

    /// The number of rooms left, which are the indoor cells of a bake, and of other cells: crevices and the insides
    /// of walls.
    fn left(&self) -> [usize; 2] {
        self.session.count_rooms(self.at, &self.config)
    }

    fn list(&self, out: &mut impl Write, range: std::ops::Range<usize>) -> io::Result<()> {
        let d = &self.session.decimation;
        for i in range {
            let s = &d.steps[i];
            let p = s.position;
            let stop = if i == d.stop { "  <- stops here" } else { "" };
            writeln!(
                out,
                "{:>6}  {:<24}  cell {} into {}  at {:.2} {:.2} {:.2}{stop}",
                i + 1,
                weight_of(s),
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
        let [n_cells, n_others] = self.left();
        write!(
            out,
            "{} of {} steps, {n_cells} cells left indoors besides {n_others} crevices and insides of walls; \
             stops by itself after {}",
            self.at,
            d.steps.len(),
            d.stop
        )?;
        match d.steps.get(self.at) {
            None => writeln!(out, "; no portal is left"),
            Some(s) => {
                let p = s.position;
                let weight = weight_of(s);
                writeln!(out, "; next: {weight}, at {:.2} {:.2} {:.2}", p.x, p.y, p.z)
            }
        }
    }

    fn bake(&self, path: &Path, out: &mut impl Write) -> anyhow::Result<()> {
        let (baked, written) = self.bake_to(path)?;
        for note in &baked.notes {
            write_lines(out, note)?;
        }
        print_summary(out, &baked.world)?;
        writeln!(out, "{written}")?;
        Ok(())
    }

    fn bake_to(&self, path: &Path) -> anyhow::Result<(BakeOutput, Written)> {
        let context = BakeContext::new(&Silent, None);
        let baked = bake_session(self.scene, &self.session, self.at, &self.config, &context)?;
        let bytes =
            encode_glb(&baked.world).context("the baked world breaks an invariant (a bug)")?;
        write_whole(path, &bytes)?;
        let written = Written::new(path, &bytes);
        Ok((baked, written))
    }

    fn print_json(&self, out: impl Write, output: Option<&Path>) -> anyhow::Result<()> {
        let d = &self.session.decimation;
        let [cells_indoors, others] = self.left();
        let steps = d.steps.iter().map(|s| StepReport {
            weight: weight_of(s),
            from: s.from as usize,
            into: s.into as usize,
            position: s.position.to_array(),
        });
        let baked = output.map(|path| self.bake_to(path)).transpose()?;
        let report = WalkReport {
            steps: steps.collect(),
            at: self.at,
            stop: d.stop,
            cells_indoors,
            others,
            baked: baked.map(|(baked, written)| Baked {
                written,
                summary: Summary::of(&baked.world),
                notes: baked.notes,
            }),
        };
        print_json(out, &report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::bake::delaunay::Choices;
    use enfilade_testkit::{Variant, gjorup_rooms};

    /// The replies of the walk to some lines.
    fn said(walk: &mut Walk<'_>, lines: &[&str]) -> String {
        let mut out = Vec::new();
        for line in lines {
            assert!(walk.obey(line, &mut out).unwrap());
        }
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn a_walk_forwards_and_back_overruled_taken_back_and_saved() {
        let scene = gjorup_rooms(Variant::Optimised, [0.0; 3]).scene;
        let config = BakeConfig::of(Method::Delaunay);
        let session = Session::begin(&scene, &config, &BakeContext::new(&Silent, None)).unwrap();
        let stop = session.decimation.stop;
        let mut walk = Walk {
            scene: &scene,
            session,
            config,
            at: stop,
            made: Vec::new(),
            is_saved: true,
            outputs: Outputs::default(),
            choices: Outputs::default(),
        };
        let n_cells = walk.left()[0];
        assert_eq!(n_cells, 4);
        said(&mut walk, &["n"]);
        assert_eq!(walk.left()[0], n_cells - 1);
        said(&mut walk, &["b", "b 1000000", "g 0"]);
        assert_eq!(walk.at, 0);
        said(&mut walk, &["g 100000000"]);
        assert_eq!(walk.at, walk.session.decimation.steps.len());
        assert!(said(&mut walk, &["keep"]).contains("no portal is left to decide about"));
        assert!(walk.is_saved);

        walk.at = stop;
        let text = said(&mut walk, &["join"]);
        assert!(text.starts_with("joins the portal at "), "{text}");
        assert_eq!(walk.left()[0], n_cells - 1);
        assert_eq!(walk.config.delaunay.choices.join.len(), 1);
        let folder = std::env::temp_dir().join(format!("enfilade-walk-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let inside = folder.join("choices.toml");
        let nowhere = folder.join("none").join("choices.toml");
        let save = |p: &Path| format!("save {}", p.display());
        let text = said(&mut walk, &[&save(&nowhere)]);
        assert!(
            text.contains("cannot write") && !text.contains("-o"),
            "{text}"
        );
        assert!(!walk.is_saved);
        assert!(said(&mut walk, &[&save(&inside)]).contains("--choices"));
        assert!(walk.is_saved);
        assert!(std::fs::read_to_string(&inside).unwrap().contains("join"));
        std::fs::remove_dir_all(&folder).unwrap();

        said(&mut walk, &["undo"]);
        assert_eq!(walk.config.delaunay.choices, Choices::default());
        assert_eq!((walk.at, walk.left()[0]), (stop, n_cells));
        assert!(said(&mut walk, &["undo"]).contains("no decision"));
        // A kept portal outlasts all that have a weight.
        said(&mut walk, &["keep"]);
        let last = walk.session.decimation.steps.last().unwrap();
        assert_eq!(weight_of(last), "kept by decision");

        for (line, answer) in [
            ("save", "'save' needs the name of one file"),
            ("bake a b", "'bake' needs the name of one file"),
            ("n x", "'x' is not a number of steps"),
            ("g", "'g' needs the number of a step"),
            ("walk", "'walk' is not a command; `help`"),
            ("help", "undo "),
            ("", "steps, "),
        ] {
            let text = said(&mut walk, &[line]);
            assert!(text.contains(answer), "{line}: {text}");
        }
        assert!(!walk.obey("q", &mut Vec::new()).unwrap());
    }
}
