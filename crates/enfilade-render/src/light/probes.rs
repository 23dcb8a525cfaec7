//! Light in the air of each cell at grid points: the light that would fall on a surface facing one of six directions.
//!
//! Probes are grouped by cell, so that no light leaks through walls, however thin. The light at a probe is that of the
//! polygons it sees through up to three portals in a row, by exact [form factors](super::form) with the view
//! narrowed at each portal, plus that of the [walls](super::balance) around it. Six colors per probe are the ambient
//! cube of McTaggart, "Half-Life 2 / Valve Source Shading" (GDC 2004). The displayed value is a power of it, as eyes
//! adapt: Stevens, "To Honor Fechner and Repeal His Law" (Science 133, 1961); so a cellar and a winter garden can
//! share one picture.

use enfilade_cpg::{CellId, World};
use enfilade_runtime::{Sight, Sightlines};
use glam::{UVec3, Vec3};

use super::balance::{Balance, GROUND, Hole, SKY, balance, holes, is_clear, luminance, spread};
use super::form::{Polygon, clip_into, clip_through, form_factor};

/// Distance between probes. [Units: wu]
const SPACING: f32 = 0.7;
/// Most probes of a cell along each axis, even in a hall.
const MOST: [u32; 3] = [14, 4, 14];
/// Most probes in all; beyond that, the spacing grows.
const MOST_IN_ALL: u64 = 30_000;
/// Least share of the light for which portals behind a portal are followed.
const WORTH: f32 = 0.004;
/// Exponent from light to brightness.
const ADAPTATION: f32 = 0.88;
/// Reflectance of a usual room, on which exposures are based; and of the darkest that is exposed longer for it.
const USUAL: f32 = 0.6;
const DARKEST: f32 = 0.4;
/// Largest distance between lamps. [Units: wu]
const BETWEEN_LAMPS: f32 = 4.0;
/// Height of lamps in a room, as a share of its own.
const LAMP_HEIGHT: f32 = 0.85;
/// Share of a lamp's light that comes straight from it; the rest is spread by its shade and the ceiling.
const STRAIGHT: f32 = 0.6;
/// Size of a lamp: nearer to it, it is not a point. [Units: wu]
const LAMP_SIZE: f32 = 0.8;
/// Brightness of a surface under the open sky.
const BRIGHTEST: f32 = 1.0;

/// The six directions that surfaces may face, in the order of the slabs of a box.
const WAYS: [Vec3; 6] = [
    Vec3::X,
    Vec3::NEG_X,
    Vec3::Y,
    Vec3::NEG_Y,
    Vec3::Z,
    Vec3::NEG_Z,
];

/// The probes of one cell: a box of texels of six stacked slabs, one per direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Minimum of its space. [Units: wu]
    pub(super) low: Vec3,
    /// Probes per meter.
    pub(super) density: Vec3,
    /// Probes along each axis.
    pub(super) n: UVec3,
    /// Position of its first texel.
    pub(super) at: UVec3,
}

/// The probes of a world.
pub(super) struct Probes {
    /// One entry per cell; none outdoors.
    pub(super) grids: Vec<Option<Grid>>,
    /// Texels along each axis.
    pub(super) size: UVec3,
    /// Shared-exponent colors, x fastest, then y.
    pub(super) texels: Vec<u32>,
    /// For each cell, mean brightness of its air and, by it, of its walls; 0 outdoors.
    pub(super) brightness: Vec<f32>,
}

/// Lays out the probes, at most `side` texels along each axis.
fn grids(world: &World, side: u32) -> (Vec<Option<Grid>>, UVec3) {
    let mut spacing = SPACING;
    loop {
        let mut out = Vec::new();
        let (mut x, mut z, mut row, mut n_all) = (0, 0, 0, 0);
        let mut size = UVec3::ONE;
        for cell in &world.graph.cells {
            let [low, high] = cell.aabb.map(Vec3::from);
            let extent = high - low;
            if cell.outdoor || !extent.is_finite() {
                out.push(None);
                continue;
            }
            let n = |k: usize| ((extent[k] / spacing).round() as u32).clamp(1, MOST[k]);
            let n = UVec3::new(n(0), n(1), n(2));
            if x + n.x > side {
                (x, z, row) = (0, z + row, 0);
            }
            out.push(Some(Grid {
                low,
                density: n.as_vec3() / extent.max(Vec3::splat(1e-3)),
                n,
                at: UVec3::new(x, 0, z),
            }));
            x += n.x;
            row = row.max(n.z);
            n_all += u64::from(n.x * n.y * n.z);
            size = size.max(UVec3::new(x, 6 * n.y, z + row));
        }
        // One probe per cell is the minimum.
        if (n_all <= MOST_IN_ALL && size.max_element() <= side) || spacing > 1e6 {
            return (out, size);
        }
        spacing *= 1.4;
    }
}

