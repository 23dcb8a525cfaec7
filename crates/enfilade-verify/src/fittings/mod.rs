//! Fittings of openings: leaves, frames and panes have the right names and positions.
//!
//! Only shapes and positions decide, by rules independent of the bake's. The side to which a leaf opens is judged as
//! far as its shape determines it: a hinge at a face of the leaf lies on the side to which it opens, else the leaf
//! runs into its jamb. A hinge at the other edge, or at the other face with the turn reversed, makes as good a door.

mod leaf;
mod opening;

use std::collections::BTreeSet;

use enfilade_cpg::{Fitting, FittingPart, Motion, Portal, PortalKind, Reason, World};
use enfilade_geom::{Aabb, Triangle};
use rayon::prelude::*;

use crate::details::triangles_of;
use crate::kinds::is_by_rule;
use leaf::Leaf;
use opening::{BESIDE, DEEP, FittedOpening};

/// Least share of a window that a pane covers.
const PANE: f64 = 0.25;
/// Least share of a door or window that a frame leaves free.
const FREE: f64 = 0.4;
/// An object that covers more of a door, and is not a leaf of another, must be a leaf of it. An object that covers less
/// leaves the larger part open: a pane beside a door in the same opening, say.
const SHUTS: f64 = 0.5;

/// Returns problems, a line each.
pub(crate) fn check(world: &World) -> Vec<String> {
    let fittings = world.graph.portals.iter().flat_map(|p| &p.fittings);
    let others = Others {
        bounds: (world.details.par_iter())
            .map(|d| Aabb::of_points(triangles_of(world, d).iter().flatten()))
            .collect(),
        leaves: fittings
            .filter(|f| f.part == FittingPart::Leaf)
            .map(|f| f.detail)
            .collect(),
    };
    let is_by_rule = is_by_rule(world);
    let portals = world.graph.portals.par_iter().enumerate();
    let found = portals.filter(|(_, p)| !p.fittings.is_empty() || is_by_rule);
    let found = found.flat_map_iter(|(i, portal)| {
        let mut out = Vec::new();
        let of_portal = OfPortal { world, portal };
        if let Some(opening) = FittedOpening::of(portal) {
            of_portal.check_fitted(&opening, &mut out);
            if is_by_rule {
                of_portal.check_rest(&opening, &others, &mut out);
            }
        }
        out.into_iter()
            .map(move |what| format!("portal {i}: {what}"))
    });
    found.collect()
}

/// All detail objects.
struct Others {
    bounds: Vec<Aabb>,
    /// Leaves of any opening.
    leaves: BTreeSet<u32>,
}

struct OfPortal<'a> {
    world: &'a World,
    portal: &'a Portal,
}

