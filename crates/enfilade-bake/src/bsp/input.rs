//! What a tree is built from.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{ConvexSolid, DVec3, Triangle};

/// What a tree is built from.
#[derive(Clone, Copy, Debug)]
pub struct BspInput<'a> {
    /// Surfaces where there are no solids: triangles, solid behind, empty before. [Units: wu]
    pub triangles: &'a [Triangle],
    /// The object of each triangle, to tell what is inside one; empty where all are one.
    pub objects: &'a [u32],
    /// Brushes; where there are some, they are the surfaces.
    pub solids: &'a [ConvexSolid],
    /// Points known to be inside, such as those of entities; with solids, what they cannot reach is
    /// dropped unless they reach the border, too.
    pub inside: &'a [DVec3],
}

/// Brushes where the whole structure is made of them, its triangles where not.
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
