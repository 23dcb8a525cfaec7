//! Occlusion by walls inside cells: a test whether all lines from one opening to another end at them.
//!
//! Planes between openings ignore a wall that juts into a cell. Here the lines from a piece of one opening to a piece
//! of another, a *beam*, are tested against the triangles themselves. A *sheet* is a set of triangles that share
//! edges; its rim consists of the edges that an odd number of them have. Suppose that the rim does not touch the hull
//! of the two pieces, no triangle touches the pieces, and one line of the beam crosses the sheet an odd number of
//! times. Then every line does: lines can be moved into each other inside the beam, and the number changes only by
//! two. Otherwise the larger piece is halved. A line that is free all the way shows that the cells see each other.
//!
//! The problem is that of Nirenstein, Blake and Gain, *Exact From-Region Visibility Culling* (EGWR 2002), who
//! subtract polyhedra in Plücker space. Halving needs no five-dimensional hulls, and each leaf can be checked by
//! itself. Errs to visible: lines not settled within [`MAX_BEAMS`] pieces count as free. Beams and sheets are in
//! `sheets`.

use enfilade_geom::{DVec3, Ray};
use rayon::prelude::*;

use crate::bits;
use crate::dirs::Dirs;
use crate::rays::{Line, walk};
use crate::search::{Closed, Search};
use crate::sheets::{Beam, Hull, Part, Sheets, cut, halves, inner_point, size, write_tree};

/// Lines tried between each two cells that only walls may hide from each other, and rounds of that, before beams.
const INSIST_LINES: usize = 50;
const INSIST_ROUNDS: u64 = 2;

/// Most pieces that the lines between two openings are cut into: in the first pass, in which a line that is easily
/// found saves the rest, and in the second.
const FEW_BEAMS: usize = 300;
const MAX_BEAMS: usize = 20_000;
/// Places along a line from which sheets are grown.
const MAX_SEEDS: usize = 6;
/// Distances that count as apart, in multiples of the rounding; a checker requires half of it.
pub(crate) const APART: f64 = 16.0;

/// Result for the lines from one opening to another.
enum Verdict {
    /// Proved by a tree of beams; `None` if it follows from neighbors.
    Closed(Option<Vec<u8>>),
    Line(Line),
    Unknown,
}

/// Results for two cells: pairs of openings between which no line leads, with their proofs, and a free line.
#[derive(Default)]
struct Settled {
    closed: Vec<(usize, usize, Option<Vec<u8>>)>,
    line: Option<Line>,
}

impl Dirs {
    /// Returns the polygons in which lines may cross the pieces of an opening: on its plane, `inset` inside their
    /// edges.
    pub(crate) fn open_parts(&self, d: usize, inset: f64) -> Vec<Vec<DVec3>> {
        let dir = &self.all[d];
        let height = (dir.low + dir.high) * 0.5;
        let pieces = &self.pieces[dir.pieces.start as usize..dir.pieces.end as usize];
        let part = |piece: &std::ops::Range<u32>| {
            let range = piece.start as usize..piece.end as usize;
            let mut points: Vec<DVec3> = self.points[range.clone()]
                .iter()
                .map(|&p| p + dir.normal * (height - dir.normal.dot(p)))
                .collect();
            for &(inward, offset) in &self.edges[range] {
                points = cut(&points, inward, offset + inset);
            }
            points
        };
        pieces.iter().map(part).collect()
    }

    /// Returns pairs of polygons such that every line through one opening and a later one passes both of a pair.
    fn beams(&self, s: usize, t: usize, inset: f64) -> Vec<[Vec<DVec3>; 2]> {
        let (a, b) = (&self.all[s], &self.all[t]);
        let height = |d: &crate::dirs::Dir| (d.low + d.high) * 0.5;
        let targets = self.open_parts(t, inset);
        let mut out = Vec::new();
        for from in self.open_parts(s, inset) {
            for to in &targets {
                let from = cut(&from, -b.normal, -height(b));
                let to = cut(to, a.normal, height(a));
                if !from.is_empty() && !to.is_empty() {
                    out.push([from, to]);
                }
            }
        }
        out
    }
}

