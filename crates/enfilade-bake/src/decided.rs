//! Decisions of people about rooms ([`BakeConfig::decisions`](crate::BakeConfig::decisions)), in a finished world.
//!
//! A bake decides by measures, and says which decisions were close. A person who knows the building settles them here: two cells
//! become one by taking their portals away, one becomes two by a portal in the narrowest section of its air around the given point,
//! and an opening becomes a door. All else stays as it was.
//!
//! A section is found by rays in upright planes through the point and near it, along and across the walls around, and in the level
//! plane; the narrowest that parts the cell is taken. Some 10⁴ rays and at most a few complexes of the one cell for each decision.

use std::f64::consts::{PI, TAU};

use enfilade_cpg::{CellId, DecidedPlace, PortalId, PortalKind, Reason, Why, World};
use enfilade_geom::{Bvh, DVec3, Plane, Ray, Triangle, Winding, shown, triangle_area_normal};

use crate::config::{RoomAnswer, RoomDecision};
use crate::edit::{AddPortalError, Added, add_portal, triangles_of};
use crate::simplify::delete_portal;

/// Distance from a portal or a close decision within which a point means it. [Units: wu]
const REACH: f64 = 1.0;
/// … from a portal, where it may mean one that is missing as well: beside a doorway, there may be another. [Units: wu]
const AT: f64 = 0.3;
/// Planes beside a point, for points before or behind the narrowest place. [Units: wu]
const BESIDE: [f64; 7] = [0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3];
/// Directions of planes all around, besides those of walls.
const AROUND: u32 = 12;
/// Directions of walls that are tried, those of most wall first.
const WALLS: usize = 6;
/// Rays of a section.
const RAYS: u32 = 64;
/// Distance by which a portal reaches into the surfaces around it. [Units: wu]
const INTO: f64 = 0.02;
/// Sections that are tried, the narrowest first.
const TRIED: usize = 8;
/// Share of a cell's volume that each of two rooms has at least: a section across a niche makes none.
const LEAST: f64 = 0.02;

/// The reason why a decision changes nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
enum Unheeded {
    #[error(
        "no portal between two cells indoors is within {REACH} m, and the air there is one cell"
    )]
    NoPortal,
    #[error("no cell is there: it lies in a wall")]
    Solid,
    #[error("it lies outdoors")]
    Outdoors,
    #[error("the opening there is level: people do not walk through it")]
    Level,
    #[error("no section of the air around it parts {cell}{}", .last.as_ref().map_or_else(String::new, |e| format!("; of the narrowest: {e}")))]
    Unparted {
        cell: String,
        last: Option<AddPortalError>,
    },
}

/// Does as people decided, in their order and by the last word on each place, and notes what could not be done and why.
pub(crate) fn keep_decisions(
    world: &mut World,
    notes: &mut Vec<String>,
    decisions: &[RoomDecision],
) {
    if decisions.is_empty() {
        return;
    }
    // Nobody edited this world: the bake did.
    let edits = world.graph.statistics.counts.get("edits").copied();
    for (i, decision) in decisions.iter().enumerate() {
        // The last word on a place: what was joined would be parted where its air is narrowest, which may be elsewhere.
        let is_revised = |later: &RoomDecision| later.at.distance(decision.at) <= AT;
        if decisions[i + 1..].iter().any(is_revised) {
            continue;
        }
        if let Err(why) = keep(world, decision) {
            notes.push(format!("the decision '{decision}' changes nothing: {why}"));
        }
    }
    let counts = &mut world.graph.statistics.counts;
    match edits {
        Some(edits) => counts.insert("edits".to_owned(), edits),
        None => counts.remove("edits"),
    };
    let settings = &mut world.graph.provenance.settings;
    settings.insert("decisions".to_owned(), in_words(decisions));
}

/// Returns decisions as the file keeps them.
pub(crate) fn in_words(decisions: &[RoomDecision]) -> String {
    let all: Vec<String> = decisions.iter().map(ToString::to_string).collect();
    all.join("; ")
}

