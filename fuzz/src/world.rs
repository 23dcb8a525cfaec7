//! Worlds: decoding, reports, queries.

use std::sync::LazyLock;

use enfilade::runtime::{
    DrawList, Follower, Narrowing, SeeOptions, Sight, SightState, Sightlines, Target, View, Viewer,
};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{CellId, Pass, PortalId, SpecialPortal, SpecialShape, Way, World};
use enfilade_geom::Similarity;
use enfilade_report::{PlanOptions, ReportParts, plan_svg, report_html};
use enfilade_testkit::{GridParams, room_grid};

use crate::Numbers;

/// The decoder: every world that it accepts is valid and can be encoded. Also with corrected lengths, so that mutations
/// get past the lengths to the contents.
pub fn world(data: &[u8]) {
    check(data);
    check(&with_lengths_mended(data));
}

fn check(bytes: &[u8]) {
    let Ok(world) = decode_glb(bytes) else { return };
    assert_eq!(world.validate(), Ok(()));
    let written = encode_glb(&world).expect("a valid world can be written");
    let back = decode_glb(&written).expect("what was written can be read");
    assert!(encode_glb(&back).expect("and written again") == written);
}

/// Plan and report page, which every valid world has.
pub fn report(data: &[u8]) {
    let Ok(world) = decode_glb(&with_lengths_mended(data)) else {
        return;
    };
    let svg = plan_svg(&world, &PlanOptions::default());
    assert!(svg.ends_with("</svg>\n"), "{svg}");
    let parts = ReportParts {
        title: "<&>".to_owned(),
        visible: world.pvs.clone().unwrap_or_default(),
        ..ReportParts::default()
    };
    let page = report_html(&world, &parts);
    assert!(page.ends_with("</html>\n"));
    // The page has its own script and none from the world.
    assert!(page.matches("<script").count() == 1 && !page.contains("<&>"));
}

/// A world that keeps its promises.
static PLAIN: LazyLock<World> = LazyLock::new(|| room_grid(&GridParams::offices(6, 3)));

/// Per-frame queries: the input holds a few queries, then a world; a plain world if that cannot be decoded.
pub fn run_time(data: &[u8]) {
    const QUESTIONS: usize = 96;
    let (questions, rest) = data.split_at(data.len().min(QUESTIONS));
    let decoded = decode_glb(&with_lengths_mended(rest)).ok();
    let world = decoded.as_ref().unwrap_or(&*PLAIN);
    let Ok(sight) = Sight::build(world) else {
        return;
    };
    let mut numbers = Numbers(questions);
    let kind = numbers.byte();
    let (is_any, has_far) = (kind & 1 == 1, kind & 2 == 2);
    let lines = Sightlines::build(world);
    let mut state = SightState::new(&sight);
    for _ in 0..2 {
        let id = u32::from(numbers.byte());
        if (id as usize) < sight.n_portals() {
            let portal = PortalId(id);
            match id % 4 {
                0 => state.close(portal),
                1 => state.open(portal),
                2 => state.set_leaves(portal, numbers.float(is_any)),
                _ => state.narrow(portal, numbers.point(is_any), numbers.point(is_any)),
            }
        }
        if (id as usize) < sight.n_cells() {
            state.lock(CellId(id), id & 4 == 4);
        }
    }
    let [a, b] = [numbers.point(is_any), numbers.point(is_any)];
    let [toward, up] = [numbers.point(is_any), numbers.point(is_any)];
    let [fov, aspect, far] = [0; 3].map(|_| numbers.float(is_any));
    look(
        &sight,
        &state,
        world,
        View::perspective(a, toward, up, fov, aspect).ok(),
        kind,
        far,
    );
    look(&sight, &state, world, View::around(b).ok(), kind, far);
    let view = View::perspective(a, toward, up, fov, aspect);
    if let (true, Ok(view)) = (has_far, view) {
        look(&sight, &state, world, view.with_far(far).ok(), kind, far);
    }
    let mut follower = Follower::new(&sight, a);
    follower.step(&sight, b);
    follower.teleport(&sight, a);
    assert!(
        follower
            .cell()
            .is_none_or(|cell| (cell.0 as usize) < sight.n_cells())
    );
    let picked = lines.pick(&state, a, b);
    let is_finite = a.iter().chain(&b).all(|x| x.is_finite());
    assert_eq!(picked.is_ok(), is_finite);
    if let Ok(Some(hit)) = picked {
        assert!((0.0..=1.0).contains(&hit.t), "{hit:?}");
        // Details do not block sight.
        let is_detail = matches!(hit.target, Target::Detail { .. });
        assert!(is_detail || !lines.is_clear(&state, a, b), "{hit:?}");
    }
    let [whole, by_cells] = [lines.first_hit(a, b), lines.first_hit_by_cells(a, b)]
        .map(|hit| hit.map(|h| h.t.to_bits()));
    // If the decoded world is inconsistent about its cells, following the cells finds other walls.
    assert!(
        decoded.is_some() || whole == by_cells,
        "{whole:?} {by_cells:?}"
    );
}

