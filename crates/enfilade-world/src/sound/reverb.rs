//! Reverberation: decay times of rooms, and levels of their diffuse fields, coupled through openings.
//!
//! Statistical room acoustics: a cell of volume `V` whose walls absorb like an area `A` (Sabine; Eyring, "Reverberation time in
//! dead rooms", 1930) loses energy at the rate `c A / 4 V`, and has `RT60 = 55.3 V / c A` (Kuttruff, "Room Acoustics", §5.1). An
//! opening of area `S` takes `c S / 4 V` of it to the cell behind (coupled rooms, §5.9). For a steady source of power `P` the
//! fields `w` solve `A w + Σ S (w − w') = 4 P / c`, a symmetric system with a dominant diagonal. `O(portals)` per step of
//! conjugate gradients, which end by their residual; one solution for each source covers all cells.
//!
//! Rooms are assumed to be diffuse: within about a tenth for rooms that are not very long or very dead. The system is singular
//! only if nothing absorbs; absorption is at least a thousandth of the walls.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Portal, PortalId, PortalKind, World};

use crate::sound::bands::N_BANDS;
use crate::sound::materials::Assumed;
use crate::sound::walls::Surfaces;
use crate::space::{Joined, PartId, Place, Space};

/// Speed of sound in air at 20 °C. [Units: wu/s]
pub const SPEED_OF_SOUND: f64 = 343.2;

/// Formula from areas and absorption of walls to a rate of decay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecayLaw {
    /// Absorbing area is area times coefficient: for live rooms.
    Sabine,
    /// Each reflection loses the mean absorption of the walls: for dead rooms, too.
    Eyring,
    /// Eyring's, corrected for the unequal lengths of free paths (Kuttruff, "Room Acoustics", §5.4), whose variance is 0.36 of
    /// their mean squared in rooms of ordinary proportions.
    Kuttruff,
}

/// Half the variance of free paths, by their mean squared.
const HALF_VARIANCE: f64 = 0.18;

/// Volume and absorption of each cell of all parts. Made once; motion does not change it.
#[derive(Clone, Debug)]
pub struct Reverb {
    /// Part by part, without those added later.
    rooms: Vec<Room>,
    /// Per part, the index of its first cell.
    first_cell: Vec<u32>,
    law: DecayLaw,
    /// Per part and material, the area of walls and objects indoors.
    surfaces: BTreeMap<(PartId, Option<u32>), f64>,
    /// Per part and portal, the absorption of what shuts it. Empty for rooms that are given.
    closures: Vec<Vec<[f64; N_BANDS]>>,
}

/// The walls of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Room {
    volume: f64,
    area: f64,
    /// Sum of area times coefficient, in octave bands.
    absorbed: [f64; N_BANDS],
    /// The same of the objects in it, which are not walls.
    objects: [f64; N_BANDS],
}

/// Two cells, the clear area between them, and that of what shuts the rest of it.
#[derive(Clone, Copy, Debug)]
struct Coupling {
    cells: [CellId; 2],
    area: f64,
    shut: f64,
    /// Absorption of what shuts it, in octave bands.
    alpha: [f64; N_BANDS],
}

impl Reverb {
    /// Computes the rooms of the structure of all parts. `absorption` returns the coefficients of a material of a part in
    /// [octave bands](crate::OCTAVES), such as [those assumed](crate::Assumed) for its name; `None` for triangles without one. Objects
    /// absorb beside the walls (EN 12354-6); leaves and panes absorb as far as they are shut; outdoors absorbs everything.
    /// O(cells · log triangles), some milliseconds a cell.
    #[must_use]
    pub fn new(
        space: &Space,
        law: DecayLaw,
        absorption: impl Fn(PartId, Option<u32>) -> [f64; N_BANDS],
    ) -> Self {
        let mut reverb = Self {
            rooms: Vec::new(),
            first_cell: Vec::new(),
            law,
            surfaces: BTreeMap::new(),
            closures: Vec::new(),
        };
        for part in (0..space.n_parts() as u32).map(PartId) {
            let layout = space.layout(part);
            let first = reverb.rooms.len();
            reverb.first_cell.push(first as u32);
            for cell in (0..layout.n_cells() as u32).map(CellId) {
                let volume = layout.cell(cell).volume;
                reverb.rooms.push(Room {
                    volume,
                    ..Room::default()
                });
            }
            reverb.add_surfaces(space, part, first, &absorption);
            let world = space.world(part);
            let closures = world.graph.portals.iter().map(|portal| {
                let material = closure_of(world, portal);
                let known = material.map(|m| absorption(part, Some(m)));
                known.unwrap_or_else(|| {
                    let is_window = portal.kind == PortalKind::Window;
                    Assumed::of_name(if is_window { "window" } else { "door" }).bands
                })
            });
            reverb.closures.push(closures.collect());
        }
        reverb
    }

