//! The bake with tetrahedra: scene → tetrahedra → cells → rooms → screens → cell complex → world.

use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, Bvh};

use super::decimate::default_stop;
use super::rooms::find_rooms;
use super::session::{DelaunayConfig, Session};
use super::space::box_points;
use crate::assemble::Cut;
use crate::complex::{ComplexInput, LabelSettings, Vote, build_complex};
use crate::join::join_unparted;
use crate::pipeline::structural_triangles;
use crate::watershed::{OUTDOORS, bounds_of};
use crate::{BakeContext, BakeError, BakeOutput};

/// Air around the scene that the cell complex knows. [Units: wu]
const AROUND: f64 = 1.0;

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
