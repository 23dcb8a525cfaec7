//! Tampered worlds: each kind of tampering at three places of each scene, and the rate at which `verify` finds it by
//! default. The command `tampered` counts, in a process of its own; the rows compare.
//!
//! Kinds and places come from the test kit (`tamper`), as in tests.

use std::io::Write;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::cpg::wire::{decode_glb, encode_glb};
use enfilade::geom::Triangle;
use enfilade::geom::scene::{Role, Scene};
use enfilade::vis::see_parts;
use enfilade_testkit::furnished_house;
use enfilade_testkit::tamper::{ShownBy, tamperings};
use enfilade_verify::{SourceDetail, VerifyOptions, compare_details, compare_scene, verify_world};
use serde_json::{Value, json};

use super::figures::Figures;
use crate::measure::{file_name, imported};
use crate::process::{binary, output_of, scenes};
use crate::rows::baked;
use crate::sight::visible_past_walls;

/// Numbers of rays tried one after the other until a problem is found; the last is the default of `verify`.
const RAYS: [u64; 4] = [0, 20_000, 200_000, 1_000_000];

/// Real buildings, from three programs.
const SCENES: [&str; 3] = ["samplehouse4", "duplex", "fzk-haus"];

/// Prints a row per kind and scene: places at which it is found, all of them if `ok`; unknown if a scene has no such
/// place.
pub(super) fn run(rows: &mut Figures<'_>) -> anyhow::Result<()> {
    let mut command = Command::new(binary("enfilade-bench"));
    command.arg("tampered");
    for scene in SCENES {
        let found = scenes().into_iter().find(|dir| dir.ends_with(scene));
        match found {
            Some(dir) => {
                command.arg(dir);
            }
            None => rows.print("tampered", scene, None, "= places", None, ""),
        }
    }
    let mut kinds = std::collections::BTreeSet::new();
    for line in output_of(&mut command, None)?.lines() {
        let row: Value = serde_json::from_str(line).context("a row of the benchmarks")?;
        let text = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
        let number = |key: &str| row[key].as_f64().unwrap_or_default();
        let (found, places) = (number("found"), number("places"));
        kinds.insert(text("kind"));
        let name = match text("by").as_str() {
            "source" => format!("tampered --source: {}", text("kind")),
            _ => format!("tampered: {}", text("kind")),
        };
        let bar = format!("= {places}");
        let ok = (places > 0.0).then_some(found == places);
        rows.print(
            &name,
            &text("scene"),
            (places > 0.0).then_some(found),
            &bar,
            ok,
            "",
        );
    }
    let n = kinds.len() as f64;
    rows.print(
        "tampered kinds",
        "all",
        Some(n),
        ">= 60",
        Some(n >= 60.0),
        "",
    );
    Ok(())
}

/// Prints a line of JSON for each kind and scene: places found and places tried. `kinds` are beginnings of names.
pub(crate) fn bench_tampered(scenes: &[PathBuf], kinds: &[String]) -> anyhow::Result<()> {
    bench_scene("house", &named(furnished_house().scene), kinds)?;
    for dir in scenes {
        bench_scene(&file_name(dir), &imported(dir)?, kinds)?;
    }
    Ok(())
}

fn bench_scene(name: &str, scene: &Scene, kinds: &[String]) -> anyhow::Result<()> {
    let world = seen(baked(scene)?).with_context(|| name.to_owned())?;
    let is_asked =
        |kind: &str| kinds.is_empty() || kinds.iter().any(|k| kind.starts_with(k.as_str()));
    anyhow::ensure!(
        !is_found(&world, scene, ShownBy::Source),
        "{name}: a problem found in the unchanged world"
    );
    for tampering in tamperings().filter(|t| is_asked(t.name)) {
        let (mut n, mut n_found) = (0, 0);
        for place in 0..3 {
            let Some(changed) = tampering.apply(&world, place) else {
                continue;
            };
            n += 1;
            n_found += u32::from(is_found(&changed, scene, tampering.shown_by));
        }
        let by = match tampering.shown_by {
            ShownBy::File => "file",
            ShownBy::Source => "source",
        };
        let row = json!({
            "kind": tampering.name, "scene": name, "by": by, "found": n_found, "places": n,
        });
        writeln!(std::io::stdout().lock(), "{row}")?;
    }
    Ok(())
}

/// Returns `true` if decoding or verification rejects a world, by itself or also by its source.
fn is_found(world: &World, scene: &Scene, by: ShownBy) -> bool {
    let Ok(Ok(read)) = encode_glb(world).map(|bytes| decode_glb(&bytes)) else {
        return true;
    };
    if by == ShownBy::Source {
        let said = [compare_scene(&read, scene), detail_problems(&read, scene)].concat();
        return !said.is_empty();
    }
    RAYS.iter().any(|&rays| {
        let options = VerifyOptions {
            rays,
            ..VerifyOptions::default()
        };
        !verify_world(&read, None, &options).holds()
    })
}

fn detail_problems(world: &World, scene: &Scene) -> Vec<String> {
    let mut triangles: Vec<Vec<Triangle>> = vec![Vec::new(); scene.objects.len()];
    for t in scene.triangle_sources(Role::Detail) {
        triangles[t.object as usize].push(scene.world_triangle(t));
    }
    let ids: Vec<usize> = (0..scene.objects.len())
        .filter(|&i| scene.objects[i].role == Role::Detail)
        .collect();
    compare_details(world, ids.len(), |i| SourceDetail {
        name: scene.objects[ids[i]].name.clone(),
        source: scene.objects[ids[i]].node,
        triangles: triangles[ids[i]].clone(),
    })
}

/// Returns the generated house with object names of its own, as an input has them.
fn named(mut scene: Scene) -> Scene {
    for (i, object) in (0..).zip(&mut scene.objects) {
        object.name = format!("{} {i}", object.name);
        object.node = Some(i);
        scene.nodes.push(enfilade::geom::scene::SourceNode {
            name: object.name.clone(),
            ..Default::default()
        });
    }
    scene
}

/// Adds visible volumes and parts for each cell.
fn seen(mut world: World) -> anyhow::Result<World> {
    let mut pvs = visible_past_walls(&world)?;
    let (volumes, parts) = see_parts(&world, &pvs)?;
    (pvs.volumes, pvs.parts) = (Some(volumes), Some(parts));
    world.pvs = Some(pvs);
    Ok(world)
}
