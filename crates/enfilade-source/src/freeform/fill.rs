//! Triangles between the limits of a patch, by a constrained Delaunay triangulation in the plane of its lattice.

use std::collections::HashSet;

use enfilade_geom::{DVec2, DVec3, closest_point_on_segment};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation as _};

use super::lattice::Lattice2;
use super::loops::Polyline;
use super::patch::{Budget, FreeformSurface, TOO_MUCH};
use crate::SourceError;

/// Crossings of the lattice closer to a limit than this are left out: they would make thin triangles. [Units: steps]
const NEAR: f64 = 0.3;

/// A vertex of a patch.
pub(super) struct FilledVertex {
    /// Place in the lattice.
    pub(super) at: [f64; 2],
    /// Its position, if it is on a limit.
    pub(super) position: Option<DVec3>,
    pub(super) is_limit: bool,
}

/// Triangles of a patch in the plane of its lattice.
pub(super) struct Filled {
    pub(super) vertices: Vec<FilledVertex>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A vertex of the triangulation.
struct Site {
    at: Point2<f64>,
    index: u32,
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// Terms of a sum that take as long as a vertex of a triangulation.
const OF_VERTEX: f64 = 160.0;

/// A triangulation as it grows.
struct Filling<'p, 'l> {
    patch: &'p FreeformSurface,
    mesh: ConstrainedDelaunayTriangulation<Site>,
    vertices: Vec<FilledVertex>,
    budget: &'p mut Budget<'l>,
}

impl Filling<'_, '_> {
    fn spend(&mut self, work: f64) -> Result<(), SourceError> {
        match self.budget.spend(work) {
            true => Ok(()),
            false => Err(self.patch.error(TOO_MUCH)),
        }
    }

