//! Decides the kind of each portal, for all builders, from what fills it, its shape, and the floors beside it.
//!
//! An object that says it is a door or a window is one. Where none does, an opening above a parapet is a window, and a filled
//! one is a door if it is as high as one and somebody can step through.

use enfilade_cpg::{Portal, PortalKind};
use enfilade_geom::filler::{LOWEST_DOOR, deepest_leaf};
use enfilade_geom::scene::{Filling, Role};
use enfilade_geom::{
    Aabb, Bvh, DVec3, Plane, Ray, Rectangle, Triangle, Winding, is_rather_level, shells,
};
use rayon::prelude::*;

use super::Cut;
use crate::complex::PartitionPortal;

/// Least height of a parapet that makes an opening a window. [Units: wu]
const PARAPET: f64 = 0.4;
/// Least width of an opening that anybody climbs through: an unfilled one that is narrower is a gap. [Units: wu]
pub(super) const SLIT: f64 = 0.3;
/// Greatest rise of a door's threshold over the floor beside it, where it leads outdoors. [Units: wu] Thresholds have 20 to
/// 60 mm; windows down to the floor stand on a curb of 80 mm or more.
const THRESHOLD: f64 = 0.07;
/// Least share of an opening that an object fills to say what it is.
const FILLS: f64 = 0.5;
/// Distance by which a frame reaches into the wall around its opening. [Units: wu]
const REBATE: f64 = 0.15;

/// Decides on kinds.
pub(super) struct PortalKinds<'a> {
    cut: &'a Cut<'a>,
    named: Vec<NamedShell>,
}

/// A shell of an object that says what it fills.
struct NamedShell {
    filling: Filling,
    triangles: Vec<Triangle>,
    aabb: Aabb,
}

impl<'a> PortalKinds<'a> {
    pub(super) fn new(cut: &'a Cut<'a>) -> Self {
        let scene = cut.structure.scene;
        let named = scene.objects.par_iter().filter(|o| o.role == Role::Detail);
        let named = named.filter_map(|o| Some((o.filling?, o)));
        let named = named.flat_map_iter(|(filling, o)| {
            let primitives = scene.meshes[o.mesh as usize].primitives.iter();
            let triangles = primitives.flat_map(|p| p.placed_triangles(o.transform));
            let triangles: Vec<Triangle> = triangles.collect();
            let (shell_of, n) = shells(&triangles);
            let mut parts = vec![Vec::new(); n];
            for (t, shell) in triangles.iter().zip(shell_of) {
                parts[shell as usize].push(*t);
            }
            parts.into_iter().map(move |triangles| NamedShell {
                filling,
                aabb: Aabb::of_points(triangles.as_flattened()),
                triangles,
            })
        });
        Self {
            cut,
            named: named.collect(),
        }
    }

    /// Returns `true` if a leaf or pane fills an opening.
    pub(super) fn is_filled(&self, p: &PartitionPortal) -> bool {
        let closed = |c: u32| self.cut.candidates[c as usize].closed;
        p.candidate.map_or(0.0, closed) >= self.cut.closed_share
    }

    /// Returns `true` if an opening is upright and its lower edge at a floor.
    pub(super) fn is_on_floor(&self, p: &PartitionPortal) -> bool {
        p.kind != PortalKind::Crack && is_upright(p) && self.sill(p) <= PARAPET
    }

    /// Returns `true` if a window may be one pane of several: it does not say that it is a window, and is not as high as a person
    /// from the floor on.
    pub(super) fn is_pane(&self, p: &PartitionPortal) -> bool {
        self.filling(p).is_none() && !(height(p) >= LOWEST_DOOR && self.is_on_floor(p))
    }

    /// Returns the kind of a portal.
    pub(super) fn kind(&self, p: &PartitionPortal, is_filled: bool) -> PortalKind {
        if p.kind == PortalKind::Crack {
            return PortalKind::Crack;
        }
        let is_upright = is_upright(p);
        match self.filling(p).filter(|_| is_upright) {
            Some(Filling::Door) => return PortalKind::Door,
            Some(Filling::Window) => return PortalKind::Window,
            None => {}
        }
        if !is_filled {
            return unfilled(p.width, is_upright && self.sill(p) > PARAPET);
        }
        if is_upright && height(p) >= LOWEST_DOOR && self.is_stepped_through(p) {
            PortalKind::Door
        } else {
            PortalKind::Window
        }
    }

    /// Returns `true` if the sill of an upright opening is that of a door.
    ///
    /// The ground outdoors says nothing: it is often missing, and so are balconies.
    fn is_stepped_through(&self, p: &PartitionPortal) -> bool {
        let leads_outdoors = p.cells.iter().any(|&c| self.cut.is_outdoors(c));
        self.sill(p) <= if leads_outdoors { THRESHOLD } else { PARAPET }
    }

