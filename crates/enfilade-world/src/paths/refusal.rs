//! Words on walks that are not possible: what is in the way, where it is, and how far one gets.

use enfilade_cpg::{CellPortalGraph, DetailObject, PortalId, PortalKind, World};
use enfilade_geom::{Aabb, DMat4, DVec3, shown};

use super::{Blocked, NoPath, Obstacle, Path, PathSearch, WalkMap};
use crate::Agent;
use crate::space::{PartId, Space};

/// Size of a walker that is tried instead, relative to the one that finds no path.
const SMALLER: f64 = 0.75;

/// Farthest of an object from the middle of an obstacle that it is named for. [Units: wu]
const NEAR: f64 = 1.0;

/// A walk as it was asked for.
pub struct AskedWalk<'a> {
    /// Where to walk.
    pub space: &'a Space,
    /// The floors of the walker there.
    pub map: &'a WalkMap,
    /// The walker.
    pub walker: Agent,
    /// `true` if objects are in its way.
    pub has_objects: bool,
    /// Start and end. [Units: wu]
    pub ends: [DVec3; 2],
    /// Portals that are closed.
    pub closed: &'a [PortalId],
    /// `true` to make the maps of other walkers, too, which takes as long as that of this one: they tell whether an obstacle is
    /// an object, low or narrow.
    pub has_others: bool,
    /// Names of its settings, for messages.
    pub words: WalkWords<'a>,
}

/// The names by which a caller gives the settings of a walk.
#[derive(Clone, Copy, Debug)]
pub struct WalkWords<'a> {
    /// Start and end.
    pub ends: [&'a str; 2],
    /// The walker's highest step.
    pub step: &'a str,
    /// Its height.
    pub height: &'a str,
    /// Its radius.
    pub radius: &'a str,
    /// The setting that lets it walk through objects.
    pub no_objects: &'a str,
}

/// Three coordinates in centimeters, never minus zero. [Units: wu]
fn at(place: DVec3) -> String {
    // Adding zero makes 0 of -0.
    let [x, y, z] = place.to_array().map(|v| (v * 100.0).round() / 100.0 + 0.0);
    format!("{x:.2} {y:.2} {z:.2}")
}

