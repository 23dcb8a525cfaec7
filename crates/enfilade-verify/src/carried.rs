//! Data that a world carries along from its source: names, looks, lights, and the source of each triangle.

use std::collections::HashMap;

use enfilade_cpg::World;
use enfilade_geom::scene::{Material, Role, Scene};
use enfilade_geom::{Bvh, Triangle};

use crate::source::key;
use crate::subject::{structural_triangles, tolerance};

/// Most differences listed per kind.
const NAMED: usize = 5;
/// Largest move of a light or camera by rounding to `f32`. [Units: wu]
const MOVED: f64 = 1e-3;

/// Compares a world's data about its source with the source: the tree of names, materials, lights and cameras, and
/// origin and material of each structural triangle. Returns problems, a line each.
///
/// O(n log n) in triangles. `scene` must be read with the settings of the bake.
#[must_use]
pub fn compare_scene(world: &World, scene: &Scene) -> Vec<String> {
    let mut out = Vec::new();
    // A world made in code has no table of sources and claims nothing about names and lights.
    if !world.sources.is_empty() {
        compare_names(world, scene, &mut out);
        compare_fixtures(world, scene, &mut out);
    }
    compare_looks(world, scene, &mut out);
    if out.is_empty() {
        compare_triangles(world, scene, &mut out);
    }
    out
}

/// Adds at most [`NAMED`] differences, and the number of the others.
fn tell(found: impl Iterator<Item = String>, out: &mut Vec<String>) {
    let mut n = 0;
    for what in found {
        n += 1;
        if n <= NAMED {
            out.push(what);
        }
    }
    if n > NAMED {
        out.push(format!("… and {} more like these", n - NAMED));
    }
}

fn compare_names(world: &World, scene: &Scene, out: &mut Vec<String>) {
    let (own, theirs) = (&world.sources, &scene.nodes);
    if own.len() != theirs.len() {
        let (own, theirs) = (own.len(), theirs.len());
        out.push(format!(
            "the world lists {own} source nodes, the source has {theirs}"
        ));
        return;
    }
    let pairs = own.iter().zip(theirs).enumerate();
    let other = pairs.filter(|(_, (a, b))| a != b);
    let told = other.map(|(i, (a, b))| {
        format!(
            "source {i} ({}): the source has {:?} there, or other properties",
            a.name, b.name
        )
    });
    tell(told, out);
}

fn compare_looks(world: &World, scene: &Scene, out: &mut Vec<String>) {
    let (own, theirs) = (&world.materials, &scene.materials);
    if own.len() != theirs.len() {
        let (own, theirs) = (own.len(), theirs.len());
        out.push(format!(
            "the world has {own} materials, the source {theirs}"
        ));
        return;
    }
    let is_other = |(a, b): (&Material, &Material)| {
        // If the source had no glTF, the world has some that was made from the other properties.
        let is_text = b.gltf.trim().is_empty() || a.gltf.trim() == b.gltf.trim();
        let flags = |m: &Material| (m.transparent, m.double_sided);
        !is_text || a.name != b.name || flags(a) != flags(b)
    };
    let pairs = own.iter().zip(theirs).enumerate();
    let other = pairs.filter(|(_, pair)| is_other(*pair));
    let told =
        other.map(|(i, (a, _))| format!("material {i} ({}): differs from the source", a.name));
    tell(told, out);
}

fn compare_fixtures(world: &World, scene: &Scene, out: &mut Vec<String>) {
    let (own, theirs) = (&world.fixtures, &scene.fixtures);
    if own.len() != theirs.len() {
        let (own, theirs) = (own.len(), theirs.len());
        out.push(format!(
            "the world has {own} lights, cameras and places, the source {theirs}"
        ));
        return;
    }
    let pairs = own.iter().zip(theirs).enumerate();
    let other = pairs.filter(|(_, (a, b))| {
        let [a_at, b_at] = [a, b].map(|f| f.transform.to_cols_array());
        let largest = b_at.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        let mut numbers = a_at.iter().zip(b_at);
        let is_there = numbers.all(|(x, y)| (x - y).abs() <= MOVED * largest);
        a.kind != b.kind || a.name != b.name || a.gltf.trim() != b.gltf.trim() || !is_there
    });
    let told =
        other.map(|(i, (a, _))| format!("fixture {i} ({}): differs from the source", a.name));
    tell(told, out);
}

/// Source and material of a triangle.
type Origin = (Option<u32>, Option<u32>);

fn compare_triangles(world: &World, scene: &Scene, out: &mut Vec<String>) {
    let mut triangles: Vec<Triangle> = Vec::new();
    let mut origins: Vec<Origin> = Vec::new();
    let mut same: HashMap<_, Vec<u32>> = HashMap::new();
    for at in scene.triangle_sources(Role::Structural) {
        let object = &scene.objects[at.object as usize];
        let primitive = &scene.meshes[object.mesh as usize].primitives[at.primitive as usize];
        let triangle = scene.world_triangle(at);
        let number = triangles.len() as u32;
        same.entry(key(&triangle)).or_default().push(number);
        triangles.push(triangle);
        origins.push((object.node, primitive.material));
    }
    let bvh = Bvh::build(&triangles);
    let reach = 4.0 * tolerance(&bvh.bounds());
    let own = structural_triangles(world);
    let mut sources = Vec::with_capacity(own.len());
    for batch in &world.batches {
        let n = batch.primitive.indices.len() / 3;
        let known = batch.sources.of_triangles().map(Some);
        sources.extend(known.chain(std::iter::repeat(None)).take(n));
    }
    let wrong = own.iter().zip(&sources).filter_map(|(&(t, batch), &source)| {
        let batch = &world.batches[batch as usize];
        if batch.is_seal {
            return None;
        }
        // A batch without sources makes no wrong claim.
        let fits = |&(node, material): &Origin| {
            (batch.sources.is_empty() || node == source) && material == batch.primitive.material
        };
        let mut is_met = false;
        let mut is_one = |number: u32| {
            is_met = true;
            fits(&origins[number as usize])
        };
        let is_right = match same.get(&key(&t)) {
            Some(known) => known.iter().any(|&n| is_one(n)),
            // A piece of a triangle lies on it.
            None => {
                let middle = (t[0] + t[1] + t[2]) / 3.0;
                let mut found = false;
                let _ = bvh.for_each_around_segment(middle, middle, reach, |number, on| {
                    let normal = (on[1] - on[0]).cross(on[2] - on[0]).normalize_or_zero();
                    let is_in_plane = t.iter().all(|p| (*p - on[0]).dot(normal).abs() <= reach);
                    found |= is_in_plane && is_one(number);
                    std::ops::ControlFlow::Continue(())
                });
                found
            }
        };
        let [x, y, z] = ((t[0] + t[1] + t[2]) / 3.0).to_array();
        (!is_right && is_met).then(|| {
            let path = source.map_or_else(String::new, |s| world.source_path(s));
            format!("the triangle at {x:.3} {y:.3} {z:.3} does not come from {path:?}, or has another material")
        })
    });
    tell(wrong, out);
}
