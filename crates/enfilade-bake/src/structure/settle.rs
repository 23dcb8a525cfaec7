//! Puts vertices that drifted apart back together, and back into the planes of their surfaces.
//!
//! Exporters, scanners and quantization move each vertex by itself: no two triangles of a wall share an edge or a plane
//! any more. Cut as they are, such models have a plane for each triangle, a sliver between each two, and portals along
//! the slivers. None of that carries meaning, since everything is smaller than the error of the model.
//!
//! 1. *Weld*: vertices closer than the error become one, at their mean.
//! 2. *Sheets*: from the largest triangle on, neighbors that lie in its plane within the error join it; the plane is
//!    fitted again whenever the sheet has doubled. Sheets in one plane, wherever they are, share it (`sheets`).
//! 3. *Settle*: each vertex moves to the nearest point that lies in the planes of all sheets it touches, those of the
//!    largest first, but never farther than the error.
//!
//! Where gaps are to stay open, vertices are not joined, and each triangle moves into the plane of its own sheet alone.
//!
//! All later stages and the file have the moved vertices, so promises stay exact. Independent of the order of triangles.
//! Time: `O(n log n)` for triangles spread out in space.

use enfilade_geom::{Aabb, Allowance, Bvh, DVec3, Plane, Triangle, closest_point_on_triangle};
use rayon::prelude::*;

use super::sheets::Sheets;
use super::weld::PointMesh;
use crate::budget::WORK_A_LOOK;

/// Moves the vertices of triangles that miss each other by up to `reach`, each by about half of that, at most twice.
/// [Units: wu]
///
/// Vertices are rounded to `f32`, as those of all scenes. Unless `closes_gaps`, each triangle only moves into the plane
/// of its own sheet, and the slits between triangles stay.
pub(crate) fn settle(
    triangles: &mut [Triangle],
    reach: f64,
    closes_gaps: bool,
    allowance: &Allowance,
) {
    if !allowance.spend(WORK_A_LOOK * 3 * triangles.len() as u64) {
        return;
    }
    let mesh = PointMesh::of(triangles, reach);
    let welded: Vec<Triangle> = mesh.triangles();
    // Copies of a vertex are at most `reach` apart, so each is about half as far from its place.
    let off = 0.5 * reach;
    let sheets = Sheets::of(&mesh, &welded, off, allowance);
    if !closes_gaps {
        for (triangle, plane) in triangles.iter_mut().zip(&sheets.plane_of) {
            let plane = plane.map(|i| sheets.planes[i as usize]);
            *triangle = triangle.map(|p| nearest_in(p, plane.iter(), reach).as_vec3().as_dvec3());
        }
        return;
    }
    let bvh = Bvh::build(&welded);
    let at: Vec<DVec3> = mesh
        .points
        .par_iter()
        .map(|&p| {
            let mut touched = Vec::new();
            bvh.for_each_in_box(&Aabb::new(p, p).expanded(off), |t| {
                let near = closest_point_on_triangle(p, &welded[t as usize]);
                if allowance.spend(1) && near.distance(p) <= off {
                    touched.extend(sheets.plane_of[t as usize]);
                }
            });
            touched.sort_unstable();
            touched.dedup();
            let planes = touched.iter().map(|&i| &sheets.planes[i as usize]);
            nearest_in(p, planes, off).as_vec3().as_dvec3()
        })
        .collect();
    for (triangle, ids) in triangles.iter_mut().zip(&mesh.corners) {
        *triangle = ids.map(|i| at[i as usize]);
    }
}

/// Returns the point nearest to `p` that lies in the planes, in their order; leaves out those that lead farther than
/// `limit` from it, such as planes that almost coincide with others.
fn nearest_in<'a>(p: DVec3, planes: impl Iterator<Item = &'a Plane>, limit: f64) -> DVec3 {
    let mut at = p;
    let mut axes: Vec<DVec3> = Vec::with_capacity(3);
    for plane in planes {
        // Moves along this direction stay in all planes before.
        let free = axes.iter().fold(plane.normal, |d, a| d - *a * d.dot(*a));
        let Some(along) = free.try_normalize() else {
            continue;
        };
        let to = at - along * (plane.signed_distance(at) / plane.normal.dot(along));
        if to.distance(p) <= limit {
            at = to;
            axes.push(along);
        }
        if axes.len() == 3 {
            break;
        }
    }
    at
}

#[cfg(test)]
mod tests {
    //! Covers V1.

