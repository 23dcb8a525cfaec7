//! Planes that cut space into bricks, across each of three axes.

use std::collections::BTreeMap;

use enfilade_cpg::{PortalKind, World};
use enfilade_geom::DVec3;

use super::frame::Frame;
use crate::surfaces::{BoundarySurface, RoomSurfaces, ground_level};

/// Least distance of two planes: several times the client's tolerance. [Units: wu]
const NEAR: f64 = 0.03;
/// Most bricks of a world: beyond, planes keep a larger distance.
const MOST_BRICKS: usize = 1_500_000;
/// Least area of a plane of a room that cuts, by how fine the room is. [Units: wu²]
const AREAS: [f64; 3] = [0.5, 0.15, 0.04];
/// Least width of the largest surface in it. [Units: wu]
const WIDTHS: [f64; 3] = [0.3, 0.1, 0.04];
/// Longest step across a surface that is along no axis, by how fine the room is. [Units: wu]
const STEPS: [f64; 3] = [1.0, 0.5, 0.25];
/// Least area of a way between rooms that cuts. [Units: wu²]
const WAY: f64 = 0.5;
/// Width of the bricks around all rooms: more than twice as thick as a construction may be. [Units: wu]
const AROUND: f64 = 4.0;
/// Cosine of the largest angle between a surface and the axis that it is across.
const ALONG: f64 = 0.9995;

/// A plane across an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    pub(crate) at: f64,
    /// Area of the surfaces in it: of two planes too close, the one with more stays.
    weight: f64,
}

/// Planes across each axis, ascending.
pub(crate) struct Lines {
    pub(crate) axes: [Vec<Line>; 3],
}

impl Lines {
    /// Returns the planes of rooms, of which each cell has a degree of `fineness`.
    pub(crate) fn of_rooms(
        world: &World,
        frame: &Frame,
        rooms: &[RoomSurfaces],
        fineness: &[u32],
    ) -> Self {
        let mut found: [Vec<Line>; 3] = Default::default();
        for room in rooms {
            add_planes(room, fineness[room.cell.idx()] as usize, &mut found);
        }
        for portal in &world.graph.portals {
            let is_way = portal.kind == PortalKind::Open && f64::from(portal.area) >= WAY;
            if is_way && portal.cells.iter().all(|&c| world.graph[c].is_room()) {
                let normal = frame.to_frame(portal.normal.map(f64::from));
                let outline = frame.outline(&portal.outline);
                let weight = f64::from(portal.area);
                for axis in (0..3).filter(|&a| normal[a].abs() > ALONG) {
                    let at = outline[0].to_array()[axis];
                    found[axis].push(Line { at, weight });
                }
            }
        }
        let mut near = NEAR;
        let axes = loop {
            let axes = found.each_mut().map(|all| kept(all, near));
            if axes.iter().map(Vec::len).product::<usize>() <= MOST_BRICKS {
                break axes;
            }
            near *= 1.5;
        };
        let mut lines = Self { axes };
        lines.surround();
        // Walls in the ground end at its surface.
        let ground = ground_level(world).unwrap_or(f64::NEG_INFINITY);
        let heights = &mut lines.axes[1];
        if heights.iter().all(|l| (l.at - ground).abs() >= 0.3) && ground > heights[0].at {
            let at = heights.partition_point(|l| l.at < ground);
            heights.insert(
                at,
                Line {
                    at: ground,
                    weight: 0.0,
                },
            );
        }
        lines
    }

    /// Adds a plane beyond each end.
    fn surround(&mut self) {
        for lines in &mut self.axes {
            let ends = [lines.first(), lines.last()].map(|l| l.map_or(0.0, |l| l.at));
            let [low, high] = [ends[0] - AROUND, ends[1] + AROUND];
            let weight = f64::INFINITY;
            lines.insert(0, Line { at: low, weight });
            lines.push(Line { at: high, weight });
        }
    }

    /// Drops planes that are near to others, the farther the more often it is called.
    pub(crate) fn thin(&mut self, times: i32) {
        let near = NEAR * 1.5_f64.powi(times);
        self.axes = self.axes.each_mut().map(|all| kept(all, near));
    }

