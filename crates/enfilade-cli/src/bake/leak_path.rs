//! Report on the way out of air that should be a room.

use std::io::{self, Write};

use enfilade::bake::leak::{LeakTrail, NoTrail, find_leak_trail};
use enfilade::bake::{BakeConfig, BakeContext, Silent};
use enfilade::geom::DVec3;
use enfilade::geom::scene::Scene;
use enfilade_cli::memory::held_memory;

use crate::progress::StageBar;
use crate::screen::{At, Told, Warned};

/// A way out, or the reason why there is none to show.
pub(super) struct LeakPath {
    found: Result<LeakTrail, NoTrail>,
    /// Requested by the user, and so also written into the world.
    is_asked: bool,
}

/// Finds the widest way out as requested by `--leak-path`.
///
/// # Errors
/// If a room cannot be at the given point; other failures are reported with the bake's results.
pub(super) fn look_as_asked(
    scene: &Scene,
    config: &BakeConfig,
    from: Option<DVec3>,
    threads: Option<u16>,
) -> anyhow::Result<LeakPath> {
    let found = look(scene, config, from, threads)?;
    match found {
        Err(why @ (NoTrail::Outside { .. } | NoTrail::InMatter { .. })) => {
            anyhow::bail!("--leak-path: {why}")
        }
        found => Ok(LeakPath {
            found,
            is_asked: true,
        }),
    }
}

/// Finds the widest way out after a bake without rooms.
pub(super) fn look_unasked(
    scene: &Scene,
    config: &BakeConfig,
    threads: Option<u16>,
) -> anyhow::Result<LeakPath> {
    Ok(LeakPath {
        found: look(scene, config, None, threads)?,
        is_asked: false,
    })
}

fn look(
    scene: &Scene,
    config: &BakeConfig,
    from: Option<DVec3>,
    threads: Option<u16>,
) -> anyhow::Result<Result<LeakTrail, NoTrail>> {
    let bar = StageBar::new();
    bar.start("looking for the way out", 0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, usize::from))
        .build()?;
    let context = BakeContext::new(&Silent, None).measured_by(held_memory);
    let found = pool.install(|| find_leak_trail(scene, config, from, &context));
    bar.finish();
    Ok(found)
}

impl LeakPath {
    /// The line for the world, if one was requested and found.
    pub(super) fn points(&self) -> Vec<[f32; 3]> {
        match &self.found {
            Ok(trail) if self.is_asked => {
                let rounded = |p: &DVec3| p.as_vec3().to_array();
                trail.points.iter().map(rounded).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The writer for the report: a way out that was not requested explains a warning.
    pub(super) fn says(&self) -> Box<dyn Write> {
        if self.is_asked {
            Box::new(Told)
        } else {
            Box::new(Warned)
        }
    }

    /// Reports the way out, and what to do about it.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let trail = match &self.found {
            Ok(trail) => trail,
            Err(why) => return writeln!(out, "no way out can be shown: {why}"),
        };
        let at = |p: DVec3| At(p.to_array()).to_string();
        writeln!(
            out,
            "the widest way out, {:.1} m long: from {}, narrowest at {} (a ball of {:.2} m passes), out at {}",
            trail.length(),
            at(trail.points[0]),
            at(trail.narrowest),
            trail.width,
            at(trail.exit),
        )?;
        let advice = if trail.is_wide_open() {
            "it is nowhere much narrower than the room: a wall, floor or roof is missing there, or was taken for furniture \
             (look with -v, then --structural-name 'PATTERN')"
        } else {
            "if that is a hole in the model, close it; if the object that closes it was taken for furniture, use --structural-name \
             'PATTERN'; if it is a doorway or a window, the model has no leak"
        };
        writeln!(out, "  {advice}")?;
        if self.is_asked {
            writeln!(
                out,
                "  it is the object 'enfilade leak path' of the world, a line"
            )
        } else {
            writeln!(
                out,
                "  --leak-path writes it into the world as a line, --leak-path=X,Y,Z from a point that should be in a room"
            )
        }
    }
}