    use enfilade_testkit::{Disturbance, disturb, furnished_house};

    use super::super::misfit::misfit;
    use super::*;
    use crate::structure::structural_triangles;

    /// Ratio of the distance of two copies of a vertex, nearly always, to the deviation of each coordinate.
    const SPREAD: f64 = 7.0;

    /// Returns the triangles of a house, as they were and with each vertex moved.
    fn house(jitter: f64) -> [Vec<Triangle>; 2] {
        let clean = furnished_house().scene;
        let by = Disturbance {
            jitter,
            seed: 1,
            ..Disturbance::default()
        };
        [&clean, &disturb(&clean, &by)].map(|scene| structural_triangles(scene).1)
    }

    fn settled(moved: &[Triangle], jitter: f64, closes_gaps: bool) -> Vec<Triangle> {
        let mut triangles = moved.to_vec();
        settle(
            &mut triangles,
            SPREAD * jitter,
            closes_gaps,
            &Allowance::default(),
        );
        triangles
    }

    /// Returns the share of the triangles along an axis that still lie along it, to the bit.
    fn share_in_axis_planes(clean: &[Triangle], triangles: &[Triangle]) -> f64 {
        let (mut n, mut n_kept) = (0.0, 0.0);
        for (before, after) in clean.iter().zip(triangles) {
            let is_flat = |t: &Triangle, axis: usize| t.iter().all(|p| p[axis] == t[0][axis]);
            for axis in (0..3).filter(|&axis| is_flat(before, axis)) {
                n += 1.0;
                n_kept += f64::from(u8::from(is_flat(after, axis)));
            }
        }
        n_kept / n
    }

    #[test]
    fn moved_triangles_share_edges_and_planes_again() {
        for jitter in [1e-5, 1e-4, 1e-3] {
            let [clean, moved] = house(jitter);
            let after = settled(&moved, jitter, true);
            let all = Allowance::default();
            assert_eq!(misfit(&after, &Bvh::build(&after), &all), 0.0, "{jitter}");
            let before = share_in_axis_planes(&clean, &moved);
            let share = share_in_axis_planes(&clean, &after);
            assert!(
                before < 0.1 && share > 0.98,
                "{jitter}: {before} to {share}"
            );
            let pairs = clean.iter().flatten().zip(after.iter().flatten());
            let off = pairs.map(|(p, q)| p.distance(*q)).fold(0.0, f64::max);
            assert!(
                off < 1.5 * SPREAD * jitter,
                "{jitter}: {off} m from its place"
            );
        }
    }

    #[test]
    fn where_gaps_stay_open_triangles_share_planes_alone() {
        let [clean, moved] = house(1e-4);
        let after = settled(&moved, 1e-4, false);
        let share = share_in_axis_planes(&clean, &after);
        assert!(share > 0.98, "{share}");
        let left = misfit(&after, &Bvh::build(&after), &Allowance::default());
        assert!(left > 1e-4, "{left}");
    }

    #[test]
    fn the_order_of_triangles_has_no_say() {
        let [_, moved] = house(1e-3);
        let turned = |t: &Triangle| [t[1], t[2], t[0]];
        let other: Vec<Triangle> = moved.iter().rev().map(turned).collect();
        let mut again = settled(&other, 1e-3, true);
        again.reverse();
        let off = settled(&moved, 1e-3, true).into_iter().zip(again);
        let off = off.map(|(t, u)| (0..3).map(|k| turned(&t)[k].distance(u[k])).sum::<f64>());
        // A step of `f32`: sums are rounded by the order of the vertices of a triangle.
        assert!(off.fold(0.0, f64::max) < 1e-5);
    }

    #[test]
    fn a_point_goes_to_planes_that_cross_and_not_to_one_that_almost_coincides() {
        let x = |d: f64, y: f64| Plane::through(DVec3::X * d, DVec3::new(1.0, y, 0.0).normalize());
        let y = Plane::through(DVec3::Y * 0.01, DVec3::Y);
        let p = nearest_in(DVec3::ZERO, [x(0.02, 0.0), x(0.03, 1e-3), y].iter(), 0.1);
        assert!(p.distance(DVec3::new(0.02, 0.01, 0.0)) < 1e-12, "{p}");
        let p = nearest_in(DVec3::ZERO, [x(0.2, 0.0), y].iter(), 0.1);
        assert!(p.distance(DVec3::new(0.0, 0.01, 0.0)) < 1e-12, "{p}");
    }
}
