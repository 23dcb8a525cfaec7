//! Openings and surfaces that part no rooms, in small buildings. Covers V9.

use std::collections::BTreeSet;

use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::{CellId, CellPortalGraph, Portal};
use enfilade_geom::scene::{Material, Mesh, Object, Role, Scene};
use enfilade_geom::{Aabb, DMat4, DVec3};
use enfilade_testkit::hills;
use enfilade_testkit::solid::{MeshBuilder, aabb};

/// A box as its minimum and maximum.
type Block = ([f64; 3], [f64; 3]);

fn boxes(of: &[Block]) -> Vec<Aabb> {
    of.iter().map(|b| aabb(b.0, b.1)).collect()
}

/// Makes one solid of boxes that touch.
fn union(of: &[Block]) -> Mesh {
    let mut mesh = MeshBuilder::new(0);
    mesh.carved(&boxes(of), &[]);
    mesh.build("", &[])
}

/// Bakes a lump with the given rooms and holes in it, and `things`, each an object.
fn baked(method: Method, air: &[Block], things: Vec<Mesh>) -> CellPortalGraph {
    let air = boxes(air);
    let lump = air.iter().fold(air[0], |all, b| all.union(*b));
    let mut mesh = MeshBuilder::new(0);
    mesh.carved(&[lump.expanded(0.3)], &air);
    let mut meshes = things;
    meshes.push(mesh.build("", &[]));
    let object = |mesh: u32| Object {
        name: String::new(),
        mesh,
        transform: DMat4::IDENTITY,
        role: Role::Structural,
        reason: String::new(),
        filling: None,
        node: None,
    };
    let scene = Scene {
        objects: (0..meshes.len() as u32).map(object).collect(),
        meshes,
        materials: vec![Material::default()],
        ..Scene::default()
    };
    let context = BakeContext::new(&Silent, None);
    let baked = bake(&scene, &BakeConfig::of(method), &context).unwrap();
    baked.world.graph
}

fn at(graph: &CellPortalGraph, p: [f64; 3]) -> CellId {
    let cell = graph.locator.locate(DVec3::from(p));
    let cell = cell.unwrap_or_else(|| panic!("no cell at {p:?}"));
    assert!(!graph[cell].outdoor, "{p:?} is outdoors");
    cell
}

fn n_indoors(graph: &CellPortalGraph) -> usize {
    graph.indoor_cells().count()
}

fn is_void(graph: &CellPortalGraph, p: [f64; 3]) -> bool {
    graph[at(graph, p)].is_void
}

/// A living room of 6 m x 5 m and a kitchen of 2.4 m x 2.5 m beside it, 2.5 m high, with an opening between them.
fn living_and_kitchen(method: Method, kitchen: [f64; 2], hole: Block) -> CellPortalGraph {
    baked(
        method,
        &[
            ([0.0, 0.0, 0.0], [6.0, 2.5, 5.0]),
            ([6.1, 0.0, kitchen[0]], [8.6, 2.5, kitchen[1]]),
            hole,
        ],
        Vec::new(),
    )
}

fn a_niche_open_at_full_height_is_part_of_its_room(method: Method) {
    // The wall of the room goes on into the kitchen: one jamb of 0.7 m on the other side, no lintel.
    let graph = living_and_kitchen(method, [2.6, 5.0], ([6.0, 0.0, 3.3], [6.1, 2.5, 5.0]));
    assert_eq!(n_indoors(&graph), 1);
    // With both jambs and a lintel it is a doorway.
    let graph = living_and_kitchen(method, [2.6, 5.0], ([6.0, 0.0, 3.3], [6.1, 2.1, 4.2]));
    assert_eq!(n_indoors(&graph), 2);
    assert_ne!(at(&graph, [3.0, 1.2, 2.5]), at(&graph, [7.4, 1.2, 3.8]));
}

