//! Shells of rooms that are coarser than the model, for programs that want few faces, all of them sound.
//!
//! Space is cut into bricks by the planes of large walls, floors and ceilings; each brick belongs to the room that has most of it, and
//! a room is the union of its bricks. So shells close, are planar, do not collide, and surfaces of two rooms that answer each other
//! are equal, all by construction. Reveals, steps, beams and other details vanish.
//!
//! | stage | file |
//! | --- | --- |
//! | axes along the walls | `frame` |
//! | planes that cut space, those close to one another as one | `lines` |
//! | the room of each brick | `bricks` |
//! | faces of rooms, and what lies behind through bricks of matter | `shell` |
//!
//! A room whose volume changes much gets more planes. Where a face is too small, the two planes that made it so become one; so this
//! ends, at last with bricks that have no small face.

mod bricks;
mod frame;
mod lines;
mod shell;

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, World};

use crate::surfaces::{RoomSurfaces, SurfaceLevel, SurfaceOptions, flat_openings, room_surfaces};

use bricks::Bricks;
pub(crate) use frame::Frame;
use lines::Lines;

/// Change of a room's volume, as a share, beyond which it gets more planes.
const ROUGH: f64 = 0.015;
/// Times that rooms may get more planes.
const REFINED: u32 = 2;
/// Rounds in which planes around small faces become one before all planes keep a larger distance.
const SINGLY: i32 = 8;
/// Smallest area of a face: clients drop those of 0.01. [Units: wu²]
const SMALLEST: f64 = 0.0125;

/// A room as a shell with few faces.
pub(crate) struct CoarseRoom {
    /// Its surfaces, with the axes of the frame; none is an opening.
    pub(crate) shell: RoomSurfaces,
    /// The volume that it has in the model, without the recesses of openings. [Units: wu³]
    pub(crate) true_volume: f64,
}

/// All rooms as shells, with the axes in which they are told.
pub(crate) struct CoarseRooms {
    pub(crate) frame: Frame,
    pub(crate) rooms: Vec<CoarseRoom>,
}

/// Returns the rooms as coarse shells, by cell; those smaller than a brick are left out. The world must be valid.
///
/// Time: that of [`room_surfaces`], and O(bricks).
pub(crate) fn coarse_rooms(world: &World) -> CoarseRooms {
    let options = SurfaceOptions {
        level: SurfaceLevel::First,
        by_object: false,
        ..flat_openings()
    };
    let mut exact = room_surfaces(world, &options);
    exact.retain(|r| world.graph[r.cell].is_indoors());
    let frame = Frame::along_walls(&exact);
    exact.iter_mut().for_each(|r| frame.turn(r));
    let mut fineness = vec![0; world.graph.cells.len()];
    let (mut lines, mut bricks);
    loop {
        lines = Lines::of_rooms(world, &frame, &exact, &fineness);
        bricks = Bricks::new(world, &frame, &exact, &lines);
        let mut rough: BTreeSet<CellId> = BTreeSet::new();
        for room in &exact {
            let change = (bricks.volume(room.cell) - room.volume).abs() / room.volume;
            if world.graph[room.cell].is_room() && change > ROUGH {
                rough.insert(room.cell);
            }
        }
        rough.retain(|c| fineness[c.idx()] < REFINED);
        if rough.is_empty() {
            break;
        }
        rough.iter().for_each(|c| fineness[c.idx()] += 1);
    }
    let mut round = 0;
    let shells = loop {
        let shells = shell::shells(world, &bricks);
        let small = shells.iter().flat_map(|r| &r.surfaces);
        let small = small.filter(|s| s.area < SMALLEST);
        if !lines.merge_around(small) {
            break shells;
        }
        round += 1;
        if round > SINGLY {
            lines.thin(round - SINGLY);
        }
        bricks = Bricks::new(world, &frame, &exact, &lines);
    };
    let rooms = shells.into_iter().map(|shell| CoarseRoom {
        true_volume: exact
            .iter()
            .find(|r| r.cell == shell.cell)
            .map_or(0.0, |r| r.volume),
        shell,
    });
    CoarseRooms {
        frame,
        rooms: rooms.collect(),
    }
}
