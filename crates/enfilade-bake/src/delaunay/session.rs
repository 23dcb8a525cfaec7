//! A session: a scene's air divided and decimated, for a person to look at before anything is baked.

use enfilade_geom::scene::Scene;
use enfilade_geom::{Bvh, Triangle};

use super::branches::find_branches;
use super::cells::{Cells, divided_at_mouths, flow_together};
use super::decimate::{Choices, Decimation, Weight, decimate, default_stop};
use super::space::{Space, divide};
use crate::pipeline::{in_own_order, structural_triangles};
use crate::watershed::{closure_triangles, find_stairs};
use crate::{BakeConfig, BakeContext, BakeError};

/// Settings of a bake with tetrahedra; the defaults are meant for everything.
#[derive(Clone, Debug, Default)]
pub struct DelaunayConfig {
    /// What it shares with the watershed: the narrowest opening, the least radius of a room, how
    /// much of an opening a door leaf must fill.
    pub common: BakeConfig,
    /// How portals are weighed.
    pub weight: Weight,
    /// The weight at which decimation stops; `None` for the weight's own. [Limit: above 0]
    pub stop: Option<f64>,
    /// What a person decided.
    pub choices: Choices,
}

/// The state of decimation, for a person to look at and to overrule.
pub struct Session {
    /// The tetrahedra and the ways between them.
    pub space: Space,
    /// Cells before the first step.
    pub cells: Cells,
    /// The steps.
    pub decimation: Decimation,
    /// Structural triangles that bound rooms: all but stairs.
    pub(super) walls: Vec<Triangle>,
    /// Of the walls.
    pub(super) bvh: Bvh,
    /// Door leaves and panes: they narrow what is near them but bound no room.
    pub(super) closures: Vec<Triangle>,
    /// Stairs stand in rooms and bound none.
    pub(super) stairs: Bvh,
}

impl Session {
    /// Divides the air of a scene and decimates.
    ///
    /// # Errors
    /// When there is nothing structural, a coordinate is out of limits, or the caller cancels.
    pub fn begin(
        scene: &Scene,
        config: &DelaunayConfig,
        context: &BakeContext<'_>,
    ) -> Result<Self, BakeError> {
        context.delaunay_stage(0)?;
        let (sources, triangles) = structural_triangles(scene);
        if triangles.is_empty() {
            return Err(BakeError::NothingStructural {
                n_objects: scene.objects.len(),
            });
        }
        let opening = config.common.min_opening;
        if !(opening > 0.0 && opening.is_finite()) {
            return Err(BakeError::Setting {
                name: "min_opening",
                value: opening.to_string(),
                limit: "a number above 0",
            });
        }
        let is_stair = find_stairs(&sources, &triangles);
        let mut walls: Vec<Triangle> = triangles
            .iter()
            .zip(&is_stair)
            .filter(|t| !t.1)
            .map(|t| *t.0)
            .collect();
        let stairs: Vec<Triangle> = triangles
            .iter()
            .zip(&is_stair)
            .filter(|t| *t.1 && !walls.is_empty())
            .map(|t| *t.0)
            .collect();
        // Stairs alone have no room to stand in.
        if walls.is_empty() {
            walls.clone_from(&triangles);
        }
        let walls = in_own_order(&walls);
        let bvh = Bvh::build(&walls);
        let closures = in_own_order(&closure_triangles(scene, &bvh));
        let space = divide(&walls, &closures, &bvh, opening)?;
        context.delaunay_stage(1)?;
        let cells = with_branches(
            &space,
            flow_together(&space),
            config.common.merge.min_radius,
            &walls,
            &bvh,
        );
        let mut session = Self {
            space,
            cells,
            decimation: Decimation {
                n_cells: 0,
                steps: Vec::new(),
                stop: 0,
            },
            walls,
            bvh,
            closures,
            stairs: Bvh::build(&stairs),
        };
        session.decimate(config);
        Ok(session)
    }

    /// Decimates anew, after other choices or with another weight or stop. Takes milliseconds.
    pub fn decimate(&mut self, config: &DelaunayConfig) {
        let stop = config.stop.unwrap_or_else(|| default_stop(config.weight));
        self.decimation = decimate(
            &self.cells,
            config.weight,
            stop,
            config.common.merge.min_radius,
            &config.choices,
        );
    }
}

/// Cells, divided where branches leave the rooms that a decimation without choices ends with.
fn with_branches(
    space: &Space,
    cells: Cells,
    min_radius: f64,
    walls: &[Triangle],
    bvh: &Bvh,
) -> Cells {
    let weight = Weight::ScaleFree;
    let stop = default_stop(weight);
    let rooms = decimate(&cells, weight, stop, min_radius, &Choices::default());
    let room_of_cell = rooms.after(rooms.stop);
    let room = |&c: &u32| room_of_cell[c as usize];
    let room_of_part: Vec<u32> = cells.cell_of_part.iter().map(room).collect();
    let branches = find_branches(space, &room_of_part, walls, bvh);
    if branches.is_empty() {
        cells
    } else {
        let branches = branches.without_leftovers(space, &cells.cell_of_part);
        divided_at_mouths(space, &cells, &branches)
    }
}
