//! Poses of detail objects, and whether they are see-through.

use enfilade_geom::DMat4;

use crate::fitting::vector;
use crate::{DetailObject, Motion, World};

impl DetailObject {
    /// Returns the transform from its mesh to the world, the same as [`DetailObject::transform`].
    #[must_use]
    pub fn placement(&self) -> DMat4 {
        DMat4::from_cols_array(&self.transform.map(f64::from))
    }

    /// Returns its transform after `motion` to a share of the way from shut (0) to open (1); column-major, as
    /// [`DetailObject::transform`], and equal to that at the model's pose.
    #[must_use]
    pub fn transform_at(&self, motion: &Motion, share: f32) -> [f32; 16] {
        if share == motion.share_of_model() {
            return self.transform;
        }
        let own = self.placement();
        (motion.at(share) * own).to_cols_array().map(|x| x as f32)
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
    /// When there is no such detail object.
    #[must_use]
    pub fn is_see_through(&self, detail: u32) -> bool {
        let mesh = &self.detail_meshes[self.details[detail as usize].mesh as usize];
        let (mut clear, mut all) = (0.0, 0.0);
        for p in &mesh.primitives {
            let corner = |i: u32| vector(p.positions[i as usize]);
            let triangles = p.indices.chunks_exact(3);
            let area: f64 = triangles
                .map(|t| {
                    let [a, b, c] = [t[0], t[1], t[2]].map(corner);
                    (b - a).cross(c - a).length()
                })
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
