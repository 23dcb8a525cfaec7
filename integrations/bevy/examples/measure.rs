//! Figures of the plugin, one JSON line each: `measure [--views N] [--furnish TRIANGLES] [--size WxH] [--no-sun]
//! WORLD.glb…`.
//!
//! | row | value | bar |
//! | --- | --- | --- |
//! | bevy pictures | pixels that differ with and without culling, over N views | 0 |
//! | bevy entities | entities that cameras hand to the renderer, without culling ÷ with | ≥ 10, furnished institute |
//! | bevy frame time | median time of a frame, without culling ÷ with, by turns | ≥ 3, furnished institute |
//!
//! Without `--no-sun`, a sun casts shadows of all there is: the engine draws them apart from what cameras see. With
//! `--furnish`, each room gets objects of its own until the world has so many triangles.

#[path = "../tests/bevy/support.rs"]
mod support;

use std::path::{Path, PathBuf};

use bevy::prelude::*;
use enfilade::cpg::DetailObject;
use enfilade::geom::scene::{Mesh as SceneMesh, Primitive};
use serde_json::json;
use support::{Lamps, Rng, Stage, Stand, stands};

/// Triangles of a piece of furniture.
const PIECE: u64 = 640;
/// Lamps that cast shadows.
const WITH_SHADOWS: usize = 4;

struct Options {
    n_views: usize,
    furnish: u64,
    size: UVec2,
    has_sun: bool,
    worlds: Vec<PathBuf>,
}

fn main() {
    let options = options(std::env::args().skip(1));
    for path in &options.worlds {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let (path, scene) = if options.furnish > 0 {
            let path = furnished(path, options.furnish);
            (path, format!("{name} furnished"))
        } else {
            (path.clone(), name.into_owned())
        };
        measure(&path, &scene, &options);
    }
}

fn options(mut arguments: impl Iterator<Item = String>) -> Options {
    let mut options = Options {
        n_views: 20,
        furnish: 0,
        size: UVec2::new(320, 200),
        has_sun: true,
        worlds: Vec::new(),
    };
    while let Some(argument) = arguments.next() {
        let mut value = || {
            arguments
                .next()
                .unwrap_or_else(|| panic!("{argument} needs a value"))
        };
        match argument.as_str() {
            "--views" => options.n_views = value().parse().expect("a number of views"),
            "--furnish" => options.furnish = value().parse().expect("a number of triangles"),
            "--size" => {
                let size = value();
                let (width, height) = size.split_once('x').expect("a size such as 320x200");
                let side = |s: &str| s.parse().expect("a number of pixels");
                options.size = UVec2::new(side(width), side(height));
            }
            "--no-sun" => options.has_sun = false,
            _ => options.worlds.push(argument.into()),
        }
    }
    assert!(!options.worlds.is_empty(), "name at least one world");
    options
}

fn measure(path: &Path, scene: &str, options: &Options) {
    let lamps = Lamps {
        range: 5.0,
        with_shadows: WITH_SHADOWS,
        sun: options.has_sun,
    };
    let mut stage = Stage::new(path, options.size, lamps);
    let stands = stands(stage.world(), options.n_views, 7);
    // The bars of gain are those of the furnished institute.
    let is_barred = scene == "institute furnished";
    let n_different: usize = stands.iter().map(|s| stage.n_different(*s)).sum();
    print(
        scene,
        "bevy pictures",
        n_different as f64,
        Some((0.0, n_different == 0)),
    );
    let gains = stands.iter().map(|s| gain(&mut stage, *s));
    let gains: Vec<Gain> = gains.collect();
    for (row, bar, of) in [
        (
            "bevy entities",
            10.0,
            (|g: &Gain| g.n_entities) as fn(&Gain) -> [f64; 2],
        ),
        ("bevy lights", 1.0, |g| g.n_lights),
        ("bevy frame time", 3.0, |g| g.seconds),
    ] {
        let medians = [0, 1].map(|k| median(gains.iter().map(|g| of(g)[k]).collect()));
        let ratio = medians[0] / medians[1].max(f64::MIN_POSITIVE);
        let bar = (is_barred && bar > 1.0).then_some((bar, ratio >= bar));
        eprintln!(
            "{scene}, {row}: {:.5} without, {:.5} with",
            medians[0], medians[1]
        );
        print(scene, row, ratio, bar);
    }
}

fn print(scene: &str, row: &str, value: f64, bar: Option<(f64, bool)>) {
    let mut line = json!({ "row": row, "scene": scene, "value": value });
    if let Some((bar, is_ok)) = bar {
        line["bar"] = bar.into();
        line["ok"] = is_ok.into();
    }
    println!("{line}");
}

