//! Changes between a world and the new scene.
//!
//! Structural triangles are compared to the bit: a world has those that it was baked from. Details may be divided into leaves and
//! frames in a world, so their triangles are compared, and those that can bear on a portal count as changes: everything near an
//! opening, and new objects that are flat enough to close one.

use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};

use enfilade_cpg::World;
use enfilade_geom::poly::{Poly, cut_out, is_larger};
use enfilade_geom::scene::{Mesh, Object, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DVec3, Plane, Triangle, plane_tolerance, triangle_area_normal};

use crate::structure::{SceneStructure, plates};

/// Distance from a portal within which details may have to do with it. [Units: wu]
const BESIDE: f64 = 0.5;

/// Most pairs of triangles that are compared.
const MOST_PAIRS: usize = 4_000_000;
/// Narrower parts of a surface that are new or gone are rounding: vertices on the edges of others. [Units: wu]
const SLIVER: f64 = 1e-4;

/// No batch of the old world has this triangle.
pub(super) const NEW: u32 = u32::MAX;

/// Changes of a scene.
pub(super) struct Diff {
    /// For each structural triangle of the new scene, the batch of the old world that has it, or [`NEW`].
    pub(super) batch_of: Vec<u32>,
    /// Structural triangles that are gone.
    pub(super) removed: Vec<Triangle>,
    /// For each object of the new scene, the same detail of the old world, if there is one.
    pub(super) detail_of: Vec<Option<u32>>,
    /// Boxes of the changes, in scene coordinates.
    pub(super) boxes: Vec<Aabb>,
}

impl Diff {
    /// Compares a world with a scene. Linear in triangles; details are compared with all portals.
    pub(super) fn of(old: &World, structure: &SceneStructure<'_>) -> Self {
        let mut known: HashMap<[u32; 9], Vec<u32>> = HashMap::new();
        for (b, batch) in (0..).zip(&old.batches).filter(|(_, batch)| !batch.is_seal) {
            for triangle in batch.primitive.triangles() {
                known.entry(bits(&triangle)).or_default().push(b);
            }
        }
        let mut added = Vec::new();
        let batch_of = structure.triangles.iter().map(|t| {
            let found = known.get_mut(&bits(t)).and_then(Vec::pop);
            if found.is_none() {
                added.push(*t);
            }
            found.unwrap_or(NEW)
        });
        let batch_of: Vec<u32> = batch_of.collect();
        let mut removed: Vec<([u32; 9], usize)> = known
            .into_iter()
            .map(|(bits, batches)| (bits, batches.len()))
            .filter(|(_, n)| *n > 0)
            .collect();
        removed.sort_unstable();
        let removed: Vec<Triangle> = removed.iter().map(|(b, _)| triangle(b)).collect();
        let eps = plane_tolerance(old.graph.locator.bounds.extent());
        let mut boxes = uncovered(&added, &removed, eps);
        boxes.extend(uncovered(&removed, &added, eps));
        let detail_of = same_details(old, structure.scene);
        add_details(old, structure.scene, &detail_of, &mut boxes);
        Self {
            batch_of,
            removed,
            detail_of,
            boxes,
        }
    }

    /// Returns the number of structural triangles that the world and the scene have in common.
    pub(super) fn n_common(&self) -> usize {
        self.batch_of.iter().filter(|&&b| b != NEW).count()
    }
}

/// Returns boxes around what of some triangles no other triangle in the same plane covers from the same side: a wall in which a
/// door is cut has other triangles, but most of its surface is as it was. Quadratic in those in one plane, within [`MOST_PAIRS`].
fn uncovered(of: &[Triangle], by: &[Triangle], eps: f64) -> Vec<Aabb> {
    if of.len().saturating_mul(by.len()) > MOST_PAIRS {
        return of.iter().map(Aabb::of_points).collect();
    }
    let mut boxes = Vec::new();
    for t in of {
        let Some(normal) = triangle_area_normal(t).try_normalize() else {
            continue;
        };
        let plane = Plane::through(t[0], normal);
        let mut rest: Vec<Poly> = vec![Poly::from_slice(t)];
        for cover in by {
            let lies_in = |p: &DVec3| plane.signed_distance(*p).abs() <= eps;
            if rest.is_empty()
                || !cover.iter().all(lies_in)
                || triangle_area_normal(cover).dot(normal) <= 0.0
            {
                continue;
            }
            let mut outside = Vec::new();
            for part in &rest {
                cut_out(part, cover, normal, eps, eps, &mut outside);
            }
            rest = outside;
        }
        rest.retain(|part| is_larger(part, SLIVER * SLIVER, SLIVER));
        boxes.extend(rest.iter().map(Aabb::of_points));
    }
    boxes
}

fn bits(t: &Triangle) -> [u32; 9] {
    std::array::from_fn(|i| (t[i / 3][i % 3] as f32).to_bits())
}

