//! The report: counts of tries and judgments, and the broken promises.

use std::collections::BTreeMap;
use std::fmt;

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{DVec3, shown};
use serde::Serialize;

use crate::options::VerifyOptions;
use crate::subject::{Crossing, Subject};

/// The place where a followed segment goes wrong.
pub(crate) struct Break {
    pub(crate) kind: FailureKind,
    pub(crate) expected: Option<CellId>,
    pub(crate) found: Option<CellId>,
    pub(crate) portal: Option<PortalId>,
    pub(crate) at: DVec3,
}

/// Failures per kind and chunk whose clearance is measured, which takes many times as long as a ray.
const MEASURED: u64 = 4;
/// Largest clearance reported; larger ones are cut to this. [Units: wu]
const FAR: f64 = 0.25;

/// Outcomes of the segments for *sealed*. All but `crossings` and `drawn` add up to `drawn`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct SealedCounts {
    /// Segments drawn.
    pub drawn: u64,
    /// Not blocked, and followed from end to end.
    pub judged: u64,
    /// Blocked by a triangle: no statement.
    pub blocked: u64,
    /// Passed an edge within twice the tolerance: not judged.
    pub grazing: u64,
    /// Both ends in solid matter.
    pub solid: u64,
    /// One end in a cell, the other in solid by the locator, and nothing between: a hole in the walls or in the
    /// locator. Each breaks the promise.
    pub cell_to_solid: u64,
    /// An end lay on a surface in every attempt.
    pub on_surface: u64,
    /// Portals crossed by judged segments.
    pub crossings: u64,
}

/// Outcomes of the rays for *complete*. All but `drawn` add up to `drawn`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct CompleteCounts {
    /// Rays drawn.
    pub drawn: u64,
    /// Met a triangle, whose batch was looked up.
    pub judged: u64,
    /// Met no triangle.
    pub escaped: u64,
    /// Passed or met an edge within twice the tolerance: not judged.
    pub grazing: u64,
    /// Started on a surface.
    pub on_surface: u64,
    /// The crossed portals did not lead to a cell; listed as breaks of *sealed*.
    pub unresolved: u64,
}

/// Outcomes of the lines for *conservative*, if a world stores visible volumes and parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct VisibleCounts {
    /// Lines aimed at hidden things.
    pub drawn: u64,
    /// Unblocked lines, those for *sealed* and *complete* included: checked against volumes along their paths.
    pub lines: u64,
    /// Triangles and objects on their paths and at their ends that were looked up.
    pub parts: u64,
}

/// A kind of broken promise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FailureKind {
    /// *Sealed*: the cell changed on the path where there is no portal.
    MissedPortal,
    /// *Sealed*: the path crossed a portal that does not belong to the cell it left.
    WrongSide,
    /// *Sealed*: the path crossed a portal between the right cells, against its normal.
    WrongWay,
    /// *Sealed*: at a portal, the locator's cell changes to another than the portal leads to.
    EndMismatch,
    /// *Sealed*: between two points of air, the locator returns solid.
    InSolid,
    /// *Sealed*: nothing lies between a point of a cell and a point in solid by the locator.
    IntoSolid,
    /// *Complete*: the batch of a triangle does not list a cell that sees it.
    Unlisted,
    /// *Complete*: no batch contains a triangle of the source that a ray met.
    MissingTriangle,
    /// *Conservative*: a straight line leads to a cell that the world's potentially visible set hides from its start.
    Hidden,
    /// *Conservative*: a straight line leads to a point outside the volume visible from its cell.
    OutsideVolume,
    /// *Conservative*: a straight line leads to a triangle or object that is not among the visible parts.
    HiddenPart,
}

impl FailureKind {
    /// Returns the promise that it breaks.
    #[must_use]
    pub(crate) fn promise(self) -> &'static str {
        match self {
            Self::Unlisted | Self::MissingTriangle => "complete",
            Self::Hidden | Self::OutsideVolume | Self::HiddenPart => "conservative",
            _ => "sealed",
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::MissedPortal => "the cell changes where there is no portal",
            Self::WrongSide => "a portal of other cells is crossed",
            Self::WrongWay => "a portal faces the wrong way",
            Self::EndMismatch => "the portals lead to another cell",
            Self::InSolid => "the locator returns solid in open air",
            Self::IntoSolid => "nothing closes the way from a cell into solid",
            Self::Unlisted => "a triangle's batch lacks a cell that sees it",
            Self::MissingTriangle => "a triangle of the source is in no batch",
            Self::Hidden => "a visible cell is missing in the potentially visible set",
            Self::OutsideVolume => "a visible point is outside the visible volume",
            Self::HiddenPart => "a visible triangle or object is missing in the visible parts",
        }
    }
}

