//! Furniture, doors and glass: meshes for detail objects.
//!
//! Each stands on the origin, its back towards -z and its front towards +z, centered in x and z, so
//! that at a yaw of 0 it faces a viewer who looks along -z.

use enfilade_geom::{Aabb, DVec2, DVec3};

use crate::site::Site;
use crate::solid::{MeshBuilder, aabb};

/// Materials that furniture is made of.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    /// Table tops, wardrobes.
    pub wood: u32,
    /// Legs, lamps.
    pub metal: u32,
    /// Sofas, beds.
    pub fabric: u32,
    /// Pillows, bath tubs, counters.
    pub white: u32,
    /// Plants.
    pub leaf: u32,
    /// Plant pots.
    pub clay: u32,
    /// Panes.
    pub glass: u32,
}

impl Palette {
    /// Adds the materials to `site`.
    pub fn new(site: &mut Site) -> Self {
        Self {
            wood: site.material("wood", [0.42, 0.24, 0.11]),
            metal: site.material("metal", [0.25, 0.26, 0.28]),
            fabric: site.material("fabric", [0.10, 0.22, 0.38]),
            white: site.material("white", [0.85, 0.85, 0.83]),
            leaf: site.material("leaf", [0.08, 0.32, 0.08]),
            clay: site.material("clay", [0.45, 0.16, 0.08]),
            glass: site.glass("glass", [0.70, 0.85, 0.90, 0.25]),
        }
    }
}

/// Meshes of furniture, each added to the scene once.
#[derive(Clone, Copy, Debug)]
pub struct Furniture {
    /// 1.6 × 0.8 m, 0.74 m high; 60 triangles.
    pub desk: u32,
    /// 2.0 × 0.9 m, 0.75 m high; 60 triangles.
    pub table: u32,
    /// 0.45 × 0.45 m, 0.85 m high; 72 triangles.
    pub chair: u32,
    /// 2.0 × 0.9 m; 72 triangles.
    pub sofa: u32,
    /// 1.6 × 2.0 m, its head towards -z; 60 triangles.
    pub bed: u32,
    /// 1.8 × 0.6 m, 2.0 m high; 36 triangles.
    pub wardrobe: u32,
    /// 0.9 × 0.35 m, 1.8 m high; 76 triangles.
    pub shelf: u32,
    /// 2.4 × 0.6 m, 0.9 m high; 52 triangles.
    pub counter: u32,
    /// 1.7 × 0.75 m, 0.55 m high; 56 triangles.
    pub tub: u32,
    /// 0.4 × 0.6 m; 24 triangles.
    pub toilet: u32,
    /// 0.5 × 0.5 m, 1.1 m high; 84 triangles.
    pub plant: u32,
    /// 0.4 × 0.4 m, 1.5 m high; 88 triangles.
    pub lamp: u32,
    /// 2.0 × 1.4 m, 1 cm thick; 12 triangles.
    pub rug: u32,
    /// 0.45 × 0.4 m, 0.5 m high; 12 triangles.
    pub cabinet: u32,
}

/// A box `w` × `d` around the origin, from `y0` to `y1`.
fn block(w: f64, d: f64, y0: f64, y1: f64) -> Aabb {
    at(0.0, 0.0, w, d, y0, y1)
}

/// A box `w` × `d` around (x, z), from `y0` to `y1`.
fn at(x: f64, z: f64, w: f64, d: f64, y0: f64, y1: f64) -> Aabb {
    aabb(
        [x - w * 0.5, y0, z - d * 0.5],
        [x + w * 0.5, y1, z + d * 0.5],
    )
}

fn legs(b: &mut MeshBuilder, w: f64, d: f64, size: f64, top: f64) {
    let (x, z) = ((w - size) * 0.5, (d - size) * 0.5);
    for (x, z) in [(-x, -z), (x, -z), (-x, z), (x, z)] {
        b.cuboid(at(x, z, size, size, 0.0, top));
    }
}

