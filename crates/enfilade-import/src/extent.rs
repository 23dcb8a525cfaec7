//! Checks of a scene's size for a wrong unit.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, DVec3, MOST_FLIGHT_PLAN, Triangle, is_flight, triangle_area_normal};
use enfilade_prepare::{Upward, find_up};

use crate::report::UpDoubt;
use crate::vox::VOX;
use crate::{FileReport, ImportError, ImportOptions, ImportReport, Up};

/// Returns the files of a report, comma separated.
pub(crate) fn paths_of(report: &ImportReport) -> String {
    let path = |f: &FileReport| f.path.display().to_string();
    report.files.iter().map(path).collect::<Vec<_>>().join(", ")
}

/// Returns an error for scenes far larger or smaller than any building, or far off the origin. Its advice is whole: the
/// axis is named with the unit, and the unit before the place, so that no second error waits behind the first.
pub(crate) fn check(
    scene: &Scene,
    report: &ImportReport,
    options: &ImportOptions,
) -> Result<(), ImportError> {
    let limits = &options.limits;
    let boxes: Vec<Aabb> = (0..scene.objects.len())
        .map(|i| scene.object_aabb(i))
        .collect();
    let has_structure = scene.objects.iter().any(|o| o.role == Role::Structural);
    // A sky dome or a landscape may have any size if it is detail.
    let counted: Vec<usize> = (0..boxes.len())
        .filter(|&i| !has_structure || scene.objects[i].role == Role::Structural)
        .collect();
    let bounds = counted.iter().fold(Aabb::EMPTY, |b, &i| b.union(boxes[i]));
    let size = bounds.size();
    let unit = options.unit.unwrap_or(1.0);
    let up = report.up_doubt.as_ref().filter(|doubt| doubt.is_clear);
    let up = up.and_then(|doubt| doubt.up);
    let and_up = up.map_or(String::new(), |up| format!(" {}", up.option()));
    let error = |bound: String, offender, advice| {
        Err(ImportError::Extent {
            paths: paths_of(report),
            size: size.to_array(),
            bound,
            offender,
            advice,
        })
    };
    let longest = size.max_element();
    // The unit of a map is known, and skies may stand anywhere.
    let is_known = !scene.solids.is_empty() && options.unit.is_none();
    if longest.is_nan() || longest > limits.max_extent && !is_known {
        let limit = limits.max_extent;
        let offender = offender(&boxes, &counted, limit).map(|i| scene.objects[i].name.clone());
        let advice = if offender.is_some() {
            "remove that object or name it detail; or, if the unit is wrong, ".to_owned()
        } else {
            String::new()
        };
        let units = plausible_units(scene, size, report);
        let factor = if longest * 0.01 > limit { 0.001 } else { 0.01 };
        let factor = if longest * 0.001 > 1.0 { 0.001 } else { factor };
        let named = match units[..] {
            [only] if options.unit.is_none() => given(&[only]),
            _ => format!("e.g. --unit {}", significant(unit * factor)),
        };
        let advice = format!("{advice}give the unit of its numbers, {named}{and_up}");
        return error(format!("larger than {limit} m"), offender, advice);
    }
    if longest < limits.min_extent {
        if longest == 0.0 {
            return error(
                format!("smaller than {} m", limits.min_extent),
                None,
                "all its vertices lie in one point; export it again".into(),
            );
        }
        let factor = if longest * 100.0 >= 2.0 {
            100.0
        } else {
            1000.0
        };
        let advice = format!(
            "give the unit of its numbers, e.g. --unit {}{and_up}",
            significant(unit * factor)
        );
        return error(
            format!("smaller than {} m", limits.min_extent),
            None,
            advice,
        );
    }
    let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
    if reach > limits.max_coordinate {
        let doubt = report.unit_doubt.as_ref();
        let units = doubt.map_or_else(Vec::new, |_| plausible_units(scene, size, report));
        let advice = nearer(bounds, &units, up, limits.max_coordinate);
        return error(
            format!(
                "and {reach:.0} m off its origin, where 32-bit numbers are too coarse \
                 (the limit is {} m)",
                limits.max_coordinate
            ),
            None,
            advice,
        );
    }
    let all = boxes.iter().fold(Aabb::EMPTY, |b, &o| b.union(o));
    let most = DVec3::splat(f32::MAX.into());
    if !(all.max.cmple(most).all() && all.min.cmpge(-most).all()) {
        return error(
            "and a detail object lies beyond what 32-bit numbers hold".into(),
            None,
            "remove it".into(),
        );
    }
    Ok(())
}

