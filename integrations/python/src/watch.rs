//! Long work on a thread of its own, while the caller's thread reports progress and watches for interrupts.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread::Builder;
use std::time::{Duration, Instant};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Time between two looks for an interrupt.
const LOOK: Duration = Duration::from_millis(50);
/// Longest wait for work that is not wanted anymore: an interrupt is heard within a second.
const PATIENCE: Duration = Duration::from_millis(800);

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
/// An exception of `progress`, or an interrupt. The work has then ended, too, or ends by itself without being waited for: reading
/// files looks at no flag.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(Watcher) -> T + Send + 'static,
) -> PyResult<T> {
    let failed =
        |e: &dyn std::fmt::Display| PyRuntimeError::new_err(format!("cannot start threads: {e}"));
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|e| failed(&e))?;
    let cancel = Arc::new(AtomicBool::new(false));
    let (steps, heard) = channel::<Step>();
    let watcher = Watcher {
        cancel: Arc::clone(&cancel),
        steps,
    };
    // The sender of steps goes with the work, so that its end is heard at once.
    let worker = Builder::new().spawn(move || pool.install(|| work(watcher)));
    let worker = worker.map_err(|e| failed(&e))?;
    // A receiver must not be shared, and Python's lock is given back while it waits.
    let heard = Mutex::new(heard);
    let mut given_up: Option<(PyErr, Instant)> = None;
    loop {
        let next = py.detach(|| match heard.lock() {
            Ok(heard) => heard.recv_timeout(LOOK),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        let told = match (next, progress, &given_up) {
            (Err(RecvTimeoutError::Disconnected), ..) => break,
            (_, _, Some((_, since))) if since.elapsed() > PATIENCE => break,
            (_, _, Some(_)) => Ok(()),
            (Ok(step), Some(progress), None) => {
                progress.call1(step).and_then(|_| py.check_signals())
            }
            _ => py.check_signals(),
        };
        if let Err(error) = told {
            cancel.store(true, Ordering::Relaxed);
            given_up = Some((error, Instant::now()));
        }
    }
    match given_up {
        Some((error, _)) => Err(error),
        None => py
            .detach(|| worker.join())
            .map_err(|panic| std::panic::resume_unwind(panic)),
    }
}
