//! Borders of areas in plan: chains of edges between squares, straightened.
//!
//! Where areas meet on low ground, at the mouth of a street or the foot of a pass, a border is as straight as the squares of the
//! two areas allow; elsewhere it follows ridges and roofs. Straightening moves a border within the two areas that it parts,
//! never through a third: so the ends of all borders, where three areas meet, stay.
//!
//! Cost: linear in the edges, times the depth of halving.

use super::relief::Relief;

/// Distance by which a border may be moved: of its length on low ground. A street's mouth is an arc of 0.27.
const BULGE: f64 = 0.3;
/// … and elsewhere. [Units: squares]
const NEAR: f64 = 1.5;
/// Spacing of the points of a line that are looked up. [Units: squares]
const STEP: f64 = 0.5;

/// A point where squares meet. [Units: squares]
pub(super) type PlanPoint = [i32; 2];

/// A straight part of a border.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) ends: [PlanPoint; 2],
    /// The areas on its sides; 0 is none.
    pub(super) areas: [u32; 2],
}

/// Owners of squares.
pub(super) struct Owners<'a> {
    pub(super) relief: &'a Relief,
    /// Low ground, and what is next to it: a wall may be anywhere there.
    pub(super) is_low: &'a [bool],
    pub(super) of_square: &'a [u32],
}

/// An edge between two squares, from a joint along an axis (0: x, 1: z).
type SquareEdge = (PlanPoint, usize);

