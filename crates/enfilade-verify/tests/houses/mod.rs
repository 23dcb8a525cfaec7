//! Worlds that tests tamper with.
#![allow(dead_code, reason = "every test binary uses a part of it")]

use std::sync::LazyLock;

use enfilade_bake::{BakeConfig, BakeContext, Method, Silent, bake};
use enfilade_cpg::{SightGraph, World};
use enfilade_geom::Triangle;
use enfilade_geom::scene::{Scene, SourceNode};
use enfilade_testkit::{Fault, furnished_house};
use enfilade_verify::{VerifyOptions, VerifyReport, structural_triangles, verify_world};
use enfilade_vis::{VisConfig, VisContext, see_all, see_parts};

/// A house with furniture: rooms on two storeys, doors, windows, a stair. Its objects have names of their own.
pub(crate) static SCENE: LazyLock<Scene> = LazyLock::new(|| {
    let mut scene = furnished_house().scene;
    for (i, object) in (0..).zip(&mut scene.objects) {
        object.name = format!("{} {i}", object.name);
        object.node = Some(i);
        scene.nodes.push(SourceNode {
            name: object.name.clone(),
            ..SourceNode::default()
        });
    }
    scene
});
/// That house, with visible volumes and parts for each cell.
pub(crate) static HOUSE: LazyLock<World> = LazyLock::new(|| seen(baked(&SCENE)));
/// Walls 2 mm above their slabs: seals close the slits.
pub(crate) static SLITS: LazyLock<World> =
    LazyLock::new(|| baked(&Fault::WallsAboveSlabs.build().scene));

fn baked(scene: &Scene) -> World {
    let config = BakeConfig::of(Method::Watershed);
    let done = bake(scene, &config, &BakeContext::new(&Silent, None));
    done.unwrap().world
}

fn seen(mut world: World) -> World {
    let walls: Vec<Triangle> = structural_triangles(&world).iter().map(|t| t.0).collect();
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls: Some(&walls),
        checkpoint: None,
    };
    let graph = SightGraph::of_graph(&world.graph);
    let found = see_all(&graph, &VisConfig::default(), &mut context);
    let mut pvs = found.unwrap().cells;
    let (volumes, parts) = see_parts(&world, &pvs).unwrap();
    (pvs.volumes, pvs.parts) = (Some(volumes), Some(parts));
    world.pvs = Some(pvs);
    world
}

pub(crate) fn verify(world: &World, rays: u64) -> VerifyReport {
    let options = VerifyOptions {
        rays,
        ..VerifyOptions::default()
    };
    verify_world(world, None, &options)
}