fn triangle(bits: &[u32; 9]) -> Triangle {
    let at = |i: usize| f64::from(f32::from_bits(bits[i]));
    [0, 3, 6].map(|i| DVec3::new(at(i), at(i + 1), at(i + 2)))
}

/// Returns for each object of a scene the detail of a world with the same name, place and mesh.
fn same_details(old: &World, scene: &Scene) -> Vec<Option<u32>> {
    let of_meshes = |meshes: &[Mesh]| -> Vec<u64> { meshes.iter().map(hash_of).collect() };
    let [old_meshes, meshes] = [of_meshes(&old.detail_meshes), of_meshes(&scene.meshes)];
    let mut known: HashMap<(&str, [u32; 16], u64), Vec<u32>> = HashMap::new();
    for (d, detail) in old.details.iter().enumerate().rev() {
        let key = (
            &detail.name[..],
            detail.transform.map(f32::to_bits),
            old_meshes[detail.mesh as usize],
        );
        known.entry(key).or_default().push(d as u32);
    }
    let mut out = vec![None; scene.objects.len()];
    for (found, o) in out.iter_mut().zip(&scene.objects) {
        let transform = o.transform.to_cols_array().map(|v| (v as f32).to_bits());
        let key = (&o.name[..], transform, meshes[o.mesh as usize]);
        if o.role == Role::Detail {
            *found = known.get_mut(&key).and_then(Vec::pop);
        }
    }
    out
}

/// Returns a hash of the triangles of a mesh.
fn hash_of(mesh: &Mesh) -> u64 {
    let mut hasher = DefaultHasher::new();
    for primitive in &mesh.primitives {
        primitive.indices.hash(&mut hasher);
        for p in &primitive.positions {
            p.map(f32::to_bits).hash(&mut hasher);
        }
    }
    hasher.finish()
}

/// Adds the boxes of changed details that can bear on portals.
fn add_details(old: &World, scene: &Scene, detail_of: &[Option<u32>], boxes: &mut Vec<Aabb>) {
    let same: HashSet<u32> = detail_of.iter().copied().flatten().collect();
    // For each triangle of the others, by its bits, how often the old world has it.
    let mut known: HashMap<[u64; 9], i64> = HashMap::new();
    for (_, detail) in (0..).zip(&old.details).filter(|(d, _)| !same.contains(d)) {
        let mesh = &old.detail_meshes[detail.mesh as usize];
        for primitive in &mesh.primitives {
            for t in primitive.placed_triangles(detail.placement()) {
                *known.entry(bits_as_placed(&t)).or_default() += 1;
            }
        }
    }
    let openings: Vec<Aabb> = (old.graph.portals.iter())
        .map(|p| {
            let points = p.outline.iter();
            points.fold(Aabb::EMPTY, |b, p| {
                b.including(DVec3::from(p.map(f64::from)))
            })
        })
        .map(|b| b.expanded(BESIDE))
        .collect();
    let is_beside = |b: &Aabb| openings.iter().any(|opening| opening.overlaps(b));
    let mut changed: Vec<Triangle> = Vec::new();
    let is_new = |o: &Object, same: &Option<u32>| o.role == Role::Detail && same.is_none();
    let objects = scene.objects.iter().zip(detail_of);
    for (object, _) in objects.filter(|(o, same)| is_new(o, same)) {
        // A world has transforms as `f32`.
        let placed = DMat4::from_cols_array(
            &object
                .transform
                .to_cols_array()
                .map(|v| f64::from(v as f32)),
        );
        let first = changed.len();
        for primitive in &scene.meshes[object.mesh as usize].primitives {
            for t in primitive.placed_triangles(placed) {
                let left = known.entry(bits_as_placed(&t)).or_default();
                *left -= 1;
                if *left < 0 {
                    changed.push(t);
                }
            }
        }
        let b = Aabb::of_points(changed[first..].as_flattened());
        if !b.is_empty() && (object.filling.is_some() || is_beside(&b)) {
            boxes.push(b);
        }
    }
    let plates = (!changed.is_empty()).then(|| plates(scene));
    for plate in plates.into_iter().flatten() {
        let b = plate.aabb;
        let lies_in = |t: &Triangle| Aabb::of_points(t).overlaps(&b);
        if changed.iter().any(lies_in) {
            boxes.push(b);
        }
    }
    // Everything that is gone and was beside an opening.
    for (bits, _) in known.into_iter().filter(|(_, n)| *n > 0) {
        let at = |i: usize| f64::from_bits(bits[i]);
        let points = [0, 3, 6].map(|i| DVec3::new(at(i), at(i + 1), at(i + 2)));
        let b = Aabb::of_points(&points);
        if is_beside(&b) {
            boxes.push(b);
        }
    }
}

fn bits_as_placed(t: &Triangle) -> [u64; 9] {
    std::array::from_fn(|i| t[i / 3][i % 3].to_bits())
}
