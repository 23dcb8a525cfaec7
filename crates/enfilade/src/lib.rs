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
//! compute in `f64`, files hold `f32`; ids are indices into lists. Points and directions in run-time queries and their
//! answers are `[f32; 3]`, as in the file.
//!
//! # Limits
//!
//! Cells need not be convex, and a scene without rooms has only the outdoor cell. Moving geometry (door leaves,
//! furniture) is detail: it bounds no cell.

mod file;
pub mod whole;

pub use glam;

/// The graph of cells and portals, its invariants, the locator, and the file.
pub mod cpg {
    pub use enfilade_cpg::{
        Batch, Cell, CellId, CellPortalGraph, CellSet, CloseDecision, DetailObject, Doubt, Exit,
        Fact, Fitting, FittingPart, GraphError, Hole, HoleReason, Locator, LocatorNode,
        MonitorCamera, Motion, MotionKind, PartNumbers, Pass, Place, Portal, PortalId, PortalKind,
        Provenance, Pvs, Reason, RoomDoubt, SightGraph, SightGraphError, SightPortal, SourceRuns,
        SpecialId, SpecialPortal, SpecialProblem, SpecialShape, Statistics, VisibleParts,
        VisibleVolumes, Way, Why, World, cell_color,
    };

    /// Worlds as bytes of GLB files ([docs/format.md](https://github.com/enfilade-rs/enfilade/blob/main/docs/format.md)).
    pub mod wire {
        pub use enfilade_cpg::wire::{
            EXTENSION, PieceContent, VERSION, WireError, decode_glb, encode_glb, is_world,
            read_piece,
        };
    }
}

/// Boxes, planes, polygons, poses, and the input scene.
pub mod geom {
    pub use enfilade_geom::{
        Aabb, Allowance, ConvexSolid, End, MemoryProbe, Plane, Shown, Similarity, SolidError,
        Triangle, Winding, shown,
    };
    pub use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, DVec4};

    /// The input scene: meshes, and objects that place them.
    pub mod scene {
        pub use enfilade_geom::scene::{
            About, Entity, Filling, Fixture, FixtureKind, GivenPortal, Image, Mark, MarkKind,
            Material, Mesh, Object, Primitive, Role, RoomName, Scene, SourceNode, Texture,
            TriangleSource,
        };
    }
}

/// Visibility per frame: what a view sees, doors, following, picking and lines of sight.
pub mod runtime {
    pub use enfilade_runtime::{
        Chunk, ChunkId, DetailId, Draw, DrawList, Follower, Hit, Leaf, Narrowing, NotFinite,
        SavedDoors, SavedDoorsError, SeeCounts, SeeOptions, Seen, Sight, SightError, SightOptions,
        SightSkeleton, SightState, Sightlines, SkeletonError, Start, Step, Stops, Target, View,
        ViewError, Viewer, Visit,
    };
}

/// Scene → [`World`]: finds cells and portals, and changes finished worlds.
#[cfg(feature = "bake")]
pub mod bake {
    pub use enfilade_bake::complex::Leak;
    pub use enfilade_bake::{
        BakeConfig, BakeContext, BakeError, BakeOutput, Budget, MergeSettings, Method, Outdoors,
        Pieces, Progress, Resolution, Silent, SmallestHole, Stage, bake,
    };

    /// Settings of the binary space partition, and leaks of its solids.
    pub mod bsp {
        pub use enfilade_bake::bsp::{BspConfig, Guide, Heuristic, Rooms};
    }

    /// Settings of the Delaunay builder.
    pub mod delaunay {
        pub use enfilade_bake::delaunay::{Choices, DelaunayConfig, DelaunayError, Weight};
    }

    /// Portals, mirrors and links added to finished worlds.
    pub mod edit {
        pub use enfilade_bake::edit::{AddPortalError, Added, add_portal};

        /// Mirrors, monitors and links.
        pub mod special {
            pub use enfilade_bake::edit::special::{
                LinkOptions, SpecialError, Spot, link, mirror, monitor, plain, reflect, tint,
            };
        }
    }

    /// The widest path from a room to the outdoors.
    pub mod leak {
        pub use enfilade_bake::leak::{LeakTrail, NoTrail, find_leak_trail};
    }

    /// Names of cells.
    pub mod names {
        pub use enfilade_bake::names::rename_cells;
    }

    /// Bakes of the part of a scene that changed.
    pub mod rebake {
        pub use enfilade_bake::rebake::{RebakeError, Rebaked, WholeBecause, rebake};
    }

    /// Cells merged where a portal costs more than it hides.
    pub mod simplify {
        pub use enfilade_bake::simplify::{
            CostModel, Metric, Simplified, SimplifySettings, UnknownMaterial, delete_portal,
            simplify,
        };
    }
}

/// Editing sessions: pieces, changes by hand, undo, a journal.
#[cfg(feature = "edit")]
pub mod edit {
    pub use enfilade_edit::{
        EditError, EditGround, EditOperation, EditSession, EditedSpace, EditedWorld, HandEdit,
        HandEditError, HandEditKind, JournalError, OwnWorlds, Resumed,
    };
}

