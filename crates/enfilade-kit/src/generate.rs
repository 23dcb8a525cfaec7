//! Levels by chance: examples of how programs put levels together, one for each way to do so.
//!
//! - [`dungeon`] *tries*: it places what fits, and takes back what leads nowhere.
//! - [`office`] follows a *grammar*: wings of corridor segments, rooms along them.
//! - [`maze`] *plans* first, and puts tiles where the plan says; openings that meet join by themselves.
//!
//! Equal kits, seeds and sizes give equal levels.

use enfilade_geom::{DQuat, DVec3};
use enfilade_world::Pose;

use crate::assembly::Assembly;
use crate::error::PlaceError;
use crate::instance::{End, InstanceId, PlaceOptions};

/// Tries for each requested room before a level counts as full.
const TRIES: usize = 40;

/// A sequence of random numbers (Vigna 2015, splitmix64).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    /// Returns a number from 0 to `n - 1`.
    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn pick<'a, T>(&mut self, items: &'a [T]) -> Option<&'a T> {
        items.get(self.below(items.len()))
    }
}

fn piece(level: &Assembly, name: &str) -> Result<usize, PlaceError> {
    let number = level.kit().named(name);
    number.ok_or_else(|| PlaceError::NoPiece(name.to_owned()))
}

/// Returns the open attachments of an instance.
fn open_ends(level: &Assembly, instance: InstanceId) -> Vec<End> {
    level.open_ends_of(instance).collect()
}

/// Places a piece by an attachment chosen by chance; `None` if it is refused.
fn attach(
    level: &mut Assembly,
    chance: &mut Chance,
    piece: usize,
    onto: End,
) -> Option<InstanceId> {
    let n = level.kit().pieces()[piece].attachments().len();
    let attachment = chance.below(n);
    let options = PlaceOptions::default();
    level.place(piece, attachment, onto, &options).ok()
}

/// Grows a dungeon of `n_rooms` chambers and halls, each at the end of a corridor, stair or crossing, and closes what is left open
/// by niches where they fit, or by plugs. Returns the number of rooms, less than requested if nothing more fits.
///
/// The kit needs the pieces `hall`, `chamber`, `corridor`, `bend`, `cross`, `stair` and `niche`, and may have a `plug`: a wall in front of
/// a doorway, with the middle of the sill at its origin and the way out along +z.
///
/// # Errors
///
/// If the kit lacks a piece, or the first hall is refused.
pub fn dungeon(level: &mut Assembly, n_rooms: usize, seed: u64) -> Result<usize, PlaceError> {
    let mut chance = Chance(seed);
    let named = |level: &Assembly, names: &[&str]| -> Result<Vec<usize>, PlaceError> {
        names.iter().map(|name| piece(level, name)).collect()
    };
    let rooms = named(level, &["chamber", "chamber", "hall"])?;
    let ways = named(level, &["corridor", "corridor", "bend", "cross", "stair"])?;
    let niche = piece(level, "niche")?;
    let first = level.put(rooms[2], Pose::IDENTITY, &PlaceOptions::default())?;
    let mut ends = open_ends(level, first);
    let (mut n, mut tries) = (1, 0);
    while n < n_rooms && !ends.is_empty() && tries < TRIES * n_rooms {
        tries += 1;
        let at = chance.below(ends.len());
        let way = ways[chance.below(ways.len())];
        let room = rooms[chance.below(rooms.len())];
        let Some(way) = attach(level, &mut chance, way, ends[at]) else {
            continue;
        };
        let exits = open_ends(level, way);
        let exit = chance.pick(&exits).copied();
        match exit.and_then(|exit| attach(level, &mut chance, room, exit)) {
            Some(room) => {
                n += 1;
                ends.swap_remove(at);
                ends.extend(open_ends(level, way));
                ends.extend(open_ends(level, room));
            }
            // A way to nowhere.
            None => {
                level.undo();
            }
        }
    }
    let left: Vec<End> = level.open_ends().collect();
    for end in left {
        if attach(level, &mut chance, niche, end).is_none() {
            wall_up(level, end);
        }
    }
    Ok(n)
}