impl Owners<'_> {
    /// Returns all borders, in order of their first edges.
    pub(super) fn borders(&self) -> Vec<Segment> {
        let [nx, nz] = self.relief.dims.map(|n| n as i32);
        let mut is_done = vec![[false; 2]; ((nx + 1) * (nz + 1)) as usize];
        let index = |[x, z]: PlanPoint| (x + (nx + 1) * z) as usize;
        let mut out = Vec::new();
        // Chains that begin where three areas meet, then rings.
        for rings in [false, true] {
            let joints = (0..=nz).flat_map(|z| (0..=nx).map(move |x| [x, z]));
            for from in joints {
                let mut edges = self.edges_at(from);
                if !rings && edges.len() == 2 {
                    continue;
                }
                edges.retain(|(at, axis)| !is_done[index(*at)][*axis]);
                for edge in edges {
                    // A ring ends with another edge of its first joint.
                    if is_done[index(edge.0)][edge.1] {
                        continue;
                    }
                    let chain = self.chain(from, edge, &mut |(at, axis): SquareEdge| {
                        is_done[index(at)][axis] = true;
                    });
                    self.straighten(&chain, self.areas_beside(edge), &mut out);
                }
            }
        }
        out
    }

    /// Returns the area at a square that may lie beside the plan.
    fn area(&self, [x, z]: PlanPoint) -> u32 {
        self.square([x, z]).map_or(0, |i| self.of_square[i])
    }

    fn square(&self, [x, z]: PlanPoint) -> Option<usize> {
        let [nx, nz] = self.relief.dims;
        let is_in = (0..nx as i32).contains(&x) && (0..nz as i32).contains(&z);
        is_in.then(|| x as usize + nx * z as usize)
    }

    /// Returns the squares on both sides of an edge.
    fn beside((at, axis): SquareEdge) -> [PlanPoint; 2] {
        let mut before = at;
        before[1 - axis] -= 1;
        [before, at]
    }

    fn areas_beside(&self, edge: SquareEdge) -> [u32; 2] {
        Self::beside(edge).map(|s| self.area(s))
    }

    /// Returns the edges of borders at a joint.
    fn edges_at(&self, [x, z]: PlanPoint) -> Vec<SquareEdge> {
        let all = [([x, z], 0), ([x - 1, z], 0), ([x, z], 1), ([x, z - 1], 1)];
        let parts = |&edge: &SquareEdge| {
            let [a, b] = self.areas_beside(edge);
            a != b
        };
        all.into_iter().filter(parts).collect()
    }

    /// Returns the joints from one on along a border, up to where others meet it or to the first one again.
    fn chain(
        &self,
        from: PlanPoint,
        first: SquareEdge,
        take: &mut impl FnMut(SquareEdge),
    ) -> Vec<PlanPoint> {
        let (mut joints, mut edge) = (vec![from], first);
        take(first);
        loop {
            let (at, axis) = edge;
            let mut end = at;
            end[axis] += 1;
            let last = joints[joints.len() - 1];
            let next = if last == at { end } else { at };
            joints.push(next);
            let edges = self.edges_at(next);
            let onward = edges.iter().find(|e| **e != edge);
            match onward {
                Some(&e) if edges.len() == 2 && next != from => {
                    take(e);
                    edge = e;
                }
                _ => return joints,
            }
        }
    }

    /// Adds the straight parts of a chain.
    fn straighten(&self, chain: &[PlanPoint], areas: [u32; 2], out: &mut Vec<Segment>) {
        let is_open = |k: usize| {
            let (a, b) = (chain[k], chain[k + 1]);
            let axis = usize::from(a[0] == b[0]);
            let edge = ([a[0].min(b[0]), a[1].min(b[1])], axis);
            Self::beside(edge)
                .into_iter()
                .all(|s| self.square(s).is_some_and(|i| self.is_low[i]))
        };
        let mut from = 0;
        for k in 1..chain.len() {
            // A ring has no ends: it is cut half way.
            let is_half = chain[0] == chain[chain.len() - 1] && k == chain.len() / 2;
            if k + 1 == chain.len() || is_half || is_open(k) != is_open(k - 1) {
                self.halve(&chain[from..=k], areas, is_open(from), out);
                from = k;
            }
        }
    }

    /// Adds one line for a part of a chain if that lies near enough, else divides it at the farthest joint.
    fn halve(&self, part: &[PlanPoint], areas: [u32; 2], is_open: bool, out: &mut Vec<Segment>) {
        let [a, .., b] = part else { return };
        let [dx, dz] = [0, 1].map(|k| f64::from(b[k] - a[k]));
        let length = dx.hypot(dz);
        let off = |p: &PlanPoint| {
            let [x, z] = [0, 1].map(|k| f64::from(p[k] - a[k]));
            if length == 0.0 {
                x.hypot(z)
            } else {
                ((x * dz - z * dx) / length).abs()
            }
        };
        let inner = 1..part.len() - 1;
        let farthest =
            inner.max_by(|&i, &j| off(&part[i]).total_cmp(&off(&part[j])).then(j.cmp(&i)));
        let most = farthest.map_or(0.0, |k| off(&part[k]));
        let reach = if is_open && !areas.contains(&0) {
            NEAR.max(BULGE * length)
        } else {
            NEAR
        };
        match farthest {
            Some(k) if most > reach || most > NEAR && !self.is_between(*a, *b, areas, is_open) => {
                self.halve(&part[..=k], areas, is_open, out);
                self.halve(&part[k..], areas, is_open, out);
            }
            _ => out.push(Segment {
                ends: [*a, *b],
                areas,
            }),
        }
    }

    /// Returns `true` if a line passes through squares of two areas alone, on low ground if that is wanted.
    fn is_between(&self, a: PlanPoint, b: PlanPoint, areas: [u32; 2], is_open: bool) -> bool {
        self.along(a, b).into_iter().all(|square| {
            square
                .is_some_and(|i| areas.contains(&self.of_square[i]) && (!is_open || self.is_low[i]))
        })
    }

    /// Returns the squares along a line, from just behind its first end to just before its last.
    pub(super) fn along(&self, a: PlanPoint, b: PlanPoint) -> Vec<Option<usize>> {
        let d = [0, 1].map(|k| f64::from(b[k] - a[k]));
        let n = (d[0].hypot(d[1]) / STEP).ceil().max(2.0) as usize;
        let at = |k: usize| {
            let share = (k as f64 + 0.5) / n as f64;
            [0, 1].map(|c| (f64::from(a[c]) + share * d[c]).floor() as i32)
        };
        (0..n).map(|k| self.square(at(k))).collect()
    }
}