/// Data for the computation of probes.
struct Room<'a> {
    world: &'a World,
    lines: &'a Sightlines,
    holes: &'a [Hole],
    balance: &'a Balance,
}

/// Places of the lamps of a room, in rows below the ceiling, and a factor that makes their mean light 1.
struct Lamps {
    at: Vec<Vec3>,
    scale: f32,
}

impl Lamps {
    fn new([low, high]: [Vec3; 2]) -> Self {
        let extent = high - low;
        let n = |k: usize| (extent[k] / BETWEEN_LAMPS).ceil().clamp(1.0, 8.0) as u32;
        let (nx, nz) = (n(0), n(2));
        let place = |i: u32| {
            let [x, z] = [(i % nx, nx), (i / nx, nz)].map(|(i, n)| (i as f32 + 0.5) / n as f32);
            low + extent * Vec3::new(x, LAMP_HEIGHT, z)
        };
        let mut out = Self {
            at: (0..nx * nz).map(place).collect(),
            scale: 1.0,
        };
        // Points all over the box.
        let steps = [0.1, 0.3, 0.5, 0.7, 0.9];
        let points = (0..125).map(|i| {
            let at = Vec3::new(steps[i % 5], steps[i / 5 % 5], steps[i / 25]);
            low + extent * at
        });
        let sum: f32 = points.map(|p| out.shine(p).iter().sum::<f32>()).sum();
        out.scale = 6.0 * 125.0 / sum.max(1e-6);
        out
    }

    /// Returns the light on six surfaces at a point.
    fn shine(&self, p: Vec3) -> [f32; 6] {
        let mut out = [0.0; 6];
        for lamp in &self.at {
            let way = *lamp - p;
            let d2 = way.length_squared() + LAMP_SIZE * LAMP_SIZE;
            let each = self.scale / (d2 * d2.sqrt());
            for (k, facing) in WAYS.iter().enumerate() {
                out[k] += way.dot(*facing).max(0.0) * each;
            }
        }
        out
    }
}

/// View of a point through portals: the part left of the last one, and the share of the light that passes all.
#[derive(Clone, Copy)]
struct Through<'a> {
    seen: &'a [Vec3],
    passes: f32,
}

/// Light on six surfaces, and the share of each hemisphere that it came from.
#[derive(Clone, Copy, Default)]
struct Falling {
    light: [Vec3; 6],
    share: [f32; 6],
}

