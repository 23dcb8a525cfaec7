//! Packed worlds: pieces come with the view and go when room is needed, and pictures are those of the whole file.

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use bevy_enfilade::enfilade::stream::{PackedWorld, Policy, StreamOptions};
use bevy_enfilade::prelude::*;
use bevy_enfilade::{PartKind, WorldPart};

use crate::LAMPS;
use crate::support::{Stage, Stand, demo_house};

/// Longest wait for a view, in frames.
const MOST_FRAMES: u32 = 2_000;

/// Messages so far.
#[derive(Resource, Default)]
struct Log {
    loaded: Vec<CellId>,
    unloaded: Vec<CellId>,
    failed: Vec<PieceFailed>,
}

/// As the demo house, but furniture is mirrored where it stands, and shaded as if it were round.
fn mirrored_house(name: &str) -> PathBuf {
    let path = demo_house(name);
    let mut world = enfilade::open(&path).expect("a world");
    let portals = &world.graph.portals;
    let fittings: Vec<u32> = (portals.iter().flat_map(|p| &p.fittings))
        .map(|f| f.detail)
        .collect();
    for (i, detail) in (0..).zip(&mut world.details) {
        if fittings.contains(&i) {
            continue;
        }
        let mesh = &mut world.detail_meshes[detail.mesh as usize];
        let points = mesh.primitives.iter().flat_map(|p| &p.positions);
        let points: Vec<Vec3> = points.copied().map(Vec3::from).collect();
        let low = points.iter().copied().fold(Vec3::MAX, Vec3::min);
        let high = points.iter().copied().fold(Vec3::MIN, Vec3::max);
        let middle = low.midpoint(high);
        for primitive in &mut mesh.primitives {
            let outwards = |p: &[f32; 3]| (Vec3::from(*p) - middle).normalize().to_array();
            primitive.normals = primitive.positions.iter().map(outwards).collect();
        }
        let mirror = Mat4::from_translation(Vec3::X * 2.0 * middle.x)
            * Mat4::from_scale(Vec3::new(-1.0, 1.0, 1.0));
        let placed = Mat4::from_cols_array(&detail.transform) * mirror;
        detail.transform = placed.to_cols_array();
    }
    enfilade::save(&path, &world).expect("a file");
    path
}

fn packed(world: &Path) -> PackedWorld {
    PackedWorld::pack(&std::fs::read(world).expect("a world")).expect("a packed world")
}

/// Writes a packed world as one file beside its world.
fn write(packed: &PackedWorld, world: &Path) -> PathBuf {
    let path = world.with_extension("enf");
    std::fs::write(&path, packed.one_file().expect("a file")).expect("a file to write to");
    path
}

/// Opens a packed world, and keeps a log.
fn open(path: &Path, max_resident: u64) -> Stage {
    let settings = StreamSettings {
        options: StreamOptions {
            policy: Policy::Cache,
            max_resident,
            ..default()
        },
        ..default()
    };
    let mut stage = Stage::with(path, UVec2::new(160, 120), LAMPS, settings);
    let app = &mut stage.app;
    app.init_resource::<Log>()
        .add_observer(|e: On<CellLoaded>, mut log: ResMut<Log>| log.loaded.push(e.cell))
        .add_observer(|e: On<CellUnloaded>, mut log: ResMut<Log>| log.unloaded.push(e.cell))
        .add_observer(|e: On<PieceFailed>, mut log: ResMut<Log>| log.failed.push(e.clone()));
    stage
}

fn stream(stage: &Stage) -> &PortalStream {
    let stream = stage.app.world().get(stage.root);
    stream.expect("a packed world is streamed")
}

