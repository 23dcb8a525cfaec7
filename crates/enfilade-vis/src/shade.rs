//! Occlusion, by walls, of the space behind a portal.
//!
//! The visible volume behind a portal is everything in front of it; in a street, that is the window's whole facade.
//! Here the lines from the portal to a triangle are tested against the walls, as `occlude` does between two portals:
//! by sheets, and by all walls in one plane (`cover`). For an object, the lines to the faces of its box by which they
//! may enter are tested first, and if that is not enough, those to its triangles. Where a wall's plane divides lines,
//! they are split there, and where walls leave gaps, only lines through those are followed; other lines are halved.
//!
//! A few random lines find most of what is visible. Errs to visible: lines not settled within [`MAX_BEAMS`] pieces
//! count as free.

use enfilade_geom::{Aabb, DVec3, Ray, Triangle};

use crate::cover::{Cover, Near, narrowed};
use crate::dirs::Dirs;
use crate::occlude::{APART, spread};
use crate::rng::Rng;
use crate::sheets::{Beam, Hull, Part, Sheets, cut, halves, inner_point, size};

/// Most pieces that the lines to one face of a box, or to one triangle, are cut into.
const MAX_BEAMS: usize = 24;
/// Random lines tried first.
const LINES: usize = 16;
/// Shortest polygon that is halved, in distances that count as apart.
const SHORT: f64 = 1e3;
/// Objects with more triangles are tested by their boxes alone.
const MAX_TRIANGLES: usize = 64;

/// Outward normals of the faces of a box, in the order of [`Aabb::faces`].
const OUTWARD: [DVec3; 6] = [
    DVec3::NEG_X,
    DVec3::X,
    DVec3::NEG_Y,
    DVec3::Y,
    DVec3::NEG_Z,
    DVec3::Z,
];

/// Walls that hide things from portals.
pub(crate) struct Shade<'a> {
    pub(crate) sheets: &'a Sheets<'a>,
    pub(crate) dirs: &'a Dirs,
    /// Distance that lines keep inside an opening's edges. [Units: wu]
    pub(crate) inset: f64,
    /// Rounding of `normal · point`. [Units: wu]
    pub(crate) rounding: f64,
    /// The world's tolerance: the distance by which planes and vertices may be moved. [Units: wu]
    pub(crate) slack: f64,
}

/// Lines from one polygon to another.
#[derive(Clone)]
struct Lines {
    ends: [Vec<DVec3>; 2],
    /// How far each end may reach past a wall and still be on one side of it. [Units: wu]
    strips: [f64; 2],
}

impl Lines {
    fn with(&self, end: usize, part: Vec<DVec3>) -> Self {
        let mut lines = self.clone();
        lines.ends[end] = part;
        lines
    }

    /// Returns the lines to and from the halves of the larger end; `None` if that is too short.
    fn halves(&self, least: f64) -> Option<Vec<Self>> {
        let end = usize::from(size(&self.ends[1]) > size(&self.ends[0]));
        let mut halves = halves(&self.ends[end]).to_vec();
        halves.retain(|half| !half.is_empty());
        let is_long = halves.iter().all(|half| size(half) >= least);
        let with = |half| self.with(end, half);
        is_long.then(|| halves.into_iter().map(with).collect())
    }
}

