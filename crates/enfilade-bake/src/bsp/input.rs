//! Input of a tree.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{ConvexSolid, DVec3, Triangle};

/// The input of a tree.
#[derive(Clone, Copy, Debug)]
pub struct BspInput<'a> {
    /// Surfaces if there are no solids: triangles, solid behind, empty in front. [Units: wu]
    pub triangles: &'a [Triangle],
    /// The object of each triangle, to find the matter within each; empty if all are one object.
    pub objects: &'a [u32],
    /// Brushes; if there are any, they are the surfaces.
    pub solids: &'a [ConvexSolid],
    /// Points known to be inside, such as those of entities. With solids, space that they cannot reach is
    /// dropped, unless they reach the border.
    pub inside: &'a [DVec3],
}

/// Returns brushes if the whole structure is made of them, else its triangles.
pub(super) fn input_of<'a>(
    scene: &'a Scene,
    triangles: &'a [Triangle],
    objects: &'a [u32],
    inside: &'a [DVec3],
) -> BspInput<'a> {
    let is_brushes = !scene.solids.is_empty()
        && scene
            .objects
            .iter()
            .filter(|o| o.role == Role::Structural)
            .all(|o| o.reason.starts_with("map: "));
    BspInput {
        triangles,
        objects,
        solids: if is_brushes { &scene.solids } else { &[] },
        inside: if is_brushes { inside } else { &[] },
    }
}
