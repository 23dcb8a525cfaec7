//! A person rides a lift: `cargo run --release -p enfilade --example lift`.

#![allow(clippy::print_stdout)]

use std::error::Error;
use std::sync::Arc;

use enfilade::bake::{BakeConfig, BakeContext, bake};
use enfilade::geom::DVec3;
use enfilade::geom::scene::Scene;
use enfilade::world::{Agent, PartId, Pose, Space, SpaceViewer, Walker};
use enfilade::{View, World};
use enfilade_testkit::lift_tower;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // A tower and the cabin of its lift, baked apart; in a program of yours, `enfilade::open(path)?`.
    let models = lift_tower();
    let [tower, cabin] = [&models.tower.scene, &models.cabin.scene].map(baked);
    let (mut space, stops) = (Space::new(tower?)?, &models.stops);
    let lift = space.add_part(cabin?, PartId::ROOT, Pose::from_translation(stops[0]))?;

    // Somebody stands in the middle of the cabin.
    let agent = Agent::default();
    let eye = models.cabin_lamp.with_y(agent.eye);
    let mut walker = Walker::new(agent, lift, eye);
    let mut viewer = SpaceViewer::new(&space);

    // Up to the highest storey in three seconds; the walker comes along, and every storey is seen through the door.
    let top = stops[stops.len() - 1];
    let mut seen = Vec::new();
    for frame in 0..=180 {
        let at = stops[0].lerp(top, f64::from(frame) / 180.0);
        space.set_pose(lift, Pose::from_translation(at))?;
        walker.step(&space, DVec3::ZERO, 1.0 / 60.0);
        let view = ahead(&walker)?;
        let answer = viewer.see(&space, walker.frame, &view);
        let cells = answer.of_part(PartId::ROOT).map_or(0, |s| s.cells().len());
        seen.push(cells);
    }
    assert_eq!(walker.frame, lift);
    let height = space.between(lift, PartId::ROOT).point(walker.feet()).y;
    println!(
        "rode up to {height:.2} m; {} frames saw the tower",
        seen.iter().filter(|n| **n > 0).count()
    );
    assert!((height - top.y).abs() < 0.02);

    // The gate opens, and the walker steps out onto the floor of the storey.
    let gate = space.leads_to(
        lift,
        space.layout(lift).exits(cell_of(&space, lift))[0].portal,
    );
    println!("the door of the lift leads to {gate:?}");
    for portal in space.world(PartId::ROOT).graph.portal_ids() {
        space.open(PartId::ROOT, portal);
    }
    for _ in 0..180 {
        walker.step(&space, DVec3::Z * 1.4, 1.0 / 60.0);
    }
    println!("stepped out to {:.2} of {:?}", walker.eye, walker.frame);
    assert_eq!(walker.frame, PartId::ROOT);
    assert!((walker.feet().y - top.y).abs() < 0.05);
    Ok(())
}

fn baked(scene: &Scene) -> Result<Arc<World>, Box<dyn Error>> {
    Ok(Arc::new(
        bake(scene, &BakeConfig::default(), &BakeContext::default())?.world,
    ))
}

fn ahead(walker: &Walker) -> Result<View, Box<dyn Error>> {
    let eye = walker.eye.as_vec3().to_array();
    Ok(View::perspective(
        eye,
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
        1.2,
        1.6,
    )?)
}

/// Returns the cell of the cabin's room.
fn cell_of(space: &Space, lift: PartId) -> enfilade::CellId {
    let (cell, _) = space
        .world(lift)
        .graph
        .indoor_cells()
        .next()
        .expect("a cabin has a room");
    cell
}
