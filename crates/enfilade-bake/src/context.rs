//! What surrounds a bake: progress, stage times and the wish to stop.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use enfilade_geom::Allowance;

use crate::budget::WORK_A_VOXEL;
use crate::{BakeError, Budget, Method, Resolution, Stage};

/// Hears of a bake's progress.
pub trait Progress: Sync {
    /// A method begins; [`Method::Auto`] may ask for a second one after the first.
    fn method(&self, _method: Method, _reason: &str) {}

    /// A stage begins.
    fn stage(&self, stage: Stage);

    /// How fine the scene will be looked at, and the memory that this takes; told before it is taken. [Units: bytes]
    fn resolution(&self, _resolution: Resolution, _memory: f64) {}
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
    allowance: Allowance,
    budget: Budget,
    n_triangles: usize,
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
            allowance: Allowance::default(),
            budget: Budget::default(),
            n_triangles: 0,
        }
    }

    /// A context of its own for a bake of so many triangles, within a budget.
    pub(crate) fn within(&self, budget: &Budget, n_triangles: usize) -> Self {
        Self {
            allowance: budget.allowance(n_triangles),
            budget: *budget,
            n_triangles,
            ..Self::new(self.progress, self.cancel)
        }
    }

    /// What long loops may spend; once it is over, the next stage does not begin.
    pub(crate) fn allowance(&self) -> &Allowance {
        &self.allowance
    }

    /// Whether to go on with what is under way.
    ///
    /// # Errors
    /// When the caller cancels, and when the budget is spent.
    pub(crate) fn check(&self) -> Result<(), BakeError> {
        if self.cancel.is_some_and(|c| c.load(Ordering::Relaxed)) {
            return Err(BakeError::Cancelled);
        }
        if !self.allowance.is_over() {
            return Ok(());
        }
        let running = *self.running.lock().expect("no panic holds it");
        let stage = running.map_or(Stage::Structure, |(stage, _)| stage);
        Err(match self.budget.time {
            Some(time) => BakeError::TimeIsUp { stage, time },
            None => BakeError::TooMuchWork {
                stage,
                n_triangles: self.n_triangles,
            },
        })
    }

    /// Begins a method with its first stage.
    pub(crate) fn begin_method(&self, method: Method, reason: &str) -> Result<(), BakeError> {
        self.progress.method(method, reason);
        self.begin(Stage::Structure)
    }

    /// Tells how fine the scene will be looked at, and grants the work that its voxels are worth.
    pub(crate) fn tell(&self, resolution: Resolution, memory: f64) {
        // Memory bounds the voxels; what is open between them grows with their number, not with that of the triangles.
        if let Resolution::Voxels { dims, .. } = resolution {
            let n_voxels = dims.iter().map(|&n| n as u64).product::<u64>();
            self.allowance.grant(WORK_A_VOXEL * n_voxels);
        }
        self.progress.resolution(resolution, memory);
    }

    /// Ends the stage under way and begins the next.
    pub(crate) fn begin(&self, stage: Stage) -> Result<(), BakeError> {
        self.check()?;
        self.end_stage();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_of_many_voxels_may_do_more() {
        let context = BakeContext::default().within(&Budget::default(), 12);
        let of_triangles = Budget::default().allowance(12);
        let work = 100_000_000;
        assert!(!of_triangles.spend(work) && of_triangles.is_over());
        let dims = [700, 240, 880];
        context.tell(Resolution::Voxels { edge: 0.1, dims }, 0.0);
        context.allowance().spend(work);
        assert!(context.check().is_ok());
    }
}