fn beams_across_a_hall_part_nothing(method: Method) {
    // One leaves 3.2 of 3.8 m; three leave 1.6 of 2.35 m, in bays narrower than the hall is deep.
    let beam = |x: f64, low: f64| ([x, low, -0.1], [x + 0.2, 4.0, 9.1]);
    let halls = [
        (3.8, vec![beam(7.8, 3.2)]),
        (2.35, [3.9, 7.9, 11.9].map(|x| beam(x, 1.6)).to_vec()),
    ];
    for (height, beams) in halls {
        let hall = ([0.0, 0.0, 0.0], [16.0, height, 9.0]);
        let graph = baked(method, &[hall], vec![union(&beams)]);
        assert_eq!(n_indoors(&graph), 1, "{height}");
    }
}

/// A hall of 9 m x 12 m, 3.7 m high, with a beam across its middle that leaves `head` m, and a wall of the given lengths on either side
/// below it.
fn hall_with_beam(method: Method, jambs: [f64; 2], head: f64) -> CellPortalGraph {
    baked(
        method,
        &[
            ([0.0, 0.0, 0.0], [9.0, 3.7, 6.0]),
            ([0.0, 0.0, 6.3], [9.0, 3.7, 12.3]),
            ([jambs[0], 0.0, 6.0], [9.0 - jambs[1], head, 6.3]),
        ],
        Vec::new(),
    )
}

fn a_beam_on_pilasters_parts_nothing_and_walls_below_it_do(method: Method) {
    assert_eq!(n_indoors(&hall_with_beam(method, [0.3; 2], 3.2)), 1);
    assert_eq!(n_indoors(&hall_with_beam(method, [1.5; 2], 3.2)), 2);
}

fn a_deep_beam_beside_a_wall_parts_what_the_wall_parts_below_it(method: Method) {
    // The opening has half of the hall's section, but people below the beam have more than three quarters of its width; and of 1.5 m
    // beside it and itself, a narrow one has two thirds.
    assert_eq!(n_indoors(&hall_with_beam(method, [0.0, 2.0], 2.35)), 1);
    assert_eq!(n_indoors(&hall_with_beam(method, [0.0, 6.0], 2.35)), 2);
}

/// Returns two rooms with a door between them below one plenum, which three beams in each room divide. Above each beam is
/// a slit of the given height.
fn below_a_plenum(method: Method, slit: f64) -> CellPortalGraph {
    let rooms = [
        ([0.0, 0.0, 0.0], [6.0, 4.0, 5.0]),
        ([6.15, 0.0, 0.0], [12.15, 4.0, 5.0]),
        ([6.0, 0.0, 2.0], [6.15, 2.1, 2.9]),
        ([6.0, 3.3, 2.0], [6.15, 3.8, 3.0]),
    ];
    let ceilings = [
        ([-0.05, 2.6, -0.05], [6.05, 2.62, 5.05]),
        ([6.1, 2.6, -0.05], [12.2, 2.62, 5.05]),
    ];
    let beam = |x: f64| ([x, 2.62, -0.05], [x + 0.2, 4.0 - slit, 5.05]);
    let beams = [1.4, 2.9, 4.4, 7.6, 9.1, 10.6].map(beam);
    baked(method, &rooms, vec![union(&ceilings), union(&beams)])
}

fn the_space_above_hung_ceilings_is_one_cell_between_beams_with_slits(method: Method) {
    // The second is too narrow for the voxels: only the exact cut shows it.
    for slit in [0.25, 0.04] {
        let graph = below_a_plenum(method, slit);
        let [west, east] = [[3.0, 1.2, 2.5], [9.0, 1.2, 2.5]].map(|p| at(&graph, p));
        let above = at(&graph, [0.7, 3.3, 2.5]);
        for x in [2.2, 3.7, 5.2, 7.0, 8.4, 9.9, 11.5] {
            assert_eq!(at(&graph, [x, 3.3, 2.5]), above, "above {x}, slit {slit}");
        }
        assert!(west != east && above != west && above != east);
        assert!(graph[above].is_void && graph[west].is_room() && graph[east].is_room());
        assert_eq!(n_indoors(&graph), 3, "slit {slit}");
    }
}

