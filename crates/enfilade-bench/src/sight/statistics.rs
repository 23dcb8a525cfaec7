//! Accuracy of the statistics for modelers: triangles that count as visible from a cell, against those that rays reach.

use enfilade::cpg::{CellId, PartNumbers, VisibleParts, World};
use enfilade::geom::scene::Material;
use enfilade::geom::{DVec3, Triangle};
use enfilade::runtime::{Sight, SightState, Sightlines, Target};
use enfilade::vis::see_parts;
use enfilade_testkit::Rng;

use super::visible::visible_past_walls;
use crate::rows::Figure;

/// Rays from each cell.
const RAYS: usize = 100_000;

/// Rays from each cell to each triangle that counts as visible but that the rays above missed.
const AIMED: usize = 256;

/// Points tried in a cell's box for each ray.
const TRIES: usize = 1000;

/// Largest ratio of visible triangles to those that rays reach.
const BAR: f64 = 2.0;

/// Measures the mean over cells of the triangles that count as visible, divided by that of those that rays reach.
///
/// Rays in all directions miss small or distant triangles, so even the exact visible set is larger. The note contains
/// the number of triangles that rays aimed at each of them reach, a lower bound for every set that leaves nothing
/// out.
pub(super) fn measure(world: &World) -> anyhow::Result<Figure> {
    let pvs = visible_past_walls(world)?;
    let (_, parts) = see_parts(world, &pvs)?;
    let sums = Sums::new(world);
    let sight = Sight::build(world)?;
    let (mut seen, mut whole, mut reached, mut proven) = (0.0, 0.0, 0.0, 0.0);
    let mut pairs = pvs.pairs().enumerate().peekable();
    let n_cells = world.graph.cells.len();
    let lines = Sightlines::build(world);
    let state = SightState::new(&sight);
    for cell in (0..n_cells as u32).map(CellId) {
        let mut is_seen = vec![false; sums.numbers.n_parts() as usize];
        let mut is_in = is_seen.clone();
        while let Some((pair, (_, to))) = pairs.next_if(|p| p.1.0 == cell) {
            mark(&mut is_seen, &parts, pair);
            sums.mark_cell(&mut is_in, world, to);
        }
        let rays = Rays {
            world,
            sight: &sight,
            lines: &lines,
            state: &state,
        };
        let mut hits = rays.reached(cell, &sums);
        reached += hits.iter().filter(|&&h| h).count() as f64;
        rays.aim(cell, &sums, &is_seen, &mut hits);
        proven += hits.iter().filter(|&&h| h).count() as f64;
        let [a, b] = [sums.n_triangles(&is_seen), sums.n_triangles(&is_in)];
        seen += a as f64;
        whole += b as f64;
    }
    let n = n_cells.max(1) as f64;
    let n_all = sums.n_triangles(&vec![true; sums.numbers.n_parts() as usize]);
    let note = format!(
        "of {n_all} triangles a cell sees {:.0} on average, {:.0} by whole cells; rays reach {:.0}, rays aimed at each {:.0}",
        seen / n,
        whole / n,
        reached / n,
        proven / n
    );
    Ok(Figure::new(seen / f64::max(reached, 1.0), BAR, note))
}

fn mark(is_seen: &mut [bool], parts: &VisibleParts, pair: usize) {
    for &[a, b] in parts.runs_of(pair) {
        is_seen[a as usize..b as usize].fill(true);
    }
}

/// Triangle counts of parts.
struct Sums {
    numbers: PartNumbers,
    /// For each detail object, the number of triangles of those before it, and last that of all; each primitive's by
    /// object.
    first: Vec<usize>,
}

impl Sums {
    fn new(world: &World) -> Self {
        let numbers = PartNumbers::new(world);
        let mut first = vec![numbers.n_triangles() as usize];
        for object in &world.details {
            let mesh = &world.detail_meshes[object.mesh as usize];
            let n: usize = mesh.primitives.iter().map(|p| p.indices.len() / 3).sum();
            first.push(first[first.len() - 1] + n);
        }
        Self { numbers, first }
    }

    fn n_triangles(&self, parts: &[bool]) -> usize {
        let (walls, details) = parts.split_at(self.numbers.n_triangles() as usize);
        let objects = details.iter().zip(self.first.windows(2));
        let objects = objects.map(|(&is_in, w)| usize::from(is_in) * (w[1] - w[0]));
        walls.iter().filter(|&&w| w).count() + objects.sum::<usize>()
    }

    /// Returns all triangles in world space, each with its part and its index among the marks of hits.
    fn triangles(&self, world: &World) -> Vec<(usize, usize, Triangle)> {
        let mut all = Vec::new();
        for (i, batch) in world.batches.iter().enumerate() {
            let first = self.numbers.of_batch(i).start as usize;
            for (k, corners) in batch.primitive.triangles().enumerate() {
                all.push((first + k, first + k, corners));
            }
        }
        for (i, object) in world.details.iter().enumerate() {
            let part = self.numbers.of_detail(i as u32) as usize;
            let mesh = &world.detail_meshes[object.mesh as usize];
            let to_world = object.placement();
            let of_object = mesh
                .primitives
                .iter()
                .flat_map(|p| p.placed_triangles(to_world));
            for (k, corners) in of_object.enumerate() {
                all.push((part, self.first[i] + k, corners));
            }
        }
        all
    }

