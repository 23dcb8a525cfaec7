//! The main flow: scene → structure → proposal → world.
//!
//! Read this first. A method proposes rooms and openings; [`realize`](crate::realize) makes them exact, in the same way
//! for all methods, so that the promises hold even where a method missed something.

use enfilade_geom::scene::Scene;

use crate::bound::keep_costs;
use crate::budget::n_structural;
use crate::decided::keep_decisions;
use crate::delaunay::Session;
use crate::given::keep_given;
use crate::marked::make_marked;
use crate::names::name_cells;
use crate::realize::realize;
use crate::structure::Structure;
use crate::vessel::is_vessel;
use crate::{
    BakeConfig, BakeContext, BakeError, BakeOutput, Method, bsp, delaunay, land, watershed,
};

/// Finds the rooms and doorways of a scene.
///
/// Deterministic: equal input and settings give an equal world on any number of threads. Time and memory depend on the
/// method; see its module.
///
/// # Errors
/// If nothing is structural, a setting is out of limits, a cost names a material that the scene does not have, the
/// scene exceeds the voxel budget, or the caller cancels.
pub fn bake(
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    config.costs.cost.check(&scene.materials)?;
    let context = &context.within(&config.budget, n_structural(scene));
    let (method, reason) = Method::choose(config.method, scene);
    let mut baked = bake_by(method, &reason, scene, config, context)?;
    let finds_little = method == Method::Watershed && baked.n_indoors() <= 1;
    if config.method.is_none() && finds_little && is_vessel(scene) {
        let n = ["no cell", "one cell"][baked.n_indoors()];
        let reason = format!(
            "the surface is curved and closed except at its ends, and the watershed finds {n} in it; the Delaunay \
             builder also finds branches"
        );
        let other = bake_by(Method::Delaunay, &reason, scene, config, context)?;
        if other.n_indoors() > baked.n_indoors() {
            baked = other;
        } else {
            let note = "the Delaunay builder finds no more cells: those of the watershed are kept";
            baked.notes.push(note.to_owned());
        }
    }
    if baked.method != Method::Delaunay && config.delaunay.has_choices() {
        let note = "`choices` ignored: they apply only to the Delaunay builder";
        baked.notes.push(note.to_owned());
    }
    if baked.method != Method::Watershed && context.pieces().is_some() {
        let note =
            "no pieces kept: only the watershed makes any, and a bake that is killed begins anew";
        baked.notes.push(note.to_owned());
    }
    finish(&mut baked, scene, config);
    Ok(baked)
}

/// Makes a world of the rooms that remain after the first `n_steps` of a session's decimation.
///
/// # Errors
/// If the caller cancels.
pub fn bake_session(
    scene: &Scene,
    session: &Session,
    n_steps: usize,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    let context = &context.within(&config.budget, n_structural(scene));
    let method = Method::Delaunay;
    let structure = Structure::of(scene, method, config, context.allowance())?;
    let mut proposal = delaunay::propose_of(&structure, session, n_steps, config, context)?;
    land::split(&structure, config, context, &mut proposal)?;
    let mut baked = realize(structure, method, proposal, config, context)?;
    finish(&mut baked, scene, config);
    Ok(baked)
}

/// Takes into a world what the scene and its maker say about it: costs, given portals, names, mirrors and links.
fn finish(baked: &mut BakeOutput, scene: &Scene, config: &BakeConfig) {
    let (world, notes) = (&mut baked.world, &mut baked.notes);
    keep_costs(world, notes, &config.costs);
    let given = config.keeps_given.then(|| keep_given(world, scene));
    keep_decisions(world, notes, &config.decisions);
    name_cells(world, notes, &scene.rooms);
    if let Some(given) = given {
        given.tell(world, scene, notes);
        let settings = &mut world.graph.provenance.settings;
        settings.insert("given".to_owned(), "portals".to_owned());
    }
    make_marked(world, notes, scene);
}

/// Bakes with one method.
fn bake_by(
    method: Method,
    reason: &str,
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    context.begin_method(method, reason)?;
    let structure = Structure::of(scene, method, config, context.allowance())?;
    let mut proposal = match method {
        Method::Bsp => bsp::propose(&structure, config, context)?,
        Method::Delaunay => delaunay::propose(&structure, config, context)?,
        Method::Watershed => watershed::propose(&structure, config, context)?,
    };
    land::split(&structure, config, context, &mut proposal)?;
    realize(structure, method, proposal, config, context)
}
