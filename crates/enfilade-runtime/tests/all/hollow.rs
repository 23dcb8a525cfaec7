//! A hollow world with its skeleton answers as the whole world does; damaged skeletons are refused.

use enfilade_cpg::{CellSet, PartNumbers, Pvs, VisibleParts, World};
use enfilade_runtime::{
    DetailId, DrawList, SeeOptions, Seen, Sight, SightError, SightOptions, SightSkeleton,
    SightState, Sightlines, SkeletonError, View, Viewer,
};
use enfilade_testkit::{GridParams, Rng, courtyard, room_grid, with_doors, with_specials};

/// Precomputed visibility by chance: each cell sees all cells, and of each a random half of its parts.
fn with_parts(mut world: World, seed: u64) -> World {
    let numbers = PartNumbers::new(&world);
    let n = world.graph.cells.len();
    let mut pvs = Pvs::of_rows(&vec![CellSet::all(n); n]);
    let mut rng = Rng::new(seed);
    let mut of_cell = vec![Vec::new(); n];
    for (i, batch) in world.batches.iter().enumerate() {
        for cell in &batch.cells {
            of_cell[cell.idx()].extend(numbers.of_batch(i));
        }
    }
    for (i, detail) in (0..).zip(&world.details) {
        for cell in &detail.cells {
            of_cell[cell.idx()].push(numbers.of_detail(i));
        }
    }
    let rows = pvs.pairs().map(|(from, to)| {
        let mut own = of_cell[to.idx()].clone();
        own.retain(|_| from == to || rng.below(2) == 0);
        own
    });
    pvs.parts = Some(VisibleParts::of_ascending(rows.collect::<Vec<_>>()));
    world.pvs = Some(pvs);
    world.validate().unwrap();
    world
}

/// Worlds with windows, holes, furniture, the outdoors, doors of wood and glass, mirrors and leads, and visible parts.
fn worlds() -> Vec<(World, SightOptions)> {
    let grid = |rooms, seed| {
        room_grid(&GridParams {
            merges: 0.2,
            holes: 0.2,
            ..GridParams::offices(rooms, seed)
        })
    };
    let usual = SightOptions::default();
    let coarse = SightOptions {
        chunk_triangles: 32,
        occluders: 0,
        ..usual
    };
    let plain = room_grid(&GridParams::offices(30, 3));
    vec![
        (grid(40, 1), usual),
        (grid(40, 2), coarse),
        (with_doors(plain.clone(), |p| p % 3 == 0), usual),
        (with_specials(plain, 3, 7), usual),
        (with_parts(with_doors(grid(20, 9), |_| false), 5), usual),
        (courtyard(8, false), usual),
        (World::default(), usual),
    ]
}

fn hollow_of(whole: &World, sight: &Sight) -> (World, Sight) {
    let hollow = SightSkeleton::hollow(whole);
    let skeleton = SightSkeleton::decode(&sight.skeleton().encode()).unwrap();
    let hollow_sight = Sight::build_hollow(&hollow, skeleton).unwrap();
    (hollow, hollow_sight)
}

fn assert_same(a: &Seen<'_>, b: &Seen<'_>) {
    assert_eq!(a.cells(), b.cells());
    assert_eq!(a.portals(), b.portals());
    assert_eq!(a.chunks(), b.chunks());
    assert_eq!(a.details(), b.details());
    assert_eq!(a.specials(), b.specials());
    assert_eq!(a.stopped(), b.stopped());
    assert_eq!(a.n_triangles(), b.n_triangles());
    assert_eq!(format!("{:?}", a.visits()), format!("{:?}", b.visits()));
    assert_eq!(format!("{:?}", a.counts()), format!("{:?}", b.counts()));
}

fn view(world: &World, rng: &mut Rng) -> View {
    let mut number = |low: f32, high: f32| rng.range(low.into(), high.into()) as f32;
    let cells = &world.graph.cells;
    let n = number(0.0, cells.len() as f32) as usize;
    let [low, high] = cells.get(n).map_or([[-1.0; 3], [1.0; 3]], |c| c.aabb);
    let eye = [0, 1, 2].map(|k| number(low[k], high[k]));
    if number(0.0, 1.0) < 0.1 {
        return View::around(eye).unwrap();
    }
    let toward = [number(-1.0, 1.0), number(-0.4, 0.4), number(-1.0, 1.0)];
    View::perspective(eye, toward, [0.0, 1.0, 0.0], number(0.3, 1.5), 1.6).unwrap()
}

