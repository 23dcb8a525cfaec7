//! Brightness of the walls of each cell: radiosity over the graph.
//!
//! A cell is an enclosure whose walls reflect a share of the light that falls on them, the same everywhere
//! (Goral, Torrance, Greenberg & Battaile, "Modeling the Interaction of Light Between Diffuse Surfaces", SIGGRAPH
//! 1984, with one patch per cell); this is the internally reflected component of Hopkinson, Longmore & Petherbridge,
//! "An Empirical Formula for the Computation of the Indirect Component of Daylight Factor" (Trans. Illum. Eng. Soc.
//! 19, 1954). Portals exchange light between cells by their area. For a cell `c` with walls of area `S` and
//! reflectance `ρ`, and portals of areas `A`:
//!
//! ```text
//! H(c) = (Σ A τ B(behind the portal) + sun + S B(c)) / (S + Σ A)      incident on its walls
//! B(c) = ρ(c) H(c)                                                    reflected by them
//! ```
//!
//! solved by Gauss-Seidel iteration in the order of the cells, so that the result is deterministic.

use enfilade_cpg::{CellId, PortalKind, World};
use enfilade_runtime::Sightlines;
use glam::Vec3;

use crate::materials::Look;

/// Radiance of the sky, in all directions: the unit of everything below. Linear.
pub(super) const SKY: Vec3 = Vec3::new(0.90, 0.98, 1.12);
/// Radiance of the ground outdoors. Linear, in skies.
pub(super) const GROUND: Vec3 = Vec3::new(0.30, 0.28, 0.24);
/// Light of the sun on a surface that faces it. Linear, in skies.
const SUN: Vec3 = Vec3::new(3.2, 2.9, 2.4);
/// Least light on walls: a room without daylight has its lamps on. Linear, in skies.
const LAMP: f32 = 0.05;
/// Color of that lamp.
const LAMP_COLOR: Vec3 = Vec3::new(1.05, 1.0, 0.91);
/// Largest reflectance of a surface: where nothing has a color, a room still reflects as much as a furnished one with white
/// walls and a dark floor, or its light would be the same from all sides.
const WHITEST: f32 = 0.6;
const ROUNDS: usize = 80;

/// An opening of the graph for light.
#[derive(Clone, Debug)]
pub(super) struct Hole {
    /// The normal points from the first cell to the second.
    pub(super) cells: [CellId; 2],
    pub(super) normal: Vec3,
    /// Convex polygons. [Units: wu]
    pub(super) pieces: Vec<Vec<Vec3>>,
    /// [Units: wu²]
    pub(super) area: f32,
    /// Transmitted share of the light.
    pub(super) passes: f32,
}

impl Hole {
    /// Returns the cell on the other side.
    pub(super) fn other(&self, cell: CellId) -> CellId {
        self.cells[usize::from(self.cells[0] == cell)]
    }
}

/// Returns the luminance of a linear color.
pub(super) fn luminance(c: Vec3) -> f32 {
    c.dot(Vec3::new(0.21, 0.72, 0.07))
}

/// Returns the openings by portal.
pub(super) fn holes(world: &World) -> Vec<Hole> {
    let vectors = |outline: &Vec<[f32; 3]>| outline.iter().map(|&p| Vec3::from(p)).collect();
    (world.graph.portals.iter())
        .map(|portal| {
            let to_outdoors = portal.cells.iter().any(|&c| world.graph[c].outdoor);
            Hole {
                cells: portal.cells,
                normal: portal.normal.into(),
                // The outline stands in for many pieces: light has no sharp edges here.
                pieces: if portal.pieces.is_empty() || portal.pieces.len() > 4 {
                    vec![vectors(&portal.outline)]
                } else {
                    portal.pieces.iter().map(vectors).collect()
                },
                area: portal.area.max(0.0),
                passes: match portal.kind {
                    PortalKind::Window => 0.8,
                    // A leaf may stand open or shut; a leaf to the outdoors is mostly shut.
                    PortalKind::Door if to_outdoors => 0.2,
                    PortalKind::Door => 0.6,
                    PortalKind::Open | PortalKind::Crack => 1.0,
                },
            }
        })
        .collect()
}

