//! `enfilade demo`: bakes a house made in code.

use std::path::PathBuf;

use anyhow::Context;
use enfilade::bake::BakeConfig;
use enfilade::cpg::World;
use enfilade::cpg::wire::encode_glb;
use enfilade::geom::{DVec3, shown};
use enfilade::import::{ImportOptions, decode_gltf, export_glb};
use enfilade_report::{PlanOptions, plan_svg};
use enfilade_testkit::{Generated, furnished_house, lift_tower};

use crate::bake::{Summary, bake_scene, print_summary};
use crate::formats::Format;
use crate::living::{LampEntry, LiftEntry, LivingFile, PeopleEntry, SoundEntry};
use crate::output::{Outputs, make_folder, write_unnamed};
use crate::screen::{print_json, printed, write_lines};

/// Light of the tower's lamps, a warm white.
const LAMP_COLOR: [f32; 3] = [1.6, 1.35, 1.0];

/// Makes a furnished two-storey house, bakes it, draws its plan and suggests what to try next; with `--living`, a tower
/// with a lift that one rides, people on errands, doors that open as one nears, lamps and a radio.
#[derive(clap::Args)]
pub(crate) struct Demo {
    /// Folder to write `house.glb`, `world.glb` and `plan.svg` to; the demo ends with an error rather than overwrite
    /// other files of these names.
    #[arg(short, long, default_value = ".", value_name = "DIR")]
    output: PathBuf,
    /// Make the tower: `tower.glb` (the model), `world.glb`, `lift.glb` and `living.json`, which says what lives there.
    #[arg(long)]
    living: bool,
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
    let made = if args.living { tower()? } else { house()? };
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
    let mut hints = format!("\nwrote {}\n\nTry next:\n{}", names.join(", "), made.hints);
    for (i, name) in names.iter().enumerate() {
        hints = hints.replace(&format!("{{{i}}}"), name);
    }
    Ok(write_lines(&mut out, &hints)?)
}

/// Bakes the model of a generated scene as `bake` does: read from its file, in the file's order, with its names.
fn baked(generated: &Generated) -> anyhow::Result<(Vec<u8>, World, Vec<u8>)> {
    let model = export_glb(&generated.scene);
    let scene = decode_gltf(&model, &ImportOptions::default())?.scene;
    let baked = bake_scene(&scene, &BakeConfig::default(), None)?;
    let bytes = encode_glb(&baked.world).context("the baked world breaks an invariant (a bug)")?;
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
