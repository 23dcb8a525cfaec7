//! Options that read the input in another way: tried before they are proposed, since a wrong one sends people astray. Each costs a
//! bake.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write as _};
use std::time::{Duration, Instant};

use enfilade::bake::{BakeContext, Silent, bake};
use enfilade::cpg::World;
use enfilade::geom::scene::Scene;
use enfilade::import::{FileReport, ImportReport, LeftOut};
use enfilade::internals::import::unnamed_helpers;
use enfilade_cli::input::{import_scene, is_stream};
use enfilade_cli::memory::held_memory;
use enfilade_report::{InputDoubt, Verdict};

use super::{Bake, Readied, found, settings};
use crate::screen::Warned;

/// Least time of a trial; it gets as much as the bake took.
const LEAST: Duration = Duration::from_secs(2);
/// Most names of objects in a proposal.
const MOST_NAMES: usize = 8;
/// Most reasons for leaving things out that are tried on their own.
const MOST_REASONS: usize = 3;
/// Units that stand for `--unit UNIT`.
const UNITS: [&str; 4] = ["mm", "cm", "in", "ft"];

/// Returns the verdict on a world that a bake of `readied` made in a time, with advice that was tried, and reports the doubts about its
/// input.
pub(super) fn verdict(
    args: &Bake,
    readied: &Readied,
    world: &World,
    time: Duration,
) -> io::Result<Verdict> {
    let mut trials = Trials::new(args, &readied.report, readied.scene.is_open_world, time);
    let mut said = found::input_doubts(&readied.report);
    let mut hint = found::hint(&readied.report);
    let mut verdict = trials.verdict(world, &mut said, &mut hint);
    let doubts = [
        trials.unnamed_helpers(&readied.scene, &verdict),
        trials.left_out(&readied.report, &verdict),
    ];
    if doubts.iter().any(Option::is_some) {
        said.extend(doubts.into_iter().flatten());
        verdict = trials.verdict(world, &mut said, &mut hint);
    }
    for text in said.iter().map(|doubt| &doubt.text).chain(&hint) {
        writeln!(Warned, "{text}")?;
    }
    Ok(verdict)
}

/// Bakes with other options.
struct Trials<'a> {
    args: &'a Bake,
    /// The input states its unit and its axes, and nobody exports them wrong.
    is_known: bool,
    is_open_world: bool,
    time: Duration,
    tried: BTreeMap<String, Option<Verdict>>,
}

impl<'a> Trials<'a> {
    /// Prepares trials beside a bake that took a time.
    fn new(args: &'a Bake, report: &ImportReport, is_open_world: bool, time: Duration) -> Self {
        let is_known = |f: &FileReport| f.tells_unit() || f.format == "IFC";
        Self {
            args,
            is_known: report.files.iter().all(is_known),
            is_open_world,
            time: time.max(LEAST),
            tried: BTreeMap::new(),
        }
    }

    /// Returns the verdict on a world, with the options that make a better one. Of the doubts about its input, and of a hint, those
    /// stay that propose nothing, or what makes a better world.
    fn verdict(
        &mut self,
        world: &World,
        said: &mut Vec<InputDoubt>,
        hint: &mut Option<String>,
    ) -> Verdict {
        let first = Verdict::of(world, said);
        said.retain(|doubt| self.holds(&doubt.text, &first));
        let first = Verdict::of(world, said);
        *hint = hint.take().filter(|hint| self.holds(hint, &first));
        let mut verdict = Verdict::of(world, said);
        verdict.advise(|option| self.better(option, &first));
        verdict
    }

    fn holds(&mut self, text: &str, than: &Verdict) -> bool {
        let as_is = [
            "m",
            if self.args.options.other_axis() == "z" {
                "y"
            } else {
                "z"
            },
        ];
        let mut options = options_in(text);
        options.retain(|option| {
            as_is
                .iter()
                .all(|value| !option.ends_with(&format!(" {value}")))
        });
        options.is_empty() || options.iter().any(|option| self.helps(option, than))
    }

    /// Returns the doubt about boxes that may be volumes of an engine, if a world without them deserves more trust.
    fn unnamed_helpers(&mut self, scene: &Scene, than: &Verdict) -> Option<InputDoubt> {
        let boxes = unnamed_helpers(scene).into_iter();
        let names = boxes.map(|i| scene.objects[i].name.clone()).collect();
        let option = self.helps_to_name("--detail-name", &names, than)?;
        let why = "boxes of a material of their own may be volumes of an engine, such as triggers; the rooms are better without them";
        Some(doubt(why, &option))
    }

