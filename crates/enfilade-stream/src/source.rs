//! Sources of pieces.

use crate::PieceId;

/// A place from which pieces are fetched: memory, a file, a server, or a simulated link. Nothing blocks.
///
/// A request ends in exactly one [`Reply`], unless it is canceled before. The bytes are those of the piece in memory: checked
/// against its hash and unpacked.
pub trait Source {
    /// Asks for a piece. A piece that is already on its way is not asked for again by callers.
    fn request(&mut self, piece: PieceId);

    /// Gives up a request; its reply never comes, or comes if it was too late to stop it. Without effect for pieces that are
    /// not on their way.
    fn cancel(&mut self, piece: PieceId);

    /// Moves the replies that have arrived to the end of `replies`.
    fn poll(&mut self, replies: &mut Vec<Reply>);
}

/// The end of a request.
#[derive(Debug)]
pub struct Reply {
    /// The piece.
    pub piece: PieceId,
    /// Its bytes, or the reason for their absence after all retries.
    pub bytes: Result<Vec<u8>, FetchError>,
}

/// The reasons why a piece could not be fetched.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FetchError {
    /// The source does not have the piece.
    #[error("piece {} is not at {place}", piece.0)]
    Missing {
        /// The piece.
        piece: PieceId,
        /// Path or address.
        place: String,
    },
    /// The bytes are not those that were packed.
    #[error("piece {} of {place} is damaged: {problem}; pack the world again, or fetch it again", piece.0)]
    Damaged {
        /// The piece.
        piece: PieceId,
        /// Path or address.
        place: String,
        /// The problem.
        problem: String,
    },
    /// The place cannot be reached.
    #[error("piece {} cannot be read from {place}: {problem}", piece.0)]
    Unreachable {
        /// The piece.
        piece: PieceId,
        /// Path or address.
        place: String,
        /// The problem.
        problem: String,
    },
}
