//! A page about one world: plans, graph, visibility, tables, pictures. Self-contained, printable.

use std::fmt::Write;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use enfilade_cpg::{CellId, PortalKind, Pvs, RoomFacts, World};

use crate::drawing::Drawing;
use crate::graph::graph_svg;
use crate::label::shortened;
use crate::matrix::{Order, matrix_svg};
use crate::plain::cells_table;
use crate::plan::{PlanOptions, Plans};
use crate::reasons::reasons;
use crate::storeys::Storey;
use crate::svg::escaped;
use crate::verdict::Verdict;

/// Most rows in the table of rooms.
const MAX_ROWS: usize = 1000;
/// Least difference of two areas that the page shows. [Units: wu²]
const SHOWN: f64 = 0.05;

/// A picture of the page.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Text below it.
    pub caption: String,
    /// A PNG file.
    pub png: Vec<u8>,
}

/// A table of the page; the first row is its head.
#[derive(Clone, Debug)]
pub struct Table {
    /// Text above it.
    pub title: String,
    /// A sentence that explains it.
    pub note: String,
    /// Cells by row. The first of each row is left-aligned; numbers are right-aligned.
    pub rows: Vec<Vec<String>>,
}

/// Content of the page that the world itself does not contain.
#[derive(Clone, Debug, Default)]
pub struct ReportParts {
    /// The title, e.g. the file's name.
    pub title: String,
    /// How far to trust the world.
    pub verdict: Option<Verdict>,
    /// The cells visible from each cell, as computed by `enfilade pvs`.
    pub visible: Pvs,
    /// Address of the page of a walk, if there is one.
    pub walk: Option<String>,
    /// Tables of measurements.
    pub tables: Vec<Table>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Sentences that name missing parts, with reasons.
    pub notes: Vec<String>,
}

/// Writes the page. The world must be valid. The same parts give the same bytes.
///
/// Every element that shows a cell carries its number as `data-cell`. When a pointer rests on one, a script in the
/// page highlights the others, and shows why the cell is there.
#[must_use]
pub fn report_html(world: &World, parts: &ReportParts) -> String {
    let plans = Plans::new(world, &PlanOptions::default());
    let mut out = String::new();
    head(&mut out, world, &plans, parts);
    let (first, rest) = parts.figures.split_at(parts.figures.len().min(1));
    figures(&mut out, first);
    drawings(&mut out, &plans);
    let is_void = |c: CellId| plans.voids().any(|v| v == c);
    let (table, cells) = rooms(world, &plans, |c| !is_void(c));
    rows(&mut out, &table, &cells);
    let facts: Vec<RoomFacts> = plans.rooms().cloned().collect();
    let _ = writeln!(
        out,
        "<p><a download=\"rooms.csv\" href=\"data:text/csv;base64,{}\">All rooms as a table for a spreadsheet (CSV)</a></p>",
        BASE64_STANDARD.encode(cells_table(world, &facts, shortened))
    );
    if plans.voids().len() > 0 {
        let (table, cells) = voids(world, is_void);
        rows(&mut out, &table, &cells);
    }
    reasons(&mut out, world);
    if !rest.is_empty() {
        out.push_str("<section><h2>Pictures</h2>\n");
        figures(&mut out, rest);
        out.push_str("</section>\n");
    }
    for_programs(&mut out, world, &plans, parts);
    let p = &world.graph.provenance;
    let settings = p.settings.iter().map(|(k, v)| format!("{k} = {v}"));
    let _ = write!(
        out,
        "<footer>Baked by {} ({}), input {}. {}</footer>\n<script>{SCRIPT}</script>\n</body></html>\n",
        escaped(&p.generator),
        escaped(&p.method),
        escaped(&p.input_hash),
        escaped(&settings.collect::<Vec<_>>().join(", "))
    );
    out
}

