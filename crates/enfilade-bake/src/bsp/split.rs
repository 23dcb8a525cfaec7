//! Cells above the cost bound are cut in two (Lefebvre & Hornus 2003, §2.1 step 4).

use std::collections::{BTreeMap, BTreeSet};

use enfilade_geom::{Aabb, DVec3, Plane, Winding};

use crate::complex::Vote;
use crate::complex::poly;
use crate::watershed::{OUTDOORS, Screen};

use super::Bsp;
use super::cells::Cells;
use super::decompose::screen;
use super::shape::{self, Region, Shape};

/// Planes tried of each kind for each cut.
const TRIES: usize = 12;
/// Cuts of one cell at most; each halves, so that is enough for any bound that can be met.
const MAX_CUTS: usize = 64;

/// A piece of a leaf and its share of the leaf's polygons.
struct Piece {
    region: Region,
    shape: Shape,
    cost: f64,
}

/// Cuts cells until none costs more than `bound` polygons, where cutting helps: adds a screen for each
/// cut; the pieces on either side vote for labels of their own.
///
/// Planes are tried of portals that are part of no separator, of axes, and of any direction; the one
/// with the best balance is taken. The choice is by a fixed sequence, the same every time.
pub(super) fn split_large(
    bsp: &Bsp,
    cells: &Cells,
    bound: f64,
    screens: &mut Vec<Screen>,
    votes: &mut Vec<Vote>,
) {
    let costs = leaf_costs(bsp);
    let mut cost_of_cell = vec![0.0; cells.n_cells];
    for (leaf, &cell) in cells.of_leaf.iter().enumerate() {
        if let Some(sum) = cost_of_cell.get_mut(cell as usize) {
            *sum += costs[leaf];
        }
    }
    let cell_of = |leaf: u32| cells.of_leaf[leaf as usize] as usize;
    let is_large = |cell: usize| cost_of_cell.get(cell).is_some_and(|&c| c > bound);
    let regions = shape::regions(&bsp.tree, &bsp.tolerance, &|leaf| is_large(cell_of(leaf)));
    if regions.is_empty() {
        return;
    }
    let mut is_separator = vec![false; bsp.portals.len()];
    for &p in cells.separators.iter().flat_map(|s| &s.portals) {
        is_separator[p as usize] = true;
    }
    let mut planes_of: BTreeMap<usize, BTreeSet<u32>> = BTreeMap::new();
    for (p, is_separator) in bsp.portals.iter().zip(&is_separator) {
        if !is_separator {
            planes_of
                .entry(cell_of(p.leaves[0]))
                .or_default()
                .insert(p.plane);
        }
    }
    let mut pieces_of: BTreeMap<usize, Vec<Piece>> = BTreeMap::new();
    for (leaf, region) in regions {
        if let Some(shape) = shape::shape_of(&region) {
            let cost = costs[leaf as usize];
            pieces_of.entry(cell_of(leaf)).or_default().push(Piece {
                region,
                shape,
                cost,
            });
        }
    }
    // The old votes of cells that are cut make room for those of their pieces.
    votes.retain(|v| !is_large(cell_of(bsp.tree.leaf_of(v.point))));
    let mut label = votes.iter().map(|v| v.label).max().unwrap_or(OUTDOORS) + 1;
    let mut random = Sequence(0x9e37_79b9_7f4a_7c15);
    for (cell, pieces) in pieces_of {
        let own: Vec<u32> = planes_of.remove(&cell).into_iter().flatten().collect();
        let mut parts = vec![pieces];
        let mut n_cuts = 0;
        while let Some(pieces) = parts.pop() {
            let cost: f64 = pieces.iter().map(|p| p.cost).sum();
            let plane = (cost > bound && n_cuts < MAX_CUTS)
                .then(|| choose(bsp, &pieces, cost, &own, &mut random))
                .flatten();
            let Some(plane) = plane else {
                votes.extend(pieces.iter().map(|p| Vote {
                    point: p.shape.middle,
                    label,
                    weight: p.shape.volume as f32,
                }));
                label += 1;
                continue;
            };
            n_cuts += 1;
            let around = bounds_of(&pieces).expanded(8.0 * bsp.tolerance.plane);
            if let Some(section) = poly::section_of_box(&plane, &around, bsp.tolerance.cut) {
                screens.push(screen(&Winding::new(section.to_vec()), [cell as u32; 2]));
            }
            let mut sides = [Vec::new(), Vec::new()];
            for piece in pieces {
                let volume = piece.shape.volume;
                let halves =
                    shape::halves(piece.region, &plane, &bsp.tree.bounds, bsp.tolerance.cut);
                for (side, region) in sides.iter_mut().zip(halves) {
                    if let Some(shape) = shape::shape_of(&region) {
                        let cost = piece.cost * (shape.volume / volume).min(1.0);
                        side.push(Piece {
                            region,
                            shape,
                            cost,
                        });
                    }
                }
            }
            parts.extend(sides.into_iter().filter(|s| !s.is_empty()));
        }
    }
}

fn bounds_of(pieces: &[Piece]) -> Aabb {
    pieces
        .iter()
        .fold(Aabb::EMPTY, |b, p| b.union(p.shape.bounds))
}

/// The plane of those tried that balances best; none where none balances at all.
fn choose(
    bsp: &Bsp,
    pieces: &[Piece],
    cost: f64,
    own: &[u32],
    random: &mut Sequence,
) -> Option<Plane> {
    let bounds = bounds_of(pieces);
    let mut tried: Vec<Plane> = Vec::new();
    for _ in 0..TRIES {
        if !own.is_empty() {
            tried.push(bsp.tree.planes[own[random.below(own.len())] as usize]);
        }
        let share = DVec3::new(random.unit(), random.unit(), random.unit());
        let p = bounds.min + bounds.size() * share;
        tried.push(Plane::through(
            p,
            [DVec3::X, DVec3::Y, DVec3::Z][random.below(3)],
        ));
        let n = DVec3::new(random.unit(), random.unit(), random.unit()) - DVec3::splat(0.5);
        tried.extend(n.try_normalize().map(|n| Plane::through(p, n)));
    }
    let lean = |plane: &Plane| {
        let sum: f64 = pieces
            .iter()
            .map(|p| {
                // How far the plane is from the piece's middle tells about how it is shared.
                let reach = plane.normal.abs().dot(p.shape.bounds.size()) * 0.5;
                let off = plane.signed_distance(p.shape.middle) / reach.max(1e-9);
                p.cost * off.clamp(-1.0, 1.0)
            })
            .sum();
        sum.abs()
    };
    tried
        .into_iter()
        .map(|p| (lean(&p), p))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(lean, _)| *lean < 0.9 * cost)
        .map(|(_, p)| p)
}

/// Polygons at each leaf.
fn leaf_costs(bsp: &Bsp) -> Vec<f64> {
    let mut costs = vec![0.0; bsp.is_open.len()];
    for f in &bsp.surfaces {
        let mut found = Vec::new();
        bsp.tree
            .leaves_before(f, bsp.tolerance.plane, &mut |l| found.push(l));
        found.sort_unstable();
        found.dedup();
        // A polygon over many leaves of a cell is drawn once.
        for &l in &found {
            costs[l as usize] += 1.0 / found.len() as f64;
        }
    }
    costs
}

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