    fn insert(
        &mut self,
        at: [f64; 2],
        position: Option<DVec3>,
    ) -> Result<FixedVertexHandle, SourceError> {
        self.spend(OF_VERTEX)?;
        // The least numbers are beyond the exact predicates.
        let at = at.map(|c| if c.abs() < 1e-12 { 0.0 } else { c });
        let index = self.vertices.len() as u32;
        self.vertices.push(FilledVertex {
            at,
            position,
            is_limit: position.is_some(),
        });
        let site = Site {
            at: Point2::new(at[0], at[1]),
            index,
        };
        let inserted = self.mesh.insert(site);
        inserted.map_err(|e| {
            self.patch
                .error(format!("cannot be divided into triangles: {e}"))
        })
    }
}

pub(super) fn fill(
    patch: &FreeformSurface,
    lattice: &Lattice2,
    polylines: &[Polyline],
    budget: &mut Budget<'_>,
) -> Result<Filled, SourceError> {
    let n: usize = polylines.iter().map(|line| line.0.len()).sum();
    budget.take(patch, n as f64, lattice.cost(patch))?;
    let mut filling = Filling {
        patch,
        mesh: ConstrainedDelaunayTriangulation::new(),
        vertices: Vec::new(),
        budget,
    };
    for line in polylines {
        let handles: Vec<_> = (line.0.iter())
            .map(|v| filling.insert(v.at, Some(v.position)))
            .collect::<Result<_, _>>()?;
        for (i, &a) in handles.iter().enumerate() {
            let b = handles[(i + 1) % handles.len()];
            if a == b {
                continue;
            }
            if !filling.mesh.can_add_constraint(a, b) {
                let at = lattice.parameters(line.0[i].at);
                let problem = format!("its trimming curves cross near u {}, v {}", at[0], at[1]);
                return Err(patch.error(problem));
            }
            filling.mesh.add_constraint(a, b);
        }
    }
    let region = Region::new(polylines, lattice.size()[1]);
    let creases = lattice.creases(patch);
    add_crossings(&mut filling, polylines, &region, lattice.size(), &creases)?;
    add_creases(&mut filling, &creases)?;
    let mut triangles = Vec::new();
    for face in filling.mesh.inner_faces() {
        let middle = face.center();
        let middle = [middle.x, middle.y];
        if !filling.budget.spend(1.0 + region.n_edges(middle[1])) {
            return Err(patch.error(TOO_MUCH));
        }
        if region.contains(middle) {
            triangles.push(face.vertices().map(|v| v.data().index));
        }
    }
    Ok(Filled {
        triangles,
        vertices: filling.vertices,
    })
}

/// Adds the crossings of lines in the region, away from its limits.
fn add_crossings(
    filling: &mut Filling<'_, '_>,
    polylines: &[Polyline],
    region: &Region,
    [m, n]: [usize; 2],
    creases: &[Vec<f64>; 2],
) -> Result<(), SourceError> {
    let mut near: HashSet<[usize; 2]> = HashSet::new();
    let is_crease = |at: [usize; 2]| (0..2).any(|a| creases[a].contains(&(at[a] as f64)));
    for [a, b] in polylines.iter().flat_map(Polyline::edges) {
        let [a, b] = [a, b].map(|v| DVec2::from_array(v.at));
        let (min, max) = (a.min(b) - NEAR, a.max(b) + NEAR);
        let around = max - min + 1.0;
        filling.spend(around.x * around.y)?;
        for j in min.y.ceil().max(0.0) as usize..=max.y.floor().max(0.0) as usize {
            for i in min.x.ceil().max(0.0) as usize..=max.x.floor().max(0.0) as usize {
                let p = DVec2::new(i as f64, j as f64).extend(0.0);
                let off = closest_point_on_segment(p, a.extend(0.0), b.extend(0.0)).distance(p);
                if off < 1e-9 || off < NEAR && !is_crease([i, j]) {
                    near.insert([i, j]);
                }
            }
        }
    }
    for j in 0..=n {
        filling.spend(region.n_edges(j as f64))?;
        let crossed = region.crossed(j as f64);
        for pair in crossed.chunks_exact(2) {
            for i in pair[0].ceil() as usize..=(pair[1].floor() as usize).min(m) {
                if !near.contains(&[i, j]) {
                    filling.insert([i as f64, j as f64], None)?;
                }
            }
        }
    }
    Ok(())
}

/// Adds edges along creases.
fn add_creases(filling: &mut Filling<'_, '_>, creases: &[Vec<f64>; 2]) -> Result<(), SourceError> {
    for (axis, lines) in creases.iter().enumerate() {
        for line in lines {
            filling.spend(filling.mesh.num_vertices() as f64)?;
            let mut on: Vec<(f64, FixedVertexHandle)> = filling
                .mesh
                .vertices()
                .map(|v| ([v.position().x, v.position().y], v.fix()))
                .filter(|(at, _)| at[axis] == *line)
                .map(|(at, v)| (at[1 - axis], v))
                .collect();
            on.sort_by(|a, b| a.0.total_cmp(&b.0));
            for pair in on.windows(2) {
                // Outside the region, creases may cross where there is no vertex.
                if filling.mesh.can_add_constraint(pair[0].1, pair[1].1) {
                    filling.mesh.add_constraint(pair[0].1, pair[1].1);
                }
            }
        }
    }
    Ok(())
}

/// Region that an odd number of loops surrounds: their edges by the row of the lattice.
struct Region {
    rows: Vec<Vec<[[f64; 2]; 2]>>,
}

impl Region {
    fn new(polylines: &[Polyline], n_rows: usize) -> Self {
        let mut rows = vec![Vec::new(); n_rows + 1];
        for [a, b] in polylines.iter().flat_map(Polyline::edges) {
            let [low, high] = if a.at[1] < b.at[1] { [a, b] } else { [b, a] };
            let crossed = low.at[1] as usize..=(high.at[1] as usize).min(n_rows);
            rows[crossed]
                .iter_mut()
                .for_each(|row| row.push([low.at, high.at]));
        }
        Self { rows }
    }

    fn row(&self, y: f64) -> &[[[f64; 2]; 2]] {
        &self.rows[(y as usize).min(self.rows.len() - 1)]
    }

    /// Returns the number of edges that a look at a line along the first axis takes.
    fn n_edges(&self, y: f64) -> f64 {
        self.row(y).len() as f64
    }

    /// Returns where a line along the first axis crosses loops, in ascending order.
    fn crossed(&self, y: f64) -> Vec<f64> {
        let edges = self.row(y).iter();
        let crossing = edges.filter(|[a, b]| a[1] <= y && y < b[1]);
        let mut all: Vec<f64> = crossing
            .map(|[a, b]| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            .collect();
        all.sort_by(f64::total_cmp);
        all
    }

    fn contains(&self, [x, y]: [f64; 2]) -> bool {
        self.crossed(y).iter().filter(|c| **c > x).count() % 2 == 1
    }
}