/// Returns a seed: four rooms with a leaf in each doorway, half of them of glass.
#[must_use]
pub fn with_doors() -> Vec<u8> {
    let grid = GridParams {
        furniture: 0,
        ..GridParams::offices(4, 2)
    };
    let world = enfilade_testkit::with_doors(room_grid(&grid), |portal| portal % 2 == 0);
    encode_glb(&world).unwrap_or_default()
}

/// Returns a seed: four rooms with a reflecting pane, a mirror in each room and a link of each to the next.
#[must_use]
pub fn with_specials() -> Vec<u8> {
    let mut world = room_grid(&GridParams::offices(4, 2));
    let mut made = Vec::new();
    let special = |cell, shape, passes| SpecialPortal {
        name: "glass".to_owned(),
        cell,
        shape,
        passes,
    };
    let pane = Pass {
        way: Way::Mirror,
        tint: [1.0, 1.0, 1.0, 0.25],
    };
    for (id, portal) in world.graph.portal_ids().zip(&world.graph.portals) {
        let passes = vec![Pass::new(Way::Through), pane.clone()];
        made.push(special(portal.cells[0], SpecialShape::Portal(id), passes));
    }
    for (id, cell) in world.graph.cell_ids().zip(&world.graph.cells) {
        let [[x, _, z], [_, top, _]] = cell.aabb;
        let shape = |at: f32| SpecialShape::Surface {
            normal: [0.0, 1.0, 0.0],
            pieces: vec![vec![[x, top, at], [x, top, at + 1.0], [x + 1.0, top, at]]],
        };
        let lead = Way::Lead {
            to: CellId(id.0 / 2),
            map: Similarity::default(),
            back: None,
        };
        made.push(special(id, shape(z), vec![Pass::new(Way::Mirror)]));
        made.push(special(id, shape(z + 1.0), vec![Pass::new(lead)]));
    }
    world.graph.specials = made;
    encode_glb(&world).unwrap_or_default()
}

fn look(sight: &Sight, state: &SightState, world: &World, view: Option<View>, kind: u8, size: f32) {
    let Some(view) = view else { return };
    let narrowing = match kind >> 2 & 3 {
        0 => Narrowing::Rectangle,
        1 => Narrowing::Polygon,
        _ => SeeOptions::default().narrowing,
    };
    let options = SeeOptions {
        narrowing,
        ..SeeOptions::default()
    };
    let mut viewer = Viewer::with_options(sight, options);
    let seen = viewer.see(sight, state, &view);
    let cells = seen.cells().to_vec();
    let _ = seen.sees_box(&cells, [view.eye(), [size; 3]]);
    let mut list = DrawList::new();
    list.fill(sight, &seen);
    let n: usize = list
        .draws()
        .iter()
        .map(|d| d.indices(sight).len() / 3)
        .sum();
    assert_eq!(list.n_triangles(), n as u64);
    for draw in &list {
        assert!(
            draw.indices(sight)
                .iter()
                .all(|&i| (i as usize) < draw.batch(world).primitive.positions.len())
        );
    }
    // The eye's own room is always visible, unless it is locked.
    if let Some(cell) = sight.locate(view.eye()) {
        assert!(
            cells.contains(&cell) || state.is_locked(cell),
            "{cell:?} of the eye in {cells:?}"
        );
    }
}

/// Sets the lengths in the header and before both chunks to those of the bytes.
fn with_lengths_mended(data: &[u8]) -> Vec<u8> {
    let mut out = data.to_vec();
    if out.len() < 20 {
        return out;
    }
    let all = out.len();
    let mut set = |at: usize, n: usize| out[at..at + 4].copy_from_slice(&(n as u32).to_le_bytes());
    set(8, all);
    match data[20..]
        .windows(4)
        .position(|w| w == b"BIN\0")
        .filter(|&at| at >= 4)
    {
        Some(at) => {
            set(12, at - 4);
            set(20 + at - 4, all - (20 + at + 4));
        }
        None => set(12, all - 20),
    }
    out
}
