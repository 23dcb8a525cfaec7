//! Transitions, one by one: their first moment is the texture, their end the geometry, and the frames between are even.

use enfilade_render::{
    Camera, Culling, Frame, Picture, PortalTextureCounts, PortalTextureOptions, Studio,
};

use super::Measurements;
use super::series::{DrawMode, style};

/// Transitions of each scene.
const MOST: usize = 6;

/// Frames of the walk between two of them at least, so that they are at different portals.
const APART: usize = 60;

/// Frames of the walk in which they are looked for.
const SEARCHED: usize = 4_000;

/// Size of the pictures. A doorway is not larger than its texture on them, so that its distance alone makes it turn.
const SIZE: [u32; 2] = [320, 240];

/// Change of a channel from which on a step is measured: smaller ones are mostly rounding. [Units: 1/255]
const CLEAR: u8 = 8;

/// Least number of such channels: a few are holes of textures, which the transition fills at once.
const LEAST: usize = 1000;

/// Distance that a walker goes in a frame at most, with some room. [Units: wu]
const STEP: f32 = 0.035;

/// The transitions of a walk, judged.
#[derive(Default)]
struct EndsFound {
    n: usize,
    /// Those that leave no other portal as a texture: the picture is that of portal culling.
    n_pure: usize,
    /// Most difference at either end. [Units: 1/255]
    texture: u8,
    geometry: u8,
    /// Most difference of the number of frames between the ends from that wanted.
    frames: usize,
    /// Sums of change in the first and the last frame between the ends, and the number of channels.
    steps: [f64; 3],
}

/// Prints the differences at both ends of the transitions of a walk.
pub(super) fn ends(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    let Some((model, studio)) = all.studio("ends", scene)? else {
        return Ok(());
    };
    let cameras = model.cameras(&studio.sight);
    DrawMode::Portals.begin(studio)?;
    let mut found = EndsFound::default();
    for i in beginnings(studio, &cameras)? {
        judge(studio, [&cameras[i - 1], &cameras[i]], &mut found)?;
    }
    studio.remove_portal_textures();
    if found.n == 0 {
        let why = "no portal turns into geometry on the walk";
        all.print("ends: texture", scene, None, "", None, why);
        return Ok(());
    }
    let EndsFound { n, n_pure, .. } = found;
    let note =
        format!("most difference in 1/255 from the texture in the first moment of {n} transitions");
    all.at_most("ends: texture", scene, f64::from(found.texture), 0.0, &note);
    let note = format!(
        "most difference in 1/255 from the geometry after {n} transitions, {n_pure} of them without other textures in view"
    );
    all.at_most(
        "ends: geometry",
        scene,
        f64::from(found.geometry),
        0.0,
        &note,
    );
    let note = "frames between the ends, less those set";
    all.at_most("ends: frames", scene, found.frames as f64, 0.0, note);
    let [first, last, n] = found.steps;
    if n < LEAST as f64 {
        let why = format!("{n} channels change by {CLEAR} or more: too few");
        all.print("ends: even steps", scene, None, "", None, &why);
        return Ok(());
    }
    let n_between = f64::from(frames() - 1);
    let off = (n_between * first / last.max(1.0) - 1.0).abs();
    let note = format!(
        "change in the first frame × {n_between} ÷ change until the last, less 1; in {n} channels"
    );
    all.at_most("ends: even steps", scene, off, 0.2, &note);
    Ok(())
}

fn frames() -> u32 {
    PortalTextureOptions::default().transition_frames
}

fn plan(studio: &mut Studio, camera: &Camera) -> anyhow::Result<PortalTextureCounts> {
    Ok(studio.plan_portal_textures(camera, style(), SIZE)?)
}

/// Draws what was planned.
fn draw(studio: &mut Studio, camera: &Camera, culling: Culling) -> anyhow::Result<Picture> {
    let aspect = SIZE[0] as f32 / SIZE[1] as f32;
    let list = studio.take_list(&camera.view(aspect)?, camera.eye, culling, SIZE);
    let frame = Frame {
        projection: camera.projection(aspect)?,
        list: &list,
        style: style(),
        marks: &[],
    };
    let picture = studio.picture_of(&frame, SIZE)?;
    studio.give_list(list);
    Ok(picture)
}