/// Returns how to bring a scene near its origin: by its unit, if that is in doubt, and by moving it.
fn nearer(bounds: Aabb, units: &[(&str, f64)], up: Option<Up>, most: f64) -> String {
    let meters = units.first().map_or(1.0, |unit| unit.1);
    let reach = meters * bounds.extent();
    let mut options = up.map_or(String::new(), |up| format!(" {}", up.option()));
    let DVec3 { x, y, z } = (bounds.center() * meters).round();
    // The middle, once the scene is turned.
    let [x, y, z] = match up {
        None => [x, y, z],
        Some(Up::Z) => [x, z, -y],
        Some(Up::Y) => [x, -z, y],
    };
    if units.is_empty() {
        return format!("move the scene to its origin, e.g. --origin {x},{y},{z}{options}");
    }
    if reach > most {
        options += &format!(" --origin {x},{y},{z}");
    }
    format!("give the unit of its numbers: {}{options}", given(units))
}

/// Rounds to six digits: short to type, and free of the residue of binary fractions.
fn significant(x: f64) -> f64 {
    format!("{x:.6e}").parse().unwrap_or(x)
}

/// Returns the one object without which the rest would fit, if there is one.
fn offender(boxes: &[Aabb], counted: &[usize], limit: f64) -> Option<usize> {
    let n = counted.len();
    if n < 2 {
        return None;
    }
    let mut after = vec![Aabb::EMPTY; n + 1];
    for k in (0..n).rev() {
        after[k] = after[k + 1].union(boxes[counted[k]]);
    }
    let mut before = Aabb::EMPTY;
    for k in 0..n {
        let rest = before.union(after[k + 1]);
        if rest.size().max_element() <= limit {
            return Some(counted[k]);
        }
        before = before.union(boxes[counted[k]]);
    }
    None
}

/// Longest plausible shortest edge of a scene in meters: few buildings are as high, wide and long. [Units: wu]
const TALL: f64 = 60.0;

/// Units that the numbers may be in, in meters.
const UNITS: [(&str, f64); 3] = [("mm", 0.001), ("cm", 0.01), ("in", 0.0254)];

/// Height of walls that is least wrong: from 1.9 to 4.8 m, so that no two units fit the same walls. [Units: wu]
const WALL: f64 = 3.0;
const WALL_FACTOR: f64 = 1.6;

/// Returns the units in which a scene of this size is a building: only one, if its walls show it.
fn plausible_units(scene: &Scene, size: DVec3, report: &ImportReport) -> Vec<(&'static str, f64)> {
    let (least, longest) = (size.min_element(), size.max_element());
    // At least a storey high, and not so high as to be doubtful itself.
    let fits = |&(_, meters): &(&str, f64)| {
        least * meters >= 2.0 && least * meters <= TALL && longest * meters >= 3.0
    };
    let mut units: Vec<(&str, f64)> = UNITS.into_iter().filter(fits).collect();
    if units.len() > 1 {
        let up = report.up_doubt.as_ref().filter(|doubt| doubt.is_clear);
        let height = wall_height(scene, up.map_or(1, |doubt| doubt.axis));
        let misfit = |u: &(&str, f64)| (height * u.1 / WALL).ln().abs();
        units.sort_by(|a, b| misfit(a).total_cmp(&misfit(b)));
        if misfit(&units[0]) <= WALL_FACTOR.ln() {
            units.truncate(1);
        }
    }
    units
}

/// Share of the area of walls that is in lower triangles. Pieces beside openings and sills are low.
const LOWER: f64 = 0.9;

/// Returns the height of the upright structural triangles, but the few highest; 0 if there are none.
fn wall_height(scene: &Scene, up: usize) -> f64 {
    let sources = scene.triangle_sources(Role::Structural);
    let triangles = sources.map(|s| scene.world_triangle(s));
    let mut heights: Vec<[f64; 2]> = triangles
        .map(|t| (triangle_area_normal(&t), Aabb::of_points(&t).size()[up]))
        .filter(|(normal, _)| normal[up].abs() < 0.05 * normal.length())
        .map(|(normal, height)| [height, normal.length()])
        .collect();
    heights.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut left = LOWER * heights.iter().map(|h| h[1]).sum::<f64>();
    for [height, area] in heights {
        left -= area;
        if left <= 0.0 {
            return height;
        }
    }
    0.0
}

