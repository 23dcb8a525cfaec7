//! *Sealed*, the other half: no seal closes more than a gap.

use enfilade_cpg::World;
use enfilade_geom::{Bvh, DVec3, Triangle, closest_point_on_triangle};
use rayon::prelude::*;

use crate::subject::structural_triangles;

/// Seals overlap what they join, by what rounding to `f32` may move. [Units: wu]
const OVERLAP: f64 = 1e-3;

/// Points on the rim of a disk, and on a smaller one in it.
const AROUND: usize = 16;

/// Problems of seals that close more than the file's `smallest_hole` says.
///
/// A seal closes more where a ball of that diameter has room in the middle of it, far enough from the model, and a disk of that
/// diameter fits into it and those beside it: the ball would have passed. A strip that is narrower is no hole, wherever it is.
///
/// Exact but for holes smaller than [`OVERLAP`]: the distance from a triangle is a convex function, so a part whose vertices
/// are near one triangle of the model is near it all over; others are cut in two.
pub(crate) fn check(world: &World, source: Option<&[Triangle]>) -> Vec<String> {
    let all = structural_triangles(world);
    let is_seal = |batch: u32| world.batches[batch as usize].is_seal;
    let (seals, model): (Vec<_>, Vec<_>) = all.into_iter().partition(|t| is_seal(t.1));
    if seals.is_empty() {
        return Vec::new();
    }
    let settings = &world.graph.provenance.settings;
    let said = settings.get("smallest_hole").and_then(|s| s.parse().ok());
    let Some(hole): Option<f64> = said else {
        return vec![
            "there are seals, but the file does not say how wide: smallest_hole is missing".into(),
        ];
    };
    let model: Vec<Triangle> = match source {
        Some(source) => source.to_vec(),
        None => model.into_iter().map(|t| t.0).collect(),
    };
    let seals: Vec<Triangle> = seals.into_iter().map(|t| t.0).collect();
    let holes = Holes {
        around: Bvh::build(&model),
        model: &model,
        closed: Bvh::build(&seals),
        reach: 0.5 * hole + OVERLAP,
    };
    let found = seals.par_iter().filter_map(|t| holes.in_seal(t));
    found
        .map(|at| {
            let [x, y, z] = at.to_array();
            format!(
                "a seal at {x:.3} {y:.3} {z:.3} closes more than a gap of smallest_hole {hole} m"
            )
        })
        .collect()
}

/// The model and the seals, to tell holes from gaps.
struct Holes<'a> {
    model: &'a [Triangle],
    around: Bvh,
    closed: Bvh,
    /// Radius of the ball. [Units: wu]
    reach: f64,
}

