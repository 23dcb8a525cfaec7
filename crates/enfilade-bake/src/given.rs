//! Openings that a designer marked ([`Scene::given_portals`]), as portals of the world.
//!
//! A bake finds openings by itself and puts a portal where the walls end. A mark that none of these portals is becomes one of its own.
//! Where a portal was found beside it, as at the other end of a doorway, that portal moves into the mark: the space between
//! the two goes to the room beyond. Where a way leads around a mark, a second mark in the same cell may close it. A mark in a wall,
//! or one that people can walk around, parts nothing and is told with the reason.
//!
//! A complex of one cell for each mark that was not found, and for each pair of those that part nothing alone.

use enfilade_cpg::{CellId, Portal, PortalId, World};
use enfilade_geom::scene::{GivenPortal, Scene};
use enfilade_geom::{Aabb, DVec3, Plane, shown};

use crate::edit::{AddPortalError, Added, add_portal, checked, cut_cell};
use crate::simplify::{Simplified, delete_portal};

/// A portal farther than this from a mark is another opening: a room is wider. [Units: wu]
const REACH: f64 = 1.5;
/// Planes that turn away from each other by more than 30 degrees are those of two openings.
const ALONG: f64 = 0.866;
/// A portal this near to a mark, beyond half of its thickness, is the mark: the grid of editors. [Units: wu]
const SAME: f64 = 0.05;
/// Volume between a mark and the portal beside it, relative to that of a straight doorway: jambs may be beveled.
const BETWEEN: f64 = 1.5;
/// Most marks that part nothing alone and are tried in pairs; each pair costs two complexes.
const MOST_IN_PAIRS: usize = 12;

/// The end of a mark.
#[derive(Clone, Debug)]
enum Fate {
    /// It is a portal that the bake found.
    Found,
    /// The portal beside it moved into it from so far away. [Units: wu]
    Moved(f64),
    /// It parts what was one cell.
    Parts,
    /// It parts what was one cell together with another mark.
    PartsWith(usize),
    /// It parts nothing.
    Refused(AddPortalError),
}

/// Makes portals of a scene's marks, and returns a sentence on each, for cells as they are called now.
pub(crate) fn keep_given(world: &mut World, scene: &Scene) -> Marks {
    let marks = &scene.given_portals;
    let mut fates: Vec<Fate> = Vec::with_capacity(marks.len());
    // Nobody edited this world: the bake did.
    let edits = world.graph.statistics.counts.get("edits").copied();
    for mark in marks {
        let near = nearest(mark, world);
        if near.as_ref().is_some_and(|near| near.is(mark)) {
            fates.push(Fate::Found);
            continue;
        }
        fates.push(match add_portal(world, &mark.outline) {
            Ok(added) => {
                let moved = near.and_then(|near| moved_into(&added, &near));
                let distance = moved.as_ref().map(|m| m.1);
                *world = moved.map_or(added.world, |m| m.0);
                distance.map_or(Fate::Parts, Fate::Moved)
            }
            Err(why) => Fate::Refused(why),
        });
    }
    part_in_pairs(world, marks, &mut fates);
    let counts = &mut world.graph.statistics.counts;
    match edits {
        Some(edits) => counts.insert("edits".to_owned(), edits),
        None => counts.remove("edits"),
    };
    Marks(fates)
}

/// The ends of all marks of a scene.
pub(crate) struct Marks(Vec<Fate>);

impl Marks {
    /// Tells for each mark which portal it is, by the names of the cells that it parts, or why it is none.
    pub(crate) fn tell(&self, world: &World, scene: &Scene, notes: &mut Vec<String>) {
        let marks = &scene.given_portals;
        for (mark, fate) in marks.iter().zip(&self.0) {
            let name = shown(&mark.name);
            let portal = nearest(mark, world).filter(|near| near.is(mark));
            let is = match portal {
                Some(near) => {
                    let portal = &world.graph[near.portal];
                    let [a, b] = portal.cells.map(|c| shown(&world.graph[c].name));
                    format!("{name} is {}, between {a} and {b}", near.portal)
                }
                None => name.to_string(),
            };
            notes.push(match fate {
                Fate::Found => is,
                Fate::Moved(by) => format!("{is}: moved into the mark by {by:.2} m"),
                Fate::Parts => format!("{is}: they were one cell without it"),
                Fate::PartsWith(other) => {
                    let other = shown(&marks[*other].name);
                    format!("{is}: they were one cell without it and {other}")
                }
                Fate::Refused(why) => format!("{name} parts nothing: {why}"),
            });
        }
        let n_kept = self.0.iter().filter(|f| !matches!(f, Fate::Refused(_)));
        let (n, n_kept) = (self.0.len(), n_kept.count());
        let n_found = self.0.iter().filter(|f| matches!(f, Fate::Found)).count();
        notes.push(match n {
            0 => "no opening is marked: brushes of visportals, areaportals and hints mark some, and objects called portal".to_owned(),
            _ => format!("{n_kept} of {n} given portals are kept; {n_found} of them were found without their marks"),
        });
    }
}