/// Returns `true` if nothing but glass lies between two points.
pub(super) fn is_clear(world: &World, lines: &Sightlines, a: Vec3, b: Vec3) -> bool {
    let mut from = a;
    // Panes have two sides, windows two panes; more than that counts as opaque.
    for _ in 0..6 {
        let Some(hit) = lines.first_hit(from.to_array(), b.to_array()) else {
            return true;
        };
        let material = world.batches[hit.batch as usize].primitive.material;
        let material = material.and_then(|m| world.materials.get(m as usize));
        if !material.is_some_and(|m| m.transparent) {
            return false;
        }
        from += (b - from) * (hit.t as f32 + 1e-4);
        from += (b - from).normalize_or_zero() * 1e-3;
    }
    false
}

/// Returns points spread over a convex polygon: its center, and points halfway to up to four vertices.
pub(super) fn spread(polygon: &[Vec3]) -> impl Iterator<Item = Vec3> + '_ {
    let middle: Vec3 = polygon.iter().sum::<Vec3>() / polygon.len().max(1) as f32;
    let step = polygon.len().div_ceil(4).max(1);
    let halfway = polygon.iter().step_by(step);
    std::iter::once(middle).chain(halfway.map(move |&p| (p + middle) * 0.5))
}

/// Light reflected by the walls of each cell, and light of lamps.
pub(super) struct Balance {
    /// For each cell, light from its walls, lamps included. Linear, in skies.
    pub(super) sent: Vec<Vec3>,
    /// For each cell, light of its lamp on a wall. Linear, in skies.
    pub(super) lamps: Vec<Vec3>,
    /// For each cell, the share of light that its walls reflect in their true colors.
    pub(super) whiteness: Vec<f32>,
}

/// The walls of a cell.
struct Walls {
    /// [Units: wu²]
    area: f32,
    /// Reflectance by which they light each other.
    reflects: Vec3,
    /// Reflectance of their true colors.
    whiteness: f32,
}

/// Returns the walls of each cell.
fn walls(world: &World) -> Vec<Walls> {
    let mut sums = vec![(0.0, Vec3::ZERO, 0.0); world.graph.cells.len()];
    for batch in &world.batches {
        let p = &batch.primitive;
        let look = (p.material).and_then(|m| world.materials.get(m as usize));
        let look = look.map_or_else(Look::default, Look::of);
        if look.is_transparent || batch.cells.is_empty() {
            continue;
        }
        let [r, g, b, _] = look.base_color;
        // A texture counts as halving the reflectance; it is not decoded.
        let dim = if look.texture.is_some() { 0.5 } else { 1.0 };
        let own = luminance(Vec3::new(r, g, b) * dim);
        let color = (Vec3::new(r, g, b) * dim).clamp(Vec3::splat(0.02), Vec3::splat(WHITEST));
        let corner = |i: u32| Vec3::from(p.positions[i as usize]);
        let area: f32 = (p.triples().iter())
            .map(|t| {
                let [a, b, c] = t.map(corner);
                (b - a).cross(c - a).length() * 0.5
            })
            .sum();
        // Cells that see the same batch share its area.
        let area = area / batch.cells.len() as f32;
        for cell in &batch.cells {
            let sum = &mut sums[cell.idx()];
            *sum = (sum.0 + area, sum.1 + color * area, sum.2 + own * area);
        }
    }
    let mean = |(area, sum, own): (f32, Vec3, f32)| {
        if area > 0.0 {
            // Half the tint: eyes adapt to the light of a room as white.
            let color = sum / area;
            Walls {
                area,
                reflects: color.lerp(Vec3::splat(luminance(color)), 0.5),
                whiteness: own / area,
            }
        } else {
            Walls {
                area: 1.0,
                reflects: Vec3::splat(0.5),
                whiteness: 0.5,
            }
        }
    };
    sums.into_iter().map(mean).collect()
}

