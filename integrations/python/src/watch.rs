//! Long work on a thread of its own, while the caller's thread reports progress and watches for interrupts.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Time between two looks for an interrupt.
const LOOK: Duration = Duration::from_millis(50);

/// A step of the work: its name, its number from 1 on, and the number of steps.
pub(crate) type Step = (&'static str, usize, usize);

/// Hands on steps, and hears whether the result is still wanted.
pub(crate) struct Watcher {
    /// Becomes true when the caller gives up.
    pub(crate) cancel: Arc<AtomicBool>,
    steps: Sender<Step>,
}

impl Watcher {
    /// Reports that a step begins.
    pub(crate) fn begin(&self, step: Step) {
        // Nobody listens after an interrupt.
        let _ = self.steps.send(step);
    }

    /// Returns `true` if the caller gave up.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }
}

/// Runs `work` in a pool of so many threads, one per core if not given.
///
/// # Errors
///
/// Of `progress`, or an interrupt; the work has then ended, too.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(Watcher) -> T + Send,
) -> PyResult<T> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|e| PyRuntimeError::new_err(format!("cannot start threads: {e}")))?;
    let cancel = Arc::new(AtomicBool::new(false));
    let (steps, heard) = channel::<Step>();
    let watcher = Watcher {
        cancel: Arc::clone(&cancel),
        steps,
    };
    let heard = std::sync::Mutex::new(heard);
    std::thread::scope(|scope| {
        // The sender of steps goes with the work, so that its end is heard at once.
        let worker = scope.spawn(|| pool.install(|| work(watcher)));
        let mut failed = None;
        loop {
            let next = py.detach(|| match heard.lock() {
                Ok(heard) => heard.recv_timeout(LOOK),
                Err(_) => Err(RecvTimeoutError::Disconnected),
            });
            let told = match (next, progress) {
                (Err(RecvTimeoutError::Disconnected), _) => break,
                (Ok(step), Some(progress)) if failed.is_none() => {
                    progress.call1(step).and_then(|_| py.check_signals())
                }
                _ => py.check_signals(),
            };
            if let Err(error) = told {
                cancel.store(true, Ordering::Relaxed);
                failed.get_or_insert(error);
            }
        }
        let done = py.detach(|| worker.join());
        match (failed, done) {
            (Some(error), _) => Err(error),
            (None, Ok(done)) => Ok(done),
            (None, Err(panic)) => std::panic::resume_unwind(panic),
        }
    })
}
