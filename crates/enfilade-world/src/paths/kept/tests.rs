//! Kept maps: the round trip, refusals, damage.

use super::*;
use crate::paths::{Path, PathSearch};
use enfilade_testkit::{GridParams, Rng, room_grid};

fn made() -> (Layout, WalkMap, WalkMapKey) {
    let world = room_grid(&GridParams {
        outdoors: true,
        ..GridParams::offices(6, 3)
    });
    let layout = Layout::new(&world);
    let walker = Agent::default();
    let map = WalkMap::new(&layout, &world, walker);
    let key = WalkMapKey {
        world: 7,
        objects: 1,
        walker,
    };
    (layout, map, key)
}

#[test]
fn a_kept_map_is_restored_to_the_bit() {
    let (layout, map, key) = made();
    assert!(
        map.floors.n_floors() > 1000 && !map.sides.is_empty() && !map.floors.crossings.is_empty()
    );
    let bytes = map.kept(&layout, &key);
    let back = WalkMap::restored(&bytes, &layout, &key).unwrap();
    assert_eq!(format!("{back:?}"), format!("{map:?}"));
    assert_eq!(back.kept(&layout, &key), bytes);
    let ends = [0, 4].map(|c| layout.cell(CellId(c)).bounds.center());
    let [a, b] = [&map, &back].map(|map| {
        let mut path = Path::default();
        let found = PathSearch::new().find(map, &layout, ends, |_| true, &mut path);
        (found, path.points)
    });
    assert_eq!(a, b);
}

#[test]
fn a_map_of_anything_else_is_refused_with_the_reason() {
    let (layout, map, key) = made();
    let bytes = map.kept(&layout, &key);
    let refused = |key: WalkMapKey| WalkMap::restored(&bytes, &layout, &key).err();
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
    let other = WalkMap::restored(&old, &layout, &key).err();
    assert_eq!(other, Some(KeptMapError::OtherVersion));
    assert_eq!(
        WalkMap::restored(b"glTF", &layout, &key).err(),
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
    let (layout, map, key) = made();
    let bytes = map.kept(&layout, &key);
    let mut rng = Rng::new(3);
    for _ in 0..400 {
        let n = rng.below(bytes.len());
        assert!(WalkMap::restored(&bytes[..n], &layout, &key).is_err());
        let mut cut = bytes[..n.max(16)].to_vec();
        hashed(&mut cut);
        assert!(WalkMap::restored(&cut, &layout, &key).is_err());
        let mut flipped = bytes.clone();
        flipped[n] ^= 1 << rng.below(8);
        assert!(WalkMap::restored(&flipped, &layout, &key).is_err());
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
        if let Ok(map) = WalkMap::restored(&forged, &layout, &key) {
            n_read += 1;
            let ends = [(); 2].map(|()| {
                let cell = CellId(rng.below(layout.n_cells()) as u32);
                rng.point_in(&layout.cell(cell).bounds)
            });
            let _ = search.find(&map, &layout, ends, |_| true, &mut path);
        }
    }
    assert!(n_read > 0, "none was read");
}
