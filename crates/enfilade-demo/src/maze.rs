//! The maze of Dirkse, "Portal processing in 3D-environments: visibility determination and other
//! applications" (master's thesis, 2002), section 8.2, rebuilt from its counts.
//!
//! The text gives 583 cells, 29,988 wall triangles and 2,735 dots of 20 triangles each, 1 dot in the
//! smallest cells and up to 12 in the largest. So cells differ in size as dots do: ours are rectangles of 1
//! to 12 squares with a dot in the middle of every square, which fill a plan of 50 × 55 squares except for
//! a block of 3 × 5. Sizes in meters and the layout are ours.

use enfilade_geom::scene::Role;
use enfilade_geom::{Aabb, DMat4, DVec3};

use crate::interior::Interior;
use crate::rng::Rng;
use crate::site::{Generated, Site};
use crate::solid::{MeshBuilder, aabb};
use crate::truth::{OpeningKind, Side};

const N_CELLS: usize = 583;
const N_WALL_TRIANGLES: usize = 29_988;
/// Squares along x and z, and the block without cells: `[[x0, z0], [x1, z1]]`.
const PLAN: [usize; 2] = [50, 55];
const BLOCK: [[usize; 2]; 2] = [[23, 25], [26, 30]];
const LARGEST: usize = 12;
/// Side of a square, thickness of walls, height of cells. [Units: wu]
const SQUARE: f64 = 2.0;
const WALL: f64 = 0.3;
const CEILING: f64 = 2.2;
/// Width and height of passages. [Units: wu]
const PASSAGE: [f64; 2] = [1.0, 1.6];

/// A rectangle of squares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Plot {
    low: [usize; 2],
    high: [usize; 2],
}

impl Plot {
    fn size(&self, axis: usize) -> usize {
        self.high[axis] - self.low[axis]
    }

    fn area(&self) -> usize {
        self.size(0) * self.size(1)
    }

    fn split(self, rng: &mut Rng) -> [Self; 2] {
        let longer = usize::from(self.size(1) > self.size(0));
        // Mostly across the longer side; the exceptions give corridors.
        let axis = if self.size(1 - longer) > 1 && rng.chance(0.2) {
            1 - longer
        } else {
            longer
        };
        let n = self.size(axis);
        // Away from the ends if there is room.
        let margin = if n > 5 { n / 4 } else { 0 };
        let at = self.low[axis] + 1 + margin + rng.below(n - 1 - 2 * margin);
        let (mut a, mut b) = (self, self);
        a.high[axis] = at;
        b.low[axis] = at;
        [a, b]
    }

    /// Returns the position of the wall across `axis`, on the plot's side of it. [Units: wu]
    fn face(&self, axis: usize, high: bool) -> f64 {
        let at = if high {
            self.high[axis]
        } else {
            self.low[axis]
        } as f64
            * SQUARE;
        if high {
            at - WALL * 0.5
        } else {
            at + WALL * 0.5
        }
    }

    /// Returns the extent from its lower to its upper wall. [Units: wu]
    fn faces(&self, axis: usize) -> [f64; 2] {
        [false, true].map(|high| self.face(axis, high))
    }
}

/// A passage from plot `from`, through its wall towards greater x or z, to plot `to`; `square` along
/// the wall.
#[derive(Clone, Copy, Debug)]
struct Passage {
    from: usize,
    to: usize,
    axis: usize,
    square: usize,
}

fn plots(rng: &mut Rng) -> Vec<Plot> {
    let [[bx0, bz0], [bx1, bz1]] = BLOCK;
    let mut open = vec![
        Plot {
            low: [0, 0],
            high: [bx0, PLAN[1]],
        },
        Plot {
            low: [bx1, 0],
            high: PLAN,
        },
        Plot {
            low: [bx0, 0],
            high: [bx1, bz0],
        },
        Plot {
            low: [bx0, bz1],
            high: [bx1, PLAN[1]],
        },
    ];
    let mut done: Vec<Plot> = Vec::new();
    while let Some(plot) = open.pop() {
        if plot.area() > LARGEST {
            open.extend(plot.split(rng));
        } else {
            done.push(plot);
        }
    }
    // Far fewer than 583 so far; split at random, sparing some of the largest.
    while done.len() < N_CELLS {
        let i = rng.below(done.len());
        if done[i].area() > 1 && (done[i].area() < LARGEST || rng.chance(0.5)) {
            let [a, b] = done[i].split(rng);
            done[i] = a;
            done.push(b);
        }
    }
    done
}

