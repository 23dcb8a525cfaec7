//! Areas of what sound meets in a room, by lines that cross the room.
//!
//! Lines of all directions cross a surface as often as it is large, whatever its shape (Crofton's formula; Santaló, "Integral
//! Geometry and Geometric Probability", §II.13.6): with a line for each area `a` of the plane across its direction, `n` crossings
//! are an area of `2 a n`, the mean over the directions. Crossings count where the air of the room begins or ends; so what lies inside
//! of walls does not, and of surfaces one upon another one does. Of an object a line meets the first and the last surface alone.
//! The same lines measure the volume, which is known: what they are off by there, areas are, too, and it is taken out. The rest of
//! the error is about 1 % for a room of any size. O(lines · log triangles) for each cell.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{Bvh, DVec3, Ray, Triangle};

use crate::layout::Layout;
use crate::space::{PartId, Space};

const N_DIRECTIONS: u32 = 48;
/// Lines along a side of the grid across each direction.
const N_SIDE: u32 = 8;
/// Surfaces closer than this along a line are one. [Units: wu]
const THIN: f64 = 1e-4;

/// A triangle's material, and the object that it is part of.
#[derive(Clone, Copy)]
struct SurfaceOf {
    material: Option<u32>,
    object: Option<u32>,
}

/// A thing that a line meets.
#[derive(Clone, Copy)]
enum LineCrossing {
    Surface(u32),
    Portal,
}

/// A piece of surface that a room is in front of.
pub(super) struct Piece {
    pub(super) material: Option<u32>,
    /// Part of an object, not of a wall.
    pub(super) is_object: bool,
    /// [Units: wu²]
    pub(super) area: f64,
}

/// The surfaces of a part.
pub(super) struct Surfaces<'s> {
    layout: &'s Layout,
    bvh: Bvh,
    surfaces: Vec<SurfaceOf>,
}

impl<'s> Surfaces<'s> {
    /// Gathers walls and objects. Leaves and panes are left out: they stand in openings.
    pub(super) fn new(space: &'s Space, part: PartId) -> Self {
        let world = space.world(part);
        let (mut triangles, mut surfaces) = (Vec::<Triangle>::new(), Vec::new());
        let mut add = |new: &mut dyn Iterator<Item = Triangle>, surface| {
            triangles.extend(new);
            surfaces.resize(triangles.len(), surface);
        };
        for batch in world.batches.iter().filter(|b| !b.cells.is_empty()) {
            let material = batch.primitive.material;
            let object = None;
            add(
                &mut batch.primitive.triangles(),
                SurfaceOf { material, object },
            );
        }
        let fittings = world.graph.portals.iter().flat_map(|p| &p.fittings);
        let fittings: BTreeSet<u32> = fittings.map(|f| f.detail).collect();
        for (id, detail) in (0..).zip(&world.details) {
            for primitive in &world.detail_meshes[detail.mesh as usize].primitives {
                let (material, object) = (primitive.material, Some(id));
                if !fittings.contains(&id) {
                    add(
                        &mut primitive.placed_triangles(detail.placement()),
                        SurfaceOf { material, object },
                    );
                }
            }
        }
        Self {
            layout: space.layout(part),
            bvh: Bvh::build(&triangles),
            surfaces,
        }
    }

    /// Returns the openings of a cell as triangles.
    fn openings(&self, cell: CellId) -> Vec<Triangle> {
        let portals: BTreeSet<PortalId> =
            self.layout.exits(cell).iter().map(|e| e.portal).collect();
        let pieces = portals
            .iter()
            .flat_map(|p| self.layout.opening(*p).pieces());
        pieces
            .flat_map(|piece| (2..piece.len()).map(move |i| [piece[0], piece[i - 1], piece[i]]))
            .collect()
    }

    /// Calls `add` with what a cell is in front of, by material.
    pub(super) fn each_piece(&self, cell: CellId, mut add: impl FnMut(Piece)) {
        let (mut areas, mut volume) = (BTreeMap::<(Option<u32>, bool), f64>::new(), 0.0);
        let bounds = self.layout.cell(cell).bounds;
        let (center, corners) = (bounds.center(), bounds.corners());
        let openings = Bvh::build(&self.openings(cell));
        let mut line = CellLine::default();
        for k in 0..N_DIRECTIONS {
            let direction = spread(k);
            let (u, v) = direction.any_orthonormal_pair();
            let reach = |axis: DVec3| {
                let along = corners.iter().map(|c| (*c - center).dot(axis).abs());
                along.fold(0.0, f64::max)
            };
            let [du, dv, deep] = [u, v, direction].map(reach);
            let area = 8.0 * du * dv / f64::from(N_SIDE * N_SIDE * N_DIRECTIONS);
            // Off the middle by another share for each direction.
            let place = |i: u32, shift: f64| (f64::from(i) + shift) / f64::from(N_SIDE) * 2.0 - 1.0;
            for i in 0..N_SIDE * N_SIDE {
                let [a, b] = [
                    place(i % N_SIDE, shift(k, 0)),
                    place(i / N_SIDE, shift(k, 1)),
                ];
                let middle = center + u * (a * du) + v * (b * dv);
                let ray = Ray::segment(middle - direction * deep, middle + direction * deep);
                line.cross(self, &openings, cell, &ray);
                volume += 0.5 * area * line.inside(ray.direction.length());
                line.each_piece(self, |material, is_object, n_sides| {
                    *areas.entry((material, is_object)).or_default() += area * f64::from(n_sides);
                });
            }
        }
        let whole = self.layout.cell(cell).volume;
        let scale = if volume > 0.0 { whole / volume } else { 1.0 };
        for ((material, is_object), area) in areas {
            add(Piece {
                material,
                is_object,
                area: area * scale,
            });
        }
    }
}

