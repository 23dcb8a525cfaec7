//! Options of a bake, on the command line and in a settings file.
//!
//! Every value is checked where it is read, so that an error message names its place.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context;
use enfilade::bake::{Method, Outdoors};
use enfilade::geom::DVec3;
use enfilade::import::{AirSide, HeightOptions, IfcConverter, ImportOptions, VolumeOptions};
use enfilade::internals::geom::Allowance;
use enfilade_settings::{
    Given, Settings, UpAxis, parse_hole, parse_length, parse_point, parse_toml, parse_unit,
    parse_weld,
};

use enfilade_cli::input::{name_of, read_text};
use enfilade_cli::memory::held_memory;

/// Options for reading scenes, shared by the baked scene and the scene that a world is compared with.
#[derive(Clone, clap::Args)]
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
    up: Option<Axis>,
    /// The scene to read of a glTF file with several, by its name or its number from 0 [default: the file's default scene].
    #[arg(long, value_name = "NAME|N")]
    scene: Option<String>,
    /// Point of the scene that becomes the origin, in meters with y up.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    origin: Option<DVec3>,
    /// Volumes: the value between matter and air; -400 in computed tomography [default: the middle of a mask].
    #[arg(long, value_name = "VALUE", value_parser = parse_level, allow_hyphen_values = true)]
    level: Option<f64>,
    /// Volumes: the side of the level on which air is [default: below a given level, above that of a mask].
    #[arg(long, value_enum)]
    air: Option<AirName>,
    /// Free-form patches (in OBJ, or in JSON): largest distance of their triangles from them [default: 0.01].
    #[arg(long, value_name = "METERS", value_parser = parse_length, allow_hyphen_values = true)]
    patch_tolerance: Option<f64>,
    /// Height maps (PNG, TIFF): distance in meters between samples [default: that of a GeoTIFF].
    #[arg(long, value_name = "METERS", value_parser = parse_length, allow_hyphen_values = true)]
    cell: Option<f64>,
    /// Height maps of grays: heights in meters of black and of white.
    #[arg(long, value_name = "MIN,MAX", value_parser = parse_place, allow_hyphen_values = true)]
    heights: Option<[f64; 2]>,
    /// Scans (clouds of points in PLY, LAS, LAZ): a place of the scanner, in meters with y up, if the file does not tell it;
    /// repeatable: in LAS, one for each point source id, in their order.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    station: Vec<DVec3>,
    /// Also read files outside the scene's folder that the scene refers to (buffers, pictures, materials); unsafe for
    /// scenes from strangers.
    #[arg(long)]
    allow_outside: bool,
    /// Program that reads IFC: a Python with the package ifcopenshell, a node with web-ifc, or IfcConvert [default: the
    /// first of these that is installed].
    #[arg(long, value_name = "PATH")]
    ifc_convert: Option<PathBuf>,
    /// Put back triangles that are missing one by one [default: on].
    #[arg(long, value_enum)]
    put_back: Option<Switch>,
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

#[derive(Clone, clap::Args)]
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
    /// Maps: a sealed level, which must not leak, or an open world, whose sky an engine draws.
    #[arg(long, value_enum, default_value_t = WorldName::Auto)]
    pub(super) world: WorldName,
    /// Put portals where designers marked openings (visportals, areaportals, hints, objects called portal), and tell for each mark
    /// whether the bake found it, and how far away.
    #[arg(long, value_enum)]
    given: Option<GivenName>,
    /// Report the narrowest place on the widest way from a room to the outdoors, and write the way into the world as
    /// a line: from the middle of the largest air with walls around, or from a point of the world that should be in a
    /// room.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, num_args = 0..=1, require_equals = true)]
    pub(super) leak_path: Option<Option<DVec3>>,
    /// Merge cells that cost less with neighbors; costs are in triangles if nothing else is set [default: 50 in
    /// levels of brushes, but across no doorway; 0 elsewhere].
    #[arg(long, value_name = "COST")]
    min_cost: Option<u32>,
    /// Cut cells that cost more, and merge none to more; cells that cannot be cut are reported.
    #[arg(long, value_name = "COST")]
    max_cost: Option<u32>,
    /// With `--max-cost`: cut the outdoors, too.
    #[arg(long)]
    split_outdoors: bool,
    /// Cells outdoors: one, or those of open land (valleys, streets, squares, courtyards), from the ground to a sky limit.
    #[arg(long, value_enum, default_value_t = OutdoorsName::Whole)]
    outdoors: OutdoorsName,
    /// A place from which open land is flooded, in meters, instead of its own minima: one cell each; repeatable.
    #[arg(long, value_name = "X,Z", value_parser = parse_place, allow_hyphen_values = true)]
    minimum: Vec<[f64; 2]>,
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
    #[arg(long, value_name = "BYTES", value_parser = enfilade_cli::values::memory_limit)]
    pub(crate) max_memory: Option<u64>,
    /// End without a world after this long; if not given, when the work is out of proportion to the triangles.
    #[arg(long, value_name = "SECONDS", value_parser = enfilade_cli::values::seconds)]
    pub(crate) max_time: Option<Duration>,
    /// Number of threads; one per core if not given. The result is the same.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Print the roles of objects with their reasons, notes of the import, stage times, and how often a bake decided for which reason.
    #[arg(short, long)]
    pub(crate) verbose: bool,
}

