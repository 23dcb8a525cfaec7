//! Score: rooms, doors and windows found, compared with those that architects modeled.
//!
//! A scene folder with a `truth.json` is baked with default settings and queried through `inspect --json` and
//! `locate`, as a user would. `docs/benchmarks/rooms.md` defines the figures.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, bail};
use serde_json::Value;

use super::floors::{self, COLUMNS};
use crate::measure::file_name;
use crate::process::{bake_command, binary, output_of, scenes, target_dir, write_between_marks};
use crate::table::Table;

pub(crate) type V3 = [f64; 3];

pub(crate) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
pub(crate) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
pub(crate) fn unit(a: V3) -> V3 {
    a.map(|x| x / dot(a, a).sqrt())
}
pub(crate) fn along(a: V3, d: V3, t: f64) -> V3 {
    [a[0] + d[0] * t, a[1] + d[1] * t, a[2] + d[2] * t]
}

pub(crate) fn vec3(v: &Value) -> Option<V3> {
    let a = v.as_array()?;
    Some([
        a.first()?.as_f64()?,
        a.get(1)?.as_f64()?,
        a.get(2)?.as_f64()?,
    ])
}

/// Returns centroid and area of a convex polygon.
pub(crate) fn center_and_area(points: &[V3]) -> (V3, f64) {
    let (mut center, mut area) = ([0.0; 3], 0.0);
    for i in 1..points.len().saturating_sub(1) {
        let n = cross(sub(points[i], points[0]), sub(points[i + 1], points[0]));
        let a = dot(n, n).sqrt() / 2.0;
        area += a;
        for k in 0..3 {
            center[k] += a * (points[0][k] + points[i][k] + points[i + 1][k]) / 3.0;
        }
    }
    if area == 0.0 {
        (points[0], 0.0)
    } else {
        (center.map(|c| c / area), area)
    }
}

/// The volume from which a cell of kind room that holds no room of the truth counts. [Units: wu³]
const SPARE: f64 = 1.0;

/// Largest difference of a floor area that is right, as a share of the architect's.
const AREA: f64 = 0.03;

/// One row of the table; `None` if a scene has nothing of the kind.
pub(crate) struct Score {
    pub(crate) name: String,
    pub(crate) n_rooms: usize,
    /// Usable doors and windows of the truth.
    pub(crate) n_doors: usize,
    pub(crate) n_windows: usize,
    /// Cells of the world, outdoors included.
    pub(crate) n_cells: usize,
    /// In the order of [`COLUMNS`].
    pub(crate) figures: [Option<f64>; 7],
    /// Indoor rooms of the world larger than [`SPARE`] that hold no point of a room, per room.
    pub(crate) spare: Option<f64>,
    /// Portals of kind crack.
    pub(crate) n_cracks: usize,
    seconds: f64,
    pub(crate) failed: Vec<String>,
    /// Openings of the truth with the portals that match them.
    pub(crate) matches: Vec<Match>,
}

/// Scores `dirs`, or all real scenes if that is empty; prints the table and the misses in each scene, and writes the
/// table to `docs/benchmarks/rooms.md` if `is_written`. With `baked`, the folder of worlds baked before, bakes none.
/// Fails if a figure lies below its floor.
pub(crate) fn bench_score(
    out: &mut Table,
    dirs: &[PathBuf],
    baked: Option<&Path>,
    is_written: bool,
) -> anyhow::Result<()> {
    let mut dirs = if dirs.is_empty() {
        scenes()
    } else {
        dirs.to_vec()
    };
    dirs.retain(|d| d.join("truth.json").is_file());
    if dirs.is_empty() {
        bail!("no scene with a truth.json; name folders, or set ENFILADE_SCENES");
    }
    let rows = dirs
        .iter()
        .map(|d| score_scene(d, baked).with_context(|| d.display().to_string()))
        .collect::<anyhow::Result<Vec<_>>>()?;
    // Worlds baked before have no time of a bake.
    out.push_text(&table(&rows, baked.is_none()));
    out.push(String::new());
    for row in rows.iter().filter(|row| !row.failed.is_empty()) {
        out.push(format!("{}: {}", row.name, row.failed.join("; ")));
    }
    if is_written {
        // Without seconds: they depend more on the machine than on the program.
        write_between_marks("rooms.md", &table(&rows, false))?;
    }
    let figures = rows.iter().map(|row| (row.name.as_str(), row.figures));
    floors::check(out, figures)
}

