//! Kinds of portals, compared with the kinds of the openings that they match.
//!
//! Row `kinds named` bakes scenes as they are, `kinds unnamed` without names and materials. An unfilled hole is open, and so
//! is a doorway in a scene without a single leaf. Boundaries without a wall do not count.
//! Row `kinds classes` needs no truth: each object of class `IfcDoor` or `IfcWindow` that fills a portal determines its kind.

use std::path::{Path, PathBuf};

use enfilade::cpg::{DetailObject, Portal, PortalKind, World};
use enfilade::geom::{Aabb, DVec3};

use super::score::{Match, score_scene};
use crate::measure::file_name;
use crate::process::{
    bake_command, bake_file, generate, output_of, scenes_and, scenes_dir, target_dir,
};
use crate::rows::RowPrinter;

/// Least share of matched portals of the right kind.
const NAMED: f64 = 0.98;
/// … without names.
const UNNAMED: f64 = 0.93;

/// Files without a truth whose objects have classes.
const CLASSED: [&str; 2] = ["sports-hall.glb", "TallBuilding.ifc"];

pub(super) fn run(out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    let mut dirs = scenes_and(&["scenes2"]);
    dirs.retain(|d| d.join("truth.json").is_file() && out.chosen.has_scene(&file_name(d)));
    let folder = target_dir().join("stranger");
    for (row, is_named, least) in [
        ("kinds named", true, NAMED),
        ("kinds unnamed", false, UNNAMED),
    ] {
        if !out.chosen.has_row(row) {
            continue;
        }
        let mut all = Kinds::default();
        for dir in &dirs {
            let name = file_name(dir);
            let spoilt = folder.join("unnamed").join(&name);
            if !is_named {
                let from = dir.display().to_string();
                generate(&[&from, "--strip"], &spoilt)?;
            }
            let has_leaves = dir.join("detail.glb").is_file();
            let matches = score_scene(if is_named { dir } else { &spoilt }, None)?.matches;
            let kinds = Kinds::of(&matches, has_leaves);
            kinds.print(row, &name, None, out);
            all.add(kinds);
        }
        all.print(row, "all", Some(least), out);
    }
    if out.chosen.has_row("kinds classes") {
        classes(&dirs, &folder, out)?;
    }
    Ok(())
}

/// Portals with a known kind, and what is wrong with the others.
#[derive(Default)]
struct Kinds {
    n: usize,
    wrong: Vec<String>,
}

impl Kinds {
    fn of(matches: &[Match], has_leaves: bool) -> Self {
        let mut out = Self::default();
        for m in matches {
            let right: &[&str] = match m.kind.as_str() {
                "door" if has_leaves => &["door"],
                "door" | "opening" => &["open"],
                "window" => &["window"],
                _ => continue,
            };
            out.n += 1;
            if !right.contains(&m.portal_kind.as_str()) {
                let Match {
                    kind, name, portal, ..
                } = m;
                let said = &m.portal_kind;
                out.wrong
                    .push(format!("{kind} {name}: portal {portal} is {said}"));
            }
        }
        out
    }

    fn add(&mut self, other: Self) {
        self.n += other.n;
        self.wrong.extend(other.wrong);
    }

    /// Prints the share of the right ones, if there are any; only `all` has a bar, and no list.
    fn print(&self, row: &str, scene: &str, least: Option<f64>, out: &mut RowPrinter<'_>) {
        if self.n == 0 {
            return;
        }
        let share = (self.n - self.wrong.len()) as f64 / self.n as f64;
        let bar = least.map_or_else(String::new, |l| format!(">= {l}"));
        let note = match least {
            Some(_) => format!("{} of {} are wrong", self.wrong.len(), self.n),
            None => self.wrong.join("; "),
        };
        out.print(
            row,
            scene,
            Some(share),
            &bar,
            least.map(|l| share >= l),
            &note,
        );
    }
}

