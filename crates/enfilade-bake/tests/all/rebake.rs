//! Rebakes: what changed is baked again, and the result is that of a bake of the whole scene.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use enfilade_bake::edit::add_portal;
use enfilade_bake::rebake::{RebakeError, Rebaked, WholeBecause, rebake};
use enfilade_bake::{BakeConfig, BakeContext, BakeError, Method, Silent, bake};
use enfilade_cpg::wire::encode_glb;
use enfilade_cpg::{CellId, World};
use enfilade_geom::DVec3;
use enfilade_geom::scene::Scene;
use enfilade_testkit::{
    Edit, Rng, TowerParams, cave, differences, edited, furnished_house, office_tower, rotated,
    with_cupboards,
};

fn tower(n: usize) -> Scene {
    with_cupboards(&office_tower(&TowerParams::with_rooms(n, 1)).scene, 8, 1)
}

fn baked(scene: &Scene) -> World {
    let context = BakeContext::default();
    bake(scene, &BakeConfig::default(), &context).unwrap().world
}

fn again(old: &World, scene: &Scene) -> Result<Rebaked, RebakeError> {
    rebake(old, scene, &BakeConfig::default(), &BakeContext::default())
}

/// Checks that a rebaked world is that of a bake, and that old cells are where they were.
#[track_caller]
fn check(old: &World, rebaked: &Rebaked, scene: &Scene) {
    rebaked.world.validate().unwrap();
    let off = differences(&rebaked.world, &baked(scene), 1);
    assert!(off.is_empty(), "{off:#?}");
    for (o, now) in old.graph.cell_ids().zip(&rebaked.cell_of) {
        let is_changed = now.is_none_or(|c| rebaked.changed.contains(&c));
        if !is_changed && !old.graph[o].name.starts_with("cell-") {
            assert_eq!(old.graph[o].name, rebaked.world.graph[now.unwrap()].name);
        }
    }
    // Moved ones, too, are named by their own numbers.
    let graph = &rebaked.world.graph;
    for c in graph.cell_ids() {
        let number = graph[c].name.strip_prefix("cell-");
        assert!(
            number.is_none_or(|n| n == c.0.to_string()),
            "{}",
            graph[c].name
        );
    }
}

#[test]
fn after_edits_the_world_is_that_of_a_bake_and_cells_keep_their_numbers() {
    let base = tower(32);
    let old = baked(&base);
    let mut n_parts = 0;
    for i in 0..9 {
        let edit = [Edit::WallOut, Edit::DoorCut, Edit::Moved][i % 3];
        let (scene, _) = edited(&base, edit, &mut Rng::stream(3, i as u64)).expect("a place");
        let rebaked = again(&old, &scene).unwrap();
        check(&old, &rebaked, &scene);
        if rebaked.whole.is_none() {
            n_parts += 1;
            let n = old.graph.cells.len();
            let kept = old.graph.cell_ids().zip(&rebaked.cell_of);
            let n_kept = kept.filter(|(c, now)| **now == Some(*c)).count();
            assert!(n_kept + 3 >= n, "{edit:?}: {n_kept} of {n}");
            assert!(
                rebaked.changed.len() < n / 2,
                "{edit:?}: {:?}",
                rebaked.changed
            );
        }
    }
    assert!(n_parts >= 7, "{n_parts} of 9 were baked as parts");
}

#[test]
fn a_turned_building_is_rebaked_along_its_own_axes() {
    let turned = rotated(office_tower(&TowerParams::with_rooms(16, 1)), 17.0).scene;
    let old = baked(&turned);
    let (scene, _) = edited(&turned, Edit::DoorCut, &mut Rng::new(5)).expect("a place");
    let rebaked = again(&old, &scene).unwrap();
    assert_eq!(rebaked.whole, None);
    check(&old, &rebaked, &scene);
}

#[test]
fn the_wall_around_a_new_door_is_no_change() {
    let base = tower(32);
    let old = baked(&base);
    for seed in 1..6 {
        let (scene, hole) = edited(&base, Edit::DoorCut, &mut Rng::new(seed)).expect("a place");
        let rebaked = again(&old, &scene).unwrap();
        assert_eq!(rebaked.whole, None);
        // Walls are as long as the corridor, of 29 m.
        let size = rebaked.block.size();
        assert!(size.x.max(size.z) < 6.0, "{size} for {hole:?}");
    }
}

#[test]
fn edit_after_edit_the_world_stays_that_of_a_bake() {
    let mut scene = tower(16);
    let mut world = baked(&scene);
    let mut rng = Rng::new(7);
    for edit in [Edit::DoorCut, Edit::WallOut, Edit::Moved, Edit::DoorCut] {
        scene = edited(&scene, edit, &mut rng).expect("a place").0;
        world = again(&world, &scene).unwrap().world;
    }
    let off = differences(&world, &baked(&scene), 1);
    assert!(off.is_empty(), "{off:#?}");
}

