//! Floor plans: one level section a storey.

use std::fmt::Write;

use enfilade_cpg::{PortalId, PortalKind, World};
use enfilade_geom::{DMat4, DVec2, DVec3, Plane, Winding};

use crate::section::{Label, Section};
use crate::storeys::{Storey, find_storeys};
use crate::svg::{SCALE, closed, color, escaped, line, number, point};

/// Air around each plan, for its title. [Units: wu]
const MARGIN: f64 = 1.2;
/// Room for the legend below all plans. [Units: wu]
const FOOT: f64 = 2.0;
/// Cuts are raised by this, so that a plane of the model at just that height does not matter.
const OFF_PLANES: f64 = 1.37e-4;

/// How to draw plans.
#[derive(Clone, Debug)]
pub struct PlanOptions {
    /// Height of the cut above each storey's floor. [Units: wu] [Limit: above 0]
    pub cut_height: f64,
}

impl Default for PlanOptions {
    fn default() -> Self {
        // The usual height of architects' plans: above sills, below lintels.
        Self { cut_height: 1.2 }
    }
}

/// Draws the floor plan of every storey as one SVG document; x runs right and z down, as seen from
/// above. One drawing unit is a centimeter.
///
/// The world must be valid (`World::validate`). Time grows with the area drawn and the triangles.
#[must_use]
pub fn plan_svg(world: &World, options: &PlanOptions) -> String {
    let storeys = find_storeys(world);
    let (min, max) = extent(world);
    let zoom = lettering(max - min, storeys.len());
    let margin = MARGIN * zoom;
    let size = max - min + 2.0 * margin;
    // Rows and columns that make the sheet about three wide by two high.
    let n = storeys.len().max(1);
    let columns = ((n as f64 * 1.5 * size.y / size.x).sqrt().round() as usize).clamp(1, n);
    let rows = n.div_ceil(columns);
    let sheet = DVec2::new(
        (size.x * columns as f64).max(8.5 * zoom),
        size.y * rows as f64 + FOOT * zoom,
    );
    let mut out = String::new();
    let (w, h) = (number(sheet.x * SCALE), number(sheet.y * SCALE));
    // Pixels for viewers that do not fit the drawing to their window.
    let pixels = (1600.0 / sheet.x.max(sheet.y)).max(1.0);
    let _ = write!(
        out,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {w} {h}\" \
         font-family=\"sans-serif\">\n<title>Floor plans</title>\n{STYLE}\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
        (sheet.x * pixels).round(),
        (sheet.y * pixels).round(),
    );
    for (k, storey) in storeys.iter().enumerate() {
        let place = DVec2::new((k % columns) as f64, (k / columns) as f64) * size;
        let origin = place + margin - min;
        let _ = writeln!(
            out,
            "<g class=\"storey\" transform=\"translate({} {})\">",
            number(origin.x * SCALE),
            number(origin.y * SCALE)
        );
        draw_storey(&mut out, world, options, storey, (min, max), zoom);
        let title = format!(
            "Storey {} of {} · floor {:+.2} m, cut {:+.2} m",
            k + 1,
            storeys.len(),
            storey.floor,
            storey.floor + options.cut_height
        );
        // A letter is about 0.6 of its height wide; the title must not reach the next plan.
        let room = (max.x - min.x + margin) * SCALE;
        let height = (room / (0.6 * title.chars().count() as f64)).min(45.0 * zoom);
        text(
            &mut out,
            min - DVec2::new(0.0, 0.4 * zoom),
            height,
            "start",
            &title,
        );
        out.push_str("</g>\n");
    }
    let foot = DVec2::new(margin, size.y * rows as f64 + 0.5 * zoom);
    draw_foot(&mut out, foot, zoom);
    out.push_str("</svg>\n");
    out
}

const STYLE: &str = "<style>\
.solid{fill:#5a5a5a}.wall{stroke:#000;stroke-width:2;fill:none;stroke-linecap:round}\
.detail{fill:#000;fill-opacity:.06;stroke:#999;stroke-width:1}\
.open{stroke:#e8590c;stroke-width:7}.door{stroke:#c92a2a;stroke-width:7}\
.window{stroke:#1c7ed6;stroke-width:6}.crack{stroke:#d6249f;stroke-width:2}\
.low{stroke:#e8590c;stroke-width:3;stroke-dasharray:10 8}\
.stair{stroke:#e8590c;stroke-width:4;stroke-dasharray:16 10;fill:none}\
text{fill:#222}</style>\n";

