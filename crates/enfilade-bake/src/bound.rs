//! Keeps the drawing cost of cells within bounds: cuts cells above the bound, and merges cells below it.
//!
//! After Lefebvre & Hornus 2003, §2.1 step 4 and §3, with the same [`CostModel`]: cells above the bound are cut first,
//! since merging never makes a cell cheaper. A cut is a plane. The candidates are planes of the cell's own polygons,
//! axis-aligned planes and planes of any direction; the one whose dearer side is cheapest is used.
//!
//! Departures from the paper: the finished world is cut ([`crate::edit`]), so that the bound holds for every builder,
//! and each part's cost is that of what it really sees. Planes of polygons replace the tree's portals that belong to no
//! separator: those lie in the same planes. The outdoors has no walls to cut along, and beyond the scene's box it is
//! one piece; on request, the air within the box is separated from the air beyond, and then cut like any cell.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use enfilade_cpg::{CellId, World};
use enfilade_geom::{Aabb, DVec3, Plane, Winding, shown};

use crate::complex::poly;
use crate::edit::{Added, cut_cell};
use crate::simplify::{
    CostModel, SimplifySettings, Surface, cost_of_cell, costs, simplify, surfaces_of,
};

/// Planes of each kind tried for each cut.
const TRIES: usize = 12;
/// Planes tried on the world itself, best first. The order is by an upper bound on the cost, so the first usually
/// works.
const CUTS_TRIED: usize = 4;
/// Greatest cost of each part of a cut, as a share of the whole: more gains nothing, and cuts would not end.
const GAIN: f64 = 0.9;
/// Greatest number of cuts of one cell, as a multiple of the parts that even cuts would make.
const CUTS_PER_PART: f64 = 4.0;

/// A world, and how its cells meet the bounds.
#[derive(Clone, Debug)]
pub struct Bounded {
    /// The world.
    pub world: World,
    /// Number of cuts made.
    pub n_cuts: usize,
    /// The requested upper bound.
    pub bound: Option<f64>,
    /// Least and greatest cost of a cell.
    pub costs: [f64; 2],
    /// Cells above the bound, dearest first.
    pub over: Vec<Over>,
}

/// A cell above the bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Over {
    /// The cell.
    pub cell: CellId,
    /// Its cost.
    pub cost: f64,
    /// The reason why it was not cut.
    pub reason: Reason,
}

/// The reason why a cell above the bound was not cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It is the outdoors, and cutting that was not requested.
    Outdoors,
    /// One object in it exceeds the bound by itself, and no plane tried makes both parts cheaper by a tenth.
    Object,
    /// No plane tried makes both parts cheaper by a tenth: the same things are seen from all of it.
    Shared,
    /// It needs more cuts than any attainable bound.
    ManyCuts,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Outdoors => "it is the outdoors, which is cut only on request (split_outdoors)",
            Self::Object => "one object in it costs more by itself",
            Self::Shared => "no plane tried makes both parts cheaper by a tenth",
            Self::ManyCuts => "it is cut into too many parts already",
        })
    }
}

/// Cells above the bound that a note lists.
const TOLD: usize = 5;

impl Bounded {
    /// Returns a message about the bounds that are not met; `None` if all are.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let bound = self.bound?;
        if self.over.is_empty() {
            return None;
        }
        let cells = &self.world.graph.cells;
        let mut text = format!(
            "{} of {} cells cost more than {bound}:",
            self.over.len(),
            cells.len()
        );
        for o in self.over.iter().take(TOLD) {
            let cell = &self.world.graph[o.cell];
            let [low, high] = cell.aabb;
            let [x, y, z] = [0, 1, 2].map(|k| low[k].midpoint(high[k]));
            text += &format!(
                "\n  {} about {x:.2} {y:.2} {z:.2} costs {:.0}: {}",
                shown(&cell.name),
                o.cost,
                o.reason
            );
        }
        if self.over.len() > TOLD {
            text += &format!("\n  and {} more", self.over.len() - TOLD);
        }
        Some(text)
    }
}