    fn add_surfaces(
        &mut self,
        space: &Space,
        part: PartId,
        first: usize,
        absorption: &impl Fn(PartId, Option<u32>) -> [f64; N_BANDS],
    ) {
        let (layout, surfaces) = (space.layout(part), Surfaces::new(space, part));
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let room = &mut self.rooms[first + cell.idx()];
            if layout.cell(cell).is_outdoor {
                room.absorbed = [OPEN_AIR; N_BANDS];
                continue;
            }
            surfaces.each_piece(cell, |piece| {
                let alpha = absorption(part, piece.material).map(|a| a.clamp(0.0, 1.0));
                let sums = match piece.is_object {
                    true => &mut room.objects,
                    false => &mut room.absorbed,
                };
                for (sum, a) in sums.iter_mut().zip(alpha) {
                    *sum += piece.area * a;
                }
                room.area += if piece.is_object { 0.0 } else { piece.area };
                let of = self.surfaces.entry((part, piece.material));
                *of.or_insert(0.0) += piece.area;
            });
        }
    }

    /// Makes rooms given by volume, area of walls and mean coefficient, for the cells of all parts, part by part. [Units: wu³, wu²]
    ///
    /// # Panics
    ///
    /// If there is not one per cell.
    #[must_use]
    #[doc(hidden)]
    pub fn of_rooms(space: &Space, law: DecayLaw, rooms: &[(f64, f64, f64)]) -> Self {
        assert_eq!(rooms.len(), space.n_cells(), "one for each cell");
        let mut reverb = Self {
            rooms: vec![Room::default(); rooms.len()],
            first_cell: space.parts.iter().map(|part| part.first_cell).collect(),
            law,
            surfaces: BTreeMap::new(),
            closures: Vec::new(),
        };
        for (room, &(volume, area, alpha)) in reverb.rooms.iter_mut().zip(rooms) {
            *room = Room {
                volume,
                area,
                absorbed: [area * alpha; N_BANDS],
                objects: [0.0; N_BANDS],
            };
        }
        reverb
    }

    /// Returns the area of a cell's walls, without openings. [Units: wu²]
    ///
    /// # Panics
    ///
    /// If there is no such place.
    #[must_use]
    #[doc(hidden)]
    pub fn area(&self, place: Place) -> f64 {
        self.rooms[self.index(place)].area
    }

    fn index(&self, place: Place) -> usize {
        self.first_cell[place.part.idx()] as usize + place.cell.idx()
    }

    /// Returns the area of walls and objects indoors of each part and material, `None` for those without one. [Units: wu²]
    #[doc(hidden)]
    pub fn surfaces(&self) -> impl Iterator<Item = (PartId, Option<u32>, f64)> {
        self.surfaces
            .iter()
            .map(|((part, material), area)| (*part, *material, *area))
    }

    /// Returns the fully absorbing area equivalent to the cell's walls and objects, in octave bands. [Units: wu²]
    ///
    /// # Panics
    ///
    /// If there is no such place.
    #[cfg(test)]
    pub(crate) fn absorbing_area(&self, place: Place) -> [f64; N_BANDS] {
        self.absorbing(&self.rooms[self.index(place)])
    }

    fn absorbing(&self, room: &Room) -> [f64; N_BANDS] {
        let least = room.area.max(1e-9);
        std::array::from_fn(|k| {
            let absorbed = room.absorbed[k];
            let mean = (absorbed / least).clamp(1e-3, 0.999);
            let walls = match self.law {
                _ if absorbed >= OPEN_AIR => return OPEN_AIR,
                DecayLaw::Sabine => mean * least,
                DecayLaw::Eyring => -(1.0 - mean).ln() * least,
                DecayLaw::Kuttruff => {
                    // As 1 − x, to the first order, but rising with absorption throughout.
                    let exponent = -(1.0 - mean).ln();
                    exponent / (1.0 + HALF_VARIANCE * exponent) * least
                }
            };
            walls + room.objects[k]
        })
    }

    /// Returns the number of cells.
    #[must_use]
    #[doc(hidden)]
    pub fn n_cells(&self) -> usize {
        self.rooms.len()
    }

    /// Writes the total loss per second of each cell's field, divided by its energy density. [Units: wu³/s]
    fn losses(&self, absorbing: &[f64], portals: &[Coupling], w: &[f64], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = absorbing[i] * w[i];
        }
        for p in portals {
            let [a, b] = p.cells.map(CellId::idx);
            let flow = p.area * (w[a] - w[b]);
            out[a] += flow;
            out[b] -= flow;
        }
    }
}

