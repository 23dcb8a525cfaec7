//! Repairs defects that the cleaning report counts, on request.
//!
//! The structural triangles are one surface over shared points (`surface.rs`). These steps are repeated until none
//! changes anything: weld vertices that nearly meet (`weld.rs`), drop triangles without area and duplicates
//! (`drop.rs`), cut T-junctions (`split.rs`), turn shells (`orient.rs`), fill holes (`fill.rs`). So a second repair
//! changes nothing.
//!
//! The order is that of Guéziec, Taubin, Lazarus & Horn, "Cutting and Stitching: Converting Sets of Polygons to
//! Manifold Surfaces" (2001): first join edges that nearly meet, then examine those left open.

mod drop;
mod fill;
mod orient;
mod quantized;
mod split;
mod surface;
mod weld;

use std::fmt;

use enfilade_geom::scene::{Role, Scene};

use crate::{BadOption, Finding};
pub(crate) use fill::Hole;
use fill::Limits;
pub use quantized::{GridSteps, weld_quantized};
use surface::Surface;

/// Largest allowed diagonal of holes to fill. [Units: wu]
const LARGEST_HOLE: f64 = 10.0;

/// Extent of a repair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RepairOptions {
    /// Ends of open edges at most this far apart become one; ends this near to the inside of an open edge cut it.
    /// [Units: wu] [Limit: 1e-6 to 0.1]
    ///
    /// The default, 1 mm, is a tenth of the smallest hole that a bake considers intended, so that no opening closes.
    pub weld: f64,
    /// Fills loops of open edges up to this diagonal of their box; 0 fills none. [Units: wu] [Limit: 0 to 10]
    ///
    /// The default, 0.1 m, is a sixth of the narrowest opening that a bake considers.
    pub hole: f64,
}

impl Default for RepairOptions {
    fn default() -> Self {
        Self {
            weld: 1e-3,
            hole: 0.1,
        }
    }
}

/// Changes of a repair.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RepairReport {
    /// Distinct vertices joined with another.
    pub welded_corners: u64,
    /// Triangles removed because two vertices are one point, or because they are lower than 0.01 mm.
    pub degenerate_triangles: u64,
    /// Duplicate triangles removed.
    pub duplicate_triangles: u64,
    /// Cuts of triangles at T-junctions.
    pub t_junctions: u64,
    /// Triangles turned over.
    pub turned_triangles: u64,
    /// Closed shells with triangles turned so that all face outwards.
    pub shells_outwards: u64,
    /// Holes filled.
    pub filled_holes: u64,
    /// Triangles added to fill them.
    pub filling_triangles: u64,
    /// Objects with changed triangles; they now have meshes of their own.
    pub changed_objects: u64,
    /// Unchanged: closed shells that face inwards, taken for rooms modeled from within.
    pub shells_rooms: u64,
    /// Unchanged: shells with one side only.
    pub shells_one_sided: u64,
    /// Unchanged: loops of open edges that are too large to fill, rims of sheets, or without fitting triangles.
    pub open_rims: u64,
    /// The last pass changed nothing.
    pub is_settled: bool,
    /// The structure consists of brushes, which are exact: nothing was examined.
    pub is_of_brushes: bool,
}

impl RepairReport {
    /// Returns the counts with their names, in display order: changes first.
    #[must_use]
    #[doc(hidden)]
    pub fn counts(&self) -> [(&'static str, u64); 12] {
        [
            ("vertices welded", self.welded_corners),
            ("degenerate triangles removed", self.degenerate_triangles),
            ("duplicate triangles removed", self.duplicate_triangles),
            ("T-junctions split", self.t_junctions),
            ("triangles turned", self.turned_triangles),
            ("closed shells turned outwards", self.shells_outwards),
            ("holes filled", self.filled_holes),
            ("triangles filling them", self.filling_triangles),
            ("objects changed", self.changed_objects),
            ("shells kept as rooms", self.shells_rooms),
            ("shells with one side, kept", self.shells_one_sided),
            ("open rims left", self.open_rims),
        ]
    }

    fn n_changes(&self) -> u64 {
        self.counts()[..8].iter().map(|c| c.1).sum()
    }
}

impl fmt::Display for RepairReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_of_brushes {
            return write!(f, "brushes are exact: nothing to repair");
        }
        let rows = self.counts().into_iter().filter(|(_, n)| *n > 0);
        let rows: Vec<String> = rows.map(|(name, n)| format!("{name:<30} {n:>9}")).collect();
        if rows.is_empty() {
            write!(f, "nothing to repair")?;
        }
        write!(f, "{}", rows.join("\n"))?;
        if !self.is_settled {
            write!(
                f,
                "\nstopped after {MAX_PASSES} passes: repair the result again"
            )?;
        }
        Ok(())
    }
}

/// Passes after which a repair stops; two or three are usual.
const MAX_PASSES: usize = 16;