/// Cuts the cells of a world that cost more than the upper bound, then merges cells as [`simplify`] does.
///
/// Keeps every promise. Deterministic for any number of threads. Time: for each cut, a bake of the one cell (several if
/// cuts fail) and a pass over the whole world.
#[must_use]
pub fn keep_bounds(world: &World, settings: &SimplifySettings) -> Bounded {
    let mut cutting = Cutting {
        world: Cow::Borrowed(world),
        n_cuts: 0,
        over: BTreeMap::new(),
        random: Sequence(SEED),
    };
    if let Some(bound) = settings.max_cost {
        for (cell, cost) in (0..).map(CellId).zip(costs(world, &settings.cost)) {
            if cost > bound {
                cutting.cut(cell, bound, settings);
            }
        }
    }
    let simple = simplify(&cutting.world, settings);
    let mut over: Vec<Over> = (cutting.over.iter())
        .map(|(cell, &reason)| {
            let cell = simple.cell_of[cell.0 as usize];
            let cost = cost_of_cell(&simple.world, cell, &settings.cost);
            Over { cell, cost, reason }
        })
        .collect();
    over.sort_by(|a, b| b.cost.total_cmp(&a.cost).then(a.cell.cmp(&b.cell)));
    let mut out = Bounded {
        world: simple.world,
        n_cuts: cutting.n_cuts,
        bound: settings.max_cost,
        costs: [simple.min_cost, simple.max_cost],
        over,
    };
    if settings.max_cost.is_some() {
        let counts = &mut out.world.graph.statistics.counts;
        // Add to the cuts of earlier runs: the count shows readers of the file that costs made portals.
        *counts.entry("cost_cuts".to_owned()).or_default() += out.n_cuts as f64;
        counts.insert("cells_over_cost".to_owned(), out.over.len() as f64);
    }
    out
}

/// Keeps a baked world within bounds, if any are given. Adds unmet ones to the notes, and the settings to the
/// provenance.
pub(crate) fn keep_costs(world: &mut World, notes: &mut Vec<String>, asked: &SimplifySettings) {
    let nothing = SimplifySettings {
        cost: asked.cost.clone(),
        outdoors: asked.outdoors,
        ..SimplifySettings::default()
    };
    if *asked == nothing {
        return;
    }
    let bounded = keep_bounds(world, asked);
    notes.extend(bounded.note());
    *world = bounded.world;
    let settings = &mut world.graph.provenance.settings;
    settings.extend(asked.to_settings());
}

struct Cutting<'a> {
    world: Cow<'a, World>,
    n_cuts: usize,
    /// Cells that stay above the bound, and why.
    over: BTreeMap<CellId, Reason>,
    random: Sequence,
}

impl Cutting<'_> {
    /// Cuts a cell and its parts until none costs more than `bound`, as long as cuts help.
    fn cut(&mut self, cell: CellId, bound: f64, settings: &SimplifySettings) {
        let cost_of = |world: &World, cell| cost_of_cell(world, cell, &settings.cost);
        let parts = cost_of(&self.world, cell) / bound;
        let mut n_left = (CUTS_PER_PART * parts).min(f64::from(u32::MAX)) as u32;
        let mut todo = vec![cell];
        while let Some(cell) = todo.pop() {
            let cost = cost_of(&self.world, cell);
            if cost <= bound {
                continue;
            }
            let is_outdoor = self.world.graph[cell].outdoor;
            let added = match (is_outdoor, n_left) {
                (true, _) if !settings.outdoors => Err(Reason::Outdoors),
                (true, _) => cut_outdoors(&self.world, cell).ok_or(Reason::Shared),
                (_, 0) => Err(Reason::ManyCuts),
                _ => self.halve(cell, cost, bound, &settings.cost),
            };
            match added {
                Ok(added) => {
                    self.world = Cow::Owned(added.world);
                    self.n_cuts += 1;
                    n_left = n_left.saturating_sub(1);
                    // The part beyond the scene's box is not cut further.
                    if is_outdoor && cost_of(&self.world, cell) > bound {
                        self.over.insert(cell, Reason::Shared);
                    }
                    todo.extend((!is_outdoor).then_some(added.cell));
                    todo.push(added.new_cell);
                }
                Err(reason) => {
                    self.over.insert(cell, reason);
                }
            }
        }
    }

    /// Returns the world with a cell cut by the plane, of those tried, that leaves its dearer part cheapest.
    fn halve(
        &mut self,
        cell: CellId,
        cost: f64,
        bound: f64,
        model: &CostModel,
    ) -> Result<Added, Reason> {
        let surfaces = surfaces_of(&self.world, cell, model);
        let boxed = &self.world.graph[cell].aabb;
        let [min, max] = boxed.map(|p| DVec3::from(p.map(f64::from)));
        let extent = min.abs().max(max.abs()).max_element();
        // Beyond the rounding of vertices.
        let around = Aabb::new(min, max).expanded((1e-5 * extent).max(1e-4));
        let mut planes: Vec<(f64, Plane)> = self
            .planes(&surfaces)
            .into_iter()
            .map(|plane| (dearer_side(&surfaces, &plane), plane))
            .filter(|(dearer, _)| *dearer <= GAIN * cost)
            .collect();
        planes.sort_by(|a, b| a.0.total_cmp(&b.0));
        let cut = |plane: &Plane| {
            let section = poly::section_of_box(plane, &around, (1e-9 * extent).max(1e-8))?;
            let candidates = vec![Winding::new(section.to_vec())];
            let distance = |p: DVec3| plane.signed_distance(p);
            let added = cut_cell(&self.world, cell, candidates, &distance).ok()?;
            let parts = [added.cell, added.new_cell];
            let is_gain = |&c: &CellId| cost_of_cell(&added.world, c, model) <= GAIN * cost;
            // A plane that grazes a portal may leave a sliver of it that rounding removes.
            (parts.iter().all(is_gain) && added.world.validate().is_ok()).then_some(added)
        };
        let found = planes
            .iter()
            .take(CUTS_TRIED)
            .find_map(|(_, plane)| cut(plane));
        let has_dear = surfaces.iter().any(|s| s.cost > bound);
        found.ok_or(if has_dear {
            Reason::Object
        } else {
            Reason::Shared
        })
    }

    fn planes(&mut self, surfaces: &[Surface]) -> Vec<Plane> {
        let random = &mut self.random;
        let mut out = Vec::with_capacity(3 * TRIES);
        for _ in 0..TRIES {
            let own = &surfaces[random.below(surfaces.len())].corners;
            if let &[a, b, c] = &own[..] {
                let normal = (b - a).cross(c - a).try_normalize();
                out.extend(normal.map(|n| Plane::through(a, n)));
            }
            // More geometry offers more places to cut.
            let place = &surfaces[random.below(surfaces.len())].corners;
            let middle = place.iter().sum::<DVec3>() / place.len() as f64;
            let axis = [DVec3::X, DVec3::Y, DVec3::Z][random.below(3)];
            out.push(Plane::through(middle, axis));
            let n = DVec3::new(random.unit(), random.unit(), random.unit()) - DVec3::splat(0.5);
            out.extend(n.try_normalize().map(|n| Plane::through(middle, n)));
        }
        out
    }
}

