//! Colors and furniture for a generated world.

use std::collections::BTreeMap;

use enfilade_cpg::{Batch, CellId, DetailObject, World};
use enfilade_geom::DVec3;
use enfilade_geom::scene::{Image, Material, Mesh, Primitive, Texture};

use super::turned::Turned;
use super::world::box_indices;
use enfilade_demo::Rng;
use enfilade_demo::oak_planks;

/// A place for furniture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) cell: u32,
    pub(super) at: DVec3,
    /// Radius of the free circle. [Units: wu]
    pub(super) radius: f64,
    /// Direction of backs to the wall: 0 for a wall at the lower end of z. [Units: degrees]
    pub(super) yaw: f64,
}

/// Colors of walls, matte.
const WALLS: [[f32; 3]; 6] = [
    [0.72, 0.66, 0.52],
    [0.55, 0.62, 0.58],
    [0.70, 0.52, 0.45],
    [0.50, 0.58, 0.68],
    [0.74, 0.70, 0.64],
    [0.62, 0.56, 0.62],
];
/// Colors of furniture: woods, fabrics, accents, one of each for each set of meshes.
const SETS: [[[f32; 3]; 3]; 4] = [
    [[0.30, 0.15, 0.06], [0.45, 0.08, 0.07], [0.80, 0.72, 0.50]],
    [[0.45, 0.27, 0.12], [0.08, 0.22, 0.40], [0.85, 0.85, 0.80]],
    [[0.18, 0.10, 0.06], [0.10, 0.32, 0.14], [0.70, 0.35, 0.10]],
    [[0.55, 0.42, 0.26], [0.42, 0.38, 0.30], [0.25, 0.45, 0.50]],
];

fn paint(world: &mut World, name: &str, [r, g, b]: [f32; 3]) -> u32 {
    world.materials.push(Material {
        name: name.into(),
        gltf: format!(
            "{{\"name\":\"{name}\",\"pbrMetallicRoughness\":{{\"baseColorFactor\":[{r},{g},{b},1],\
             \"metallicFactor\":0,\"roughnessFactor\":0.9}}}}"
        ),
        base_color: [r, g, b, 1.0],
        ..Material::default()
    });
    world.materials.len() as u32 - 1
}

fn planks(world: &mut World) -> u32 {
    world.images.push(Image {
        name: "planks".into(),
        mime: "image/png".into(),
        bytes: oak_planks(),
    });
    world.textures.push(Texture {
        image: Some(world.images.len() as u32 - 1),
        sampler: "{\"magFilter\":9729,\"minFilter\":9987,\"wrapS\":10497,\"wrapT\":10497}".into(),
    });
    let texture = world.textures.len() - 1;
    world.materials.push(Material {
        name: "planks".into(),
        gltf: format!(
            "{{\"name\":\"planks\",\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{texture}}},\
             \"metallicFactor\":0,\"roughnessFactor\":0.8}}}}"
        ),
        base_color: [1.0; 4],
        ..Material::default()
    });
    world.materials.len() as u32 - 1
}

/// Gives floors a texture of planks, and walls and the roof colors. Walls lie upright.
pub(super) fn dress(world: &mut World) {
    let planks = planks(world);
    let plaster = paint(world, "plaster", [0.82, 0.80, 0.76]);
    let walls: Vec<u32> = (WALLS.iter().enumerate())
        .map(|(i, color)| paint(world, &format!("wall-{i}"), *color))
        .collect();
    let top = world.graph.cells.iter().filter(|c| !c.outdoor);
    let top = top.map(|c| c.aabb[1][1]).fold(0.0, f32::max);
    let mut batches = Vec::new();
    for (i, batch) in std::mem::take(&mut world.batches).into_iter().enumerate() {
        let mut parts: BTreeMap<u32, Primitive> = BTreeMap::new();
        let from = &batch.primitive;
        for triple in from.triples() {
            let points = triple.map(|k| from.positions[k as usize]);
            let is_flat = points.iter().all(|p| p[1] == points[0][1]);
            let material = match is_flat {
                true if points[0][1] < top - 0.1 => planks,
                true => plaster,
                false => walls[i * 5 % walls.len()],
            };
            let part = parts.entry(material).or_insert_with(|| Primitive {
                material: Some(material),
                uvs: if material == planks {
                    vec![Vec::new()]
                } else {
                    Vec::new()
                },
                ..Primitive::default()
            });
            let first = part.positions.len() as u32;
            part.positions.extend(points);
            part.indices.extend([first, first + 1, first + 2]);
            if let Some(uv) = part.uvs.first_mut() {
                uv.extend(points.map(|p| [p[0], p[2]]));
            }
        }
        batches.extend(parts.into_values().map(|primitive| Batch {
            cells: batch.cells.clone(),
            primitive,
            ..Batch::default()
        }));
    }
    world.batches = batches;
}

/// An object to be placed: its kind and set of colors, the cell, the place, the yaw in degrees.
type Placing = (Turned, usize, u32, DVec3, f64);

