//! Quantized meshes: corners that were one before they were rounded are one again.
//!
//! Compression rounds each mesh to a grid of its own, so that walls which met in a corner miss each other by up to half a step
//! of either grid. This is the one place that knows of it: it runs before anything else looks at the triangles.

use std::collections::HashMap;

use enfilade_geom::scene::{Object, Scene};
use enfilade_geom::{DMat3, DVec3};

use super::surface::Surface;

/// By mesh that has any, and by primitive: width of the grid that positions were rounded to, 0 if they were not.
/// [Units: those of the mesh]
pub(crate) type GridSteps = HashMap<u32, Vec<f32>>;

/// Wider grids are taken for meant: no tool rounds walls to what a bake takes for an opening. [Units: wu]
const WIDEST_STEP: f64 = 0.05;

/// Two corners of one grid are a whole step apart, less what `f32` loses.
const ALMOST: f64 = 0.99;

/// Welds structural corners of different primitives that are nearer, along each axis, than half a step of the one and half a
/// step of the other; how many moved.
///
/// Finer grids decide where a corner is, and corners of one primitive never become one: on their grid they differ. Objects
/// that change get a mesh of their own in world space. `n log n` for `n` corners; nothing is done where no mesh is quantized.
pub(crate) fn weld_quantized(scene: &mut Scene, steps: &GridSteps) -> u64 {
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

/// What is known of each point of a surface.
struct Corners {
    /// Half the step of the finest grid that it is on, along each axis. [Units: wu]
    reach: Vec<DVec3>,
    /// The primitives that it is a corner of.
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

    /// By point the one that it becomes.
    ///
    /// The finest first, equal ones by place, as the points are numbered: each goes to the nearest head that it may be one
    /// with, or becomes a head.
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
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        for &head in cells.get(&[x, y, z]).map_or(&[][..], Vec::as_slice) {
                            let d = at.distance_squared(points[head as usize]);
                            if best.is_none_or(|(least, of)| (d, head) < (least, of))
                                && self.may_be_one(points, head, p)
                            {
                                best = Some((d, head));
                            }
                        }
                    }
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

/// Half a step of a primitive's grid where it is placed; 0 where it is too wide to be one. [Units: wu]
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
