//! Finds the leaves of doors among the shells of an object, and their poses: shut, or open by an angle.
//!
//! A *body* is a plate about as high as the opening: a leaf, one of its two skins, or the glass within its rails. A
//! *ring* runs around something: a frame, or the rails of a leaf. Other shells are small, such as a handle or a hinge,
//! and belong to the leaf on which their middle lies.

use std::collections::BTreeMap;

use enfilade_cpg::{Portal, PortalKind};
use enfilade_geom::filler::{
    DEEPEST, FILLED, Filler, FillerFacts, LEAF, LOWEST_DOOR, deepest_leaf,
};
use enfilade_geom::{Aabb, DVec3, Mask, Rectangle, Triangle};

/// Height of a leaf over that of its opening; less if a light is above the door, more if it overlaps the frame.
const HEIGHT: [f64; 2] = [0.7, 1.1];
/// Width of a body over that of its opening: from the glass in one of two leaves to a leaf that overlaps the frame.
const WIDTH: [f64; 2] = [0.2, 1.1];
/// Width of an open leaf over that of its opening, for a single leaf and for one of two.
const OPEN_WIDTHS: [[f64; 2]; 2] = [[0.8, 1.1], [0.4, 0.55]];
/// A shut leaf is tilted from the opening's plane by less: the sine of 3 degrees.
const SHUT: f64 = 0.05;
/// Largest angle of an open leaf: beyond it, the object would lie along the wall, as a cupboard does. [Units: degrees]
const MOST_TURNED: f64 = 130.0;
/// Greatest distance from the edge of a leaf or frame to the jamb, sill or head. [Units: wu]
const OFF: f64 = 0.15;
/// Greatest distance by which an object on a leaf reaches over its edges. [Units: wu]
const HAIR: f64 = 0.01;
/// Range of widths of openings that have doors. [Units: wu]
const DOOR_WIDTH: [f64; 2] = [0.5, 6.0];
/// Least share of a door that an object covers to be its leaf if none of its shells is a plate.
const WHOLE: f64 = 0.5;
/// Least share of a window that a pane covers.
const PANE: f64 = 0.3;

/// A leaf in an object.
#[derive(Clone, Debug)]
pub(super) struct Leaf {
    /// Shell numbers, ascending.
    pub(super) shells: Vec<u32>,
    /// The rectangle around its bodies.
    pub(super) around: Rectangle,
    pub(super) pose: Pose,
    /// Position of its outermost handle along `around.across`, from the middle in half widths; 0 if it has none.
    pub(super) handle: f64,
    /// Share of the opening that it covers; for an open leaf, how well it fits: 1 at best.
    pub(super) fit: f64,
}

impl Leaf {
    /// Returns `true` if triangles lie on it, like those of a handle or of its glass.
    pub(super) fn carries(&self, triangles: &[Triangle]) -> bool {
        let r = &self.around;
        let b = r.bounds(triangles);
        let grow = DVec3::new(HAIR, HAIR, OFF);
        b.min.cmpge(r.low - grow).all() && b.max.cmple(r.high + grow).all()
    }
}

/// The pose of a leaf in the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pose {
    Shut,
    /// Turned around its hinge by an angle, counter-clockwise seen from above. [Units: rad]
    Open {
        hinge: DVec3,
        angle: f64,
    },
}

/// Roles of an object at an opening.
#[derive(Clone, Debug, Default)]
pub(super) struct Roles {
    pub(super) leaves: Vec<Leaf>,
    /// The shells that are not leaves run around the opening.
    pub(super) is_frame: bool,
    pub(super) is_pane: bool,
}

/// The opening of a portal.
pub(super) struct Aperture {
    pub(super) kind: PortalKind,
    pub(super) around: Rectangle,
    pub(super) open: Mask,
}

impl Aperture {
    /// Returns `None` if the portal is a crack or not upright.
    pub(super) fn of(portal: &Portal) -> Option<Self> {
        if portal.kind == PortalKind::Crack || portal.is_level() {
            return None;
        }
        let point = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let points: Vec<DVec3> = portal.pieces.iter().flatten().map(|p| point(*p)).collect();
        let around = Rectangle::around(point(portal.normal), &points);
        let fans = portal.pieces.iter().flat_map(|piece| {
            (2..piece.len()).map(move |i| [piece[0], piece[i - 1], piece[i]].map(point))
        });
        Some(Self {
            kind: portal.kind,
            open: around.mask(fans),
            around,
        })
    }