/// Returns one of the directions, which are spread evenly over half a sphere (Fibonacci's lattice), and alike to all axes.
fn spread(k: u32) -> DVec3 {
    let y = (f64::from(k / 3) + 0.5) / f64::from(N_DIRECTIONS / 3);
    let (sin, cos) = (f64::from(k / 3) * 2.399_963_229_728_653).sin_cos();
    let flat = (1.0 - y * y).sqrt();
    let direction = [flat * cos, y, flat * sin];
    DVec3::from_array([0, 1, 2].map(|i| direction[(i + k as usize) % 3]))
}

/// Returns a number between 0 and 1, another for each direction and axis.
fn shift(k: u32, axis: u32) -> f64 {
    (f64::from(k + 1) * [0.754_877_666_246_693, 0.569_840_290_998_053][axis as usize]).fract()
}

/// A line across a cell.
#[derive(Default)]
struct CellLine {
    /// Where it meets something, in order.
    crossings: Vec<(f64, LineCrossing)>,
    /// Before each, and after the last: `true` where the line is in the cell.
    is_inside: Vec<bool>,
    met: BTreeSet<u32>,
}

impl CellLine {
    fn cross(&mut self, surfaces: &Surfaces<'_>, openings: &Bvh, cell: CellId, ray: &Ray) {
        let crossings = &mut self.crossings;
        crossings.clear();
        (surfaces.bvh).for_each_hit(ray, |hit| {
            crossings.push((hit.t, LineCrossing::Surface(hit.triangle)));
        });
        self.is_inside.clear();
        if crossings.is_empty() {
            return;
        }
        let layout = surfaces.layout;
        openings.for_each_hit(ray, |hit| crossings.push((hit.t, LineCrossing::Portal)));
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ends = crossings.iter().map(|c| c.0);
        let before = std::iter::once(0.0).chain(ends.clone());
        let middles = before.zip(ends.chain([1.0])).map(|(a, b)| 0.5 * (a + b));
        self.is_inside
            .extend(middles.map(|t| layout.locate(ray.at(t)) == Some(cell)));
        self.join(THIN / ray.direction.length());
    }

    /// Makes crossings that lie one upon another two at most: the first and the last.
    fn join(&mut self, thin: f64) {
        let (crossings, is_inside) = (&mut self.crossings, &mut self.is_inside);
        for i in 1..crossings.len() {
            if crossings[i].0 - crossings[i - 1].0 < thin {
                // No air in between.
                is_inside[i] = false;
            }
        }
    }

    /// Returns the length of a line inside of the cell. [Units: wu]
    fn inside(&self, length: f64) -> f64 {
        let ends = self.crossings.iter().map(|c| c.0);
        let before = std::iter::once(0.0).chain(ends.clone());
        let parts = before.zip(ends.chain([1.0])).zip(&self.is_inside);
        parts
            .filter(|p| *p.1)
            .map(|((a, b), _)| (b - a) * length)
            .sum()
    }

    /// Calls `add` with the material of each surface in front of which the cell is, with whether it is an object's, and with the
    /// number of its sides.
    fn each_piece(&mut self, surfaces: &Surfaces<'_>, mut add: impl FnMut(Option<u32>, bool, u8)) {
        self.met.clear();
        for (k, (_, crossing)) in self.crossings.iter().enumerate() {
            let LineCrossing::Surface(i) = *crossing else {
                continue;
            };
            let n_sides = u8::from(self.is_inside[k]) + u8::from(self.is_inside[k + 1]);
            let SurfaceOf { material, object } = surfaces.surfaces[i as usize];
            match object {
                None if n_sides > 0 => add(material, false, n_sides),
                // Its first surface, and its last.
                Some(object) if n_sides > 0 && self.met.insert(object) => add(material, true, 2),
                _ => {}
            }
        }
    }
}
