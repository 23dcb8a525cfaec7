//! A link in virtual time.

use std::time::Duration;

use crate::{Catalog, FetchError, PieceId, Reply, Source};

/// Settings of a [`SimulatedLink`].
#[derive(Clone, Debug, PartialEq)]
pub struct SimulatedLinkOptions {
    /// Time from a request to its first byte.
    pub latency: Duration,
    /// Bytes a second, shared equally by all transfers that have begun. [Limit: above 0]
    pub bandwidth: f64,
    /// Probability that a request ends in an error. [Limit: 0 to 1]
    pub error_rate: f64,
    /// Probability that a transfer breaks off at a random byte; the rest follows after another latency, as a source that asks
    /// for the missing range would have it. [Limit: 0 to 1]
    pub short_read_rate: f64,
    /// Seed of the errors and breaks.
    pub seed: u64,
}

impl Default for SimulatedLinkOptions {
    fn default() -> Self {
        Self {
            latency: Duration::from_millis(50),
            bandwidth: 1e6,
            error_rate: 0.0,
            short_read_rate: 0.0,
            seed: 1,
        }
    }
}

/// A source for tests and benchmarks: pieces come over a link with latency, bandwidth and errors, in virtual time. Equal
/// calls give equal replies.
#[derive(Debug)]
pub struct SimulatedLink {
    options: SimulatedLinkOptions,
    /// Size of each piece in transit. [Units: bytes]
    sizes: Vec<u64>,
    /// Bytes of each piece; empty vectors if not given.
    contents: Vec<Vec<u8>>,
    /// True if there is no answer but errors.
    is_down: bool,
    now: Duration,
    random: u64,
    transfers: Vec<Transfer>,
    done: Vec<Reply>,
    n_bytes: f64,
}

#[derive(Clone, Debug)]
struct Transfer {
    piece: PieceId,
    /// Time of the first byte.
    begin: Duration,
    /// Bytes to go until it ends or breaks off.
    left: f64,
    /// Bytes to go after the break.
    rest: f64,
    is_bad: bool,
}

impl SimulatedLink {
    /// Makes a link to the pieces of a catalog. Their contents are empty unless [given](Self::with_contents).
    #[must_use]
    pub fn new(catalog: &Catalog, options: SimulatedLinkOptions) -> Self {
        Self {
            sizes: catalog.pieces().iter().map(|p| p.n_packed).collect(),
            contents: Vec::new(),
            is_down: false,
            now: Duration::ZERO,
            random: options.seed,
            transfers: Vec::new(),
            done: Vec::new(),
            n_bytes: 0.0,
            options,
        }
    }

    /// Gives the pieces their bytes, in the order of the catalog.
    #[must_use]
    #[doc(hidden)]
    pub fn with_contents(mut self, contents: Vec<Vec<u8>>) -> Self {
        self.contents = contents;
        self
    }

    /// Cuts the link, or mends it. What is on its way over a cut link fails, as do requests, after the latency.
    #[doc(hidden)]
    pub fn set_down(&mut self, is_down: bool) {
        self.is_down = is_down;
        if is_down {
            for transfer in &mut self.transfers {
                (transfer.left, transfer.rest, transfer.is_bad) = (0.0, 0.0, true);
                transfer.begin = transfer.begin.max(self.now + self.options.latency);
            }
        }
    }

    /// Sets the bandwidth from now on. [Units: bytes/s] [Limit: above 0]
    pub fn set_bandwidth(&mut self, bandwidth: f64) {
        self.options.bandwidth = bandwidth;
    }

    /// Returns the bytes that have come over the link so far, those of failed and canceled transfers included.
    #[must_use]
    pub fn n_bytes(&self) -> f64 {
        self.n_bytes
    }

    /// Lets time pass until `now`. Linear in the transfers, for each that ends.
    pub fn advance(&mut self, now: Duration) {
        while self.now < now {
            // The bandwidth is shared anew when a transfer begins or ends.
            let is_running = |t: &&Transfer| t.begin <= self.now;
            let n = self.transfers.iter().filter(is_running).count();
            let rate = self.options.bandwidth / (n.max(1)) as f64;
            let left = self.transfers.iter().filter(is_running).map(|t| t.left);
            let least = left.fold(f64::INFINITY, f64::min);
            let begins = self.transfers.iter().map(|t| t.begin);
            let next = begins.filter(|b| *b > self.now).min();
            let mut until = now.min(next.unwrap_or(now));
            // Rounded up, so that time goes on.
            let end = seconds(least / rate).map(|d| self.now + d + Duration::from_nanos(1));
            until = until.min(end.unwrap_or(until));
            let bytes = (until - self.now).as_secs_f64() * rate;
            for t in self.transfers.iter_mut().filter(|t| t.begin <= self.now) {
                self.n_bytes += bytes.min(t.left);
                t.left -= bytes;
            }
            self.now = until;
            self.end_transfers();
        }
    }

    fn end_transfers(&mut self) {
        let mut i = 0;
        while let Some(t) = self.transfers.get_mut(i) {
            if t.begin > self.now || t.left > 0.0 {
                i += 1;
            } else if t.rest > 0.0 {
                (t.left, t.rest) = (t.rest, 0.0);
                t.begin = self.now + self.options.latency;
            } else {
                let t = self.transfers.remove(i);
                let bytes = if t.is_bad {
                    Err(FetchError::Unreachable {
                        piece: t.piece,
                        place: "the simulated link".to_owned(),
                        problem: if self.is_down {
                            "it is cut"
                        } else {
                            "an error at random"
                        }
                        .to_owned(),
                    })
                } else {
                    Ok(self
                        .contents
                        .get(t.piece.idx())
                        .cloned()
                        .unwrap_or_default())
                };
                self.done.push(Reply {
                    piece: t.piece,
                    bytes,
                });
            }
        }
    }

    /// Returns a number in `0.0..1.0` (`SplitMix64`; Steele, Lea & Flood 2014).
    fn unit(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Returns a duration; `None` if it is too long or not a number.
fn seconds(x: f64) -> Option<Duration> {
    Duration::try_from_secs_f64(x).ok()
}

impl Source for SimulatedLink {
    fn request(&mut self, piece: PieceId) {
        let Some(&size) = self.sizes.get(piece.idx()) else {
            let place = "the simulated link".to_owned();
            let error = FetchError::Missing { piece, place };
            return self.done.push(Reply {
                piece,
                bytes: Err(error),
            });
        };
        let [bad, short, at] = [(); 3].map(|()| self.unit());
        let is_short = short < self.options.short_read_rate;
        let mut size = size as f64;
        let mut rest = if is_short { size * at } else { 0.0 };
        size -= rest;
        if self.is_down {
            (size, rest) = (0.0, 0.0);
        }
        self.transfers.push(Transfer {
            piece,
            begin: self.now + self.options.latency,
            left: size,
            rest,
            is_bad: self.is_down || bad < self.options.error_rate,
        });
    }

    fn cancel(&mut self, piece: PieceId) {
        self.transfers.retain(|t| t.piece != piece);
        self.done.retain(|r| r.piece != piece);
    }

    fn poll(&mut self, replies: &mut Vec<Reply>) {
        replies.append(&mut self.done);
    }
}
