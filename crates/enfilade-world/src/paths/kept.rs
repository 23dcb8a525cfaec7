//! Walk maps as bytes, so that a program need not make them anew at each start.
//!
//! Restored to the bit. A map fits one world, walker and choice of objects, and the version of this crate that made it: a
//! [`WalkMapKey`] tells them apart. Bytes that do not fit, or are damaged, are refused as a whole; everything that queries rely
//! on is checked, so a forged map gives wrong paths at worst.
//!
//! | bytes | |
//! | --- | --- |
//! | 8 | `ENFWALK1` |
//! | 8 | hash (FNV-1a) of all that follows |
//! | | version, key, squares, floors, steps between cells, leaves, points of portals, lengths in cells |
//!
//! Whole numbers take seven bits a byte, lowest first; those of floors are differences from what the floor before suggests.
//! O(floors).

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;
use enfilade_runtime::DetailId;

use super::columns::Squares;
use super::floors::{Crossing, Floor, Floors};
use super::grounds::{MAX_SQUARES, NONE, first_of};
use super::walk_map::{PartMap, WalkMap, stops_of};
use super::ways::Ways;
use crate::bodies::Agent;
use crate::layout::Layout;
use crate::space::{PartId, Space};

const MAGIC: &[u8; 8] = b"ENFWALK1";
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Origin of a walk map: world, objects and walker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkMapKey {
    /// Hash of the world's file, as [`WalkMapKey::hash`].
    pub world: u64,
    /// Any number that tells apart the caller's choices of objects: see [`WalkMap::with_objects`].
    pub objects: u64,
    /// The walker.
    pub walker: Agent,
}

impl WalkMapKey {
    /// Returns the 64-bit FNV-1a hash of a file. Tells files apart, but does not withstand forgery.
    #[must_use]
    #[doc(hidden)]
    pub fn hash(bytes: &[u8]) -> u64 {
        bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }
}

/// Reason why bytes are not the map that is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KeptMapError {
    /// Not a walk map at all.
    #[error("it is not a walk map")]
    NotAMap,
    /// Made by another version.
    #[error("another version of enfilade made it")]
    OtherVersion,
    /// Made of another world.
    #[error("it is of another world, or the world has changed since")]
    OtherWorld,
    /// For another walker.
    #[error("it is for a walker of another size")]
    OtherWalker,
    /// With other objects.
    #[error("it is with other objects")]
    OtherObjects,
    /// Incomplete or changed.
    #[error("it is damaged: {0}")]
    Damaged(&'static str),
}

impl WalkMap {
    /// Returns the map of the root as bytes. Those of moving parts are small, and made anew.
    #[must_use]
    pub fn kept(&self, space: &Space, key: &WalkMapKey) -> Vec<u8> {
        let layout = space.layout(PartId::ROOT);
        // All fields, so that none is forgotten; the obstacles follow from the key.
        let PartMap {
            floors,
            ways,
            sides,
            stops: _,
        } = &*self.parts[PartId::ROOT.idx()];
        let mut out = Writer(Vec::new());
        out.key(key);
        out.floors(floors);
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            let range = ways.range(portal);
            out.number(range.len() as u64);
            for k in range {
                for floor in sides[k as usize] {
                    out.number(floor.into());
                }
            }
        }
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let n = ways.points_of(cell).count();
            // They are symmetric.
            for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
                out.real(ways.length(cell, i, j));
            }
        }
        let mut bytes = MAGIC.to_vec();
        bytes.extend(WalkMapKey::hash(&out.0).to_le_bytes());
        bytes.extend(out.0);
        bytes
    }

    /// Makes the map of a space whose root is the world in the key; `counts` makes the choice of objects in the key, as in
    /// [`WalkMap::with_objects`]. O(bytes), and the time to map the moving parts.
    ///
    /// # Errors
    ///
    /// If the bytes are of another key, or damaged.
    pub fn restored(
        bytes: &[u8],
        space: &Space,
        key: &WalkMapKey,
        mut counts: impl FnMut(PartId, DetailId) -> bool,
    ) -> Result<Self, KeptMapError> {
        let root = PartMap::restored(bytes, space, key, |d| counts(PartId::ROOT, d))?;
        Ok(Self::around(root, space, key.walker, counts))
    }
}