/// Places furniture at the spots, and floors (boxes with their cells), so that the world has `n_triangles`.
pub(super) fn furnish(
    world: &mut World,
    spots: &[Spot],
    floors: &[(u32, [DVec3; 2])],
    n_triangles: u64,
    seed: u64,
) {
    let placings = placings(spots, seed);
    let structure: usize = (world.batches.iter())
        .map(|b| b.primitive.indices.len() / 3)
        .sum();
    let n_floors = 12 * floors.len() as u64;
    let budget = n_triangles.saturating_sub(structure as u64 + n_floors);
    let mut counts: BTreeMap<(Turned, usize), u64> = BTreeMap::new();
    for (kind, set, ..) in &placings {
        *counts.entry((*kind, *set)).or_default() += 1;
    }
    let colors = SETS.map(|set| set.map(|color| paint(world, "furniture", color)));
    let meshes: BTreeMap<(Turned, usize), (u32, u32)> = (fineness(&counts, budget).into_iter())
        .map(|((kind, set), fineness)| {
            let mesh = world.detail_meshes.len() as u32;
            world.detail_meshes.push(kind.mesh(colors[set], fineness));
            ((kind, set), (mesh, kind.n_triangles(fineness) as u32))
        })
        .collect();
    for (kind, set, cell, at, yaw) in placings {
        let (mesh, n) = meshes[&(kind, set)];
        let (sin, cos) = yaw.to_radians().sin_cos();
        place(world, kind.name(), mesh, n, cell, at, [cos, sin]);
    }
    for (cell, [low, high]) in floors {
        let mesh = world.detail_meshes.len() as u32;
        let size = (*high - *low).as_vec3().to_array();
        world.detail_meshes.push(Mesh {
            name: "floor".into(),
            primitives: vec![Primitive {
                positions: (0..8)
                    .map(|c| [0, 1, 2].map(|k| (c >> k & 1) as f32 * size[k]))
                    .collect(),
                indices: box_indices(),
                material: Some(colors[1][0]),
                ..Primitive::default()
            }],
        });
        place(world, "floor", mesh, 12, *cell, *low, [1.0, 0.0]);
    }
}

fn place(
    world: &mut World,
    name: &str,
    mesh: u32,
    n_triangles: u32,
    cell: u32,
    at: DVec3,
    [cos, sin]: [f64; 2],
) {
    let [c, s] = [cos as f32, sin as f32];
    let [x, y, z] = at.as_vec3().to_array();
    world.details.push(DetailObject {
        name: name.into(),
        mesh,
        transform: [
            c, 0.0, -s, 0.0, 0.0, 1.0, 0.0, 0.0, s, 0.0, c, 0.0, x, y, z, 1.0,
        ],
        cells: vec![CellId(cell)],
        source: None,
        part_of: None,
    });
    world.graph.cells[cell as usize].n_detail_triangles += n_triangles;
}

/// Chooses furniture: a set of colors a room, and at each spot one of the kinds that its room has more of.
fn placings(spots: &[Spot], seed: u64) -> Vec<Placing> {
    let mut rng = Rng::stream(seed, 2);
    let mut out = Vec::new();
    for spot in spots {
        let mut of_room = Rng::stream(seed, 100 + u64::from(spot.cell));
        let set = of_room.below(SETS.len());
        let favorite = Turned::ALL[of_room.below(Turned::ALL.len())];
        if rng.chance(0.08) {
            continue;
        }
        let kind = if rng.chance(0.4) {
            favorite
        } else {
            Turned::ALL[rng.below(Turned::ALL.len())]
        };
        if kind != Turned::Table {
            let is_round = matches!(kind, Turned::Lamp | Turned::Vase | Turned::Plant);
            let slack = if is_round { spot.radius - 0.4 } else { 0.0 };
            let aside = DVec3::new(rng.range(-slack, slack), 0.0, rng.range(-slack, slack));
            out.push((kind, set, spot.cell, spot.at + aside * 0.7, spot.yaw));
            continue;
        }
        // Chairs around it, turned to its middle.
        out.push((kind, set, spot.cell, spot.at, 0.0));
        for i in 0..3 {
            let yaw = 120.0 * f64::from(i) + rng.range(-20.0, 20.0);
            let (sin, cos) = yaw.to_radians().sin_cos();
            let away = DVec3::new(-sin, 0.0, -cos) * (spot.radius - 0.28);
            out.push((Turned::Chair, set, spot.cell, spot.at + away, yaw));
        }
    }
    out
}

/// Returns the fineness of each mesh, given how often it is placed: as fine as `budget` triangles allow, all about alike.
fn fineness(
    counts: &BTreeMap<(Turned, usize), u64>,
    budget: u64,
) -> BTreeMap<(Turned, usize), f64> {
    const STEP: f64 = 0.05;
    let total = |x: f64| -> u64 {
        (counts.iter())
            .map(|((kind, _), n)| n * kind.n_triangles(x))
            .sum()
    };
    let (mut low, mut high) = (1.0, 400.0);
    while high - low > STEP {
        let middle = (low + high) * 0.5;
        *(if total(middle) <= budget {
            &mut low
        } else {
            &mut high
        }) = middle;
    }
    let mut left = budget.saturating_sub(total(low));
    let refined = |(&(kind, set), n): (&(Turned, usize), &u64)| {
        let mut own = low;
        // At most a fifth finer than the others.
        for i in 1..=((low * 0.2 / STEP) as u32) {
            let finer = low + f64::from(i) * STEP;
            let more = n * (kind.n_triangles(finer) - kind.n_triangles(own));
            if more <= left {
                left -= more;
                own = finer;
            }
        }
        ((kind, set), own)
    };
    counts.iter().map(refined).collect()
}
