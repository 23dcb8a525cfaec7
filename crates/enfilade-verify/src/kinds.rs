//! Kinds of portals, as far as a file determines them.
//!
//! In every world, a crack is narrow and a door stands upright. In a bake of this version, sill and height, unless the name
//! of what fills them speaks for another kind, also determine which portals are windows, doors or openings, unless portals were cut
//! since; a person who asked for a portal said its kind. `fittings` judges the kinds that leaves determine.
//!
//! Sills are measured anew from the triangles of the file; values within rounding of another kind are not judged.

use enfilade_cpg::{DetailObject, Fact, Portal, PortalKind, Reason, World};
use enfilade_geom::{Aabb, Bvh, DVec3, Plane, Ray, Triangle, Winding};

use crate::details::triangles_of;
use crate::subject::to_dvec;

/// Largest width of every piece of a crack: nobody climbs through. [Units: wu]
const CRACK_WIDTH: f64 = 0.3;
/// Least height of a sill over the ground. [Units: wu]
const SILL: f64 = 0.4;
/// Least height of a window's sill over the ground, to the outdoors. [Units: wu]
const CURB: f64 = 0.07;
/// Least height of a door. [Units: wu]
const LEAST_DOOR: f64 = 1.5;
/// More than the growth of outlines: closer to a bound, nothing is judged. [Units: wu]
const ROOM: f64 = 0.02;
/// Share of an opening that leaves and panes must fill to shut it, if the bake does not say another.
const CLOSED: f64 = 0.6;
/// Distance from an opening at which an object may fill it. [Units: wu]
const REACH: f64 = 0.5;
/// Distance from an opening at which the ground is searched. [Units: wu]
const BESIDE: f64 = 0.5;

/// Returns problems, a line each.
pub(crate) fn check(world: &World, own: &[Triangle]) -> Vec<String> {
    let is_by_rule = is_by_rule(world);
    let ground = is_by_rule.then(|| Bvh::build(own));
    let portals = world.graph.portals.iter().enumerate();
    portals
        .filter_map(|(i, p)| {
            let of_shape = shape_problem(p);
            let what = of_shape.or_else(|| {
                let is_asked = p.why.iter().any(|why| why.reason == Reason::Asked);
                let ground = ground.as_ref().filter(|_| !is_asked)?;
                match said(world, p) {
                    Said::Kind(kind) if kind == p.kind => None,
                    Said::Nothing | Said::Kind(_) => stance_problem(world, p, ground),
                    Said::Other => None,
                }
            })?;
            Some(format!(
                "portal {i} is of kind {}, but {what}",
                word(p.kind)
            ))
        })
        .collect()
}

/// Returns `true` if all portals are as a bake of this version made them.
pub(crate) fn is_by_rule(world: &World) -> bool {
    let counts = &world.graph.statistics.counts;
    let is_cut = ["edits", "cost_cuts"]
        .iter()
        .any(|name| counts.get(*name).is_some_and(|&n| n > 0.0));
    let ours = concat!("enfilade ", env!("CARGO_PKG_VERSION"));
    world.graph.provenance.generator == ours && !is_cut
}

fn word(kind: PortalKind) -> &'static str {
    match kind {
        PortalKind::Open => "open",
        PortalKind::Door => "a door",
        PortalKind::Window => "a window",
        PortalKind::Crack => "a crack",
    }
}

fn shape_problem(p: &Portal) -> Option<String> {
    match p.kind {
        PortalKind::Crack => {
            let width = p
                .pieces
                .iter()
                .map(|piece| width(piece))
                .fold(0.0, f64::max);
            (width > CRACK_WIDTH + ROOM).then(|| format!("is {width:.3} m wide"))
        }
        PortalKind::Door => (!is_upright(p)).then(|| "does not stand upright".to_owned()),
        PortalKind::Open | PortalKind::Window => None,
    }
}

/// Kind that the names of all fittings of a portal say.
#[derive(Clone, Copy, PartialEq)]
enum Said {
    Nothing,
    /// One kind, in plain words.
    Kind(PortalKind),
    /// Something that only the bake's rules can read.
    Other,
}

/// Words for doors and windows, and for parts of both.
const WORDS: [(&str, Option<PortalKind>); 7] = [
    ("door", Some(PortalKind::Door)),
    ("window", Some(PortalKind::Window)),
    ("frame", None),
    ("leaf", None),
    ("glass", None),
    ("pane", None),
    ("sash", None),
];

