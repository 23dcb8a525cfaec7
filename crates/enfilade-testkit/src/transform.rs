//! Transformed copies of a scene: rotated, scaled, reordered.

use enfilade_geom::{DMat4, DVec3};

use enfilade_demo::Generated;
use enfilade_demo::Rng;

/// Moves a scene by a rotation, uniform scaling and translation. Leaves meshes unchanged.
#[must_use]
pub fn transformed(mut generated: Generated, by: &DMat4) -> Generated {
    for o in &mut generated.scene.objects {
        o.transform = *by * o.transform;
    }
    generated.truth.transform(by);
    generated
}

/// Rotates a scene about +Y.
#[must_use]
pub fn rotated(generated: Generated, degrees: f64) -> Generated {
    transformed(generated, &DMat4::from_rotation_y(degrees.to_radians()))
}

/// Scales a scene about the origin.
#[must_use]
pub fn scaled(generated: Generated, factor: f64) -> Generated {
    transformed(generated, &DMat4::from_scale(DVec3::splat(factor)))
}

/// Shuffles the objects of a scene, and the triangles within each part; triangles also start at another of
/// their vertices. The truth stays the same.
#[must_use]
pub fn shuffled(mut generated: Generated, seed: u64) -> Generated {
    let mut rng = Rng::new(seed);
    rng.shuffle(&mut generated.scene.objects);
    for p in generated
        .scene
        .meshes
        .iter_mut()
        .flat_map(|m| &mut m.primitives)
    {
        let mut triangles = p.triples().to_vec();
        rng.shuffle(&mut triangles);
        for t in &mut triangles {
            t.rotate_left(rng.below(3));
        }
        p.indices = triangles.concat();
    }
    generated
}

/// As [`shuffled`], also with the vertices of each part in another order: the same scene as written by another program.
#[must_use]
pub fn reordered(generated: Generated, seed: u64) -> Generated {
    let mut generated = shuffled(generated, seed);
    let mut rng = Rng::new(seed ^ 0x5eed);
    let meshes = generated.scene.meshes.iter_mut();
    for p in meshes.flat_map(|m| &mut m.primitives) {
        // Old index by new index, and the inverse.
        let mut old: Vec<usize> = (0..p.positions.len()).collect();
        rng.shuffle(&mut old);
        let mut new = vec![0; old.len()];
        for (i, &o) in old.iter().enumerate() {
            new[o] = i as u32;
        }
        fn moved<T: Copy>(list: &mut Vec<T>, old: &[usize]) {
            if !list.is_empty() {
                *list = old.iter().map(|&o| list[o]).collect();
            }
        }
        moved(&mut p.positions, &old);
        moved(&mut p.normals, &old);
        moved(&mut p.tangents, &old);
        moved(&mut p.colors, &old);
        for uvs in &mut p.uvs {
            moved(uvs, &old);
        }
        for i in &mut p.indices {
            *i = new[*i as usize];
        }
    }
    generated
}
