//! Disturbs a scene as exporters, scanners and web pipelines do.
//!
//! Works on any [`Scene`], generated or imported: triangles no longer share vertices, some are missing, vertices lie
//! on a grid, names and materials are gone.

use enfilade_geom::scene::{Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DVec3};

use enfilade_demo::Generated;
use enfilade_demo::Rng;

/// The changes to a scene, applied in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Disturbance {
    /// Grid to which vertices are rounded; it starts at the minimum of their object's box, as in quantized meshes. 0
    /// for none. [Units: wu]
    pub snap: f64,
    /// Share of the triangles to remove at random. [Limit: 0 <= drop <= 1]
    pub drop: f64,
    /// Standard deviation, along each axis, of the move of each vertex of each triangle; 0 for none. [Units: wu]
    pub jitter: f64,
    /// Removes names and materials, and makes all objects structural.
    pub strip: bool,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Returns the scene with each object as a mesh of its own, in world space, without shared vertices, and then
/// disturbed. The same seed gives the same scene, to the bit.
///
/// Drops objects that lose all their triangles, and normals, tangents and brushes: these would reveal where the
/// triangles were.
#[must_use]
pub fn disturb(scene: &Scene, by: &Disturbance) -> Scene {
    let mut out = Scene {
        entities: scene.entities.clone(),
        ..Scene::default()
    };
    if !by.strip {
        out.materials.clone_from(&scene.materials);
        out.textures.clone_from(&scene.textures);
        out.images.clone_from(&scene.images);
    }
    let mut placed = vec![None; scene.objects.len()];
    for (i, object) in scene.objects.iter().enumerate() {
        let mesh = &scene.meshes[object.mesh as usize];
        let (mesh, called) = (
            spoil(mesh, &object.transform, by, i as u64),
            format!("object-{}", i + 1),
        );
        if mesh.primitives.is_empty() {
            continue;
        }
        placed[i] = Some(out.objects.len() as u32);
        out.objects.push(Object {
            mesh: out.meshes.len() as u32,
            transform: DMat4::IDENTITY,
            ..if by.strip {
                Object {
                    name: called.clone(),
                    role: Role::Structural,
                    reason: "default".into(),
                    filling: None,
                    ..object.clone()
                }
            } else {
                object.clone()
            }
        });
        out.meshes.push(if by.strip {
            Mesh {
                name: called,
                ..mesh
            }
        } else {
            mesh
        });
    }
    for e in &mut out.entities {
        e.object = e.object.and_then(|o| placed.get(o as usize).copied()?);
    }
    out
}

/// Returns the scene disturbed, with the same truth.
#[must_use]
pub fn disturbed(generated: &Generated, by: &Disturbance) -> Generated {
    Generated {
        scene: disturb(&generated.scene, by),
        truth: generated.truth.clone(),
    }
}

/// Returns a placed mesh in world space, disturbed; without parts that lost all their triangles.
fn spoil(mesh: &Mesh, placed: &DMat4, by: &Disturbance, stream: u64) -> Mesh {
    // A stream for each object, so that additional objects do not change the rest.
    let mut rng = Rng::stream(by.seed, stream);
    let world = |p: [f32; 3]| placed.transform_point3(DVec3::from(p.map(f64::from)));
    let used = |p: &Primitive| -> Vec<DVec3> {
        let corner = |&i: &u32| world(p.positions[i as usize]);
        p.indices.iter().map(corner).collect()
    };
    let low = mesh
        .primitives
        .iter()
        .fold(Aabb::EMPTY, |b, p| b.union(Aabb::of_points(&used(p))))
        .min;
    let mut primitives = Vec::new();
    for p in &mesh.primitives {
        let mut part = Primitive {
            material: p.material.filter(|_| !by.strip),
            ..Primitive::default()
        };
        // Index of the source of each vertex, for its other attributes.
        let mut from = Vec::new();
        for (t, corners) in used(p).chunks_exact(3).enumerate() {
            // Drawn for every triangle, whatever the share: a larger share removes more triangles, never others.
            let is_missing = rng.unit() < by.drop;
            for (k, &corner) in corners.iter().enumerate() {
                let mut at = corner;
                if by.snap > 0.0 {
                    at = low + ((at - low) / by.snap).round() * by.snap;
                }
                if by.jitter > 0.0 {
                    at += by.jitter
                        * DVec3::new(normal(&mut rng), normal(&mut rng), normal(&mut rng));
                }
                if !is_missing {
                    part.positions.push(at.as_vec3().to_array());
                    from.push(p.indices[3 * t + k] as usize);
                }
            }
        }
        part.indices = (0..part.positions.len() as u32).collect();
        if !by.strip {
            part.colors = gathered(&p.colors, &from);
            part.uvs = p.uvs.iter().map(|set| gathered(set, &from)).collect();
        }
        if !part.indices.is_empty() {
            primitives.push(part);
        }
    }
    Mesh {
        name: mesh.name.clone(),
        primitives,
    }
}

fn gathered<T: Copy>(items: &[T], from: &[usize]) -> Vec<T> {
    if items.is_empty() {
        return Vec::new();
    }
    from.iter().map(|&i| items[i]).collect()
}

