//! Whether what fills openings is there and can move.

use crate::World;

/// Checks the fittings of all portals, and what details say they were taken out of.
pub(crate) fn check(world: &World, broken: &mut dyn FnMut(String, String)) {
    let n = world.details.len();
    for (i, portal) in world.graph.portals.iter().enumerate() {
        let mut before = None;
        for f in &portal.fittings {
            let mut report = |problem: String| broken(format!("portal {i}"), problem);
            if f.detail as usize >= n {
                report(format!("is filled by detail {} of {n}", f.detail));
            } else if before.is_some_and(|b| b >= f.detail) {
                report("its fittings do not ascend by detail".into());
            }
            before = Some(f.detail);
            if let Some(problem) = f.motion.as_ref().and_then(crate::Motion::problem) {
                report(format!("detail {} in it: {problem}", f.detail));
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
                format!("is part of detail {whole}, which is none, itself, or a part of another"),
            );
        }
    }
}
