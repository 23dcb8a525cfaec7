//! An oracle: are two worlds the same up to the numbers of cells and portals?
//!
//! Knows nothing of how either was made. Cells are matched by points that lie in both; then everything is compared by that match.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use enfilade_cpg::{CellId, Portal, World};
use enfilade_geom::{Aabb, DVec3};

use enfilade_demo::Rng;

/// Points that place a cell among those of the other world, and most tries to find them.
const POINTS: [usize; 2] = [24, 4000];
/// Points at which the two locators are compared.
const PROBES: usize = 20_000;
/// Distance from a plane of a locator within which rounding may decide. [Units: wu]
const ROUNDING: f64 = 1e-4;
/// Largest difference of volumes, as a share and absolute. [Units: wu³]
const VOLUME: [f64; 2] = [1e-4, 1e-3];
/// Largest difference of boxes, and of areas. [Units: wu], [Units: wu²]
const PLACE: f32 = 2e-3;

/// Largest difference of the areas of seals: where hair-fine gaps are cut depends on all planes of a scene. [Units: wu²]
const SEALS: f64 = 0.05;

/// Returns the differences of two worlds, one sentence each; empty if they are the same up to numbers and rounding.
///
/// Compares cells (place, volume, kind), 20,000 points, portals (cells, kind, place, area, fittings), the cells that see each
/// structural triangle, those of details, and the area of seals.
#[must_use]
pub fn differences(a: &World, b: &World, seed: u64) -> Vec<String> {
    let mut found = Vec::new();
    let [n, m] = [a, b].map(|w| w.graph.cells.len());
    if n != m {
        found.push(format!("{n} cells, not {m}"));
    }
    let mut rng = Rng::new(seed);
    let cell_of = matched(a, b, &mut rng, &mut found);
    compare_points(a, b, &cell_of, &mut rng, &mut found);
    compare_cells(a, b, &cell_of, &mut found);
    compare_portals(a, b, &cell_of, &mut found);
    compare_triangles(a, b, &cell_of, &mut found);
    compare_details(a, b, &cell_of, &mut found);
    found
}

type Match = BTreeMap<CellId, CellId>;

