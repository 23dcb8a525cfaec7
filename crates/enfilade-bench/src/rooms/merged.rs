//! Merged meshes: buildings as optimizers, STL and PLY leave them, against the same buildings object by object.
//!
//! Row `merged rooms` is the share of rooms lost by merging, `merged doors` that of doors; `one mesh` keeps the name of its first
//! object, as `gltf-transform join` does.

use std::io::Write as _;
use std::path::Path;
use std::process::Command;

use anyhow::Context;
use enfilade::geom::DVec3;
use enfilade::geom::scene::Scene;

use super::bakes::{folder, shared};
use super::score::{Score, inspect, score_scene, score_world};
use crate::measure::imported;
use crate::process::{bake_file, output_of};
use crate::rows::RowPrinter;

/// Most rooms lost, as a share of all.
const ROOMS: f64 = 0.02;
/// Most doors lost, as a share of all.
const DOORS: f64 = 0.05;

/// A format, and the ending of its files.
const FORMS: [(&str, &str); 3] = [("one mesh", "obj"), ("STL", "stl"), ("PLY", "ply")];

pub(super) fn run(out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    for (name, dir) in shared() {
        if !dir.join("truth.json").is_file() || !out.chosen.has_scene(&name) {
            continue;
        }
        let whole = score_scene(&dir, None)?;
        let scene = imported(&dir)?;
        for (form, ending) in FORMS {
            let merged = merged_score(&dir, &scene, &name, ending)?;
            // Rooms and doors are the first of the columns.
            for (k, row, most) in [(0, "merged rooms", ROOMS), (1, "merged doors", DOORS)] {
                let (Some(before), Some(after)) = (whole.figures[k], merged.figures[k]) else {
                    continue;
                };
                let note = format!("{form}: {after:.3} of {before:.3}");
                out.at_most(row, &name, before - after, most, &note);
            }
        }
    }
    Ok(())
}

/// Writes a scene as one mesh, bakes and scores it.
fn merged_score(dir: &Path, scene: &Scene, name: &str, ending: &str) -> anyhow::Result<Score> {
    let world = folder()?.join(format!("{name}-merged.glb"));
    output_of(&mut merged_bake(scene, name, ending, &world)?, None)?;
    score_world(dir, &world, &inspect(&world)?)
}

/// Writes a scene as one mesh, and returns its bake.
pub(crate) fn merged_bake(
    scene: &Scene,
    name: &str,
    ending: &str,
    world: &Path,
) -> anyhow::Result<Command> {
    let mesh = Merged::of(scene);
    let path = folder()?.join(format!("{name}-merged.{ending}"));
    let bytes = match ending {
        "stl" => mesh.stl(),
        "ply" => mesh.ply(),
        _ => mesh.obj(scene.objects.first().map_or("", |o| &o.name)),
    };
    std::fs::write(&path, bytes?).with_context(|| path.display().to_string())?;
    Ok(bake_file(&path, &["--up", "y"], world))
}

/// The triangles of all objects.
struct Merged {
    points: Vec<[f32; 3]>,
    triangles: Vec<[usize; 3]>,
}

impl Merged {
    fn of(scene: &Scene) -> Self {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for object in &scene.objects {
            for primitive in &scene.meshes[object.mesh as usize].primitives {
                let first = points.len();
                points.extend(primitive.positions.iter().map(|p| {
                    let p = DVec3::from_array(p.map(f64::from));
                    object.transform.transform_point3(p).as_vec3().to_array()
                }));
                let triples = primitive.triples().iter();
                triangles.extend(triples.map(|t| t.map(|i| first + i as usize)));
            }
        }
        Self { points, triangles }
    }

    fn stl(&self) -> std::io::Result<Vec<u8>> {
        let mut bytes = vec![0; 80];
        bytes.extend((self.triangles.len() as u32).to_le_bytes());
        for triangle in &self.triangles {
            let vertices = triangle.iter().flat_map(|&i| self.points[i]);
            for x in [0.0; 3].into_iter().chain(vertices) {
                bytes.extend(x.to_le_bytes());
            }
            bytes.extend([0, 0]);
        }
        Ok(bytes)
    }

    fn ply(&self) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        writeln!(bytes, "ply\nformat ascii 1.0")?;
        writeln!(bytes, "element vertex {}", self.points.len())?;
        for axis in ["x", "y", "z"] {
            writeln!(bytes, "property float {axis}")?;
        }
        writeln!(bytes, "element face {}", self.triangles.len())?;
        writeln!(bytes, "property list uchar int vertex_indices\nend_header")?;
        for [x, y, z] in &self.points {
            writeln!(bytes, "{x} {y} {z}")?;
        }
        for [a, b, c] in &self.triangles {
            writeln!(bytes, "3 {a} {b} {c}")?;
        }
        Ok(bytes)
    }

    fn obj(&self, name: &str) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        writeln!(bytes, "o {name}")?;
        for [x, y, z] in &self.points {
            writeln!(bytes, "v {x} {y} {z}")?;
        }
        for [a, b, c] in &self.triangles {
            writeln!(bytes, "f {} {} {}", a + 1, b + 1, c + 1)?;
        }
        Ok(bytes)
    }
}
