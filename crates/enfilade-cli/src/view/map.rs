//! The map in the window: a level cut at the eye's height, from the locator.

use egui::{Align2, Color32, ColorImage, Pos2, Rect, Stroke, TextureHandle, TextureOptions, Vec2};
use enfilade::cpg::{Cell, CellId, World, cell_color};
use enfilade::geom::{DVec3, shown};
use enfilade_render::Camera;

use crate::living::{Blip, BlipKind, RADAR_REACH};

/// Most points along the longer side of the map.
const POINTS: f32 = 360.0;
/// The cut is remade when the eye has moved up or down by this. [Units: wu]
const STEP: f32 = 0.25;
/// Cells smaller than this on the map get no name. [Units: px²]
const ROOM_FOR_A_NAME: f32 = 900.0;

/// Things higher or lower than this are on another storey. [Units: wu]
const STOREY: f64 = 2.0;

/// State of a frame that the map shows.
pub(super) struct MapShown<'a> {
    pub(super) camera: Camera,
    /// Visible cells, ascending.
    pub(super) cells: &'a [u32],
    pub(super) closed: &'a [u32],
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

/// Cells and portals as seen from above.
pub(super) struct Map {
    names: Vec<String>,
    is_room: Vec<bool>,
    /// For each portal: two ends and the height range.
    portals: Vec<([f32; 2], [f32; 2], [f32; 2])>,
    low: [f32; 2],
    high: [f32; 2],
    /// Points in a row, and number of rows.
    n: [usize; 2],
    /// Height of the cut, and the cell of each of its points.
    cut: Option<(f32, Vec<Option<CellId>>)>,
    labels: Vec<Label>,
    /// The cut in colors, and the cells visible in it.
    picture: Option<(TextureHandle, Vec<u32>)>,
}

