//! Cuts edges at T-junctions, where a vertex of a neighbor lies in their middle.
//!
//! Barequet & Kumar 1997 close cracks in the same way: nothing moves, and new vertices lie only at existing ones.

use std::collections::HashMap;

use super::drop::cut_face;
use super::surface::{Face, Surface, open_of};
use crate::tjunction;

/// Cuts triangles at open edges where an end of another open edge lies within `tolerance` of their inside, and
/// returns the number of cuts. `n log n`, plus a bounded search as in the cleaning report.
///
/// A vertex of the same triangle does not cut it: nothing would be left.
pub(super) fn split_t_junctions(surface: &mut Surface, tolerance: f64) -> u64 {
    let open: Vec<[u32; 2]> = open_of(&surface.uses()).iter().map(|u| u.ends).collect();
    let mut found: HashMap<[u32; 2], Vec<(f64, u32)>> = HashMap::new();
    tjunction::for_each(&surface.points, &open, tolerance, |edge, point, along| {
        found.entry(open[edge]).or_default().push((along, point));
    });
    if found.is_empty() {
        return 0;
    }
    for points in found.values_mut() {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by_key(|p| p.1);
    }
    let mut n = 0;
    let mut made = Vec::new();
    let mut is_replaced = vec![false; surface.faces.len()];
    for (face, gone) in is_replaced.iter_mut().enumerate() {
        let pieces = cut(surface, surface.faces[face], &found);
        if pieces.len() > 1 {
            *gone = true;
            n += pieces.len() as u64 - 1;
            made.extend(pieces);
        }
    }
    surface.remove(&is_replaced);
    surface.faces.extend(made);
    n
}

/// Returns the pieces of a face; the face itself if nothing cuts it.
fn cut(
    surface: &mut Surface,
    whole: Face,
    found: &HashMap<[u32; 2], Vec<(f64, u32)>>,
) -> Vec<Face> {
    let point = |surface: &Surface, face: &Face, k: usize| {
        surface.parts[face.part as usize].points[face.corners[k % 3] as usize]
    };
    let own = [0, 1, 2].map(|k| point(surface, &whole, k));
    let mut pieces = vec![whole];
    for k in 0..3 {
        let (a, b) = (own[k], own[(k + 1) % 3]);
        let Some(cuts) = found.get(&[a.min(b), a.max(b)]) else {
            continue;
        };
        // Sorted from the lesser end; the piece at the edge's end is cut next.
        let mut cuts: Vec<u32> = cuts.iter().map(|c| c.1).collect();
        if a > b {
            cuts.reverse();
        }
        cuts.retain(|p| !own.contains(p));
        let mut from = a;
        for p in cuts {
            let at = pieces.iter().enumerate().find_map(|(i, f)| {
                let corner = (0..3)
                    .find(|&c| point(surface, f, c) == from && point(surface, f, c + 1) == b)?;
                Some((i, corner))
            });
            let Some((i, corner)) = at else { break };
            let halves = cut_face(surface, pieces[i], corner, p);
            pieces[i] = halves[0];
            pieces.push(halves[1]);
            from = p;
        }
    }
    pieces
}
