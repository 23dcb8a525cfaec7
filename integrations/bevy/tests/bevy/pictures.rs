//! Pictures with and without culling are the same, pixel by pixel.

use crate::support::{Lamps, Stage, demo_house, stands};
use bevy::prelude::*;

const LAMPS: Lamps = Lamps {
    range: 5.0,
    with_shadows: 4,
    sun: true,
};

// Covers R1 and W3.
#[test]
fn culling_changes_no_pixel_of_the_demo_house() {
    let mut stage = Stage::new(&demo_house("pictures"), UVec2::new(240, 160), LAMPS);
    let (mut n_before, mut n_after) = (0, 0);
    for (i, stand) in stands(stage.world(), 10, 7).into_iter().enumerate() {
        stage.stand(stand);
        stage.set_culling(true);
        stage.frame();
        n_before += stage.view().n_before;
        n_after += stage.view().n_after;
        let n_different = stage.n_different(stand);
        assert_eq!(n_different, 0, "view {i}, {stand:?}");
    }
    // Otherwise the test would show nothing.
    assert!(n_after * 3 < n_before * 2, "{n_after} of {n_before} drawn");
}
