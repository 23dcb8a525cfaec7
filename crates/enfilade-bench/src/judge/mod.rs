//! `bench judge`: rows on the decisions of a bake. How few numbers they need, that each can say why, and that the verdict on a world
//! doubts the worlds that are wrong.

pub(crate) mod cases;
mod facts;
mod size;

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::process::{bake_command, binary, output_of, scenes_dir, scenes_in, target_dir};
use crate::rows::{Chosen, RowPrinter};
use crate::score::{Score, inspect, list, score_world};

pub(crate) use facts::bench_facts;

/// Buildings whose every cell and portal must say why it is there.
const ASKED: [&str; 3] = ["duplex", "institute", "kit-edc"];

/// The verdict on a world, beside the truth.
#[derive(Clone)]
struct Verdict {
    name: String,
    /// Share of right rooms.
    rooms: f64,
    /// Word of the verdict.
    trust: String,
    /// Share of rooms in doubt.
    doubt: f64,
}

impl Verdict {
    /// Returns word and doubt of what `bake --json` prints.
    fn said(said: &Value) -> (String, f64) {
        let trust = said["verdict"]["trust"].as_str().unwrap_or_default();
        let doubt = said["verdict"]["doubt"].as_f64().unwrap_or(f64::NAN);
        (trust.to_owned(), doubt)
    }
}

/// A building with truth, baked and scored.
struct JudgedWorld {
    verdict: Verdict,
    score: Score,
    /// Decisions, as `inspect --why all --json` prints them.
    whys: Vec<Value>,
    /// Cells and portals of the world.
    n_subjects: usize,
}

impl JudgedWorld {
    /// Bakes and scores a building.
    fn of(dir: &Path) -> anyhow::Result<Self> {
        let name = dir.file_name().unwrap_or_default().to_string_lossy();
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
                name: name.into_owned(),
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

/// Returns the folders of all buildings with truth.
pub(crate) fn buildings() -> Vec<PathBuf> {
    let dir = scenes_dir();
    let beside = ["scenes2", "scenes3"].map(|name| dir.as_ref().map(|d| d.with_file_name(name)));
    let all = dir.iter().chain(beside.iter().flatten());
    let mut all: Vec<PathBuf> = all.flat_map(|d| scenes_in(d)).collect();
    all.retain(|d| d.join("truth.json").is_file());
    all
}

/// Measures the rows; an error if a bar is missed.
pub(crate) fn bench_judge(chosen: &Chosen, is_json: bool) -> anyhow::Result<()> {
    let mut out = RowPrinter::new(is_json);
    size::print(chosen, &mut out)?;
    let is_wanted = ["why", "verdict"].iter().any(|row| chosen.has_row(row));
    let dirs = buildings().into_iter().filter(|dir| {
        let name = dir.file_name().unwrap_or_default().to_string_lossy();
        is_wanted && chosen.has_scene(&name)
    });
    let judged: Vec<JudgedWorld> = dirs
        .map(|dir| JudgedWorld::of(&dir))
        .collect::<anyhow::Result<_>>()?;
    for j in judged
        .iter()
        .filter(|j| chosen.has_row("why") && ASKED.contains(&j.verdict.name.as_str()))
    {
        let n = j.n_silent();
        let note = format!("of {} cells and portals", j.n_subjects);
        out.print(
            "why",
            &j.verdict.name,
            Some(n as f64),
            "0",
            Some(n == 0),
            &note,
        );
    }
    if chosen.has_row("verdict") {
        let mut verdicts: Vec<Verdict> = judged.iter().map(|j| j.verdict.clone()).collect();
        let cases = cases::verdicts()?.into_iter();
        verdicts.extend(cases.filter(|v| chosen.has_scene(&v.name)));
        print_verdicts(&verdicts, &mut out);
    }
    out.finish()
}

/// Prints the rows of the verdict: whether the worlds that it doubts are those that are wrong.
fn print_verdicts(judged: &[Verdict], out: &mut RowPrinter) {
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