impl PartMap {
    fn restored(
        bytes: &[u8],
        space: &Space,
        key: &WalkMapKey,
        counts: impl FnMut(DetailId) -> bool,
    ) -> Result<Self, KeptMapError> {
        let layout = space.layout(PartId::ROOT);
        let rest = bytes.strip_prefix(MAGIC).ok_or(KeptMapError::NotAMap)?;
        let Some((hash, rest)) = rest.split_first_chunk() else {
            return Err(KeptMapError::Damaged("it ends early"));
        };
        if u64::from_le_bytes(*hash) != WalkMapKey::hash(rest) {
            return Err(KeptMapError::Damaged("its hash differs"));
        }
        let mut from = Reader(rest);
        from.key(key)?;
        let floors = from.floors(layout, key.walker)?;
        let (mut sides, mut first_side) = (Vec::new(), vec![0]);
        for portal in (0..layout.n_portals() as u32).map(PortalId) {
            for _ in 0..from.count(2)? {
                let pair = [
                    from.below(floors.n_floors())?,
                    from.below(floors.n_floors())?,
                ];
                if pair.map(|f| floors.floor(f).cell) != layout.opening(portal).cells() {
                    return Err(KeptMapError::Damaged("a portal has floors of other cells"));
                }
                sides.push(pair);
            }
            first_side.push(sides.len());
        }
        let mut ways = Ways::with_points(layout, |portal, points| {
            let own = &sides[first_side[portal.idx()]..first_side[portal.idx() + 1]];
            points.extend(own.iter().map(|[a, b]| middle(&floors, *a, *b)));
        });
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let n = ways.points_of(cell).count();
            if (n * (n + 1) / 2).saturating_mul(8) > from.0.len() {
                return Err(KeptMapError::Damaged("it ends early"));
            }
            let mut lengths = vec![0.0; n * n];
            for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
                let length = from.real()?;
                if length.is_nan() || length < 0.0 {
                    return Err(KeptMapError::Damaged(
                        "a length is not a number of at least 0",
                    ));
                }
                (lengths[i * n + j], lengths[j * n + i]) = (length, length);
            }
            ways.set_lengths(cell, lengths);
        }
        if !from.0.is_empty() {
            return Err(KeptMapError::Damaged("it goes on after its end"));
        }
        Ok(Self {
            stops: stops_of(space.world(PartId::ROOT), counts),
            floors,
            ways,
            sides,
        })
    }
}

/// Returns the point of a portal between two floors.
fn middle(floors: &Floors, a: u32, b: u32) -> DVec3 {
    (floors.point(a) + floors.point(b)) * 0.5
}

/// The steps of a floor that are likely after those of the floor before it.
#[derive(Default)]
struct Guess {
    square: i64,
    y: u32,
    cell: i64,
    steps: [i64; 4],
}

impl Guess {
    fn learn(&mut self, floor: &Floor) {
        (self.square, self.y) = (floor.square.into(), floor.y.to_bits());
        self.cell = floor.cell.0.into();
        for (guess, step) in self.steps.iter_mut().zip(floor.steps) {
            *guess += 1;
            if step != NONE {
                *guess = i64::from(step) + 1;
            }
        }
    }
}

struct Writer(Vec<u8>);

impl Writer {
    fn number(&mut self, mut n: u64) {
        while n >= 0x80 {
            self.0.push(n as u8 | 0x80);
            n >>= 7;
        }
        self.0.push(n as u8);
    }

    /// Writes a small number of either sign.
    fn signed(&mut self, n: i64) {
        self.number(((n << 1) ^ (n >> 63)) as u64);
    }

    fn real(&mut self, x: f64) {
        self.0.extend(x.to_bits().to_le_bytes());
    }

    fn key(&mut self, key: &WalkMapKey) {
        self.number(VERSION.len() as u64);
        self.0.extend(VERSION.as_bytes());
        self.0.extend(key.world.to_le_bytes());
        self.0.extend(key.objects.to_le_bytes());
        for x in numbers_of(&key.walker) {
            self.real(x);
        }
    }

    fn floors(&mut self, floors: &Floors) {
        // All fields, so that none is forgotten; `first` follows from the floors, the walker from the key.
        let Floors {
            squares: Squares { origin, side, n },
            first: _,
            floors,
            crossings,
            swung,
            doors,
            walker: _,
        } = floors;
        for x in [origin[0], origin[1], *side] {
            self.real(x);
        }
        for n in n {
            self.number(*n as u64);
        }
        self.number(floors.len() as u64);
        let mut guess = Guess::default();
        for floor in floors {
            self.signed(i64::from(floor.square) - guess.square);
            self.number((floor.y.to_bits() ^ guess.y).into());
            self.signed(i64::from(floor.cell.0) - guess.cell);
            self.number(u64::from(floor.is_swung) | u64::from(floor.is_edge) << 1);
            for (step, guess) in floor.steps.iter().zip(guess.steps) {
                if *step == NONE {
                    self.number(0);
                } else {
                    let n = i64::from(*step) - guess;
                    self.number((((n << 1) ^ (n >> 63)) as u64) + 1);
                }
            }
            guess.learn(floor);
        }
        self.number(crossings.len() as u64);
        let mut last = 0;
        for c in crossings {
            self.number(u64::from(c.from - last));
            self.number(c.direction.into());
            self.number(c.portal.0.into());
            last = c.from;
        }
        self.number(swung.len() as u64);
        let mut last = 0;
        for (floor, portal) in swung {
            self.number(u64::from(floor - last));
            self.number(portal.0.into());
            last = *floor;
        }
        self.number(doors.len() as u64);
        for portal in doors {
            self.number(portal.0.into());
        }
    }
}