fn keep(world: &mut World, decision: &RoomDecision) -> Result<(), Unheeded> {
    let at = decision.at;
    match decision.is {
        RoomAnswer::OneRoom => {
            let near = portal_between(world, at, REACH, true);
            if let Some(joined) = near.and_then(|p| delete_portal(world, p)) {
                *world = joined.world;
            } else if !settle(world, at) {
                return Err(Unheeded::NoPortal);
            }
        }
        RoomAnswer::TwoRooms => {
            let portals = match portal_between(world, at, AT, false) {
                Some(portal) => vec![portal],
                None => part(world, at)?,
            };
            mean(world, &portals, None);
        }
        RoomAnswer::Door => {
            let portals = match portal_between(world, at, AT, false) {
                Some(portal) => vec![portal],
                None => part(world, at)?,
            };
            let is_level = |p: &PortalId| world.graph[*p].is_level();
            if portals.iter().any(is_level) {
                return Err(Unheeded::Level);
            }
            mean(world, &portals, Some(PortalKind::Door));
        }
    }
    settle(world, at);
    Ok(())
}

/// Returns the portal that a point means, if it does not mean a doubt nearer by; `indoors` leaves out those to the outdoors.
fn portal_between(world: &World, at: DVec3, reach: f64, indoors: bool) -> Option<PortalId> {
    let graph = &world.graph;
    let joins = graph.places.iter().filter(|p| is_join(p));
    let reach = joins.map(|p| distance(p, at)).fold(reach, f64::min);
    let is_meant = |p: &PortalId| !indoors || graph[*p].cells.iter().all(|c| !graph[*c].outdoor);
    let near = (graph.portal_ids().filter(is_meant)).map(|p| (graph[p].distance(at), p));
    let near = near.min_by(|a, b| a.0.total_cmp(&b.0));
    near.filter(|(distance, _)| *distance <= reach).map(|n| n.1)
}

/// Returns `true` for an opening that nearly parted a cell.
fn is_join(place: &DecidedPlace) -> bool {
    matches!(place.why.reason, Reason::Wide | Reason::Unframed)
}

fn distance(place: &DecidedPlace, at: DVec3) -> f64 {
    DVec3::from(place.at.map(f64::from)).distance(at)
}

/// Says of portals that a person asked for them, and of which kind they are.
fn mean(world: &mut World, portals: &[PortalId], kind: Option<PortalKind>) {
    for portal in portals {
        let portal = &mut world.graph.portals[portal.idx()];
        portal.why = vec![Why::given(Reason::Asked)];
        portal.kind = kind.unwrap_or(portal.kind);
    }
}

/// Takes the doubts about openings within cells away that a point means; returns `true` if there were any.
fn settle(world: &mut World, at: DVec3) -> bool {
    let places = &mut world.graph.places;
    let n = places.len();
    places.retain(|place| !is_join(place) || distance(place, at) > REACH);
    places.len() < n
}

/// Parts the cell of a point by the narrowest section around it that leaves two rooms; returns the new portals.
fn part(world: &mut World, at: DVec3) -> Result<Vec<PortalId>, Unheeded> {
    let cell = world.graph.locator.locate(at).ok_or(Unheeded::Solid)?;
    if world.graph[cell].outdoor {
        return Err(Unheeded::Outdoors);
    }
    let mut last = None;
    for section in sections(world, cell, at).iter().take(TRIED) {
        for outline in section.outlines() {
            match add_portal(world, &outline) {
                Ok(added) if are_rooms(&added) => {
                    *world = added.world;
                    return Ok(added.portals);
                }
                Ok(_) => {}
                Err(why) => last = last.or(Some(why)),
            }
        }
    }
    let cell = shown(&world.graph[cell].name).to_string();
    Err(Unheeded::Unparted { cell, last })
}

fn are_rooms(added: &Added) -> bool {
    let [a, b] = [added.cell, added.new_cell].map(|c| f64::from(added.world.graph[c].volume));
    a.min(b) >= LEAST * (a + b)
}

/// The air of a cell in a plane, as far as a point of it sees.
struct Section {
    plane: Plane,
    /// Where rays from the point end, in their order.
    ends: Vec<DVec3>,
    area: f64,
}