/// Returns the material of the leaf or pane that shuts a portal.
fn closure_of(world: &World, portal: &Portal) -> Option<u32> {
    let detail = world
        .details
        .get(portal.fittings.first()?.detail as usize)?;
    let mesh = world.detail_meshes.get(detail.mesh as usize)?;
    mesh.primitives.iter().find_map(|p| p.material)
}

/// Absorbing area of the outdoors, which returns nothing. [Units: wu²]
const OPEN_AIR: f64 = 1e6;

/// The diffuse fields of all cells, with reusable buffers: allocates nothing once they have grown.
#[derive(Clone, Debug, Default)]
pub struct DiffuseFields {
    portals: Vec<Coupling>,
    /// The cells, with what shuts their openings as walls.
    rooms: Vec<Room>,
    /// Per part, the index of its first cell.
    first_cell: Vec<u32>,
    /// Absorbing area of each cell in the band that is solved.
    absorbing: Vec<f64>,
    right: Vec<f64>,
    level: Vec<f64>,
    /// Per cell, in octave bands: the field, and the time of its decay.
    steady: Vec<[f64; N_BANDS]>,
    times: Vec<[f64; N_BANDS]>,
    decays: Vec<Decay>,
    /// Added to the diagonal of the balance: what the volume holds back in a step of time.
    inertia: Vec<f64>,
    residue: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
}

impl DiffuseFields {
    /// Makes it without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Solves for a steady source in a place. `open` returns the fraction of a portal's area that lets sound through, 0 to 1: of
    /// doors of parts that meet, the product of both counts. Rooms are coupled as the parts stand. O(portals · steps), at most
    /// some steps per cell; allocates if there are several parts.
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn solve(
        &mut self,
        reverb: &Reverb,
        space: &Space,
        place: Place,
        open: impl Fn(PartId, PortalId) -> f64,
    ) {
        let n = reverb.n_cells();
        self.first_cell.clone_from(&reverb.first_cell);
        self.couple(reverb, space, |part, portal| {
            open(part, portal).clamp(0.0, 1.0)
        });
        self.rooms.clone_from(&reverb.rooms);
        for portal in &self.portals {
            for cell in portal.cells {
                let room = &mut self.rooms[cell.idx()];
                room.area += portal.shut;
                for (sum, a) in room.absorbed.iter_mut().zip(portal.alpha) {
                    *sum += portal.shut * a;
                }
            }
        }
        for field in [&mut self.steady, &mut self.times] {
            field.clear();
            field.resize(n, [0.0; N_BANDS]);
        }
        for band in 0..N_BANDS {
            self.absorbing.clear();
            let rooms = self.rooms.iter();
            (self.absorbing).extend(rooms.map(|room| reverb.absorbing(room)[band]));
            self.inertia.clear();
            self.inertia.resize(n, 0.0);
            self.right.clear();
            self.right.resize(n, 0.0);
            self.right[reverb.index(place)] = 1.0;
            self.balance(reverb, 1e-24);
            for (steady, level) in self.steady.iter_mut().zip(&self.level) {
                steady[band] = level.max(0.0);
            }
            self.decay(reverb, band);
        }
    }

