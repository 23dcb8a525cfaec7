//! Leaves out what only all objects together show to be no part of the scene: skies, and copies of other objects.

use enfilade_geom::scene::Scene;
use enfilade_prepare::{collision_copies, lower_levels, skies};

use crate::ImportReport;

/// Removes coarser levels of detail, then skies, but for objects that the caller's rules keep as structure.
pub(crate) fn leave_out(scene: &mut Scene, report: &mut ImportReport) {
    let of_levels = lower_levels(scene);
    remove(
        scene,
        &of_levels,
        report,
        "a coarser level of detail beside a finer one",
    );
    let of_collision = collision_copies(scene);
    remove(
        scene,
        &of_collision,
        report,
        "a collision shape beside what it is a copy of",
    );
    // The sky of a map is a side of its brushes.
    if scene.solids.is_empty() {
        let of_sky = skies(scene);
        remove(
            scene,
            &of_sky,
            report,
            "a sky: it is around everything else and touches nothing",
        );
    }
}

/// Removes objects, ascending, and reports them.
fn remove(scene: &mut Scene, objects: &[usize], report: &mut ImportReport, reason: &str) {
    let is_kept = |i: usize| scene.objects[i].reason.starts_with("rule: structural");
    let gone: Vec<usize> = objects.iter().copied().filter(|&i| !is_kept(i)).collect();
    if gone.is_empty() {
        return;
    }
    let mut number = 0;
    let mut becomes = Vec::with_capacity(scene.objects.len());
    for i in 0..scene.objects.len() {
        let stays = gone.binary_search(&i).is_err();
        becomes.push(stays.then_some(number));
        number += u32::from(stays);
    }
    for &i in &gone {
        report.leave_out(reason, &scene.objects[i].name, 1);
    }
    let mut stays = becomes.iter();
    scene
        .objects
        .retain(|_| stays.next().is_some_and(Option::is_some));
    for entity in &mut scene.entities {
        entity.object = entity.object.and_then(|o| becomes[o as usize]);
    }
}
