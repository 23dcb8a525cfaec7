//! Options of a bake, on the command line and in a settings file.
//!
//! Every value is checked where it is read, so that an error message names its place.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, bail};
use enfilade::bake::bsp::{BspConfig, Guide, Heuristic, Rooms};
use enfilade::bake::simplify::{CostModel, SimplifySettings};
use enfilade::bake::{BakeConfig, Method, SmallestHole};
use enfilade::geom::scene::{RoomName, Scene};
use enfilade::geom::{Aabb, DVec3, Plane};
use enfilade::import::{IfcConverter, ImportOptions, RepairOptions, RoleRules, Up};

use enfilade_cli::input::{name_of, read_text};

use super::values::{
    Amount, Budget, Hole, Length, SettingsPoint, Unit, Weld, parse_hole, parse_length, parse_point,
    parse_toml, parse_unit, parse_weld,
};

/// Options for reading scenes, shared by the baked scene and the scene that a world is compared with.
#[derive(clap::Args)]
pub(crate) struct SceneOptions {
    /// Objects whose object, mesh or material name matches this pattern (`*`, `?`) are detail.
    #[arg(long, value_name = "PATTERN")]
    detail_name: Vec<String>,
    /// Objects whose name matches this pattern are structural, even if another rule makes them detail.
    #[arg(long, value_name = "PATTERN")]
    structural_name: Vec<String>,
    /// Make small free-standing objects detail if no other rule gives them a role [default: on].
    #[arg(long, value_enum)]
    auto_roles: Option<Switch>,
    /// Make mirrors and links of flat objects called `mirror` or `portal:NAME` [default: on].
    #[arg(long, value_enum)]
    marks: Option<Switch>,
    /// The input's unit: m, cm, mm, in, ft, or a number of meters.
    #[arg(long, visible_alias = "scale", value_name = "UNIT", value_parser = parse_unit)]
    unit: Option<f64>,
    /// The input's up axis.
    #[arg(long, value_enum)]
    up: Option<UpAxis>,
    /// Point of the scene that becomes the origin, in meters with y up.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    origin: Option<DVec3>,
    /// Also read files outside the scene's folder that the scene refers to (buffers, pictures, materials); unsafe for
    /// scenes from strangers.
    #[arg(long)]
    allow_outside: bool,
    /// Program that reads IFC: a Python with the package ifcopenshell, a node with web-ifc, or IfcConvert [default: the
    /// first of these that is installed].
    #[arg(long, value_name = "PATH")]
    ifc_convert: Option<PathBuf>,
    /// Repair structural triangles: weld vertices along open edges within METERS (0.001 if not given), split
    /// T-junctions, orient shells consistently, drop duplicates, fill small holes; each change is counted.
    #[arg(long, value_name = "METERS", num_args = 0..=1, require_equals = true,
        default_missing_value = "0.001", value_parser = parse_weld)]
    repair: Option<f64>,
    /// Fill holes whose box has a diagonal of up to METERS; implies `--repair`; 0 fills none [default: 0.1].
    #[arg(long, value_name = "METERS", value_parser = parse_hole, allow_hyphen_values = true)]
    repair_holes: Option<f64>,
    /// Settings file in TOML; the command line takes precedence.
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
}