fn numbers_of(walker: &Agent) -> [f64; 5] {
    let Agent {
        radius,
        height,
        eye,
        step,
        slope,
    } = *walker;
    [radius, height, eye, step, slope]
}

const WRONG: KeptMapError = KeptMapError::Damaged("its floors contradict each other");

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn byte(&mut self) -> Result<u8, KeptMapError> {
        let (first, rest) = self
            .0
            .split_first()
            .ok_or(KeptMapError::Damaged("it ends early"))?;
        self.0 = rest;
        Ok(*first)
    }

    fn word(&mut self) -> Result<u64, KeptMapError> {
        let (word, rest) =
            (self.0.split_first_chunk()).ok_or(KeptMapError::Damaged("it ends early"))?;
        self.0 = rest;
        Ok(u64::from_le_bytes(*word))
    }

    fn real(&mut self) -> Result<f64, KeptMapError> {
        self.word().map(f64::from_bits)
    }

    fn number(&mut self) -> Result<u64, KeptMapError> {
        let mut n = 0;
        for shift in (0..63).step_by(7) {
            let byte = self.byte()?;
            n |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Ok(n);
            }
        }
        Err(KeptMapError::Damaged("a number is too large"))
    }

    fn signed(&mut self) -> Result<i64, KeptMapError> {
        let n = self.number()?;
        Ok((n >> 1) as i64 ^ -((n & 1) as i64))
    }

    /// Reads an index below `n`.
    fn below(&mut self, n: usize) -> Result<u32, KeptMapError> {
        let i = self.number()?;
        u32::try_from(i)
            .ok()
            .filter(|i| (*i as usize) < n)
            .ok_or(KeptMapError::Damaged("a number is too large"))
    }

    /// Reads the number of items of at least `least` bytes each, that must follow.
    fn count(&mut self, least: usize) -> Result<usize, KeptMapError> {
        let n = self.number()?;
        let most = (self.0.len() / least) as u64;
        if n > most {
            return Err(KeptMapError::Damaged("it ends early"));
        }
        Ok(n as usize)
    }

    fn key(&mut self, key: &WalkMapKey) -> Result<(), KeptMapError> {
        let n = self.count(1)?;
        let (version, rest) = self.0.split_at(n);
        self.0 = rest;
        if version != VERSION.as_bytes() {
            return Err(KeptMapError::OtherVersion);
        }
        if self.word()? != key.world {
            return Err(KeptMapError::OtherWorld);
        }
        let has_objects = self.word()? == key.objects;
        for x in numbers_of(&key.walker) {
            if self.word()? != x.to_bits() {
                return Err(KeptMapError::OtherWalker);
            }
        }
        if has_objects {
            Ok(())
        } else {
            Err(KeptMapError::OtherObjects)
        }
    }

    fn floors(&mut self, layout: &Layout, walker: Agent) -> Result<Floors, KeptMapError> {
        let [x, z, side] = [self.real()?, self.real()?, self.real()?];
        let n = [self.number()?, self.number()?];
        let n_squares = n[0].saturating_mul(n[1]);
        let is_grid = x.is_finite() && z.is_finite() && side > 0.0 && side.is_finite();
        // A grid one square wide may have twice as many.
        if !is_grid || n_squares == 0 || n_squares as f64 > 4.0 * MAX_SQUARES {
            return Err(WRONG);
        }
        let squares = Squares {
            origin: [x, z],
            side,
            n: n.map(|n| n as usize),
        };
        let n_floors = self.count(8)?;
        let mut floors: Vec<Floor> = Vec::with_capacity(n_floors);
        let mut guess = Guess::default();
        for _ in 0..n_floors {
            let square = guess.square.saturating_add(self.signed()?);
            let y = u32::try_from(self.number()?).map_err(|_| WRONG)? ^ guess.y;
            let cell = guess.cell.saturating_add(self.signed()?);
            let flags = self.below(4)?;
            let mut steps = [NONE; 4];
            for (step, guess) in steps.iter_mut().zip(guess.steps) {
                if let Some(code) = self.number()?.checked_sub(1) {
                    let by = (code >> 1) as i64 ^ -((code & 1) as i64);
                    let to = u32::try_from(guess.saturating_add(by)).map_err(|_| WRONG)?;
                    *step = Some(to).filter(|t| (*t as usize) < n_floors).ok_or(WRONG)?;
                }
            }
            let is_in = |at: i64, n: usize| at >= 0 && (at as u64) < n as u64;
            let is_there = is_in(square, n_squares as usize) && is_in(cell, layout.n_cells());
            if !is_there || square < guess.square || !f32::from_bits(y).is_finite() {
                return Err(WRONG);
            }
            floors.push(Floor {
                square: square as u32,
                y: f32::from_bits(y),
                cell: CellId(cell as u32),
                is_swung: flags & 1 != 0,
                is_edge: flags & 2 != 0,
                steps,
            });
            guess.learn(&floors[floors.len() - 1]);
        }
        for (i, floor) in (0_u32..).zip(&floors) {
            for (direction, &to) in floor.steps.iter().enumerate().filter(|s| *s.1 != NONE) {
                let other = &floors[to as usize];
                let is_beside =
                    squares.beside(floor.square, direction) == Some(other.square as usize);
                if !is_beside || other.steps[(direction + 2) % 4] != i {
                    return Err(WRONG);
                }
            }
        }
        let crossings = self.crossings(layout, &floors)?;
        let swung = self.swung(layout, &floors)?;
        let doors = self.doors(layout)?;
        Ok(Floors {
            first: first_of(&squares, floors.iter().map(|f| f.square)),
            squares,
            floors,
            crossings,
            swung,
            doors,
            walker,
        })
    }

    /// Reads the steps between cells.
    fn crossings(
        &mut self,
        layout: &Layout,
        floors: &[Floor],
    ) -> Result<Vec<Crossing>, KeptMapError> {
        let (n_portals, n_floors) = (layout.n_portals(), floors.len());
        let mut crossings: Vec<Crossing> = Vec::new();
        let mut last = 0_u32;
        for _ in 0..self.count(3)? {
            let from = u64::from(last) + self.number()?;
            let from = u32::try_from(from)
                .ok()
                .filter(|f| (*f as usize) < n_floors);
            let from = from.ok_or(WRONG)?;
            let direction = self.below(4)?;
            let portal = PortalId(self.below(n_portals)?);
            let step = Crossing {
                from,
                direction,
                portal,
            };
            let to = floors[from as usize].steps[direction as usize];
            let other = floors.get(to as usize).ok_or(WRONG)?;
            let cells = layout.opening(portal).cells();
            let between = [floors[from as usize].cell, other.cell];
            let joins = between == cells || between == [cells[1], cells[0]];
            if !joins || crossings.last().is_some_and(|last| *last >= step) {
                return Err(WRONG);
            }
            crossings.push(step);
            last = from;
        }
        Ok(crossings)
    }

    /// Reads the floors in the way of leaves.
    fn swung(
        &mut self,
        layout: &Layout,
        floors: &[Floor],
    ) -> Result<Vec<(u32, PortalId)>, KeptMapError> {
        let (n_portals, n_floors) = (layout.n_portals(), floors.len());
        let mut swung: Vec<(u32, PortalId)> = Vec::new();
        let mut last = 0_u32;
        for _ in 0..self.count(2)? {
            let floor = u64::from(last) + self.number()?;
            let floor = u32::try_from(floor)
                .ok()
                .filter(|f| (*f as usize) < n_floors);
            let item = (floor.ok_or(WRONG)?, PortalId(self.below(n_portals)?));
            if swung.last().is_some_and(|last| *last >= item) || !floors[item.0 as usize].is_swung {
                return Err(WRONG);
            }
            last = item.0;
            swung.push(item);
        }
        Ok(swung)
    }

    /// Reads the portals with leaves.
    fn doors(&mut self, layout: &Layout) -> Result<Vec<PortalId>, KeptMapError> {
        let n_portals = layout.n_portals();
        let mut doors: Vec<PortalId> = Vec::new();
        for _ in 0..self.count(1)? {
            let portal = PortalId(self.below(n_portals)?);
            // A door with two leaves is there twice.
            if doors.last().is_some_and(|last| *last > portal) {
                return Err(WRONG);
            }
            doors.push(portal);
        }
        Ok(doors)
    }
}

#[cfg(test)]
mod tests;
