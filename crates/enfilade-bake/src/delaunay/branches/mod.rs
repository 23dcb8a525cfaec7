//! Branches: tubes that leave a wider room though nothing pinches them.
//!
//! What decimation weighs is a pinch, and a tube that leaves a trunk has none: every ball of the tube passes its mouth. What
//! distinguishes the two is that the trunk's balls do not get in. So each room is opened by balls, from wide to narrow, into
//! limbs; the limb of the room's largest ball is its trunk. What is left between limbs goes to the one that reaches it by the
//! widest way. Each limb but the trunks is then measured and classified:
//!
//! - it has one mouth: what has two is a neck between chambers, or a ring;
//! - no opening leads from it to a room that is wider than its mouth, for the same reason;
//! - its mouth is not much longer than wide, so it is no slit under a bed, along a wall or in a corner;
//! - it is deep, so it is no alcove;
//! - the trunk is much wider near the mouth, so it is no tube that tapers.
//!
//! Outdoors is a room, too, and what branches off it is a room: a tube that is open at its ends, a tunnel, a garage, a living
//! room with its terrace door open. It may have several mouths, none a slit, and doors to rooms.
//!
//! All else is merged across its largest opening. Pockets between rough walls and the balls of a room count as branches, too; they hold
//! less than a ball, and decimation takes them for the spikes that they are. Where a trunk divides into arms as wide as itself
//! no ball tells them apart; `forks` does.
//!
//! | file | answers |
//! | --- | --- |
//! | `regions` | which parts are connected, and by how wide a ball |
//! | `measure` | what the facts of a limb are |
//! | `rule` | what a limb or an arm with such facts is: all bounds, and nothing else |
//! | `flare` | where in its mouth a limb begins |
//! | `forks`, `arms`, `separate` | where tubes of one width meet, and how they are separated |
//! | `labels` | what the rest of the builder sees of it |

mod arms;
mod flare;
mod forks;
mod labels;
mod measure;
mod regions;
mod rule;
mod separate;

use std::collections::BTreeSet;

use enfilade_geom::{Allowance, Bvh, Triangle};

use super::space::Space;
use arms::Walls;
pub(super) use labels::Branches;
use regions::{NONE, TubeRegions};
use rule::{LimbKind, classify};

/// Finds the branches of rooms, given by the room of each part.
///
/// `O(n log n)` in parts, and the parts of trunks times their limbs.
pub(super) fn find_branches(
    space: &Space,
    room_of_part: &[u32],
    walls: &[Triangle],
    bvh: &Bvh,
    allowance: &Allowance,
) -> Branches {
    let mut regions = TubeRegions::new(space, room_of_part, allowance);
    let limbs = open_rooms(&mut regions);
    // Narrow ones first: what is no branch is merged into a wider limb, which may be one.
    for limb in limbs.into_iter().rev() {
        for limb in regions.without_flare(limb) {
            settle(&mut regions, limb);
        }
    }
    regions.separate_forks(&Walls {
        triangles: walls,
        bvh,
    });
    regions.finished()
}

/// Divides rooms into trunks and limbs; gives the limbs, widest first.
fn open_rooms(regions: &mut TubeRegions<'_>) -> Vec<u32> {
    let mut has_trunk = BTreeSet::new();
    let (mut limbs, mut seeds) = (Vec::new(), Vec::new());
    for b in regions.by_radius(0..regions.owner.len() as u32) {
        if regions.owner[b as usize] != NONE {
            continue;
        }
        let limb = regions.open_limb(b);
        // The first limb of a room is its trunk.
        let is_trunk = has_trunk.insert(regions.room_of_part[b as usize]);
        if !is_trunk && !regions.is_long(limb) {
            regions.dissolve(limb);
            continue;
        }
        seeds.extend(&regions.regions[limb as usize].parts);
        if !is_trunk {
            limbs.push(limb);
        }
    }
    regions.flood(&seeds);
    limbs
}

/// Makes a limb a branch, or merges it across its widest mouth.
fn settle(regions: &mut TubeRegions<'_>, limb: u32) {
    let mouths = regions.mouths(limb);
    match (classify(&regions.facts(limb, &mouths)), mouths.first()) {
        (LimbKind::Branch(mouth), _) => regions.regions[limb as usize].branch = Some(mouth),
        (_, Some(widest)) => regions.merge(limb, widest.parent),
        (_, None) => {}
    }
}
