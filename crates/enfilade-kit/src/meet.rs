//! Encounters of an instance where it is placed: openings that fit, walls in front of openings, and instances in its way.

use enfilade_geom::poly::{self, Poly, Sides};
use enfilade_geom::{Aabb, DVec3};
use enfilade_world::Pose;

use crate::body::Body;
use crate::error::PlaceError;
use crate::fit::Mouth;
use crate::instance::{End, InstanceId, Instances, Link};
use crate::piece::Piece;
use crate::region::plane_of;

/// Share of an opening below which what covers it does not count, and above which the rest does not: rounding at its rim.
const RIM: f64 = 0.01;

/// Limits of what may meet.
#[derive(Clone, Copy)]
pub(crate) struct Rules {
    /// As [`Assembly::set_tolerance`](crate::Assembly::set_tolerance).
    pub(crate) tolerance: f64,
    /// As [`PlaceOptions::overlap`](crate::PlaceOptions::overlap).
    pub(crate) overlap: bool,
}

/// Links of an instance.
pub(crate) struct Links {
    pub(crate) own: Vec<Link>,
    /// Open attachments of others that it walls up.
    pub(crate) blocked: Vec<End>,
}

/// A piece at a pose.
#[derive(Clone, Copy)]
struct Placed<'a> {
    piece: &'a Piece,
    pose: &'a Pose,
}

impl Placed<'_> {
    /// Returns a mouth in the frame of the level: its vertices, and the way out.
    fn mouth(&self, attachment: usize) -> (Vec<DVec3>, DVec3) {
        let mouth = &self.piece.attachments()[attachment].mouth;
        let corners = mouth.corners().into_iter().map(|p| self.pose.point(p));
        let out = self.pose.direction(mouth.frame.direction(DVec3::Z));
        (corners.collect(), out)
    }
}