/// Puts a wall in front of an open attachment, if the kit has one, and it fits.
fn wall_up(level: &mut Assembly, end: End) {
    if let (Some(plug), Ok(host)) = (level.kit().named("plug"), level.standing(end.instance)) {
        let mouth = &level.piece(end.instance).attachments()[end.attachment].mouth;
        let pose = host.pose.after(&mouth.frame);
        let _ = level.put(plug, pose, &PlaceOptions::default());
    }
}

/// Builds an office of `n_rooms` rooms: wings of corridor segments with offices and meeting rooms on both sides, which start at
/// lobbies. Returns the number of rooms, less than requested if nothing more fits.
///
/// The kit needs the pieces `lobby`, `corridor` with the attachments `west`, `east`, `north` and `south`, `office` and `meeting`.
///
/// # Errors
///
/// If the kit lacks a piece or attachment, or the first lobby is refused.
pub fn office(level: &mut Assembly, n_rooms: usize, seed: u64) -> Result<usize, PlaceError> {
    let mut chance = Chance(seed);
    let [lobby, corridor] = [piece(level, "lobby")?, piece(level, "corridor")?];
    let rooms = [piece(level, "office")?, piece(level, "meeting")?];
    let along = |level: &Assembly, name: &str| {
        let own = &level.kit().pieces()[corridor];
        own.attachment_named(name)
            .ok_or_else(|| PlaceError::NoAttachment {
                of: "corridor".into(),
                name: name.into(),
                known: own.attachments().iter().map(|a| a.name.clone()).collect(),
            })
    };
    let [west, east] = [along(level, "west")?, along(level, "east")?];
    let sides = [along(level, "north")?, along(level, "south")?];
    let options = PlaceOptions::default();
    let first = level.put(lobby, Pose::IDENTITY, &options)?;
    let mut starts = open_ends(level, first);
    let (mut n, mut tries) = (0, 0);
    while n < n_rooms && !starts.is_empty() && tries < TRIES * n_rooms {
        tries += 1;
        let mut end = starts.swap_remove(chance.below(starts.len()));
        for _ in 0..3 + chance.below(5) {
            if n == n_rooms {
                break;
            }
            let Ok(segment) = level.place(corridor, west, end, &options) else {
                break;
            };
            for side in sides {
                let onto = End {
                    instance: segment,
                    attachment: side,
                };
                let room = rooms[usize::from(chance.below(4) == 0)];
                if n < n_rooms && attach(level, &mut chance, room, onto).is_some() {
                    n += 1;
                }
            }
            end = End {
                instance: segment,
                attachment: east,
            };
        }
        if n < n_rooms
            && let Some(lobby) = attach(level, &mut chance, lobby, end)
        {
            starts.extend(open_ends(level, lobby));
        }
    }
    Ok(n)
}

/// Sides of a tile in the order east, south, west, north, each a quarter turn after the one before.
const SIDES: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// Builds a maze of square tiles, `side` × `side` of them: a tree of ways, with a loop for every ten tiles, an entrance and an exit.
///
/// The kit needs the pieces `end`, `straight`, `turn`, `fork` and `crossing`, of one square size around the origin in plan, with
/// doorways in the middle of the sides: of `end` in the south, of `straight` in the south and north, of `turn` in the east and
/// south, of `fork` in the east, south and north.
///
/// # Errors
///
/// If the kit lacks a piece, or a tile is refused because the pieces are not as described.
pub fn maze(level: &mut Assembly, side: usize, seed: u64) -> Result<usize, PlaceError> {
    let mut chance = Chance(seed);
    let plan = maze_plan(side, &mut chance);
    let width = level.kit().pieces()[piece(level, "crossing")?]
        .bounds()
        .size()
        .x;
    for (i, openings) in plan.iter().enumerate() {
        let (name, quarters) = tile(*openings);
        let number = piece(level, name)?;
        let [x, z] = [i % side, i / side].map(|k| width * k as f64);
        let pose = Pose {
            turn: DQuat::from_rotation_y(-f64::from(quarters) * std::f64::consts::FRAC_PI_2),
            at: DVec3::new(x, 0.0, z),
        };
        level.put(number, pose, &PlaceOptions::default())?;
    }
    Ok(plan.len())
}

