//! Divides one cell of a finished world by a candidate.
//!
//! The complex is built from the cell's own triangles, the new candidates (which come first: one in a plane, or the
//! sides of a box) and the pieces of the cell's portals (all other candidates). Leaves connected without crossing a
//! candidate form one part. The two parts with most of the new candidates' opening between them become the two new
//! cells, and any other part that the candidates cut off joins one of them.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;

use enfilade_geom::{DVec3, Sets, Winding, poly};

use super::facet::{Cover, FacetSink, OpenPieces, RawFacet, Visitor};
use super::graph::{box_faces, sides_of_border};
use super::leaf_cells::{LeafCells, SOLID};
use super::partition::{self, Partition};
use super::{Complex, Label};

/// The cell of [`Complex::divided`] in front of the candidate's plane.
pub const FRONT: u32 = 0;
/// The cell of [`Complex::divided`] behind it.
pub const BACK: u32 = 1;

/// The candidates that divide a cell.
pub struct Cutter<'a> {
    /// Candidates with a smaller index belong to the cutter.
    pub n_candidates: u32,
    /// Returns the distance of a point in front of the cutter; negative behind it. [Units: wu]
    pub distance: &'a dyn Fn(DVec3) -> f64,
}

impl Cutter<'_> {
    fn is_own(&self, candidate: Option<u32>) -> bool {
        candidate.is_some_and(|s| s < self.n_candidates)
    }

    /// Returns `true` if a leaf's middle lies in front of the cutter.
    fn is_before(&self, middle: Option<DVec3>) -> bool {
        middle.is_some_and(|p| (self.distance)(p) >= 0.0)
    }
}

/// The reasons why a candidate does not divide a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Undivided {
    /// No opening of the candidate has the cell on both sides.
    Aside,
    /// Both sides reach the border of the box; everything beyond it is one cell.
    Endless,
    /// Both sides are connected: at this point, a path passes the candidate's plane beside the candidate.
    Around(DVec3),
}

/// An opening between two leaves.
struct LeafOpening {
    leaves: [u32; 2],
    candidate: Option<u32>,
    area: f64,
    at: DVec3,
}

impl Complex<'_> {
    /// Divides the part of space in which `is_ours` holds by the cutter's candidates.
    ///
    /// The partition has two cells, [`FRONT`] and [`BACK`]; everything else counts as solid. Linear in leaves and
    /// openings.
    ///
    /// # Errors
    /// If the candidates do not divide it in two.
    pub fn divided(
        &self,
        cutter: &Cutter<'_>,
        is_ours: impl Fn(DVec3) -> bool,
    ) -> Result<Partition, Undivided> {
        let (openings, middles) = self.openings();
        let ours: Vec<bool> = middles.iter().map(|m| m.is_some_and(&is_ours)).collect();
        let is_inner = |o: &&LeafOpening| o.leaves.iter().all(|&l| ours[l as usize]);
        let mut sets = Sets::new(ours.len());
        for o in openings.iter().filter(is_inner) {
            if o.candidate.is_none() {
                sets.join(o.leaves[0], o.leaves[1]);
            }
        }
        // For each pair of parts, in front and behind, the area of the cutter's openings between them.
        let mut between: BTreeMap<[u32; 2], f64> = BTreeMap::new();
        for o in openings.iter().filter(is_inner) {
            if cutter.is_own(o.candidate) {
                let mut pair = o.leaves.map(|l| sets.find(l));
                if !cutter.is_before(middles[o.leaves[0] as usize]) {
                    pair.swap(0, 1);
                }
                *between.entry(pair).or_default() += o.area;
            }
        }
        let main = between.iter().max_by(|a, b| a.1.total_cmp(b.1));
        let &[front, back] = main.ok_or(Undivided::Aside)?.0;
        if front == back {
            let around = Self::way_around(cutter, &openings, &ours, &middles, &mut sets, front);
            return Err(around.map_or(Undivided::Aside, Undivided::Around));
        }
        // The other parts join one of the two by their widest openings.
        let mut by_area: Vec<([u32; 2], f64)> = Vec::new();
        for o in openings.iter().filter(is_inner) {
            by_area.push((o.leaves, o.area));
        }
        by_area.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (leaves, _) in by_area {
            let [a, b] = leaves.map(|l| sets.find(l));
            let [f, k] = [front, back].map(|l| sets.find(l));
            if [a, b] != [f, k] && [b, a] != [f, k] {
                sets.join(a, b);
            }
        }
        let [f, k] = [front, back].map(|l| sets.find(l));
        let mut cell_of_leaf = vec![SOLID; ours.len()];
        for (leaf, cell) in cell_of_leaf.iter_mut().enumerate() {
            if ours[leaf] {
                let set = sets.find(leaf as u32);
                // A leaf without openings is a sliver at a wall; either cell will do.
                let is_behind = set == k || (set != f && !cutter.is_before(middles[leaf]));
                *cell = if is_behind { BACK } else { FRONT };
            }
        }
        let mut volumes = vec![0.0; 2];
        let mut border = [0.0; 2];
        for (leaf, &cell) in cell_of_leaf.iter().enumerate() {
            if cell != SOLID {
                volumes[cell as usize] += self.graph.volumes[leaf];
            }
            if cell != SOLID && self.graph.at_border[leaf] {
                border[cell as usize] += self.graph.volumes[leaf];
            }
        }
        if border[0] > 0.0 && border[1] > 0.0 {
            return Err(Undivided::Endless);
        }
        let outside = [FRONT, BACK]
            .into_iter()
            .find(|&c| border[c as usize] > 0.0);
        Ok(partition::realize(
            self,
            LeafCells {
                cell_of_leaf,
                label_of_cell: [FRONT, BACK].map(Label::Region).to_vec(),
                volumes,
                outside,
            },
        ))
    }

    /// Returns the point where the shortest path within a part, from one side of the cutter to the other, crosses
    /// between them.
    fn way_around(
        cutter: &Cutter<'_>,
        openings: &[LeafOpening],
        ours: &[bool],
        middles: &[Option<DVec3>],
        sets: &mut Sets,
        part: u32,
    ) -> Option<DVec3> {
        let mut next: Vec<Vec<u32>> = vec![Vec::new(); ours.len()];
        let mut from = vec![u32::MAX; ours.len()];
        let mut is_goal = vec![false; ours.len()];
        let mut queue = VecDeque::new();
        for (i, o) in openings.iter().enumerate() {
            if !o.leaves.iter().all(|&l| ours[l as usize]) || sets.find(o.leaves[0]) != part {
                continue;
            }
            match o.candidate {
                None => o
                    .leaves
                    .iter()
                    .for_each(|&l| next[l as usize].push(i as u32)),
                Some(_) if cutter.is_own(o.candidate) && sets.find(o.leaves[1]) == part => {
                    for l in o.leaves {
                        if cutter.is_before(middles[l as usize]) {
                            from[l as usize] = u32::MAX - 1;
                            queue.push_back(l);
                        } else {
                            is_goal[l as usize] = true;
                        }
                    }
                }
                Some(_) => {}
            }
        }
        while let Some(leaf) = queue.pop_front() {
            if is_goal[leaf as usize] {
                // Back along the path, from middle to opening to middle, until the side changes.
                let mut points = vec![middles[leaf as usize]?];
                let mut at = leaf;
                while from[at as usize] < u32::MAX - 1 {
                    let o = &openings[from[at as usize] as usize];
                    at = o.leaves[usize::from(o.leaves[0] == at)];
                    points.extend([o.at, middles[at as usize]?]);
                }
                return points.windows(2).find_map(|w| {
                    let [a, b] = [w[0], w[1]].map(cutter.distance);
                    (a < 0.0 && b >= 0.0).then(|| w[0].lerp(w[1], a / (a - b)))
                });
            }
            for &i in &next[leaf as usize] {
                let o = &openings[i as usize];
                let to = o.leaves[usize::from(o.leaves[0] == leaf)];
                if from[to as usize] == u32::MAX {
                    from[to as usize] = i;
                    queue.push_back(to);
                }
            }
        }
        None
    }

    /// Returns the openings of all leaves, and a point well inside each leaf; `None` if rounding has left it without
    /// vertices.
    fn openings(&self) -> (Vec<LeafOpening>, Vec<Option<DVec3>>) {
        let visitor = Visitor {
            tree: &self.tree,
            surfaces: &self.set.surfaces,
            tolerance: self.tolerance,
            purse: self.graph.purse,
        };
        let n = self.tree.n_leaves as usize;
        let mut sink = OpeningSink {
            visitor: &visitor,
            first_leaf: 0,
            openings: Vec::new(),
            sums: vec![(DVec3::ZERO, 0.0); n],
        };
        visitor.visit(&mut sink);
        for (face, _) in box_faces(&self.tree.bounds) {
            sides_of_border(
                &self.tree,
                self.tree.root,
                &face,
                self.tolerance.cut,
                &mut |leaf, piece| sink.count(leaf, piece),
            );
        }
        let OpeningSink { openings, sums, .. } = sink;
        let middle = |(sum, n): (DVec3, f64)| (n > 0.0).then(|| sum / n);
        (openings, sums.into_iter().map(middle).collect())
    }
}

