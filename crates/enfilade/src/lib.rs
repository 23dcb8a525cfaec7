//! `enfilade` finds the rooms (cells) and doorways (portals) of a 3D scene by itself, and answers
//! from then on what can be seen and reached from where.
//!
//! ```text
//! scene ──► bake ──► cell-and-portal graph ──► world file (.glb) ──► your engine
//! ```
//!
//! | module | does |
//! | --- | --- |
//! | [`import`] | reads glTF, OBJ, PLY and STL into one [`Scene`](geom::scene::Scene) |
//! | [`bake`] | scene → [`World`](cpg::World): finds cells and portals |
//! | [`cpg`] | the graph, its invariants, the locator, and the file ([`cpg::wire`]) |
//! | [`runtime`] | questions per frame |
//! | [`vis`] | what can be seen from each cell, before run-time |
//! | [`geom`] | boxes, planes, windings, the scene, the bounding volume hierarchy |
//!
//! # Reading a world
//!
//! A world file is a GLB that any viewer opens; `docs/format.md` describes it. Here one is made in
//! code, as `enfilade bake` would write it: two rooms of 4 × 3 × 5 m with a doorway between.
//!
//! ```
//! use enfilade::cpg::wire::{decode_glb, encode_glb};
//! use enfilade::cpg::{
//!     Cell, CellId, CellPortalGraph, Locator, LocatorNode, Portal, PortalId, PortalKind, World,
//! };
//! use enfilade::geom::{Aabb, DVec3};
//!
//! let room = |name: &str, x: f32| Cell {
//!     name: name.into(),
//!     aabb: [[x, 0.0, 0.0], [x + 4.0, 3.0, 5.0]],
//!     volume: 60.0,
//!     portals: vec![PortalId(0)],
//!     ..Cell::default()
//! };
//! // Counter-clockwise seen from the second cell, which the normal points to.
//! let outline = vec![[4.0, 0.0, 2.0], [4.0, 2.1, 2.0], [4.0, 2.1, 3.0], [4.0, 0.0, 3.0]];
//! let graph = CellPortalGraph {
//!     cells: vec![room("cell-0", 0.0), room("cell-1", 4.0)],
//!     portals: vec![Portal {
//!         cells: [CellId(0), CellId(1)],
//!         kind: PortalKind::Open,
//!         normal: [1.0, 0.0, 0.0],
//!         pieces: vec![outline.clone()],
//!         outline,
//!         area: 2.1,
//!     }],
//!     locator: Locator {
//!         bounds: Aabb::new(DVec3::ZERO, DVec3::new(8.0, 3.0, 5.0)),
//!         planes: vec![[1.0, 0.0, 0.0, -4.0]],
//!         nodes: vec![LocatorNode {
//!             plane: 0,
//!             children: [Locator::leaf(Some(CellId(1))), Locator::leaf(Some(CellId(0)))],
//!         }],
//!         root: 0,
//!         ..Locator::default()
//!     },
//!     ..CellPortalGraph::default()
//! };
//! let bytes = encode_glb(&World { graph, ..World::default() })?;
//!
//! // From here on it is what an engine does with a file.
//! let world = decode_glb(&bytes)?; // checked: every invariant holds, or this is an error
//! let eye = DVec3::new(1.0, 1.6, 2.0);
//! let cell = world.graph.locator.locate(eye).expect("the eye is in a room");
//! assert_eq!(world.graph.cells[cell.0 as usize].name, "cell-0");
//!
//! // Where do its doorways lead?
//! for portal in &world.graph.cells[cell.0 as usize].portals {
//!     let portal = &world.graph.portals[portal.0 as usize];
//!     let [from, to] = portal.cells;
//!     let next = if from == cell { to } else { from };
//!     assert_eq!(world.graph.cells[next.0 as usize].name, "cell-1");
//! }
//!
//! // What is drawn from here without looking through a doorway?
//! let own = world.batches.iter().filter(|b| b.cells.contains(&cell));
//! assert_eq!(own.count(), 0); // this world has no walls
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Conventions, everywhere
//!
//! Right-handed, +Y up, meters; front faces are counter-clockwise; ranges are half-open; building
//! computes in `f64`, files hold `f32`; ids are positions in lists.
//!
//! # What is not promised
//!
//! Cells need not be convex, and a scene without rooms has none but the outdoors. Geometry that
//! moves (door leaves, furniture) is detail: it bounds no cell.

pub use enfilade_bake as bake;
pub use enfilade_cpg as cpg;
pub use enfilade_geom as geom;
pub use enfilade_import as import;
pub use enfilade_runtime as runtime;
pub use enfilade_vis as vis;
