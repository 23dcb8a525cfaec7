//! One page about a world: plans, graph, visibility, tables, pictures. Self-contained, printable.

use std::fmt::Write;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use enfilade_cpg::{PortalKind, Pvs, World};
use enfilade_geom::DVec2;

use crate::drawing::color;
use crate::plan::{PlanOptions, plan_svg};
use crate::storeys::find_storeys;
use crate::svg::{escaped, hex};

/// Cells of a visibility matrix at most; larger ones show the largest cells.
const MAX_MATRIX: usize = 200;
/// Rows of the table of rooms at most.
const MAX_ROWS: usize = 100;

/// A picture of the page.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What is below it.
    pub caption: String,
    /// A PNG file.
    pub png: Vec<u8>,
}

/// A table of the page; the first row is its head.
#[derive(Clone, Debug)]
pub struct Table {
    /// What is above it.
    pub title: String,
    /// A sentence that says what it means.
    pub note: String,
    /// Cells by row, the first of each left-aligned, numbers right-aligned.
    pub rows: Vec<Vec<String>>,
}

/// What goes on the page beside what the world itself tells.
#[derive(Clone, Debug, Default)]
pub struct ReportParts {
    /// The title, e.g. the file's name.
    pub title: String,
    /// By cell: what can be seen from it, as `enfilade pvs` finds it.
    pub visible: Pvs,
    /// Tables of measurements.
    pub tables: Vec<Table>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Sentences on what is missing, and why.
    pub notes: Vec<String>,
}

/// Writes the page. The world must be valid; the same parts give the same bytes.
#[must_use]
pub fn report_html(world: &World, parts: &ReportParts) -> String {
    let mut out = String::new();
    let title = escaped(&parts.title);
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}: rooms and doorways</title>\n<style>{STYLE}</style></head><body>\n\
         <header><h1>{title}</h1><p>{}</p></header>\n",
        escaped(&summary(world))
    );
    for note in &parts.notes {
        let _ = writeln!(out, "<p class=\"note\">{}</p>", escaped(note));
    }
    let (first, rest) = parts.figures.split_at(parts.figures.len().min(1));
    figures(&mut out, first);
    let plan = plan_svg(world, &PlanOptions::default());
    let plan = plan.split_once("?>").map_or(plan.as_str(), |(_, svg)| svg);
    let _ = write!(
        out,
        "<section><h2>Plans</h2><div class=\"drawing\">{plan}</div></section>\n\
         <section><h2>Graph</h2><p>A disk for each room, as large as its volume, where its middle is on the \
         plan, storeys side by side; a line for each doorway.</p><div class=\"drawing\">{}</div></section>\n",
        graph_svg(world)
    );
    if parts.visible.n_cells() > 0 {
        matrix(&mut out, world, &parts.visible);
    }
    for t in &parts.tables {
        table(&mut out, t);
    }
    table(&mut out, &rooms(world));
    if !rest.is_empty() {
        out.push_str("<section><h2>Pictures</h2>\n");
        figures(&mut out, rest);
        out.push_str("</section>\n");
    }
    let p = &world.graph.provenance;
    let settings: Vec<String> = p
        .settings
        .iter()
        .map(|(k, v)| format!("{k} = {v}"))
        .collect();
    let _ = write!(
        out,
        "<footer>Baked by {} ({}), input {}. {}</footer>\n</body></html>\n",
        escaped(&p.generator),
        escaped(&p.method),
        escaped(&p.input_hash),
        escaped(&settings.join(", "))
    );
    out
}

const STYLE: &str = "\
:root{color-scheme:light}*{box-sizing:border-box}\
body{font:16px/1.5 system-ui,sans-serif;color:#222;background:#fff;max-width:1080px;margin:0 auto;padding:1.2rem}\
h1{font-size:1.8rem;margin:.2em 0;overflow-wrap:anywhere}h2{font-size:1.2rem;border-bottom:2px solid #e8590c;padding-bottom:.2em}\
header p{color:#555;margin:.2em 0 1em}.note{background:#fff4e6;border-left:4px solid #e8590c;padding:.5em .8em}\
figure{margin:0 0 1rem}figure img{width:100%;height:auto;border-radius:6px;display:block}\
figcaption{color:#555;font-size:.9rem}.gallery{display:grid;grid-template-columns:repeat(auto-fit,minmax(290px,1fr));gap:1rem}\
.drawing svg{width:100%;height:auto;max-height:90vh;display:block}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-size:.92rem;font-variant-numeric:tabular-nums;min-width:60%}\
th,td{padding:.25em .7em;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}\
th:first-child,td:first-child{text-align:left}th{background:#f4f4f2}\
footer{color:#777;font-size:.8rem;margin-top:2rem;overflow-wrap:anywhere}\
@media print{body{max-width:none;padding:0;font-size:11px}section{break-inside:avoid-page}\
.wide{overflow:visible}h2{break-after:avoid}tr,figure{break-inside:avoid}th{-webkit-print-color-adjust:exact;print-color-adjust:exact}}";

