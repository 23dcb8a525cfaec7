//! The invariants of a graph and of a world, checked one by one.
//!
//! All readers of a graph rely on these: a decoded world satisfies them or is not returned, and a world that breaks
//! one is never written. All checks together take time near-linear in the size of the input, so that a few bytes of a
//! hostile file cannot take hours.

mod error;
mod extent;
mod facts;
mod fitting;
mod geometry;
mod locator;
mod origin;
mod portal;
mod special;
mod special_error;

use std::collections::HashMap;

use crate::{CellPortalGraph, PartNumbers, PortalId, Why, World};
use error::Findings;
use extent::{check_boxes_around_geometry, check_cells_in_locator};
use geometry::{check_cell_list, check_detail, check_mesh, check_primitive};
use locator::check_locator;
use portal::check_portal;
use special::check_specials;

pub use error::{GraphError, MAX_REPORTED};
pub use special_error::SpecialProblem;

impl CellPortalGraph {
    /// Checks every invariant of the graph.
    ///
    /// Takes time near-linear in cells, portal vertices and locator nodes.
    ///
    /// # Errors
    ///
    /// The problems and their places, in the order of the lists; at most [`MAX_REPORTED`].
    pub fn validate(&self) -> Result<(), Vec<GraphError>> {
        let mut found = Findings::default();
        self.check(&mut found);
        found.into_result()
    }

    fn check(&self, found: &mut Findings) {
        check_cells(self, found);
        check_cell_portals(self, found);
        for (i, portal) in self.portals.iter().enumerate() {
            if found.is_full() {
                return;
            }
            check_portal(i as u32, portal, self.cells.len(), found);
        }
        check_specials(self, found);
        check_locator(&self.locator, self.cells.len(), found);
        check_outside(self, found);
        check_decisions(self, found);
        check_cells_in_locator(self, found);
        for (name, &value) in &self.statistics.counts {
            if !value.is_finite() {
                found.push(GraphError::Statistic {
                    name: name.clone(),
                    value,
                });
            }
        }
    }
}

impl World {
    /// Checks every invariant of the graph ([`CellPortalGraph::validate`]) and of its geometry.
    ///
    /// Takes time near-linear in the size of the world.
    ///
    /// # Errors
    ///
    /// The problems and their places; at most [`MAX_REPORTED`].
    pub fn validate(&self) -> Result<(), Vec<GraphError>> {
        let mut found = Findings::default();
        self.graph.check(&mut found);
        let n_cells = self.graph.cells.len();
        check_boxes_around_geometry(self, &mut found);
        for (i, batch) in self.batches.iter().enumerate() {
            let owner = || format!("batch {i}");
            check_cell_list(owner, &batch.cells, n_cells, &mut found);
            check_primitive(owner, &batch.primitive, self.materials.len(), &mut found);
        }
        for (i, mesh) in self.detail_meshes.iter().enumerate() {
            check_mesh(i, mesh, self.materials.len(), &mut found);
        }
        for (i, detail) in self.details.iter().enumerate() {
            check_detail(i, detail, n_cells, self.detail_meshes.len(), &mut found);
        }
        fitting::check(self, &mut |owner, problem| {
            found.push(GraphError::Fitting { owner, problem });
        });
        origin::check(self, &mut |owner, problem| {
            found.push(GraphError::Source { owner, problem });
        });
        let is_finite = self.leak_path.as_flattened().iter().all(|v| v.is_finite());
        if self.leak_path.len() == 1 || !is_finite {
            found.push(GraphError::LeakPath);
        }
        let pvs = self.pvs.as_ref().and_then(|p| p.problem(n_cells));
        if let Some((cell, problem)) = pvs {
            found.push(GraphError::Pvs { cell, problem });
        } else if let Some((cells, problem)) =
            (self.pvs.as_ref()).and_then(|p| p.pair_problem(PartNumbers::new(self).n_parts()))
        {
            found.push(GraphError::PvsPair { cells, problem });
        }
        let facts = (self.room_facts.as_ref()).and_then(|f| facts::problem(f, &self.graph));
        if let Some((cell, problem)) = facts {
            found.push(GraphError::RoomFacts {
                cell: cell.0,
                problem,
            });
        }
        crate::look::check(self, &mut |owner, problem| {
            found.push(GraphError::Look { owner, problem });
        });
        found.into_result()
    }
}

