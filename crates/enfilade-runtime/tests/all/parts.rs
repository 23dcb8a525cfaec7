//! Precomputed visibility of a cell bounds the answer for an eye in it.

use enfilade_cpg::{CellId, CellSet, PartNumbers, Pvs, VisibleParts, World};
use enfilade_runtime::{SeeOptions, Sight, SightState, View, Viewer};
use enfilade_testkit::{GridParams, room_grid};

/// Two rooms in a row along x with a doorway between them, and furniture.
fn two_rooms() -> World {
    room_grid(&GridParams {
        size: [2, 1, 1],
        doors: 1.0,
        windows: 0.0,
        ..GridParams::offices(2, 1)
    })
}

/// The middle of a cell's box.
fn middle(world: &World, cell: CellId) -> [f32; 3] {
    let [low, high] = world.graph.cells[cell.idx()].aabb;
    [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5)
}

// Covers Q5.
#[test]
fn precomputed_visibility_bounds_the_answer_and_nothing_else() {
    let mut world = two_rooms();
    let numbers = PartNumbers::new(&world);
    let n = world.graph.cells.len();
    let mut pvs = Pvs::of_rows(&vec![CellSet::all(n); n]);
    let (a, b) = {
        let mut indoors = world.graph.indoor_cells().map(|c| c.0);
        (indoors.next().unwrap(), indoors.next().unwrap())
    };
    // The first room sees nothing of the other cells, except the first triangle of every second batch.
    let is_first = |part: u32| {
        let mut batches = (1..world.batches.len()).step_by(2);
        batches.any(|i| numbers.of_batch(i).start == part)
    };
    let pairs: Vec<_> = pvs.pairs().collect();
    let row = |&(from, to): &(CellId, CellId)| {
        let is_cut = from == a && to != a;
        let parts = 0..numbers.n_parts();
        parts
            .filter(|&part| !is_cut || is_first(part))
            .collect::<Vec<_>>()
    };
    // Listing all parts for (a, a) would make the whole second room visible, so list only those of the cell.
    let of_cell = |cell: CellId| {
        let mut parts: Vec<u32> = Vec::new();
        for (i, batch) in world.batches.iter().enumerate() {
            if batch.cells.contains(&cell) {
                parts.extend(numbers.of_batch(i));
            }
        }
        let details = (0..).zip(&world.details);
        let details = details.filter(|(_, d)| d.cells.contains(&cell));
        parts.extend(details.map(|(i, _)| numbers.of_detail(i)));
        parts
    };
    let rows = pairs.iter().map(|pair| {
        let mut parts = row(pair);
        let own = of_cell(pair.1);
        parts.retain(|part| own.contains(part));
        parts
    });
    pvs.parts = Some(VisibleParts::of_ascending(rows.collect::<Vec<_>>()));
    world.pvs = Some(pvs);
    world.validate().unwrap();

    let sight = Sight::build(&world).unwrap();
    let state = SightState::new(&sight);
    let ask = |eye: [f32; 3], precomputed: bool| {
        let options = SeeOptions {
            precomputed,
            occlusion: false,
            ..SeeOptions::default()
        };
        let mut viewer = Viewer::with_options(&sight, options);
        let view = View::around(eye).unwrap();
        let seen = viewer.see(&sight, &state, &view);
        (
            seen.chunks().to_vec(),
            seen.details().to_vec(),
            seen.n_triangles(),
        )
    };
    let is_elsewhere = |cells: &[CellId]| !cells.contains(&a);
    let eye = middle(&world, a);
    let ((chunks, details, _), (all_chunks, all_details, _)) = (ask(eye, true), ask(eye, false));
    let hidden: Vec<_> = all_details
        .iter()
        .filter(|d| !details.contains(d))
        .collect();
    assert!(!hidden.is_empty());
    assert!(
        hidden
            .iter()
            .all(|d| is_elsewhere(&world.details[d.0 as usize].cells))
    );
    let kept = all_details
        .iter()
        .filter(|d| !is_elsewhere(&world.details[d.0 as usize].cells));
    assert!(kept.into_iter().all(|d| details.contains(d)));
    // A chunk stays if one of its triangles is seen.
    let mut n_hidden = 0;
    for chunk in &all_chunks {
        let batch = sight[*chunk].batch as usize;
        let is_first = !batch.is_multiple_of(2)
            && sight.indices(batch as u32)[sight[*chunk].first_index as usize..]
                [..sight[*chunk].n_indices as usize]
                .chunks_exact(3)
                .any(|t| *t == world.batches[batch].primitive.indices[..3]);
        let is_out = is_elsewhere(&world.batches[batch].cells) && !is_first;
        n_hidden += usize::from(is_out);
        assert_eq!(!chunks.contains(chunk), is_out, "{chunk:?}");
    }
    // From the second room nothing changes, nor for an eye in no cell.
    assert_eq!(ask(middle(&world, b), true), ask(middle(&world, b), false));
    let outside = [1e4; 3];
    assert_eq!(ask(outside, true), ask(outside, false));
    assert!(n_hidden > 0);
}
