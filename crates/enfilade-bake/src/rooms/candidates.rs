//! Fits a candidate portal to each opening between two regions.

use enfilade_geom::{Allowance, Bvh, DVec3, Triangle};
use rayon::prelude::*;

use super::fronts::{
    Faces, WORK_A_FACE as PATCH_WORK_A_FACE, connected_patches, face_center, front_of, is_in,
    without_corners,
};
use super::lids::Lids;
use super::regions::Regions;
use crate::structure::{Candidate, fit_candidate};
use crate::voxel::{Grid, Labels, SparseVolume};

/// Smaller openings, in voxel faces, are left to the complex, which finds them as cracks.
const MIN_FACES: usize = 4;

/// Cost of fitting a candidate, in units of [`Allowance`], plus that of each face of its opening.
const WORK: u64 = 100;
const WORK_A_FACE: u64 = 5;

/// Fits a candidate to each opening, among `walls`. `closures` are the voxels that door leaves and panes fill; a front
/// with at least the share `closed_share` of them is a pane, and is split where it bends. Slits narrower than
/// `hole` count as closed.
pub(super) fn fit_candidates(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    (closures, lids): (&SparseVolume, &Lids),
    walls: &[Triangle],
    [closed_share, hole]: [f64; 2],
    allowance: &Allowance,
) -> Vec<Candidate> {
    let bvh = Bvh::build(walls);
    let is_shut = |faces: &[u64]| {
        let n = faces.iter().filter(|&&f| is_in(grid, closures, f)).count();
        n as f64 >= closed_share * faces.len() as f64
    };
    let patches = |faces: &[u64]| -> Vec<Faces> {
        if !allowance.spend(PATCH_WORK_A_FACE * faces.len() as u64) {
            return Vec::new();
        }
        let whole = connected_patches(grid, faces).into_iter();
        let parts = whole.flat_map(|patch| {
            if is_shut(&patch) {
                without_corners(grid, patch)
            } else {
                vec![patch]
            }
        });
        parts.filter(|patch| patch.len() >= MIN_FACES).collect()
    };
    let openings: Vec<([u32; 2], Faces)> = regions
        .contacts
        .iter()
        .flat_map(|(&(a, b), faces)| patches(faces).into_iter().map(move |patch| ([a, b], patch)))
        .collect();
    let candidate = |(pair, faces): ([u32; 2], Faces)| {
        // Measured: a picture of the opening, many times finer than its faces.
        if !allowance.spend(WORK + WORK_A_FACE * faces.len() as u64) {
            return None;
        }
        if let Some(lid) = lids.candidate_of(grid, &faces) {
            return Some(lid);
        }
        let is_lesser = |at| regions.region_of_basin[labels.at(at) as usize] == pair[0];
        let front = front_of(grid, faces, &is_lesser, Some(closures));
        let centers: Vec<DVec3> = front.faces.iter().map(|&f| face_center(grid, f)).collect();
        let opening = &front.opening;
        Some(fit_candidate(
            &centers, grid.voxel, opening, walls, &bvh, hole, allowance,
        ))
    };
    openings.into_par_iter().filter_map(candidate).collect()
}
