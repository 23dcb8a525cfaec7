//! The refusal of maps that leak, with what would close them.

use std::collections::BTreeSet;
use std::io::Write as _;

use anyhow::bail;
use enfilade::bake::BakeConfig;
use enfilade::geom::scene::{Role, Scene};
use enfilade::internals::bake::bsp::find_leak;
use enfilade_cli::input::{import_scene, is_stream};
use enfilade_cli::memory::held_memory;

use super::Bake;
use super::settings::{self, WorldName};
use crate::screen::Warned;
use enfilade::whole::write as write_whole;

/// Returns `true` for a map whose world is open to the sky. Ends the bake of one that has no wall, or whose inside is open to the
/// void through a gap, and reports the way out.
pub(super) fn is_open_world(
    args: &Bake,
    scene: &Scene,
    config: &BakeConfig,
) -> anyhow::Result<bool> {
    let options = &args.options;
    let classes = classes_of_detail(scene);
    if !classes.is_empty() && scene.objects.iter().all(|o| o.role == Role::Detail) {
        bail!(
            "all brushes are detail, which bounds no rooms, of the class {}; {} makes them structure",
            classes.join(", "),
            options_for(&classes)
        );
    }
    let n_faces = scene.solids.iter().map(|s| s.faces.len()).sum();
    let allowance = config.budget.allowance(n_faces, Some(held_memory));
    let leak = find_leak(scene, (&allowance).into());
    // An exhausted allowance makes the search incomplete; the bake then ends with its own error at once.
    let Some(leak) = leak.filter(|_| !allowance.is_over()) else {
        return Ok(options.world == WorldName::Open && !scene.solids.is_empty());
    };
    let lines: String = leak
        .points
        .iter()
        .map(|p| format!("{} {} {}\n", p.x, p.y, p.z))
        .collect();
    let mut way = String::new();
    if let Some(path) = &options.leak {
        write_whole(path, lines.as_bytes())?;
        way = format!("; the way is in {}", path.display());
    }
    let text = format!("{}{way}", leak.says(scene));
    if options.allow_leak {
        writeln!(Warned, "{text}")?;
        return Ok(options.world == WorldName::Open);
    }
    if let Some(cause) = walls_of_detail(args, scene, config) {
        bail!("{text}; {cause}");
    }
    let is_open = match options.world {
        WorldName::Auto => leak.is_open_world(),
        WorldName::Open => true,
        WorldName::Sealed => false,
    };
    let share = 100.0 * leak.open_floor;
    if is_open {
        writeln!(
            Warned,
            "{text}; {share:.0} % of its floor lies below the open sky: it is read as an open world, not as a sealed one (--world sealed)"
        )?;
        return Ok(true);
    }
    bail!(
        "{text}; {share:.0} % of its floor lies below the open sky: close the gap, write the way with --leak FILE.pts, go on with \
         --allow-leak, or with --world open if an engine draws the sky"
    )
}

/// Returns the classes of detail brushes that would close the map as structure, if some do, and the option: tried before it is
/// said.
fn walls_of_detail(args: &Bake, scene: &Scene, config: &BakeConfig) -> Option<String> {
    if args.inputs.iter().any(|p| is_stream(p)) {
        return None;
    }
    let import = settings::resolve(&args.options).ok()?.import;
    let closes = |classes: &[&str]| {
        let mut import = import.clone();
        let patterns = classes.iter().map(|class| format!("{class} *"));
        import.roles.structural.extend(patterns);
        let other = import_scene(&args.inputs, &args.options.detail, &import);
        let Ok(other) = other else {
            return false;
        };
        let n_faces = other.scene.solids.iter().map(|s| s.faces.len()).sum();
        let allowance = config.budget.allowance(n_faces, Some(held_memory));
        let leak = find_leak(&other.scene, (&allowance).into());
        leak.is_none() && !allowance.is_over()
    };
    let all = classes_of_detail(scene);
    // Only if all of them do can one alone.
    if all.is_empty() || !closes(&all) {
        return None;
    }
    let alone = all.iter().find(|&&class| closes(&[class]));
    let walls = alone.map_or(all.clone(), |&class| vec![class]);
    Some(format!(
        "its walls are detail, which closes nothing, of the class {}; {} makes them structure and closes the map",
        walls.join(", "),
        options_for(&walls)
    ))
}

/// Returns the classes of entities whose brushes are detail.
fn classes_of_detail(scene: &Scene) -> Vec<&str> {
    let detail = scene.objects.iter().filter(|o| o.role == Role::Detail);
    let classes = detail.filter_map(|o| o.reason.strip_prefix("map: brushes of "));
    classes.collect::<BTreeSet<_>>().into_iter().collect()
}

fn options_for(classes: &[&str]) -> String {
    let options = classes
        .iter()
        .map(|class| format!("--structural-name '{class} *'"));
    options.collect::<Vec<_>>().join(" ")
}
