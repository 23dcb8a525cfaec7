//! Order: the same scene with triangles, vertices, nodes and all other lists shuffled, baked by each builder.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;
use serde_json::Value;

use super::figures::Figures;
use crate::process::{binary, output_of, scenes_dir};
use crate::rows::Chosen;

/// Shuffles per scene.
const COUNT: usize = 20;

const METHODS: [&str; 3] = ["watershed", "bsp", "delaunay"];

/// A bake that takes longer is killed, and counts as a failure. [Units: s]
const MOST: u32 = 3600;

/// A scene as files.
struct SceneFiles {
    name: String,
    inputs: Vec<PathBuf>,
    detail: Option<PathBuf>,
}

impl SceneFiles {
    fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.inputs.iter().chain(&self.detail)
    }

    fn size(&self) -> u64 {
        let size = |file: &PathBuf| file.metadata().map_or(0, |m| m.len());
        self.files().map(size).sum()
    }

    /// Returns the same files in a folder.
    fn within(&self, folder: &Path) -> Self {
        let moved = |file: &PathBuf| folder.join(file.file_name().unwrap_or_default());
        Self {
            name: self.name.clone(),
            inputs: self.inputs.iter().map(moved).collect(),
            detail: self.detail.as_ref().map(moved),
        }
    }
}

/// Counts, by scene and builder, shuffles that change cells or portals, and those that change any byte. A rejected
/// scene must be rejected in any order.
pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let seeds = rows.state.runs(COUNT);
    for subject in subjects(rows.chosen)? {
        let mut differ = [[0; 2]; METHODS.len()];
        let all = |subject: &SceneFiles| -> anyhow::Result<Vec<Baked>> {
            METHODS
                .iter()
                .map(|method| bake(rows, subject, method))
                .collect()
        };
        let plain = all(&subject)?;
        for seed in seeds.clone() {
            let folder = rows.path("shuffled");
            for file in subject.files() {
                let mut generate = Command::new(binary("examples/generate"));
                generate.arg(file).args(["--shuffle", &seed.to_string()]);
                output_of(generate.arg("-o").arg(&folder), None)?;
            }
            let others = all(&subject.within(&folder))?;
            for (n, (plain, other)) in differ.iter_mut().zip(plain.iter().zip(&others)) {
                n[0] += usize::from(plain.bytes != other.bytes);
                n[1] += usize::from(plain.graph != other.graph);
            }
        }
        for (method, [bytes, graph]) in METHODS.into_iter().zip(differ) {
            let scene = format!("{} {method} of {}", subject.name, seeds.len());
            rows.at_most("order graph", &scene, graph as f64, 0.0, "");
            rows.at_most("order bytes", &scene, bytes as f64, 0.0, "");
        }
    }
    Ok(())
}

/// Returns the scene folders in the folder of real scenes and in the one beside it whose name ends in 2, and single
/// files in folders without; the small ones first.
fn subjects(chosen: &Chosen) -> anyhow::Result<Vec<SceneFiles>> {
    let first = scenes_dir().context("no real scenes: set ENFILADE_SCENES to their folder")?;
    let mut second = first.clone().into_os_string();
    second.push("2");
    let mut all = Vec::new();
    for folder in [first, second.into()] {
        for scene in list(&folder) {
            let name = scene.file_name().unwrap_or_default().to_string_lossy();
            let inside = scene.join("scene.glb");
            if inside.is_file() {
                let detail = Some(scene.join("detail.glb")).filter(|f| f.is_file());
                all.push(SceneFiles {
                    name: name.into_owned(),
                    inputs: vec![inside],
                    detail,
                });
                continue;
            }
            let is_known = |file: &PathBuf| {
                ["glb", "obj", "map"]
                    .map(OsStr::new)
                    .map(Some)
                    .contains(&file.extension())
            };
            all.extend(list(&scene).into_iter().filter(is_known).map(|file| {
                SceneFiles {
                    name: file
                        .file_stem()
                        .unwrap_or_default()
                        .to_string_lossy()
                        .into_owned(),
                    inputs: vec![file],
                    detail: None,
                }
            }));
        }
    }
    all.retain(|s| chosen.has_scene(&s.name));
    all.sort_by_key(|s| (s.size(), s.name.clone()));
    Ok(all)
}

fn list(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries
        .filter_map(|e| e.path().canonicalize().ok())
        .collect();
    paths.sort();
    paths
}

/// The result of a bake; empty if it was rejected.
struct Baked {
    bytes: Option<Vec<u8>>,
    /// Cells and portals.
    graph: Option<[Value; 2]>,
}

fn bake(rows: &Figures<'_>, subject: &SceneFiles, method: &str) -> anyhow::Result<Baked> {
    let world = rows.path("order.glb");
    // Remove the output of an earlier bake.
    let _ = std::fs::remove_file(&world);
    let mut args = vec![
        "bake",
        "--method",
        method,
        "--allow-leak",
        "-o",
        "order.glb",
    ];
    let inputs: Vec<_> = subject.inputs.iter().map(|p| p.to_string_lossy()).collect();
    args.extend(inputs.iter().map(AsRef::as_ref));
    let detail = subject.detail.as_ref().map(|p| p.to_string_lossy());
    args.extend(detail.iter().flat_map(|d| ["--detail", d]));
    let ran = rows.enfilade(&args, MOST)?;
    if ran.code != Some(0) {
        anyhow::ensure!(ran.code == Some(1), "{}: {}", subject.name, ran.said);
        return Ok(Baked {
            bytes: None,
            graph: None,
        });
    }
    let mut inspect = Command::new(binary("enfilade"));
    inspect.args(["inspect", "--json"]).arg(&world);
    let graph: Value = serde_json::from_str(&output_of(&mut inspect, None)?)?;
    Ok(Baked {
        bytes: Some(std::fs::read(&world)?),
        graph: Some(["cells", "portals"].map(|list| graph[list].clone())),
    })
}
