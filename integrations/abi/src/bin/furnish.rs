//! Furnishes a world for measurements: `furnish IN.glb OUT.glb TRIANGLES` puts an object of its own into every room, about
//! `TRIANGLES` in all, so that a building weighs what one with furniture weighs. No two objects share a mesh.

use std::process::ExitCode;

use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{CellId, DetailObject, World};
use enfilade_geom::scene::{Mesh, Primitive};

/// Half the size of an object. [Units: m]
const HALF: f32 = 0.3;

/// A ball of about `n` triangles, dented so that no two are equal.
fn ball(n: usize, seed: u32) -> Primitive {
    let rings = ((n / 4) as f32).sqrt().ceil().max(3.0) as u32;
    let (mut positions, mut normals, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    let mut state = seed.wrapping_mul(2_654_435_761).max(1);
    for y in 0..=rings {
        for x in 0..=2 * rings {
            let (down, around) = (
                std::f32::consts::PI * y as f32 / rings as f32,
                std::f32::consts::PI * x as f32 / rings as f32,
            );
            let n = [
                down.sin() * around.cos(),
                down.cos(),
                down.sin() * around.sin(),
            ];
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            let dent = 1.0 - 0.02 * (state >> 8) as f32 / (1_u32 << 24) as f32;
            positions.push(n.map(|v| HALF * dent * v));
            let length = n.map(|v| v * v).iter().sum::<f32>().sqrt();
            normals.push(n.map(|v| v / length));
        }
    }
    let at = |y: u32, x: u32| y * (2 * rings + 1) + x;
    for y in 0..rings {
        for x in 0..2 * rings {
            indices.extend([at(y, x), at(y, x + 1), at(y + 1, x)]);
            indices.extend([at(y + 1, x), at(y, x + 1), at(y + 1, x + 1)]);
        }
    }
    Primitive {
        positions,
        normals,
        indices,
        ..Primitive::default()
    }
}

/// A place for an object in a room: the first of a grid whose surroundings are all in the room.
fn place(world: &World, cell: CellId) -> Option<[f32; 3]> {
    let [low, high] = world.graph[cell].aabb;
    let steps = [0, 1, 2].map(|k| ((high[k] - low[k]) / HALF).ceil() as u32);
    for y in 1..steps[1] {
        for x in 1..steps[0] {
            for z in 1..steps[2] {
                let p = [x, y, z].map(|s| s as f32 * HALF);
                let p = [0, 1, 2].map(|k| low[k] + p[k]);
                let is_free = (0..27).all(|i: i32| {
                    let d = [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1];
                    let q = [0, 1, 2].map(|k| p[k] + HALF * d[k] as f32);
                    world.graph.locate(q) == Some(cell)
                });
                if is_free {
                    return Some(p);
                }
            }
        }
    }
    None
}

fn run() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [from, to, n] = &arguments[..] else {
        return Err("usage: furnish IN.glb OUT.glb TRIANGLES".into());
    };
    let n: usize = n.parse().map_err(|e| format!("{n}: {e}"))?;
    let bytes = std::fs::read(from).map_err(|e| format!("{from}: {e}"))?;
    let mut world = decode_glb(&bytes).map_err(|e| e.to_string())?;
    let rooms: Vec<CellId> = world.graph.rooms().map(|(id, _)| id).collect();
    let places: Vec<_> = (rooms.iter())
        .filter_map(|&cell| Some((cell, place(&world, cell)?)))
        .collect();
    for &(cell, [x, y, z]) in &places {
        let primitive = ball(n / places.len(), cell.0);
        world.graph.cells[cell.idx()].n_detail_triangles += (primitive.indices.len() / 3) as u32;
        world.details.push(DetailObject {
            name: format!("object of {cell}"),
            mesh: world.detail_meshes.len() as u32,
            transform: [
                1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0,
            ],
            cells: vec![cell],
            source: None,
            part_of: None,
        });
        world.detail_meshes.push(Mesh {
            name: format!("object of {cell}"),
            primitives: vec![primitive],
        });
    }
    let bytes = encode_glb(&world).map_err(|e| e.to_string())?;
    std::fs::write(to, bytes).map_err(|e| format!("{to}: {e}"))
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}