/// Returns the sunlight that enters a cell through an opening to the outdoors. Linear, in skies times wu².
fn sunshine(world: &World, lines: &Sightlines, hole: &Hole, sun: Vec3) -> Vec3 {
    let is_out = |c: CellId| world.graph[c].outdoor;
    let outwards = match hole.cells.map(is_out) {
        [false, true] => hole.normal,
        [true, false] => -hole.normal,
        _ => return Vec3::ZERO,
    };
    let facing = outwards.dot(sun);
    if facing <= 0.0 {
        return Vec3::ZERO;
    }
    let (mut lit, mut n) = (0_u32, 0_u32);
    for p in hole.pieces.iter().flat_map(|p| spread(p)) {
        n += 1;
        lit += u32::from(is_clear(world, lines, p + sun * 0.02, p + sun * 500.0));
    }
    SUN * (facing * hole.area * hole.passes * lit as f32 / n.max(1) as f32)
}

/// Computes the brightness of walls. Time grows with the portals, and with the rays that test for sunlight.
pub(super) fn balance(world: &World, lines: &Sightlines, holes: &[Hole], sun: Vec3) -> Balance {
    let cells = &world.graph.cells;
    let walls = walls(world);
    let mut gains = vec![Vec3::ZERO; cells.len()];
    let mut surface: Vec<f32> = walls.iter().map(|w| w.area).collect();
    for hole in holes {
        let from_sun = sunshine(world, lines, hole, sun);
        for cell in hole.cells {
            surface[cell.idx()] += hole.area;
            if !cells[cell.idx()].outdoor {
                gains[cell.idx()] += from_sun;
            }
        }
    }
    // Light from outdoors is half sky, half ground.
    let outdoors = (SKY + GROUND) * 0.5;
    let solve = |lamps: &[Vec3]| -> Vec<Vec3> {
        let sent_at_first = |c: &enfilade_cpg::Cell| if c.outdoor { outdoors } else { Vec3::ZERO };
        let mut sent: Vec<Vec3> = cells.iter().map(sent_at_first).collect();
        for _ in 0..ROUNDS {
            for (i, cell) in cells.iter().enumerate() {
                if cell.outdoor {
                    continue;
                }
                let mut flux = gains[i] + sent[i] * walls[i].area;
                for portal in &cell.portals {
                    let hole = &holes[portal.idx()];
                    let behind = hole.other(CellId(i as u32));
                    flux += sent[behind.idx()] * hole.area * hole.passes;
                }
                sent[i] = walls[i].reflects * (flux / surface[i].max(1e-6) + lamps[i]);
            }
        }
        sent
    };
    let mut lamps = vec![Vec3::ZERO; cells.len()];
    let by_day = solve(&lamps);
    for (i, cell) in cells.iter().enumerate() {
        let falls = luminance(by_day[i] / walls[i].reflects);
        if !cell.outdoor {
            // Reflected light comes on top.
            let own = 1.0 - luminance(walls[i].reflects);
            lamps[i] = LAMP_COLOR * ((LAMP - falls).max(0.0) * own);
        }
    }
    Balance {
        sent: solve(&lamps),
        lamps,
        whiteness: walls.iter().map(|w| w.whiteness).collect(),
    }
}

/// Returns the direction of the sun: of sixteen, the one that sends most light through openings to the outdoors.
pub(crate) fn sun_of(world: &World) -> Vec3 {
    // As high as on a spring afternoon: a lower sun makes rooms all glare, a higher one never reaches their floors.
    let (height, flat) = 40_f32.to_radians().sin_cos();
    let mut best = (f32::NEG_INFINITY, Vec3::Y);
    for i in 0..16 {
        // The first direction is oblique to the axes along which most walls run.
        let angle = (i as f32 + 0.58) * std::f32::consts::TAU / 16.0;
        let sun = Vec3::new(angle.cos() * flat, height, angle.sin() * flat);
        let mut sum = 0.0;
        for portal in &world.graph.portals {
            let normal = Vec3::from(portal.normal);
            let [a, b] = portal.cells.map(|c| world.graph[c].outdoor);
            let facing = match [a, b] {
                [false, true] => normal.dot(sun),
                [true, false] => -normal.dot(sun),
                _ => 0.0,
            };
            sum += facing.max(0.0) * portal.area;
        }
        // Only a clear gain replaces an earlier direction, so rounding does not decide.
        if sum > best.0 * 1.001 + 1e-3 || i == 0 {
            best = (sum, sun);
        }
    }
    best.1
}