impl Furniture {
    /// Adds the meshes to `site`.
    pub fn new(site: &mut Site, p: &Palette) -> Self {
        let table = |w: f64, d: f64, h: f64| {
            let mut b = MeshBuilder::new(p.wood);
            b.cuboid(block(w, d, h - 0.04, h)).paint(p.metal);
            legs(&mut b, w, d, 0.06, h - 0.04);
            b
        };
        let mut chair = MeshBuilder::new(p.wood);
        chair.cuboid(block(0.45, 0.45, 0.42, 0.46));
        chair
            .cuboid(at(0.0, -0.205, 0.45, 0.04, 0.46, 0.85))
            .paint(p.metal);
        legs(&mut chair, 0.45, 0.45, 0.04, 0.42);

        let mut sofa = MeshBuilder::new(p.fabric);
        sofa.cuboid(block(1.6, 0.9, 0.12, 0.42));
        sofa.cuboid(at(-0.9, 0.0, 0.2, 0.9, 0.08, 0.62));
        sofa.cuboid(at(0.9, 0.0, 0.2, 0.9, 0.08, 0.62));
        sofa.cuboid(at(0.0, -0.35, 1.6, 0.2, 0.42, 0.85))
            .paint(p.white);
        sofa.cuboid(at(-0.6, -0.15, 0.4, 0.15, 0.42, 0.75));
        sofa.cuboid(at(0.6, -0.15, 0.4, 0.15, 0.42, 0.75));

        let mut bed = MeshBuilder::new(p.wood);
        bed.cuboid(block(1.6, 2.0, 0.08, 0.3));
        bed.cuboid(at(0.0, -1.0, 1.6, 0.06, 0.0, 0.95))
            .paint(p.fabric);
        bed.cuboid(at(0.0, 0.2, 1.56, 1.5, 0.3, 0.52))
            .paint(p.white);
        bed.cuboid(at(-0.4, -0.75, 0.65, 0.4, 0.3, 0.6));
        bed.cuboid(at(0.4, -0.75, 0.65, 0.4, 0.3, 0.6));

        let mut wardrobe = MeshBuilder::new(p.wood);
        wardrobe.cuboid(block(1.8, 0.56, 0.0, 2.0));
        wardrobe.cuboid(at(-0.45, 0.29, 0.86, 0.02, 0.06, 1.94));
        wardrobe.cuboid(at(0.45, 0.29, 0.86, 0.02, 0.06, 1.94));

        let mut shelf = MeshBuilder::new(p.wood);
        let niches: Vec<Aabb> = (0..4)
            .map(|i| {
                let low = 0.05 + 0.44 * f64::from(i);
                aabb([-0.42, low, -0.15], [0.42, low + 0.39, 0.175])
            })
            .collect();
        shelf.carved(&[block(0.9, 0.35, 0.0, 1.8)], &niches);

        let mut counter = MeshBuilder::new(p.wood);
        counter.cuboid(block(2.4, 0.56, 0.0, 0.86)).paint(p.white);
        let sink = at(-0.5, 0.0, 0.6, 0.4, 0.88, 0.9);
        counter.carved(&[block(2.4, 0.6, 0.86, 0.9)], &[sink]);

        let mut tub = MeshBuilder::new(p.white);
        tub.carved(
            &[block(1.7, 0.75, 0.0, 0.55)],
            &[block(1.54, 0.59, 0.12, 0.55)],
        );

        let mut toilet = MeshBuilder::new(p.white);
        toilet.cuboid(at(0.0, 0.05, 0.38, 0.5, 0.0, 0.42));
        toilet.cuboid(at(0.0, -0.25, 0.4, 0.1, 0.0, 0.8));

        let mut plant = MeshBuilder::new(p.clay);
        plant.column(DVec2::ZERO, 0.18, 6, 0.0, 0.35).paint(p.leaf);
        for (x, y, z, r) in [
            (0.0, 0.62, 0.0, 0.24),
            (0.1, 0.85, 0.04, 0.18),
            (-0.08, 0.9, -0.06, 0.16),
        ] {
            plant.icosahedron(DVec3::new(x, y, z), DVec3::new(r, r * 1.2, r));
        }

        let mut lamp = MeshBuilder::new(p.metal);
        lamp.column(DVec2::ZERO, 0.15, 8, 0.0, 0.03);
        lamp.column(DVec2::ZERO, 0.015, 8, 0.03, 1.25)
            .paint(p.white);
        lamp.column(DVec2::ZERO, 0.2, 10, 1.25, 1.5);

        let mut rug = MeshBuilder::new(p.fabric);
        rug.cuboid(block(2.0, 1.4, 0.0, 0.01));
        let mut cabinet = MeshBuilder::new(p.metal);
        cabinet.cuboid(block(0.45, 0.4, 0.0, 0.5));

        Self {
            desk: site.mesh("desk", table(1.6, 0.8, 0.74)),
            table: site.mesh("table", table(2.0, 0.9, 0.75)),
            chair: site.mesh("chair", chair),
            sofa: site.mesh("sofa", sofa),
            bed: site.mesh("bed", bed),
            wardrobe: site.mesh("wardrobe", wardrobe),
            shelf: site.mesh("shelf", shelf),
            counter: site.mesh("kitchen cabinet", counter),
            tub: site.mesh("bathtub", tub),
            toilet: site.mesh("toilet", toilet),
            plant: site.mesh("plant", plant),
            lamp: site.mesh("lamp", lamp),
            rug: site.mesh("rug", rug),
            cabinet: site.mesh("cabinet", cabinet),
        }
    }
}

