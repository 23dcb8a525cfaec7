//! Images of things that stand in special portals: they are on both sides, cut at the plane.

use enfilade_cpg::{CellId, SpecialId};
use enfilade_geom::{DVec3, Similarity, closest_point_on_triangle};

use super::{PartId, Place, Space};

/// The image of a thing beyond a special portal that it stands in.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SpecialImage {
    /// The special portal.
    pub special: SpecialId,
    /// The cell beyond it.
    pub to: CellId,
    /// Map from the thing to its image, in the frame of their part.
    pub map: Similarity,
    /// Plane of the special portal, its normal out of the thing's cell and its height: the thing ends where `normal · p > height`.
    pub near: (DVec3, f64),
    /// Image of that plane: the image begins where `normal · p >= height`.
    pub far: (DVec3, f64),
}

impl Space {
    /// Adds to `images` those of a thing in a part, within `radius` around `center`, beyond the special portals that it touches
    /// from their fronts; a thing whose center is beyond the plane should have passed ([`Space::follow`]). Draw the thing and its
    /// images with what is beyond the planes cut off. Images of images are left out. O(special portals of the part).
    ///
    /// # Panics
    ///
    /// If there is no such part.
    #[doc(hidden)]
    pub fn images(&self, part: PartId, center: DVec3, radius: f64, images: &mut Vec<SpecialImage>) {
        let own = &self.parts[part.idx()];
        let at = (own.layout.n_specials() > 0).then(|| self.locate(part, center));
        let Some(at) = at else { return };
        for special in (0..own.layout.n_specials() as u32).map(SpecialId) {
            let Some((to, map)) = own.layout.passage(special) else {
                continue;
            };
            let opening = own.layout.special_opening(special);
            let height = opening.height_of(center);
            let is_before = (-radius..=own.layout.tolerance()).contains(&height);
            let cell = opening.cells()[0];
            let is_there = at.is_none_or(|at| at == Place { part, cell });
            if !is_before || !is_there || !self.is_special_open(part, special) {
                continue;
            }
            let triangles = opening
                .pieces()
                .flat_map(|piece| (2..piece.len()).map(move |k| [0, k - 1, k].map(|i| piece[i])));
            let mut nearest = triangles.map(|t| closest_point_on_triangle(center, &t));
            if !nearest.any(|p| p.distance_squared(center) < radius * radius) {
                continue;
            }
            let normal = opening.normal();
            let beyond = map.direction(normal);
            images.push(SpecialImage {
                special,
                to,
                map: *map,
                near: (normal, normal.dot(opening.center())),
                far: (beyond, beyond.dot(map.point(opening.center()))),
            });
        }
    }
}
