//! Facts of rooms that people ask for: floor area, height, storey, doors and windows.
//!
//! A floor area is the area that a room covers as seen from above, with galleries in it, divided exactly by the tree of the
//! world's cells. The recesses of doorways and windows between a portal and the face of its wall do not count: they belong
//! to the wall, as in the rules by which architects measure.

use std::borrow::Cow;
use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Portal, PortalKind, RoomFacts, World};
use enfilade_geom::poly::cut_out;
use enfilade_geom::{Aabb, DVec3, Plane, Winding};

use crate::floors::{Level, Samples, find_levels, floor_samples};
use crate::storeys::{Storey, find_pages};

/// Distance of level sections: floors that differ by less are one. [Units: wu]
const BAND: f64 = 0.24;
/// Most sections of a cell; in one higher than 240 m they are farther apart.
const MAX_BANDS: f64 = 1000.0;
/// Parts of a section that are smaller do not count: they are left where walls lean. [Units: wu²]
const SLIVER: f64 = 1e-3;
/// Height of a person: a floor over another of the same room counts if one can stand between. [Units: wu]
const STANDING: f64 = 1.9;
/// A room that is lower than a height by less has it: coordinates are rounded. [Units: wu]
const ROUNDING: f64 = 1e-3;
/// Deepest recess of a doorway: thicker walls do not occur. [Units: wu]
const DEEPEST: f64 = 1.5;
/// Distance from an opening's edge at which its jamb is looked up. [Units: wu]
const IN_JAMB: f64 = 0.03;
/// Spacing of the points between which the end of a jamb is found. [Units: wu]
const STEP: f64 = 0.01;
/// A portal whose normal rises more is a hatch, which has no jambs.
const UPRIGHT: f32 = 0.5;

/// Returns the facts of all rooms, by cell: those that the world has, or else measured. The world must be valid.
#[must_use]
pub fn room_facts(world: &World) -> Cow<'_, [RoomFacts]> {
    match &world.room_facts {
        Some(facts) => facts.into(),
        None => measured_room_facts(world).into(),
    }
}

/// Measures the facts of all rooms, by cell, whatever the world says; to the millimeter. The world must be valid.
///
/// O(floor area + triangles + parts of the tree that sections each 0.24 m meet).
#[must_use]
pub fn measured_room_facts(world: &World) -> Vec<RoomFacts> {
    let samples = floor_samples(world);
    let (pages, _) = find_pages(world, &samples);
    let storeys: Vec<&Storey> = pages.iter().map(|p| &p.storey).collect();
    measured(world, &samples, &storeys)
}

/// Returns what [`room_facts`] does, of a world whose floors and storeys are known.
pub(crate) fn facts_of_rooms(
    world: &World,
    samples: &Samples,
    storeys: &[&Storey],
) -> Vec<RoomFacts> {
    if let Some(facts) = &world.room_facts {
        return facts.clone();
    }
    measured(world, samples, storeys)
}

fn measured(world: &World, samples: &Samples, storeys: &[&Storey]) -> Vec<RoomFacts> {
    let mut levels: BTreeMap<CellId, Vec<Level>> = BTreeMap::new();
    for level in find_levels(world, samples, BAND) {
        levels.entry(level.cell).or_default().push(level);
    }
    let n_portals = |id, kind| world.graph.n_portals(id, kind);
    let rounded = |measure: f64| (1000.0 * measure).round() / 1000.0;
    let rooms = world.graph.rooms();
    rooms
        .map(|(id, _)| {
            let on = (storeys.iter()).filter(|s| s.cells.binary_search(&id).is_ok());
            let own = levels.get(&id).map_or(&[][..], Vec::as_slice);
            let floor = floor_of(world, id, own);
            RoomFacts {
                cell: id,
                storeys: on.map(|s| s.name.clone()).collect(),
                floor_area: rounded(floor.area),
                area_above_1_5: rounded(floor.above_1_5),
                area_above_2_3: rounded(floor.above_2_3),
                height: rounded(floor.height),
                n_doors: n_portals(id, PortalKind::Door),
                n_windows: n_portals(id, PortalKind::Window),
            }
        })
        .collect()
}