/// Starts anew with all textures of a camera, and plans the next one's frame.
fn stepped(
    studio: &mut Studio,
    [before, at]: [&Camera; 2],
    frames: u32,
    nearer: f32,
) -> anyhow::Result<PortalTextureCounts> {
    let default = PortalTextureOptions::default();
    studio.add_portal_textures(PortalTextureOptions {
        transition_frames: frames,
        transition_distance: default.transition_distance - nearer,
        max_made: u32::MAX,
        ..default
    })?;
    for _ in 0..20 {
        if plan(studio, before)?.n_made == 0 {
            break;
        }
    }
    plan(studio, at)
}

/// Finds frames in which a transition begins and no other goes on.
fn beginnings(studio: &mut Studio, cameras: &[Camera]) -> anyhow::Result<Vec<usize>> {
    let default = PortalTextureOptions::default();
    studio.add_portal_textures(PortalTextureOptions {
        max_made: u32::MAX,
        ..default
    })?;
    let mut out: Vec<usize> = Vec::new();
    let mut last = PortalTextureCounts::default();
    for (i, camera) in cameras.iter().enumerate().take(SEARCHED) {
        let now = plan(studio, camera)?;
        let is_far = out.last().is_none_or(|last| i - last >= APART);
        if is_far && now.n_turning > 0 && last.n_turning == 0 && last.n_textured > 0 {
            out.push(i);
        }
        // Some of them turn back into textures, and do not count.
        if out.len() >= 3 * MOST {
            break;
        }
        last = now;
    }
    Ok(out)
}

fn most_difference(a: &Picture, b: &Picture) -> u8 {
    let pairs = a.rgba.iter().zip(&b.rgba);
    pairs.map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

/// Returns the change from the first picture to the second and to the third, in channels in which the latter is clear, and
/// their number.
fn changes([from, first, last]: [&Picture; 3]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for ((from, first), last) in from.rgba.iter().zip(&first.rgba).zip(&last.rgba) {
        if from.abs_diff(*last) >= CLEAR {
            sums[0] += f64::from(from.abs_diff(*first));
            sums[1] += f64::from(from.abs_diff(*last));
            sums[2] += 1.0;
        }
    }
    sums
}

/// Judges the transition that begins between two cameras, if a texture turns into geometry there.
fn judge(studio: &mut Studio, cameras: [&Camera; 2], found: &mut EndsFound) -> anyhow::Result<()> {
    if found.n >= MOST {
        return Ok(());
    }
    let at = cameras[1];
    let own = Culling::PortalTextures;
    // As if the transition began a step later.
    let still = stepped(studio, cameras, 0, STEP)?;
    let texture = draw(studio, at, own)?;
    let turned = stepped(studio, cameras, 0, 0.0)?;
    let geometry = draw(studio, at, own)?;
    // The first moment of one that takes forever.
    let begun = stepped(studio, cameras, u32::MAX, 0.0)?;
    if still.n_textured <= turned.n_textured || begun.n_textured != still.n_textured {
        return Ok(());
    }
    found.n += 1;
    let first = draw(studio, at, own)?;
    found.texture = found.texture.max(most_difference(&first, &texture));
    let mut now = stepped(studio, cameras, frames(), 0.0)?;
    let mut between = Vec::new();
    while now.n_turning > 0 && between.len() <= frames() as usize {
        between.push(draw(studio, at, own)?);
        now = plan(studio, at)?;
    }
    let end = draw(studio, at, own)?;
    found.geometry = found.geometry.max(most_difference(&end, &geometry));
    if now.n_textured == 0 {
        found.n_pure += 1;
        let truth = draw(studio, at, Culling::Portals)?;
        found.geometry = found.geometry.max(most_difference(&end, &truth));
    }
    let wanted = frames() as usize - 1;
    found.frames = found.frames.max(between.len().abs_diff(wanted));
    if let [first, .., last] = &between[..] {
        let own = changes([&texture, first, last]);
        found.steps = [0, 1, 2].map(|k| found.steps[k] + own[k]);
    }
    Ok(())
}
