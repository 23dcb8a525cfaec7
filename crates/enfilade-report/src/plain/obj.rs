//! The surfaces as OBJ, for programs that build navigation meshes.
//!
//! Each triangle is written once, in the groups of all cells that see it (`g cell-1 cell-2`). Door leaves are left out, so
//! that doorways can be walked through. Vertices are shared within a batch only.

use std::collections::BTreeSet;
use std::fmt::Write;

use enfilade_cpg::{CellId, CellPortalGraph, FittingPart, World};
use enfilade_geom::DVec3;
use enfilade_geom::scene::Primitive;

/// Returns all structural triangles, seals included, and all detail objects but door leaves.
#[must_use]
pub fn surfaces_obj(world: &World) -> String {
    let graph = &world.graph;
    let mut out = String::from("# meters, +Y up, right-handed\n");
    let mut n_vertices = 0;
    for batch in &world.batches {
        group(&mut out, graph, &batch.cells);
        add(&mut out, &mut n_vertices, &batch.primitive, |p| p);
    }
    let fittings = graph.portals.iter().flat_map(|p| &p.fittings);
    let leaves = fittings.filter(|f| f.part == FittingPart::Leaf);
    let leaves: BTreeSet<u32> = leaves.map(|f| f.detail).collect();
    for (id, detail) in (0..).zip(&world.details) {
        if leaves.contains(&id) {
            continue;
        }
        group(&mut out, graph, &detail.cells);
        let placement = detail.placement();
        for primitive in &world.detail_meshes[detail.mesh as usize].primitives {
            add(&mut out, &mut n_vertices, primitive, |p| {
                placement.transform_point3(p)
            });
        }
    }
    out
}

fn group(out: &mut String, graph: &CellPortalGraph, cells: &[CellId]) {
    out.push('g');
    if cells.is_empty() {
        out.push_str(" unseen");
    }
    for &c in cells {
        // Blanks part the names of groups.
        let name = graph[c]
            .name
            .replace(|c: char| c.is_whitespace() || c.is_control(), "_");
        let _ = write!(out, " {name}");
    }
    out.push('\n');
}

fn add(
    out: &mut String,
    n_vertices: &mut usize,
    primitive: &Primitive,
    place: impl Fn(DVec3) -> DVec3,
) {
    for p in &primitive.positions {
        let [x, y, z] = place(DVec3::from(p.map(f64::from))).as_vec3().to_array();
        let _ = writeln!(out, "v {x} {y} {z}");
    }
    // Numbers begin with 1.
    for t in primitive.indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| *n_vertices + i as usize + 1);
        let _ = writeln!(out, "f {a} {b} {c}");
    }
    *n_vertices += primitive.positions.len();
}
