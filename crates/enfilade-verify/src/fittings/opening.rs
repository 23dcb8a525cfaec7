//! An opening in its own directions, to measure how much of it its fittings cover.

use enfilade_cpg::Portal;
use enfilade_geom::{Aabb, DVec3, Triangle, is_rather_level};

use crate::subject::to_dvec;

/// Width and height of the raster of an opening, in squares.
const SQUARES: usize = 32;

/// Distance by which a fitting may extend over the wall, or end short of the jamb. [Units: wu]
pub(super) const BESIDE: f64 = 0.3;
/// Largest distance of a fitting from the opening's plane, within a wall. [Units: wu]
pub(super) const DEEP: f64 = 0.6;

/// The opening of a portal. Its own directions are across, up, and along its normal; its plane lies at 0.
pub(super) struct FittedOpening {
    origin: DVec3,
    directions: [DVec3; 3],
    /// Box around the open area.
    pub(super) bounds: Aabb,
    is_open: Vec<bool>,
    n_open: usize,
}

impl FittedOpening {
    /// Returns `None` if nothing is open.
    pub(super) fn of(portal: &Portal) -> Option<Self> {
        let normal = to_dvec(portal.normal).try_normalize()?;
        let across = DVec3::Y.cross(normal).try_normalize();
        let across = across.unwrap_or_else(|| normal.any_orthonormal_vector());
        let mut this = Self {
            origin: to_dvec(*portal.outline.first()?),
            directions: [across, normal.cross(across), normal],
            bounds: Aabb::EMPTY,
            is_open: Vec::new(),
            n_open: 0,
        };
        let place = |piece: &Vec<[f32; 3]>| -> Vec<DVec3> {
            piece.iter().map(|&c| this.place(to_dvec(c))).collect()
        };
        let pieces: Vec<Vec<DVec3>> = portal.pieces.iter().map(place).collect();
        this.bounds = Aabb::of_points(pieces.iter().flatten());
        let fans = pieces.iter().flat_map(|p| {
            let n = p.len();
            (1..n.saturating_sub(1)).map(|k| [p[0], p[k], p[k + 1]])
        });
        this.is_open = this.raster(fans);
        this.n_open = this.is_open.iter().filter(|&&is| is).count();
        (this.n_open > 0).then_some(this)
    }

    /// Converts a point of the world to the opening's directions.
    pub(super) fn place(&self, p: DVec3) -> DVec3 {
        self.turn(p - self.origin)
    }

    /// Converts a direction of the world to the opening's.
    pub(super) fn turn(&self, d: DVec3) -> DVec3 {
        let [x, y, z] = self.directions.map(|own| own.dot(d));
        DVec3::new(x, y, z)
    }

    /// Returns `true` if it stands upright, as doors do.
    pub(super) fn is_upright(&self) -> bool {
        !is_rather_level(self.directions[2])
    }

    /// Returns a box in the world around everything closer to the opening than `reach`. [Units: wu]
    pub(super) fn around(&self, reach: f64) -> Aabb {
        let [x, y, z] = self.directions;
        let corners = self.bounds.expanded(reach).corners();
        let to_world = |p: &DVec3| self.origin + x * p.x + y * p.y + z * p.z;
        corners
            .iter()
            .fold(Aabb::EMPTY, |b, p| b.including(to_world(p)))
    }

    /// Returns the share of the open area that triangles, given in the opening's directions, cover along its normal.
    pub(super) fn covered<'t>(&self, by: impl IntoIterator<Item = &'t Triangle>) -> f64 {
        let covered = self.raster(by.into_iter().copied());
        let both = self.is_open.iter().zip(&covered);
        both.filter(|(open, covered)| **open && **covered).count() as f64 / self.n_open as f64
    }

    /// Marks the squares whose center lies in a triangle.
    fn raster(&self, triangles: impl IntoIterator<Item = Triangle>) -> Vec<bool> {
        let mut marks = vec![false; SQUARES * SQUARES];
        let size = self.bounds.size().max(DVec3::splat(1e-9));
        for t in triangles {
            // In squares, the center of the first at 0.
            let t = t.map(|p| (p - self.bounds.min) / size * SQUARES as f64 - 0.5);
            let low = t[0].min(t[1]).min(t[2]).ceil().max(DVec3::ZERO);
            let high = t[0].max(t[1]).max(t[2]).floor();
            let last = (SQUARES - 1) as f64;
            for x in low.x as usize..(high.x.min(last) + 1.0).max(0.0) as usize {
                for y in low.y as usize..(high.y.min(last) + 1.0).max(0.0) as usize {
                    let is_in = holds(&t, x as f64, y as f64);
                    marks[x * SQUARES + y] |= is_in;
                }
            }
        }
        marks
    }
}

/// Returns `true` if a triangle, seen along z, contains a point.
fn holds(t: &Triangle, x: f64, y: f64) -> bool {
    let side = |a: DVec3, b: DVec3| (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x);
    let sides = [side(t[0], t[1]), side(t[1], t[2]), side(t[2], t[0])];
    let is_flat = sides.iter().all(|&s| s == 0.0);
    !is_flat && (sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0))
}