/// All failures of the same kind, cells and portal, with the surest example.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Failure {
    /// Kind of broken promise.
    pub kind: FailureKind,
    /// Number of rays with this failure.
    pub count: u64,
    /// The cell in which the ray should be there.
    pub expected: Option<u32>,
    /// The cell found there; none for solid, or for triangles.
    pub found: Option<u32>,
    /// The portal crossed there, or last.
    pub portal: Option<u32>,
    /// Position of the failure. [Units: wu]
    pub at: [f64; 3],
    /// Start of the example. [Units: wu]
    pub start: [f64; 3],
    /// End of the example. [Units: wu]
    pub end: [f64; 3],
    /// Portals that the example crosses, in order.
    pub crossed: Vec<u32>,
    /// Distance of the example from every edge, at most 0.25; more is surer. [Units: wu]
    pub clearance: f64,
    /// The triangle met.
    pub triangle: Option<[[f64; 3]; 3]>,
    /// Index of the example's ray.
    pub ray: u64,
}

impl Failure {
    pub(crate) fn of_break(
        wrong: &Break,
        ray: u64,
        [start, end]: [DVec3; 2],
        crossings: &[Crossing],
    ) -> Self {
        Self {
            kind: wrong.kind,
            count: 1,
            expected: wrong.expected.map(|c: CellId| c.0),
            found: wrong.found.map(|c| c.0),
            portal: wrong.portal.map(|p: PortalId| p.0),
            at: wrong.at.to_array(),
            start: start.to_array(),
            end: end.to_array(),
            crossed: crossings.iter().map(|c| c.portal.0).collect(),
            clearance: 0.0,
            triangle: None,
            ray,
        }
    }

    fn key(&self) -> FailureKey {
        (self.kind, self.expected, self.found, self.portal)
    }

    /// Merges two failures with the same key: counts add up, the surer example stays.
    fn joined(self, other: Self) -> Self {
        let count = self.count + other.count;
        let is_first_surer = other
            .clearance
            .total_cmp(&self.clearance)
            .then(self.ray.cmp(&other.ray))
            .is_le();
        Self {
            count,
            ..if is_first_surer { self } else { other }
        }
    }
}

type FailureKey = (FailureKind, Option<u32>, Option<u32>, Option<u32>);

/// Counts and failures of some rays; tallies add up in any order to the same sum.
#[derive(Default)]
pub(crate) struct Tally {
    pub(crate) sealed: SealedCounts,
    /// Counts of segments across faces.
    pub(crate) across: SealedCounts,
    pub(crate) complete: CompleteCounts,
    pub(crate) visible: VisibleCounts,
    failures: BTreeMap<FailureKey, Failure>,
}

impl Tally {
    pub(crate) fn add_failure(&mut self, subject: &Subject, mut failure: Failure) {
        let seen = self.failures.get(&failure.key()).map_or(0, |f| f.count);
        if seen < MEASURED {
            let (a, b) = (failure.start.into(), failure.end.into());
            failure.clearance = subject.edge_clearance(a, b, FAR).min(FAR);
        }
        self.join(failure);
    }

    fn join(&mut self, failure: Failure) {
        let key = failure.key();
        let joined = match self.failures.remove(&key) {
            Some(known) => known.joined(failure),
            None => failure,
        };
        self.failures.insert(key, joined);
    }

    pub(crate) fn merged(mut self, other: Self) -> Self {
        for (s, o) in [
            (&mut self.sealed, other.sealed),
            (&mut self.across, other.across),
        ] {
            s.drawn += o.drawn;
            s.judged += o.judged;
            s.blocked += o.blocked;
            s.grazing += o.grazing;
            s.solid += o.solid;
            s.cell_to_solid += o.cell_to_solid;
            s.on_surface += o.on_surface;
            s.crossings += o.crossings;
        }
        let (c, o) = (&mut self.complete, other.complete);
        c.drawn += o.drawn;
        c.judged += o.judged;
        c.escaped += o.escaped;
        c.grazing += o.grazing;
        c.on_surface += o.on_surface;
        c.unresolved += o.unresolved;
        let (v, o) = (&mut self.visible, other.visible);
        v.drawn += o.drawn;
        v.lines += o.lines;
        v.parts += o.parts;
        for failure in other.failures.into_values() {
            self.join(failure);
        }
        self
    }
}

