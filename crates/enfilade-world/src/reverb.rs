//! Reverberation: how long rooms ring, and how loud their diffuse fields are, coupled through openings.
//!
//! Statistical room acoustics: a cell of volume `V` whose walls absorb like an area `A` (Sabine; Eyring, "Reverberation time in dead
//! rooms", 1930) loses energy at the rate `c A / 4 V`, and rings `RT60 = 55.3 V / c A` (Kuttruff, "Room Acoustics", §5.1). An opening
//! of area `S` takes `c S / 4 V` of it and gives that to the cell behind (coupled rooms, §5.9). Of a steady source of power `P` the
//! fields `w` solve `A w + Σ S (w − w') = 4 P / c`, a symmetric system with a dominant diagonal. `O(portals)` a step of conjugate
//! gradients, which end by their residue; solved for all cells once for each source.
//!
//! Rooms are taken for diffuse: within about a tenth for rooms that are not very long or very dead. The system is singular only where
//! nothing absorbs; absorption is at least a thousandth of the walls.

use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::{DVec3, triangle_area_normal};

use crate::layout::Layout;

/// Of sound in air at 20 °C. [Units: wu/s]
pub const SPEED_OF_SOUND: f64 = 343.2;

/// By which formula walls' areas and absorption become a rate of decay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecayLaw {
    /// Absorbed area is area times coefficient: for live rooms.
    Sabine,
    /// Sound loses at each reflection what the mean wall absorbs: for dead rooms too.
    Eyring,
}

/// How much of the sound that falls on a material is absorbed at 500 Hz, 0 to 1, by words in its name; 0.1 where none fits.
///
/// After the tables of Kuttruff and of Cox & D'Antonio ("Acoustic Absorbers and Diffusers"): mean values of a class.
#[must_use]
pub fn absorption_of_name(name: &str) -> f64 {
    const CLASSES: [(&[&str], f64); 8] = [
        (&["carpet", "rug", "teppich"], 0.30),
        (&["curtain", "fabric", "textile", "cloth"], 0.45),
        (&["acoustic", "foam", "absorb"], 0.80),
        (&["ceiling", "gypsum", "drywall", "board"], 0.10),
        (&["wood", "parquet", "timber", "oak"], 0.08),
        (&["glass", "window", "pane"], 0.06),
        (&["grass", "soil", "ground", "snow"], 0.60),
        (
            &[
                "concrete", "brick", "stone", "tile", "marble", "plaster", "metal", "steel",
            ],
            0.03,
        ),
    ];
    let name = name.to_lowercase();
    let fits = |words: &[&str]| words.iter().any(|w| name.contains(w));
    let class = CLASSES.iter().find(|(words, _)| fits(words));
    class.map_or(0.1, |c| c.1)
}

/// What each cell holds and absorbs. Made once.
#[derive(Clone, Debug)]
pub struct Reverb {
    rooms: Vec<Room>,
    portals: Vec<Coupling>,
    law: DecayLaw,
}

/// The walls of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Room {
    volume: f64,
    area: f64,
    /// Area times coefficient, summed.
    absorbed: f64,
}

#[derive(Clone, Copy, Debug)]
struct Coupling {
    cells: [CellId; 2],
    area: f64,
}

impl Reverb {
    /// Of a world's structure, with the coefficient of each material by `absorption`: `None` for triangles without one. A wall seen
    /// from several cells counts in those of its front, by where its triangles face; outdoors absorbs all. O(triangles).
    #[must_use]
    pub fn new(
        layout: &Layout,
        world: &World,
        law: DecayLaw,
        absorption: impl Fn(Option<u32>) -> f64,
    ) -> Self {
        let mut rooms = vec![Room::default(); layout.n_cells()];
        for (i, room) in rooms.iter_mut().enumerate() {
            room.volume = layout.cell(CellId(i as u32)).volume;
        }
        for batch in world.batches.iter().filter(|b| !b.cells.is_empty()) {
            let alpha = absorption(batch.primitive.material).clamp(0.0, 1.0);
            let corner =
                |i: &u32| DVec3::from_array(batch.primitive.positions[*i as usize].map(f64::from));
            for indices in batch.primitive.indices.as_chunks::<3>().0 {
                let triangle = indices.each_ref().map(corner);
                let normal = triangle_area_normal(&triangle);
                let area = 0.5 * normal.length();
                let middle = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
                let off = normal.normalize_or_zero() * OFF;
                // A wall without thickness has a cell on either side.
                let sides = [middle + off, middle - off].map(|p| layout.locate(p));
                for (k, cell) in sides.iter().enumerate() {
                    let is_other = k == 0 || sides[0] != sides[1];
                    if let Some(cell) = cell.filter(|c| is_other && batch.cells.contains(c)) {
                        rooms[cell.idx()].area += area;
                        rooms[cell.idx()].absorbed += area * alpha;
                    }
                }
            }
        }
        let portals = (0..layout.n_portals() as u32).map(|p| {
            let opening = layout.opening(PortalId(p));
            Coupling {
                cells: opening.cells(),
                area: opening.area(),
            }
        });
        for (i, room) in rooms.iter_mut().enumerate() {
            if layout.cell(CellId(i as u32)).is_outdoor {
                room.absorbed = OPEN_AIR;
            }
        }
        Self {
            rooms,
            portals: portals.collect(),
            law,
        }
    }

