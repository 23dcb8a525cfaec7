//! Claims about sight: cells, volumes and parts.

use enfilade_cpg::{Cell, CellId, CellSet, PartNumbers, Pvs, VisibleParts, VisibleVolumes, World};
use enfilade_geom::{Bvh, DVec3, Plane, Ray, Triangle};

use super::{Tampering, pick};

pub(super) const ALL: &[Tampering] = &[
    Tampering::new(
        "two cells that do not see each other through their portal",
        |w, at| hidden(w, at, true),
    ),
    Tampering::new(
        "a cell that does not see another, which sees it",
        |w, at| hidden(w, at, false),
    ),
    Tampering::new("a visible volume emptied", |w, at| {
        volumes(w, at, |_, pieces| pieces.clear())
    }),
    Tampering::new("a visible volume half a meter inwards", |w, at| {
        volumes(w, at, |_, pieces| {
            pieces.iter_mut().flatten().for_each(|p| p[3] -= 0.5);
        })
    }),
    Tampering::new("a plane of a visible volume two meters inwards", |w, at| {
        volumes(w, at, |portal, pieces| {
            for piece in pieces {
                if let Some(plane) = facing(portal, piece) {
                    piece[plane][3] -= 2.0;
                }
            }
        })
    }),
    Tampering::new("a visible volume turned about", |w, at| {
        volumes(w, at, |_, pieces| {
            let flat = pieces.iter_mut().flatten();
            flat.for_each(|p| *p = p.map(|x| -x));
        })
    }),
    Tampering::new("a cell that does not see all of itself", |w, at| {
        let pvs = w.pvs.as_ref()?;
        let own = |i: usize| pvs.pairs().nth(i).is_some_and(|(a, b)| a == b);
        let pair = pick(pvs.n_pairs(), at, own)?;
        volumes_of_pair(w, pair, |pieces| {
            pieces.clear();
            pieces.push(vec![[1.0, 0.0, 0.0, -1e4]]);
        })
    }),
    Tampering::new("a piece of a visible volume dropped", |w, at| {
        let volumes = w.pvs.as_ref()?.volumes.as_ref()?;
        let pairs = Pairs::new(w)?;
        let of_several = |i: usize| pairs.are_apart(w, i) && volumes.pieces_of(i).count() > 1;
        let (pair, piece) = pairs.lines_from_place(at, of_several, |pair, lines| {
            let pieces: Vec<&[[f64; 4]]> = volumes.pieces_of(pair).collect();
            let is_only_of = |i: usize, p: DVec3| {
                let mut holding = (0..pieces.len()).filter(|&k| is_in(pieces[k], p));
                holding.next() == Some(i) && holding.next().is_none()
            };
            let n_lost = |i: usize| lines.iter().filter(|l| is_only_of(i, l[1])).count();
            (0..pieces.len()).find(|&i| n_lost(i) > lines.len() / MOST_HIDDEN)
        })?;
        volumes_of_pair(w, pair, |pieces| {
            pieces.remove(piece);
        })
    }),
    Tampering::new("the parts of a pair emptied", |w, at| {
        parts(w, at, Vec::clear)
    }),
    Tampering::new("a run of parts halved", |w, at| {
        parts(w, at, |row| {
            let half = row.len() / 2;
            row.truncate(half);
        })
    }),
    Tampering::new("a row of parts of cells apart shortened", |w, at| {
        let parts = w.pvs.as_ref()?.parts.as_ref()?;
        let pairs = Pairs::new(w)?;
        let is_far = |i: usize| pairs.are_apart(w, i) && !parts.runs_of(i).is_empty();
        let (pair, end) = pairs.lines_from_place(at, is_far, |pair, lines| {
            let runs = parts.runs_of(pair).iter();
            let row: Vec<u32> = runs.flat_map(|&[a, b]| a..b).collect();
            let (end, to) = (row[row.len() / 2], pairs.pairs[pair].1);
            let is_lost = |t: u32| t >= end && row.contains(&t) && cells_of(w, t) == [to];
            let met = lines.iter().filter_map(|l| pairs.met(l));
            (met.filter(|&t| is_lost(t)).count() > lines.len() / MOST_HIDDEN).then_some(end)
        })?;
        parts_of_pair(w, pair, |row| row.retain(|&t| t < end))
    }),
    Tampering::new("the largest triangle that a pair sees left out", |w, at| {
        let p = portal(w, at)?;
        let largest = largest_seen(w, p)?;
        parts(w, at, |row| row.retain(|t| *t != largest))
    }),
    Tampering::new("a part that its own cell does not see", |w, at| {
        let pvs = w.pvs.as_ref()?;
        let own = |i: usize| pvs.pairs().nth(i).is_some_and(|(a, b)| a == b);
        let pair = pick(pvs.n_pairs(), at, own)?;
        parts_of_pair(w, pair, |row| {
            row.pop();
        })
    }),
];

