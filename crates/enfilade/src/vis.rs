//! Visibility from each cell, precomputed.
//!
//! [`see_world`] finds what can be seen from each cell of a world; [`see_parts`] which triangles and objects:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::vis::{VisConfig, VisContext, see_parts, see_world};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let mut context = VisContext { on_round: &mut |_, _| true, walls: None, checkpoint: None };
//! let visible = see_world(&world.graph, &VisConfig::default(), &mut context)?;
//! let pvs = visible.vis.cells;
//! assert!(pvs.sees(CellId(0), CellId(1)));
//! let (volumes, parts) = see_parts(&world, &pvs)?;
//! assert_eq!((volumes.n_pairs(), parts.n_pairs()), (pvs.n_pairs(), pvs.n_pairs()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`see_all`] does so for any openings. Here three rooms in a row, whose doorways are not in line:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::cpg::SightGraph;
//! use enfilade::geom::DVec3;
//! use enfilade::vis::{VisConfig, VisContext, see_all};
//!
//! let doorway = |x: f64, z: f64| {
//!     [[0., 0.], [2., 0.], [2., 1.], [0., 1.]].map(|[y, w]| DVec3::new(x, y, z + w)).to_vec()
//! };
//! // The second and third doorway face sideways: nobody sees around two corners.
//! let side = [[0., 0.], [1., 0.], [1., 2.], [0., 2.]].map(|[x, y]| DVec3::new(4. + x, y, 9.));
//! let graph = SightGraph::of_windings(4, [([0, 1], doorway(0., 0.)), ([1, 2], side.to_vec()), ([2, 3], doorway(2., 20.))]);
//! let mut context = VisContext { on_round: &mut |_, _| true, walls: None, checkpoint: None };
//! let seen = see_all(&graph, &VisConfig::default(), &mut context)?;
//! assert!(seen.is_complete && seen.cells.sees(CellId(0), CellId(1)));
//! assert!(!seen.cells.sees(CellId(0), CellId(3)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use enfilade_vis::{
    VisBlocks, VisCheckpoint, VisConfig, VisContext, VisError, VisMode, VisOutput, Witness,
    WorldVis, see_all, see_parts, see_world,
};
