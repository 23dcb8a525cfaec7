//! Openings that a designer marks: visportals of Doom 3, areaportals of Quake 2, Quake 3 and Source, sides of hint brushes.

use enfilade_geom::scene::GivenPortal;
use enfilade_geom::{ConvexSolid, DVec3};
use enfilade_prepare::{RoleRules, TextureMatter, texture_matter};

use super::parse::{Brush, RawEntity};

/// Beginning of the classes of entities whose brushes mark openings, whatever their textures.
const CLASS: &str = "func_areaportal";

/// Returns the openings marked in a map, numbered from 1 in the order of the entities. `placed` makes a solid of a brush, in the scene.
pub(super) fn portals(
    entities: &[RawEntity<'_>],
    rules: &RoleRules,
    placed: impl Fn(&Brush<'_>) -> Option<ConvexSolid>,
) -> Vec<GivenPortal> {
    let is_mark = |texture: &str| {
        let matter = texture_matter(&rules.textures, texture);
        matches!(matter, Some(TextureMatter::Portal | TextureMatter::Hint))
    };
    let mut found: Vec<GivenPortal> = Vec::new();
    for entity in entities {
        let class = entity.get("classname").unwrap_or("");
        for brush in &entity.brushes {
            let marks: Vec<bool> = brush.sides.iter().map(|s| is_mark(s.texture)).collect();
            if !class.starts_with(CLASS) && !marks.contains(&true) {
                continue;
            }
            let Some(solid) = placed(brush) else { continue };
            // A single marked side is the opening; a brush marked all over has it in its middle.
            let is_single = marks.contains(&true) && marks.contains(&false);
            let is_side = |f: &usize| !is_single || marks[solid.sources[*f] as usize];
            let area = |f: &usize| solid.faces[*f].area();
            let sides = (0..solid.faces.len()).filter(is_side);
            let Some(side) = sides.max_by(|a, b| area(a).total_cmp(&area(b))) else {
                continue;
            };
            let normal = solid.planes[side].normal;
            let depths = solid.faces.iter().flat_map(|f| &f.points);
            let depths = depths.map(|&p| -solid.planes[side].signed_distance(p));
            let thickness = depths.fold(0.0, f64::max);
            let by = if is_single {
                DVec3::ZERO
            } else {
                normal * (-thickness / 2.0)
            };
            let what = if class.starts_with(CLASS) {
                "areaportal"
            } else {
                name_of(brush, &marks)
            };
            found.push(GivenPortal {
                name: format!("{what} {}", found.len() + 1),
                outline: solid.faces[side].points.iter().map(|&p| p + by).collect(),
                normal,
                thickness,
            });
        }
    }
    found
}

/// Returns the last name of the texture that marks a brush.
fn name_of<'t>(brush: &Brush<'t>, marks: &[bool]) -> &'t str {
    let marked = brush.sides.iter().zip(marks).find(|(_, is)| **is);
    let texture = marked.map_or("portal", |(side, _)| side.texture);
    texture.rsplit('/').next().unwrap_or(texture)
}
