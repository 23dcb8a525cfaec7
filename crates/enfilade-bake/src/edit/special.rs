//! Makes mirrors, monitors, tinted panes and teleporters of doorways and walls.
//!
//! Each function changes the world only if the result is valid, and drops its potentially visible set, as all edits of openings do.

use std::f64::consts::{FRAC_PI_4, PI};

use enfilade_cpg::{
    CellId, CellPortalGraph, GraphError, MonitorCamera, Pass, PortalId, SpecialId, SpecialPortal,
    SpecialProblem, SpecialShape, Way, World,
};
use enfilade_geom::{DMat3, DQuat, DVec3, Plane, Similarity, Winding, is_rather_level, shown};

use super::{AddPortalError, checked, place};
use crate::specials::without;

/// How far before a wall the cell of a polygon is looked for, nearest first: people type coordinates with two or three digits, and
/// pictures are thick. [Units: wu]
const BEFORE: [f64; 3] = [0.01, 0.05, 0.25];

/// The place of a special portal.
#[derive(Clone, Debug, PartialEq)]
pub enum SpecialSpot {
    /// A doorway, as seen from one of its cells.
    Doorway {
        /// The doorway.
        portal: PortalId,
        /// One of its cells. If absent, the room of a doorway that leads outdoors.
        cell: Option<CellId>,
    },
    /// A convex planar polygon on a wall, in order, either way around. It is seen from the cell before it; in mid-air, from where its
    /// vertices run counter-clockwise. [Units: wu]
    Wall(Vec<DVec3>),
}

/// The choices for a link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkOptions {
    /// Only the first place leads to the second.
    pub is_one_way: bool,
    /// Openings of different size may be linked if one is the other magnified.
    pub is_scaled: bool,
    /// The map from the first place to the second. If absent, the one that lays the first opening on the second, upright.
    pub map: Option<Similarity>,
}

/// The reason why a special portal cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecialError {
    /// There is no such portal.
    #[error("there is no portal {}; there are {n}, counted from 0", .portal.0)]
    NoPortal {
        /// The portal.
        portal: PortalId,
        /// Number of portals.
        n: usize,
    },
    /// There is no such special portal.
    #[error("there is no {special}; there are {n} special portals, counted from 0")]
    NoSpecial {
        /// The special portal.
        special: SpecialId,
        /// Their number.
        n: usize,
    },
    /// The portal has two sides, and none was chosen.
    #[error("{portal} has two sides: give {0}:{1} or {0}:{2}, the cell that it is seen from", .portal.0, shown(&.cells[0]), shown(&.cells[1]))]
    WhichSide {
        /// The portal.
        portal: PortalId,
        /// Names of its cells.
        cells: [String; 2],
    },
    /// The cell is not one of the portal's.
    #[error("{portal} is not at {cell}; its cells are {} and {}", shown(&.cells[0]), shown(&.cells[1]))]
    NotAtCell {
        /// The portal.
        portal: PortalId,
        /// The cell.
        cell: CellId,
        /// Names of its cells.
        cells: [String; 2],
    },
    /// The vertices do not form a polygon.
    #[error("this is no place for a special portal: {0}")]
    Polygon(AddPortalError),
    /// No cell lies before the polygon.
    #[error("no cell is within 0.25 m of {} on either side: the polygon must lie on a wall of a cell", place(*.at))]
    InSolid {
        /// The polygon's middle. [Units: wu]
        at: DVec3,
    },
    /// Both sides of a doorway would be mirrors.
    #[error(
        "the other side of {portal} is a mirror already: nobody could see or pass it from either cell; cover a wall instead, given by \
         the vertices of a polygon"
    )]
    BothMirrors {
        /// The portal.
        portal: PortalId,
    },
    /// The side is a mirror: there is nothing behind it.
    #[error(
        "{special} is a mirror, with nothing behind it that could shine through; remove it first"
    )]
    OnlyMirror {
        /// The special portal.
        special: SpecialId,
    },
    /// A way without return ends in the wrong cell.
    #[error("the map leads to {}, which is in {}, not in {to}; give another map or another end", place(*.at), in_words(*.cell))]
    LandsElsewhere {
        /// Where the middle of the opening comes out. [Units: wu]
        at: DVec3,
        /// Its cell.
        cell: Option<CellId>,
        /// The cell that it should lead to.
        to: CellId,
    },
    /// The result breaks a rule.
    #[error("{0}")]
    Invalid(GraphError),
}

