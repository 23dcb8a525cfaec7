//! Settings of the simplifier.

use std::collections::BTreeMap;

use super::cost::CostModel;

/// How portals are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Metric {
    /// Triangles that sampled views additionally draw without the portal.
    #[default]
    ExpectedTriangles,
    /// Volume that sees the portal times the difference of its cells' costs (Lefebvre & Hornus 2003).
    VisibleVolume,
}

/// Settings of the simplifier.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SimplifySettings {
    /// Merges cheaper cells with neighbors, where that keeps the upper bound. An item that reaches through
    /// several cells counts in each in part: no portal between them hides it.
    pub min_cost: f64,
    /// No merge for `min_cost` takes an opening between two rooms that is below this share of the space beside it. A default sets
    /// this, for costs bound what is asked for. [Limit: 0 to 1]
    pub doorway: Option<f64>,
    /// No merge makes a cell that costs more; [`keep_bounds`](crate::bound::keep_bounds) cuts cells that do.
    pub max_cost: Option<f64>,
    /// Cuts the outdoors, too, if it costs more.
    pub outdoors: bool,
    /// Merges cells until at most this many are left, where that keeps the upper bound.
    pub max_cells: Option<usize>,
    /// Merges cells until at most this many portals are left, where that keeps the upper bound.
    pub max_portals: Option<usize>,
    /// Lets rooms and the outdoors become one cell, if a bound cannot be met otherwise. Without it, all portals that
    /// lead outdoors stay.
    pub join_outdoors: bool,
    /// How portals are compared.
    pub metric: Metric,
    /// The cost of drawing.
    pub cost: CostModel,
}

impl SimplifySettings {
    /// Returns every setting by name, as text, for the provenance of the file.
    #[must_use]
    pub(crate) fn to_settings(&self) -> BTreeMap<String, String> {
        let number = |v: Option<f64>| v.map_or_else(|| "none".to_owned(), |v| v.to_string());
        let mut out: BTreeMap<String, String> = [
            ("simplify.min_cost", self.min_cost.to_string()),
            ("simplify.max_cost", number(self.max_cost)),
            (
                "simplify.max_cells",
                number(self.max_cells.map(|n| n as f64)),
            ),
            (
                "simplify.max_portals",
                number(self.max_portals.map(|n| n as f64)),
            ),
            ("simplify.metric", format!("{:?}", self.metric)),
            ("cost.triangle", self.cost.triangle.to_string()),
            ("cost.area", self.cost.area.to_string()),
            ("cost.detail", self.cost.detail.to_string()),
        ]
        .map(|(k, v)| (k.to_owned(), v))
        .into();
        if let Some(share) = self.doorway {
            out.insert("simplify.doorway".to_owned(), share.to_string());
        }
        if self.outdoors {
            out.insert("simplify.outdoors".to_owned(), "true".to_owned());
        }
        if self.join_outdoors {
            out.insert("simplify.join_outdoors".to_owned(), "true".to_owned());
        }
        for (name, weight) in &self.cost.materials {
            out.insert(format!("cost.material.{name}"), weight.to_string());
        }
        out
    }
}
