//! A world file that changes on disk is loaded again, with other rooms.

use bevy::prelude::*;
use bevy_enfilade::prelude::*;

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
    stage.frame();
    stage.frame();
    let view = stage.view().world(stage.root).expect("a view");
    assert!(view.cells.iter().all(|c| c.idx() < n_others));
    let mut doors = stage.app.world_mut().query::<&Door>();
    let root = stage.root;
    assert!(doors.iter(stage.app.world()).all(|d| d.root == root));
    for stand in stands(stage.world(), 4, 2) {
        assert_eq!(stage.n_different(stand), 0, "{stand:?}");
    }
}
