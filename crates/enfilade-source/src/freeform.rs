//! Free-form surfaces: Bézier and B-spline patches, rational, trimmed, as triangles within a distance of them.
//!
//! All patches are splines (Piegl & Tiller, *The NURBS Book*, 1997, chapters 2 to 5). Second derivatives give the lattice of
//! parameters at which a patch is evaluated (Filip, Magedson & Markot, "Surface algorithms using bounds on derivatives",
//! 1986), here those out of the surface alone: along it, an error is none. The vertices of the lattice and those of the limits of the
//! patch are joined by a constrained Delaunay triangulation, and its distance is measured.
//!
//! A side of a patch is divided as its curve is, whatever the patch: where patches share the curve of a side, they share its
//! vertices.

mod curves;
mod fill;
mod lattice;
mod loops;
mod parse;
mod patch;
mod sides;
mod spline;
mod weld;

use enfilade_geom::DVec3;

use crate::{SourceError, SourceLimits};
pub use curves::{FreeformCurve, TrimCurve};
use lattice::Lattice2;
use loops::Polyline;
pub use parse::{FreeformPatch, FreeformScene};
use patch::Budget;
pub use patch::FreeformSurface;
use sides::Sides;
pub use spline::SplineBasis;
use weld::Weld;

/// Vertices on limits of patches closer than this are one. [Units: tolerances]
const WELDED: f64 = 0.01;

/// Triangles of patches.
#[derive(Clone, Debug, Default)]
pub struct FreeformMesh {
    /// Vertices, shared by all patches.
    pub positions: Vec<DVec3>,
    /// Triangles of each patch; front faces show where the first parameter crossed with the second points.
    pub triangles: Vec<Vec<[u32; 3]>>,
    /// Largest distance between a patch and its triangles, found in the middle of each triangle and edge.
    pub distance: f64,
    /// Points at which patches were evaluated.
    pub n_samples: u64,
}

/// Makes triangles of patches, within `tolerance` of them. [Units: those of the patches]
///
/// # Errors
///
/// If a patch is malformed, or more triangles are needed than the limits allow.
pub fn tessellate(
    patches: &[FreeformSurface],
    tolerance: f64,
    limits: &SourceLimits,
) -> Result<FreeformMesh, SourceError> {
    for patch in patches {
        patch.check()?;
    }
    // Second derivatives are found at points; where more is in between, steps are too long.
    let mut finer = 1.0;
    loop {
        let mesh = mesh_of(patches, tolerance * finer, limits)?;
        if mesh.distance <= tolerance || finer < FINEST {
            return Ok(mesh);
        }
        finer *= 0.5;
    }
}

/// Most of the tolerance, to which steps are not made finer.
const FINEST: f64 = 0.01;

fn mesh_of(
    patches: &[FreeformSurface],
    tolerance: f64,
    limits: &SourceLimits,
) -> Result<FreeformMesh, SourceError> {
    let mut budget = Budget {
        n_triangles: limits.max_triangles,
        work: limits.max_work,
        purse: limits.purse(),
    };
    let mut lattices = Vec::with_capacity(patches.len());
    let mut sides = Sides::new(tolerance);
    for patch in patches {
        let lattice = Lattice2::new(patch, tolerance, &mut budget)?;
        sides.count(patch, &lattice, &mut budget)?;
        lattices.push(lattice);
    }
    let mut mesh = FreeformMesh::default();
    let mut weld = Weld::new(tolerance * WELDED);
    for (patch, lattice) in patches.iter().zip(&lattices) {
        let outline = sides.outline(patch, lattice);
        let polylines = match patch.loops.is_empty() {
            true => vec![Polyline::of_sides(&outline)],
            false => loops::polylines(patch, lattice, &outline, tolerance, &mut budget)?,
        };
        let filled = fill::fill(patch, lattice, &polylines, &mut budget)?;
        // A vertex, and the middles of a triangle and its edges.
        let n_values = (filled.vertices.len() + 4 * filled.triangles.len()) as f64;
        if !budget.spend(n_values * lattice.cost(patch)) {
            return Err(patch.error(patch::TOO_MUCH));
        }
        mesh.add(patch, lattice, &filled, &mut weld, limits)?;
    }
    Ok(mesh)
}

impl FreeformMesh {
    /// Adds the triangles of a patch, without those that have no area: sides may be points.
    fn add(
        &mut self,
        patch: &FreeformSurface,
        lattice: &Lattice2,
        filled: &fill::Filled,
        weld: &mut Weld,
        limits: &SourceLimits,
    ) -> Result<(), SourceError> {
        let cost = lattice.cost(patch) as u64 / 4 + 1;
        let index: Vec<u32> = (filled.vertices.iter())
            .take_while(limits.purse().each(cost))
            .map(|v| {
                let p = v
                    .position
                    .unwrap_or_else(|| patch.at(lattice.parameters(v.at)));
                match v.is_limit {
                    true => weld.index(p, &mut self.positions),
                    false => weld::push(p, &mut self.positions),
                }
            })
            .collect();
        limits.go_on()?;
        let mut triangles = Vec::with_capacity(filled.triangles.len());
        for t in &filled.triangles {
            let [a, b, c] = t.map(|v| index[v as usize]);
            if a == b || b == c || c == a {
                continue;
            }
            limits.spend(cost)?;
            triangles.push([a, b, c]);
            // The middles of the triangle and of its edges.
            for weights in [
                [1.0, 1.0, 1.0],
                [1.0, 1.0, 0.0],
                [0.0, 1.0, 1.0],
                [1.0, 0.0, 1.0],
            ] {
                let sum: f64 = weights.iter().sum();
                let (mut at, mut p) = ([0.0; 2], DVec3::ZERO);
                for (v, w) in t.iter().zip(weights) {
                    let w = w / sum;
                    let from = filled.vertices[*v as usize].at;
                    at = [0, 1].map(|k| at[k] + w * from[k]);
                    p += self.positions[index[*v as usize] as usize] * w;
                }
                let at = lattice.parameters(at);
                if patch.at(at).distance(p) > self.distance {
                    self.distance = self.distance.max(patch.distance(p, at));
                }
            }
        }
        self.n_samples += (filled.vertices.len() + 4 * filled.triangles.len()) as u64;
        self.triangles.push(triangles);
        Ok(())
    }
}