/// Axes by their letters, which clap lists.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Axis {
    Y,
    Z,
}

/// Sides of a level by their names, which clap lists.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum AirName {
    Below,
    Above,
}

fn parse_level(text: &str) -> Result<f64, String> {
    let level = text.parse::<f64>().ok().filter(|x| x.is_finite());
    level.ok_or_else(|| "must be a number".to_owned())
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Switch {
    On,
    Off,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum OutdoorsName {
    /// One cell.
    Whole,
    /// A cell for each area of open land, and one for the sky and all beyond.
    Split,
}

/// Marks of designers.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum GivenName {
    /// Openings between rooms or areas.
    Portals,
}

/// Worlds that maps are of.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum WorldName {
    /// Open if it leaks and half or more of the floor that people reach lies below nothing.
    Auto,
    /// Open, whether it leaks or not.
    Open,
    /// Sealed: it must not leak.
    Sealed,
}

fn parse_place(text: &str) -> Result<[f64; 2], String> {
    let number = |n: &str| n.trim().parse().ok().filter(|n: &f64| n.is_finite());
    let place = text.split_once(',').map(|(x, z)| [number(x), number(z)]);
    match place {
        Some([Some(x), Some(z)]) => Ok([x, z]),
        _ => Err("give two numbers with a comma between, such as 120,-45".to_owned()),
    }
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

/// All settings of a bake, resolved.
pub(crate) struct Resolved {
    pub(crate) import: ImportOptions,
    pub(crate) bake: enfilade_settings::Resolved,
}
impl BakeOptions {
    /// Returns an option that was given and only makes sense for a bake.
    pub(crate) fn of_bakes_alone(&self) -> Option<&'static str> {
        let given = [
            (self.leak.is_some(), "--leak"),
            (self.allow_leak, "--allow-leak"),
            (self.world != WorldName::Auto, "--world"),
            (self.given.is_some(), "--given"),
            (self.leak_path.is_some(), "--leak-path"),
        ];
        given.into_iter().find(|(is, _)| *is).map(|(_, name)| name)
    }

    /// Returns the axis that is not taken to point up.
    pub(super) fn other_axis(&self) -> &'static str {
        match self.scene.up {
            Some(Axis::Z) => "y",
            _ => "z",
        }
    }

    /// Returns the options with one more, in words; `None` for one that only a person can fill in.
    pub(super) fn with(&self, option: &str) -> Option<Self> {
        let mut options = self.clone();
        let (name, value) = option.split_once(' ')?;
        match (name, value) {
            (_, "'PATTERN'") => return None,
            ("--unit", _) => options.scene.unit = Some(parse_unit(value).ok()?),
            ("--up", "y") => options.scene.up = Some(Axis::Y),
            ("--up", "z") => options.scene.up = Some(Axis::Z),
            ("--detail-name" | "--structural-name", _) => {
                let names = value.strip_prefix('\'')?.strip_suffix('\'')?;
                let between = format!("' {name} '");
                let names = names.split(&between).map(str::to_owned);
                match name {
                    "--detail-name" => options.scene.detail_name.extend(names),
                    _ => options.scene.structural_name.extend(names),
                }
            }
            ("--min-cost", _) => options.min_cost = Some(value.parse().ok()?),
            _ => return None,
        }
        Some(options)
    }

    /// All files to read, including `scene`.
    pub(crate) fn inputs<'a>(&'a self, scene: &'a [PathBuf]) -> impl Iterator<Item = &'a PathBuf> {
        scene
            .iter()
            .chain(&self.detail)
            .chain(&self.scene.config)
            .chain(&self.delaunay.choices)
    }
}

