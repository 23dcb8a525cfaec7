//! Doors and their leaves: each door has one, shut leaves hide the rooms behind, and culling loses no pixel.

use enfilade::cpg::{PortalId, PortalKind, World};
use enfilade::runtime::{Sight, SightState, View, Viewer};
use enfilade_cli::cameras::random_camera;
use enfilade_render::{AdapterChoice, Gpu, Oracle, Studio};
use enfilade_testkit::Rng;

use crate::rows::Figure;

/// Views in random states of doors, and the size of their pictures.
const VIEWS: usize = 1000;
const SIZE: [u32; 2] = [320, 240];
/// Distance of the eye from a shut door. [Units: wu]
const BEFORE: f32 = 0.6;

fn doors(world: &World) -> Vec<PortalId> {
    let all = (0..).map(PortalId).zip(&world.graph.portals);
    let doors = all.filter(|(_, p)| p.kind == PortalKind::Door);
    doors.map(|(id, _)| id).collect()
}

/// Counts doors without a leaf.
pub(super) fn without_leaf(world: &World) -> anyhow::Result<Figure> {
    let sight = Sight::build(world)?;
    let doors = doors(world);
    let without = doors.iter().filter(|d| sight.leaves(**d).is_empty());
    let note = format!("of {} doors have no leaf", doors.len());
    Ok(Figure::new(without.count() as f64, 0.0, note))
}

/// Counts sides of doors from which, with all doors shut, another cell is visible, or the leaf is not. Excludes
/// leaves of glass.
pub(super) fn seen_through(world: &World) -> anyhow::Result<Figure> {
    let sight = Sight::build(world)?;
    let mut state = SightState::new(&sight);
    let mut viewer = Viewer::new(&sight);
    let doors = doors(world);
    for &door in &doors {
        state.set_leaves(door, 0.0);
    }
    let (mut n_sides, mut bad, mut most) = (0, Vec::new(), 0);
    let solid = doors.iter().filter(|d| !state.is_open(**d));
    let n_solid = solid.clone().count();
    for &door in solid {
        let portal = &world.graph[door];
        let middle = portal.center();
        for (side, cell) in [(-1.0, portal.cells[0]), (1.0, portal.cells[1])] {
            let n = portal.normal.map(|n| n * side);
            let eye = [0, 1, 2].map(|k| middle[k] + BEFORE * n[k]);
            // Skip eyes that are not in the cell, because something else is right before the door.
            if sight.locate(eye) != Some(cell) {
                continue;
            }
            // Narrow enough that only the door is in view.
            let view = View::perspective(eye, n.map(|x| -x), [0.0, 1.0, 0.0], 0.3, 1.0)?;
            let seen = viewer.see(&sight, &state, &view);
            let has_leaf = sight
                .leaves(door)
                .iter()
                .any(|l| seen.details().contains(&l.detail));
            n_sides += 1;
            // Outdoors, other openings lie behind the wall with the door; the wall hides them, but only portals cull.
            let n_cells = if world.graph[cell].outdoor {
                1 + usize::from(seen.portals().contains(&door))
            } else {
                seen.cells().len()
            };
            if n_cells > 1 || !has_leaf {
                bad.push(format!("{door} from {cell}"));
            }
            most = most.max(n_cells);
        }
    }
    let note = format!(
        "of {n_sides} sides of {n_solid} doors without glass show another cell or no leaf; at most {most} cells seen {}",
        bad.join(", ")
    );
    Ok(Figure::new(bad.len() as f64, 0.0, note))
}

/// Counts pixels that culling loses in random states of doors, by the rule of `verify --views --doors`.
pub(super) fn pixels_lost(world: &World) -> anyhow::Result<Figure> {
    let gpu = Gpu::open(&AdapterChoice::Software)?;
    let mut studio = Studio::new(gpu, world)?;
    let bounds = studio.world.bounds();
    let mut oracle = Oracle::new(world, &studio.sight);
    let mut rng = Rng::new(1);
    let (mut n_lost, mut n_pixels, mut n_views) = (0, 0, 0);
    for _ in 0..VIEWS {
        studio.state = enfilade_cli::doors::random_doors(&mut rng, &studio.sight);
        oracle.follow(&studio.sight, &studio.state);
        let camera = random_camera(&mut rng, world, &studio.sight, bounds);
        if oracle.is_at_surface(camera.eye) {
            continue;
        }
        n_views += 1;
        let [whole, culled] = studio.ids_compared(&camera, SIZE)?;
        for (layer, (a, b)) in whole.iter().zip(&culled).enumerate() {
            let difference = a.difference(b);
            n_pixels += if layer == 0 { difference.n_pixels } else { 0 };
            let lost = difference.lost.iter();
            n_lost += lost
                .filter(|l| oracle.is_lost(&camera, l, SIZE, layer == 1))
                .count();
        }
    }
    let note = format!("of {n_pixels} pixels of {n_views} views are lost");
    Ok(Figure::new(n_lost as f64, 0.0, note))
}
