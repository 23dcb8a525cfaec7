//! Reads glTF, GLB, OBJ, PLY, STL, IFC, gbXML, HBJSON, Quake maps, and sources that are not triangles into one [`Scene`].
//!
//! [`import`] reads any number of files into one scene, in meters and +Y up, with a role for each object and a report
//! of everything skipped or repaired. Input is not trusted: each count, offset and index is checked before use,
//! [`Limits`] bound the memory, and bad input ends in an [`ImportError`] with place and remedy.
//!
//! Each object's transform has a determinant of at least 0: a mirrored placement gets a mirrored mesh, so front faces
//! are always counter-clockwise in world space.
//!
//! ```
//! use enfilade_import::{ImportOptions, decode_obj};
//!
//! let text = b"o Wall\nv 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nf 1 2 3 4\n";
//! let imported = decode_obj(text, &ImportOptions::default())?;
//! assert_eq!(imported.scene.objects[0].reason, "name: 'wall'");
//! assert_eq!(imported.scene.meshes[0].primitives[0].indices.len(), 6);
//! # Ok::<(), enfilade_import::ImportError>(())
//! ```
//!
//! Not supported: animation, skins, curves, points and lines; they are left out with a note.

mod arrays;
mod builder;
mod caught;
mod energy;
mod error;
mod export;
mod extent;
mod files;
mod foreign;
mod gltf;
mod groups;
mod held;
mod ifc;
mod left_out;
mod map;
mod marks;
mod mesh;
mod mtl;
mod obj;
mod options;
mod order;
mod origins;
mod ply;
mod polygon;
mod prt;
mod pvs_text;
mod report;
mod rooms;
mod scans;
mod soup;
mod sources;
mod stl;
mod textures;
mod vox;

pub use arrays::{ArrayMesh, import_arrays};
pub use enfilade_prepare::{
    BadOption, CleaningOptions, CleaningReport, Example, Finding, Glob, GlobState, RepairOptions,
    RepairReport, RoleRules, ShellCounts, TextureMatter, is_match, repair, unnamed_helpers,
};
pub use error::ImportError;
pub use export::export_glb;
pub use held::{ConvertedIfc, HeldFiles};
pub use options::{IfcConverter, ImportOptions, Limits, Up, VolumeOptions};
pub use order::sort_scene;
pub use prt::{PrtError, PrtFace, PrtFile, PrtFormat, PrtPortal, read_prt, write_prt};
pub use pvs_text::{PvsText, read_pvs_text, write_pvs_text};
pub use report::{
    FileReport, ImportReport, LeftOut, Note, SurfaceReport, UpDoubt, cleaning_report,
};

use builder::Builder;
pub use caught::is_panic_caught;
use enfilade_geom::scene::Scene;
pub use enfilade_source::AirSide;
pub use enfilade_source::HeightOptions;
use enfilade_source::{FreeformScene, HeightMap, ImplicitScene, Volume};
use files::Beside;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A scene and the report of its import.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Imported {
    /// The scene.
    pub scene: Scene,
    /// Everything skipped, assumed or repaired.
    pub report: ImportReport,
}

/// Reads all files into one scene; all objects of `detail_paths` are detail.
///
/// Detects the format by content, or for OBJ by the name's ending. Linear time and memory.
///
/// # Errors
///
/// When a file cannot be read, is malformed or unsupported, when a limit is exceeded, when there are no triangles, or
/// when the scene's size indicates a wrong unit.
pub fn import(
    paths: &[PathBuf],
    detail_paths: &[PathBuf],
    options: &ImportOptions,
) -> Result<Imported, ImportError> {
    let file = |is_detail| {
        move |path: &PathBuf| SceneSource {
            is_detail,
            ..SceneSource::file(path)
        }
    };
    let all = paths.iter().map(file(false));
    import_sources(all.chain(detail_paths.iter().map(file(true))), options)
}

/// An input: a file, or a stream such as standard input.
pub struct SceneSource<'a> {
    /// The file, or the stream's name in messages. The name's ending decides the format where the content is
    /// ambiguous.
    pub path: PathBuf,
    /// Replaces the file, up to [`Limits::max_file_bytes`]. A stream has no folder, and may not refer to files.
    pub stream: Option<Box<dyn Read + 'a>>,
    /// All its objects are detail.
    pub is_detail: bool,
}

impl fmt::Debug for SceneSource<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SceneSource")
            .field("path", &self.path)
            .field("is_detail", &self.is_detail)
            .finish_non_exhaustive()
    }
}

impl SceneSource<'_> {
    /// A file, with roles decided for each object.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            stream: None,
            is_detail: false,
        }
    }
}

