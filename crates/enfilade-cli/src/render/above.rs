//! Pictures from above, with the view frozen.

use enfilade::cpg::World;
use enfilade_render::{Camera, Frame, MarkShape, Picture, PictureMark, Projection, Studio, Style};

use super::light;

/// Draws the world from above with the view frozen: what is drawn, and what is culled and why.
pub(crate) fn above(
    studio: &mut Studio,
    world: &World,
    camera: &Camera,
    cut: Option<f32>,
    size: [u32; 2],
) -> anyhow::Result<Picture> {
    let aspect = size[0] as f32 / size[1] as f32;
    let view = camera.view(aspect.max(1.0))?;
    light(studio, world)?;
    let list = studio.everything();
    let seen = studio.viewer.see(&studio.sight, &studio.state, &view);
    let cut = cut.unwrap_or(camera.eye[1] + 0.5);
    let width = size[1] as f32 / 260.0;
    let line = |shape, color, width| PictureMark {
        shape,
        color,
        width,
        on_top: true,
    };
    let mut marks = Vec::new();
    // Walls along the view have no visible side: draw their edges at the cut.
    for segment in section(world, cut) {
        marks.push(line(
            MarkShape::Line(segment),
            [0.03, 0.03, 0.04, 1.0],
            width * 0.6,
        ));
    }
    for p in seen.portals() {
        let outline = &world.graph[*p].outline;
        // An upright portal is drawn where the walls beside it are cut: its outline would lean over the floor.
        let shape = match across(outline, cut) {
            Some(segment) => MarkShape::Line(segment),
            None => MarkShape::Outline(outline.clone()),
        };
        marks.push(line(shape, [0.93, 0.45, 0.05, 1.0], 2.0 * width));
    }
    // Pictures from above show rooms, not the ground around them.
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for (_, cell) in world.graph.indoor_cells() {
        for k in 0..3 {
            low[k] = low[k].min(cell.aabb[0][k]);
            high[k] = high[k].max(cell.aabb[1][k]);
        }
    }
    if low[0] > high[0] {
        [low, high] = studio.world.bounds();
    }
    let center = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
    let [x, z] = [high[0] - low[0], high[2] - low[2]];
    let reach = x.hypot(z);
    let corners = camera.corners(aspect.max(1.0));
    for corner in [corners[0], corners[2]] {
        let end = edge_of(camera.eye, corner.to_array(), [low, high], 0.02 * reach);
        marks.push(line(
            MarkShape::Line([camera.eye, end]),
            [0.05, 0.30, 0.62, 0.9],
            width,
        ));
    }
    let ring: Vec<[f32; 3]> = (0..24)
        .map(|i| {
            let a = i as f32 / 24.0 * std::f32::consts::TAU;
            let r = reach * 0.008;
            [
                camera.eye[0] + a.cos() * r,
                camera.eye[1],
                camera.eye[2] + a.sin() * r,
            ]
        })
        .collect();
    marks.push(line(MarkShape::Area(ring), [0.05, 0.30, 0.62, 1.0], 0.0));
    // Slightly oblique, so that walls have a side.
    let toward = [0.0, -1.0, -0.38];
    let height = (z * 0.94 + (high[1] - low[1]) * 0.38).max(x / aspect) * 1.06;
    let projection = Projection::parallel(center, toward, height, aspect, reach.max(50.0) * 2.0);
    let style = Style {
        shadows: false,
        daylight: false,
        cut_above: cut,
        ..Style::default()
    };
    let frame = Frame {
        projection,
        list: &list,
        // Drawn parts keep their look; a floor of many rooms has no single cell's color.
        style,
        marks: &marks,
    };
    Ok(studio.explained(&view, &frame, size)?)
}

/// The end of a level line from an eye along `d`, a little `beyond` the bounds of the rooms.
fn edge_of(eye: [f32; 3], d: [f32; 3], [low, high]: [[f32; 3]; 2], beyond: f32) -> [f32; 3] {
    let flat = d[0].hypot(d[2]).max(1e-6);
    let length = |k: usize| {
        let bound = if d[k] > 0.0 {
            high[k] + beyond
        } else {
            low[k] - beyond
        };
        if d[k] == 0.0 {
            f32::INFINITY
        } else {
            (bound - eye[k]) / (d[k] / flat)
        }
    };
    let length = length(0).min(length(2)).max(0.0);
    let length = if length.is_finite() { length } else { 0.0 };
    [
        eye[0] + d[0] / flat * length,
        eye[1],
        eye[2] + d[2] / flat * length,
    ]
}

/// The segment of an upright portal at a height, or else along its upper edge; `None` for a level one.
fn across(outline: &[[f32; 3]], height: f32) -> Option<[[f32; 3]; 2]> {
    let bounds = |k: usize| {
        let values = || outline.iter().map(move |p| p[k]);
        [
            values().fold(f32::INFINITY, f32::min),
            values().fold(f32::NEG_INFINITY, f32::max),
        ]
    };
    let [low, high] = bounds(1);
    let level = height.clamp(low, high);
    let along = |p: &[f32; 3]| (p[0], p[2]);
    let first = outline.first().map(along)?;
    let far = |from: (f32, f32)| {
        let distance = move |p: &(f32, f32)| (p.0 - from.0).hypot(p.1 - from.1);
        outline
            .iter()
            .map(along)
            .max_by(move |a, b| distance(a).total_cmp(&distance(b)))
    };
    let a = far(first)?;
    let b = far(a)?;
    // A level portal is as deep as it is wide.
    let is_upright = high - low > 0.3 * (a.0 - b.0).hypot(a.1 - b.1).min(1.0);
    is_upright.then_some([[a.0, level, a.1], [b.0, level, b.1]])
}

/// The segments where a level plane cuts the structure.
fn section(world: &World, height: f32) -> Vec<[[f32; 3]; 2]> {
    let mut out = Vec::new();
    for batch in &world.batches {
        let p = &batch.primitive;
        for t in p.triples() {
            let corners = t.map(|i| p.positions[i as usize]);
            let mut ends = Vec::new();
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                if (a[1] < height) != (b[1] < height) {
                    let s = (height - a[1]) / (b[1] - a[1]);
                    ends.push([0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * s));
                }
            }
            if let [a, b] = ends[..] {
                out.push([a, b]);
            }
        }
    }
    out
}