/// Writes the title, the main figures, the verdict and the notes.
fn head(out: &mut String, world: &World, plans: &Plans, parts: &ReportParts) {
    let title = escaped(&parts.title);
    let voids: Vec<String> = plans.voids().map(|c| c.0.to_string()).collect();
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}: rooms and doorways</title>\n<style>{STYLE}</style></head><body data-voids=\"{}\">\n\
         <header><p class=\"kind\">Rooms, doorways, and what can be seen from where</p><h1>{title}</h1>{}</header>\n",
        voids.join(" "),
        facts(world, plans)
    );
    if let Some(walk) = &parts.walk {
        let _ = writeln!(
            out,
            "<p><a href=\"{}\">Walk through it</a> (from a server, such as <code>enfilade serve</code>: browsers let \
             no page read files beside it)</p>",
            escaped(walk)
        );
    }
    if let Some(verdict) = &parts.verdict {
        let class = match verdict.is_good() {
            true => "note good",
            false => "note",
        };
        let sentence = verdict.sentence();
        let _ = writeln!(out, "<p class=\"{class}\">{}</p>", escaped(&sentence));
    }
    for note in &parts.notes {
        let _ = writeln!(out, "<p class=\"note\">{}</p>", escaped(note));
    }
    if !voids.is_empty() {
        let _ = writeln!(
            out,
            "<p class=\"filter\"><label><input type=\"checkbox\" id=\"voids\" checked> Show spaces in which nobody can stand, such as \
             shafts and the air above ceilings: {}</label></p>",
            voids.len()
        );
    }
}

/// Writes the plans and their legend, all at one scale: they are scrolled rather than made smaller.
fn drawings(out: &mut String, plans: &Plans) {
    out.push_str(
        "<section><h2>Plans</h2><p>Point at a room, here or below, to see it everywhere on this page and why it is there, at a line of the graph for its doorway; click to go to it.</p>\n",
    );
    let mut draw = |class: &str, drawing: &Drawing| {
        let svg = drawing.to_svg();
        let svg = svg.split_once("?>").map_or(svg.as_str(), |(_, svg)| svg);
        let width = drawing.size()[0] / plans.on_page();
        let svg = svg.replacen("<svg ", &format!("<svg style=\"width:{width:.0}px\" "), 1);
        let _ = writeln!(out, "<div class=\"drawing{class}\">{svg}</div>");
    };
    for (k, storey) in plans.storeys().enumerate() {
        let class = if storey.is_between { " between" } else { "" };
        draw(class, &plans.bare(k));
    }
    draw(" legend", &plans.legend());
    out.push_str("</section>\n");
}

/// Writes what readers of plans do without, folded away: the graph, what is visible from where, counts.
fn for_programs(out: &mut String, world: &World, plans: &Plans, parts: &ReportParts) {
    let storeys: Vec<&Storey> = plans.storeys().collect();
    let _ = write!(
        out,
        "<details><summary>For programs that draw it: graph, visibility, counts</summary>\n<section><h2>Graph</h2><p>A disk for each \
         room, with its number and as large as its volume; a line for each doorway, as on the plan. A thick ring: there is a door, a \
         window or an opening to the outdoors.</p><div class=\"wide\">{}</div></section>\n",
        graph_svg(world, &storeys)
    );
    if parts.visible.n_cells() > 0 {
        matrix(out, world, plans, &parts.visible);
    }
    for table in &parts.tables {
        rows(out, table, &[]);
    }
    out.push_str("</details>\n");
}

/// Highlights the elements of a cell, shows why it is there, and hides voids. The page is complete without it.
const SCRIPT: &str = include_str!("report.js");