/// Without culling, and with it.
struct Gain {
    n_entities: [f64; 2],
    n_lights: [f64; 2],
    seconds: [f64; 2],
}

/// Draws a view by turns, without and with culling, and keeps the shortest time of each.
fn gain(stage: &mut Stage, stand: Stand) -> Gain {
    stage.stand(stand);
    let mut seconds = [f64::INFINITY; 2];
    let (mut n_entities, mut n_lights) = ([0.0; 2], [0.0; 2]);
    for _ in 0..3 {
        for (k, is_culling) in [false, true].into_iter().enumerate() {
            stage.set_culling(is_culling);
            // The first frame after a change fills caches.
            stage.frame();
            seconds[k] = stage.frame().as_secs_f64().min(seconds[k]);
            let view = stage.view();
            n_entities[k] = view.n_after as f64;
            n_lights[k] = view.n_lights_after as f64;
        }
    }
    Gain {
        n_entities,
        n_lights,
        seconds,
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Writes the world with pieces of furniture in its rooms, each a mesh of its own, beside the system's temporary files.
fn furnished(path: &Path, n_triangles: u64) -> PathBuf {
    let mut world = enfilade::open(path).expect("a world");
    let rooms: Vec<(enfilade::CellId, [[f32; 3]; 2])> = world
        .graph
        .rooms()
        .map(|(cell, room)| (cell, room.aabb))
        .collect();
    let mut rng = Rng::new(5);
    let n_pieces = n_triangles / PIECE;
    let mut n_placed = 0;
    // Rooms with a slanted ceiling or a narrow box take several tries.
    for i in 0..n_pieces * 50 {
        if n_placed == n_pieces {
            break;
        }
        let (cell, [low, high]) = rooms[i as usize % rooms.len()];
        let radius = 0.15 + 0.2 * rng.unit();
        let at = [0, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit());
        let at = [at[0], low[1] + radius + 0.02, at[1]];
        let is_inside = |d: [f32; 3]| {
            let p = [0, 1, 2].map(|k| at[k] + d[k] * radius);
            world.graph.locate(p) == Some(cell)
        };
        let around = [-1.0, 1.0]
            .into_iter()
            .flat_map(|s| [[s, 0.0, 0.0], [0.0, s, 0.0], [0.0, 0.0, s]]);
        if !around.into_iter().all(is_inside) {
            continue;
        }
        let mesh = ball(at, radius, &mut rng);
        let n_own = mesh.primitives[0].indices.len() / 3;
        let mut transform = [0.0; 16];
        for k in [0, 5, 10, 15] {
            transform[k] = 1.0;
        }
        world.details.push(DetailObject {
            name: format!("piece {n_placed}"),
            mesh: world.detail_meshes.len() as u32,
            transform,
            cells: vec![cell],
            source: None,
            part_of: None,
        });
        world.detail_meshes.push(mesh);
        world.graph.cells[cell.idx()].n_detail_triangles += n_own as u32;
        n_placed += 1;
    }
    // Sets of visible parts number the details.
    world.pvs = None;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let out = std::env::temp_dir().join(format!("{name}-furnished-{}.glb", std::process::id()));
    enfilade::save(&out, &world).expect("a file");
    out
}

/// A rough ball of [`PIECE`] triangles: rings of latitude, joined by strips.
fn ball(center: [f32; 3], radius: f32, rng: &mut Rng) -> SceneMesh {
    const RINGS: u32 = 17;
    const SIDES: u32 = 20;
    let mut primitive = Primitive::default();
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let up = std::f32::consts::PI * ring as f32 / (RINGS - 1) as f32;
            let around = std::f32::consts::TAU * side as f32 / SIDES as f32;
            let normal = [up.sin() * around.cos(), up.cos(), up.sin() * around.sin()];
            let r = radius * (0.9 + 0.1 * rng.unit());
            primitive
                .positions
                .push([0, 1, 2].map(|k| center[k] + normal[k] * r));
            primitive.normals.push(normal);
        }
    }
    for ring in 0..RINGS - 1 {
        for side in 0..SIDES {
            let at = |ring: u32, side: u32| ring * SIDES + side % SIDES;
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
            primitive.indices.extend([a, b, c, b, d, c]);
        }
    }
    assert_eq!(primitive.indices.len() as u64, 3 * PIECE);
    SceneMesh {
        name: "piece".to_owned(),
        primitives: vec![primitive],
    }
}