    /// Returns `true` if a door fits into it, or is in it: hatches and gates are lower, and say that they are doors.
    fn takes_door(&self) -> bool {
        let size = self.around.size();
        let is_sized = size.x >= DOOR_WIDTH[0] && size.x <= DOOR_WIDTH[1] && size.y >= LOWEST_DOOR;
        is_sized || self.kind == PortalKind::Door
    }

    /// Returns the box that contains its leaves, frames and panes.
    pub(super) fn reach(&self) -> Aabb {
        let r = &self.around;
        // An open leaf reaches as far as it is wide.
        let out = if self.takes_door() {
            r.size().x + OFF
        } else {
            DEEPEST
        };
        let grow = DVec3::new(out.min(DOOR_WIDTH[1]), OFF, out.max(DEEPEST));
        let (low, high) = (r.low - grow, r.high + grow);
        Aabb::new(low, high)
            .corners()
            .iter()
            .fold(Aabb::EMPTY, |b, p| b.including(r.point(*p)))
    }
}

/// A shell and its shape.
struct Shell<'t> {
    number: u32,
    triangles: Vec<&'t Triangle>,
    around: Rectangle,
    facts: FillerFacts,
    /// Share of its foot that it covers.
    foot: f64,
}

impl<'t> Shell<'t> {
    fn of(number: u32, triangles: Vec<&'t Triangle>) -> Self {
        let owned: Vec<Triangle> = triangles.iter().map(|t| **t).collect();
        let around = Rectangle::upright(&owned);
        let mask = around.mask(owned);
        Self {
            number,
            triangles,
            facts: FillerFacts::of(&around, &mask),
            foot: mask.share_at_foot(),
            around,
        }
    }

    fn is_body(&self, opening: &Rectangle) -> bool {
        let share = self.facts.size / opening.size();
        let fits = |x: f64, [least, most]: [f64; 2]| x >= least && x <= most;
        matches!(self.facts.kind(), Filler::Leaf | Filler::Pane)
            && fits(share.y, HEIGHT)
            && fits(share.x, WIDTH)
    }

    /// Returns `true` if it runs around something as high as the opening, however deep it is.
    fn is_ring(&self, opening: &Rectangle) -> bool {
        let share = self.facts.size / opening.size();
        share.y >= HEIGHT[0] && share.x >= WIDTH[0] && self.facts.covered < FILLED
    }
}

/// An object divided into shells.
pub(super) struct InShells<'a> {
    pub(super) triangles: &'a [Triangle],
    /// Shell of each triangle.
    pub(super) shells: &'a [u32],
    /// Bounding box of each shell.
    pub(super) bounds: &'a [Aabb],
}

/// Returns the roles of an object at an opening.
pub(super) fn roles(opening: &Aperture, object: &InShells<'_>) -> Roles {
    let near = near_shells(opening, object);
    let mut roles = Roles::default();
    if near.is_empty() {
        return roles;
    }
    let around = &opening.around;
    let all = || near.iter().flat_map(|s| s.triangles.iter().map(|t| **t));
    let bounds = all()
        .flatten()
        .fold(Aabb::EMPTY, |b, p| b.including(around.place(p)));
    let deepest = deepest_leaf(around.size());
    let is_within_wall = bounds.min.z >= around.low.z - deepest
        && bounds.max.z <= around.high.z + deepest
        && bounds.size().z <= 2.0 * deepest;
    let covered = opening.open.share_in(&around.mask(all()));
    if opening.takes_door() && opening.kind != PortalKind::Window {
        roles.leaves = leaves(opening, &near);
        if roles.leaves.is_empty()
            && opening.kind == PortalKind::Door
            && is_within_wall
            && covered >= WHOLE
        {
            roles.leaves = vec![whole(opening, &near, covered)];
        }
    }
    let n_taken: usize = roles.leaves.iter().map(|l| l.shells.len()).sum();
    if n_taken == near.len() || !is_within_wall {
        return roles;
    }
    roles.is_pane = opening.kind == PortalKind::Window && covered >= PANE;
    let reaches = |own: f64, rim: f64| (own - rim).abs() <= OFF;
    roles.is_frame = !roles.is_pane
        && (!roles.leaves.is_empty()
            || reaches(bounds.min.x, around.low.x)
                && reaches(bounds.max.x, around.high.x)
                && reaches(bounds.max.y, around.high.y));
    roles
}