#[test]
fn a_hollow_world_answers_as_the_whole_world_does() {
    let (mut n_shadowed, mut n_specials) = (0, 0);
    for (n, (world, options)) in worlds().into_iter().enumerate() {
        let whole = Sight::build_with(&world, &options).unwrap();
        let (hollow, sight) = hollow_of(&world, &whole);
        let mut state = [&whole, &sight].map(SightState::new);
        let mut viewers = [&whole, &sight].map(Viewer::new);
        let (mut draws, mut hollow_draws) = (DrawList::new(), DrawList::new());
        let mut rng = Rng::new(n as u64);
        for i in 0..200 {
            for portal in world.graph.portal_ids().filter(|_| i % 10 == 9) {
                let fraction = [0.0, 0.5, 1.0][rng.below(3)];
                for state in &mut state {
                    state.set_leaves(portal, fraction);
                }
            }
            let view = view(&world, &mut rng);
            let precomputed = rng.below(4) > 0;
            for viewer in &mut viewers {
                *viewer.options_mut() = SeeOptions {
                    precomputed,
                    ..SeeOptions::default()
                };
            }
            let [one, other] = &mut viewers;
            let a = one.see(&whole, &state[0], &view);
            let b = other.see(&sight, &state[1], &view);
            assert_same(&a, &b);
            n_shadowed += a.counts().shadowed;
            n_specials += a.specials().len();
            draws.fill(&whole, &a);
            hollow_draws.fill(&sight, &b);
            assert_eq!(draws.draws(), hollow_draws.draws());
            assert!(
                hollow_draws
                    .into_iter()
                    .all(|d| d.indices(&sight).is_empty())
            );
            let (a, b) = (
                one.see_through_walls(&whole, &view),
                other.see_through_walls(&sight, &view),
            );
            assert_same(&a, &b);
        }
        let sizes = sight.skeleton().sizes();
        assert_eq!(whole.skeleton().sizes(), sizes);
        let batches = world.batches.iter().map(|b| &b.primitive);
        let meshes = world.detail_meshes.iter().flat_map(|m| &m.primitives);
        let indices = batches.chain(meshes).map(|p| p.indices.len() as u64);
        assert_eq!(sizes[1], indices.sum::<u64>());
        assert_eq!(whole.chunks(), sight.chunks());
        assert_eq!(whole.n_triangles(), sight.n_triangles());
        assert_eq!(whole.tolerance().to_bits(), sight.tolerance().to_bits());
        for d in (0..world.details.len() as u32).map(DetailId) {
            assert_eq!(whole.detail_box(d), sight.detail_box(d));
            assert_eq!(whole.detail_triangles(d.0), sight.detail_triangles(d.0));
            assert_eq!(
                whole.cells_of_detail(&world, d),
                sight.cells_of_detail(&hollow, d)
            );
        }
    }
    assert!(
        n_shadowed > 100 && n_specials > 20,
        "{n_shadowed} {n_specials}"
    );
}

#[test]
fn triangles_that_arrive_are_ordered_as_in_the_whole_world_and_others_refused() {
    let (world, options) = worlds().swap_remove(0);
    let whole = Sight::build_with(&world, &options).unwrap();
    let (_, sight) = hollow_of(&world, &whole);
    let mut n_chunks = 0;
    for (i, batch) in (0..).zip(&world.batches) {
        let order = sight.chunk_order(i, &batch.primitive).unwrap();
        assert_eq!(order, whole.indices(i));
        assert_eq!(sight.chunks_of(i).start, n_chunks);
        n_chunks = sight.chunks_of(i).end;
        assert!(sight.batch_area(i) > 0.0);
        let refused = |primitive| {
            let found = sight.chunk_order(i, &primitive);
            assert_eq!(found, Err(SightError::OtherBatch { batch: i }));
        };
        let mut other = batch.primitive.clone();
        other.indices.truncate(other.indices.len() - 3);
        refused(other);
        let mut other = batch.primitive.clone();
        for p in &mut other.positions {
            p[1] += 0.25;
        }
        refused(other);
        let mut other = batch.primitive.clone();
        other.indices[0] = other.positions.len() as u32;
        refused(other);
    }
    assert_eq!(n_chunks as usize, sight.chunks().len());
    let n = world.batches.len() as u32;
    assert!(sight.chunk_order(n, &Default::default()).is_err());
    assert!(sight.chunks_of(n).is_empty());
}

