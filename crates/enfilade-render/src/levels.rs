//! Levels of detail: versions of an object with fewer triangles, each with its geometric error.
//!
//! Funkhouser & Séquin, "Adaptive display algorithm for interactive frame rates" (1993), keep models of objects at
//! several levels and choose per object; Gjørup 1999, §2.3.2, lets portals decide. Both are done here: what is visible
//! through portals is drawn at the level that its distance allows. The library meshoptimizer collapses edges by
//! quadrics (Garland & Heckbert 1997); the error of a level is measured here, on the resulting surface.

use std::collections::HashMap;

use enfilade_geom::scene::Primitive;
use enfilade_geom::{Bvh, DVec3, Triangle};
use meshopt::{SimplifyOptions, VertexDataAdapter};

/// Meshes with fewer triangles have one level. [Units: triangles]
const WORTH: usize = 200;
/// Requested ratio of the triangles of a level to those of the one before.
const STEP: usize = 4;
/// Largest ratio of triangles that makes a level worth keeping. Vertices at seams and rims stay, which ends the gain.
const GAIN: f64 = 0.7;
/// Largest requested move of a vertex, as a share of the mesh's size: an object drawn so coarsely covers ten pixels.
const FARTHEST: f32 = 0.1;
/// Weight of a change of the normal relative to a move by the mesh's size: shading must not jump.
const NORMAL_WEIGHT: f32 = 0.2;

/// A mesh with fewer triangles.
pub(crate) struct Coarser {
    /// Largest distance between its surface and the original. [Units: wu of the mesh]
    pub(crate) error: f64,
    /// For each primitive, triples of indices into its positions.
    pub(crate) indices: Vec<Vec<u32>>,
}

/// Returns ever coarser versions of `primitives`, errors ascending; none if the mesh is small.
///
/// O(n log n) in triangles. Input need not be sound: primitives that meshoptimizer rejects stay unchanged.
pub(crate) fn coarser(primitives: &[&Primitive]) -> Vec<Coarser> {
    let n_of = |all: &[Vec<u32>]| all.iter().map(|i| i.len() / 3).sum::<usize>();
    let full: Vec<Vec<u32>> = primitives.iter().map(|p| p.indices.clone()).collect();
    let mut levels: Vec<Coarser> = Vec::new();
    let mut n = n_of(&full);
    let mut share = STEP;
    let is_sound = primitives.iter().all(|p| {
        p.indices.len().is_multiple_of(3)
            && p.positions.iter().flatten().all(|x| x.is_finite())
            && p.indices.iter().all(|&i| (i as usize) < p.positions.len())
    });
    while is_sound && n >= WORTH {
        let before = levels.last().map_or(&full, |l| &l.indices);
        let indices: Vec<Vec<u32>> = (primitives.iter().zip(before))
            .map(|(p, before)| {
                let less = collapsed(p, p.indices.len() / 3 / share, primitives.len() > 1);
                // No primitive vanishes, and no level has more triangles than the one before.
                if less.is_empty() || less.len() > before.len() {
                    before.clone()
                } else {
                    less
                }
            })
            .collect();
        let n_left = n_of(&indices);
        if n_left as f64 > GAIN * n as f64 {
            break;
        }
        let error = (primitives.iter().zip(&indices))
            .map(|(p, coarse)| distance(p, coarse))
            .fold(levels.last().map_or(0.0, |l| l.error), f64::max);
        levels.push(Coarser { error, indices });
        n = n_left;
        share *= STEP;
    }
    levels
}

/// Returns the indices of a primitive reduced to about `n` triangles. Rims where other primitives may begin stay.
fn collapsed(p: &Primitive, n: usize, keeps_rims: bool) -> Vec<u32> {
    let bytes = bytemuck::cast_slice(&p.positions);
    let Ok(positions) = VertexDataAdapter::new(bytes, size_of::<[f32; 3]>(), 0) else {
        return Vec::new();
    };
    let options = if keeps_rims {
        SimplifyOptions::LockBorder
    } else {
        SimplifyOptions::empty()
    };
    let indices = joined(p);
    let is_smooth = p.normals.len() == p.positions.len();
    let normals: &[f32] = if is_smooth {
        bytemuck::cast_slice(&p.normals)
    } else {
        &[]
    };
    if is_smooth {
        let stays = vec![false; p.positions.len()];
        meshopt::simplify_with_attributes_and_locks(
            &indices,
            &positions,
            normals,
            &[NORMAL_WEIGHT; 3],
            size_of::<[f32; 3]>(),
            &stays,
            3 * n,
            FARTHEST,
            options,
            None,
        )
    } else {
        meshopt::simplify(&indices, &positions, 3 * n, FARTHEST, options, None)
    }
}