fn in_words(cell: Option<CellId>) -> String {
    cell.map_or_else(|| "solid matter".to_owned(), |c| c.to_string())
}

/// Makes a mirror of a doorway's side or of a part of a wall.
///
/// # Errors
///
/// If the place is none, is special already, or both sides of a doorway would be mirrors.
pub fn mirror(world: &mut World, spot: &SpecialSpot) -> Result<SpecialId, SpecialError> {
    let (cell, shape) = shape_at(&world.graph, spot)?;
    if let SpecialShape::Portal(portal) = shape {
        let other = world.graph[portal].beyond(cell);
        let other = world.graph.special_side(portal, other);
        let is_mirror = |s: SpecialId| {
            let passes = &world.graph.specials[s.idx()].passes;
            passes.iter().all(|p| p.way == Way::Mirror)
        };
        if other.is_some_and(is_mirror) {
            return Err(SpecialError::BothMirrors { portal });
        }
    }
    add(world, cell, shape, vec![Pass::new(Way::Mirror)])
}

/// Shows the picture of a camera in a doorway's side or on a part of a wall.
///
/// # Errors
///
/// If the place is none or special already, or the camera is none.
pub fn monitor(
    world: &mut World,
    spot: &SpecialSpot,
    camera: MonitorCamera,
) -> Result<SpecialId, SpecialError> {
    let (cell, shape) = shape_at(&world.graph, spot)?;
    add(world, cell, shape, vec![Pass::new(Way::Monitor(camera))])
}

/// Links two places: who enters one comes out of the other.
///
/// Returns the special portals, the second unless the link is one-way.
///
/// # Errors
///
/// If a place is none or special already, the openings differ by more than the tolerance of
/// [`CellPortalGraph::validate`], or the map leads elsewhere.
pub fn link(
    world: &mut World,
    from: &SpecialSpot,
    into: &SpecialSpot,
    options: &LinkOptions,
) -> Result<(SpecialId, Option<SpecialId>), SpecialError> {
    let one = shape_at(&world.graph, from)?;
    let other = shape_at(&world.graph, into)?;
    let is_same = one == other;
    let n = world.graph.specials.len() as u32;
    let [first, second] = [SpecialId(n), SpecialId(if is_same { n } else { n + 1 })];
    let pair = |map: &Similarity, [a, b]: [SpecialId; 2]| {
        let lead = |(cell, shape): &(CellId, SpecialShape), to, map, back| SpecialPortal {
            name: String::new(),
            cell: *cell,
            shape: shape.clone(),
            passes: vec![Pass::new(Way::Lead { to, map, back })],
        };
        let mut pair = vec![lead(&one, other.0, *map, Some(b))];
        if !is_same {
            pair.push(lead(&other, one.0, map.inverse(), Some(a)));
        }
        pair
    };
    let map = match options.map {
        Some(map) => map,
        None => {
            // Fits, if both were linked with nothing else special.
            let bare = |map: &Similarity| {
                let mut graph = CellPortalGraph {
                    specials: pair(map, [SpecialId(0), SpecialId(u32::from(!is_same))]),
                    ..world.graph.clone()
                };
                let maps = fitted(&graph, is_same, options.is_scaled);
                let mut problem = None;
                for map in maps {
                    graph.specials = pair(&map, [SpecialId(0), SpecialId(u32::from(!is_same))]);
                    match first_problem(&graph) {
                        None => return Ok(map),
                        Some(found) => problem = problem.or(Some(found)),
                    }
                }
                Err(problem)
            };
            match bare(&Similarity::IDENTITY) {
                Ok(map) => map,
                Err(Some(problem)) => return Err(renamed(problem, [first, second])),
                Err(None) => Similarity::IDENTITY,
            }
        }
    };
    let mut made = pair(&map, [first, second]);
    if options.is_one_way {
        made.truncate(1);
        if let Way::Lead { back, .. } = &mut made[0].passes[0].way {
            *back = None;
        }
    }
    let is_single = made.len() == 1;
    push(world, made, |graph| {
        if !options.is_one_way || !map.is_valid() {
            return Ok(());
        }
        let (normal, pieces) = graph.special_opening(first);
        let at = map.point(middle(&pieces)) + map.direction(normal) * BEFORE[0];
        let cell = graph.locator.locate(at);
        let to = other.0;
        if cell == Some(to) {
            Ok(())
        } else {
            Err(SpecialError::LandsElsewhere { at, cell, to })
        }
    })?;
    Ok((first, (!is_single).then_some(second)))
}