/// Scenes from files: glTF, OBJ, PLY, STL, IFC, maps, and sources that are not triangles.
#[cfg(feature = "import")]
pub mod import {
    pub use enfilade_import::{
        AirSide, ArrayMesh, BadOption, CleaningOptions, CleaningReport, Example, FileReport,
        Finding, Glob, GlobState, HeightOptions, IfcConverter, ImportError, ImportOptions,
        ImportReport, Imported, LeftOut, Limits, Note, PrtError, PrtFace, PrtFile, PrtFormat,
        PrtPortal, PvsText, RepairOptions, RepairReport, RoleRules, SceneSource, ShellCounts,
        SurfaceReport, TextureMatter, Up, UpDoubt, VolumeOptions, decode_gltf, decode_map,
        decode_obj, decode_ply, decode_stl, decode_vox, export_glb, import, import_arrays,
        import_sources, read_prt, read_pvs_text, write_prt, write_pvs_text,
    };
}

/// Levels put together from baked pieces.
#[cfg(feature = "kit")]
pub mod kit {
    pub use enfilade_kit::{
        Assembly, Attachment, Choice, Chosen, DEFAULT_TOLERANCE, End, FlattenError, Instance,
        InstanceId, Kit, KitFault, LevelParts, LevelSpace, Link, Mouth, Piece, PieceError,
        PieceNamedTwice, PlaceError, PlaceOptions, Spot, open_air,
    };

    /// Levels made at random.
    pub mod generate {
        pub use enfilade_kit::generate::{dungeon, maze, office};
    }
}

/// Pictures of a world with wgpu.
#[cfg(feature = "render")]
pub mod render {
    pub use enfilade_render::{
        AdapterChoice, Camera, Culling, Frame, Gpu, LampCone, LampLight, LampOptions,
        MadePortalTextures, Mark, MarkShape, Paint, Picture, PieceOf, PortalTextureCounts,
        PortalTextureError, PortalTextureFileError, PortalTextureMaking, PortalTextureOptions,
        PortalTexturePaint, PortalTextureProgress, Projection, Prop, PropMesh, RenderError,
        RenderList, SpaceCounts, SpaceShot, Studio, StudioTarget, Style, Viewpoints, good_camera,
    };
}

/// Worlds in pieces, fetched as they come into view and kept within a budget.
#[cfg(feature = "stream")]
pub mod stream {
    pub use enfilade_stream::{
        Catalog, Cause, Changes, Eye, Failed, Fetch, FetchError, FileFetch, Frame, HEAD, InView,
        LinkOptions, Loaded, PackError, PackedFiles, PackedHead, PackedPlace, PackedWorld, Piece,
        PieceAt, PieceId, PinError, Policy, Reply, SimulatedLink, Source, StandIn, StreamCounts,
        StreamOptions, Streamer, ThreadSource, WorldPieces,
    };
    #[cfg(feature = "http")]
    pub use enfilade_stream::{HttpFetch, PackedHttp};
}

/// The checker of the promises of a world, which shares no code with any builder.
#[cfg(feature = "verify")]
pub mod verify {
    pub use enfilade_verify::{
        CompleteCounts, EvidenceError, EvidenceReport, Failure, FailureKind, SealedCounts,
        VerifyOptions, VerifyReport, VisibleCounts, structural_triangles, verify_evidence,
        verify_world,
    };
}

/// Visibility from each cell, precomputed.
#[cfg(feature = "vis")]
pub mod vis {
    pub use enfilade_vis::{
        VisBlocks, VisCheckpoint, VisConfig, VisContext, VisError, VisMode, VisOutput, Witness,
        WorldVis, see_all, see_parts, see_world,
    };
}

/// Queries of a living world: things, actors, paths, sound, light, contacts, moving rooms.
#[cfg(feature = "world")]
pub mod world {
    pub use enfilade_world::{
        Acoustics, ActorEvent, ActorId, ActorPlace, Actors, Agent, Arrival, Assumed, AwakeCells,
        Blocked, Body, Cast, Caster, Cause, CellShape, Chance, Contact, Corner, DecayLaw,
        DiffuseFields, Docking, Errands, Exit, Flood, Floors, Followed, Geodesics, Heard, Hop,
        Hops, Impact, KeptMapError, Lamp, LampError, LampId, Layout, LengthSearch, Lights,
        Listener, Moved, NoPath, OCTAVES, Obstacle, Opening, Pairs, PartId, PassedPortal, Passing,
        Path, PathFollower, PathPoint, PathPortal, PathSearch, Place, PlanDraft, Pose, Posted,
        Progress, Reverb, SPEED_OF_SOUND, Sampling, SavedActor, SavedActors, SavedError, SavedPose,
        SavedSpace, SavedThing, SavedThings, SavedTie, SeenContext, SeenVia, Shape, ShapeError,
        SightRay, Space, SpaceError, SpaceSeen, SpaceViewer, SpecialImage, SpecialOptions,
        StoppedSpecial, ThingError, ThingId, Things, Tie, TraceEnd, Traced, Transmission, WalkMap,
        WalkMapKey, Walker, WayPoint, Ways,
    };
}

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
