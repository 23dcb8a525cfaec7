//! Surfaces below the cut, as seen from above: treads, sills, galleries, furniture.
//!
//! A height map on the grid of the section, split into patches: neighboring points of one object whose heights differ
//! by less than a step. Their borders are the lines that a draftsman draws below the cut, whatever the mesh is like.

use enfilade_geom::{DVec2, DVec3, Sets};

use crate::section::{Label, Section};

/// Heights of one surface differ by less between neighboring points; more is an edge. [Units: wu]
const STEP: f64 = 0.04;
/// Patches smaller than this are not drawn apart from what is around them: a leaf of a plant, a handle. [Units: wu²]
const LEAST: f64 = 0.01;
/// Patches of structure larger than this are floor, on which names may stand; treads and sills are smaller. [Units: wu²]
const FLOOR: f64 = 1.0;

/// A mesh of the height map: triangles in world space, and their owner (0 for structure).
pub(crate) struct Owned<'a> {
    pub(crate) owner: u32,
    pub(crate) triangles: Box<dyn Iterator<Item = [DVec3; 3]> + 'a>,
}

/// The highest surface below the cut at each point of a section.
pub(crate) struct Relief {
    /// Borders of patches. [Units: wu, x and z]
    pub(crate) lines: Vec<Vec<DVec2>>,
    /// For each grid point, `true` on a floor.
    pub(crate) is_floor: Vec<bool>,
}

impl Relief {
    /// Looks down from the cuts of a section at the given heights. O(triangles + grid points).
    pub(crate) fn new<'a>(
        section: &Section,
        heights: &[f64],
        meshes: impl Iterator<Item = Owned<'a>>,
    ) -> Self {
        let mut map = HeightMap {
            section,
            limits: section.cut_heights(heights),
            tops: vec![(f64::NEG_INFINITY, 0); section.n_points()],
        };
        for mesh in meshes {
            for triangle in mesh.triangles {
                map.add(&triangle, mesh.owner);
            }
        }
        map.patches()
    }
}

struct HeightMap<'a> {
    section: &'a Section,
    /// Height of the cut at each point; below everything where nothing is drawn. [Units: wu]
    limits: Vec<f64>,
    /// Height and owner of the highest surface below the cut. [Units: wu]
    tops: Vec<(f64, u32)>,
}

impl HeightMap<'_> {
    /// Adds a triangle at the grid points whose centers it covers.
    fn add(&mut self, triangle: &[DVec3; 3], owner: u32) {
        let [a, b, c] = *triangle;
        let flat = |p: DVec3| DVec2::new(p.x, p.z);
        let (u, v) = (flat(b) - flat(a), flat(c) - flat(a));
        let twice = u.perp_dot(v);
        // Upright triangles cover nothing.
        if twice.abs() < 1e-9 || !twice.is_finite() {
            return;
        }
        let low = flat(a).min(flat(b)).min(flat(c));
        let high = flat(a).max(flat(b)).max(flat(c));
        let Some([columns, rows]) = self.section.points_in(low, high) else {
            return;
        };
        for row in rows {
            for column in columns.clone() {
                let at = self.section.center(column, row) - flat(a);
                let (s, t) = (at.perp_dot(v) / twice, u.perp_dot(at) / twice);
                if s < 0.0 || t < 0.0 || s + t > 1.0 {
                    continue;
                }
                let y = a.y + s * (b.y - a.y) + t * (c.y - a.y);
                let i = self.section.number(column, row);
                // An object that the cut passes through is drawn with its whole outline.
                let y = if owner > 0 { y.min(self.limits[i]) } else { y };
                if y <= self.limits[i] && y > self.tops[i].0 {
                    self.tops[i] = (y, owner);
                }
            }
        }
    }

    /// Joins points to patches and traces their borders.
    fn patches(&self) -> Relief {
        let n = self.tops.len();
        let is_open = |i: usize| self.limits[i] > f64::NEG_INFINITY;
        let neighbors = |i: usize| self.section.next_points(i);
        let least = (LEAST / self.section.step().powi(2)).ceil() as u32;
        let mut sets = Patches::new(n);
        for i in (0..n).filter(|&i| is_open(i)) {
            for j in neighbors(i).filter(|&j| is_open(j)) {
                let ((y, owner), (other_y, other)) = (self.tops[i], self.tops[j]);
                // Two points without any surface are alike, too.
                if owner == other && (y == other_y || (y - other_y).abs() < STEP) {
                    sets.join(i, j);
                }
            }
        }
        // Crumbs join their own object first, then whatever is around.
        for only_own in [true, false] {
            for i in (0..n).filter(|&i| is_open(i)) {
                for j in neighbors(i).filter(|&j| is_open(j)) {
                    let is_crumb = sets.size(i) < least || sets.size(j) < least;
                    if is_crumb && (!only_own || self.tops[i].1 == self.tops[j].1) {
                        sets.join(i, j);
                    }
                }
            }
        }
        let large = (FLOOR / self.section.step().powi(2)).ceil() as u32;
        let (mut largest, mut labels) = ((0, 0), Vec::with_capacity(n));
        for i in 0..n {
            let root = sets.root(i);
            if is_open(i) && sets.size(i) > largest.0 {
                largest = (sets.size(i), root);
            }
            labels.push(root);
        }
        let is_floor = (0..n)
            .map(|i| is_open(i) && self.tops[i].1 == 0 && sets.size(i) >= large)
            .collect();
        // Each border is that of the patch on one of its sides; the largest patch needs none.
        let label = |i: usize| {
            if is_open(i) && labels[i] != largest.1 {
                Label::Cell(labels[i] as u32)
            } else {
                Label::Outdoor
            }
        };
        let traced = self.section.relabeled((0..n).map(label).collect());
        let regions = traced.regions().into_values();
        Relief {
            lines: regions.flat_map(|r| r.borders).collect(),
            is_floor,
        }
    }
}

/// Disjoint sets of points, with their sizes.
struct Patches {
    sets: Sets,
    /// Number of points, by representative.
    sizes: Vec<u32>,
}

impl Patches {
    fn new(n: usize) -> Self {
        Self {
            sets: Sets::new(n),
            sizes: vec![1; n],
        }
    }

    fn root(&mut self, i: usize) -> usize {
        self.sets.find(i as u32) as usize
    }

    fn size(&mut self, i: usize) -> u32 {
        let root = self.root(i);
        self.sizes[root]
    }

    fn join(&mut self, i: usize, j: usize) {
        let (a, b) = (self.root(i), self.root(j));
        if a != b {
            let size = self.sizes[a] + self.sizes[b];
            self.sets.join(a as u32, b as u32);
            self.sizes[a.min(b)] = size;
        }
    }
}