    /// Returns the doubt about what was left out, if a world with it deserves more trust: with all, or else with what one reason left out.
    fn left_out(&mut self, report: &ImportReport, than: &Verdict) -> Option<InputDoubt> {
        let names = |l: &LeftOut| l.names.iter().cloned().collect();
        let names: Vec<BTreeSet<String>> = report.left_out.iter().map(names).collect();
        let all = names.iter().flatten().cloned().collect();
        let sets = [&all].into_iter().chain(&names).take(1 + MOST_REASONS);
        let option =
            { sets }.find_map(|names| self.helps_to_name("--structural-name", names, than))?;
        let why = "what was left out may be part of the building; the rooms are better with it";
        Some(doubt(why, &option))
    }

    /// Returns an option for some names, if a world made with it deserves more trust than one that is not good.
    fn helps_to_name(
        &mut self,
        option: &str,
        names: &BTreeSet<String>,
        than: &Verdict,
    ) -> Option<String> {
        let is_told = |name: &String| !name.is_empty() && !name.contains('\'');
        if than.is_good() || !(1..=MOST_NAMES).contains(&names.len()) || !names.iter().all(is_told)
        {
            return None;
        }
        let names: Vec<String> = names
            .iter()
            .map(|name| format!("{option} '{name}'"))
            .collect();
        let options = names.join(" ");
        self.helps(&options, than).then_some(options)
    }

    /// Returns the option to propose instead of one that the verdict has, if any.
    fn better(&mut self, option: &str, than: &Verdict) -> Option<String> {
        match option {
            "--unit UNIT" => {
                let mut best: Option<String> = None;
                for unit in UNITS.map(|unit| format!("--unit {unit}")) {
                    if !self.helps(&unit, than) {
                        continue;
                    }
                    let verdict = |option: &String| self.tried[option].as_ref();
                    let is_better = best.as_ref().is_none_or(|best| {
                        let [own, best] = [&unit, best].map(verdict);
                        own.zip(best)
                            .is_some_and(|(own, best)| own.is_better_than(best))
                    });
                    if is_better {
                        best = Some(unit);
                    }
                }
                best
            }
            "--up z" => {
                let up = self.args.options.other_axis();
                let option = format!("--up {up}");
                self.helps(&option, than).then_some(option)
            }
            _ if self.args.options.with(option).is_some() => {
                self.helps(option, than).then(|| option.to_owned())
            }
            // Only a person can fill it in.
            _ => Some(option.to_owned()),
        }
    }

    /// Returns `true` if a bake with the option deserves more trust, and loses no room if it only reads the input in another way.
    fn helps(&mut self, option: &str, than: &Verdict) -> bool {
        let is_reading = option.starts_with("--unit") || option.starts_with("--up");
        if self.is_known && is_reading || self.args.inputs.iter().any(|p| is_stream(p)) {
            return false;
        }
        if !self.tried.contains_key(option) {
            let verdict = self.bake_with(option);
            self.tried.insert(option.to_owned(), verdict);
        }
        let tried = self.tried[option].as_ref();
        let keeps = |v: &&Verdict| !is_reading || v.n_rooms() >= than.n_rooms();
        tried.filter(keeps).is_some_and(|v| v.is_better_than(than))
    }

    fn bake_with(&self, option: &str) -> Option<Verdict> {
        let options = self.args.options.with(option)?;
        let settings = settings::resolve(&options).ok()?;
        let mut imported =
            import_scene(&self.args.inputs, &options.detail, &settings.import).ok()?;
        if imported.report.refusal().is_some() {
            return None;
        }
        let scene = &mut imported.scene;
        scene.rooms.extend_from_slice(&settings.bake.names);
        scene.is_open_world |= self.is_open_world;
        let mut config = settings.bake.config_for(scene);
        config.budget.began = Some(Instant::now());
        config.budget.time = Some(self.time);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads.map_or(0, usize::from))
            .build()
            .ok()?;
        let context = BakeContext::new(&Silent, None).measured_by(held_memory);
        let baked = pool.install(|| bake(scene, &config, &context)).ok()?;
        Some(Verdict::of(
            &baked.world,
            &found::input_doubts(&imported.report),
        ))
    }
}

/// Returns a doubt about the input that an option settles.
fn doubt(why: &str, option: &str) -> InputDoubt {
    InputDoubt {
        text: format!("{why} (try {option})"),
        is_about_up: false,
    }
}

/// Returns the options about unit and axis that a text proposes.
fn options_in(text: &str) -> Vec<String> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let pairs = words.windows(2).filter(|w| {
        let name = w[0].trim_start_matches(['(', '\'', '`']);
        name == "--unit" || name == "--up"
    });
    let option = |w: &[&str]| {
        let value = w[1].trim_end_matches(|c: char| !c.is_alphanumeric());
        format!("{} {value}", w[0].trim_start_matches(['(', '\'', '`']))
    };
    pairs.map(option).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_found_in_sentences() {
        let text = "doors are high (try --unit ft), or, as it lies, `--up z`; see --upper 3";
        assert_eq!(options_in(text), ["--unit ft", "--up z"]);
        assert!(options_in("nothing to do").is_empty());
    }
}
