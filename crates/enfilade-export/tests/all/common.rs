//! Worlds to test with.

use enfilade_bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade_cpg::World;
use enfilade_testkit::{Generated, furnished_house};

/// Bakes a scene with default settings.
pub(crate) fn baked(scene: &Generated) -> World {
    let context = BakeContext::new(&Silent, None);
    let baked = bake(&scene.scene, &BakeConfig::default(), &context);
    baked.unwrap().world
}

/// The demo house.
pub(crate) fn house() -> World {
    baked(&furnished_house())
}