/// Returns the links of a piece placed at a pose among its neighbors.
pub(crate) fn meetings(
    level: &Instances,
    piece: usize,
    pose: &Pose,
    near: &[InstanceId],
    rules: Rules,
) -> Result<Links, PlaceError> {
    let own = Placed {
        piece: &level.kit.pieces()[piece],
        pose,
    };
    let others: Vec<(InstanceId, Placed<'_>)> =
        (near.iter()).map(|&id| (id, placed(level, id))).collect();
    if !rules.overlap {
        for (id, other) in &others {
            if let Some((by, at)) = deepest(own, *other, rules.tolerance) {
                let with = level.get(*id).name.clone();
                return Err(PlaceError::Overlaps {
                    with,
                    by,
                    at: at.to_array(),
                });
            }
        }
    }
    let mut links = Links {
        own: vec![Link::Open; own.piece.attachments().len()],
        blocked: Vec::new(),
    };
    join(level, own, &others, rules.tolerance, &mut links);
    let own_name = own.piece.name();
    for attachment in 0..links.own.len() {
        if links.own[attachment] != Link::Open {
            continue;
        }
        let end = || format!("{own_name}.{}", own.piece.attachments()[attachment].name);
        let shares = others
            .iter()
            .map(|&(id, other)| (id, covered(own, attachment, other, rules.tolerance)));
        if let Some(by) = blocked(level, rules, end, own, attachment, shares)? {
            links.own[attachment] = Link::Blocked(by);
        }
    }
    for &(id, other) in &others {
        for (attachment, link) in level.get(id).links.iter().enumerate() {
            let end = End {
                instance: id,
                attachment,
            };
            if *link != Link::Open || links.own.contains(&Link::Joined(end)) {
                continue;
            }
            let share = covered(other, attachment, own, rules.tolerance);
            let name = || level.end_name(end);
            // Named after the piece: the instance does not exist yet.
            if share > RIM && share < 1.0 - RIM && !rules.overlap {
                return Err(partly(
                    name(),
                    share,
                    own_name.to_owned(),
                    other,
                    attachment,
                ));
            }
            if share >= 1.0 - RIM {
                links.blocked.push(end);
            }
        }
    }
    Ok(links)
}

fn partly(
    end: String,
    share: f64,
    behind: String,
    of: Placed<'_>,
    attachment: usize,
) -> PlaceError {
    let sill = of.piece.attachments()[attachment].mouth.frame.at;
    PlaceError::PartlyBlocked {
        end,
        share,
        behind,
        at: of.pose.point(sill).to_array(),
    }
}

/// Returns the instance that walls up an opening, given the share of it that each covers.
fn blocked(
    level: &Instances,
    rules: Rules,
    end: impl Fn() -> String,
    of: Placed<'_>,
    attachment: usize,
    shares: impl Iterator<Item = (InstanceId, f64)>,
) -> Result<Option<InstanceId>, PlaceError> {
    let (mut sum, mut most): (f64, Option<(InstanceId, f64)>) = (0.0, None);
    for (id, share) in shares {
        sum += share;
        if share > most.map_or(0.0, |m| m.1) {
            most = Some((id, share));
        }
    }
    match most {
        Some((id, _)) if sum >= 1.0 - RIM => Ok(Some(id)),
        Some((id, _)) if sum > RIM && !rules.overlap => {
            let behind = level.get(id).name.clone();
            Err(partly(end(), sum, behind, of, attachment))
        }
        _ => Ok(None),
    }
}

/// Returns the instance of those given that walls up an attachment.
pub(crate) fn walled_up(
    level: &Instances,
    end: End,
    beside: &[InstanceId],
    tolerance: f64,
) -> Option<InstanceId> {
    let of = placed(level, end.instance);
    let shares = (beside.iter()).map(|&id| {
        (
            id,
            covered(of, end.attachment, placed(level, id), tolerance),
        )
    });
    let rules = Rules {
        tolerance,
        overlap: true,
    };
    let name = || level.end_name(end);
    // Nothing is refused where overlaps are allowed.
    blocked(level, rules, name, of, end.attachment, shares)
        .ok()
        .flatten()
}

fn placed(level: &Instances, id: InstanceId) -> Placed<'_> {
    Placed {
        piece: level.piece(id),
        pose: &level.get(id).pose,
    }
}

