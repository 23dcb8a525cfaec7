//! Cameras: given, on a recorded path, at random.

use std::path::Path;

use anyhow::bail;
use enfilade::cpg::{CellId, World};
use enfilade::runtime::Sight;
use enfilade_demo::Rng;
use enfilade_render::Camera;

use crate::input::read_text;

/// Reads a path: one line per camera, `eye-x eye-y eye-z look-x look-y look-z`, in meters.
///
/// # Errors
///
/// If the file cannot be read, a line is not six numbers, or there are no lines.
pub fn read_path(path: &Path, fov_y: f32) -> anyhow::Result<Vec<Camera>> {
    let text = read_text("cameras", path)?;
    let mut out = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.is_empty() {
            continue;
        }
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        match numbers.as_deref() {
            Ok(&[x, y, z, a, b, c]) if [x, y, z, a, b, c].iter().all(|v| v.is_finite()) => {
                out.push(Camera {
                    eye: [x, y, z].map(|v| v as f32),
                    // From the rounded eye, so that the direction survives few digits.
                    toward: [[a, x], [b, y], [c, z]]
                        .map(|[to, from]| (to - f64::from(from as f32)) as f32),
                    fov_y,
                });
            }
            _ => bail!(
                "{}:{}: six numbers are needed, eye and point looked at: x y z x y z",
                path.display(),
                i + 1
            ),
        }
    }
    if out.is_empty() {
        bail!("{}: holds no camera", path.display());
    }
    Ok(out)
}

/// Formats a path as [`read_path`] reads it.
#[must_use]
pub fn path_text(cameras: &[Camera]) -> String {
    let mut out = String::from("# eye x y z, point looked at x y z; meters\n");
    for c in cameras {
        let [x, y, z] = c.eye;
        // Summed with more digits than either has, so that reading restores what was written.
        let [a, b, d] = [0, 1, 2].map(|k| f64::from(c.eye[k]) + f64::from(c.toward[k]));
        out += &format!("{x} {y} {z} {a} {b} {d}\n");
    }
    out
}

/// A random camera of `verify --views`: mostly in a cell, sometimes in an opening, or anywhere, including walls and
/// the outside.
pub fn random_camera(rng: &mut Rng, world: &World, sight: &Sight, bounds: [[f32; 3]; 2]) -> Camera {
    let in_box = |rng: &mut Rng, [low, high]: [[f32; 3]; 2]| {
        [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit() as f32)
    };
    let graph = &world.graph;
    let kind = rng.below(10);
    let mut eye = in_box(rng, bounds);
    if kind == 0 && !graph.portals.is_empty() {
        // On the portal's plane except for rounding, or slightly beside it.
        let portal = &graph.portals[rng.below(graph.portals.len())];
        let middle = portal.center();
        let corner = portal.outline[rng.below(portal.outline.len())];
        let t = rng.unit() as f32 * 0.95;
        let off = [0.0, 1e-5, 1e-3, 0.03][rng.below(4)];
        eye = [0, 1, 2].map(|k| middle[k] + (corner[k] - middle[k]) * t + portal.normal[k] * off);
    } else if kind > 1 && !graph.cells.is_empty() {
        for _ in 0..1000 {
            let c = rng.below(graph.cells.len());
            let p = in_box(rng, graph.cells[c].aabb);
            if sight.locate(p) == Some(CellId(c as u32)) {
                eye = p;
                break;
            }
        }
    }
    let angle = rng.range(0.0, std::f64::consts::TAU);
    let level = rng.range(-1.2, 1.2) * rng.unit();
    Camera {
        eye,
        toward: [angle.cos(), level.tan(), angle.sin()].map(|x| x as f32),
        fov_y: rng.range(0.4, 1.9) as f32,
    }
}