/// Things that make a furnished room look lived in, each mesh added to the scene once.
#[derive(Clone, Copy, Debug)]
pub struct Comforts {
    /// 1.8 × 0.6 m, 0.9 m high; 24 triangles.
    pub worktop: u32,
    /// 1.2 × 0.6 m, 0.4 m high; 72 triangles.
    pub low_table: u32,
    /// 0.8 × 0.8 m; 60 triangles.
    pub armchair: u32,
    /// 1.8 × 0.45 m, 0.7 m high; 84 triangles.
    pub sideboard: u32,
    /// Books for the niches of a [`Furniture::shelf`].
    pub books: u32,
    /// 1.0 × 0.7 m, to hang 1.2 m above the floor; 24 triangles.
    pub painting: u32,
    /// A lamp that hangs 1 m below a ceiling, at its origin; 64 triangles.
    pub pendant: u32,
    /// 2.4 × 1.7 m, 1 cm thick, with a border; 24 triangles.
    pub carpet: u32,
}

impl Comforts {
    /// Adds the meshes to `site`.
    pub fn new(site: &mut Site, p: &Palette) -> Self {
        let mustard = site.material("mustard", [0.62, 0.34, 0.05]);
        let brick = site.material("terracotta", [0.55, 0.19, 0.10]);
        let sand = site.material("sand", [0.70, 0.62, 0.48]);
        let mut worktop = MeshBuilder::new(p.wood);
        worktop.cuboid(block(1.8, 0.56, 0.0, 0.86)).paint(p.white);
        worktop.cuboid(block(1.8, 0.6, 0.86, 0.9));

        let mut low_table = MeshBuilder::new(p.wood);
        low_table.cuboid(block(1.2, 0.6, 0.36, 0.4));
        low_table
            .cuboid(block(1.0, 0.45, 0.12, 0.14))
            .paint(p.metal);
        legs(&mut low_table, 1.2, 0.6, 0.05, 0.36);

        let mut armchair = MeshBuilder::new(mustard);
        armchair.cuboid(block(0.56, 0.7, 0.14, 0.42));
        for x in [-0.34, 0.34] {
            armchair.cuboid(at(x, 0.0, 0.12, 0.8, 0.08, 0.6));
        }
        armchair.cuboid(at(0.0, -0.32, 0.56, 0.16, 0.42, 0.86));
        armchair
            .paint(p.white)
            .cuboid(at(0.0, -0.16, 0.4, 0.14, 0.42, 0.7));

        let mut sideboard = MeshBuilder::new(p.wood);
        sideboard.cuboid(block(1.8, 0.42, 0.12, 0.7));
        for x in [-0.6, 0.0, 0.6] {
            sideboard.cuboid(at(x, 0.215, 0.57, 0.02, 0.15, 0.67));
        }
        sideboard.paint(p.metal);
        legs(&mut sideboard, 1.7, 0.36, 0.04, 0.12);

        // Rows of books of four colors, as high and wide as a hash of their place.
        let mut books = MeshBuilder::new(p.fabric);
        for shelf in 0..4_u32 {
            let mut x = -0.4;
            for k in 0..6_u32 {
                let hash = ((shelf * 31 + k * 17).wrapping_mul(2_654_435_761) >> 16) % 97;
                let (wide, high) = (
                    0.06 + 0.05 * f64::from(hash % 3) / 2.0,
                    0.22 + 0.1 * f64::from(hash % 5) / 4.0,
                );
                if x + wide > 0.4 || hash % 7 == 6 {
                    x += wide;
                    continue;
                }
                books.paint([p.fabric, brick, sand, mustard][(hash % 4) as usize]);
                let low = 0.05 + 0.44 * f64::from(shelf);
                books.cuboid(at(
                    x + wide * 0.5,
                    -0.02,
                    wide - 0.002,
                    0.2,
                    low,
                    low + high,
                ));
                x += wide;
            }
        }

        let mut painting = MeshBuilder::new(p.wood);
        painting
            .cuboid(at(0.0, 0.015, 1.0, 0.03, 1.2, 1.9))
            .paint(sand);
        painting.cuboid(at(0.0, 0.032, 0.9, 0.006, 1.25, 1.85));
        painting
            .paint(brick)
            .cuboid(at(-0.15, 0.036, 0.4, 0.004, 1.35, 1.7));
        painting
            .paint(p.fabric)
            .cuboid(at(0.2, 0.037, 0.3, 0.004, 1.3, 1.55));

        let mut pendant = MeshBuilder::new(p.metal);
        pendant
            .column(DVec2::ZERO, 0.01, 6, -0.8, 0.0)
            .paint(p.white);
        pendant.column(DVec2::ZERO, 0.22, 12, -1.0, -0.8);

        let mut carpet = MeshBuilder::new(sand);
        carpet.cuboid(block(2.4, 1.7, 0.0, 0.008));
        carpet.paint(brick).cuboid(block(2.1, 1.4, 0.008, 0.01));

        Self {
            worktop: site.mesh("worktop", worktop),
            low_table: site.mesh("low table", low_table),
            armchair: site.mesh("armchair", armchair),
            sideboard: site.mesh("sideboard", sideboard),
            books: site.mesh("books", books),
            painting: site.mesh("painting", painting),
            pendant: site.mesh("pendant lamp", pendant),
            carpet: site.mesh("carpet", carpet),
        }
    }
}