impl Room<'_> {
    /// Adds the light that reaches the point `p` through the portals of `cell`, as far as `through` shows them.
    fn add(
        &self,
        out: &mut Falling,
        p: Vec3,
        cell: CellId,
        through: Option<Through<'_>>,
        path: &mut Vec<u32>,
    ) {
        for portal in &self.world.graph[cell].portals {
            let hole = &self.holes[portal.idx()];
            if path.contains(&portal.0) || hole.pieces.is_empty() {
                continue;
            }
            // View portals from their cell's side.
            let side = if hole.cells[0] == cell { 1.0 } else { -1.0 };
            let ahead = hole.normal * side;
            if ahead.dot(hole.pieces[0][0] - p) <= 1e-4 {
                continue;
            }
            for piece in &hole.pieces {
                let mut seen: Polygon = piece.iter().map(|&q| q - p).collect();
                let mut passes = hole.passes;
                if let Some(before) = through {
                    seen = clip_through(&seen, before.seen);
                    passes *= before.passes;
                }
                if seen.len() >= 3 {
                    let clear = self.clear_share(p, &seen, path.is_empty());
                    let through = Through {
                        seen: &seen,
                        passes: passes * clear,
                    };
                    self.add_seen(out, p, cell, portal.0, through, path);
                }
            }
        }
    }

    /// Returns the share of a polygon that no structure hides. Portals behind portals count in full: they are
    /// clipped by the view already, and rays are expensive.
    fn clear_share(&self, p: Vec3, seen: &[Vec3], is_near: bool) -> f32 {
        if !is_near {
            return 1.0;
        }
        let (mut n, mut clear) = (0_u32, 0_u32);
        for q in spread(seen) {
            n += 1;
            clear += u32::from(is_clear(self.world, self.lines, p, p + q * 0.995));
        }
        clear as f32 / n.max(1) as f32
    }

    fn add_seen(
        &self,
        out: &mut Falling,
        p: Vec3,
        cell: CellId,
        portal: u32,
        through: Through<'_>,
        path: &mut Vec<u32>,
    ) {
        let Through { seen, passes } = through;
        let behind = self.holes[portal as usize].other(cell);
        let (mut scratch, mut part) = (Vec::new(), Vec::new());
        if self.world.graph[behind].outdoor {
            for (color, up) in [(SKY, Vec3::Y), (GROUND, Vec3::NEG_Y)] {
                clip_into(seen, up, &mut part);
                for (k, &way) in WAYS.iter().enumerate() {
                    let share = form_factor(&part, way, &mut scratch) * passes;
                    out.light[k] += color * share;
                    out.share[k] += share;
                }
            }
            return;
        }
        // The walls behind, and everything visible through those walls' portals.
        let mut beyond = Falling::default();
        let shares = WAYS.map(|way| form_factor(seen, way, &mut scratch) * passes);
        if path.len() < 2 && shares.iter().any(|&s| s > WORTH) {
            path.push(portal);
            self.add(&mut beyond, p, behind, Some(through), path);
            path.pop();
        }
        for (k, share) in shares.into_iter().enumerate() {
            let walls = (share - beyond.share[k]).max(0.0);
            out.light[k] += beyond.light[k] + self.balance.sent[behind.idx()] * walls;
            out.share[k] += share;
        }
    }

    /// Returns the light on surfaces at a point of a cell. Linear, in skies.
    fn falling(&self, p: Vec3, cell: CellId, lamps: &Lamps) -> [Vec3; 6] {
        let mut out = Falling::default();
        self.add(&mut out, p, cell, None, &mut Vec::new());
        let walls = self.balance.sent[cell.idx()];
        let lamp = self.balance.lamps[cell.idx()];
        let straight = lamps.shine(p);
        std::array::from_fn(|k| {
            // Most of the rest comes from the ceiling.
            let spread = 1.0 + 0.45 * WAYS[k].y;
            let from_lamp = lamp * (spread + (straight[k] - spread) * STRAIGHT);
            out.light[k] + walls * (1.0 - out.share[k]).max(0.0) + from_lamp
        })
    }
}

/// Returns the position of a probe in its cell: the center of its box, or a point near that.
fn place(sight: &Sight, cell: CellId, grid: &Grid, i: UVec3) -> Option<Vec3> {
    let size = 1.0 / grid.density;
    let middle = grid.low + (i.as_vec3() + 0.5) * size;
    let offsets = [
        [0.0, 0.0, 0.0],
        [0.3, 0.0, 0.0],
        [-0.3, 0.0, 0.0],
        [0.0, 0.0, 0.3],
        [0.0, 0.0, -0.3],
        [0.0, 0.3, 0.0],
        [0.0, -0.3, 0.0],
    ];
    (offsets.iter())
        .map(|&o| middle + size * Vec3::from(o))
        .find(|p| sight.locate(p.to_array()) == Some(cell))
}

/// Returns the brightness that eyes perceive.
fn adapted(light: Vec3) -> Vec3 {
    let sum = luminance(light).max(1e-4);
    light * (BRIGHTEST * sum.powf(ADAPTATION - 1.0))
}

/// Fills probes outside of air from their neighbors, nearest first.
fn spread_into_gaps(n: UVec3, values: &mut [Option<[Vec3; 6]>]) {
    let index = |x: u32, y: u32, z: u32| ((z * n.y + y) * n.x + x) as usize;
    for _ in 0..n.x.max(n.y).max(n.z) {
        let before = values.to_vec();
        let mut is_done = true;
        for (z, y, x) in
            (0..n.z).flat_map(|z| (0..n.y).flat_map(move |y| (0..n.x).map(move |x| (z, y, x))))
        {
            if before[index(x, y, z)].is_some() {
                continue;
            }
            let (mut sum, mut count) = ([Vec3::ZERO; 6], 0.0);
            let mut take = |x: u32, y: u32, z: u32| {
                let is_inside = x < n.x && y < n.y && z < n.z;
                if let Some(v) = is_inside.then(|| before[index(x, y, z)]).flatten() {
                    (0..6).for_each(|k| sum[k] += v[k]);
                    count += 1.0;
                }
            };
            for step in [1, u32::MAX] {
                take(x.wrapping_add(step), y, z);
                take(x, y.wrapping_add(step), z);
                take(x, y, z.wrapping_add(step));
            }
            if count > 0.0 {
                values[index(x, y, z)] = Some(sum.map(|s| s / count));
            } else {
                is_done = false;
            }
        }
        if is_done {
            break;
        }
    }
}

