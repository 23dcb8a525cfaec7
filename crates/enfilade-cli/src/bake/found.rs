//! Report on the scene before the work: files, role of each object, faults of the model.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write;

use anyhow::bail;
use enfilade::geom::scene::{Role, Scene};
use enfilade::geom::shown;
use enfilade::import::{CleaningOptions, ImportReport};
use enfilade::internals::import::cleaning_report;

use enfilade_report::InputDoubt;

use crate::screen::{At, Told, Warned, write_lines};

/// Reports what was read; with `verbose`, also the roles of the objects and all notes of the import.
pub(crate) fn report_import(
    scene: &Scene,
    report: &ImportReport,
    verbose: bool,
) -> anyhow::Result<()> {
    let mut err = Told;
    for file in &report.files {
        if let Some(surface) = &file.surface {
            let path = shown(file.path.display());
            if !surface.text.is_empty() {
                writeln!(err, "{path}: {}", surface.text)?;
            }
            let steps = match surface.step {
                Some(step) => format!(" in steps of {step:.3} m"),
                None => String::new(),
            };
            writeln!(
                err,
                "{path}: {}, a surface of {} triangles{steps}; it is at most {:.3} m from its source, and all promises hold \
                 for it",
                file.format, file.n_triangles, surface.distance
            )?;
        }
    }
    for left_out in &report.left_out {
        writeln!(err, "{left_out}")?;
    }
    if verbose {
        write_lines(&mut err, report)?;
        write_lines(&mut err, &roles(scene))?;
    }
    if let Some(hole) = report.put_back.examples.first() {
        writeln!(
            err,
            "missing triangles put back: {}, the largest at {} in '{}' (--put-back off leaves them out)",
            report.put_back.n,
            At(hole.position.to_array()),
            shown(&hole.name)
        )?;
    }
    let title = if let Some(repair) = &report.repair {
        writeln!(
            err,
            "repaired (leave out --repair to have the model as it was):"
        )?;
        write_lines(&mut err, repair)?;
        "remaining faults of the model"
    } else {
        match report.put_back.n {
            0 => "the model as found (nothing was changed)",
            _ => "remaining faults of the model",
        }
    };
    let cleaning = cleaning_report(scene, Some(report), &CleaningOptions::default())?;
    if cleaning.findings().iter().any(|(_, f)| f.n > 0) {
        writeln!(err, "{title}:")?;
        write_lines(&mut err, &cleaning)?;
    }
    if let Some(hole) = cleaning.holes.examples.first() {
        let (n, at) = (cleaning.holes.n, At(hole.position.to_array()));
        writeln!(
            Warned,
            "triangles are missing in {n} places, most at {at} in '{}': --repair-holes 10 fills holes of up to 10 m",
            hole.name
        )?;
    }
    Ok(())
}

/// Ends the bake if the files state neither unit nor axis, and their numbers speak against those that are assumed.
pub(crate) fn refuse(report: &ImportReport) -> anyhow::Result<()> {
    match report.refusal() {
        Some(why) => bail!("{why}"),
        None => Ok(()),
    }
}

/// Returns what seems to point up, if it is another axis and the evidence is weak.
pub(super) fn hint(report: &ImportReport) -> Option<String> {
    let unclear = report.up_doubt.as_ref().filter(|doubt| !doubt.is_clear);
    unclear.map(|doubt| doubt.text.clone())
}

/// Returns the doubts about unit and axis, for the verdict.
pub(super) fn input_doubts(report: &ImportReport) -> Vec<InputDoubt> {
    let up = report.up_doubt.as_ref().map(|doubt| &doubt.text);
    let doubt = |text: String| InputDoubt {
        is_about_up: Some(&text) == up,
        text,
    };
    report.doubts().into_iter().map(doubt).collect()
}

/// Most names listed for one reason.
const NAMES: usize = 3;
/// Most reasons of a role with a line.
const REASONS: usize = 30;