    /// Drops one of the two closest planes around each surface, and returns `false` if there was none to drop.
    pub(crate) fn merge_around<'s>(
        &mut self,
        surfaces: impl Iterator<Item = &'s BoundarySurface>,
    ) -> bool {
        let mut dropped: BTreeMap<[usize; 2], ()> = BTreeMap::new();
        for surface in surfaces {
            let (low, high) = extent(surface);
            let mut closest: Option<(f64, [usize; 2])> = None;
            for (axis, lines) in self.axes.iter().enumerate() {
                for (i, pair) in lines.windows(2).enumerate() {
                    let gap = pair[1].at - pair[0].at;
                    let is_around = pair[0].at >= low[axis] - NEAR / 2.0
                        && pair[1].at <= high[axis] + NEAR / 2.0;
                    let lighter = usize::from(pair[1].weight < pair[0].weight);
                    if is_around && closest.is_none_or(|c| gap < c.0) {
                        closest = Some((gap, [axis, i + lighter]));
                    }
                }
            }
            if let Some((_, [axis, i])) = closest {
                // One of three in a row stays.
                let has_near = [i.wrapping_sub(1), i + 1].map(|k| dropped.contains_key(&[axis, k]));
                if has_near == [false; 2] {
                    dropped.insert([axis, i], ());
                }
            }
        }
        for [axis, i] in dropped.keys().rev() {
            self.axes[*axis].remove(*i);
        }
        !dropped.is_empty()
    }
}

/// Returns planes that are not near to one with more area, ascending.
fn kept(all: &mut [Line], near: f64) -> Vec<Line> {
    all.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.at.total_cmp(&b.at)));
    let mut kept: Vec<Line> = Vec::new();
    for line in all {
        if kept.iter().all(|k| (k.at - line.at).abs() >= near) {
            kept.push(*line);
        }
    }
    kept.sort_by(|a, b| a.at.total_cmp(&b.at));
    kept
}

fn extent(surface: &BoundarySurface) -> ([f64; 3], [f64; 3]) {
    let points = surface.loops.iter().flatten().map(|&p| DVec3::from(p));
    let (low, high) = points.fold((DVec3::MAX, DVec3::MIN), |(l, h), p| (l.min(p), h.max(p)));
    (low.to_array(), high.to_array())
}

/// Adds the planes of a room that are large, its ends, and steps across its large surfaces that are along no axis.
fn add_planes(room: &RoomSurfaces, fineness: usize, found: &mut [Vec<Line>; 3]) {
    // Area, area × place, and width of the widest, by axis, side and place.
    let mut planes: BTreeMap<(usize, bool, i64), [f64; 3]> = BTreeMap::new();
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for surface in &room.surfaces {
        let (from, to) = extent(surface);
        for axis in 0..3 {
            low[axis] = low[axis].min(from[axis]);
            high[axis] = high[axis].max(to[axis]);
        }
        if surface.opening().is_some() {
            continue;
        }
        let sizes = [0, 1, 2].map(|a| to[a] - from[a]);
        let longest = DVec3::from(sizes).length().max(f64::MIN_POSITIVE);
        let width = surface.area / longest;
        if let Some(axis) = (0..3).find(|&a| surface.normal[a].abs() > ALONG) {
            let at = (from[axis] + to[axis]) / 2.0;
            let key = (
                axis,
                surface.normal[axis] > 0.0,
                (at / 0.005).round() as i64,
            );
            let sums = planes.entry(key).or_default();
            sums[0] += surface.area;
            sums[1] += surface.area * at;
            sums[2] = sums[2].max(width);
        } else if surface.area >= AREAS[fineness] && width >= WIDTHS[fineness] {
            for axis in (0..3).filter(|&a| surface.normal[a].abs() > 0.05) {
                let n = (sizes[axis] / STEPS[fineness]).ceil();
                let steps = (0..=n as usize).map(|i| from[axis] + sizes[axis] * i as f64 / n);
                let weight = 0.05 * surface.area;
                found[axis].extend(steps.map(|at| Line { at, weight }));
            }
        }
    }
    for ((axis, ..), [area, moment, width]) in planes {
        if area >= AREAS[fineness] && width >= WIDTHS[fineness] {
            let at = moment / area;
            found[axis].push(Line { at, weight: area });
        }
    }
    for (axis, lines) in found.iter_mut().enumerate() {
        lines.extend([low[axis], high[axis]].map(|at| Line { at, weight: 0.01 }));
    }
}
