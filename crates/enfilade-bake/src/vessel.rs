//! Detects vessels: surfaces that are curved nearly everywhere, and closed except at their ends.

use std::collections::HashMap;

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{DVec3, Sets, triangle_area_normal};

/// Larger scenes are left to the watershed, which takes seconds where tetrahedra take minutes.
const MAX_TRIANGLES: usize = 200_000;
/// Least share of the surface for a flat patch to count as a plane: flat patches of a scanned aorta and of a cave have
/// at most 0.0007, the walls of a building a hundredth.
const PLANE: f64 = 0.001;
/// Largest share of the surface in planes: the caps of cut vessels. Buildings have half and more.
const FLAT: f64 = 0.2;
/// Largest share of edges with an odd number of triangles.
const OPEN: f64 = 0.05;
/// Largest length of the sum of all area normals ÷ area. A closed surface has 0, a vessel the share of its open ends, a
/// terrain 0.7 and more.
const HOLES: f64 = 0.1;
/// Cosine of the angle between triangles at an edge of a wall. Surfaces of volumes with few samples bend by 30 degrees from one
/// triangle to the next, so that each may be a hundredth of all; walls meet at 90.
const SHARP: f64 = 0.5;
/// Cosine of the angle between two triangles of one patch: a tenth of a degree, the single precision error of a
/// plane in a large scene.
const ONE_PATCH: f64 = 0.999_998_5;

/// Returns `true` if the structure is closed, with an even number of triangles at each edge, except for holes that are
/// small beside it, and hardly any of it lies in planes.
/// `O(n)` in triangles; `false` above [`MAX_TRIANGLES`].
pub(crate) fn is_vessel(scene: &Scene) -> bool {
    let triangles: Vec<_> = scene
        .triangle_sources(Role::Structural)
        .take(MAX_TRIANGLES + 1)
        .map(|s| scene.world_triangle(s))
        .collect();
    if triangles.is_empty() || triangles.len() > MAX_TRIANGLES {
        return false;
    }
    // Vertices are equal if their positions are: files repeat them for normals and materials.
    let key = |p: DVec3| (p + 0.0).to_array().map(f64::to_bits);
    let mut sides: HashMap<_, Vec<usize>> = HashMap::new();
    for (t, corners) in triangles.iter().enumerate() {
        let keys = corners.map(key);
        for i in 0..3 {
            let (a, b) = (keys[i], keys[(i + 1) % 3]);
            sides.entry((a.min(b), a.max(b))).or_default().push(t);
        }
    }
    let normals: Vec<DVec3> = triangles.iter().map(triangle_area_normal).collect();
    let unit = |t: usize| normals[t].normalize_or_zero();
    let mut patches = Sets::new(triangles.len());
    let mut n_open = 0;
    let mut is_wall = vec![false; triangles.len()];
    for around in sides.values() {
        n_open += around.len() % 2;
        // Sheets that touch along an edge are not planes that continue there.
        let &[a, b] = &around[..] else { continue };
        let bend = unit(a).dot(unit(b));
        if bend > ONE_PATCH {
            patches.join(a as u32, b as u32);
        }
        // A patch of several triangles is flat, too.
        if !(SHARP..=ONE_PATCH).contains(&bend) {
            is_wall[a] = true;
            is_wall[b] = true;
        }
    }
    let mut areas = vec![0.0; triangles.len()];
    for (t, normal) in (0..).zip(&normals) {
        let patch = patches.find(t) as usize;
        areas[patch] += normal.length();
        is_wall[patch] |= is_wall[t as usize];
    }
    let all: f64 = areas.iter().sum();
    let of_wall = areas.iter().zip(&is_wall);
    let planes = of_wall.filter(|&(&a, &is_wall)| is_wall && a >= PLANE * all);
    let planes: f64 = planes.map(|(a, _)| a).sum();
    // The area normals of the holes and of the surface add up to zero.
    let holes = normals.iter().sum::<DVec3>().length();
    planes <= FLAT * all && holes <= HOLES * all && n_open as f64 <= OPEN * sides.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::{Tube, Variant, cave, gjorup_rooms, tubes};

    #[test]
    fn tubes_and_caves_are_and_rooms_are_not() {
        let along = |radius: f64, by: DVec3| Tube {
            ends: [DVec3::ZERO, by],
            radius,
        };
        let vessel = tubes(
            &[
                along(1.0, DVec3::new(4.0, 0.3, 0.2)),
                along(0.5, DVec3::new(0.5, 3.0, 1.0)),
            ],
            0.12,
        );
        assert!(is_vessel(&vessel.scene));
        // However few triangles it has.
        let pipe = along(1.0, DVec3::new(4.0, 0.3, 0.2));
        assert!(is_vessel(&tubes(&[pipe], 0.5).scene));
        assert!(is_vessel(&cave(1).scene));
        for variant in [Variant::Optimised, Variant::Tessellated, Variant::Distorted] {
            assert!(!is_vessel(&gjorup_rooms(variant, [0.0; 3]).scene));
        }
        // Open at one end, and cut in half along its axis.
        let mut open = vessel.scene;
        let mesh = &mut open.meshes[0].primitives[0];
        let kept = |keeps: &dyn Fn([f32; 3]) -> bool| -> Vec<u32> {
            let is_kept = |t: &&[u32]| t.iter().all(|&i| keeps(mesh.positions[i as usize]));
            let kept = mesh.indices.chunks(3).filter(is_kept);
            kept.flatten().copied().collect()
        };
        let (pipe, trough) = (kept(&|p| p[0] < 4.0), kept(&|p| p[2] < 0.1));
        mesh.indices = pipe;
        assert!(is_vessel(&open));
        open.meshes[0].primitives[0].indices = trough;
        assert!(!is_vessel(&open));
    }
}
