//! The settings file: the fields of the bake's configuration and of the import, all optional.

use std::collections::BTreeMap;

use serde::Deserialize;

use enfilade_bake::RoomAnswer;
use enfilade_import::TextureMatter;

use crate::values::{
    amount, amounts, hole, length, matters, named_points, point, room_answer, unit, voxels, weld,
};

/// Settings by their names in the settings file, `docs/settings.md`. Options of a command overwrite its fields.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Edge of a voxel. [Units: wu]
    #[serde(deserialize_with = "length")]
    pub voxel: Option<f64>,
    /// Width of the narrowest opening that must be found. [Units: wu]
    #[serde(deserialize_with = "length")]
    pub min_opening: Option<f64>,
    /// Width below which openings are closed by seals; 0 leaves them open. [Units: wu]
    #[serde(deserialize_with = "amount")]
    pub smallest_hole: Option<f64>,
    /// Most voxels.
    #[serde(deserialize_with = "voxels")]
    pub max_voxels: Option<usize>,
    /// Depth below which basins are noise. [Units: wu]
    #[serde(deserialize_with = "amount")]
    pub noise: Option<f64>,
    /// Meters per unit of the input.
    #[serde(deserialize_with = "unit")]
    pub unit: Option<f64>,
    /// The input's up axis.
    pub up: Option<UpAxis>,
    /// The scene to read of a file with several, by name or number.
    pub scene: Option<String>,
    /// Point of the scene that becomes the origin. [Units: wu]
    pub origin: Option<[f64; 3]>,
    /// `true` if small free-standing objects are detail.
    pub auto_roles: Option<bool>,
    /// `true` if objects called `mirror` or `portal:NAME` become mirrors and links.
    pub marks: Option<bool>,
    /// Marks of designers that are kept.
    pub given: Option<Given>,
    /// `true` if triangles that are missing one by one are put back.
    pub put_back: Option<bool>,
    /// Distance within which a repair welds vertices. [Units: wu]
    #[serde(deserialize_with = "weld")]
    pub repair: Option<f64>,
    /// Diagonal of the largest hole that a repair fills. [Units: wu]
    #[serde(deserialize_with = "hole")]
    pub repair_holes: Option<f64>,
    /// Patterns of names of detail.
    pub detail_names: Vec<String>,
    /// Patterns of names of structure.
    pub structural_names: Vec<String>,
    /// Matter of surfaces, by patterns of their textures or materials.
    #[serde(deserialize_with = "matters")]
    pub textures: BTreeMap<String, TextureMatter>,
    /// The table `[merge]`.
    pub merge: MergeTable,
    /// The table `[bsp]`.
    pub bsp: BspTable,
    /// Names of rooms, each with a point in its room. [Units: wu]
    #[serde(deserialize_with = "named_points")]
    pub names: BTreeMap<String, [f64; 3]>,
    /// Decisions about rooms, in their order.
    pub decisions: Vec<DecisionTable>,
}

/// An entry of `[[decisions]]`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecisionTable {
    /// A point of the opening, or of where one should be. [Units: wu]
    #[serde(deserialize_with = "point")]
    pub at: [f64; 3],
    /// The decision.
    #[serde(deserialize_with = "room_answer")]
    pub is: RoomAnswer,
}

/// Axes that may point up in an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// +Y.
    Y,
    /// +Z.
    Z,
}

/// Marks of designers that a bake can keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Given {
    /// Openings between rooms or areas.
    Portals,
}

/// The table `[bsp]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BspTable {
    /// `true` if the shape of openings makes cells rooms.
    pub rooms: Option<bool>,
    /// Choice of splitters.
    pub heuristic: Option<SplitHeuristic>,
    /// Side of the squares of a grid of planes. [Units: wu]
    #[serde(deserialize_with = "length")]
    pub grid: Option<f64>,
    /// Distance of the points between which tetrahedra give planes. [Units: wu]
    #[serde(deserialize_with = "length")]
    pub tetrahedra: Option<f64>,
    /// A point and a normal for each.
    pub planes: Vec<[f64; 6]>,
    /// Two opposite vertices for each.
    pub boxes: Vec<[f64; 6]>,
    /// Cost below which cells are merged.
    #[serde(deserialize_with = "amount")]
    pub min_cost: Option<f64>,
    /// Cost above which cells are cut.
    #[serde(deserialize_with = "amount")]
    pub max_cost: Option<f64>,
    /// `true` if the outdoors is cut, too.
    pub split_outdoors: Option<bool>,
    /// Most cells.
    pub max_cells: Option<usize>,
    /// Most portals.
    pub max_portals: Option<usize>,
    /// Cost of a triangle.
    #[serde(deserialize_with = "amount")]
    pub triangle_cost: Option<f64>,
    /// Cost of a square meter.
    #[serde(deserialize_with = "amount")]
    pub area_cost: Option<f64>,
    /// Cost of a triangle of detail.
    #[serde(deserialize_with = "amount")]
    pub detail_cost: Option<f64>,
    /// Factors of costs by material.
    #[serde(deserialize_with = "amounts")]
    pub material_costs: BTreeMap<String, f64>,
}