impl OfPortal<'_> {
    fn called(&self, detail: u32) -> String {
        format!(
            "detail {detail} ({})",
            self.world.details[detail as usize].name
        )
    }

    /// Checks the fittings of the opening against their names.
    fn check_fitted(&self, opening: &FittedOpening, out: &mut Vec<String>) {
        let of_part = |part| {
            let fittings = self.portal.fittings.iter();
            fittings.filter(move |f: &&Fitting| f.part == part)
        };
        if self.portal.kind != PortalKind::Door
            && let Some(f) = of_part(FittingPart::Leaf).next()
        {
            let leaf = self.called(f.detail);
            out.push(format!("{leaf} is a leaf in it, but its kind is not door"));
        }
        // Objects with the same motion are one leaf: with its handles, and the glass in it.
        let mut leaves: Vec<(&Motion, Vec<u32>)> = Vec::new();
        for f in of_part(FittingPart::Leaf) {
            let Some(motion) = &f.motion else { continue };
            match leaves.iter_mut().find(|(m, _)| *m == motion) {
                Some((_, own)) => own.push(f.detail),
                None => leaves.push((motion, vec![f.detail])),
            }
        }
        for (motion, details) in leaves {
            let of = |d: &u32| triangles_of(self.world, &self.world.details[*d as usize]);
            let triangles = details.iter().flat_map(of).collect();
            if let Some(what) = (Leaf { motion, triangles }).problem(opening) {
                out.push(format!("leaf {}: {what}", self.called(details[0])));
            }
        }
        for f in of_part(FittingPart::Frame).chain(of_part(FittingPart::Pane)) {
            if let Some(what) = self.still_problem(f, opening) {
                out.push(format!("{} {what}", self.called(f.detail)));
            }
        }
    }

    /// Returns a fault of a frame or pane.
    fn still_problem(&self, f: &Fitting, opening: &FittedOpening) -> Option<String> {
        let near = self.within(f.detail, opening);
        let covered = opening.covered(&near);
        let percent = 100.0 * covered;
        if f.part == FittingPart::Pane {
            if self.portal.kind != PortalKind::Window {
                return Some("is a pane in it, but its kind is not window".into());
            }
            return (covered < PANE)
                .then(|| format!("is a pane, but covers only {percent:.0} % of it"));
        }
        if self.portal.kind != PortalKind::Open && covered > 1.0 - FREE {
            return Some(format!("is a frame, but covers {percent:.0} % of it"));
        }
        // The rest of an object from which leaves were taken is a frame, whatever its shape.
        let mut others = self.portal.fittings.iter();
        let is_rest = others.any(|o| {
            let part_of = self.world.details[o.detail as usize].part_of;
            part_of == Some(f.detail)
        });
        let b = Aabb::of_points(near.iter().flatten());
        let rim = opening.bounds.expanded(-BESIDE);
        let is_around = b.min.x <= rim.min.x && b.max.x >= rim.max.x && b.max.y >= rim.max.y;
        if near.is_empty() || !is_rest && !is_around {
            return Some("is a frame, but does not run around it".into());
        }
        None
    }

    /// Checks that objects that shut a door are leaves of it, and that there is one.
    fn check_rest(&self, opening: &FittedOpening, others: &Others, out: &mut Vec<String>) {
        if self.portal.kind != PortalKind::Door {
            return;
        }
        let around = opening.around(BESIDE.max(DEEP));
        let is_fitting = |d: u32| self.portal.fittings.iter().any(|f| f.detail == d);
        let is_near = |&d: &u32| {
            let b = &others.bounds[d as usize];
            !b.is_empty() && b.overlaps(&around) && !is_fitting(d) && !others.leaves.contains(&d)
        };
        let mut is_shut = false;
        for d in (0..others.bounds.len() as u32).filter(is_near) {
            let covered = opening.covered(&self.within(d, opening));
            if covered > SHUTS {
                is_shut = true;
                let (d, percent) = (self.called(d), 100.0 * covered);
                out.push(format!(
                    "{d} covers {percent:.0} % of it, but is not one of its fittings"
                ));
            }
        }
        let mut fittings = self.portal.fittings.iter();
        let has_leaf = fittings.any(|f| f.part == FittingPart::Leaf);
        // A person may know of a door that the model lacks.
        let is_asked = self.portal.why.iter().any(|w| w.reason == Reason::Asked);
        if !has_leaf && !is_shut && !is_asked {
            out.push("is a door without a leaf".into());
        }
    }

    /// Returns the triangles of a detail around the opening, in its directions.
    fn within(&self, detail: u32, opening: &FittedOpening) -> Vec<Triangle> {
        let b = opening.bounds;
        let is_in = |t: &Triangle| {
            let low = t[0].min(t[1]).min(t[2]);
            let high = t[0].max(t[1]).max(t[2]);
            let is_beside = low.x > b.max.x + BESIDE || high.x < b.min.x - BESIDE;
            let is_off = low.y > b.max.y + BESIDE || high.y < b.min.y - BESIDE;
            !is_beside && !is_off && low.z >= b.min.z - DEEP && high.z <= b.max.z + DEEP
        };
        let own = triangles_of(self.world, &self.world.details[detail as usize]);
        let placed = own.iter().map(|t| t.map(|p| opening.place(p)));
        placed.filter(is_in).collect()
    }
}