#[derive(clap::Args)]
pub(crate) struct BakeOptions {
    /// Files whose objects are all detail: furniture, door leaves, plants.
    #[arg(long, value_name = "FILE")]
    pub(crate) detail: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) scene: SceneOptions,
    /// Method that finds the cells.
    #[arg(long, value_enum, default_value_t = MethodName::Auto)]
    method: MethodName,
    #[command(flatten)]
    pub(crate) delaunay: super::delaunay::DelaunayOptions,
    /// File for the way out of a map that leaks, as lines of `x y z` in meters.
    #[arg(long, value_name = "FILE.pts")]
    pub(super) leak: Option<PathBuf>,
    /// Continue although the map leaks.
    #[arg(long)]
    pub(super) allow_leak: bool,
    /// Report the narrowest place on the widest way from a room to the outdoors, and write the way into the world as
    /// a line: from the middle of the largest air with walls around, or from a point of the world that should be in a
    /// room.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, num_args = 0..=1, require_equals = true)]
    pub(super) leak_path: Option<Option<DVec3>>,
    /// Merge cells that cost less with neighbors; costs are in triangles if nothing else is set [default: 50 in
    /// levels of brushes, 0 elsewhere].
    #[arg(long, value_name = "COST")]
    min_cost: Option<u32>,
    /// Cut cells that cost more, and merge none to more; cells that cannot be cut are reported.
    #[arg(long, value_name = "COST")]
    max_cost: Option<u32>,
    /// With `--max-cost`: cut the outdoors, too.
    #[arg(long)]
    split_outdoors: bool,
    /// Edge of a voxel in meters; chosen from the narrowest opening and the scene's size if not given.
    #[arg(long, value_name = "METERS", value_parser = parse_length, allow_hyphen_values = true)]
    voxel: Option<f64>,
    /// Width in meters of the narrowest opening that must be found [default: 0.6].
    #[arg(long, value_name = "METERS", value_parser = parse_length, allow_hyphen_values = true)]
    min_opening: Option<f64>,
    /// Close openings narrower than this, in meters, with seals, as gaps of the model; 0 leaves them open, as cracks
    /// [default: 0.01, and more if triangles that should meet miss each other by more].
    #[arg(long, value_name = "METERS", value_parser = parse_hole, allow_hyphen_values = true)]
    smallest_hole: Option<f64>,
    /// Most memory to use, a number and K, M, G or T: sets the number of voxels and points [default: 8G, and less for
    /// few triangles].
    #[arg(long, value_name = "BYTES", value_parser = enfilade_cli::values::bytes)]
    max_memory: Option<u64>,
    /// End without a world after this long; if not given, when the work is out of proportion to the triangles.
    #[arg(long, value_name = "SECONDS", value_parser = enfilade_cli::values::seconds)]
    max_time: Option<Duration>,
    /// Number of threads; one per core if not given. The result is the same.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) threads: Option<u16>,
    /// Print the roles of objects with their reasons, notes of the import and stage times.
    #[arg(short, long)]
    pub(super) verbose: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum UpAxis {
    Y,
    Z,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Switch {
    On,
    Off,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum MethodName {
    /// The partition if all structure is made of brushes, else the watershed; tetrahedra if that finds one cell or
    /// none in a curved surface, perhaps branched, that is closed except at its ends.
    Auto,
    /// Voxels, distances, watershed.
    Watershed,
    /// Binary space partition and separators, for brushes and clean architectural models.
    Bsp,
    /// Tetrahedra between the surfaces, decimated; for caves, vessels and other irregular scenes.
    Delaunay,
}

/// The settings file: the fields of the bake's configuration and of the import, all optional.
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct ConfigFile {
    voxel: Option<Length>,
    min_opening: Option<Length>,
    smallest_hole: Option<Amount>,
    max_voxels: Option<Budget>,
    noise: Option<Amount>,
    unit: Option<Unit>,
    up: Option<UpAxis>,
    origin: Option<[f64; 3]>,
    auto_roles: Option<bool>,
    marks: Option<bool>,
    repair: Option<Weld>,
    repair_holes: Option<Hole>,
    #[serde(default)]
    detail_names: Vec<String>,
    #[serde(default)]
    structural_names: Vec<String>,
    #[serde(default)]
    merge: MergeTable,
    #[serde(default)]
    bsp: BspTable,
    /// Names of rooms, each with a point in its room.
    #[serde(default)]
    names: BTreeMap<String, SettingsPoint>,
}

/// The table `[bsp]` of the settings file.
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct BspTable {
    /// `true` if the shape of openings makes cells rooms.
    rooms: Option<bool>,
    heuristic: Option<HeuristicName>,
    grid: Option<Length>,
    tetrahedra: Option<Length>,
    /// A point and a normal for each.
    planes: Vec<[f64; 6]>,
    /// Two opposite vertices for each.
    boxes: Vec<[f64; 6]>,
    min_cost: Option<Amount>,
    max_cost: Option<Amount>,
    split_outdoors: Option<bool>,
    max_cells: Option<usize>,
    max_portals: Option<usize>,
    triangle_cost: Option<Amount>,
    area_cost: Option<Amount>,
    detail_cost: Option<Amount>,
    material_costs: BTreeMap<String, Amount>,
}

#[derive(Clone, Copy, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
enum HeuristicName {
    MinCut,
    MaxArea,
    MaxOrtho,
}

/// The table `[merge]` of the settings file.
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct MergeTable {
    threshold: Option<Amount>,
    wall_threshold: Option<Amount>,
    wall_rim: Option<Amount>,
    radius_gain: Option<Amount>,
    reach: Option<Amount>,
    surround: Option<Amount>,
    outdoor_gain: Option<Amount>,
    closed_share: Option<Amount>,
    min_radius: Option<Amount>,
}

impl ConfigFile {
    fn read(path: &Path) -> anyhow::Result<Self> {
        let text = read_text("settings", path)?;
        let file: Self = parse_toml(&text).with_context(|| {
            format!(
                "settings {} are not understood; correct or remove the line",
                name_of(path)
            )
        })?;
        if file.names.keys().any(|name| name.trim().is_empty()) {
            bail!("settings {}: a name in [names] is empty", name_of(path));
        }
        Ok(file)
    }
}

/// Default bound below which cells are merged with a neighbor, in triangles: the merging threshold of Lefebvre &
/// Hornus 2003, table 2.
const MERGE_BELOW: f64 = 50.0;

/// Bounds on the costs of cells.
fn resolve_costs(options: &BakeOptions, table: &BspTable) -> anyhow::Result<SimplifySettings> {
    let max_cost = options
        .max_cost
        .map(f64::from)
        .or(table.max_cost.as_ref().map(|v| v.0));
    let costs = SimplifySettings {
        min_cost: options
            .min_cost
            .map(f64::from)
            .or(table.min_cost.as_ref().map(|v| v.0))
            .unwrap_or_else(|| max_cost.unwrap_or(MERGE_BELOW).min(MERGE_BELOW)),
        max_cost,
        outdoors: options.split_outdoors || table.split_outdoors == Some(true),
        max_cells: table.max_cells,
        max_portals: table.max_portals,
        cost: CostModel {
            triangle: table.triangle_cost.as_ref().map_or(1.0, |v| v.0),
            area: table.area_cost.as_ref().map_or(0.0, |v| v.0),
            detail: table.detail_cost.as_ref().map_or(1.0, |v| v.0),
            materials: table
                .material_costs
                .iter()
                .map(|(k, v)| (k.clone(), v.0))
                .collect(),
        },
        ..SimplifySettings::default()
    };
    if let Some(max) = costs.max_cost.filter(|m| *m < costs.min_cost) {
        bail!(
            "max_cost {max} is below min_cost {}; no cell can be within both",
            costs.min_cost
        );
    }
    Ok(costs)
}

/// Settings of the partition alone.
fn resolve_bsp(table: BspTable) -> anyhow::Result<BspConfig> {
    let plane = |[x, y, z, nx, ny, nz]: [f64; 6]| {
        let normal = DVec3::new(nx, ny, nz).try_normalize();
        let normal = normal.context("a plane of [bsp] has no normal: give x, y, z, nx, ny, nz")?;
        Ok(Plane::through(DVec3::new(x, y, z), normal))
    };
    Ok(BspConfig {
        heuristic: match table.heuristic {
            None => Heuristic::Default,
            Some(HeuristicName::MinCut) => Heuristic::MinCut,
            Some(HeuristicName::MaxArea) => Heuristic::MaxArea,
            Some(HeuristicName::MaxOrtho) => Heuristic::MaxOrtho,
        },
        guide: Guide {
            grid: table.grid.map(|v| v.0),
            tetrahedra: table.tetrahedra.map(|v| v.0),
            planes: table
                .planes
                .into_iter()
                .map(plane)
                .collect::<anyhow::Result<_>>()?,
            boxes: table
                .boxes
                .into_iter()
                .map(|[a, b, c, x, y, z]| {
                    let (p, q) = (DVec3::new(a, b, c), DVec3::new(x, y, z));
                    Aabb::new(p.min(q), p.max(q))
                })
                .collect(),
        },
        rooms: match table.rooms {
            None => Rooms::Auto,
            Some(true) => Rooms::Always,
            Some(false) => Rooms::Never,
        },
    })
}

/// All settings of a bake, resolved.
pub(crate) struct Resolved {
    pub(crate) import: ImportOptions,
    pub(crate) config: BakeConfig,
    /// Names of rooms, beside those of the scene.
    pub(crate) names: Vec<RoomName>,
    /// No bound for merging was given: the default applies to levels of brushes alone.
    merges_brushes_only: bool,
}

impl Resolved {
    /// Returns the settings for a scene. A room of a building has few triangles, and the shape of its openings shows
    /// that it is a room: by default, small cells are merged only in a partition of brushes.
    pub(crate) fn config_for(&self, scene: &Scene) -> BakeConfig {
        let mut config = self.config.clone();
        let is_of_brushes =
            !scene.solids.is_empty() && config.method.is_none_or(|m| m == Method::Bsp);
        if self.merges_brushes_only && !is_of_brushes {
            config.costs.min_cost = 0.0;
        }
        config
    }
}

impl BakeOptions {
    /// All files to read, including `scene`.
    pub(crate) fn inputs<'a>(&'a self, scene: &'a [PathBuf]) -> impl Iterator<Item = &'a PathBuf> {
        scene
            .iter()
            .chain(&self.detail)
            .chain(&self.scene.config)
            .chain(&self.delaunay.choices)
    }
}

/// Holds the converter of IFC, a separate process, to the limits of the command.
pub(crate) fn bound_converter(
    options: &mut ImportOptions,
    max_time: Option<Duration>,
    max_memory: Option<u64>,
) {
    if let Some(ifc) = &mut options.ifc {
        ifc.max_time = max_time.unwrap_or(ifc.max_time);
        ifc.max_memory = max_memory;
    }
}

/// Resolves command line and settings file.
pub(crate) fn resolve(options: &BakeOptions) -> anyhow::Result<Resolved> {
    let file = options.scene.file()?;
    let mut import_options = options.scene.resolve_with(&file);
    bound_converter(&mut import_options, options.max_time, options.max_memory);
    let mut config = BakeConfig {
        voxel: options.voxel.or(file.voxel.map(|v| v.0)),
        ..BakeConfig::default()
    };
    if let Some(v) = options.min_opening.or(file.min_opening.map(|v| v.0)) {
        config.min_opening = v;
    }
    if let Some(v) = options.smallest_hole.or(file.smallest_hole.map(|v| v.0)) {
        config.smallest_hole = SmallestHole::of_width(v);
    }
    if let Some(v) = file.max_voxels {
        config.max_voxels = v.0;
    }
    let (m, table) = (&mut config.merge, file.merge);
    for (field, given) in [
        (&mut config.noise, file.noise),
        (&mut m.threshold, table.threshold),
        (&mut m.wall_threshold, table.wall_threshold),
        (&mut m.wall_rim, table.wall_rim),
        (&mut m.radius_gain, table.radius_gain),
        (&mut m.reach, table.reach),
        (&mut m.surround, table.surround),
        (&mut m.outdoor_gain, table.outdoor_gain),
        (&mut m.closed_share, table.closed_share),
        (&mut m.min_radius, table.min_radius),
    ] {
        if let Some(Amount(value)) = given {
            *field = value;
        }
    }
    config.method = match options.method {
        MethodName::Auto => None,
        MethodName::Watershed => Some(Method::Watershed),
        MethodName::Bsp => Some(Method::Bsp),
        MethodName::Delaunay => Some(Method::Delaunay),
    };
    config.budget = enfilade::bake::Budget {
        memory: options.max_memory,
        time: options.max_time,
        ..enfilade::bake::Budget::default()
    };
    config.costs = resolve_costs(options, &file.bsp)?;
    config.delaunay = options.delaunay.resolve()?;
    let merges_brushes_only = options.min_cost.is_none() && file.bsp.min_cost.is_none();
    config.bsp = resolve_bsp(file.bsp)?;
    let named = file.names.into_iter();
    Ok(Resolved {
        import: import_options,
        config,
        names: named.map(|(name, at)| RoomName::at(name, at.0)).collect(),
        merges_brushes_only,
    })
}

impl SceneOptions {
    fn file(&self) -> anyhow::Result<ConfigFile> {
        match &self.config {
            None => Ok(ConfigFile::default()),
            Some(path) => ConfigFile::read(path),
        }
    }

    /// Resolves command line and settings file.
    pub(crate) fn resolve(&self) -> anyhow::Result<ImportOptions> {
        Ok(self.resolve_with(&self.file()?))
    }

    /// Repairs to make: none unless the command line or the settings file requests them.
    fn repair_with(&self, file: &ConfigFile) -> Option<RepairOptions> {
        let weld = self.repair.or(file.repair.as_ref().map(|v| v.0));
        let hole = self
            .repair_holes
            .or(file.repair_holes.as_ref().map(|v| v.0));
        let default = RepairOptions::default();
        (weld.is_some() || hole.is_some()).then(|| RepairOptions {
            weld: weld.unwrap_or(default.weld),
            hole: hole.unwrap_or(default.hole),
        })
    }

    /// The given program for IFC, or those of this machine.
    fn ifc_converter(&self) -> IfcConverter {
        let folder = std::env::temp_dir();
        match &self.ifc_convert {
            Some(program) => IfcConverter::new(program, folder),
            None => IfcConverter::installed(folder),
        }
    }

    fn resolve_with(&self, file: &ConfigFile) -> ImportOptions {
        ImportOptions {
            unit: self.unit.or(file.unit.as_ref().map(|u| u.0)),
            up: self.up.or(file.up).map(|up| match up {
                UpAxis::Y => Up::Y,
                UpAxis::Z => Up::Z,
            }),
            origin: self
                .origin
                .or(file.origin.map(DVec3::from_array))
                .unwrap_or(DVec3::ZERO),
            roles: RoleRules {
                structural: [self.structural_name.clone(), file.structural_names.clone()].concat(),
                detail: [self.detail_name.clone(), file.detail_names.clone()].concat(),
                is_automatic: self
                    .auto_roles
                    .map(|s| s == Switch::On)
                    .or(file.auto_roles)
                    .unwrap_or(true),
                ..RoleRules::default()
            },
            allow_outside: self.allow_outside,
            ignores_marks: !(self.marks.map(|s| s == Switch::On))
                .or(file.marks)
                .unwrap_or(true),
            ifc: Some(self.ifc_converter()),
            repair: self.repair_with(file),
            ..ImportOptions::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_file_says_which_line_is_wrong() {
        let problem = |text: &str| parse_toml::<ConfigFile>(text).err().unwrap().to_string();
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
        of_line("unit = \"feet\"", 1, "ft");
        of_line("up = \"x\"", 1, "up");
        of_line("origin = [1, 2]", 1, "origin");
        of_line("[names]\nHall = [1, 2]", 2, "three numbers");
        of_line("[names]\nHall = [1, 2, inf]", 2, "finite");
        of_line("[names]\nHall = \"1,2,3\"", 2, "three numbers");
        of_line("[names]\nHall = [1,2,3]\nHall = [4,5,6]", 3, "duplicate");
    }

    #[test]
    fn every_setting_is_documented() {
        const DOCS: &str = include_str!("../../../../docs/settings.md");
        let mut n = 0;
        for table in ["", "[merge]\n", "[bsp]\n"] {
            // The error for an unknown key lists all known keys.
            let problem = toml::from_str::<ConfigFile>(&format!("{table}unknown = 1")).err();
            let problem = problem.unwrap().to_string();
            let (_, known) = problem.split_once("expected one of").unwrap();
            for key in known.split('`').skip(1).step_by(2) {
                let is_table = ["merge", "bsp", "names"].contains(&key);
                let name = if is_table {
                    format!("`[{key}]`")
                } else {
                    format!("`{key}`")
                };
                assert!(DOCS.contains(&name), "{name} is not in docs/settings.md");
                n += 1;
            }
        }
        assert_eq!(n, 41);
        let example = DOCS.split("```").nth(1).unwrap();
        let file: ConfigFile = toml::from_str(example.strip_prefix("toml").unwrap()).unwrap();
        assert_eq!(file.bsp.max_portals, Some(20));
        assert_eq!(file.names["Kitchen"].0, DVec3::new(4.0, 1.0, -2.5));
    }

    #[test]
    fn the_settings_file_sets_what_it_names() {
        let file: ConfigFile = toml::from_str(
            "voxel = 0.2\nunit = \"mm\"\nup = \"z\"\norigin = [1, 2, 3.5]\n[merge]\nreach = 0.5",
        )
        .unwrap();
        assert_eq!(file.voxel.unwrap().0, 0.2);
        assert_eq!(file.unit.unwrap().0, 0.001);
        assert!(file.up == Some(UpAxis::Z));
        assert_eq!(file.origin, Some([1.0, 2.0, 3.5]));
        assert_eq!(file.merge.reach.unwrap().0, 0.5);
        let number: ConfigFile = toml::from_str("unit = 1").unwrap();
        assert_eq!(number.unit.unwrap().0, 1.0);
    }
}
