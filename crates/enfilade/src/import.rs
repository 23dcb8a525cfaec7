//! Scenes from files: glTF, OBJ, PLY, STL, IFC, maps, and sources that are not triangles.
//!
//! Meshes that a program already holds:
//!
//! ```
//! use enfilade::geom::DMat4;
//! use enfilade::import::{ArrayMesh, ImportOptions, import_arrays};
//!
//! let wall = ArrayMesh {
//!     names: ["wall".to_owned(), String::new()],
//!     positions: vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 3.0, 0.0], [0.0, 3.0, 0.0]],
//!     triangles: vec![[0, 1, 2], [0, 2, 3]],
//!     transform: DMat4::IDENTITY,
//!     is_detail: false,
//! };
//! let imported = import_arrays("made here", vec![wall], &ImportOptions::default())?;
//! assert_eq!(imported.scene.objects.len(), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A scene as GLB, and back; [`Limits`] bound what is read, and the [`ImportError`] tells what was too much:
//!
//! ```
//! use enfilade::import::{ImportOptions, Limits, decode_gltf, export_glb};
//! # let scene = enfilade_testkit::furnished_house().scene;
//!
//! let bytes = export_glb(&scene);
//! let read = decode_gltf(&bytes, &ImportOptions::default())?;
//! assert_eq!(read.scene.objects.len(), scene.objects.len());
//! let options = ImportOptions {
//!     limits: Limits { max_objects: 1, ..Limits::default() },
//!     ..ImportOptions::default()
//! };
//! assert!(decode_gltf(&bytes, &options).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Portal files of other programs, and their sets of visible leaves:
//!
//! ```
//! use enfilade::import::{read_prt, read_pvs_text, write_prt, write_pvs_text};
//!
//! let text = "PRT1\n2\n1\n4 0 1 (0 0 0 ) (0 64 0 ) (0 64 96 ) (0 0 96 ) \n";
//! let file = read_prt(text)?;
//! assert_eq!((file.portals.len(), file.portals[0].points.len()), (1, 4));
//! assert_eq!(read_prt(&write_prt(&file))?, file);
//! let error = read_prt("PRT1\n2\nmany").unwrap_err();
//! assert_eq!(error.line, 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Patterns of [`RoleRules`] tell walls from furniture by name:
//!
//! ```
//! use enfilade::import::{ImportOptions, decode_obj};
//!
//! let text = b"o Chair\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let mut options = ImportOptions::default();
//! let before = decode_obj(text, &options)?;
//! options.roles.structural.push("chair*".to_owned());
//! let after = decode_obj(text, &options)?;
//! assert_ne!(before.scene.objects[0].role, after.scene.objects[0].role);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use enfilade_import::{
    AirSide, ArrayMesh, BadOption, CleaningOptions, CleaningReport, Example, FileReport, Finding,
    Glob, GlobState, HeightOptions, IfcConverter, ImportError, ImportOptions, ImportReport,
    Imported, LeftOut, Limits, Note, PrtError, PrtFace, PrtFile, PrtFormat, PrtPortal, PvsText,
    RepairOptions, RepairReport, RoleRules, SceneSource, ShellCounts, SurfaceReport, TextureMatter,
    Up, UpDoubt, VolumeOptions, decode_gltf, decode_map, decode_obj, decode_ply, decode_stl,
    decode_vox, export_glb, import, import_arrays, import_sources, read_prt, read_pvs_text,
    write_prt, write_pvs_text,
};