/// Joins the attachments of a piece with the open ones of others that they meet.
fn join(
    level: &Instances,
    own: Placed<'_>,
    others: &[(InstanceId, Placed<'_>)],
    tolerance: f64,
    links: &mut Links,
) {
    for &(instance, other) in others {
        let to_own = own.pose.inverse().after(other.pose);
        for (attachment, link) in level.get(instance).links.iter().enumerate() {
            if *link != Link::Open {
                continue;
            }
            let its = &other.piece.attachments()[attachment].mouth;
            let meets = |mine: &Mouth| is_met(mine, its, &to_own, tolerance);
            let mouths = own.piece.attachments().iter().map(|a| &a.mouth);
            let free = mouths
                .zip(&mut links.own)
                .find(|(mine, l)| **l == Link::Open && meets(mine));
            if let Some((_, link)) = free {
                *link = Link::Joined(End {
                    instance,
                    attachment,
                });
            }
        }
    }
}

/// Returns `true` if two mouths face each other within a tolerance, the second in a piece at a pose in that of the first.
fn is_met(own: &Mouth, its: &Mouth, to_own: &Pose, tolerance: f64) -> bool {
    let between = own.frame.inverse().after(to_own).after(&its.frame);
    if between.at.length() > own.radius() + its.radius() + tolerance {
        return false;
    }
    let corners: Vec<DVec3> = (its.outline.iter())
        .map(|p| between.point(p.extend(0.0)))
        .collect();
    let faces = between.direction(DVec3::Z).z < 0.0;
    // Compared in the plane of the first, by the farthest vertex.
    let flat = Mouth {
        frame: Pose::IDENTITY,
        outline: corners
            .iter()
            .map(|p| enfilade_geom::DVec2::new(-p.x, p.y))
            .collect(),
        area: its.area,
    };
    faces && corners.iter().all(|p| p.z.abs() <= tolerance) && own.misfit(&flat, 0.0) <= tolerance
}

/// Returns the share of an opening that is in front of another piece.
fn covered(of: Placed<'_>, attachment: usize, other: Placed<'_>, tolerance: f64) -> f64 {
    let (corners, out) = of.mouth(attachment);
    let pushed = corners
        .iter()
        .map(|p| other.pose.point_back(*p + out * (2.0 * tolerance)));
    let polygon: Poly = pushed.collect();
    let whole = poly::area(&polygon);
    if whole <= 0.0 || !Aabb::of_points(&polygon).overlaps(other.piece.bounds()) {
        return 0.0;
    }
    let locator = &other.piece.world().graph.locator;
    let outdoors = enfilade_cpg::Locator::leaf(Some(other.piece.outdoors));
    let mut sum = 0.0;
    let mut stack = vec![(locator.root, polygon)];
    while let Some((at, polygon)) = stack.pop() {
        let Ok(node) = usize::try_from(at) else {
            if at != outdoors {
                sum += poly::area(&polygon);
            }
            continue;
        };
        let [front, back] = locator.nodes[node].children;
        match poly::split(&polygon, &plane_of(locator, node), 0.0) {
            Sides::Front | Sides::On => stack.push((front, polygon)),
            Sides::Back => stack.push((back, polygon)),
            Sides::Both(a, b) => stack.extend([(front, a), (back, b)]),
        }
    }
    sum / whole
}

/// Returns how deep two pieces are in each other, and where, in the frame of the level; `None` within the tolerance.
///
/// Exact: air in air, and air in matter, by the convex leaves of their locators, surfaces outdoors by their triangles. Objects outdoors
/// count as their boxes. Walls may be in walls.
fn deepest(a: Placed<'_>, b: Placed<'_>, tolerance: f64) -> Option<(f64, DVec3)> {
    let to_a = a.pose.inverse().after(b.pose);
    let in_a = |bounds: &Aabb| Aabb::of_points(&bounds.corners().map(|p| to_a.point(p)));
    let [shape, its] = [&a.piece.shape, &b.piece.shape];
    let near_b = in_a(&its.hull).expanded(-tolerance);
    let near_a = shape.hull.expanded(-tolerance);
    let reaches = |own: &&Body| own.bounds.overlaps(&near_b);
    let moved = |bodies: &'_ [Body]| -> Vec<(Aabb, usize)> {
        let boxes = bodies
            .iter()
            .enumerate()
            .map(|(k, body)| (in_a(&body.bounds), k));
        boxes
            .filter(|(bounds, _)| bounds.overlaps(&near_a))
            .collect()
    };
    let (air, matter) = (moved(&its.air), moved(&its.matter));
    let mut deepest: Option<(f64, DVec3)> = None;
    let mut test = |own: &Body, (bounds, other): (&Aabb, &Body)| {
        if !own.bounds.overlaps(bounds) {
            return;
        }
        if let Some(depth) = own.overlap(other, &to_a, tolerance)
            && deepest.is_none_or(|d| depth > d.0)
        {
            let shared = own.bounds.intersection(*bounds);
            deepest = Some((depth, a.pose.point(shared.center())));
        }
    };
    for own in shape.air.iter().filter(reaches) {
        for (bounds, k) in &air {
            test(own, (bounds, &its.air[*k]));
        }
        for (bounds, k) in &matter {
            test(own, (bounds, &its.matter[*k]));
        }
    }
    for own in shape.matter.iter().filter(reaches) {
        for (bounds, k) in &air {
            test(own, (bounds, &its.air[*k]));
        }
    }
    deepest
}
