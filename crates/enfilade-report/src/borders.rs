//! Borders of the labels of a section, traced along the grid and simplified.
//!
//! They are cut at the points where three labels meet and simplified piece by piece, each the same way from both
//! sides, so that neighbors still share them.

use std::collections::BTreeMap;

use enfilade_geom::DVec2;

use crate::section::{Label, Region, Section};

/// Border edges by their start vertex.
type Edges = BTreeMap<(i64, i64), Vec<(i64, i64)>>;

impl Section {
    /// Every label except the outdoors, with its region.
    pub(crate) fn regions(&self) -> BTreeMap<Label, Region> {
        let mut edges = self.border_edges();
        let depth = self.depths();
        let mut regions: BTreeMap<Label, Region> = BTreeMap::new();
        let mut deepest: BTreeMap<Label, (u32, usize)> = BTreeMap::new();
        let mut counts: BTreeMap<Label, usize> = BTreeMap::new();
        let mut boxes: BTreeMap<Label, [[usize; 2]; 2]> = BTreeMap::new();
        for (i, &label) in self.labels.iter().enumerate() {
            *counts.entry(label).or_default() += 1;
            let at = [i % self.width, i / self.width];
            let [low, high] = boxes.entry(label).or_insert([at, at]);
            for k in 0..2 {
                low[k] = low[k].min(at[k]);
                high[k] = high[k].max(at[k]);
            }
            let best = deepest.entry(label).or_insert((0, i));
            if depth[i] > best.0 {
                *best = (depth[i], i);
            }
        }
        for (label, count) in counts {
            if label == Label::Outdoor {
                continue;
            }
            let (_, i) = deepest[&label];
            let [first, last] = boxes[&label];
            let (row, column) = ((i / self.width) as f64 + 0.5, (i % self.width) as f64 + 0.5);
            let borders = edges
                .remove(&label)
                .map_or_else(Vec::new, |e| self.trace(e));
            regions.insert(
                label,
                Region {
                    borders,
                    area: count as f64 * self.step * self.step,
                    inner: self.origin + DVec2::new(column, row) * self.step,
                    first,
                    size: [last[0] + 1 - first[0], last[1] + 1 - first[1]],
                },
            );
        }
        regions
    }

    /// Border edges of each label, from vertex to vertex, with the label on the right as drawn.
    fn border_edges(&self) -> BTreeMap<Label, Edges> {
        let mut out: BTreeMap<Label, Edges> = BTreeMap::new();
        for row in 0..self.height as i64 {
            for column in 0..self.width as i64 {
                let label = self.label(column, row);
                if label == Label::Outdoor {
                    continue;
                }
                let corners = [
                    (column, row),
                    (column + 1, row),
                    (column + 1, row + 1),
                    (column, row + 1),
                ];
                let sides = [(0, -1), (1, 0), (0, 1), (-1, 0)];
                for k in 0..4 {
                    if self.label(column + sides[k].0, row + sides[k].1) != label {
                        let starts = out.entry(label).or_default();
                        starts
                            .entry(corners[k])
                            .or_default()
                            .push(corners[(k + 1) % 4]);
                    }
                }
            }
        }
        out
    }

    /// Returns `true` if borders of more than two regions, or two borders, meet at a vertex.
    fn is_junction(&self, (x, z): (i64, i64)) -> bool {
        let around = [
            self.label(x - 1, z - 1),
            self.label(x, z - 1),
            self.label(x, z),
            self.label(x - 1, z),
        ];
        (0..4).filter(|&k| around[k] != around[(k + 1) % 4]).count() > 2
    }

    /// Links edges into closed borders and simplifies them.
    fn trace(&self, mut edges: Edges) -> Vec<Vec<DVec2>> {
        let mut borders = Vec::new();
        while let Some((&start, _)) = edges.first_key_value() {
            let (mut path, mut at, mut heading) = (Vec::new(), start, (0, 0));
            while let Some(nexts) = edges.get_mut(&at) {
                // There are two continuations where the label touches itself at a vertex: turn right, which stays at
                // the same square.
                let right = (at.0 - heading.1, at.1 + heading.0);
                let k = nexts
                    .iter()
                    .position(|&n| n == right)
                    .unwrap_or(nexts.len() - 1);
                let next = nexts.swap_remove(k);
                if nexts.is_empty() {
                    edges.remove(&at);
                }
                path.push(at);
                heading = (next.0 - at.0, next.1 - at.1);
                at = next;
                if at == start {
                    break;
                }
            }
            borders.push(self.simplified(path));
        }
        borders
    }

