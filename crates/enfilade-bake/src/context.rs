//! The context of a bake: progress, stage times and cancellation.

use std::fmt;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use enfilade_geom::{Allowance, AllowanceEnd, Instant, MemoryProbe};

use crate::{BakeError, Budget, Method, Pieces, Resolution, Stage};

/// Approximate memory of the complex for each structural triangle, from bakes of 20 buildings of 300 to 40,000. [Units: bytes]
const BYTES_A_TRIANGLE: f64 = 3.5e3;
/// … and for those beyond so many: larger models repeat their storeys, of simple walls. From towers of 100,000 and 775,000.
const BYTES_A_FURTHER: f64 = 700.0;
const MANY: f64 = 40_000.0;

/// Receives the progress of a bake.
pub trait Progress: Sync {
    /// Called when a method begins; a bake that chooses it may use a second one after the first.
    fn method(&self, _method: Method, _reason: &str) {}

    /// Called when a stage begins.
    fn stage(&self, stage: Stage);

    /// Receives the resolution of a bake, and the most memory that the process will hold, about, before the voxels are there.
    /// [Units: bytes]
    fn resolution(&self, _resolution: Resolution, _memory: f64) {}
}

/// Ignores all progress.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _stage: Stage) {}
}

/// Time and work of the stages so far.
#[derive(Default)]
struct Stages {
    times: Vec<(Stage, Duration)>,
    work: Vec<(Stage, u64)>,
    /// The current stage, its start, and the work spent before.
    running: Option<(Stage, Instant, u64)>,
}

/// State carried through a bake. Threads come from the rayon pool in which the bake is called.
pub struct BakeContext<'a> {
    progress: &'a dyn Progress,
    cancel: Option<Arc<AtomicBool>>,
    probe: Option<MemoryProbe>,
    stages: Mutex<Stages>,
    allowance: Allowance,
    budget: Budget,
    n_triangles: usize,
    pieces: Option<&'a dyn Pieces>,
}

impl fmt::Debug for BakeContext<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BakeContext")
            .field("budget", &self.budget)
            .finish_non_exhaustive()
    }
}

/// Ignores progress, and cannot be canceled.
impl Default for BakeContext<'_> {
    fn default() -> Self {
        Self::new(&Silent, None)
    }
}

impl<'a> BakeContext<'a> {
    /// Makes a context that reports to `progress`, and whose bake ends within about a second after `cancel` becomes
    /// true, in the middle of a stage, too.
    #[must_use]
    pub fn new(progress: &'a dyn Progress, cancel: Option<Arc<AtomicBool>>) -> Self {
        Self {
            progress,
            allowance: Allowance::default().unless(cancel.clone()),
            cancel,
            probe: None,
            stages: Mutex::default(),
            budget: Budget::default(),
            n_triangles: 0,
            pieces: None,
        }
    }

    /// Adds a place for finished pieces: a bake then goes on from those that are there. See [`Pieces`].
    #[must_use]
    pub fn keeping(mut self, pieces: &'a dyn Pieces) -> Self {
        self.pieces = Some(pieces);
        self
    }

