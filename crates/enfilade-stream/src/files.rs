//! Packed worlds on disk, and sources that read on threads of their own.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::head::{PackError, PackedHead};
use crate::{FetchError, PackedWorld, PieceId, Reply, Source};

/// Name of the head in the folder of a packed world.
pub const HEAD: &str = "head.enfp";
/// Name of the pieces in the folder of a packed world.
const PIECES: &str = "pieces.enfp";

/// Tries of a fetch before it is given up.
const TRIES: u32 = 4;
/// Wait before the second try; doubled before each further one.
const FIRST_WAIT: Duration = Duration::from_millis(50);

impl PackedWorld {
    /// Returns the files of its folder, by name.
    ///
    /// # Errors
    ///
    /// A world that breaks invariants.
    pub fn files(&self) -> Result<[(&'static str, Vec<u8>); 2], PackError> {
        Ok([(HEAD, self.head.encode()?), (PIECES, self.body.clone())])
    }

    /// Returns it as one file.
    ///
    /// # Errors
    ///
    /// As [`PackedWorld::files`].
    pub fn one_file(&self) -> Result<Vec<u8>, PackError> {
        let mut out = self.head.encode()?;
        out.extend_from_slice(&self.body);
        Ok(out)
    }
}

/// Place of a packed world on disk: a folder with a head and pieces, or one file with both.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedFiles {
    /// The file with the pieces.
    pub pieces: PathBuf,
    /// Offset of the first piece there. [Units: bytes]
    pub offset: u64,
}

impl PackedFiles {
    /// Opens a packed world: reads its head, and finds its pieces. Takes the memory of the head.
    ///
    /// # Errors
    ///
    /// A path without a packed world, damage.
    pub fn open(path: &Path) -> Result<(PackedHead, Self), PackError> {
        let in_one = !path.is_dir();
        let of_head = if in_one {
            path.to_owned()
        } else {
            path.join(HEAD)
        };
        let mut file = File::open(&of_head).map_err(|e| at(&of_head, &e))?;
        let mut bytes = Vec::new();
        let limited = (&mut file).take(64);
        read(limited, &mut bytes, &of_head)?;
        let n = PackedHead::size(&bytes)?;
        let limited = (&mut file).take(n.saturating_sub(bytes.len() as u64));
        read(limited, &mut bytes, &of_head)?;
        let head = PackedHead::decode(&bytes)?;
        let files = if in_one {
            Self {
                pieces: of_head,
                offset: n,
            }
        } else {
            Self {
                pieces: path.join(PIECES),
                offset: 0,
            }
        };
        Ok((head, files))
    }

    /// Returns `true` if a path looks like a packed world.
    #[must_use]
    pub fn is_packed(path: &Path) -> bool {
        let file = if path.is_dir() {
            path.join(HEAD)
        } else {
            path.to_owned()
        };
        let mut first = [0; 64];
        let n = File::open(file).and_then(|mut f| f.read(&mut first));
        n.is_ok_and(|n| PackedHead::size(&first[..n]).is_ok())
    }

    /// Reads a packed world whole.
    ///
    /// # Errors
    ///
    /// As [`PackedFiles::open`].
    pub fn read_all(path: &Path) -> Result<PackedWorld, PackError> {
        let (head, files) = Self::open(path)?;
        let mut file = File::open(&files.pieces).map_err(|e| at(&files.pieces, &e))?;
        let mut body = Vec::new();
        let start = file.seek(SeekFrom::Start(files.offset));
        start.map_err(|e| at(&files.pieces, &e))?;
        read(file, &mut body, &files.pieces)?;
        Ok(PackedWorld { head, body })
    }

    /// Returns a source of its pieces, which reads on a thread.
    #[must_use]
    pub fn source(&self, head: &Arc<PackedHead>) -> ThreadSource {
        let fetch = FileFetch {
            files: self.clone(),
            file: None,
        };
        ThreadSource::new(head, &self.pieces.display().to_string(), vec![fetch])
    }
}

fn read(mut from: impl Read, to: &mut Vec<u8>, path: &Path) -> Result<(), PackError> {
    from.read_to_end(to).map(|_| ()).map_err(|e| at(path, &e))
}

