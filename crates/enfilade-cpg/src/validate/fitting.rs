//! Checks that fittings exist and have valid motions.

use std::collections::HashMap;

use enfilade_geom::Aabb;

use super::extent::geometry;
use crate::fitting::vector;
use crate::{Fitting, FittingPart, Motion, MotionKind, World};

/// Farthest that a hinge may be from the model, and most by which a leaf may slide beyond the model's size. A leaf is
/// not larger than the model, and stands in one of its openings. [Units: wu]
const BESIDE: f64 = 10.0;

/// Checks the fittings of all portals, and the objects that details were separated from.
pub(crate) fn check(world: &World, broken: &mut dyn FnMut(String, String)) {
    let n = world.details.len();
    let model = geometry(world).expanded(BESIDE);
    let mut known: HashMap<u32, (usize, &Fitting)> = HashMap::new();
    for (i, portal) in world.graph.portals.iter().enumerate() {
        let mut before = None;
        for f in &portal.fittings {
            let mut report = |problem: String| broken(format!("portal {i}"), problem);
            if f.detail as usize >= n {
                report(format!(
                    "refers to detail {} as a fitting, but there are {n}",
                    f.detail
                ));
            } else if before.is_some_and(|b| b >= f.detail) {
                report("its fittings must be ascending by detail, without duplicates".into());
            }
            before = Some(f.detail);
            if let Some(problem) = problem(f, &model) {
                report(format!("fitting, detail {}: {problem}", f.detail));
            }
            let (first, other) = *known.entry(f.detail).or_insert((i, f));
            if other.motion != f.motion {
                let d = f.detail;
                report(format!(
                    "detail {d} has another motion in portal {first}; an object has one motion or none"
                ));
            }
        }
    }
    for (i, detail) in world.details.iter().enumerate() {
        let is_whole = |w: u32| {
            let whole = world.details.get(w as usize);
            w as usize != i && whole.is_some_and(|w| w.part_of.is_none())
        };
        if let Some(whole) = detail.part_of.filter(|&w| !is_whole(w)) {
            broken(
                format!("detail {i} ({})", detail.name),
                format!(
                    "is part of detail {whole}, which does not exist, is itself, or is part of another"
                ),
            );
        }
    }
}

/// Returns a problem of a single fitting, if any.
fn problem(f: &Fitting, model: &Aabb) -> Option<&'static str> {
    let motion = match (f.part, &f.motion) {
        (FittingPart::Leaf, Some(motion)) => motion,
        (FittingPart::Leaf, None) => return Some("a leaf needs a motion"),
        (_, None) => return None,
        (_, Some(_)) => return Some("only leaves have a motion"),
    };
    motion.problem().or_else(|| far_problem(motion, model))
}

/// Returns a problem if a motion leads out of the world.
fn far_problem(motion: &Motion, model: &Aabb) -> Option<&'static str> {
    match motion.kind {
        MotionKind::Turn { through, .. } => {
            (!model.contains(vector(through))).then_some("its hinge is far from the model")
        }
        MotionKind::Slide { .. } => {
            let most = model.size().max_element();
            let is_far = |x: f32| f64::from(x).abs() > most;
            (is_far(motion.shut) || is_far(motion.open)).then_some("it slides out of the model")
        }
    }
}
