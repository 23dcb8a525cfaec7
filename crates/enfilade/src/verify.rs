//! The checker of the promises of a world, which shares no code with any builder.
//!
//! A [`VerifyReport`] counts what was tested, and lists each [`Failure`]:
//!
//! ```
//! use enfilade::verify::{VerifyOptions, verify_world};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let options = VerifyOptions { rays: 2_000, ..VerifyOptions::default() };
//! let report = verify_world(&world, None, &options);
//! assert!(report.sealed.judged > 0);
//! ```
//!
//! Evidence of the hidden pairs of `vis::see_all`, which [`verify_evidence`] checks without its code:
//!
//! ```
//! use enfilade::cpg::SightGraph;
//! use enfilade::verify::verify_evidence;
//! use enfilade::vis::{VisConfig, VisContext, see_all};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let graph = SightGraph::of_graph(&world.graph);
//! let config = VisConfig { has_evidence: true, ..VisConfig::default() };
//! let mut context = VisContext { on_round: &mut |_, _| true, walls: None, checkpoint: None };
//! let output = see_all(&graph, &config, &mut context)?;
//! let bytes = output.evidence.expect("asked for");
//! assert!(verify_evidence(&graph, &bytes, None).is_ok());
//! assert!(verify_evidence(&graph, &bytes[1..], None).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use enfilade_verify::{
    CompleteCounts, EvidenceError, EvidenceReport, Failure, FailureKind, SealedCounts,
    VerifyOptions, VerifyReport, VisibleCounts, structural_triangles, verify_evidence,
    verify_world,
};
