//! Polygons clipped by planes.
//!
//! Everything here errs outwards: a clip keeps [`Tolerance::outward`] more than the plane's front side.

use enfilade_geom::DVec3;

use crate::dirs::sine;
use crate::planes::{Four, Side, cuts};
use crate::tolerance::{HalfSpace, Tolerance};

/// A polygon in an [`Arena`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Poly {
    start: u32,
    len: u32,
    /// The directed portal that it is part of.
    pub(crate) dir: u32,
}

/// Vertices of the polygons of a search path, as a stack.
#[derive(Default)]
pub(crate) struct Arena {
    points: Vec<DVec3>,
}

impl Arena {
    #[inline]
    pub(crate) fn mark(&self) -> usize {
        self.points.len()
    }

    #[inline]
    pub(crate) fn release(&mut self, mark: usize) {
        self.points.truncate(mark);
    }

    #[inline]
    pub(crate) fn push(&mut self, points: &[DVec3], dir: u32) -> Poly {
        let start = self.points.len() as u32;
        self.points.extend_from_slice(points);
        Poly {
            start,
            len: points.len() as u32,
            dir,
        }
    }

    #[inline]
    pub(crate) fn get(&self, poly: Poly) -> &[DVec3] {
        &self.points[poly.start as usize..][..poly.len as usize]
    }

    #[inline]
    pub(crate) fn mean(&self, poly: Poly) -> DVec3 {
        let points = self.get(poly);
        points.iter().sum::<DVec3>() / points.len() as f64
    }

    /// Returns the part of `poly` in a half-space widened by [`Tolerance::outward`]; `poly` itself if nothing is cut
    /// off. `None` if no line with clearance meets it. `turn` is the polygon's unit normal.
    #[inline]
    pub(crate) fn clip(
        &mut self,
        poly: Poly,
        keep: HalfSpace,
        turn: DVec3,
        tolerance: &Tolerance,
    ) -> Option<Poly> {
        let n = poly.len as usize;
        let mut few = [0.0; 16];
        let mut many = Vec::new();
        let heights = if n <= few.len() {
            &mut few[..n]
        } else {
            many.resize(n, 0.0);
            &mut many[..]
        };
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (height, p) in heights.iter_mut().zip(self.get(poly)) {
            let h = keep.normal.dot(*p) - keep.offset;
            low = low.min(h);
            high = high.max(h);
            *height = h;
        }
        if low >= -tolerance.outward {
            return Some(poly);
        }
        // A disc of radius `clearance` around the crossing lies inside the opening, so the opening reaches that far
        // past the plane, foreshortened by the angle between them.
        if high < tolerance.clearance && high < tolerance.clearance * sine(keep.normal, turn) {
            return None;
        }
        if high < -tolerance.outward {
            return None;
        }
        let start = self.points.len();
        for i in 0..n {
            let j = if i + 1 == n { 0 } else { i + 1 };
            let (hi, hj) = (
                heights[i] + tolerance.outward,
                heights[j] + tolerance.outward,
            );
            let p = self.points[poly.start as usize + i];
            if hi >= 0.0 {
                self.points.push(p);
            }
            if (hi > 0.0 && hj < 0.0) || (hi < 0.0 && hj > 0.0) {
                let q = self.points[poly.start as usize + j];
                // Computed from the inner end, so that both directions of an edge give the same point.
                let cut = if hi > 0.0 {
                    p + (q - p) * (hi / (hi - hj))
                } else {
                    q + (p - q) * (hj / (hj - hi))
                };
                self.points.push(cut);
            }
        }
        Some(Poly {
            start: start as u32,
            len: (self.points.len() - start) as u32,
            dir: poly.dir,
        })
    }

    /// Returns the part of `poly` on one side of all planes, as [`Arena::clip`] does for each in order.
    ///
    /// Five of six planes cut nothing off; four are tested for that at a time. `ball` (center, radius) encloses
    /// `poly`.
    #[inline]
    pub(crate) fn clip_all(
        &mut self,
        mut poly: Poly,
        planes: &[Four],
        side: Side,
        ball: [f64; 4],
        turn: DVec3,
        tolerance: &Tolerance,
    ) -> Option<Poly> {
        for four in planes {
            let mut cuts = cuts(four, side, self.get(poly), ball, tolerance);
            while cuts != 0 {
                let lane = cuts.trailing_zeros() as usize;
                cuts &= cuts - 1;
                poly = self.clip(poly, four.half_space(side, lane), turn, tolerance)?;
            }
        }
        Some(poly)
    }
}
