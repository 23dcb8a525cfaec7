//! `enfilade verify`: tests the promises of a world.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::cpg::{RoomFacts, World};
use enfilade::geom::scene::{Role, Scene, TriangleSource};
use enfilade::geom::{Triangle, shown};
use enfilade::runtime::{SeeOptions, Sight};
use enfilade_verify::{
    SourceDetail, VerifyOptions, ViewOptions, ViewReport, check_drawn, compare_details,
    compare_scene, other_scene, verify_evidence, verify_views, verify_world_with_progress,
};

use crate::bake::settings::{SceneOptions, bound};
use crate::exact::ViewComparison;
use crate::limits::Limits;
use crate::output::Outputs;
use crate::progress::StageBar;
use crate::pvs::read_graph;
use crate::screen::{print_json, printed, printed_at_once, write_lines};
use enfilade_cli::answers::Answers;
use enfilade_cli::input::{import_scene, name_of, read};
use enfilade_cli::world::read_world_checked;
use enfilade_report::measured_room_facts;

/// Tests the promises of a world with random sight lines; exits with 1 if one is broken.
#[derive(clap::Args)]
pub(crate) struct Verify {
    /// World written by `enfilade bake`; with --evidence, a Quake portal file too; `-` for standard input.
    world: PathBuf,
    /// Check this evidence, written by `enfilade pvs --evidence`, instead of the promises.
    #[arg(long, value_name = "FILE")]
    evidence: Option<PathBuf>,
    /// Scene that the world was baked from: its structural triangles, not those in the world, then block sight, and
    /// its details must be where the world has them. It is read with the settings below; give those of the bake.
    #[arg(long, num_args = 1.., value_name = "IN")]
    source: Vec<PathBuf>,
    /// Files of the source whose objects are all detail, as in the bake.
    #[arg(long, value_name = "FILE", requires = "source")]
    detail: Vec<PathBuf>,
    #[command(flatten)]
    scene: SceneOptions,
    /// Segments for `sealed`, and as many rays for `complete`.
    #[arg(long, default_value_t = 1_000_000, value_name = "N")]
    rays: u64,
    /// Views for *conservative per frame*, with 100 rays in each: the run-time's answer must contain all that they
    /// hit. 0: none.
    #[arg(long, default_value_t = 10_000, value_name = "N")]
    sight: u64,
    #[command(flatten)]
    drawn: ViewComparison,
    /// Start of the random sequences; equal seeds give equal reports.
    #[arg(long, default_value_t = 1, value_name = "S")]
    seed: u64,
    /// Distance up to which planes may be snapped and vertices rounded, in meters; from the size of the scene if not
    /// given.
    #[arg(long, value_name = "METERS", value_parser = positive)]
    tolerance: Option<f64>,
    /// Most kinds of failure listed.
    #[arg(long, default_value_t = 20, value_name = "N")]
    list: usize,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

pub(crate) fn run(args: &Verify) -> anyhow::Result<()> {
    args.limits.begin()?;
    let inputs = [&args.world].into_iter().chain(&args.evidence);
    let inputs = inputs.chain(&args.source).chain(&args.detail);
    let mut outputs = Outputs::reading(inputs.chain(&args.scene.config))?;
    if let Some(evidence) = &args.evidence {
        return verify_visibility(args, evidence);
    }
    args.drawn.make_folder()?;
    let (world, file) = read_world_checked(&args.world)?;
    let source = (!args.source.is_empty())
        .then(|| read_source(args, &mut outputs))
        .transpose()?;
    let structure = source.as_ref().map(structure_of);
    let options = VerifyOptions {
        rays: args.rays,
        seed: args.seed,
        tolerance: args.tolerance,
        max_listed: args.list,
    };
    refuse_other(args, &world, structure.as_deref(), &options)?;
    let bar = StageBar::new();
    bar.start("shooting rays", args.rays.saturating_mul(2));
    let mut report =
        verify_world_with_progress(&world, structure.as_deref(), &options, &|done, _| {
            bar.set(done);
        });
    bar.finish();
    report
        .problems
        .extend(problems_of_file(&world, &file, source.as_ref()));
    let sight = (args.sight > 0)
        .then(|| verify_sight(args, &world))
        .transpose()?;
    let exact = args
        .drawn
        .compare(&world, args.seed, args.list, &mut outputs)
        .with_context(|| name_of(&args.world))?;
    let mut out = printed_at_once();
    if args.json {
        let mut value = serde_json::to_value(&report)?;
        if let Some(sight) = &sight {
            value["sight"] = serde_json::to_value(sight)?;
        }
        if let Some(exact) = &exact {
            value["exact"] = serde_json::to_value(exact)?;
        }
        print_json(out, &value)?;
    } else {
        write_lines(&mut out, &report)?;
        if let Some(sight) = &sight {
            write_lines(&mut out, sight)?;
        }
        if let Some(exact) = &exact {
            write_lines(&mut out, exact)?;
        }
        out.flush().context("cannot write to standard output")?;
    }
    if !report.holds() {
        bail!(
            "{} breaks a promise: {} segments not sealed, {} triangles not listed, {} hidden things seen, {} problems",
            name_of(&args.world),
            report.unsealed,
            report.incomplete,
            report.hidden,
            report.problems.len()
        );
    }
    if let Some(sight) = sight.filter(|s| !s.holds()) {
        bail!(
            "{} is not seen whole: {} of {} hits are missing from the answers",
            name_of(&args.world),
            sight.missed,
            sight.hits
        );
    }
    if let Some(exact) = exact.filter(|e| e.differing() > 0) {
        bail!(
            "{} is not drawn whole: {} pixels differ from pictures without culling",
            name_of(&args.world),
            exact.differing()
        );
    }
    Ok(())
}

/// Ends if the source is another scene: nothing that differs from it is then worth a number.
fn refuse_other(
    args: &Verify,
    world: &World,
    structure: Option<&[Triangle]>,
    options: &VerifyOptions,
) -> anyhow::Result<()> {
    let problem = structure.and_then(|structure| other_scene(world, structure, options));
    if let Some(problem) = problem {
        bail!("{} was not compared: {problem}", name_of(&args.world));
    }
    Ok(())
}

/// Queries the run-time for random views, and casts rays in them.
fn verify_sight(args: &Verify, world: &World) -> anyhow::Result<ViewReport> {
    let sight = Sight::build(world).with_context(|| name_of(&args.world))?;
    let answers = Answers::new(world, &sight);
    let options = ViewOptions {
        views: args.sight,
        seed: args.seed,
        tolerance: args.tolerance,
        ..ViewOptions::default()
    };
    let bar = StageBar::new();
    bar.start("casting rays in views", args.sight);
    let seer = || answers.seer(Some(SeeOptions::default()));
    let report = verify_views(world, &options, &seer, &|done, _| bar.set(done));
    bar.finish();
    Ok(report)
}

/// Checks every claim of the evidence about visibility.
fn verify_visibility(args: &Verify, evidence: &Path) -> anyhow::Result<()> {
    let (graph, walls) = read_graph(&args.world)?;
    let bytes = read(evidence)?;
    let report = verify_evidence(&graph, &bytes, walls.as_deref())
        .with_context(|| format!("{} is not accepted", name_of(evidence)))?;
    let mut out = printed();
    if args.json {
        let value = serde_json::json!({
            "visible_pairs": report.n_visible,
            "proved_pairs": report.n_proved,
            "undecided_pairs": report.n_visible - report.n_proved,
            "hidden_pairs": report.n_hidden,
            "walled_openings": report.n_walled,
            "lines": report.n_lines,
            "trace_bytes": report.n_trace,
            "clearance": report.clearance,
            "far": report.far.is_finite().then_some(report.far),
        });
        print_json(out, &value)?;
    } else {
        let share = 100.0 * report.n_proved as f64 / report.n_visible.max(1) as f64;
        writeln!(
            out,
            "every claim holds: {} pairs proved visible by {} lines ({share:.2} % of those called visible), \
             {} proved hidden, {} undecided and called visible",
            report.n_proved,
            report.n_lines,
            report.n_hidden,
            report.n_visible - report.n_proved
        )?;
        if report.far.is_finite() {
            writeln!(
                out,
                "within {} m: all that is farther counts as hidden",
                report.far
            )?;
        }
    }
    Ok(())
}

fn read_source(args: &Verify, outputs: &mut Outputs) -> anyhow::Result<Scene> {
    let mut options = args.scene.resolve()?;
    bound(
        &mut options,
        args.limits.max_time(),
        args.limits.max_memory(),
    );
    let imported = import_scene(&args.source, &args.detail, &options)?;
    outputs.read(&imported.report.references)?;
    Ok(imported.scene)
}

/// The structural triangles of a scene, as the builder read them.
fn structure_of(scene: &Scene) -> Vec<Triangle> {
    scene
        .triangle_sources(Role::Structural)
        .map(|source| scene.world_triangle(source))
        .collect()
}

/// Problems if viewers draw something else than the world, or it does not have all that came with the scene.
fn problems_of_file(world: &World, file: &[u8], scene: Option<&Scene>) -> Vec<String> {
    let mut problems = check_drawn(file);
    problems.extend(fact_problems(world));
    if let Some(scene) = scene {
        problems.extend(detail_problems(world, scene));
        problems.extend(compare_scene(world, scene));
    }
    problems
}

/// Largest difference of stored facts from those measured of the file, whose numbers are rounded. [Units: wu, wu²]
const FACTS: f64 = 0.01;

/// Problems if the facts of rooms are not those of its walls.
fn fact_problems(world: &World) -> Vec<String> {
    let Some(facts) = &world.room_facts else {
        return Vec::new();
    };
    let measured = measured_room_facts(world);
    let pairs = facts.iter().zip(&measured);
    let wrong = pairs.filter(|(own, found)| {
        let all = |f: &RoomFacts| [f.floor_area, f.area_above_1_5, f.area_above_2_3, f.height];
        let mut both = all(own).into_iter().zip(all(found));
        own.storeys != found.storeys || both.any(|(a, b)| (a - b).abs() > FACTS)
    });
    let told = wrong.map(|(own, found)| {
        let words = |f: &RoomFacts| {
            format!(
                "storey {}, {:.2} m² ({:.2} above 1.5 m, {:.2} above 2.3 m), {:.2} m high",
                f.storeys.join(" "),
                f.floor_area,
                f.area_above_1_5,
                f.area_above_2_3,
                f.height
            )
        };
        let name = shown(&world.graph[own.cell].name);
        format!(
            "the facts of {name} are {}; its walls make {}",
            words(own),
            words(found)
        )
    });
    told.collect()
}

/// Problems if the world's details are not those of the scene.
fn detail_problems(world: &World, scene: &Scene) -> Vec<String> {
    let numbers = 0..scene.objects.len() as u32;
    let role = |&i: &u32| scene.objects[i as usize].role;
    let ids: Vec<u32> = numbers.filter(|i| role(i) == Role::Detail).collect();
    compare_details(world, ids.len(), |i| SourceDetail {
        name: scene.objects[ids[i] as usize].name.clone(),
        source: scene.objects[ids[i] as usize].node,
        triangles: triangles_of_object(scene, ids[i]).collect(),
    })
}

fn triangles_of_object(scene: &Scene, object: u32) -> impl Iterator<Item = Triangle> {
    let mesh = &scene.meshes[scene.objects[object as usize].mesh as usize];
    let primitives = mesh.primitives.iter().zip(0..);
    primitives.flat_map(move |(primitive, number)| {
        let triangles = 0..primitive.indices.len() as u32 / 3;
        triangles.map(move |triangle| {
            scene.world_triangle(TriangleSource {
                object,
                primitive: number,
                triangle,
            })
        })
    })
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("a number of meters greater than 0 is needed, e.g. 1e-4".into()),
    }
}