/// The outcome of [`verify_world`](crate::verify_world).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct VerifyReport {
    /// Cells of the world.
    pub cells: usize,
    /// Portals of the world.
    pub portals: usize,
    /// Structural triangles in its batches.
    pub triangles: usize,
    /// Triangles that block: the world's own, or those of the source.
    pub blockers: usize,
    /// True if a source was given.
    pub has_source: bool,
    /// Half the distance below which nothing is judged: `eps`. [Units: wu]
    pub tolerance: f64,
    /// Seed of the random sequences.
    pub seed: u64,
    /// Broken invariants of graph, outlines and numbers, a line each.
    pub problems: Vec<String>,
    /// Segments for *sealed*.
    pub sealed: SealedCounts,
    /// Short segments for *sealed*, across faces where the locator's answer changes.
    pub across: SealedCounts,
    /// Rays for *complete*.
    pub complete: CompleteCounts,
    /// Lines for *conservative*; none if the world stores no visible volumes and parts.
    pub visible: VisibleCounts,
    /// Cells in which no point was found, so that nothing is known about them.
    pub unsampled_cells: Vec<u32>,
    /// Segments, and paths of rays to their triangles, that break *sealed*.
    pub unsealed: u64,
    /// Rays that break *complete*.
    pub incomplete: u64,
    /// Lines that lead to something that the world's potentially visible set hides from their start: a cell, a point, a
    /// triangle or an object.
    pub hidden: u64,
    /// Groups of equal failures, the most frequent first; at most as many as the options allow.
    pub failures: Vec<Failure>,
    /// Number of all such groups.
    pub failure_groups: usize,
    /// Names of cells.
    #[serde(skip)]
    names: Vec<String>,
}

impl VerifyReport {
    /// Returns `true` if no promise was found broken. Means nothing if nothing was judged.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.problems.is_empty() && self.unsealed == 0 && self.incomplete == 0 && self.hidden == 0
    }

    pub(crate) fn unshot(world: &World, options: &VerifyOptions, problems: Vec<String>) -> Self {
        Self {
            cells: world.graph.cells.len(),
            portals: world.graph.portals.len(),
            triangles: world
                .batches
                .iter()
                .map(|b| b.primitive.indices.len() / 3)
                .sum(),
            blockers: 0,
            has_source: false,
            tolerance: 0.0,
            seed: options.seed,
            problems,
            sealed: SealedCounts::default(),
            across: SealedCounts::default(),
            complete: CompleteCounts::default(),
            visible: VisibleCounts::default(),
            unsampled_cells: Vec::new(),
            unsealed: 0,
            incomplete: 0,
            hidden: 0,
            failures: Vec::new(),
            failure_groups: 0,
            names: world.graph.cells.iter().map(|c| c.name.clone()).collect(),
        }
    }

    fn write_failure(&self, f: &mut fmt::Formatter<'_>, failure: &Failure) -> fmt::Result {
        let cell = |c: Option<u32>| c.map_or("solid".to_owned(), |c| self.name(c));
        let crossed: Vec<String> = (failure.crossed.iter())
            .map(|&p| PortalId(p).to_string())
            .collect();
        let point = |p: [f64; 3]| format!("({:.6} {:.6} {:.6})", p[0], p[1], p[2]);
        write!(
            f,
            "{} × {}: {}",
            failure.count,
            failure.kind.promise(),
            failure.kind.words()
        )?;
        match failure.kind {
            FailureKind::Unlisted | FailureKind::MissingTriangle => {
                write!(f, "; seen from {}", cell(failure.expected))?;
            }
            FailureKind::Hidden | FailureKind::OutsideVolume | FailureKind::HiddenPart => write!(
                f,
                "; from {}, in {}",
                cell(failure.expected),
                cell(failure.found)
            )?,
            _ => write!(
                f,
                "; in {}, found {}",
                cell(failure.expected),
                cell(failure.found)
            )?,
        }
        if let Some(portal) = failure.portal {
            write!(f, ", {}", PortalId(portal))?;
        }
        writeln!(
            f,
            "\n  at {}, {:.2e} m from any edge",
            point(failure.at),
            failure.clearance
        )?;
        writeln!(
            f,
            "  from {} to {}, crossing {}",
            point(failure.start),
            point(failure.end),
            if crossed.is_empty() {
                "no portal".to_owned()
            } else {
                crossed.join(" ")
            }
        )?;
        if let Some([a, b, c]) = failure.triangle {
            writeln!(f, "  triangle {} {} {}", point(a), point(b), point(c))?;
        }
        Ok(())
    }
    /// Returns the name that other commands print for a cell, too.
    fn name(&self, cell: u32) -> String {
        let name = self.names.get(cell as usize);
        name.map_or_else(|| CellId(cell).to_string(), |n| shown(n).to_string())
    }

    pub(crate) fn new(
        subject: &Subject,
        options: &VerifyOptions,
        problems: Vec<String>,
        tally: Tally,
    ) -> Self {
        let mut failures: Vec<Failure> = tally.failures.into_values().collect();
        let total = |promise: &str| {
            failures
                .iter()
                .filter(|f| f.kind.promise() == promise)
                .map(|f| f.count)
                .sum()
        };
        let (unsealed, incomplete) = (total("sealed"), total("complete"));
        let hidden = total("conservative");
        // Stable: ties stay in the order of the keys.
        failures.sort_by_key(|f| std::cmp::Reverse(f.count));
        let failure_groups = failures.len();
        failures.truncate(options.max_listed);
        let is_sampled = |c: &u32| subject.sampled.binary_search(&CellId(*c)).is_ok();
        Self {
            blockers: subject.triangles.len(),
            has_source: subject.has_source,
            tolerance: subject.eps,
            sealed: tally.sealed,
            across: tally.across,
            complete: tally.complete,
            visible: tally.visible,
            unsampled_cells: (0..subject.cells.len() as u32)
                .filter(|c| !is_sampled(c))
                .collect(),
            unsealed,
            incomplete,
            hidden,
            failures,
            failure_groups,
            ..Self::unshot(subject.world, options, problems)
        }
    }
}