    /// Marks all parts in a cell.
    fn mark_cell(&self, is_in: &mut [bool], world: &World, cell: CellId) {
        for (i, batch) in world.batches.iter().enumerate() {
            if batch.cells.contains(&cell) {
                for part in self.numbers.of_batch(i) {
                    is_in[part as usize] = true;
                }
            }
        }
        for (i, detail) in (0..).zip(&world.details) {
            if detail.cells.contains(&cell) {
                is_in[self.numbers.of_detail(i) as usize] = true;
            }
        }
    }
}

struct Rays<'a> {
    world: &'a World,
    sight: &'a Sight,
    lines: &'a Sightlines,
    state: &'a SightState,
}

impl Rays<'_> {
    /// Returns the triangles, those behind glass included, that rays from random points of a cell in random
    /// directions reach.
    fn reached(&self, cell: CellId, sums: &Sums) -> Vec<bool> {
        let mut is_hit = vec![false; sums.first[sums.first.len() - 1]];
        let mut rng = Rng::new(u64::from(cell.0));
        let far = 1e4;
        for _ in 0..RAYS {
            let Some(eye) = self.point_in(cell, &mut rng) else {
                break;
            };
            let angle = rng.range(0.0, std::f64::consts::TAU);
            let height = rng.range(-1.0, 1.0);
            let level = (1.0 - height * height).sqrt();
            let way = [level * angle.cos(), height, level * angle.sin()];
            let end = [0, 1, 2].map(|k| eye[k] + (far * way[k]) as f32);
            self.shoot(eye, end, sums, &mut is_hit);
        }
        is_hit
    }

    /// Marks the visible triangles that rays aimed at random points of them reach.
    fn aim(&self, cell: CellId, sums: &Sums, is_seen: &[bool], is_hit: &mut [bool]) {
        let mut rng = Rng::new(!u64::from(cell.0));
        for (part, triangle, corners) in sums.triangles(self.world) {
            for _ in 0..AIMED {
                if !is_seen[part] || is_hit[triangle] {
                    break;
                }
                let Some(eye) = self.point_in(cell, &mut rng) else {
                    return;
                };
                let [mut u, mut v] = [rng.unit(), rng.unit()];
                if u + v > 1.0 {
                    [u, v] = [1.0 - u, 1.0 - v];
                }
                let [a, b, c] = corners;
                let on = a + (b - a) * u + (c - a) * v;
                let from = DVec3::from_array(eye.map(f64::from));
                let beyond = from + (on - from) * 1.01;
                self.shoot(eye, beyond.as_vec3().to_array(), sums, is_hit);
            }
        }
    }

    /// Returns a random point of a cell; `None` if none is found.
    fn point_in(&self, cell: CellId, rng: &mut Rng) -> Option<[f32; 3]> {
        let [low, high] = self.world.graph.cells[cell.idx()].aabb;
        let mut inside =
            (0..TRIES).map(|_| [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit() as f32));
        inside.find(|&p| self.sight.locate(p) == Some(cell))
    }

    fn shoot(&self, eye: [f32; 3], end: [f32; 3], sums: &Sums, is_hit: &mut [bool]) {
        for lets_through in [false, true] {
            let counts =
                |detail: enfilade::runtime::DetailId| !(lets_through && self.is_glass(detail.0));
            let Ok(Some(hit)) = self.lines.pick_where(self.state, eye, end, counts) else {
                return;
            };
            match hit.target {
                Target::Wall { batch, triangle } => {
                    let first = sums.numbers.of_batch(batch as usize).start;
                    is_hit[(first + triangle) as usize] = true;
                    return;
                }
                Target::Detail {
                    detail,
                    primitive,
                    triangle,
                } => {
                    let object = &self.world.details[detail.0 as usize];
                    let mesh = &self.world.detail_meshes[object.mesh as usize];
                    let before = mesh.primitives[..primitive as usize].iter();
                    let before: usize = before.map(|p| p.indices.len() / 3).sum();
                    is_hit[sums.first[detail.0 as usize] + before + triangle as usize] = true;
                    if !self.is_glass(detail.0) {
                        return;
                    }
                }
                Target::Portal(_) => return,
            }
        }
    }

    fn is_glass(&self, detail: u32) -> bool {
        let mesh = &self.world.detail_meshes[self.world.details[detail as usize].mesh as usize];
        let material =
            |p: &enfilade::geom::scene::Primitive| self.world.materials.get(p.material? as usize);
        let lets_through = |m: &Material| m.transparent;
        mesh.primitives
            .iter()
            .filter_map(material)
            .any(lets_through)
    }
}