/// Returns the options that give one of these units.
fn given(units: &[(&str, f64)]) -> String {
    let names: Vec<&str> = units.iter().map(|u| u.0).collect();
    format!("--unit {}", names.join(" or --unit "))
}

/// Returns the reason to doubt that the numbers are meters, before hours pass: only if no unit was given and the
/// format does not have one that all its writers know.
///
/// A landscape may be as large; so nothing is changed.
pub(crate) fn unit_doubt(
    scene: &Scene,
    report: &ImportReport,
    options: &ImportOptions,
) -> Option<String> {
    if options.unit.is_some() || report.files.iter().any(FileReport::tells_unit) {
        return None;
    }
    let structural = |i: &usize| scene.objects[*i].role == Role::Structural;
    let boxes = (0..scene.objects.len()).filter(structural);
    let size = boxes
        .fold(Aabb::EMPTY, |b, i| b.union(scene.object_aabb(i)))
        .size();
    let units = plausible_units(scene, size, report);
    if size.min_element() <= TALL || units.is_empty() {
        return None;
    }
    Some(format!(
        "{}: the scene is {:.0} x {:.0} x {:.0} m if its numbers are meters, far more than a building; if it is one, give the \
         unit of its numbers: {}",
        paths_of(report),
        size.x,
        size.y,
        size.z,
        given(&units)
    ))
}

/// A foot. [Units: wu]
const FOOT: f64 = 0.3048;
/// Tiers of seats, up to 0.47 m high, are flights if they are made lower by this factor, and as narrow as stairs; stairs
/// whose numbers are feet are not: theirs rise by 0.49 (0.15 m) and more.
const TIER: f64 = 0.85;

/// Returns the reason to take the numbers for feet: stairs whose steps one can climb only if they are, below walls at
/// least a storey high in feet. Only if no unit was given and the format does not have one that all its writers know.
///
/// A house in feet is a plausible hall, so nothing but its stairs and doors shows it. Stairs that fit in meters speak
/// against it. Surfaces made of other sources, such as scans, are one object with all its stairs, and do not tell.
pub(crate) fn feet_hint(
    scene: &Scene,
    report: &ImportReport,
    options: &ImportOptions,
) -> Option<String> {
    let tells_nothing = |f: &FileReport| f.tells_unit() || f.surface.is_some();
    let is_known = options.unit.is_some() || report.files.iter().any(tells_nothing);
    if is_known || report.unit_doubt.is_some() {
        return None;
    }
    if FOOT * wall_height(scene, 1) < WALL / WALL_FACTOR {
        return None;
    }
    let mut is_feet = false;
    for i in 0..scene.objects.len() {
        let has_steps = |factors: DVec3| is_flight_at(scene, i, factors);
        if has_steps(DVec3::ONE) || has_steps(DVec3::new(FOOT, TIER, FOOT)) {
            return None;
        }
        is_feet |= has_steps(DVec3::splat(FOOT));
    }
    is_feet.then(|| {
        format!(
            "{}: one can climb its stairs only if its numbers are feet: give --unit ft; if they are meters, --unit m",
            paths_of(report)
        )
    })
}

/// Returns `true` if an object is a structural flight of stairs once its numbers are multiplied by factors.
fn is_flight_at(scene: &Scene, object: usize, factors: DVec3) -> bool {
    let size = scene.object_aabb(object).size() * factors;
    let object = &scene.objects[object];
    if object.role != Role::Structural || size.x * size.z > MOST_FLIGHT_PLAN {
        return false;
    }
    let parts = &scene.meshes[object.mesh as usize].primitives;
    let triangles = parts
        .iter()
        .flat_map(|p| p.placed_triangles(object.transform));
    let scaled: Vec<Triangle> = triangles.map(|t| t.map(|p| factors * p)).collect();
    is_flight(&scaled)
}