    pub(crate) fn pieces(&self) -> Option<&'a dyn Pieces> {
        self.pieces
    }

    /// Adds a probe of the process's memory: a bake then ends when that exceeds [`Budget::memory`].
    #[must_use]
    pub fn measured_by(mut self, probe: MemoryProbe) -> Self {
        self.probe = Some(probe);
        self
    }

    /// Makes a context for a bake of so many triangles, within a budget.
    pub(crate) fn within(&self, budget: &Budget, n_triangles: usize) -> Self {
        let allowance = budget.allowance(n_triangles, self.probe);
        Self {
            allowance: allowance.unless(self.cancel.clone()),
            probe: self.probe,
            budget: *budget,
            n_triangles,
            pieces: self.pieces,
            ..Self::new(self.progress, self.cancel.clone())
        }
    }

    /// Returns the allowance for long loops; once it is spent, the next stage does not begin.
    pub(crate) fn allowance(&self) -> &Allowance {
        &self.allowance
    }

    /// Checks if the bake may go on.
    ///
    /// # Errors
    /// If the caller cancels, or the budget is spent.
    pub(crate) fn check(&self) -> Result<(), BakeError> {
        let Some(end) = self.allowance.end() else {
            return Ok(());
        };
        let running = self.stages().running;
        let stage = running.map_or(Stage::Structure, |(stage, ..)| stage);
        Err(match end {
            AllowanceEnd::Time => BakeError::TimeIsUp {
                stage,
                time: self.budget.time.unwrap_or_default(),
            },
            AllowanceEnd::Memory => BakeError::TooMuchMemory {
                stage,
                memory: self.budget.bound(),
            },
            AllowanceEnd::Cancelled => BakeError::Cancelled,
            AllowanceEnd::Work => BakeError::TooMuchWork {
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

    /// Reports the resolution, and the memory by what the flood and the votes will take, and grants the work that its voxels are
    /// worth.
    pub(crate) fn tell(&self, resolution: Resolution, of_flood: f64, of_votes: f64) {
        // Memory bounds the voxels; the open space between them grows with their number, not with that of the
        // triangles.
        if let Resolution::Voxels { n_voxels, .. } = resolution {
            self.grant_voxels(n_voxels);
        }
        // Memory held by now, above all for the scene, stays; leaves of the complex and votes follow when the voxels are freed.
        let n = self.n_triangles as f64;
        let of_triangles = BYTES_A_TRIANGLE * n.min(MANY) + BYTES_A_FURTHER * (n - MANY).max(0.0);
        let of_complex = of_triangles + of_votes;
        let held = self.probe.and_then(|probe| probe()).unwrap_or(0) as f64;
        self.progress
            .resolution(resolution, held + of_flood.max(of_complex));
    }

    /// Grants the work that so many voxels are worth.
    pub(crate) fn grant_voxels(&self, n_voxels: u64) {
        self.allowance.grant(self.budget.work_of_voxels(n_voxels));
    }

    /// Ends the current stage and begins the next.
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
            let work = self.allowance.spent().saturating_sub(before);
            // A stage that is begun again, for another building, has one time.
            match stages.times.iter().position(|t| t.0 == stage) {
                Some(at) => {
                    stages.times[at].1 += start.elapsed();
                    stages.work[at].1 += work;
                }
                None => {
                    stages.times.push((stage, start.elapsed()));
                    stages.work.push((stage, work));
                }
            }
        }
    }

    /// Returns the wall time of each stage so far.
    pub(crate) fn times(&self) -> Vec<(Stage, Duration)> {
        self.stages().times.clone()
    }

    /// Returns the work that each stage so far has spent, see [`Allowance`].
    pub(crate) fn work(&self) -> Vec<(Stage, u64)> {
        self.stages().work.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancelled_bake_ends_in_the_middle_of_a_stage() {
        let cancel = Arc::new(AtomicBool::new(false));
        let context = BakeContext::new(&Silent, Some(Arc::clone(&cancel)));
        let context = context.within(&Budget::default(), 12);
        let work = 1 << 16;
        assert!(context.allowance().spend(work) && context.check().is_ok());
        cancel.store(true, std::sync::atomic::Ordering::Relaxed);
        assert!(!context.allowance().spend(work));
        assert!(matches!(context.check(), Err(BakeError::Cancelled)));
    }

    #[test]
    fn a_scene_of_many_voxels_may_do_more() {
        let context = BakeContext::default().within(&Budget::default(), 12);
        let of_triangles = Budget::default().allowance(12, None);
        let work = 500_000_000;
        assert!(!of_triangles.spend(work) && of_triangles.is_over());
        let dims = [700, 240, 880];
        let resolution = Resolution::Voxels {
            edge: 0.1,
            dims,
            n_grids: 1,
            n_voxels: dims.iter().product::<usize>() as u64,
        };
        context.tell(resolution, 0.0, 0.0);
        context.allowance().spend(work);
        assert!(context.check().is_ok());
    }
}