/// Draws until all that is in view is there. The budget holds all the while.
fn settle(stage: &mut Stage) {
    // A camera that was moved is followed from the next frame on.
    stage.frame();
    for _ in 0..MOST_FRAMES {
        stage.frame();
        let counts = stream(stage).counts();
        assert!(counts.n_kept <= counts.max_kept, "{counts:?}");
        if stream(stage).is_settled() {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    panic!("the view is not settled: {:?}", stream(stage).counts());
}

/// Places in three rooms that are far from each other, looking along each room's longer side.
fn three_rooms(stage: &Stage) -> [Stand; 3] {
    let graph = &stage.world().world.graph;
    let rooms: Vec<[Vec3; 2]> = graph.rooms().map(|(_, r)| r.aabb.map(Vec3::from)).collect();
    let stand = |i: usize| {
        let [low, high] = rooms[i];
        let size = high - low;
        let toward = if size.x > size.z { Vec3::X } else { Vec3::Z };
        let eye = low.midpoint(high) - toward * 0.3 * size.dot(toward);
        Stand {
            eye,
            toward: toward - 0.2 * Vec3::Y,
        }
    };
    [0, rooms.len() / 2, rooms.len() - 1].map(stand)
}

/// Returns what the whole world takes, by the estimates that budgets are of. [Units: bytes]
fn size_of_all(stage: &Stage) -> u64 {
    let pieces = stream(stage).streamer().catalog().pieces();
    pieces.iter().map(|p| p.n_resident).sum()
}

fn n_meshes(stage: &mut Stage) -> usize {
    let mut parts = stage.app.world_mut().query::<(&WorldPart, &Mesh3d)>();
    parts.iter(stage.app.world()).count()
}

/// Returns the memory of all meshes and pictures that there are, as the engine keeps them. [Units: bytes]
fn size_of_assets(stage: &Stage) -> u64 {
    let world = stage.app.world();
    let of_mesh = |mesh: &Mesh| {
        mesh.get_vertex_buffer_size() + mesh.get_index_buffer_bytes().map_or(0, <[u8]>::len)
    };
    let meshes = world
        .resource::<Assets<Mesh>>()
        .iter()
        .map(|(_, m)| of_mesh(m));
    let images = world.resource::<Assets<Image>>().iter();
    let images = images.filter_map(|(_, image)| Some(image.data.as_ref()?.len()));
    meshes.chain(images).sum::<usize>() as u64
}

#[test]
fn a_packed_world_is_drawn_as_the_whole_one_within_its_budget() {
    let path = mirrored_house("packed");
    let mut whole = Stage::new(&path, UVec2::new(160, 120), LAMPS);
    let packed = write(&packed(&path), &path);
    let all = size_of_all(&open(&packed, u64::MAX));
    let budget = all / 2;
    let mut stage = open(&packed, budget);
    // Pieces come from the first frame on.
    let others = size_of_assets(&stage) - stream(&stage).n_bytes();
    let mut colors = std::collections::BTreeSet::new();
    for (i, stand) in three_rooms(&whole).into_iter().cycle().take(4).enumerate() {
        stage.stand(stand);
        settle(&mut stage);
        // Meshes that go are freed at the end of the frame.
        stage.frame();
        let n_bytes = size_of_assets(&stage) - others;
        assert!(n_bytes <= budget, "{n_bytes} of {budget}");
        // A picture that comes replaces a white pixel.
        let told = stream(&stage).n_bytes();
        assert!(told.abs_diff(n_bytes) <= 4, "{told} are {n_bytes}");
        let cell = stage.view().world(stage.root).and_then(|w| w.cell);
        assert!(stream(&stage).is_complete(cell.expect("in a room")));
        whole.stand(stand);
        let pictures = [whole.picture(), stage.picture()];
        let pixels = pictures[0].chunks(4).zip(pictures[1].chunks(4));
        let n_different = pixels.filter(|(a, b)| a != b).count();
        if n_different > 0 {
            let folder = std::env::temp_dir();
            let [expected, got] = pictures;
            whole.save(expected, &folder.join("bevy-enfilade-whole.png"));
            stage.save(got, &folder.join("bevy-enfilade-streamed.png"));
            panic!("view {i}: {n_different} pixels differ");
        }
        colors.extend(pictures[0].chunks(4).map(<[u8]>::to_vec));
    }
    // Otherwise the test would show nothing.
    assert!(colors.len() > 200, "{}", colors.len());
    let log = stage.app.world().resource::<Log>();
    assert!(log.failed.is_empty(), "{:?}", log.failed);
    assert!(!log.loaded.is_empty() && !log.unloaded.is_empty());
    for &cell in &log.loaded {
        let n = |of: &[CellId]| of.iter().filter(|c| **c == cell).count();
        let n_there = n(&log.loaded) - n(&log.unloaded);
        assert_eq!(n_there == 1, stream(&stage).is_complete(cell), "{cell}");
    }
}

#[test]
fn pieces_that_go_leave_nothing_behind() {
    let path = demo_house("gone");
    let packed = write(&packed(&path), &path);
    let mut stage = open(&packed, u64::MAX);
    stage.stand(three_rooms(&stage)[0]);
    settle(&mut stage);
    let count = |stage: &mut Stage| {
        let n_meshes = n_meshes(stage);
        let world = stage.app.world();
        let pictures = world.resource::<Assets<Image>>().iter();
        let n_large = pictures
            .filter(|(_, i)| i.width() == i.height() && i.width() > 1)
            .count();
        (n_meshes, world.resource::<Assets<Mesh>>().len(), n_large)
    };
    let there = count(&mut stage);
    let root = stage.root;
    stage
        .app
        .world_mut()
        .entity_mut(root)
        .remove::<PortalStream>();
    stage
        .app
        .world_mut()
        .entity_mut(root)
        .remove::<bevy_enfilade::PackedRoot>();
    for _ in 0..3 {
        stage.frame();
    }
    let gone = count(&mut stage);
    assert!(
        gone.0 < there.0 && gone.1 < there.1 && gone.2 < there.2,
        "{there:?} {gone:?}"
    );
    let mut parts = stage.app.world_mut().query::<&WorldPart>();
    let mut parts = parts.iter(stage.app.world());
    // Leaves of doors stay.
    assert!(parts.all(|p| matches!(p.kind, PartKind::Detail(_))));
}

#[test]
fn a_damaged_piece_is_told_and_the_rest_is_drawn() {
    let path = demo_house("damaged");
    let packed = packed(&path);
    let mut file = packed.one_file().expect("a file");
    let head = file.len() - packed.body().len();
    let stand = three_rooms(&Stage::new(&path, UVec2::splat(32), LAMPS))[0];
    let cell = {
        let sight = packed.head.sight().expect("a head");
        sight.locate(stand.eye.to_array()).expect("a room")
    };
    let piece = packed.head.catalog.pieces_of(cell)[0];
    file[head + packed.head.places[piece.idx()].offset as usize + 8] ^= 0x55;
    let packed_path = path.with_extension("enf");
    std::fs::write(&packed_path, file).expect("a file to write to");
    let mut stage = open(&packed_path, u64::MAX);
    stage.stand(stand);
    settle(&mut stage);
    let log = stage.app.world().resource::<Log>();
    assert!(log.failed.iter().all(|f| f.piece == piece));
    let reason = &log.failed.first().expect("a message").reason;
    assert!(
        reason.contains("damaged") && reason.contains("damaged.enf"),
        "{reason}"
    );
    assert_eq!(stream(&stage).failures().count(), 1);
    assert!(!stream(&stage).is_complete(cell));
    assert!(!log.loaded.contains(&cell));
    let in_view = packed.head.catalog.pieces_of(cell).len();
    assert!(in_view > 1 && stream(&stage).n_pieces()[0] >= in_view - 1);
}
