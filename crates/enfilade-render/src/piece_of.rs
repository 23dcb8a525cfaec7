//! Names of the pieces of a hollow world.

/// A part of a hollow world that comes and goes as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PieceOf {
    /// The triangles of a batch; index into `World::batches`.
    Batch(u32),
    /// The triangles of a mesh of objects; index into `World::detail_meshes`.
    Mesh(u32),
    /// A picture; index into `World::images`.
    Image(u32),
}
