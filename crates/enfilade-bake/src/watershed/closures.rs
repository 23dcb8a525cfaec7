//! Door leaves and panes: detail objects that close an opening.
//!
//! Detail is left out of the decomposition (Haumont et al. 2003, §6.1), but a door leaf says more
//! about where a room ends than any measure of the opening behind it. Flat detail objects are
//! therefore drawn into a volume of their own: the flood stops there, and an opening that such an
//! object fills is never merged across. Whether the object is called a door does not matter, and a
//! flat object that stands elsewhere (a shelf against a wall, a table top) fills no opening between
//! two rooms, so it changes nothing.

use enfilade_geom::scene::{Role, Scene, TriangleSource};
use enfilade_geom::{Aabb, DVec3, Triangle, triangle_area_normal};

use crate::voxel::{BitVolume, Labels};

/// Flat means thinner than this. [Units: wu] A door with its frame and handles is about 0.3.
const MAX_THICKNESS: f64 = 0.4;
/// A closure is at least this long and this wide. [Units: wu]
const MIN_EXTENT: f64 = 0.35;
/// … and at least this many times wider than thick.
const MIN_FLATNESS: f64 = 2.0;

/// Triangles of the detail objects that are flat enough to close an opening.
#[must_use]
pub fn closure_triangles(scene: &Scene) -> Vec<Triangle> {
    let mut out = Vec::new();
    let mut object: Vec<Triangle> = Vec::new();
    let mut current = None;
    let mut sources: Vec<TriangleSource> = scene.triangle_sources(Role::Detail).collect();
    sources.push(TriangleSource {
        object: u32::MAX,
        primitive: 0,
        triangle: 0,
    });
    for source in sources {
        if current != Some(source.object) {
            if is_flat(&object) {
                out.append(&mut object);
            }
            object.clear();
            current = Some(source.object);
        }
        if source.object != u32::MAX {
            object.push(scene.world_triangle(source));
        }
    }
    out
}

fn is_flat(triangles: &[Triangle]) -> bool {
    if triangles.is_empty() {
        return false;
    }
    let n = thin_direction(triangles);
    let points = || triangles.iter().flatten();
    let extent = |d: DVec3| {
        let (lo, hi) = points().fold((f64::MAX, f64::MIN), |(lo, hi), p| {
            let t = d.dot(*p);
            (lo.min(t), hi.max(t))
        });
        hi - lo
    };
    let thickness = extent(n);
    // The two other extents along the horizontal and the vertical of the plate.
    let level = if n.y.abs() > 0.7 { DVec3::X } else { DVec3::Y };
    let u = (level - n * n.dot(level)).normalize();
    let (a, b) = (extent(u), extent(n.cross(u)));
    let least = a.min(b);
    thickness < MAX_THICKNESS && least > MIN_EXTENT && least > MIN_FLATNESS * thickness
}

/// The direction that most of the surface faces, up to sign.
fn thin_direction(triangles: &[Triangle]) -> DVec3 {
    let mut clusters: Vec<(DVec3, f64)> = Vec::new();
    for t in triangles {
        let n = triangle_area_normal(t);
        let area = n.length();
        if area < 1e-12 {
            continue;
        }
        let n = n / area;
        if let Some((_, a)) = clusters.iter_mut().find(|(m, _)| m.dot(n).abs() > 0.98) {
            *a += area;
        } else if clusters.len() < 64 {
            clusters.push((n, area));
        }
    }
    clusters
        .iter()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(DVec3::Y, |c| c.0)
}

/// Labels the voxels that only closures fill: they were walls to the flood but are air. The basins
/// on both sides grow into them at the same pace and meet in the middle of the leaf or pane.
pub fn flood_closures(dims: [usize; 3], labels: &mut Labels, occupied: &BitVolume) {
    match labels {
        Labels::U16(v) => grow(dims, v, occupied),
        Labels::U32(v) => grow(dims, v, occupied),
    }
}

fn grow<T: Copy + Default + PartialEq>(dims: [usize; 3], labels: &mut [T], occupied: &BitVolume) {
    let [nx, ny, nz] = dims;
    let layer = nx * ny;
    let each_neighbor = |i: usize, visit: &mut dyn FnMut(usize)| {
        let (x, y, z) = (i % nx, i / nx % ny, i / layer);
        for (exists, next) in [
            (x > 0, i.wrapping_sub(1)),
            (x + 1 < nx, i + 1),
            (y > 0, i.wrapping_sub(nx)),
            (y + 1 < ny, i + nx),
            (z > 0, i.wrapping_sub(layer)),
            (z + 1 < nz, i + layer),
        ] {
            if exists {
                visit(next);
            }
        }
    };
    let solid = T::default();
    // First round: air voxels without a label that touch a labelled one, in index order.
    let mut front: Vec<(usize, T)> = Vec::new();
    for i in 0..labels.len() {
        if labels[i] == solid && !occupied.get_index(i) {
            let mut first = None;
            each_neighbor(i, &mut |j| {
                if first.is_none() && labels[j] != solid {
                    first = Some(labels[j]);
                }
            });
            if let Some(l) = first {
                front.push((i, l));
            }
        }
    }
    while !front.is_empty() {
        for &(i, l) in &front {
            labels[i] = l;
        }
        let mut next: Vec<(usize, T)> = Vec::new();
        for &(i, l) in &front {
            each_neighbor(i, &mut |j| {
                if labels[j] == solid && !occupied.get_index(j) {
                    next.push((j, l));
                }
            });
        }
        next.sort_by_key(|e| e.0);
        next.dedup_by_key(|e| e.0);
        front = next;
    }
}

/// World box of triangles; empty for none.
#[must_use]
pub fn bounds_of(triangles: &[Triangle]) -> Aabb {
    triangles
        .iter()
        .flatten()
        .fold(Aabb::EMPTY, |b, &p| b.including(p))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn box_triangles(size: DVec3) -> Vec<Triangle> {
        let corner = |i: usize| {
            DVec3::new(
                if i & 1 == 0 { 0.0 } else { size.x },
                if i & 2 == 0 { 0.0 } else { size.y },
                if i & 4 == 0 { 0.0 } else { size.z },
            )
        };
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        quads
            .iter()
            .flat_map(|q| {
                let p = q.map(corner);
                [[p[0], p[1], p[2]], [p[0], p[2], p[3]]]
            })
            .collect()
    }

    #[test]
    fn a_door_leaf_is_flat_and_a_wardrobe_is_not() {
        assert!(is_flat(&box_triangles(DVec3::new(0.9, 2.0, 0.04))));
        assert!(!is_flat(&box_triangles(DVec3::new(0.9, 2.0, 0.6))));
        assert!(!is_flat(&box_triangles(DVec3::new(0.05, 2.0, 0.04))));
    }
}
