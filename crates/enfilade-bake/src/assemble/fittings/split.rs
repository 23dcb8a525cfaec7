//! Splits leaves off as objects of their own.

use std::collections::HashMap;

use enfilade_cpg::World;
use enfilade_geom::scene::Mesh;

use super::{Hung, Object, triangles_of};
use crate::subset::subset_of;

/// Part number of the rest of an object after its leaves are split off.
const REST: u32 = u32::MAX;

/// Splits leaves off their objects; returns the index of the detail that each leaf becomes.
///
/// If an object consists of leaves only, it becomes the first of them. Objects that share a mesh and are divided alike
/// share the new meshes.
pub(super) fn take_out(world: &mut World, objects: &[Object], hung: &[Hung]) -> Vec<u32> {
    let mut numbers = vec![0; hung.len()];
    let mut of_object: Vec<Vec<usize>> = vec![Vec::new(); objects.len()];
    for (h, leaf) in hung.iter().enumerate() {
        of_object[leaf.object as usize].push(h);
    }
    let mut known: HashMap<(u32, Vec<u32>), Vec<u32>> = HashMap::new();
    for (object, leaves) in objects.iter().zip(&of_object) {
        if leaves.is_empty() {
            continue;
        }
        let mut part_of_shell = vec![REST; object.bounds.len()];
        for (k, &h) in (0..).zip(leaves) {
            for &s in &hung[h].leaf.shells {
                part_of_shell[s as usize] = k;
            }
        }
        let mut parts: Vec<u32> = (object.shells.iter())
            .map(|&s| part_of_shell[s as usize])
            .collect();
        if !parts.contains(&REST) {
            // The first leaf takes the object's place.
            numbers[leaves[0]] = object.detail;
            for p in &mut parts {
                *p = if *p == 0 { REST } else { *p };
            }
        }
        let taken: Vec<u32> = (0..leaves.len() as u32)
            .filter(|k| parts.contains(k))
            .collect();
        if taken.is_empty() {
            continue;
        }
        let whole = world.details[object.detail as usize].clone();
        let meshes = known
            .entry((whole.mesh, parts))
            .or_insert_with_key(|(mesh, parts)| {
                let mesh = world.detail_meshes[*mesh as usize].clone();
                let all = [REST].iter().chain(&taken);
                all.map(|&part| {
                    world.detail_meshes.push(part_mesh(&mesh, parts, part));
                    world.detail_meshes.len() as u32 - 1
                })
                .collect()
            });
        let meshes = meshes.clone();
        world.details[object.detail as usize].mesh = meshes[0];
        for (&k, &mesh) in taken.iter().zip(&meshes[1..]) {
            let mut part = whole.clone();
            part.mesh = mesh;
            part.part_of = Some(object.detail);
            part.name = if taken.len() > 1 {
                format!("{} leaf {}", whole.name, k + 1)
            } else {
                format!("{} leaf", whole.name)
            };
            let part_name = part.name.trim_start().to_owned();
            part.name = part_name;
            numbers[leaves[k as usize]] = world.details.len() as u32;
            world.details.push(part);
        }
        relist(world, object.detail, taken.len());
    }
    drop_unused_meshes(world);
    numbers
}

/// Returns the triangles of one part, with the vertices that they use.
fn part_mesh(mesh: &Mesh, parts: &[u32], part: u32) -> Mesh {
    let mut first = 0;
    let mut primitives = Vec::new();
    for p in &mesh.primitives {
        let n = p.indices.len() / 3;
        let of = &parts[first..first + n];
        first += n;
        let indices: Vec<u32> = (p.triples().iter().zip(of))
            .filter(|(_, of)| **of == part)
            .flat_map(|(t, _)| *t)
            .collect();
        if !indices.is_empty() {
            primitives.push(subset_of(p, &indices));
        }
    }
    Mesh {
        primitives,
        ..mesh.clone()
    }
}

/// Recomputes the cells of a detail and of the parts just split off it.
fn relist(world: &mut World, detail: u32, n_parts: usize) {
    let last = world.details.len();
    let before = world.details[detail as usize].cells.clone();
    let n_triangles = |world: &World, d: usize| {
        let mesh = &world.detail_meshes[world.details[d].mesh as usize];
        mesh.primitives
            .iter()
            .map(|p| p.indices.len() / 3)
            .sum::<usize>() as u32
    };
    let all: Vec<usize> = [detail as usize]
        .into_iter()
        .chain(last - n_parts..last)
        .collect();
    let n_whole: u32 = all.iter().map(|&d| n_triangles(world, d)).sum();
    for c in &before {
        world.graph[*c].n_detail_triangles -= n_whole;
    }
    for d in all {
        let mut cells = Vec::new();
        for t in triangles_of(world, &world.details[d]) {
            world.graph.locator.cells_touching(&t, &mut cells);
        }
        if cells.is_empty() {
            // Buried in solid matter: keep the cells of the whole.
            cells.clone_from(&before);
        }
        let n = n_triangles(world, d);
        for c in &cells {
            world.graph[*c].n_detail_triangles += n;
        }
        world.details[d].cells = cells;
    }
}

fn drop_unused_meshes(world: &mut World) {
    let mut number = vec![None; world.detail_meshes.len()];
    for d in &world.details {
        number[d.mesh as usize] = Some(0);
    }
    for (n, slot) in (0..).zip(number.iter_mut().flatten()) {
        *slot = n;
    }
    let mut is_used = number.iter().map(Option::is_some);
    world.detail_meshes.retain(|_| is_used.next() == Some(true));
    for d in &mut world.details {
        d.mesh = number[d.mesh as usize].unwrap_or_default();
    }
}
