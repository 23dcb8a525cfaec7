//! Bad input: it is refused, or drawn without textures, and told.

use std::ops::ControlFlow;
use std::process::Command;

use anyhow::Context;
use enfilade::World;
use enfilade::cpg::CellId;
use enfilade_render::{
    Camera, Culling, Gpu, PortalTextureCounts, PortalTextureError, PortalTextureFileError,
    PortalTextureMaking, PortalTextureOptions, RenderError, Studio,
};

use super::Measurements;
use super::errors::mean_difference;
use super::models::WalkedModel;
use super::series::{DrawMode, shot, style, textured_shot};
use crate::process::{binary, target_dir};

/// Cameras of the walk from which pictures are compared.
const N_CAMERAS: usize = 8;

/// Size of the pictures.
const SIZE: [u32; 2] = [320, 240];

/// Largest file of textures in these tests, which are about refusal. [Units: byte]
const FILE: u64 = 60 << 10;

/// A test: `Ok` with what was said, or with what is wrong.
type BadCase = fn(&mut BadInput<'_>) -> anyhow::Result<Result<String, String>>;

const CASES: &[(&str, BadCase)] = &[
    ("memory of 0 bytes", no_memory),
    ("0 textures a frame", none_a_frame),
    ("0 triangles a frame", no_triangles),
    ("a file of 0 bytes", no_file),
    ("a file for another world", other_world),
    ("a file cut off, of another version, or foreign", damaged),
    ("portals without area", flat_portals),
    ("portals onto nothing", onto_nothing),
    ("a full disk", full_disk),
];

/// A scene, and what is drawn of it.
struct BadInput<'a> {
    world: &'a World,
    studio: &'a mut Studio,
    cameras: Vec<Camera>,
    new_gpu: &'a dyn Fn() -> Result<Gpu, RenderError>,
    scene: &'a str,
}

/// Prints the number of bad inputs that are neither refused nor drawn without textures.
pub(super) fn bad_input(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    let adapter = all.state.options.adapter.clone();
    let new_gpu = || enfilade_cli::adapter::open(&adapter);
    let Some((model, studio)) = all.studio("bad input", scene)? else {
        return Ok(());
    };
    DrawMode::Portals.begin(studio)?;
    let mut input = BadInput {
        world: &model.world,
        cameras: spread(model, studio),
        studio,
        new_gpu: &new_gpu,
        scene,
    };
    let mut rows = Vec::new();
    for (name, case) in CASES {
        rows.push((name, case(&mut input).with_context(|| (*name).to_owned())?));
        input.studio.remove_portal_textures();
    }
    for (name, found) in rows {
        let (n, note) = match found {
            Ok(said) => (0.0, said),
            Err(wrong) => (1.0, wrong),
        };
        all.at_most(&format!("bad input: {name}"), scene, n, 0.0, &note);
    }
    Ok(())
}

/// Returns cameras spread over the walk.
fn spread(model: &WalkedModel, studio: &Studio) -> Vec<Camera> {
    let all = model.cameras(&studio.sight);
    let step = (all.len() / N_CAMERAS).max(1);
    all.into_iter().step_by(step).take(N_CAMERAS).collect()
}

fn options() -> PortalTextureOptions {
    PortalTextureOptions {
        max_made: u32::MAX,
        ..PortalTextureOptions::default()
    }
}

fn making(max_bytes: u64) -> PortalTextureMaking {
    PortalTextureMaking {
        style: style(),
        max_bytes,
        lines: SIZE[1],
    }
}

/// Returns whether pictures with textures are those of portal culling, pixel for pixel.
fn is_plain(
    studio: &mut Studio,
    cameras: &[Camera],
) -> anyhow::Result<Result<PortalTextureCounts, String>> {
    let mut sum = PortalTextureCounts::default();
    for camera in cameras {
        let counts = studio.plan_portal_textures(camera, style(), SIZE)?;
        sum.n_textured += counts.n_textured;
        sum.n_made += counts.n_made;
        let own = studio.picture(camera, Culling::PortalTextures, style(), &[], SIZE)?;
        if own != shot(studio, camera, DrawMode::Portals, SIZE)? {
            return Ok(Err(format!(
                "another picture than without textures at {:?}",
                camera.eye
            )));
        }
    }
    Ok(Ok(sum))
}

