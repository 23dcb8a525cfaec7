//! A review in text: a command a line, and a reply to each.

use std::io::{self, Write};
use std::path::Path;

use enfilade::internals::bake::delaunay::{Choice, Decision};

use crate::bake::print_summary;
use crate::formats::Format;
use crate::reviewed::{Reviewed, in_walk, weight_words};
use crate::screen::{At, write_lines};

const HELP: &str = "\
n [K]           K steps forwards, one if not given
b [K]           back
g N             to after step N
l               lists the steps ahead
keep, join      decides about the next portal, for good: it stays, or it goes first
undo            goes back to before the last decision of this walk
redo            makes it again
save FILE.toml  writes all decisions; `bake --method delaunay --choices FILE.toml` applies them
bake FILE.glb   writes a world of the cells that are left now
q               ends";

/// Steps listed by `l`.
const AHEAD: usize = 10;

pub(super) struct Walk<'a>(pub(super) Reviewed<'a>);

impl Walk<'_> {
    /// Executes a command line; returns `false` to end.
    pub(super) fn obey(&mut self, line: &str, out: &mut impl Write) -> anyhow::Result<bool> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let review = &mut self.0.review;
        let n = review.steps().len();
        let count = || words.get(1).map_or(Ok(1), |w| w.parse::<usize>());
        match words.first().copied() {
            None => {}
            Some("q") => return Ok(false),
            Some("n" | "b" | "g") if count().is_err() => {
                writeln!(out, "'{}' is not a number of steps", words[1])?;
            }
            Some("g") if words.len() < 2 => writeln!(out, "'g' needs the number of a step")?,
            Some("n") => review.go_to(review.at().saturating_add(count()?)),
            Some("b") => review.go_to(review.at().saturating_sub(count()?)),
            Some("g") => review.go_to(count()?),
            Some("l") => {
                let at = review.at();
                self.list(out, at..(at + AHEAD).min(n))?;
            }
            Some("keep") => self.choose(Choice::Keep, out)?,
            Some("join") => self.choose(Choice::Join, out)?,
            Some("undo") => match review.undo() {
                Some(Decision { position, .. }) => {
                    let at = At(position.to_array());
                    writeln!(out, "took back the decision at {at}")?;
                }
                None => writeln!(out, "no decision of this walk is left to take back")?,
            },
            Some("redo") => match review.redo() {
                Some(decision) => decided(decision, out)?,
                None => writeln!(out, "no decision of this walk was taken back last")?,
            },
            // A failed write is reported, and does not end the walk.
            Some("save") if words.len() == 2 => match self.0.save("save", Path::new(words[1])) {
                Ok(()) => writeln!(
                    out,
                    "wrote {0}; `enfilade bake --method delaunay --choices {0}` applies it",
                    words[1]
                )?,
                Err(error) => writeln!(out, "{error:#}")?,
            },
            Some("bake") if words.len() == 2 => {
                let path = Path::new(words[1]);
                let outputs = &self.0.outputs;
                let allowed = in_walk("bake", path)
                    .and_then(|()| outputs.clone().write("bake", Format::World, path));
                if let Err(error) = allowed.and_then(|()| self.bake(path, out)) {
                    writeln!(out, "{error:#}")?;
                }
            }
            Some(file @ ("save" | "bake")) => {
                writeln!(out, "'{file}' needs the name of one file to write")?;
            }
            Some("help") => write_lines(out, &HELP)?,
            Some(other) => writeln!(out, "'{other}' is not a command; `help` lists them")?,
        }
        self.show(out)?;
        Ok(true)
    }

    /// Overrules the next step.
    fn choose(&mut self, choice: Choice, out: &mut impl Write) -> io::Result<()> {
        let review = &mut self.0.review;
        if review.next_step().is_none() {
            return writeln!(out, "no portal is left to decide about");
        }
        match review.decide_next(choice) {
            Some(decision) => decided(decision, out),
            None => writeln!(out, "that is decided already"),
        }
    }

    pub(super) fn list(
        &self,
        out: &mut impl Write,
        range: std::ops::Range<usize>,
    ) -> io::Result<()> {
        let review = &self.0.review;
        for i in range {
            let s = &review.steps()[i];
            let stop = if i == review.stop() {
                "  <- stops here"
            } else {
                ""
            };
            writeln!(
                out,
                "{:>6}  {:<24}  cell {} into {}  at {}{stop}",
                i + 1,
                weight_words(s.weight, s.is_mouth),
                s.from,
                s.into,
                At(s.position.to_array()),
            )?;
        }
        Ok(())
    }

    pub(super) fn show(&self, out: &mut impl Write) -> io::Result<()> {
        let review = &self.0.review;
        let [n_cells, n_others] = review.count_rooms();
        write!(
            out,
            "{} of {} steps, {n_cells} cells left indoors besides {n_others} crevices and insides of walls; \
             stops by itself after {}",
            review.at(),
            review.steps().len(),
            review.stop()
        )?;
        match review.next_step() {
            None => writeln!(out, "; no portal is left"),
            Some(s) => {
                let weight = weight_words(s.weight, s.is_mouth);
                writeln!(out, "; next: {weight}, at {}", At(s.position.to_array()))
            }
        }
    }

    pub(super) fn bake(&self, path: &Path, out: &mut impl Write) -> anyhow::Result<()> {
        let (baked, written) = self.0.bake_to(path)?;
        for note in &baked.notes {
            write_lines(out, note)?;
        }
        print_summary(out, &baked.world)?;
        writeln!(out, "{written}")?;
        Ok(())
    }
}

