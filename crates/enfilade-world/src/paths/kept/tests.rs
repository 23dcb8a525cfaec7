//! Kept maps: the round trip, refusals, damage.

use super::*;
use crate::paths::{Path, PathSearch};
use enfilade_testkit::{GridParams, Rng, room_grid};

fn made() -> (Space, WalkMap, WalkMapKey) {
    let world = room_grid(&GridParams {
        outdoors: true,
        ..GridParams::offices(6, 3)
    });
    let space = Space::new(world).unwrap();
    let walker = Agent::default();
    let map = WalkMap::new(&space, walker);
    let key = WalkMapKey {
        world: 7,
        objects: 1,
        walker,
    };
    (space, map, key)
}

fn root(map: &WalkMap) -> &PartMap {
    &map.parts[0]
}

#[test]
fn a_kept_map_is_restored_to_the_bit() {
    let (space, map, key) = made();
    assert!(
        root(&map).floors.n_floors() > 1000
            && !root(&map).sides.is_empty()
            && !root(&map).floors.crossings().is_empty()
    );
    let bytes = map.kept(&space, &key);
    let back = WalkMap::restored(&bytes, &space, &key, |_, _| true).unwrap();
    assert_eq!(format!("{back:?}"), format!("{map:?}"));
    assert_eq!(back.kept(&space, &key), bytes);
    let layout = space.layout(PartId::ROOT);
    let ends = [0, 4].map(|c| (PartId::ROOT, layout.cell(CellId(c)).bounds.center()));
    let [a, b] = [&map, &back].map(|map| {
        let mut path = Path::default();
        let found = PathSearch::new().find(map, &space, ends, |_, _| true, &mut path);
        (found, path.points)
    });
    assert_eq!(a, b);
}

#[test]
fn a_map_of_anything_else_is_refused_with_the_reason() {
    let (space, map, key) = made();
    let bytes = map.kept(&space, &key);
    let refused = |key: WalkMapKey| WalkMap::restored(&bytes, &space, &key, |_, _| true).err();
    assert_eq!(refused(key), None);
    assert_eq!(
        refused(WalkMapKey { world: 8, ..key }),
        Some(KeptMapError::OtherWorld)
    );
    assert_eq!(
        refused(WalkMapKey { objects: 0, ..key }),
        Some(KeptMapError::OtherObjects)
    );
    for change in [
        |a: &mut Agent| a.radius = 0.2,
        |a: &mut Agent| a.height = 1.7,
        |a: &mut Agent| a.eye = 1.5,
        |a: &mut Agent| a.step = 0.2,
        |a: &mut Agent| a.slope = 0.7,
    ] {
        let mut walker = key.walker;
        change(&mut walker);
        assert_eq!(
            refused(WalkMapKey { walker, ..key }),
            Some(KeptMapError::OtherWalker)
        );
    }
    let mut old = bytes.clone();
    old[17] ^= 1;
    hashed(&mut old);
    let other = WalkMap::restored(&old, &space, &key, |_, _| true).err();
    assert_eq!(other, Some(KeptMapError::OtherVersion));
    assert_eq!(
        WalkMap::restored(b"glTF", &space, &key, |_, _| true).err(),
        Some(KeptMapError::NotAMap)
    );
}

/// Makes the hash right after a change.
fn hashed(bytes: &mut [u8]) {
    let hash = WalkMapKey::hash(&bytes[16..]).to_le_bytes();
    bytes[8..16].copy_from_slice(&hash);
}

#[test]
fn damaged_and_forged_bytes_are_refused_or_harmless() {
    let (space, map, key) = made();
    let bytes = map.kept(&space, &key);
    let mut rng = Rng::new(3);
    for _ in 0..400 {
        let n = rng.below(bytes.len());
        assert!(WalkMap::restored(&bytes[..n], &space, &key, |_, _| true).is_err());
        let mut cut = bytes[..n.max(16)].to_vec();
        hashed(&mut cut);
        assert!(WalkMap::restored(&cut, &space, &key, |_, _| true).is_err());
        let mut flipped = bytes.clone();
        flipped[n] ^= 1 << rng.below(8);
        assert!(WalkMap::restored(&flipped, &space, &key, |_, _| true).is_err());
    }
    // With a hash that fits, what is not refused answers queries.
    let mut n_read = 0;
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    for _ in 0..600 {
        let mut forged = bytes.clone();
        for _ in 0..=rng.below(3) {
            let at = 16 + rng.below(bytes.len() - 16);
            forged[at] = rng.next_u32() as u8;
        }
        hashed(&mut forged);
        if let Ok(map) = WalkMap::restored(&forged, &space, &key, |_, _| true) {
            n_read += 1;
            let ends = [(); 2].map(|()| {
                let cell = CellId(rng.below(space.layout(PartId::ROOT).n_cells()) as u32);
                (
                    PartId::ROOT,
                    rng.point_in(&space.layout(PartId::ROOT).cell(cell).bounds),
                )
            });
            let _ = search.find(&map, &space, ends, |_, _| true, &mut path);
        }
    }
    assert!(n_read > 0, "none was read");
}
