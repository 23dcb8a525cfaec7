//! Sources that fetch on threads of their own.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::{FetchError, PackedHead, PieceId, Reply, Source};

/// Tries of a fetch before it is given up.
const TRIES: u32 = 4;
/// Wait before the second try; doubled before each further one.
const FIRST_WAIT: Duration = Duration::from_millis(50);

/// Counts the tries of a fetch from 0, and waits before each but the first.
pub(crate) fn tries() -> impl Iterator<Item = u32> {
    (0..TRIES).inspect(|i| {
        if let Some(n_waits) = i.checked_sub(1) {
            std::thread::sleep(FIRST_WAIT * (1 << n_waits));
        }
    })
}

/// Fetches ranges of the packed pieces; may block, on a thread of its own.
pub trait Fetch: Send + 'static {
    /// Returns `n` bytes of the packed pieces from `offset` on, or fewer if there are no more.
    ///
    /// # Errors
    ///
    /// The problem, in words.
    fn fetch(&mut self, offset: u64, n: u64) -> Result<Vec<u8>, String>;
}

/// All requests of a source. A piece is in one of the three lists at most.
#[derive(Default)]
struct Requests {
    /// Pieces that wait for a thread, the oldest first.
    waiting: Vec<PieceId>,
    /// Pieces that a thread fetches, each with `true` if somebody still wants it.
    fetched: BTreeMap<PieceId, bool>,
    replies: Vec<Reply>,
    /// `true` once the source is dropped.
    is_over: bool,
}

/// The requests, and what wakes threads.
#[derive(Default)]
struct Shared {
    requests: Mutex<Requests>,
    woken: Condvar,
}

impl Shared {
    /// Each change is whole before anything can panic, so a panic elsewhere leaves nothing half done.
    fn requests(&self) -> MutexGuard<'_, Requests> {
        self.requests.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A source whose pieces are fetched, checked and unpacked by threads, each by its own [`Fetch`]. A fetch that fails is tried
/// again, four times in all, after 50, 100 and 200 ms. Dropping it does not wait for fetches under way: a thread ends with its
/// own.
pub struct ThreadSource {
    shared: Arc<Shared>,
}

impl fmt::Debug for ThreadSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ThreadSource").finish_non_exhaustive()
    }
}

impl ThreadSource {
    /// Starts a thread for each of `fetches`. `place` names where the pieces are, for people.
    #[must_use]
    pub fn new<F: Fetch>(head: &Arc<PackedHead>, place: &str, fetches: Vec<F>) -> Self {
        let shared = Arc::new(Shared::default());
        for fetch in fetches {
            let mut worker = Worker {
                head: Arc::clone(head),
                place: place.to_owned(),
                shared: Arc::clone(&shared),
                fetch,
            };
            std::thread::spawn(move || while worker.work() {});
        }
        Self { shared }
    }
}

impl Source for ThreadSource {
    fn request(&mut self, piece: PieceId) {
        let mut requests = self.shared.requests();
        if let Some(is_wanted) = requests.fetched.get_mut(&piece) {
            *is_wanted = true;
        } else if !requests.waiting.contains(&piece) {
            requests.waiting.push(piece);
            self.shared.woken.notify_one();
        }
    }

    fn cancel(&mut self, piece: PieceId) {
        let mut requests = self.shared.requests();
        requests.waiting.retain(|p| *p != piece);
        requests.replies.retain(|r| r.piece != piece);
        if let Some(is_wanted) = requests.fetched.get_mut(&piece) {
            *is_wanted = false;
        }
    }

    fn poll(&mut self, replies: &mut Vec<Reply>) {
        replies.append(&mut self.shared.requests().replies);
    }
}

impl Drop for ThreadSource {
    fn drop(&mut self) {
        self.shared.requests().is_over = true;
        self.shared.woken.notify_all();
    }
}

/// A thread of a source.
struct Worker<F> {
    head: Arc<PackedHead>,
    place: String,
    shared: Arc<Shared>,
    fetch: F,
}

impl<F: Fetch> Worker<F> {
    /// Waits for a request and ends it; returns `false` at the end of the source.
    fn work(&mut self) -> bool {
        let requests = self.shared.requests();
        let idle = |r: &mut Requests| !r.is_over && r.waiting.is_empty();
        let woken = self.shared.woken.wait_while(requests, idle);
        let mut requests = woken.unwrap_or_else(PoisonError::into_inner);
        if requests.is_over {
            return false;
        }
        let piece = requests.waiting.remove(0);
        requests.fetched.insert(piece, true);
        drop(requests);
        let bytes = self.piece(piece);
        let mut requests = self.shared.requests();
        if requests.fetched.remove(&piece) == Some(true) {
            // Without bytes it was given up, and then asked for again.
            match bytes {
                Some(bytes) => requests.replies.push(Reply { piece, bytes }),
                None => requests.waiting.insert(0, piece),
            }
        }
        true
    }

    fn is_wanted(&self, piece: PieceId) -> bool {
        let requests = self.shared.requests();
        !requests.is_over && requests.fetched.get(&piece) == Some(&true)
    }

    /// Fetches a piece; `None` if it is no longer wanted.
    fn piece(&mut self, piece: PieceId) -> Option<Result<Vec<u8>, FetchError>> {
        let place = || self.place.clone();
        let mut last = FetchError::Missing {
            piece,
            place: place(),
        };
        let Some(at) = self.head.places.get(piece.idx()).copied() else {
            return Some(Err(last));
        };
        let n = self.head.catalog.pieces()[piece.idx()].n_packed;
        for _ in tries() {
            if !self.is_wanted(piece) {
                return None;
            }
            let place = self.place.clone();
            last = match self.fetch.fetch(at.offset, n) {
                Ok(packed) => match self.head.expand(piece, &packed) {
                    Ok(bytes) => return Some(Ok(bytes)),
                    Err(problem) => FetchError::Damaged {
                        piece,
                        place,
                        problem,
                    },
                },
                Err(problem) => FetchError::Unreachable {
                    piece,
                    place,
                    problem,
                },
            };
        }
        Some(Err(last))
    }
}