/// Width from which a door has two leaves. [Units: wu]
const DOUBLE: f64 = 1.3;

/// Hangs open door leaves into `hole`, a hole across `axis` (0 or 2), swung by `degrees` towards the
/// positive side of `axis`: one hinged at its low end, in wide doors one at either end.
pub fn hang_door(site: &mut Site, p: &Palette, hole: &Aabb, axis: usize, degrees: f64) {
    let along = 2 - axis;
    let size = hole.size();
    let n = if size[along] > DOUBLE { 2 } else { 1 };
    let width = size[along] / f64::from(n);
    let mut leaf = MeshBuilder::new(p.wood);
    leaf.cuboid(aabb(
        [0.01, 0.005, -0.02],
        [width - 0.01, size.y - 0.01, 0.02],
    ));
    leaf.paint(p.metal);
    leaf.cuboid(aabb(
        [width - 0.12, 0.98, -0.07],
        [width - 0.08, 1.02, 0.07],
    ));
    let mesh = site.mesh("door leaf", leaf);
    for i in 0..n {
        let mut hinge = hole.center();
        hinge.y = hole.min.y;
        hinge[along] = if i == 0 {
            hole.min[along]
        } else {
            hole.max[along]
        };
        // The leaf points along +x. Across z it closes along +x and swings from there to +z;
        // across x it closes along +z (yaw -90) and swings to +x. The second leaf mirrors that.
        let yaw = match (axis, i) {
            (2, 0) => -degrees,
            (2, _) => 180.0 + degrees,
            (_, 0) => degrees - 90.0,
            _ => 90.0 - degrees,
        };
        site.furnish("door leaf", mesh, hinge, yaw);
    }
}

/// Sets a frame and a pane into `hole`, a hole across `axis` (0 or 2).
pub fn glaze(site: &mut Site, p: &Palette, hole: &Aabb, axis: usize) {
    let along = 2 - axis;
    let slice = |border: f64, depth: f64| {
        let mut b = *hole;
        let middle = hole.center()[axis];
        (b.min[axis], b.max[axis]) = (middle - depth, middle + depth);
        for a in [along, 1] {
            b.min[a] += border;
            b.max[a] -= border;
        }
        b
    };
    let mut frame = MeshBuilder::new(p.white);
    frame.carved(&[slice(0.0, 0.03)], &[slice(0.05, 0.03)]);
    site.detail("window frame", frame);
    let mut pane = MeshBuilder::new(p.glass);
    pane.cuboid(slice(0.05, 0.005));
    site.detail("window glass", pane);
}