impl Search<'_> {
    /// Settles pairs of cells that only walls inside other cells may hide from each other: random lines first.
    pub(crate) fn settle_inside(
        &mut self,
        sheets: &Sheets<'_>,
        inset: f64,
        on_round: &mut (dyn FnMut(u64, u64) -> bool + Send),
    ) {
        self.insist(INSIST_LINES, INSIST_ROUNDS, &mut *on_round);
        self.settle_by_walls(sheets, inset, &mut *on_round);
    }

    /// Settles pairs of cells that only walls inside other cells can hide from each other: by a line, or by beams
    /// that sheets of triangles close. Near pairs come first, as their results help those beyond. Stops when
    /// `on_round` returns `false`.
    fn settle_by_walls(
        &mut self,
        sheets: &Sheets<'_>,
        inset: f64,
        on_round: &mut dyn FnMut(u64, u64) -> bool,
    ) {
        let visible = self.visible();
        let n = self.dirs.n_cells;
        let mut pairs = Vec::new();
        for a in 0..n {
            let unseen: Vec<usize> = bits::ones(visible.row(a))
                .filter(|&b| self.is_first(a, b) && !self.seen.get(a, b))
                .collect();
            if !unseen.is_empty() {
                let steps = self.steps_from(a);
                pairs.extend(unseen.into_iter().map(|b| (steps[b], a, b)));
            }
        }
        pairs.sort_unstable();
        for round in pairs.chunk_by(|x, y| x.0 == y.0) {
            if !on_round(1, 1) {
                return;
            }
            let found: Vec<Settled> = round
                .par_iter()
                .with_max_len(1)
                .map(|&(_, a, b)| self.settle_pair(sheets, inset, a, b))
                .collect();
            for Settled { closed, line } in found {
                for (s, t, tree) in closed {
                    self.might.clear(s, t);
                    let back = self.dirs.reverse[s] as usize;
                    self.might.clear(self.dirs.reverse[t] as usize, back);
                    self.closed.extend(tree.map(|tree| Closed {
                        from: s as u32,
                        to: t as u32,
                        tree,
                    }));
                }
                self.keep(line.into_iter().collect());
            }
            self.grow();
        }
    }

    /// Returns the least number of openings between a cell and each other one.
    fn steps_from(&self, cell: usize) -> Vec<u32> {
        let mut steps = vec![u32::MAX; self.dirs.n_cells];
        let mut queue = std::collections::VecDeque::from([cell as u32]);
        steps[cell] = 0;
        while let Some(at) = queue.pop_front() {
            for d in self.dirs.exits(at) {
                let to = self.dirs.all[d].to;
                if steps[to as usize] == u32::MAX {
                    steps[to as usize] = steps[at as usize] + 1;
                    queue.push_back(to);
                }
            }
        }
        steps
    }

    fn settle_pair(&self, sheets: &Sheets<'_>, inset: f64, a: usize, b: usize) -> Settled {
        let dirs = self.dirs;
        let mut settled = Settled::default();
        if self.seen.get(a, b) {
            return settled;
        }
        let entries = dirs.entries(b as u32).iter();
        let exits = dirs.exits(a as u32);
        let both = exits.flat_map(|s| entries.clone().map(move |&t| (s, t as usize)));
        let mut open: Vec<_> = both.filter(|&(s, t)| self.might.get(s, t)).collect();
        for most in [FEW_BEAMS, MAX_BEAMS] {
            let mut left = Vec::new();
            for (s, t) in std::mem::take(&mut open) {
                let verdict = if self.follows_from_neighbors(s, t) {
                    Verdict::Closed(None)
                } else {
                    self.settle_openings(sheets, inset, (s, t), most)
                };
                match verdict {
                    Verdict::Closed(tree) => settled.closed.push((s, t, tree)),
                    Verdict::Line(line) => {
                        settled.line = Some(line);
                        return settled;
                    }
                    // The cells now count as seeing each other, whatever the other openings give.
                    Verdict::Unknown if most == MAX_BEAMS => return settled,
                    Verdict::Unknown => left.push((s, t)),
                }
            }
            open = left;
        }
        settled
    }

    /// Returns `true` if each way on after the first opening, or each way to the second, is known to be closed.
    fn follows_from_neighbors(&self, s: usize, t: usize) -> bool {
        let (dirs, might) = (self.dirs, &self.might);
        if dirs.all[t].from == dirs.all[s].to {
            return false;
        }
        dirs.after(s)
            .all(|q| q == dirs.reverse[s] as usize || !might.get(s, q) || !might.get(q, t))
            || dirs
                .entries(dirs.all[t].from)
                .iter()
                .map(|&p| p as usize)
                .all(|p| p == dirs.reverse[t] as usize || !might.get(s, p) || !might.get(p, t))
    }

    fn settle_openings(
        &self,
        sheets: &Sheets<'_>,
        inset: f64,
        (s, t): (usize, usize),
        most: usize,
    ) -> Verdict {
        let mut tree = Vec::new();
        let mut n_left = most;
        for ends in self.dirs.beams(s, t, inset) {
            match self.settle_beams(sheets, (s, t), ends, &mut n_left) {
                Ok(beams) => write_tree(&beams, 0, &mut tree),
                Err(verdict) => return verdict,
            }
        }
        Verdict::Closed(Some(tree))
    }

    /// Works breadth first, so that lines of large beams are tried before those of small ones.
    fn settle_beams(
        &self,
        sheets: &Sheets<'_>,
        (s, t): (usize, usize),
        ends: [Vec<DVec3>; 2],
        n_left: &mut usize,
    ) -> Result<Vec<Beam>, Verdict> {
        let apart = APART * self.tolerance.rounding;
        let mut beams = vec![Beam {
            ends,
            what: Part::Open,
        }];
        let mut at = 0;
        while at < beams.len() {
            if *n_left == 0 {
                return Err(Verdict::Unknown);
            }
            *n_left -= 1;
            let beam = &beams[at];
            if beam.ends.iter().any(Vec::is_empty) {
                at += 1;
                continue;
            }
            let line = [inner_point(&beam.ends[0]), inner_point(&beam.ends[1])];
            let mut hits: Vec<(f64, u32)> = Vec::new();
            sheets
                .bvh
                .for_each_hit(&Ray::segment(line[0], line[1]), |hit| {
                    hits.push((hit.t, hit.triangle));
                });
            if hits.is_empty()
                && let Some(line) = self.free_line(s, t, line)
            {
                return Err(Verdict::Line(line));
            }
            hits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let hull = Hull::new(beam, apart);
            let sheet = spread(hits.len()).find_map(|i| sheets.grown(hits[i].1, beam, &hull, line));
            beams[at].what = match sheet {
                Some(sheet) => Part::Sheet(sheet),
                None => divide(&mut beams, at, 1e3 * apart)?,
            };
            at += 1;
        }
        Ok(beams)
    }

    fn free_line(&self, s: usize, t: usize, [from, to]: [DVec3; 2]) -> Option<Line> {
        let margin = self.tolerance.rounding * 16.0;
        let mut chain = vec![s as u32];
        let direction = to - from;
        walk(
            self.dirs,
            s,
            from,
            direction,
            margin,
            self.blocker,
            &mut chain,
        );
        chain.contains(&(t as u32)).then_some(Line {
            origin: from,
            direction,
            chain,
        })
    }
}

/// Adds the halves of a beam, cut across its larger end; an error if one would be smaller than `least`.
fn divide(beams: &mut Vec<Beam>, at: usize, least: f64) -> Result<Part, Verdict> {
    let end = usize::from(size(&beams[at].ends[1]) > size(&beams[at].ends[0]));
    let mut next = [None, None];
    for (half, points) in next.iter_mut().zip(halves(&beams[at].ends[end])) {
        // A polygon as thin as rounding leaves an empty half, through which nothing leads.
        let what = if points.is_empty() {
            Part::Sheet(Vec::new())
        } else if size(&points) < least {
            return Err(Verdict::Unknown);
        } else {
            Part::Open
        };
        let mut ends = beams[at].ends.clone();
        ends[end] = points;
        *half = Some(beams.len());
        beams.push(Beam { ends, what });
    }
    Ok(Part::Halves(end, next))
}

/// Returns up to [`MAX_SEEDS`] of `n` places, from both ends inwards.
pub(crate) fn spread(n: usize) -> impl Iterator<Item = usize> {
    let front = 0..n.min(MAX_SEEDS);
    front.map(move |i| if i % 2 == 0 { i / 2 } else { n - 1 - i / 2 })
}
