//! What surrounds a bake: progress, stage times and the wish to stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::BakeError;

/// Hears of a bake's progress.
pub trait Progress: Sync {
    /// A stage begins; it is stage `index` of `count`.
    fn stage(&self, name: &'static str, index: usize, count: usize);
}

/// Nobody listens.
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _name: &'static str, _index: usize, _count: usize) {}
}

/// Carried through a bake. Threads come from the rayon pool that the bake is called in.
pub struct BakeContext<'a> {
    progress: &'a dyn Progress,
    cancel: Option<&'a AtomicBool>,
    times: Mutex<Vec<(&'static str, Duration)>>,
    running: Mutex<Option<(&'static str, Instant)>>,
}

/// The stages in order, as progress shows them.
pub(crate) const STAGES: [&str; 8] = [
    "voxelize",
    "distance",
    "flood",
    "merge basins",
    "fit screens",
    "cell complex",
    "cells and portals",
    "hand out geometry",
];

/// The stages of a bake by partition.
const BSP_STAGES: [&str; 5] = [
    "tree",
    "separators",
    "cell complex",
    "cells and portals",
    "hand out geometry",
];

/// The stages of a bake by tetrahedra.
const DELAUNAY_STAGES: [&str; 6] = [
    "tetrahedra",
    "decimation",
    "fit screens",
    "cell complex",
    "cells and portals",
    "hand out geometry",
];

/// Tells nobody, and is not stopped.
impl Default for BakeContext<'_> {
    fn default() -> Self {
        Self::new(&Silent, None)
    }
}

impl<'a> BakeContext<'a> {
    /// The names of the stages, in order, as [`Progress::stage`] hears them.
    pub const STAGES: &'static [&'static str] = &STAGES;
    /// The same of a bake by binary space partition.
    pub const BSP_STAGES: &'static [&'static str] = &BSP_STAGES;
    /// The same of a bake by Delaunay tetrahedra.
    pub const DELAUNAY_STAGES: &'static [&'static str] = &DELAUNAY_STAGES;

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

    /// Ends the stage under way and begins the next.
    pub(crate) fn stage(&self, index: usize) -> Result<(), BakeError> {
        self.stage_of(&STAGES, index)
    }

    /// The same among the stages of a bake by partition.
    pub(crate) fn bsp_stage(&self, index: usize) -> Result<(), BakeError> {
        self.stage_of(&BSP_STAGES, index)
    }

    /// The same among the stages of a bake by tetrahedra.
    pub(crate) fn delaunay_stage(&self, index: usize) -> Result<(), BakeError> {
        self.stage_of(&DELAUNAY_STAGES, index)
    }

    fn stage_of(&self, stages: &[&'static str], index: usize) -> Result<(), BakeError> {
        self.end_stage();
        if self.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            return Err(BakeError::Cancelled);
        }
        self.progress.stage(stages[index], index, stages.len());
        *self.running.lock().expect("no panic holds it") = Some((stages[index], Instant::now()));
        Ok(())
    }

    pub(crate) fn end_stage(&self) {
        if let Some((name, start)) = self.running.lock().expect("no panic holds it").take() {
            self.times
                .lock()
                .expect("no panic holds it")
                .push((name, start.elapsed()));
        }
    }

    /// Wall time of each stage so far.
    pub(crate) fn times(&self) -> Vec<(&'static str, Duration)> {
        self.times.lock().expect("no panic holds it").clone()
    }
}
