//! Refinement: adds points to surfaces until every ball between points is a ball of air.
//!
//! The circumsphere of a tetrahedron is empty of points, but surfaces may cross it where points are few; then the
//! tetrahedron carries no information on the air. The surface point nearest to the sphere's center is added, and so on
//! (Chew, "Guaranteed-quality mesh generation for curved surfaces", 1993; Boissonnat & Oudot, "Provably good sampling
//! and meshing of surfaces", 2005, for the resulting density: in proportion to the distance to the next surface). Large
//! walls of large halls get few points, the jambs of a door many, whatever the scale of the scene.
//!
//! Wide places come first: each pass continues to narrower balls of air, and the last one also refines narrow gaps,
//! such as those between the two faces of a wall. If points run out, wide places are still correct.
//!
//! **Termination:** a new point is at least a tenth of a radius away from all others, and radii have a lower bound.

use std::collections::HashMap;

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3};
use rayon::prelude::*;

use super::balls::{ENTERS, circle, circumsphere};
use super::insert::Growing;
use super::limits::Limits;
use super::tetrahedra::{Delaunay, INFINITE};
use crate::error::DelaunayError;

/// Least distance between points added in one round, as a share of the ball's radius.
const APART: f64 = 0.4;
/// Most rounds of a pass, more than any scene took. After that, points count as having run out.
const MAX_ROUNDS: usize = 100;
/// Cost of examining a tetrahedron, in units of [`enfilade_geom::Allowance`].
const WORK_A_LOOK: u64 = 5;

/// Tetrahedra whose balls are balls of air.
pub(super) struct Refined {
    pub(super) delaunay: Delaunay,
    /// Radius down to which that holds; above the requested one if points ran out. [Units: wu]
    pub(super) down_to: f64,
}

/// A point to add, and the radius of the ball that the surface enters there.
#[derive(Clone, Copy)]
struct Wanted {
    point: DVec3,
    radius: f64,
}

/// Adds points of `surfaces` to `points` until no ball wider than `least` has a surface in it.
///
/// `O(n log n)` in the resulting points, whose number the limits bound.
pub(super) fn refined(
    points: &[DVec3],
    surfaces: &Bvh,
    bounds: &Aabb,
    least: f64,
    limits: &Limits<'_>,
) -> Result<Refined, DelaunayError> {
    let mut growing = Growing::begin(points, limits.allowance)?;
    let mut down_to = bounds.size().max_element();
    // Least radius of a ball that gets points, and least distance of its center from surfaces.
    let passes = [8.0, 4.0, 2.0, 1.0].map(|k| (k * least, k * least));
    for pass in passes.into_iter().chain([(least, 0.0)]) {
        let mut fresh = growing.all();
        for n_rounds in 0.. {
            let wanted: Vec<Wanted> = fresh
                .par_iter()
                .filter(limits.allowance.each(WORK_A_LOOK))
                .flat_map_iter(|&t| {
                    wanted_by(&growing, t, surfaces, bounds, pass, limits.allowance)
                })
                .collect();
            let round = thinned(wanted);
            if round.is_empty() {
                break;
            }
            let is_full = growing.vertices().len() + round.len() > limits.n_points;
            let may_go_on = limits.allowance.spend(1);
            if is_full || n_rounds == MAX_ROUNDS || !may_go_on {
                return Ok(Refined {
                    delaunay: growing.finished(),
                    down_to,
                });
            }
            let points: Vec<DVec3> = round.iter().map(|w| w.point).collect();
            growing.add(&points, limits.allowance)?;
            fresh = growing.fresh();
        }
        down_to = pass.0;
    }
    Ok(Refined {
        delaunay: growing.finished(),
        down_to,
    })
}