fn said(world: &World, p: &Portal) -> Said {
    let mut all = Said::Nothing;
    for f in &p.fittings {
        let detail = &world.details[f.detail as usize];
        all = match (all, said_by(&detail.name)) {
            (Said::Nothing, Said::Nothing) if is_told_elsewhere(world, detail, &TOLD) => {
                Said::Other
            }
            (a, Said::Nothing) => a,
            (Said::Nothing, b) => b,
            (a, b) if a == b => a,
            _ => Said::Other,
        };
    }
    all
}

/// Returns what a name says: an IFC class, or words that are all known.
fn said_by(name: &str) -> Said {
    for (class, kind) in [
        ("IfcDoor", PortalKind::Door),
        ("IfcWindow", PortalKind::Window),
    ] {
        if name.starts_with(class) {
            return Said::Kind(kind);
        }
    }
    let name = name.to_lowercase();
    let words = name.split(|c: char| !c.is_alphabetic());
    let mut kinds = Vec::new();
    let mut is_plain = true;
    for word in words.filter(|w| !w.is_empty()) {
        match WORDS.iter().find(|w| w.0 == word) {
            Some((_, kind)) => kinds.extend(*kind),
            None => is_plain = false,
        }
    }
    match kinds[..] {
        [kind] if is_plain => Said::Kind(kind),
        [] if !tells(&name) => Said::Nothing,
        _ => Said::Other,
    }
}

/// Words by which a name may say which opening its object fills, and those for windows.
const TOLD: [&str; 4] = ["door", "gate", "window", "skylight"];
const WINDOWS: [&str; 2] = ["window", "skylight"];

/// Returns `true` if a name in small letters may say which opening its object fills.
fn tells(name: &str) -> bool {
    has_any(name, &TOLD)
}

fn has_any(name: &str, words: &[&str]) -> bool {
    words.iter().any(|word| name.contains(word))
}

/// Returns `true` if the names of a detail's mesh, groups or materials may say which opening it fills.
fn is_told_elsewhere(world: &World, detail: &DetailObject, words: &[&str]) -> bool {
    let mesh = world.detail_meshes.get(detail.mesh as usize);
    let primitives = mesh.iter().flat_map(|m| &m.primitives);
    let materials = primitives.filter_map(|q| world.materials.get(q.material? as usize));
    let mut node = detail.source;
    let groups = std::iter::from_fn(|| {
        let own = world.sources.get(node? as usize)?;
        node = own.parent;
        Some(&own.name)
    });
    let names = materials.map(|m| &m.name).chain(mesh.map(|m| &m.name));
    names
        .chain(groups)
        .any(|name| has_any(&name.to_lowercase(), words))
}

/// Returns `true` if an object near a portal may say which opening it fills.
fn is_told_near(world: &World, p: &Portal) -> bool {
    !triangles_told_near(world, p, &TOLD).is_empty()
}

/// Returns `true` if objects that may say that they are windows are before or behind half of an opening, or more.
fn is_called_window(world: &World, p: &Portal, opening: &Winding) -> bool {
    let windows = Bvh::build(&triangles_told_near(world, p, &WINDOWS));
    let middle = opening.centroid();
    let shares = [0.3, 0.6, 0.9];
    let points = opening.points.iter();
    let points = points.flat_map(|&q| shares.map(|share| middle.lerp(q, share)));
    let n_before = |q: DVec3| usize::from(windows.nearest(q, REACH).is_some());
    2 * points.map(n_before).sum::<usize>() >= shares.len() * opening.points.len()
}

/// Returns the triangles near a portal of objects that may say with one of these words which opening they fill.
fn triangles_told_near(world: &World, p: &Portal, words: &[&str]) -> Vec<Triangle> {
    let corners = p.pieces.iter().flatten().map(|&c| to_dvec(c));
    let near = corners.fold(Aabb::EMPTY, Aabb::including).expanded(REACH);
    let tells = |detail: &&DetailObject| {
        has_any(&detail.name.to_lowercase(), words) || is_told_elsewhere(world, detail, words)
    };
    let told = world.details.iter().filter(tells);
    let all = told.flat_map(|detail| triangles_of(world, detail));
    all.filter(|t| near.overlaps(&Aabb::of_points(t))).collect()
}

