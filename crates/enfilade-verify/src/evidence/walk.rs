//! The walk through all portal chains that a trace describes.

use enfilade_geom::DVec3;

use super::EvidenceError;
use super::decode::Evidence;
use super::shape::{Openings, Part, Plane, get, set};

const SKIP: u8 = 0;
const CUT: u8 = 1;
const ENTER: u8 = 2;
const SPLIT: u8 = 3;
const EXITS: u8 = 4;
const DONE: u8 = 5;
const CLOSED: u8 = 6;
const HALVES: u8 = 7;
const UNSTABBED: u8 = 8;

/// Longest chain and deepest split: within recursion limits.
const MAX_DEPTH: usize = 600;

/// Nested splits tried on a chain that the trace calls closed but planes leave open.
const MAX_TRIES: u32 = 5;

/// Checks that the trace closes every chain from an opening to those that it claims hidden.
pub(super) fn check_trace(openings: &Openings, evidence: &Evidence) -> Result<(), EvidenceError> {
    let mut walk = Walk {
        openings,
        evidence,
        at: 0,
        start: 0,
        chain: Vec::new(),
    };
    for start in 0..openings.all.len() {
        let claims = evidence.claims.row(start);
        if claims.iter().all(|&w| w == 0) {
            continue;
        }
        walk.start = start;
        walk.chain.clear();
        let whole = Part {
            opening: start,
            corners: openings.all[start].corners.clone(),
        };
        walk.chain.push((start, Some(whole.clone())));
        walk.step(Some(&whole), vec![u64::MAX; claims.len()])?;
    }
    if walk.at != evidence.trace.len() {
        return Err(walk.error("it continues after the last opening"));
    }
    Ok(())
}

struct Walk<'a> {
    openings: &'a Openings,
    evidence: &'a Evidence,
    /// Position of the next byte of the trace.
    at: usize,
    start: usize,
    /// The crossed openings, each with its remaining part; `None` where planes closed the chain already.
    chain: Vec<(usize, Option<Part>)>,
}

type Checked<T> = Result<T, EvidenceError>;