    /// Simplifies a closed border between its junctions.
    fn simplified(&self, mut path: Vec<(i64, i64)>) -> Vec<DVec2> {
        // Without junctions, the smallest vertex and the one farthest from it stay.
        let mut fixed: Vec<usize> = (0..path.len())
            .filter(|&i| self.is_junction(path[i]))
            .collect();
        if fixed.is_empty() {
            let least = (0..path.len()).min_by_key(|&i| path[i]).unwrap_or(0);
            path.rotate_left(least);
            fixed.push(0);
        }
        path.rotate_left(fixed[0]);
        let first = fixed[0];
        let mut stops: Vec<usize> = fixed.iter().map(|i| i - first).collect();
        stops.push(path.len());
        path.push(path[0]);
        let mut out = Vec::new();
        for stop in stops.windows(2) {
            let mut arc: Vec<DVec2> = path[stop[0]..=stop[1]]
                .iter()
                .map(|&c| self.at(c))
                .collect();
            // The neighbor walks the other way; both simplify from the same end.
            let ends = (path[stop[0]], path[stop[1]]);
            let next = (path[stop[0] + 1], path[stop[1] - 1]);
            let is_reversed = (ends.1, next.1) < (ends.0, next.0);
            if is_reversed {
                arc.reverse();
            }
            // The vertices of a slanted line's steps lie up to √2 steps apart across it.
            let mut kept = simplify(&arc, 1.5 * self.step);
            if is_reversed {
                kept.reverse();
            }
            kept.pop();
            out.extend(kept);
        }
        out
    }

    /// Steps from each grid point to the nearest one of another label, in rounds over the four neighbors.
    fn depths(&self) -> Vec<u32> {
        let (w, h) = (self.width as i64, self.height as i64);
        let mut depth = vec![0_u32; self.labels.len()];
        let mut round: Vec<(i64, i64)> = Vec::new();
        let sides = [(0, -1), (1, 0), (0, 1), (-1, 0)];
        for row in 0..h {
            for column in 0..w {
                let label = self.label(column, row);
                // Points beyond the grid count as another label, even for a region that reaches its rim.
                let is_border = sides.iter().any(|s| {
                    let (c, r) = (column + s.0, row + s.1);
                    !(0..w).contains(&c) || !(0..h).contains(&r) || self.label(c, r) != label
                });
                if is_border {
                    depth[(row * w + column) as usize] = 1;
                    round.push((column, row));
                }
            }
        }
        let mut steps = 1;
        while !round.is_empty() {
            steps += 1;
            let mut next = Vec::new();
            for (column, row) in round {
                for s in sides {
                    let (c, r) = (column + s.0, row + s.1);
                    if (0..w).contains(&c) && (0..h).contains(&r) {
                        let i = (r * w + c) as usize;
                        if depth[i] == 0 {
                            depth[i] = steps;
                            next.push((c, r));
                        }
                    }
                }
            }
            round = next;
        }
        depth
    }
}

/// Ramer–Douglas–Peucker: the fewest of the points, ends kept, that stay within `tolerance`.
fn simplify(points: &[DVec2], tolerance: f64) -> Vec<DVec2> {
    let mut keep = vec![false; points.len()];
    keep[0] = true;
    keep[points.len() - 1] = true;
    let mut work = vec![(0, points.len() - 1)];
    while let Some((first, last)) = work.pop() {
        let (a, b) = (points[first], points[last]);
        let along = b - a;
        let length = along.length();
        let distance = |p: DVec2| {
            // A closed arc has no line; use the distance from its end.
            if length > 0.0 {
                along.perp_dot(p - a).abs() / length
            } else {
                p.distance(a)
            }
        };
        let mut worst = (tolerance, 0);
        for (i, &p) in points.iter().enumerate().take(last).skip(first + 1) {
            let d = distance(p);
            if d > worst.0 {
                worst = (d, i);
            }
        }
        if worst.1 > 0 {
            keep[worst.1] = true;
            work.extend([(first, worst.1), (worst.1, last)]);
        }
    }
    points
        .iter()
        .zip(keep)
        .filter(|(_, k)| *k)
        .map(|(p, _)| *p)
        .collect()
}
