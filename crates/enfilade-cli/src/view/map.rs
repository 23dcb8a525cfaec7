//! The map in the window: a level cut at the eye's height, from the locator.

use egui::{Align2, Color32, ColorImage, Pos2, Rect, Stroke, TextureHandle, TextureOptions, Vec2};
use enfilade::cpg::{CellId, PortalId, cell_color};
use enfilade::geom::{Aabb, DVec3};
use enfilade::world::{PartId, Place, Space};
use enfilade_render::Camera;

use super::titles::Titles;
use crate::living::{Blip, BlipKind, RADAR_REACH};

/// Most points along the longer side of the map.
const POINTS: f32 = 360.0;
/// The cut is remade when the eye has moved up or down by this. [Units: wu]
const STEP: f32 = 0.25;
/// Cells smaller than this on the map get no name. [Units: px²]
const ROOM_FOR_A_NAME: f32 = 900.0;

/// Things higher or lower than this are on another storey. [Units: wu]
const STOREY: f64 = 2.0;

/// Points of the cut that are found in a frame, so that no frame waits for the map.
const SLICE: usize = 4096;

/// State of a frame that the map shows.
pub(super) struct MapShown<'a> {
    pub(super) camera: Camera,
    /// [Numbers](Space::cell_number) of visible cells, ascending.
    pub(super) cells: &'a [u32],
    /// Ascending.
    pub(super) closed: &'a [(PartId, PortalId)],
    /// 1 for the whole world; more for the surroundings of the eye.
    pub(super) zoom: f32,
    /// Things on the radar; none if it is off.
    pub(super) blips: &'a [Blip],
}

/// A name on the map: the point of the cell nearest to its middle, and the number of points of the cell.
struct Label {
    cell: u32,
    at: [f32; 2],
    n: u32,
}

/// A portal from above: two ends, and the height range.
struct Line {
    of: (PartId, PortalId),
    ends: [[f32; 2]; 2],
    heights: [f32; 2],
}

/// Cells and portals as seen from above.
#[derive(Default)]
pub(super) struct Map {
    sheet: Option<Sheet>,
    /// The next one, as far as it is found.
    begun: Option<Sheet>,
    /// `true` if the world has changed since.
    is_stale: bool,
    /// `true` if parts are on it: in levels, where they stay where they are.
    has_parts: bool,
    /// The cut in colors, and the cells visible in it.
    picture: Option<(TextureHandle, Vec<u32>)>,
}

/// A map at one height.
struct Sheet {
    names: Vec<String>,
    is_room: Vec<bool>,
    portals: Vec<Line>,
    low: [f32; 2],
    high: [f32; 2],
    /// Points in a row, and number of rows.
    n: [usize; 2],
    /// Height of the cut, and the cell of each of its points.
    height: f32,
    cells: Vec<Option<u32>>,
    labels: Vec<Label>,
}

impl Map {
    /// Finds the map anew, with what stands in the world if `has_parts`. The old one is shown until that is done.
    pub(super) fn renew(&mut self, has_parts: bool) {
        (self.is_stale, self.begun, self.has_parts) = (true, None, has_parts);
    }

    /// Goes on with a map for the height of the eye, for a while.
    pub(super) fn follow(&mut self, space: &Space, titles: &Titles, eye: [f32; 3]) {
        let is_near = |sheet: &Sheet| (sheet.height - eye[1]).abs() < STEP;
        if self.begun.is_none() {
            if !self.is_stale && self.sheet.as_ref().is_some_and(is_near) {
                return;
            }
            self.is_stale = false;
            self.begun = Some(Sheet::begin(space, titles, self.has_parts, eye[1]));
        }
        if let Some(mut sheet) = self.begun.take_if(|sheet| sheet.advance(space)) {
            sheet.label();
            (self.sheet, self.picture) = (Some(sheet), None);
        }
    }