/// Tints what is seen in a doorway's side; `share` is that of the color: 0 leaves all as it is, 1 multiplies by the color.
///
/// # Errors
///
/// If the place is none, or the color is.
pub fn tint(
    world: &mut World,
    spot: &SpecialSpot,
    color: [f32; 3],
    share: f32,
) -> Result<SpecialId, SpecialError> {
    let color = color.map(|c| 1.0 - share + share * c);
    change(world, spot, |special| {
        if let Some(first) = special.passes.first_mut() {
            first.tint = [color[0], color[1], color[2], first.tint[3]];
        }
        Ok(())
    })
}

/// Makes a doorway's side reflect a share of what is before it, like a pane of glass.
///
/// # Errors
///
/// If the place is none or only a mirror, or the share is none.
pub fn reflect(
    world: &mut World,
    spot: &SpecialSpot,
    share: f32,
) -> Result<SpecialId, SpecialError> {
    change(world, spot, |special| {
        let mut mirrors = special.passes.iter().skip(1);
        match mirrors.position(|p| p.way == Way::Mirror) {
            Some(at) => special.passes[at + 1].tint[3] = share,
            None if special.passes.first().is_some_and(|p| p.way == Way::Mirror) => return Err(()),
            None => special.passes.push(Pass {
                way: Way::Mirror,
                tint: [1.0, 1.0, 1.0, share],
            }),
        }
        Ok(())
    })
}

/// Makes a special portal plain again: a doorway is open, a wall is a wall. Those after it are renumbered, and who came back by it no
/// longer does.
///
/// # Errors
///
/// If it does not exist.
pub fn plain(world: &mut World, special: SpecialId) -> Result<(), SpecialError> {
    let n = world.graph.specials.len();
    if special.idx() >= n {
        return Err(SpecialError::NoSpecial { special, n });
    }
    world.graph.specials = without(&world.graph.specials, |id, _| id == special);
    changed(world);
    Ok(())
}

/// Changes what a doorway's side shows; a plain one shows the cell behind it. `Err` if it is nothing but a mirror.
fn change(
    world: &mut World,
    spot: &SpecialSpot,
    change: impl Fn(&mut SpecialPortal) -> Result<(), ()>,
) -> Result<SpecialId, SpecialError> {
    let (cell, shape) = shape_at(&world.graph, spot)?;
    let known = world
        .graph
        .specials
        .iter()
        .position(|s| s.cell == cell && s.shape == shape);
    let mut specials = world.graph.specials.clone();
    let at = known.unwrap_or_else(|| {
        specials.push(SpecialPortal {
            name: String::new(),
            cell,
            shape,
            passes: vec![Pass::new(Way::Through)],
        });
        specials.len() - 1
    });
    let special = SpecialId(at as u32);
    change(&mut specials[at]).map_err(|()| SpecialError::OnlyMirror { special })?;
    replace(world, specials, |_| Ok(()))?;
    Ok(special)
}