/// Works as [`import`] on files and streams. Reads each stream to its end before the next source.
///
/// # Errors
///
/// As [`import`].
pub fn import_sources<'a>(
    sources: impl IntoIterator<Item = SceneSource<'a>>,
    options: &ImportOptions,
) -> Result<Imported, ImportError> {
    let mut builder = Builder::new(options)?;
    for source in sources {
        let (path, limit) = (&source.path, options.limits.max_file_bytes);
        let (from, beside): (Box<dyn Read>, _) = match source.stream {
            None => {
                let folder = path.parent().map(Path::to_path_buf);
                let beside = folder.map_or(Beside::Nothing, Beside::Folder);
                (Box::new(files::open_file(path, limit)?), beside)
            }
            Some(stream) => (stream, Beside::Nothing),
        };
        let length = |head: &[u8], is_all| {
            let format = format_of(head, path, if is_all { 0 } else { limit })?;
            Ok(format.length(head, &options.limits))
        };
        let bytes = files::read_headed(from, path, limit, length)?;
        builder.begin_file(path, beside, source.is_detail);
        builder.add_read_bytes(bytes.len() as u64);
        read_any(&bytes, path, &mut builder)?;
    }
    finish(builder, options)
}

/// Works as [`import`] on files in memory; scenes refer to others of them, and never to the disk.
///
/// # Errors
///
/// As [`import`].
pub fn import_held(files: &HeldFiles, options: &ImportOptions) -> Result<Imported, ImportError> {
    let mut builder = Builder::new(options)?;
    for (name, bytes) in files.scenes() {
        let path = Path::new(name);
        builder.begin_file(path, Beside::Held(files), files.is_detail(name));
        builder.add_read_bytes(bytes.len() as u64);
        read_any(bytes, path, &mut builder)?;
    }
    finish(builder, options)
}

fn read_any(bytes: &[u8], path: &Path, builder: &mut Builder<'_>) -> Result<(), ImportError> {
    match format_of(bytes, path, 0)? {
        Format::Gltf => gltf::read(bytes, builder),
        Format::Ply => ply::read(bytes, builder),
        Format::Obj => obj::read(bytes, builder),
        Format::Map => map::read(bytes, builder),
        Format::Stl => stl::read(bytes, builder),
        Format::Ifc => ifc::read(bytes, builder),
        Format::GbXml => energy::read_gbxml(bytes, builder),
        Format::HbJson => energy::read_hbjson(bytes, builder),
        Format::Implicit => sources::read_implicit(bytes, builder),
        Format::Patches => sources::read_patches(bytes, builder),
        Format::Volume => sources::read_volume(bytes, builder),
        Format::E57 => scans::read_e57(bytes, builder),
        Format::Las => scans::read_las(bytes, builder),
        Format::Heights => sources::read_heights(bytes, builder),
        Format::Vox => vox::read(bytes, builder),
    }
}

/// The problem of a file whose reader was left out of the build.
#[cfg(not(all(feature = "draco", feature = "energy", feature = "scans")))]
fn not_built(format: &str, feature: &str) -> String {
    format!("is {format}, which this build cannot read: build it with the feature `{feature}`")
}

/// The supported formats.
#[derive(Clone, Copy)]
enum Format {
    Gltf,
    Ply,
    Obj,
    Map,
    Stl,
    Ifc,
    GbXml,
    HbJson,
    Implicit,
    Patches,
    Volume,
    E57,
    Las,
    Heights,
    Vox,
}

impl Format {
    /// Returns the length of an input according to its head; an upper bound where the head does not have it.
    fn length(self, head: &[u8], limits: &Limits) -> u64 {
        match self {
            // One byte more than allowed shows that the input is too large.
            Self::Gltf => gltf::length(head).unwrap_or(limits.max_json_bytes.saturating_add(1)),
            Self::Stl => stl::length(head).unwrap_or(u64::MAX),
            _ => u64::MAX,
        }
    }
}

/// Returns the format of a file that begins with `bytes` and has at most `most`.
fn format_of(bytes: &[u8], path: &Path, most: u64) -> Result<Format, ImportError> {
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    if bytes.is_empty() {
        return Err(ImportError::malformed(
            path,
            "start",
            "the file is empty; export it again",
        ));
    }
    // Unambiguous content first, then the name, then a guess.
    Ok(
        if let Some(error) = foreign::unsupported_bytes(bytes, path) {
            return Err(error);
        } else if bytes.starts_with(b"glTF") {
            Format::Gltf
        } else if vox::is_vox(bytes) {
            Format::Vox
        } else if ply::is_ply(bytes) {
            Format::Ply
        } else if ending == "obj" {
            Format::Obj
        } else if ending == "map" {
            Format::Map
        } else if ending == "stl" {
            Format::Stl
        } else if ifc::is_ifc(bytes) {
            Format::Ifc
        } else if energy::is_gbxml(bytes) {
            Format::GbXml
        } else if energy::is_hbjson(bytes, &ending) {
            Format::HbJson
        } else if let Some(error) = foreign::unsupported(bytes, path) {
            return Err(error);
        } else if bytes.starts_with(b"ASTM-E57") {
            Format::E57
        } else if bytes.starts_with(b"LASF") {
            Format::Las
        } else if HeightMap::is_one(bytes) {
            Format::Heights
        } else if Volume::is_one(bytes) {
            Format::Volume
        } else if ImplicitScene::is_one(bytes) {
            Format::Implicit
        } else if FreeformScene::is_one(bytes) {
            Format::Patches
        } else if gltf::is_gltf(bytes) {
            Format::Gltf
        } else if stl::is_stl(bytes) || stl::may_go_on(bytes, most) {
            Format::Stl
        } else if map::is_map(bytes) {
            Format::Map
        } else if obj::is_obj(bytes) {
            Format::Obj
        } else {
            return Err(ImportError::UnknownFormat {
                path: path.to_path_buf(),
            });
        },
    )
}

