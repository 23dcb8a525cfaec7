//! The paper's figures 6 to 10 as plots.

use super::Measurements;
use super::plot::{Plot, PlotLine};
use super::series::{DrawMode, Series};
use crate::process::root;

/// A figure of the paper.
struct PaperFigure {
    number: u32,
    scene: &'static str,
    title: &'static str,
    quantity: Quantity,
    modes: &'static [DrawMode],
}

#[derive(Clone, Copy)]
enum Quantity {
    Triangles,
    Times,
}

impl Quantity {
    fn label(self) -> &'static str {
        match self {
            Self::Triangles => "triangles drawn, in thousands",
            Self::Times => "frame time in ms",
        }
    }

    fn of(self, series: &Series) -> Vec<f64> {
        let (values, scale) = match self {
            Self::Triangles => (&series.triangles, 1e-3),
            Self::Times => (&series.seconds, 1e3),
        };
        values.iter().map(|x| x * scale).collect()
    }
}

/// Frames drawn with all pictures made before.
const WARM: &[DrawMode] = &[DrawMode::Frustum, DrawMode::Portals, DrawMode::Warm];
/// Frames that make the pictures they need.
const COLD: &[DrawMode] = &[
    DrawMode::Portals,
    DrawMode::ColdEvery1,
    DrawMode::ColdEvery10,
    DrawMode::Cold,
];

const FIGURES: &[PaperFigure] = &[
    PaperFigure {
        number: 6,
        scene: "brooks",
        title: "Triangles in a house of 528,000",
        quantity: Quantity::Triangles,
        modes: WARM,
    },
    PaperFigure {
        number: 7,
        scene: "brooks",
        title: "Frame times in a house of 528,000 triangles",
        quantity: Quantity::Times,
        modes: WARM,
    },
    PaperFigure {
        number: 8,
        scene: "haunted",
        title: "Triangles in a house of 214,000",
        quantity: Quantity::Triangles,
        modes: WARM,
    },
    PaperFigure {
        number: 9,
        scene: "haunted",
        title: "Frame times in a house of 214,000 triangles",
        quantity: Quantity::Times,
        modes: WARM,
    },
    PaperFigure {
        number: 10,
        scene: "brooks",
        title: "Frame times with a cold cache, 528,000 triangles",
        quantity: Quantity::Times,
        modes: COLD,
    },
];

/// Plots the figures of a scene; writes them to docs/images if asked.
pub(super) fn draw(all: &mut Measurements<'_>, scene: &str) -> anyhow::Result<()> {
    for figure in FIGURES.iter().filter(|f| f.scene == scene) {
        let mut lines = Vec::new();
        for mode in figure.modes.iter().copied() {
            let Some(series) = all.series("figures", scene, mode)? else {
                return Ok(());
            };
            lines.push(PlotLine {
                label: mode.label(),
                values: figure.quantity.of(series),
            });
        }
        let plot = Plot {
            title: figure.title,
            x: "frame",
            y: figure.quantity.label(),
            lines: &lines,
        };
        let name = format!("portal-textures-{}.svg", figure.number);
        if all.state.options.write {
            std::fs::write(root().join("docs/images").join(&name), plot.to_svg())?;
        }
        let n_empty = lines.iter().filter(|l| l.values.is_empty()).count();
        let note = format!("{name}: {}", figure.title);
        let row = format!("figure {}: lines without frames", figure.number);
        all.at_most(&row, scene, n_empty as f64, 0.0, &note);
    }
    Ok(())
}