    /// Colors the cut: visible cells are bright.
    fn paint(&mut self, context: &egui::Context, seen: &[u32]) {
        let Some(sheet) = self.sheet.as_ref().filter(|sheet| !sheet.is_empty()) else {
            return;
        };
        if self.picture.as_ref().is_some_and(|(_, of)| of == seen) {
            return;
        }
        let color = |cell: &Option<u32>| {
            let Some(cell) = cell else {
                return Color32::TRANSPARENT;
            };
            let [r, g, b] = cell_color(CellId(*cell));
            let is_seen = seen.binary_search(cell).is_ok();
            Color32::from_rgba_unmultiplied(r, g, b, if is_seen { 215 } else { 60 })
        };
        let pixels = sheet.cells.iter().map(color).collect();
        let image = ColorImage::new(sheet.n, pixels);
        let texture = context.load_texture("map", image, TextureOptions::LINEAR);
        self.picture = Some((texture, seen.to_vec()));
    }

    pub(super) fn draw(&mut self, painter: &egui::Painter, area: Rect, shown: &MapShown<'_>) {
        painter.rect_filled(area, 4.0, Color32::from_black_alpha(170));
        self.paint(painter.ctx(), shown.cells);
        let Some(sheet) = self.sheet.as_ref().filter(|sheet| !sheet.is_empty()) else {
            return;
        };
        let painter = painter.with_clip_rect(area.intersect(painter.clip_rect()));
        let size = [sheet.high[0] - sheet.low[0], sheet.high[1] - sheet.low[1]];
        let whole = ((area.width() - 12.0) / size[0]).min((area.height() - 12.0) / size[1]);
        let scale = whole * shown.zoom;
        let eye = [shown.camera.eye[0], shown.camera.eye[2]];
        // Around the eye, but no farther out than the map reaches.
        let middle = [0, 1].map(|k| {
            let half = [area.width(), area.height()][k] * 0.5 / scale;
            let (least, most) = (sheet.low[k] + half, sheet.high[k] - half);
            if least < most {
                eye[k].clamp(least, most)
            } else {
                (sheet.low[k] + sheet.high[k]) * 0.5
            }
        });
        let place = |p: [f32; 2]| -> Pos2 {
            area.center() + Vec2::from([p[0] - middle[0], p[1] - middle[1]]) * scale
        };
        if let Some((picture, _)) = &self.picture {
            let rect = Rect::from_two_pos(place(sheet.low), place(sheet.high));
            let all = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            painter.image(picture.id(), rect, all, Color32::WHITE);
        }
        let y = shown.camera.eye[1];
        for line in &sheet.portals {
            let [bottom, top] = line.heights;
            if y < bottom - 1.0 || y > top + 1.0 {
                continue;
            }
            let color = if shown.closed.binary_search(&line.of).is_ok() {
                Color32::RED
            } else {
                Color32::from_rgb(255, 150, 30)
            };
            painter.line_segment(line.ends.map(place), Stroke::new(2.0, color));
        }
        // The screen points that one point of the cut covers.
        let cover = scale * scale * size[0] * size[1] / (sheet.n[0] * sheet.n[1]) as f32;
        for label in &sheet.labels {
            let is_room = sheet.is_room[label.cell as usize];
            if !is_room || (label.n as f32) * cover < ROOM_FOR_A_NAME {
                continue;
            }
            let font = egui::FontId::proportional(11.0);
            let name = &sheet.names[label.cell as usize];
            let at = place(label.at);
            let shadow = at + Vec2::splat(1.0);
            painter.text(
                shadow,
                Align2::CENTER_CENTER,
                name,
                font.clone(),
                Color32::BLACK,
            );
            painter.text(at, Align2::CENTER_CENTER, name, font, Color32::WHITE);
        }
        for blip in shown.blips {
            let at = place([blip.at.x as f32, blip.at.z as f32]);
            let (radius, color) = match blip.kind {
                BlipKind::Person => (4.0, Color32::from_rgb(90, 230, 255)),
                BlipKind::Lamp => (2.5, Color32::from_rgb(255, 235, 90)),
                BlipKind::Sound => (4.0, Color32::from_rgb(255, 110, 220)),
            };
            // A ring is asleep; what is on another storey is small.
            let is_here = (blip.at.y - f64::from(y)).abs() < STOREY;
            let radius = if is_here { radius } else { 0.6 * radius };
            painter.circle_stroke(at, radius, Stroke::new(3.0, Color32::BLACK));
            painter.circle_stroke(at, radius, Stroke::new(1.5, color));
            if blip.is_awake {
                painter.circle_filled(at, radius, color);
            }
        }
        if !shown.blips.is_empty() {
            let reach = RADAR_REACH as f32 * scale;
            painter.circle_stroke(
                place(eye),
                reach,
                Stroke::new(1.0, Color32::from_white_alpha(90)),
            );
        }
        let at = place(eye);
        let ahead = Vec2::new(shown.camera.toward[0], shown.camera.toward[2]).normalized() * 14.0;
        painter.line_segment([at, at + ahead], Stroke::new(2.0, Color32::WHITE));
        painter.circle_filled(at, 4.0, Color32::WHITE);
    }
}