/// Reads a glTF or GLB file from memory. It may not refer to other files.
///
/// # Errors
///
/// As [`import`].
pub fn decode_gltf(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.glb", options, gltf::read)
}

/// Reads a scene of implicit shapes from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_implicit(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.json", options, sources::read_implicit)
}

/// Reads a scene of free-form patches in JSON from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_patches(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.json", options, sources::read_patches)
}

/// Reads a volume of samples from memory: NIfTI or NRRD, in one file.
///
/// # Errors
///
/// As [`import`].
pub fn decode_volume(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.nii", options, sources::read_volume)
}

/// Reads scans in E57 from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_e57(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.e57", options, scans::read_e57)
}

/// Reads a scan in LAS or LAZ from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_las(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.las", options, scans::read_las)
}

/// Reads a height map from memory: gray PNG or TIFF.
///
/// # Errors
///
/// As [`import`].
pub fn decode_heights(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.png", options, sources::read_heights)
}

/// Reads an OBJ file from memory, without its material libraries.
///
/// # Errors
///
/// As [`import`].
pub fn decode_obj(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.obj", options, obj::read)
}

/// Reads a Quake map from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_map(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.map", options, map::read)
}

/// Reads models of MagicaVoxel from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_vox(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.vox", options, vox::read)
}

/// Reads a PLY file from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_ply(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.ply", options, ply::read)
}

/// Reads an STL file from memory.
///
/// # Errors
///
/// As [`import`].
pub fn decode_stl(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.stl", options, stl::read)
}

fn decode(
    bytes: &[u8],
    name: &str,
    options: &ImportOptions,
    read: impl Fn(&[u8], &mut Builder<'_>) -> Result<(), ImportError>,
) -> Result<Imported, ImportError> {
    let mut builder = Builder::new(options)?;
    builder.begin_file(Path::new(name), Beside::Nothing, false);
    builder.add_read_bytes(bytes.len() as u64);
    read(bytes, &mut builder)?;
    finish(builder, options)
}

fn finish(builder: Builder<'_>, options: &ImportOptions) -> Result<Imported, ImportError> {
    builder.go_on("scene")?;
    let (mut scene, mut report) = builder.finish();
    if scene.objects.is_empty() {
        let kept = |left_out: &LeftOut| {
            let name = left_out.names.first()?;
            Some(format!("{left_out} (--structural-name '{name}' keeps it)"))
        };
        let noticed = || {
            Some(format!(
                "the first thing noticed: {}",
                report.notes.first()?
            ))
        };
        let advice = report.left_out.first().and_then(kept).or_else(noticed);
        let is_energy = (report.files.iter()).any(|f| ["gbXML", "HBJSON"].contains(&f.format));
        let advice = advice.unwrap_or_else(|| match is_energy {
            true => "export its surfaces, too: gbXML's Surface elements, the faces of HBJSON's rooms",
            false => "export the meshes, too",
        }.into());
        return Err(ImportError::NoTriangles {
            paths: extent::paths_of(&report),
            advice,
        });
    }
    report.up_doubt = extent::up_doubt(&scene, &report, options);
    report.unit_doubt = extent::unit_doubt(&scene, &report, options);
    report.feet_hint = extent::feet_hint(&scene, &report, options);
    extent::check(&scene, &report, options)?;
    if options.roles.is_automatic && !options.roles.is_manual {
        enfilade_prepare::decide_undecided(&mut scene);
    }
    if !options.leaves_missing {
        report.put_back = enfilade_prepare::put_back(&mut scene);
    }
    if let Some(wanted) = &options.repair {
        report.repair = Some(repair(&mut scene, wanted)?);
    }
    if !options.ignores_marks {
        scene.marks = marks::of_scene(&scene);
    }
    report.settings = report.told(options);
    Ok(Imported { scene, report })
}
