//! A bake in shards, which any number of processes make, in any order: the rooms of each site.

mod written;

use enfilade_geom::scene::Scene;

use crate::budget::n_structural;
use crate::pieces::{Kept, PieceKind, unsealed};
use crate::proposal::Proposal;
use crate::structure::Structure;
use crate::watershed::{propose_site, sites_of};
use crate::{BakeConfig, BakeContext, BakeError, Method};

/// Returns the keys of the pieces with the rooms of each site, which any number of processes may make by [`bake_pieces`]. The
/// context must [keep](BakeContext::keeping) pieces.
///
/// # Errors
/// If the scene is one for another method than the watershed, or as [`bake`](crate::bake()).
pub fn piece_keys(
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Vec<String>, BakeError> {
    let mut keys = Vec::new();
    let add = |key: &str| {
        keys.push(key.to_owned());
        false
    };
    bake_pieces(scene, config, context, add)?;
    Ok(keys)
}

/// Makes the pieces whose keys are `wanted`, unless they are there, in the order of [`piece_keys`]. A [`bake`](crate::bake()) with
/// all of them has little left to do.
///
/// # Errors
/// As [`piece_keys`].
pub fn bake_pieces(
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
    mut wanted: impl FnMut(&str) -> bool,
) -> Result<(), BakeError> {
    let context = &context.within(&config.budget, n_structural(scene));
    let (method, reason) = Method::choose(config.method, scene);
    if method != Method::Watershed {
        return Err(BakeError::Setting {
            name: "method",
            value: method.name().to_owned(),
            limit: "watershed, the only method whose work is divided; set it, or bake on one machine",
        });
    }
    context.begin_method(method, &reason)?;
    let structure = Structure::of(scene, method, config, context.allowance())?;
    let kept = Kept::of(scene, config, context.pieces());
    let plots = sites_of(&structure, config, context)?;
    for plot in plots {
        if wanted(&kept.key(PieceKind::Rooms, &plot)) {
            propose_site(&structure, plot, kept, config, context)?;
        }
    }
    Ok(())
}

/// Returns `true` if these are the bytes of the whole piece with this key, which has the rooms of a site.
#[must_use]
pub fn is_piece(key: &str, bytes: &[u8]) -> bool {
    unsealed::<Proposal>(key, bytes).is_some()
}