/// Holds the import, and the converter of IFC, a separate process, to the limits of the command. Time counts from now on.
pub(crate) fn bound(
    options: &mut ImportOptions,
    max_time: Option<Duration>,
    max_memory: Option<u64>,
) {
    if let Some(ifc) = &mut options.ifc {
        ifc.max_time = max_time.unwrap_or(ifc.max_time);
        ifc.max_memory = max_memory;
    }
    // A time too long for the clock is not a bound.
    let until = max_time.and_then(|t| Instant::now().checked_add(t));
    let allowance = Allowance::new(u64::MAX, until);
    options.allowance = Some(Arc::new(match max_memory {
        Some(bytes) => allowance.holding(bytes, held_memory),
        None => allowance,
    }));
}

/// Resolves command line and settings file.
pub(crate) fn resolve(options: &BakeOptions) -> anyhow::Result<Resolved> {
    let mut settings = options.scene.settings()?;
    let mut import = options.scene.import_options(&settings);
    bound(&mut import, options.max_time, options.max_memory);
    settings.voxel = options.voxel.or(settings.voxel);
    settings.min_opening = options.min_opening.or(settings.min_opening);
    settings.smallest_hole = options.smallest_hole.or(settings.smallest_hole);
    settings.given = options
        .given
        .map(|GivenName::Portals| Given::Portals)
        .or(settings.given);
    let table = &mut settings.bsp;
    table.min_cost = options.min_cost.map(f64::from).or(table.min_cost);
    table.max_cost = options.max_cost.map(f64::from).or(table.max_cost);
    if options.split_outdoors {
        table.split_outdoors = Some(true);
    }
    let mut bake = settings.resolve()?;
    let config = &mut bake.config;
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
    config.delaunay = options.delaunay.resolve()?;
    config.outdoors = outdoors(options)?;
    Ok(Resolved { import, bake })
}

/// Returns the choice of cells outdoors. Places to flood land from are a choice, too.
fn outdoors(options: &BakeOptions) -> anyhow::Result<Outdoors> {
    let minima = options.minimum.clone();
    match options.outdoors {
        OutdoorsName::Split => Ok(Outdoors::Split { minima }),
        OutdoorsName::Whole if minima.is_empty() => Ok(Outdoors::Whole),
        OutdoorsName::Whole => {
            anyhow::bail!("--minimum divides open land: give --outdoors split, too")
        }
    }
}

impl SceneOptions {
    /// Resolves command line and settings file.
    pub(crate) fn resolve(&self) -> anyhow::Result<ImportOptions> {
        Ok(self.import_options(&self.settings()?))
    }

    /// The settings file, and over it what the command line says about the scene.
    fn settings(&self) -> anyhow::Result<Settings> {
        let mut settings = match &self.config {
            None => Settings::default(),
            Some(path) => read_settings(path)?,
        };
        settings.unit = self.unit.or(settings.unit);
        let up = self.up.map(|up| match up {
            Axis::Y => UpAxis::Y,
            Axis::Z => UpAxis::Z,
        });
        settings.up = up.or(settings.up);
        settings.scene = self.scene.clone().or(settings.scene);
        settings.origin = self.origin.map(|p| p.to_array()).or(settings.origin);
        let on = |switch: Option<Switch>| switch.map(|s| s == Switch::On);
        settings.auto_roles = on(self.auto_roles).or(settings.auto_roles);
        settings.marks = on(self.marks).or(settings.marks);
        settings.put_back = on(self.put_back).or(settings.put_back);
        settings.repair = self.repair.or(settings.repair);
        settings.repair_holes = self.repair_holes.or(settings.repair_holes);
        let names = &mut settings.detail_names;
        *names = [&self.detail_name[..], names].concat();
        let names = &mut settings.structural_names;
        *names = [&self.structural_name[..], names].concat();
        Ok(settings)
    }

    /// Options of the import that only the command line has, and those of the settings.
    fn import_options(&self, settings: &Settings) -> ImportOptions {
        let folder = std::env::temp_dir();
        let ifc = match &self.ifc_convert {
            Some(program) => IfcConverter::new(program, folder),
            None => IfcConverter::installed(folder),
        };
        ImportOptions {
            allow_outside: self.allow_outside,
            ifc: Some(ifc),
            patch_tolerance: self.patch_tolerance,
            stations: self.station.clone(),
            heights: HeightOptions {
                cell: self.cell,
                heights: self.heights,
            },
            volume: VolumeOptions {
                level: self.level,
                air: self.air.map(|air| match air {
                    AirName::Below => AirSide::Below,
                    AirName::Above => AirSide::Above,
                }),
            },
            ..settings.import_options()
        }
    }
}

fn read_settings(path: &Path) -> anyhow::Result<Settings> {
    let text = read_text("settings", path)?;
    parse_toml(&text).with_context(|| {
        format!(
            "settings {} are not understood; correct or remove the line",
            name_of(path)
        )
    })
}