/// Returns `true` if a decision knows how little fills an opening, and no object may say that it is a window, as none does of a level one.
fn is_unfilled(world: &World, p: &Portal) -> bool {
    let settings = &world.graph.provenance.settings;
    let shut = settings.get("merge.closed_share");
    let shut = shut.and_then(|s| s.parse().ok()).unwrap_or(CLOSED);
    let mut closed = p
        .why
        .iter()
        .filter_map(|why| why.facts.get(&Fact::Closed))
        .peekable();
    closed.peek().is_some()
        && closed.all(|&share| f64::from(share) < shut - ROOM)
        && p.fittings.is_empty()
        && (!is_upright(p) || !is_told_near(world, p))
}

/// Returns a contradiction between kind, height and sill of a portal.
fn stance_problem(world: &World, p: &Portal, ground: &Bvh) -> Option<String> {
    let is_window = p.kind == PortalKind::Window && p.pieces.len() == 1;
    if !is_upright(p) {
        let is_wrong = is_window && is_unfilled(world, p);
        return is_wrong.then(|| "lies level, and nothing fills it".to_owned());
    }
    if p.kind == PortalKind::Crack {
        return None;
    }
    // Measure the open area: outlines of sharp openings are rectangles and may reach below the ground.
    let corners: Vec<DVec3> = p.pieces.iter().flatten().map(|&c| to_dvec(c)).collect();
    let normal = to_dvec(p.normal).try_normalize()?;
    let plane = Plane::through(*corners.first()?, normal);
    let opening = Winding::hull_in_plane(&plane, &corners);
    let heights = corners.iter().map(|c| c.y);
    let [low, high] = heights.fold([f64::MAX, f64::MIN], |[a, b], y| [a.min(y), b.max(y)]);
    let height = high - low;
    let [least, most] = sills(normal, opening.centroid().with_y(low), ground);
    match p.kind {
        PortalKind::Door if height < LEAST_DOOR - ROOM => Some(format!("is {height:.2} m high")),
        PortalKind::Door if leads_outdoors(world, p) && least > CURB + ROOM => Some(format!(
            "stands {least:.2} m over the ground, to the outdoors"
        )),
        PortalKind::Door | PortalKind::Open if least > SILL + ROOM => {
            Some(format!("stands {least:.2} m over the ground"))
        }
        // A piece among several may be a bay, joined from panes that are lower.
        PortalKind::Window
            if p.pieces.len() == 1
                && height > LEAST_DOOR + ROOM
                && most < if leads_outdoors(world, p) { CURB } else { SILL } - ROOM
                // A window in many parts may have none as a fitting.
                && !(p.fittings.is_empty() && is_called_window(world, p, &opening)) =>
        {
            Some(format!("is {height:.2} m high and stands on the ground"))
        }
        PortalKind::Window if is_window && most < SILL - ROOM && is_unfilled(world, p) => {
            Some("stands on the ground, and nothing fills it".to_owned())
        }
        _ => None,
    }
}

fn leads_outdoors(world: &World, p: &Portal) -> bool {
    let cells = p.cells.iter();
    let mut cells = cells.filter_map(|c| world.graph.cells.get(c.0 as usize));
    cells.any(|c| !c.is_indoors())
}

fn is_upright(p: &Portal) -> bool {
    !p.is_level()
}

/// Returns least and greatest height of an opening's `foot` over the ground on the higher side, at several points
/// around that of the rule, so that a ray beside an edge does not decide. [Units: wu]
fn sills(n: DVec3, foot: DVec3, ground: &Bvh) -> [f64; 2] {
    let out = DVec3::new(n.x, 0.0, n.z).normalize_or_zero();
    let along = out.cross(DVec3::Y);
    let mut bounds = [f64::INFINITY, 0.0_f64];
    for (u, v) in [
        (0.0, 0.0),
        (ROOM, 0.0),
        (-ROOM, 0.0),
        (0.0, ROOM),
        (0.0, -ROOM),
    ] {
        let drop = |side: f64| {
            let ray = Ray {
                origin: foot + DVec3::Y * 0.05 + out * (BESIDE * side + u) + along * v,
                direction: -DVec3::Y,
                t_max: 100.0,
            };
            let hit = ground.closest_hit(&ray, |_| false);
            hit.map_or(f64::INFINITY, |h| h.t - 0.05)
        };
        let sill = drop(1.0).min(drop(-1.0));
        bounds = [bounds[0].min(sill), bounds[1].max(sill)];
    }
    bounds
}

