//! Every kind of tampering with a baked world is found, at three places each.

use crate::houses;

use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{PortalKind, World};
use enfilade_testkit::tamper::{ShownBy, recounted, tamperings};
use houses::{HOUSE, SLITS, verify};
use serde_json::Value;

/// Returns `true` if decoding rejects the world, or a check finds a problem.
fn is_found(world: &World) -> bool {
    let read = encode_glb(world).map(|bytes| decode_glb(&bytes));
    // Without rays first, which finds most tampering at once.
    !matches!(read, Ok(Ok(_)))
        || [0, 20_000, 200_000, 1_000_000]
            .iter()
            .any(|&rays| !verify(world, rays).holds())
}

#[test]
fn worlds_that_nobody_changed_pass() {
    for world in [&*HOUSE, &*SLITS] {
        let report = verify(world, 50_000);
        assert!(report.holds(), "{report}");
        assert!(report.across.blocked + report.across.judged > 0);
        assert!(verify(&recounted(world.clone()), 0).holds());
    }
    let counts = verify(&HOUSE, 20_000).visible;
    assert!(counts.lines > 10_000 && counts.parts > 5_000, "{counts:?}");
}

#[test]
fn every_kind_of_change_is_found_at_three_places() {
    let (mut missed, mut n_kinds) = (Vec::new(), 0);
    for tampering in tamperings().filter(|t| t.shown_by == ShownBy::File) {
        let mut n_places = 0;
        for place in 0..3 {
            let worlds = [&*HOUSE, &*SLITS].into_iter();
            let changed = worlds.filter_map(|w| tampering.apply(w, place)).next();
            let Some(world) = changed else { continue };
            n_places += 1;
            if !is_found(&world) {
                missed.push(format!("{}, place {place}", tampering.name));
            }
        }
        // Neither world has parts of details, nor seals and sources at once; `sources.rs` and the decoder's tests
        // cover those.
        n_kinds += u32::from(n_places > 0);
    }
    assert!(n_kinds >= 80, "{n_kinds}");
    assert!(missed.is_empty(), "{missed:#?}");
}

#[test]
fn a_removed_seal_is_found() {
    let of_seals = tamperings().filter(|t| t.name.contains("seal") && !t.name.contains("source"));
    let mut n = 0;
    for tampering in of_seals {
        for place in 0..3 {
            let world = tampering.apply(&SLITS, place).unwrap();
            assert!(is_found(&world), "{}, place {place}", tampering.name);
            n += 1;
        }
    }
    assert_eq!(n, 6);
}

/// The face that ends at a slit finds it, whatever rays are drawn.
#[test]
fn a_slit_is_found_without_a_ray() {
    let removed = tamperings().find(|t| t.name == "a seal removed").unwrap();
    for place in 0..3 {
        let report = verify(&removed.apply(&SLITS, place).unwrap(), 0);
        assert!(report.unsealed > 0, "{report}");
    }
}

/// Returns the file of a world with its JSON changed and the rest unchanged.
fn with_json(world: &World, change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let bytes = encode_glb(world).unwrap();
    let len = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut root = serde_json::from_slice(&bytes[20..20 + len]).unwrap();
    change(&mut root);
    let mut text = serde_json::to_vec(&root).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + len..];
    let mut out = bytes[..8].to_vec();
    out.extend((20 + text.len() as u32 + rest.len() as u32).to_le_bytes());
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(&bytes[16..20]);
    out.extend(text);
    out.extend(rest);
    out
}

#[test]
fn what_is_changed_in_the_files_own_text_is_found() {
    const OURS: &str = "ENFILADE_cell_portal_graph";
    decode_glb(&with_json(&HOUSE, |_| ())).unwrap();
    for place in 0..3 {
        let i = 10 * place;
        // A detail moved by a hand's breadth, which stays in its room.
        let moved = with_json(&HOUSE, |root| {
            let node = root["extensions"][OURS]["details"][i]["node"]
                .as_u64()
                .unwrap();
            let node = root["nodes"][node as usize].as_object_mut().unwrap();
            node.remove("matrix");
            let to = HOUSE.details[i].transform;
            node.insert(
                "translation".into(),
                serde_json::json!([to[12] + 0.1, to[13], to[14]]),
            );
        });
        assert!(decode_glb(&moved).is_err(), "{place}");
        // Two nodes exchanged.
        let exchanged = with_json(&HOUSE, |root| {
            let cells = &mut root["extensions"][OURS]["cells"];
            let node = cells[place]["node"].clone();
            cells[place]["node"] = cells[place + 1]["node"].clone();
            cells[place + 1]["node"] = node;
        });
        assert!(decode_glb(&exchanged).is_err(), "{place}");
    }
}

#[test]
fn kinds_of_portals_are_those_of_the_rule_as_far_as_a_file_tells() {
    let is_found = |change: &dyn Fn(&mut World)| {
        let mut world = HOUSE.clone();
        change(&mut world);
        !verify(&world, 0).holds()
    };
    let first = |kind| {
        HOUSE
            .graph
            .portals
            .iter()
            .position(|p| p.kind == kind)
            .unwrap()
    };
    let window = first(PortalKind::Window);
    let as_door = |w: &mut World| {
        w.graph.portals[window].kind = PortalKind::Door;
        w.graph.portals[window].fittings.clear();
    };
    assert!(is_found(&as_door));
    // A tool that cuts portals or has another rule records that, and is not judged by this rule.
    let by_another = |w: &mut World| {
        as_door(w);
        w.graph.provenance.generator = "another".into();
    };
    let edited = |w: &mut World| {
        as_door(w);
        w.graph.statistics.counts.insert("edits".into(), 1.0);
    };
    assert!(!is_found(&by_another) && !is_found(&edited));
    // An opening with a leaf is a door.
    let door = first(PortalKind::Door);
    assert!(is_found(&|w| w.graph.portals[door].kind = PortalKind::Open));
}
