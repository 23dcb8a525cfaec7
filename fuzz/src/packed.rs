//! Packed worlds: heads, pieces, skeletons.

use std::sync::LazyLock;

use enfilade::runtime::{Sight, SightSkeleton, SightState, View, Viewer};
use enfilade::stream::{PackedWorld, PieceId};
use enfilade_cpg::World;
use enfilade_cpg::wire::{encode_glb, read_piece};
use enfilade_testkit::{GridParams, room_grid};

static PLAIN: LazyLock<World> = LazyLock::new(|| room_grid(&GridParams::offices(6, 3)));

/// The head, behind its hash: what it accepts answers, and can be written and read again.
pub fn head(data: &[u8]) {
    let Ok(head) = enfilade::stream::PackedHead::decode_body(data) else {
        return;
    };
    for piece in [0, 1, u32::MAX].map(PieceId) {
        let _ = head.expand(piece, data);
    }
    if let Ok(sight) = head.sight() {
        look(&sight);
    }
    let written = head.encode_body().expect("what was read can be written");
    let back = enfilade::stream::PackedHead::decode_body(&written);
    let back = back.expect("what was written can be read");
    assert!(back.encode_body().expect("and written again") == written);
}

/// A piece, unpacked.
pub fn piece(data: &[u8]) {
    let _ = read_piece(data);
}

/// The skeleton of a sight, with its checksum mended, for a plain world.
pub fn skeleton(data: &[u8]) {
    let data = &with_sum_mended(data);
    let Ok(skeleton) = SightSkeleton::decode(data) else {
        return;
    };
    let written = skeleton.encode();
    let back = SightSkeleton::decode(&written).expect("what was written can be read");
    assert!(back.encode() == written);
    let hollow = SightSkeleton::hollow(&PLAIN);
    if let Ok(sight) = Sight::build_hollow(&hollow, skeleton) {
        look(&sight);
    }
}

/// Returns bytes that end in their checksum, 64-bit FNV-1a.
fn with_sum_mended(data: &[u8]) -> Vec<u8> {
    let body = &data[..data.len().saturating_sub(8)];
    let step = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    let sum = body.iter().fold(0xcbf2_9ce4_8422_2325, step);
    [body, &sum.to_le_bytes()].concat()
}

fn look(sight: &Sight) {
    let state = SightState::new(sight);
    let mut viewer = Viewer::new(sight);
    for eye in [[1.0, 1.0, 1.0], [4.0, 1.5, 3.0], [-9.0, 1.0, 1.0]] {
        let view = View::perspective(eye, [1.0, 0.0, 0.2], [0.0, 1.0, 0.0], 1.0, 1.5);
        if let Ok(view) = view {
            viewer.see(sight, &state, &view);
        }
    }
}

/// Returns a valid body of a head, a valid skeleton, and valid pieces.
pub fn seeds() -> (Vec<u8>, Vec<u8>, Vec<Vec<u8>>) {
    let file = encode_glb(&PLAIN).expect("a valid world can be written");
    let packed = PackedWorld::pack(&file).expect("and packed");
    let pieces = (0..packed.head.places.len() as u32).map(PieceId);
    let pieces = pieces.filter_map(|piece| packed.head.expand(piece, packed.packed(piece)?).ok());
    (
        packed.head.encode_body().expect("its head can be written"),
        packed.head.skeleton.encode(),
        pieces.collect(),
    )
}