/// How much larger than usual letters and margins are: sheets are looked at as a whole, whatever
/// the size of the building. Whole numbers keep the scale bar round.
fn lettering(plan: DVec2, n_storeys: usize) -> f64 {
    let side = (plan.x * plan.y * n_storeys.max(1) as f64).sqrt();
    [4.0, 2.0]
        .into_iter()
        .find(|zoom| side > 20.0 * zoom)
        .unwrap_or(1.0)
}

/// The rectangle (x and z) around all indoor cells; around the triangles where there is none.
fn extent(world: &World) -> (DVec2, DVec2) {
    let indoor = world.graph.indoor_cells().flat_map(|(_, c)| c.aabb);
    let mut corners: Vec<[f32; 3]> = indoor.collect();
    if corners.is_empty() {
        corners.extend(
            world
                .batches
                .iter()
                .flat_map(|b| b.primitive.positions.iter().copied()),
        );
    }
    if corners.is_empty() {
        return (DVec2::ZERO, DVec2::ONE);
    }
    let mut bounds = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for c in corners {
        let p = DVec2::new(c[0].into(), c[2].into());
        bounds = (bounds.0.min(p), bounds.1.max(p));
    }
    // Room for the thickness of outer walls.
    (bounds.0 - 0.5, bounds.1 + 0.5)
}

fn draw_storey(
    out: &mut String,
    world: &World,
    options: &PlanOptions,
    storey: &Storey,
    (min, max): (DVec2, DVec2),
    zoom: f64,
) {
    let y = storey.floor + options.cut_height + OFF_PLANES;
    let regions = Section::sample(world, y, min, max).regions();
    for (label, region) in &regions {
        let path: String = region.borders.iter().map(|b| closed(b)).collect();
        let _ = match label {
            Label::Cell(id) => writeln!(
                out,
                "<path class=\"cell\" fill=\"{}\" fill-rule=\"evenodd\" d=\"{path}\"><title>{}</title></path>",
                color(*id),
                escaped(&world.graph.cells[*id as usize].name)
            ),
            _ => writeln!(
                out,
                "<path class=\"solid\" fill-rule=\"evenodd\" d=\"{path}\"/>"
            ),
        };
    }
    draw_details(out, world, storey, y);
    draw_walls(out, world, y);
    for id in world.graph.portal_ids() {
        draw_portal(out, world, id, storey, y);
    }
    for (label, region) in &regions {
        let Label::Cell(id) = label else { continue };
        // Legible where there is room; small cells get a name that still fits, a letter being about 0.6 of its
        // height wide.
        let name = &world.graph.cells[*id as usize].name;
        let fitting = 1.9 / (0.6 * name.chars().count().max(1) as f64);
        let height = (region.radius * fitting.min(0.55)).clamp(0.06, 0.32 * zoom) * SCALE;
        text(out, region.inner, height, "middle", name);
        if region.radius > 0.25 {
            let below = region.inner + DVec2::new(0.0, height / SCALE * 0.9);
            text(
                out,
                below,
                height * 0.7,
                "middle",
                &format!("{:.1} m²", region.area),
            );
        }
    }
}

/// Structural triangles cut by the plane.
fn draw_walls(out: &mut String, world: &World, y: f64) {
    let mut lines: Vec<String> = Vec::new();
    for batch in &world.batches {
        let p = &batch.primitive;
        for t in p.indices.chunks_exact(3) {
            let corners: Vec<DVec3> = t
                .iter()
                .map(|&i| DVec3::from_array(p.positions[i as usize].map(f64::from)))
                .collect();
            if let Some((a, b)) = cut(&corners, y) {
                // One way round, so that the two sides of a sheet are drawn once.
                let (a, b) = if (a.x, a.y) <= (b.x, b.y) {
                    (a, b)
                } else {
                    (b, a)
                };
                if point(a) != point(b) {
                    lines.push(line(a, b));
                }
            }
        }
    }
    lines.sort_unstable();
    lines.dedup();
    let _ = writeln!(out, "<path class=\"wall\" d=\"{}\"/>", lines.concat());
}