/// Measures of a room's floors.
#[derive(Default)]
struct Floor {
    area: f64,
    above_1_5: f64,
    above_2_3: f64,
    /// Clear height over most of the area. [Units: wu]
    height: f64,
}

/// Measures a room's floors.
fn floor_of(world: &World, cell: CellId, levels: &[Level]) -> Floor {
    let footprint = Footprint::new(world, cell);
    let portals = world.graph[cell].portals.iter().map(|&p| &world.graph[p]);
    let recesses: Vec<Recess> = portals.filter_map(|p| recess(world, cell, p)).collect();
    let mut heights: Vec<(f64, f64)> = Vec::new();
    let mut out = Floor::default();
    let mut add = |floor: Winding| {
        for part in without(floor, &recesses) {
            let under = footprint.under(&part);
            heights.push((footprint.over(&part) + under, part.area()));
            // Air at 2.3 m over a beam lower than 1.5 m is not high.
            let high = footprint.lifted(&part, 1.5 - ROUNDING - under);
            let higher = high.iter().flat_map(|p| footprint.lifted(p, 2.3 - 1.5));
            out.above_2_3 += higher.map(|p| p.area()).sum::<f64>();
            out.above_1_5 += high.iter().map(Winding::area).sum::<f64>();
        }
    };
    for k in 0..footprint.heights.len() {
        footprint.lowest(k).into_iter().for_each(&mut add);
    }
    for level in levels {
        footprint.upper(level.height).into_iter().for_each(&mut add);
    }
    out.area = heights.iter().map(|h| h.1).sum();
    // Each is part of the one before; sums of pieces differ by rounding.
    out.above_1_5 = out.above_1_5.min(out.area);
    out.above_2_3 = out.above_2_3.min(out.above_1_5);
    heights.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below = 0.0;
    let middle = heights.iter().find(|h| {
        below += h.1;
        below >= 0.5 * out.area
    });
    out.height = middle.map_or(0.0, |h| h.0);
    out
}

/// The recess of an opening as seen from above, counter-clockwise about +y.
type Recess = [DVec3; 4];

/// The parts of a floor outside of recesses.
fn without(floor: Winding, recesses: &[Recess]) -> Vec<Winding> {
    let mut parts = vec![floor];
    for recess in recesses {
        let cover = recess.map(|p| p.with_y(parts.first().map_or(0.0, |part| part.points[0].y)));
        let mut outside = Vec::new();
        for part in parts {
            let _ = cut_out(&part.points, &cover, DVec3::Y, 0.0, 0.0, &mut outside);
        }
        parts = outside
            .into_iter()
            .map(|p| Winding::new(p.to_vec()))
            .collect();
    }
    parts
}

/// Level sections of a cell, from below.
struct Footprint<'w> {
    world: &'w World,
    cell: CellId,
    bounds: Aabb,
    /// Heights of the sections, ascending. [Units: wu]
    heights: Vec<f64>,
}

impl<'w> Footprint<'w> {
    fn new(world: &'w World, cell: CellId) -> Self {
        let [min, max] = world.graph[cell]
            .aabb
            .map(|p| DVec3::from(p.map(f64::from)));
        let step = BAND.max((max.y - min.y) / MAX_BANDS);
        let n = ((max.y - min.y) / step).ceil() as usize;
        Self {
            world,
            cell,
            bounds: Aabb { min, max }.expanded(1.0),
            heights: (0..n).map(|k| min.y + (k as f64 + 0.5) * step).collect(),
        }
    }

    /// Returns what the section of this number covers and none below it does.
    fn lowest(&self, k: usize) -> Vec<Winding> {
        self.not_over(self.air(self.heights[k]), &self.heights[..k])
    }

    /// Returns the height of the cell over the middle of a part of a section.
    fn over(&self, part: &Winding) -> f64 {
        self.reach(part, self.bounds.max.y)
    }

    /// Returns the height of the cell under the middle of a part of a section, one step at most.
    fn under(&self, part: &Winding) -> f64 {
        self.reach(part, part.mean().y - BAND)
    }

    /// Returns how much of the upright line from the middle of a part to the height `y` is in the cell. [Units: wu]
    fn reach(&self, part: &Winding, y: f64) -> f64 {
        let middle = part.mean();
        let locator = &self.world.graph.locator;
        // Beyond the box of the tree is the outdoors.
        let [low, high] = [locator.bounds.min.y, locator.bounds.max.y];
        let end = middle.with_y(y.clamp(low, high));
        end.distance(middle) * locator.share_in(self.cell, middle, end)
    }

