//! Branches: tubes that leave a wider room although nothing narrows at their mouths.
//!
//! Decimation weighs pinches, and a tube that leaves a trunk has none: every ball of the tube passes its mouth. The
//! difference is that the trunk's balls do not get in. So each room is opened by balls, from wide to narrow, into
//! limbs; the limb of the room's largest ball is its trunk. The space between limbs goes to the one that reaches it by
//! the widest way. Each limb except the trunks is then measured. It is a branch if:
//!
//! - it has one mouth: a limb with two is a neck between chambers, or a ring;
//! - no opening leads from it to a room that is wider than its mouth, for the same reason;
//! - its mouth is not much longer than wide, so it is not a slit under a bed or along one or two walls;
//! - it is deep, so it is not an alcove;
//! - the trunk is much wider near the mouth, so it is not a tube that tapers.
//!
//! Outdoors is a room, too, and its branches are rooms: a tube that is open at its ends, a tunnel, a garage, a living
//! room with its terrace door open. Such a branch may have several mouths, none a slit, and doors to rooms.
//!
//! Every other limb is merged across its largest opening. Pockets between rough walls and the balls of a room count as
//! branches, too; they are smaller than a ball, and decimation treats them as the spikes that they are. Where a trunk
//! divides into arms as wide as itself, no ball distinguishes them; `separate` does, at the forks of [`crate::tubes`].
//!
//! | file | contents |
//! | --- | --- |
//! | `regions` | connected sets of parts, and the width of the balls that connect them |
//! | `measure` | the facts of a limb |
//! | `rule` | the kind of a limb with such facts: all bounds, and nothing else |
//! | `flare` | the start of a limb within its mouth |
//! | `separate` | the separation of tubes of one width where they meet |

mod flare;
mod measure;
mod regions;
mod rule;
mod separate;

use std::collections::BTreeSet;

use enfilade_geom::Allowance;

use super::labels::Branches;
use super::space::Space;
use crate::tubes::Walls;
use regions::{NONE, TubeRegions};
use rule::{LimbKind, classify};

/// Finds the branches of rooms, given by the room of each part.
///
/// `O(n log n)` in parts, plus the parts of trunks times their limbs.
pub(super) fn find_branches(
    space: &Space,
    room_of_part: &[u32],
    walls: &Walls<'_>,
    allowance: &Allowance,
) -> Branches {
    let mut regions = TubeRegions::new(space, room_of_part, allowance);
    let limbs = open_rooms(&mut regions);
    // Narrow ones first: a limb that is not a branch is merged into a wider limb, which may be one.
    for limb in limbs.into_iter().rev() {
        for limb in regions.without_flare(limb) {
            settle(&mut regions, limb);
        }
    }
    regions.separate_forks(walls);
    regions.finished()
}

/// Divides rooms into trunks and limbs; returns the limbs, widest first.
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