/// Where a convex polygon crosses the height `y`, seen from above.
fn cut(corners: &[DVec3], y: f64) -> Option<(DVec2, DVec2)> {
    let mut ends = Vec::with_capacity(2);
    for (i, &p) in corners.iter().enumerate() {
        let q = corners[(i + 1) % corners.len()];
        if (p.y < y) != (q.y < y) {
            let at = p + (q - p) * ((y - p.y) / (q.y - p.y));
            ends.push(DVec2::new(at.x, at.z));
        }
    }
    match ends[..] {
        [a, b] => Some((a, b)),
        _ => None,
    }
}

/// A line for upright portals, at their true width; an outline for level ones.
fn draw_portal(out: &mut String, world: &World, id: PortalId, storey: &Storey, y: f64) {
    let portal = &world.graph[id];
    let outline: Vec<DVec3> = portal
        .outline
        .iter()
        .map(|p| DVec3::from_array(p.map(f64::from)))
        .collect();
    let low = outline.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    let high = outline
        .iter()
        .map(|p| p.y)
        .fold(f64::NEG_INFINITY, f64::max);
    let kind = match portal.kind {
        PortalKind::Open => "open",
        PortalKind::Door => "door",
        PortalKind::Window => "window",
        PortalKind::Crack => "crack",
    };
    let [one, other] = portal.cells.map(|c| escaped(&world.graph[c].name));
    let title = format!("{id}, {one} and {other}");
    // Half a meter: a hole in a floor belongs to the storeys on both sides of that floor.
    let is_near = high > storey.floor - 0.5 && low < storey.top + 0.5;
    let is_level = portal.normal[1].abs() > 0.7;
    if is_level {
        if is_near {
            let flat: Vec<DVec2> = outline.iter().map(|p| DVec2::new(p.x, p.z)).collect();
            let class = if kind == "crack" { "crack" } else { "stair" };
            let _ = writeln!(
                out,
                "<path class=\"{class}\" fill=\"none\" d=\"{}\"><title>{title}</title></path>",
                closed(&flat)
            );
        }
        return;
    }
    let pieces = portal.pieces.iter().filter_map(|piece| {
        let corners: Vec<DVec3> = piece
            .iter()
            .map(|p| DVec3::from_array(p.map(f64::from)))
            .collect();
        cut(&corners, y)
    });
    let mut segments: Vec<(DVec2, DVec2)> = pieces.collect();
    let mut class = kind;
    if segments.is_empty() {
        // Not cut: what is in the storey all the same, by half of its height at least (a lintel
        // may hang through a ceiling, and a sill stand in the floor), is drawn as wide as it is.
        let is_inside = high.min(storey.top) - low.max(storey.floor) > 0.5 * (high - low);
        if !is_inside {
            return;
        }
        if matches!(portal.kind, PortalKind::Open | PortalKind::Door) {
            class = "low";
        }
        let across = DVec2::new(-f64::from(portal.normal[2]), f64::from(portal.normal[0]));
        let flat = outline.iter().map(|p| DVec2::new(p.x, p.z));
        let first = flat
            .clone()
            .min_by(|a, b| across.dot(*a).total_cmp(&across.dot(*b)));
        let last = flat.max_by(|a, b| across.dot(*a).total_cmp(&across.dot(*b)));
        segments.extend(first.zip(last));
    }
    let path: String = joined(&segments).iter().map(|s| line(s.0, s.1)).collect();
    let _ = writeln!(
        out,
        "<path class=\"{class}\" d=\"{path}\"><title>{title}</title></path>"
    );
}

/// Joins touching segments of one line.
fn joined(segments: &[(DVec2, DVec2)]) -> Vec<(DVec2, DVec2)> {
    let Some(longest) = segments.iter().max_by(|a, b| {
        a.0.distance_squared(a.1)
            .total_cmp(&b.0.distance_squared(b.1))
    }) else {
        return Vec::new();
    };
    let along = (longest.1 - longest.0).normalize_or(DVec2::X);
    let mut sorted: Vec<(DVec2, DVec2)> = segments
        .iter()
        .map(|&(a, b)| {
            if along.dot(a) <= along.dot(b) {
                (a, b)
            } else {
                (b, a)
            }
        })
        .collect();
    sorted.sort_by(|a, b| along.dot(a.0).total_cmp(&along.dot(b.0)));
    let mut out: Vec<(DVec2, DVec2)> = Vec::new();
    for (a, b) in sorted {
        match out.last_mut() {
            // A millimeter: as far as is drawn.
            Some(last) if along.dot(a) <= along.dot(last.1) + 1e-3 => {
                if along.dot(b) > along.dot(last.1) {
                    last.1 = b;
                }
            }
            _ => out.push((a, b)),
        }
    }
    out
}

