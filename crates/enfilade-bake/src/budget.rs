//! Limits on the resources of a bake, and the work that a scene is worth.

use std::time::Duration;

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Allowance, Instant, MemoryProbe};

/// Limits on the resources of a bake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Budget {
    /// Memory. Voxels and points are as many as fit; a bake that needs more is refused before it begins. Default:
    /// 8 GiB, 2 GiB where addresses have 32 bits, and less for few triangles: 2,000 of them get no more voxels or points than
    /// fit in 1 GiB. [Units: bytes]
    pub memory: Option<u64>,
    /// Time after which a bake is refused. Without it, a bake ends when its work is out of all proportion to its
    /// triangles and voxels, whatever the clock: the work of a minute for 2,000 triangles, and at least four times that
    /// of ordinary scenes.
    pub time: Option<Duration>,
    /// Start of that time; the start of the bake if not given.
    pub began: Option<Instant>,
    /// Work, in units of about 100 ns; the end of a bake then depends on no clock. Default, unless a time is given: the
    /// work that the triangles and voxels are worth.
    pub work: Option<u64>,
}

/// Default limit of a bake's memory. [Units: bytes]
const MEMORY: u64 = if IS_SMALL { 2 << 30 } else { 8 << 30 };
/// No program can hold more than 4 GiB: its memory is watched in any case, and a bake ends before that is gone.
const IS_SMALL: bool = cfg!(target_pointer_width = "32");

/// Work that any scene is worth, and additional work for each triangle, in units of [`Allowance`]. The most expensive
/// real scenes, a house by tetrahedra and a vessel by the partition, take a quarter of it; by the watershed, none takes
/// more than a tenth.
const WORK: u64 = 400_000_000;
const WORK_A_TRIANGLE: u64 = 200_000;

/// Work of a ray, or of another search in a tree: what a loop over such searches spends on each.
pub(crate) const WORK_A_LOOK: u64 = 10;

/// Additional work for each voxel.
const WORK_A_VOXEL: u64 = 5;

/// Voxels that any scene is worth, and additional ones for each triangle: a few triangles far apart are not worth
/// gigabytes.
const VOXELS: f64 = 120e6;
const VOXELS_A_TRIANGLE: f64 = 50e3;

/// Memory that points of any scene are worth, and additional memory for each triangle. None of six real buildings takes
/// more than four fifths of it. [Units: bytes]
const POINT_BYTES: u64 = 800_000_000;
const POINT_BYTES_A_TRIANGLE: u64 = 100_000;

impl Budget {
    /// Returns the allowance of a bake of so many triangles. Memory is watched if there is a probe.
    #[must_use]
    #[doc(hidden)]
    pub fn allowance(&self, n_triangles: usize, probe: Option<MemoryProbe>) -> Allowance {
        let work = match (self.work, self.time) {
            (Some(work), _) => work,
            (None, Some(_)) => u64::MAX,
            (None, None) => WORK + WORK_A_TRIANGLE * n_triangles as u64,
        };
        // A time too long to be represented is not a bound.
        let began = self.began.unwrap_or_else(Instant::now);
        let until = self.time.and_then(|t| began.checked_add(t));
        let allowance = Allowance::new(work, until);
        match (self.memory.or(IS_SMALL.then_some(MEMORY)), probe) {
            (Some(bytes), Some(probe)) => allowance.holding(bytes, probe),
            _ => allowance,
        }
    }

    /// Returns the memory beyond which a bake that is watched ends. [Units: bytes]
    pub(crate) fn bound(&self) -> u64 {
        self.memory.unwrap_or(MEMORY)
    }

    /// Returns the additional work for so many voxels.
    pub(crate) fn work_of_voxels(&self, n_voxels: u64) -> u64 {
        self.work.map_or(WORK_A_VOXEL * n_voxels, |_| 0)
    }

    /// Returns the largest number of voxels of `bytes_each` for so many triangles.
    pub(crate) fn voxels(&self, n_triangles: usize, bytes_each: f64) -> f64 {
        let worth = VOXELS + VOXELS_A_TRIANGLE * n_triangles as f64;
        match self.memory {
            Some(bytes) => bytes as f64 / bytes_each,
            None => worth.min(MEMORY as f64 / bytes_each),
        }
    }

    /// Returns the largest number of points of `bytes_each` on surfaces of so many triangles, not counting vertices.
    pub(crate) fn points(&self, n_triangles: usize, bytes_each: u64) -> usize {
        let worth = POINT_BYTES + POINT_BYTES_A_TRIANGLE * n_triangles as u64;
        (self.memory.unwrap_or(worth.min(MEMORY)) / bytes_each) as usize
    }
}

/// Returns the number of structural triangles of a scene.
pub(crate) fn n_structural(scene: &Scene) -> usize {
    let structural = scene.objects.iter().filter(|o| o.role == Role::Structural);
    let of_object = |o: &enfilade_geom::scene::Object| {
        let primitives = scene.meshes[o.mesh as usize].primitives.iter();
        primitives.map(|p| p.indices.len() / 3).sum::<usize>()
    };
    structural.map(of_object).sum()
}

#[cfg(test)]
mod tests {
    use enfilade_testkit::furnished_house;

    use super::*;
    use crate::{BakeConfig, BakeContext, BakeError, Method, Resolution, bake};

    fn baked(method: Method, budget: Budget) -> Result<Resolution, BakeError> {
        let config = BakeConfig {
            budget,
            ..BakeConfig::of(method)
        };
        let scene = furnished_house().scene;
        bake(&scene, &config, &BakeContext::default()).map(|baked| baked.resolution)
    }

    #[test]
    fn a_bake_ends_when_its_time_is_up() {
        for method in [Method::Watershed, Method::Bsp, Method::Delaunay] {
            let budget = Budget {
                time: Some(Duration::ZERO),
                ..Budget::default()
            };
            let error = baked(method, budget).unwrap_err();
            assert!(matches!(error, BakeError::TimeIsUp { .. }), "{error}");
            assert!(error.to_string().contains("--max-time"), "{error}");
            let budget = Budget {
                time: Some(Duration::MAX),
                ..Budget::default()
            };
            baked(method, budget).unwrap();
        }
    }

    #[test]
    fn voxels_are_as_many_as_fit_memory_and_too_few_are_refused() {
        let with = |memory| {
            baked(
                Method::Watershed,
                Budget {
                    memory: Some(memory),
                    ..Budget::default()
                },
            )
        };
        let edge = |resolution| match resolution {
            Resolution::Voxels { edge, n_voxels, .. } => {
                assert!(n_voxels > 0);
                edge
            }
            other => panic!("{other:?}"),
        };
        let fine = edge(with(8 << 30).unwrap());
        let coarse = edge(with(4_000_000).unwrap());
        assert!(coarse > 1.2 * fine, "{coarse} {fine}");
        let error = with(1000).unwrap_err();
        assert!(error.to_string().contains("--max-memory"), "{error}");
    }

    #[test]
    fn what_a_scene_is_worth_grows_with_its_triangles() {
        let budget = Budget::default();
        // The voxels of 2,000 triangles fit in a gibibyte.
        assert!(budget.voxels(2000, 3.0) * 3.0 < f64::from(1 << 30));
        assert!(budget.voxels(50_000, 3.0) > 1.6e9);
        assert!(budget.points(50_000, 5000) >= 1_000_000);
        assert!(budget.points(2_000, 5000) * 5000 <= 1 << 30);
        let small = budget.allowance(2000, None);
        assert!(!small.spend(u64::MAX / 2) && small.is_over());
    }
}
