//! Furnished dwellings of known size: rooms by a plan, wide doorways in line, and as many triangles of furniture as asked for.
//!
//! The first two plans have the sizes of the models in Aliaga & Lastra, "Architectural Walkthroughs Using Portal Textures"
//! (IEEE Visualization 1997), §5.1: triangles, cells, portals. The models themselves are not to be had. Openings are so wide that
//! portal culling draws about as large a share of what frustum culling draws as there (3.3 to 4.6 and 2.6 to 4.3, that is 0.72 and
//! 0.60; here 0.71 and 0.54 on the route).

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use enfilade_cpg::{PortalKind, World};
use enfilade_geom::{DMat3, DVec3};

use super::furnished::{Spot, dress, furnish};
use super::grid::{Face, Grid};
use super::world::{FaceHole, world_of};
use enfilade_demo::Rng;

/// Height of a storey, and of an eye above its floor. [Units: wu]
const STOREY: f64 = 3.0;
const EYE: f64 = 1.6;
/// Distance of furniture from the lines between the middles of doorways, and from walls. [Units: wu]
const WALKWAY: f64 = 0.4;
const REVEAL: f64 = 0.1;

/// Parameters of [`dwelling`].
#[derive(Clone, Debug)]
pub struct DwellingParams {
    /// Storeys from the ground, each of rows along z of squares along x. A letter is a room of the storey; a small letter is a
    /// square of the same room with a floor above more of that room.
    pub plan: Vec<Vec<String>>,
    /// Letters of rooms that continue from storey to storey, without floors between.
    pub tall: String,
    /// Square (x, storey, z) of a stair that rises along z to the next storey.
    pub stair: Option<[usize; 3]>,
    /// Portals between rooms; as many as there are walls between squares at most.
    pub n_inner: usize,
    /// Windows to the outdoors, likewise.
    pub n_windows: usize,
    /// Share of a wall that its opening is wide.
    pub width: f64,
    /// Triangles with furniture. Furniture comes as close as it can from below, to less than 1 %.
    pub n_triangles: u64,
    /// Seed of the random choices.
    pub seed: u64,
}

fn storey(rows: &[&str]) -> Vec<String> {
    rows.iter().map(|&row| row.to_owned()).collect()
}

impl DwellingParams {
    /// A large one-storey house: 528,000 triangles, 19 cells with the outdoors, 52 portals.
    #[must_use]
    pub fn brooks() -> Self {
        Self {
            plan: vec![storey(&[
                "AABBBCC", "AADDEQQ", "FFGGEHH", "RIGGJHK", "LMNOJPK",
            ])],
            tall: String::new(),
            stair: None,
            n_inner: 38,
            n_windows: 14,
            width: 0.77,
            n_triangles: 528_000,
            seed: 1,
        }
    }

    /// A house of two storeys around a hall with a stair: 214,000 triangles, 7 cells with the outdoors, 12 portals.
    #[must_use]
    pub fn haunted() -> Self {
        Self {
            plan: vec![
                storey(&["AAHB", "AAHB", "CCHB"]),
                storey(&["DDHE", "DDHE", "DDhE"]),
            ],
            tall: "H".into(),
            stair: Some([2, 0, 1]),
            n_inner: 11,
            n_windows: 1,
            width: 0.84,
            n_triangles: 214_000,
            ..Self::brooks()
        }
    }

    /// A tower of furnished storeys around an atrium, 10 million triangles on 20 storeys.
    #[must_use]
    pub fn tower() -> Self {
        let one = Self::brooks();
        let n = 20;
        Self {
            plan: vec![one.plan[0].clone(); n],
            tall: "G".into(),
            n_inner: 38 * n,
            n_windows: 14 * n,
            n_triangles: 10_000_000,
            ..one
        }
    }
}

