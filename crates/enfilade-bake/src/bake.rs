//! The main flow: scene → structure → proposal → world.
//!
//! Read this first. A method proposes where rooms and their openings are; [`realize`](crate::realize) makes that exact, in
//! the same way for all of them, so that the promises hold whatever a method missed.

use enfilade_geom::scene::Scene;

use crate::bound::keep_costs;
use crate::budget::n_structural;
use crate::realize::realize;
use crate::vessel::is_vessel;
use crate::{BakeConfig, BakeContext, BakeError, BakeOutput, Method, bsp, delaunay, watershed};

/// Finds the rooms and doorways of a scene.
///
/// Deterministic: equal input and settings give an equal world on any number of threads. For time and memory see the
/// methods.
///
/// # Errors
/// When there is nothing structural, a setting is out of limits, a cost is given for a material that the scene has not, the
/// scene is too large for the budget of voxels, or the caller cancels.
pub fn bake(
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    config.costs.cost.check(&scene.materials)?;
    let context = &context.within(&config.budget, n_structural(scene));
    let (method, reason) = config.method.choose(scene);
    let mut baked = bake_by(method, &reason, scene, config, context)?;
    let finds_little = method == Method::Watershed && baked.n_indoors() <= 1;
    if config.method == Method::Auto && finds_little && is_vessel(scene) {
        let n = ["no cell", "one cell"][baked.n_indoors()];
        let reason = format!(
            "the surface is curved and closed but for its ends, and the watershed finds {n} in it; tetrahedra find \
             branches, too"
        );
        let other = bake_by(Method::Delaunay, &reason, scene, config, context)?;
        if other.n_indoors() > baked.n_indoors() {
            baked = other;
        } else {
            let note = "tetrahedra find no more cells either: the watershed's are kept";
            baked.notes.push(note.to_owned());
        }
    }
    if baked.method != Method::Delaunay && config.delaunay.has_choices() {
        let note = "the choices were not asked: they are about portals of the Delaunay builder";
        baked.notes.push(note.to_owned());
    }
    keep_costs(&mut baked.world, &mut baked.notes, &config.costs);
    Ok(baked)
}

/// Bakes by one method.
fn bake_by(
    method: Method,
    reason: &str,
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    context.begin_method(method, reason)?;
    let structure = method.structure_of(scene, context.allowance())?;
    let proposal = match method {
        Method::Bsp => bsp::propose(&structure, config, context)?,
        Method::Delaunay => delaunay::propose(&structure, config, context)?,
        Method::Watershed | Method::Auto => watershed::propose(&structure, config, context)?,
    };
    realize(structure, method, proposal, config, context)
}