impl Sheet {
    fn begin(space: &Space, titles: &Titles, has_parts: bool, height: f32) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let (mut names, mut is_room, mut portals) = (Vec::new(), Vec::new(), Vec::new());
        let n_parts = if has_parts { space.n_parts() } else { 1 };
        for part in (0..n_parts as u32).map(PartId) {
            let (graph, pose) = (&space.world(part).graph, space.pose(part));
            for cell in graph.cell_ids() {
                names.push(titles.of(space, Place { part, cell }));
                is_room.push(graph[cell].is_place());
            }
            if !space.is_present(part) {
                continue;
            }
            for (_, cell) in graph.indoor_cells() {
                let box_of = Aabb::of_points(&cell.aabb.map(|p| DVec3::from(p.map(f64::from))));
                let bounds = Aabb::of_points(&box_of.corners().map(|p| pose.point(p)));
                for (k, axis) in [0, 2].into_iter().enumerate() {
                    // With a margin for outer walls.
                    low[k] = low[k].min(bounds.min[axis] as f32 - 0.5);
                    high[k] = high[k].max(bounds.max[axis] as f32 + 0.5);
                }
            }
            // A doorway of a part that is shut is one in front of a wall.
            let state = space.state(part);
            let is_way = |p: &PortalId| part == PartId::ROOT || state.is_open(*p);
            let ways = graph.portal_ids().filter(is_way);
            portals.extend(ways.map(|portal| {
                let outline = graph[portal].outline.iter();
                let outline = outline.map(|p| pose.point(DVec3::from(p.map(f64::from))));
                Line::of(part, portal, &outline.collect::<Vec<_>>())
            }));
        }
        let size = [high[0] - low[0], high[1] - low[1]];
        let density = POINTS / size[0].max(size[1]).max(0.1);
        Self {
            names,
            is_room,
            portals,
            n: size.map(|s| (s * density).max(1.0) as usize),
            low,
            high,
            height,
            cells: Vec::new(),
            labels: Vec::new(),
        }
    }

    fn is_empty(&self) -> bool {
        self.low[0] >= self.high[0]
    }

    /// The center of a point of the cut. [Units: wu]
    fn point(&self, i: usize) -> [f32; 2] {
        let at = [i % self.n[0], i / self.n[0]];
        [0, 1].map(|k| {
            let t = (at[k] as f32 + 0.5) / self.n[k] as f32;
            self.low[k] + (self.high[k] - self.low[k]) * t
        })
    }

    /// Finds the cells of some more points; returns `true` if there are no others.
    fn advance(&mut self, space: &Space) -> bool {
        if self.is_empty() {
            return true;
        }
        let n = self.n[0] * self.n[1];
        for i in self.cells.len()..n.min(self.cells.len() + SLICE) {
            let [x, z] = self.point(i);
            let p = DVec3::new(f64::from(x), f64::from(self.height), f64::from(z));
            let place = space.locate(PartId::ROOT, p);
            let indoors = place.filter(|p| !space.world(p.part).graph[p.cell].outdoor);
            let number = indoors.map(|place| space.cell_number(place));
            // Parts that are not on the map have no names.
            let named = number.filter(|number| (*number as usize) < self.names.len());
            self.cells.push(named);
        }
        self.cells.len() == n
    }

    /// Finds the places of names.
    fn label(&mut self) {
        let mut sums = vec![([0.0_f32; 2], 0_u32); self.names.len()];
        for (i, cell) in self.cells.iter().enumerate() {
            if let Some(cell) = cell {
                let p = self.point(i);
                let (sum, n) = &mut sums[*cell as usize];
                (*sum, *n) = ([sum[0] + p[0], sum[1] + p[1]], *n + 1);
            }
        }
        // The middle of an L-shaped room may lie in another cell.
        let mut nearest = vec![(f32::INFINITY, [0.0; 2]); self.names.len()];
        for (i, cell) in self.cells.iter().enumerate() {
            if let Some(cell) = cell {
                let cell = *cell as usize;
                let (p, (sum, n)) = (self.point(i), sums[cell]);
                let d = (p[0] - sum[0] / n as f32).hypot(p[1] - sum[1] / n as f32);
                if d < nearest[cell].0 {
                    nearest[cell] = (d, p);
                }
            }
        }
        self.labels = (0..)
            .zip(sums.iter().zip(&nearest))
            .filter(|(_, ((_, n), _))| *n > 0)
            .map(|(cell, ((_, n), (_, at)))| Label {
                cell,
                at: *at,
                n: *n,
            })
            .collect();
    }
}

