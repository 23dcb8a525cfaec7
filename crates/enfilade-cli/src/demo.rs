//! `enfilade demo`: a house of our own, baked.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::Context;
use enfilade::bake::BakeConfig;
use enfilade::cpg::wire::encode_glb;
use enfilade::import::{export_glb, sort_scene};
use enfilade_report::{PlanOptions, plan_svg};
use enfilade_testkit::furnished_house;

use crate::bake::{Summary, bake_scene, print_summary};
use crate::formats::Format;
use crate::output::{Outputs, make_folder, print_json, write_whole};

/// Makes a furnished two-storey house, bakes it, draws its plan and says what to try next.
#[derive(clap::Args)]
pub(crate) struct Demo {
    /// Folder to write `house.glb`, `world.glb` and `plan.svg` to.
    #[arg(short, long, default_value = ".", value_name = "DIR")]
    output: PathBuf,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(serde::Serialize)]
struct DemoReport {
    files: [PathBuf; 3],
    #[serde(flatten)]
    summary: Summary,
}

pub(crate) fn run(args: &Demo) -> anyhow::Result<()> {
    let mut scene = furnished_house().scene;
    // As it is when the file is read, by `verify` for one.
    sort_scene(&mut scene);
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
    write_whole(&path("house.glb"), &export_glb(&scene))?;
    let baked = bake_scene(&scene, &BakeConfig::default(), None)?;
    let bytes = encode_glb(&baked.world).context("the baked world breaks an invariant (a bug)")?;
    write_whole(&path("world.glb"), &bytes)?;
    let plan = plan_svg(&baked.world, &PlanOptions::default());
    write_whole(&path("plan.svg"), plan.as_bytes())?;
    let mut out = io::stdout().lock();
    if args.json {
        let report = DemoReport {
            files: ["house.glb", "world.glb", "plan.svg"].map(path),
            summary: Summary::of(&baked.world),
        };
        return print_json(out, &report);
    }
    print_summary(&mut out, &baked.world)?;
    let (house, world, plan) = (path("house.glb"), path("world.glb"), path("plan.svg"));
    let (house, world, plan) = (house.display(), world.display(), plan.display());
    writeln!(
        out,
        "\nwrote {house}, {world}, {plan}\n\nTry next:\n  \
         enfilade inspect {world}\n  \
         echo '2 1 2' | enfilade locate {world}\n  \
         enfilade verify {world} --source {house}\n  \
         enfilade view {world}\n  \
         enfilade bake YOUR.glb -o your-world.glb\n\
         and open {plan} in a browser, {world} in any glTF viewer."
    )?;
    Ok(())
}