const STYLE: &str = "\
:root{color-scheme:light}*{box-sizing:border-box}\
body{font:16px/1.5 system-ui,sans-serif;color:#222;background:#fff;max-width:1080px;margin:0 auto;padding:1.2rem}\
h1{font-size:2rem;line-height:1.2;margin:0;overflow-wrap:anywhere}h2{font-size:1.2rem;border-bottom:2px solid #e8590c;padding-bottom:.2em}\
header{border-bottom:1px solid #ddd;margin-bottom:1rem}.kind{color:#777;margin:0;letter-spacing:.04em}\
dl{display:flex;flex-wrap:wrap;gap:.4rem 2.2rem;margin:.6rem 0 1.1rem}dl div{display:flex;flex-direction:column}\
dd{margin:0;font-size:1.5rem;font-weight:600;line-height:1.2}dt{color:#666;font-size:.9rem}.note{background:#fff4e6;border-left:4px solid #e8590c;padding:.5em .8em}.good{background:#ebfbee;border-color:#2b8a3e}\
figure{margin:0 0 1rem}figure img{width:100%;height:auto;border-radius:6px;display:block}\
figcaption{color:#555;font-size:.9rem}.gallery{display:grid;grid-template-columns:repeat(auto-fit,minmax(290px,1fr));gap:1rem}\
.drawing{overflow-x:auto}.drawing svg{height:auto;display:block}\
.graph,.matrix{width:100%;height:auto}details{margin-top:1.5rem}summary{cursor:pointer;font-weight:600}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-size:.92rem;font-variant-numeric:tabular-nums;min-width:60%}\
th,td{padding:.25em .7em;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}\
th:first-child,td:first-child{text-align:left}th{background:#f4f4f2}\
.graph line{stroke-width:2;stroke-opacity:.75}.graph text,.matrix text{fill:#222}\
.band{fill:#e8590c;fill-opacity:0}[data-cell]{cursor:pointer}\
path.lit{stroke:#000;stroke-width:14}text.lit{font-weight:bold}tr.lit td{background:#ffe8cc}\
g.lit circle{stroke:#000;stroke-width:5}g.lit .band{fill-opacity:.35}g.lit text{font-weight:bold}line.lit{stroke-width:5;stroke-opacity:1}\
.no-voids .void,.no-voids .between,.no-voids .twice,.without-voids{display:none}.no-voids .without-voids{display:block}\
td.why{text-align:left;white-space:normal}#why{position:fixed;left:0;right:0;bottom:0;max-height:30vh;overflow-y:auto;background:#fff;\
border-top:2px solid #e8590c;padding:.4rem 1.2rem;font-size:.9rem;line-height:1.35}#why p{margin:.25em 0}#why b{margin-right:.5em}\
footer{color:#777;font-size:.8rem;margin-top:2rem;overflow-wrap:anywhere}\
@media print{#why{display:none}body{max-width:none;padding:0;font-size:11px}section{break-inside:avoid-page}\
.wide{overflow:visible}details{display:none}.drawing svg{max-width:100%}h2{break-after:avoid}tr,figure{break-inside:avoid}th{-webkit-print-color-adjust:exact;print-color-adjust:exact}}";

/// The main figures, each over its name; those that are zero are left out, except rooms.
fn facts(world: &World, plans: &Plans) -> String {
    let n_voids = plans.voids().len();
    let graph = &world.graph;
    let indoors = graph.indoor_cells().map(|(_, c)| c);
    let n = |kind| graph.portals.iter().filter(|p| p.kind == kind).count();
    let volume: f32 = indoors.clone().map(|c| c.volume).sum();
    let area: f64 = plans.rooms().map(|room| room.floor_area).sum();
    let counted = |n: usize, one: &str, many: &str| {
        (n > 0).then(|| (n.to_string(), if n == 1 { one } else { many }.to_owned()))
    };
    let rooms = indoors.count() - n_voids;
    let n_storeys = plans.storeys().filter(|s| !s.is_between).count();
    let all = [
        counted(rooms, "room", "rooms").or_else(|| Some(("0".into(), "rooms".into()))),
        counted(n_voids, "void", "voids"),
        counted(n_storeys, "storey", "storeys"),
        (area >= 1.0).then(|| (format!("{area:.0} m²"), "floor".into())),
        (volume >= 1.0).then(|| (format!("{volume:.0} m³"), "air".into())),
        counted(n(PortalKind::Door), "door", "doors"),
        counted(n(PortalKind::Window), "window", "windows"),
        counted(n(PortalKind::Open), "open passage", "open passages"),
        counted(n(PortalKind::Crack), "crack", "cracks"),
        counted(world.details.len(), "object", "objects"),
    ];
    let facts = all.into_iter().flatten();
    let facts: String = facts
        .map(|(n, name)| format!("<div><dd>{n}</dd><dt>{name}</dt></div>"))
        .collect();
    format!("<dl>{facts}</dl>")
}

fn figures(out: &mut String, figures: &[Figure]) {
    let class = if figures.len() > 1 { "gallery" } else { "" };
    let _ = writeln!(out, "<div class=\"{class}\">");
    for f in figures {
        let caption = escaped(&f.caption);
        let _ = writeln!(
            out,
            "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{}\"><figcaption>{caption}</figcaption></figure>",
            BASE64_STANDARD.encode(&f.png)
        );
    }
    out.push_str("</div>\n");
}

