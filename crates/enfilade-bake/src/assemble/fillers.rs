//! Divides openings between the objects that fill them, so that each door and each window has a portal of its own: a
//! door and the window beside it, windows in one row without a pier between them.
//!
//! Cuts run between objects, first from side to side, then from foot to head. Bare panes side by side are one filling,
//! and so are the leaves of a double door, whatever they are made of.
//!
//! `O(portals · plates)` comparisons of boxes; each cut is exact, so both parts together are the opening.

use enfilade_cpg::PortalKind;
use enfilade_geom::filler::{DEEPEST, FILLED};
use enfilade_geom::{Aabb, Allowance, DVec3, Plane, Rectangle, Triangle, Winding, poly, shells};

use crate::complex::PartitionPortal;
use crate::structure::Plate;

/// Vertices nearer than this to a cut count as on it: parts narrower than the rounding to `f32` would vanish. [Units: wu]
const ON_CUT: f64 = 1e-5;
/// Greatest overlap of two fillers beside each other, and greatest distance of the edges of two panes in a row.
/// [Units: wu] Frames overlap by a rebate of 10 to 30 mm.
const REBATE: f64 = 0.05;
/// Least width of a frame, as far as it is in view. [Units: wu]
const FRAME: f64 = 0.02;
/// Least share of a filler that lies in the opening that it fills.
const WITHIN: f64 = 0.5;
/// Least area of a part. [Units: wu²] A window of 0.35 m by 0.35 m.
const LEAST_PART: f64 = 0.12;

/// A flat object, seen along the normal of an opening.
#[derive(Clone, Copy, Debug)]
struct Filler {
    /// Ranges across and up. [Units: wu]
    across: [f64; 2],
    up: [f64; 2],
    /// It has no frame of its own.
    is_bare: bool,
    /// It may be a leaf of a double door.
    is_leaf: bool,
}

