//! Compares a baked part with the old world where it is to be put in: on the faces of the block.
//!
//! The result holds its promises only if both agree there on what is air, which cells go on from one side to the other, and which
//! portals cross. If they disagree, the change reaches farther than assumed, and the block has to grow by what disagrees.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, Portal, World};
use enfilade_geom::{Aabb, DVec3, Winding};

use super::block::Block;
use super::part::BakedPart;
use super::tree::{PlaneTree, cell_of};
use crate::complex::poly;

/// Area on which both may disagree by rounding, and width of such slivers. [Units: wu²], [Units: wu]
const SLIVER: [f64; 2] = [1e-4, 1e-3];
/// Largest difference of the parts of one portal in the block: absolute and as a share. [Units: wu²]
const AREA: [f64; 2] = [1e-4, 1e-4];
/// Largest distance of the planes of one portal. [Units: wu]
const PLANE: f64 = 1e-4;

/// How the cells of a part go on beyond the block.
#[derive(Debug, Default)]
pub(super) struct Seam {
    /// The old cell of each cell of the part that reaches the block's faces.
    pub(super) old_of: BTreeMap<u32, CellId>,
    /// For each portal of the old world, its place relative to the block.
    pub(super) old_portals: Vec<Place>,
    /// For each portal of the part.
    pub(super) portals: Vec<Place>,
}

/// The place of a portal relative to the block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    Inside,
    Across,
    Outside,
}

/// A place where the part does not fit.
#[derive(Clone, Debug)]
pub(super) struct Misfit {
    /// Boxes that the block should contain, in scene coordinates.
    pub(super) boxes: Vec<Aabb>,
}

/// A pair of cells on the two sides of a face.
type Faced = BTreeMap<(Option<CellId>, Option<u32>), (f64, Aabb)>;

