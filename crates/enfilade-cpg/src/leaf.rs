//! Placement of detail objects, and whether they are see-through.

use enfilade_geom::{DMat4, triangle_area_normal};

use crate::{DetailObject, World};

impl DetailObject {
    /// Returns the transform from its mesh to the world, the same as [`DetailObject::transform`].
    #[must_use]
    pub fn placement(&self) -> DMat4 {
        DMat4::from_cols_array(&self.transform.map(f64::from))
    }
}

/// Least share of transparent surface that makes a leaf see-through as a whole.
const SEE_THROUGH: f64 = 0.25;

impl World {
    /// Returns `true` if at least a quarter of an object's surface is transparent, by its materials' `alphaMode`. A
    /// glass door shuts the way, not the view. O(triangles of the object).
    ///
    /// # Panics
    ///
    /// If the detail object does not exist.
    #[must_use]
    pub fn is_see_through(&self, detail: u32) -> bool {
        let mesh = &self.detail_meshes[self.details[detail as usize].mesh as usize];
        let (mut clear, mut all) = (0.0, 0.0);
        for p in &mesh.primitives {
            let area: f64 = (p.triangles())
                .map(|t| triangle_area_normal(&t).length())
                .sum();
            all += area;
            let material = p.material.and_then(|m| self.materials.get(m as usize));
            if material.is_some_and(|m| m.transparent) {
                clear += area;
            }
        }
        all > 0.0 && clear >= SEE_THROUGH * all
    }
}