/// Returns points to add where surfaces enter the ball of a tetrahedron or those of its facets.
fn wanted_by(
    growing: &Growing,
    t: u32,
    surfaces: &Bvh,
    bounds: &Aabb,
    (least, air): (f64, f64),
    allowance: &Allowance,
) -> impl Iterator<Item = Wanted> + use<> {
    let vertices = growing.vertices();
    let corners = |t: u32| {
        let tet = growing.tetrahedron(t);
        tet.vertices.map(|v| vertices[v as usize])
    };
    let mut n_looked = 0;
    let mut entered = |center: DVec3, radius: f64| -> Option<Wanted> {
        if radius <= least || !bounds.contains(center) {
            return None;
        }
        let near = surfaces.nearest_counted(center, radius * (1.0 - ENTERS), &mut n_looked)?;
        (near.distance > air).then_some(Wanted {
            point: near.point,
            radius,
        })
    };
    let c = corners(t);
    let (center, radius, _) = circumsphere(c);
    let mut out: [Option<Wanted>; 5] = [None; 5];
    if !radius.is_finite() {
        return out.into_iter().flatten();
    }
    out[4] = entered(center, radius);
    if out[4].is_none() {
        // The passage through a facet is as wide as the facet's own ball if the facet is a bottleneck: if it lies
        // between the centers of the balls on both sides.
        let tet = growing.tetrahedron(t);
        for (i, out) in out.iter_mut().take(4).enumerate() {
            let other = tet.neighbor(i);
            if growing.tetrahedron(other).vertices.contains(&INFINITE) {
                continue;
            }
            let f = tet.facet(i).map(|v| vertices[v as usize]);
            let Some((middle, radius)) = circle(f) else {
                continue;
            };
            if radius <= least {
                continue;
            }
            let d = corners(other);
            let (beyond, r, _) = circumsphere(d);
            let side = |p: DVec3| enfilade_geom::triangle_area_normal(&f).dot(p - f[2]);
            if !r.is_finite() || side(center) * side(beyond) > 0.0 {
                continue;
            }
            let Some(wanted) = entered(middle, radius) else {
                continue;
            };
            // A facet in a wall gets no points: nothing passes it.
            let mean = |c: [DVec3; 4]| c.iter().sum::<DVec3>() / 4.0;
            if wanted.point.distance(middle) > 1e-6 * radius
                && !surfaces.any_hit(mean(c), middle, |_| false)
                && !surfaces.any_hit(mean(d), middle, |_| false)
            {
                *out = Some(wanted);
            }
        }
    }
    allowance.spend(n_looked / 4);
    out.into_iter().flatten()
}

/// Returns those points to add that are not near to each other, preferring those of the largest balls.
fn thinned(mut wanted: Vec<Wanted>) -> Vec<Wanted> {
    wanted.sort_unstable_by(|a, b| {
        let (p, q) = (a.point.to_array(), b.point.to_array());
        let order = |k: usize| p[k].total_cmp(&q[k]);
        b.radius
            .total_cmp(&a.radius)
            .then_with(|| order(0))
            .then_with(|| order(1))
            .then_with(|| order(2))
    });
    // A grid for each octave of radii, with cells of about the distance to be kept.
    let mut taken: HashMap<(i32, [i64; 3]), Vec<DVec3>> = HashMap::new();
    let mut octaves: Vec<i32> = Vec::new();
    let size = |octave: i32| APART * 2.0_f64.powi(octave);
    let cell = |p: DVec3, octave: i32| (p / size(octave)).floor().to_array().map(|x| x as i64);
    let mut out = Vec::new();
    for w in wanted {
        // Larger balls came first, and their grid cells are at least as large as this ball's distance.
        let is_near = octaves.iter().any(|&octave| {
            let [x, y, z] = cell(w.point, octave);
            (0..27).any(|i| {
                let at = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
                taken
                    .get(&(octave, at))
                    .is_some_and(|list| list.iter().any(|q| q.distance(w.point) < APART * w.radius))
            })
        });
        if is_near {
            continue;
        }
        let octave = w.radius.log2().ceil() as i32;
        if !octaves.contains(&octave) {
            octaves.push(octave);
        }
        taken
            .entry((octave, cell(w.point, octave)))
            .or_default()
            .push(w.point);
        out.push(w);
    }
    out
}