/// Returns the table in Markdown; the last row is the average over the scenes that have a figure.
fn table(rows: &[Score], with_seconds: bool) -> String {
    let show = |f: Option<f64>| f.map_or_else(|| "–".to_owned(), |f| format!("{f:.2}"));
    let seconds = |text: String| {
        if with_seconds {
            format!(" {text} |")
        } else {
            String::new()
        }
    };
    let mut out = format!(
        "| scene | n | {} |{}\n| --- |{}{}\n",
        COLUMNS.join(" | "),
        seconds("seconds".into()),
        " ---: |".repeat(1 + COLUMNS.len()),
        seconds("---:".into()),
    );
    for r in rows {
        let figures: Vec<String> = r.figures.iter().map(|&f| show(f)).collect();
        let _ = writeln!(
            out,
            "| {} | {} | {} |{}",
            r.name,
            r.n_rooms,
            figures.join(" | "),
            seconds(format!("{:.2}", r.seconds))
        );
    }
    let mean = |k: usize| {
        let known: Vec<f64> = rows.iter().filter_map(|r| r.figures[k]).collect();
        show((!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64))
    };
    let means: Vec<String> = (0..COLUMNS.len()).map(mean).collect();
    let total = rows.iter().map(|r| r.seconds).sum::<f64>();
    let _ = writeln!(
        out,
        "| **average** | | {} |{}",
        means.join(" | "),
        seconds(format!("{:.2}", total / rows.len() as f64))
    );
    out
}

/// Returns the cell of each point, `-` for none.
pub(crate) fn locate(world: &Path, points: &[V3]) -> anyhow::Result<Vec<String>> {
    let text: String = points
        .iter()
        .map(|p| format!("{} {} {}\n", p[0], p[1], p[2]))
        .collect();
    let said = output_of(
        Command::new(binary("enfilade")).arg("locate").arg(world),
        Some(&text),
    )?;
    let lines: Vec<String> = said.split_whitespace().map(str::to_owned).collect();
    if lines.len() != points.len() {
        bail!(
            "locate printed {} answers for {} points",
            lines.len(),
            points.len()
        );
    }
    Ok(lines)
}

pub(crate) fn text(v: &Value) -> String {
    v.as_str().map_or_else(|| v.to_string(), str::to_owned)
}

/// Returns groups of rooms joined by boundaries without a wall: separating those is optional.
fn groups(rooms: &[Value], openings: &[Value]) -> BTreeMap<String, String> {
    let mut group: BTreeMap<String, String> = rooms
        .iter()
        .map(|r| (text(&r["id"]), text(&r["id"])))
        .collect();
    for o in openings.iter().filter(|o| o["kind"] == "virtual") {
        let (a, b) = (text(&o["rooms"][0]), text(&o["rooms"][1]));
        if let (Some(from), Some(to)) = (group.get(&a).cloned(), group.get(&b).cloned()) {
            group
                .values_mut()
                .filter(|g| **g == from)
                .for_each(|g| g.clone_from(&to));
        }
    }
    group
}