#[test]
fn a_skeleton_of_another_world_is_refused() {
    let worlds = worlds();
    for (i, (world, options)) in worlds.iter().enumerate() {
        let skeleton = Sight::build_with(world, options)
            .unwrap()
            .skeleton()
            .clone();
        for (j, (other, _)) in worlds.iter().enumerate() {
            let hollow = SightSkeleton::hollow(other);
            let built = Sight::build_hollow(&hollow, skeleton.clone());
            assert_eq!(built.is_ok(), i == j, "{i} {j}");
        }
    }
    // The leaves of doors must have their triangles.
    let (world, options) = &worlds[2];
    let skeleton = Sight::build_with(world, options)
        .unwrap()
        .skeleton()
        .clone();
    let mut hollow = SightSkeleton::hollow(world);
    assert!(hollow.validate().is_ok());
    for mesh in &mut hollow.detail_meshes {
        mesh.primitives.clear();
    }
    let built = Sight::build_hollow(&hollow, skeleton).unwrap_err();
    assert!(built.to_string().contains("triangles in a leaf"), "{built}");
}

#[test]
fn damaged_skeletons_are_refused() {
    let small = with_parts(room_grid(&GridParams::two_rooms()), 2);
    let furnished = room_grid(&GridParams::offices(4, 6));
    for world in [small, furnished] {
        let bytes = Sight::build(&world).unwrap().skeleton().encode();
        let read = SightSkeleton::decode(&bytes).unwrap();
        assert_eq!(read.encode(), bytes);
        for n in 0..bytes.len() {
            assert!(SightSkeleton::decode(&bytes[..n]).is_err(), "cut at {n}");
        }
        for at in 0..bytes.len() {
            for bit in [0, 3, 7] {
                let mut flipped = bytes.clone();
                flipped[at] ^= 1 << bit;
                assert!(
                    SightSkeleton::decode(&flipped).is_err(),
                    "bit {bit} of {at}"
                );
            }
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(SightSkeleton::decode(&longer).is_err());
    }
    let found = SightSkeleton::decode(b"glTF and so on").unwrap_err();
    assert_eq!(found, SkeletonError::OtherFormat);
}

/// Writes the checksum of changed bytes, so that what follows it is tested, too.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let n = bytes.len() - 8;
    let fnv = |sum: u64, b: &u8| (sum ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3);
    let sum = bytes[..n].iter().fold(0xcbf2_9ce4_8422_2325, fnv);
    bytes[n..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

#[test]
fn forged_skeletons_are_refused_or_answer_something() {
    let world = with_parts(room_grid(&GridParams::offices(4, 6)), 1);
    let hollow = SightSkeleton::hollow(&world);
    let bytes = Sight::build(&world).unwrap().skeleton().encode();
    let mut rng = Rng::new(8);
    let (mut n_refused, mut n_built) = (0, 0);
    for i in 0..3000 {
        let mut forged = bytes.clone();
        // The head, where the counts are, as often as all the rest.
        let end = if i % 2 == 0 { 64 } else { bytes.len() - 8 };
        for _ in 0..=rng.below(3) {
            let at = 12 + rng.below(end - 12);
            forged[at] = [0, 1, 0x7f, 0x80, 0xff, rng.below(256) as u8][rng.below(6)];
        }
        if rng.below(8) == 0 {
            forged.truncate(20 + rng.below(bytes.len() - 20));
        }
        let Ok(skeleton) = SightSkeleton::decode(&sealed(forged)) else {
            n_refused += 1;
            continue;
        };
        let Ok(sight) = Sight::build_hollow(&hollow, skeleton) else {
            n_refused += 1;
            continue;
        };
        n_built += 1;
        let state = SightState::new(&sight);
        let mut viewer = Viewer::new(&sight);
        let mut list = DrawList::new();
        for _ in 0..4 {
            let view = view(&world, &mut rng);
            list.fill(&sight, &viewer.see(&sight, &state, &view));
        }
        for (i, batch) in (0..).zip(&world.batches) {
            let _ = sight.chunk_order(i, &batch.primitive);
        }
    }
    assert!(n_refused > 500 && n_built > 200, "{n_refused} {n_built}");
}

#[test]
fn lines_of_sight_in_a_hollow_world_meet_what_is_there() {
    let (world, _) = worlds().swap_remove(2);
    let mut hollow = SightSkeleton::hollow(&world);
    let (whole, empty) = (Sightlines::build(&world), Sightlines::build(&hollow));
    hollow.batches.clone_from(&world.batches);
    let walls = Sightlines::build(&hollow);
    let mut rng = Rng::new(3);
    let mut n_hits = 0;
    for _ in 0..500 {
        let mut point = || [0, 1, 2].map(|_| rng.range(0.0, 20.0) as f32);
        let (a, b) = (point(), point());
        let hit = whole.first_hit(a, b);
        n_hits += usize::from(hit.is_some());
        assert_eq!(walls.first_hit(a, b), hit);
        assert_eq!(empty.first_hit(a, b), None);
        assert_eq!(empty.first_hit_by_cells(a, b), None);
    }
    assert!(n_hits > 100, "{n_hits}");
}
