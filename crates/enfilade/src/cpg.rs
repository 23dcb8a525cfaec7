//! The graph of cells and portals, its invariants, the locator, and the file.
//!
//! Each cell knows its portals, each [`Portal`] its two cells:
//!
//! ```
//! use enfilade::{CellId, PortalKind};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let graph = &world.graph;
//! assert_eq!(graph.cell_ids().len(), 2);
//! let door = graph.portals_between(CellId(0), CellId(1)).next().expect("a doorway");
//! assert_eq!(graph[door].kind, PortalKind::Open);
//! assert_eq!(graph[door].beyond(CellId(0)), CellId(1));
//! let [width, height] = graph[door].size();
//! assert!(width < height && !graph[door].is_level());
//! assert!(graph.exits(CellId(1)).any(|exit| exit.to == CellId(0)));
//! ```
//!
//! The [`Locator`] finds the [`Cell`] of a point:
//!
//! ```
//! use enfilade::CellId;
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let [low, high] = world.graph.cells[1].aabb;
//! let middle = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
//! assert_eq!(world.graph.locate(middle), Some(CellId(1)));
//! assert_eq!(world.graph.locate([0.0, 1e6, 0.0]), world.graph.outdoors());
//! ```
//!
//! [`World::validate`] names each broken invariant, as a [`GraphError`]; readers of files call it:
//!
//! ```
//! use enfilade::CellId;
//! # let mut world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! assert!(world.validate().is_ok());
//! world.graph.portals[0].cells[1] = CellId(99);
//! let errors = world.validate().unwrap_err();
//! assert!(!errors.is_empty());
//! println!("{}", errors[0]);
//! ```
//!
//! A [`CellSet`] is a set of cells; a [`Pvs`] has one for each cell, those that can be seen from it:
//!
//! ```
//! use enfilade::cpg::CellSet;
//! use enfilade::{CellId, Pvs};
//!
//! let mut both = CellSet::new(3);
//! assert!(both.insert(CellId(0)) && both.insert(CellId(2)));
//! let pvs = Pvs::of_rows(&[both.clone(), CellSet::new(3), both]);
//! assert!(pvs.sees(CellId(0), CellId(2)) && !pvs.sees(CellId(0), CellId(1)));
//! assert_eq!(pvs.visible_from(CellId(2)).collect::<Vec<_>>(), [CellId(0), CellId(2)]);
//! ```
//!
//! A [`Why`] has the [`Reason`] for a cell or a portal, and the [`Fact`]s that decided; [`World::doubts`] and
//! [`suspected_holes`](CellPortalGraph::suspected_holes) say what may be wrong with a world:
//!
//! ```
//! use enfilade::cpg::Doubt;
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! for portal in &world.graph.portals {
//!     for why in &portal.why {
//!         println!("{}: margin {}", why.reason.name(), why.margin());
//!     }
//! }
//! assert!(!world.doubts().contains(&Doubt::NoRooms));
//! assert!(world.graph.suspected_holes().is_empty());
//! ```
//!
//! A [`SightGraph`] has the openings alone, from any source, for `vis::see_all`:
//!
//! ```
//! use enfilade::cpg::SightGraph;
//! use enfilade::geom::DVec3;
//!
//! let square = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]].map(|[y, z]| DVec3::new(0.0, y, z));
//! let graph = SightGraph::of_windings(2, [([0, 1], square.to_vec())]);
//! assert!(graph.validate().is_ok());
//! ```

pub use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, CellSet, CloseDecision, DecidedPlace, DetailObject,
    Doubt, Exit, Fact, Fitting, FittingPart, GraphError, Hole, HoleReason, Locator, LocatorNode,
    MonitorCamera, Motion, MotionKind, PartNumbers, Pass, Portal, PortalId, PortalKind, Provenance,
    Pvs, Reason, RoomDoubt, RoomFacts, SightGraph, SightGraphError, SightPortal, SourceRuns,
    SpecialId, SpecialPortal, SpecialProblem, SpecialShape, Statistics, VisibleParts,
    VisibleVolumes, Way, Why, World, cell_color,
};

pub mod wire {
    //! Worlds as bytes of GLB files ([docs/format.md](https://github.com/enfilade-rs/enfilade/blob/main/docs/format.md)).
    //!
    //! [`encode_glb`] and [`decode_glb`] are inverse; damaged bytes are a [`WireError`], never a world:
    //!
    //! ```
    //! use enfilade::cpg::wire::{decode_glb, encode_glb, is_world};
    //! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
    //!
    //! let mut bytes = encode_glb(&world)?;
    //! assert!(is_world(&bytes));
    //! assert_eq!(encode_glb(&decode_glb(&bytes)?)?, bytes);
    //! bytes.truncate(bytes.len() / 2);
    //! assert!(decode_glb(&bytes).is_err());
    //! # Ok::<(), Box<dyn std::error::Error>>(())
    //! ```

    pub use enfilade_cpg::wire::{
        EXTENSION, PieceContent, VERSION, WireError, decode_glb, encode_glb, is_world, read_piece,
    };
}