/// All three cellars are too low to stand in, and each has a doorway to the next room.
fn cellars_with_doorways_stay_rooms(method: Method) {
    for is_mirrored in [false, true] {
        let mirrored = |(min, max): Block| match is_mirrored {
            true => ([-max[0], min[1], min[2]], [-min[0], max[1], max[2]]),
            false => (min, max),
        };
        let air = [
            ([0.0, 0.0, 0.0], [5.0, 2.6, 5.0]),
            ([5.2, 0.0, 0.0], [9.2, 1.8, 5.0]),
            ([9.4, 0.0, 0.0], [13.4, 1.8, 5.0]),
            ([13.6, 0.0, 0.0], [17.6, 1.8, 5.0]),
            ([5.0, 0.0, 2.0], [5.2, 1.6, 2.9]),
            ([9.2, 0.0, 2.0], [9.4, 1.6, 2.9]),
            ([13.4, 0.0, 2.0], [13.6, 1.6, 2.9]),
        ];
        let graph = baked(method, &air.map(mirrored), Vec::new());
        assert_eq!(n_indoors(&graph), 4, "mirrored: {is_mirrored}");
        assert_eq!(graph.rooms().count(), 4, "mirrored: {is_mirrored}");
    }
}

#[test]
fn spaces_without_room_to_stand_or_a_doorway_are_voids_for_each_method() {
    // A duct behind a grille, a crawl space with a hatch in the room's floor, and a closed space as high as a room.
    let air = [
        ([0.0, 0.0, 0.0], [5.0, 2.6, 5.0]),
        ([5.3, 0.0, 0.0], [10.3, 0.6, 1.0]),
        ([5.0, 0.1, 0.2], [5.3, 0.5, 0.8]),
        ([0.0, -1.5, 0.0], [5.0, -0.3, 5.0]),
        ([2.0, -0.3, 2.0], [2.8, 0.0, 2.8]),
        ([5.3, 0.0, 2.0], [8.3, 2.6, 5.0]),
    ];
    for method in [Method::Watershed, Method::Bsp, Method::Delaunay] {
        let graph = baked(method, &air, Vec::new());
        assert!(is_void(&graph, [7.0, 0.3, 0.5]), "duct, {method:?}");
        assert!(is_void(&graph, [1.0, -0.9, 1.0]), "crawl space, {method:?}");
        assert!(!is_void(&graph, [7.0, 1.2, 3.5]), "closet, {method:?}");
        assert!(!is_void(&graph, [1.0, 1.2, 1.0]), "room, {method:?}");
    }
}

/// A model in another unit, or a vessel.
#[test]
fn where_nobody_can_stand_anywhere_nothing_is_a_void() {
    let air = [
        ([0.0, 0.0, 0.0], [1.5, 0.8, 1.5]),
        ([1.6, 0.0, 0.0], [3.1, 0.8, 1.5]),
    ];
    for graph in [Method::Watershed, Method::Bsp].map(|m| baked(m, &air, Vec::new())) {
        assert!(graph.cells.iter().all(|c| !c.is_void));
    }
}

/// The ridge of the roof is 2.3 m above the floor of the upper attic, 1.8 m above that of the lower; hatches lead to both.
#[test]
fn an_attic_is_a_room_if_somebody_can_stand_below_its_ridge() {
    let roof = |ridge: f64, x: f64| {
        let steps = (0..46).map(|k| {
            let z = 0.1 * f64::from(k);
            let top = ridge - (z + 0.05 - 2.3).abs();
            ([x, 2.6 + top.max(0.05), z], [x + 4.0, 5.0, z + 0.1])
        });
        union(&steps.collect::<Vec<_>>())
    };
    let air = [
        ([0.0, 0.0, 0.0], [8.3, 2.3, 4.6]),
        ([0.0, 2.6, 0.0], [4.0, 4.95, 4.6]),
        ([4.3, 2.6, 0.0], [8.3, 4.95, 4.6]),
        ([1.0, 2.3, 1.8], [1.7, 2.6, 2.5]),
        ([6.0, 2.3, 1.8], [6.7, 2.6, 2.5]),
    ];
    let graph = baked(
        Method::Watershed,
        &air,
        vec![roof(2.3, 0.0), roof(1.8, 4.3)],
    );
    assert!(!is_void(&graph, [3.0, 3.0, 2.3]));
    assert!(is_void(&graph, [7.3, 3.0, 2.3]));
}

