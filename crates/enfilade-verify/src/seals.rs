//! *Sealed*, the other half: no seal closes more than a gap.

use enfilade_cpg::World;
use enfilade_geom::{Bvh, DVec3, Triangle};

use crate::subject::structural_triangles;

/// Overlap of seals with the surfaces that they join: allows for rounding to `f32`. [Units: wu]
const OVERLAP: f64 = 1e-3;

/// Returns problems of seals that close more than the file's `smallest_hole`.
///
/// A seal closes a gap if it is narrower than the hole, or no point of it is farther than half the hole's width from
/// the model.
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
            "there are seals, but the file lacks smallest_hole, their largest width".into(),
        ];
    };
    let model: Vec<Triangle> = match source {
        Some(source) => source.to_vec(),
        None => model.into_iter().map(|t| t.0).collect(),
    };
    let bvh = Bvh::build(&model);
    let reach = 0.5 * hole + OVERLAP;
    let is_far = |p: DVec3| bvh.nearest(p, reach).is_none();
    let wide = seals.iter().filter(|(t, _)| {
        let middle = (t[0] + t[1] + t[2]) / 3.0;
        let samples = [
            middle,
            t[0].lerp(middle, 0.2),
            t[1].lerp(middle, 0.2),
            t[2].lerp(middle, 0.2),
        ];
        height(t) > hole + 2.0 * OVERLAP && samples.into_iter().any(is_far)
    });
    let mut out = Vec::new();
    for (t, _) in wide {
        let [x, y, z] = ((t[0] + t[1] + t[2]) / 3.0).to_array();
        out.push(format!(
            "a seal at {x:.3} {y:.3} {z:.3} closes more than a gap of smallest_hole {hole} m"
        ));
    }
    out
}

/// Returns the least height of a triangle.
fn height(t: &Triangle) -> f64 {
    let longest = (0..3)
        .map(|k| t[k].distance(t[(k + 1) % 3]))
        .fold(0.0, f64::max);
    let area = (t[1] - t[0]).cross(t[2] - t[0]).length();
    if longest > 0.0 { area / longest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::Batch;
    use enfilade_geom::scene::Primitive;

    /// Two walls with a slit of `width` meters between them, and a seal across it.
    fn sealed(width: f32) -> World {
        let strip = |x0: f32, x1: f32, is_seal| Batch {
            primitive: Primitive {
                positions: vec![
                    [x0, 0.0, 0.0],
                    [x1, 0.0, 0.0],
                    [x1, 3.0, 0.0],
                    [x0, 3.0, 0.0],
                ],
                indices: vec![0, 1, 2, 0, 2, 3],
                ..Primitive::default()
            },
            is_seal,
            ..Batch::default()
        };
        let mut world = World {
            batches: vec![
                strip(-2.0, 0.0, false),
                strip(width, 2.0, false),
                strip(0.0, width, true),
            ],
            ..World::default()
        };
        let settings = &mut world.graph.provenance.settings;
        settings.insert("smallest_hole".into(), "0.01".into());
        world
    }

    #[test]
    fn a_seal_wider_than_it_claims_is_found() {
        assert_eq!(check(&sealed(0.009), None), Vec::<String>::new());
        assert_eq!(check(&sealed(0.1), None).len(), 2);
        let mut silent = sealed(0.009);
        silent.graph.provenance.settings.clear();
        assert!(check(&silent, None)[0].contains("smallest_hole"));
    }
}
