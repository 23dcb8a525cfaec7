//! Rooms written into the IFC file that they were found in: as spaces with bodies, quantities and boundaries.
//!
//! The file keeps every statement; new ones stand behind the last (`step` and `model` read no more than that takes, `written` makes them). A
//! space has the polygons of its room's boundary, and one `IfcRelSpaceBoundary` for each surface, which names the wall, slab, door or
//! window by its GlobalId. Coordinates are those of the file, in its unit: the world's +Y up turned to +Z, from the world's origin.
//! **Complexity:** O(bytes + surfaces), beside that of [`room_surfaces`].

mod model;
mod step;
mod told;
mod written;

use std::collections::{BTreeSet, HashMap};

use enfilade_cpg::{CellId, World};

use crate::surfaces::{SurfaceLevel, SurfaceOptions, flat_openings, room_surfaces};
use model::{Model, is_layer, representations};
use step::{Statement, StepFile, text_of};
use written::IfcWriter;

pub use told::{IfcError, IfcOptions, IfcSpaces};

/// Returns an IFC file with the rooms of the world that was baked from it. The world must be valid.
///
/// # Errors
///
/// If it is not an IFC file, or another one, or if there is nothing to write.
pub fn ifc_with_spaces(
    world: &World,
    ifc: &[u8],
    options: &IfcOptions,
) -> Result<IfcSpaces, IfcError> {
    if world.graph.rooms().next().is_none() {
        return Err(IfcError::NoRooms);
    }
    let model = Model::read(ifc)?;
    if !world.sources.iter().any(|s| model.is_object(&s.name)) {
        return Err(IfcError::OtherFile);
    }
    let known = spaces_of_rooms(world, &model);
    let replaced: BTreeSet<u64> = known
        .values()
        .filter_map(|spaces| match spaces.as_slice() {
            // A room in which the file has several spaces keeps them.
            &[space] if options.replaces_spaces => Some(space),
            _ => None,
        })
        .collect();
    let bodies = room_surfaces(
        world,
        &SurfaceOptions {
            level: SurfaceLevel::First,
            by_object: false,
            ..flat_openings()
        },
    );
    let boundaries = room_surfaces(
        world,
        &SurfaceOptions {
            level: options.level,
            ..flat_openings()
        },
    );
    let mut writer = IfcWriter::new(world, &model, options);
    let mut rooms = Vec::new();
    for (body, surfaces) in bodies.iter().zip(&boundaries) {
        if !world.graph[body.cell].is_room() {
            continue;
        }
        match known.get(&body.cell).map(Vec::as_slice) {
            None => rooms.push((writer.space(body, None), surfaces)),
            Some(&[space]) if replaced.contains(&space) => {
                rooms.push((writer.space(body, Some(space)), surfaces));
            }
            Some(_) => {}
        }
    }
    writer.aggregate();
    writer.boundaries(&rooms);
    let n_spaces = model.file.of_class("IFCSPACE").count();
    let mut out = writer.finish(ifc, &removed(&model, &replaced));
    out.n_replaced = replaced.len();
    out.n_kept = n_spaces - replaced.len();
    out.n_added = rooms.len() - replaced.len();
    Ok(out)
}

/// Returns the spaces of the file after which rooms are named: several where the room holds several.
fn spaces_of_rooms(world: &World, model: &Model<'_>) -> HashMap<CellId, Vec<u64>> {
    let mut by_name: HashMap<&str, Vec<CellId>> = HashMap::new();
    for (cell, room) in world.graph.rooms() {
        for name in room.name.split(" / ") {
            by_name.entry(name).or_default().push(cell);
        }
    }
    let mut found: HashMap<CellId, Vec<u64>> = HashMap::new();
    for space in model.file.of_class("IFCSPACE") {
        let attributes = model.file.attributes(space);
        let text = |i: usize| {
            attributes
                .get(i)
                .and_then(|t| text_of(t))
                .unwrap_or_default()
        };
        let (number, name) = (text(2), text(7));
        let both = format!("{} {}", number.trim(), name.trim());
        let called = [both.trim(), number.trim(), name.trim()];
        let cells = called.into_iter().filter_map(|n| by_name.get(n)).flatten();
        // One that has no space yet, if several are called so.
        let best = { cells }.min_by_key(|cell| found.get(cell).map_or(0, Vec::len));
        if let Some(&cell) = best {
            found.entry(cell).or_default().push(space.id);
        }
    }
    found
}

