//! Lines of pieces and polygons before they are there.

use std::collections::BTreeMap;

use enfilade::geom::DVec3;
use enfilade::kit::{Assembly, Kit, Piece};
use enfilade::world::Pose;
use enfilade_render::{MarkShape, PictureMark};

/// Most lines of a piece; of more, the longest.
const MOST: usize = 3000;
/// Edges whose triangles lean less to each other are none. [Units: cosine of an angle]
const FLAT: f64 = 0.9;

/// Green: it fits. Red: it is refused.
pub(super) const COLORS: [[f32; 3]; 2] = [[0.05, 0.8, 0.15], [0.9, 0.05, 0.03]];
/// Doorways to dock at, and the one aimed at.
const OPEN: [f32; 4] = [0.1, 0.55, 1.0, 0.8];
const AIMED: [f32; 4] = [1.0, 0.8, 0.1, 1.0];

/// The lines of each piece of a kit, in its frame.
pub(super) fn lines_of(kit: &Kit) -> Vec<Vec<[DVec3; 2]>> {
    kit.pieces().iter().map(lines).collect()
}

/// Returns the edges of the walls of a piece.
fn lines(piece: &Piece) -> Vec<[DVec3; 2]> {
    // Tenths of a millimeter: pieces of a surface share vertices only roughly.
    let key = |p: DVec3| (p * 1e4).round().as_i64vec3().to_array();
    let mut normals: BTreeMap<[[i64; 3]; 2], Vec<DVec3>> = BTreeMap::new();
    let batches = piece.world().batches.iter().filter(|b| !b.is_seal);
    for [a, b, c] in batches.flat_map(|b| b.primitive.triangles()) {
        let normal = (b - a).cross(c - a).normalize_or_zero();
        for [p, q] in [[a, b], [b, c], [c, a]] {
            let mut ends = [key(p), key(q)];
            ends.sort_unstable();
            normals.entry(ends).or_default().push(normal);
        }
    }
    let is_edge = |n: &[DVec3]| n.iter().any(|m| m.dot(n[0]) < FLAT);
    let point = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64 * 1e-4));
    let edges = normals
        .into_iter()
        .filter(|(_, n)| n.len() < 2 || is_edge(n));
    let mut lines: Vec<[DVec3; 2]> = edges.map(|(ends, _)| ends.map(point)).collect();
    lines.sort_by(|a, b| b[0].distance(b[1]).total_cmp(&a[0].distance(a[1])));
    lines.truncate(MOST);
    lines
}

fn mark(shape: MarkShape, color: [f32; 4], width: f32, on_top: bool) -> PictureMark {
    PictureMark {
        shape,
        color,
        width,
        on_top,
    }
}

fn with_alpha([r, g, b]: [f32; 3], alpha: f32) -> [f32; 4] {
    [r, g, b, alpha]
}

fn single(p: DVec3) -> [f32; 3] {
    p.as_vec3().to_array()
}

/// Adds a piece at a pose: bright lines, and faint ones behind walls.
pub(super) fn add_piece(
    marks: &mut Vec<PictureMark>,
    lines: &[[DVec3; 2]],
    pose: &Pose,
    fits: bool,
) {
    let color = COLORS[usize::from(!fits)];
    for ends in lines {
        let line = MarkShape::Line(ends.map(|p| single(pose.point(p))));
        marks.push(mark(line.clone(), with_alpha(color, 0.35), 1.5, true));
        marks.push(mark(line, with_alpha(color, 1.0), 2.0, false));
    }
}

/// Adds a polygon that is drawn.
pub(super) fn add_polygon(marks: &mut Vec<PictureMark>, corners: &[DVec3], fits: bool) {
    let color = COLORS[usize::from(!fits)];
    let outline: Vec<[f32; 3]> = corners.iter().map(|p| single(*p)).collect();
    if outline.len() > 2 {
        let area = MarkShape::Area(outline.clone());
        marks.push(mark(area, with_alpha(color, 0.25), 0.0, true));
    }
    let line = MarkShape::Outline(outline);
    marks.push(mark(line, with_alpha(color, 1.0), 2.5, true));
}

/// Adds the outline of a change by hand that is there.
pub(super) fn add_known(marks: &mut Vec<PictureMark>, corners: &[DVec3]) {
    let outline = MarkShape::Outline(corners.iter().map(|p| single(*p)).collect());
    marks.push(mark(outline, AIMED, 2.0, true));
}

/// Adds a cross at a point.
pub(super) fn add_point(marks: &mut Vec<PictureMark>, at: DVec3, size: f64, fits: bool) {
    let color = COLORS[usize::from(!fits)];
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let line = MarkShape::Line([at - axis * size, at + axis * size].map(single));
        marks.push(mark(line, with_alpha(color, 1.0), 2.5, true));
    }
}

/// Adds the doorways of a level that lead outdoors.
pub(super) fn add_ends(
    marks: &mut Vec<PictureMark>,
    level: &Assembly,
    aimed: Option<enfilade::kit::End>,
) {
    for end in level.open_ends() {
        let Ok(instance) = level.standing(end.instance) else {
            continue;
        };
        let mouth = &level.piece(end.instance).attachments()[end.attachment].mouth;
        let frame = instance.pose.after(&mouth.frame);
        let corners = mouth.outline.iter().map(|p| frame.point(p.extend(0.0)));
        let outline = MarkShape::Outline(corners.map(single).collect());
        let is_aimed = aimed == Some(end);
        let (color, width) = if is_aimed { (AIMED, 4.0) } else { (OPEN, 2.0) };
        marks.push(mark(outline, color, width, is_aimed));
    }
}