/// A world and a way through it.
#[derive(Clone, Debug)]
pub struct Dwelling {
    /// The world.
    pub world: World,
    /// Points at the height of an eye, from room to room until all that can be walked to have been visited, clear of
    /// furniture. [Units: wu]
    pub route: Vec<[f32; 3]>,
}

/// Builds a furnished dwelling.
///
/// # Panics
///
/// If rows or storeys of the plan differ in size.
#[must_use]
pub fn dwelling(params: &DwellingParams) -> Dwelling {
    let plan = RoomPlan::new(params);
    let holes = plan.holes();
    let mut world = world_of(&plan.grid, &[], &mut |face| holes.get(&key(face)).copied());
    dress(&mut world);
    let floors = plan.floors();
    furnish(
        &mut world,
        &plan.spots(),
        &floors,
        params.n_triangles,
        params.seed,
    );
    Dwelling {
        route: plan.route(&holes),
        world,
    }
}

type Square = [usize; 3];
/// An axis, and the square above.
type FaceKey = (usize, Square);

fn key(face: &Face) -> FaceKey {
    (face.axis, face.square)
}

/// Joins the groups of two squares; returns `false` if they are one.
fn join(groups: &mut BTreeMap<Square, usize>, squares: [Square; 2]) -> bool {
    let [a, b] = squares.map(|s| groups[&s]);
    groups
        .values_mut()
        .filter(|g| **g == b)
        .for_each(|g| *g = a);
    a != b
}

struct RoomPlan<'a> {
    params: &'a DwellingParams,
    grid: Grid,
}

impl<'a> RoomPlan<'a> {
    fn new(params: &'a DwellingParams) -> Self {
        let plan = &params.plan;
        let size = [plan[0][0].len(), plan.len(), plan[0].len()];
        let mut rng = Rng::new(params.seed);
        let at = [0, 1, 2].map(|k| {
            let mut x = 0.0;
            let mut at = vec![x];
            for _ in 0..size[k] {
                x += if k == 1 { STOREY } else { rng.range(4.2, 5.0) };
                at.push(x);
            }
            at
        });
        let mut numbers = BTreeMap::new();
        let mut label = Vec::new();
        for row in 0..size[2] {
            for (s, rows) in plan.iter().enumerate() {
                assert_eq!([rows.len(), rows[row].len()], [size[2], size[0]]);
                for letter in rows[row].chars() {
                    let room = letter.to_ascii_uppercase();
                    let is_tall = params.tall.contains(room);
                    let room = (room, if is_tall { 0 } else { s });
                    let next = numbers.len() as u32;
                    label.push(*numbers.entry(room).or_insert(next));
                }
            }
        }
        let grid = Grid {
            size,
            at,
            label,
            outdoors: Some(numbers.len() as u32),
            turn: DMat3::IDENTITY,
        };
        Self { params, grid }
    }

    fn letter(&self, [x, y, z]: Square) -> char {
        char::from(self.params.plan[y][z].as_bytes()[x])
    }

    fn room(&self, [x, y, z]: Square) -> u32 {
        let [nx, ny, _] = self.grid.size;
        self.grid.label[(z * ny + y) * nx + x]
    }

    /// Returns `true` if there is a floor to walk on, without a stair.
    fn is_walkable(&self, square: Square) -> bool {
        self.has_floor(square) && self.params.stair != Some(square)
    }

    fn has_floor(&self, square: Square) -> bool {
        let [x, y, z] = square;
        y == 0
            || self.letter(square).is_ascii_lowercase()
            || self.room([x, y - 1, z]) != self.room(square)
    }

    /// Returns the squares, the lowest first.
    fn squares(&self) -> impl Iterator<Item = Square> + use<> {
        let [nx, ny, nz] = self.grid.size;
        (0..nx * ny * nz).map(move |i| [i % nx, i / nx / nz, i / nx % nz])
    }