/// Number of lines of sight between two cells of which more than one must meet what a lie hides: where none does, it is not a lie, and few
/// of a checker's lines meet less.
const MOST_HIDDEN: usize = 20;

/// Ordered pairs of cells, and the walls between.
struct Pairs {
    pairs: Vec<(CellId, CellId)>,
    walls: Bvh,
    /// Points in the air of each cell.
    points: Vec<Vec<DVec3>>,
}

impl Pairs {
    fn new(w: &World) -> Option<Self> {
        let batches = w.batches.iter();
        let all: Vec<Triangle> = batches.flat_map(|b| b.primitive.triangles()).collect();
        let points_of = |(i, cell): (usize, &Cell)| {
            const SIDE: usize = 5;
            let [low, high] = cell.aabb.map(|p| DVec3::from(p.map(f64::from)));
            let share = |k: usize| (k % SIDE) as f64 / SIDE as f64 + 0.08;
            let by = |k: usize| DVec3::new(share(k), share(k / SIDE), share(k / SIDE / SIDE));
            let grid = (0..SIDE * SIDE * SIDE).map(|k| low + (high - low) * by(k));
            let is_own = |p: &DVec3| w.graph.locator.locate(*p) == Some(CellId(i as u32));
            grid.filter(is_own).collect()
        };
        Some(Self {
            pairs: w.pvs.as_ref()?.pairs().collect(),
            walls: Bvh::build(&all),
            points: w.graph.cells.iter().enumerate().map(points_of).collect(),
        })
    }

    /// The first pair from one of three places on that `is_fit`, with the lie that `lie` finds in it, given its lines of sight.
    fn lines_from_place<T>(
        &self,
        place: usize,
        is_fit: impl Fn(usize) -> bool,
        lie: impl Fn(usize, &[[DVec3; 2]]) -> Option<T>,
    ) -> Option<(usize, T)> {
        let fit: Vec<usize> = (0..self.pairs.len()).filter(|&i| is_fit(i)).collect();
        let (before, after) = fit.split_at(place * fit.len() / 3);
        let mut from = after.iter().chain(before);
        from.find_map(|&pair| Some((pair, lie(pair, &self.lines(pair))?)))
    }

    /// The lines of sight between the points of a pair.
    fn lines(&self, pair: usize) -> Vec<[DVec3; 2]> {
        let (a, b) = self.pairs[pair];
        let [eyes, ends] = [a, b].map(|c| &self.points[c.idx()]);
        let all = eyes.iter().flat_map(|&p| ends.iter().map(move |&q| [p, q]));
        let is_open = |[p, q]: &[DVec3; 2]| !self.walls.any_hit(*p, *q, |_| false);
        all.filter(is_open).collect()
    }

    /// The triangle that a line meets behind its end.
    fn met(&self, &[p, q]: &[DVec3; 2]) -> Option<u32> {
        let ray = Ray {
            origin: p,
            direction: (q - p).try_normalize()?,
            t_max: f64::INFINITY,
        };
        Some(self.walls.closest_hit(&ray, |_| false)?.triangle)
    }

    fn are_apart(&self, w: &World, pair: usize) -> bool {
        let (a, b) = self.pairs[pair];
        let mut portals = w.graph.portals.iter();
        a != b && !portals.any(|p| p.cells.contains(&a) && p.cells.contains(&b))
    }
}

/// The cells of a triangle of the structure.
fn cells_of(w: &World, triangle: u32) -> &[CellId] {
    let numbers = PartNumbers::new(w);
    let mut batches = (0..w.batches.len()).filter(|&b| numbers.of_batch(b).contains(&triangle));
    batches.next().map_or(&[], |b| &w.batches[b].cells)
}

fn is_in(piece: &[[f64; 4]], p: DVec3) -> bool {
    let mut planes = piece.iter();
    planes.all(|&[x, y, z, d]| DVec3::new(x, y, z).dot(p) + d >= 0.0)
}

/// A portal between two cells, the larger ones of its kind.
fn portal(w: &World, place: usize) -> Option<usize> {
    pick(w.graph.portals.len(), place, |i| {
        w.graph.portals[i].area > 0.2
    })
}

fn hidden(w: &mut World, at: usize, is_mutual: bool) -> Option<()> {
    let n = w.graph.cells.len();
    let [a, b] = w.graph.portals[portal(w, at)?].cells;
    let mut rows = match &w.pvs {
        None => vec![CellSet::all(n); n],
        Some(pvs) => {
            let row = |c: usize| {
                let mut set = CellSet::new(n);
                pvs.visible_from(CellId(c as u32)).for_each(|to| {
                    set.insert(to);
                });
                set
            };
            (0..n).map(row).collect()
        }
    };
    rows[a.idx()].remove(b);
    if is_mutual {
        rows[b.idx()].remove(a);
    }
    w.pvs = Some(Pvs::of_rows(&rows));
    Some(())
}