fn summary(world: &World) -> String {
    let graph = &world.graph;
    let indoors = graph.indoor_cells().map(|(_, c)| c);
    let n = |kind| graph.portals.iter().filter(|p| p.kind == kind).count();
    let volume: f32 = indoors.clone().map(|c| c.volume).sum();
    format!(
        "{} rooms in {} storeys, {volume:.0} m³ of air; {} doors, {} windows, {} open passages, {} cracks; {} objects",
        indoors.count(),
        find_storeys(world).len(),
        n(PortalKind::Door),
        n(PortalKind::Window),
        n(PortalKind::Open),
        n(PortalKind::Crack),
        world.details.len()
    )
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

fn table(out: &mut String, t: &Table) {
    let _ = write!(
        out,
        "<section><h2>{}</h2><p>{}</p><div class=\"wide\"><table>",
        escaped(&t.title),
        escaped(&t.note)
    );
    for (i, row) in t.rows.iter().enumerate() {
        let tag = if i == 0 { "th" } else { "td" };
        out.push_str("<tr>");
        for cell in row {
            let _ = write!(out, "<{tag}>{}</{tag}>", escaped(cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table></div></section>\n");
}

fn rooms(world: &World) -> Table {
    let mut cells: Vec<_> = (0..)
        .zip(&world.graph.cells)
        .filter(|c| !c.1.outdoor)
        .collect();
    cells.sort_by(|a: &(u32, _), b| b.1.volume.total_cmp(&a.1.volume).then(a.0.cmp(&b.0)));
    let n = cells.len();
    let head = [
        "room",
        "volume m³",
        "size m",
        "doorways",
        "triangles",
        "of objects",
    ];
    let mut rows = vec![head.map(String::from).to_vec()];
    rows.extend(cells.into_iter().take(MAX_ROWS).map(|(_, c)| {
        let [x, y, z] = [0, 1, 2].map(|k| c.aabb[1][k] - c.aabb[0][k]);
        vec![
            c.name.clone(),
            format!("{:.1}", c.volume),
            format!("{x:.1} × {y:.1} × {z:.1}"),
            c.portals.len().to_string(),
            c.n_triangles.to_string(),
            c.n_detail_triangles.to_string(),
        ]
    }));
    Table {
        title: "Rooms".into(),
        note: if n > MAX_ROWS {
            format!("The {MAX_ROWS} largest of {n}.")
        } else {
            "By volume.".into()
        },
        rows,
    }
}

/// The graph as a drawing: rooms where they are, storeys side by side.
fn graph_svg(world: &World) -> String {
    let storeys = find_storeys(world);
    let cells = &world.graph.cells;
    let mut low = DVec2::INFINITY;
    let mut high = DVec2::NEG_INFINITY;
    let middle = |i: usize| {
        let [a, b] = cells[i].aabb.map(|p| p.map(f64::from));
        (
            (a[0] + b[0]) * 0.5,
            (a[1] + b[1]) * 0.5,
            (a[2] + b[2]) * 0.5,
        )
    };
    for c in cells.iter().filter(|c| !c.outdoor) {
        let [a, b] = c.aabb.map(|p| DVec2::new(p[0].into(), p[2].into()));
        (low, high) = (low.min(a), high.max(b));
    }
    if !low.is_finite() {
        return "<p>No rooms.</p>".into();
    }
    let size = (high - low).max(DVec2::splat(1.0));
    let step = size.x * 1.12;
    let place = |i: usize| {
        let (x, y, z) = middle(i);
        let storey = storeys.iter().rposition(|s| s.floor <= y).unwrap_or(0);
        DVec2::new(x - low.x + storey as f64 * step, z - low.y)
    };
    let unit = size.max_element() / 100.0;
    let width = step * storeys.len().max(1) as f64;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{:.2} {:.2} {:.2} {:.2}\" font-family=\"sans-serif\" role=\"img\" aria-label=\"graph of rooms\">",
        -4.0 * unit,
        -4.0 * unit,
        width + 8.0 * unit,
        size.y + 8.0 * unit
    );
    for p in &world.graph.portals {
        let [a, b] = p.cells.map(|c| c.0 as usize);
        let stroke = match p.kind {
            PortalKind::Open => "#e8590c",
            PortalKind::Door => "#c92a2a",
            PortalKind::Window => "#1c7ed6",
            PortalKind::Crack => "#d6249f",
        };
        let ends = match (cells[a].outdoor, cells[b].outdoor) {
            (true, true) => continue,
            // To the outdoors: a stub, from the room through its window.
            (true, _) | (_, true) => {
                let room = if cells[a].outdoor { b } else { a };
                let n = p.outline.len().max(1) as f64;
                let at = |k: usize| p.outline.iter().map(|c| f64::from(c[k])).sum::<f64>() / n;
                let (x, _, z) = middle(room);
                let from = place(room);
                [
                    from,
                    from + (DVec2::new(at(0), at(2)) - DVec2::new(x, z)) * 1.08,
                ]
            }
            _ => [place(a), place(b)],
        };
        let [u, v] = ends;
        let _ = write!(
            out,
            "<line x1=\"{:.2}\" y1=\"{:.2}\" x2=\"{:.2}\" y2=\"{:.2}\" stroke=\"{stroke}\" stroke-width=\"{:.2}\" stroke-opacity=\".75\"/>",
            u.x,
            u.y,
            v.x,
            v.y,
            unit * 0.5
        );
    }
    for (i, c) in cells.iter().enumerate().filter(|(_, c)| !c.outdoor) {
        let p = place(i);
        let r = (f64::from(c.volume.max(0.0)).cbrt() * 0.22)
            .clamp(unit * 1.2, size.max_element() * 0.08);
        let _ = write!(
            out,
            "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{r:.2}\" fill=\"{}\" stroke=\"#444\" stroke-width=\"{:.2}\"><title>{}</title></circle>\
             <text x=\"{:.2}\" y=\"{:.2}\" font-size=\"{:.2}\" text-anchor=\"middle\" fill=\"#222\">{i}</text>",
            p.x,
            p.y,
            hex(color(i as u32)),
            unit * 0.2,
            escaped(&c.name),
            p.x,
            p.y + unit * 0.8,
            unit * 2.2
        );
    }
    out.push_str("</svg>");
    out
}

/// Which room can be seen from which, as a square of dots.
fn matrix(out: &mut String, world: &World, visible: &Pvs) {
    let mut cells: Vec<usize> = (0..visible.n_cells().min(world.graph.cells.len())).collect();
    if cells.len() > MAX_MATRIX {
        cells.sort_by(|&a, &b| {
            let volume = |i: usize| world.graph.cells[i].volume;
            volume(b).total_cmp(&volume(a)).then(a.cmp(&b))
        });
        cells.truncate(MAX_MATRIX);
        cells.sort_unstable();
    }
    let n = cells.len();
    let pairs = visible.n_pairs();
    let all = visible.n_cells() * visible.n_cells();
    let _ = write!(
        out,
        "<section><h2>Visibility</h2><p>A dark square where something of the column's room can be seen from somewhere in \
         the row's: {pairs} of {all} pairs, {:.1} %{}.</p><div class=\"drawing\"><svg xmlns=\"http://www.w3.org/2000/svg\" \
         viewBox=\"-1 -1 {} {}\" style=\"max-width:520px\" role=\"img\" aria-label=\"visibility matrix\">\
         <rect width=\"{n}\" height=\"{n}\" fill=\"#f1f1ee\"/><path fill=\"#1c3d5a\" d=\"",
        100.0 * pairs as f64 / all.max(1) as f64,
        if n < visible.n_cells() {
            format!("; the {n} largest of {} rooms", visible.n_cells())
        } else {
            String::new()
        },
        n + 2,
        n + 2
    );
    for (y, &from) in cells.iter().enumerate() {
        let sees = |x: usize| {
            visible.sees(
                enfilade_cpg::CellId(from as u32),
                enfilade_cpg::CellId(cells[x] as u32),
            )
        };
        let mut x = 0;
        while x < n {
            let start = x;
            while x < n && sees(x) {
                x += 1;
            }
            if x > start {
                let _ = write!(out, "M{start} {y}h{}v1h-{}z", x - start, x - start);
            }
            x += 1;
        }
    }
    out.push_str("\"/></svg></div></section>\n");
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
        assert!(!page.contains("<script"), "{page}");
        // Names of name spaces are no addresses to load from.
        let outside = page.replace("http://www.w3.org/2000/svg", "");
        assert!(
            !outside.contains("http") && !outside.contains("src=\"/"),
            "{outside}"
        );
        assert!(page.contains("M0 0h1v1h-1z"), "a room sees itself");
        assert!(page.contains("data:image/png;base64,AQID"));
        assert_eq!(page, report_html(&world, &parts));
    }

    #[test]
    fn a_world_without_rooms_has_a_page() {
        assert!(report_html(&World::default(), &ReportParts::default()).ends_with("</html>\n"));
    }
}
