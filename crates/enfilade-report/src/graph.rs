//! The graph of rooms as a drawing: laid out by forces, starting from the places of the rooms.
//!
//! Doorways pull their rooms together, and rooms push each other away (library `force_graph`). The start selects one
//! of the many possible arrangements, so that the graph resembles the plan as far as possible. At the end, disks that
//! still touch are pushed apart.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use enfilade_cpg::{CellId, PortalKind, World, cell_color};
use enfilade_geom::{DVec2, Sets};
use force_graph::{ForceGraph, NodeData, SimulationParameters};

use crate::label::shortened;
use crate::storeys::Storey;
use crate::svg::{escaped, hex};

/// Distance at which the pull of a doorway and the push of its two rooms are equal. [Units: pixels]
const DISTANCE: f64 = 70.0;
/// Least distance between centers of disks: numbers of three digits stay apart. [Units: pixels]
const LEAST_DISTANCE: f64 = 40.0;
/// Largest factor by which a page enlarges the drawing.
const LARGEST: f64 = 1.6;
/// Width of a page without a scroll bar, minus the margins. [Units: pixels]
const PAGE: f64 = 980.0;
/// Radius of the smallest and of the largest disk. [Units: pixels]
const RADII: [f64; 2] = [11.0, 19.0];
/// Steps of the layout: three times as many as a tower of 100 rooms takes to come to rest.
const STEPS: usize = 400;
/// Unit directions without a pattern.
const WAYS: [DVec2; 5] = [
    DVec2::new(1.0, 0.0),
    DVec2::new(-0.6, 0.8),
    DVec2::new(0.28, -0.96),
    DVec2::new(0.8, 0.6),
    DVec2::new(-0.96, -0.28),
];
/// With more rooms than this, rooms stay where they are: a step takes time quadratic in their number.
const MAX_ROOMS: usize = 2000;

/// Draws the graph as an `svg` element, rooms as disks with the number of the cell. Returns a sentence if there are
/// no rooms.
pub(crate) fn graph_svg(world: &World, storeys: &[&Storey]) -> String {
    let rooms: Vec<CellId> = world.graph.indoor_cells().map(|c| c.0).collect();
    if rooms.is_empty() {
        return "<p>No rooms.</p>".into();
    }
    let edges = edges(world);
    let mut places = start(world, storeys, &rooms);
    if rooms.len() <= MAX_ROOMS {
        lay_out(&rooms, &edges, &mut places);
    }
    tighten(&mut places);
    spread(&mut places);
    let (low, high) = bounds(&places);
    let margin = DVec2::splat(1.5 * RADII[1]);
    let size = high - low + 2.0 * margin;
    let at: BTreeMap<CellId, DVec2> = rooms
        .iter()
        .zip(&places)
        .map(|(&c, &p)| (c, p - low + margin))
        .collect();
    let mut out = format!(
        "<svg class=\"graph\" xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.0}\" height=\"{:.0}\" viewBox=\"0 0 {:.0} {:.0}\" \
         font-family=\"sans-serif\" role=\"img\" aria-label=\"graph of rooms\" style=\"min-width:{:.0}px;max-width:{:.0}px\">\n",
        size.x,
        size.y,
        size.x,
        size.y,
        // Scrolled rather than made smaller: its numbers stay legible.
        size.x,
        LARGEST * size.x
    );
    for ((a, b), kind) in &edges {
        let (p, q) = (at[a], at[b]);
        let _ = writeln!(
            out,
            "<line data-ends=\"{} {}\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{}\"><title>{} and {}</title></line>",
            a.0,
            b.0,
            p.x,
            p.y,
            q.x,
            q.y,
            stroke(*kind),
            escaped(&shortened(&world.graph[*a].name)),
            escaped(&shortened(&world.graph[*b].name))
        );
    }
    let openings = openings(world);
    let most = rooms.iter().map(|c| volume(world, *c)).fold(1.0, f64::max);
    for (cell, p) in &at {
        let radius = RADII[0] + (RADII[1] - RADII[0]) * (volume(world, *cell) / most).sqrt();
        // Thick rings mark rooms with an opening to the outdoors.
        let ring = openings.get(cell).map_or("#444", |kind| stroke(*kind));
        let width = if openings.contains_key(cell) { 3 } else { 1 };
        let _ = writeln!(
            out,
            "<g data-cell=\"{}\"><circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius:.1}\" fill=\"{}\" stroke=\"{ring}\" stroke-width=\"{width}\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"12\" text-anchor=\"middle\">{}</text><title>{}</title></g>",
            cell.0,
            p.x,
            p.y,
            hex(cell_color(*cell)),
            p.x,
            p.y + 4.2,
            cell.0,
            escaped(&shortened(&world.graph[*cell].name))
        );
    }
    out.push_str("</svg>\n");
    out
}

