//! Answers of the run-time, in the checker's format.

use std::collections::HashMap;

use enfilade::cpg::World;
use enfilade::runtime::{SeeOptions, Sight, SightState, View, Viewer};
use enfilade_verify::{Seer, ViewAnswer, ViewQuery};

/// The run-time as the checker queries it: answers the views of `verify --sight` and of the tables.
pub struct Answers<'w> {
    sight: &'w Sight,
    state: SightState,
    /// For each chunk, the indices of its triangles in their batch.
    triangles: Vec<Vec<u32>>,
}

impl<'w> Answers<'w> {
    /// Finds the index of each chunk's triangles in their batch. Time and memory grow with the world's triangles.
    #[must_use]
    pub fn new(world: &World, sight: &'w Sight) -> Self {
        let mut numbers: Vec<HashMap<[u32; 3], Vec<u32>>> = Vec::new();
        for batch in &world.batches {
            let mut by_corners: HashMap<[u32; 3], Vec<u32>> = HashMap::new();
            for (i, t) in (0..).zip(batch.primitive.triples()) {
                by_corners.entry(*t).or_default().push(i);
            }
            numbers.push(by_corners);
        }
        let triangles = sight
            .chunks()
            .iter()
            .map(|c| {
                let first = c.first_index as usize;
                let indices = &sight.indices(c.batch)[first..first + c.n_indices as usize];
                indices
                    .as_chunks()
                    .0
                    .iter()
                    .filter_map(|t| numbers[c.batch as usize].get(t))
                    .flatten()
                    .copied()
                    .collect()
            })
            .collect();
        Self {
            sight,
            state: SightState::new(sight),
            triangles,
        }
    }

    /// Returns a seer that answers by portals, or by the view frustum alone if `options` is `None`.
    #[must_use]
    pub fn seer(&self, options: Option<SeeOptions>) -> Seer<'_> {
        let mut viewer = Viewer::with_options(self.sight, options.unwrap_or_default());
        Box::new(move |query: &ViewQuery, answer: &mut ViewAnswer<'_>| {
            let view =
                View::perspective(query.eye, query.toward, query.up, query.fov_y, query.aspect);
            // An impossible view gets no answer, and shows up as misses.
            let Ok(view) = view else { return };
            let seen = match options {
                Some(_) => viewer.see(self.sight, &self.state, &view),
                None => viewer.see_through_walls(self.sight, &view),
            };
            for c in seen.chunks() {
                let batch = self.sight.chunks()[c.0 as usize].batch;
                for &t in &self.triangles[c.0 as usize] {
                    answer.add_triangle(batch, t);
                }
            }
            for d in seen.details() {
                answer.add_detail(d.0);
            }
            for c in seen.cells() {
                answer.add_cell(c.0);
            }
        })
    }
}
