//! `enfilade demo`: bakes a house made in code.

use std::path::PathBuf;

use anyhow::Context;
use enfilade::bake::BakeConfig;
use enfilade::cpg::wire::encode_glb;
use enfilade::geom::shown;
use enfilade::import::{ImportOptions, decode_gltf, export_glb};
use enfilade_report::{PlanOptions, plan_svg};
use enfilade_testkit::furnished_house;

use crate::bake::{Summary, bake_scene, print_summary};
use crate::formats::Format;
use crate::output::{Outputs, make_folder, write_unnamed};
use crate::screen::{print_json, printed, write_lines};

/// Makes a furnished two-storey house, bakes it, draws its plan and suggests what to try next.
#[derive(clap::Args)]
pub(crate) struct Demo {
    /// Folder to write `house.glb`, `world.glb` and `plan.svg` to; the demo ends with an error rather than overwrite
    /// other files of these names.
    #[arg(short, long, default_value = ".", value_name = "DIR")]
    output: PathBuf,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// The output of `--json`.
#[derive(serde::Serialize)]
struct DemoReport {
    /// As text: JSON cannot hold other names.
    files: [String; 3],
    #[serde(flatten)]
    summary: Summary,
}

pub(crate) fn run(args: &Demo) -> anyhow::Result<()> {
    let house = export_glb(&furnished_house().scene);
    // Read as `bake` does: in the file's order, with its names.
    let scene = decode_gltf(&house, &ImportOptions::default())?.scene;
    make_folder("-o", &args.output)?;
    let path = |name: &str| args.output.join(name);
    let mut outputs = Outputs::default();
    for (name, format) in [
        ("house.glb", Format::World),
        ("world.glb", Format::World),
        ("plan.svg", Format::Plan),
    ] {
        outputs.write("-o", format, &path(name))?;
    }
    let baked = bake_scene(&scene, &BakeConfig::default(), None)?;
    let bytes = encode_glb(&baked.world).context("the baked world breaks an invariant (a bug)")?;
    let plan = plan_svg(&baked.world, &PlanOptions::default());
    let files = [
        (path("house.glb"), house),
        (path("world.glb"), bytes),
        (path("plan.svg"), plan.into_bytes()),
    ];
    write_unnamed("-o", &files, |_, _| false)?;
    let mut out = printed();
    if args.json {
        let report = DemoReport {
            files: files.map(|(path, _)| path.display().to_string()),
            summary: Summary::of(&baked.world),
        };
        return print_json(out, &report);
    }
    print_summary(&mut out, &baked.world)?;
    let [house, world, plan] = files.map(|(path, _)| shown(path.display()).to_string());
    let hints = format!(
        "\nwrote {house}, {world}, {plan}\n\nTry next:\n  \
         enfilade inspect {world}\n  \
         echo '2 1 2' | enfilade locate {world}\n  \
         enfilade verify {world} --source {house}\n  \
         enfilade view {world}\n  \
         enfilade bake YOUR.glb -o your-world.glb\n\
         and open {plan} in a browser, {world} in any glTF viewer."
    );
    Ok(write_lines(&mut out, &hints)?)
}
