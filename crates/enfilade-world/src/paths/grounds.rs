//! Floors in construction: where spans of air stand on matter, how walkers step between them, and which are clear of drops.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use enfilade_cpg::CellId;
use enfilade_geom::{Aabb, DVec3, Triangle};

use crate::bodies::Agent;
use crate::layout::Layout;
use crate::paths::columns::{Span, Squares};

/// Marks the absence of a floor.
pub(crate) const NONE: u32 = u32::MAX;

/// Most squares: beyond that, they get wider.
pub(super) const MAX_SQUARES: f64 = 8e6;

/// Narrowest squares for a small walker, if there would be more than `MAX_FINE_SQUARES`. [Units: wu]
const FINE: f64 = 0.05;
const MAX_FINE_SQUARES: f64 = 5e5;

/// Most squares that triangles cover, each counted: beyond that, squares get wider.
const MAX_COVERED: f64 = 3e7;

/// Extent of floors outdoors around the rooms. [Units: wu]
const GROUND: f64 = 30.0;

/// A floor in construction.
pub(super) struct Ground {
    pub(super) square: u32,
    pub(super) y: f32,
    pub(super) ceiling: f32,
    pub(super) steps: [u32; 4],
}

/// Returns a box around all vertices, but not far beyond the rooms: the model may contain a sky.
pub(super) fn bounds_of(layout: &Layout, corners: impl Iterator<Item = DVec3>) -> Aabb {
    let finite = corners.filter(|p| p.is_finite());
    let all = finite.fold(Aabb::EMPTY, Aabb::including);
    let cells = (0..layout.n_cells() as u32).map(|c| layout.cell(CellId(c)));
    let rooms = cells.filter(|c| !c.is_outdoor);
    let rooms = rooms.fold(Aabb::EMPTY, |b, c| b.union(c.bounds));
    if rooms.is_empty() {
        all
    } else {
        all.intersection(rooms.expanded(GROUND))
    }
}

/// Returns squares of this side, or wider ones.
pub(super) fn squares_of(
    bounds: &Aabb,
    side: f64,
    triangles: impl Iterator<Item = Triangle>,
) -> Squares {
    let size = bounds.size().max(DVec3::ZERO);
    let side_of = |area: f64, n: f64| (area / n).sqrt();
    let all = size.x * size.z;
    // Estimate the squares covered within the bounds by areas in plan, and by lengths along the axes for borders.
    let (mut areas, mut lengths) = (0.0, 0.0);
    for t in triangles.filter(|t| t.iter().all(|p| p.is_finite())) {
        let whole = t.into_iter().fold(Aabb::EMPTY, Aabb::including);
        let size = whole.intersection(*bounds).size().max(DVec3::ZERO);
        let own = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).y.abs();
        areas += own.min(size.x * size.z);
        lengths += size.x + size.z;
    }
    let side = side
        .max(side_of(all, MAX_FINE_SQUARES).min(FINE))
        .max(side_of(all, MAX_SQUARES))
        .max(side_of(2.0 * areas, MAX_COVERED))
        .max(4.0 * lengths / MAX_COVERED)
        .max(1e-3);
    let n = |size: f64| (size / side).floor() as usize + 1;
    let origin = if bounds.is_empty() {
        [0.0; 2]
    } else {
        [bounds.min.x, bounds.min.z]
    };
    Squares {
        origin,
        side,
        n: [n(size.x), n(size.z)],
    }
}

pub(super) fn grounds(spans: &[Span], height: f32) -> Vec<Ground> {
    let above = spans.iter().skip(1).map(Some).chain([None]);
    let all = spans.iter().zip(above).filter(|(s, _)| s.is_floor);
    all.filter_map(|(span, above)| {
        let above = above.filter(|a| a.square == span.square);
        let ceiling = above.map_or(f32::INFINITY, |a| a.low);
        (ceiling - span.high >= height).then_some(Ground {
            square: span.square,
            y: span.high,
            ceiling,
            steps: [NONE; 4],
        })
    })
    .collect()
}

pub(super) fn first_of(squares: &Squares, floors: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut first = vec![0; squares.n[0] * squares.n[1] + 1];
    for square in floors {
        first[square as usize + 1] += 1;
    }
    for i in 1..first.len() {
        first[i] += first[i - 1];
    }
    first
}

