//! The cells that see each triangle: those with a leaf that borders on part of it.
//!
//! **Errs to "seen":** if a triangle lies nearly in a plane of the tree, both sides see it.

use enfilade_geom::poly::{self, Sides};
use enfilade_geom::{DVec3, Plane, Purse, Tab};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::leaf_cells::SOLID;
use super::surface::{NO_PLANE, PARALLEL, Source, Surface, SurfaceSet, Tolerance};
use super::tagged::{MIXED, TaggedTree};

/// The cells that see each triangle, separately for its front and its back, each list ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TriangleCells {
    /// Start of each list in `cells`: two entries per triangle, front then back, and one at the end.
    offsets: Vec<u32>,
    cells: Vec<u32>,
}

impl TriangleCells {
    /// Returns the number of triangles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1) / 2
    }

    /// Returns `true` if there are no triangles.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the cells that see the side from which the vertices run counter-clockwise.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn front(&self, triangle: usize) -> &[u32] {
        &self.cells[self.offsets[2 * triangle] as usize..self.offsets[2 * triangle + 1] as usize]
    }

    /// Returns the cells that see the other side.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn back(&self, triangle: usize) -> &[u32] {
        &self.cells
            [self.offsets[2 * triangle + 1] as usize..self.offsets[2 * triangle + 2] as usize]
    }

    /// Returns a copy in which each cell `c` becomes `number[c]`; several may become one.
    ///
    /// # Panics
    /// If a cell has no number.
    #[must_use]
    pub fn renumbered(&self, number: &[u32]) -> Self {
        let mut out = Self {
            offsets: Vec::with_capacity(self.offsets.len()),
            cells: Vec::with_capacity(self.cells.len()),
        };
        out.offsets.push(0);
        for list in self.offsets.windows(2) {
            let old = &self.cells[list[0] as usize..list[1] as usize];
            let mut new: SmallVec<[u32; 8]> = old.iter().map(|&c| number[c as usize]).collect();
            new.sort_unstable();
            new.dedup();
            out.cells.extend(new);
            out.offsets.push(out.cells.len() as u32);
        }
        out
    }

    /// Returns the cells that see either side, ascending, without duplicates.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn both(&self, triangle: usize) -> Vec<u32> {
        let mut all = [self.front(triangle), self.back(triangle)].concat();
        all.sort_unstable();
        all.dedup();
        all
    }
}

type Sides2 = [SmallVec<[u32; 2]>; 2];

/// Finds the cells that see each triangle. Time: the pieces that triangles are cut into where cells meet, times the
/// depth.
pub(super) fn cells_of_triangles(
    tagged: &TaggedTree<'_>,
    set: &SurfaceSet,
    tolerance: &Tolerance,
    n_triangles: usize,
    purse: Purse<'_>,
) -> TriangleCells {
    let mut surface_of: Vec<Option<&Surface>> = vec![None; n_triangles];
    for surface in set.surfaces.iter().chain(&set.copies) {
        if let Source::Triangle(t) = surface.source {
            surface_of[t as usize] = Some(surface);
        }
    }
    let lists: Vec<Sides2> = surface_of
        .par_iter()
        .with_min_len(64)
        .map_init(
            || Tab::from(purse),
            |tab, &surface| match surface {
                Some(surface) => Descent::of(tagged, surface, tolerance, tab),
                None => Sides2::default(),
            },
        )
        .collect();
    let mut out = TriangleCells {
        offsets: Vec::with_capacity(2 * n_triangles + 1),
        cells: Vec::new(),
    };
    out.offsets.push(0);
    for side in lists.iter().flatten() {
        out.cells.extend_from_slice(side);
        out.offsets.push(out.cells.len() as u32);
    }
    out
}

struct Descent<'a, 'b> {
    tagged: &'a TaggedTree<'a>,
    tolerance: &'a Tolerance,
    tab: &'a mut Tab<'b>,
    plane: u32,
    normal: DVec3,
    /// Narrower parts are the result of rounding.
    min_width: f64,
    found: Sides2,
}