/// Returns the open sides of all tiles of a maze.
fn maze_plan(side: usize, chance: &mut Chance) -> Vec<[bool; 4]> {
    let n = side * side;
    let mut plan = vec![[false; 4]; n];
    let beyond = |tile: usize, k: usize| {
        let [x, z] = [tile % side, tile / side].map(|v| v as i64);
        let [x, z] = [x + SIDES[k][0], z + SIDES[k][1]];
        let is_in = |v: i64| (0..side as i64).contains(&v);
        (is_in(x) && is_in(z)).then(|| (z * side as i64 + x) as usize)
    };
    let open = |plan: &mut Vec<[bool; 4]>, tile: usize, k: usize| {
        if let Some(other) = beyond(tile, k) {
            plan[tile][k] = true;
            plan[other][(k + 2) % 4] = true;
        }
    };
    // A walk that turns back where it is stuck.
    let mut is_known = vec![false; n];
    let mut walk = vec![0];
    is_known[..1.min(n)].fill(true);
    while let Some(&tile) = walk.last().filter(|_| n > 0) {
        let free = |k: &usize| beyond(tile, *k).is_some_and(|t| !is_known[t]);
        let ways: Vec<usize> = (0..4).filter(free).collect();
        let Some(&k) = chance.pick(&ways) else {
            walk.pop();
            continue;
        };
        open(&mut plan, tile, k);
        if let Some(next) = beyond(tile, k) {
            is_known[next] = true;
            walk.push(next);
        }
    }
    for _ in 0..n / 10 {
        open(&mut plan, chance.below(n), chance.below(4));
    }
    if let (Some(first), true) = (plan.first_mut(), n > 0) {
        first[2] = true;
    }
    if let Some(last) = plan.last_mut() {
        last[0] = true;
    }
    plan
}

/// Returns the tile with these open sides, and the quarter turns from east to south that it needs.
fn tile(openings: [bool; 4]) -> (&'static str, u32) {
    let shapes = [
        ("end", [false, true, false, false]),
        ("straight", [false, true, false, true]),
        ("turn", [true, true, false, false]),
        ("fork", [true, true, false, true]),
        ("crossing", [true; 4]),
    ];
    for (name, sides) in shapes {
        for quarters in 0..4 {
            let turned = |k: usize| sides[(k + 4 - quarters) % 4];
            if (0..4).all(|k| turned(k) == openings[k]) {
                return (name, quarters as u32);
            }
        }
    }
    ("end", 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Covers W14: every tile of a maze is reached, and openings of neighbors agree.
    #[test]
    fn a_maze_leads_everywhere() {
        let side = 9;
        let plan = maze_plan(side, &mut Chance(3));
        let mut is_reached = vec![false; side * side];
        let mut stack = vec![0_usize];
        while let Some(at) = stack.pop() {
            if std::mem::replace(&mut is_reached[at], true) {
                continue;
            }
            let [x, z] = [at % side, at / side].map(|v| v as i64);
            for k in (0..4).filter(|k| plan[at][*k]) {
                let [x, z] = [x + SIDES[k][0], z + SIDES[k][1]];
                if x >= 0 && z >= 0 && x < side as i64 && z < side as i64 {
                    let other = (z * side as i64 + x) as usize;
                    assert!(plan[other][(k + 2) % 4]);
                    stack.push(other);
                }
            }
        }
        assert!(is_reached.iter().all(|r| *r));
    }

    /// Covers W14.
    #[test]
    fn every_tile_is_turned_so_that_its_doorways_are_where_the_plan_has_them() {
        let (east, south, west, north) = (1, 2, 4, 8);
        let known = [
            (south, ("end", 0)),
            (west, ("end", 1)),
            (east, ("end", 3)),
            (east | west, ("straight", 1)),
            (south | west, ("turn", 1)),
            (north | east, ("turn", 3)),
            (south | west | east, ("fork", 1)),
            (east | south | west | north, ("crossing", 0)),
        ];
        for (mask, expected) in known {
            assert_eq!(tile([0, 1, 2, 3].map(|k| mask >> k & 1 == 1)), expected);
        }
    }
}
