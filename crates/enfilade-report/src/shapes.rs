//! The shapes of a plan, for programs that draw it with means of their own.

use enfilade_cpg::CellId;
use enfilade_geom::DVec2;

use crate::drawing::{Drawing, Item, Rgb};

/// A path of a plan, in the world: +x is right, +z down, as seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanShape {
    /// Its meaning: `cell`, `wall`, `door`, …: the class in the SVG.
    pub class: &'static str,
    /// Color of its inside, and its opacity.
    pub fill: Option<(Rgb, f32)>,
    /// Color of its lines, and their width. [Units: cm]
    pub stroke: Option<(Rgb, f64)>,
    /// Lines; closed ones do not repeat their first point. A point inside an odd number of them is inside. [Units: wu]
    pub lines: Vec<Vec<[f64; 2]>>,
    /// `true` if each line returns to its first point.
    pub is_closed: bool,
    /// The cell that it shows.
    pub cell: Option<CellId>,
}

/// A line of text in a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanLabel {
    /// Middle of its base line. [Units: wu]
    pub at: [f64; 2],
    /// Height of the letters. [Units: wu]
    pub size: f64,
    /// Read from bottom to top.
    pub is_turned: bool,
    /// The text.
    pub text: String,
    /// The cell that it names.
    pub cell: Option<CellId>,
}

impl Drawing {
    /// Returns the shapes of its plans in the order of drawing, without titles and legend.
    pub fn shapes(&self) -> impl Iterator<Item = PlanShape> {
        let paths = self.of_plans().filter_map(|item| match item {
            Item::Path(path) => Some(path),
            _ => None,
        });
        paths.map(|path| {
            let look = path.class.look();
            let fill = look.fill;
            let stroke = look.stroke;
            PlanShape {
                class: look.name,
                fill: fill.map(|(color, opacity)| (path.fill.unwrap_or(color), opacity)),
                stroke: stroke.map(|(color, width)| (color, width * self.zoom)),
                lines: (path.lines.iter())
                    .map(|line| line.iter().map(DVec2::to_array).collect())
                    .collect(),
                is_closed: path.is_closed,
                cell: path.cell,
            }
        })
    }

    /// Returns the names and areas of cells in its plans.
    pub fn labels(&self) -> impl Iterator<Item = PlanLabel> {
        let words = self.of_plans().filter_map(|item| match item {
            Item::Words(words) if words.is_centered => Some(words),
            _ => None,
        });
        words.map(|words| PlanLabel {
            at: words.at.to_array(),
            size: words.size,
            is_turned: words.is_turned,
            text: words.text.clone(),
            cell: words.cell,
        })
    }

    /// Returns the items at the place of a storey: those of a plan are in coordinates of the world.
    fn of_plans(&self) -> impl Iterator<Item = &Item> {
        let mut is_plan = false;
        self.items.iter().filter(move |item| {
            if let Item::Place { storey, .. } = item {
                is_plan = storey.is_some();
            }
            is_plan
        })
    }
}

#[cfg(test)]
mod tests {
    use enfilade_cpg::PortalKind;

    use crate::{PlanOptions, Plans};

    #[test]
    fn shapes_lie_where_their_cells_do() {
        let params = enfilade_testkit::GridParams::offices(6, 1);
        let world = enfilade_testkit::room_grid(&params);
        let plans = Plans::new(&world, &PlanOptions::default());
        let sheet = plans.sheet(&[0]);
        let mut n = 0;
        for shape in sheet.shapes().filter(|s| s.class == "cell") {
            let cell = &world.graph[shape.cell.expect("a cell has an id")];
            let [min, max] = cell.aabb.map(|p| [p[0], p[2]].map(f64::from));
            for p in shape.lines.iter().flatten() {
                // A pixel of the sampling grid.
                let is_in = |k: usize| (min[k] - 0.1..=max[k] + 0.1).contains(&p[k]);
                assert!(is_in(0) && is_in(1), "{}: {p:?}", cell.name);
            }
            n += 1;
        }
        assert_eq!(n, world.graph.rooms().count());
        let names: Vec<String> = sheet.labels().map(|label| label.text).collect();
        assert!(names.contains(&world.graph.cells[0].name), "{names:?}");
        let doors = sheet.shapes().filter(|s| s.class == "door").count();
        let is_door = |p: &&enfilade_cpg::Portal| p.kind == PortalKind::Door;
        assert_eq!(doors, world.graph.portals.iter().filter(is_door).count());
    }
}