impl<'a, 'b> Descent<'a, 'b> {
    fn of(
        tagged: &'a TaggedTree<'a>,
        surface: &Surface,
        tolerance: &'a Tolerance,
        tab: &'a mut Tab<'b>,
    ) -> Sides2 {
        let Some(normal) = poly::area_normal(&surface.points).try_normalize() else {
            return Sides2::default();
        };
        let bounds = tagged.tree.bounds;
        let Some(points) = poly::clip_to_box(&surface.points, &bounds, tolerance.cut) else {
            return Sides2::default();
        };
        let min_width = tolerance.plane.min(0.25 * poly::width(&surface.points));
        let plane = surface.plane;
        let mut descent = Self {
            tagged,
            tolerance,
            tab,
            plane,
            normal,
            min_width,
            found: Sides2::default(),
        };
        descent.go(tagged.tree.root, &points, None);
        let mut found = descent.found;
        for side in &mut found {
            side.sort_unstable();
            side.dedup();
        }
        found
    }

    /// `side` is set if the points lie in a plane above: 0 for the triangle's front.
    fn go(&mut self, mut child: i32, points: &[DVec3], side: Option<usize>) {
        let (node, plane) = loop {
            if !self.tab.spend(1) {
                return;
            }
            let tag = self.tagged.tag(child);
            if tag != MIXED {
                return self.find(tag, side);
            }
            let node = &self.tagged.tree.nodes[child as usize];
            let plane = &self.tagged.tree.planes[node.plane as usize];
            if node.plane == self.plane && self.plane != NO_PLANE {
                return self.both_sides(node.children, plane, points);
            }
            // Most planes are farther than all tolerances.
            let far = 2.0 * self.tolerance.plane;
            if points.iter().all(|&p| plane.signed_distance(p) > far) {
                child = node.children[0];
            } else if points.iter().all(|&p| plane.signed_distance(p) < -far) {
                child = node.children[1];
            } else {
                break (*node, *plane);
            }
        };
        if self.normal.cross(plane.normal).length_squared() < PARALLEL * PARALLEL {
            // Points within the tolerance of the plane were not cut there: visit both sides.
            let eps = self.tolerance.plane;
            let shifted = |by: f64| Plane {
                normal: plane.normal,
                d: plane.d - by,
            };
            let mut band = points;
            let (upper, lower);
            match poly::split(points, &shifted(eps), 0.0) {
                Sides::Front => return self.go(node.children[0], points, side),
                Sides::Both(f, b) => {
                    self.go_part(node.children[0], &f, side);
                    upper = b;
                    band = &upper;
                }
                Sides::Back | Sides::On => {}
            }
            match poly::split(band, &shifted(-eps), 0.0) {
                Sides::Back => return self.go(node.children[1], band, side),
                Sides::Both(f, b) => {
                    self.go_part(node.children[1], &b, side);
                    lower = f;
                    band = &lower;
                }
                Sides::Front | Sides::On => {}
            }
            return self.both_sides(node.children, &plane, band);
        }
        match poly::split(points, &plane, self.tolerance.cut) {
            Sides::Front | Sides::On => self.go(node.children[0], points, side),
            Sides::Back => self.go(node.children[1], points, side),
            Sides::Both(f, b) => {
                self.go_part(node.children[0], &f, side);
                self.go_part(node.children[1], &b, side);
            }
        }
    }

    fn find(&mut self, cell: u32, side: Option<usize>) {
        for s in (0..2).filter(|&s| cell != SOLID && side.is_none_or(|x| x == s)) {
            if self.found[s].last() != Some(&cell) {
                self.found[s].push(cell);
            }
        }
    }

    fn go_part(&mut self, child: i32, points: &[DVec3], side: Option<usize>) {
        if poly::is_larger(points, 0.0, self.min_width) {
            self.go(child, points, side);
        }
    }

    fn both_sides(&mut self, children: [i32; 2], plane: &Plane, points: &[DVec3]) {
        // A triangle moved into the plane may be hit just behind a portal beside it, so each side of it may be seen
        // from both sides of the plane.
        if points
            .iter()
            .any(|&p| plane.signed_distance(p).abs() > self.tolerance.cut)
        {
            self.go(children[0], points, None);
            return self.go(children[1], points, None);
        }
        let faces_along = self.normal.dot(plane.normal) >= 0.0;
        self.go(children[0], points, Some(usize::from(!faces_along)));
        self.go(children[1], points, Some(usize::from(faces_along)));
    }
}