/// Repairs the structural triangles of a scene; detail stays unchanged.
///
/// Positions are those of existing vertices. Normals, tangents, texture coordinates and colors are kept, interpolated
/// along cut edges, and taken from the rim for holes. Changed objects get a mesh of their own, in world space, and
/// objects that lose all triangles are removed; the others keep their bits. Repairing again changes nothing if
/// [`RepairReport::is_settled`].
///
/// Time: `n log n` for `n` triangles in each pass, plus the cube of the vertices of a hole; memory: about 300 bytes
/// per triangle.
///
/// # Errors
///
/// When an option is out of range.
///
/// # Panics
///
/// When the scene breaks its own promises (an index out of range).
pub fn repair(scene: &mut Scene, options: &RepairOptions) -> Result<RepairReport, BadOption> {
    for (option, x, low, high) in [
        ("repair", options.weld, 1e-6, 0.1),
        ("repair_holes", options.hole, 0.0, LARGEST_HOLE),
    ] {
        if !(low..=high).contains(&x) {
            let problem = format!("{x} m is not between {low} and {high}");
            return Err(BadOption { option, problem });
        }
    }
    let mut report = RepairReport::default();
    if !scene.solids.is_empty() {
        report.is_of_brushes = true;
        report.is_settled = true;
        return Ok(report);
    }
    let mut surface = Surface::of_scene(scene);
    for _ in 0..MAX_PASSES {
        let before = report.n_changes();
        pass(&mut surface, options, &mut report);
        report.is_settled = report.n_changes() == before;
        if report.is_settled {
            break;
        }
    }
    report.changed_objects = surface.is_changed.iter().filter(|c| **c).count() as u64;
    surface.into_scene(scene);
    Ok(report)
}

/// Most steps of a search for holes without filling: about three seconds.
const STEPS_TO_LOOK: u64 = 1_000_000_000;

/// Returns the loops of open edges that a repair could fill, of any size, largest first, and `true` if all were
/// examined. `n log n` for `n` triangles plus a bounded number of steps; about 300 bytes per triangle.
pub(crate) fn holes_of(scene: &Scene) -> (Vec<Hole>, bool) {
    if !scene.solids.is_empty() {
        return (Vec::new(), true);
    }
    let mut surface = Surface::of_scene(scene);
    let filled = fill::fill_holes(&mut surface, Limits::up_to(LARGEST_HOLE, STEPS_TO_LOOK));
    let mut holes = filled.holes;
    holes.sort_by(|a, b| b.area.total_cmp(&a.area));
    (holes, filled.is_complete)
}

/// Most triangles of a scene to put others back into; more would take more than 600 MB for the search.
const MOST_TO_PUT_BACK: usize = 2_000_000;

/// Puts back structural triangles that are missing one by one, and returns their places, the largest first.
///
/// Three open edges that meet are closed by one triangle if the surface continues straight into it, within 45 degrees, across one of them.
/// An exporter that drops triangles leaves such holes; a hole meant as one has a wall's thickness, or more vertices. Brushes and scenes
/// of more than two million structural triangles stay as they are.
///
/// Time: `n log n` for `n` triangles; memory: about 300 bytes per triangle.
///
/// # Panics
///
/// When the scene breaks its own promises (an index out of range).
pub fn put_back(scene: &mut Scene) -> Finding {
    let mut found = Finding::default();
    let structural = scene.objects.iter().filter(|o| o.role == Role::Structural);
    let meshes = structural.flat_map(|o| &scene.meshes[o.mesh as usize].primitives);
    let n_triangles: usize = meshes.map(|p| p.triples().len()).sum();
    if !scene.solids.is_empty() || n_triangles > MOST_TO_PUT_BACK {
        return found;
    }
    let mut surface = Surface::of_scene(scene);
    let mut holes = fill::fill_holes(&mut surface, Limits::ONE_TRIANGLE).holes;
    if holes.is_empty() {
        return found;
    }
    holes.sort_by(|a, b| b.area.total_cmp(&a.area));
    for hole in holes {
        let name = || scene.objects[hole.object as usize].name.clone();
        found.add(hole.position, name);
    }
    surface.into_scene(scene);
    found
}

fn pass(surface: &mut Surface, options: &RepairOptions, report: &mut RepairReport) {
    let tidy = |surface: &mut Surface, report: &mut RepairReport| {
        report.degenerate_triangles += drop::drop_collapsed(surface);
        report.duplicate_triangles += drop::drop_duplicates(surface);
        report.degenerate_triangles += drop::drop_caps(surface);
    };
    // In the order of a new import, so that the next repair starts from the same state.
    surface.faces.sort_by_key(|f| f.part);
    report.welded_corners += weld::weld_all(surface, options.weld);
    tidy(surface, report);
    report.welded_corners += weld::weld_rims(surface, options.weld);
    tidy(surface, report);
    report.t_junctions += split::split_t_junctions(surface, options.weld);
    let turned = orient::orient(surface);
    report.turned_triangles += turned.n_triangles;
    report.shells_outwards += turned.n_outwards;
    report.shells_rooms = turned.n_rooms;
    report.shells_one_sided = turned.n_one_sided;
    let filled = fill::fill_holes(surface, Limits::up_to(options.hole, u64::MAX));
    report.filled_holes += filled.n_holes;
    report.filling_triangles += filled.n_triangles;
    report.open_rims = filled.n_left;
}