    /// Finds the openings between rooms.
    fn couple(&mut self, reverb: &Reverb, space: &Space, open: impl Fn(PartId, PortalId) -> f64) {
        self.portals.clear();
        let n_parts = reverb.first_cell.len();
        let coupling = |cells, whole: f64, area: f64, part: PartId, portal: PortalId| {
            let alpha = reverb.closures.get(part.idx()).map(|c| c[portal.idx()]);
            Coupling {
                cells,
                area,
                shut: alpha.map_or(0.0, |_| whole - area),
                alpha: alpha.unwrap_or_default(),
            }
        };
        if n_parts == 1 {
            let layout = space.layout(PartId::ROOT);
            for portal in (0..layout.n_portals() as u32).map(PortalId) {
                let (opening, part) = (layout.opening(portal), PartId::ROOT);
                let (cells, whole) = (opening.cells(), opening.area());
                let area = whole * open(part, portal);
                self.portals
                    .push(coupling(cells, whole, area, part, portal));
            }
            return;
        }
        let joined = Joined::new(space, n_parts);
        let is_place = |cell: CellId| {
            let place = joined.place(cell);
            place.is_some_and(|p| space.parts[p.part.idx()].border != Some(p.cell))
        };
        for portal in (0..joined.layout.n_portals() as u32).map(PortalId) {
            let opening = joined.layout.opening(portal);
            let (part, own) = joined.of_portal(portal);
            let (mut cells, mut area) = (opening.cells(), opening.area() * open(part, own));
            if let Some(other) = joined.docked[portal.idx()] {
                if other < portal {
                    continue;
                }
                let (part_behind, its) = joined.of_portal(other);
                let width = joined.layout.opening(other).area().min(opening.area());
                area *= open(part_behind, its) * width / opening.area().max(1e-9);
                let seam = usize::from(joined.place(cells[0]).is_some());
                cells[seam] = joined.behind(portal, cells[1 - seam]);
            }
            // A door in front of a wall leads nowhere.
            if cells.into_iter().all(is_place) {
                let whole = opening.area();
                self.portals.push(coupling(cells, whole, area, part, own));
            }
        }
    }

    /// Lets the field decay after the source has stopped, by the trapezoidal rule, `(V + h M) w' = (V − h M) w`, with steps that
    /// grow, and fits a line to each cell's level from 5 to 35 dB down.
    fn decay(&mut self, reverb: &Reverb, band: usize) {
        let n = reverb.n_cells();
        self.decays.clear();
        self.decays.resize(n, Decay::default());
        let rates = reverb
            .rooms
            .iter()
            .zip(&self.absorbing)
            .filter(|r| *r.1 < OPEN_AIR);
        let fastest = rates.map(|(room, area)| area / room.volume.max(1e-9));
        let fastest = SPEED_OF_SOUND / 4.0 * fastest.fold(0.0, f64::max);
        let (mut time, mut step) = (0.0, FIRST_STEP / fastest.max(1e-3));
        for _ in 0..MOST_STEPS {
            let share = SPEED_OF_SOUND * step / 8.0;
            reverb.losses(
                &self.absorbing,
                &self.portals,
                &self.level,
                &mut self.product,
            );
            for (i, room) in reverb.rooms.iter().enumerate() {
                self.inertia[i] = room.volume / share;
                self.right[i] = self.inertia[i] * self.level[i] - self.product[i];
            }
            self.balance(reverb, 1e-16);
            time += step;
            let mut is_done = true;
            for (i, decay) in self.decays.iter_mut().enumerate() {
                let share = self.level[i] / self.steady[i][band];
                is_done &= decay.add(time, step, share);
            }
            if is_done {
                break;
            }
            step *= GROWTH;
        }
        for (times, decay) in self.times.iter_mut().zip(&self.decays) {
            times[band] = decay.time();
        }
    }

    /// Conjugate gradients (Hestenes & Stiefel 1952), scaled by the diagonal, since areas vary widely.
    fn balance(&mut self, reverb: &Reverb, gap: f64) {
        let n = reverb.n_cells();
        let absorbing = &self.absorbing;
        let scale = |i: usize| 1.0 / (absorbing[i] + self.inertia[i]).max(1e-6).sqrt();
        for buffer in [&mut self.level, &mut self.product] {
            buffer.clear();
            buffer.resize(n, 0.0);
        }
        self.residue.clear();
        self.residue
            .extend(self.right.iter().enumerate().map(|(i, x)| x * scale(i)));
        self.direction.clone_from(&self.residue);
        let mut rest = dot(&self.residue, &self.residue);
        let end = gap * rest;
        for _ in 0..4 * n + 8 {
            if rest <= end {
                break;
            }
            for (i, x) in self.direction.iter_mut().enumerate() {
                *x *= scale(i);
            }
            reverb.losses(absorbing, &self.portals, &self.direction, &mut self.product);
            for i in 0..n {
                self.product[i] += self.inertia[i] * self.direction[i];
                self.direction[i] /= scale(i);
                self.product[i] *= scale(i);
            }
            let step = rest / dot(&self.direction, &self.product);
            for i in 0..n {
                self.level[i] += step * self.direction[i];
                self.residue[i] -= step * self.product[i];
            }
            let next = dot(&self.residue, &self.residue);
            for i in 0..n {
                self.direction[i] = self.residue[i] + next / rest * self.direction[i];
            }
            rest = next;
        }
        for (i, x) in self.level.iter_mut().enumerate() {
            *x *= scale(i);
        }
    }