    /// Chooses the openings: first doorways so that one can walk from any floor to any other, then any, as many as there should be.
    fn holes(&self) -> BTreeMap<FaceKey, FaceHole> {
        let mut rng = Rng::stream(self.params.seed, 1);
        let outdoors = self.grid.outdoors;
        let mut upright: Vec<Face> = (self.grid.faces().into_iter())
            .filter(|face| face.axis != 1)
            .collect();
        rng.shuffle(&mut upright);
        let (outer, inner): (Vec<Face>, Vec<Face>) = upright
            .into_iter()
            .partition(|face| face.cells.contains(&outdoors));
        let sides = |face: &Face| {
            let mut below = face.square;
            below[face.axis] -= 1;
            [below, face.square]
        };
        let is_doorway = |face: &Face| sides(face).iter().all(|s| self.is_walkable(*s));
        let mut groups = self.places();
        let mut joins = |face: &Face| is_doorway(face) && join(&mut groups, sides(face));
        let (first, rest): (Vec<Face>, Vec<Face>) = inner.iter().partition(|face| joins(face));
        let inner = first.iter().chain(&rest).take(self.params.n_inner);
        let openings = inner.map(|face| (key(face), self.hole(face, is_doorway(face))));
        let windows = outer.iter().take(self.params.n_windows);
        openings
            .chain(windows.map(|face| (key(face), self.hole(face, false))))
            .collect()
    }

    /// Returns a number for each square with a floor, equal for those between which one walks without a doorway.
    fn places(&self) -> BTreeMap<Square, usize> {
        let squares = self.squares().filter(|s| self.is_walkable(*s));
        let mut groups: BTreeMap<Square, usize> = squares.zip(0..).collect();
        let none = BTreeMap::new();
        for square in groups.keys().copied().collect::<Vec<_>>() {
            for (to, _) in self.ways(square, &none) {
                join(&mut groups, [square, to]);
            }
        }
        groups
    }

    /// Returns the opening in the middle of a wall.
    fn hole(&self, face: &Face, is_doorway: bool) -> FaceHole {
        let is_outer = face.cells.contains(&self.grid.outdoors);
        let up = usize::from(face.axis != 0);
        let width = self.params.width;
        let (mut low, mut high) = ([0.5 - width * 0.5; 2], [0.5 + width * 0.5; 2]);
        (low[up], high[up]) = if is_doorway { (0.0, 0.9) } else { (0.3, 0.85) };
        let kind = if is_outer {
            PortalKind::Window
        } else {
            PortalKind::Open
        };
        (low, high, kind)
    }

    fn middle(&self, [x, y, z]: Square) -> DVec3 {
        let [ax, ay, az] = &self.grid.at;
        DVec3::new((ax[x] + ax[x + 1]) * 0.5, ay[y], (az[z] + az[z + 1]) * 0.5)
    }

