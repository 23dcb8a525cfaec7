//! The state of decimation, which a bake runs through at once and a user step by step.

use std::sync::Mutex;

use enfilade_geom::scene::Scene;
use enfilade_geom::{Allowance, Bvh, DVec3, Triangle};

use super::branches::find_branches;
use super::cells::{Cells, divided_at_mouths, flow_together};
use super::decimate::{
    Decimation, Merging, RemainingPortal, Resolved, Rules, begun_before, decided, decimate,
    default_stop, remaining,
};
use super::limbs::RoomSpace;
use super::limits::{BYTES_A_POINT, Limits};
use super::space::{Space, divide_within};
use super::standing::{CellSpace, KnownBacks, LargestParts, count_rooms};
use crate::budget::n_structural;
use crate::config::{Choices, Weight};
use crate::structure::{Structure, in_own_order};
use crate::tubes::Walls;
use crate::{BakeConfig, BakeContext, BakeError, Method, Stage};

/// The state of decimation, for a user to inspect and overrule.
pub struct Session {
    /// The tetrahedra and the ways between them.
    pub space: Space,
    /// Cells before the first step.
    pub cells: Cells,
    /// The steps.
    pub decimation: Decimation,
    /// The choices of that decimation, and the portals that they are about.
    resolved: Vec<Resolved>,
    /// The same decimation in progress, a little before the step of which the portals were asked for last.
    begun: Mutex<Option<Merging>>,
    /// Structural triangles that bound rooms: all but stairs.
    pub(super) walls: Vec<Triangle>,
    /// BVH of the walls.
    pub(super) bvh: Bvh,
    /// For [`CellSpace`].
    largest: LargestParts,
    known_backs: KnownBacks,
    pub(super) closures: Vec<Triangle>,
    pub(super) stairs: Bvh,
    /// The smallest hole. [Units: wu]
    pub(super) hole: f64,
}

impl Session {
    /// Divides the air of a scene and decimates. `config` is that of a bake by [`Method::Delaunay`].
    ///
    /// # Errors
    /// If nothing is structural, a coordinate is out of limits, or the caller cancels.
    pub fn begin(
        scene: &Scene,
        config: &BakeConfig,
        context: &BakeContext<'_>,
    ) -> Result<Self, BakeError> {
        let context = &context.within(&config.budget, n_structural(scene));
        let method = Method::Delaunay;
        context.begin_method(method, "as requested")?;
        let structure = Structure::of(scene, method, config, context.allowance())?;
        let session = Self::of(&structure, config, context)?;
        context.check()?;
        Ok(session)
    }

    pub(super) fn of(
        structure: &Structure<'_>,
        config: &BakeConfig,
        context: &BakeContext<'_>,
    ) -> Result<Self, BakeError> {
        context.begin(Stage::Tetrahedra)?;
        config.check_opening()?;
        // The result must not depend on the order of triangles in a file.
        let walls = in_own_order(&structure.walls);
        let bvh = Bvh::build(&walls);
        let mut closures = Vec::new();
        structure.for_blockers(&bvh, |own| closures.extend(own));
        let closures = in_own_order(&closures);
        let shut = [closures.clone(), in_own_order(&structure.missing)].concat();
        let space = divide_within(
            &walls,
            &shut,
            &bvh,
            config.min_opening,
            &Limits {
                n_points: config
                    .budget
                    .points(structure.triangles.len(), BYTES_A_POINT),
                allowance: context.allowance(),
            },
        )?;
        context.begin(Stage::Decimation)?;
        let cells = with_branches(
            &space,
            flow_together(&space),
            [config.min_opening, config.merge.min_radius],
            &Walls {
                triangles: &walls,
                bvh: &bvh,
            },
            context.allowance(),
        );
        let mut session = Self {
            largest: LargestParts::of(&space, &cells),
            known_backs: KnownBacks::default(),
            space,
            cells,
            decimation: Decimation {
                n_cells: 0,
                steps: Vec::new(),
                stop: 0,
            },
            resolved: Vec::new(),
            begun: Mutex::new(None),
            walls,
            bvh,
            closures,
            stairs: Bvh::build(&structure.stairs),
            hole: structure.hole.gap(),
        };
        session.decimate_within(config, context.allowance());
        Ok(session)
    }