    /// Returns the time in which a cell's field falls by 60 dB after the source has stopped, at mid frequencies: the mean of the
    /// bands of 500 and 1,000 Hz (ISO 3382-2). Twice that of the decay from 5 to 35 dB down, with the energy that other rooms
    /// return, to half a percent. 0 if no sound reaches it. [Units: s]
    ///
    /// # Panics
    ///
    /// If there is no such place, or nothing was solved.
    #[must_use]
    pub fn rt60(&self, place: Place) -> f64 {
        let bands = self.rt60_bands(place);
        0.5 * (bands[2] + bands[3])
    }

    /// Returns the same in each [octave band](crate::OCTAVES). Air absorbs nothing, which matters at 4 kHz in halls. [Units: s]
    ///
    /// # Panics
    ///
    /// If there is no such place, or nothing was solved.
    #[must_use]
    pub fn rt60_bands(&self, place: Place) -> [f64; N_BANDS] {
        self.times[self.index(place)]
    }

    /// Returns the amplitude of a cell's field, relative to the source's free field at a distance of 1: its energy is `16 π`
    /// times this, the mean over the bands. Above 0 if any sound reaches it.
    ///
    /// # Panics
    ///
    /// If there is no such place, or nothing was solved.
    #[must_use]
    pub fn gain(&self, place: Place) -> f64 {
        (16.0 * std::f64::consts::PI * self.density(place).max(0.0)).sqrt()
    }

    /// Returns the same in each [octave band](crate::OCTAVES).
    ///
    /// # Panics
    ///
    /// If there is no such place, or nothing was solved.
    #[must_use]
    pub fn gain_bands(&self, place: Place) -> [f64; N_BANDS] {
        let density = self.steady[self.index(place)];
        density.map(|d| (16.0 * std::f64::consts::PI * d).sqrt())
    }

    /// Returns the energy density divided by 4 / c times the source's power, the mean over the bands. [Units: 1/wu²]
    ///
    /// # Panics
    ///
    /// If there is no such place, or nothing was solved.
    #[must_use]
    #[doc(hidden)]
    pub fn density(&self, place: Place) -> f64 {
        self.steady[self.index(place)].iter().sum::<f64>() / N_BANDS as f64
    }

    fn index(&self, place: Place) -> usize {
        self.first_cell[place.part.idx()] as usize + place.cell.idx()
    }
}

/// First step of time, by the time in which the fastest room falls to 1 / e, and the growth of steps.
const FIRST_STEP: f64 = 0.08;
const GROWTH: f64 = 1.02;
/// Most steps: two hundred times the time of the fastest room.
const MOST_STEPS: usize = 200;

/// A line fitted to the level of a decay, by the weights of the steps of time.
#[derive(Clone, Copy, Debug, Default)]
struct Decay {
    weight: f64,
    time: f64,
    level: f64,
    time_squared: f64,
    time_level: f64,
}

impl Decay {
    /// Adds the energy left after a time; returns `true` once it has fallen by 35 dB, or was nothing at first.
    fn add(&mut self, time: f64, step: f64, share: f64) -> bool {
        let level = 10.0 * share.max(1e-30).log10();
        if !share.is_finite() || level <= -35.0 {
            return true;
        }
        if level <= -5.0 {
            self.weight += step;
            self.time += step * time;
            self.level += step * level;
            self.time_squared += step * time * time;
            self.time_level += step * time * level;
        }
        false
    }

    /// Returns the time of a decay by 60 dB; 0 if there was none. [Units: s]
    fn time(&self) -> f64 {
        let spread = self.weight * self.time_squared - self.time * self.time;
        let slope = self.weight * self.time_level - self.time * self.level;
        if slope < 0.0 {
            -60.0 * spread / slope
        } else {
            0.0
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests;