/// Bakes and scores a scene, or scores the world in the folder `baked`.
pub(crate) fn score_scene(dir: &Path, baked: Option<&Path>) -> anyhow::Result<Score> {
    let name = file_name(dir);
    let world = match baked {
        Some(folder) => folder.join(format!("{name}.glb")),
        None => target_dir().join(format!("score-{name}.glb")),
    };
    let start = Instant::now();
    if baked.is_none() {
        output_of(&mut bake_command(dir, &world), None)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let score = score_world(dir, &world, &inspect(&world)?)?;
    Ok(Score { seconds, ..score })
}

/// Returns the output of `inspect --json`.
pub(crate) fn inspect(world: &Path) -> anyhow::Result<Value> {
    let mut command = Command::new(binary("enfilade"));
    command.arg("inspect").arg(world).arg("--json");
    Ok(serde_json::from_str(&output_of(&mut command, None)?)?)
}

/// Scores a world, given its output of `inspect`, against the truth in its scene's folder.
pub(crate) fn score_world(dir: &Path, world: &Path, graph: &Value) -> anyhow::Result<Score> {
    let name = file_name(dir);
    let truth: Value = serde_json::from_str(&std::fs::read_to_string(dir.join("truth.json"))?)
        .with_context(|| format!("{name}/truth.json"))?;
    let (rooms, openings) = (list(&truth["rooms"]), list(&truth["openings"]));
    let locate = |points: &[V3]| locate(world, points);
    let mut failed = Vec::new();

    let samples = Samples::of(rooms, openings, &locate)?;
    let n_good = samples.n_whole_and_alone(rooms, &mut failed);
    let portals = portals_of(graph);
    let found = find_openings(openings, &portals, &locate, &mut failed)?;
    let outdoor: BTreeSet<String> = list(&graph["cells"])
        .iter()
        .filter(|c| c["outdoor"] == true)
        .map(|c| c["id"].to_string())
        .collect();
    let extra = portals
        .iter()
        .filter(|p| p.cells.is_disjoint(&outdoor) && !found.used.contains(&p.id))
        .count();
    let n = rooms.len();
    let per_n = |x: usize| (n > 0).then(|| x as f64 / n as f64);
    Ok(Score {
        name,
        n_rooms: n,
        n_doors: found.n_tried("door"),
        n_windows: found.n_tried("window"),
        n_cells: list(&graph["cells"]).len(),
        figures: [
            per_n(n_good),
            found.share("door"),
            found.share("window"),
            per_n(samples.n_cells),
            per_n(extra),
            pair_mcc(&samples.rooms, &samples.groups, &samples.cells),
            samples.areas(rooms, list(&graph["cells"]), &mut failed),
        ],
        spare: per_n(samples.n_spare(list(&graph["cells"]))),
        n_cracks: portals.iter().filter(|p| p.kind == "crack").count(),
        seconds: f64::NAN,
        failed,
        matches: found.matches,
    })
}

/// Returns the elements of an array; none of anything else.
pub(crate) fn list(v: &Value) -> &[Value] {
    v.as_array().map_or(&[], Vec::as_slice)
}

/// Points in rooms; each list has one entry per point.
struct Samples {
    rooms: Vec<String>,
    /// The group of the room.
    groups: Vec<String>,
    /// The cell found; a point outside of all cells gets a cell of its own.
    cells: Vec<String>,
    /// Number of cells that contain points.
    n_cells: usize,
}

impl Samples {
    fn of(
        rooms: &[Value],
        openings: &[Value],
        locate: &impl Fn(&[V3]) -> anyhow::Result<Vec<String>>,
    ) -> anyhow::Result<Self> {
        let (mut points, mut owners) = (Vec::new(), Vec::new());
        for r in rooms {
            for p in list(&r["sample_points"]).iter().filter_map(vec3) {
                points.push(p);
                owners.push(text(&r["id"]));
            }
        }
        let located = locate(&points)?;
        let with_points: BTreeSet<&String> = located.iter().filter(|c| *c != "-").collect();
        let group = groups(rooms, openings);
        let cell = |(i, c): (usize, &String)| match c.as_str() {
            "-" => format!("none{i}"),
            cell => cell.to_owned(),
        };
        Ok(Self {
            groups: owners.iter().map(|o| group[o].clone()).collect(),
            rooms: owners,
            n_cells: with_points.len(),
            cells: located.iter().enumerate().map(cell).collect(),
        })
    }

    /// Counts indoor rooms of the world that hold no point. A cell without a kind is a room, one without a volume large.
    fn n_spare(&self, cells: &[Value]) -> usize {
        let held: BTreeSet<&str> = self.cells.iter().map(String::as_str).collect();
        let is_spare = |c: &&Value| {
            let is_room = c["kind"].as_str().is_none_or(|kind| kind == "room");
            let is_large = c["volume"].as_f64().is_none_or(|v| v > SPARE);
            c["outdoor"] != true && is_room && is_large && !held.contains(&*c["id"].to_string())
        };
        cells.iter().filter(is_spare).count()
    }

    /// Returns the share of rooms whose cell has their floor area within [`AREA`]; where several are one cell, their sum. Rooms of
    /// which the truth has no area do not count; those in no cell do.
    fn areas(&self, rooms: &[Value], cells: &[Value], failed: &mut Vec<String>) -> Option<f64> {
        let mut of_cell = BTreeMap::<&str, (f64, usize, Vec<String>)>::new();
        let mut points = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
        for (room, cell) in self.rooms.iter().zip(&self.cells) {
            *points.entry(room).or_default().entry(cell).or_default() += 1;
        }
        for room in rooms {
            let Some(area) = room["floor_area"].as_f64().filter(|a| *a > 0.0) else {
                continue;
            };
            let counts = points.get(text(&room["id"]).as_str());
            let most = counts.and_then(|c| c.iter().max_by_key(|c| c.1));
            let entry = of_cell.entry(most.map_or("-", |m| m.0)).or_default();
            entry.0 += area;
            entry.1 += 1;
            entry.2.push(text(&room["name"]));
        }
        let (mut n_right, mut n) = (0, 0);
        for (id, (area, n_rooms, names)) in of_cell {
            let cell = cells.iter().find(|c| id.parse().ok() == c["id"].as_u64());
            let found = cell.and_then(|c| c["floor_area"].as_f64());
            n += n_rooms;
            if found.is_some_and(|found| (found / area - 1.0).abs() <= AREA) {
                n_right += n_rooms;
            } else {
                let found = found.map_or("none".to_owned(), |found| format!("{found:.2}"));
                failed.push(format!(
                    "area of {}: {found} of {area:.2} m²",
                    names.join(" and ")
                ));
            }
        }
        (n > 0).then(|| n_right as f64 / n as f64)
    }

    /// Counts rooms with nearly all points in one cell that has hardly any points of other groups.
    fn n_whole_and_alone(&self, rooms: &[Value], failed: &mut Vec<String>) -> usize {
        let mut per_room = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
        let mut per_cell = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
        let mut group_of = BTreeMap::<&str, &str>::new();
        for (i, (room, cell)) in self.rooms.iter().zip(&self.cells).enumerate() {
            let group = &self.groups[i];
            *per_room.entry(room).or_default().entry(cell).or_default() += 1;
            *per_cell.entry(cell).or_default().entry(group).or_default() += 1;
            group_of.insert(room, group);
        }
        let mut n_good = 0;
        for r in rooms {
            let id = text(&r["id"]);
            let Some(counts) = per_room.get(id.as_str()) else {
                continue;
            };
            let Some((cell, n)) = counts.iter().max_by_key(|c| c.1) else {
                continue;
            };
            let whole = *n as f64 >= 0.95 * counts.values().sum::<usize>() as f64;
            let inside = &per_cell[cell];
            let own = inside.get(group_of[id.as_str()]).copied().unwrap_or(0);
            let alone = own as f64 >= 0.95 * inside.values().sum::<usize>() as f64;
            if whole && alone {
                n_good += 1;
            } else {
                let why = if whole { "shares its cell" } else { "is split" };
                failed.push(format!("room {} {why}", text(&r["name"])));
            }
        }
        n_good
    }
}

/// A portal of the world.
struct Portal {
    id: u64,
    kind: String,
    center: V3,
    area: f64,
    normal: V3,
    cells: BTreeSet<String>,
}

fn portals_of(graph: &Value) -> Vec<Portal> {
    let portal = |p: &Value| {
        let outline: Vec<V3> = list(&p["outline"]).iter().filter_map(vec3).collect();
        let (center, area) = center_and_area(&outline);
        Some(Portal {
            id: p["id"].as_u64()?,
            kind: text(&p["kind"]),
            center,
            area,
            normal: unit(vec3(&p["normal"])?),
            cells: list(&p["cells"]).iter().map(ToString::to_string).collect(),
        })
    };
    list(&graph["portals"]).iter().filter_map(portal).collect()
}

/// The place of an opening of the truth.
struct OpeningPlace {
    center: V3,
    normal: V3,
    thickness: f64,
    area: f64,
}

impl OpeningPlace {
    fn of(opening: &Value) -> Option<Self> {
        let corners = list(&opening["corners"]);
        let corners: Vec<V3> = corners.iter().filter_map(vec3).collect();
        Some(Self {
            center: vec3(&opening["centre"])?,
            normal: unit(vec3(&opening["normal"])?),
            thickness: opening["thickness"].as_f64().unwrap_or(0.0),
            area: center_and_area(&corners).1,
        })
    }

    /// Returns points on either side of it.
    fn probes(&self) -> [V3; 2] {
        let far = 0.35 + self.thickness / 2.0;
        [far, -far].map(|t| along(self.center, self.normal, t))
    }

    /// Returns `true` if a portal lies in it, and so is not superfluous.
    fn holds(&self, portal: &Portal) -> bool {
        let off = sub(portal.center, self.center);
        let depth = dot(off, self.normal).abs();
        let across = (dot(off, off) - depth * depth).max(0.0).sqrt();
        let is_turned = dot(portal.normal, self.normal).abs() < 15.0_f64.to_radians().cos();
        !(depth > 0.3 + self.thickness / 2.0 || across > 0.3 || is_turned)
    }
}

/// Openings of the truth by kind, and the portals that lie in one.
#[derive(Default)]
struct FoundOpenings {
    hits: BTreeMap<String, usize>,
    tried: BTreeMap<String, usize>,
    used: BTreeSet<u64>,
    matches: Vec<Match>,
}

/// An opening of the truth and the portal that matches it.
pub(crate) struct Match {
    /// Place of the opening in the truth's list.
    pub(crate) opening: usize,
    /// Its kind and name there.
    pub(crate) kind: String,
    pub(crate) name: String,
    pub(crate) portal: u64,
    pub(crate) portal_kind: String,
}

impl FoundOpenings {
    fn n_tried(&self, kind: &str) -> usize {
        self.tried.get(kind).copied().unwrap_or(0)
    }

    fn share(&self, kind: &str) -> Option<f64> {
        let n_hit = self.hits.get(kind).copied().unwrap_or(0);
        self.tried.get(kind).map(|&n| n_hit as f64 / n as f64)
    }
}

/// Finds a portal at each usable opening's place, of its size and cells.
fn find_openings(
    openings: &[Value],
    portals: &[Portal],
    locate: &impl Fn(&[V3]) -> anyhow::Result<Vec<String>>,
    failed: &mut Vec<String>,
) -> anyhow::Result<FoundOpenings> {
    let usable: Vec<(usize, &Value)> = (openings.iter().enumerate())
        .filter(|(_, o)| {
            o.get("usable").is_none_or(|u| u == true) && !list(&o["corners"]).is_empty()
        })
        .collect();
    let places = usable
        .iter()
        .map(|(_, o)| OpeningPlace::of(o).context("an opening without place"))
        .collect::<anyhow::Result<Vec<OpeningPlace>>>()?;
    let probes: Vec<V3> = places.iter().flat_map(OpeningPlace::probes).collect();
    let sides = locate(&probes)?;
    let mut found = FoundOpenings::default();
    for (k, ((index, o), place)) in usable.iter().zip(&places).enumerate() {
        let want: BTreeSet<String> = sides[2 * k..2 * k + 2].iter().cloned().collect();
        let sizes = 0.5 * place.area..=2.0 * place.area;
        let mut hit: Option<&Portal> = None;
        for portal in portals.iter().filter(|p| place.holds(p)) {
            found.used.insert(portal.id);
            let fits = sizes.contains(&portal.area) && portal.cells == want && want.len() == 2;
            // Among several, the one most like it in size.
            let off = |p: &Portal| (p.area / place.area).ln().abs();
            if fits && hit.is_none_or(|h| off(portal) < off(h)) {
                hit = Some(portal);
            }
        }
        let kind = text(&o["kind"]);
        *found.tried.entry(kind.clone()).or_default() += 1;
        if let Some(portal) = hit {
            found.matches.push(Match {
                opening: *index,
                kind: kind.clone(),
                name: text(&o["name"]),
                portal: portal.id,
                portal_kind: portal.kind.clone(),
            });
            *found.hits.entry(kind).or_default() += 1;
        } else if kind == "door" || kind == "window" {
            failed.push(format!("{kind} {} missed", text(&o["name"])));
        }
    }
    Ok(found)
}

/// Returns the Matthews correlation of "same room" and "same cell" over pairs of points. Pairs from two rooms in one
/// group do not count.
fn pair_mcc(rooms: &[String], groups: &[String], cells: &[String]) -> Option<f64> {
    fn pairs<K: Ord>(keys: impl Iterator<Item = K>) -> f64 {
        let mut count: BTreeMap<K, usize> = BTreeMap::new();
        for k in keys {
            *count.entry(k).or_default() += 1;
        }
        count.values().map(|&n| (n * (n - 1) / 2) as f64).sum()
    }
    let n = rooms.len() as f64;
    let tp = pairs(rooms.iter().zip(cells));
    let fn_ = pairs(rooms.iter()) - tp;
    let fp = pairs(cells.iter()) - pairs(groups.iter().zip(cells));
    let tn = n * (n - 1.0) / 2.0 - pairs(groups.iter()) - fp;
    let den = ((tp + fp) * (tp + fn_) * (tn + fp) * (tn + fn_)).sqrt();
    (den > 0.0).then(|| (tp * tn - fp * fn_) / den)
}