fn no_memory(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    let refused = all.studio.add_portal_textures(PortalTextureOptions {
        max_bytes: 0,
        ..options()
    });
    let why = match refused {
        Err(RenderError::PortalTextures(why @ PortalTextureError::NoRoom { budget: 0, .. })) => why,
        other => return Ok(Err(format!("{other:?}"))),
    };
    let pictures = is_plain(all.studio, &all.cameras)?;
    Ok(pictures.map(|_| why.to_string()))
}

fn none_a_frame(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    all.studio.add_portal_textures(PortalTextureOptions {
        max_made: 0,
        ..options()
    })?;
    Ok(match is_plain(all.studio, &all.cameras)? {
        Ok(sum) if sum.n_made + sum.n_textured > 0 => Err(format!("{sum:?}")),
        other => other.map(|_| "the pictures are those of portal culling".into()),
    })
}

fn no_triangles(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    all.studio.add_portal_textures(PortalTextureOptions {
        max_triangles: 0,
        ..options()
    })?;
    let (mut n_plain, aspect) = (0, SIZE[0] as f32 / SIZE[1] as f32);
    for camera in &all.cameras {
        let counts = all.studio.plan_portal_textures(camera, style(), SIZE)?;
        let view = camera.view(aspect)?;
        let list = (all.studio).list(&view, camera.eye, Culling::PortalTextures, SIZE);
        let n = list.n_triangles() + counts.n_made_triangles;
        if n > 0 {
            return Ok(Err(format!("{n} triangles at {:?}", camera.eye)));
        }
        n_plain += counts.n_plain;
        all.studio
            .picture(camera, Culling::PortalTextures, style(), &[], SIZE)?;
    }
    Ok(Ok(format!(
        "no triangle is drawn, and {n_plain} portals of one color are told"
    )))
}

fn no_file(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    all.studio.add_portal_textures(options())?;
    let go_on = &mut |_| ControlFlow::Continue(());
    let made = (all.studio).make_portal_textures(all.world, &making(0), go_on);
    Ok(match made {
        Err(RenderError::PortalTextureFile(
            why @ PortalTextureFileError::NoRoom { budget: 0, .. },
        )) => Ok(why.to_string()),
        other => Err(format!("{:?}", other.map(|made| made.n_textures))),
    })
}

/// Makes a small file of textures.
fn made(all: &mut BadInput<'_>) -> anyhow::Result<Vec<u8>> {
    all.studio.add_portal_textures(options())?;
    let go_on = &mut |_| ControlFlow::Continue(());
    let made = (all.studio).make_portal_textures(all.world, &making(FILE), go_on)?;
    Ok(made.bytes)
}

fn other_world(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    let file = made(all)?;
    let n = match all.studio.load_portal_textures(&file) {
        Ok(n) => n,
        Err(why) => return Ok(Err(format!("refused for its own world: {why}"))),
    };
    // The same world after one of its portals was made a centimeter wider.
    let mut other = all.world.clone();
    let Some(portal) = other.graph.portals.first_mut() else {
        return Ok(Err("the world has no portals".into()));
    };
    let middle = portal.outline[0];
    for p in portal.outline.iter_mut().skip(1) {
        for (x, from) in p.iter_mut().zip(middle) {
            *x += (*x - from).signum() * f32::from(u8::from(*x != from)) * 0.01;
        }
    }
    let mut studio = Studio::new((all.new_gpu)()?, &other)?;
    studio.add_portal_textures(options())?;
    Ok(match studio.load_portal_textures(&file) {
        Err(RenderError::PortalTextureFile(why @ PortalTextureFileError::OtherWorld)) => Ok(
            format!("{n} textures for the own world; for another: {why}"),
        ),
        other => Err(format!("for another world: {other:?}")),
    })
}