/// Returns the reason to doubt that the axis which was taken to point up does so; only if none was given.
pub(crate) fn up_doubt(
    scene: &Scene,
    report: &ImportReport,
    options: &ImportOptions,
) -> Option<UpDoubt> {
    if options.up.is_some() {
        return None;
    }
    let (axis, is_clear) = match find_up(scene) {
        Upward::Clear(axis) => (axis, true),
        Upward::Likely(axis) => (axis, false),
        Upward::Unknown => return None,
    };
    // Some formats are read with z up, so that across z here is across y there.
    let is_z_up = |f: &FileReport| f.tells_unit() || f.format == VOX;
    let (other, turned) = match report.files.iter().any(is_z_up) {
        false => ("z", Up::Z),
        true => ("y", Up::Y),
    };
    let (name, up) = match axis {
        0 => ("x", None),
        1 => return None,
        _ => (other, Some(turned)),
    };
    let advice = up.map_or("turn the scene where it was made".into(), |up| {
        format!("give {}", up.option())
    });
    let paths = paths_of(report);
    let text = if is_clear {
        format!("{paths}: {name} points up, to judge by its floors and ceilings: {advice}")
    } else {
        format!(
            "{paths}: which way is up is not clear from its floors; if the plan cuts through all storeys, {advice}"
        )
    };
    Some(UpDoubt {
        text,
        axis,
        up,
        is_clear,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::SurfaceReport;
    use enfilade_geom::DMat4;
    use enfilade_testkit::{TowerParams, furnished_house, mixed, office_tower};

    fn hint(scene: &Scene, unit: Option<f64>) -> Option<String> {
        let options = ImportOptions {
            unit,
            ..ImportOptions::default()
        };
        feet_hint(scene, &ImportReport::default(), &options)
    }

    fn scaled(mut scene: Scene, factor: f64) -> Scene {
        for object in &mut scene.objects {
            object.transform = DMat4::from_scale(DVec3::splat(factor)) * object.transform;
        }
        scene
    }

    #[test]
    fn stairs_show_feet() {
        let scene = scaled(mixed::stair_hall().scene, 1.0 / FOOT);
        let text = hint(&scene, None).unwrap();
        assert!(text.contains("--unit ft"), "{text}");
        assert_eq!(hint(&scene, Some(1.0)), None, "who says meters means them");
        assert_eq!(hint(&scaled(scene.clone(), FOOT), None), None);
        // As if it were the surface of a scan.
        let surface = SurfaceReport {
            step: None,
            distance: 0.0,
            n_samples: 0,
            enlarged: None,
            text: String::new(),
        };
        let file = FileReport {
            surface: Some(surface),
            ..FileReport::default()
        };
        let report = ImportReport {
            files: vec![file],
            ..ImportReport::default()
        };
        assert_eq!(feet_hint(&scene, &report, &ImportOptions::default()), None);
    }

    #[test]
    fn buildings_in_meters_are_not_taken_for_feet() {
        let towers = [4, 64].map(|n| office_tower(&TowerParams::with_rooms(n, 1)));
        let all = mixed::all()
            .into_iter()
            .chain(towers)
            .chain([furnished_house()]);
        for (i, building) in all.enumerate() {
            assert_eq!(hint(&building.scene, None), None, "{i}");
            // A storey twice as high as usual.
            let high = scaled(building.scene, 2.0);
            assert_eq!(hint(&high, None), None, "{i}");
        }
    }

    #[test]
    fn tiers_of_seats_in_a_hall_are_not_stairs_in_feet() {
        // Sixteen rows, 12 m wide and 0.85 m deep, in a hall with walls of 9 m.
        let hall = |rise: f64| {
            let scene = mixed::stair_hall().scene;
            let at = scene.objects.iter().position(|o| o.name == "stairs");
            let at = at.unwrap();
            let stairs = scene.objects[at].clone();
            let tall = 16.0 * rise / scene.object_aabb(at).size().y;
            let grow = DMat4::from_scale(DVec3::new(12.0 / 0.9, tall, 0.85 / 0.26));
            let mut scene = scaled(scene, 1.0 / FOOT);
            scene.objects[at].transform = grow * stairs.transform;
            scene
        };
        for rise in [0.40, 0.45] {
            assert_eq!(hint(&hall(rise), None), None, "{rise}");
        }
        assert!(hint(&hall(0.6), None).is_some(), "nobody climbs these");
    }

    #[test]
    fn stairs_in_meters_and_low_walls_speak_against_feet() {
        let feet = scaled(mixed::stair_hall().scene, 1.0 / FOOT);
        let is_stairs = |o: &&enfilade_geom::scene::Object| o.name == "stairs";
        let mut both = feet.clone();
        let mut small = feet.objects.iter().find(is_stairs).unwrap().clone();
        small.transform = DMat4::from_scale(DVec3::splat(FOOT)) * small.transform;
        both.objects.push(small);
        assert_eq!(hint(&both, None), None);
        // Terraces in the open, 7 m wide.
        let mut open = feet;
        open.objects.retain(|o| is_stairs(&o));
        let wide = DMat4::from_scale(DVec3::new(8.0, 1.0, 1.0));
        open.objects[0].transform = wide * open.objects[0].transform;
        assert_eq!(hint(&open, None), None);
    }
}
