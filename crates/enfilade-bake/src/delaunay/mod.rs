//! The Delaunay builder: tetrahedra between the surfaces, put together to rooms.
//!
//! Gjørup, "Portal techniques for large interactive worlds" (1999), chapter 4.
//!
//! | stage | file | source |
//! | --- | --- | --- |
//! | tetrahedra of points | `tetrahedra`, `order`, `predicate` | Bowyer 1981, Watson 1981 |

mod order;
mod predicate;
mod tetrahedra;

#[cfg(test)]
mod tests;

pub use tetrahedra::{Delaunay, DelaunayError, INFINITE, Tetrahedron, tetrahedralize};
