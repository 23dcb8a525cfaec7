//! *Planar, convex outline*, the other half: a portal's pieces lie in the open, between its own two cells.
//!
//! No line of sight meets a piece inside a wall, so no other check would find it.

use enfilade_geom::{DVec3, Plane};
use rayon::prelude::*;

use crate::rng::Rng;
use crate::subject::{Subject, to_dvec};

/// Points tried on each portal.
const POINTS: usize = 128;
/// Distance to both sides at which the locator is queried, in tolerances.
const ASIDE: f64 = 20.0;

/// Returns problems, at most a line per portal.
pub(crate) fn check(subject: &Subject, seed: u64) -> Vec<String> {
    let portals = subject.crossable.par_iter();
    portals
        .filter_map(|&id| {
            // Chunk numbers of rays count up from 0, those of cells down from the other end.
            let mut rng = Rng::new(seed, (1 << 62) + u64::from(id.0));
            let p = (0..POINTS).find_map(|_| {
                let p = subject.point_of_portal(&mut rng, id);
                is_wrong(subject, id.0 as usize, p).then_some(p)
            })?;
            let [from, to] = subject.portals[id.0 as usize]
                .cells
                .map(|c| subject.cell_name(c));
            Some(format!("{id} at ({p:.3}): not between {from} and {to}"))
        })
        .collect()
}

fn is_wrong(subject: &Subject, portal: usize, p: DVec3) -> bool {
    let view = &subject.portals[portal];
    let stored = &subject.world.graph.portals[portal];
    let plane = Plane::through(to_dvec(stored.outline[0]), view.normal);
    let aside = ASIDE * subject.eps;
    let p = plane.project(p);
    let step = plane.normal * aside;
    let found = [p - step, p + step].map(|q| subject.locator.locate(q));
    if found == view.cells.map(Some) {
        return false;
    }
    // Beside a surface, a rim or another portal, any answer is right.
    let mut crossings = Vec::new();
    subject.crossings(p - step * 2.0, p + step * 2.0, &mut crossings);
    let is_clear = subject.blockers.nearest(p, 3.0 * aside).is_none();
    is_clear && crossings.len() == 1 && subject.edge_clearance(p - step, p + step, aside) >= aside
}
