//! World files in pieces.

use enfilade_cpg::wire::{
    PieceContent, SplitFile, decode_glb, encode_glb, join_file, read_piece, split_file,
};
use enfilade_cpg::{Batch, World};
use enfilade_geom::scene::Primitive;
use enfilade_testkit::{GridParams, Rng, room_grid};

fn file() -> (World, Vec<u8>) {
    let world = room_grid(&GridParams {
        furniture: 4,
        ..GridParams::offices(8, 3)
    });
    let bytes = encode_glb(&world).unwrap();
    (decode_glb(&bytes).unwrap(), bytes)
}

fn text(primitive: &Primitive) -> String {
    format!("{primitive:?}")
}

// Covers W1.
#[test]
fn pieces_make_the_file_again_in_any_order_and_no_other() {
    let (_, bytes) = file();
    let SplitFile { pieces, rest, .. } = split_file(&bytes).unwrap();
    let all = || std::iter::once(&rest).chain(&pieces).map(Vec::as_slice);
    let len = bytes.len() as u64;
    assert_eq!(join_file(len, all()).unwrap(), bytes);
    let backward: Vec<&[u8]> = all().collect();
    assert_eq!(join_file(len, backward.into_iter().rev()).unwrap(), bytes);
    assert!(join_file(len, all().skip(1)).is_err());
    assert!(join_file(len + 1, all()).is_err());
}

#[test]
fn pieces_hold_the_primitives_of_the_world() {
    let (world, bytes) = file();
    let mut n = [0; 3];
    for piece in split_file(&bytes).unwrap().pieces {
        match read_piece(&piece).unwrap() {
            PieceContent::Batches(batches) => {
                let cells = |b: u32| &world.batches[b as usize].cells;
                for (batch, primitive) in &batches {
                    assert_eq!(cells(*batch), cells(batches[0].0));
                    let expected = &world.batches[*batch as usize].primitive;
                    assert_eq!(text(primitive), text(expected));
                    n[0] += 1;
                }
            }
            PieceContent::Mesh { mesh, primitives } => {
                let expected = &world.detail_meshes[mesh as usize].primitives;
                assert!(primitives.iter().map(text).eq(expected.iter().map(text)));
                n[1] += 1;
            }
            PieceContent::Image { image, bytes } => {
                assert_eq!(bytes, world.images[image as usize].bytes);
                n[2] += 1;
            }
        }
    }
    let with_triangles = |b: &&Batch| !b.primitive.indices.is_empty();
    assert_eq!(n[0], world.batches.iter().filter(with_triangles).count());
    assert_eq!(n[1..], [world.detail_meshes.len(), world.images.len()]);
    assert!(n[0] > 0 && n[1] > 0);
}

#[test]
fn damaged_pieces_are_refused_or_harmless() {
    let (_, bytes) = file();
    let pieces = split_file(&bytes).unwrap().pieces;
    let mut rng = Rng::new(4);
    let mut n_refused = 0;
    for _ in 0..2000 {
        let mut piece = pieces[rng.below(pieces.len())].clone();
        if rng.below(2) == 0 {
            piece.truncate(rng.below(piece.len()));
        } else {
            let at = rng.below(piece.len().min(400));
            piece[at] ^= 1 << rng.below(8);
        }
        n_refused += usize::from(read_piece(&piece).is_err());
        let _ = join_file(bytes.len() as u64, [piece.as_slice()]);
    }
    assert!(n_refused > 500, "{n_refused}");
}