fn passages(plots: &[Plot], rng: &mut Rng) -> Vec<Passage> {
    let mut at = vec![None; PLAN[0] * PLAN[1]];
    for (i, p) in plots.iter().enumerate() {
        for z in p.low[1]..p.high[1] {
            at[z * PLAN[0] + p.low[0]..z * PLAN[0] + p.high[0]].fill(Some(i));
        }
    }
    let mut candidates = Vec::new();
    for i in 0..PLAN[0] * PLAN[1] {
        let (x, z) = (i % PLAN[0], i / PLAN[0]);
        for (axis, next) in [(0, [x + 1, z]), (1, [x, z + 1])] {
            if next[0] == PLAN[0] || next[1] == PLAN[1] {
                continue;
            }
            let pair = (at[i], at[next[1] * PLAN[0] + next[0]]);
            if let (Some(from), Some(to)) = pair
                && from != to
            {
                candidates.push(Passage {
                    from,
                    to,
                    axis,
                    square: [z, x][axis],
                });
            }
        }
    }
    rng.shuffle(&mut candidates);
    let mut group: Vec<usize> = (0..plots.len()).collect();
    let mut joined = std::collections::BTreeSet::new();
    candidates.retain(|p| {
        let (a, b) = (group[p.from], group[p.to]);
        // A spanning tree, and one more passage in twelve, for cycles.
        let wanted = (a != b || rng.chance(1.0 / 12.0)) && joined.insert((p.from, p.to));
        if wanted {
            group.iter_mut().filter(|g| **g == a).for_each(|g| *g = b);
        }
        wanted
    });
    candidates.sort_by_key(|p| (p.from, p.to));
    candidates
}

/// The maze of Dirkse 2002, section 8.2: 583 cells, 29,988 wall triangles, 2,735 dots.
///
/// Walls are one closed surface that faces the cells, without T-junctions; another object, `shell` of 12
/// triangles, makes a solid of it that stands in the open. Dots are detail.
#[must_use]
pub fn dirkse_maze(seed: u64) -> Generated {
    let mut rng = Rng::new(seed);
    let plots = plots(&mut rng);
    let passages = passages(&plots, &mut rng);
    let mut site = Site::new("dirkse-maze");
    let storey = site.storey("maze", 0.0);
    let sides: Vec<Side> = plots
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let [x, z] = [0, 1].map(|axis| p.faces(axis));
            let air = aabb([x[0], 0.0, z[0]], [x[1], CEILING, z[1]]);
            site.room(&format!("cell {i}"), storey, air)
        })
        .collect();

    let mut mesh = Interior::default();
    let mut ends: Vec<Ends> = vec![Ends::default(); plots.len()];
    for p in &passages {
        let tunnel = WallPassage::new(p, &plots);
        let axis = if p.axis == 0 { 0 } else { 2 };
        let rooms = [sides[p.from], sides[p.to]];
        site.opening(OpeningKind::Opening, tunnel.hole(), axis, rooms);
        let (walls, made) = tunnel.add_to(&mut mesh);
        ends[p.from][walls[0]].push((tunnel.middle, made[0]));
        ends[p.to][walls[1]].push((tunnel.middle, made[1]));
    }
    for (plot, ends) in plots.iter().zip(&mut ends) {
        add_cell(&mut mesh, plot, ends);
    }
    mesh.bisect_to(N_WALL_TRIANGLES);
    place(&mut site, mesh, &plots);
    site.finish()
}

/// End of a passage in a wall: position along it; lower and upper vertices, in the wall's direction.
type PassageEnd = (f64, [u32; 4]);

/// Per wall of a plot.
type Ends = [Vec<PassageEnd>; 4];

/// A passage through the wall between two plots.
struct WallPassage {
    axis: usize,
    /// Start and end across the wall. [Units: wu]
    across: [f64; 2],
    /// Its middle and its sides along the wall. [Units: wu]
    middle: f64,
    along: [f64; 2],
}

impl WallPassage {
    fn new(p: &Passage, plots: &[Plot]) -> Self {
        let middle = (p.square as f64 + 0.5) * SQUARE;
        Self {
            axis: p.axis,
            across: [
                plots[p.from].face(p.axis, true),
                plots[p.to].face(p.axis, false),
            ],
            middle,
            along: [middle - PASSAGE[0] * 0.5, middle + PASSAGE[0] * 0.5],
        }
    }

    fn point(&self, across: f64, along: f64, y: f64) -> DVec3 {
        if self.axis == 0 {
            DVec3::new(across, y, along)
        } else {
            DVec3::new(along, y, across)
        }
    }

    fn hole(&self) -> Aabb {
        let ends = [
            self.point(self.across[0], self.along[0], 0.0),
            self.point(self.across[1], self.along[1], PASSAGE[1]),
        ];
        Aabb::new(ends[0].min(ends[1]), ends[0].max(ends[1]))
    }

    /// Adds its four faces; returns the wall of either plot in which it ends, and the vertices there.
    fn add_to(&self, mesh: &mut Interior) -> ([usize; 2], [[u32; 4]; 2]) {
        let [low, high] = self.along;
        let mut end = |across: f64| {
            [
                (low, 0.0),
                (high, 0.0),
                (low, PASSAGE[1]),
                (high, PASSAGE[1]),
            ]
            .map(|(along, y)| mesh.corner(self.point(across, along, y)))
        };
        let (a, b) = (end(self.across[0]), end(self.across[1]));
        // Walls run as the vertices of a plan do, (x0, z0), (x1, z0), (x1, z1), (x0, z1): along z
        // in the wall at greater x, against x in the wall at greater z.
        let flip = |e: [u32; 4]| [e[1], e[0], e[3], e[2]];
        let (p, q, walls) = if self.axis == 0 {
            (a, flip(b), [1, 3])
        } else {
            (flip(a), b, [2, 0])
        };
        mesh.quad([p[0], p[1], q[0], q[1]]);
        mesh.quad([p[2], q[3], q[2], p[3]]);
        mesh.quad([p[0], q[1], q[3], p[2]]);
        mesh.quad([p[1], p[3], q[2], q[0]]);
        (walls, [p, q])
    }
}

