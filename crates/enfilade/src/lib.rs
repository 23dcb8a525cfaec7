//! `enfilade` finds the rooms (cells) and doorways (portals) of a 3D scene automatically, and then answers
//! queries of visibility and paths between them.
//!
//! ```text
//! scene ──► bake ──► cell-and-portal graph ──► world file (.glb) ──► your program
//! ```
//!
//! # From a file to a frame
//!
//! Bake a scene into a world once, with the command `enfilade bake house.glb -o world.glb` or in code (features `import` and
//! `bake`). This scene is a house from the test kit:
#![cfg_attr(all(feature = "import", feature = "bake"), doc = "```")]
#![cfg_attr(not(all(feature = "import", feature = "bake")), doc = "```ignore")]
//! use enfilade::bake::{BakeConfig, BakeContext, bake};
//! use enfilade::import::{ImportOptions, import};
//!
//! # let folder = std::env::temp_dir().join(format!("enfilade-tour-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! # let (house, baked) = (folder.join("house.glb"), folder.join("world.glb"));
//! # let scene = enfilade_testkit::furnished_house().scene;
//! # std::fs::write(&house, enfilade::import::export_glb(&scene))?;
//! let imported = import(&[house], &[], &ImportOptions::default())?;
//! let output = bake(&imported.scene, &BakeConfig::default(), &BakeContext::default())?;
//! enfilade::save(&baked, &output.world)?;
//!
//! let world = enfilade::open(&baked)?; // checked: every invariant holds, or this is an error
//! assert_eq!(world.graph.indoor_cells().count(), 12);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The graph: each cell knows its portals, each portal its two cells.
//!
//! ```
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::offices(24, 1));
//! let graph = &world.graph;
//! let cell = graph.cell_named("cell-3").expect("there is a cell-3");
//! println!("{} has {:.0} m³", graph[cell].name, graph[cell].volume);
//! for exit in graph.exits(cell) {
//!     println!("{}, {:?}, leads to {}", exit.id, exit.portal.kind, graph[exit.to].name);
//!     assert_eq!(graph[exit.id].beyond(exit.to), cell);
//! }
//! ```
//!
//! To draw frames, build a [`Sight`] once. Every frame, query a [`Viewer`] (one per camera) for everything that a [`View`]
//! sees; a [`DrawList`] turns the answer into few ranges of triangles.
//!
//! ```
//! use enfilade::{DrawList, Sight, SightState, View, Viewer};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::offices(24, 1));
//!
//! let sight = Sight::build(&world)?;
//! let mut state = SightState::new(&sight); // the state of doors; all are open
//! let (mut viewer, mut list) = (Viewer::new(&sight), DrawList::new());
//!
//! // Every frame; allocates nothing once warm.
//! let view = View::perspective([2.0, 1.6, 2.0], [1.0, 0.0, 0.3], [0.0, 1.0, 0.0], 1.0, 16.0 / 9.0)?;
//! let seen = viewer.see(&sight, &state, &view);
//! list.fill(&sight, &seen);
//! for draw in &list {
//!     let primitive = &draw.batch(&world).primitive; // positions, normals, uvs, material
//!     let triangles = draw.indices(&sight);
//!     // ... draw them
//! #     assert!(triangles.iter().all(|&i| (i as usize) < primitive.positions.len()));
//! }
//! for &detail in seen.details() {
//!     let object = &world[detail];
//!     // ... draw `world.detail_meshes[object.mesh as usize]` with `object.transform`
//! #     assert!((object.mesh as usize) < world.detail_meshes.len());
//! }
//! assert!(list.n_triangles() < sight.n_triangles());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Doors, picking and lines of sight: a closed portal hides everything behind it and stops a line.
//!
//! ```
//! use enfilade::{Sight, Sightlines, SightState, Target};
//! # let mut params = enfilade_testkit::GridParams::offices(24, 1);
//! # params.furniture = 0;
//! # let world = enfilade_testkit::room_grid(&params);
//!
//! let sight = Sight::build(&world)?;
//! let lines = Sightlines::build(&world);
//! let mut state = SightState::new(&sight);
//!
//! let (door, portal) = (enfilade::PortalId(0), &world.graph.portals[0]);
//! let [x, y, z] = portal.center();
//! let step = portal.normal.map(|n| 0.2 * n);
//! let (here, there) = ([x - step[0], y - step[1], z - step[2]], [x + step[0], y + step[1], z + step[2]]);
//!
//! assert!(lines.is_clear(&state, here, there));
//! state.close(door);
//! let hit = lines.pick(&state, here, there)?.expect("a closed door");
//! assert_eq!(hit.target, Target::Portal(door));
//! assert_eq!(hit.cell, sight.locate(here));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The folder `examples` has all of this as programs: `bake_a_file`, `game_loop`, `doors`, and `own_builder`, which makes a
//! world without a bake.
//!
//! # Features
//!
//! | feature | module | contents |
//! | --- | --- | --- |
//! | always | [`cpg`] | the graph, its invariants, the locator, and the file ([`cpg::wire`]) |
//! | always | [`runtime`] | visibility queries per frame |
//! | always | [`whole`] | atomic writing of files |
//! | always | [`geom`] | boxes, planes, windings, the scene, the bounding volume hierarchy |
//! | `import` | `import` | reads glTF, OBJ, PLY and STL into one [`Scene`](geom::scene::Scene) |
//! | `draco`, `scans`, `tiff` | | … glTF compressed with Draco; scans in E57, LAS and LAZ; height maps in TIFF |
//! | `bake` | `bake` | scene → [`World`]: finds cells and portals |
//! | `vis` | `vis` | visibility from each cell, precomputed |
//! | `render` | `render` | pictures of a world with wgpu |
//! | `verify` | `verify` | checks the promises of a world |
//! | `stream` | `stream` | worlds in pieces, fetched as they come into view and kept within a budget |
//! | `kit` | `kit` | levels put together from baked pieces |
//! | `edit` | `edit` | editing sessions: pieces, changes by hand, undo, a journal |
//! | `world` | `world` | queries of a living world: things, paths, sound, contacts, moving rooms |
//!
//! None is on by default: a game that only loads and queries worlds links neither importers nor builders.
//!
//! # Conventions, everywhere
//!
//! Right-handed, +Y up, meters; front faces are counter-clockwise; ranges are half-open; builders
//! compute in `f64`, files hold `f32`; ids are indices into lists.
//!
//! Points and directions are of one of two types:
//!
//! | modules | type | why |
//! | --- | --- | --- |
//! | this one, [`cpg`], [`runtime`], `stream`; lamps of `world` | `[f32; 3]` | as in the file, and without a library of vectors |
//! | [`geom`], `import`, `bake`, `vis`, `world`, `kit`, `edit`; the [`Locator`](cpg::Locator) | [`DVec3`](geom::DVec3) | they compute in `f64` |
//! | `render` | `glam::Vec3`, and `DVec3` in spaces | as shaders do |
//!
//! [`glam`] is re-exported, so that nobody needs to find its version: `DVec3::from(p.map(f64::from))` and
//! `p.as_vec3().to_array()` convert.
//!
//! # What is promised
//!
//! The items that this crate names, and nothing else, are the API; `api.txt` beside its sources lists them all. While the
//! version is 0.x, a minor version may break them, and a patch version does not. The crates behind it (`enfilade-bake` and so
//! on) may change with any version, and so may what is hidden from these pages.
//!
//! - **Settings** are made with `..Default::default()`, as in `BakeConfig { min_opening: 0.7, ..BakeConfig::default() }`: a
//!   patch version may add a field.
//! - **Results, errors and reasons** are `#[non_exhaustive]` where they may grow: match them with `..` and `_`.
//! - **Parts of worlds and scenes** ([`World`], [`Cell`], [`Portal`], [`Scene`](geom::scene::Scene)) are made by users, too. A
//!   new field is a new minor version.
//! - All types are `Debug`, `Send` and `Sync`, unless they say why not.
//!
//! # Limits
//!
//! Cells need not be convex, and a scene without rooms has only the outdoor cell. Moving geometry (door leaves,
//! furniture) is detail: it bounds no cell.

