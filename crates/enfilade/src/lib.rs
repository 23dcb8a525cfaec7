//! `enfilade` finds the rooms (cells) and doorways (portals) of a 3D scene by itself.
//!
//! Conventions, everywhere: right-handed, +Y up, meters; front faces are counter-clockwise;
//! building computes in `f64`, files hold `f32`.

pub use enfilade_bake as bake;
pub use enfilade_cpg as cpg;
pub use enfilade_geom as geom;
pub use enfilade_import as import;
pub use enfilade_runtime as runtime;
