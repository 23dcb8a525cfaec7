//! Rows of `bench judge` on the decisions of a bake. How few numbers they need, that each can say why, and that the verdict on a world
//! doubts the worlds that are wrong.

use std::path::Path;

use serde_json::Value;

use super::cases::{Found, SmallCase, judged_cases};
use super::score::{Score, inspect, list, score_world};
use super::worlds::buildings;
use crate::measure::file_name;
use crate::process::{bake_command, binary, output_of, target_dir};
use crate::rows::{Chosen, RowPrinter};

/// Buildings whose every cell and portal must say why it is there.
const ASKED: [&str; 3] = ["duplex", "institute", "kit-edc"];

/// The verdict on a world, beside the truth.
#[derive(Clone)]
pub(super) struct Verdict {
    pub(super) name: String,
    /// Share of right rooms.
    rooms: f64,
    /// Word of the verdict.
    trust: String,
    /// Share of rooms in doubt.
    doubt: f64,
}

impl Verdict {
    /// Bakes a small case. One that is refused has no room, and all doubt.
    fn of_case(case: &SmallCase, file: &Path) -> anyhow::Result<Self> {
        let found = Found::of(case, file)?;
        let (trust, doubt) = match found.world {
            Some(_) => Self::said(&found.report),
            None => ("refused".to_owned(), 1.0),
        };
        Ok(Self {
            name: format!("case {}", file_name(file)),
            rooms: found.share_of_rooms(case),
            trust,
            doubt,
        })
    }

    /// Returns word and doubt of what `bake --json` prints.
    fn said(said: &Value) -> (String, f64) {
        let trust = said["verdict"]["trust"].as_str().unwrap_or_default();
        let doubt = said["verdict"]["doubt"].as_f64().unwrap_or(f64::NAN);
        (trust.to_owned(), doubt)
    }
}

/// A building with truth, baked and scored.
pub(super) struct JudgedWorld {
    pub(super) verdict: Verdict,
    pub(super) score: Score,
    /// Decisions, as `inspect --why all --json` prints them.
    pub(super) whys: Vec<Value>,
    /// Cells and portals of the world.
    n_subjects: usize,
}

impl JudgedWorld {
    /// Bakes and scores a building.
    fn of(dir: &Path) -> anyhow::Result<Self> {
        let name = file_name(dir);
        let world = target_dir().join(format!("judge-{name}.glb"));
        let said = output_of(bake_command(dir, &world).arg("--json"), None)?;
        let said: Value = serde_json::from_str(&said)?;
        let mut asking = std::process::Command::new(binary("enfilade"));
        asking.arg("inspect").arg(&world);
        let whys = output_of(asking.args(["--why", "all", "--json"]), None)?;
        let whys: Value = serde_json::from_str(&whys)?;
        let graph = inspect(&world)?;
        let score = score_world(dir, &world, &graph)?;
        let (trust, doubt) = Verdict::said(&said);
        Ok(Self {
            verdict: Verdict {
                name,
                rooms: score.figures[0].unwrap_or(f64::NAN),
                trust,
                doubt,
            },
            score,
            whys: list(&whys["whys"]).to_vec(),
            n_subjects: list(&graph["cells"]).len() + list(&graph["portals"]).len(),
        })
    }

    /// Returns the number of cells and portals without an answer.
    fn n_silent(&self) -> usize {
        let mut subjects: Vec<(u64, u64)> = (self.whys.iter())
            .filter_map(|why| {
                let [cell, portal] = ["cell", "portal"].map(|key| why[key].as_u64());
                cell.map(|c| (0, c)).or(portal.map(|p| (1, p)))
            })
            .collect();
        subjects.sort_unstable();
        subjects.dedup();
        self.n_subjects - subjects.len()
    }
}

/// Returns the chosen buildings with truth, baked and scored.
pub(super) fn judged(chosen: &Chosen) -> anyhow::Result<Vec<JudgedWorld>> {
    let dirs = buildings(chosen).into_iter();
    dirs.map(|dir| JudgedWorld::of(&dir)).collect()
}

/// Prints the rows of answers and of the verdict.
pub(super) fn run(out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    let [has_why, has_verdict] = ["why", "verdict"].map(|row| out.chosen.has_row(row));
    if !has_why && !has_verdict {
        return Ok(());
    }
    let judged = judged(out.chosen)?;
    let asked = |j: &&JudgedWorld| has_why && ASKED.contains(&j.verdict.name.as_str());
    for j in judged.iter().filter(asked) {
        let n = j.n_silent();
        let note = format!("of {} cells and portals", j.n_subjects);
        let ok = Some(n == 0);
        out.print("why", &j.verdict.name, Some(n as f64), "0", ok, &note);
    }
    if has_verdict {
        let mut verdicts: Vec<Verdict> = judged.into_iter().map(|j| j.verdict).collect();
        for (case, file) in judged_cases() {
            let verdict = Verdict::of_case(case, &file)?;
            verdicts.extend(Some(verdict).filter(|v| out.chosen.has_scene(&v.name)));
        }
        print_verdicts(&verdicts, out);
    }
    Ok(())
}

/// Prints the rows of the verdict: whether the worlds that it doubts are those that are wrong.
fn print_verdicts(judged: &[Verdict], out: &mut RowPrinter<'_>) {
    for j in judged {
        let is_wrong = j.trust == "good" && j.rooms < 0.8 || j.trust == "low" && j.rooms > 0.95;
        let note = format!("{}; {:.2} of rooms right", j.trust, j.rooms);
        let bar = "not good below 0.8, not low above 0.95";
        out.print(
            "verdict: doubt",
            &j.name,
            Some(j.doubt),
            bar,
            Some(!is_wrong),
            &note,
        );
    }
    let pairs: Vec<(f64, f64)> = judged.iter().map(|j| (j.doubt, 1.0 - j.rooms)).collect();
    if pairs.len() > 2 {
        let value = rank_correlation(&pairs);
        let note = format!("{} buildings and cases", pairs.len());
        out.print(
            "verdict: rank correlation",
            "all",
            Some(value),
            ">= 0.7",
            Some(value >= 0.7),
            &note,
        );
    }
}

/// Returns Spearman's rank correlation; equal values have the mean of their ranks.
fn rank_correlation(pairs: &[(f64, f64)]) -> f64 {
    let ranks = |values: Vec<f64>| -> Vec<f64> {
        let below = |v: f64| values.iter().filter(|&&o| o < v).count() as f64;
        let same = |v: f64| values.iter().filter(|&&o| o.total_cmp(&v).is_eq()).count() as f64;
        values
            .iter()
            .map(|&v| below(v) + 0.5 * (same(v) - 1.0))
            .collect()
    };
    let a = ranks(pairs.iter().map(|p| p.0).collect());
    let b = ranks(pairs.iter().map(|p| p.1).collect());
    let mean = 0.5 * (pairs.len() as f64 - 1.0);
    let product = |x: &[f64], y: &[f64]| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mean) * (y - mean)).sum()
    };
    product(&a, &b) / (product(&a, &a) * product(&b, &b)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rank_correlation_is_one_for_equal_orders_and_minus_one_for_opposite_ones() {
        let up = [(0.1, 1.0), (0.2, 5.0), (0.9, 7.0)];
        assert!((rank_correlation(&up) - 1.0).abs() < 1e-12);
        let down = up.map(|(a, b)| (a, -b));
        assert!((rank_correlation(&down) + 1.0).abs() < 1e-12);
        let tied = [(0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (1.0, 1.0)];
        assert!((rank_correlation(&tied) - 1.0).abs() < 1e-12);
    }
}
