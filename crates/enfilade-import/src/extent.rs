//! Checks of a scene's size for a wrong unit.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, DVec3};

use crate::{FileReport, ImportError, ImportOptions, ImportReport};

/// Returns the files of a report, comma separated.
pub(crate) fn paths_of(report: &ImportReport) -> String {
    let path = |f: &FileReport| f.path.display().to_string();
    report.files.iter().map(path).collect::<Vec<_>>().join(", ")
}

/// Returns an error for scenes far larger or smaller than any building, or far off the origin.
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
        let factor = if longest * 0.01 > limit { 0.001 } else { 0.01 };
        let factor = if longest * 0.001 > 1.0 { 0.001 } else { factor };
        let advice = format!(
            "{advice}give the unit of its numbers, e.g. --unit {}",
            significant(unit * factor)
        );
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
            "give the unit of its numbers, e.g. --unit {}",
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
        let center = bounds.center().round();
        let advice = format!(
            "move the scene to its origin, e.g. --origin {},{},{}",
            center.x, center.y, center.z
        );
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

/// Returns a warning, before hours pass, that the unit may be wrong: only if none was given and the format has none.
///
/// A landscape may be as large; so nothing is rejected or changed.
pub(crate) fn unit_doubt(
    scene: &Scene,
    report: &ImportReport,
    options: &ImportOptions,
) -> Option<String> {
    let has_no_unit = |f: &FileReport| matches!(f.format, "OBJ" | "PLY" | "STL");
    if options.unit.is_some() || !report.files.iter().all(has_no_unit) {
        return None;
    }
    let structural = |i: &usize| scene.objects[*i].role == Role::Structural;
    let boxes = (0..scene.objects.len()).filter(structural);
    let size = boxes
        .fold(Aabb::EMPTY, |b, i| b.union(scene.object_aabb(i)))
        .size();
    let (least, longest) = (size.min_element(), size.max_element());
    // At least a storey high, and not so high as to be doubtful itself.
    let fits =
        |meters: f64| least * meters >= 2.0 && least * meters <= TALL && longest * meters >= 3.0;
    let names: Vec<&str> = UNITS.iter().filter(|u| fits(u.1)).map(|u| u.0).collect();
    if least <= TALL || names.is_empty() {
        return None;
    }
    Some(format!(
        "{}: the scene is {:.0} x {:.0} x {:.0} m if its numbers are meters, far more than a building; if it is one, give the \
         unit of its numbers: --unit {}",
        paths_of(report),
        size.x,
        size.y,
        size.z,
        names.join(" or --unit ")
    ))
}
