//! The order of triangles, vertices and objects in a file has no effect on the world.

use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::World;
use enfilade_testkit::mixed::{l_corridor, rooms_with_closet};
use enfilade_testkit::{Generated, TowerParams, office_tower, reordered};

fn baked(g: &Generated, method: Method) -> World {
    let config = BakeConfig::of(method);
    let done = bake(&g.scene, &config, &BakeContext::new(&Silent, None));
    done.unwrap().world
}

/// The vertices of a triangle, by their bits, the least first: independent of the first vertex in the file.
type Corners = [[u32; 3]; 3];

/// The cells of a batch, its material, `true` for seals, and its triangles.
type Content = (Vec<u32>, Option<u32>, bool, Vec<Corners>);

/// Returns the batches in a canonical order.
fn geometry(world: &World) -> Vec<Content> {
    let batches = world.batches.iter().map(|b| {
        let p = &b.primitive;
        let mut triangles: Vec<Corners> = (p.indices.chunks_exact(3))
            .map(|t| {
                let mut corners = [0, 1, 2].map(|k| p.positions[t[k] as usize].map(f32::to_bits));
                let first = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
                corners.rotate_left(first);
                corners
            })
            .collect();
        triangles.sort_unstable();
        let cells = b.cells.iter().map(|c| c.0).collect();
        (cells, p.material, b.is_seal, triangles)
    });
    let mut batches: Vec<_> = batches.collect();
    batches.sort();
    batches
}

#[test]
fn cells_portals_and_locator_are_the_same_to_the_bit_in_any_order() {
    let scenes = [
        rooms_with_closet(),
        l_corridor(),
        office_tower(&TowerParams::with_rooms(4, 3)),
    ];
    for g in &scenes {
        for method in [Method::Watershed, Method::Bsp, Method::Delaunay] {
            let plain = baked(g, method);
            let other = baked(&reordered(g.clone(), 1), method);
            let what = format!("{} by {method:?}", g.truth.scene);
            let (a, b) = (&plain.graph, &other.graph);
            assert_eq!(a.cells, b.cells, "{what}");
            assert_eq!(a.portals, b.portals, "{what}");
            assert!(a.locator == b.locator, "{what}");
            assert_eq!(a.statistics, b.statistics, "{what}");
            assert!(geometry(&plain) == geometry(&other), "{what}");
        }
    }
}
