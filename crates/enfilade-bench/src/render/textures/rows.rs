//! The rows of numbers.

use enfilade::cpg::World;

use super::Measurements;
use super::errors::{Mask, mean_difference, mean_pop, portal_mask};
use super::models::in_paper;
use super::series::{DrawMode, shot};
use enfilade_render::{Camera, Picture};

/// Prints how far the sizes of a model are from the paper's.
pub(super) fn model(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    let Some((model, studio)) = all.studio("model", scene)? else {
        return Ok(());
    };
    let (n_triangles, graph) = (studio.sight.n_triangles(), &model.world.graph);
    let [n_cells, n_portals] = [graph.cells.len(), graph.portals.len()];
    let n_frames = model.cameras(&studio.sight).len();
    let Some(paper) = in_paper(scene) else {
        return Ok(());
    };
    let off = (n_triangles as f64 / paper.n_triangles as f64 - 1.0).abs();
    let note = format!(
        "{n_triangles} triangles, {} in the paper; a walk of {n_frames} frames",
        paper.n_triangles
    );
    all.at_most("model: triangles", scene, off, 0.01, &note);
    let off = n_cells.abs_diff(paper.n_cells) + n_portals.abs_diff(paper.n_portals);
    let note = format!("{n_cells} cells, {n_portals} portals");
    all.at_most("model: cells and portals", scene, off as f64, 0.0, &note);
    Ok(())
}

/// Prints the triangles of portal culling as a share of those of frustum culling: the ground that pictures start from.
pub(super) fn portal_culling(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    let row = "portal culling: share of frustum culling";
    let mut of_modes = Vec::new();
    for mode in [DrawMode::Frustum, DrawMode::Portals, DrawMode::Room] {
        let Some(series) = all.series(row, scene, mode)? else {
            return Ok(());
        };
        of_modes.push(series.clone());
    }
    let [frustum, portals, room] = [&of_modes[0], &of_modes[1], &of_modes[2]];
    let paper = in_paper(scene).map_or_else(String::new, |paper| {
        format!("{:.3} in the paper; ", paper.portals_to_frustum)
    });
    let [[before, ..], [mean, median, p99]] = [frustum.times(), portals.times()];
    let note = format!(
        "{paper}triangles a frame: {:.0} by frustum culling, {:.0} by portals, {:.0} in the eye's room alone, {:.0} by portals at \
         most; ms a frame: {before:.2} by frustum culling, {mean:.2} by portals, p99 ÷ median {:.2}; {} frames",
        frustum.mean_triangles(),
        portals.mean_triangles(),
        room.mean_triangles(),
        portals.most_triangles(),
        p99 / median,
        portals.seconds.len(),
    );
    let share = portals.mean_triangles() / frustum.mean_triangles();
    all.at_most(row, scene, share, 1.0, &note);
    Ok(())
}

/// Prints that pictures by portals are those by frustum culling: both are the truth that textures are held against.
pub(super) fn truth(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    let row = "truth: portal culling";
    if let Some([error, pop]) = compared(all, row, scene, DrawMode::Portals)? {
        let note =
            format!("mean difference in 1/255 from frustum culling; from frame to frame {pop}");
        all.at_most(row, scene, error, 0.02, &note);
    }
    Ok(())
}

/// Returns the mean error and the mean pop of pairs of successive frames along a walk.
fn compared(
    all: &mut Measurements<'_>,
    row: &str,
    scene: &str,
    mode: DrawMode,
) -> anyhow::Result<Option<[f64; 2]>> {
    let (n, size) = (all.state.options.pictures.max(1), all.state.options.size);
    let Some((model, studio)) = all.studio(row, scene)? else {
        return Ok(None);
    };
    let cameras = model.cameras(&studio.sight);
    let step = (cameras.len().saturating_sub(1) / n).max(1);
    let (mut sums, mut n_pairs) = ([0.0; 2], 0.0_f64);
    mode.begin(studio)?;
    for pair in cameras.windows(2).step_by(step) {
        let mut frames: Vec<[Picture; 2]> = Vec::new();
        for camera in pair {
            let truth = shot(studio, camera, DrawMode::Frustum, size)?;
            frames.push([shot(studio, camera, mode, size)?, truth]);
        }
        let [[before, truth_before], [now, truth]] = [&frames[0], &frames[1]];
        let mask = seen_portals(&model.world, &pair[1], size);
        sums[0] += mean_difference(now, truth, &mask);
        sums[1] += mean_pop([before, now], [truth_before, truth], &mask);
        n_pairs += 1.0;
    }
    Ok(Some(sums.map(|sum| sum / n_pairs.max(1.0))))
}

/// Returns the pixels of the portals of the eye's cell.
fn seen_portals(world: &World, camera: &Camera, size: [u32; 2]) -> Mask {
    let eye = camera.eye.map(f64::from).into();
    let cell = world.graph.locator.locate(eye);
    let exits = cell.into_iter().flat_map(|cell| world.graph.exits(cell));
    portal_mask(camera, exits.map(|exit| exit.portal), size)
}
