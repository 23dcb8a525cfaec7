//! Triangles, seals and details: where they are, and which cells list them.

use enfilade_cpg::World;
use enfilade_geom::{Bvh, DVec3, Ray, Triangle};

use super::{Tampering, detail, pick, stranger};

pub(super) const ALL: &[Tampering] = &[
    Tampering::new("a triangle removed", |w, at| {
        let (b, t) = triangle(w, at)?;
        cut_out(w, b, t);
        Some(())
    }),
    Tampering::new("a triangle collapsed", |w, at| {
        let (b, t) = triangle(w, at)?;
        let indices = &mut w.batches[b].primitive.indices;
        indices[t + 1] = indices[t];
        Some(())
    }),
    Tampering::new("a triangle moved to the front", |w, at| {
        moved_triangle(w, at, 0.05)
    }),
    Tampering::new("a triangle moved to the back", |w, at| {
        moved_triangle(w, at, -0.05)
    }),
    Tampering::new("a batch that lacks a cell", |w, at| {
        let (b, _) = triangle(w, at)?;
        w.batches[b].cells.remove(0);
        Some(())
    }),
    Tampering::new("a seal removed", |w, at| {
        let needed = needed_seals(w);
        let (b, t) = needed[pick(needed.len(), at, |_| true)?];
        w.batches[b].primitive.indices.drain(t..t + 3);
        forget_seals(w);
        Some(())
    }),
    Tampering::new("a batch of seals emptied", |w, at| {
        let needed = needed_seals(w);
        let of = |i: usize| needed.iter().any(|&(b, _)| b == i);
        let i = pick(w.batches.len(), at, of)?;
        w.batches[i].primitive.indices.clear();
        forget_seals(w);
        Some(())
    }),
    Tampering::new("a detail dropped from a cell", |w, at| {
        let i = detail(w, at)?;
        w.details[i].cells.clear();
        Some(())
    }),
    Tampering::new("a wrong cell of a detail", |w, at| {
        let i = detail(w, at)?;
        w.details[i].cells = vec![stranger(w, &w.details[i].cells)?];
        Some(())
    }),
    Tampering::new("a cell too many of a detail", |w, at| {
        let i = detail(w, at)?;
        let more = stranger(w, &w.details[i].cells)?;
        w.details[i].cells.push(more);
        w.details[i].cells.sort();
        Some(())
    }),
    Tampering::new("a detail moved out of its room", |w, at| {
        let i = detail(w, at)?;
        w.details[i].transform[12] += 9.0;
        Some(())
    }),
    Tampering::uncounted("a detail that disappeared", |w, at| {
        // The counts are left as they are: nothing else knows of it.
        let i = loose_detail(w, at)?;
        taken_away(w, i);
        Some(())
    }),
    Tampering::new("a detail taken away", |w, at| {
        let i = loose_detail(w, at)?;
        taken_away(w, i);
        Some(())
    }),
    Tampering::by_source("furniture moved by 0.3 m within its room", |w, at| {
        let i = loose_detail(w, at)?;
        w.details[i].transform[12] += 0.3;
        Some(())
    }),
    Tampering::by_source("furniture of another size", |w, at| {
        let i = loose_detail(w, at)?;
        for k in [0, 1, 2, 4, 5, 6, 8, 9, 10] {
            w.details[i].transform[k] *= 0.9;
        }
        Some(())
    }),
    Tampering::by_source("a detail taken away, and never counted", |w, at| {
        let i = loose_detail(w, at)?;
        let mesh = &w.detail_meshes[w.details[i].mesh as usize].primitives;
        let n: usize = mesh.iter().map(|p| p.indices.len() / 3).sum();
        taken_away(w, i);
        if let Some(all) = w.graph.statistics.counts.get_mut("input_triangles") {
            *all -= n as f64;
        }
        Some(())
    }),
];

/// Whoever takes a seal away may say so.
fn forget_seals(w: &mut World) {
    w.pvs = None;
    if let Some(n) = w.graph.statistics.counts.get_mut("seals") {
        *n = 0.0;
    }
}

/// How far a line reaches to both sides of a seal that nothing else closes. [Units: wu]
const ASIDE: f64 = 1e-3;