/// `cells` are the cells of the rows after the head, if the rows describe cells.
fn rows(out: &mut String, t: &Table, cells: &[CellId]) {
    let _ = write!(
        out,
        "<section><h2>{}</h2><p>{}</p><div class=\"wide\"><table>",
        escaped(&t.title),
        escaped(&t.note)
    );
    for (i, row) in t.rows.iter().enumerate() {
        let tag = if i == 0 { "th" } else { "td" };
        match i.checked_sub(1).and_then(|k| cells.get(k)) {
            Some(cell) => {
                let _ = write!(out, "<tr data-cell=\"{}\">", cell.0);
            }
            None => out.push_str("<tr>"),
        }
        for cell in row {
            let _ = write!(out, "<{tag}>{}</{tag}>", escaped(cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table></div></section>\n");
}

/// The table of the rooms on floors, storey by storey, and the cells of its rows.
fn rooms(world: &World, plans: &Plans, is_listed: impl Fn(CellId) -> bool) -> (Table, Vec<CellId>) {
    let mut rooms: Vec<&RoomFacts> = plans.rooms().filter(|r| is_listed(r.cell)).collect();
    let place = |room: &&RoomFacts| {
        let first = room.storeys.first();
        plans.storeys().position(|s| Some(&s.name) == first)
    };
    rooms.sort_by_key(|room| (place(room), room.cell));
    let area: f64 = rooms.iter().map(|room| room.floor_area).sum();
    let n = rooms.len();
    rooms.truncate(MAX_ROWS);
    // Under level ceilings, these columns would repeat the first.
    let is_low = rooms
        .iter()
        .any(|r| r.floor_area - r.area_above_2_3 > SHOWN);
    let low = |all: [String; 2]| all.into_iter().filter(|_| is_low);
    let mut head = ["name", "storey", "floor m²"].map(String::from).to_vec();
    head.extend(low(["over 1.5 m", "over 2.3 m"].map(String::from)));
    head.extend(["height m", "volume m³", "doors", "windows"].map(String::from));
    let mut rows = vec![head];
    rows.extend(rooms.iter().map(|room| {
        let cell = &world.graph[room.cell];
        let areas = [room.area_above_1_5, room.area_above_2_3];
        let mut row = vec![
            shortened(&cell.name).into_owned(),
            room.storeys.join(", "),
            format!("{:.1}", room.floor_area),
        ];
        row.extend(low(areas.map(|area| format!("{area:.1}"))));
        row.extend([
            format!("{:.2}", room.height),
            format!("{:.1}", cell.volume),
            room.n_doors.to_string(),
            room.n_windows.to_string(),
        ]);
        row
    }));
    let mut note = "Floors as seen from above, without the recesses of doors and windows; the height over most of the floor.".to_owned();
    if is_low {
        note += " Over 1.5 m and 2.3 m: the floor over which a room is that high.";
    }
    if n > MAX_ROWS {
        let _ = write!(note, " The first {MAX_ROWS} of {n}.");
    } else if n > 1 {
        rows.push(vec!["all".into(), String::new(), format!("{area:.1}")]);
    }
    let table = Table {
        title: "Rooms".into(),
        note,
        rows,
    };
    (table, rooms.iter().map(|room| room.cell).collect())
}

/// The table of spaces in which nobody can stand, the largest first, and the cells of its rows.
fn voids(world: &World, is_void: impl Fn(CellId) -> bool) -> (Table, Vec<CellId>) {
    let mut cells: Vec<_> = world
        .graph
        .indoor_cells()
        .filter(|c| is_void(c.0))
        .collect();
    cells.sort_by(|a, b| b.1.volume.total_cmp(&a.1.volume).then(a.0.cmp(&b.0)));
    let n = cells.len();
    cells.truncate(MAX_ROWS);
    let mut rows = vec![["name", "volume m³", "size m"].map(String::from).to_vec()];
    rows.extend(cells.iter().map(|(_, c)| {
        let [x, y, z] = [0, 1, 2].map(|k| c.aabb[1][k] - c.aabb[0][k]);
        vec![
            shortened(&c.name).into_owned(),
            format!("{:.1}", c.volume),
            format!("{x:.1} × {y:.1} × {z:.1}"),
        ]
    }));
    let note = match n > MAX_ROWS {
        true => format!("The {MAX_ROWS} largest of {n}."),
        false => "By volume.".into(),
    };
    let table = Table {
        title: "Voids".into(),
        note,
        rows,
    };
    (table, cells.iter().map(|c| c.0).collect())
}

/// Writes the matrix of visible pairs of rooms; if there are voids, twice: with and without them.
fn matrix(out: &mut String, world: &World, plans: &Plans, visible: &Pvs) {
    let storeys: Vec<&Storey> = plans.storeys().collect();
    let all = Order::new(world, &storeys, visible, |_| true);
    let (n, n_known) = (all.cells.len(), visible.n_cells());
    let (pairs, of) = (visible.n_pairs(), n_known * n_known);
    let _ = write!(
        out,
        "<section><h2>Visibility</h2><p>A dark square where something of the column's room can be seen from somewhere in \
         the row's: {pairs} of {of} pairs, {:.1} %{}. Storeys are parted by lines.</p>",
        100.0 * pairs as f64 / of.max(1) as f64,
        if n < n_known {
            format!("; the {n} largest of {n_known} rooms")
        } else {
            String::new()
        },
    );
    let class = if plans.voids().len() > 0 {
        " twice"
    } else {
        ""
    };
    let svg = matrix_svg(world, visible, &all);
    let _ = writeln!(out, "<div class=\"wide{class}\">{svg}</div>");
    if plans.voids().len() > 0 {
        let is_void = |c: CellId| plans.voids().any(|v| v == c);
        let some = Order::new(world, &storeys, visible, |c| !is_void(c));
        let svg = matrix_svg(world, visible, &some);
        let _ = writeln!(out, "<div class=\"wide without-voids\">{svg}</div>");
    }
    out.push_str("</section>\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{Cell, CellId};

    #[test]
    fn a_page_needs_nothing_from_outside_and_hostile_names_stay_text() {
        let mut world = World::default();
        world.graph.cells.push(Cell {
            name: "<script>x</script>".into(),
            aabb: [[0.0; 3], [4.0, 3.0, 5.0]],
            volume: 60.0,
            ..Cell::default()
        });
        let mut seen = enfilade_cpg::CellSet::new(1);
        seen.insert(CellId(0));
        let parts = ReportParts {
            title: "a \"house\" & <b>".into(),
            visible: Pvs::of_rows(&[seen]),
            figures: vec![Figure {
                caption: "'\">".into(),
                png: vec![1, 2, 3],
            }],
            ..ReportParts::default()
        };
        let page = report_html(&world, &parts);
        assert!(!page.contains("<script>x"), "{page}");
        // Namespace names are not addresses to load from.
        let outside = page.replace("http://www.w3.org/2000/svg", "");
        assert!(
            !outside.contains("http") && !outside.contains("src=\"/"),
            "{outside}"
        );
        assert!(page.contains("M0 0h11v11h-11z"), "a room sees itself");
        assert!(page.contains("data:image/png;base64,AQID"));
        assert_eq!(page, report_html(&world, &parts));
    }

    #[test]
    fn voids_are_counted_and_listed_apart() {
        let mut world = World::default();
        for (name, is_void) in [("cell-0", false), ("cell-1", true)] {
            world.graph.cells.push(Cell {
                name: name.into(),
                aabb: [[0.0; 3], [4.0, 3.0, 5.0]],
                is_void,
                ..Cell::default()
            });
        }
        // Without a floor of its own, a room is listed with the voids.
        let page = report_html(&world, &ReportParts::default());
        let facts = ["<dd>0</dd><dt>rooms</dt>", "<dd>2</dd><dt>voids</dt>"];
        assert!(facts.iter().all(|f| page.contains(f)), "{page}");
        assert!(!page.contains("storeys</dt>"), "{page}");
        let [_, tables] = [
            page.split("<h2>Rooms").next(),
            page.split("<h2>Rooms").nth(1),
        ];
        let (rooms, voids) = tables
            .and_then(|t| t.split_once("<h2>Voids"))
            .unwrap_or_default();
        assert!(!rooms.contains("cell-1") && voids.contains("cell-1"));
    }

    #[test]
    fn a_world_without_rooms_has_a_page() {
        assert!(report_html(&World::default(), &ReportParts::default()).ends_with("</html>\n"));
    }
}
