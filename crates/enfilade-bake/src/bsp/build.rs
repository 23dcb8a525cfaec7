//! Builds leaves from surfaces: gathers, cuts, finds which leaves are matter, and drops those not reached from inside.

use enfilade_geom::{Aabb, BoxTree, ConvexSolid, DVec3, Purse};
use rayon::prelude::*;

use crate::budget::WORK_A_LOOK;
use crate::config::{Guide, Heuristic};

use super::input::BspInput;
use super::leaves::Bsp;
use super::tolerance::Tolerance;
use super::tree::{self, Content, Tree};
use super::{inside, leak, portals, shape, surfaces};

/// Returns the number of distinct values; equal ones are adjacent.
fn n_distinct(numbers: &[u32]) -> usize {
    numbers.chunk_by(|a, b| a == b).count()
}

impl<'a> Bsp<'a> {
    /// Builds the tree and its portals.
    ///
    /// With solids and points inside, it is built twice: first to find the surfaces seen from inside, then from
    /// those alone. Time near-linear if surfaces are spread out; deterministic.
    #[must_use]
    pub fn build(input: &BspInput<'_>, heuristic: Heuristic, guide: &Guide) -> Self {
        Self::build_of(input, heuristic, guide, true, Purse::endless())
    }

    /// Like [`Bsp::build`]; unless `has_matter`, both sides of all triangles are air.
    pub(super) fn build_of(
        input: &BspInput<'_>,
        heuristic: Heuristic,
        guide: &Guide,
        has_matter: bool,
        purse: Purse<'a>,
    ) -> Self {
        let surfaces::Gathered {
            planes,
            fragments,
            faces,
            bounds,
            tolerance,
        } = surfaces::gather(input, purse);
        let boxes: Vec<Aabb> = input.solids.iter().map(ConvexSolid::aabb).collect();
        let solids = BoxTree::new(&boxes);
        let make = |fragments: Vec<tree::Fragment>,
                    heuristic: Heuristic,
                    guide: &Guide,
                    has_void: bool| {
            let mut tree = tree::build(
                planes.clone(),
                fragments.clone(),
                bounds,
                heuristic,
                guide,
                &tolerance,
                purse,
            );
            if !boxes.is_empty() {
                // A middle on the border of two solids is in matter.
                settle(&mut tree, &tolerance, has_void, purse, &|p| {
                    let mut is_inside = false;
                    solids.for_each_in_box(&Aabb::new(p, p), |i| {
                        is_inside |= input.solids[i as usize].contains(p, -10.0 * tolerance.cut);
                    });
                    is_inside
                });
            } else if !input.triangles.is_empty() {
                let soup = inside::Soup::of(input.triangles, input.objects);
                settle(&mut tree, &tolerance, true, purse, &|p| {
                    has_matter && soup.is_inside(p, purse)
                });
            }
            let mut bsp = Self {
                portals: portals::leaf_portals(&tree, &tolerance, purse),
                tree,
                tolerance,
                surfaces: fragments,
                n_own_planes: planes.len() as u32,
                n_faces: n_distinct(&faces),
                is_of_triangles: boxes.is_empty(),
                is_open: Vec::new(),
                leak: None,
                purse,
            };
            bsp.resolve_unknown();
            bsp
        };
        let knows_inside = !input.solids.is_empty() && !input.inside.is_empty();
        if !knows_inside {
            return make(fragments, heuristic, guide, true);
        }
        let first = make(fragments, Heuristic::Default, &Guide::default(), true);
        let reached = leak::reach(&first, input.inside);
        if reached.path.is_some() {
            let mut leaky = make(first.surfaces, heuristic, guide, true);
            leaky.leak = reached.path;
            return leaky;
        }
        let (seen, faces_seen): (Vec<tree::Fragment>, Vec<u32>) = first
            .surfaces
            .iter()
            .zip(&faces)
            .filter(|(f, _)| {
                let mut is_seen = false;
                first.tree.leaves_before(f, tolerance.plane, &mut |leaf| {
                    is_seen |= reached.is_reached[leaf as usize];
                });
                is_seen
            })
            .map(|(f, face)| (f.clone(), *face))
            .unzip();
        let mut bsp = make(seen, heuristic, guide, false);
        bsp.n_faces = n_distinct(&faces_seen);
        let reached = leak::reach(&bsp, input.inside);
        // The points no longer reach slivers of the void that rounding left.
        for (open, &reached) in bsp.is_open.iter_mut().zip(&reached.is_reached) {
            *open &= reached;
        }
        bsp.drop_closed_portals();
        bsp
    }
}

/// Decides if each leaf is matter by testing its middle against the solids: next to slivers, the surfaces
/// around a leaf can mislead. Without the void's surfaces, the void counts as matter, too, and only leaves
/// that are certainly in a solid are corrected.
fn settle(
    tree: &mut Tree,
    tolerance: &Tolerance,
    has_void: bool,
    purse: Purse<'_>,
    is_inside: &(dyn Fn(DVec3) -> bool + Sync),
) {
    let shapes = shape::shapes(tree, tolerance, purse);
    let contents = tree.contents.par_iter_mut().zip(&shapes);
    contents.for_each(|(content, shape)| {
        if !purse.spend(WORK_A_LOOK) {
            return;
        }
        match shape {
            // No room for anything.
            None => *content = Content::Solid,
            Some(s) if is_inside(s.middle) => *content = Content::Solid,
            Some(_) if has_void => *content = Content::Empty,
            Some(_) => {}
        }
    });
}