/// Checks that all numbers of decisions are finite.
fn check_decisions(graph: &CellPortalGraph, found: &mut Findings) {
    let is_finite = |why: &Why| {
        let mut numbers = why.facts.values().chain(&why.limit);
        numbers.all(|x| x.is_finite())
    };
    let mut check = |owner: &dyn Fn() -> String, is_right: bool| {
        if !is_right && !found.is_full() {
            found.push(GraphError::Decision { owner: owner() });
        }
    };
    for (i, cell) in graph.cells.iter().enumerate() {
        check(&|| format!("cell {i}"), cell.why.iter().all(is_finite));
    }
    for (i, portal) in graph.portals.iter().enumerate() {
        check(&|| format!("portal {i}"), portal.why.iter().all(is_finite));
    }
    for (i, place) in graph.places.iter().enumerate() {
        let is_right = is_finite(&place.why) && place.at.iter().all(|x| x.is_finite());
        check(&|| format!("place {i}"), is_right);
    }
}

fn check_cells(graph: &CellPortalGraph, found: &mut Findings) {
    let mut first_of_name = HashMap::with_capacity(graph.cells.len());
    let mut outdoors = None;
    for (i, cell) in graph.cells.iter().enumerate() {
        let i = i as u32;
        if let Some(first) = first_of_name.insert(cell.name.as_str(), i) {
            found.push(GraphError::DuplicateName {
                first,
                second: i,
                name: cell.name.clone(),
            });
        }
        if cell.outdoor {
            if let Some(first) = outdoors {
                found.push(GraphError::TwoOutdoors { first, second: i });
            }
            outdoors = outdoors.or(Some(i));
            if cell.is_void {
                found.push(GraphError::OutdoorVoid { cell: i });
            }
        }
        let [min, max] = cell.aabb;
        let ordered = (0..3).all(|k| min[k].is_finite() && max[k].is_finite() && min[k] <= max[k]);
        if !ordered || !cell.volume.is_finite() || cell.volume < 0.0 {
            let (aabb, volume) = (cell.aabb, cell.volume);
            found.push(GraphError::CellExtent {
                cell: i,
                aabb,
                volume,
            });
        }
    }
}

/// The space beyond the locator's box is the outdoors, if there is one; otherwise no cell.
fn check_outside(graph: &CellPortalGraph, found: &mut Findings) {
    let outside = graph.locator.outside.map(|c| c.0);
    let outdoors = graph.cells.iter().position(|c| c.outdoor);
    let outdoors = outdoors.map(|i| i as u32);
    // A graph without a locator does not place its outdoors.
    let says = outside.is_some() || !graph.locator.bounds.is_empty();
    if says && outside != outdoors {
        found.push(GraphError::OutsideOutdoors { outside, outdoors });
    }
}

fn check_cell_portals(graph: &CellPortalGraph, found: &mut Findings) {
    let mut actual: Vec<Vec<PortalId>> = vec![Vec::new(); graph.cells.len()];
    for (i, portal) in graph.portals.iter().enumerate() {
        let [a, b] = portal.cells;
        for id in if a == b {
            &portal.cells[..1]
        } else {
            &portal.cells[..]
        } {
            if let Some(list) = actual.get_mut(id.0 as usize) {
                list.push(PortalId(i as u32));
            }
        }
    }
    for (i, (cell, actual)) in graph.cells.iter().zip(&actual).enumerate() {
        if cell.portals != *actual {
            let same = cell
                .portals
                .iter()
                .zip(actual)
                .take_while(|(a, b)| a == b)
                .count();
            let rest = |list: &[PortalId]| list[same..].iter().take(8).map(|p| p.0).collect();
            found.push(GraphError::CellPortals {
                cell: i as u32,
                listed: rest(&cell.portals),
                actual: rest(actual),
            });
        }
    }
}
