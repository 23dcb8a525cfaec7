//! The native part of the Python package `enfilade`.
//!
//! Takes and returns arrays and plain values; the names, sequences and plots that users see are made of them in
//! `python/enfilade`. Long work runs on threads of its own while the caller's watches for interrupts (`watch.rs`), and
//! without Python's global lock.

mod arrays;
mod bake;
mod demo;
mod errors;
mod export;
mod plan;
mod see;
mod walk;
mod watch;
mod world;

/// Native functions and types; not for use from outside the package.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::bake::{bake_arrays, bake_files};
    #[pymodule_export]
    use super::demo::demo_meshes;
    #[pymodule_export]
    use super::errors::{BakeError, EnfiladeError, NoPathError, SceneError, WorldError};
    #[pymodule_export]
    use super::world::World;
}
