//! What surrounds a bake: progress, stage times and the wish to stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::{BakeError, Method, Stage};

/// Hears of a bake's progress.
pub trait Progress: Sync {
    /// A method begins; [`Method::Auto`] may ask for a second one after the first.
    fn method(&self, _method: Method, _reason: &str) {}

    /// A stage begins.
    fn stage(&self, stage: Stage);
}

/// Nobody listens.
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _stage: Stage) {}
}

/// Carried through a bake. Threads come from the rayon pool that the bake is called in.
pub struct BakeContext<'a> {
    progress: &'a dyn Progress,
    cancel: Option<&'a AtomicBool>,
    times: Mutex<Vec<(Stage, Duration)>>,
    running: Mutex<Option<(Stage, Instant)>>,
}

/// Tells nobody, and is not stopped.
impl Default for BakeContext<'_> {
    fn default() -> Self {
        Self::new(&Silent, None)
    }
}

impl<'a> BakeContext<'a> {
    /// A context that tells `progress` and stops when `cancel` becomes true.
    #[must_use]
    pub fn new(progress: &'a dyn Progress, cancel: Option<&'a AtomicBool>) -> Self {
        Self {
            progress,
            cancel,
            times: Mutex::default(),
            running: Mutex::default(),
        }
    }

    /// Begins a method with its first stage.
    pub(crate) fn begin_method(&self, method: Method, reason: &str) -> Result<(), BakeError> {
        self.progress.method(method, reason);
        self.begin(Stage::Structure)
    }

    /// Ends the stage under way and begins the next.
    pub(crate) fn begin(&self, stage: Stage) -> Result<(), BakeError> {
        self.end_stage();
        if self.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            return Err(BakeError::Cancelled);
        }
        self.progress.stage(stage);
        *self.running.lock().expect("no panic holds it") = Some((stage, Instant::now()));
        Ok(())
    }

    pub(crate) fn end_stage(&self) {
        if let Some((stage, start)) = self.running.lock().expect("no panic holds it").take() {
            self.times
                .lock()
                .expect("no panic holds it")
                .push((stage, start.elapsed()));
        }
    }

    /// Wall time of each stage so far.
    pub(crate) fn times(&self) -> Vec<(Stage, Duration)> {
        self.times.lock().expect("no panic holds it").clone()
    }
}