    /// Returns a part of a section moved up, as far as it is in the cell there.
    fn lifted(&self, part: &Winding, up: f64) -> Vec<Winding> {
        let mut moved = part.clone();
        moved.points.iter_mut().for_each(|p| p.y += up);
        let mut own = Vec::new();
        if moved.points[0].y > self.bounds.max.y {
            return own;
        }
        self.world.graph.locator.for_parts(moved, |cell, part| {
            if cell == Some(self.cell) {
                own.push(part);
            }
        });
        own
    }

    /// Returns the parts of a floor under which the cell goes on, a person's height below or more.
    fn upper(&self, floor: f64) -> Vec<Winding> {
        let air = self.air(floor + 0.5 * BAND);
        let air = self.not_over(air, &[floor - 0.5 * BAND]);
        let n_below = self.heights.partition_point(|&y| y < floor - STANDING);
        let over = |part: &Winding| {
            let p = part.mean();
            let mut below = self.heights[..n_below].iter();
            below.any(|&y| self.locate(DVec3::new(p.x, y, p.z)))
        };
        air.into_iter().filter(over).collect()
    }

    fn locate(&self, p: DVec3) -> bool {
        self.world.graph.locator.locate(p) == Some(self.cell)
    }

    /// The section of the cell at a height.
    fn air(&self, height: f64) -> Vec<Winding> {
        let plane = Plane::through(DVec3::Y * height, DVec3::Y);
        let mut own = Vec::new();
        if let Some(whole) = Winding::section_of_box(&plane, &self.bounds) {
            let locator = &self.world.graph.locator;
            locator.for_parts(whole, |cell, part| {
                if cell == Some(self.cell) {
                    own.push(part);
                }
            });
        }
        own
    }

    /// Returns the parts of `parts`, all at one height, that are over none of the sections at `heights`.
    fn not_over(&self, mut parts: Vec<Winding>, heights: &[f64]) -> Vec<Winding> {
        let locator = &self.world.graph.locator;
        for &height in heights.iter().rev() {
            let mut beside = Vec::new();
            for mut part in parts {
                let at = part.points[0].y;
                part.points.iter_mut().for_each(|p| p.y = height);
                locator.for_parts(part, |cell, mut part| {
                    if cell != Some(self.cell) && part.area() > SLIVER {
                        part.points.iter_mut().for_each(|p| p.y = at);
                        beside.push(part);
                    }
                });
            }
            parts = beside;
        }
        parts
    }
}

