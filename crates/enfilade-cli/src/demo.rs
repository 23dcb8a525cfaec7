//! `enfilade demo`: bakes a house made in code.

use std::path::PathBuf;

use anyhow::Context;
use enfilade::bake::BakeConfig;
use enfilade::bake::edit::special;
use enfilade::bake::edit::special::LinkOptions;
use enfilade::cpg::{MonitorCamera, PortalId, World};
use enfilade::geom::{DVec3, shown};
use enfilade::import::{ImportOptions, decode_gltf, export_glb};
use enfilade::internals::bake::edit::special::SpecialSpot;
use enfilade_demo::{Generated, furnished_house, impossible_house, lift_tower};
use enfilade_report::{PlanOptions, Verdict, plan_svg};

use crate::bake::{Summary, bake_scene, print_summary};
use crate::formats::Format;
use crate::living::{LampEntry, LiftEntry, LivingFile, PeopleEntry, SoundEntry};
use crate::output::{Outputs, make_folder, write_unnamed};
use crate::screen::{print_json, printed, write_lines};
use enfilade_cli::world::encode_whole;

/// Light of the tower's lamps, a warm white.
const LAMP_COLOR: [f32; 3] = [1.6, 1.35, 1.0];

/// Makes a furnished two-storey house, bakes it, draws its plan and suggests what to try next; with `--living`, a tower
/// with a lift that one rides, people on errands, doors that open as one nears, lamps and a radio; with `--impossible`, a
/// house of mirrors and doors that lead elsewhere.
#[derive(clap::Args)]
pub(crate) struct Demo {
    /// Folder to write `house.glb`, `world.glb` and `plan.svg` to; the demo ends with an error rather than overwrite
    /// other files of these names.
    #[arg(short, long, default_value = ".", value_name = "DIR")]
    output: PathBuf,
    /// Make the tower: `tower.glb` (the model), `world.glb`, `lift.glb` and `living.json`, which says what lives there.
    #[arg(long)]
    living: bool,
    /// Make a house that does not fit in space: `house.glb` (the model) and `world.glb`, with a room that is its own
    /// neighbor, a cabinet larger inside than outside, mirrors that face each other, a screen and a window that reflects.
    #[arg(long, conflicts_with = "living")]
    impossible: bool,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// The output of `--json`.
#[derive(serde::Serialize)]
struct DemoReport {
    /// As text: JSON cannot hold other names.
    files: Vec<String>,
    #[serde(flatten)]
    summary: Summary,
}

/// A baked demo: its world, and its files by name and format, the model first, then the world.
struct Made {
    world: World,
    files: Vec<(&'static str, Format, Vec<u8>)>,
    hints: &'static str,
}

pub(crate) fn run(args: &Demo) -> anyhow::Result<()> {
    let made = match (args.living, args.impossible) {
        (true, _) => tower()?,
        (_, true) => impossible()?,
        _ => house()?,
    };
    make_folder("-o", &args.output)?;
    let path = |name: &str| args.output.join(name);
    let mut outputs = Outputs::default();
    for (name, format, _) in &made.files {
        outputs.write("-o", *format, &path(name))?;
    }
    let files = made.files.into_iter();
    let files: Vec<(PathBuf, Vec<u8>)> = files.map(|(name, _, b)| (path(name), b)).collect();
    write_unnamed("-o", &files, |_, _| false)?;
    let mut out = printed();
    if args.json {
        let report = DemoReport {
            files: (files.iter().map(|(path, _)| path.display().to_string())).collect(),
            summary: Summary::of(&made.world),
        };
        return print_json(out, &report);
    }
    print_summary(&mut out, &made.world)?;
    let names = files
        .iter()
        .map(|(path, _)| shown(path.display()).to_string());
    let names: Vec<String> = names.collect();
    let verdict = Verdict::of(&made.world, &[]).untried();
    let names_in_words = names.join(", ");
    let mut hints = format!(
        "\nwrote {names_in_words}\n{verdict}\n\nTry next:\n{}",
        made.hints
    );
    for (i, name) in names.iter().enumerate() {
        hints = hints.replace(&format!("{{{i}}}"), name);
    }
    Ok(write_lines(&mut out, &hints)?)
}

/// Bakes the model of a generated scene as `bake` does: read from its file, in the file's order, with its names.
fn baked(generated: &Generated) -> anyhow::Result<(Vec<u8>, World, Vec<u8>)> {
    let model = export_glb(&generated.scene);
    let scene = decode_gltf(&model, &ImportOptions::default())?.scene;
    let mut baked = bake_scene(&scene, &BakeConfig::default(), None, None)?;
    let bytes =
        encode_whole(&mut baked.world).context("the baked world breaks an invariant (a bug)")?;
    Ok((model, baked.world, bytes))
}

fn house() -> anyhow::Result<Made> {
    let (model, world, bytes) = baked(&furnished_house())?;
    let plan = plan_svg(&world, &PlanOptions::default()).into_bytes();
    Ok(Made {
        world,
        files: vec![
            ("house.glb", Format::World, model),
            ("world.glb", Format::World, bytes),
            ("plan.svg", Format::Plan, plan),
        ],
        hints: "  enfilade inspect {1}\n  \
                echo '2 1 2' | enfilade locate {1}\n  \
                enfilade verify {1} --source {0}\n  \
                enfilade report {1} -o report.html\n  \
                enfilade view {1}\n  \
                enfilade bake YOUR.glb -o your-world.glb\n\
                and open {2} in a browser, {1} in any glTF viewer.",
    })
}

fn tower() -> anyhow::Result<Made> {
    let tower = lift_tower();
    let (model, world, bytes) = baked(&tower.tower)?;
    let (_, _, cabin) = baked(&tower.cabin)?;
    let lamp = |lift: Option<usize>, at: &DVec3| LampEntry {
        lift,
        at: at.as_vec3().to_array(),
        color: LAMP_COLOR,
        range: 7.0,
    };
    let lamps = tower.lamps.iter().map(|at| lamp(None, at));
    let living = LivingFile {
        version: 1,
        lifts: vec![LiftEntry {
            world: "lift.glb".into(),
            stops: tower.stops.iter().map(DVec3::to_array).collect(),
            speed: 1.5,
            wait: 8.0,
        }],
        lamps: lamps.chain([lamp(Some(0), &tower.cabin_lamp)]).collect(),
        people: PeopleEntry {
            count: 12,
            seed: 1,
            places: tower.places.iter().map(DVec3::to_array).collect(),
            stay: [4.0, 30.0],
        },
        sounds: vec![SoundEntry {
            name: "radio".into(),
            at: tower.radio.to_array(),
        }],
    };
    let plan = plan_svg(&world, &PlanOptions::default()).into_bytes();
    Ok(Made {
        world,
        files: vec![
            ("tower.glb", Format::World, model),
            ("world.glb", Format::World, bytes),
            ("plan.svg", Format::Plan, plan),
            ("lift.glb", Format::World, cabin),
            (
                "living.json",
                Format::Living,
                serde_json::to_vec_pretty(&living)?,
            ),
        ],
        hints: "  enfilade view {1} --living {4} --eye 6,1.6,7.5\n\
                and walk into the lift; F1 in the window lists all keys. {4} can be edited.",
    })
}

/// Bakes the impossible house as `bake` does, and makes its special portals as `edit` does.
fn impossible() -> anyhow::Result<Made> {
    let made = impossible_house();
    let (model, mut world, _) = baked(&made.house)?;
    let on_wall = |polygon: &Vec<DVec3>| SpecialSpot::Wall(polygon.clone());
    for polygon in &made.mirrors {
        special::mirror(&mut world, &on_wall(polygon))?;
    }
    for [a, b] in &made.links {
        special::link(
            &mut world,
            &on_wall(a),
            &on_wall(b),
            &LinkOptions::default(),
        )?;
    }
    let (screen, eye, toward) = &made.monitor;
    let camera = MonitorCamera {
        eye: eye.as_vec3().to_array(),
        toward: toward.as_vec3().to_array(),
        up: [0.0, 1.0, 0.0],
        fov_y: 1.0,
    };
    special::monitor(&mut world, &on_wall(screen), camera)?;
    for (portal, cell) in sides_near(&world, made.window) {
        let cell = Some(cell);
        special::reflect(&mut world, &SpecialSpot::Doorway { portal, cell }, 0.25)?;
    }
    let bytes = encode_whole(&mut world).context("the world breaks an invariant (a bug)")?;
    let plan = plan_svg(&world, &PlanOptions::default()).into_bytes();
    Ok(Made {
        world,
        files: vec![
            ("house.glb", Format::World, model),
            ("world.glb", Format::World, bytes),
            ("plan.svg", Format::Plan, plan),
        ],
        hints: "  enfilade view {1} --eye 4.5,1.6,1\n  \
                enfilade inspect {1}\n\
                and walk into the blue cabinet, or out by an end of the long room beside the hall.",
    })
}

/// Returns the portal whose middle is nearest to a point, from both its cells.
fn sides_near(world: &World, at: DVec3) -> Vec<(PortalId, enfilade::CellId)> {
    let distance = |id: &PortalId| {
        let corners = world.graph[*id].outline.iter();
        let points = corners.map(|p| DVec3::from_array(p.map(f64::from)));
        let n = points.len() as f64;
        (points.sum::<DVec3>() / n).distance(at)
    };
    let nearest = world
        .graph
        .portal_ids()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let sides = nearest.map(|id| world.graph[id].cells.map(|cell| (id, cell)));
    sides.into_iter().flatten().collect()
}