impl Shade<'_> {
    /// Returns `true` if no line through an opening reaches a triangle, or the triangles of an object, behind it.
    pub(crate) fn hides(&self, dir: usize, triangles: &[Triangle], bounds: &Aabb) -> bool {
        let opening = &self.dirs.all[dir];
        let height = (opening.low + opening.high) * 0.5;
        let parts = self.dirs.open_parts(dir, self.inset);
        let parts: Vec<_> = parts.into_iter().filter(|part| part.len() > 2).collect();
        if triangles.len() > 1 && self.hides_box(dir, &bounds.expanded(self.slack)) {
            return true;
        }
        if triangles.len() > MAX_TRIANGLES {
            return false;
        }
        // Parts in the opening's plane are seen at most edge-on.
        let behind = |t: &Triangle| cut(t, opening.normal, height + self.inset);
        let to: Vec<_> = triangles
            .iter()
            .map(behind)
            .filter(|t| !t.is_empty())
            .collect();
        let both = || {
            parts
                .iter()
                .flat_map(|part| to.iter().map(move |to| [part, to]))
        };
        // A line quickly finds most of what is visible.
        !both().any(|ends| self.has_line(ends, LINES.div_ceil(to.len()), true))
            && both().all(|ends| self.closes(ends.map(Clone::clone), self.inset, true))
    }

    /// Returns `true` if no line through an opening reaches a box behind it.
    fn hides_box(&self, dir: usize, bounds: &Aabb) -> bool {
        let opening = &self.dirs.all[dir];
        let height = (opening.low + opening.high) * 0.5;
        let parts = self.dirs.open_parts(dir, self.inset);
        let parts = parts.iter().filter(|part| part.len() > 2);
        // Lines that begin inside the box enter through none of its faces.
        if Aabb::of_points(parts.clone().flatten()).overlaps(bounds) {
            return false;
        }
        let faces = bounds.faces();
        let center = bounds.center();
        for part in parts {
            for (face, outward) in faces.iter().zip(OUTWARD) {
                // `outward` is the axis along which the face is offset from the center.
                debug_assert!((face[0] - center).dot(outward) >= 0.0);
                let from = cut(part, outward, outward.dot(face[0]));
                let to = cut(face, opening.normal, height);
                if from.is_empty() || to.is_empty() {
                    continue;
                }
                if self.has_line([&from, &to], LINES, false)
                    // A part of an object this little in front of a wall may as well lie in the wall.
                    || !self.closes([from, to], self.slack, false)
                {
                    return false;
                }
            }
        }
        true
    }

    fn near(&self) -> Near {
        Near {
            apart: APART * self.rounding,
            slack: self.slack,
        }
    }

    /// Returns `true` if one of `n` random lines from a polygon to another is free; the second may be part of a wall.
    fn has_line(&self, ends: [&Vec<DVec3>; 2], n: usize, may_be_wall: bool) -> bool {
        let mut rng = Rng::new(0);
        (0..n).any(|_| {
            let [a, b] = ends.map(|end| point_in(end, &mut rng));
            let is_same = |i| may_be_wall && self.sheets.is_in_plane(i, ends[1], self.slack);
            !self.sheets.bvh.any_hit(a, b, is_same)
        })
    }

    /// Returns `true` if walls close all lines from one polygon to the other, which may be part of a wall.
    fn closes(&self, ends: [Vec<DVec3>; 2], strip: f64, may_be_wall: bool) -> bool {
        let near = self.near();
        let mut beams = vec![Lines {
            ends,
            strips: [strip; 2],
        }];
        let mut n_done = 0;
        while let Some(lines) = beams.pop() {
            n_done += 1;
            if n_done > MAX_BEAMS {
                return false;
            }
            let ends = &lines.ends;
            let line = [inner_point(&ends[0]), inner_point(&ends[1])];
            let mut hits: Vec<(f64, u32)> = Vec::new();
            let ray = Ray::segment(line[0], line[1]);
            self.sheets.bvh.for_each_hit(&ray, |hit| {
                hits.push((hit.t, hit.triangle));
            });
            if may_be_wall {
                hits.retain(|hit| !self.sheets.is_in_plane(hit.1, &ends[1], self.slack));
            }
            if hits.is_empty() {
                return false;
            }
            hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            match self.close(&lines, &hits, line, near) {
                Cover::Closed => {}
                Cover::Cuts(end, plane) => {
                    for (normal, least) in [(plane.normal, -plane.d), (-plane.normal, plane.d)] {
                        let part = cut(&ends[end], normal, least + 4.0 * near.apart);
                        if !part.is_empty() {
                            beams.push(lines.with(end, part));
                        }
                    }
                }
                Cover::Gaps(_, gaps) => {
                    for gap in gaps {
                        let Some(ends) = narrowed([&ends[0], &ends[1]], &gap, near) else {
                            continue;
                        };
                        let narrow = Lines { ends, ..lines };
                        let Some(more) = self.followed(&narrow, gap.to_vec(), may_be_wall) else {
                            return false;
                        };
                        beams.extend(more);
                    }
                }
                Cover::Open => match lines.halves(SHORT * near.apart) {
                    Some(halves) => beams.extend(halves),
                    None => return false,
                },
            }
        }
        true
    }

    /// Returns lines of which all must be closed so that those through a gap are: on the side of the gap where a wall is in the
    /// way, else from halves. `None` if there is nothing to halve.
    fn followed(&self, lines: &Lines, gap: Vec<DVec3>, may_be_wall: bool) -> Option<Vec<Lines>> {
        let apart = self.near().apart;
        let [from, to] = &lines.ends;
        let middle = inner_point(&gap);
        let is_same = |i| may_be_wall && self.sheets.is_in_plane(i, to, self.slack);
        let bvh = &self.sheets.bvh;
        let end = if bvh.any_hit(middle, inner_point(to), is_same) {
            0
        } else if bvh.any_hit(inner_point(from), middle, |_| false) {
            1
        } else {
            return lines.halves(SHORT * apart);
        };
        let mut lines = lines.with(end, gap);
        // There is nothing beside a gap into which a part of it may be moved.
        lines.strips[end] = 4.0 * apart;
        Some(vec![lines])
    }

    /// Returns the effect on lines of the walls that one of them, `line`, hits.
    fn close(&self, lines: &Lines, hits: &[(f64, u32)], line: [DVec3; 2], near: Near) -> Cover {
        let mut best = Cover::Open;
        for i in spread(hits.len()) {
            let found = self
                .sheets
                .cover(hits[i].1, &lines.ends, lines.strips, near);
            let is_better = match (&found, &best) {
                (Cover::Closed, _) => return Cover::Closed,
                (Cover::Open, _) | (_, Cover::Cuts(..)) => false,
                (Cover::Gaps(share, _), Cover::Gaps(least, _)) => share < least,
                _ => true,
            };
            if is_better {
                best = found;
            }
        }
        let beam = Beam {
            ends: lines.ends.clone(),
            what: Part::Open,
        };
        let hull = Hull::new(&beam, near.apart);
        let grows = |i: usize| self.sheets.grown(hits[i].1, &beam, &hull, line).is_some();
        if spread(hits.len()).any(grows) {
            Cover::Closed
        } else {
            best
        }
    }
}