    /// Returns the name of what fills an opening, if it has one: of the door or the window that covers more of it.
    fn filling(&self, p: &PartitionPortal) -> Option<Filling> {
        if !self.cut.allowance.spend(1 + self.named.len() as u64 / 16) {
            return None;
        }
        let corners: Vec<DVec3> = p.pieces.iter().flat_map(|w| w.points.clone()).collect();
        let opening = Rectangle::around(p.plane.normal, &corners);
        let deepest = deepest_leaf(opening.size());
        let reach = Aabb::of_points(&corners).expanded(deepest + REBATE);
        let out = DVec3::new(REBATE, REBATE, deepest);
        let limits = Aabb::new(opening.low - out, opening.high + out);
        let is_in = |b: &Aabb| limits.contains(b.min) && limits.contains(b.max);
        let near: Vec<&NamedShell> = (self.named.iter())
            .filter(|s| s.aabb.overlaps(&reach))
            .collect();
        let of = |filling: Filling| near.iter().filter(move |s| s.filling == filling);
        let bounds = |s: &NamedShell| opening.bounds(&s.triangles);
        // A leaf belongs to one opening; a row of windows counts with the part before this one.
        let leaves = of(Filling::Door).filter(|s| is_in(&bounds(s)));
        let leaves = leaves.flat_map(|s| s.triangles.iter().copied());
        let panes = of(Filling::Window).flat_map(|s| s.triangles.iter().copied());
        let panes = panes.filter(|t| {
            let b = opening.bounds(&[*t]);
            b.min.z >= limits.min.z && b.max.z <= limits.max.z
        });
        // A window may lack its panes, but a door without a leaf is none.
        let frames = of(Filling::Window).map(|s| bounds(s)).filter(is_in);
        let frames = frames.fold(Aabb::EMPTY, Aabb::union);
        let size = opening.size();
        let common = frames.max.min(opening.high) - frames.min.max(opening.low);
        let framed = common.x.max(0.0) * common.y.max(0.0) / (size.x * size.y);
        let door = opening.mask(leaves).share();
        let window = opening.mask(panes).share().max(framed);
        if door.max(window) < FILLS {
            None
        } else if window > door {
            Some(Filling::Window)
        } else {
            Some(Filling::Door)
        }
    }

    /// Returns the height of an upright opening's lower edge over the ground beside it, as [`sill`] does.
    fn sill(&self, p: &PartitionPortal) -> f64 {
        let foot = p.outline.centroid().with_y(bottom(p));
        sill(&self.cut.structure.bvh, p.plane.normal, foot)
    }
}

/// Returns the kind of an opening that nothing fills.
fn unfilled(width: f64, has_parapet: bool) -> PortalKind {
    if width < SLIT {
        PortalKind::Crack
    } else if has_parapet {
        PortalKind::Window
    } else {
        PortalKind::Open
    }
}

/// Returns the kind of a portal that was taken for a door, but has no leaf.
pub(super) fn without_leaf(p: &Portal, walls: &Bvh) -> PortalKind {
    let corners = p.pieces.iter().flatten();
    let corners: Vec<DVec3> = corners.map(|&c| DVec3::from(c.map(f64::from))).collect();
    let normal = DVec3::from(p.normal.map(f64::from));
    let Some(&first) = corners.first() else {
        return p.kind;
    };
    let outline = Winding::hull_in_plane(&Plane::through(first, normal), &corners);
    let low = corners.iter().map(|c| c.y).fold(f64::MAX, f64::min);
    let foot = outline.centroid().with_y(low);
    unfilled(f64::INFINITY, sill(walls, normal, foot) > PARAPET)
}

/// Returns the height of an upright opening's lower edge, with `foot` in its middle, over the ground half a meter before or behind
/// it, on the higher side; infinite where there is none. [Units: wu]
fn sill(walls: &Bvh, normal: DVec3, foot: DVec3) -> f64 {
    let out = DVec3::new(normal.x, 0.0, normal.z).normalize_or_zero();
    let drops = [0.5, -0.5].map(|side| {
        let ray = Ray {
            origin: foot + DVec3::Y * 0.05 + out * side,
            direction: -DVec3::Y,
            t_max: 100.0,
        };
        let hit = walls.closest_hit(&ray, |_| false);
        hit.map_or(f64::INFINITY, |h| h.t - 0.05)
    });
    drops[0].min(drops[1])
}

fn is_upright(p: &PartitionPortal) -> bool {
    !is_rather_level(p.plane.normal)
}

fn bottom(p: &PartitionPortal) -> f64 {
    let up = p.outline.points.iter().map(|q| q.y);
    up.fold(f64::MAX, f64::min)
}

fn height(p: &PartitionPortal) -> f64 {
    let up = p.outline.points.iter().map(|q| q.y);
    up.fold(f64::MIN, f64::max) - bottom(p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::CellId;

    #[test]
    fn what_was_taken_for_a_door_is_an_opening_or_above_a_parapet_a_window() {
        let floor = |y: f64| {
            let [a, b, c] =
                [(-9.0, -9.0), (9.0, -9.0), (0.0, 9.0)].map(|(x, z)| DVec3::new(x, y, z));
            Bvh::build(&[[a, b, c]])
        };
        let piece = [
            [0.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [0.0, 2.0, 1.0],
            [0.0, 0.0, 1.0],
        ];
        let door = Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Door,
            normal: [1.0, 0.0, 0.0],
            outline: piece.to_vec(),
            pieces: vec![piece.to_vec()],
            area: 2.0,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        assert_eq!(without_leaf(&door, &floor(-0.39)), PortalKind::Open);
        assert_eq!(without_leaf(&door, &floor(-0.41)), PortalKind::Window);
    }
}