fn damaged(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    let file = made(all)?;
    let mut old = file.clone();
    old[6] ^= 0x40;
    let mut changed = file.clone();
    changed[file.len() / 2] ^= 1;
    for bad in [
        &file[..0],
        &file[..file.len() / 2],
        &file[..file.len() - 1],
        b"glTF and more",
        &old,
        &changed,
    ] {
        let refused = all.studio.load_portal_textures(bad);
        if !matches!(refused, Err(RenderError::PortalTextureFile(_))) {
            let n = bad.len();
            return Ok(Err(format!("{n} bytes: {refused:?}")));
        }
    }
    Ok(Ok("all six are refused".into()))
}

fn flat_portals(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    let mut flat = all.world.clone();
    for portal in &mut flat.graph.portals {
        let [a, b] = [portal.outline[0], portal.outline[1]];
        let on = |i: usize| if i.is_multiple_of(2) { a } else { b };
        portal.outline = (0..portal.outline.len()).map(on).collect();
    }
    Ok(match Studio::new((all.new_gpu)()?, &flat) {
        Err(why) => Ok(why.to_string()),
        Ok(mut studio) => {
            studio.add_portal_textures(options())?;
            let pictures = is_plain(&mut studio, &all.cameras)?;
            pictures.map(|_| "the pictures are those of portal culling".into())
        }
    })
}

fn onto_nothing(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    let (mut n_textured, mut error, mut n_pixels) = (0, 0.0, 0.0);
    for camera in &all.cameras {
        let eye = camera.eye.map(f64::from).into();
        let Some(own) = all.world.graph.locator.locate(eye) else {
            continue;
        };
        let mut studio = Studio::new((all.new_gpu)()?, &alone(all.world, own))?;
        studio.add_portal_textures(options())?;
        let own = textured_shot(&mut studio, camera, SIZE)?;
        let truth = shot(&mut studio, camera, DrawMode::Portals, SIZE)?;
        let n = own.is_textured.iter().filter(|t| **t).count() as f64;
        error += mean_difference(&own.picture, &truth, &own.is_textured) * n;
        n_pixels += n;
        n_textured += own.counts.n_textured;
    }
    let mean = error / n_pixels.max(1.0);
    let note = format!(
        "{n_textured} portals are textures of nothing, off by {mean:.2} of 255 in {n_pixels} pixels"
    );
    Ok(if mean <= 2.0 { Ok(note) } else { Err(note) })
}

/// Returns a world of which one cell alone has surfaces.
fn alone(world: &World, cell: CellId) -> World {
    let mut out = world.clone();
    for batch in &mut out.batches {
        if batch.cells != [cell] {
            batch.cells.clear();
        }
    }
    for object in &mut out.details {
        object.cells.retain(|own| *own == cell);
    }
    out
}

/// Writes to a device that is always full; elsewhere than on Linux, to a folder that is missing.
fn full_disk(all: &mut BadInput<'_>) -> anyhow::Result<Result<String, String>> {
    let dir = target_dir().join("textures-bad");
    std::fs::create_dir_all(&dir)?;
    let world = dir.join(format!("{}.glb", all.scene));
    enfilade::save(&world, all.world)?;
    let full = if cfg!(target_os = "linux") {
        "/dev/full"
    } else {
        "none/w.ptx"
    };
    let done = Command::new(binary("enfilade"))
        .args(["portals", "--plain", "--side", "16", "--max-bytes", "20K"])
        .args(["-o", full])
        .arg(&world)
        .output()
        .context("cannot start enfilade; build it with the same profile")?;
    std::fs::remove_dir_all(&dir)?;
    let said = String::from_utf8_lossy(&done.stderr);
    let said = said.trim().lines().last().unwrap_or_default().to_owned();
    let is_told = done.status.code() == Some(1) && said.contains(full);
    Ok(if is_told { Ok(said) } else { Err(said) })
}