impl Walk<'_> {
    fn error(&self, problem: &'static str) -> EvidenceError {
        EvidenceError::Trace {
            opening: self.start,
            at: self.at,
            problem,
        }
    }

    fn next(&mut self) -> Checked<u8> {
        let byte = self.evidence.trace.get(self.at).copied();
        self.at += 1;
        byte.ok_or_else(|| self.error("it ends early"))
    }

    /// Follows the trace behind the last opening of the chain. `reach` contains the openings that all openings of the
    /// chain but the first might see.
    fn step(&mut self, source: Option<&Part>, mut reach: Vec<u64>) -> Checked<()> {
        let (openings, evidence) = (self.openings, self.evidence);
        let depth = self.chain.len() - 1;
        if depth > MAX_DEPTH {
            return Err(self.error("its chains are too long"));
        }
        let last = self.chain[depth].0;
        let pass = self.chain[depth].1.clone();
        let mut planes = Vec::new();
        if let (Some(source), Some(pass)) = (source, &pass)
            && depth > 0
        {
            planes = openings.between(source, pass);
            if depth == 1 {
                self.flood(&planes, &mut reach);
            } else {
                self.drop_hidden(&planes, &mut reach);
            }
        }
        let claims = evidence.claims.row(self.start);
        let is_closed = source.is_none() || pass.is_none();
        match self.next()? {
            DONE if is_closed || !meets(&reach, claims) => return Ok(()),
            DONE => return Err(self.error("it stops before it shows everything")),
            EXITS => {}
            _ => return Err(self.error("a step begins with an unknown symbol")),
        }
        for &q in &openings
            .exits(openings.all[last].to, usize::MAX)
            .collect::<Vec<_>>()
        {
            let symbol = self.next()?;
            let mut behind = reach.clone();
            for (b, m) in behind.iter_mut().zip(evidence.might.row(q)) {
                *b &= m;
            }
            let is_claimed = get(&reach, q) && get(claims, q);
            if symbol == SKIP {
                let leads_on = evidence.might.get(self.start, q) && meets(&behind, claims);
                if is_closed || q == last ^ 1 || !get(&reach, q) || !(leads_on || is_claimed) {
                    continue;
                }
                return Err(self.error("it skips an exit that matters"));
            }
            if q == last ^ 1 {
                return Err(self.error("it goes back through an opening"));
            }
            let narrowed = match (source, &pass) {
                (Some(source), Some(pass)) => self.narrow(source, pass, q, &planes),
                _ => None,
            };
            let (source, target) = narrowed.unzip();
            match symbol {
                CUT if target.is_none() || self.closes_with(q, target.clone(), source.clone()) => {}
                CUT => return Err(self.error("planes do not close this chain")),
                UNSTABBED => {
                    self.chain.push((q, None));
                    let done = self.unstabbed();
                    self.chain.pop();
                    done?;
                }
                ENTER | SPLIT => {
                    if symbol == ENTER && is_claimed && target.is_some() {
                        return Err(self.error("it sees an opening that it claims hidden"));
                    }
                    self.chain.push((q, target));
                    let done = if symbol == ENTER {
                        self.step(source.as_ref(), behind)
                    } else {
                        self.split(source, 0)
                    };
                    self.chain.pop();
                    done?;
                }
                _ => return Err(self.error("an exit has an unknown symbol")),
            }
        }
        Ok(())
    }

    /// Returns the remaining parts of the source and of the next opening.
    fn narrow(
        &self,
        source: &Part,
        pass: &Part,
        q: usize,
        planes: &[Plane],
    ) -> Option<(Part, Part)> {
        let (openings, clearance) = (self.openings, self.evidence.clearance);
        let mut target = Part {
            opening: q,
            corners: openings.all[q].corners.clone(),
        };
        target = openings.in_front(target, &openings.plane(source.opening), clearance)?;
        if pass.opening != source.opening {
            target = openings.in_front(target, &openings.plane(pass.opening), clearance)?;
        }
        let mut source = openings.behind(source.clone(), &openings.plane(q), clearance)?;
        for plane in planes {
            target = openings.in_front(target, plane, clearance)?;
        }
        if self.chain.len() > 1 {
            for plane in openings.between(pass, &target) {
                source = openings.behind(source, &plane, clearance)?;
            }
        }
        Some((source, target))
    }

    /// Removes claimed openings that lie behind a plane.
    fn drop_hidden(&self, planes: &[Plane], reach: &mut [u64]) {
        let clearance = self.evidence.clearance;
        for q in self.evidence.claims.ones(self.start) {
            if get(reach, q)
                && planes
                    .iter()
                    .any(|plane| self.openings.is_behind(q, plane, clearance))
            {
                reach[q / 64] &= !(1 << (q % 64));
            }
        }
    }

    /// Removes openings that lie behind a plane or can only be reached through such openings.
    fn flood(&self, planes: &[Plane], reach: &mut [u64]) {
        let (openings, evidence) = (self.openings, self.evidence);
        let claims = evidence.claims.row(self.start);
        let mut reached = vec![0; reach.len()];
        let mut stack = vec![self.chain[1].0];
        while let Some(at) = stack.pop() {
            for q in openings.exits(openings.all[at].to, at ^ 1) {
                let may_pass = evidence.might.get(self.start, q);
                if !get(&reached, q)
                    && get(reach, q)
                    && evidence.might.get(at, q)
                    && (may_pass || get(claims, q))
                    && !planes
                        .iter()
                        .any(|plane| openings.is_behind(q, plane, evidence.clearance))
                {
                    set(&mut reached, q);
                    if may_pass {
                        stack.push(q);
                    }
                }
            }
        }
        for (word, kept) in reach.iter_mut().zip(reached) {
            *word &= kept;
        }
    }

    /// Checks that the weighted rows of the chain's openings sum to zero.
    fn unstabbed(&mut self) -> Checked<()> {
        let n = self.next()?;
        let mut weights = Vec::new();
        for _ in 0..n {
            let row = [self.next()?, self.next()?];
            let mut weight = [0; 8];
            for byte in &mut weight {
                *byte = self.next()?;
            }
            weights.push((
                usize::from(u16::from_le_bytes(row)),
                f64::from_le_bytes(weight),
            ));
        }
        let chain: Vec<usize> = self.chain.iter().map(|&(d, _)| d).collect();
        if self.openings.are_balanced(&chain, &weights) {
            return Ok(());
        }
        Err(self.error("its weights do not show that no line passes this chain"))
    }

    /// Checks that planes close the chain once its source is split as in the trace.
    fn split(&mut self, source: Option<Part>, depth: usize) -> Checked<()> {
        if depth > MAX_DEPTH {
            return Err(self.error("it splits too often"));
        }
        let kept = self.chain.clone();
        let tight = source.and_then(|source| self.tighten(source));
        match self.next()? {
            CLOSED
                if tight
                    .clone()
                    .is_none_or(|part| self.closes(part, MAX_TRIES)) => {}
            CLOSED => return Err(self.error("planes do not close this piece")),
            HALVES => {
                let halves = tight.map_or([None, None], |part| self.halves(&part));
                for half in halves {
                    self.split(half, depth + 1)?;
                }
            }
            _ => return Err(self.error("a split has an unknown symbol")),
        }
        self.chain = kept;
        Ok(())
    }

    /// Returns `true` if no line passes the chain once portal `q` is added to it. Tries more planes and splits than the trace
    /// has, since its writer and this reader may round the edges of thin slivers differently.
    fn closes_with(&mut self, q: usize, target: Option<Part>, source: Option<Part>) -> bool {
        self.chain.push((q, target));
        let is_closed = source.is_none_or(|source| self.closes(source, MAX_TRIES));
        self.chain.pop();
        is_closed
    }

    fn closes(&mut self, source: Part, tries: u32) -> bool {
        let kept = self.chain.clone();
        let is_closed = match self.tighten(source) {
            None => true,
            Some(_) if tries == 0 => false,
            Some(part) => self
                .halves(&part)
                .into_iter()
                .flatten()
                .all(|half| self.closes(half, tries - 1)),
        };
        self.chain = kept;
        is_closed
    }

    /// Clips the chain by planes between the source and each of its openings, then the source by planes between those
    /// and the last.
    fn tighten(&mut self, mut source: Part) -> Option<Part> {
        let (openings, clearance) = (self.openings, self.evidence.clearance);
        let mut planes: Vec<Plane> = Vec::new();
        for k in 1..self.chain.len() {
            let mut part = self.chain[k].1.clone()?;
            for plane in &planes {
                part = openings.in_front(part, plane, clearance)?;
            }
            planes.extend(openings.between(&source, &part));
            self.chain[k].1 = Some(part);
        }
        let (target, passes) = self.chain[1..].split_last()?;
        let target = target.1.clone()?;
        for (_, pass) in passes {
            for plane in openings.between(pass.as_ref()?, &target) {
                source = openings.behind(source, &plane, clearance)?;
            }
        }
        Some(source)
    }

    /// Returns the two halves of a part, cut across its longest side.
    fn halves(&self, part: &Part) -> [Option<Part>; 2] {
        let low = part.corners.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = part.corners.iter().copied().fold(DVec3::MIN, DVec3::max);
        let size = high - low;
        let axis = if size.x >= size.y && size.x >= size.z {
            DVec3::X
        } else if size.y >= size.z {
            DVec3::Y
        } else {
            DVec3::Z
        };
        let middle = axis.dot(low + high) * 0.5;
        [1.0, -1.0].map(|sign| {
            self.openings
                .keep(part.clone(), axis * sign, middle * sign, 0.0)
        })
    }
}

fn meets(a: &[u64], b: &[u64]) -> bool {
    a.iter().zip(b).any(|(x, y)| x & y != 0)
}