/// Links each floor to the one nearest in height beside it.
pub(super) fn step_from_each(
    squares: &Squares,
    first: &[u32],
    grounds: &mut [Ground],
    walker: &Agent,
) {
    for i in 0..grounds.len() {
        let Ground {
            square, y, ceiling, ..
        } = grounds[i];
        let at = [
            square as usize % squares.n[0],
            square as usize / squares.n[0],
        ];
        for (direction, axis) in [(0, 0), (1, 1)] {
            let mut to = at;
            to[axis] += 1;
            if to[axis] == squares.n[axis] {
                continue;
            }
            let to = squares.number(to);
            let beside = (first[to]..first[to + 1]).filter(|&j| {
                let other = &grounds[j as usize];
                let room = ceiling.min(other.ceiling) - y.max(other.y);
                (other.y - y).abs() <= walker.step as f32 && room >= walker.height as f32
            });
            let rise = |j: &u32| (grounds[*j as usize].y - y).abs();
            if let Some(j) = beside.min_by(|a, b| rise(a).total_cmp(&rise(b))) {
                // If two floors lead to one, it keeps the nearer.
                let other = grounds[j as usize].steps[direction + 2];
                if other != NONE {
                    if rise(&other) <= rise(&j) {
                        continue;
                    }
                    grounds[other as usize].steps[direction] = NONE;
                }
                grounds[i].steps[direction] = j;
                grounds[j as usize].steps[direction + 2] = i as u32;
            }
        }
    }
}

/// Returns per floor the directions in which it ends at a drop, one bit each, rather than at something that a walker touches.
pub(super) fn edges_of(
    squares: &Squares,
    spans: &[Span],
    grounds: &[Ground],
    walker: &Agent,
) -> Vec<u8> {
    let first = first_of(squares, spans.iter().map(|s| s.square));
    let is_drop = |ground: &Ground, direction: usize| {
        let Some(beside) = squares.beside(ground.square, direction) else {
            return true;
        };
        let low = ground.y + walker.step as f32;
        let high = ground.y + walker.height as f32;
        let column = &spans[first[beside] as usize..first[beside + 1] as usize];
        !column.iter().any(|s| s.high > low && s.low < high)
    };
    let bits = |ground: &Ground| {
        let ends = (0..4).filter(|&d| ground.steps[d] == NONE && is_drop(ground, d));
        ends.fold(0, |bits, d| bits | 1 << d)
    };
    grounds.iter().map(bits).collect()
}

/// Marks the floors that are at least `radius` from the nearest drop.
pub(super) fn clear(squares: &Squares, grounds: &[Ground], edges: &[u8], radius: f64) -> Vec<bool> {
    // Offset from each floor to the nearest border, in half squares.
    let mut offset = vec![[i16::MAX / 4; 2]; grounds.len()];
    let length = |v: [i16; 2]| i32::from(v[0]).pow(2) + i32::from(v[1]).pow(2);
    let directions: [[i16; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];
    let mut heap = BinaryHeap::new();
    for (i, edges) in edges.iter().enumerate().filter(|e| *e.1 != 0) {
        offset[i] = directions[edges.trailing_zeros() as usize];
        heap.push(Reverse((1, i as u32)));
    }
    let reach = (2.0 * radius / squares.side).max(0.0);
    while let Some(Reverse((far, i))) = heap.pop() {
        let own = offset[i as usize];
        if far > length(own) || f64::from(far).sqrt() >= reach {
            continue;
        }
        let steps = grounds[i as usize].steps;
        for (direction, &to) in steps.iter().enumerate() {
            if to == NONE {
                continue;
            }
            // Along the diagonal, too: otherwise distances would be Manhattan distances.
            let turn = grounds[to as usize].steps[(direction + 1) % 4];
            let [a, b] = [direction, (direction + 1) % 4].map(|d| directions[d]);
            let straight = [own[0] - 2 * a[0], own[1] - 2 * a[1]];
            let slanted = [straight[0] - 2 * b[0], straight[1] - 2 * b[1]];
            for (to, v) in [(to, straight), (turn, slanted)] {
                if to != NONE && length(v) < length(offset[to as usize]) {
                    offset[to as usize] = v;
                    heap.push(Reverse((length(v), to)));
                }
            }
        }
    }
    (offset.iter())
        .map(|&v| f64::from(length(v)).sqrt() >= reach)
        .collect()
}