/// Batch and first index of the triangles of seals, of 10 cm² at least, behind whose middle nothing else closes the way: where
/// other seals or walls lie on one, to take it away opens nothing.
fn needed_seals(w: &World) -> Vec<(usize, usize)> {
    let all: Vec<(usize, usize)> = (0..w.batches.len())
        .flat_map(|b| (0..w.batches[b].primitive.indices.len() / 3).map(move |t| (b, 3 * t)))
        .collect();
    let corners: Vec<Triangle> = all.iter().map(|&at| corners_of(w, at)).collect();
    let matter = Bvh::build(&corners);
    let is_needed = |i: &usize| {
        let [x, y, z] = corners[*i];
        let normal = (y - x).cross(z - x);
        if !w.batches[all[*i].0].is_seal || normal.length() < 0.002 {
            return false;
        }
        let (middle, step) = ((x + y + z) / 3.0, normal.normalize() * ASIDE);
        let mut others = 0;
        matter.for_each_hit(&Ray::segment(middle - step, middle + step), |hit| {
            others += usize::from(hit.triangle as usize != *i);
        });
        others == 0
    };
    let needed = (0..all.len()).filter(is_needed);
    needed.map(|i| all[i]).collect()
}

/// Takes a triangle out of a batch and out of what is said of its triangles.
fn cut_out(w: &mut World, b: usize, t: usize) {
    let batch = &mut w.batches[b];
    let mut sources: Vec<u32> = batch.sources.of_triangles().collect();
    batch.primitive.indices.drain(t..t + 3);
    if !sources.is_empty() {
        sources.remove(t / 3);
    }
    let mut runs = enfilade_cpg::SourceRuns::default();
    sources.into_iter().for_each(|s| runs.push(s, 1));
    batch.sources = runs;
    w.pvs = None;
}

/// A detail in a single room that fills no opening and of which no other is a part.
pub(super) fn loose_detail(w: &World, place: usize) -> Option<usize> {
    let is_fitting = |i: usize| {
        let fittings = w.graph.portals.iter().flat_map(|p| &p.fittings);
        fittings.into_iter().any(|f| f.detail as usize == i)
    };
    let is_whole = |i: usize| {
        let mut parts = w.details.iter().filter_map(|d| d.part_of);
        parts.any(|whole| whole as usize == i)
    };
    let is_in_room = |i: usize| matches!(w.details[i].cells[..], [c] if !w.graph[c].outdoor);
    let is_loose = |&i: &usize| {
        is_in_room(i) && !is_fitting(i) && !is_whole(i) && w.details[i].part_of.is_none()
    };
    let loose: Vec<usize> = (0..w.details.len()).filter(is_loose).collect();
    pick(loose.len(), place, |_| true).map(|k| loose[k])
}

/// Removes a detail; what names others by number keeps its meaning.
fn taken_away(w: &mut World, i: usize) {
    w.details.remove(i);
    let after = |n: &mut u32| *n -= u32::from(*n as usize > i);
    w.details
        .iter_mut()
        .filter_map(|d| d.part_of.as_mut())
        .for_each(after);
    let fittings = w.graph.portals.iter_mut().flat_map(|p| &mut p.fittings);
    fittings.for_each(|f| after(&mut f.detail));
    if let Some(pvs) = &mut w.pvs {
        pvs.parts = None;
    }
}

/// Batch and first index of a triangle of the structure of at least 4 dm² that some cell sees: few of so many lines meet what is
/// smaller.
fn triangle(w: &World, place: usize) -> Option<(usize, usize)> {
    let all: Vec<(usize, usize)> = (0..w.batches.len())
        .filter(|&b| !w.batches[b].is_seal && !w.batches[b].cells.is_empty())
        .flat_map(|b| (0..w.batches[b].primitive.indices.len() / 3).map(move |t| (b, 3 * t)))
        .collect();
    let i = pick(all.len(), place, |i| normal_of(w, all[i]).length() > 0.08)?;
    Some(all[i])
}

fn corners_of(w: &World, (b, t): (usize, usize)) -> Triangle {
    let p = &w.batches[b].primitive;
    [0, 1, 2].map(|k| {
        let corner = p.positions[p.indices[t + k] as usize];
        DVec3::from(corner.map(f64::from))
    })
}

fn normal_of(w: &World, at: (usize, usize)) -> DVec3 {
    let [x, y, z] = corners_of(w, at);
    (y - x).cross(z - x)
}

fn moved_triangle(w: &mut World, place: usize, by: f64) -> Option<()> {
    let (b, t) = triangle(w, place)?;
    let to = normal_of(w, (b, t)).normalize() * by;
    let p = &mut w.batches[b].primitive;
    for k in 0..3 {
        let old = p.indices[t + k] as usize;
        let moved = DVec3::from(p.positions[old].map(f64::from)) + to;
        p.positions.push(moved.as_vec3().to_array());
        p.indices[t + k] = p.positions.len() as u32 - 1;
        p.normals.extend(p.normals.get(old).copied());
        p.tangents.extend(p.tangents.get(old).copied());
        p.colors.extend(p.colors.get(old).copied());
        for uvs in &mut p.uvs {
            uvs.extend(uvs.get(old).copied());
        }
    }
    Some(())
}