fn volume(world: &World, cell: CellId) -> f64 {
    f64::from(world.graph[cell].volume.max(0.0))
}

fn stroke(kind: PortalKind) -> &'static str {
    match kind {
        PortalKind::Open => "#e8590c",
        PortalKind::Door => "#c92a2a",
        PortalKind::Window => "#1c7ed6",
        PortalKind::Crack => "#d6249f",
    }
}

/// The pairs of rooms that portals join, each with its most important kind of portal: passages before windows.
fn edges(world: &World) -> BTreeMap<(CellId, CellId), PortalKind> {
    let mut out: BTreeMap<(CellId, CellId), PortalKind> = BTreeMap::new();
    for portal in &world.graph.portals {
        let [a, b] = portal.cells;
        if !world.graph[a].outdoor && !world.graph[b].outdoor {
            let kind = out.entry((a.min(b), a.max(b))).or_insert(portal.kind);
            *kind = (*kind).min(portal.kind);
        }
    }
    out
}

/// The rooms that portals join to the outdoors, each with its most important kind of portal.
fn openings(world: &World) -> BTreeMap<CellId, PortalKind> {
    let mut out: BTreeMap<CellId, PortalKind> = BTreeMap::new();
    for portal in &world.graph.portals {
        let [a, b] = portal.cells;
        let room = match (world.graph[a].outdoor, world.graph[b].outdoor) {
            (true, false) => b,
            (false, true) => a,
            _ => continue,
        };
        let kind = out.entry(room).or_insert(portal.kind);
        *kind = (*kind).min(portal.kind);
    }
    out
}

/// Places of the rooms on the plan, upper storeys at the top, scaled to the space that so many rooms need.
fn start(world: &World, storeys: &[&Storey], rooms: &[CellId]) -> Vec<DVec2> {
    let middle = |c: CellId| {
        let [low, high] = world.graph[c].aabb;
        DVec2::new(
            0.5 * f64::from(low[0] + high[0]),
            0.5 * f64::from(low[2] + high[2]),
        )
    };
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for &c in rooms {
        (low, high) = (low.min(middle(c)), high.max(middle(c)));
    }
    let size = (high - low).max(DVec2::ONE);
    // Upper storeys at the top, as is usual in drawings.
    let main = || storeys.iter().filter(|s| !s.is_between);
    let n = main().count().max(1);
    let row = |c: CellId| main().position(|s| s.cells.contains(&c)).unwrap_or(0);
    let zoom = DISTANCE * (rooms.len() as f64 / (size.x * size.y * n as f64)).sqrt();
    let place = |c: CellId| {
        let down = (n - 1 - row(c)) as f64 * 1.1 * size.y;
        (middle(c) - low + DVec2::Y * down) * zoom
    };
    rooms.iter().map(|&c| place(c)).collect()
}

/// Moves the rooms until pull and push are roughly equal.
fn lay_out(rooms: &[CellId], edges: &BTreeMap<(CellId, CellId), PortalKind>, places: &mut [DVec2]) {
    let mut graph = <ForceGraph>::new(SimulationParameters {
        // For two rooms with a doorway, the pull 0.5 · spring · d equals the push charge / d² at the distance above.
        force_spring: 1.0,
        force_charge: (0.5 * DISTANCE.powi(3)) as f32,
        force_max: 2000.0,
        // With the step below, a fiftieth of the force per step: stable for up to a hundred doorways per room.
        node_speed: 20.0,
        damping_factor: 0.85,
    });
    let nodes: Vec<_> = places
        .iter()
        .enumerate()
        .map(|(i, p)| {
            graph.add_node(NodeData {
                // Two rooms exactly above each other would have no direction to push in.
                x: (p.x + (i % 7) as f64) as f32,
                y: (p.y + (i % 11) as f64) as f32,
                mass: 1.0,
                ..NodeData::default()
            })
        })
        .collect();
    let index: BTreeMap<CellId, usize> = rooms.iter().enumerate().map(|(i, &c)| (c, i)).collect();
    let mut joined: Vec<[usize; 2]> = edges.keys().map(|(a, b)| [index[a], index[b]]).collect();
    joined.extend(bonds(&joined, places));
    for [a, b] in joined {
        graph.add_edge(nodes[a], nodes[b], Default::default());
    }
    for _ in 0..STEPS {
        graph.update(0.1);
    }
    let mut moved = Vec::with_capacity(places.len());
    graph.visit_nodes(|n| moved.push(DVec2::new(n.x().into(), n.y().into())));
    for (place, moved) in places.iter_mut().zip(moved) {
        if moved.is_finite() {
            *place = moved;
        }
    }
}