mod file;
pub mod whole;

pub use glam;

#[cfg(feature = "bake")]
pub mod bake;
pub mod cpg;
#[cfg(feature = "edit")]
pub mod edit;
pub mod geom;
#[cfg(feature = "import")]
pub mod import;
#[cfg(feature = "kit")]
pub mod kit;
#[cfg(feature = "render")]
pub mod render;
pub mod runtime;
#[cfg(feature = "stream")]
pub mod stream;
#[cfg(feature = "verify")]
pub mod verify;
#[cfg(feature = "vis")]
pub mod vis;
#[cfg(feature = "world")]
pub mod world;
/// All that our crates make public for each other: for the command and the benchmarks. Not part of the promise.
#[doc(hidden)]
pub mod internals {
    #[cfg(feature = "bake")]
    pub use enfilade_bake as bake;
    pub use enfilade_cpg as cpg;
    #[cfg(feature = "edit")]
    pub use enfilade_edit as edit;
    pub use enfilade_geom as geom;
    #[cfg(feature = "import")]
    pub use enfilade_import as import;
    #[cfg(feature = "kit")]
    pub use enfilade_kit as kit;
    pub use enfilade_runtime as runtime;
    #[cfg(feature = "stream")]
    pub use enfilade_stream as stream;
    #[cfg(feature = "vis")]
    pub use enfilade_vis as vis;
    #[cfg(feature = "world")]
    pub use enfilade_world as world;
}

pub use cpg::{
    Batch, Cell, CellId, CellPortalGraph, DetailObject, Exit, Portal, PortalId, PortalKind, Pvs,
    World,
};
pub use file::{FileError, open, save};
pub use runtime::{
    ChunkId, DetailId, Draw, DrawList, Follower, Hit, NotFinite, Seen, Sight, SightError,
    SightState, Sightlines, Step, Target, View, ViewError, Viewer,
};

/// The README's programs, compiled with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

/// The tutorial of living worlds, compiled with the tests.
#[cfg(all(doctest, feature = "world"))]
#[doc = include_str!("../../../docs/living.md")]
struct Living;

/// The page about worlds in pieces, compiled with the tests.
#[cfg(all(doctest, feature = "stream"))]
#[doc = include_str!("../../../docs/streaming.md")]
struct Streaming;

/// The page about portal textures, compiled with the tests.
#[cfg(all(doctest, feature = "render"))]
#[doc = include_str!("../../../docs/portal-textures.md")]
struct PortalTextures;
