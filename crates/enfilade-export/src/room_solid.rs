//! Rooms as closed meshes for acoustics: OBJ and STL, and the walls that pyroomacoustics takes.
//!
//! First-level surfaces, each with the absorption of what it is made of; openings are surfaces of their own. A wall with a hole is
//! given to pyroomacoustics as triangles, which it takes as convex walls. Its Z is up: (x, y, z) is written as (x, -z, y).

use std::collections::HashMap;
use std::fmt::Write;

use enfilade_cpg::{CellId, PortalKind, World};
use enfilade_geom::DVec3;
use serde_json::{Value, json};

use crate::names::{Names, source_name};
use crate::surfaces::{BoundarySurface, SurfaceCover, SurfaceLevel, SurfaceOptions, room_surfaces};
use crate::triangles::triangulated;

/// Number of octave bands of absorption: 125 Hz to 4 kHz.
const N_BANDS: usize = 6;
/// Centers of the bands. [Units: Hz]
const CENTERS: [u32; N_BANDS] = [125, 250, 500, 1000, 2000, 4000];
/// Farthest vertex of a wall from its plane up to which it is one wall and not triangles. [Units: wu]
const FLAT: f64 = 1e-6;

/// A surface of a [`RoomSolid`].
#[derive(Clone, Debug)]
struct Side {
    /// Name of its material, or of its object without one.
    material: String,
    absorption: [f64; N_BANDS],
    surface: BoundarySurface,
    triangles: Vec<[u32; 3]>,
}

/// A room as a closed mesh.
#[derive(Clone, Debug)]
pub struct RoomSolid {
    /// The room.
    pub cell: CellId,
    /// An identifier, unique in the world, fit for names of files.
    pub name: String,
    /// Its volume. [Units: wu³]
    pub volume: f64,
    /// Vertices. [Units: wu]
    pub points: Vec<[f64; 3]>,
    sides: Vec<Side>,
}

/// Returns all rooms as closed meshes, by cell. The world must be valid.
///
/// `absorption` returns the coefficients of a material's name, 125 Hz to 4 kHz. An opening without anything in it absorbs all.
#[must_use]
pub fn room_solids(world: &World, absorption: &dyn Fn(&str) -> [f64; N_BANDS]) -> Vec<RoomSolid> {
    let options = SurfaceOptions {
        level: SurfaceLevel::First,
        ..SurfaceOptions::default()
    };
    let names = Names::new(world);
    let mut solids = Vec::new();
    for room in room_surfaces(world, &options) {
        if !world.graph[room.cell].is_room() {
            continue;
        }
        let mut points = Vec::new();
        let mut numbers: HashMap<[u64; 3], u32> = HashMap::new();
        let sides = room.surfaces.into_iter().map(|surface| {
            let material = material_of(world, surface.cover);
            let all = surface.loops.iter().flatten();
            let own: Vec<u32> = all
                .map(|&p| {
                    *numbers.entry(p.map(f64::to_bits)).or_insert_with(|| {
                        points.push(p);
                        points.len() as u32 - 1
                    })
                })
                .collect();
            let triangles = triangulated(&surface.loops, surface.normal);
            Side {
                absorption: if material == OPEN {
                    [1.0; N_BANDS]
                } else {
                    absorption(&material)
                },
                material,
                triangles: triangles.iter().map(|t| t.map(|i| own[i])).collect(),
                surface,
            }
        });
        let sides = sides.collect();
        solids.push(RoomSolid {
            cell: room.cell,
            name: names.of(room.cell).to_owned(),
            volume: room.volume,
            points,
            sides,
        });
    }
    solids
}

/// Name of the material of openings without anything in them.
const OPEN: &str = "open";

fn material_of(world: &World, cover: SurfaceCover) -> String {
    match cover {
        SurfaceCover::Opening(id) => match world.graph[id].kind {
            PortalKind::Door => "door".into(),
            PortalKind::Window => "window".into(),
            PortalKind::Open | PortalKind::Crack => OPEN.into(),
        },
        SurfaceCover::Object { source, material } => {
            let material = material.and_then(|m| world.materials.get(m as usize));
            let material = material.map(|m| m.name.as_str()).filter(|n| !n.is_empty());
            let name = material.or_else(|| source_name(world, source));
            name.unwrap_or("wall").to_owned()
        }
        SurfaceCover::Bare => "wall".into(),
    }
}

