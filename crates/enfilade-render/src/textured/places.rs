//! Places where a walker may stand.

use enfilade_cpg::{Cell, CellId, World};
use enfilade_runtime::{Sight, Sightlines};

use crate::viewpoints::EYE_HEIGHT;

/// Distance between neighboring places. [Units: wu]
const SPACING: f32 = 0.75;

/// Most places of a cell along each axis; in larger cells they are farther apart.
const MOST: u32 = 65;

/// Most floors above each other in a cell.
const MOST_FLOORS: usize = 8;

/// A place to stand, with others around it that see much the same.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StandingPlace {
    pub(super) eye: [f32; 3],
    /// Eyes up to half-way to the neighbors, in the same cell.
    pub(super) around: Vec<[f32; 3]>,
}

/// Returns the places in all cells. The middle of each cell is one if it has a floor. Cells without floor have none.
pub(super) fn standing_places(world: &World, sight: &Sight) -> Vec<StandingPlace> {
    let lines = Sightlines::build(world);
    let mut out = Vec::new();
    for (id, cell) in (0..).map(CellId).zip(&world.graph.cells) {
        places_in(&mut out, sight, &lines, id, cell);
    }
    out
}

fn places_in(
    out: &mut Vec<StandingPlace>,
    sight: &Sight,
    lines: &Sightlines,
    id: CellId,
    cell: &Cell,
) {
    let [low, high] = cell.aabb;
    // Odd, so that the middle is one of them.
    let along = |k: usize| {
        let width = high[k] - low[k];
        let half = (width * 0.5 / SPACING).floor().max(0.0) as u32;
        let n = 2 * half.min(MOST / 2) + 1;
        let step = if n < MOST {
            SPACING
        } else {
            width / MOST as f32
        };
        let middle = (low[k] + high[k]) * 0.5;
        let at = move |i: u32| middle + (i as f32 - (n / 2) as f32) * step;
        (0..n).map(at).collect::<Vec<f32>>()
    };
    let is_here = |eye: &[f32; 3]| sight.locate(*eye) == Some(id);
    for x in along(0) {
        for z in along(2) {
            for eye in eyes_above(lines, [x, z], [low[1], high[1]]) {
                if !is_here(&eye) {
                    continue;
                }
                let third = SPACING / 3.0;
                let offsets =
                    [-third, 0.0, third].map(|dx| [-third, 0.0, third].map(|dz| [dx, dz]));
                let moved = |[dx, dz]: &[f32; 2]| [eye[0] + dx, eye[1], eye[2] + dz];
                let around = offsets.as_flattened().iter().map(moved).filter(is_here);
                out.push(StandingPlace {
                    eye,
                    around: around.collect(),
                });
            }
        }
    }
}

/// Returns the eyes of those who stand on the floors of a vertical line, from above.
fn eyes_above(lines: &Sightlines, [x, z]: [f32; 2], [low, high]: [f32; 2]) -> Vec<[f32; 3]> {
    let mut out = Vec::new();
    let mut top = high;
    let bottom = low - 0.05;
    for _ in 0..MOST_FLOORS {
        if top <= bottom {
            break;
        }
        let Some(hit) = lines.first_hit([x, top, z], [x, bottom, z]) else {
            break;
        };
        let floor = top + (bottom - top) * hit.t as f32;
        let eye = [x, floor + EYE_HEIGHT, z];
        // The lower side of a slab is not a floor.
        if lines.first_hit(eye, [x, floor + 0.05, z]).is_none() {
            out.push(eye);
        }
        top = floor - 0.05;
    }
    out
}
