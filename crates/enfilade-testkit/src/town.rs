//! A town as a graph of cells and openings: streets, crossings, lanes, gardens and houses, each cell a box.
//!
//! Gates stand at the ends of streets and lanes, on alternating sides, so that no line passes three of them: what a
//! cell sees does not grow with the town. In a village all houses stand in one outdoor cell, and what a cell sees grows
//! with their number.

use enfilade_cpg::{SightGraph, SightPortal};
use enfilade_geom::{Aabb, DVec3};

use enfilade_demo::Rng;

/// Lengths of the plan. [Units: wu]
const STREET: f64 = 80.0;
const WIDTH: f64 = 8.0;
const HOUSE: f64 = 10.0;
const GARDEN: f64 = 14.0;
/// Heights of streets and of storeys. [Units: wu]
const SKY: f64 = 9.0;
const STOREY: f64 = 3.0;
/// Houses on one side of a street.
const HOUSES: usize = 6;
/// Cells of a street with its crossing, lane, garden and houses.
const QUARTER: usize = 4 + 2 * HOUSES * ROOMS;
const ROOMS: usize = 5;
/// Distance from the edges of an opening within which a line is not followed. [Units: wu]
const MARGIN: f64 = 1e-6;

/// A town: boxes, and the rectangular openings between them.
#[derive(Clone, Debug)]
pub struct Town {
    /// The cells' boxes.
    pub cells: Vec<Aabb>,
    /// The graph of cells and openings.
    pub graph: SightGraph,
    /// Boxes of houses that stand in the first cell.
    houses: Vec<Aabb>,
    /// For each cell, the holes in its faces.
    holes: Vec<Vec<TownHole>>,
}

/// A rectangle in a face of a box.
#[derive(Clone, Debug)]
struct TownHole {
    axis: usize,
    area: Aabb,
    to: u32,
}

/// Makes a town of at least `n_cells` cells, by less than 64 more for each street in a row. Streets form a square.
#[must_use]
pub fn town(n_cells: usize, seed: u64) -> Town {
    let n_quarters = n_cells.div_ceil(QUARTER).max(1);
    let n_columns = (1..).find(|n| n * n >= n_quarters).unwrap_or(1);
    let n_rows = n_quarters.div_ceil(n_columns);
    let mut town = Town {
        cells: Vec::new(),
        graph: SightGraph::default(),
        houses: Vec::new(),
        holes: Vec::new(),
    };
    let mut outdoors = Vec::new();
    for row in 0..n_rows {
        for column in 0..n_columns {
            let at = origin(row, column);
            let mut add = |size: [f64; 2], offset: [f64; 2]| {
                let low = at + DVec3::new(offset[0], 0.0, offset[1]);
                town.add(low, low + DVec3::new(size[0], SKY, size[1]))
            };
            let lane = 2.0 * HOUSE + GARDEN;
            outdoors.push([
                add([WIDTH, WIDTH], [0.0, 0.0]),
                add([STREET, WIDTH], [WIDTH, 0.0]),
                add([WIDTH, lane], [0.0, WIDTH]),
                add([STREET, GARDEN], [WIDTH, WIDTH + HOUSE]),
            ]);
        }
    }
    for row in 0..n_rows {
        for column in 0..n_columns {
            let of = |r: usize, c: usize| {
                (r < n_rows && c < n_columns).then(|| outdoors[r * n_columns + c])
            };
            let here = outdoors[row * n_columns + column];
            town.add_gates(
                here,
                of(row, column + 1),
                of(row + 1, column),
                [row, column],
            );
            let mut rng = Rng::stream(seed, (row * n_columns + column) as u64);
            let corner = origin(row, column) + DVec3::new(WIDTH, 0.0, 0.0);
            for house in 0..HOUSES {
                let x = STREET * house as f64 / HOUSES as f64;
                let near = corner + DVec3::new(x, 0.0, WIDTH);
                town.add_house(near, 1.0, Some(here[1]), here[3], &mut rng);
                let far = corner + DVec3::new(x, 0.0, WIDTH + 2.0 * HOUSE + GARDEN);
                let street = of(row + 1, column).map(|next| next[1]);
                town.add_house(far, -1.0, street, here[3], &mut rng);
            }
        }
    }
    town
}