fn classes(dirs: &[PathBuf], folder: &Path, out: &mut RowPrinter<'_>) -> anyhow::Result<()> {
    let row = "kinds classes";
    std::fs::create_dir_all(folder)?;
    let world = folder.join("classes.glb");
    let foreign = scenes_dir().map(|d| d.join("foreign"));
    let foreign = foreign.iter().flat_map(|d| CLASSED.map(|f| d.join(f)));
    let foreign = foreign.filter(|f| f.is_file() && out.chosen.has_scene(&file_name(f)));
    let mut all = Kinds::default();
    for path in foreign.chain(dirs.iter().cloned()) {
        let name = file_name(&path);
        let mut command = if path.is_dir() {
            bake_command(&path, &world)
        } else {
            bake_file(&path, &[], &world)
        };
        if let Err(error) = output_of(&mut command, None) {
            let said = error.to_string();
            let first = said.lines().nth(1).unwrap_or_default();
            out.print(row, &name, None, "", None, first);
            continue;
        }
        let kinds = by_class(&enfilade::open(&world)?);
        kinds.print(row, &name, None, out);
        all.add(kinds);
    }
    all.print(row, "all", Some(NAMED), out);
    Ok(())
}

/// Compares each portal that an object of class `IfcDoor` or `IfcWindow` fills with this class.
fn by_class(world: &World) -> Kinds {
    let mut out = Kinds::default();
    let mut fillers: Vec<(&str, PortalKind, Aabb)> = Vec::new();
    for d in &world.details {
        let kind = match d.name.split('/').next() {
            Some("IfcDoor") => PortalKind::Door,
            Some("IfcWindow") => PortalKind::Window,
            _ => continue,
        };
        fillers.push((&d.name, kind, bounds_of(world, d)));
    }
    for (id, p) in world.graph.portals.iter().enumerate() {
        let own = outline_box(p);
        let of = |k: PortalKind| {
            let near = fillers.iter().filter(move |f| f.1 == k);
            near.map(|f| (share_within(&own, &f.2), f.0))
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .filter(|f| f.0 >= 0.6)
        };
        let (name, kind) = match (of(PortalKind::Door), of(PortalKind::Window)) {
            (Some(d), None) => (d.1, PortalKind::Door),
            (None, Some(w)) => (w.1, PortalKind::Window),
            _ => continue,
        };
        out.n += 1;
        if p.kind != kind {
            out.wrong
                .push(format!("{name}: portal {id} is {:?}", p.kind));
        }
    }
    out
}

/// Returns the share of a portal's bounding box, seen from its front, that lies within a filler's box in the same wall.
fn share_within(portal: &Aabb, filler: &Aabb) -> f64 {
    // As deep as a wall, and with a frame behind a rebate.
    let reach = filler.expanded(0.3);
    if !reach.overlaps(portal) {
        return 0.0;
    }
    let thin = 0.05;
    let (own, around) = (portal.expanded(thin), filler.expanded(thin));
    let deep = own.size().min_element();
    let common = own.max.min(around.max) - own.min.max(around.min);
    let shares: Vec<f64> = (0..3)
        .filter(|&k| own.size()[k] > deep)
        .map(|k| (common[k] / own.size()[k]).max(0.0))
        .collect();
    shares.iter().product()
}

fn outline_box(p: &Portal) -> Aabb {
    let points: Vec<DVec3> = p
        .outline
        .iter()
        .map(|c| DVec3::from(c.map(f64::from)))
        .collect();
    Aabb::of_points(&points)
}

fn bounds_of(world: &World, d: &DetailObject) -> Aabb {
    let placed = d.placement();
    let mesh = &world.detail_meshes[d.mesh as usize];
    let points = mesh.primitives.iter().flat_map(|p| &p.positions);
    points.fold(Aabb::EMPTY, |b, p| {
        b.including(placed.transform_point3(DVec3::from(p.map(f64::from))))
    })
}