#[test]
fn openings_from_a_room_into_a_void_are_one_portal_for_each_plane() {
    let lamp = |x: f64| ([x, 2.4, 2.0], [x + 0.6, 2.5, 3.0]);
    let mut air = vec![
        ([0.0, 0.0, 0.0], [6.0, 2.4, 5.0]),
        ([0.0, 2.5, 0.0], [6.0, 3.5, 5.0]),
    ];
    air.extend([0.5, 2.5, 4.5].map(lamp));
    let graph = baked(Method::Watershed, &air, Vec::new());
    let [room, above] = [[3.0, 1.2, 4.0], [3.0, 3.0, 4.0]].map(|p| at(&graph, p));
    assert!(graph[above].is_void && graph[room].is_room());
    let between: Vec<_> = graph.exits(room).filter(|e| e.to == above).collect();
    assert_eq!(between.len(), 1);
    assert_eq!(between[0].portal.pieces.len(), 3);
    assert!((between[0].portal.area - 1.8).abs() < 0.01);
}

fn the_inside_of_a_massive_flight_belongs_to_its_room(method: Method) {
    let step = |i: usize| {
        let x = 1.0 + 0.3 * i as f64;
        ([x, 0.0, 2.0], [x + 0.3, 0.18 * (i + 1) as f64, 5.0])
    };
    let steps: Vec<Block> = (0..15).map(step).collect();
    // One solid, and as many closed boxes as steps; boxes smaller than any cell stay solid.
    let mut apart = MeshBuilder::new(0);
    for b in boxes(&steps[..7]) {
        apart.cuboid(b);
    }
    let mut flights = vec![(union(&steps), &steps[2..])];
    // The Delaunay builder drops parts that open nowhere, and each box is one.
    if method != Method::Delaunay {
        flights.push((apart.build("", &[]), &steps[3..7]));
    }
    for (flight, inside) in flights {
        let graph = baked(method, &[([0.0, 0.0, 0.0], [8.0, 3.6, 6.0])], vec![flight]);
        assert_eq!(n_indoors(&graph), 1);
        let room = at(&graph, [7.0, 1.2, 5.0]);
        for (min, max) in inside {
            let x = 0.5 * (min[0] + max[0]);
            assert_eq!(at(&graph, [x, 0.4, 2.7]), room, "inside {max:?}");
        }
    }
}

/// Makes a test of each function with the given methods.
macro_rules! by {
    ($($of:ident $method:ident: $($name:ident),* $(,)?;)*) => {
        $(mod $of {
            $(#[test]
            fn $name() {
                super::$name(enfilade_bake::Method::$method);
            })*
        })*
    };
}

by! {
    watershed Watershed:
        a_niche_open_at_full_height_is_part_of_its_room,
        beams_across_a_hall_part_nothing,
        a_beam_on_pilasters_parts_nothing_and_walls_below_it_do,
        a_deep_beam_beside_a_wall_parts_what_the_wall_parts_below_it,
        the_space_above_hung_ceilings_is_one_cell_between_beams_with_slits,
        cellars_with_doorways_stay_rooms,
        the_inside_of_a_massive_flight_belongs_to_its_room;
    bsp Bsp:
        a_niche_open_at_full_height_is_part_of_its_room,
        beams_across_a_hall_part_nothing,
        a_beam_on_pilasters_parts_nothing_and_walls_below_it_do,
        the_space_above_hung_ceilings_is_one_cell_between_beams_with_slits,
        cellars_with_doorways_stay_rooms,
        the_inside_of_a_massive_flight_belongs_to_its_room;
    // Tetrahedra have no headroom, so nothing tells a plenum from rooms; and a hole of two thirds of the width is a room's.
    delaunay Delaunay:
        a_niche_open_at_full_height_is_part_of_its_room,
        beams_across_a_hall_part_nothing,
        cellars_with_doorways_stay_rooms,
        the_inside_of_a_massive_flight_belongs_to_its_room;
}