/// Edges that are not drawn: ties each part without a doorway to the first part to its nearest room, so that it does
/// not drift away.
fn bonds(joined: &[[usize; 2]], places: &[DVec2]) -> Vec<[usize; 2]> {
    let mut parts = Sets::new(places.len());
    for &[a, b] in joined {
        parts.join(a as u32, b as u32);
    }
    let roots: Vec<usize> = parts.into_least().iter().map(|&r| r as usize).collect();
    let firsts: BTreeSet<usize> = roots.iter().copied().collect();
    let mut out = Vec::new();
    for &first in firsts.iter().skip(1) {
        let others = (0..places.len()).filter(|&i| roots[i] < first);
        let near = |i: &usize| places[*i].distance_squared(places[first]);
        if let Some(nearest) = others.min_by(|a, b| near(a).total_cmp(&near(b))) {
            out.push([first, nearest]);
        }
    }
    out
}

fn bounds(places: &[DVec2]) -> (DVec2, DVec2) {
    let start = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    places
        .iter()
        .fold(start, |(low, high), p| (low.min(*p), high.max(*p)))
}

/// Shrinks the drawing as far as the number of disks allows, and to the width of the page if possible.
fn tighten(places: &mut [DVec2]) {
    let (low, high) = bounds(places);
    let size = (high - low).max(DVec2::ONE);
    let area = places.len() as f64 * DISTANCE * DISTANCE;
    let scale = (area / (size.x * size.y))
        .sqrt()
        .min(PAGE / size.x)
        .min(1.0);
    for p in places.iter_mut() {
        *p = (*p - low) * scale;
    }
}

/// Pushes apart disks that overlap.
fn spread(places: &mut [DVec2]) {
    for _ in 0..500 {
        let mut is_moved = false;
        // Neighbors in x only: the list is nearly sorted after the first round.
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_by(|&a, &b| places[a].x.total_cmp(&places[b].x).then(a.cmp(&b)));
        for (k, &a) in order.iter().enumerate() {
            for &b in &order[k + 1..] {
                let apart = places[b] - places[a];
                if apart.x > LEAST_DISTANCE {
                    break;
                }
                let distance = apart.length();
                if distance < LEAST_DISTANCE {
                    // Coinciding disks part in directions of their own, or a heap of them would become a row.
                    let way = if distance > 1e-6 {
                        apart / distance
                    } else {
                        WAYS[(a + b) % WAYS.len()]
                    };
                    // Slightly more than needed, so that the loop ends.
                    let push = way * (0.5 * (LEAST_DISTANCE - distance) + 0.05);
                    places[a] -= push;
                    places[b] += push;
                    is_moved = true;
                }
            }
        }
        if !is_moved {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_rooms_on_one_spot_end_up_apart_and_near_their_neighbors() {
        // A corridor with 99 rooms.
        let rooms: Vec<CellId> = (0..100).map(CellId).collect();
        let edges = (1..100).map(|i| ((CellId(0), CellId(i)), PortalKind::Door));
        let edges = edges.collect();
        let mut places = vec![DVec2::ZERO; 100];
        lay_out(&rooms, &edges, &mut places);
        tighten(&mut places);
        spread(&mut places);
        for (i, p) in places.iter().enumerate() {
            for q in &places[i + 1..] {
                assert!(p.distance(*q) > LEAST_DISTANCE - 0.5, "{p} {q}");
            }
            assert!(p.distance(places[0]) < 600.0, "{i}: {p}");
        }
        let mut again = vec![DVec2::ZERO; 100];
        lay_out(&rooms, &edges, &mut again);
        tighten(&mut again);
        spread(&mut again);
        assert_eq!(places, again);
    }

    #[test]
    fn disks_on_one_spot_are_pushed_apart() {
        let mut places = vec![DVec2::ONE; 30];
        spread(&mut places);
        for (i, p) in places.iter().enumerate() {
            let near = |q: &DVec2| p.distance(*q) < LEAST_DISTANCE - 0.5;
            assert!(!places[i + 1..].iter().any(near), "{places:?}");
        }
    }

    #[test]
    fn parts_without_a_doorway_between_them_stay_in_sight() {
        let rooms: Vec<CellId> = (0..20).map(CellId).collect();
        let mut places: Vec<DVec2> = (0..20).map(|i| DVec2::X * f64::from(i)).collect();
        lay_out(&rooms, &BTreeMap::new(), &mut places);
        let far = places.iter().map(|p| p.length()).fold(0.0, f64::max);
        assert!(far < 1500.0, "{far}");
    }
}
