//! Portals as they are stored, and the cells that they join where a shape meets them: the judge of things in cells.

use enfilade::World;
use enfilade::cpg::Portal;
use enfilade::geom::{Aabb, DVec3, Triangle};
use enfilade::internals::geom::Sets;
use enfilade::world::Pose;
use enfilade_testkit::oracle::{ball_meets, box_meets};

use crate::measure::point;

/// A portal as stored.
pub(super) struct Gap {
    cells: [u32; 2],
    pieces: Vec<Vec<DVec3>>,
    bounds: Aabb,
}

impl Gap {
    pub(super) fn of(portal: &Portal) -> Self {
        let polygon = |p: &Vec<[f32; 3]>| p.iter().map(|c| point(*c)).collect();
        let pieces: Vec<Vec<DVec3>> = portal.pieces.iter().map(polygon).collect();
        Self {
            cells: portal.cells.map(|c| c.0),
            bounds: Aabb::of_points(pieces.iter().flatten()),
            pieces,
        }
    }

    pub(super) fn triangles(&self) -> impl Iterator<Item = Triangle> {
        let fan = |p: &Vec<DVec3>| {
            let p = p.clone();
            (2..p.len()).map(move |i| [p[0], p[i - 1], p[i]])
        };
        self.pieces.iter().flat_map(fan)
    }
}

pub(super) fn gaps_of(world: &World) -> Vec<Gap> {
    world.graph.portals.iter().map(Gap::of).collect()
}

/// Returns the sets of cells joined by the openings that a ball or box meets.
pub(super) fn joined(
    gaps: &[Gap],
    n_cells: usize,
    half: DVec3,
    is_ball: bool,
    pose: &Pose,
) -> Sets {
    let mut sets = Sets::new(n_cells);
    let reach = half.length();
    for gap in gaps {
        if gap.bounds.distance_squared(pose.at) > reach * reach {
            continue;
        }
        let is_met = gap.pieces.iter().any(|piece| {
            if is_ball {
                ball_meets(half.x, pose.at, piece)
            } else {
                box_meets(half, pose.turn, pose.at, piece)
            }
        });
        if is_met {
            sets.join(gap.cells[0], gap.cells[1]);
        }
    }
    sets
}