/// Makes land with level ground 40 m around the given places (x, z).
fn land(places: &[[f64; 2]]) -> Mesh {
    let places = places.iter().map(|&[x, z]| DVec3::new(x, 0.0, z));
    hills(&places.collect::<Vec<_>>(), -0.2, 40.0, 10.0)
}

#[test]
fn a_house_on_wide_land_has_the_rooms_of_the_house_at_the_default_voxels() {
    let air = [
        ([0.0, 0.0, 0.0], [4.0, 2.6, 4.0]),
        ([4.2, 0.0, 0.0], [9.0, 2.6, 4.0]),
        ([4.0, 0.0, 1.0], [4.2, 2.1, 2.0]),
    ];
    let alone = baked(Method::Watershed, &air, vec![]);
    let there = baked(Method::Watershed, &air, vec![land(&[[0.0; 2]])]);
    for graph in [&alone, &there] {
        assert_eq!((graph.cells.len(), graph.portals.len()), (3, 1));
        let voxel = graph.statistics.counts["voxel_size"];
        assert!((voxel - 0.1).abs() < 1e-12, "{voxel}");
    }
    let counts = [&alone, &there].map(|graph| graph.statistics.counts["voxels"]);
    assert!(counts[1] < 30.0 * counts[0], "{counts:?}");
    // Far land is outdoors.
    let outdoors = there.locator.locate(DVec3::new(-30.0, 1.0, 0.0));
    assert!(outdoors.is_some());
    for far in [
        [400.0, 40.0, 300.0],
        [-450.0, 30.0, 20.0],
        [20.0, 3.0, -490.0],
    ] {
        assert_eq!(there.locator.locate(far.into()), outdoors, "{far:?}");
    }
}

#[test]
fn houses_far_apart_on_wide_land_have_the_rooms_that_each_has_alone() {
    let places = [[0.0, 0.0], [300.0, -150.0], [-200.0, 350.0]];
    let house = |[x, z]: [f64; 2]| {
        let air = [
            ([0.0, 0.0, 0.0], [4.0, 2.6, 4.0]),
            ([4.2, 0.0, 0.0], [9.0, 2.6, 4.0]),
            ([4.0, 0.0, 1.0], [4.2, 2.1, 2.0]),
        ];
        air.map(|(lo, hi): ([f64; 3], [f64; 3])| {
            let moved = |[a, b, c]: [f64; 3]| [a + x, b, c + z];
            (moved(lo), moved(hi))
        })
    };
    let mut others = vec![land(&places)];
    for at in &places[1..] {
        let air = boxes(&house(*at));
        let mut mesh = MeshBuilder::new(0);
        mesh.carved(&[air[0].union(air[1]).expanded(0.3)], &air);
        others.push(mesh.build("", &[]));
    }
    let town = baked(Method::Watershed, &house(places[0]), others);
    assert_eq!((town.cells.len(), town.portals.len()), (7, 3));
    let counts = &town.statistics.counts;
    let [voxel, n] = ["voxel_size", "voxels"].map(|name| counts[name]);
    assert!((voxel - 0.1).abs() < 1e-12 && n < 3e7, "{n} of {voxel}");
    let mut rooms = BTreeSet::new();
    for [x, z] in places {
        let room = |at: f64| town.locator.locate(DVec3::new(x + at, 1.0, z + 2.0));
        let pair = [room(2.0), room(6.0)].map(Option::unwrap);
        let meets = |p: &&Portal| pair.iter().all(|c| p.cells.contains(c));
        assert_eq!(town.portals.iter().filter(meets).count(), 1);
        rooms.extend(pair);
    }
    assert_eq!(rooms.len(), 6);
}