impl Seam {
    /// Compares a part with the old world; `touched` are the cells in which something changed.
    ///
    /// # Errors
    /// Where they do not fit.
    pub(super) fn of(
        old: &World,
        part: &BakedPart,
        block: &Block,
        trees: [&PlaneTree<'_>; 2],
        touched: &BTreeSet<CellId>,
    ) -> Result<Self, Misfit> {
        let mut seam = Self::default();
        let faced = faced(block, trees);
        let box_of = |c: CellId| {
            let [low, high] = old.graph[c].aabb.map(|p| DVec3::from(p.map(f64::from)));
            Aabb::new(low, high)
        };
        let grown = |c: CellId, at: Aabb| if old.graph[c].outdoor { at } else { box_of(c) };
        let mut olds_of: BTreeMap<u32, Vec<(CellId, Aabb)>> = BTreeMap::new();
        let mut news_of: BTreeMap<CellId, Vec<(u32, Aabb)>> = BTreeMap::new();
        for ((o, n), (_, at)) in faced {
            match (o, n) {
                (Some(o), Some(n)) => {
                    olds_of.entry(n).or_default().push((o, at));
                    news_of.entry(o).or_default().push((n, at));
                }
                (None, None) => {}
                _ => {
                    return Err(Misfit { boxes: vec![at] });
                }
            }
        }
        for (&n, olds) in &olds_of {
            if olds.len() > 1 {
                return Err(Misfit {
                    boxes: olds.iter().map(|&(c, at)| grown(c, at)).collect(),
                });
            }
            seam.old_of.insert(n, olds[0].0);
        }
        for (&o, news) in &news_of {
            let is_parted = news.len() > 1 && {
                let is_one = |n: u32| news.iter().any(|(m, _)| *m == n);
                let mut portals = part.portals.iter();
                !old.graph[o].outdoor && touched.contains(&o)
                    || portals.any(|p| p.cells.iter().all(|c| is_one(c.0)))
            };
            if is_parted {
                return Err(Misfit {
                    boxes: news.iter().map(|&(_, at)| grown(o, at)).collect(),
                });
            }
        }
        seam.match_portals(old, part, block)?;
        Ok(seam)
    }

    /// Finds the portals that cross the faces in both.
    fn match_portals(
        &mut self,
        old: &World,
        part: &BakedPart,
        block: &Block,
    ) -> Result<(), Misfit> {
        self.old_portals = old.graph.portals.iter().map(|p| place(p, block)).collect();
        self.portals = part.portals.iter().map(|p| place(p, block)).collect();
        for (p, place) in part.portals.iter().zip(&self.portals) {
            let is_lost = p.cells.iter().any(|c| part.is_beyond[c.0 as usize]);
            if is_lost && *place != Place::Outside {
                return Err(Misfit {
                    boxes: vec![box_of_portal(p)],
                });
            }
        }
        let across = |places: &[Place]| -> BTreeSet<usize> {
            let numbered = places.iter().enumerate();
            numbered
                .filter(|(_, p)| **p == Place::Across)
                .map(|(i, _)| i)
                .collect()
        };
        let mut free = across(&self.portals);
        for i in across(&self.old_portals) {
            let p = &old.graph.portals[i];
            let area = block.area_inside(&pieces(p));
            let is_same = |&&k: &&usize| {
                let q = &part.portals[k];
                let cells = q.cells.map(|c| self.old_of.get(&c.0).copied());
                let is_between = cells
                    .iter()
                    .all(|c| c.is_some_and(|c| p.cells.contains(&c)));
                let other = block.area_inside(&pieces(q));
                is_between
                    && cells[0] != cells[1]
                    && in_one_plane(p, q)
                    && (area - other).abs() <= AREA[0] + AREA[1] * area
            };
            match free.iter().find(is_same).copied() {
                Some(k) => {
                    free.remove(&k);
                }
                None => {
                    return Err(Misfit {
                        boxes: vec![box_of_portal(p)],
                    });
                }
            }
        }
        if let Some(&k) = free.iter().next() {
            return Err(Misfit {
                boxes: vec![box_of_portal(&part.portals[k])],
            });
        }
        Ok(())
    }
}

/// Returns the pairs of cells on both sides of the block's faces, outside in the old world and inside in the part.
fn faced(block: &Block, [old, new]: [&PlaneTree<'_>; 2]) -> Faced {
    let mut faced = Faced::new();
    for (plane, face) in &block.region {
        old.divide(face, -plane.normal, &mut |o, piece| {
            new.divide(piece, plane.normal, &mut |n, piece| {
                let area = poly::area(piece);
                if area < SLIVER[0] || poly::width(piece) < SLIVER[1] {
                    return;
                }
                let pair = (cell_of(o), cell_of(n).map(|c| c.0));
                let entry = faced.entry(pair).or_insert((0.0, Aabb::EMPTY));
                entry.0 += area;
                entry.1 = entry.1.union(Aabb::of_points(piece));
            });
        });
    }
    faced
}

/// Returns the true opening of a portal.
pub(super) fn pieces(p: &Portal) -> Vec<Winding> {
    let point = |p: &[f32; 3]| DVec3::from(p.map(f64::from));
    let pieces = p.pieces.iter();
    pieces
        .map(|piece| Winding::new(piece.iter().map(point).collect()))
        .collect()
}

pub(super) fn box_of_portal(p: &Portal) -> Aabb {
    let pieces = pieces(p);
    Aabb::of_points(pieces.iter().flat_map(|w| &w.points))
}

fn place(p: &Portal, block: &Block) -> Place {
    if !box_of_portal(p).overlaps(&block.around) {
        return Place::Outside;
    }
    let pieces = pieces(p);
    if block.contains(pieces.iter().flat_map(|w| &w.points), 1e-6) {
        Place::Inside
    } else if block.area_inside(&pieces) > 1e-6 {
        Place::Across
    } else {
        Place::Outside
    }
}

/// Returns `true` if two portals lie in one plane, whichever way their normals point.
pub(super) fn in_one_plane(a: &Portal, b: &Portal) -> bool {
    let [m, n] = [a, b].map(|p| DVec3::from(p.normal.map(f64::from)));
    let at = |p: &Portal| {
        p.pieces
            .first()
            .map_or(DVec3::ZERO, |w| DVec3::from(w[0].map(f64::from)))
    };
    m.dot(n).abs() > 1.0 - 1e-6 && (at(a) - at(b)).dot(m).abs() < PLANE
}