impl fmt::Display for VerifyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (s, c) = (&self.sealed, &self.complete);
        writeln!(
            f,
            "{} cells, {} portals, {} triangles; {} triangles {}block; tolerance {:.1e} m, seed {}",
            self.cells,
            self.portals,
            self.triangles,
            self.blockers,
            if self.has_source {
                "of the source "
            } else {
                ""
            },
            self.tolerance,
            self.seed
        )?;
        writeln!(
            f,
            "sealed    {:>10} judged ({} portals crossed), {} broken\n          \
             {:>10} blocked, {} grazing, {} on a surface, {} in solid, {} from a cell into solid",
            s.judged,
            s.crossings,
            self.unsealed,
            s.blocked,
            s.grazing,
            s.on_surface,
            s.solid,
            s.cell_to_solid
        )?;
        writeln!(
            f,
            "  across  {:>10} judged, {} blocked, {} grazing\ncomplete  {:>10} judged, {} broken\n          \
             {:>10} met nothing, {} grazing, {} on a surface, {} unresolved",
            self.across.judged,
            self.across.blocked,
            self.across.grazing,
            c.judged,
            self.incomplete,
            c.escaped,
            c.grazing,
            c.on_surface,
            c.unresolved
        )?;
        let v = &self.visible;
        if v.lines > 0 || self.hidden > 0 {
            writeln!(
                f,
                "seen      {:>10} lines, {} parts judged, {} broken",
                v.lines, v.parts, self.hidden
            )?;
        }
        writeln!(f, "outlines, numbers {:>3} problems", self.problems.len())?;
        for problem in &self.problems {
            writeln!(f, "  {}", shown(problem))?;
        }
        if !self.unsampled_cells.is_empty() {
            let shown: Vec<String> = self
                .unsampled_cells
                .iter()
                .take(20)
                .map(|&c| self.name(c))
                .collect();
            writeln!(
                f,
                "no point found in {} cells: {}",
                self.unsampled_cells.len(),
                shown.join(" ")
            )?;
        }
        for failure in &self.failures {
            self.write_failure(f, failure)?;
        }
        if self.failure_groups > self.failures.len() {
            writeln!(
                f,
                "… and {} more kinds",
                self.failure_groups - self.failures.len()
            )?;
        }
        match (self.holds(), s.judged + c.judged) {
            (true, 0) => writeln!(f, "nothing was judged"),
            (true, _) => writeln!(f, "no broken promise found"),
            (false, _) => writeln!(f, "BROKEN"),
        }
    }
}