    /// Of rooms given by volume, area of walls and mean coefficient, coupled by the portals of `layout`. [Units: wu³, wu²]
    ///
    /// # Panics
    ///
    /// When there is not one for each cell.
    #[must_use]
    pub fn of_rooms(layout: &Layout, law: DecayLaw, rooms: &[(f64, f64, f64)]) -> Self {
        assert_eq!(rooms.len(), layout.n_cells(), "one for each cell");
        let mut reverb = Self::new(layout, &World::default(), law, |_| 0.1);
        for (room, &(volume, area, alpha)) in reverb.rooms.iter_mut().zip(rooms) {
            *room = Room {
                volume,
                area,
                absorbed: area * alpha,
            };
        }
        reverb
    }

    /// The area of a cell's walls, without openings. [Units: wu²]
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    #[must_use]
    pub fn area(&self, cell: CellId) -> f64 {
        self.rooms[cell.idx()].area
    }

    /// The area that absorbs as much as the cell's walls, all that falls on it. [Units: wu²]
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    #[must_use]
    pub fn absorbing_area(&self, cell: CellId) -> f64 {
        let room = &self.rooms[cell.idx()];
        let mean = (room.absorbed / room.area.max(1e-9)).clamp(1e-3, 0.999);
        let least = room.area.max(1e-9);
        match self.law {
            _ if room.absorbed >= OPEN_AIR => OPEN_AIR,
            DecayLaw::Sabine => mean * least,
            DecayLaw::Eyring => -(1.0 - mean).ln() * least,
        }
    }

    /// How many cells there are.
    #[must_use]
    pub fn n_cells(&self) -> usize {
        self.rooms.len()
    }

    /// The total of what a cell's field loses a second, by its energy density. [Units: wu³/s]
    fn losses(&self, open: &[f64], w: &[f64], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.absorbing_area(CellId(i as u32)) * w[i];
        }
        for (p, share) in self.portals.iter().zip(open) {
            let [a, b] = p.cells.map(CellId::idx);
            let flow = p.area * share * (w[a] - w[b]);
            out[a] += flow;
            out[b] -= flow;
        }
    }
}

/// What a wall's points are moved off it by. [Units: wu]
const OFF: f64 = 0.02;
/// Absorbs all that comes out. [Units: wu²]
const OPEN_AIR: f64 = 1e6;

/// The diffuse fields of all cells, with buffers that are used again: nothing is allocated once they have grown.
#[derive(Clone, Debug, Default)]
pub struct DiffuseFields {
    open: Vec<f64>,
    right: Vec<f64>,
    level: Vec<f64>,
    steady: Vec<f64>,
    residue: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
}

impl DiffuseFields {
    /// Without buffers yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Solves for a steady source in `cell`: `open` says of each portal how much of its area lets sound through, 0 to 1.
    /// O(portals · steps), at most some steps for each cell.
    ///
    /// # Panics
    ///
    /// When there is no such cell.
    pub fn solve(&mut self, reverb: &Reverb, cell: CellId, open: impl Fn(PortalId) -> f64) {
        let n = reverb.n_cells();
        self.open.clear();
        let portals = (0..reverb.portals.len() as u32).map(PortalId);
        self.open.extend(portals.map(|p| open(p).clamp(0.0, 1.0)));
        self.right.clear();
        self.right.resize(n, 0.0);
        self.right[cell.idx()] = 1.0;
        self.balance(reverb);
        std::mem::swap(&mut self.steady, &mut self.level);
        // The sum over time of what is left after the source stopped solves the same system.
        for (i, room) in reverb.rooms.iter().enumerate() {
            self.right[i] = room.volume * self.steady[i];
        }
        self.balance(reverb);
    }

