//! Removes triangles without area and duplicates.

use std::collections::{HashMap, HashSet};

use super::surface::{Face, Surface};
use super::weld::ONE_POINT;

/// Removes triangles of which two vertices are one point, and returns their number. Linear.
///
/// Their edges pair up, so that nothing opens.
pub(super) fn drop_collapsed(surface: &mut Surface) -> u64 {
    let is_gone: Vec<bool> = (0..surface.faces.len())
        .map(|f| {
            let [a, b, c] = surface.ends(f);
            a == b || b == c || c == a
        })
        .collect();
    surface.remove(&is_gone)
}

/// Removes triangles lower than [`ONE_POINT`] with three distinct points, and returns their number.
///
/// The vertex opposite the longest edge lies on that edge. Other triangles at the edge are cut there, so that nothing
/// opens (the cap of Botsch & Kobbelt 2001, removed by a cut). `n log n`.
pub(super) fn drop_caps(surface: &mut Surface) -> u64 {
    let mut is_gone = vec![false; surface.faces.len()];
    let mut cuts: HashMap<[u32; 2], u32> = HashMap::new();
    for (face, gone) in is_gone.iter_mut().enumerate() {
        let (height, apex) = surface.height(face);
        if height > ONE_POINT {
            continue;
        }
        let ends = surface.ends(face);
        let (a, b) = (ends[(apex + 1) % 3], ends[(apex + 2) % 3]);
        // One cap per edge; the next pass takes the others.
        let cut = cuts.entry([a.min(b), a.max(b)]).or_insert(ends[apex]);
        *gone = *cut == ends[apex];
    }
    if cuts.is_empty() {
        return 0;
    }
    let mut made: Vec<Face> = Vec::new();
    let mut is_replaced = is_gone.clone();
    for face in 0..surface.faces.len() {
        let ends = surface.ends(face);
        let cut = (0..3).find_map(|k| {
            let (a, b) = (ends[k], ends[(k + 1) % 3]);
            let point = *cuts.get(&[a.min(b), a.max(b)])?;
            (point != ends[(k + 2) % 3]).then_some((k, point))
        });
        if let (false, Some((k, point))) = (is_gone[face], cut) {
            made.extend(cut_face(surface, surface.faces[face], k, point));
            is_replaced[face] = true;
        }
    }
    let n = is_gone.iter().filter(|g| **g).count();
    surface.remove(&is_replaced);
    surface.faces.extend(made);
    n as u64
}

/// Returns the two parts of a face whose edge from vertex `k` is cut at a point on it.
pub(super) fn cut_face(surface: &mut Surface, face: Face, k: usize, point: u32) -> [Face; 2] {
    let [a, b, c] = [0, 1, 2].map(|i| face.corners[(k + i) % 3]);
    let part = &surface.parts[face.part as usize];
    let [from, to] = [a, b].map(|v| surface.points[part.points[v as usize] as usize]);
    let along = to - from;
    let share = (surface.points[point as usize] - from).dot(along) / along.length_squared();
    let middle = surface.mix(face.part, [a, b], share.clamp(0.0, 1.0), point);
    let part = face.part;
    [[a, middle, c], [middle, b, c]].map(|corners| Face { part, corners })
}

/// Returns the vertices in ascending order, and `true` if the face traverses them so.
fn key([a, b, c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut sorted = [a, b, c];
    sorted.sort_unstable();
    let [x, y, _] = sorted;
    let is_forward = [[a, b], [b, c], [c, a]].contains(&[x, y]);
    (sorted, is_forward)
}

/// Removes duplicate triangles and returns their number. `n log n`.
///
/// Duplicates are: triangles of one object with the same vertices and winding; all triangles of an object that equals
/// an earlier one; and, of two with the same vertices and opposite windings, the one that disagrees with its
/// neighbors, if each edge has just one neighbor. So sheets with a triangle for either side keep both, and solids
/// that touch keep their sides.
pub(super) fn drop_duplicates(surface: &mut Surface) -> u64 {
    let n = surface.faces.len();
    let mut is_gone = vec![false; n];
    let mut keys: Vec<(u32, [u32; 3], bool, u32)> = (0..n)
        .map(|f| {
            let (corners, is_forward) = key(surface.ends(f));
            (surface.object(f), corners, is_forward, f as u32)
        })
        .collect();
    keys.sort_unstable();
    for pair in keys.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        is_gone[b.3 as usize] = (a.0, a.1, a.2) == (b.0, b.1, b.2);
    }
    keys.retain(|k| !is_gone[k.3 as usize]);
    let mut seen: HashSet<Vec<([u32; 3], bool)>> = HashSet::new();
    for object in keys.chunk_by(|a, b| a.0 == b.0) {
        let shape = object.iter().map(|k| (k.1, k.2)).collect();
        if !seen.insert(shape) {
            object.iter().for_each(|k| is_gone[k.3 as usize] = true);
        }
    }
    keys.retain(|k| !is_gone[k.3 as usize]);
    drop_against(surface, &keys, &mut is_gone);
    surface.remove(&is_gone)
}

/// Marks the worse of two triangles with opposite windings in an otherwise plain surface.
fn drop_against(surface: &Surface, keys: &[(u32, [u32; 3], bool, u32)], is_gone: &mut [bool]) {
    let twins: Vec<[usize; 2]> = keys
        .windows(2)
        .filter(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1))
        .map(|w| [w[0].3 as usize, w[1].3 as usize])
        .collect();
    if twins.is_empty() {
        return;
    }
    let mut uses = surface.uses();
    uses.retain(|u| !is_gone[u.face as usize]);
    for [first, second] in twins {
        let object = surface.object(first);
        let ends = surface.ends(first);
        // Votes for the first one: neighbors that traverse their edge the other way.
        let mut votes = 0_i32;
        let is_plain = (0..3).all(|k| {
            let (a, b) = (ends[k], ends[(k + 1) % 3]);
            let edge = [a.min(b), a.max(b)];
            let start = uses.partition_point(|u| (u.ends, u.object) < (edge, object));
            let same = uses[start..]
                .iter()
                .take_while(|u| (u.ends, u.object) == (edge, object));
            let others = same.filter(|u| ![first, second].contains(&(u.face as usize)));
            let others: Vec<bool> = others.map(|u| u.is_reverse).collect();
            votes += others
                .iter()
                .map(|&r| if r == (a > b) { -1 } else { 1 })
                .sum::<i32>();
            others.len() == 1
        });
        if is_plain {
            is_gone[if votes < 0 { first } else { second }] = true;
        }
    }
}