/// Footprints of the detail objects that stand in the storey.
fn draw_details(out: &mut String, world: &World, storey: &Storey, y: f64) {
    let plane = Plane {
        normal: DVec3::Y,
        d: 0.0,
    };
    for detail in &world.details {
        let place = DMat4::from_cols_array(&detail.transform.map(f64::from));
        let mesh = &world.detail_meshes[detail.mesh as usize];
        let mut bounds = enfilade_geom::Aabb::EMPTY;
        for p in mesh.primitives.iter().flat_map(|p| &p.positions) {
            bounds = bounds.including(DVec3::from_array(p.map(f64::from)));
        }
        if bounds.is_empty() {
            continue;
        }
        let corners: Vec<DVec3> = (0..8)
            .map(|k| {
                let pick = |axis: usize| {
                    if k >> axis & 1 == 0 {
                        bounds.min[axis]
                    } else {
                        bounds.max[axis]
                    }
                };
                place.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
            })
            .collect();
        let low = corners.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        let high = corners
            .iter()
            .map(|p| p.y)
            .fold(f64::NEG_INFINITY, f64::max);
        // What hangs above the cut is not seen from it.
        if low >= y || high <= storey.floor {
            continue;
        }
        let level: Vec<DVec3> = corners.iter().map(|p| DVec3::new(p.x, 0.0, p.z)).collect();
        let hull = Winding::hull_in_plane(&plane, &level);
        let flat: Vec<DVec2> = hull.points.iter().map(|p| DVec2::new(p.x, p.z)).collect();
        if flat.len() >= 3 {
            let _ = writeln!(
                out,
                "<path class=\"detail\" d=\"{}\"><title>{}</title></path>",
                closed(&flat),
                escaped(&detail.name)
            );
        }
    }
}

/// Scale bar and legend.
fn draw_foot(out: &mut String, at: DVec2, zoom: f64) {
    let _ = writeln!(
        out,
        "<g transform=\"translate({}) scale({zoom})\">",
        point(at)
    );
    for k in 0..5 {
        let fill = if k % 2 == 0 { "#000" } else { "#fff" };
        let _ = writeln!(
            out,
            "<rect x=\"{}\" y=\"0\" width=\"100\" height=\"12\" fill=\"{fill}\" stroke=\"#000\" stroke-width=\"1\"/>",
            k * 100
        );
    }
    text(out, DVec2::new(0.0, 0.4), 22.0, "middle", "0");
    text(
        out,
        DVec2::new(5.0, 0.4),
        22.0,
        "middle",
        &format!("{} m", 5.0 * zoom),
    );
    let entries = [
        ("open", "opening"),
        ("door", "door"),
        ("window", "window"),
        ("crack", "crack"),
        ("low", "opening not cut"),
        ("stair", "hole in floor or ceiling"),
    ];
    for (k, (class, words)) in entries.iter().enumerate() {
        let (x, z) = ((k % 3) as f64 * 2.2, 0.75 + 0.4 * (k / 3) as f64);
        let path = line(DVec2::new(x, z - 0.07), DVec2::new(x + 0.35, z - 0.07));
        let _ = writeln!(out, "<path class=\"{class}\" d=\"{path}\"/>");
        text(out, DVec2::new(x + 0.42, z), 16.0, "start", words);
    }
    out.push_str("</g>\n");
}

fn text(out: &mut String, at: DVec2, size: f64, anchor: &str, words: &str) {
    let _ = writeln!(
        out,
        "<text x=\"{}\" y=\"{}\" font-size=\"{}\" text-anchor=\"{anchor}\">{}</text>",
        number(at.x * SCALE),
        number(at.y * SCALE),
        number(size),
        escaped(words)
    );
}