/// Returns the indices of a primitive with identical vertices merged: files repeat vertices, and meshoptimizer treats
/// unmerged ones as a seam.
fn joined(p: &Primitive) -> Vec<u32> {
    let bits = |v: Option<&[f32]>| -> Vec<u32> {
        // Adding zero makes -0 and 0 the same key.
        v.unwrap_or_default()
            .iter()
            .map(|x| (x + 0.0).to_bits())
            .collect()
    };
    let mut first_of: HashMap<Vec<u32>, u32> = HashMap::new();
    let firsts: Vec<u32> = (0..p.positions.len())
        .map(|i| {
            let mut key = bits(Some(&p.positions[i]));
            key.extend(bits(p.normals.get(i).map(|n| &n[..])));
            key.extend(bits(p.colors.get(i).map(|c| &c[..])));
            for uvs in &p.uvs {
                key.extend(bits(uvs.get(i).map(|u| &u[..])));
            }
            *first_of.entry(key).or_insert(i as u32)
        })
        .collect();
    p.indices.iter().map(|&i| firsts[i as usize]).collect()
}

/// Returns the largest distance of vertices and centers of triangles of either surface from the other.
fn distance(p: &Primitive, coarse: &[u32]) -> f64 {
    let triangles = |indices: &[u32]| -> Vec<Triangle> {
        let corner = |i: u32| DVec3::from_array(p.positions[i as usize].map(f64::from));
        let triples = indices.as_chunks().0.iter();
        triples.map(|t: &[u32; 3]| t.map(corner)).collect()
    };
    let (fine, coarse) = (triangles(&p.indices), triangles(coarse));
    let far = |from: &[Triangle], to: &[Triangle]| {
        let tree = Bvh::build(to);
        let points = from.iter().flat_map(|&[a, b, c]| {
            [
                a,
                b,
                c,
                (a + b) / 2.0,
                (b + c) / 2.0,
                (c + a) / 2.0,
                (a + b + c) / 3.0,
            ]
        });
        points
            .filter_map(|p| tree.nearest(p, f64::INFINITY))
            .map(|n| n.distance)
            .fold(0.0, f64::max)
    };
    far(&fine, &coarse).max(far(&coarse, &fine))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of `n` × `2 n` quads, flat or smooth.
    fn ball(n: u32, is_smooth: bool) -> Primitive {
        let mut p = Primitive::default();
        for i in 0..=n {
            for j in 0..2 * n {
                let [a, b] = [i, j].map(|k| f64::from(k) * std::f64::consts::PI / f64::from(n));
                // The sine of half a turn is not exactly zero, which would leave a hole.
                let r = if i == n { 0.0 } else { a.sin() };
                let at = [r * b.cos(), a.cos(), r * b.sin()].map(|x| x as f32);
                p.positions.push(at);
                if is_smooth {
                    p.normals.push(at);
                }
            }
        }
        let at = |i: u32, j: u32| i * 2 * n + j % (2 * n);
        for i in 0..n {
            for j in 0..2 * n {
                let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
                p.indices.extend([a, b, c, a, c, d]);
            }
        }
        p
    }

    #[test]
    fn levels_of_a_ball_have_ever_fewer_triangles_near_its_surface() {
        for is_smooth in [false, true] {
            let p = ball(24, is_smooth);
            let levels = coarser(&[&p]);
            assert!(levels.len() >= 2, "{}", levels.len());
            let (mut n, mut error) = (p.indices.len(), 0.0);
            for level in &levels {
                let [indices] = &level.indices[..] else {
                    panic!("a primitive each")
                };
                assert!(indices.len() < n && !indices.is_empty());
                assert!(level.error >= error);
                (n, error) = (indices.len(), level.error);
                // All vertices are on the ball. Between them, the surface lies inside by at most the error plus
                // the ball's own error.
                for t in indices.chunks_exact(3) {
                    let corner = |i: u32| DVec3::from_array(p.positions[i as usize].map(f64::from));
                    let middle = t.iter().map(|&i| corner(i)).sum::<DVec3>() / 3.0;
                    assert!(middle.length() > 1.0 - error - 0.02, "{middle} {error}");
                }
            }
            // An octahedron's faces are 0.42 off; no level here is that coarse.
            assert!(levels[0].error < 0.05 && error < 0.42, "{error}");
        }
    }

    #[test]
    fn what_is_small_or_broken_has_one_level() {
        assert!(coarser(&[]).is_empty());
        assert!(coarser(&[&ball(6, true)]).is_empty());
        for broken in 0..3 {
            let mut p = ball(24, false);
            match broken {
                0 => p.indices.truncate(100),
                1 => p.indices[7] = u32::MAX,
                _ => p.positions[9][1] = f32::NAN,
            }
            assert!(coarser(&[&p]).is_empty(), "{broken}");
        }
        // All vertices coincide.
        let mut point = ball(24, false);
        point.positions.fill([1.0; 3]);
        assert!(coarser(&[&point]).iter().all(|l| l.error == 0.0));
    }

    #[test]
    fn rims_stay_between_primitives() {
        // A ball cut in two, with a row of shared vertices.
        let whole = ball(24, false);
        let half = |indices: &[u32]| Primitive {
            indices: indices.to_vec(),
            ..whole.clone()
        };
        let middle = whole.indices.len() / 2;
        let parts = [
            half(&whole.indices[..middle]),
            half(&whole.indices[middle..]),
        ];
        let levels = coarser(&[&parts[0], &parts[1]]);
        assert!(!levels.is_empty());
        let rim = 12 * 48..13 * 48;
        for level in levels {
            for indices in level.indices {
                assert!(rim.clone().all(|i| indices.contains(&i)));
            }
        }
    }
}
