//! Special portals in made worlds: mirrors, teleporters and one-way places.

use enfilade_cpg::{CellId, Pass, PortalId, SpecialId, SpecialPortal, SpecialShape, Way, World};
use enfilade_geom::{DMat4, DQuat, DVec3, Similarity};

use super::{GridParams, room_grid, scaled_world};
use crate::assembled::{Assembled, Standing, assembled};
use enfilade_demo::Rng;

/// Distance of a made surface from the wall behind it. [Units: wu]
const OFF_WALL: f64 = 1e-3;

/// A rectangle on a wall of a cell.
struct OnWall {
    cell: CellId,
    center: DVec3,
    normal: DVec3,
    /// Half edges: to the right as seen from the cell, and up.
    half: [DVec3; 2],
}

impl OnWall {
    /// Chooses an upright rectangle on a wall of a cell's box, with a random place and the given half size.
    fn random(world: &World, cell: CellId, half: [f64; 2], rng: &mut Rng) -> Self {
        let point = |p: [f32; 3]| DVec3::from_array(p.map(f64::from));
        let [low, high] = world.graph[cell].aabb.map(point);
        let (axis, side) = ([DVec3::X, DVec3::Z][rng.below(2)], rng.below(2));
        let normal = axis * [-1.0, 1.0][side];
        let right = normal.cross(DVec3::Y);
        let size = high - low;
        let room = |along: DVec3, half: f64| (along.abs().dot(size) * 0.5 - half - 0.05).max(0.0);
        let middle = (low + high) * 0.5;
        let off = normal * (axis.dot(size) * 0.5 - OFF_WALL);
        let mut shift = |along: DVec3, half: f64| along * rng.range(-1.0, 1.0) * room(along, half);
        let center = middle + off + shift(right, half[0]) + shift(DVec3::Y, half[1]);
        Self {
            cell,
            center,
            normal,
            half: [right * half[0], DVec3::Y * half[1]],
        }
    }

    fn shape(&self) -> SpecialShape {
        let [r, u] = self.half;
        // Counter-clockwise about the normal, which points away from those who look.
        let corners = [-r - u, u - r, r + u, r - u].map(|d| self.center + d);
        SpecialShape::Surface {
            normal: self.normal.as_vec3().to_array(),
            pieces: vec![corners.map(|p| p.as_vec3().to_array()).to_vec()],
        }
    }

    /// Returns the rotation from axes right, up and out of the cell.
    fn turn(&self) -> DQuat {
        let [r, u] = self.half.map(DVec3::normalize);
        DQuat::from_mat3(&enfilade_geom::DMat3::from_cols(r, u, -self.normal)).normalize()
    }
}

/// Returns a special portal with one untinted pass.
fn special(name: &str, at: &OnWall, way: Way) -> SpecialPortal {
    SpecialPortal {
        name: name.into(),
        cell: at.cell,
        shape: at.shape(),
        passes: vec![Pass::new(way)],
    }
}

/// Adds special portals to the walls of random rooms: `n` mirrors, `n` pairs of rectangles that lead into each other, and `n`
/// that lead to a turned and scaled place in the air of a room, one way. Rooms must be boxes, not rotated.
#[must_use]
pub fn with_specials(mut world: World, n: usize, seed: u64) -> World {
    let mut rng = Rng::new(seed);
    let rooms: Vec<CellId> = world.graph.indoor_cells().map(|(id, _)| id).collect();
    for _ in 0..n {
        let at = |half: [f64; 2], rng: &mut Rng| {
            let cell = rooms[rng.below(rooms.len())];
            OnWall::random(&world, cell, half, rng)
        };
        let mirror = at([rng.range(0.3, 1.2), rng.range(0.3, 1.2)], &mut rng);
        let half = [rng.range(0.3, 1.0), rng.range(0.3, 1.2)];
        let [a, b] = [at(half, &mut rng), at(half, &mut rng)];
        let one_way = at([0.5, 0.5], &mut rng);
        let goal = rooms[rng.below(rooms.len())];
        world
            .graph
            .specials
            .push(special("mirror", &mirror, Way::Mirror));
        world
            .graph
            .specials
            .extend(linked(&a, &b, world.graph.specials.len() as u32));
        let [low, high] = world.graph[goal]
            .aabb
            .map(|p| DVec3::from_array(p.map(f64::from)));
        let axis = DVec3::new(
            rng.range(-1.0, 1.0),
            rng.range(-1.0, 1.0),
            rng.range(-1.0, 1.0),
        );
        let turn = DQuat::from_axis_angle(axis.normalize_or(DVec3::Y), rng.range(-3.0, 3.0));
        let scale = rng.range(0.3, 1.5) * [1.0, -1.0][rng.below(2)];
        let to = low.lerp(high, 0.5);
        let map = Similarity {
            turn,
            at: to - turn * (one_way.center * scale),
            scale,
        };
        let way = Way::Lead {
            to: goal,
            map,
            back: None,
        };
        world.graph.specials.push(special("one way", &one_way, way));
    }
    world
}