impl AskedWalk<'_> {
    /// Finds the path; the error says what is in the way, by name and place, and how far one gets.
    ///
    /// # Errors
    ///
    /// If an end is not on a floor, or there is no way between them.
    pub fn find(&self, path: &mut Path) -> Result<(), String> {
        let mut search = PathSearch::new();
        match search.find(self.map, self.space, self.at_root(), self.is_open(), path) {
            Ok(()) => Ok(()),
            Err(NoPath::NoFloorAtStart) => Err(self.no_floor(0)),
            Err(NoPath::NoFloorAtEnd) => Err(self.no_floor(1)),
            Err(NoPath::NoWay) => Err(self.no_way(&mut search)),
        }
    }

    fn at_root(&self) -> [(PartId, DVec3); 2] {
        self.ends.map(|p| (PartId::ROOT, p))
    }

    fn is_open(&self) -> impl FnMut(PartId, PortalId) -> bool {
        |_, portal| !self.closed.contains(&portal)
    }

    fn graph(&self) -> &CellPortalGraph {
        &self.space.world(PartId::ROOT).graph
    }

    /// Returns the name of a cell, or words for solid matter, around a point.
    pub fn around(&self, p: DVec3) -> String {
        match self.space.layout(PartId::ROOT).locate(p) {
            Some(cell) => format!("in {}", shown(&self.graph()[cell].name)),
            None => "in solid matter".into(),
        }
    }

    fn no_floor(&self, end: usize) -> String {
        let (p, option) = (self.ends[end], self.words.ends[end]);
        let nearest = self.map.floors(PartId::ROOT).nearest(p);
        let nearest = match nearest {
            Some(q) => format!("the nearest is {:.2} m away, at {}", q.distance(p), at(q)),
            None => "there is none in the world".into(),
        };
        format!(
            "{option}: no floor for a walker within its height and diameter of {}, {}; {nearest}",
            at(p),
            self.around(p)
        )
    }

    fn no_way(&self, search: &mut PathSearch) -> String {
        let blocked = search.blocked(self.map, self.space, self.at_root(), self.is_open());
        let walker = self.walker;
        let side = self.map.floors(PartId::ROOT).side();
        // Squares are a quarter of the radius wide unless the world is too large for that.
        let coarse = if side > 0.26 * walker.radius {
            format!(
                "; with floors divided into squares of {side:.3} m, doorways narrower than {:.2} m may be missed",
                2.0 * (walker.radius + side)
            )
        } else {
            String::new()
        };
        let why = match blocked {
            None => "leaves of doors are in each other's way".into(),
            Some(blocked) => format!(
                "{}; one gets {:.2} m far, to {} {}, {:.2} m from the end",
                self.obstacle(&blocked),
                blocked.length,
                at(blocked.at),
                self.around(blocked.at + DVec3::Y * 0.5 * walker.height),
                blocked.at.distance(self.ends[1])
            ),
        };
        format!("{}: {why}{coarse}", NoPath::NoWay)
    }

    fn obstacle(&self, blocked: &Blocked) -> String {
        let walker = self.walker;
        let step = |rise: f64| {
            let way = if rise > 0.0 { "higher" } else { "lower" };
            format!(
                "{:.2} m {way} than the floor before it, more than a step of {:.2} m ({})",
                rise.abs(),
                walker.step,
                self.words.step
            )
        };
        let words = match blocked.by {
            Obstacle::Closed(p) => return format!("{} is closed", self.portal(p)),
            Obstacle::Leaf(p) => {
                return format!("the open leaf of {} is in the way", self.portal(p));
            }
            Obstacle::Filled(p) => return format!("{} is filled, as by a pane", self.portal(p)),
            Obstacle::Narrow(p, width) => {
                return format!(
                    "{} is {width:.2} m wide, too narrow for a walker of {:.2} m ({} {})",
                    self.portal(p),
                    2.0 * walker.radius,
                    self.words.radius,
                    walker.radius
                );
            }
            Obstacle::Low(p, height) => {
                return format!(
                    "{} is {height:.2} m high, too low for a walker of {:.2} m ({})",
                    self.portal(p),
                    walker.height,
                    self.words.height
                );
            }
            Obstacle::Sill(p, rise) => return format!("{} is {}", self.portal(p), step(rise)),
            Obstacle::Unfit(p) => format!(
                "{} has no floor on one side, or something stands in it",
                self.portal(p)
            ),
            Obstacle::Step(rise) => {
                format!("the floor at {} is {}", at(blocked.beyond), step(rise))
            }
            Obstacle::Tight => format!(
                "between {} and {} is too little room",
                at(blocked.at),
                at(blocked.beyond)
            ),
            Obstacle::Gap => {
                let [from, to] = [blocked.at, blocked.beyond];
                let rise = to.y - from.y;
                let level = match rise.abs() {
                    h if h <= walker.step => String::new(),
                    h if rise > 0.0 => format!(", {h:.2} m higher,"),
                    h => format!(", {h:.2} m lower,"),
                };
                format!(
                    "between {} and {}{level} is no floor, or something stands there",
                    at(from),
                    at(to)
                )
            }
        };
        match self.has_others {
            true => self.compared(blocked, words),
            false => words,
        }
    }

    /// Adds to words on an obstacle which other walker would pass it.
    fn compared(&self, blocked: &Blocked, words: String) -> String {
        let walker = self.walker;
        // Only other maps tell whether objects, a low ceiling or a narrow place are in the way.
        if self.has_objects && self.is_way_for(walker, false) {
            return self.objects_in_way(blocked);
        }
        let [mut lower, mut thinner] = [walker, walker];
        lower.height *= SMALLER;
        thinner.radius *= SMALLER;
        let size = |what: &str, own: f64, option: &str| {
            let would = SMALLER * own;
            format!(
                "{words}; a walker {would:.2} m {what} would get there, and this one is {own:.2} m {what} ({option})"
            )
        };
        if self.is_way_for(lower, self.has_objects) {
            return size("high", walker.height, self.words.height);
        }
        if self.is_way_for(thinner, self.has_objects) {
            let option = format!("{}, half of it", self.words.radius);
            return size("wide", 2.0 * walker.radius, &option);
        }
        words
    }

    /// Tests if another walker gets to the end.
    fn is_way_for(&self, walker: Agent, has_objects: bool) -> bool {
        let map = WalkMap::with_objects(self.space, walker, |_, _| has_objects);
        let mut path = Path::default();
        let mut search = PathSearch::new();
        let found = search.find(&map, self.space, self.at_root(), self.is_open(), &mut path);
        found.is_ok()
    }

    fn objects_in_way(&self, blocked: &Blocked) -> String {
        let world = self.space.world(PartId::ROOT);
        let middle = blocked.at.midpoint(blocked.beyond) + DVec3::Y * 0.25 * self.walker.height;
        let far = |object: &DetailObject| bounds_of(world, object).distance_squared(middle).sqrt();
        let all = world.details.iter().map(|d| (far(d), d));
        let nearest = all.min_by(|a, b| a.0.total_cmp(&b.0));
        let named = nearest.filter(|n| n.0 <= NEAR && !n.1.name.is_empty());
        let name = named.map_or_else(String::new, |n| format!(", nearest '{}'", shown(&n.1.name)));
        format!(
            "objects stand between {} and {}{name} ({} walks through them)",
            at(blocked.at),
            at(blocked.beyond),
            self.words.no_objects
        )
    }

    /// Returns a portal in words: its number, kind, cells and place.
    fn portal(&self, id: PortalId) -> String {
        let graph = self.graph();
        let portal = &graph[id];
        let [a, b] = portal.cells.map(|c| shown(&graph[c].name).to_string());
        let kind = match portal.kind {
            PortalKind::Open => "an opening",
            PortalKind::Door => "a door",
            PortalKind::Window => "a window",
            PortalKind::Crack => "a crack",
        };
        let opening = self.space.layout(PartId::ROOT).opening(id);
        let middle = opening.center().with_y(opening.bounds().min.y);
        format!("{id}, {kind} between {a} and {b} at {},", at(middle))
    }
}

fn bounds_of(world: &World, object: &DetailObject) -> Aabb {
    let mesh = &world.detail_meshes[object.mesh as usize];
    let transform = DMat4::from_cols_array(&object.transform.map(f64::from));
    let points = mesh.primitives.iter().flat_map(|p| &p.positions);
    points
        .map(|p| transform.transform_point3(DVec3::from_array(p.map(f64::from))))
        .fold(Aabb::EMPTY, Aabb::including)
}