impl Holes<'_> {
    /// A point of a seal through which the ball passes.
    fn in_seal(&self, t: &Triangle) -> Option<DVec3> {
        let normal = (t[1] - t[0]).cross(t[2] - t[0]).try_normalize()?;
        // No recursion: a seal is cut into as many parts as it takes.
        let mut parts = vec![*t];
        while let Some(part) = parts.pop() {
            let middle = (part[0] + part[1] + part[2]) / 3.0;
            match self.around.nearest(middle, self.reach) {
                None if self.has_disk(middle, normal) => return Some(middle),
                None => {}
                Some(near) => {
                    let near = &self.model[near.triangle as usize];
                    let distance = |p: &DVec3| closest_point_on_triangle(*p, near).distance(*p);
                    if part.iter().all(|p| distance(p) <= self.reach) {
                        continue;
                    }
                }
            }
            let length = |k: usize| part[k].distance(part[(k + 1) % 3]);
            let longest = (1..3).fold(0, |l, k| if length(k) > length(l) { k } else { l });
            if length(longest) > OVERLAP {
                let [a, b, c] = [0, 1, 2].map(|k| part[(longest + k) % 3]);
                let half = a.midpoint(b);
                parts.extend([[a, half, c], [half, b, c]]);
            }
        }
        None
    }

    /// Tells whether seals close the disk as wide as the ball about a point of one.
    fn has_disk(&self, p: DVec3, normal: DVec3) -> bool {
        let u = normal.any_orthonormal_vector();
        let v = normal.cross(u);
        let is_closed = |k: usize, radius: f64| {
            let angle = std::f64::consts::TAU * k as f64 / AROUND as f64;
            let at = p + (u * angle.cos() + v * angle.sin()) * radius;
            self.closed.nearest(at, OVERLAP).is_some()
        };
        (0..AROUND).all(|k| is_closed(k, self.reach) && is_closed(k, 0.5 * self.reach))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::Batch;
    use enfilade_geom::scene::Primitive;

    /// A batch of upright rectangles, `[x0, y0, x1, y1]` each.
    fn batch(rectangles: &[[f32; 4]], is_seal: bool) -> Batch {
        let mut primitive = Primitive::default();
        for &[x0, y0, x1, y1] in rectangles {
            let n = primitive.positions.len() as u32;
            let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
            let corners = corners.map(|[x, y]| [x, y, 0.0]);
            primitive.positions.extend(corners);
            let indices = [0, 1, 2, 0, 2, 3].map(|i| n + i);
            primitive.indices.extend(indices);
        }
        Batch {
            primitive,
            is_seal,
            ..Batch::default()
        }
    }

    /// Walls and what closes the gaps between them.
    fn closed(walls: &[[f32; 4]], seals: &[[f32; 4]]) -> World {
        let mut world = World {
            batches: vec![batch(walls, false), batch(seals, true)],
            ..World::default()
        };
        let settings = &mut world.graph.provenance.settings;
        settings.insert("smallest_hole".into(), "0.01".into());
        world
    }

    /// Two walls with a slit of so many meters between them, and a seal across it.
    fn sealed(width: f32) -> World {
        let walls = [[-2.0, 0.0, 0.0, 3.0], [width, 0.0, 2.0, 3.0]];
        closed(&walls, &[[0.0, 0.0, width, 3.0]])
    }

    #[test]
    fn a_seal_wider_than_it_claims_is_found() {
        assert_eq!(check(&sealed(0.009), None), Vec::<String>::new());
        assert_eq!(check(&sealed(0.1), None).len(), 2);
        let mut silent = sealed(0.009);
        silent.graph.provenance.settings.clear();
        assert!(check(&silent, None)[0].contains("smallest_hole"));
    }

    #[test]
    fn a_hole_beside_what_is_near_matter_is_found_however_small_its_share() {
        // A grating of bars 8 mm apart, closed as one, in which one bar of three hundred is missing, far from the middle.
        let bars = (0..300).filter(|&k| k != 211);
        let bars: Vec<[f32; 4]> = bars
            .map(|k| 0.01 * k as f32)
            .map(|x| [x, 0.0, x + 0.002, 3.0])
            .collect();
        let world = closed(&bars, &[[0.0, 0.0, 3.0, 3.0]]);
        assert!(!check(&world, None).is_empty());
        let whole: Vec<[f32; 4]> = (0..=300)
            .map(|k| 0.01 * k as f32)
            .map(|x| [x, 0.0, x + 0.002, 3.0])
            .collect();
        let world = closed(&whole, &[[0.0, 0.0, 3.0, 3.0]]);
        assert_eq!(check(&world, None), Vec::<String>::new());
    }

    #[test]
    fn strips_that_are_narrow_close_a_wide_hole_together() {
        let strips: Vec<[f32; 4]> = (0..20)
            .map(|k| 0.005 * k as f32)
            .map(|x| [x, 0.0, x + 0.005, 3.0])
            .collect();
        let walls = [[-2.0, 0.0, 0.0, 3.0], [0.1, 0.0, 2.0, 3.0]];
        assert!(!check(&closed(&walls, &strips), None).is_empty());
        // One in the open is no hole.
        assert_eq!(
            check(&closed(&walls, &strips[9..10]), None),
            Vec::<String>::new()
        );
    }
}