/// Ways in which a partition chooses its splitters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SplitHeuristic {
    /// The fewest cuts.
    MinCut,
    /// The largest area.
    MaxArea,
    /// The most right angles.
    MaxOrtho,
}

/// The table `[merge]`, see [`MergeSettings`](enfilade_bake::MergeSettings).
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[allow(
    missing_docs,
    reason = "the fields of `MergeSettings`, which documents them"
)]
pub struct MergeTable {
    #[serde(deserialize_with = "amount")]
    pub threshold: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub wall_threshold: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub wall_rim: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub radius_gain: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub reach: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub surround: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub outdoor_gain: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub closed_share: Option<f64>,
    #[serde(deserialize_with = "amount")]
    pub min_radius: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_toml;

    #[test]
    fn the_settings_file_says_which_line_is_wrong() {
        let problem = |text: &str| parse_toml::<Settings>(text).err().unwrap().to_string();
        let of_line = |text, line: usize, word| {
            let problem = problem(text);
            assert!(problem.contains(&format!("line {line}")), "{problem}");
            assert!(problem.contains(word), "{problem}");
        };
        of_line("\nvoxell = 0.1", 2, "voxell");
        of_line("voxel = -1", 1, "above 0");
        of_line("min_opening = nan", 1, "above 0");
        of_line("max_voxels = 999", 1, "at least 1000");
        of_line("noise = -0.5", 1, "at least 0");
        of_line("repair = 0.0", 1, "0.1");
        of_line("repair_holes = 11", 1, "up to 10");
        of_line("[merge]\nthreshold = inf", 2, "at least 0");
        of_line("[merge]\n\nthreshhold = 0.7", 3, "threshhold");
        of_line("[bsp.material_costs]\nglass = -1", 2, "at least 0");
        of_line("unit = \"feet\"", 1, "ft");
        of_line("up = \"x\"", 1, "up");
        of_line("origin = [1, 2]", 1, "origin");
        of_line("[textures]\nnull = \"stone\"", 2, "portal");
        of_line("scene = 1", 1, "scene");
        of_line("[names]\nHall = [1, 2]", 2, "three numbers");
        of_line("[names]\nHall = [1, 2, inf]", 2, "finite");
        of_line("[names]\nHall = \"1,2,3\"", 2, "three numbers");
        of_line("[names]\nHall = [1,2,3]\nHall = [4,5,6]", 3, "duplicate");
        of_line("[names]\n\" \" = [1,2,3]", 1, "empty");
        of_line(
            "[[decisions]]\nat = [1,2,3]\nis = \"a gate\"",
            3,
            "'a door'",
        );
        of_line(
            "[[decisions]]\nat = [1,2]\nis = \"a door\"",
            2,
            "three numbers",
        );
        of_line("[[decisions]]\nat = [1,2,3]", 1, "is");
    }

    #[test]
    fn every_setting_is_documented() {
        const DOCS: &str = include_str!("../../../docs/settings.md");
        let mut n = 0;
        for table in ["", "[merge]\n", "[bsp]\n"] {
            // The error for an unknown key lists all known keys.
            let problem = parse_toml::<Settings>(&format!("{table}unknown = 1")).err();
            let problem = problem.unwrap().to_string();
            let (_, known) = problem.split_once("expected one of").unwrap();
            for key in known.split('`').skip(1).step_by(2) {
                let is_table = ["merge", "bsp", "names", "textures"].contains(&key);
                let name = if key == "decisions" {
                    "`[[decisions]]`".to_owned()
                } else if is_table {
                    format!("`[{key}]`")
                } else {
                    format!("`{key}`")
                };
                assert!(DOCS.contains(&name), "{name} is not in docs/settings.md");
                n += 1;
            }
        }
        assert_eq!(n, 46);
        let example = DOCS.split("```").nth(1).unwrap();
        let file: Settings = parse_toml(example.strip_prefix("toml").unwrap()).unwrap();
        assert_eq!(file.bsp.max_portals, Some(20));
        assert_eq!(file.names["Kitchen"], [4.0, 1.0, -2.5]);
    }

    #[test]
    fn the_settings_file_sets_what_it_names() {
        let file: Settings = parse_toml(
            "voxel = 0.2\nunit = \"mm\"\nup = \"z\"\norigin = [1, 2, 3.5]\n[merge]\nreach = 0.5",
        )
        .unwrap();
        assert_eq!(file.voxel, Some(0.2));
        assert_eq!(file.unit, Some(0.001));
        assert!(file.up == Some(UpAxis::Z));
        assert_eq!(file.origin, Some([1.0, 2.0, 3.5]));
        assert_eq!(file.merge.reach, Some(0.5));
        assert_eq!(parse_toml::<Settings>("unit = 1").unwrap().unit, Some(1.0));
    }

    #[test]
    fn scripts_write_the_same_as_json() {
        let of: Settings = serde_json::from_str("{\"unit\": 1, \"voxel\": 0.2}").unwrap();
        assert_eq!((of.unit, of.voxel), (Some(1.0), Some(0.2)));
        let unknown = serde_json::from_str::<Settings>("{\"voxell\": 1}").unwrap_err();
        assert!(unknown.to_string().contains("`voxell`"), "{unknown}");
    }
}
