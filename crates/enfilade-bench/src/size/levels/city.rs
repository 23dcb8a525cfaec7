//! The figures of Gjørup 1999, section 3.3.5: 1,500 segments, 10⁵ polygons, about 1 % of them visible, at the speed of a small
//! level.

use std::time::Instant;

use anyhow::Context;
use enfilade::geom::{Aabb, DVec3};
use enfilade::world::{PartId, SpaceViewer};
use enfilade::{Sight, SightState, View, Viewer, World};
use enfilade_testkit::Rng;

use super::scenes::level;
use crate::measure::quantile;
use crate::rows::Figure;

/// Views from random eyes in rooms.
const VIEWS: usize = 4_000;
/// Least distance of an eye from the box of its room. [Units: wu]
const BESIDE: f64 = 0.3;

/// Returns level views with random directions.
fn views(world: &World) -> anyhow::Result<Vec<View>> {
    let mut rng = Rng::new(3);
    let rooms: Vec<Aabb> = (world.graph.rooms())
        .map(|(_, c)| Aabb::of_points(&c.aabb.map(|p| DVec3::from_array(p.map(f64::from)))))
        .collect();
    let mut views = Vec::new();
    while views.len() < VIEWS {
        let room = rooms[rng.below(rooms.len())].expanded(-BESIDE);
        let eye = rng.point_in(&room);
        let angle = rng.range(0.0, std::f64::consts::TAU);
        let look = DVec3::new(angle.cos(), 0.0, angle.sin());
        let [eye, look] = [eye, look].map(|p| p.as_vec3().to_array());
        views.push(View::perspective(
            eye,
            look,
            [0.0, 1.0, 0.0],
            1.0,
            16.0 / 9.0,
        )?);
    }
    Ok(views)
}

/// Share of the triangles drawn on average. [Units: percent]
pub(super) fn visible(scene: &str) -> anyhow::Result<Figure> {
    let level = level(scene)?.level;
    let world = level.flattened()?;
    let sight = Sight::build(&world)?;
    let state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);
    let views = views(&world)?;
    let drawn: u64 = (views.iter())
        .map(|view| viewer.see(&sight, &state, view).n_triangles())
        .sum();
    let all = sight.n_triangles();
    let value = 100.0 * drawn as f64 / views.len() as f64 / all as f64;
    let note = format!("% of {all} triangles of {} segments", level.len());
    Ok(Figure::new(value, 1.0, note))
}

/// Microseconds of a view in one world, in multiples of those in a level of a tenth.
pub(super) fn frame(scene: &str) -> anyhow::Result<Figure> {
    compared(scene, &|scene| {
        let world = level(scene)?.level.flattened()?;
        let sight = Sight::build(&world)?;
        let state = SightState::new(&sight);
        let mut viewer = Viewer::new(&sight);
        timed(&views(&world)?, |view| {
            viewer.see(&sight, &state, view).cells().len()
        })
    })
}

/// Microseconds of a view in the space of instances, in multiples of those in a level of a tenth.
pub(super) fn frame_of_instances(scene: &str) -> anyhow::Result<Figure> {
    compared(scene, &|scene| {
        let level = level(scene)?.level;
        let views = views(&level.flattened()?)?;
        let space = level.space()?.space;
        let mut viewer = SpaceViewer::new(&space);
        timed(&views, |view| {
            viewer.see(&space, PartId::ROOT, view).parts().len()
        })
    })
}

/// Returns the median time of a view, each the fastest of five, as when the same place is viewed frame after frame. [Units: µs]
fn timed(views: &[View], mut see: impl FnMut(&View) -> usize) -> anyhow::Result<f64> {
    let mut seen = 0;
    let mut once = |view: &View| {
        let start = Instant::now();
        seen += see(view);
        start.elapsed().as_secs_f64() * 1e6
    };
    let of_five = |view: &View| (0..5).fold(f64::INFINITY, |t, _| t.min(once(view)));
    let mut times: Vec<f64> = views.iter().map(of_five).collect();
    anyhow::ensure!(seen > 0, "nothing is seen");
    Ok(quantile(&mut times, 0.5))
}

fn compared(scene: &str, measure: &dyn Fn(&str) -> anyhow::Result<f64>) -> anyhow::Result<Figure> {
    let (kind, n) = scene.rsplit_once('-').context("a kind and a number")?;
    let small = format!("{kind}-{}", n.parse::<usize>()? / 10);
    let (few, many) = (measure(&small)?, measure(scene)?);
    let note = format!("{many:.2} µs; {few:.2} µs in {small}");
    Ok(Figure::new(many / few, 1.2, note))
}
