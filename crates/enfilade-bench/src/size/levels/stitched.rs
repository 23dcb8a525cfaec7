//! Levels put together, against bakes of their merged meshes; and the promises of the result.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use enfilade::cpg::{CellId, Portal};
use enfilade::geom::{Aabb, DVec3, Winding};
use enfilade::import::{ImportOptions, decode_gltf, export_glb};
use enfilade::{World, save};
use enfilade_testkit::Rng;
use serde_json::Value;

use super::scenes::level;
use crate::kept::Kept;
use crate::process::{binary, target_dir};
use crate::rows::{Figure, baked};

/// Points that place a cell among those of the other world.
const POINTS: usize = 60;
/// Largest distance of two portals in one doorway along its normal, as thick as two walls, and across it. [Units: wu]
const ALONG: f64 = 0.45;
const ACROSS: f64 = 0.02;
/// Largest difference of areas of portals, and of volumes of cells without what doorways take, as shares.
const AREA: f64 = 0.01;
const VOLUME: f64 = 0.1;
/// Lines and pictures of `verify`.
const RAYS: &str = "300000";
const VIEWS: &str = "40";

/// A level put together, and baked whole.
struct Both {
    stitched: World,
    whole: World,
    n_instances: usize,
    /// To flatten it, and to bake it whole. [Units: s]
    seconds: [f64; 2],
}

fn both(scene: &str) -> anyhow::Result<Arc<Both>> {
    static KNOWN: Kept<Both> = Kept::new();
    KNOWN.get(scene, || Both::of(scene))
}

impl Both {
    fn of(scene: &str) -> anyhow::Result<Self> {
        let level = level(scene)?;
        let start = Instant::now();
        let stitched = level.level.flattened()?;
        let flattened = start.elapsed().as_secs_f64();
        // As `bake` reads it, in the order of its file.
        let merged = export_glb(&level.merged());
        let merged = decode_gltf(&merged, &ImportOptions::default())?.scene;
        let start = Instant::now();
        let whole = baked(&merged)?;
        Ok(Self {
            stitched,
            whole,
            n_instances: level.level.len(),
            seconds: [flattened, start.elapsed().as_secs_f64()],
        })
    }
}