/// Returns a random point of a convex polygon, not evenly distributed.
fn point_in(points: &[DVec3], rng: &mut Rng) -> DVec3 {
    let k = 1 + rng.below(points.len() - 2);
    let [mut u, mut v] = [rng.unit(), rng.unit()];
    if u + v > 1.0 {
        [u, v] = [1.0 - u, 1.0 - v];
    }
    points[0] + (points[k] - points[0]) * u + (points[k + 1] - points[0]) * v
}

#[cfg(test)]
mod tests {
    use enfilade_cpg::SightGraph;
    use enfilade_geom::Bvh;

    use super::*;
    use crate::hourglass::Hourglasses;

    /// A square opening between two cells, one unit wide around the z axis, crossed upwards.
    const OPENING: [[f64; 3]; 4] = [
        [-0.5, -0.5, 0.0],
        [0.5, -0.5, 0.0],
        [0.5, 0.5, 0.0],
        [-0.5, 0.5, 0.0],
    ];

    fn rectangle([x0, y0]: [f64; 2], [x1, y1]: [f64; 2], z: f64) -> [Triangle; 2] {
        let p = |x, y| DVec3::new(x, y, z);
        [
            [p(x0, y0), p(x1, y0), p(x1, y1)],
            [p(x0, y0), p(x1, y1), p(x0, y1)],
        ]
    }

    fn hides(walls: &[Triangle], target: &[Triangle]) -> bool {
        let winding = OPENING.map(DVec3::from_array).to_vec();
        let graph = SightGraph::of_windings(2, [([0, 1], winding)]);
        let glasses = Hourglasses::new(&graph).unwrap();
        let bvh = Bvh::build(walls);
        let shade = Shade {
            sheets: &Sheets::new(walls, &bvh),
            dirs: glasses.dirs(),
            inset: glasses.clearance(),
            rounding: glasses.tolerance().rounding,
            slack: 2e-5,
        };
        let bounds = Aabb::of_points(target.iter().flatten());
        shade.hides(glasses.place(0), target, &bounds)
    }

    /// Three walls side by side in one plane, without shared edges.
    fn row(z: f64) -> Vec<Triangle> {
        let walls = [
            rectangle([-9.0, -9.0], [-0.1, 9.0], z),
            rectangle([-0.1, -9.5], [0.2, 9.5], z),
            rectangle([0.2, -9.0], [9.0, 9.0], z),
        ];
        walls.concat()
    }

    #[test]
    fn walls_side_by_side_hide_what_is_behind_them() {
        let target = rectangle([-1.0, -1.0], [1.0, 1.0], 4.0);
        let walls = row(1.0);
        assert!(hides(&walls, &target[..1]) && hides(&walls, &target));
        // Without the middle wall there is a way through, and nothing in front of the walls is hidden.
        let gap = [&walls[..2], &walls[4..]].concat();
        assert!(!hides(&gap, &target[..1]) && !hides(&gap, &target));
        let before = rectangle([-1.0, -1.0], [1.0, 1.0], 0.9);
        assert!(!hides(&walls, &before[..1]) && !hides(&walls, &before));
    }