    /// Returns the number of rooms left after the first `n_steps`, which is the number of cells indoors that
    /// [`bake_session`](crate::bake_session) makes of them, and the number of other cells: crevices, and interiors of
    /// walls, which are dropped.
    ///
    /// `O(n log n)` in the initial cells, and rays from the rooms that no count before had: milliseconds, and a fraction of a
    /// second for the first.
    #[must_use]
    pub fn count_rooms(&self, n_steps: usize, config: &BakeConfig) -> [usize; 2] {
        let room_of_cell = self.decimation.after(n_steps);
        let least = config.merge.min_radius;
        count_rooms(&self.air(), &room_of_cell, least, &self.known_backs)
    }

    pub(super) fn air(&self) -> CellSpace<'_> {
        CellSpace {
            space: &self.space,
            cells: &self.cells,
            bvh: &self.bvh,
            largest: &self.largest,
        }
    }

    /// Returns the portals left after the first `n_steps`, with their weights at that step. `config` is that of the last
    /// decimation. Takes milliseconds.
    #[must_use]
    pub fn remaining(&self, n_steps: usize, config: &BakeConfig) -> Vec<RemainingPortal> {
        // A poisoned lock only costs the time to begin anew.
        let mut begun = self.begun.lock().ok();
        let earlier = begun.as_mut().and_then(|begun| begun.take());
        let to_cells = (&self.cells, rules_of(config));
        let merging = begun_before(earlier, to_cells.0, to_cells.1, &self.resolved, n_steps);
        if let Some(begun) = &mut begun {
            **begun = Some(merging.clone());
        }
        let record = (&self.decimation, &self.resolved[..]);
        remaining(&self.cells, merging, record.0, record.1, n_steps)
    }

    /// Returns the openings of a portal as convex polygons, without cracks, in which no portal is placed. [Units: wu]
    #[must_use]
    pub fn openings(&self, portal: &RemainingPortal) -> Vec<Vec<DVec3>> {
        let links = portal.links.iter().map(|&l| &self.space.links[l as usize]);
        let wide = links.filter(|link| !self.space.is_crack(link));
        wide.map(|link| self.space.outline(link).to_vec()).collect()
    }

    /// Decimates again, after other choices or with another weight or stop. Takes milliseconds.
    pub fn decimate(&mut self, config: &BakeConfig) {
        self.decimate_within(config, &Allowance::default());
    }

    fn decimate_within(&mut self, config: &BakeConfig, allowance: &Allowance) {
        let choices = &config.delaunay.choices;
        (self.decimation, self.resolved) =
            decided(&self.cells, rules_of(config), choices, allowance);
        self.begun = Mutex::new(None);
    }
}

fn rules_of(config: &BakeConfig) -> Rules {
    let own = &config.delaunay;
    Rules {
        weight: own.weight,
        stop: own.stop.unwrap_or_else(|| default_stop(own.weight)),
        min_radius: config.merge.min_radius,
    }
}

/// Divides cells where branches and corridors leave the rooms with which a decimation without choices ends.
fn with_branches(
    space: &Space,
    cells: Cells,
    [narrowest, min_radius]: [f64; 2],
    walls: &Walls<'_>,
    allowance: &Allowance,
) -> Cells {
    let weight = Weight::ScaleFree;
    let stop = default_stop(weight);
    let rooms = decimate(
        &cells,
        weight,
        stop,
        min_radius,
        &Choices::default(),
        allowance,
    );
    let room_of_cell = rooms.after(rooms.stop);
    let room = |&c: &u32| room_of_cell[c as usize];
    let room_of_part: Vec<u32> = cells.cell_of_part.iter().map(room).collect();
    let rooms = RoomSpace {
        space,
        walls,
        room_of_part: &room_of_part,
        allowance,
    };
    let branches = find_branches(space, &room_of_part, walls, allowance);
    let branches = branches.with_limbs(&rooms, narrowest, min_radius);
    if branches.is_empty() {
        cells
    } else {
        let branches = branches.without_leftovers(space, &cells.cell_of_part);
        divided_at_mouths(space, &cells, &branches)
    }
}