/// Divides an opening between the `plates` that fill it. One part if they cannot be parted, or fewer than two do;
/// otherwise each part has its filler.
pub(super) fn divided(
    portal: &PartitionPortal,
    is_on_floor: bool,
    plates: &[Plate<'_>],
    allowance: &Allowance,
) -> Vec<PartitionPortal> {
    let whole = || vec![portal.clone()];
    if portal.kind == PortalKind::Crack || !allowance.spend(1 + plates.len() as u64 / 16) {
        return whole();
    }
    let corners: Vec<DVec3> = portal
        .pieces
        .iter()
        .flat_map(|w| w.points.clone())
        .collect();
    let opening = Rectangle::around(portal.plane.normal, &corners);
    let reach = Aabb::of_points(&corners).expanded(DEEPEST);
    let near = plates.iter().filter(|p| p.aabb.overlaps(&reach));
    let fillers = near.filter_map(|p| filler(&opening, is_on_floor, p));
    let fillers: Vec<Filler> = fillers.collect();
    if fillers.len() < 2 {
        return whole();
    }
    let (mut done, mut left) = (Vec::new(), vec![(portal.clone(), fillers)]);
    while let Some((part, fillers)) = left.pop() {
        match cut(&opening, &part, &fillers) {
            Some(parts) => left.extend(parts),
            None => done.push(part),
        }
    }
    done
}

/// Returns the plate as a filler of the opening; `None` if it does not lie in it.
fn filler(opening: &Rectangle, is_on_floor: bool, plate: &Plate<'_>) -> Option<Filler> {
    let bounds = opening.bounds(&plate.triangles());
    let size = bounds.size();
    let z = (bounds.min.z + bounds.max.z) * 0.5 - opening.low.z;
    if size.z > DEEPEST || z.abs() > DEEPEST {
        return None;
    }
    let common = bounds.max.min(opening.high) - bounds.min.max(opening.low);
    if common.x.min(common.y) <= 0.0 || common.x * common.y < WITHIN * size.x * size.y {
        return None;
    }
    let is_leaf = plate.is_leaf && is_on_floor && bounds.min.y < opening.low.y + REBATE;
    Some(Filler {
        across: [bounds.min.x, bounds.max.x],
        up: [bounds.min.y, bounds.max.y],
        is_bare: is_bare(plate),
        is_leaf,
    })
}

/// Returns `true` if one body of an object reaches to all of its sides, so that no frame runs around it.
fn is_bare(plate: &Plate<'_>) -> bool {
    let triangles = plate.triangles();
    let (shell_of, n) = shells(&triangles);
    (0..n as u32).any(|shell| {
        let of = triangles.iter().zip(&shell_of).filter(|t| *t.1 == shell);
        let body: Vec<Triangle> = of.map(|t| *t.0).collect();
        let frame = plate.around.size() - plate.around.bounds(&body).size();
        frame.x.max(frame.y) < 2.0 * FRAME && plate.around.mask(body).share() >= FILLED
    })
}

/// Cuts a part of an opening in two between its fillers; `None` if they cannot be parted.
fn cut(
    opening: &Rectangle,
    part: &PartitionPortal,
    fillers: &[Filler],
) -> Option<[(PartitionPortal, Vec<Filler>); 2]> {
    for (is_across, direction) in [(true, opening.across), (false, opening.up)] {
        let range = |f: &Filler| if is_across { f.across } else { f.up };
        let mut in_order = fillers.to_vec();
        in_order.sort_by(|a, b| {
            let (a, b) = (range(a), range(b));
            a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
        });
        let mut high = f64::NEG_INFINITY;
        for k in 1..in_order.len() {
            high = high.max(range(&in_order[k - 1])[1]);
            let low = range(&in_order[k])[0];
            let (before, after) = in_order.split_at(k);
            if low < high - REBATE || is_across && is_row(before, after) {
                continue;
            }
            let at = Plane::through(direction * ((low + high) * 0.5), direction);
            if let Some([front, back]) = halves(part, &at) {
                return Some([(back, before.to_vec()), (front, after.to_vec())]);
            }
        }
    }
    None
}

/// Returns `true` if a row of panes, or of leaves of one width, continues beyond a cut.
fn is_row(before: &[Filler], after: &[Filler]) -> bool {
    let width = |f: &Filler| f.across[1] - f.across[0];
    let is_one = |a: &Filler, b: &Filler| {
        let is_level = (0..2).all(|k| (a.up[k] - b.up[k]).abs() <= REBATE);
        let are_leaves = a.is_leaf && b.is_leaf && (width(a) - width(b)).abs() <= REBATE;
        is_level && (a.is_bare && b.is_bare || are_leaves)
    };
    before.iter().any(|a| after.iter().any(|b| is_one(a, b)))
}

/// Returns the parts of a portal in front of and behind a plane; `None` if one of them is too small.
fn halves(portal: &PartitionPortal, at: &Plane) -> Option<[PartitionPortal; 2]> {
    let [mut front, mut back] = [Vec::new(), Vec::new()];
    for piece in &portal.pieces {
        let (a, b) = piece.split(at, ON_CUT);
        front.extend(a);
        back.extend(b);
    }
    let part = |mut pieces: Vec<Winding>| {
        // Largest first, as in every portal.
        pieces.sort_by(|a, b| b.area().total_cmp(&a.area()));
        let area: f64 = pieces.iter().map(Winding::area).sum();
        let width = pieces
            .iter()
            .map(|w| poly::width(&w.points))
            .fold(0.0, f64::max);
        let corners: Vec<DVec3> = pieces.iter().flat_map(|w| w.points.clone()).collect();
        (area >= LEAST_PART).then(|| PartitionPortal {
            outline: Winding::hull_in_plane(&portal.plane, &corners),
            area,
            width,
            pieces,
            ..portal.clone()
        })
    };
    Some([part(front)?, part(back)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An opening of 4 m by 2.4 m across z.
    fn opening() -> PartitionPortal {
        let plane = Plane::through(DVec3::ZERO, DVec3::Z);
        let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.4], [0.0, 2.4]];
        let corners = corners.map(|[x, y]| DVec3::new(x, y, 0.0));
        let outline = Winding::hull_in_plane(&plane, &corners);
        PartitionPortal {
            cells: [1, 2],
            plane,
            pieces: vec![outline.clone()],
            area: outline.area(),
            outline,
            candidate: None,
            width: 2.4,
            kind: PortalKind::Open,
            is_leak: false,
        }
    }

    fn block([x0, y0, x1, y1]: [f64; 4], half_depth: f64) -> Vec<Triangle> {
        let low = DVec3::new(x0, y0, -half_depth);
        Aabb::new(low, DVec3::new(x1, y1, half_depth)).triangles()
    }

    fn plate(triangles: Vec<Triangle>) -> Plate<'static> {
        Plate::of(triangles).unwrap()
    }

    /// A frame of four bars, and a pane in it.
    fn window([x0, y0, x1, y1]: [f64; 4]) -> Plate<'static> {
        let b = 0.06;
        let bars = [
            [x0, y0, x0 + b, y1],
            [x1 - b, y0, x1, y1],
            [x0 + b, y0, x1 - b, y0 + b],
            [x0 + b, y1 - b, x1 - b, y1],
        ];
        let mut triangles: Vec<Triangle> = bars.iter().flat_map(|&r| block(r, 0.04)).collect();
        triangles.extend(block([x0 + b, y0 + b, x1 - b, y1 - b], 0.005));
        plate(triangles)
    }

    fn bare(r: [f64; 4]) -> Plate<'static> {
        plate(block(r, 0.02))
    }

    /// Returns the areas of the parts, in units of 0.01 m², ascending.
    fn areas(plates: &[Plate<'_>]) -> Vec<i64> {
        areas_over(plates, false)
    }

    fn areas_over(plates: &[Plate<'_>], is_on_floor: bool) -> Vec<i64> {
        let parts = divided(&opening(), is_on_floor, plates, &Allowance::default());
        let mut areas: Vec<i64> = parts
            .iter()
            .map(|p| (p.area * 100.0).round() as i64)
            .collect();
        areas.sort_unstable();
        let total: f64 = parts.iter().map(|p| p.area).sum();
        assert!((total - 9.6).abs() < 1e-9, "{total}");
        areas
    }

    // Covers V4.
    #[test]
    fn windows_and_doors_side_by_side_have_a_portal_each() {
        let row = [window([0.0, 0.0, 1.0, 2.4]), window([1.0, 0.0, 2.5, 2.4])];
        assert_eq!(areas(&row), [240, 720]);
        let third = window([2.48, 0.0, 4.0, 2.4]);
        let [a, b] = row;
        // In the middle of what the second and the third share.
        assert_eq!(areas(&[third, a, b]), [240, 358, 362]);
        // A door with a light above, beside a pane.
        let door = [
            window([0.0, 0.0, 1.0, 2.0]),
            window([0.0, 2.0, 1.0, 2.4]),
            bare([1.0, 0.0, 4.0, 2.4]),
        ];
        assert_eq!(areas(&door), [40, 200, 720]);
    }

    #[test]
    fn bare_leaves_and_panes_in_a_row_are_one_filling() {
        assert_eq!(
            areas(&[bare([0.0, 0.0, 2.0, 2.4]), bare([2.0, 0.0, 4.0, 2.4])]),
            [960]
        );
        // Two rows of panes.
        let grid: Vec<Plate<'_>> = (0..8)
            .map(|i| (f64::from(i % 4), 1.2 * f64::from(i / 4)))
            .map(|(x, y)| bare([x, y, x + 1.0, y + 1.2]))
            .collect();
        assert_eq!(areas(&grid), [480, 480]);
    }

    #[test]
    fn leaves_of_a_double_door_are_one_filling_and_what_stands_beside_them_is_not() {
        let left = || window([0.0, 0.0, 1.2, 2.4]);
        let right = || window([1.2, 0.0, 2.4, 2.4]);
        let light = || window([2.4, 0.0, 4.0, 2.4]);
        assert_eq!(areas_over(&[left(), right(), light()], true), [384, 576]);
        // Above a sill they are windows.
        assert_eq!(areas(&[left(), right(), light()]), [288, 288, 384]);
    }

    #[test]
    fn plates_that_do_not_fill_the_opening_part_nothing() {
        let left = || window([0.0, 0.0, 2.0, 2.4]);
        assert_eq!(areas(&[left()]), [960]);
        // In front of both, as a curtain.
        let curtain = bare([0.0, 0.0, 4.0, 2.4]);
        assert_eq!(
            areas(&[left(), window([2.0, 0.0, 4.0, 2.4]), curtain]),
            [960]
        );
        // Mostly on the wall beside the opening, and a strip too narrow for a plate.
        assert_eq!(areas(&[left(), window([3.5, 0.0, 6.0, 2.4])]), [960]);
        assert!(Plate::of(block([3.96, 0.0, 4.0, 2.4], 0.02)).is_none());
        // Far from the plane.
        let mut far = block([2.0, 0.0, 4.0, 2.4], 0.02);
        far.iter_mut().flatten().for_each(|p| p.z += 0.5);
        assert_eq!(areas(&[left(), plate(far)]), [960]);
    }
}