/// Encodes a color as `RGB9E5`: nine bits per channel and a shared exponent.
fn shared_exponent(c: Vec3) -> u32 {
    const BIAS: i32 = 15;
    let c = c.clamp(Vec3::ZERO, Vec3::splat(65408.0));
    let exponent = (c.max_element().max(1e-30).log2().floor() as i32).max(-BIAS - 1) + 1 + BIAS;
    let scale = |e: i32| f32::powi(2.0, 9 + BIAS - e);
    // If the greatest channel rounds up to 512, take the next exponent.
    let e = exponent + i32::from((c.max_element() * scale(exponent)).round() >= 512.0);
    let [r, g, b] = (c * scale(e)).to_array().map(|x| x.round() as u32);
    r | g << 9 | b << 18 | (e as u32) << 27
}

impl Probes {
    /// Computes the light of a world under a sun in direction `sun`, in a texture of at most `side` texels along
    /// each axis.
    /// Time grows with the probes, 30,000 at most, and the portals that each sees: mostly below a second.
    pub(super) fn build(world: &World, sight: &Sight, sun: Vec3, side: u32) -> Self {
        let lines = Sightlines::build(world);
        let holes = holes(world);
        let balance = balance(world, &lines, &holes, sun);
        let room = Room {
            world,
            lines: &lines,
            holes: &holes,
            balance: &balance,
        };
        let (grids, size) = grids(world, side);
        let mut texels = vec![0; size.element_product() as usize];
        let mut brightness = vec![0.0; grids.len()];
        for (cell, grid) in (0..).map(CellId).zip(&grids) {
            let Some(grid) = grid else { continue };
            let n = grid.n;
            let mut values = Vec::new();
            let lamps = Lamps::new(world.graph[cell].aabb.map(Vec3::from));
            for i in 0..n.element_product() {
                let at = UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y));
                let p = place(sight, cell, grid, at);
                values.push(p.map(|p| room.falling(p, cell, &lamps).map(adapted)));
            }
            spread_into_gaps(n, &mut values);
            let lights = || values.iter().flatten().flatten();
            let sum: f32 = lights().map(|&light| luminance(light)).sum();
            // Cameras measure what walls reflect: white rooms look no brighter than others.
            let reflected = balance.whiteness[cell.idx()].clamp(DARKEST, 1.0) / USUAL;
            brightness[cell.idx()] = reflected * sum / lights().count().max(1) as f32;
            // Without any probe in air, use the light of the walls.
            let walls = [adapted(balance.sent[cell.idx()] + balance.lamps[cell.idx()]); 6];
            for (i, value) in (0..).zip(values) {
                let at = grid.at + UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y));
                for (k, color) in (0..).zip(value.unwrap_or(walls)) {
                    let y = at.y + k * n.y;
                    let texel = (at.z * size.y + y) * size.x + at.x;
                    texels[texel as usize] = shared_exponent(color);
                }
            }
        }
        Self {
            grids,
            size,
            texels,
            brightness,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::{Cell, Portal, PortalId, PortalKind};
    use enfilade_testkit::{GridParams, room_grid};

    const SUN: Vec3 = Vec3::new(0.0, 0.6, -0.8);

    /// Two rooms in a row along x, 4 m a side, 3 m high, without walls: a window in the first at x = 0, a doorway
    /// between them. There is only the graph: portals alone decide where light passes.
    fn two_rooms(window: bool, doorway: bool) -> World {
        let cell = |name: &str, low: f32, high: f32, outdoor| Cell {
            name: name.into(),
            aabb: [[low, 0.0, 0.0], [high, 3.0, 4.0]],
            volume: (high - low) * 12.0,
            outdoor,
            ..Cell::default()
        };
        let portal = |cells: [u32; 2], x: f32, [from, to]: [f32; 2], kind| Portal {
            cells: cells.map(CellId),
            kind,
            normal: [1.0, 0.0, 0.0],
            outline: vec![[x, from, 1.5], [x, to, 1.5], [x, to, 2.5], [x, from, 2.5]],
            pieces: Vec::new(),
            fittings: Vec::new(),
            area: to - from,
            why: Vec::new(),
        };
        let mut world = World::default();
        world.graph.cells = vec![
            cell("outdoors", -9.0, 9.0, true),
            cell("a", 0.0, 4.0, false),
            cell("b", 4.0, 8.0, false),
        ];
        let window = window.then(|| portal([0, 1], 0.0, [1.0, 2.0], PortalKind::Window));
        let doorway = doorway.then(|| portal([1, 2], 4.0, [0.0, 2.0], PortalKind::Open));
        for portal in window.into_iter().chain(doorway) {
            let id = PortalId(world.graph.portals.len() as u32);
            for cell in portal.cells {
                world.graph.cells[cell.idx()].portals.push(id);
            }
            world.graph.portals.push(portal);
        }
        world
    }

    /// Returns the light on surfaces at a point of a cell of such rooms.
    fn falling(world: &World, p: [f32; 3], cell: u32) -> [f32; 6] {
        let lines = Sightlines::build(world);
        let holes = holes(world);
        let balance = balance(world, &lines, &holes, SUN);
        let room = Room {
            world,
            lines: &lines,
            holes: &holes,
            balance: &balance,
        };
        let lamps = Lamps::new(world.graph.cells[cell as usize].aabb.map(Vec3::from));
        room.falling(p.into(), CellId(cell), &lamps).map(luminance)
    }

    #[test]
    fn it_is_brighter_at_a_window_and_on_what_faces_it() {
        let world = two_rooms(true, true);
        let (near, far) = ([0.5, 1.5, 2.0], [3.5, 1.5, 2.0]);
        let (near, far) = (falling(&world, near, 1), falling(&world, far, 1));
        // Slab 1 faces the window, slab 0 faces away from it.
        assert!(near[1] > 3.0 * far[1], "{near:?} {far:?}");
        assert!(far[1] > 1.3 * far[0], "{far:?}");
    }

    #[test]
    fn light_comes_from_room_to_room_through_doorways_alone() {
        let p = [4.5, 1.5, 2.0];
        let [lit, dark] = [true, false].map(|doorway| falling(&two_rooms(true, doorway), p, 2));
        // Before the doorway, the window two rooms away is visible.
        assert!(
            lit[1] > 1.5 * lit[0] && lit[1] > 1.2 * dark[1],
            "{lit:?} {dark:?}"
        );
        // Behind a wall, a window changes nothing: the lamp is the only light.
        assert_eq!(dark, falling(&two_rooms(false, false), p, 2));
        assert!(
            dark.iter().all(|&x| x > 0.01),
            "somebody switched a light on"
        );
    }

    #[test]
    fn a_room_sends_back_less_than_it_gets_and_more_with_a_window() {
        let of = |window| {
            let world = two_rooms(window, false);
            let lines = Sightlines::build(&world);
            balance(&world, &lines, &holes(&world), SUN)
        };
        let (day, night) = (of(true), of(false));
        assert!(luminance(day.sent[1]) > luminance(night.sent[1]));
        assert!(luminance(day.sent[1]) < luminance(SKY), "{:?}", day.sent);
        assert!(luminance(day.lamps[1]) < luminance(night.lamps[1]));
    }

    #[test]
    fn every_texel_is_filled_and_the_same_each_time() {
        let world = room_grid(&GridParams::offices(30, 3));
        let sight = Sight::build(&world).unwrap();
        let [a, b] = [(), ()].map(|()| Probes::build(&world, &sight, SUN, 512));
        assert_eq!(a.texels, b.texels);
        for grid in a.grids.iter().flatten() {
            for z in 0..grid.n.z {
                for y in 0..6 * grid.n.y {
                    let row = ((grid.at.z + z) * a.size.y + y) * a.size.x + grid.at.x;
                    let row = &a.texels[row as usize..(row + grid.n.x) as usize];
                    assert!(row.iter().all(|&t| t != 0), "{grid:?}");
                }
            }
        }
        // A texture with few texels has fewer probes.
        let small = Probes::build(&world, &sight, SUN, 32);
        assert!(small.size.max_element() <= 32, "{}", small.size);
    }

    #[test]
    fn colors_come_back_from_nine_bits_and_an_exponent() {
        for c in [
            [1.0, 0.5, 0.25],
            [0.01, 0.02, 0.0],
            [511.6, 3.0, 900.0],
            [0.999_9, 0.0, 0.0],
        ] {
            let word = shared_exponent(c.into());
            let scale = f32::powi(2.0, (word >> 27) as i32 - 24);
            for (k, want) in c.into_iter().enumerate() {
                let got = (word >> (9 * k) & 511) as f32 * scale;
                let largest = c.into_iter().fold(0.0, f32::max);
                assert!((got - want).abs() <= largest / 256.0, "{c:?}: {got}");
            }
        }
    }
}
