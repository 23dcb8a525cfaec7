//! Pictures in which far portals are textures of what lies behind them.

use std::path::PathBuf;

use anyhow::{Context, bail};
use enfilade_render::{PortalTextureCounts, PortalTextureOptions, Studio};

use super::options::{Render, RenderMode};
use enfilade_cli::input::name_of;

/// Plans of one picture at most. Each makes a texture or more, and there is room for 128.
const MOST_PLANS: usize = 1000;

/// Checks the options of portal textures, and reads the file of textures made ahead.
///
/// # Errors
///
/// Options without the mode that they are for; a file that cannot be read.
pub(super) fn read_textures(args: &Render) -> anyhow::Result<Option<Vec<u8>>> {
    if args.mode != RenderMode::PortalTextures {
        for (option, is_given) in [
            ("--textures", args.textures.is_some()),
            ("--max-triangles", args.max_triangles.is_some()),
        ] {
            if is_given {
                bail!("{option} is for portals drawn as textures; add --mode portal-textures");
            }
        }
    }
    let read = |path: &PathBuf| std::fs::read(path).with_context(|| name_of(path));
    args.textures.as_ref().map(read).transpose()
}

/// Turns textures on, and loads those that were made ahead. Light and lamps come before.
///
/// # Errors
///
/// A file for another world, light or size; an adapter without room.
pub(super) fn add_textures(
    args: &Render,
    studio: &mut Studio,
    ahead: Option<&[u8]>,
) -> anyhow::Result<()> {
    if args.mode != RenderMode::PortalTextures {
        return Ok(());
    }
    studio.add_portal_textures(PortalTextureOptions {
        // A picture waits for all of them.
        max_made: u32::MAX,
        max_triangles: args.max_triangles.unwrap_or(u64::MAX),
        ..PortalTextureOptions::default()
    })?;
    if let (Some(bytes), Some(path)) = (ahead, &args.textures) {
        (studio.load_portal_textures(bytes)).with_context(|| name_of(path))?;
    }
    Ok(())
}

/// Plans until nothing is left to make, as if one had stood there for a while; returns the counts of all plans together.
///
/// # Errors
///
/// As the plan.
pub(super) fn settle(
    studio: &mut Studio,
    mut plan: impl FnMut(&mut Studio) -> anyhow::Result<PortalTextureCounts>,
) -> anyhow::Result<PortalTextureCounts> {
    // Each picture as if it were the only one.
    studio.clear_portal_textures();
    let mut sum = PortalTextureCounts::default();
    for _ in 0..MOST_PLANS {
        let (before, now) = (sum, plan(studio)?);
        sum = now;
        sum.n_made += before.n_made;
        sum.n_loaded += before.n_loaded;
        sum.n_made_triangles += before.n_made_triangles;
        if now.n_made + now.n_loaded + now.n_turning == 0 {
            break;
        }
    }
    Ok(sum)
}