/// The pair of cells that a portal joins, one way.
fn pair_through(w: &World, portal: usize) -> Option<usize> {
    let [a, b] = w.graph.portals[portal].cells;
    w.pvs.as_ref()?.pairs().position(|pair| pair == (a, b))
}

type Pieces = Vec<Vec<[f64; 4]>>;

fn volumes(w: &mut World, at: usize, change: impl Fn(&Plane, &mut Pieces)) -> Option<()> {
    let volumes = w.pvs.as_ref()?.volumes.as_ref()?;
    // A piece without planes is all of the cell, whatever the others are.
    let is_bounded = |p: usize| {
        let pair = pair_through(w, p);
        pair.is_some_and(|pair| volumes.pieces_of(pair).all(|piece| !piece.is_empty()))
    };
    let p = pick(w.graph.portals.len(), at, |p| {
        w.graph.portals[p].area > 0.2 && is_bounded(p)
    })?;
    let pair = pair_through(w, p)?;
    let portal = &w.graph.portals[p];
    let v = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let plane = Plane::through(v(portal.outline[0]), v(portal.normal));
    volumes_of_pair(w, pair, |pieces| change(&plane, pieces))
}

fn volumes_of_pair(w: &mut World, pair: usize, change: impl Fn(&mut Pieces)) -> Option<()> {
    let pvs = w.pvs.as_mut()?;
    let known = pvs.volumes.as_ref()?;
    let mut all: Vec<Pieces> = (0..known.n_pairs())
        .map(|i| known.pieces_of(i).map(<[_]>::to_vec).collect())
        .collect();
    let before = all[pair].clone();
    change(&mut all[pair]);
    let is_other = all[pair] != before;
    pvs.volumes = Some(VisibleVolumes::of_pairs(all));
    is_other.then_some(())
}

/// The plane of a piece that is most that of a portal.
fn facing(portal: &Plane, piece: &[[f64; 4]]) -> Option<usize> {
    let along = |p: &[f64; 4]| DVec3::new(p[0], p[1], p[2]).dot(portal.normal);
    (0..piece.len()).max_by(|&a, &b| along(&piece[a]).total_cmp(&along(&piece[b])))
}

fn parts(w: &mut World, at: usize, change: impl Fn(&mut Vec<u32>)) -> Option<()> {
    let pair = pair_through(w, portal(w, at)?)?;
    parts_of_pair(w, pair, change)
}

fn parts_of_pair(w: &mut World, pair: usize, change: impl Fn(&mut Vec<u32>)) -> Option<()> {
    let pvs = w.pvs.as_mut()?;
    let known = pvs.parts.as_ref()?;
    let row = |i| {
        let runs = known.runs_of(i).iter();
        runs.flat_map(|&[a, b]| a..b).collect()
    };
    let mut all: Vec<Vec<u32>> = (0..known.n_pairs()).map(row).collect();
    let before = all[pair].len();
    change(&mut all[pair]);
    let is_other = all[pair].len() != before;
    pvs.parts = Some(VisibleParts::of_ascending(all));
    is_other.then_some(())
}

/// The largest triangle of the second cell of a portal whose middle is seen from the middle of the portal: leaving out what
/// is not seen is not a lie.
fn largest_seen(w: &World, portal: usize) -> Option<u32> {
    let batches = w.batches.iter();
    let all: Vec<Triangle> = batches.flat_map(|b| b.primitive.triangles()).collect();
    let walls = Bvh::build(&all);
    let portal = &w.graph.portals[portal];
    let piece: Vec<DVec3> = (portal.pieces[0].iter())
        .map(|c| DVec3::from(c.map(f64::from)))
        .collect();
    let normal = DVec3::from(portal.normal.map(f64::from));
    let eye = piece.iter().sum::<DVec3>() / piece.len() as f64 - normal * 0.01;
    let numbers = PartNumbers::new(w);
    // A batch of several cells may be seen by way of another of them.
    let of_one = (0..w.batches.len()).filter(|&b| w.batches[b].cells == [portal.cells[1]]);
    let seen = of_one.flat_map(|b| numbers.of_batch(b)).filter(|&n| {
        let [x, y, z] = all[n as usize];
        let middle = (x + y + z) / 3.0;
        let is_ahead = (middle - eye).dot(normal) > 0.2;
        is_ahead && !walls.any_hit(eye, eye.lerp(middle, 0.999), |_| false)
    });
    let size = |n: u32| {
        let [x, y, z] = all[n as usize];
        (y - x).cross(z - x).length()
    };
    seen.max_by(|&a, &b| size(a).total_cmp(&size(b)))
}
