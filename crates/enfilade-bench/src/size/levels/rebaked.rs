//! Worlds rebaked after random edits, against bakes of the edited scenes.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use enfilade::World;
use enfilade::bake::rebake::rebake;
use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade::geom::scene::Scene;
use enfilade::import::{ImportOptions, import};
use enfilade_testkit::{Edit, Rng, TowerParams, differences, edited, office_tower, with_cupboards};

use crate::kept::Kept;
use crate::process::scenes;
use crate::rows::Figure;

/// Edits of each scene, unless the environment gives another number.
const EDITS: usize = 20;
/// Variable with that number.
const NUMBER: &str = "ENFILADE_EDITS";
/// Cupboards put into each scene.
const CUPBOARDS: usize = 24;

/// The outcome of all edits of a scene.
#[derive(Default)]
struct Edits {
    n: usize,
    /// Edits after which the graph is another than that of a bake.
    off: Vec<String>,
    /// Number of scenes baked whole, by reason.
    whole: BTreeMap<String, usize>,
    /// To rebake, and to bake whole. [Units: s]
    seconds: [f64; 2],
}

fn base(name: &str) -> anyhow::Result<Scene> {
    let scene = match name.strip_prefix("tower-") {
        Some(n) => office_tower(&TowerParams::with_rooms(n.parse()?, 1)).scene,
        None => {
            let dirs = scenes();
            let dir = dirs
                .iter()
                .find(|d| d.file_name().is_some_and(|n| n == name));
            let file = dir.context("no such scene")?.join("scene.glb");
            import(&[file], &[], &ImportOptions::default())?.scene
        }
    };
    Ok(with_cupboards(&scene, CUPBOARDS, 1))
}

fn edits(name: &str) -> anyhow::Result<Arc<Edits>> {
    static KNOWN: Kept<Edits> = Kept::new();
    KNOWN.get(name, || measured(name))
}

fn measured(name: &str) -> anyhow::Result<Edits> {
    let n = std::env::var(NUMBER)
        .ok()
        .map(|n| n.parse())
        .transpose()?
        .unwrap_or(EDITS);
    let base = base(name)?;
    let config = BakeConfig::default();
    let context = || BakeContext::new(&Silent, None);
    let old: World = bake(&base, &config, &context())?.world;
    let mut out = Edits::default();
    for i in 0..n {
        let edit = [Edit::WallOut, Edit::DoorCut, Edit::Moved][i % 3];
        let mut rng = Rng::stream(1, i as u64);
        let Some((scene, _)) = edited(&base, edit, &mut rng) else {
            continue;
        };
        let start = Instant::now();
        let rebaked = rebake(&old, &scene, &config, &context())?;
        let quick = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let whole = bake(&scene, &config, &context())?.world;
        let slow = start.elapsed().as_secs_f64();
        out.n += 1;
        out.seconds[0] += quick;
        out.seconds[1] += slow;
        let off = differences(&rebaked.world, &whole, 1);
        if let Some(why) = rebaked.whole {
            *out.whole.entry(why.to_string()).or_default() += 1;
        }
        if let Some(first) = off.first() {
            out.off.push(format!("edit {i}, {edit:?}: {first}"));
        }
    }
    Ok(out)
}

/// Edits after which the rebaked world is not that of a bake.
pub(super) fn same(name: &str) -> anyhow::Result<Figure> {
    let edits = edits(name)?;
    let first = edits.off.first().cloned().unwrap_or_default();
    let note = format!(
        "of {} edits; baked whole: {:?} {first}",
        edits.n, edits.whole
    );
    Ok(Figure::new(edits.off.len() as f64, 0.0, note))
}

/// Time of rebakes as a share of that of bakes.
pub(super) fn time(name: &str) -> anyhow::Result<Figure> {
    let edits = edits(name)?;
    let [quick, slow] = edits.seconds;
    let note = format!(
        "{:.3} s each on average, not {:.3} s; of {} edits baked whole: {:?}",
        quick / edits.n as f64,
        slow / edits.n as f64,
        edits.n,
        edits.whole
    );
    Ok(Figure::new(quick / slow, 1.0 / 20.0, note))
}
