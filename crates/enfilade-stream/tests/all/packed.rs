//! Packed worlds: the same world, and the same file.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use enfilade_cpg::wire::{PieceContent, decode_glb, encode_glb, read_piece};
use enfilade_cpg::{CellId, Pvs, World};
use enfilade_runtime::{Sight, SightState, View, Viewer};
use enfilade_stream::{
    Catalog, Fetch, FetchError, PackedFiles, PackedHead, PackedWorld, PieceId, Reply, Source,
    ThreadSource,
};
use enfilade_testkit::{GridParams, Rng, room_grid};

fn world() -> World {
    room_grid(&GridParams {
        furniture: 4,
        outdoors: true,
        ..GridParams::offices(12, 3)
    })
}

fn folder(name: &str) -> std::path::PathBuf {
    let dir = std::env::temp_dir().join(format!("enfilade-{}-{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

fn write(packed: &PackedWorld, path: &std::path::Path, in_one: bool) {
    if in_one {
        std::fs::write(path, packed.one_file().unwrap()).unwrap();
        return;
    }
    std::fs::create_dir(path).unwrap();
    for (name, bytes) in packed.files().unwrap() {
        std::fs::write(path.join(name), bytes).unwrap();
    }
}

/// Waits for `n` replies.
fn replies(source: &mut ThreadSource, n: usize) -> Vec<Reply> {
    let start = Instant::now();
    let mut out = Vec::new();
    while out.len() < n {
        assert!(start.elapsed() < Duration::from_secs(60), "it hangs");
        source.poll(&mut out);
        std::thread::sleep(Duration::from_millis(1));
    }
    out
}

// Covers W1.
#[test]
fn a_packed_world_unpacks_to_the_same_file_from_a_folder_and_from_one_file() {
    let file = encode_glb(&world()).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    assert_eq!(packed.unpack().unwrap(), file);
    let dir = folder("round");
    for in_one in [false, true] {
        let path = dir.join(if in_one { "one.enf" } else { "world.enf" });
        write(&packed, &path, in_one);
        assert!(PackedFiles::is_packed(&path));
        assert_eq!(
            PackedFiles::read_all(&path).unwrap().unpack().unwrap(),
            file
        );
    }
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn the_head_answers_as_the_whole_world() {
    let file = encode_glb(&world()).unwrap();
    let world = decode_glb(&file).unwrap();
    let head = PackedWorld::pack(&file).unwrap().head.encode().unwrap();
    let head = PackedHead::decode(&head).unwrap();
    let sights = [Sight::build(&world).unwrap(), head.sight().unwrap()];
    let mut viewers = [Viewer::new(&sights[0]), Viewer::new(&sights[1])];
    let mut rng = Rng::new(5);
    for _ in 0..200 {
        let cell = world.graph.cells[1 + rng.below(world.graph.cells.len() - 1)].aabb;
        let eye =
            [0, 1, 2].map(|k| cell[0][k] + (cell[1][k] - cell[0][k]) * rng.range(0.2, 0.8) as f32);
        let toward = [0, 1, 2].map(|_| rng.range(-1.0, 1.0) as f32);
        let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.2, 1.5).unwrap();
        let mut answers = Vec::new();
        for (sight, viewer) in sights.iter().zip(&mut viewers) {
            let seen = viewer.see(sight, &SightState::new(sight), &view);
            answers.push((
                seen.cells().to_vec(),
                seen.chunks().to_vec(),
                seen.details().to_vec(),
            ));
        }
        assert_eq!(answers[0], answers[1]);
    }
}

#[test]
fn a_cell_needs_its_triangles_its_objects_and_nothing_else() {
    let file = encode_glb(&world()).unwrap();
    let world = decode_glb(&file).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    for cell in (0..world.graph.cells.len() as u32).map(CellId) {
        let mut batches = Vec::new();
        let mut meshes = Vec::new();
        for &piece in packed.head.catalog.pieces_of(cell) {
            let bytes = packed.head.expand(piece, packed.packed(piece).unwrap());
            match read_piece(&bytes.unwrap()).unwrap() {
                PieceContent::Batches(own) => batches.extend(own.into_iter().map(|b| b.0)),
                PieceContent::Mesh { mesh, .. } => meshes.push(mesh),
                PieceContent::Image { .. } => {}
            }
        }
        batches.sort_unstable();
        let expected: Vec<u32> = (0..)
            .zip(&world.batches)
            .filter(|(_, b)| b.cells.contains(&cell) && !b.primitive.indices.is_empty())
            .map(|(i, _)| i)
            .collect();
        assert_eq!(batches, expected, "{cell}");
        let touching = world.details.iter().filter(|d| d.cells.contains(&cell));
        assert!(touching.map(|d| d.mesh).all(|m| meshes.contains(&m)));
    }
}

#[test]
fn damaged_heads_and_bodies_are_told() {
    let file = encode_glb(&world()).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    let head = packed.head.encode().unwrap();
    let mut rng = Rng::new(8);
    for i in 0..300 {
        let mut other = head.clone();
        if i % 2 == 0 {
            other.truncate(rng.below(head.len()));
        } else {
            other[rng.below(head.len())] ^= 1 << rng.below(8);
        }
        assert!(PackedHead::decode(&other).is_err());
    }
    for _ in 0..100 {
        let piece = PieceId(rng.below(packed.head.places.len()) as u32);
        let mut other = packed.packed(piece).unwrap().to_vec();
        let at = rng.below(other.len());
        other[at] ^= 1 << rng.below(8);
        assert!(packed.head.expand(piece, &other).is_err());
    }
}

// Fuzz targets `head` and `piece` do the same for longer.
#[test]
fn hostile_heads_and_pieces_are_told_or_harmless() {
    let file = encode_glb(&world()).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    let body = packed.head.encode_body().unwrap();
    let mut rng = Rng::new(9);
    let damage = |bytes: &[u8], rng: &mut Rng| {
        let mut other = bytes.to_vec();
        for _ in 0..=rng.below(3) {
            let at = rng.below(other.len());
            other[at] = match rng.below(3) {
                0 => other[at] ^ (1 << rng.below(8)),
                1 => b'0' + rng.below(10) as u8,
                _ => rng.below(256) as u8,
            };
        }
        other
    };
    let mut n_read = [0; 2];
    for _ in 0..300 {
        if let Ok(head) = PackedHead::decode_body(&damage(&body, &mut rng)) {
            n_read[0] += 1;
            for piece in [0, 1, u32::MAX].map(PieceId) {
                let _ = head.expand(piece, &body);
            }
            let _ = head.sight();
        }
        let piece = PieceId(rng.below(packed.head.places.len()) as u32);
        let bytes = packed.packed(piece).unwrap();
        let bytes = packed.head.expand(piece, bytes).unwrap();
        n_read[1] += usize::from(read_piece(&damage(&bytes, &mut rng)).is_ok());
    }
    assert!(n_read.iter().all(|n| *n > 0 && *n < 300), "{n_read:?}");
}

type Change<'a, T> = &'a dyn Fn(&mut T);

/// A change of the list of pieces in the body of a head.
fn relisted(body: &[u8], change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let n = u64::from_le_bytes(body[..8].try_into().unwrap()) as usize;
    let mut listed = serde_json::from_slice(&body[8..8 + n]).unwrap();
    change(&mut listed);
    let listed = serde_json::to_vec(&listed).unwrap();
    let n_listed = (listed.len() as u64).to_le_bytes();
    [&n_listed, &listed[..], &body[8 + n..]].concat()
}

#[test]
fn heads_that_list_other_pieces_than_their_world_has_are_refused() {
    let file = encode_glb(&world()).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    let body = packed.head.encode_body().unwrap();
    assert!(PackedHead::decode_body(&relisted(&body, |_| ())).is_ok());
    let refused = |change: Change<'_, serde_json::Value>| {
        let why = PackedHead::decode_body(&relisted(&body, change)).unwrap_err();
        why.to_string()
    };
    let again = |v: &mut serde_json::Value| {
        for list in ["pieces", "hashes"] {
            let first = v[list][0].clone();
            v[list].as_array_mut().unwrap().push(first);
        }
    };
    let changes: [(&str, Change<'_, serde_json::Value>); 8] = [
        ("needs piece", &|v| v["cells"][3] = [0_u32; 0][..].into()),
        ("no list of its pieces", &|v| {
            v["cells"][3] = [0, 0, 1][..].into();
        }),
        ("no list of its pieces", &|v| {
            v["cells"][3].as_array_mut().unwrap().push(9999.into());
        }),
        ("no list of its pieces", &|v| {
            v["cells"][3].as_array_mut().unwrap().reverse();
        }),
        ("one after the other", &|v| v["pieces"][1][0] = 0.into()),
        ("one after the other", &again),
        ("of another world", &|v| v["materials"][0] = 9999.into()),
        ("its rest does not", &|v| v["rest"][0][0] = 0.into()),
    ];
    for (words, change) in changes {
        let why = refused(change);
        assert!(why.contains(words), "{words}: {why}");
    }
    // A body that expands a thousand times is not expanded.
    let long = relisted(&body, |v| v["cells"][3] = vec![0; 12 << 20].into());
    let tight = zstd::bulk::compress(&long, 9).unwrap();
    let mut head = packed.head.encode().unwrap()[..12].to_vec();
    head.extend((tight.len() as u64).to_le_bytes());
    head.extend((long.len() as u64).to_le_bytes());
    head.extend(twox_hash::XxHash3_128::oneshot(&tight).to_le_bytes());
    head.extend(&tight);
    let why = PackedHead::decode(&head).unwrap_err().to_string();
    assert!(why.contains("more than a part of it"), "{why}");
    // Four gigabytes that are claimed are not waited for.
    head[12..20].copy_from_slice(&(4_u64 << 30).to_le_bytes());
    assert!(PackedHead::size(&head).is_err());
}

#[test]
fn a_head_of_another_world_than_its_pieces_is_told() {
    let mut whole = world();
    let n = whole.graph.cells.len() as u32;
    whole.pvs = Some(Pvs::of_ascending((0..n).map(|_| 0..n)));
    let file = encode_glb(&whole).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    packed.check(&packed.unpack().unwrap()).unwrap();
    let other = room_grid(&GridParams::offices(12, 2));
    let other = PackedWorld::pack(&encode_glb(&other).unwrap()).unwrap();
    let told = |change: Change<'_, PackedHead>| {
        let mut forged = packed.clone();
        change(&mut forged.head);
        // As it comes back from its file.
        forged.head = PackedHead::decode(&forged.head.encode().unwrap()).unwrap();
        // Its pieces still make the file.
        assert!(forged.unpack().unwrap() == file);
        forged.check(&file).unwrap_err().to_string()
    };
    let lists_more = |head: &mut PackedHead| {
        let rows: Vec<Vec<PieceId>> = (0..n)
            .map(|_| (0..head.places.len() as u32).map(PieceId).collect())
            .collect();
        head.catalog = Catalog::new(head.catalog.pieces().to_vec(), &rows);
    };
    let changes: [(&str, Change<'_, PackedHead>); 5] = [
        ("the list of the pieces of cell", &lists_more),
        ("its list of boxes", &|h| {
            h.skeleton = other.head.skeleton.clone();
        }),
        ("the world in its head", &|h| {
            h.world.pvs = Some(Pvs::of_ascending((0..n).map(|c| [c])));
        }),
        ("the world in its head", &|h| {
            h.world.graph.cells[1].aabb[1][1] -= 0.5;
        }),
        ("the world in its head", &|h| {
            h.world.graph.cells[1].name = "elsewhere".into();
        }),
    ];
    for (words, change) in changes {
        let why = told(change);
        assert!(why.contains(words), "{words}: {why}");
    }
}

#[test]
fn pieces_come_from_disk_and_canceled_ones_do_not() {
    let file = encode_glb(&world()).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    let dir = folder("disk");
    let path = dir.join("world.enf");
    write(&packed, &path, true);
    let (head, files) = PackedFiles::open(&path).unwrap();
    let n = head.places.len() as u32;
    let head = Arc::new(head);
    let mut source = files.source(&head);
    for piece in (0..n).map(PieceId) {
        source.request(piece);
    }
    for reply in replies(&mut source, n as usize) {
        let expected = head.expand(reply.piece, packed.packed(reply.piece).unwrap());
        assert_eq!(reply.bytes.unwrap(), expected.unwrap());
    }
    source.request(PieceId(n));
    let missing = replies(&mut source, 1).remove(0).bytes.unwrap_err();
    assert!(matches!(missing, FetchError::Missing { .. }), "{missing}");
    drop(source);
    std::fs::remove_dir_all(dir).unwrap();
}

/// Fails, falls short and damages, each one time in ten.
struct Unreliable {
    body: Arc<Vec<u8>>,
    rng: Rng,
}

impl Fetch for Unreliable {
    fn fetch(&mut self, offset: u64, n: u64) -> Result<Vec<u8>, String> {
        let mut out = self.body[offset as usize..(offset + n) as usize].to_vec();
        match self.rng.below(10) {
            0 => return Err("the line is dead".into()),
            1 => out.truncate(out.len() / 2),
            2 => out[0] ^= 1,
            _ => {}
        }
        Ok(out)
    }
}

#[test]
fn faults_on_the_way_are_survived_or_told() {
    let file = encode_glb(&world()).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    let body = Arc::new(packed.body().to_vec());
    let head = Arc::new(packed.head.clone());
    let fetches = (0..4).map(|seed| Unreliable {
        body: Arc::clone(&body),
        rng: Rng::new(seed),
    });
    let mut source = ThreadSource::new(&head, "here", fetches.collect());
    let n = head.places.len();
    for piece in (0..n as u32).map(PieceId) {
        source.request(piece);
    }
    let mut n_failed = 0;
    for reply in replies(&mut source, n) {
        match reply.bytes {
            Ok(bytes) => {
                let expected = head.expand(reply.piece, packed.packed(reply.piece).unwrap());
                assert_eq!(bytes, expected.unwrap());
            }
            Err(why) => {
                assert!(why.to_string().contains("here"), "{why}");
                n_failed += 1;
            }
        }
    }
    // 0.3 to the fourth: one in 120.
    assert!(n_failed * 10 < n, "{n_failed} of {n}");
}

/// Fetches once it is let through.
struct Gate {
    body: Arc<Vec<u8>>,
    begun: Sender<()>,
    let_through: Receiver<()>,
}

impl Fetch for Gate {
    fn fetch(&mut self, offset: u64, n: u64) -> Result<Vec<u8>, String> {
        self.begun.send(()).map_err(|e| e.to_string())?;
        self.let_through.recv().map_err(|e| e.to_string())?;
        Ok(self.body[offset as usize..(offset + n) as usize].to_vec())
    }
}

#[test]
fn a_request_ends_in_one_reply_even_if_an_earlier_one_was_canceled() {
    let packed = PackedWorld::pack(&encode_glb(&world()).unwrap()).unwrap();
    let (begun, has_begun) = channel();
    let (let_through, gate) = channel();
    let fetch = Gate {
        body: Arc::new(packed.body().to_vec()),
        begun,
        let_through: gate,
    };
    let mut source = ThreadSource::new(&Arc::new(packed.head), "here", vec![fetch]);
    let replies_of = |source: &mut ThreadSource, pieces: &[u32]| {
        // The thread takes the next request only after its last reply.
        source.request(PieceId(9));
        let _ = let_through.send(());
        let _ = let_through.send(());
        let mut ids: Vec<u32> = (replies(source, pieces.len() + 1).iter())
            .map(|r| r.piece.0)
            .collect();
        assert_eq!(ids.pop(), Some(9));
        assert_eq!(ids, pieces);
        while has_begun.try_recv().is_ok() {}
    };
    let begin = |source: &mut ThreadSource| {
        source.request(PieceId(0));
        has_begun.recv().unwrap();
    };
    // Canceled under way, and asked for again.
    begin(&mut source);
    source.cancel(PieceId(0));
    source.request(PieceId(0));
    replies_of(&mut source, &[0]);
    // Canceled for good.
    begin(&mut source);
    source.cancel(PieceId(0));
    replies_of(&mut source, &[]);
    // Canceled when its reply is there.
    begin(&mut source);
    let _ = let_through.send(());
    std::thread::sleep(Duration::from_millis(50));
    source.cancel(PieceId(0));
    source.request(PieceId(0));
    replies_of(&mut source, &[0]);
    // Dropping it does not wait for what is under way.
    begin(&mut source);
    drop(source);
}