/// Returns the shells of an object near an opening: within it, or for a window without any, those that lie in its wall and reach
/// beyond it, as one pane of two portals does. Reads triangles only if there are any.
fn near_shells<'t>(opening: &Aperture, object: &InShells<'t>) -> Vec<Shell<'t>> {
    let reach = opening.reach().expanded(OFF);
    let chosen = |is_chosen: &dyn Fn(&Aabb) -> bool| -> BTreeMap<u32, Vec<&'t Triangle>> {
        let shells = (0..).zip(object.bounds).filter(|(_, b)| is_chosen(b));
        shells.map(|(shell, _)| (shell, Vec::new())).collect()
    };
    let mut near = chosen(&|b| reach.contains(b.min) && reach.contains(b.max));
    let is_beyond = near.is_empty() && opening.kind == PortalKind::Window;
    if is_beyond {
        near = chosen(&|b| b.overlaps(&reach));
    }
    if near.is_empty() {
        return Vec::new();
    }
    for (t, shell) in object.triangles.iter().zip(object.shells) {
        if let Some(own) = near.get_mut(shell) {
            own.push(t);
        }
    }
    if is_beyond {
        let around = &opening.around;
        let depth = around.low.z - DEEPEST..=around.high.z + DEEPEST;
        let is_in = |t: &&Triangle| t.iter().all(|p| depth.contains(&around.place(*p).z));
        near.retain(|_, own| own.iter().all(is_in));
    }
    let near = near.into_iter();
    near.map(|(shell, triangles)| Shell::of(shell, triangles))
        .collect()
}

/// Returns an entire object as one shut leaf.
fn whole(opening: &Aperture, near: &[Shell], covered: f64) -> Leaf {
    let corners = near
        .iter()
        .flat_map(|s| s.triangles.iter().copied().flatten());
    let corners: Vec<DVec3> = corners.copied().collect();
    Leaf {
        shells: near.iter().map(|s| s.number).collect(),
        around: Rectangle::around(opening.around.normal, &corners),
        pose: Pose::Shut,
        handle: 0.0,
        fit: covered,
    }
}

fn leaves(opening: &Aperture, near: &[Shell]) -> Vec<Leaf> {
    let mut leaves: Vec<Leaf> = Vec::new();
    for shell in near.iter().filter(|s| s.is_body(&opening.around)) {
        let Some((pose, fit)) = pose(opening, shell) else {
            continue;
        };
        // Two skins of one leaf, or its glass and its panel.
        let same = leaves.iter_mut().find(|l| is_one(l, shell));
        if let Some(leaf) = same {
            leaf.shells.push(shell.number);
            let size = [leaf.around.size().x, shell.around.size().x];
            if size[1] > size[0] {
                (leaf.around, leaf.pose) = (shell.around.clone(), pose);
            }
            leaf.fit = leaf.fit.max(fit);
        } else {
            leaves.push(Leaf {
                shells: vec![shell.number],
                around: shell.around.clone(),
                pose,
                handle: 0.0,
                fit,
            });
        }
    }
    let rings: Vec<&Shell> = near.iter().filter(|s| s.is_ring(&opening.around)).collect();
    for shell in near {
        if leaves.iter().any(|l| l.shells.contains(&shell.number)) {
            continue;
        }
        let is_ring = rings.iter().any(|r| r.number == shell.number);
        if is_ring && is_frame(shell, &rings) {
            continue;
        }
        if is_ring {
            join_within(shell, &mut leaves);
        }
        attach(shell, is_ring, &mut leaves);
    }
    for leaf in &mut leaves {
        leaf.shells.sort_unstable();
    }
    leaves
}