fn decided(decision: Decision, out: &mut impl Write) -> io::Result<()> {
    let verb = match decision.choice {
        Choice::Keep => "keeps",
        Choice::Join => "joins",
    };
    let at = At(decision.position.to_array());
    writeln!(out, "{verb} the portal at {at}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Outputs;
    use enfilade::bake::delaunay::Choices;
    use enfilade::bake::{BakeConfig, BakeContext, Method, Silent};
    use enfilade::internals::bake::delaunay::{Review, Session};
    use enfilade_testkit::{Variant, gjorup_rooms};

    /// The replies of the walk to some lines.
    fn said(walk: &mut Walk<'_>, lines: &[&str]) -> String {
        let mut out = Vec::new();
        for line in lines {
            assert!(walk.obey(line, &mut out).unwrap());
        }
        String::from_utf8(out).unwrap()
    }

    fn state(walk: &Walk<'_>) -> (usize, usize) {
        let review = &walk.0.review;
        (review.at(), review.count_rooms()[0])
    }

    // Covers T5.
    #[test]
    fn a_walk_forwards_and_back_overruled_taken_back_and_saved() {
        let scene = gjorup_rooms(Variant::Optimised, [0.0; 3]).scene;
        let config = BakeConfig::of(Method::Delaunay);
        let session = Session::begin(&scene, &config, &BakeContext::new(&Silent, None)).unwrap();
        let stop = session.decimation.stop;
        let review = Review::new(session, config);
        let files = Outputs::default();
        let mut walk = Walk(Reviewed::new(&scene, review, files.clone(), files));
        let n_cells = 4;
        assert_eq!(state(&walk), (stop, n_cells));
        said(&mut walk, &["n"]);
        assert_eq!(state(&walk), (stop + 1, n_cells - 1));
        said(&mut walk, &["b", "b 1000000", "g 0"]);
        assert_eq!(walk.0.review.at(), 0);
        said(&mut walk, &["g 100000000"]);
        assert_eq!(walk.0.review.at(), walk.0.review.steps().len());
        assert!(said(&mut walk, &["keep"]).contains("no portal is left to decide about"));
        assert!(walk.0.is_saved());

        walk.0.review.go_to(stop);
        let text = said(&mut walk, &["join"]);
        assert!(text.starts_with("joins the portal at "), "{text}");
        assert_eq!(state(&walk).1, n_cells - 1);
        assert_eq!(walk.0.review.choices().join.len(), 1);
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
        assert!(!walk.0.is_saved());
        assert!(said(&mut walk, &[&save(&inside)]).contains("--choices"));
        assert!(walk.0.is_saved());
        assert!(std::fs::read_to_string(&inside).unwrap().contains("join"));
        std::fs::remove_dir_all(&folder).unwrap();

        assert!(said(&mut walk, &["undo"]).starts_with("took back the decision at "));
        assert_eq!(*walk.0.review.choices(), Choices::default());
        assert_eq!(state(&walk), (stop, n_cells));
        assert!(!walk.0.is_saved());
        assert!(said(&mut walk, &["undo"]).contains("no decision"));
        assert!(said(&mut walk, &["redo"]).starts_with("joins the portal at "));
        assert_eq!(state(&walk).1, n_cells - 1);
        assert!(said(&mut walk, &["redo"]).contains("no decision"));
        said(&mut walk, &["undo"]);
        // A kept portal outlasts all that have a weight.
        said(&mut walk, &["keep"]);
        let last = walk.0.review.steps().last().unwrap();
        assert_eq!(weight_words(last.weight, last.is_mouth), "kept by decision");
        let n = walk.0.review.steps().len();
        walk.0.review.go_to(n - 1);
        assert!(said(&mut walk, &["keep"]).contains("decided already"));

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
