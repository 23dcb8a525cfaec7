//! What surrounds a bake: progress, stage times and the wish to stop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use enfilade_geom::{Allowance, End, MemoryProbe};

use crate::{BakeError, Budget, Method, Resolution, Stage};

/// Memory of the complex for each structural triangle, more or less. [Units: bytes]
const BYTES_A_TRIANGLE: f64 = 5e3;

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

/// What the stages so far took.
#[derive(Default)]
struct Stages {
    times: Vec<(Stage, Duration)>,
    work: Vec<(Stage, u64)>,
    /// The stage under way, when it began, and what was spent before.
    running: Option<(Stage, Instant, u64)>,
}

/// Carried through a bake. Threads come from the rayon pool that the bake is called in.
pub struct BakeContext<'a> {
    progress: &'a dyn Progress,
    cancel: Option<&'a AtomicBool>,
    probe: Option<MemoryProbe>,
    stages: Mutex<Stages>,
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
            probe: None,
            stages: Mutex::default(),
            allowance: Allowance::default(),
            budget: Budget::default(),
            n_triangles: 0,
        }
    }

    /// Adds what tells the memory that the process holds: a bake ends then when it holds more than [`Budget::memory`].
    #[must_use]
    pub fn measured_by(mut self, probe: MemoryProbe) -> Self {
        self.probe = Some(probe);
        self
    }

    /// A context of its own for a bake of so many triangles, within a budget.
    pub(crate) fn within(&self, budget: &Budget, n_triangles: usize) -> Self {
        Self {
            allowance: budget.allowance(n_triangles, self.probe),
            probe: self.probe,
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
        let Some(end) = self.allowance.end() else {
            return Ok(());
        };
        let running = self.stages().running;
        let stage = running.map_or(Stage::Structure, |(stage, ..)| stage);
        Err(match end {
            End::Time => BakeError::TimeIsUp {
                stage,
                time: self.budget.time.unwrap_or_default(),
            },
            End::Memory => BakeError::TooMuchMemory {
                stage,
                memory: self.budget.memory.unwrap_or_default(),
            },
            End::Work => BakeError::TooMuchWork {
                stage,
                n_triangles: self.n_triangles,
                spent: self.allowance.spent(),
            },
        })
    }

    fn stages(&self) -> MutexGuard<'_, Stages> {
        self.stages.lock().expect("no panic holds it")
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
            self.grant_voxels(dims.iter().map(|&n| n as u64).product());
        }
        // What is held by now, the scene above all, stays; leaves of the complex come when the voxels have gone.
        let held = self.probe.and_then(|probe| probe()).unwrap_or(0) as f64;
        let of_complex = BYTES_A_TRIANGLE * self.n_triangles as f64;
        self.progress
            .resolution(resolution, held + memory.max(of_complex));
    }

    /// Grants the work that so many voxels are worth.
    pub(crate) fn grant_voxels(&self, n_voxels: u64) {
        self.allowance.grant(self.budget.work_of_voxels(n_voxels));
    }

    /// Ends the stage under way and begins the next.
    pub(crate) fn begin(&self, stage: Stage) -> Result<(), BakeError> {
        self.check()?;
        self.end_stage();
        self.progress.stage(stage);
        self.stages().running = Some((stage, Instant::now(), self.allowance.spent()));
        Ok(())
    }

    pub(crate) fn end_stage(&self) {
        let mut stages = self.stages();
        if let Some((stage, start, before)) = stages.running.take() {
            stages.times.push((stage, start.elapsed()));
            let work = self.allowance.spent().saturating_sub(before);
            stages.work.push((stage, work));
        }
    }

    /// Wall time of each stage so far.
    pub(crate) fn times(&self) -> Vec<(Stage, Duration)> {
        self.stages().times.clone()
    }

    /// What each stage so far has spent, see [`Allowance`].
    pub(crate) fn work(&self) -> Vec<(Stage, u64)> {
        self.stages().work.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_of_many_voxels_may_do_more() {
        let context = BakeContext::default().within(&Budget::default(), 12);
        let of_triangles = Budget::default().allowance(12, None);
        let work = 500_000_000;
        assert!(!of_triangles.spend(work) && of_triangles.is_over());
        let dims = [700, 240, 880];
        context.tell(Resolution::Voxels { edge: 0.1, dims }, 0.0);
        context.allowance().spend(work);
        assert!(context.check().is_ok());
    }
}