/// Returns the pose of a body in an opening, and how well it fits; `None` if it is not a leaf of the opening.
fn pose(opening: &Aperture, body: &Shell) -> Option<(Pose, f64)> {
    let (r, own) = (&opening.around, &body.around);
    let center = own.point((own.low + own.high) * 0.5);
    let at = r.place(center);
    let z = (r.low.z + r.high.z) * 0.5;
    let is_flat = own.across.dot(r.normal).abs() < SHUT;
    if is_flat && at.x > r.low.x && at.x < r.high.x && (at.z - z).abs() <= DEEPEST {
        let covered = opening
            .open
            .share_in(&r.mask(body.triangles.iter().map(|t| **t)));
        // An object in front of an opening without a door does not shut it.
        let is_shut = opening.kind == PortalKind::Door && covered >= WIDTH[0];
        return is_shut.then_some((Pose::Shut, covered));
    }
    let width = own.size().x;
    let fits = |[least, most]: [f64; 2]| {
        let share = width / r.size().x;
        share >= least && share <= most
    };
    let is_on_sill = (own.low.y - r.low.y).abs() <= OFF;
    if own.size().z > LEAF || !OPEN_WIDTHS.into_iter().any(fits) || !is_on_sill {
        return None;
    }
    let ends = [-0.5, 0.5].map(|k| center + own.across * (k * width));
    let mut best: Option<(f64, Pose)> = None;
    for (end, far) in [(ends[0], ends[1]), (ends[1], ends[0])] {
        for (jamb, sign) in [(r.low.x, 1.0), (r.high.x, -1.0)] {
            let p = r.place(end);
            let off = (p.x - jamb).abs();
            let is_at_jamb = off <= OFF + own.size().z && (p.z - z).abs() <= DEEPEST;
            let angle = turn(r.across * sign, far - end);
            let turned = angle.abs().to_degrees();
            if is_at_jamb && turned <= MOST_TURNED && best.is_none_or(|(o, _)| off < o) {
                let pose = Pose::Open { hinge: end, angle };
                best = Some((off, pose));
            }
        }
    }
    best.map(|(off, pose)| (pose, 1.0 - off))
}

/// Returns the angle from one horizontal direction to another, counter-clockwise seen from above. [Units: rad]
fn turn(from: DVec3, to: DVec3) -> f64 {
    // Seen from above with x to the right, z points down.
    let cross = from.z * to.x - from.x * to.z;
    let dot = from.x * to.x + from.z * to.z;
    cross.atan2(dot)
}

/// Returns `true` if a body lies on a leaf: another skin or a panel of it.
fn is_one(leaf: &Leaf, body: &Shell) -> bool {
    let (a, b) = (&leaf.around, &body.around);
    let center = a.place(b.point((b.low + b.high) * 0.5));
    let is_flat = a.across.dot(b.normal).abs() < 3.0 * SHUT;
    let is_inside = center.cmpge(a.low - OFF).all() && center.cmple(a.high + OFF).all();
    let back = b.place(a.point((a.low + a.high) * 0.5));
    let is_around = back.x >= b.low.x && back.x <= b.high.x;
    is_flat && is_inside && (is_around || center.x >= a.low.x && center.x <= a.high.x)
}

/// Returns `true` if a ring is a frame, not the rails of a leaf: it has no rail at its foot or contains another ring,
/// and no ring contains it.
fn is_frame(ring: &Shell, rings: &[&Shell]) -> bool {
    let lies_in = |inner: &Shell, outer: &Shell| {
        let b = outer.around.bounds(&[[
            inner.around.point(inner.around.low),
            inner.around.point(inner.around.high),
            inner
                .around
                .point((inner.around.low + inner.around.high) * 0.5),
        ]]);
        let (low, high) = (outer.around.low, outer.around.high);
        inner.number != outer.number && b.min.x > low.x && b.max.x < high.x && b.max.y < high.y
    };
    let is_inner = rings.iter().any(|r| lies_in(ring, r));
    let is_outer = rings.iter().any(|r| lies_in(r, ring));
    !is_inner && (is_outer || ring.foot < FILLED)
}

/// Merges leaves that share their rails: a single piece cannot part in the middle.
fn join_within(rails: &Shell, leaves: &mut Vec<Leaf>) {
    let r = &rails.around;
    let is_within = |l: &Leaf| {
        let p = r.place(l.around.point((l.around.low + l.around.high) * 0.5));
        l.pose == Pose::Shut && p.cmpgt(r.low - OFF).all() && p.cmplt(r.high + OFF).all()
    };
    if leaves.iter().filter(|l| is_within(l)).count() < 2 {
        return;
    }
    let mut whole = Leaf {
        shells: Vec::new(),
        around: r.clone(),
        pose: Pose::Shut,
        handle: 0.0,
        fit: 0.0,
    };
    leaves.retain(|leaf| {
        if !is_within(leaf) {
            return true;
        }
        whole.shells.extend(&leaf.shells);
        whole.fit += leaf.fit;
        false
    });
    leaves.push(whole);
}