/// Returns an upper bound on the cost of the dearer side of a plane.
fn dearer_side(surfaces: &[Surface], plane: &Plane) -> f64 {
    let mut sides = [0.0; 2];
    for s in surfaces {
        let mut is_on = [false; 2];
        for p in &s.corners {
            let d = plane.signed_distance(*p);
            is_on[0] |= d >= 0.0;
            is_on[1] |= d <= 0.0;
        }
        for (sum, _) in sides.iter_mut().zip(is_on).filter(|s| s.1) {
            *sum += s.cost;
        }
    }
    sides[0].max(sides[1])
}

/// Returns the world with the outdoors within the scene's box separated from the rest, by the sides of a box halfway
/// between the scene and the border of the known space. The part beyond keeps the number. `None` if there is no room.
fn cut_outdoors(world: &World, cell: CellId) -> Option<Added> {
    let points = world.batches.iter().flat_map(|b| &b.primitive.positions);
    let scene = points.fold(Aabb::EMPTY, |b, p| {
        b.including(DVec3::from(p.map(f64::from)))
    });
    let border = &world.graph.locator.bounds;
    let between = Aabb::new(
        scene.min.midpoint(border.min),
        scene.max.midpoint(border.max),
    );
    let room = (scene.min - border.min).min(border.max - scene.max);
    let extent = border.min.abs().max(border.max.abs()).max_element();
    if scene.is_empty() || room.min_element() < 1e-4 * extent.max(1.0) {
        return None;
    }
    let candidates = sides_of_box(&between);
    let added = cut_cell(world, cell, candidates, &|p| {
        (p - between.min).min(between.max - p).min_element()
    });
    added
        .ok()
        .filter(|a| a.cell == cell && a.world.validate().is_ok())
}

fn sides_of_box(b: &Aabb) -> Vec<Winding> {
    let side = |i: usize| {
        let (axis, is_high) = (i % 3, i >= 3);
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |[pu, pv]: [bool; 2]| {
            let pick = |axis: usize, is_high: bool| if is_high { b.max[axis] } else { b.min[axis] };
            let mut p = DVec3::ZERO;
            p[axis] = pick(axis, is_high);
            p[u] = pick(u, pu);
            p[v] = pick(v, pv);
            p
        };
        let around = [[false, false], [true, false], [true, true], [false, true]];
        Winding::new(around.map(corner).to_vec())
    };
    (0..6).map(side).collect()
}

/// Start of the sequence: 2⁶⁴ divided by the golden ratio.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// A fixed sequence of pseudo-random numbers (Marsaglia's xorshift).
struct Sequence(u64);

impl Sequence {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}
