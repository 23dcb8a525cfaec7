//! Lines that pass a chain of openings: guessed, corrected, and followed beyond its end.

use enfilade_geom::DVec3;

use super::{Flow, Shared, Stab};
use crate::clip::Poly;
use crate::dirs::Dirs;
use crate::rays::{self, Line, MIN_SINE};
use crate::stabbing::{self, Answer, Gate};
use crate::tolerance::HalfSpace;

/// Most corrections of the ends of a guessed line.
const MAX_TURNS: usize = 8;

impl Flow {
    /// Decides whether any line passes the chain, independently of planes.
    pub(super) fn stab_at_all(&mut self, shared: &Shared<'_>, source: Poly) -> Stab {
        let (origin, direction) = match self.stabbed(shared) {
            Answer::Closed(_) => return Stab::None,
            Answer::Unknown => return Stab::Unknown,
            Answer::Guess(origin, direction) => (origin, direction),
        };
        let dirs = shared.dirs;
        let target = self.chain[self.chain.len() - 1];
        let at = |dir: u32| origin + direction * dirs.crossing(dir as usize, origin, direction);
        let (mut from, mut to) = (at(source.dir), at(target.dir));
        // Move each end in turn to the middle of the part seen from the other.
        for _ in 0..MAX_TURNS {
            if self.passes(shared, from, to) {
                return Stab::Line(from, to);
            }
            to = self.middle_seen(shared, from, target).unwrap_or(to);
            if self.passes(shared, from, to) {
                return Stab::Line(from, to);
            }
            from = self.middle_seen(shared, to, source).unwrap_or(from);
        }
        Stab::Unknown
    }

    pub(crate) fn stabbed(&self, shared: &Shared<'_>) -> Answer {
        let dirs = shared.dirs;
        let gate = |poly: &Poly| {
            let dir = &dirs.all[poly.dir as usize];
            Gate {
                winding: dirs.winding(poly.dir as usize),
                turn: dir.turn,
                normal: dir.normal,
            }
        };
        stabbing::stabbed(&self.chain.iter().map(gate).collect::<Vec<_>>())
    }

    /// Follows a line from the source and marks everything it crosses as seen.
    pub(super) fn shoot(&mut self, shared: &Shared<'_>, from: DVec3, to: DVec3) {
        let dirs = shared.dirs;
        let source = self.found.source;
        self.walked.clear();
        self.found.effort.rays += 1;
        rays::walk(
            dirs,
            source,
            from,
            to - from,
            shared.tolerance.rounding * 16.0,
            shared.blocker,
            &mut self.walked,
        );
        let mut is_new = false;
        for k in 0..self.walked.len() {
            let crossed = self.walked[k];
            is_new |= self.settle_cell(dirs, dirs.all[crossed as usize].to);
        }
        if is_new {
            let mut chain = vec![source as u32];
            chain.extend_from_slice(&self.walked);
            self.found.lines.push(Line {
                origin: from,
                direction: to - from,
                chain,
            });
        }
    }

    /// Tries a few lines through the openings of the chain.
    pub(super) fn stab(&mut self, shared: &Shared<'_>, source: Poly, target: Poly) -> Stab {
        self.found.effort.stabs += 1;
        let (from, to) = (self.arena.mean(source), self.arena.mean(target));
        if self.passes(shared, from, to) {
            return Stab::Line(from, to);
        }
        if let Some(to) = self.middle_seen(shared, from, target)
            && self.passes(shared, from, to)
        {
            return Stab::Line(from, to);
        }
        if let Some(from) = self.middle_seen(shared, to, source)
            && self.passes(shared, from, to)
        {
            return Stab::Line(from, to);
        }
        Stab::Unknown
    }

    /// Returns `true` if the line crosses all openings of the chain.
    fn passes(&self, shared: &Shared<'_>, from: DVec3, to: DVec3) -> bool {
        let dirs = shared.dirs;
        let margin = shared.tolerance.rounding * 16.0;
        let direction = to - from;
        let least = MIN_SINE * direction.length();
        // Test the ends too: a clip keeps slightly more than the opening.
        self.chain.iter().all(|poly| {
            let dir = &dirs.all[poly.dir as usize];
            let speed = dir.normal.dot(direction);
            let t = ((dir.low + dir.high) * 0.5 - dir.normal.dot(from)) / speed;
            speed > least && dirs.is_inside(poly.dir as usize, from + direction * t, margin)
        })
    }

    /// Returns the middle of the polygon in which lines from a point at one end of the chain meet its other end.
    fn middle_seen(&mut self, shared: &Shared<'_>, eye: DVec3, end: Poly) -> Option<DVec3> {
        let mark = self.arena.mark();
        let seen = self.seen_from(shared, eye, end);
        let middle = seen.map(|seen| self.arena.mean(seen));
        self.arena.release(mark);
        middle
    }

    /// Returns the part of one end of the chain that is seen from a point at the other.
    fn seen_from(&mut self, shared: &Shared<'_>, eye: DVec3, mut end: Poly) -> Option<Poly> {
        let dirs = shared.dirs;
        for k in 1..self.chain.len() - 1 {
            let pass = self.chain[k].dir as usize;
            for i in 0..dirs.winding(pass).len() {
                let Some(plane) = edge_plane(dirs, pass, i, eye) else {
                    continue;
                };
                let turn = dirs.all[end.dir as usize].turn;
                end = self.arena.clip(end, plane, turn, &shared.tolerance)?;
            }
        }
        Some(end)
    }
}

/// Returns the half-space of lines from `eye` that pass edge `i` of an opening on its inner side.
fn edge_plane(dirs: &Dirs, dir: usize, i: usize, eye: DVec3) -> Option<HalfSpace> {
    let winding = dirs.winding(dir);
    let p = winding[i];
    let q = winding[if i + 1 == winding.len() { 0 } else { i + 1 }];
    let normal = (q - p).cross(eye - p).normalize_or_zero();
    if normal == DVec3::ZERO {
        return None;
    }
    let inward = dirs.edges[dirs.all[dir].corners.start as usize + i].0;
    let normal = if normal.dot(inward) < 0.0 {
        -normal
    } else {
        normal
    };
    Some(HalfSpace {
        normal,
        offset: normal.dot(p),
    })
}