/// Returns two rectangles of one size that lead into each other; they are numbered from `first`.
fn linked(a: &OnWall, b: &OnWall, first: u32) -> [SpecialPortal; 2] {
    let lead = |from: &OnWall, to: &OnWall, back: u32| {
        // Half a turn about the upward axis: out of one room is into the other.
        let turn =
            (to.turn() * DQuat::from_rotation_y(std::f64::consts::PI)) * from.turn().conjugate();
        Way::Lead {
            to: to.cell,
            map: Similarity::rigid(turn.normalize(), to.center - turn * from.center),
            back: Some(SpecialId(back)),
        }
    };
    [
        special("there", a, lead(a, b, first + 1)),
        special("back", b, lead(b, a, first)),
    ]
}

/// Puts a scaled copy of a world at a pose beside it, and makes one doorway of the first lead into the copy, and the copy's back
/// into the first. Nobody in the doorway's first cell can tell the result from the world itself: what lies behind the doorway looks
/// the same, is as far, and stops the same bodies. Scaled copies have doors without motion.
///
/// # Panics
///
/// If there is no such portal.
#[must_use]
pub fn linked_copies(world: &World, portal: PortalId, map: &Similarity) -> World {
    assert!(map.scale > 0.0, "copies are not reflected");
    let scaled;
    let copy = if map.scale == 1.0 {
        world
    } else {
        scaled = scaled_world(world.clone(), map.scale as f32);
        &scaled
    };
    let standing = |world, turn, at| Standing { world, turn, at };
    let both = [
        standing(world, DQuat::IDENTITY, DVec3::ZERO),
        standing(copy, map.turn, map.at),
    ];
    let Assembled {
        mut world,
        first_cell,
    } = assembled(&both, &[]);
    let [here, behind] = both[0].world.graph[portal].cells;
    let there = CellId(behind.0 + first_cell[1]);
    // Portals of the copy that lead outdoors are left out.
    let between = |p: &&PortalId| {
        let cells = world.graph[**p]
            .cells
            .map(|c| c.0.wrapping_sub(first_cell[1]));
        cells == [here.0, behind.0]
    };
    let same = |p: &&PortalId| {
        let nth = |of: PortalId, cells: [CellId; 2]| {
            let before = (0..of.0).map(PortalId);
            before.filter(|q| world.graph[*q].cells == cells).count()
        };
        nth(**p, world.graph[**p].cells) == nth(portal, [here, behind])
    };
    let all: Vec<PortalId> = world.graph.portal_ids().collect();
    let twin = *all
        .iter()
        .filter(between)
        .find(same)
        .expect("the copy's doorway");
    let lead = |to: CellId, map: Similarity, back: u32| {
        let back = Some(SpecialId(back));
        vec![Pass::new(Way::Lead { to, map, back })]
    };
    world.graph.specials = vec![
        SpecialPortal {
            name: "there".into(),
            cell: here,
            shape: SpecialShape::Portal(portal),
            passes: lead(there, *map, 1),
        },
        SpecialPortal {
            name: "back".into(),
            cell: there,
            shape: SpecialShape::Portal(twin),
            passes: lead(here, map.inverse(), 0),
        },
    ];
    world
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// A room whose walls lead into each other through squares of 2 m in their middles: opposite ones, as in Gjørup 1999, section
/// 3.4.2; or `turned`, neighboring ones.
#[must_use]
pub fn endless_room(turned: bool) -> World {
    let mut world = room_grid(&GridParams {
        size: [1, 1, 1],
        windows: 0.0,
        furniture: 0,
        outdoors: false,
        ..GridParams::offices(1, 1)
    });
    let [low, high] = world.graph.cells[0].aabb.map(point);
    // 2 m by 2 m in the middle of each of the four walls.
    let middle = (low + high) * 0.5;
    let half = (high - low) * 0.5;
    let walls: Vec<(DVec3, DVec3)> = [DVec3::X, DVec3::NEG_X, DVec3::Z, DVec3::NEG_Z]
        .map(|n| (n, middle + n * (n.abs().dot(half) - 1e-3)))
        .to_vec();
    let pairs = if turned { [2, 3, 1, 0] } else { [1, 0, 3, 2] };
    for (i, (normal, center)) in walls.iter().enumerate() {
        let right = normal.cross(DVec3::Y);
        let corners = [
            -right - DVec3::Y,
            DVec3::Y - right,
            right + DVec3::Y,
            right - DVec3::Y,
        ];
        // Out of one wall is into the other.
        let (out, at) = walls[pairs[i]];
        let turn = DQuat::from_rotation_y(normal.cross(-out).y.atan2(normal.dot(-out)));
        let map = Similarity::rigid(turn, at - turn * *center);
        world.graph.specials.push(SpecialPortal {
            name: String::new(),
            cell: CellId(0),
            shape: SpecialShape::Surface {
                normal: normal.as_vec3().to_array(),
                pieces: vec![corners.map(|c| (*center + c).as_vec3().to_array()).to_vec()],
            },
            passes: vec![Pass::new(Way::Lead {
                to: CellId(0),
                map,
                back: None,
            })],
        });
    }
    world
}

/// Returns the end of a segment, the matrix to there, and where and along which direction it passes which special portals,
/// and how near it comes to a rim: by matrices and planes alone.
///
/// # Panics
///
/// If a special portal does not lead anywhere.
#[must_use]
pub fn traced_step(
    world: &World,
    mut from: DVec3,
    mut by: DVec3,
) -> (DVec3, DMat4, Vec<(usize, DVec3, DVec3)>, f64) {
    let (mut whole, mut crossings) = (DMat4::IDENTITY, Vec::new());
    let mut nearest = f64::INFINITY;
    loop {
        let mut first: Option<(f64, usize)> = None;
        for k in 0..world.graph.specials.len() {
            let (normal, pieces) = world.graph.special_opening(SpecialId(k as u32));
            let corners = &pieces[0].points;
            let t = normal.dot(corners[0] - from) / normal.dot(by);
            let p = from + by * t;
            let [u, v] = [corners[1] - corners[0], corners[3] - corners[0]];
            let [x, y] = [u, v].map(|e| e.dot(p - corners[0]) / e.length_squared());
            let is_in = (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y);
            let is_met = normal.dot(by) > 0.0 && (0.0..1.0).contains(&t);
            // From the nearest rim, inside or outside.
            let off = |x: f64, edge: DVec3| x.min(1.0 - x) * edge.length();
            let off = off(x, u).min(off(y, v)).abs();
            if is_met {
                nearest = nearest.min(off);
            }
            if is_met && is_in && first.is_none_or(|f| t < f.0) {
                first = Some((t, k));
            }
        }
        let Some((t, k)) = first else {
            return (from + by, whole, crossings, nearest);
        };
        let Way::Lead { map, .. } = &world.graph.specials[k].passes[0].way else {
            panic!("leads")
        };
        let matrix = map.matrix();
        crossings.push((k, from + by * t, by.normalize()));
        (from, by) = (
            matrix.transform_point3(from + by * t),
            matrix.transform_vector3(by * (1.0 - t)),
        );
        whole = matrix * whole;
    }
}