/// Objects that have a role for one reason.
struct Group<'a> {
    /// The reason of the first one.
    reason: &'a str,
    /// The numbers in the reason differ between objects.
    is_mixed: bool,
    n: usize,
    /// The first few distinct names.
    names: Vec<&'a str>,
    has_more_names: bool,
}

/// The objects by role and reason, a line each: their number and a few names. Largest groups first.
fn roles(scene: &Scene) -> String {
    let mut text = String::new();
    for (role, name) in [(Role::Structural, "structural"), (Role::Detail, "detail")] {
        let groups = groups(scene, role);
        for g in groups.iter().take(REASONS) {
            let masked = without_numbers(g.reason);
            let reason = if g.is_mixed { &masked } else { g.reason };
            let more = if g.has_more_names { ", …" } else { "" };
            let names = g.names.join(", ");
            let _ = writeln!(
                text,
                "{name:<10} {:>7}  {}",
                g.n,
                shown(format!("{reason}: {names}{more}"))
            );
        }
        let rest = groups.get(REASONS..).unwrap_or_default();
        if !rest.is_empty() {
            let n: usize = rest.iter().map(|g| g.n).sum();
            let _ = writeln!(text, "{name:<10} {n:>7}  for {} other reasons", rest.len());
        }
    }
    text
}

fn groups(scene: &Scene, role: Role) -> Vec<Group<'_>> {
    let mut groups: Vec<Group<'_>> = Vec::new();
    let mut by_reason: HashMap<String, usize> = HashMap::new();
    for o in scene.objects.iter().filter(|o| o.role == role) {
        let at = *by_reason
            .entry(without_numbers(&o.reason))
            .or_insert(groups.len());
        if at == groups.len() {
            groups.push(Group {
                reason: &o.reason,
                is_mixed: false,
                n: 0,
                names: Vec::new(),
                has_more_names: false,
            });
        }
        let g = &mut groups[at];
        g.n += 1;
        g.is_mixed |= g.reason != o.reason;
        if !g.names.contains(&o.name.as_str()) {
            if g.names.len() < NAMES {
                g.names.push(&o.name);
            } else {
                g.has_more_names = true;
            }
        }
    }
    // A stable sort: equal groups keep their order.
    groups.sort_by_key(|g| std::cmp::Reverse(g.n));
    groups
}

/// A reason with `…` for each number: common to objects of different size.
fn without_numbers(reason: &str) -> String {
    let mut out = String::new();
    let mut is_in_number = false;
    for c in reason.chars() {
        if c.is_ascii_digit() {
            if !is_in_number {
                out.push('…');
            }
            is_in_number = true;
        } else if c != '.' || !is_in_number {
            out.push(c);
            is_in_number = false;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::furnished_house;

    #[test]
    fn objects_are_told_by_role_and_reason_and_not_one_by_one() {
        let mut scene = furnished_house().scene;
        let first = scene.objects[0].clone();
        scene.objects.clear();
        for i in 0..1000 {
            let mut o = first.clone();
            o.role = [Role::Structural, Role::Detail][i % 2];
            o.name = format!("part {i}");
            o.reason = match i % 4 {
                0 => "name: 'wall'".into(),
                2 => "default".into(),
                _ => format!("fills an opening of 0.{i} m"),
            };
            scene.objects.push(o);
        }
        scene.objects[0].reason = "default".into();
        let text = roles(&scene);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines,
            [
                "structural     251  default: part 0, part 2, part 6, …",
                "structural     249  name: 'wall': part 4, part 8, part 12, …",
                "detail         500  fills an opening of … m: part 1, part 3, part 5, …",
            ]
        );
        // Each object has a reason of its own: the rest becomes one line, too.
        for (i, o) in scene.objects.iter_mut().enumerate() {
            o.role = Role::Detail;
            o.reason = format!("below '{}'", "x".repeat(i + 1));
            o.name = "one".into();
        }
        let text = roles(&scene);
        assert_eq!(text.lines().count(), REASONS + 1);
        assert!(
            text.ends_with("detail         970  for 970 other reasons\n"),
            "{text}"
        );
    }
}
