//! What walls hide from a portal on the way to it.
//!
//! Behind a portal the visible volume is all that is in front of it, which in a street is the whole facade that the window is in. Here the lines
//! from the portal to a box are held against the triangles, as `occlude` does between two portals: each face of the box by which they may come in
//! is one end of a beam. Errs to visible: what [`MAX_BEAMS`] pieces do not settle counts as seen.

use enfilade_geom::{Aabb, DVec3, Ray};

use crate::dirs::Dirs;
use crate::occlude::{APART, spread};
use crate::sheets::{Beam, Hull, Part, Sheets, cut, halves, inner_point, size};

/// Pieces that the lines to one face of a box may be cut into.
const MAX_BEAMS: usize = 24;

/// Which way the faces of a box look, in the order of [`Aabb::faces`].
const OUTWARD: [DVec3; 6] = [
    DVec3::NEG_X,
    DVec3::X,
    DVec3::NEG_Y,
    DVec3::Y,
    DVec3::NEG_Z,
    DVec3::Z,
];

/// Walls that hide things from portals.
pub(crate) struct Shade<'a> {
    pub(crate) sheets: &'a Sheets<'a>,
    pub(crate) dirs: &'a Dirs,
    /// How far inside an opening's edges lines pass it. [Units: wu]
    pub(crate) inset: f64,
    /// Rounding of `normal · point`. [Units: wu]
    pub(crate) rounding: f64,
}

impl Shade<'_> {
    /// Whether no line through an opening reaches a box behind it.
    pub(crate) fn hides(&self, dir: usize, bounds: &Aabb) -> bool {
        let opening = &self.dirs.all[dir];
        let height = (opening.low + opening.high) * 0.5;
        let parts = self.dirs.open_parts(dir, self.inset);
        let parts = parts.iter().filter(|part| part.len() > 2);
        // Lines that begin in the box come in by no face.
        if Aabb::of_points(parts.clone().flatten()).overlaps(bounds) {
            return false;
        }
        let faces = bounds.faces();
        let center = bounds.center();
        for part in parts {
            for (face, outward) in faces.iter().zip(OUTWARD) {
                // The axis along which the face lies apart from the middle.
                debug_assert!((face[0] - center).dot(outward) >= 0.0);
                let from = cut(part, outward, outward.dot(face[0]));
                let to = cut(face, opening.normal, height);
                if from.is_empty() || to.is_empty() {
                    continue;
                }
                if !self.closes([from, to]) {
                    return false;
                }
            }
        }
        true
    }

    /// Whether sheets close all lines from one polygon to the other.
    fn closes(&self, ends: [Vec<DVec3>; 2]) -> bool {
        let apart = APART * self.rounding;
        let mut beams = vec![ends];
        let mut n_done = 0;
        while let Some(ends) = beams.pop() {
            n_done += 1;
            if n_done > MAX_BEAMS {
                return false;
            }
            let line = [inner_point(&ends[0]), inner_point(&ends[1])];
            let mut hits: Vec<(f64, u32)> = Vec::new();
            let ray = Ray::segment(line[0], line[1]);
            self.sheets.bvh.for_each_hit(&ray, |hit| {
                hits.push((hit.t, hit.triangle));
            });
            if hits.is_empty() {
                return false;
            }
            hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let beam = Beam {
                ends,
                what: Part::Open,
            };
            let hull = Hull::new(&beam, apart);
            let is_closed = spread(hits.len())
                .any(|i| self.sheets.grown(hits[i].1, &beam, &hull, line).is_some());
            if is_closed {
                continue;
            }
            let end = usize::from(size(&beam.ends[1]) > size(&beam.ends[0]));
            for half in halves(&beam.ends[end]) {
                if half.is_empty() {
                    continue;
                }
                if size(&half) < 1e3 * apart {
                    return false;
                }
                let mut ends = beam.ends.clone();
                ends[end] = half;
                beams.push(ends);
            }
        }
        true
    }
}