    #[test]
    fn two_walls_that_meet_hide_what_neither_does() {
        // Lines to what stands in a house cross its front, or pass above that and cross its roof.
        let front = rectangle([-9.0, -9.0], [9.0, 0.25], 1.0);
        let roof = |from: f64| {
            let level = |p: DVec3| DVec3::new(p.x, p.z, p.y);
            rectangle([-9.0, from], [9.0, 9.0], 0.25).map(|t| t.map(level))
        };
        let target = [[-0.3, 0.0, 4.0], [0.3, 0.0, 4.0], [0.0, 0.0, 4.4]].map(DVec3::from_array);
        assert!(hides(&[front, roof(1.0)].concat(), &[target]));
        assert!(!hides(&front, &[target]) && !hides(&roof(1.0), &[target]));
        // A slit between them shows it.
        assert!(!hides(&[front, roof(1.3)].concat(), &[target]));
    }

    #[test]
    fn a_screen_behind_a_doorway_hides_what_is_beyond() {
        let front = [
            rectangle([-9.0, -9.0], [9.0, -0.3], 1.0),
            rectangle([-9.0, 0.3], [9.0, 9.0], 1.0),
            rectangle([-9.0, -0.3], [-0.2, 0.3], 1.0),
            rectangle([0.2, -0.3], [9.0, 0.3], 1.0),
        ];
        let target = rectangle([-1.0, -1.0], [1.0, 1.0], 4.0);
        let screen = |x: f64| rectangle([-x, -0.5], [x, 0.5], 1.5);
        let walls = |x: f64| [front.concat(), screen(x).to_vec()].concat();
        assert!(hides(&walls(0.4), &target));
        // Lines from the edge of the opening pass a narrow one.
        assert!(!hides(&walls(0.25), &target) && !hides(&screen(0.4), &target));
    }

    #[test]
    fn what_sticks_out_of_a_wall_is_seen_and_what_stands_behind_it_is_not() {
        let upright = |low: f64, high: f64| {
            let p = |y, z| DVec3::new(0.3, y, z);
            [p(-0.2, low), p(0.3, low), p(0.1, high)]
        };
        let walls = row(1.0);
        assert!(!hides(&walls, &[upright(0.5, 2.0)]));
        assert!(!hides(&walls, &[upright(0.999, 2.0)]));
        // It begins in the wall, like a wall that two rooms share.
        assert!(hides(&walls, &[upright(1.0, 2.0)]));
        // A triangle in the wall itself is visible.
        assert!(!hides(&walls, &walls[..1]));
    }

    #[test]
    fn no_line_reaches_what_counts_as_hidden() {
        let mut n_hidden = 0;
        for seed in 0..600 {
            let mut rng = Rng::new(seed);
            let mut range = |low: f64, high: f64| low + (high - low) * rng.unit();
            let mut walls = Vec::new();
            for k in 0..8 {
                let z = f64::round(range(1.0, 4.0)) * 0.5;
                let [x, y] =
                    [range(-2.0, 0.5), range(-2.0, 0.5)].map(|x| f64::round(x * 4.0) / 4.0);
                let size = [range(0.5, 4.0), range(0.5, 4.0)];
                let wall = rectangle([x, y], [x + size[0], y + size[1]], z);
                // Some stand across, from the plane of another on, as a floor meets a front.
                let across = |p: DVec3| match k % 4 {
                    2 => DVec3::new(p.z - 1.5, p.y, 0.5 + (p.x + 2.0) / 2.0),
                    3 => DVec3::new(p.x, p.z - 1.5, 0.5 + (p.y + 2.0) / 2.0),
                    _ => p,
                };
                walls.extend(wall.map(|t| t.map(across)));
            }
            let at = [range(-1.0, 1.0), range(-1.0, 1.0), range(0.4, 3.0)];
            let mut corner = || DVec3::from_array(at.map(|x| x + range(-0.5, 0.5)));
            let target = [corner(), corner(), corner()];
            if !hides(&walls, &[target]) {
                continue;
            }
            n_hidden += 1;
            for _ in 0..2000 {
                let opening = OPENING.map(DVec3::from_array);
                let [a, b] = [&opening[..], &target].map(|end| point_in(end, &mut rng));
                let blocks = |t: &Triangle| {
                    let ray = Ray::segment(a, b);
                    enfilade_geom::ray::hit_triangle(&ray, t).is_some()
                };
                assert!(
                    b.z < 0.0 || walls.iter().any(blocks),
                    "seed {seed}: {a} sees {b}"
                );
            }
        }
        assert!(n_hidden > 60, "{n_hidden}");
    }
}