impl Section {
    /// Returns the outlines to try: a rectangle around all of it, then the hull.
    fn outlines(&self) -> [Vec<DVec3>; 2] {
        let (u, v) = axes(self.plane.normal);
        let base = self.ends[0];
        let along = |axis: DVec3| {
            let all = self.ends.iter().map(move |p| axis.dot(*p - base));
            let low = all.clone().fold(f64::INFINITY, f64::min) - INTO;
            [low, all.fold(f64::NEG_INFINITY, f64::max) + INTO]
        };
        let [[u0, u1], [v0, v1]] = [along(u), along(v)];
        let corners = [[u0, v0], [u1, v0], [u1, v1], [u0, v1]];
        let hull = Winding::hull_in_plane(&self.plane, &self.ends);
        [
            corners.map(|[a, b]| base + u * a + v * b).to_vec(),
            hull.points,
        ]
    }
}

/// Returns two directions in a plane, the second upwards where the plane is upright.
fn axes(normal: DVec3) -> (DVec3, DVec3) {
    let u = DVec3::Y.cross(normal).try_normalize().unwrap_or(DVec3::X);
    (u, normal.cross(u))
}

/// Returns the narrowest section in each direction, the narrowest first.
fn sections(world: &World, cell: CellId, at: DVec3) -> Vec<Section> {
    let mut around: Vec<Triangle> = triangles_of(world, cell).iter().map(|t| t.2).collect();
    let normals = normals(&around);
    let point = |p: &[f32; 3]| DVec3::from(p.map(f64::from));
    for exit in world.graph.exits(cell) {
        for piece in &exit.portal.pieces {
            let corners: Vec<DVec3> = piece.iter().map(point).collect();
            let fan = corners.windows(2).skip(1);
            around.extend(fan.map(|pair| [corners[0], pair[0], pair[1]]));
        }
    }
    let bvh = Bvh::build(&around);
    let narrowest = |normal: DVec3| {
        let from = BESIDE.map(|by| at + normal * by).into_iter();
        let inside = from.filter(|p| world.graph.locator.locate(*p) == Some(cell));
        let all = inside.filter_map(|p| section(&bvh, p, normal));
        all.min_by(|a, b| a.area.total_cmp(&b.area))
    };
    let mut all: Vec<Section> = normals.into_iter().filter_map(narrowest).collect();
    all.sort_by(|a, b| a.area.total_cmp(&b.area));
    all
}

/// Returns the normals of the planes to try: those of the most wall, around in equal steps, and upwards.
fn normals(triangles: &[Triangle]) -> Vec<DVec3> {
    /// Walls whose directions differ by less are parallel.
    const STEP: f64 = PI / 360.0;
    let mut by_angle = std::collections::BTreeMap::<i64, f64>::new();
    for triangle in triangles {
        let normal = triangle_area_normal(triangle);
        let flat = DVec3::new(normal.x, 0.0, normal.z);
        if normal.y.abs() < 0.1 * normal.length() && flat.length() > 0.0 {
            let angle = flat.z.atan2(flat.x).rem_euclid(PI);
            let step = (angle / STEP).round() as i64 % (PI / STEP).round() as i64;
            *by_angle.entry(step).or_default() += flat.length();
        }
    }
    let mut walls: Vec<(i64, f64)> = by_angle.into_iter().collect();
    walls.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let of_walls = walls.iter().take(WALLS).map(|w| w.0 as f64 * STEP);
    let around = (0..AROUND).map(|i| f64::from(i) * PI / f64::from(AROUND));
    let upright = of_walls.chain(around);
    let upright = upright.map(|angle| DVec3::new(angle.cos(), 0.0, angle.sin()));
    upright.chain([DVec3::Y]).collect()
}

/// Returns the section of the air in a plane; `None` if a ray finds no end.
fn section(bvh: &Bvh, from: DVec3, normal: DVec3) -> Option<Section> {
    let (u, v) = axes(normal);
    let ray = |i| {
        let angle = TAU * (f64::from(i) + 0.5) / f64::from(RAYS);
        let ray = Ray {
            origin: from,
            direction: u * angle.cos() + v * angle.sin(),
            t_max: f64::INFINITY,
        };
        bvh.closest_hit(&ray, |_| false).map(|hit| ray.at(hit.t))
    };
    let ends: Vec<DVec3> = (0..RAYS).map(ray).collect::<Option<_>>()?;
    Some(Section {
        plane: Plane::through(from, normal),
        area: Winding::new(ends.clone()).area(),
        ends,
    })
}
