//! The state of decimation, which a bake runs through at once and a user step by step.

use std::collections::BTreeSet;
use std::sync::Mutex;

use enfilade_geom::scene::Scene;
use enfilade_geom::{Allowance, Bvh, DVec3};

use super::branches::find_branches;
use super::cells::{Cells, divided_at_mouths, flow_together};
use super::decimate::{
    Decimation, Merging, RemainingPortal, Resolved, Rules, begun_before, decided, decimate,
    default_stop, remaining,
};
use super::limits::{BYTES_A_POINT, Limits};
use super::space::{Space, divide_within};
use super::voxels::CellVoxels;
use crate::budget::n_structural;
use crate::config::{Choices, Weight};
use crate::rooms::{self, VoxelRooms};
use crate::structure::{OUTDOORS, Structure, in_own_order};
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
    /// The cells in voxels.
    voxels: CellVoxels,
    /// All structural triangles.
    surfaces: Bvh,
}

impl Session {
    /// Divides the air of a scene and decimates. `config` is that of a bake by [`Method::Delaunay`].
    ///
    /// # Errors
    /// If nothing is structural, a coordinate is out of limits, the scene is too large for the voxel budget, or the caller cancels.
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
        let allowance = context.allowance();
        context.begin(Stage::Tetrahedra)?;
        config.check_opening()?;
        // The result must not depend on the order of triangles in a file.
        let triangles = &in_own_order(&structure.walls);
        let bvh = &Bvh::build(triangles);
        let walls = Walls { triangles, bvh };
        let closures = in_own_order(&structure.blockers(bvh));
        let shut = [closures, in_own_order(&structure.missing)].concat();
        let budget = &config.budget;
        let limits = Limits {
            n_points: budget.points(structure.triangles.len(), BYTES_A_POINT),
            allowance,
        };
        let space = divide_within(triangles, &shut, bvh, config.min_opening, &limits)?;
        let air = rooms::prepare(structure, config, context)?;
        context.begin(Stage::Decimation)?;
        let voxels_of = |cells: &Cells, air| CellVoxels::of(&space, cells, bvh, air, allowance);
        let cells = flow_together(&space);
        let room_of_cell = rooms_of(&cells, config, allowance);
        let room_of_part = cells.cell_of_part.iter();
        let room_of_part: Vec<u32> = room_of_part.map(|&c| room_of_cell[c as usize]).collect();
        let mut voxels = voxels_of(&cells, air.clone());
        let branches = find_branches(&space, &room_of_part, &walls, allowance).with_limbs(
            &space,
            voxels.of_rooms(&room_of_cell),
            &walls,
            &config.merge,
            allowance,
        );
        let cells = if branches.is_empty() {
            cells
        } else {
            let branches = branches.without_leftovers(&space, &cells.cell_of_part);
            let cells = divided_at_mouths(&space, &cells, &branches);
            voxels = voxels_of(&cells, air);
            cells
        };
        let mut session = Self {
            space,
            cells,
            decimation: Decimation {
                n_cells: 0,
                steps: Vec::new(),
                stop: 0,
            },
            resolved: Vec::new(),
            begun: Mutex::new(None),
            voxels,
            surfaces: Bvh::build(&structure.triangles),
        };
        session.decimate_within(config, allowance);
        Ok(session)
    }

    /// Returns the rooms left after the first `n_steps`, in voxels.
    pub(super) fn rooms_after(&self, n_steps: usize) -> VoxelRooms {
        self.voxels.of_rooms(&self.decimation.after(n_steps))
    }

    /// Returns the number of rooms left after the first `n_steps`, which is the number of cells indoors that
    /// [`bake_session`](crate::bake_session) makes of them, and the number of other cells: crevices, and interiors of
    /// walls, which are dropped.
    ///
    /// Linear in voxels, and rays from each room: a fraction of a second.
    #[must_use]
    pub fn count_rooms(&self, n_steps: usize, config: &BakeConfig) -> [usize; 2] {
        let rooms = self.rooms_after(n_steps);
        let least = config.merge.min_radius;
        let matter = rooms.matter(&self.surfaces, least, &Allowance::default());
        let all: BTreeSet<u32> = rooms.regions.region_of_basin.into_iter().collect();
        let n = all.range(OUTDOORS + 1..).count();
        let n_matter = matter.regions.len();
        [n - n_matter, n_matter]
    }

    /// Returns the portals left after the first `n_steps`, with their weights at that step. `config` is that of the last
    /// decimation. Takes milliseconds.
    #[must_use]
    pub fn remaining(&self, n_steps: usize, config: &BakeConfig) -> Vec<RemainingPortal> {
        // A poisoned lock only costs the time to begin anew.
        let mut begun = self.begun.lock().ok();
        let earlier = begun.as_mut().and_then(|begun| begun.take());
        let to_cells = (&self.cells, rules_of(config));
        let merging = begun_before(earlier, to_cells, &self.resolved, n_steps);
        if let Some(begun) = &mut begun {
            **begun = Some(merging.clone());
        }
        let record = (&self.decimation, &self.resolved[..]);
        remaining(&self.cells, merging, record, n_steps)
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

/// Returns the room of each cell with which a decimation without choices ends.
fn rooms_of(cells: &Cells, config: &BakeConfig, allowance: &Allowance) -> Vec<u32> {
    let weight = Weight::ScaleFree;
    let stop = default_stop(weight);
    let least = config.merge.min_radius;
    let rooms = decimate(cells, weight, stop, least, &Choices::default(), allowance);
    rooms.after(rooms.stop)
}
