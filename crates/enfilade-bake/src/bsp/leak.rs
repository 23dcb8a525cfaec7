//! Tests if the inside of a map is closed, and finds the way out if it is not: any path through the leaves of the tree, since
//! a sealed map has none. In a building, which has doors, only the widest one says something ([`crate::leak`]).

use std::collections::VecDeque;

use enfilade_geom::scene::{Entity, Scene};
use enfilade_geom::{ConvexSolid, DVec3, OPEN_WORLD, Purse, open_floor};

use crate::config::{Guide, Heuristic};

use super::input::BspInput;
use super::leaves::{Bsp, LeakPath};
use super::tree::Content;

/// Points that a text lists.
const SHOWN: usize = 8;

impl LeakPath {
    /// Returns `true` if the world is open to the sky, so that the way out is a street, not a gap.
    #[must_use]
    pub fn is_open_world(&self) -> bool {
        self.open_floor >= OPEN_WORLD
    }

    /// Returns a sentence about it, without a remedy: the class of the entity in the scene, and the first points.
    #[must_use]
    pub fn says(&self, scene: &Scene) -> String {
        let points = self.points.iter().take(SHOWN);
        let shown: Vec<String> = points
            .map(|p| format!("{:.2} {:.2} {:.2}", p.x, p.y, p.z))
            .collect();
        let class = points_of(scene).nth(self.from);
        let class = class.map_or("an entity", |(entity, _)| &entity.class);
        let more = if self.points.len() > SHOWN {
            ", …"
        } else {
            ""
        };
        format!(
            "the map leaks: {class} reaches the void in {} steps, by {}{more}",
            self.points.len(),
            shown.join(", "),
        )
    }
}

/// Leaves that a flood from inside reached.
pub(super) struct Reached {
    pub(super) is_reached: Vec<bool>,
    /// The way to the border, if it got there.
    pub(super) path: Option<LeakPath>,
}

/// Floods from the points through the portals; finds a path if the flood reaches the border.
pub(super) fn reach(bsp: &Bsp<'_>, inside: &[DVec3]) -> Reached {
    let n = bsp.is_open.len();
    let mut neighbors: Vec<Vec<(u32, u32)>> = vec![Vec::new(); n];
    for (i, p) in bsp.portals.iter().enumerate() {
        for side in 0..2 {
            neighbors[p.leaves[side] as usize].push((p.leaves[1 - side], i as u32));
        }
    }
    let mut is_void = vec![false; n];
    for leaf in bsp.outer_leaves() {
        is_void[leaf as usize] = bsp.is_open[leaf as usize];
    }
    let mut via: Vec<Option<(u32, u32)>> = vec![None; n];
    let mut start: Vec<Option<usize>> = vec![None; n];
    let mut queue = VecDeque::new();
    for (i, &p) in inside.iter().enumerate() {
        let leaf = bsp.tree.leaf_of(p) as usize;
        // Points in matter, or alone in the void, carry no information.
        if bsp.tree.contents[leaf] == Content::Empty && bsp.is_open[leaf] && start[leaf].is_none() {
            start[leaf] = Some(i);
            queue.push_back(leaf as u32);
        }
    }
    let mut path = None;
    let mut is_reached: Vec<bool> = start.iter().map(Option::is_some).collect();
    while let Some(leaf) = queue.pop_front() {
        if is_void[leaf as usize] && path.is_none() {
            path = Some(way_to(bsp, leaf, &via, &start, inside));
        }
        for &(next, portal) in &neighbors[leaf as usize] {
            if !is_reached[next as usize] {
                is_reached[next as usize] = true;
                via[next as usize] = Some((leaf, portal));
                queue.push_back(next);
            }
        }
    }
    Reached { is_reached, path }
}

fn way_to(
    bsp: &Bsp<'_>,
    leaf: u32,
    via: &[Option<(u32, u32)>],
    start: &[Option<usize>],
    inside: &[DVec3],
) -> LeakPath {
    let b = &bsp.tree.bounds;
    let mut points = Vec::new();
    let mut at = leaf;
    while let Some((from, portal)) = via[at as usize] {
        let p = &bsp.portals[portal as usize].points;
        points.push(p.iter().sum::<DVec3>() / p.len() as f64);
        at = from;
    }
    let from = start[at as usize].unwrap_or(0);
    points.push(inside[from]);
    points.reverse();
    // Leaves are convex, so a straight line to the nearest side of the box stays in the last one or the
    // void beyond.
    let last = points[points.len() - 1];
    let (axis, to) = (0..3)
        .flat_map(|a| [(a, b.min[a]), (a, b.max[a])])
        .min_by(|p, q| (p.1 - last[p.0]).abs().total_cmp(&(q.1 - last[q.0]).abs()))
        .unwrap_or((0, b.max.x));
    let mut end = last;
    end[axis] = to;
    points.push(end);
    LeakPath {
        from,
        points,
        open_floor: 0.0,
    }
}

/// Returns the entities that have a position but no shape, which are known to be inside.
fn points_of(scene: &Scene) -> impl Iterator<Item = (&Entity, DVec3)> {
    let entities = scene.entities.iter().filter(|e| e.object.is_none());
    entities.filter_map(|e| Some((e, e.position?)))
}

/// Returns positions known to be inside: those of entities that have no shape.
pub(super) fn inside_of(scene: &Scene) -> Vec<DVec3> {
    points_of(scene).map(|(_, at)| at).collect()
}

/// Returns the path from an entity of the scene to the void; `None` if the solids close every path, and for
/// scenes that are not made of solids or have no entities.
#[must_use]
pub fn find_leak(scene: &Scene, purse: Purse<'_>) -> Option<LeakPath> {
    let solids: &[ConvexSolid] = &[&scene.solids[..], &scene.sky].concat();
    let inside = inside_of(scene);
    if solids.is_empty() || inside.is_empty() {
        return None;
    }
    let input = BspInput {
        triangles: &[],
        objects: &[],
        solids,
        inside: &inside,
    };
    let guide = Guide::default();
    let mut leak = Bsp::build_of(&input, Heuristic::Default, &guide, true, purse).leak?;
    leak.open_floor = open_floor(&scene.solids, &inside, purse);
    Some(leak)
}
