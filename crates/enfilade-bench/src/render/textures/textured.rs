//! The rows of portal textures.

use enfilade_render::{Camera, Studio};

use super::Measurements;
use super::errors::{mean_difference, mean_pop};
use super::series::{DrawMode, MOST_TRIANGLES, Series, TexturedShot, shot, textured_shot};

/// Least gain over portal culling in the paper, §5.1.
fn least_gain(scene: &str) -> Option<f64> {
    match scene {
        "brooks" => Some(3.3),
        "haunted" => Some(2.6),
        _ => None,
    }
}

/// Prints how many times fewer triangles are drawn than by portal culling, those drawn for textures included.
pub(super) fn gains(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    for (row, mode, bar) in [
        (
            "fewer triangles: made ahead",
            DrawMode::Warm,
            least_gain(scene),
        ),
        ("fewer triangles: cold", DrawMode::Cold, Some(1.8)),
        (
            "fewer triangles: cold, flat, 1°",
            DrawMode::ColdEvery1,
            None,
        ),
        (
            "fewer triangles: cold, flat, 10°",
            DrawMode::ColdEvery10,
            None,
        ),
    ] {
        let mut of_modes: Vec<Series> = Vec::new();
        for mode in [DrawMode::Portals, mode] {
            let Some(series) = all.series(row, scene, mode)? else {
                return Ok(());
            };
            of_modes.push(series.clone());
        }
        let [portals, own] = [&of_modes[0], &of_modes[1]];
        let n = own.made.len().max(1) as f64;
        let [made, for_them] = [0, 1].map(|k| own.made.iter().map(|m| m[k]).sum::<f64>() / n);
        let [[before, ..], [mean, median, p99]] = [portals.times(), own.times()];
        let note = format!(
            "triangles a frame: {:.0} by portals, {:.0} by textures, {for_them:.0} of them to make {made:.2} textures; ms a frame: \
             {before:.2} by portals, {mean:.2} by textures, {:.2} times faster, p99 ÷ median {:.2}; {} MiB; {} textures ahead, {} left out, {:.2} taken a frame; {} frames",
            portals.mean_triangles(),
            own.mean_triangles(),
            before / mean,
            p99 / median,
            own.n_bytes >> 20,
            own.ahead[0],
            own.ahead[1],
            own.n_loaded as f64 / n,
            own.seconds.len(),
        );
        let gain = portals.mean_triangles() / own.mean_triangles();
        match bar {
            Some(least) => all.at_least(row, scene, gain, least, &note),
            None => all.print(row, scene, Some(gain), "", None, &note),
        }
    }
    Ok(())
}

/// Prints whether the bound on triangles holds in each frame of a walk, and how even its frame times are.
pub(super) fn bound(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    let Some(series) = all.series("bound", scene, DrawMode::Bound)? else {
        return Ok(());
    };
    let (most, [mean, median, p99]) = (series.most_triangles(), series.times());
    let n = series.seconds.len();
    let note = format!("most triangles of {n} frames, those drawn for textures included");
    all.at_most(
        "bound: triangles",
        scene,
        most,
        MOST_TRIANGLES as f64,
        &note,
    );
    let note = format!("p99 ÷ median of frame times; mean {mean:.2} ms");
    all.at_most("bound: spread", scene, p99 / median, 1.5, &note);
    Ok(())
}

/// Sums over frames.
#[derive(Default)]
struct Judged {
    /// Error and change beyond that of the truth, each times pixels. [Units: 1/255 a channel]
    error: f64,
    pop: f64,
    n_pixels: f64,
    n_pop_pixels: f64,
    n_holes: f64,
    n_bytes: u64,
}

