//! Messages on walks that are not possible, or not between the points that were asked for.

use anyhow::anyhow;
use enfilade::cpg::{CellPortalGraph, DetailObject, PortalId, World};
use enfilade::geom::{Aabb, DMat4, DVec3, shown};
use enfilade::world::{Blocked, NoPath, Obstacle, PartId, Path, PathSearch, Space, WalkMap};
use serde::Serialize;

use crate::inspect::kind_name;
use crate::screen::At;
use crate::walk::Walks;

/// A walk as it was asked for.
pub(crate) struct Wanted<'a> {
    pub(crate) space: &'a Space,
    pub(crate) map: &'a WalkMap,
    pub(crate) walks: Walks,
    /// Start and end. [Units: wu]
    pub(crate) ends: [DVec3; 2],
    /// Options that give start and end.
    pub(crate) options: [&'a str; 2],
    pub(crate) closed: &'a [u32],
}

/// An end of a path that is elsewhere than it was asked for.
#[derive(Serialize)]
pub(crate) struct MovedEnd {
    /// The option that gave it.
    option: String,
    asked: [f64; 3],
    reached: [f64; 3],
    /// Cell in which it was asked for; `null` in solid matter.
    asked_cell: Option<u32>,
    reached_cell: Option<u32>,
    /// Between both, in plan. [Units: wu]
    distance: f64,
}

/// An end that is moved less, in plan, is where it was asked. [Units: wu]
const BESIDE: f64 = 0.1;

/// Size of a walker that is tried instead, relative to the one that finds no path.
const SMALLER: f64 = 0.75;

/// Farthest of an object from the middle of an obstacle that it is named for. [Units: wu]
const NEAR: f64 = 1.0;

