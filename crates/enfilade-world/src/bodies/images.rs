//! Images of a body beyond special portals.

use enfilade_cpg::{SpecialId, Way};
use enfilade_geom::{DVec3, Similarity};

use super::carve::Carver;
use super::kernel::sweep;
use super::moving::Moving;
use crate::space::{PartId, Place, Space};

/// Images of a body in one query; what lies behind further special portals is not met.
const MAX_IMAGES: usize = 32;

/// A place of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct ImagePlace {
    pub(super) image: usize,
    pub(super) place: Place,
}

/// A body on the far side of special portals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Image {
    /// The part in whose frame it is, and the map there from the frame of the motion.
    pub(super) frame: PartId,
    pub(super) map: Similarity,
    /// The plane beyond which it meets things, `normal · p >= height`, and the special portal that leads back.
    far: Option<(DVec3, f64, Option<SpecialId>)>,
    /// True if it passed a doorway, not an opening made in a wall.
    is_doorway: bool,
}

/// A special portal that an image touches from its front.
#[derive(Clone, Copy, Debug)]
struct Touched {
    image: usize,
    part: PartId,
    special: SpecialId,
}

/// The images of one query: the body itself, and one beyond each special portal that it touches.
#[derive(Clone, Debug, Default)]
pub(super) struct Images {
    pub(super) all: Vec<Image>,
    touched: Vec<Touched>,
    /// The obstacles that count for the current one.
    pub(super) carver: Carver,
}

impl Images {
    /// Begins with the body itself, in the frame of a part.
    pub(super) fn begin(&mut self, frame: PartId) {
        self.touched.clear();
        self.all.clear();
        self.all.push(Image {
            frame,
            map: Similarity::IDENTITY,
            far: None,
            is_doorway: false,
        });
    }

    /// Continues on the far sides of the special portals of a cell that the body touches from their fronts.
    pub(super) fn meet(
        &mut self,
        space: &Space,
        moving: &Moving,
        ImagePlace { image, place }: ImagePlace,
        [since, left]: [f64; 2],
        mut reach: impl FnMut(ImagePlace, f64),
    ) {
        let Place { part, cell } = place;
        let start = moving.from + moving.by * since;
        let own = &space.parts[part.idx()];
        if own.layout.n_specials() == 0 {
            return;
        }
        for special in own.layout.specials_of(cell) {
            let Some((to, map)) = own.layout.passage(special) else {
                continue;
            };
            let Image { frame, far, .. } = self.all[image];
            let is_back = far.is_some_and(|far| frame == part && far.2 == Some(special));
            let is_known = |t: &Touched| t.image == image && t.part == part && t.special == special;
            if is_back
                || self.touched.iter().any(is_known)
                || self.all.len() == MAX_IMAGES
                || !space.is_special_open(part, special)
            {
                continue;
            }
            let opening = own.layout.special_opening(special);
            let triangles = opening.pieces().flat_map(|piece| {
                (2..piece.len()).map(move |k| [0, k - 1, k].map(|i| piece[i] - start))
            });
            let touches = triangles.filter_map(|t| sweep(&moving.grown, moving.by, left, &t));
            let Some(after) = touches.map(|touch| touch.t).min_by(f64::total_cmp) else {
                continue;
            };
            // From behind, its back is met.
            let center = start + moving.by * after;
            if opening.height_of(center) > own.layout.tolerance() {
                continue;
            }
            self.touched.push(Touched {
                image,
                part,
                special,
            });
            let normal = map.direction(opening.normal());
            let back = space.world(part).graph.specials[special.idx()]
                .passes
                .iter()
                .find_map(|pass| match pass.way {
                    Way::Lead { back, .. } => Some(back),
                    _ => None,
                });
            self.all.push(Image {
                frame: part,
                map: map.after(&moving.map),
                is_doorway: own.layout.portal_of_special(special).is_some(),
                far: Some((
                    normal,
                    normal.dot(map.point(opening.center())),
                    back.flatten(),
                )),
            });
            let image = self.all.len() - 1;
            let place = Place { part, cell: to };
            reach(ImagePlace { image, place }, since + after);
        }
    }

    /// Sets the obstacles that count for an image in a part.
    pub(super) fn set_cuts(&mut self, space: &Space, image: usize, part: PartId) {
        self.carver.clear();
        let margin = space.layout(part).tolerance();
        let own = &self.all[image];
        if let Some((normal, height, _)) = own.far {
            let to = space.between(own.frame, part);
            let (normal, through) = (to.direction(normal), to.point(normal * height));
            // In the plane of a doorway may be its leaf, which counts as beyond; in that of a wall, the wall itself.
            let margin = if own.is_doorway { -margin } else { margin };
            self.carver.add_far(normal, normal.dot(through), margin);
        }
        for touched in self.touched.iter().filter(|t| t.image == image) {
            let opening = space.layout(touched.part).special_opening(touched.special);
            let to = space.between(touched.part, part);
            let normal = to.direction(opening.normal());
            let height = normal.dot(to.point(opening.center()));
            self.carver
                .add_near(normal, height, margin, opening.pieces(), |p| to.point(p));
        }
    }
}