fn add(
    world: &mut World,
    cell: CellId,
    shape: SpecialShape,
    passes: Vec<Pass>,
) -> Result<SpecialId, SpecialError> {
    let special = SpecialId(world.graph.specials.len() as u32);
    let name = String::new();
    let made = SpecialPortal {
        name,
        cell,
        shape,
        passes,
    };
    push(world, vec![made], |_| Ok(()))?;
    Ok(special)
}

fn push(
    world: &mut World,
    made: Vec<SpecialPortal>,
    check: impl Fn(&CellPortalGraph) -> Result<(), SpecialError>,
) -> Result<(), SpecialError> {
    let mut specials = world.graph.specials.clone();
    specials.extend(made);
    replace(world, specials, check)
}

/// Replaces all special portals if the result is valid and passes `check`.
fn replace(
    world: &mut World,
    specials: Vec<SpecialPortal>,
    check: impl Fn(&CellPortalGraph) -> Result<(), SpecialError>,
) -> Result<(), SpecialError> {
    let before = std::mem::replace(&mut world.graph.specials, specials);
    let problem = match first_problem(&world.graph) {
        Some(problem) => Err(SpecialError::Invalid(problem)),
        None => check(&world.graph),
    };
    match problem {
        Ok(()) => changed(world),
        Err(_) => world.graph.specials = before,
    }
    problem
}

fn changed(world: &mut World) {
    world.pvs = None;
    let counts = &mut world.graph.statistics.counts;
    *counts.entry("edits".to_owned()).or_default() += 1.0;
}

fn first_problem(graph: &CellPortalGraph) -> Option<GraphError> {
    let errors = graph.validate().err()?;
    (errors.into_iter()).find(|e| matches!(e, GraphError::Special { .. }))
}

/// Gives the two special portals of a trial the numbers that they would have in the world.
fn renamed(problem: GraphError, ids: [SpecialId; 2]) -> SpecialError {
    let number = |id: SpecialId| ids[id.idx().min(1)];
    let mut problem = problem;
    if let GraphError::Special {
        special, problem, ..
    } = &mut problem
    {
        *special = number(*special);
        match problem {
            SpecialProblem::Outline { back, .. }
            | SpecialProblem::Bars { back, .. }
            | SpecialProblem::OffPlane { back, .. }
            | SpecialProblem::Facing { back, .. }
            | SpecialProblem::NotInverse { back, .. }
            | SpecialProblem::NoWayBack { back, .. } => *back = number(*back),
            _ => {}
        }
    }
    SpecialError::Invalid(problem)
}

/// Most turns of an opening that are tried.
const MOST_TURNS: usize = 16;

/// Returns the maps that lay the first special portal's opening on the second's, middle on middle, and out of the one into the other:
/// upright, or turned so that edges lie on edges: by up to 45° where walls lean, by any angle for hatches. The most upright first.
fn fitted(graph: &CellPortalGraph, is_same: bool, is_scaled: bool) -> Vec<Similarity> {
    let (normal, pieces) = graph.special_opening(SpecialId(0));
    let (normal_there, pieces_there) = graph.special_opening(SpecialId(u32::from(!is_same)));
    let inward = -normal_there;
    let upright = frame(inward) * frame(normal).transpose();
    let area = |pieces: &[Winding]| pieces.iter().map(Winding::area).sum::<f64>();
    let scale = if is_scaled {
        (area(&pieces_there) / area(&pieces)).sqrt()
    } else {
        1.0
    };
    let edges = |normal, pieces: &[Winding]| {
        let points: Vec<DVec3> = pieces.iter().flat_map(|p| p.points.clone()).collect();
        let hull = Winding::hull_in_plane(&Plane::through(points[0], normal), &points).points;
        let next = hull.iter().cycle().skip(1);
        let mut edges: Vec<DVec3> = hull.iter().zip(next).map(|(a, b)| b - a).collect();
        edges.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
        edges
    };
    // Hatches have no upright.
    let is_hatch = is_rather_level(normal) || is_rather_level(inward);
    let most = if is_hatch { PI } else { FRAC_PI_4 };
    // Counter-clockwise about the normal into the cell, as the first is about its own.
    let longest = edges(normal, &pieces).first().map(|e| upright * *e);
    let turned = edges(inward, &pieces_there).into_iter().take(MOST_TURNS);
    let turned = turned.filter_map(|to| {
        let longest = longest?;
        Some(inward.dot(longest.cross(to)).atan2(longest.dot(to)))
    });
    let mut angles: Vec<f64> = turned.filter(|a| a.abs() <= most).chain([0.0]).collect();
    angles.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let [from, to] = [&pieces, &pieces_there].map(|p| centroid(p));
    angles
        .into_iter()
        .map(|angle| {
            let turn = DQuat::from_axis_angle(inward, angle) * DQuat::from_mat3(&upright);
            let turn = turn.normalize();
            Similarity {
                turn,
                at: to - turn * (from * scale),
                scale,
            }
        })
        .collect()
}