impl Wanted<'_> {
    /// Finds the path; the error says what is in the way.
    pub(crate) fn find(&self, path: &mut Path) -> anyhow::Result<()> {
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
        |_, portal| !self.closed.contains(&portal.0)
    }

    fn graph(&self) -> &CellPortalGraph {
        &self.space.world(PartId::ROOT).graph
    }

    /// Returns the name of a cell, or words for solid matter, around a point.
    fn around(&self, p: DVec3) -> String {
        match self.space.layout(PartId::ROOT).locate(p) {
            Some(cell) => format!("in {}", shown(&self.graph()[cell].name)),
            None => "in solid matter".into(),
        }
    }

    fn no_floor(&self, end: usize) -> anyhow::Error {
        let (p, option) = (self.ends[end], self.options[end]);
        let nearest = self.map.floors(PartId::ROOT).nearest(p);
        let nearest = match nearest {
            Some(q) => format!(
                "the nearest is {:.2} m away, at {}",
                q.distance(p),
                At(q.into())
            ),
            None => "there is none in the world".into(),
        };
        anyhow!(
            "{option}: no floor for a walker within its height and diameter of {}, {}; {nearest}",
            At(p.into()),
            self.around(p)
        )
    }

    fn no_way(&self, search: &mut PathSearch) -> anyhow::Error {
        let blocked = search.blocked(self.map, self.space, self.at_root(), self.is_open());
        let walker = self.walks.agent;
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
                At(blocked.at.into()),
                self.around(blocked.at + DVec3::Y * 0.5 * walker.height),
                blocked.at.distance(self.ends[1])
            ),
        };
        anyhow!("{}: {why}{coarse}", NoPath::NoWay)
    }

    fn obstacle(&self, blocked: &Blocked) -> String {
        let walker = self.walks.agent;
        let step = |rise: f64| {
            let way = if rise > 0.0 { "higher" } else { "lower" };
            format!(
                "{:.2} m {way} than the floor before it, more than a step of {:.2} m (--step)",
                rise.abs(),
                walker.step
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
                    "{} is {width:.2} m wide, too narrow for a walker of {:.2} m (--radius {})",
                    self.portal(p),
                    2.0 * walker.radius,
                    walker.radius
                );
            }
            Obstacle::Low(p, height) => {
                return format!(
                    "{} is {height:.2} m high, too low for a walker of {:.2} m (--height)",
                    self.portal(p),
                    walker.height
                );
            }
            Obstacle::Sill(p, rise) => return format!("{} is {}", self.portal(p), step(rise)),
            Obstacle::Unfit(p) => format!(
                "{} has no floor on one side, or something stands in it",
                self.portal(p)
            ),
            Obstacle::Step(rise) => {
                format!(
                    "the floor at {} is {}",
                    At(blocked.beyond.into()),
                    step(rise)
                )
            }
            Obstacle::Tight => format!(
                "between {} and {} is too little room",
                At(blocked.at.into()),
                At(blocked.beyond.into())
            ),
            Obstacle::Gap => {
                let [at, to] = [blocked.at, blocked.beyond];
                let rise = to.y - at.y;
                let level = match rise.abs() {
                    h if h <= walker.step => String::new(),
                    h if rise > 0.0 => format!(", {h:.2} m higher,"),
                    h => format!(", {h:.2} m lower,"),
                };
                format!(
                    "between {} and {}{level} is no floor, or something stands there",
                    At(at.into()),
                    At(to.into())
                )
            }
            // A later version may have more.
            _ => format!("the way ends at {}", At(blocked.at.into())),
        };
        // Only other maps tell whether objects, a low ceiling or a narrow place are in the way.
        let walks = self.walks;
        let bare = Walks {
            objects: false,
            ..walks
        };
        if walks.objects && self.is_way_for(&bare) {
            return self.objects_in_way(blocked);
        }
        let [mut lower, mut thinner] = [walks, walks];
        lower.agent.height *= SMALLER;
        thinner.agent.radius *= SMALLER;
        let size = |what: &str, own: f64, option: &str| {
            let would = SMALLER * own;
            format!(
                "{words}; a walker {would:.2} m {what} would get there, and this one is {own:.2} m {what} ({option})"
            )
        };
        if self.is_way_for(&lower) {
            return size("high", walker.height, "--height");
        }
        if self.is_way_for(&thinner) {
            return size("wide", 2.0 * walker.radius, "--radius, half of it");
        }
        words
    }

    /// Tests if other walkers get to the end.
    fn is_way_for(&self, walks: &Walks) -> bool {
        let map = walks.map(self.space);
        let mut path = Path::default();
        let mut search = PathSearch::new();
        let found = search.find(&map, self.space, self.at_root(), self.is_open(), &mut path);
        found.is_ok()
    }

    fn objects_in_way(&self, blocked: &Blocked) -> String {
        let world = self.space.world(PartId::ROOT);
        let middle =
            blocked.at.midpoint(blocked.beyond) + DVec3::Y * 0.25 * self.walks.agent.height;
        let far = |object: &DetailObject| bounds_of(world, object).distance_squared(middle).sqrt();
        let all = world.details.iter().map(|d| (far(d), d));
        let nearest = all.min_by(|a, b| a.0.total_cmp(&b.0));
        let named = nearest.filter(|n| n.0 <= NEAR && !n.1.name.is_empty());
        let name = named.map_or_else(String::new, |n| format!(", nearest '{}'", shown(&n.1.name)));
        format!(
            "objects stand between {} and {}{name} (--no-objects walks through them)",
            At(blocked.at.into()),
            At(blocked.beyond.into())
        )
    }

    /// Returns a portal in words: its number, kind, cells and place.
    fn portal(&self, id: PortalId) -> String {
        let graph = self.graph();
        let portal = &graph[id];
        let [a, b] = portal.cells.map(|c| shown(&graph[c].name).to_string());
        let kind = match kind_name(portal.kind) {
            "open" => "opening",
            kind => kind,
        };
        let article = if kind == "opening" { "an" } else { "a" };
        let opening = self.space.layout(PartId::ROOT).opening(id);
        let at = opening.center().with_y(opening.bounds().min.y);
        format!(
            "{id}, {article} {kind} between {a} and {b} at {},",
            At(at.into())
        )
    }

    /// Returns the ends of a path that are elsewhere than they were asked for.
    pub(crate) fn moved(&self, path: &Path) -> Vec<MovedEnd> {
        let (Some(first), Some(last)) = (path.points.first(), path.points.last()) else {
            return Vec::new();
        };
        let layout = self.space.layout(PartId::ROOT);
        let half = DVec3::Y * 0.5 * self.walks.agent.height;
        let ends = self.ends.into_iter().zip([first.at, last.at]);
        let all = ends
            .zip(self.options)
            .filter_map(|((asked, reached), option)| {
                let distance = (reached - asked).with_y(0.0).length();
                let [before, after] =
                    [above(asked, reached), reached + half].map(|p| layout.locate(p));
                let is_other = before.is_some() && before != after;
                (distance > BESIDE || is_other).then(|| MovedEnd {
                    option: option.to_owned(),
                    asked: asked.to_array(),
                    reached: reached.to_array(),
                    asked_cell: before.map(|c| c.0),
                    reached_cell: after.map(|c| c.0),
                    distance,
                })
            });
        all.collect()
    }

    /// Returns a moved end in words.
    pub(crate) fn told(&self, moved: &MovedEnd) -> String {
        let [asked, reached] = [moved.asked, moved.reached];
        let half = DVec3::Y * 0.5 * self.walks.agent.height;
        format!(
            "{}: a walker cannot stand at {}, {}; the path leads {} {} {}, {:.2} m beside and {:.2} m below",
            moved.option,
            At(asked),
            self.around(above(asked.into(), reached.into())),
            if moved.option == self.options[0] {
                "from"
            } else {
                "to"
            },
            At(reached),
            self.around(DVec3::from(reached) + half),
            moved.distance,
            asked[1] - reached[1]
        )
    }
}

/// The point of an end that tells its cell: one at the feet may be in the floor.
fn above(asked: DVec3, reached: DVec3) -> DVec3 {
    asked.with_y(asked.y.max(reached.y + BESIDE))
}

fn bounds_of(world: &World, object: &DetailObject) -> Aabb {
    let mesh = &world.detail_meshes[object.mesh as usize];
    let transform = DMat4::from_cols_array(&object.transform.map(f64::from));
    let points = mesh.primitives.iter().flat_map(|p| &p.positions);
    points
        .map(|p| transform.transform_point3(DVec3::from_array(p.map(f64::from))))
        .fold(Aabb::EMPTY, Aabb::including)
}
