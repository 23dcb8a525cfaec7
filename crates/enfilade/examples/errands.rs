//! People on errands in a building, simulated whether anybody looks or not: `cargo run --release -p enfilade --example errands`.

#![allow(clippy::print_stdout)]

use std::error::Error;

use enfilade::CellId;
use enfilade::geom::DVec3;
use enfilade::world::{
    ActorEvent, Actors, Agent, Chance, Errands, PartId, Path, PathSearch, PlanDraft, Space,
    WalkMap, WayPoint,
};
use enfilade_testkit::{GridParams, room_grid, with_doors};

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // A storey of offices with doors and furniture; in a program of yours, `enfilade::open(path)?`.
    let world = room_grid(&GridParams {
        doors: 1.0,
        furniture: 1,
        ..GridParams::offices(40, 3)
    });
    let world = with_doors(world, |_| false);
    let space = Space::new(world)?;
    let (layout, world) = (space.layout(PartId::ROOT), space.world(PartId::ROOT));
    let map = WalkMap::new(&space, Agent::default());

    let ends = |ends: [DVec3; 2]| ends.map(|p| (PartId::ROOT, p));

    // Places to go to: a spot in each room that one can walk to from the first.
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let mut places: Vec<WayPoint> = Vec::new();
    for (cell, shape) in (0..).map(CellId).zip(&world.graph.cells) {
        let [low, high] = shape.aabb.map(|p| DVec3::from_array(p.map(f64::from)));
        let spots = [0.5, 0.3, 0.7].map(|t| low.lerp(high, t).with_y(low.y + 0.1));
        let free = spots.into_iter().find(|at| {
            let from = places.first().map_or(*at, |p| p.at);
            !shape.outdoor
                && search
                    .find(&map, &space, ends([from, *at]), |_, _| true, &mut path)
                    .is_ok()
        });
        places.extend(free.map(|at| WayPoint { at, cell }));
    }

    // Each errand: a place, a path to it, a stay there.
    let mut errands = Errands::default();
    let mut plan = |event: &ActorEvent, chance: &mut Chance, plan: &mut PlanDraft<'_>| {
        errands.plan(chance, plan, places.len() as u32, |place, way| {
            let ends = ends([event.at, places[place as usize].at]);
            let found = search.find(&map, &space, ends, |_, _| true, &mut path);
            if found.is_ok() {
                way.extend(path.points.windows(2).map(|leg| {
                    WayPoint {
                        at: leg[1].at,
                        cell: layout
                            .locate((leg[0].at + leg[1].at) * 0.5 + DVec3::Y)
                            .unwrap_or(event.cell),
                    }
                }));
            }
        });
    };
    let mut actors = Actors::new(layout.n_cells(), 42);
    for i in 0..30 {
        let start = places[i % places.len()];
        actors.add(start.at, start.cell, &mut plan);
    }

    // An hour, in steps of any length: the state at its end is the same.
    let mut n_updates = 0;
    for minute in 1..=60 {
        actors.advance(f64::from(minute) * 60.0, &mut plan);
        n_updates += actors.n_updates();
    }
    let busiest = (0..layout.n_cells() as u32).map(CellId);
    let busiest = busiest.max_by_key(|c| actors.in_cell(*c).count());
    let busiest = busiest.ok_or("no cells")?;
    println!(
        "{} places, {} people after an hour, {} updates; {} of them are in {}",
        places.len(),
        actors.len(),
        n_updates,
        actors.in_cell(busiest).count(),
        world.graph[busiest].name
    );
    assert!(places.len() > 10 && n_updates > 100);
    Ok(())
}