fn at(path: &Path, error: &std::io::Error) -> PackError {
    PackError::File {
        path: path.display().to_string(),
        problem: error.to_string(),
    }
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

/// Fetches from a file, which is opened anew after a failure.
#[derive(Debug)]
pub struct FileFetch {
    files: PackedFiles,
    file: Option<File>,
}

impl Fetch for FileFetch {
    fn fetch(&mut self, offset: u64, n: u64) -> Result<Vec<u8>, String> {
        let path = &self.files.pieces;
        let mut file = match self.file.take() {
            Some(file) => file,
            None => File::open(path).map_err(|e| e.to_string())?,
        };
        let start = self.files.offset.saturating_add(offset);
        let mut out = Vec::new();
        file.seek(SeekFrom::Start(start))
            .and_then(|_| (&mut file).take(n).read_to_end(&mut out))
            .map_err(|e| e.to_string())?;
        self.file = Some(file);
        Ok(out)
    }
}

/// Requests that wait, and pieces of which nobody wants to hear any more.
#[derive(Default)]
struct Waiting {
    /// The oldest first.
    queue: Vec<PieceId>,
    canceled: BTreeSet<PieceId>,
}

/// A source whose pieces are fetched, checked and unpacked by threads, each by its own [`Fetch`]. A fetch that fails is tried
/// again, four times in all, after 50, 100 and 200 ms.
pub struct ThreadSource {
    waiting: Arc<Mutex<Waiting>>,
    /// Wakes a thread; dropped to end them all.
    wake: Option<Sender<()>>,
    replies: Receiver<Reply>,
    threads: Vec<JoinHandle<()>>,
}

impl ThreadSource {
    /// Starts a thread for each of `fetches`. `place` names where the pieces are, for people.
    #[must_use]
    pub fn new<F: Fetch>(head: &Arc<PackedHead>, place: &str, fetches: Vec<F>) -> Self {
        let waiting = Arc::new(Mutex::new(Waiting::default()));
        let (wake, woken) = channel();
        let (reply, replies) = channel();
        let woken = Arc::new(Mutex::new(woken));
        let threads = fetches.into_iter().map(|fetch| {
            let mut worker = Worker {
                head: Arc::clone(head),
                place: place.to_owned(),
                waiting: Arc::clone(&waiting),
                woken: Arc::clone(&woken),
                reply: reply.clone(),
                fetch,
            };
            std::thread::spawn(move || worker.run())
        });
        let threads = threads.collect();
        Self {
            waiting,
            wake: Some(wake),
            replies,
            threads,
        }
    }
}

impl Source for ThreadSource {
    fn request(&mut self, piece: PieceId) {
        if let Ok(mut waiting) = self.waiting.lock() {
            waiting.canceled.remove(&piece);
            waiting.queue.push(piece);
        }
        if let Some(wake) = &self.wake {
            // Threads end only when this is dropped.
            let _ = wake.send(());
        }
    }

    fn cancel(&mut self, piece: PieceId) {
        if let Ok(mut waiting) = self.waiting.lock() {
            let n = waiting.queue.len();
            waiting.queue.retain(|p| *p != piece);
            if waiting.queue.len() == n {
                waiting.canceled.insert(piece);
            }
        }
    }

    fn poll(&mut self, replies: &mut Vec<Reply>) {
        replies.extend(self.replies.try_iter());
    }
}

impl Drop for ThreadSource {
    fn drop(&mut self) {
        self.wake = None;
        if let Ok(mut waiting) = self.waiting.lock() {
            waiting.queue.clear();
        }
        for thread in self.threads.drain(..) {
            // A thread that panicked has nothing left to do.
            let _ = thread.join();
        }
    }
}

/// A thread of a source.
struct Worker<F> {
    head: Arc<PackedHead>,
    place: String,
    waiting: Arc<Mutex<Waiting>>,
    woken: Arc<Mutex<Receiver<()>>>,
    reply: Sender<Reply>,
    fetch: F,
}

impl<F: Fetch> Worker<F> {
    fn run(&mut self) {
        while self.is_woken() {
            let next = self.waiting.lock().ok().and_then(|mut waiting| {
                let is_some = !waiting.queue.is_empty();
                is_some.then(|| waiting.queue.remove(0))
            });
            let Some(piece) = next else { continue };
            let bytes = self.piece(piece);
            let is_canceled = self
                .waiting
                .lock()
                .is_ok_and(|mut waiting| waiting.canceled.remove(&piece));
            if !is_canceled && self.reply.send(Reply { piece, bytes }).is_err() {
                return;
            }
        }
    }

    /// Waits for a request; returns `false` at the end.
    fn is_woken(&self) -> bool {
        let woken = self.woken.lock();
        woken.is_ok_and(|woken| woken.recv().is_ok())
    }

    fn piece(&mut self, piece: PieceId) -> Result<Vec<u8>, FetchError> {
        let place = || self.place.clone();
        let Some(at) = self.head.places.get(piece.idx()).copied() else {
            let place = place();
            return Err(FetchError::Missing { piece, place });
        };
        let n = self.head.catalog.pieces()[piece.idx()].n_packed;
        let mut last = FetchError::Missing {
            piece,
            place: place(),
        };
        let mut wait = FIRST_WAIT;
        for try_number in 0..TRIES {
            if try_number > 0 {
                std::thread::sleep(wait);
                wait *= 2;
            }
            let place = self.place.clone();
            last = match self.fetch.fetch(at.offset, n) {
                Ok(packed) => match self.head.expand(piece, &packed) {
                    Ok(bytes) => return Ok(bytes),
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
        Err(last)
    }
}
