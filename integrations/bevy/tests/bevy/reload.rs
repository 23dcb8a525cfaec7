//! A world file that changes on disk is loaded again, with other rooms.

use bevy::prelude::*;
use bevy_enfilade::prelude::*;
use bevy_enfilade::{PartKind, WorldPart};

use crate::LAMPS;
use crate::support::{Stage, demo_house, stands};

#[test]
fn a_changed_file_brings_its_own_rooms_and_doors() {
    let path = demo_house("reload");
    let mut stage = Stage::new(&path, UVec2::new(160, 120), LAMPS);
    let n_cells = stage.world().world.graph.cells.len();
    let other = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::offices(6, 1));
    let n_others = other.graph.cells.len();
    assert_ne!(n_cells, n_others);
    enfilade::save(&path, &other).expect("a file");
    let file = path
        .file_name()
        .expect("a name")
        .to_string_lossy()
        .into_owned();
    stage.app.world().resource::<AssetServer>().reload(file);
    for _ in 0..500 {
        stage.frame();
        if stage.reset_root() && stage.world().world.graph.cells.len() == n_others {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert_eq!(stage.world().world.graph.cells.len(), n_others);
    // Meshes arrive after the graph.
    for _ in 0..100 {
        stage.frame();
    }
    assert!(stage.reset_root());
    let view = stage.view().world(stage.root).expect("a view");
    assert!(view.cells.iter().all(|c| c.idx() < n_others));
    let mut doors = stage.app.world_mut().query::<&Door>();
    let root = stage.root;
    assert!(doors.iter(stage.app.world()).all(|d| d.root == root));
    let (n_batches, n_details) = {
        let world = &stage.world().world;
        (world.batches.len() as u32, world.details.len() as u32)
    };
    let mut parts = stage.app.world_mut().query::<&WorldPart>();
    let parts: Vec<WorldPart> = parts.iter(stage.app.world()).copied().collect();
    assert!(!parts.is_empty());
    for part in parts {
        assert_eq!(part.root, root);
        assert!(match part.kind {
            PartKind::Batch(i) => i < n_batches,
            PartKind::Detail(i) => i < n_details,
        });
    }
    let mut n_culled = 0;
    for stand in stands(stage.world(), 10, 2) {
        stage.stand(stand);
        stage.frame();
        let view = stage.view();
        n_culled += usize::from(view.n_after < view.n_before);
    }
    assert!(n_culled > 5, "{n_culled}");
}