impl RoomSolid {
    /// Returns the triangles of all surfaces, counter-clockwise seen from outside.
    pub fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.sides.iter().flat_map(|s| s.triangles.iter().copied())
    }

    /// Returns the mesh as OBJ, a group for each surface and a material for each name. +Y is up.
    #[must_use]
    pub fn obj(&self) -> String {
        let mut out = format!(
            "# {}: meters, +Y up, normals out of the room\no {0}\n",
            self.name
        );
        for [x, y, z] in &self.points {
            let _ = writeln!(out, "v {x} {y} {z}");
        }
        for (i, side) in self.sides.iter().enumerate() {
            let material = side
                .material
                .replace(|c: char| c.is_whitespace() || c.is_control(), "_");
            let kind = if side.surface.opening().is_some() {
                "opening"
            } else {
                "surface"
            };
            let _ = writeln!(out, "g {kind}-{i}\nusemtl {material}");
            for t in &side.triangles {
                // Numbers begin with 1.
                let [a, b, c] = t.map(|v| v + 1);
                let _ = writeln!(out, "f {a} {b} {c}");
            }
        }
        out
    }

    /// Returns the mesh as binary STL. +Y is up.
    #[must_use]
    pub fn stl(&self) -> Vec<u8> {
        let mut out = vec![b' '; 80];
        let head = b"enfilade: meters, +Y up";
        out[..head.len()].copy_from_slice(head);
        out.extend((self.triangles().count() as u32).to_le_bytes());
        for t in self.triangles() {
            let [a, b, c] = t.map(|v| DVec3::from(self.points[v as usize]));
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for p in [normal, a, b, c] {
                for x in p.to_array() {
                    out.extend((x as f32).to_le_bytes());
                }
            }
            out.extend([0, 0]);
        }
        out
    }

    /// Returns the walls for pyroomacoustics as JSON: for each, `corners` (rows x, y, z, as `wall_factory` takes them) and
    /// `absorption` (`coeffs` and `center_freqs`, as `Material` takes them).
    #[must_use]
    pub fn acoustics_json(&self) -> String {
        let mut walls = Vec::new();
        for (i, side) in self.sides.iter().enumerate() {
            let polygons = self.convex_or_triangles(side);
            let n = polygons.len();
            for (k, corners) in polygons.iter().enumerate() {
                let row = |axis: usize| -> Vec<f64> { corners.iter().map(|p| p[axis]).collect() };
                let part = if n > 1 {
                    format!(".{k}")
                } else {
                    String::new()
                };
                walls.push(json!({
                    "name": format!("{i}{part} {}", side.material),
                    "corners": [row(0), row(1), row(2)],
                    "absorption": { "coeffs": side.absorption, "center_freqs": CENTERS },
                    "scattering": 0.1,
                    "is_opening": side.surface.opening().is_some(),
                    "area": side.surface.area / n as f64,
                }));
            }
        }
        let value: Value = json!({
            "name": self.name,
            "units": "m",
            "up": "z",
            "volume": self.volume,
            "walls": walls,
        });
        value.to_string() + "\n"
    }

    /// Returns the polygon of a side without holes in its plane, or else its triangles; with Z up.
    fn convex_or_triangles(&self, side: &Side) -> Vec<Vec<[f64; 3]>> {
        let turned = |[x, y, z]: [f64; 3]| [x, 0.0 - z, y];
        let surface = &side.surface;
        let normal = DVec3::from(surface.normal);
        let outer: Vec<DVec3> = surface.loops[0].iter().map(|&p| DVec3::from(p)).collect();
        let n = outer.len();
        let is_flat = (outer.iter()).all(|&p| (p - outer[0]).dot(normal).abs() <= FLAT);
        let is_convex = (0..n).all(|i| {
            let [a, b, c] = [outer[i], outer[(i + 1) % n], outer[(i + 2) % n]];
            (b - a).cross(c - b).dot(normal) >= 0.0
        });
        if surface.loops.len() == 1 && is_flat && is_convex {
            return vec![outer.iter().map(|p| turned(p.to_array())).collect()];
        }
        let corner = |v: u32| turned(self.points[v as usize]);
        let triangles = side.triangles.iter();
        triangles.map(|t| t.map(corner).to_vec()).collect()
    }
}
