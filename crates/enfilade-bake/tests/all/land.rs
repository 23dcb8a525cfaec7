//! Open land as cells of its own. Covers V10 and V11.

use enfilade_bake::{BakeConfig, BakeContext, BakeError, Outdoors, Silent, bake};
use enfilade_cpg::{CellId, CellPortalGraph, World};
use enfilade_geom::scene::{Material, Object, Role, Scene};
use enfilade_geom::{DMat4, DVec3};
use enfilade_testkit::solid::{MeshBuilder, aabb};

/// Three by three blocks of 40 m, 9 m high, with streets of 10 m between and around them.
/// The block in the middle is missing: a square.
fn town() -> Scene {
    let mut ground = MeshBuilder::new(0);
    ground.cuboid(aabb([-90.0, -1.0, -90.0], [90.0, 0.0, 90.0]));
    let mut blocks = MeshBuilder::new(0);
    for (i, k) in (0..3).flat_map(|i| (0..3).map(move |k| (i, k))) {
        if (i, k) != (1, 1) {
            let [x, z] = [i, k].map(|v| -70.0 + 50.0 * f64::from(v));
            blocks.cuboid(aabb([x, 0.0, z], [x + 40.0, 9.0, z + 40.0]));
        }
    }
    let object = |mesh: u32| Object {
        name: String::new(),
        mesh,
        transform: DMat4::IDENTITY,
        role: Role::Structural,
        reason: String::new(),
        filling: None,
        node: None,
    };
    Scene {
        meshes: vec![ground.build("ground", &[]), blocks.build("blocks", &[])],
        materials: vec![Material::default()],
        objects: vec![object(0), object(1)],
        ..Scene::default()
    }
}

fn world(outdoors: Outdoors) -> Result<World, BakeError> {
    let config = BakeConfig {
        outdoors,
        voxel: Some(0.5),
        min_opening: 3.0,
        ..BakeConfig::default()
    };
    let context = BakeContext::new(&Silent, None);
    Ok(bake(&town(), &config, &context)?.world)
}

fn split(minima: &[[f64; 2]]) -> Result<World, BakeError> {
    let minima = minima.to_vec();
    world(Outdoors::Split { minima })
}

fn at(graph: &CellPortalGraph, x: f64, z: f64) -> CellId {
    let cell = graph.locator.locate(DVec3::new(x, 1.5, z)).unwrap();
    assert!(graph[cell].is_land, "{x} {z}: {}", graph[cell].name);
    cell
}

#[test]
fn streets_and_squares_are_cells_and_blocks_are_matter() {
    let world = split(&[]).unwrap();
    assert!(world.validate().is_ok());
    let graph = &world.graph;
    assert_eq!(graph.rooms().count(), 0);
    let square = at(graph, 0.0, 0.0);
    // Streets that meet at a vertex of the square are one.
    let mut streets = [(-25.0, 50.0), (25.0, 50.0), (-25.0, -50.0), (25.0, -50.0)]
        .map(|(x, z)| at(graph, x, z))
        .to_vec();
    streets.push(square);
    streets.sort_unstable();
    streets.dedup();
    assert_eq!(streets.len(), 5);
    for (x, z) in [(-50.0, -50.0), (50.0, 0.0)] {
        assert_eq!(graph.locator.locate(DVec3::new(x, 1.5, z)), None);
    }
    // A sky limit below the roofs, one plane for all; what is above is the outdoors.
    assert_eq!(
        graph.locator.locate(DVec3::new(0.0, 9.5, 0.0)),
        graph.outdoors()
    );
    let tops = graph
        .cells
        .iter()
        .filter(|c| c.is_land)
        .map(|c| c.aabb[1][1]);
    for top in tops {
        assert!((8.0..9.0).contains(&top), "{top}");
    }
    // A street has an upright portal at its end, from the ground to the sky limit.
    let street = at(graph, -25.0, 50.0);
    let upright = graph[street].portals.iter().map(|&p| &graph[p]);
    let mouth = upright
        .filter(|p| p.normal[2].abs() > 0.99)
        .max_by(|a, b| a.area.total_cmp(&b.area));
    let area = mouth.map_or(0.0, |p| p.area);
    assert!((75.0..100.0).contains(&area), "{area}");
}

#[test]
fn the_outdoors_is_one_cell_unless_it_is_split() {
    let world = world(Outdoors::Whole).unwrap();
    assert_eq!(world.graph.cells.len(), 1);
    assert!(world.graph.cells[0].outdoor && !world.graph.cells[0].is_land);
}

#[test]
fn land_is_flooded_from_places_that_a_user_gives() {
    let world = split(&[[0.0, 0.0], [-25.0, 80.0]]).unwrap();
    let graph = &world.graph;
    assert_eq!(graph.cells.iter().filter(|c| c.is_land).count(), 2);
    assert_ne!(at(graph, 0.0, 0.0), at(graph, -25.0, 80.0));
    let beside = split(&[[0.0, 0.0], [500.0, 0.0]]).unwrap_err();
    assert!(beside.to_string().contains("500,0"), "{beside}");
}

#[test]
fn land_is_the_same_every_time() {
    let threads = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        pool.install(|| split(&[]).unwrap())
    };
    let [one, three] = [1, 3].map(threads);
    assert!(one.graph == three.graph);
}