/// Makes houses with five rooms each, in one outdoor cell, in rows that are not quite straight.
#[must_use]
pub fn village(n_houses: usize, seed: u64) -> Town {
    const PITCH: f64 = 24.0;
    let mut town = Town {
        cells: Vec::new(),
        graph: SightGraph::default(),
        houses: Vec::new(),
        holes: Vec::new(),
    };
    let n_columns = (1..).find(|n| n * n >= n_houses).unwrap_or(1);
    let side = PITCH * (n_columns + 1) as f64;
    let outdoors = town.add(DVec3::ZERO, DVec3::new(side, SKY, side));
    let mut rng = Rng::new(seed);
    for house in 0..n_houses {
        let place = [house % n_columns, house / n_columns];
        let [x, z] = place.map(|i| PITCH * i as f64 + rng.range(4.0, 12.0));
        let corner = DVec3::new(x, 0.0, z);
        let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
        let front = corner + DVec3::Z * if sign > 0.0 { 0.0 } else { HOUSE };
        town.add_house(front, sign, Some(outdoors), outdoors, &mut rng);
        let size = DVec3::new(STREET / HOUSES as f64, 2.0 * STOREY, HOUSE);
        town.houses.push(Aabb::new(corner, corner + size));
    }
    town
}

fn origin(row: usize, column: usize) -> DVec3 {
    let depth = WIDTH + 2.0 * HOUSE + GARDEN;
    DVec3::new(column as f64 * (STREET + WIDTH), 0.0, row as f64 * depth)
}

impl Town {
    fn add(&mut self, a: DVec3, b: DVec3) -> u32 {
        let cell = self.cells.len() as u32;
        self.cells.push(Aabb::of_points(&[a, b]));
        self.holes.push(Vec::new());
        self.graph.n_cells += 1;
        cell
    }

    /// Adds a rectangle between two cells, whose thin axis is normal to it.
    fn open(&mut self, [a, b]: [u32; 2], low: DVec3, high: DVec3) {
        let area = Aabb::of_points(&[low, high]);
        let size = area.size();
        let axis = (0..3).find(|&k| size[k] == 0.0).unwrap_or(0);
        for (from, to) in [(a, b), (b, a)] {
            self.holes[from as usize].push(TownHole { axis, area, to });
        }
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut winding: Vec<DVec3> = [[0, 0], [1, 0], [1, 1], [0, 1]]
            .map(|[i, j]| {
                let mut p = area.min;
                p[u] = [area.min[u], area.max[u]][i];
                p[v] = [area.min[v], area.max[v]][j];
                p
            })
            .to_vec();
        // The normal points from the first cell, which is convex, to the second.
        if self.cells[a as usize].center()[axis] > area.min[axis] {
            winding.reverse();
        }
        self.graph.portals.push(SightPortal {
            cells: [a, b],
            winding,
            pieces: Vec::new(),
        });
    }

    /// Adds the gates of a crossing, and of the next ones along street and lane.
    fn add_gates(
        &mut self,
        [crossing, street, lane, garden]: [u32; 4],
        east: Option<[u32; 4]>,
        south: Option<[u32; 4]>,
        [row, column]: [usize; 2],
    ) {
        let at = origin(row, column);
        let side = |i: usize| if i.is_multiple_of(2) { 0.5 } else { 4.5 };
        let mut gate = |cells, x: f64, z: f64, along_x: bool| {
            let low = at + DVec3::new(x, 0.0, z);
            let size = if along_x {
                DVec3::new(0.0, 4.0, 3.0)
            } else {
                DVec3::new(3.0, 4.0, 0.0)
            };
            self.open(cells, low, low + size);
        };
        gate([crossing, street], WIDTH, side(column), true);
        gate([crossing, lane], side(row), WIDTH, false);
        gate([lane, garden], WIDTH, WIDTH + HOUSE + 2.0, true);
        if let Some(east) = east {
            gate([street, east[0]], WIDTH + STREET, side(column + 1), true);
        }
        if let Some(south) = south {
            let depth = WIDTH + 2.0 * HOUSE + GARDEN;
            gate([lane, south[0]], side(row + 1), depth, false);
        }
    }