fn dvec(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Returns the cell of the other world in which most points of each cell are.
fn matched(from: &World, to: &World) -> BTreeMap<CellId, CellId> {
    let mut rng = Rng::new(1);
    let mut found = BTreeMap::new();
    for (id, cell) in from.graph.indoor_cells() {
        let bounds = Aabb::of_points(&cell.aabb.map(dvec));
        let mut votes: BTreeMap<CellId, usize> = BTreeMap::new();
        let points = (0..20 * POINTS).map(|_| rng.point_in(&bounds));
        let inside = points.filter(|p| from.graph.locator.locate(*p) == Some(id));
        for p in inside.take(POINTS) {
            if let Some(other) = to.graph.locator.locate(p) {
                *votes.entry(other).or_default() += 1;
            }
        }
        let best = votes.into_iter().max_by_key(|vote| vote.1);
        if let Some((other, _)) = best.filter(|best| !to.graph[best.0].outdoor) {
            found.insert(id, other);
        }
    }
    if let (Some(a), Some(b)) = (from.graph.outdoors(), to.graph.outdoors()) {
        found.insert(a, b);
    }
    found
}

/// Cells of either world without a cell of the other at its place and of its volume.
pub(super) fn cells(scene: &str) -> anyhow::Result<Figure> {
    let both = both(scene)?;
    let Both {
        stitched, whole, ..
    } = &*both;
    let found = matched(stitched, whole);
    let taken: BTreeSet<CellId> = found.values().copied().collect();
    let is_off = |(a, b): (&CellId, &CellId)| {
        let volumes = [stitched.graph[*a].volume, whole.graph[*b].volume].map(f64::from);
        !stitched.graph[*a].outdoor && (volumes[0] - volumes[1]).abs() > VOLUME * volumes[1]
    };
    let n_off = found.iter().filter(|pair| is_off(*pair)).count();
    let [n, n_whole] = [stitched, whole].map(|w| w.graph.cells.len());
    // One that two share is not found by one of them.
    let n_lost = (n - taken.len()) + (n_whole - taken.len());
    let note = format!(
        "{} pieces: {n} cells, {n_whole} baked whole; {n_off} of other volume; put together in {:.3} s, baked in {:.1} s",
        both.n_instances, both.seconds[0], both.seconds[1]
    );
    Ok(Figure::new((n_lost + n_off) as f64, 0.0, note))
}

fn middle(portal: &Portal) -> DVec3 {
    Winding::new(portal.outline.iter().copied().map(dvec).collect()).centroid()
}

/// Portals of either world without one of the other in the same doorway, of the same area, between the same cells.
pub(super) fn portals(scene: &str) -> anyhow::Result<Figure> {
    let both = both(scene)?;
    let Both {
        stitched, whole, ..
    } = &*both;
    let found = matched(stitched, whole);
    let mut free: BTreeSet<usize> = (0..whole.graph.portals.len()).collect();
    let mut n_lost = 0;
    for portal in &stitched.graph.portals {
        let cells = portal.cells.map(|c| found.get(&c).copied());
        let (at, normal) = (middle(portal), dvec(portal.normal));
        let is_same = |k: &&usize| {
            let other = &whole.graph.portals[**k];
            let off = middle(other) - at;
            let along = off.dot(normal);
            let its = other.cells.map(Some);
            let is_between = its == cells || its == [cells[1], cells[0]];
            let areas = [portal.area, other.area].map(f64::from);
            is_between
                && along.abs() <= ALONG
                && (off - normal * along).length() <= ACROSS
                && (areas[0] - areas[1]).abs() <= AREA * areas[1]
        };
        match free.iter().find(is_same).copied() {
            Some(k) => {
                free.remove(&k);
            }
            None => n_lost += 1,
        }
    }
    let [n, n_whole] = [stitched, whole].map(|w| w.graph.portals.len());
    let note = format!("{n} portals, {n_whole} baked whole");
    Ok(Figure::new((n_lost + free.len()) as f64, 0.0, note))
}

/// Returns the report of `enfilade verify` on a level put together.
fn verified(scene: &str) -> anyhow::Result<Value> {
    let folder = target_dir().join("constructive");
    std::fs::create_dir_all(&folder)?;
    let file = folder.join(format!("{scene}.glb"));
    save(&file, &both(scene)?.stitched)?;
    let mut command = Command::new(binary("enfilade"));
    command.arg("verify").arg(&file);
    command.args([
        "--rays",
        RAYS,
        "--views",
        VIEWS,
        "--adapter",
        "software",
        "--json",
    ]);
    let done = command
        .output()
        .context("`cargo build -p enfilade-cli` first")?;
    serde_json::from_slice(&done.stdout)
        .with_context(|| String::from_utf8_lossy(&done.stderr).into_owned())
}

/// Broken promises: unsealed segments, incomplete triangles, missed hits, and problems of the file.
pub(super) fn promises(scene: &str) -> anyhow::Result<Figure> {
    static KNOWN: Kept<Value> = Kept::new();
    let report = KNOWN.get(scene, || verified(scene))?;
    let number = |pointer: &str| {
        let value = report.pointer(pointer).and_then(Value::as_f64);
        value.with_context(|| pointer.to_owned())
    };
    let problems = report["problems"].as_array().map_or(0, Vec::len);
    let broken = number("/unsealed")?
        + number("/incomplete")?
        + number("/hidden")?
        + number("/sight/missed")?;
    let note = format!(
        "{} portals crossed by lines, {} triangles met, {} hits in views",
        number("/sealed/crossings")?,
        number("/complete/judged")?,
        number("/sight/hits")?
    );
    Ok(Figure::new(broken + problems as f64, 0.0, note))
}

/// Pixels that culling by portals changes.
pub(super) fn pixels(scene: &str) -> anyhow::Result<Figure> {
    static KNOWN: Kept<Value> = Kept::new();
    let report = KNOWN.get(scene, || verified(scene))?;
    let exact = &report["exact"];
    let drawn: Vec<f64> = exact["triangles"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Value::as_f64)
        .collect();
    let share = drawn
        .first()
        .zip(drawn.get(1))
        .map_or(0.0, |(a, b)| 100.0 * a / b);
    let value = exact["differing"].as_f64().context("pixels")?;
    let note = format!(
        "of {}; {share:.2} % of the triangles drawn",
        exact["pixels"]
    );
    Ok(Figure::new(value, 0.0, note))
}
