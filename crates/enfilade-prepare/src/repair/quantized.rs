//! Joins vertices of quantized meshes that coincided before they were rounded.
//!
//! Compression rounds each mesh to its own grid, so that walls which shared a vertex miss each other by up to half a
//! step of either grid. Only this step knows about grids; it runs before all others.

use std::collections::HashMap;

use enfilade_geom::scene::{Object, Scene};
use enfilade_geom::{DMat3, DVec3};

use super::surface::Surface;

/// Grid width that positions were rounded to, for each primitive of each quantized mesh; 0 if not rounded. [Units:
/// those of the mesh]
pub type GridSteps = HashMap<u32, Vec<f32>>;

/// Widest grid that counts as rounding: no tool rounds walls by the size of an opening. [Units: wu]
const WIDEST_STEP: f64 = 0.05;

/// Two vertices of one grid are a whole step apart, less the rounding of `f32`.
const ALMOST: f64 = 0.99;

/// Welds structural vertices of different primitives that are nearer, along each axis, than half a step of the one
/// plus half a step of the other. Returns the number of moved vertices.
///
/// The finer grid decides the position; vertices of one primitive never become one, as they differ on their grid.
/// Changed objects get a mesh of their own in world space. `n log n` for `n` vertices; does nothing without a
/// quantized mesh.
pub fn weld_quantized(scene: &mut Scene, steps: &GridSteps) -> u64 {
    if steps.is_empty() || !scene.solids.is_empty() {
        return 0;
    }
    let mut surface = Surface::of_scene(scene);
    let corners = Corners::new(&surface, scene, steps);
    let heads = corners.heads(&surface.points);
    let mut n_moved = 0;
    for (p, &head) in heads.iter().enumerate() {
        n_moved += u64::from(head != p as u32);
    }
    if n_moved == 0 {
        return 0;
    }
    for part in &mut surface.parts {
        for p in &mut part.points {
            let head = heads[*p as usize];
            surface.is_changed[part.object as usize] |= head != *p;
            *p = head;
        }
    }
    surface.into_scene(scene);
    n_moved
}

/// Grids and primitives of each point of a surface.
struct Corners {
    /// Half the step of the finest grid of each point, along each axis. [Units: wu]
    reach: Vec<DVec3>,
    /// The primitives with a vertex at each point.
    parts: Vec<Vec<u32>>,
    /// The longest reach.
    longest: f64,
}

impl Corners {
    fn new(surface: &Surface, scene: &Scene, steps: &GridSteps) -> Self {
        let mut corners = Self {
            reach: vec![DVec3::INFINITY; surface.points.len()],
            parts: vec![Vec::new(); surface.points.len()],
            longest: 0.0,
        };
        let (mut of, mut primitive) = (u32::MAX, 0);
        for (i, part) in surface.parts.iter().enumerate() {
            primitive = if part.object == of { primitive + 1 } else { 0 };
            of = part.object;
            let object = &scene.objects[of as usize];
            let step = steps.get(&object.mesh).and_then(|s| s.get(primitive));
            let reach = reach(object, step.copied().unwrap_or(0.0));
            corners.longest = corners.longest.max(reach.max_element());
            for &p in &part.points {
                let p = p as usize;
                corners.reach[p] = corners.reach[p].min(reach);
                if corners.parts[p].last() != Some(&(i as u32)) {
                    corners.parts[p].push(i as u32);
                }
            }
        }
        corners
    }

    /// Returns the point that each point becomes.
    ///
    /// Finest first, equal ones in numerical order, which is by place: each point goes to the nearest head that it
    /// may join, or becomes a head.
    fn heads(mut self, points: &[DVec3]) -> Vec<u32> {
        let mut into: Vec<u32> = (0..points.len() as u32).collect();
        if self.longest == 0.0 {
            return into;
        }
        let width = 4.0 * self.longest;
        let cell = |p: DVec3| (p / width).floor().to_array().map(|c| c as i64);
        let mut order = into.clone();
        order.sort_by(|&p, &q| {
            let size = |p: u32| self.reach[p as usize].max_element();
            size(p).total_cmp(&size(q)).then(p.cmp(&q))
        });
        let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for p in order {
            let at = points[p as usize];
            let around = DVec3::splat(2.0 * self.longest);
            let (low, high) = (cell(at - around), cell(at + around));
            let mut best: Option<(f64, u32)> = None;
            let [xs, ys, zs] = [0, 1, 2].map(|k| low[k]..=high[k]);
            let row = |x: i64, y: i64| zs.clone().map(move |z| [x, y, z]);
            let near = xs.flat_map(|x| ys.clone().flat_map(move |y| row(x, y)));
            for &head in near.filter_map(|cell| cells.get(&cell)).flatten() {
                let d = at.distance_squared(points[head as usize]);
                if best.is_none_or(|(least, of)| (d, head) < (least, of))
                    && self.may_be_one(points, head, p)
                {
                    best = Some((d, head));
                }
            }
            match best {
                Some((_, head)) => {
                    into[p as usize] = head;
                    let parts = std::mem::take(&mut self.parts[p as usize]);
                    self.parts[head as usize].extend(parts);
                }
                None => cells.entry(cell(at)).or_default().push(p),
            }
        }
        into
    }

    fn may_be_one(&self, points: &[DVec3], p: u32, q: u32) -> bool {
        let (p, q) = (p as usize, q as usize);
        let reach = (self.reach[p] + self.reach[q]) * ALMOST;
        let is_near = (points[p] - points[q]).abs().cmplt(reach).all();
        is_near
            && !self.parts[q]
                .iter()
                .any(|part| self.parts[p].contains(part))
    }
}

/// Returns half a step of a primitive's grid as placed; 0 for a grid too wide to be rounding. [Units: wu]
fn reach(object: &Object, step: f32) -> DVec3 {
    let DMat3 {
        x_axis,
        y_axis,
        z_axis,
    } = DMat3::from_mat4(object.transform);
    let step = (x_axis.abs() + y_axis.abs() + z_axis.abs()) * f64::from(step);
    if step.max_element() <= WIDEST_STEP {
        step * 0.5
    } else {
        DVec3::ZERO
    }
}