/// Returns the least distance between two parallel lines along an edge that enclose the polygon. [Units: wu]
fn width(piece: &[[f32; 3]]) -> f64 {
    let points: Vec<DVec3> = piece.iter().map(|&c| to_dvec(c)).collect();
    let n = points.len();
    let across = |i: usize| {
        let (a, b) = (points[i], points[(i + 1) % n]);
        let along = (b - a).try_normalize()?;
        let off = |p: &DVec3| (*p - a).reject_from_normalized(along).length();
        Some(points.iter().map(off).fold(0.0, f64::max))
    };
    (0..n).filter_map(across).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{CellId, CellPortalGraph};
    use enfilade_geom::scene::{Mesh, Primitive};
    use enfilade_geom::{Aabb, DMat4};

    #[test]
    fn a_sill_is_that_of_what_is_open_and_not_of_the_outline() {
        // A triangle that stands on the ground, in an outline that reaches half a meter below it.
        let ground = Aabb::new(DVec3::new(-5.0, -0.2, -5.0), DVec3::new(5.0, 0.0, 5.0)).triangles();
        let open = Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Open,
            normal: [1.0, 0.0, 0.0],
            outline: vec![
                [0.0, -0.5, 0.0],
                [0.0, -0.5, 2.0],
                [0.0, 2.0, 2.0],
                [0.0, 2.0, 0.0],
            ],
            pieces: vec![vec![[0.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, 2.0, 1.0]]],
            area: 2.0,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        let mut world = World {
            graph: CellPortalGraph {
                portals: vec![open],
                ..CellPortalGraph::default()
            },
            ..World::default()
        };
        world.graph.provenance.generator = concat!("enfilade ", env!("CARGO_PKG_VERSION")).into();
        assert_eq!(check(&world, &ground), Vec::<String>::new());
        // A meter higher it has a sill.
        for corner in &mut world.graph.portals[0].pieces[0] {
            corner[1] += 1.0;
        }
        let said = check(&world, &ground);
        assert!(
            said.len() == 1 && said[0].contains("1.00 m over the ground"),
            "{said:?}"
        );
    }

    #[test]
    fn what_stands_on_the_ground_is_a_window_if_one_is_near_that_says_so() {
        let ground = Aabb::new(DVec3::new(-5.0, -0.2, -5.0), DVec3::new(5.0, 0.0, 5.0)).triangles();
        let piece = vec![
            [0.0, 0.0, 0.0],
            [0.0, 0.0, 2.0],
            [0.0, 2.0, 2.0],
            [0.0, 2.0, 0.0],
        ];
        let window = Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Window,
            normal: [1.0, 0.0, 0.0],
            outline: piece.clone(),
            pieces: vec![piece],
            area: 4.0,
            fittings: Vec::new(),
            why: Vec::new(),
        };
        let mut world = World {
            graph: CellPortalGraph {
                portals: vec![window],
                ..CellPortalGraph::default()
            },
            ..World::default()
        };
        world.graph.provenance.generator = concat!("enfilade ", env!("CARGO_PKG_VERSION")).into();
        let said = check(&world, &ground);
        assert!(
            said.len() == 1 && said[0].contains("stands on the ground"),
            "{said:?}"
        );
        world.detail_meshes = vec![Mesh {
            name: String::new(),
            primitives: vec![Primitive {
                positions: vec![[0.1, 0.5, 0.5], [0.1, 0.5, 1.5], [0.1, 1.5, 1.0]],
                indices: vec![0, 1, 2],
                ..Primitive::default()
            }],
        }];
        for (name, n) in [("RoomWindow_01", 0), ("Chair", 1)] {
            world.details = vec![DetailObject {
                name: name.to_owned(),
                mesh: 0,
                transform: DMat4::IDENTITY.to_cols_array().map(|v| v as f32),
                cells: Vec::new(),
                source: None,
                part_of: None,
            }];
            assert_eq!(check(&world, &ground).len(), n, "{name}");
        }
        // One beside the opening says nothing about it.
        world.details[0].name = "RoomWindow_01".to_owned();
        for corner in &mut world.detail_meshes[0].primitives[0].positions {
            corner[2] += 1.8;
        }
        assert_eq!(check(&world, &ground).len(), 1);
    }
}