#[test]
fn an_edit_undone_gives_the_old_graph() {
    let base = tower(16);
    let old = baked(&base);
    let (scene, _) = edited(&base, Edit::WallOut, &mut Rng::new(2)).expect("a place");
    let there = again(&old, &scene).unwrap().world;
    let back = again(&there, &base).unwrap();
    let off = differences(&back.world, &old, 1);
    assert!(off.is_empty(), "{off:#?}");
}

#[test]
fn nothing_changed_changes_nothing() {
    let scene = furnished_house().scene;
    let old = baked(&scene);
    let same = again(&old, &scene).unwrap();
    assert_eq!(same.whole, None);
    assert!(same.changed.is_empty() && same.block.is_empty());
    assert_eq!(same.world.graph.cells, old.graph.cells);
    assert_eq!(same.world.graph.portals, old.graph.portals);
    assert_eq!(same.world.graph.locator, old.graph.locator);
    let [a, b] = [&same.world, &old].map(|w| &w.graph.provenance);
    assert_eq!(a, b);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let base = tower(16);
    let old = baked(&base);
    let (scene, _) = edited(&base, Edit::DoorCut, &mut Rng::new(4)).expect("a place");
    let [one, two] = [1, 3].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .unwrap();
        let rebaked = pool.install(|| again(&old, &scene)).unwrap();
        encode_glb(&rebaked.world).unwrap()
    });
    assert!(one == two);
}

#[test]
fn what_the_whole_scene_decides_is_decided_by_the_whole_scene() {
    let base = tower(16);
    let old = baked(&base);
    // A mast beside the building makes it larger.
    let mut scene = base.clone();
    let tall = scene
        .objects
        .iter()
        .position(|o| o.name == "cupboard")
        .unwrap();
    let far = DVec3::new(-30.0, 0.0, 0.0);
    scene.objects[tall].transform = enfilade_geom::DMat4::from_translation(far);
    let rebaked = again(&old, &scene).unwrap();
    assert_eq!(rebaked.whole, Some(WholeBecause::Bounds));
    let off = differences(&rebaked.world, &baked(&scene), 1);
    assert!(off.is_empty(), "{off:#?}");
    // Most cells are where they were, and keep their numbers even so.
    let kept = old.graph.cell_ids().zip(&rebaked.cell_of);
    let n_kept = kept.filter(|(c, now)| **now == Some(*c)).count();
    assert!(n_kept + 2 >= old.graph.cells.len(), "{n_kept}");
}

#[test]
fn worlds_of_other_scenes_and_settings_are_refused() {
    let scene = furnished_house().scene;
    let old = baked(&scene);
    let other = cave(1).scene;
    let said = again(&old, &other).unwrap_err().to_string();
    assert!(said.contains("baked from something else"), "{said}");

    let wide = BakeConfig {
        min_opening: 0.8,
        ..BakeConfig::default()
    };
    let said = rebake(&old, &scene, &wide, &BakeContext::default()).unwrap_err();
    assert!(
        matches!(&said, RebakeError::Setting { name, .. } if name == "min_opening"),
        "{said}"
    );
    assert!(said.to_string().contains("min_opening 0.6"), "{said}");
    let said = rebake(
        &old,
        &scene,
        &BakeConfig::of(Method::Bsp),
        &BakeContext::default(),
    );
    assert!(said.unwrap_err().to_string().contains("method watershed"));

    let mut hollow = old.clone();
    hollow.batches.clear();
    let said = again(&hollow, &scene).unwrap_err();
    assert!(matches!(said, RebakeError::NoGeometry), "{said}");
}

#[test]
fn an_edited_world_is_refused() {
    let scene = furnished_house().scene;
    let old = baked(&scene);
    let room = old
        .graph
        .cell_ids()
        .find(|&c| old.graph[c].is_room())
        .unwrap();
    let portal = wall_across(&old, room);
    let edited = add_portal(&old, &portal).unwrap().world;
    let said = again(&edited, &scene).unwrap_err().to_string();
    assert!(said.contains("edited by hand"), "{said}");
}

/// Returns a polygon across the middle of a cell.
fn wall_across(world: &World, cell: CellId) -> [DVec3; 4] {
    let [low, high] = world.graph[cell]
        .aabb
        .map(|p| DVec3::from(p.map(f64::from)));
    let x = low.x + 0.45 * (high.x - low.x);
    let at = |y: f64, z: f64| DVec3::new(x, y, z);
    let [low, high] = [low - 0.05, high + 0.05];
    [
        at(low.y, low.z),
        at(low.y, high.z),
        at(high.y, high.z),
        at(high.y, low.z),
    ]
}

#[test]
fn a_canceled_rebake_ends() {
    let scene = furnished_house().scene;
    let old = baked(&scene);
    let context = BakeContext::new(&Silent, Some(Arc::new(AtomicBool::new(true))));
    let end = rebake(&old, &scene, &BakeConfig::default(), &context);
    assert!(matches!(end, Err(RebakeError::Bake(BakeError::Cancelled))));
}