    /// Adds a house whose front is at `at` and whose depth runs along z with this sign: a hall, two rooms, and two
    /// rooms above.
    fn add_house(&mut self, at: DVec3, sign: f64, street: Option<u32>, garden: u32, rng: &mut Rng) {
        let width = STREET / HOUSES as f64;
        let hall = width * rng.range(0.3, 0.4);
        let half = HOUSE * rng.range(0.4, 0.6);
        let at = |x: f64, y: f64, z: f64| at + DVec3::new(x, y, sign * z);
        let h = STOREY;
        let rooms: [u32; ROOMS] = [
            self.add(at(0.0, 0.0, 0.0), at(hall, h, HOUSE)),
            self.add(at(hall, 0.0, 0.0), at(width, h, half)),
            self.add(at(hall, 0.0, half), at(width, h, HOUSE)),
            self.add(at(0.0, h, 0.0), at(width, 2.0 * h, half)),
            self.add(at(0.0, h, half), at(width, 2.0 * h, HOUSE)),
        ];
        let [entry, front, back, above, behind] = rooms;
        let mut shift = || rng.range(0.2, 0.8);
        let mut across = |cells, x: f64, y: f64, z: f64, size: [f64; 2]| {
            let x = x + shift();
            self.open(cells, at(x, y, z), at(x + size[0], y + size[1], z));
        };
        let (door, window) = ([1.0, 2.1], [1.2, 1.3]);
        if let Some(street) = street {
            across([entry, street], 0.5, 0.0, 0.0, door);
            across([front, street], hall + 1.0, 0.9, 0.0, window);
            across([above, street], 1.0, h + 0.9, 0.0, window);
            across([above, street], 7.0, h + 0.9, 0.0, window);
        }
        // Beside the front door: no line passes house after house.
        across([entry, garden], 2.0, 0.0, HOUSE, door);
        across([back, garden], hall + 1.0, 0.9, HOUSE, window);
        across([behind, garden], 1.0, h + 0.9, HOUSE, window);
        across([behind, garden], 7.0, h + 0.9, HOUSE, window);
        across([above, behind], 4.0, h, half, door);
        let mut along = |room, z: f64| {
            let z = z + shift();
            self.open([entry, room], at(hall, 0.0, z), at(hall, 2.1, z + 0.9));
        };
        along(front, 1.0);
        along(back, half + 1.0);
        let z = half + 0.5 + shift();
        self.open([entry, behind], at(0.4, h, z), at(1.6, h, z + 2.0));
    }

    /// Follows a line from a point of a cell through openings, more than a micrometer inside their edges, until it
    /// meets a wall. Calls `enter` with each cell that it enters.
    pub fn follow(&self, cell: u32, from: DVec3, direction: DVec3, mut enter: impl FnMut(u32)) {
        let mut at = cell;
        let mut start = 0.0;
        // A line is in a convex cell from one time to another, and between houses in the one that is not.
        for _ in 0..=2 * self.cells.len() {
            let b = &self.cells[at as usize];
            let mut end = (f64::INFINITY, 0, 0.0);
            for k in (0..3).filter(|&k| direction[k] != 0.0) {
                let face = if direction[k] > 0.0 { b.max } else { b.min }[k];
                let t = (face - from[k]) / direction[k];
                if t < end.0 {
                    end = (t, k, face);
                }
            }
            if at == 0 {
                for house in &self.houses {
                    let hit = entry(house, from, direction).filter(|hit| hit.0 > start);
                    end = hit.filter(|hit| hit.0 < end.0).unwrap_or(end);
                }
            }
            let (t, axis, face) = end;
            let p = from + direction * t;
            let is_through = |hole: &&TownHole| {
                let others = [(axis + 1) % 3, (axis + 2) % 3];
                hole.axis == axis
                    && hole.area.min[axis] == face
                    && others.into_iter().all(|k| {
                        p[k] > hole.area.min[k] + MARGIN && p[k] < hole.area.max[k] - MARGIN
                    })
            };
            let Some(hole) = self.holes[at as usize].iter().find(is_through) else {
                return;
            };
            at = hole.to;
            start = t;
            enter(at);
        }
    }