/// Returns what spaces with new bodies had before: their boundaries, with those that refer to them; quantities; bodies and
/// placements, with what nothing else refers to.
fn removed(model: &Model<'_>, replaced: &BTreeSet<u64>) -> BTreeSet<u64> {
    let mut removed = BTreeSet::new();
    if replaced.is_empty() {
        return removed;
    }
    let file = &model.file;
    let of_replaced = |text: Option<&&str>| {
        let id = text.and_then(|t| StepFile::reference(t));
        id.is_some_and(|id| replaced.contains(&id))
    };
    let boundaries = file.statements.iter();
    let boundaries = boundaries.filter(|s| s.class.starts_with("IFCRELSPACEBOUNDARY"));
    let boundaries: Vec<&Statement> = boundaries.collect();
    loop {
        let before = removed.len();
        for boundary in &boundaries {
            let attributes = file.attributes(boundary);
            let others = attributes
                .iter()
                .skip(9)
                .filter_map(|t| StepFile::reference(t));
            if of_replaced(attributes.get(4)) || { others }.any(|other| removed.contains(&other)) {
                removed.insert(boundary.id);
            }
        }
        if removed.len() == before {
            break;
        }
    }
    for relation in file.of_class("IFCRELDEFINESBYPROPERTIES") {
        let attributes = file.attributes(relation);
        let set = attributes.get(5).and_then(|t| file.target(t));
        let is_of_one = matches!(
            attributes.get(4).map(|t| StepFile::list(t)).as_deref(),
            Some([one]) if of_replaced(Some(one))
        );
        if is_of_one && set.is_some_and(|s| is_base(file, s)) {
            removed.insert(relation.id);
        }
    }
    release(file, replaced, &mut removed);
    removed
}

/// Returns `true` for the set of a space's own quantities, by its name of IFC4 or of IFC2X3.
fn is_base(file: &StepFile<'_>, set: &Statement) -> bool {
    let name = file.attributes(set).get(2).and_then(|t| text_of(t));
    let is_named = name.is_some_and(|n| n == "Qto_SpaceBaseQuantities" || n == "BaseQuantities");
    set.class == "IFCELEMENTQUANTITY" && is_named
}

/// Removes what only removed statements, and the old bodies and placements of spaces, referred to. O(bytes).
fn release(file: &StepFile<'_>, replaced: &BTreeSet<u64>, removed: &mut BTreeSet<u64>) {
    let mut counts: HashMap<u64, usize> = HashMap::new();
    for statement in &file.statements {
        for id in file.references(statement) {
            *counts.entry(id).or_default() += 1;
        }
    }
    let mut dropped: Vec<u64> = Vec::new();
    for id in removed.iter().filter_map(|&id| file.get(id)) {
        dropped.extend(file.references(id));
    }
    for space in replaced.iter().filter_map(|&id| file.get(id)) {
        let attributes = file.attributes(space);
        let old = attributes.iter().skip(5).take(2);
        dropped.extend(old.filter_map(|t| StepFile::reference(t)));
        // Layers get the new body.
        let bodies = representations(file, space);
        for layer in file.statements.iter().filter(|s| is_layer(s)) {
            let items = file.references(layer).into_iter();
            dropped.extend(items.filter(|id| bodies.contains(id)));
        }
    }
    while let Some(id) = dropped.pop() {
        let Some(left) = counts.get_mut(&id) else {
            continue;
        };
        *left = left.saturating_sub(1);
        // A GlobalId, but for sets of quantities, stands for itself.
        let statement = file.get(id).filter(|_| *left == 0);
        let is_own = |s: &Statement| {
            let first = file.attributes(s).first().copied().unwrap_or_default();
            s.class != "IFCELEMENTQUANTITY" && first.len() == 24 && first.starts_with('\'')
        };
        if let Some(statement) = statement.filter(|s| !is_own(s))
            && removed.insert(id)
        {
            dropped.extend(file.references(statement));
        }
    }
}
