//! Problems of special portals.

use crate::{CellId, PortalId, SpecialId};

/// The reason why a special portal is broken, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpecialProblem {
    /// Its cell does not exist.
    #[error("it is seen from {cell}, but there are {n_cells} cells")]
    NoCell {
        /// The cell.
        cell: CellId,
        /// Number of cells.
        n_cells: usize,
    },
    /// It is a side of a doorway that does not exist, or not in its cell.
    #[error(
        "{portal} is no portal of its cell; give one of those that `enfilade inspect` lists for it"
    )]
    NotOfCell {
        /// The portal.
        portal: PortalId,
    },
    /// Another special portal is the same side of the same doorway.
    #[error(
        "{other} is the same side of {portal}; remove one of the two, or give one of them the passes of both"
    )]
    SameSide {
        /// The portal.
        portal: PortalId,
        /// The other one.
        other: SpecialId,
    },
    /// Its normal is not of unit length.
    #[error("its normal {normal:?} is not of unit length")]
    Normal {
        /// The normal.
        normal: [f32; 3],
    },
    /// A vertex is not finite.
    #[error("its vertex {at:?} is not finite")]
    Corner {
        /// The vertex.
        at: [f32; 3],
    },
    /// It has no piece with area.
    #[error("it covers no area; give at least one polygon")]
    NoArea,
    /// A piece is not a convex polygon in its plane, counter-clockwise about its normal.
    #[error("its piece {piece} is no polygon: {problem}")]
    Piece {
        /// The piece.
        piece: u32,
        /// The problem.
        problem: String,
    },
    /// A vertex is far from its cell.
    #[error("its vertex {at:?} is not at its cell, whose box is {aabb:?}; give the cell before it")]
    FarFromCell {
        /// The vertex. [Units: wu]
        at: [f32; 3],
        /// The cell's box. [Units: wu]
        aabb: [[f32; 3]; 2],
    },
    /// It shows nothing.
    #[error("it has no passes; give it one, or remove it")]
    NoPass,
    /// A tint is not a color.
    #[error("the tint {tint:?} of pass {pass} must be four numbers from 0 to 1")]
    Tint {
        /// The pass.
        pass: usize,
        /// Its tint.
        tint: [f32; 4],
    },
    /// The first pass covers only a share.
    #[error(
        "its first pass covers a share of {share}; it must cover all (1), as there is nothing below"
    )]
    FirstShare {
        /// The share.
        share: f32,
    },
    /// A part of a wall shows the cell behind a doorway.
    #[error(
        "pass {pass} shows the cell behind a doorway, but it covers a wall; only sides of doorways can"
    )]
    ThroughWall {
        /// The pass.
        pass: usize,
    },
    /// Two passes are ways to go.
    #[error(
        "passes {first} and {second} are both ways to go; a body goes one way, so only one pass may be through or a lead"
    )]
    TwoWays {
        /// The earlier pass.
        first: usize,
        /// The later pass.
        second: usize,
    },
    /// The map of a lead is none.
    #[error(
        "the map of pass {pass} must be finite, with a rotation of unit length and a scale from 1e-6 to 1e6, either sign"
    )]
    Map {
        /// The pass.
        pass: usize,
    },
    /// A lead leads to a cell that does not exist.
    #[error("pass {pass} leads to {to}, but there are {n_cells} cells")]
    NoTarget {
        /// The pass.
        pass: usize,
        /// The cell.
        to: CellId,
        /// Number of cells.
        n_cells: usize,
    },
    /// The way back does not exist, is in another cell, or leads elsewhere.
    #[error(
        "pass {pass} names {back} as the way back, which must be in {to} and lead back to {cell} naming this one; it {is}"
    )]
    NoWayBack {
        /// The pass.
        pass: usize,
        /// The way back.
        back: SpecialId,
        /// The cell that it should be in.
        to: CellId,
        /// The cell that it should lead to.
        cell: CellId,
        /// The problem with it.
        is: &'static str,
    },
    /// The way back leads elsewhere than to where one came from.
    #[error(
        "the map of {back} is not the inverse of that of pass {pass}: who goes there and back is {off:.4} m off; link both anew"
    )]
    NotInverse {
        /// The pass.
        pass: usize,
        /// The way back.
        back: SpecialId,
        /// How far one is off at most. [Units: wu]
        off: f64,
    },
    /// Both ends look the same way.
    #[error(
        "the map of pass {pass} leaves by the back of {back}: it must turn this side's outward normal into the inward one there"
    )]
    Facing {
        /// The pass.
        pass: usize,
        /// The way back.
        back: SpecialId,
    },
    /// The mapped opening lies beside the plane of the way back.
    #[error("the map of pass {pass} puts this opening {off:.4} m off the plane of {back}")]
    OffPlane {
        /// The pass.
        pass: usize,
        /// The way back.
        back: SpecialId,
        /// The distance. [Units: wu]
        off: f64,
    },
    /// The mapped opening is not that of the way back.
    #[error(
        "its opening of {:.3} × {:.3} m is mapped to one of {:.3} × {:.3} m, but {back} is {:.3} × {:.3} m, up to {off:.3} m off; \
         link openings of one shape and size, give a map that fits, or link one way only",
        .sizes[0][0], .sizes[0][1], .sizes[1][0], .sizes[1][1], .sizes[2][0], .sizes[2][1]
    )]
    Outline {
        /// The pass.
        pass: usize,
        /// The way back.
        back: SpecialId,
        /// Width and height of this opening, of its image, and of the way back. [Units: wu]
        sizes: [[f64; 2]; 3],
        /// Largest distance between the outlines. [Units: wu]
        off: f64,
    },
    /// The mapped opening is as large as the way back, but has other holes.
    #[error("its opening of {:.3} m² is mapped to {:.3} m², but {back} has {:.3} m² of the same outline: one has bars that the other lacks", .areas[0], .areas[1], .areas[2])]
    Bars {
        /// The pass.
        pass: usize,
        /// The way back.
        back: SpecialId,
        /// Area of this opening, of its image, and of the way back. [Units: wu²]
        areas: [f64; 3],
    },
    /// A camera is none.
    #[error("the camera of pass {pass} {problem}")]
    Camera {
        /// The pass.
        pass: usize,
        /// The problem.
        problem: &'static str,
    },
}