impl Map {
    pub(super) fn new(world: &World) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        for (_, cell) in world.graph.indoor_cells() {
            for (k, axis) in [0, 2].into_iter().enumerate() {
                // With a margin for outer walls.
                low[k] = low[k].min(cell.aabb[0][axis] - 0.5);
                high[k] = high[k].max(cell.aabb[1][axis] + 0.5);
            }
        }
        let portals = world.graph.portals.iter().map(|p| {
            let flat = |c: &[f32; 3]| [c[0], c[2]];
            // The two vertices farthest apart, seen from above.
            let mut ends = ([0.0; 2], [0.0; 2]);
            let mut longest = -1.0;
            let (mut bottom, mut top) = (f32::INFINITY, f32::NEG_INFINITY);
            for a in &p.outline {
                (bottom, top) = (bottom.min(a[1]), top.max(a[1]));
                for b in &p.outline {
                    let d = (a[0] - b[0]).hypot(a[2] - b[2]);
                    if d > longest {
                        (longest, ends) = (d, (flat(a), flat(b)));
                    }
                }
            }
            (ends.0, ends.1, [bottom, top])
        });
        let size = [high[0] - low[0], high[1] - low[1]];
        let density = POINTS / size[0].max(size[1]).max(0.1);
        Self {
            names: (world.graph.cells.iter())
                .map(|c| shown(&c.name).to_string())
                .collect(),
            is_room: world.graph.cells.iter().map(Cell::is_place).collect(),
            portals: portals.collect(),
            n: size.map(|s| (s * density).max(1.0) as usize),
            low,
            high,
            cut: None,
            labels: Vec::new(),
            picture: None,
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

    /// Cuts the world again if the eye is at another height.
    pub(super) fn follow(&mut self, world: &World, eye: [f32; 3]) {
        let is_near = |cut: &(f32, _)| (cut.0 - eye[1]).abs() < STEP;
        if self.is_empty() || self.cut.as_ref().is_some_and(is_near) {
            return;
        }
        let cells: Vec<Option<CellId>> = (0..self.n[0] * self.n[1])
            .map(|i| {
                let [x, z] = self.point(i);
                let p = DVec3::new(f64::from(x), f64::from(eye[1]), f64::from(z));
                (world.graph.locator.locate(p)).filter(|c| !world.graph[*c].outdoor)
            })
            .collect();
        let mut sums = vec![([0.0_f32; 2], 0_u32); self.names.len()];
        for (i, cell) in cells.iter().enumerate() {
            if let Some(cell) = cell {
                let p = self.point(i);
                let (sum, n) = &mut sums[cell.idx()];
                (*sum, *n) = ([sum[0] + p[0], sum[1] + p[1]], *n + 1);
            }
        }
        // The middle of an L-shaped room may lie in another cell.
        let mut nearest = vec![(f32::INFINITY, [0.0; 2]); self.names.len()];
        for (i, cell) in cells.iter().enumerate() {
            if let Some(cell) = cell {
                let (p, (sum, n)) = (self.point(i), sums[cell.idx()]);
                let d = (p[0] - sum[0] / n as f32).hypot(p[1] - sum[1] / n as f32);
                if d < nearest[cell.idx()].0 {
                    nearest[cell.idx()] = (d, p);
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
        self.cut = Some((eye[1], cells));
        self.picture = None;
    }

    /// Colors the cut: visible cells are bright.
    fn paint(&mut self, context: &egui::Context, seen: &[u32]) {
        let Some((_, cells)) = &self.cut else { return };
        if self.picture.as_ref().is_some_and(|(_, of)| of == seen) {
            return;
        }
        let color = |cell: &Option<CellId>| {
            let Some(cell) = cell else {
                return Color32::TRANSPARENT;
            };
            let [r, g, b] = cell_color(*cell);
            let is_seen = seen.binary_search(&cell.0).is_ok();
            Color32::from_rgba_unmultiplied(r, g, b, if is_seen { 215 } else { 60 })
        };
        let pixels = cells.iter().map(color).collect();
        let image = ColorImage::new(self.n, pixels);
        let texture = context.load_texture("map", image, TextureOptions::LINEAR);
        self.picture = Some((texture, seen.to_vec()));
    }

    pub(super) fn draw(&mut self, painter: &egui::Painter, area: Rect, shown: &MapShown<'_>) {
        painter.rect_filled(area, 4.0, Color32::from_black_alpha(170));
        if self.is_empty() {
            return;
        }
        self.paint(painter.ctx(), shown.cells);
        let painter = painter.with_clip_rect(area.intersect(painter.clip_rect()));
        let size = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        let whole = ((area.width() - 12.0) / size[0]).min((area.height() - 12.0) / size[1]);
        let scale = whole * shown.zoom;
        let eye = [shown.camera.eye[0], shown.camera.eye[2]];
        // Around the eye, but no farther out than the map reaches.
        let middle = [0, 1].map(|k| {
            let half = [area.width(), area.height()][k] * 0.5 / scale;
            let (least, most) = (self.low[k] + half, self.high[k] - half);
            if least < most {
                eye[k].clamp(least, most)
            } else {
                (self.low[k] + self.high[k]) * 0.5
            }
        });
        let place = |p: [f32; 2]| -> Pos2 {
            area.center() + Vec2::from([p[0] - middle[0], p[1] - middle[1]]) * scale
        };
        if let Some((picture, _)) = &self.picture {
            let rect = Rect::from_two_pos(place(self.low), place(self.high));
            let all = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            painter.image(picture.id(), rect, all, Color32::WHITE);
        }
        let y = shown.camera.eye[1];
        for (i, (a, b, [bottom, top])) in (0..).zip(&self.portals) {
            if y < *bottom - 1.0 || y > *top + 1.0 {
                continue;
            }
            let color = if shown.closed.contains(&i) {
                Color32::RED
            } else {
                Color32::from_rgb(255, 150, 30)
            };
            painter.line_segment([place(*a), place(*b)], Stroke::new(2.0, color));
        }
        // The screen points that one point of the cut covers.
        let cover = scale * scale * size[0] * size[1] / (self.n[0] * self.n[1]) as f32;
        for label in &self.labels {
            let is_room = self.is_room[label.cell as usize];
            if !is_room || (label.n as f32) * cover < ROOM_FOR_A_NAME {
                continue;
            }
            let font = egui::FontId::proportional(11.0);
            let name = &self.names[label.cell as usize];
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

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::{GridParams, room_grid};

    #[test]
    fn the_map_shows_the_cells_at_the_eyes_height_where_they_are() {
        let world = room_grid(&GridParams::offices(24, 2));
        let mut map = Map::new(&world);
        for (id, cell) in world.graph.indoor_cells() {
            let middle = [0, 1, 2].map(|k| (cell.aabb[0][k] + cell.aabb[1][k]) * 0.5);
            map.follow(&world, middle);
            let (_, cells) = map.cut.as_ref().unwrap();
            let of_it: Vec<[f32; 2]> = (0..cells.len())
                .filter(|&i| cells[i] == Some(id))
                .map(|i| map.point(i))
                .collect();
            assert!(!of_it.is_empty(), "{id}");
            let is_inside = |p: &[f32; 2]| {
                let [low, high] = cell.aabb;
                p[0] >= low[0] && p[0] <= high[0] && p[1] >= low[2] && p[1] <= high[2]
            };
            assert!(of_it.iter().all(is_inside));
            let label = map.labels.iter().find(|l| l.cell == id.0).unwrap();
            assert!(is_inside(&label.at), "its name stands in it");
        }
    }
}