fn dvec(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

fn matched(a: &World, b: &World, rng: &mut Rng, found: &mut Vec<String>) -> Match {
    let mut out = Match::new();
    let mut taken = BTreeSet::new();
    for id in a.graph.cell_ids() {
        let cell = &a.graph[id];
        let other = if cell.outdoor {
            b.graph.outdoors()
        } else {
            let bounds = Aabb::of_points(&cell.aabb.map(dvec));
            let mut votes: BTreeMap<CellId, usize> = BTreeMap::new();
            let points = (0..POINTS[1]).map(|_| rng.point_in(&bounds));
            let inside = points.filter(|p| a.graph.locator.locate(*p) == Some(id));
            for other in inside
                .take(POINTS[0])
                .filter_map(|p| b.graph.locator.locate(p))
            {
                *votes.entry(other).or_default() += 1;
            }
            votes.into_iter().max_by_key(|v| v.1).map(|v| v.0)
        };
        match other {
            Some(other) if taken.insert(other) => {
                out.insert(id, other);
            }
            _ => found.push(format!("'{}' has no cell of its own", cell.name)),
        }
    }
    out
}

fn compare_points(a: &World, b: &World, cell_of: &Match, rng: &mut Rng, found: &mut Vec<String>) {
    let bounds = a.graph.locator.bounds.expanded(0.5);
    let mut n_off = 0;
    let mut first = None;
    for p in (0..PROBES).map(|_| rng.point_in(&bounds)) {
        let [(x, near), (y, close)] = [a, b].map(|w| w.graph.locator.locate_with_room(p));
        if x.map(|c| cell_of.get(&c).copied()) != y.map(Some)
            && near.max(close) > ROUNDING
            && !is_at_border(a, b, p)
        {
            n_off += 1;
            first.get_or_insert((p, x, y));
        }
    }
    if let Some((p, x, y)) = first {
        found.push(format!(
            "{n_off} points are in other cells, such as {p}: {x:?}, not {y:?}"
        ));
    }
}

/// Returns `true` if a point is within rounding of another cell in either world.
fn is_at_border(a: &World, b: &World, p: DVec3) -> bool {
    [a, b].iter().any(|w| {
        let here = w.graph.locator.locate(p);
        let around = Aabb::new(p, p).expanded(ROUNDING).corners();
        around.iter().any(|q| w.graph.locator.locate(*q) != here)
    })
}

fn compare_cells(a: &World, b: &World, cell_of: &Match, found: &mut Vec<String>) {
    for (&x, &y) in cell_of {
        let [p, q] = [&a.graph[x], &b.graph[y]];
        let [v, w] = [p, q].map(|c| f64::from(c.volume));
        if (v - w).abs() > VOLUME[0] * w + VOLUME[1] {
            found.push(format!("'{}' has {v} m³, not {w}", p.name));
        }
        if (p.outdoor, p.is_void) != (q.outdoor, q.is_void) {
            found.push(format!("'{}' is of another kind", p.name));
        }
        if p.n_triangles != q.n_triangles || p.n_detail_triangles != q.n_detail_triangles {
            let counts = [p, q].map(|c| (c.n_triangles, c.n_detail_triangles));
            found.push(format!(
                "'{}' sees {:?} triangles, not {:?}",
                p.name, counts[0], counts[1]
            ));
        }
        let is_near = |k: usize| (0..3).all(|i| (p.aabb[k][i] - q.aabb[k][i]).abs() < PLACE);
        let is_moved = !is_near(0) || !is_near(1);
        if is_moved && !p.outdoor {
            found.push(format!(
                "'{}' has the box {:?}, not {:?}",
                p.name, p.aabb, q.aabb
            ));
        }
    }
}

fn box_of(p: &Portal) -> [[f32; 3]; 2] {
    let mut out = [[f32::MAX; 3], [f32::MIN; 3]];
    for q in p.pieces.iter().flatten() {
        for k in 0..3 {
            out[0][k] = out[0][k].min(q[k]);
            out[1][k] = out[1][k].max(q[k]);
        }
    }
    out
}

fn compare_portals(a: &World, b: &World, cell_of: &Match, found: &mut Vec<String>) {
    let [n, m] = [a, b].map(|w| w.graph.portals.len());
    if n != m {
        found.push(format!("{n} portals, not {m}"));
    }
    let mut free: BTreeSet<usize> = (0..m).collect();
    let fittings = |w: &World, p: &Portal| -> Vec<String> {
        let mut all: Vec<String> = (p.fittings.iter())
            .map(|f| {
                let detail = &w.details[f.detail as usize];
                format!("{} {:?} {}", detail.name, f.part, f.motion.is_some())
            })
            .collect();
        all.sort();
        all
    };
    for p in &a.graph.portals {
        let cells = p.cells.map(|c| cell_of.get(&c).copied());
        let here = box_of(p);
        let is_same = |k: &&usize| {
            let q = &b.graph.portals[**k];
            let there = box_of(q);
            let its = q.cells.map(Some);
            (its == cells || its == [cells[1], cells[0]])
                && q.kind == p.kind
                && (p.area - q.area).abs() < PLACE
                && here
                    .iter()
                    .flatten()
                    .zip(there.iter().flatten())
                    .all(|(x, y)| (x - y).abs() < PLACE)
                && fittings(a, p) == fittings(b, q)
        };
        match free.iter().find(is_same).copied() {
            Some(k) => {
                free.remove(&k);
            }
            None => found.push(format!(
                "no portal as {:?} {} m² at {here:?} between {:?}",
                p.kind, p.area, p.cells
            )),
        }
    }
    for k in free {
        let p = &b.graph.portals[k];
        found.push(format!(
            "lost the portal {:?} {} m² at {:?} between {:?}",
            p.kind,
            p.area,
            box_of(p),
            p.cells
        ));
    }
}

fn lists(
    w: &World,
    name: impl Fn(CellId) -> Option<CellId>,
) -> HashMap<[u32; 9], Vec<Vec<Option<CellId>>>> {
    let mut out: HashMap<_, Vec<_>> = HashMap::new();
    for batch in w.batches.iter().filter(|b| !b.is_seal) {
        let mut cells: Vec<_> = batch.cells.iter().map(|&c| name(c)).collect();
        cells.sort_unstable();
        for t in batch.primitive.triangles() {
            let bits = std::array::from_fn(|i| (t[i / 3][i % 3] as f32).to_bits());
            let of: &mut Vec<_> = out.entry(bits).or_default();
            of.push(cells.clone());
        }
    }
    out.values_mut().for_each(|v| v.sort());
    out
}

fn compare_triangles(a: &World, b: &World, cell_of: &Match, found: &mut Vec<String>) {
    let [x, y] = [lists(a, |c| cell_of.get(&c).copied()), lists(b, Some)];
    let is_off = |(bits, lists): &(&[u32; 9], &Vec<_>)| y.get(*bits) != Some(*lists);
    let mut off: Vec<_> = x.iter().filter(is_off).collect();
    off.sort();
    if let Some((bits, lists)) = off.first() {
        let at = |i: usize| f32::from_bits(bits[i]);
        let corners = [0, 3, 6].map(|i| [at(i), at(i + 1), at(i + 2)]);
        let other = y.get(*bits);
        found.push(format!(
            "{} triangles are seen from other cells, such as {corners:?}: {lists:?}, not {other:?}",
            off.len()
        ));
    }
    if x.len() != y.len() {
        found.push(format!("{} triangles, not {}", x.len(), y.len()));
    }
    let area = |w: &World| -> f64 {
        let seals = w.batches.iter().filter(|b| b.is_seal);
        let triangles = seals.flat_map(|b| b.primitive.triangles());
        triangles
            .map(|t| 0.5 * enfilade_geom::triangle_area_normal(&t).length())
            .sum()
    };
    if (area(a) - area(b)).abs() > SEALS {
        found.push(format!("{} m² of seals, not {}", area(a), area(b)));
    }
}

fn compare_details(a: &World, b: &World, cell_of: &Match, found: &mut Vec<String>) {
    let all = |w: &World, name: &dyn Fn(CellId) -> Option<CellId>| -> BTreeMap<String, usize> {
        let mut out = BTreeMap::new();
        for d in &w.details {
            let mut cells: Vec<_> = d.cells.iter().map(|&c| name(c)).collect();
            cells.sort_unstable();
            let key = format!("'{}' at {:?} in {cells:?}", d.name, d.transform);
            *out.entry(key).or_default() += 1;
        }
        out
    };
    let x = all(a, &|c| cell_of.get(&c).copied());
    let y = all(b, &Some);
    if let Some((name, _)) = x.iter().find(|(k, n)| y.get(*k) != Some(n)) {
        found.push(format!("no detail as {name}"));
    } else if x != y {
        found.push("details are missing".to_owned());
    }
}
