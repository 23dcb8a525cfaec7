//! Options of the import.

use enfilade_geom::{Allowance, DMat4, DVec3};
use enfilade_prepare::{BadOption, RepairOptions, RoleRules};
use enfilade_source::{AirSide, HeightOptions};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// The input's up axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// +Y, as in glTF.
    Y,
    /// +Z, as in most CAD and survey data; `(x, y, z)` becomes `(x, z, -y)`.
    Z,
}

impl Up {
    /// Returns the rotation that turns this axis up.
    pub(crate) fn axes(self) -> DMat4 {
        match self {
            Self::Y => DMat4::IDENTITY,
            Self::Z => DMat4::from_cols_array_2d(&[
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 0.0, -1.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ]),
        }
    }

    /// Returns the option of the command, as typed.
    #[must_use]
    #[doc(hidden)]
    pub fn option(self) -> &'static str {
        match self {
            Self::Y => "--up y",
            Self::Z => "--up z",
        }
    }
}

/// Settings of an import.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions {
    /// Meters per input unit, from 1e-9 to 1e9; `None` is 1.
    pub unit: Option<f64>,
    /// The input's up axis; `None` is [`Up::Y`] for every format but volumes and scans that say which way is up.
    pub up: Option<Up>,
    /// Point of the scaled, Y-up scene that becomes the origin. [Units: wu]
    ///
    /// Maps and surveys lie millions of meters from their origin, where the `f32` numbers of a file are no longer
    /// exact to a millimeter.
    pub origin: DVec3,
    /// Limits beyond which input is rejected.
    pub limits: Limits,
    /// Rules that decide between structure and detail.
    pub roles: RoleRules,
    /// The scene to read of a glTF file with several, by its name, or else by its number from 0; `None` is the file's default.
    pub scene: Option<String>,
    /// Allows references to files outside the scene's own folder, such as `../textures/wall.png`.
    ///
    /// Without it, a scene from elsewhere cannot bring a file of the reader's disk into the output.
    pub allow_outside: bool,
    /// Programs for IFC; without them such files are rejected. [`IfcConverter::installed`] finds them.
    pub ifc: Option<IfcConverter>,
    /// Leaves objects called `mirror` or `portal:NAME` as they are, so that [`Scene::marks`](enfilade_geom::scene::Scene::marks)
    /// stays empty.
    pub ignores_marks: bool,
    /// Where the surface of a volume lies.
    pub volume: VolumeOptions,
    /// Size and heights of height maps.
    pub heights: HeightOptions,
    /// Largest distance of triangles from free-form patches; `None` is 0.01. [Units: wu]
    pub patch_tolerance: Option<f64>,
    /// Places of the scanner, for clouds of points that do not tell them; in meters, +Y up. [Units: wu]
    pub stations: Vec<DVec3>,
    /// Leaves out the triangles that [`put_back`](enfilade_prepare::put_back) finds missing.
    pub leaves_missing: bool,
    /// Repairs of structural triangles; `None` repairs nothing.
    pub repair: Option<RepairOptions>,
    /// Time and memory, shared with whoever goes on with the scene; `None` limits neither, so that work out of proportion to a source
    /// is refused beforehand.
    pub allowance: Option<Arc<Allowance>>,
}

/// Settings of volumes of samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeOptions {
    /// The value between matter and air; `None` is the middle of a mask, and an error for other volumes.
    pub level: Option<f64>,
    /// The side of it on which air is; `None` is below a given level, and above the middle of a mask.
    pub air: Option<AirSide>,
}

/// Programs that read IFC, and their limits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IfcConverter {
    /// Programs to try in turn, by path or by a name on the `PATH`; the first that has its package decides.
    ///
    /// One called `python...` needs the package ifcopenshell, one called `node...` web-ifc; any other is taken for IfcConvert of
    /// IfcOpenShell.
    pub programs: Vec<PathBuf>,
    /// Folder for a temporary folder, which is removed at the end, or by the next import if this one is killed.
    pub folder: PathBuf,
    /// Longest time it may take.
    pub max_time: Duration,
    /// Most memory it may take, on systems that report it (Linux). [Units: bytes]
    pub max_memory: Option<u64>,
}

