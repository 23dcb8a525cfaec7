//! States of pieces.

/// The state of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    Absent,
    /// On its way. Its memory is reserved.
    InFlight,
    /// Arrived, not handed over.
    Arrived,
    /// In memory of the program.
    Resident,
    /// Failed; to be asked for again later.
    Failing,
    /// The source does not have it.
    Missing,
}

impl State {
    /// Returns `true` if its memory is reserved.
    #[inline]
    pub(crate) fn is_kept(self) -> bool {
        matches!(self, Self::InFlight | Self::Arrived | Self::Resident)
    }
}