    /// Returns `true` if a point of a cell's box is in the cell, and not in a house that stands in it.
    #[must_use]
    pub fn is_in(&self, cell: u32, p: DVec3) -> bool {
        cell != 0 || !self.houses.iter().any(|house| house.contains(p))
    }
}

/// Returns where a line enters a box: how far along, by which axis, and the coordinate of the face.
fn entry(b: &Aabb, from: DVec3, direction: DVec3) -> Option<(f64, usize, f64)> {
    let (mut first, mut last) = ((f64::NEG_INFINITY, 0, 0.0), f64::INFINITY);
    for k in 0..3 {
        if direction[k] == 0.0 {
            if from[k] < b.min[k] || from[k] > b.max[k] {
                return None;
            }
            continue;
        }
        let (near, far) = if direction[k] > 0.0 {
            (b.min[k], b.max[k])
        } else {
            (b.max[k], b.min[k])
        };
        let t = (near - from[k]) / direction[k];
        if t > first.0 {
            first = (t, k, near);
        }
        last = last.min((far - from[k]) / direction[k]);
    }
    (first.0 < last).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn openings_lie_in_faces_of_both_their_cells() {
        for town in [town(1000, 1), village(60, 1)] {
            faces_fit(&town);
        }
    }

    fn faces_fit(town: &Town) {
        assert!((300..1300).contains(&town.cells.len()));
        town.graph.validate().unwrap();
        for portal in &town.graph.portals {
            let [p, q, r] = [0, 1, 2].map(|i| portal.winding[i]);
            let room = town.cells[portal.cells[0] as usize].center();
            assert!((q - p).cross(r - p).dot(p - room) > 0.0, "{portal:?}");
        }
        for (cell, holes) in town.holes.iter().enumerate() {
            assert!(!holes.is_empty(), "{cell}");
            for hole in holes {
                let is_room = |c: &usize| *c > 0 || town.houses.is_empty();
                for c in [cell, hole.to as usize].into_iter().filter(is_room) {
                    let b = &town.cells[c];
                    let k = hole.axis;
                    assert!([b.min[k], b.max[k]].contains(&hole.area.min[k]), "{cell}");
                    for j in (0..3).filter(|&j| j != k) {
                        let is_in = b.min[j] <= hole.area.min[j] && hole.area.max[j] <= b.max[j];
                        assert!(is_in, "{cell} {c} {hole:?} {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_line_along_a_street_stops_at_the_second_gate() {
        let town = town(3000, 1);
        let street = 1;
        let from = DVec3::new(WIDTH + 1.0, 1.5, 2.0);
        let mut entered = Vec::new();
        town.follow(street, from, DVec3::X, |cell| entered.push(cell));
        assert!(entered.is_empty());
        let direction = DVec3::new(STREET - 1.0, 0.0, 4.0);
        town.follow(street, from, direction, |cell| entered.push(cell));
        // The crossing, and perhaps the next street.
        assert!((1..=2).contains(&entered.len()), "{entered:?}");
    }

    #[test]
    fn a_line_in_a_village_stops_at_the_first_house_and_leaves_by_its_windows() {
        let village = village(9, 1);
        let mut rng = Rng::new(2);
        let (mut n_entered, mut n_left) = (0, 0);
        for _ in 0..20_000 {
            let from = rng.point_in(&village.cells[0]);
            if !village.is_in(0, from) {
                continue;
            }
            let direction = rng.turn() * DVec3::X;
            let mut way = vec![0];
            village.follow(0, from, direction, |cell| way.push(cell));
            assert!(
                way.windows(2)
                    .all(|w| (w[0] == 0) != (w[1] == 0) || w[0] > 0 && w[1] > 0)
            );
            n_entered += usize::from(way.len() > 1);
            n_left += usize::from(way[1..].contains(&0));
        }
        assert!(
            n_entered > 100 && n_left > 0 && n_left < n_entered,
            "{n_entered} {n_left}"
        );
    }
}