/// Returns a number of the normal distribution, mean 0 and deviation 1.
///
/// The sum of twelve uniform numbers minus their mean (Irwin 1927, Hall 1927): within 0.3 % of the normal distribution
/// everywhere, and without a logarithm, which differs between machines in its last bit.
fn normal(rng: &mut Rng) -> f64 {
    (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::furnished_house;
    use crate::oracle::n_open_edges;

    fn corners(scene: &Scene, role: Role) -> Vec<DVec3> {
        let sources = scene.triangle_sources(role);
        sources.flat_map(|s| scene.world_triangle(s)).collect()
    }

    #[test]
    fn corners_move_by_what_is_asked_and_each_by_itself() {
        let house = furnished_house().scene;
        let by = Disturbance {
            jitter: 1e-3,
            seed: 1,
            ..Disturbance::default()
        };
        let moved = disturb(&house, &by);
        assert_eq!(moved.objects.len(), house.objects.len());
        let (a, b) = (
            corners(&house, Role::Structural),
            corners(&moved, Role::Structural),
        );
        assert_eq!(a.len(), b.len());
        let steps: Vec<f64> = a
            .iter()
            .zip(&b)
            .flat_map(|(a, b)| (*b - *a).to_array())
            .collect();
        let n = steps.len() as f64;
        let mean = steps.iter().sum::<f64>() / n;
        let deviation = (steps.iter().map(|s| s * s).sum::<f64>() / n).sqrt();
        // About 10,000 numbers: five deviations of the mean (1e-5), and of the deviation (0.7 %).
        assert!(mean.abs() < 5e-5, "{mean}");
        assert!((deviation / by.jitter - 1.0).abs() < 0.04, "{deviation}");
        let two = steps.iter().filter(|s| s.abs() > 2.0 * by.jitter).count() as f64 / n;
        assert!((0.035..0.055).contains(&two), "{two} beyond two deviations");
        // No triangles of a wall share edges any more.
        let wall: Vec<_> = moved
            .triangle_sources(Role::Structural)
            .filter(|s| s.object == 0)
            .map(|s| moved.world_triangle(s))
            .collect();
        assert_eq!(n_open_edges(&wall), 3 * wall.len());
        let again = disturb(&house, &by);
        assert_eq!(b, corners(&again, Role::Structural));
        let other = disturb(&house, &Disturbance { seed: 2, ..by });
        assert_ne!(b, corners(&other, Role::Structural));
    }

    #[test]
    fn a_share_of_the_triangles_is_missing() {
        let house = furnished_house().scene;
        let dropped = |drop| {
            let by = Disturbance {
                drop,
                seed: 3,
                ..Disturbance::default()
            };
            let out = disturb(&house, &by);
            corners(&out, Role::Structural).len() + corners(&out, Role::Detail).len()
        };
        let all = dropped(0.0);
        let share = 1.0 - dropped(0.2) as f64 / all as f64;
        // About 4,000 triangles: four deviations of 0.6 %.
        assert!((0.175..0.225).contains(&share), "{share}");
        assert_eq!(dropped(1.0), 0);
        let kept = disturb(&house, &Disturbance::default());
        assert_eq!(
            corners(&kept, Role::Structural),
            corners(&house, Role::Structural)
        );
    }

    #[test]
    fn corners_lie_on_a_grid_of_their_object() {
        let house = furnished_house().scene;
        let by = Disturbance {
            snap: 0.07,
            ..Disturbance::default()
        };
        let snapped = disturb(&house, &by);
        for i in 0..house.objects.len() {
            let low = house.object_aabb(i).min;
            for p in &snapped.meshes[i].primitives {
                for p in &p.positions {
                    let steps = (DVec3::from(p.map(f64::from)) - low) / by.snap;
                    // The spacing of f32 at 20 m is 2e-6.
                    assert!(
                        (steps - steps.round()).abs().max_element() < 1e-4,
                        "{steps}"
                    );
                }
            }
        }
    }

    #[test]
    fn names_and_materials_go_and_triangles_stay() {
        let house = furnished_house().scene;
        let by = Disturbance {
            strip: true,
            ..Disturbance::default()
        };
        let bare = disturb(&house, &by);
        assert!(bare.materials.is_empty() && bare.textures.is_empty() && bare.images.is_empty());
        assert_eq!(bare.objects.len(), house.objects.len());
        assert!(bare.objects.iter().all(|o| o.role == Role::Structural));
        assert!(bare.objects.iter().all(|o| o.name.starts_with("object-")));
        let parts = |s: &Scene| s.meshes.iter().map(|m| m.primitives.len()).sum::<usize>();
        assert!(parts(&bare) >= parts(&house));
        assert!(
            bare.meshes
                .iter()
                .flat_map(|m| &m.primitives)
                .all(|p| p.material.is_none())
        );
        assert_eq!(
            corners(&bare, Role::Structural).len(),
            corners(&house, Role::Structural).len() + corners(&house, Role::Detail).len()
        );
    }
}