/// The recess of an opening on the side of a cell, seen from above: the opening's width at half its height, as deep as the
/// shallower of its jambs. `None` without jambs: the room itself begins at the portal.
fn recess(world: &World, cell: CellId, portal: &Portal) -> Option<Recess> {
    if portal.normal[1].abs() > UPRIGHT || portal.kind == PortalKind::Crack {
        return None;
    }
    let normal = DVec3::from(portal.normal.map(f64::from)).with_y(0.0);
    let into = normal.normalize() * if portal.cells[0] == cell { -1.0 } else { 1.0 };
    let across = into.cross(DVec3::Y);
    let points = portal.outline.iter().map(|p| DVec3::from(p.map(f64::from)));
    let box_of = Aabb::of_points(&points.clone().collect::<Vec<_>>());
    let middle = box_of.center();
    let wide = points.map(|p| across.dot(p - middle));
    let [low, high] = wide.fold([0.0_f64; 2], |[l, h], x| [l.min(x), h.max(x)]);
    let ends = [low, high].map(|x| middle + across * x);
    let jambs = [ends[0] - across * IN_JAMB, ends[1] + across * IN_JAMB].map(|start| {
        let locator = (world.graph.locator).around(&[start, start + into * (DEEPEST + STEP)]);
        let at = |depth: f64| locator.locate(start + into * depth);
        // Beside the portal itself, which may lie in the face of the wall.
        let steps = (0..(DEEPEST / STEP) as usize).map(|k| (k as f64 + 0.5) * STEP);
        let end = steps.take_while(|&depth| at(depth).is_none()).last();
        let is_face = |depth: &f64| at(*depth + STEP) == Some(cell);
        let Some(end) = end.filter(is_face) else {
            return f64::INFINITY;
        };
        let (mut matter, mut air) = (end, end + STEP);
        while air - matter > 1e-3 * STEP {
            let middle = 0.5 * (matter + air);
            *if at(middle).is_none() {
                &mut matter
            } else {
                &mut air
            } = middle;
        }
        air
    });
    let depth = jambs[0].min(jambs[1]);
    let far = into * depth;
    depth.is_finite().then(|| {
        let behind = -into * STEP;
        let around = [
            ends[0] + behind,
            ends[0] + far,
            ends[1] + far,
            ends[1] + behind,
        ];
        let turn = (around[1] - around[0]).cross(around[2] - around[1]).y;
        if turn > 0.0 {
            around
        } else {
            [around[3], around[2], around[1], around[0]]
        }
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use enfilade_cpg::{Batch, Cell, Locator, LocatorNode};
    use enfilade_geom::scene::Primitive;

    use super::*;

    /// Cell 0 of the boxes; all else is solid.
    fn world(boxes: &[[[f64; 3]; 2]]) -> World {
        world_of(boxes, |_| CellId(0))
    }

    fn world_of(boxes: &[[[f64; 3]; 2]], cell_of: impl Fn(usize) -> CellId) -> World {
        let mut world = World::default();
        let locator = Arc::make_mut(&mut world.graph.locator);
        let bounds: Vec<DVec3> = boxes.iter().flatten().map(|p| DVec3::from(*p)).collect();
        let bounds = Aabb::of_points(&bounds);
        for (n, [min, max]) in boxes.iter().enumerate() {
            let next = match n + 1 < boxes.len() {
                true => 6 * (n as i32 + 1),
                false => Locator::leaf(None),
            };
            for k in 0..6 {
                let mut plane = [0.0; 4];
                (plane[k % 3], plane[3]) = match k < 3 {
                    true => (1.0, -min[k]),
                    false => (-1.0, max[k - 3]),
                };
                let inside = match k {
                    5 => Locator::leaf(Some(cell_of(n))),
                    _ => locator.nodes.len() as i32 + 1,
                };
                locator.nodes.push(LocatorNode {
                    plane: locator.planes.len() as u32,
                    children: [inside, next],
                });
                locator.planes.push(plane);
            }
        }
        locator.root = 0;
        locator.bounds = bounds.expanded(1.0);
        world.graph.cells.push(Cell {
            aabb: [bounds.min, bounds.max].map(|p| p.as_vec3().to_array()),
            ..Cell::default()
        });
        world
    }

    fn facts(world: &World) -> [f64; 2] {
        let facts = facts_of_rooms(world, &floor_samples(world), &[]);
        [facts[0].floor_area, facts[0].height]
    }

    fn near(found: [f64; 2], expected: [f64; 2]) {
        let is_near = |k: usize| (found[k] - expected[k]).abs() < 1e-3;
        assert!(is_near(0) && is_near(1), "{found:?} for {expected:?}");
    }

    #[test]
    fn a_stair_or_a_low_wall_covers_floor_and_a_ledge_adds_none() {
        near(facts(&world(&[[[0.0; 3], [5.0, 3.0, 4.0]]])), [20.0, 3.0]);
        // A solid of 1 by 4 m, 0.5 m high; then one that hangs over a meter of the floor.
        let on_floor = [
            [[1.0, 0.0, 0.0], [5.0, 3.0, 4.0]],
            [[0.0, 0.5, 0.0], [1.0, 3.0, 4.0]],
        ];
        near(facts(&world(&on_floor)), [20.0, 3.0]);
        let hangs = [
            [[1.0, 0.0, 0.0], [5.0, 3.0, 4.0]],
            [[0.0, 0.0, 0.0], [1.0, 0.9, 4.0]],
            [[0.0, 1.0, 0.0], [1.0, 3.0, 4.0]],
        ];
        near(facts(&world(&hangs)), [20.0, 3.0]);
    }

    #[test]
    fn a_sloped_ceiling_leaves_less_area_at_each_height() {
        // As high as it is far from the wall, from 1 m to 4 m; and a ceiling of 2.3 m.
        let mut world = world(&[[[1.0, 0.0, 0.0], [4.0, 4.0, 5.0]]]);
        let areas = |world: &World| {
            let facts = facts_of_rooms(world, &floor_samples(world), &[]);
            let room = &facts[0];
            [room.floor_area, room.area_above_1_5, room.area_above_2_3]
        };
        near_all(areas(&world), [15.0, 15.0, 15.0]);
        Arc::make_mut(&mut world.graph.locator).planes[4] =
            [0.5_f64.sqrt(), -0.5_f64.sqrt(), 0.0, 0.0];
        near_all(areas(&world), [15.0, 12.5, 8.5]);
        let level = self::world(&[[[0.0; 3], [5.0, 2.3, 4.0]]]);
        near_all(areas(&level), [20.0, 20.0, 20.0]);
        let low = self::world(&[[[0.0; 3], [5.0, 1.4, 4.0]]]);
        near_all(areas(&low), [20.0, 0.0, 0.0]);
    }

    #[test]
    fn air_over_a_low_beam_is_not_high() {
        let beside = [[5.0, 0.0, 0.0], [6.0, 3.0, 4.0]];
        let [under, over] = [[0.0, 1.2], [1.8, 3.0]].map(|[a, b]| [[0.0, a, 0.0], [5.0, b, 4.0]]);
        let world = world(&[beside, under, over]);
        let facts = facts_of_rooms(&world, &floor_samples(&world), &[]);
        let room = &facts[0];
        let areas = [room.floor_area, room.area_above_1_5, room.area_above_2_3];
        near_all(areas, [24.0, 4.0, 4.0]);
    }

    fn near_all(found: [f64; 3], expected: [f64; 3]) {
        let is_near = |k: usize| (found[k] - expected[k]).abs() < 0.01;
        assert!((0..3).all(is_near), "{found:?} for {expected:?}");
    }

    #[test]
    fn a_gallery_counts_where_one_can_stand_below() {
        for (height, area) in [(2.2, 24.0), (1.2, 20.0)] {
            let mut world = world(&[
                [[1.0, 0.0, 0.0], [5.0, 5.0, 4.0]],
                [[0.0, 0.0, 0.0], [1.0, height, 4.0]],
                [[0.0, height + 0.2, 0.0], [1.0, 5.0, 4.0]],
            ]);
            let floor = |low: f32, high: f32, y: f32| Batch {
                cells: vec![CellId(0)],
                primitive: Primitive {
                    positions: vec![[low, y, 0.0], [low, y, 4.0], [high, y, 4.0], [high, y, 0.0]],
                    indices: vec![0, 1, 2, 0, 2, 3],
                    ..Primitive::default()
                },
                ..Batch::default()
            };
            world.batches = vec![floor(0.0, 5.0, 0.0), floor(0.0, 1.0, height as f32 + 0.2)];
            near(facts(&world), [area, 5.0]);
        }
    }

    #[test]
    fn the_recess_of_an_opening_belongs_to_the_wall() {
        // A doorway 1 m wide in a wall of 0.3 m, and the portal at its far side, where another cell begins.
        let boxes = [
            [[0.0; 3], [5.0, 3.0, 4.0]],
            [[2.0, 0.0, -0.3], [3.0, 2.0, 0.0]],
            [[-5.0, 0.0, -5.0], [9.0, 3.0, -0.3]],
        ];
        let mut world = world_of(&boxes, |n| CellId(u32::from(n == 2)));
        near(facts(&world), [20.3, 3.0]);
        world.graph.portals.push(Portal {
            cells: [CellId(0), CellId(1)],
            kind: PortalKind::Door,
            normal: [0.0, 0.0, -1.0],
            outline: vec![
                [2.0, 0.0, -0.3],
                [3.0, 0.0, -0.3],
                [3.0, 2.0, -0.3],
                [2.0, 2.0, -0.3],
            ],
            pieces: Vec::new(),
            area: 2.0,
            fittings: Vec::new(),
            why: Vec::new(),
        });
        world.graph.cells[0].portals = vec![enfilade_cpg::PortalId(0)];
        near(facts(&world), [20.0, 3.0]);
    }
}
