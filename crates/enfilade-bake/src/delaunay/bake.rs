//! The bake with tetrahedra: scene → tetrahedra → cells → rooms → screens → cell complex → world.

use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, Bvh, Triangle};

use super::branches::find_branches;
use super::decimate::{
    Cells, Choices, Decimation, Weight, decimate, default_stop, flow_together, parted,
};
use super::rooms::{count_rooms, find_rooms};
use super::space::{Space, box_points, divide};
use crate::assemble::Cut;
use crate::complex::{ComplexInput, LabelSettings, Vote, build_complex};
use crate::join::join_unparted;
use crate::pipeline::{in_own_order, structural_triangles};
use crate::watershed::{OUTDOORS, bounds_of, closure_triangles, find_stairs};
use crate::{BakeConfig, BakeContext, BakeError, BakeOutput};

/// Air around the scene that the cell complex knows. [Units: wu]
const AROUND: f64 = 1.0;

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
    pub(super) closures: Vec<Triangle>,
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
        // Stairs stand in rooms and bound none.
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
        // What is nothing but stairs has no others to stand in.
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

    /// How many rooms are left after the first `n_steps`, which is how many cells indoors [`bake_session`] makes of them,
    /// and how many cells besides: crevices, and the insides of walls, which are dropped.
    ///
    /// `O(n log n)` in the parts of the space; a fraction of a second.
    #[must_use]
    pub fn count_rooms(&self, n_steps: usize, config: &DelaunayConfig) -> [usize; 2] {
        count_rooms(
            &self.space,
            &self.cells,
            &self.decimation.after(n_steps),
            &self.bvh,
            config.common.merge.min_radius,
        )
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

/// Cells that end where branches leave the rooms that a decimation without choices comes to.
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
        parted(space, &cells, &branches)
    }
}

/// Votes for the outdoors between two boxes, with nothing between them. Tetrahedra there reach far beyond the outer box,
/// and so do their middles.
fn votes_around(inner: &Aabb, outer: &Aabb) -> impl Iterator<Item = Vote> {
    let [volume, less] = [outer, inner].map(|b| b.size().element_product());
    let middle = Aabb::new((inner.min + outer.min) * 0.5, (inner.max + outer.max) * 0.5);
    let points = box_points(&middle);
    let weight = ((volume - less) / points.len() as f64) as f32;
    points.into_iter().map(move |point| Vote {
        point,
        label: OUTDOORS,
        weight,
    })
}

/// Finds the rooms and doorways of a scene by tetrahedra.
///
/// Deterministic on any number of threads. About `O(n log n)` in the points that stand for the
/// surfaces, and in triangles.
///
/// # Errors
/// When there is nothing structural, a setting or coordinate is out of limits, or the caller cancels.
pub fn bake_delaunay(
    scene: &Scene,
    config: &DelaunayConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    let session = Session::begin(scene, config, context)?;
    bake_session(scene, &session, session.decimation.stop, config, context)
}

/// Makes a world of the rooms that are left after the first `n_steps` of a session's decimation.
///
/// # Errors
/// When the caller cancels.
pub fn bake_session(
    scene: &Scene,
    session: &Session,
    n_steps: usize,
    config: &DelaunayConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    context.delaunay_stage(2)?;
    let (sources, triangles) = structural_triangles(scene);
    let bvh = Bvh::build(&triangles);
    let merge = &config.common.merge;
    let rooms = find_rooms(
        session,
        &session.decimation.after(n_steps),
        merge.min_radius,
    );
    context.delaunay_stage(3)?;
    let windings: Vec<_> = rooms.screens.iter().map(|s| s.winding.clone()).collect();
    let bounds = bounds_of(&triangles);
    let around = bounds.expanded(AROUND);
    let complex = build_complex(&ComplexInput {
        triangles: &triangles,
        screens: &windings,
        bounds: around,
        gap: config.common.smallest_hole.gap(),
        has_seals: config.common.smallest_hole.has_seals(),
    });
    context.delaunay_stage(4)?;
    let mut votes = rooms.votes;
    votes.extend(votes_around(&bounds, &around));
    let settings = LabelSettings {
        keeps_closed: false,
        ..LabelSettings::default()
    };
    let mut partition = complex.partition(&votes, &settings);
    while join_unparted(&partition, &mut votes, &mut []) {
        partition = complex.partition(&votes, &settings);
    }
    let outward = complex.opening_tolerance();
    let counts = [
        ("tetrahedra", session.space.delaunay.n_finite as f64),
        ("finest", session.space.finest),
        ("passed_over", session.space.n_passed_over as f64),
        ("steps", n_steps as f64),
        ("screens", rooms.screens.len() as f64),
        ("leaves", complex.n_leaves() as f64),
    ];
    drop(complex);
    context.delaunay_stage(5)?;
    let leaks = partition.leaks.clone();
    let mut settings = config.common.to_settings();
    settings.insert("weight".to_owned(), format!("{:?}", config.weight));
    settings.insert(
        "stop".to_owned(),
        config
            .stop
            .unwrap_or_else(|| default_stop(config.weight))
            .to_string(),
    );
    let world = Cut {
        scene,
        sources: &sources,
        triangles: &triangles,
        bvh: &bvh,
        partition,
        screens: &rooms.screens,
        outward,
        closed_share: merge.closed_share,
    }
    .into_world("delaunay", settings, &counts);
    context.end_stage();
    Ok(BakeOutput {
        world,
        voxel: session.space.finest,
        dims: [0; 3],
        times: context.times(),
        leaks,
        notes: Vec::new(),
    })
}
