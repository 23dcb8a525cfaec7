//! A canonical order of the entities of a map, their brushes and sides, whatever their order in the file. Order
//! matters because brushes share vertices, hide each other's faces in turn, and entities are numbered.

use std::cmp::Ordering;

use crate::order::all;

use super::parse::{Brush, Patch, RawEntity, Side};

/// Sorts the world first, other entities by their properties, then by their brushes and patches.
pub(super) fn sort(entities: &mut [RawEntity<'_>]) {
    for entity in entities.iter_mut() {
        for brush in &mut entity.brushes {
            brush.sides.sort_by(sides);
        }
        entity.brushes.sort_by(brushes);
        entity.patches.sort_by(patches);
    }
    let is_world = |e: &RawEntity<'_>| e.get("classname") == Some("worldspawn");
    entities.sort_by(|a, b| {
        (!is_world(a), &a.properties)
            .cmp(&(!is_world(b), &b.properties))
            .then_with(|| all(&a.brushes, &b.brushes, brushes))
            .then_with(|| all(&a.patches, &b.patches, patches))
    });
}

fn points(a: &[[f64; 3]], b: &[[f64; 3]]) -> Ordering {
    all(a, b, |a, b| all(a, b, f64::total_cmp))
}

fn sides(a: &Side<'_>, b: &Side<'_>) -> Ordering {
    let other = || (a.texture, a.is_detail).cmp(&(b.texture, b.is_detail));
    points(&a.points, &b.points).then_with(other)
}

fn brushes(a: &Brush<'_>, b: &Brush<'_>) -> Ordering {
    all(&a.sides, &b.sides, sides)
}

fn patches(a: &Patch<'_>, b: &Patch<'_>) -> Ordering {
    (a.size, a.n_segments, a.texture)
        .cmp(&(b.size, b.n_segments, b.texture))
        .then_with(|| points(&a.controls, &b.controls))
}