    /// Conjugate gradients (Hestenes & Stiefel 1952), scaled by the diagonal: areas are of all sizes.
    fn balance(&mut self, reverb: &Reverb) {
        let n = reverb.n_cells();
        let scale = |i: usize| 1.0 / reverb.absorbing_area(CellId(i as u32)).max(1e-6).sqrt();
        for buffer in [&mut self.level, &mut self.product] {
            buffer.clear();
            buffer.resize(n, 0.0);
        }
        self.residue.clear();
        self.residue
            .extend(self.right.iter().enumerate().map(|(i, x)| x * scale(i)));
        self.direction.clone_from(&self.residue);
        let mut rest = dot(&self.residue, &self.residue);
        let end = 1e-24 * rest;
        for _ in 0..4 * n + 8 {
            if rest <= end {
                break;
            }
            for (i, x) in self.direction.iter_mut().enumerate() {
                *x *= scale(i);
            }
            reverb.losses(&self.open, &self.direction, &mut self.product);
            for i in 0..n {
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

    /// How long a cell's field takes to fall by 60 dB after the source has stopped, by its mean time of decay: with what other rooms
    /// give back. 0 where no sound comes. [Units: s]
    ///
    /// # Panics
    ///
    /// When there is no such cell, or nothing was solved.
    #[must_use]
    pub fn rt60(&self, cell: CellId) -> f64 {
        let steady = self.steady[cell.idx()];
        if steady <= 0.0 {
            return 0.0;
        }
        let mean = 4.0 / SPEED_OF_SOUND * self.level[cell.idx()] / steady;
        6.0 * std::f64::consts::LN_10 * mean.max(0.0)
    }

    /// The field of a cell, by that of the source's free field at a distance of 1: its energy is `16 π` times this. The amplitude
    /// that is heard of the room. Above 0 where any sound comes.
    ///
    /// # Panics
    ///
    /// When there is no such cell, or nothing was solved.
    #[must_use]
    pub fn gain(&self, cell: CellId) -> f64 {
        (16.0 * std::f64::consts::PI * self.steady[cell.idx()].max(0.0)).sqrt()
    }

    /// Energy density by the source's power times 4 / c. [Units: 1/wu²]
    ///
    /// # Panics
    ///
    /// When there is no such cell, or nothing was solved.
    #[must_use]
    pub fn density(&self, cell: CellId) -> f64 {
        self.steady[cell.idx()]
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::{GridParams, room_grid};

    fn two_rooms() -> (Layout, f64) {
        let world = room_grid(&GridParams::two_rooms());
        let layout = Layout::new(&world);
        let door = layout.opening(PortalId(0)).area();
        (layout, door)
    }

    /// W11: a room alone is Sabine's.
    #[test]
    fn a_closed_room_rings_as_sabine_says() {
        let (layout, _) = two_rooms();
        let reverb = Reverb::of_rooms(
            &layout,
            DecayLaw::Sabine,
            &[(100.0, 130.0, 0.1), (50.0, 90.0, 0.2)],
        );
        let mut fields = DiffuseFields::new();
        fields.solve(&reverb, CellId(0), |_| 0.0);
        let sabine = 24.0 * 10f64.ln() / SPEED_OF_SOUND * 100.0 / 13.0;
        assert!((fields.rt60(CellId(0)) / sabine - 1.0).abs() < 1e-9);
        assert!((fields.density(CellId(0)) * 13.0 - 1.0).abs() < 1e-9);
        assert_eq!(fields.gain(CellId(1)), 0.0);
    }

    /// W11: two rooms by a door, against the balance of two equations in closed form.
    #[test]
    fn coupled_rooms_balance() {
        let (layout, door) = two_rooms();
        let (v, a) = ([100.0, 50.0], [13.0, 18.0]);
        let reverb = Reverb::of_rooms(
            &layout,
            DecayLaw::Sabine,
            &[(v[0], 130.0, 0.1), (v[1], 90.0, 0.2)],
        );
        let mut fields = DiffuseFields::new();
        for share in [0.0, 0.3, 1.0] {
            let s = door * share;
            fields.solve(&reverb, CellId(0), |_| share);
            let (m00, m11) = (a[0] + s, a[1] + s);
            let det = m00 * m11 - s * s;
            let w = [m11 / det, s / det];
            for k in 0..2 {
                let got = fields.density(CellId(k as u32));
                assert!((got - w[k]).abs() < 1e-9 * w[0], "{got} {}", w[k]);
            }
            let left = (m11 * v[0] * w[0] + s * v[1] * w[1]) / det;
            let time = 24.0 * 10f64.ln() / SPEED_OF_SOUND * left / w[0];
            assert!((fields.rt60(CellId(0)) / time - 1.0).abs() < 1e-9);
        }
    }

    /// W11: the walls of rooms without thickness are found by the cells before them.
    #[test]
    fn a_rooms_walls_are_its_box_less_its_doors() {
        let world = room_grid(&GridParams::two_rooms());
        let layout = Layout::new(&world);
        let reverb = Reverb::new(&layout, &world, DecayLaw::Eyring, |_| 0.2);
        for c in [CellId(0), CellId(1)] {
            let size = layout.cell(c).bounds.max - layout.cell(c).bounds.min;
            let all = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
            let walls = all - layout.opening(PortalId(0)).area();
            assert!(
                (reverb.area(c) - walls).abs() < 0.01 * walls,
                "{} {walls}",
                reverb.area(c)
            );
            let eyring = -0.8f64.ln() * reverb.area(c);
            assert!((reverb.absorbing_area(c) - eyring).abs() < 1e-6 * eyring);
        }
    }
}