impl IfcConverter {
    /// Returns a converter by one program that may take an hour.
    #[must_use]
    pub fn new(program: impl Into<PathBuf>, folder: impl Into<PathBuf>) -> Self {
        Self {
            programs: vec![program.into()],
            folder: folder.into(),
            max_time: Duration::from_secs(3600),
            max_memory: None,
        }
    }
}

/// Limits on the input, so that hostile input ends in an error in bounded memory and time.
///
/// All limits but `max_file_bytes` and `max_json_bytes` apply to the sum over all files of one import.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Largest file. [Units: bytes]
    pub max_file_bytes: u64,
    /// Largest JSON part of a glTF file. [Units: bytes]
    pub max_json_bytes: u64,
    /// Most triangles, counted once per placement.
    pub max_triangles: u64,
    /// Most vertices, counted once per mesh.
    pub max_vertices: u64,
    /// Most placed meshes.
    pub max_objects: u64,
    /// Most bytes of encoded pictures.
    pub max_image_bytes: u64,
    /// Most memory that meshes, objects and placed structural triangles may take. [Units: bytes]
    ///
    /// The limit is the larger of this and [`Limits::max_expansion`] times the bytes read, so that a small file that
    /// repeats the same accessors, or declares data that it does not contain, ends early.
    pub max_bytes_of_small: u64,
    /// Most memory per byte read.
    pub max_expansion: u64,
    /// Largest depth of a node below its scene.
    pub max_node_depth: u32,
    /// Largest edge of the structural objects' box. [Units: wu]
    pub max_extent: f64,
    /// Smallest allowed longest edge of the scene's box. [Units: wu]
    pub min_extent: f64,
    /// Largest coordinate of the structural objects' box. [Units: wu]
    ///
    /// At 100 km, `f32` coordinates are 8 mm apart; beyond, walls tear.
    pub max_coordinate: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            max_file_bytes: 4 << 30,
            max_json_bytes: 256 << 20,
            max_triangles: 100_000_000,
            max_vertices: 100_000_000,
            max_objects: 2_000_000,
            max_image_bytes: 4 << 30,
            max_bytes_of_small: 256 << 20,
            max_expansion: 64,
            max_node_depth: 1024,
            max_extent: 2000.0,
            min_extent: 0.1,
            max_coordinate: 100_000.0,
        }
    }
}

impl Limits {
    /// Returns limits small enough for fuzzing: never more than a few megabytes of memory.
    #[must_use]
    #[doc(hidden)]
    pub fn tiny() -> Self {
        Self {
            max_file_bytes: 1 << 20,
            max_json_bytes: 1 << 20,
            max_triangles: 100_000,
            max_vertices: 100_000,
            max_objects: 10_000,
            max_image_bytes: 1 << 20,
            max_bytes_of_small: 64 << 20,
            max_node_depth: 64,
            ..Self::default()
        }
    }
}

impl ImportOptions {
    /// Returns the transform from input space to world space.
    pub(crate) fn base_transform(&self) -> Result<DMat4, BadOption> {
        let unit = self.unit.unwrap_or(1.0);
        if !(unit.is_finite() && (1e-9..=1e9).contains(&unit)) {
            return Err(BadOption {
                option: "unit",
                problem: format!(
                    "{unit} is not a length in meters; give e.g. 0.001 for millimeters"
                ),
            });
        }
        if !self.origin.is_finite() {
            return Err(BadOption {
                option: "origin",
                problem: format!("{} is not a point", self.origin),
            });
        }
        let axes = self.up.unwrap_or(Up::Y).axes();
        // A product with an identity would turn some 0 into -0; keep plain input unchanged.
        Ok(DMat4::from_translation(-self.origin) * DMat4::from_scale(DVec3::splat(unit)) * axes)
    }
}
