//! Special portals in words.

use enfilade::cpg::{CellPortalGraph, SpecialId, SpecialShape, Way};
use enfilade::geom::{Aabb, DVec3, shown};

use crate::screen::At;

/// Says what a special portal is, in words.
pub(crate) fn described(graph: &CellPortalGraph, special: SpecialId) -> String {
    let side = &graph.specials[special.idx()];
    let passes = side.passes.iter().enumerate().map(|(i, pass)| {
        let share = match i {
            0 => String::new(),
            _ => format!(" {:.0} %", pass.tint[3] * 100.0),
        };
        let what = match &pass.way {
            Way::Through => "through".to_owned(),
            Way::Mirror => "mirror".to_owned(),
            Way::Lead { to, map, back } => {
                let mut out = format!("to {}", graph[*to].name);
                if map.scale.abs() != 1.0 {
                    out += &format!(", ×{:.4}", map.scale.abs());
                }
                if map.is_reflection() {
                    out += ", reflected";
                }
                match back {
                    Some(back) => out + &format!(", back by {back}"),
                    None => out + ", one way",
                }
            }
            Way::Monitor(camera) => {
                let at = At(camera.eye.map(f64::from));
                format!("monitor of a camera at {at}")
            }
        };
        let [r, g, b, _] = pass.tint;
        let tint = if [r, g, b] == [1.0; 3] {
            String::new()
        } else {
            format!(" in {r:.2} {g:.2} {b:.2}")
        };
        what + &share + &tint
    });
    let passes: Vec<String> = passes.collect();
    let place = match side.shape {
        SpecialShape::Portal(portal) => portal.to_string(),
        SpecialShape::Surface { .. } => "a wall".to_owned(),
    };
    let at = middle(graph, special);
    let text = format!(
        "{} of {place} in {}, at {}",
        passes.join(" + "),
        graph[side.cell].name,
        At(at.to_array())
    );
    shown(text).to_string()
}

/// Returns the middle of a special portal's box.
pub(crate) fn middle(graph: &CellPortalGraph, special: SpecialId) -> DVec3 {
    let (_, pieces) = graph.special_opening(special);
    let points = pieces.iter().flat_map(|p| &p.points).copied();
    let bounds = points.fold(Aabb::EMPTY, Aabb::including);
    bounds.center()
}
