//! Settings of a streamer.

use std::time::Duration;

/// The choice of what is in memory besides what is in view. After the managers of Dirkse (2002), §4.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Policy {
    /// Nothing: what leaves the view leaves memory (his §4.1.1).
    Minimal,
    /// Everything, nearest first, over a slow link: cells that cover much of the screen come before all others, and those that
    /// cover little only once these are complete (his §4.1.2).
    Delayed {
        /// Share of the screen that counts as much. [Limit: 0 to 1]
        first_share: f32,
    },
    /// All that was in view, until room is needed. Then what is due last goes first, by visibility and length of the way, not
    /// by age (his §4.1.3).
    Cache,
    /// All that may be seen soon, by deadline: from the eye's cell, and then from each cell that the eye can be in, before it
    /// can be there (his §4.1.3, last part). As in a cache, what was in view stays until room is needed.
    Prefetch {
        /// Longest time ahead. All that is due within it is watched, and fetched as soon as the link, at the pace that it has
        /// shown, might need the time; what is due later is not fetched.
        horizon: Duration,
    },
}

impl Default for Policy {
    fn default() -> Self {
        Self::Prefetch {
            horizon: Duration::from_secs(60),
        }
    }
}

/// Settings of a [`Streamer`](crate::Streamer).
#[derive(Clone, Debug, PartialEq)]
pub struct StreamOptions {
    /// The choice of what is in memory.
    pub policy: Policy,
    /// Most memory of all pieces that are in memory, on their way, or not handed over yet. [Units: bytes]
    pub max_resident: u64,
    /// Most requests on their way. [Limit: above 0]
    pub max_in_flight: usize,
    /// Most bytes on their way, as packed. A single piece may be larger. [Units: bytes]
    pub max_bytes_in_flight: u64,
    /// Most bytes handed over in a frame, so that the program integrates them in about a millisecond. A single piece may be
    /// larger. [Units: bytes]
    pub max_bytes_a_frame: u64,
    /// Cells that cover less of the screen are not fetched for the view; they are reported as stand-ins. [Limit: 0 to 1]
    pub min_share: f32,
    /// True if the eye passes windows and cracks too. If it does so unexpectedly, all that it sees there is late.
    pub flies: bool,
    /// Distance of the eye from the last search at which deadlines are found anew. [Units: wu]
    pub step: f32,
    /// Time until a piece that failed is asked for again; doubles with each failure in a row.
    pub first_retry: Duration,
    /// Most time until a piece that failed is asked for again.
    pub last_retry: Duration,
}

impl Default for StreamOptions {
    fn default() -> Self {
        Self {
            policy: Policy::default(),
            max_resident: 256 << 20,
            max_in_flight: 16,
            max_bytes_in_flight: 4 << 20,
            max_bytes_a_frame: 1 << 20,
            min_share: 0.0,
            flies: false,
            step: 1.0,
            first_retry: Duration::from_millis(250),
            last_retry: Duration::from_secs(8),
        }
    }
}
