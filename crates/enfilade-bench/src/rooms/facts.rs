//! `bench facts`: all facts of all decisions of all buildings with truth, labelled right or wrong, and how far the number of each rule
//! can move before a decision changes.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::judge::{JudgedWorld, judged};
use crate::rows::Chosen;

/// A decision on an opening between two cells, with its label.
struct Labelled<'a> {
    scene: &'a str,
    why: &'a Value,
    /// `Some` if the truth tells.
    is_right: Option<bool>,
}

/// Prints the decisions as CSV, or a table of the rules.
pub(crate) fn bench_facts(chosen: &Chosen, is_csv: bool) -> anyhow::Result<()> {
    let judged = judged(chosen)?;
    let all: Vec<Labelled<'_>> = judged.iter().flat_map(labelled).collect();
    if is_csv {
        print_csv(&all);
    } else {
        print_rules(&all);
    }
    Ok(())
}

/// Labels the decisions of a building: a portal that an opening of the truth matches is right.
fn labelled(judged: &JudgedWorld) -> impl Iterator<Item = Labelled<'_>> {
    let right: BTreeSet<u64> = judged.score.matches.iter().map(|m| m.portal).collect();
    judged.whys.iter().map(move |why| Labelled {
        scene: &judged.verdict.name,
        why,
        is_right: why["portal"].as_u64().map(|p| right.contains(&p)),
    })
}

fn print_csv(all: &[Labelled<'_>]) {
    let names: BTreeSet<&String> = (all.iter())
        .flat_map(|l| {
            l.why["facts"]
                .as_object()
                .into_iter()
                .flat_map(|f| f.keys())
        })
        .collect();
    let header: Vec<&str> = names.iter().map(|n| n.as_str()).collect();
    println!("scene,reason,right,limit,margin,x,y,z,{}", header.join(","));
    for l in all {
        let at = |k: usize| l.why["position"][k].as_f64().unwrap_or(f64::NAN);
        let right = l.is_right.map_or("", |is| if is { "1" } else { "0" });
        let facts = names
            .iter()
            .map(|name| match &l.why["facts"][name.as_str()] {
                Value::Null => String::new(),
                value => value.to_string(),
            });
        let facts: Vec<String> = facts.collect();
        println!(
            "{},{},{right},{},{},{:.2},{:.2},{:.2},{}",
            l.scene,
            l.why["reason"].as_str().unwrap_or_default(),
            l.why["limit"],
            l.why["margin"],
            at(0),
            at(1),
            at(2),
            facts.join(",")
        );
    }
}

/// Prints for each reason its decisions, those that match no opening of the truth, and the closest one.
fn print_rules(all: &[Labelled<'_>]) {
    let mut by_reason: BTreeMap<&str, Vec<&Labelled<'_>>> = BTreeMap::new();
    for l in all {
        let reason = l.why["reason"].as_str().unwrap_or_default();
        by_reason.entry(reason).or_default().push(l);
    }
    println!("| reason | decisions | labelled | not in the truth | least margin | in |");
    println!("| --- | ---: | ---: | ---: | ---: | --- |");
    for (reason, of) in by_reason {
        let margin = |l: &&Labelled<'_>| l.why["margin"].as_f64().unwrap_or(1.0);
        let closest = of
            .iter()
            .copied()
            .min_by(|a, b| margin(a).total_cmp(&margin(b)));
        let n_labelled = of.iter().filter(|l| l.is_right.is_some()).count();
        let n_wrong = of.iter().filter(|l| l.is_right == Some(false)).count();
        let (least, scene) = closest.map_or((1.0, ""), |l| (margin(&l), l.scene));
        println!(
            "| {reason} | {} | {n_labelled} | {n_wrong} | {least:.3} | {scene} |",
            of.len()
        );
    }
}
