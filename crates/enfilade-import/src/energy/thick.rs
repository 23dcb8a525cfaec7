//! Walls between the shells of spaces: as thick as these are apart.
//!
//! Surfaces of gbXML lie on the middle of walls, and a wall between two spaces is there once. Where spaces have shells of their own,
//! which end at the faces of walls, these are the walls, and openings lead through, from one shell to the next or to the surface outdoors.
//!
//! **Complexity:** O(openings × polygons of shells), most of them told apart by their boxes. **Numerics:** openings are cut by what both
//! shells have of them, in the plane of the opening, so both ends of a way have the same vertices.

use enfilade_geom::DVec3;
use i_overlay::core::overlay_rule::OverlayRule;

use super::model::{Class, EnergyModel, Loop, Ring, Sheet, area, overlay, plane, turned_left};

/// Farthest face of a wall from its opening. [Units: m] Walls of twice that are rare.
const REACH: f64 = 1.0;
/// Nearer planes are one: the tolerance of most such models. [Units: m]
const SAME_PLANE: f64 = 0.01;
/// Least cosine of the angle between an opening and a wall: 5 degrees.
const PARALLEL: f64 = 0.996;
/// Least share of an opening that lies on a shell which it leads through.
const LEAST: f64 = 0.5;

/// A polygon of a space's shell.
struct ShellSide {
    space: usize,
    /// Number in the shell.
    number: usize,
    origin: DVec3,
    normal: DVec3,
    low: DVec3,
    high: DVec3,
}

impl ShellSide {
    fn plane(&self) -> (DVec3, DVec3) {
        (self.origin, self.normal)
    }
}

/// The part of an opening that lies on one plane of a space's shell.
struct Mouth {
    space: usize,
    /// From the opening's plane along its normal. [Units: those of the file]
    depth: f64,
    sides: Vec<usize>,
    rings: Vec<Ring>,
}

/// An opening in its own plane.
struct Frame {
    origin: DVec3,
    normal: DVec3,
    axes: [DVec3; 2],
    outline: Ring,
    low: DVec3,
    high: DVec3,
}

impl Frame {
    fn of(outline: &Loop) -> Option<Self> {
        let (origin, normal) = plane(outline)?;
        let axes = normal.any_orthonormal_pair().into();
        let [low, high] = bounds(outline);
        let mut frame = Self {
            origin,
            normal,
            axes,
            outline: Ring::new(),
            low,
            high,
        };
        frame.outline = turned_left(outline.iter().map(|&p| frame.flat(p)).collect());
        Some(frame)
    }

    fn flat(&self, p: DVec3) -> [f64; 2] {
        self.axes.map(|axis| (p - self.origin).dot(axis))
    }

    /// Returns a ring of the plane, moved along the normal to another plane, of which a point and the normal are given.
    fn placed(&self, ring: &[[f64; 2]], (point, normal): (DVec3, DVec3)) -> Loop {
        let along = self.normal / self.normal.dot(normal);
        let at = |&[x, y]: &[f64; 2]| {
            let p = self.origin + self.axes[0] * x + self.axes[1] * y;
            p + along * (point - p).dot(normal)
        };
        ring.iter().map(at).collect()
    }

    fn plane(&self) -> (DVec3, DVec3) {
        (self.origin, self.normal)
    }
}