impl Line {
    fn of(part: PartId, portal: PortalId, outline: &[DVec3]) -> Self {
        let flat = |p: &DVec3| [p.x as f32, p.z as f32];
        // The two vertices farthest apart, seen from above.
        let mut ends = [[0.0; 2]; 2];
        let mut longest = -1.0;
        let (mut bottom, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        for a in outline {
            (bottom, top) = (bottom.min(a.y), top.max(a.y));
            for b in outline {
                let d = (a.x - b.x).hypot(a.z - b.z);
                if d > longest {
                    (longest, ends) = (d, [flat(a), flat(b)]);
                }
            }
        }
        Self {
            of: (part, portal),
            ends,
            heights: [bottom as f32, top as f32],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::{GridParams, room_grid};

    #[test]
    fn the_map_shows_the_cells_at_the_eyes_height_where_they_are() {
        let world = room_grid(&GridParams::offices(24, 2));
        let space = Space::new(world.clone()).unwrap();
        let mut map = Map::default();
        for (id, cell) in world.graph.indoor_cells() {
            let middle = [0, 1, 2].map(|k| (cell.aabb[0][k] + cell.aabb[1][k]) * 0.5);
            map.follow(&space, &Titles::default(), middle);
            while map.begun.is_some() {
                map.follow(&space, &Titles::default(), middle);
            }
            let sheet = map.sheet.as_ref().unwrap();
            let of_it: Vec<[f32; 2]> = (0..sheet.cells.len())
                .filter(|&i| sheet.cells[i] == Some(id.0))
                .map(|i| sheet.point(i))
                .collect();
            assert!(!of_it.is_empty(), "{id}");
            let is_inside = |p: &[f32; 2]| {
                let [low, high] = cell.aabb;
                p[0] >= low[0] && p[0] <= high[0] && p[1] >= low[2] && p[1] <= high[2]
            };
            assert!(of_it.iter().all(is_inside));
            let label = sheet.labels.iter().find(|l| l.cell == id.0).unwrap();
            assert!(is_inside(&label.at), "its name stands in it");
        }
    }
}
