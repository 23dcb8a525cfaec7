//! Conversion of stored `f32` points to `f64`.

use enfilade_geom::DVec3;

pub(crate) fn point(p: [f32; 3]) -> DVec3 {
    DVec3::new(p[0].into(), p[1].into(), p[2].into())
}