/// Prints error, holes, pops and memory of warped textures, beside those of flat ones.
pub(super) fn quality(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    let (n, size) = (all.state.options.pictures.max(1), all.state.options.size);
    let Some((model, studio)) = all.studio("quality", scene)? else {
        return Ok(());
    };
    let cameras = model.cameras(&studio.sight);
    let mut of = Vec::new();
    for mode in [DrawMode::Cold, DrawMode::ColdEvery1, DrawMode::ColdEvery10] {
        of.push(judged(studio, &cameras, mode, n, size)?);
    }
    let [warped, fine, coarse] = [&of[0], &of[1], &of[2]];
    let mean = |j: &Judged| j.error / j.n_pixels.max(1.0);
    let note = format!(
        "mean difference in 1/255 from the truth in {:.0} pixels of textures; flat: {:.2} every degree, {:.2} every 10 degrees",
        warped.n_pixels,
        mean(fine),
        mean(coarse)
    );
    all.at_most("error", scene, mean(warped), 2.0, &note);
    let share = warped.n_holes / warped.n_pixels.max(1.0);
    let note = "share of these pixels that no texture shows, and that another surface fills";
    all.at_most("holes", scene, share, 1e-3, note);
    let pop = |j: &Judged| j.pop / j.n_pop_pixels.max(1.0);
    let note = format!(
        "change between successive frames beyond that of the truth, divided by that of flat textures every 10 degrees; in 1/255: \
         {:.4}, {:.4} every degree, {:.4} every 10 degrees",
        pop(warped),
        pop(fine),
        pop(coarse)
    );
    all.at_most("pops", scene, pop(warped) / pop(coarse), 0.1, &note);
    let mib = warped.n_bytes as f64 / f64::from(1 << 20);
    let better = if mean(warped) <= mean(fine) {
        "less"
    } else {
        "MORE"
    };
    let note = format!("MiB of textures at most, with {better} error than flat ones every degree");
    let bar = if mean(warped) <= mean(fine) {
        64.0
    } else {
        0.0
    };
    all.at_most("memory", scene, mib, bar, &note);
    Ok(())
}

/// Makes the textures of a camera, as if the walk had come there.
fn settle(studio: &mut Studio, camera: Option<&Camera>, size: [u32; 2]) -> anyhow::Result<()> {
    for camera in camera.into_iter().cycle().take(200) {
        if textured_shot(studio, camera, size)?.counts.n_made == 0 {
            break;
        }
    }
    Ok(())
}

/// Judges stretches of a walk, each of a few successive frames.
fn judged(
    studio: &mut Studio,
    cameras: &[Camera],
    mode: DrawMode,
    n: usize,
    size: [u32; 2],
) -> anyhow::Result<Judged> {
    /// Frames of a stretch.
    const STRETCH: usize = 12;
    mode.begin(studio)?;
    let mut out = Judged::default();
    let n_stretches = n.div_ceil(STRETCH);
    let step = (cameras.len() / n_stretches).max(1);
    for stretch in cameras.windows(STRETCH).step_by(step) {
        settle(studio, stretch.first(), size)?;
        let mut before: Option<(TexturedShot, enfilade_render::Picture)> = None;
        for camera in stretch {
            let own = textured_shot(studio, camera, size)?;
            let truth = shot(studio, camera, DrawMode::Portals, size)?;
            out.n_bytes = out.n_bytes.max(own.counts.n_bytes);
            let n = own.is_textured.iter().filter(|t| **t).count() as f64;
            out.error += mean_difference(&own.picture, &truth, &own.is_textured) * n;
            out.n_pixels += n;
            out.n_holes += own.is_hole.iter().filter(|h| **h).count() as f64;
            if let Some((last, last_truth)) = &before {
                let either = own.is_textured.iter().zip(&last.is_textured);
                let mask: Vec<bool> = either.map(|(a, b)| *a || *b).collect();
                let n = mask.iter().filter(|t| **t).count() as f64;
                let frames = [&last.picture, &own.picture];
                out.pop += mean_pop(frames, [last_truth, &truth], &mask) * n;
                out.n_pop_pixels += n;
            }
            before = Some((own, truth));
        }
    }
    Ok(out)
}