/// Adds a shell that is not a body to the leaf on which it lies, if any.
fn attach(shell: &Shell, is_ring: bool, leaves: &mut [Leaf]) {
    let own = &shell.around;
    let center = own.point((own.low + own.high) * 0.5);
    for leaf in leaves {
        let r = &leaf.around;
        let at = r.place(center);
        let is_on = at.x > r.low.x && at.x < r.high.x && at.y > r.low.y && at.y < r.high.y;
        let is_near = at.z > r.low.z - OFF && at.z < r.high.z + OFF;
        if is_on && is_near {
            leaf.shells.push(shell.number);
            let half = r.size().x * 0.5;
            let off = (at.x - (r.low.x + r.high.x) * 0.5) / half;
            // Keep the outermost of several handles.
            if !is_ring && off.abs() > leaf.handle.abs() {
                leaf.handle = off;
            }
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::CellId;

    /// A door of 1.8 × 2.1 m across z.
    fn doorway() -> Aperture {
        let outline = [[0.0, 0.0], [1.8, 0.0], [1.8, 2.1], [0.0, 2.1]];
        let outline: Vec<[f32; 3]> = outline.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        let portal = Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Door,
            normal: [0.0, 0.0, 1.0],
            pieces: vec![outline.clone()],
            outline,
            area: 3.78,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        Aperture::of(&portal).unwrap()
    }

    /// Returns the roles of boxes across the opening, 4 cm thick, each with its shell: left, foot, right, head.
    fn roles_of(boxes: &[(u32, [f64; 4])]) -> Roles {
        let (mut triangles, mut shells, mut bounds) = (Vec::new(), Vec::new(), Vec::new());
        for &(shell, [x0, y0, x1, y1]) in boxes {
            let b = Aabb::new(DVec3::new(x0, y0, -0.02), DVec3::new(x1, y1, 0.02));
            triangles.extend(b.triangles());
            shells.extend([shell; 12]);
            bounds.resize(bounds.len().max(shell as usize + 1), Aabb::EMPTY);
            bounds[shell as usize] = bounds[shell as usize].union(b);
        }
        let object = InShells {
            triangles: &triangles,
            shells: &shells,
            bounds: &bounds,
        };
        roles(&doorway(), &object)
    }

    const FRAME: [(u32, [f64; 4]); 3] = [
        (0, [0.0, 0.0, 0.04, 2.1]),
        (0, [1.76, 0.0, 1.8, 2.1]),
        (0, [0.04, 2.06, 1.76, 2.1]),
    ];

    /// Stiles and rails around a pane, from `x` to `x + 0.86`.
    fn glazed(x: f64, rails: u32, pane: u32) -> [(u32, [f64; 4]); 5] {
        [
            (rails, [x, 0.0, x + 0.1, 2.06]),
            (rails, [x + 0.76, 0.0, x + 0.86, 2.06]),
            (rails, [x + 0.1, 0.0, x + 0.76, 0.1]),
            (rails, [x + 0.1, 1.96, x + 0.76, 2.06]),
            (pane, [x + 0.1, 0.1, x + 0.76, 1.96]),
        ]
    }

    #[test]
    fn rails_go_with_their_pane_and_the_frame_stays() {
        let boxes = [&FRAME[..], &glazed(0.04, 1, 2), &glazed(0.9, 3, 4)].concat();
        let roles = roles_of(&boxes);
        let leaves: Vec<&[u32]> = roles.leaves.iter().map(|l| &l.shells[..]).collect();
        assert_eq!(leaves, [&[1, 2][..], &[3, 4]]);
        assert!(roles.is_frame);
    }

    #[test]
    fn panes_in_rails_of_one_piece_are_one_leaf() {
        let boxes = [&FRAME[..], &glazed(0.04, 1, 2), &glazed(0.9, 1, 3)].concat();
        let roles = roles_of(&boxes);
        let leaves: Vec<&[u32]> = roles.leaves.iter().map(|l| &l.shells[..]).collect();
        assert_eq!(leaves, [&[1, 2, 3][..]]);
        assert!((roles.leaves[0].around.size().x - 1.72).abs() < 1e-9);
    }
}