/// A portal near a mark.
struct Near {
    portal: PortalId,
    /// Distance along the mark's normal. [Units: wu]
    distance: f64,
}

impl Near {
    fn is(&self, mark: &GivenPortal) -> bool {
        self.distance <= SAME + mark.thickness / 2.0
    }
}

/// Returns the portal of a world that is nearest to a mark, if any is within [`REACH`].
fn nearest(mark: &GivenPortal, world: &World) -> Option<Near> {
    let all = (0..).map(PortalId).zip(&world.graph.portals);
    let near = all.filter_map(|(portal, p)| {
        let distance = distance(mark, p)?;
        Some(Near { portal, distance })
    });
    near.min_by(|a, b| a.distance.total_cmp(&b.distance))
}

/// Returns the distance of a portal from a mark that it faces and covers in part, `None` for others.
fn distance(mark: &GivenPortal, portal: &Portal) -> Option<f64> {
    let outline = portal.outline.iter();
    let points: Vec<DVec3> = outline.map(|p| DVec3::from(p.map(f64::from))).collect();
    let normal = DVec3::from(portal.normal.map(f64::from));
    let plane = Plane::through(middle(&mark.outline), mark.normal);
    let away = plane.signed_distance(middle(&points)).abs();
    let flat: Vec<DVec3> = points.iter().map(|&p| plane.project(p)).collect();
    let own = Aabb::of_points(&mark.outline).expanded(SAME);
    let is_along = normal.dot(mark.normal).abs() >= ALONG;
    (is_along && away <= REACH && own.overlaps(&Aabb::of_points(&flat))).then_some(away)
}

fn middle(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// Returns the world in which the portal beside a new one is gone, and its distance, if nothing but a doorway lies between the two.
fn moved_into(added: &Added, near: &Near) -> Option<(World, f64)> {
    let graph = &added.world.graph;
    let area: f64 = added
        .portals
        .iter()
        .map(|p| f64::from(graph[*p].area))
        .sum();
    let is_doorway = |cell: &CellId| {
        let portals = &graph[*cell].portals;
        let others = portals.iter().flat_map(|p| graph[*p].cells);
        let n_others = others.collect::<std::collections::BTreeSet<_>>().len() - 1;
        portals.contains(&near.portal)
            && n_others == 2
            && f64::from(graph[*cell].volume) <= BETWEEN * near.distance * area
    };
    let doorway = [added.cell, added.new_cell].into_iter().find(is_doorway)?;
    let beyond = graph[near.portal]
        .cells
        .into_iter()
        .find(|c| *c != doorway)?;
    let Simplified {
        mut world, cell_of, ..
    } = delete_portal(&added.world, near.portal)?;
    // The room beyond is what it was, and no room is lost.
    let room = cell_of[beyond.idx()];
    world.graph.cells[room.idx()]
        .why
        .clone_from(&graph[beyond].why);
    world.graph.places.clone_from(&graph.places);
    Some((world, near.distance))
}

/// Parts cells by two marks each, of those that part nothing alone.
fn part_in_pairs(world: &mut World, marks: &[GivenPortal], fates: &mut [Fate]) {
    let goes_around = |f: &Fate| matches!(f, Fate::Refused(AddPortalError::DoesNotPart { .. }));
    let alone: Vec<usize> = (0..marks.len())
        .filter(|&i| goes_around(&fates[i]))
        .collect();
    let alone = &alone[..alone.len().min(MOST_IN_PAIRS)];
    for (k, &one) in alone.iter().enumerate() {
        for &other in &alone[k + 1..] {
            if !goes_around(&fates[one]) || !goes_around(&fates[other]) {
                continue;
            }
            let pair = [&marks[one].outline[..], &marks[other].outline[..]];
            if let Ok(added) = add_portals(world, pair) {
                *world = added.world;
                fates[one] = Fate::PartsWith(other);
                fates[other] = Fate::PartsWith(one);
            }
        }
    }
}

/// Divides a cell by two polygons together, each a portal of [`add_portal`] around which a way leads.
///
/// # Errors
/// If either is not a convex planar polygon, or the two do not divide the cell that contains the middle of the first.
fn add_portals(world: &World, pair: [&[DVec3]; 2]) -> Result<Added, AddPortalError> {
    let [(one, first), (other, second)] = [checked(pair[0])?, checked(pair[1])?];
    let (at, beside) = (first.centroid(), second.centroid());
    let locate = |p: DVec3| world.graph.locator.locate(p);
    let cell = locate(at).ok_or(AddPortalError::InSolid { at })?;
    if locate(beside) != Some(cell) {
        return Err(AddPortalError::Aside { at: beside, cell });
    }
    // Whoever passes one forwards may pass the other forwards or backwards on the way back.
    let by = |turn: f64| {
        let distance = |p: DVec3| match p.distance(at) <= p.distance(beside) {
            true => one.signed_distance(p),
            false => turn * other.signed_distance(p),
        };
        cut_cell(world, cell, vec![first.clone(), second.clone()], &distance)
    };
    (by(1.0).or_else(|_| by(-1.0))).map_err(|_| AddPortalError::DoesNotPart { cell, at: beside })
}