/// Returns the axes of an opening: across, upward, and its normal.
fn frame(normal: DVec3) -> DMat3 {
    let hint = if is_rather_level(normal) {
        DVec3::Z
    } else {
        DVec3::Y
    };
    let across = hint.cross(normal).normalize_or_zero();
    DMat3::from_cols(across, normal.cross(across), normal)
}

/// Returns the center of gravity of an opening.
fn centroid(pieces: &[Winding]) -> DVec3 {
    let weighted = pieces.iter().map(|p| (p.centroid(), p.area()));
    let (sum, area) = weighted.fold((DVec3::ZERO, 0.0), |(s, n), (at, a)| (s + at * a, n + a));
    if area > 0.0 {
        sum / area
    } else {
        middle(pieces)
    }
}

fn middle(pieces: &[Winding]) -> DVec3 {
    let points = pieces.iter().flat_map(|p| &p.points);
    let n = points.clone().count().max(1) as f64;
    points.sum::<DVec3>() / n
}

/// Finds the cell and polygon of a place.
fn shape_at(
    graph: &CellPortalGraph,
    spot: &SpecialSpot,
) -> Result<(CellId, SpecialShape), SpecialError> {
    match spot {
        SpecialSpot::Doorway { portal, cell } => {
            let portal = *portal;
            let n = graph.portals.len();
            let found = graph.portals.get(portal.idx());
            let found = found.ok_or(SpecialError::NoPortal { portal, n })?;
            let names = || found.cells.map(|c| graph[c].name.clone());
            let rooms: Vec<CellId> = (found.cells.into_iter())
                .filter(|&c| !graph[c].outdoor)
                .collect();
            let cell = match (*cell, &rooms[..]) {
                (Some(cell), _) if found.cells.contains(&cell) => cell,
                (Some(cell), _) => {
                    return Err(SpecialError::NotAtCell {
                        portal,
                        cell,
                        cells: names(),
                    });
                }
                (None, [room]) => *room,
                (None, _) => {
                    return Err(SpecialError::WhichSide {
                        portal,
                        cells: names(),
                    });
                }
            };
            Ok((cell, SpecialShape::Portal(portal)))
        }
        SpecialSpot::Wall(corners) => {
            let (plane, polygon) = checked(corners).map_err(SpecialError::Polygon)?;
            let at = polygon.centroid();
            for before in BEFORE {
                let [front, back] =
                    [before, -before].map(|d| graph.locator.locate(at + plane.normal * d));
                let (cell, toward) = match (front, back) {
                    (Some(cell), _) => (cell, plane.normal),
                    (None, Some(cell)) => (cell, -plane.normal),
                    (None, None) => continue,
                };
                let normal = (-toward).as_vec3().normalize().to_array();
                let mut piece: Vec<[f32; 3]> = (polygon.points.iter())
                    .map(|p| p.as_vec3().to_array())
                    .collect();
                if toward == plane.normal {
                    piece.reverse();
                }
                let pieces = vec![piece];
                return Ok((cell, SpecialShape::Surface { normal, pieces }));
            }
            Err(SpecialError::InSolid { at })
        }
    }
}
