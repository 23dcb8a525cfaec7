//! The layout agrees with the graph about each cell and portal.

use enfilade_cpg::PortalId;
use enfilade_geom::{Aabb, DVec3};
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_world::Layout;

fn layout_and_graph() -> (Layout, enfilade_cpg::World) {
    let world = room_grid(&GridParams {
        merges: 0.2,
        turn: 0.4,
        ..GridParams::offices(120, 3)
    });
    (Layout::new(&world), world)
}

#[test]
fn exits_and_openings_are_those_of_the_graph() {
    let (layout, world) = layout_and_graph();
    let graph = &world.graph;
    for cell in graph.cell_ids() {
        let exits: Vec<_> = graph.exits(cell).map(|e| (e.id, e.to)).collect();
        let own: Vec<_> = layout
            .exits(cell)
            .iter()
            .map(|e| (e.portal, e.to))
            .collect();
        assert_eq!(own, exits);
    }
    for id in graph.portal_ids() {
        let (opening, portal) = (layout.opening(id), &graph[id]);
        assert_eq!(opening.cells(), portal.cells);
        assert!((opening.area() - f64::from(portal.area)).abs() < 1e-4 * opening.area());
        for &corner in opening.pieces().flatten() {
            assert!(opening.height_of(corner).abs() < layout.tolerance());
            assert!(corner.distance(opening.center()) <= opening.radius());
            assert!(opening.bounds().contains(corner));
        }
    }
}

#[test]
fn a_portal_leads_from_one_of_its_cells_to_the_other() {
    let (layout, _) = layout_and_graph();
    for id in (0..layout.n_portals() as u32).map(PortalId) {
        let opening = layout.opening(id);
        let step = opening.normal() * 0.01;
        let middle: DVec3 =
            opening.pieces().flatten().sum::<DVec3>() / opening.pieces().flatten().count() as f64;
        let sides = [middle - step, middle + step].map(|p| layout.locate(p));
        assert_eq!(sides, opening.cells().map(Some), "{id}");
    }
}

#[test]
fn a_portal_whose_pieces_and_outline_have_no_area_has_no_opening() {
    let (_, mut world) = layout_and_graph();
    let flat = vec![[0.0; 3]; 3];
    world.graph.portals[0].pieces = vec![flat.clone()];
    let by_outline = Layout::new(&world);
    assert_eq!(by_outline.opening(PortalId(0)).pieces().len(), 1);
    world.graph.portals[0].outline = flat;
    world.graph.portals[1].pieces[0][0][1] = f32::NAN;
    world.graph.portals[1].outline[0][1] = f32::NAN;
    let none = Layout::new(&world);
    for id in [0, 1].map(PortalId) {
        assert_eq!(none.opening(id).pieces().len(), 0);
        assert_eq!(none.opening(id).area(), 0.0);
    }
}

#[test]
fn within_the_room_that_a_point_has_the_cell_is_the_same() {
    let (layout, world) = layout_and_graph();
    let mut rng = Rng::new(9);
    let bounds = world.graph.locator.bounds;
    let mut n_wide = 0;
    for _ in 0..20_000 {
        let mut random = |low: DVec3, high: DVec3| {
            DVec3::from_array([0, 1, 2].map(|k| rng.range(low[k], high[k])))
        };
        let p = random(bounds.min - 1.0, bounds.max + 1.0);
        let (cell, room) = layout.locate_with_room(p);
        assert_eq!(cell, layout.locate(p));
        n_wide += usize::from(room > 0.1);
        let step = random(DVec3::NEG_ONE, DVec3::ONE).normalize_or(DVec3::X);
        assert_eq!(layout.locate(p + step * room * 0.999), cell, "{p} {room}");
    }
    assert!(n_wide > 5000, "{n_wide}");
}

#[test]
fn a_part_of_the_tree_answers_for_the_hull_of_its_points() {
    let (_, world) = layout_and_graph();
    let locator = &world.graph.locator;
    let mut rng = Rng::new(5);
    let around = locator.bounds.expanded(0.5);
    for _ in 0..2000 {
        let first = rng.point_in(&around);
        let near = Aabb::new(first, first).expanded(rng.range(0.0, 2.0));
        let hull = [(); 4].map(|()| rng.point_in(&near));
        let part = locator.around(&hull);
        let share = rng.unit();
        let between = (0..4).map(|k| hull[k].lerp(hull[(k + 1) % 4], share));
        for p in hull.into_iter().chain(between) {
            assert_eq!(part.locate(p), locator.locate(p), "{p} of {hull:?}");
        }
    }
}