/// Makes the shells of spaces the walls, and leads openings through them, if all are closed, and most doors and windows lie
/// between the faces of their walls.
/// Otherwise changes nothing. Surfaces between two spaces, and those on a shell, are then left out.
pub(super) fn thicken(model: &mut EnergyModel) {
    if !model.spaces.iter().all(|space| closes(&space.shell)) {
        return;
    }
    let (reach, same) = (REACH / model.unit, SAME_PLANE / model.unit);
    let sides = sides_of(model);
    let openings: Vec<usize> = (0..model.sheets.len())
        .filter(|&i| model.sheets[i].is_opening())
        .collect();
    let mut ways = Vec::new();
    for &i in &openings {
        let sheet = &model.sheets[i];
        if let Some(frame) = Frame::of(&sheet.outline) {
            let mouths = mouths(model, sheet, &frame, &sides, [reach, same]);
            if let Some(first) = mouths.first() {
                let depth = |m: &Mouth| m.depth;
                let from = depth(first);
                let to = mouths.get(1).map_or(0.0, depth);
                ways.push((i, frame, mouths, [from, to]));
            }
        }
    }
    let is_deep = |[from, to]: &[f64; 2]| (from - to).abs() > same;
    // Where surfaces lie on one face of walls, shells may end in openings, and those of air between spaces are flat in all models.
    let judged = ways
        .iter()
        .filter(|way| model.sheets[way.0].class != Class::Air);
    let is_between =
        |way: &&(usize, Frame, Vec<Mouth>, [f64; 2])| way.2.iter().all(|m| m.depth.abs() > same);
    let (between, on_a_face): (Vec<_>, Vec<_>) = judged.partition(is_between);
    if between.len() <= on_a_face.len() {
        return;
    }
    let mut holes: Vec<Vec<Vec<Loop>>> = (model.spaces.iter())
        .map(|space| vec![Vec::new(); space.shell.len()])
        .collect();
    let mut made = Vec::new();
    for (i, frame, mouths, depths) in ways {
        let mut left = vec![frame.outline.clone()];
        for mouth in &mouths {
            left = common(&left, &mouth.rings);
        }
        let Some(ring) = (left.into_iter()).max_by(|a, b| area(a).total_cmp(&area(b))) else {
            continue;
        };
        for mouth in &mouths {
            for &side in &mouth.sides {
                let side = &sides[side];
                let hole = frame.placed(&ring, side.plane());
                holes[side.space][side.number].push(hole);
            }
        }
        let mut ends = mouths
            .iter()
            .map(|m| frame.placed(&ring, sides[m.sides[0]].plane()));
        let own = frame.placed(&ring, frame.plane());
        if is_deep(&depths)
            && let Some(near) = ends.next()
        {
            let far = ends.next().unwrap_or_else(|| own.clone());
            made.extend(reveal(&model.sheets[i].id, &near, &far));
        }
        model.sheets[i].outline = own;
    }
    let is_wall = |sheet: &Sheet| sheet.spaces.len() < 2 && !lies_on_a_shell(sheet, &sides, same);
    let stays: Vec<bool> = (model.sheets.iter())
        .map(|s| s.is_opening() || matches!(s.class, Class::Shade | Class::Column) || is_wall(s))
        .collect();
    for (sheet, stays) in model.sheets.iter_mut().zip(stays) {
        sheet.is_left_out = !stays;
    }
    model.sheets.extend(made);
    for (space, holes) in model.spaces.iter_mut().zip(holes) {
        space.walls = holes;
    }
}

fn bounds(points: &Loop) -> [DVec3; 2] {
    let all = points.iter().copied();
    [
        all.clone().fold(DVec3::INFINITY, DVec3::min),
        all.fold(DVec3::NEG_INFINITY, DVec3::max),
    ]
}

/// Direction of the rays that tell the inside of a shell: along no wall.
const ASKEW: DVec3 = DVec3::new(0.5377, 0.3214, 0.7795);
/// Distance of their starts from a polygon, as a share of its size.
const OFF: f64 = 1e-4;

/// Greatest sum of the area vectors of a closed shell, as a share of its area.
const CLOSED: f64 = 1e-3;

/// Returns `true` if the area vectors of a shell's polygons cancel, and there are some: as they are turned, or each away from the
/// inside, as some exporters turn them anyhow. O(n), or O(n²).
fn closes(shell: &[Loop]) -> bool {
    let frames: Vec<Frame> = shell.iter().filter_map(Frame::of).collect();
    let vector = |f: &Frame| f.normal * area(&f.outline);
    let all: f64 = frames.iter().map(|f| area(&f.outline)).sum();
    let cancels = |sum: DVec3| all > 0.0 && sum.length() <= CLOSED * all;
    let turned = |f: &Frame| {
        let inner = inner_point(&f.outline)?;
        let off = f.normal * (OFF * area(&f.outline).sqrt());
        let from = f.placed(&[inner], f.plane())[0] + off;
        let n_hit = frames.iter().filter(|other| is_hit(other, from)).count();
        Some(vector(f) * if n_hit % 2 == 0 { 1.0 } else { -1.0 })
    };
    cancels(frames.iter().map(vector).sum()) || cancels(frames.iter().filter_map(turned).sum())
}

/// Returns a point inside a ring, on the level half way in the largest step between heights of its vertices.
fn inner_point(ring: &Ring) -> Option<[f64; 2]> {
    let mut heights: Vec<f64> = ring.iter().map(|p| p[1]).collect();
    heights.sort_by(f64::total_cmp);
    let steps = heights.windows(2).map(|h| [h[0], h[1]]);
    let [low, high] = steps.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0])))?;
    let y = 0.5 * (low + high);
    let mut across = crossings(ring, y);
    across.sort_by(f64::total_cmp);
    let [from, to, ..] = across[..] else {
        return None;
    };
    Some([0.5 * (from + to), y])
}

/// Returns where the edges of a ring cross a level.
fn crossings(ring: &Ring, y: f64) -> Vec<f64> {
    let next = ring.iter().cycle().skip(1);
    let crossed = ring
        .iter()
        .zip(next)
        .filter(|(a, b)| (a[1] > y) != (b[1] > y));
    crossed
        .map(|(a, b)| a[0] + (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]))
        .collect()
}

/// Returns `true` if a ray along [`ASKEW`] meets a polygon.
fn is_hit(frame: &Frame, from: DVec3) -> bool {
    let along = (frame.origin - from).dot(frame.normal) / ASKEW.dot(frame.normal);
    if along.is_nan() || along <= 0.0 {
        return false;
    }
    let [x, y] = frame.flat(from + ASKEW * along);
    let left = crossings(&frame.outline, y);
    left.iter().filter(|&&c| c < x).count() % 2 == 1
}

