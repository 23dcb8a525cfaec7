//! The bake itself, in the order of the command.

use enfilade_bake::bsp::find_leak;
use enfilade_bake::{BakeConfig, BakeContext, BakeError, BakeOutput, bake};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_geom::Instant;
use enfilade_geom::scene::{Role, Scene};
use enfilade_import::{HeldFiles, ImportReport, Imported, import_held};
use enfilade_report::{PlanOptions, Plans, Verdict, is_empty, measured_room_facts};

use crate::answer::{Facts, input_doubts, openings, questions, rooms, storeys};
use crate::{Answer, BakeRequest, Failure, Steps};

/// Bakes files: the world is that of the command, byte for byte, and so is the plan.
///
/// # Errors
///
/// If the files or the settings are refused, the bake ends early, or no room is found.
pub fn baked(
    files: &HeldFiles,
    request: &BakeRequest,
    steps: &Steps<'_>,
) -> Result<Answer, Failure> {
    let began = Instant::now();
    let (import, resolved) = request.resolve()?;
    steps.begin_reading();
    let read = import_held(files, &import);
    let read = read.map_err(|e| Failure::new("files", e.to_string()).asking(None))?;
    let Imported {
        mut scene, report, ..
    } = read;
    if let Some(why) = report.refusal() {
        return Err(Failure::new("refused", why).asking(Some(&report)));
    }
    scene.rooms.extend_from_slice(&resolved.names);
    let mut warnings: Vec<String> = report.left_out.iter().map(ToString::to_string).collect();
    let config = resolved.config_for(&scene);
    let leak = open_world(&scene, &config, request)?;
    scene.is_open_world |= leak.is_some();
    warnings.extend(leak);
    let mut config = resolved.config_for(&scene);
    config.budget.began = Some(began);
    let material = config.costs.cost.check(&scene.materials);
    material.map_err(|e| Failure::settings(&e.to_string()))?;
    steps.plan_for(&config);
    let mut context = BakeContext::new(steps, None);
    if let Some(probe) = request.probe {
        context = context.measured_by(probe);
    }
    let mut baked = bake(&scene, &config, &context).map_err(|e| of_bake(&e, &report))?;
    drop(scene);
    let told = &mut baked.world.graph.provenance.settings;
    told.extend(report.settings.clone());
    // Readers of its file get it rounded, and so do the plan and the facts.
    let defect = |e: String| {
        Failure::new(
            "defect",
            format!("the baked world breaks an invariant: {e}"),
        )
    };
    steps.begin_plan();
    baked.world.room_facts = Some(measured_room_facts(&baked.world));
    let bytes = encode_glb(&baked.world).map_err(|e| defect(e.to_string()))?;
    let world = decode_glb(&bytes).map_err(|e| defect(e.to_string()))?;
    let seconds = baked.times.iter().map(|(s, t)| (s.name(), t.as_secs_f64()));
    let seconds = seconds.collect();
    let BakeOutput { notes, method, .. } = baked;
    warnings.extend(notes);
    let verdict = Verdict::of(&world, &input_doubts(&report)).untried();
    if is_empty(&world) && !request.allow_empty {
        let text = format!("no room was found: {}", verdict.why());
        return Err(Failure::new("empty", text).asking(Some(&report)));
    }
    let triangles = world.graph.statistics.counts.get("input_triangles");
    let plans = Plans::new(&world, &PlanOptions::default());
    let all: Vec<usize> = (0..plans.storeys().len()).collect();
    let facts = Facts {
        text: verdict.to_string(),
        verdict: &verdict,
        warnings,
        questions: questions(&report),
        method: method.name(),
        triangles: triangles.copied().unwrap_or(0.0) as usize,
        rooms: rooms(&world, &plans),
        storeys: storeys(&plans),
        openings: openings(&world),
        seconds,
    };
    Ok(Answer {
        plan: plans.sheet(&all).to_svg(),
        facts: serde_json::to_string(&facts).map_err(|e| defect(e.to_string()))?,
        world: bytes,
    })
}

/// Returns the reason to read a map as a world open to the sky.
fn open_world(
    scene: &Scene,
    config: &BakeConfig,
    request: &BakeRequest,
) -> Result<Option<String>, Failure> {
    if scene.solids.is_empty() {
        return Ok(None);
    }
    if scene.objects.iter().all(|o| o.role == Role::Detail) {
        let text = "all brushes are detail, which bounds no rooms: name those that are walls in structural_names";
        return Err(Failure::new("leak", text));
    }
    let n_faces = scene.solids.iter().map(|s| s.faces.len()).sum();
    let allowance = config.budget.allowance(n_faces, request.probe);
    let leak = find_leak(scene, (&allowance).into());
    // An exhausted allowance makes the search incomplete; the bake then ends with its own error at once.
    match leak.filter(|_| !allowance.is_over()) {
        None => Ok(None),
        Some(_) if request.allow_leak => Ok(None),
        Some(leak) if leak.is_open_world() => Ok(Some(format!(
            "{}; it is read as an open world",
            leak.says(scene)
        ))),
        Some(leak) => Err(Failure::new(
            "leak",
            format!("{}; close the gap, or allow leaks", leak.says(scene)),
        )),
    }
}

fn of_bake(error: &BakeError, report: &ImportReport) -> Failure {
    let kind = match error {
        BakeError::TooMuchMemory { .. } => "memory",
        BakeError::Setting { .. } | BakeError::Material(_) => "settings",
        _ => "bake",
    };
    Failure::new(kind, error.to_string()).asking(Some(report))
}