    /// Returns the quarters of squares beside the lines from doorway to doorway.
    fn spots(&self) -> Vec<Spot> {
        let mut out = Vec::new();
        for square in self.squares().filter(|s| self.is_walkable(*s)) {
            let middle = self.middle(square);
            for [i, k] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                let quarter = |axis: usize, side: usize| {
                    let [low, high] = [0, 1].map(|d| self.grid.at[axis][square[axis] + d]);
                    let ends = if side == 0 {
                        [low + REVEAL, middle[axis] - WALKWAY]
                    } else {
                        [middle[axis] + WALKWAY, high - REVEAL]
                    };
                    [(ends[0] + ends[1]) * 0.5, ends[1] - ends[0]]
                };
                let ([x, w], [z, d]) = (quarter(0, i), quarter(2, k));
                // Backs against the wall across z.
                out.push(Spot {
                    cell: self.room(square),
                    at: DVec3::new(x, middle.y, z),
                    radius: w.min(d) * 0.5,
                    yaw: if k == 0 { 0.0 } else { 180.0 },
                });
            }
        }
        out
    }

    /// Returns the floors within rooms and the steps, as boxes with their cells.
    fn floors(&self) -> Vec<(u32, [DVec3; 2])> {
        let mut out = Vec::new();
        let extent = |square: Square| {
            let at = |d: usize| DVec3::from([0, 1, 2].map(|k| self.grid.at[k][square[k] + d]));
            [at(0), at(1)]
        };
        for square in self
            .squares()
            .filter(|s| self.letter(*s).is_ascii_lowercase())
        {
            let [low, high] = extent(square);
            let top = DVec3::new(high.x, low.y, high.z);
            // Clear of the walls, so that it touches no other room.
            let edge = DVec3::new(0.01, 0.0, 0.01);
            out.push((self.room(square), [low - DVec3::Y * 0.2 + edge, top - edge]));
        }
        if let Some(square) = self.params.stair {
            let [low, high] = extent(square);
            let n = 17;
            for i in 0..n {
                let t = |i: u32| f64::from(i) / f64::from(n);
                let [z0, z1] = [i, i + 1].map(|i| low.z + (high.z - low.z) * t(i));
                let top = low.y + STOREY * t(i + 1);
                let step = [
                    DVec3::new(low.x + 1.2, (top - 0.3).max(low.y), z0),
                    DVec3::new(high.x - 1.2, top, z1),
                ];
                out.push((self.room(square), step));
            }
        }
        out
    }

    /// Returns the walkable neighbors of a square, with the points on the way.
    fn ways(
        &self,
        square: Square,
        holes: &BTreeMap<FaceKey, FaceHole>,
    ) -> Vec<(Square, Vec<DVec3>)> {
        let mut out = Vec::new();
        for (axis, is_up) in [(0, false), (0, true), (2, false), (2, true)] {
            let mut to = square;
            if (is_up && square[axis] + 1 == self.grid.size[axis]) || (!is_up && square[axis] == 0)
            {
                continue;
            }
            to[axis] = if is_up {
                square[axis] + 1
            } else {
                square[axis] - 1
            };
            let upper = if is_up { to } else { square };
            let is_open = self.room(to) == self.room(square) || holes.contains_key(&(axis, upper));
            if is_open && self.is_walkable(to) {
                let mut between = self.middle(square);
                between[axis] = self.grid.at[axis][upper[axis]];
                out.push((to, vec![between, self.middle(to)]));
            }
        }
        let Some(stair) = self.params.stair else {
            return out;
        };
        let [x, y, z] = stair;
        let (foot, head) = ([x, y, z - 1], [x, y + 1, z + 1]);
        let mut ends = [self.middle(stair); 2];
        ends[0].z = self.grid.at[2][z];
        ends[1].z = self.grid.at[2][z + 1];
        ends[1].y += STOREY;
        if square == foot {
            out.push((head, vec![ends[0], ends[1], self.middle(head)]));
        } else if square == head {
            out.push((foot, vec![ends[1], ends[0], self.middle(foot)]));
        }
        out
    }

    /// Walks to the nearest room not visited yet, until there is none, from a square of the storey in the middle.
    fn route(&self, holes: &BTreeMap<FaceKey, FaceHole>) -> Vec<[f32; 3]> {
        let start = (self.grid.size[1] - 1) / 2;
        let Some(mut at) = self
            .squares()
            .find(|s| s[1] == start && self.is_walkable(*s))
        else {
            return Vec::new();
        };
        let mut visited = BTreeSet::from([self.room(at)]);
        let mut route = vec![self.middle(at)];
        while let Some((to, points)) = self.nearest(at, &visited, holes) {
            visited.insert(self.room(to));
            route.extend(points);
            at = to;
        }
        let eye = |p: &DVec3| (*p + DVec3::Y * EYE).as_vec3().to_array();
        route.iter().map(eye).collect()
    }

    fn nearest(
        &self,
        from: Square,
        visited: &BTreeSet<u32>,
        holes: &BTreeMap<FaceKey, FaceHole>,
    ) -> Option<(Square, Vec<DVec3>)> {
        let mut came: BTreeMap<Square, (Square, Vec<DVec3>)> = BTreeMap::new();
        let mut queue = VecDeque::from([from]);
        while let Some(at) = queue.pop_front() {
            if !visited.contains(&self.room(at)) {
                let (mut points, mut back) = (Vec::new(), at);
                while back != from {
                    let (before, way) = &came[&back];
                    points.extend(way.iter().rev());
                    back = *before;
                }
                points.reverse();
                return Some((at, points));
            }
            for (to, way) in self.ways(at, holes) {
                if to != from && !came.contains_key(&to) {
                    came.insert(to, (at, way));
                    queue.push_back(to);
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn n_triangles(world: &World) -> u64 {
        let structure: usize = (world.batches.iter())
            .map(|b| b.primitive.indices.len() / 3)
            .sum();
        let of_mesh = |m: u32| {
            let all = world.detail_meshes[m as usize].primitives.iter();
            all.map(|p| p.indices.len() as u64 / 3).sum::<u64>()
        };
        structure as u64 + world.details.iter().map(|d| of_mesh(d.mesh)).sum::<u64>()
    }

    fn rooms_on(route: &[[f32; 3]], world: &World) -> BTreeSet<u32> {
        let at = |p: &[f32; 3]| DVec3::from(p.map(f64::from)) + DVec3::splat(1e-4);
        let cell = |p| world.graph.locator.locate(at(p)).map(|c| c.0);
        route.iter().filter_map(cell).collect()
    }

    #[test]
    fn the_paper_s_models_have_their_sizes_and_all_rooms_are_walked_through() {
        for (params, n_cells, n_portals) in [
            (DwellingParams::brooks(), 19, 52),
            (DwellingParams::haunted(), 7, 12),
        ] {
            let Dwelling { world, route } = dwelling(&params);
            assert_eq!(world.validate(), Ok(()));
            let graph = &world.graph;
            assert_eq!(
                [graph.cells.len(), graph.portals.len()],
                [n_cells, n_portals]
            );
            let share = n_triangles(&world) as f64 / params.n_triangles as f64;
            assert!((0.99..=1.0).contains(&share), "{share}");
            assert_eq!(rooms_on(&route, &world).len(), n_cells - 1);
        }
    }

    #[test]
    fn furniture_stands_in_its_cell_and_off_the_route() {
        for params in [DwellingParams::brooks(), DwellingParams::haunted()] {
            let Dwelling { world, route } = dwelling(&params);
            let flat = |p: [f32; 3]| DVec3::new(p[0].into(), 0.0, p[2].into());
            for object in world.details.iter().filter(|o| o.name != "floor") {
                let place = object.transform[12..15].iter().map(|&x| f64::from(x));
                let place = DVec3::from_slice(&place.collect::<Vec<_>>());
                let mesh = &world.detail_meshes[object.mesh as usize];
                let vertices = mesh.primitives.iter().flat_map(|p| &p.positions);
                for v in vertices.step_by(7) {
                    let m = object.transform.map(f64::from);
                    let [x, y, z] = v.map(f64::from);
                    let turned = DVec3::new(m[0] * x + m[8] * z, y, m[2] * x + m[10] * z);
                    let p = place + turned + DVec3::Y * 1e-3;
                    let cell = world.graph.locator.locate(p);
                    assert_eq!(cell, object.cells.first().copied(), "{} {p}", object.name);
                    for pair in route.windows(2) {
                        if (f64::from(pair[0][1]) - EYE - place.y).abs() > 2.0 {
                            continue;
                        }
                        let [a, b] = [flat(pair[0]), flat(pair[1])];
                        let own = DVec3::new(p.x, 0.0, p.z);
                        let t = (own - a).dot(b - a) / (b - a).length_squared();
                        let gap = own.distance(a + (b - a) * t.clamp(0.0, 1.0));
                        assert!(gap > 0.2, "{} {gap}", object.name);
                    }
                }
            }
        }
    }
}