fn sides_of(model: &EnergyModel) -> Vec<ShellSide> {
    let mut sides = Vec::new();
    for (space, shell) in model.spaces.iter().map(|s| &s.shell).enumerate() {
        for (number, outline) in shell.iter().enumerate() {
            if let Some((origin, normal)) = plane(outline) {
                let [low, high] = bounds(outline);
                sides.push(ShellSide {
                    space,
                    number,
                    origin,
                    normal,
                    low,
                    high,
                });
            }
        }
    }
    sides
}

/// Returns the planes of shells that an opening leads through: the nearest one, and the nearest of another space on the other side.
fn mouths(
    model: &EnergyModel,
    sheet: &Sheet,
    frame: &Frame,
    sides: &[ShellSide],
    [reach, same]: [f64; 2],
) -> Vec<Mouth> {
    let is_near = |side: &ShellSide| {
        let away = (side.low - frame.high).max(frame.low - side.high);
        away.max_element() <= reach && side.normal.dot(frame.normal).abs() >= PARALLEL
    };
    let mut found: Vec<Mouth> = Vec::new();
    for (i, side) in sides.iter().enumerate().filter(|(_, side)| is_near(side)) {
        let space = &model.spaces[side.space];
        let depth = (side.origin - frame.origin).dot(frame.normal);
        if depth.abs() > reach || !(sheet.spaces.is_empty() || sheet.spaces.contains(&space.id)) {
            continue;
        }
        let ring = space.shell[side.number].iter().map(|&p| frame.flat(p));
        let ring = turned_left(ring.collect());
        let is_of = |m: &&mut Mouth| m.space == side.space && (m.depth - depth).abs() <= same;
        if let Some(mouth) = found.iter_mut().find(is_of) {
            mouth.sides.push(i);
            mouth.rings.push(ring);
        } else {
            found.push(Mouth {
                space: side.space,
                depth,
                sides: vec![i],
                rings: vec![ring],
            });
        }
    }
    let all = area(&frame.outline);
    found.retain(|mouth| {
        let common = common(std::slice::from_ref(&frame.outline), &mouth.rings);
        common.iter().map(|ring| area(ring)).sum::<f64>() >= LEAST * all
    });
    found.sort_by(|a, b| a.depth.abs().total_cmp(&b.depth.abs()));
    let Some(first) = found.first().map(|m| (m.space, m.depth)) else {
        return found;
    };
    let (own, others): (Vec<Mouth>, Vec<Mouth>) =
        found.into_iter().partition(|m| m.space == first.0);
    // Beyond the first space is another wall.
    let is_between = |depth: f64| {
        own[1..].iter().any(|m| {
            let share = (m.depth - first.1) / (depth - first.1);
            share > 0.0 && share < 1.0
        })
    };
    let second = others.into_iter().find(|m| {
        let is_across = first.1.abs() <= same || m.depth * first.1 < same * same;
        is_across && !is_between(m.depth)
    });
    own.into_iter().take(1).chain(second).collect()
}

/// Returns the outlines of what rings and others have in common.
fn common(rings: &[Ring], others: &[Ring]) -> Vec<Ring> {
    let shapes = overlay(rings, others, OverlayRule::Intersect);
    let outlines = shapes.into_iter().filter_map(|s| s.into_iter().next());
    outlines.map(turned_left).collect()
}

/// Returns the sides of an opening's way through a wall, between outlines whose vertices answer each other.
fn reveal(id: &str, near: &Loop, far: &Loop) -> impl Iterator<Item = Sheet> {
    (0..near.len()).map(move |i| {
        let k = (i + 1) % near.len();
        let outline = vec![near[i], near[k], far[k], far[i]];
        Sheet::new(format!("{id}-reveal-{i}"), Class::Wall, outline)
    })
}

/// Returns `true` if a surface's middle is on a polygon of a shell.
fn lies_on_a_shell(sheet: &Sheet, sides: &[ShellSide], same: f64) -> bool {
    let Some(frame) = Frame::of(&sheet.outline) else {
        return true;
    };
    let middle: DVec3 = sheet.outline.iter().sum::<DVec3>() / sheet.outline.len() as f64;
    sides.iter().any(|side| {
        let is_in = (middle - side.low).min(side.high - middle).min_element() >= -same;
        is_in
            && side.normal.dot(frame.normal).abs() >= PARALLEL
            && (middle - side.origin).dot(side.normal).abs() <= same
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_without_one_side_does_not_close() {
        let at = |k: usize| DVec3::from([0, 1, 2].map(|i| f64::from((k >> i) as u32 & 1)));
        let sides = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let shell: Vec<Loop> = sides.iter().map(|s| s.map(at).to_vec()).collect();
        assert!(closes(&shell) && !closes(&shell[1..]));
        let mut turned = shell.clone();
        turned[3].reverse();
        assert!(closes(&turned));
    }
}
