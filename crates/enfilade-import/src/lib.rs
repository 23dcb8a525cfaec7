//! Reads glTF, GLB, OBJ, PLY, STL and Quake maps into one [`Scene`].
//!
//! [`import`] takes any number of files and gives one scene, in meters and +Y up, with a role for
//! each object and a report of everything skipped or repaired. Input is not trusted: each count,
//! offset and index is checked before use, memory is bounded by [`Limits`], and bad input ends in
//! an [`ImportError`] that says where and what to do.
//!
//! Each object's transform has a determinant of at least 0: a mirrored placement gets a mirrored
//! mesh, so front faces are counter-clockwise in world space without further thought.
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
//! Not promised: animation, skins, cameras, lights, curves, points and lines; they
//! are left out with a note.

mod auto_roles;
mod builder;
mod clean;
mod crossing;
mod error;
mod export;
mod extent;
mod files;
mod foreign;
mod gltf;
mod ifc;
mod map;
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
mod repair;
mod report;
mod roles;
mod shells;
mod soup;
mod stl;
mod tjunction;

pub use clean::{CleaningOptions, CleaningReport, ShellCounts, cleaning_report};
pub use error::ImportError;
pub use export::export_glb;
pub use options::{IfcConverter, ImportOptions, Limits, Up};
pub use order::sort_scene;
pub use prt::{PrtError, PrtFace, PrtFile, PrtFormat, PrtPortal, read_prt, write_prt};
pub use pvs_text::{PvsText, read_pvs_text, write_pvs_text};
pub use repair::{RepairOptions, RepairReport, repair};
pub use report::{Example, FileReport, Finding, ImportReport, Note};
pub use roles::{RoleRules, is_match};

use builder::Builder;
use enfilade_geom::scene::Scene;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A scene and what was noticed while reading it.
#[derive(Clone, Debug, Default)]
pub struct Imported {
    /// What was read.
    pub scene: Scene,
    /// What was noticed.
    pub report: ImportReport,
}

/// Reads all files into one scene; those of `detail_paths` are detail as a whole.
///
/// The format is told by content, or by the name's ending for OBJ. Time and memory grow linearly
/// with the input.
///
/// # Errors
///
/// When a file cannot be read, is malformed or unsupported, when a limit is passed, when there is
/// no triangle, or when the scene's size speaks of a wrong unit.
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

/// A scene on its way in: a file, or a stream such as standard input.
pub struct SceneSource<'a> {
    /// The file, or what the stream is called in messages; a name's ending tells the format where content leaves a doubt.
    pub path: PathBuf,
    /// Read instead of the file, up to [`Limits::max_file_bytes`]. What comes so has no folder, and refers to no files.
    pub stream: Option<Box<dyn Read + 'a>>,
    /// Whether all its objects are detail.
    pub is_detail: bool,
}

impl SceneSource<'_> {
    /// A file whose objects have the roles that they seem to have.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            stream: None,
            is_detail: false,
        }
    }
}

/// [`import`], from files and streams; the stream of each is read to its end before the next source is begun.
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
        let (bytes, folder) = match source.stream {
            None => (files::read_file(path, limit)?, path.parent()),
            Some(stream) => (files::read_up_to(stream, path, limit)?, None),
        };
        builder.begin_file(path, folder, source.is_detail);
        builder.add_read_bytes(bytes.len() as u64);
        read_any(&bytes, path, &mut builder)?;
    }
    finish(builder, options)
}

fn read_any(bytes: &[u8], path: &Path, builder: &mut Builder<'_>) -> Result<(), ImportError> {
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    // Content first, where it leaves no doubt; then the name; then a guess.
    if bytes.starts_with(b"glTF") {
        gltf::read(bytes, builder)
    } else if ply::is_ply(bytes) {
        ply::read(bytes, builder)
    } else if ending == "obj" {
        obj::read(bytes, builder)
    } else if ending == "map" {
        map::read(bytes, builder)
    } else if ending == "stl" {
        stl::read(bytes, builder)
    } else if ifc::is_ifc(bytes) {
        ifc::read(bytes, builder)
    } else if let Some(error) = foreign::unsupported(bytes, path) {
        Err(error)
    } else if gltf::is_gltf(bytes) {
        gltf::read(bytes, builder)
    } else if stl::is_stl(bytes) {
        stl::read(bytes, builder)
    } else if map::is_map(bytes) {
        map::read(bytes, builder)
    } else if obj::is_obj(bytes) {
        obj::read(bytes, builder)
    } else {
        Err(ImportError::UnknownFormat {
            path: path.to_path_buf(),
        })
    }
}

/// Reads a glTF or GLB file from memory; it may refer to no other file.
///
/// # Errors
///
/// As [`import`].
pub fn decode_gltf(bytes: &[u8], options: &ImportOptions) -> Result<Imported, ImportError> {
    decode(bytes, "memory.glb", options, gltf::read)
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
    builder.begin_file(Path::new(name), None, false);
    builder.add_read_bytes(bytes.len() as u64);
    read(bytes, &mut builder)?;
    finish(builder, options)
}

fn finish(builder: Builder<'_>, options: &ImportOptions) -> Result<Imported, ImportError> {
    let (mut scene, mut report) = builder.finish();
    if scene.objects.is_empty() {
        let advice = match report.notes.first() {
            Some(note) => format!("the first thing noticed: {note}"),
            None => "export the meshes, too".into(),
        };
        return Err(ImportError::NoTriangles {
            paths: extent::paths_of(&report),
            advice,
        });
    }
    extent::check(&scene, &report, options)?;
    report.unit_doubt = extent::unit_doubt(&scene, &report, options);
    if options.roles.is_automatic && !options.roles.is_manual {
        auto_roles::judge(&mut scene);
    }
    if let Some(wanted) = &options.repair {
        report.repair = Some(repair(&mut scene, wanted)?);
    }
    Ok(Imported { scene, report })
}
