//! Pictures from above, with the view frozen.

use enfilade::cpg::World;
use enfilade_render::{Camera, Frame, Mark, MarkShape, Picture, Projection, Studio, Style};

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
    let line = |shape, color, width| Mark {
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
        let outline = world.graph[*p].outline.clone();
        marks.push(line(
            MarkShape::Outline(outline),
            [1.0, 0.42, 0.0, 1.0],
            width,
        ));
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
    for corner in camera.corners(aspect.max(1.0)) {
        let d = corner.to_array();
        let flat = d[0].hypot(d[2]).max(1e-6);
        let end = [0, 1, 2].map(|k| camera.eye[k] + d[k] / flat * reach * [1.0, 0.0, 1.0][k]);
        marks.push(line(
            MarkShape::Line([camera.eye, end]),
            [0.02, 0.30, 0.85, 0.9],
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
    marks.push(line(MarkShape::Area(ring), [0.02, 0.30, 0.85, 1.0], 0.0));
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