struct OpeningSink<'a> {
    visitor: &'a Visitor<'a>,
    first_leaf: u32,
    openings: Vec<LeafOpening>,
    /// Sum and number of vertices, for the leaves from `first_leaf` on.
    sums: Vec<(DVec3, f64)>,
}

impl OpeningSink<'_> {
    fn count(&mut self, leaf: u32, points: &[DVec3]) {
        let sum = &mut self.sums[(leaf - self.first_leaf) as usize];
        sum.0 += points.iter().sum::<DVec3>();
        sum.1 += points.len() as f64;
    }
}

impl FacetSink for OpeningSink<'_> {
    fn take(&mut self, facet: &RawFacet<'_>) {
        facet
            .leaves
            .into_iter()
            .for_each(|l| self.count(l, facet.points));
        let normal = self.visitor.tree.planes[facet.plane as usize].normal;
        for (piece, candidate) in OpenPieces::of(facet, normal, &self.visitor.tolerance).pieces {
            let at = piece.iter().sum::<DVec3>() / piece.len() as f64;
            // A piece too narrow for its candidate is listed without one; it must not lead around the candidate.
            let is_on = |cover: &&Cover| {
                let outline = Winding::new(cover.points.to_vec());
                cover.candidate.is_some() && outline.contains_in_plane(at, 0.0)
            };
            self.openings.push(LeafOpening {
                leaves: facet.leaves,
                candidate: candidate.or_else(|| facet.covers.iter().find(|c| is_on(c))?.candidate),
                area: poly::area(&piece),
                at,
            });
        }
    }

    fn fork(&self, leaves: Range<u32>) -> Self {
        Self {
            visitor: self.visitor,
            first_leaf: leaves.start,
            openings: Vec::new(),
            sums: vec![(DVec3::ZERO, 0.0); leaves.len()],
        }
    }

    fn join(&mut self, front: Self, back: Self) {
        for part in [front, back] {
            self.openings.extend(part.openings);
            let at = (part.first_leaf - self.first_leaf) as usize;
            for (sum, s) in self.sums[at..].iter_mut().zip(&part.sums) {
                sum.0 += s.0;
                sum.1 += s.1;
            }
        }
    }
}