/// Adds walls, floor and ceiling of a cell around the ends of its passages.
fn add_cell(mesh: &mut Interior, plot: &Plot, ends: &mut Ends) {
    let [x, z] = [0, 1].map(|axis| plot.faces(axis));
    let plan = [[x[0], z[0]], [x[1], z[0]], [x[1], z[1]], [x[0], z[1]]];
    let low = plan.map(|[x, z]| mesh.corner(DVec3::new(x, 0.0, z)));
    let high = plan.map(|[x, z]| mesh.corner(DVec3::new(x, CEILING, z)));
    let mut floor = Vec::new();
    for j in 0..4 {
        let k = (j + 1) % 4;
        let sign = if j < 2 { 1.0 } else { -1.0 };
        ends[j].sort_by(|a, b| (a.0 * sign).total_cmp(&(b.0 * sign)));
        floor.push(low[j]);
        let mut wall = vec![low[j]];
        for (_, [f0, f1, h0, h1]) in &ends[j] {
            floor.extend([*f0, *f1]);
            wall.extend([*f0, *h0, *h1, *f1]);
        }
        wall.extend([low[k], high[k], high[j]]);
        mesh.polygon(&wall);
    }
    floor.reverse();
    mesh.polygon(&floor);
    mesh.quad(high);
}

/// Places the walls, the shell around them and the dots.
fn place(site: &mut Site, mesh: Interior, plots: &[Plot]) {
    let stone = site.material("maze wall", [0.10, 0.12, 0.55]);
    let gold = site.material("dot", [0.95, 0.75, 0.25]);
    let walls = site.add_mesh(mesh.into_mesh("maze walls", stone, true));
    site.place("maze walls", walls, DMat4::IDENTITY, Role::Structural);
    let mut shell = MeshBuilder::new(stone);
    let end = PLAN.map(|n| n as f64 * SQUARE + WALL * 0.5);
    shell.cuboid(aabb(
        [-WALL * 0.5, -WALL, -WALL * 0.5],
        [end[0], CEILING + WALL, end[1]],
    ));
    site.structure("shell", shell);
    let mut dot = MeshBuilder::new(gold);
    dot.icosahedron(DVec3::ZERO, DVec3::splat(0.12));
    let dot = site.mesh("dot prop", dot);
    for p in plots {
        for z in p.low[1]..p.high[1] {
            for x in p.low[0]..p.high[0] {
                let at = DVec3::new((x as f64 + 0.5) * SQUARE, 0.8, (z as f64 + 0.5) * SQUARE);
                site.furnish("dot prop", dot, at, 0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::oracle::{n_open_edges, object_triangles, signed_volume};

    #[test]
    fn the_maze_has_the_counts_of_the_thesis() {
        for seed in 0..3 {
            let g = dirkse_maze(seed);
            assert_eq!(g.truth.rooms.len(), 583);
            assert_eq!(g.n_triangles(Role::Detail), 2735 * 20);
            let walls = object_triangles(&g.scene, 0);
            assert_eq!(walls.len(), 29_988);
            assert_eq!(n_open_edges(&walls), 0);
            // Volume of the air: cells and passages, vertices rounded to f32.
            let rooms: f64 = g.truth.rooms.iter().map(|r| r.volume).sum();
            let holes: f64 = g
                .truth
                .openings
                .iter()
                .map(|o| o.area() * o.thickness)
                .sum();
            assert!((signed_volume(&walls) + rooms + holes).abs() < 0.05);
        }
    }

    #[test]
    fn cells_hold_one_to_twelve_dots() {
        let sizes: Vec<usize> = plots(&mut Rng::new(4)).iter().map(Plot::area).collect();
        assert_eq!(sizes.iter().sum::<usize>(), 2735);
        assert_eq!(sizes.iter().min(), Some(&1));
        assert_eq!(sizes.iter().max(), Some(&12));
    }

    #[test]
    fn every_cell_can_be_reached_and_there_are_ways_around() {
        let mut rng = Rng::new(4);
        let plots = plots(&mut rng);
        let passages = passages(&plots, &mut rng);
        assert!(
            passages.len() > N_CELLS - 1 + 50,
            "{} passages",
            passages.len()
        );
        let mut reached = vec![false; N_CELLS];
        let mut stack = vec![0];
        while let Some(cell) = stack.pop() {
            if !std::mem::replace(&mut reached[cell], true) {
                let next = passages.iter().filter_map(|p| match cell {
                    c if c == p.from => Some(p.to),
                    c if c == p.to => Some(p.from),
                    _ => None,
                });
                stack.extend(next);
            }
        }
        assert!(reached.iter().all(|r| *r));
    }
}
