//! Cells within bounds on what drawing them costs: those above are cut, those below merged.
//!
//! After Lefebvre & Hornus 2003, §2.1 step 4 and §3: cells above the bound are cut first, since merging never makes a
//! cell cheaper, and by the same [`CostModel`]. A cut is a plane; of planes of the cell's own polygons, of the axes and
//! of any direction the one counts whose dearer side is cheapest.
//!
//! Where it departs from the paper: it is the finished world that is cut ([`crate::edit`]), so that the bound holds
//! whatever built it, and what counts is what each part really sees. The planes of polygons take the place of portals
//! of the tree that are in no separator: those lie in the same planes. The outdoors has no walls to be cut from to, and
//! what lies beyond the scene's box is one; where asked, the air within the box is parted from the air beyond, and
//! then cut like any cell.

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

/// Planes tried of each kind for each cut.
const TRIES: usize = 12;
/// Of those, so many are tried on the world itself. What a plane is chosen by is a bound from above, so the first is
/// mostly good.
const CUTS_TRIED: usize = 4;
/// What both parts of a cut may cost, as a share of the whole: more is no gain, and cuts would not end.
const GAIN: f64 = 0.9;
/// Cuts of one cell at most, times the parts that even cuts would make.
const CUTS_PER_PART: f64 = 4.0;

/// A world, and which of its cells are within the bounds.
#[derive(Clone, Debug)]
pub struct Bounded {
    /// The world.
    pub world: World,
    /// How many cuts were made.
    pub n_cuts: usize,
    /// The upper bound that was asked for.
    pub bound: Option<f64>,
    /// Least and greatest cost of a cell.
    pub costs: [f64; 2],
    /// Cells above the bound, the dearest first.
    pub over: Vec<Over>,
}

/// A cell above the bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Over {
    /// The cell.
    pub cell: CellId,
    /// What it costs.
    pub cost: f64,
    /// Why it was not cut.
    pub reason: Reason,
}

/// Why a cell above the bound was not cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It is the outdoors, and that was not asked for.
    Outdoors,
    /// One object in it costs more by itself, and no plane that was tried makes both parts cheaper by a tenth.
    Object,
    /// No plane that was tried makes both its parts cheaper by a tenth: what it sees is seen from all of it.
    Shared,
    /// It was cut more often than a bound takes that can be met.
    ManyCuts,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Outdoors => "it is the outdoors, which is cut only where asked (split_outdoors)",
            Self::Object => "one object in it costs more by itself",
            Self::Shared => "no plane that was tried leaves both parts cheaper by a tenth",
            Self::ManyCuts => "it is in too many parts already",
        })
    }
}

/// Cells above the bound that a note tells of one by one.
const TOLD: usize = 5;

impl Bounded {
    /// What could not be met, in words; `None` where all was.
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
/// Every promise is kept. Deterministic for any number of threads. Time: for each cut that of a bake of the one cell,
/// a few times where cuts fail, and a look at the whole world.
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
        // Of all times: whoever reads the file knows by it that portals were made by costs.
        *counts.entry("cost_cuts".to_owned()).or_default() += out.n_cuts as f64;
        counts.insert("cells_over_cost".to_owned(), out.over.len() as f64);
    }
    out
}

/// Keeps a baked world within bounds, where any are given, and says in the notes and in the file's provenance which.
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
    /// Cuts a cell and its parts until none costs more than `bound`, as far as that helps.
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
                    // What is beyond the scene's box is cut no further.
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

    /// The world with a cell cut by the plane that leaves its dearer part cheapest, of those tried.
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
        // Beyond what corners are rounded by.
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
            // A plane that grazes a portal may leave of it less than rounding does.
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
            // Where there is more to draw there are more places to cut.
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

/// What the dearer side of a plane costs at most.
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

/// The world with the outdoors within the scene's box parted from what is beyond, by the sides of a box halfway between
/// the scene and the border of what is known. The part beyond keeps the number; `None` where there is no room.
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

/// Where the sequence begins: 2⁶⁴ by the golden ratio, as many ones as zeros.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// A fixed sequence of numbers that look random (Marsaglia's xorshift).
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
