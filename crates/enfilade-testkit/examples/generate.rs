//! Writes a generated scene as `scene.glb` (structure), `detail.glb` and `truth.json`:
//!
//! `cargo run -p enfilade-testkit --example generate -- tower --rooms 64 -o DIR`

use std::error::Error;
use std::path::PathBuf;

use enfilade_geom::scene::Role;
use enfilade_import::export_glb;
use enfilade_testkit::{
    Generated, TowerParams, Variant, cave, dirkse_maze, furnished_house, gjorup_cavern,
    gjorup_rooms, mixed, office_tower, rotated, scaled, shuffled,
};

const USAGE: &str = "\
usage: generate SCENE [OPTIONS] -o DIR
SCENE    house, tower, maze, cave, gjorup-optimised, gjorup-tessellated, gjorup-distorted,
         gjorup-cavern, or a small building: two-rooms, two-rooms-crack, zero-thickness-rooms,
         open-courtyard, room-within-room, l-corridor, stair-hall, rooms-with-closet,
         double-door-corridor, glass-facade-office, pitched-roof-attic
OPTIONS  --rooms N     rooms of the tower (64)     --seed N      of tower, maze, cave (1)
         --cracks, --double-walls, --leaves        of the tower
         --turn DEG    about +Y                    --scale F     about the origin
         --shuffle N   triangles in another order, by seed";

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let scene = args.next().ok_or(USAGE)?;
    let mut folder = None;
    let (mut rooms, mut seed, mut turn, mut scale, mut shuffle) = (64, 1, 0.0, 1.0, None);
    let (mut cracks, mut double_walls, mut leaves) = (false, false, false);
    while let Some(option) = args.next() {
        let mut value = || {
            args.next()
                .ok_or(format!("{option} needs a value\n{USAGE}"))
        };
        match option.as_str() {
            "-o" => folder = Some(PathBuf::from(value()?)),
            "--rooms" => rooms = value()?.parse()?,
            "--seed" => seed = value()?.parse()?,
            "--turn" => turn = value()?.parse()?,
            "--scale" => scale = value()?.parse()?,
            "--shuffle" => shuffle = Some(value()?.parse()?),
            "--cracks" => cracks = true,
            "--double-walls" => double_walls = true,
            "--leaves" => leaves = true,
            _ => return Err(format!("unknown option {option}\n{USAGE}").into()),
        }
    }
    let folder = folder.ok_or(USAGE)?;
    let tower = || TowerParams {
        cracks,
        double_walls,
        leaves,
        ..TowerParams::with_rooms(rooms, seed)
    };
    let mut generated: Generated = match scene.as_str() {
        "house" => furnished_house(),
        "tower" => office_tower(&tower()),
        "maze" => dirkse_maze(seed),
        "cave" => cave(seed),
        "gjorup-optimised" => gjorup_rooms(Variant::Optimised, [0.0; 3]),
        "gjorup-tessellated" => gjorup_rooms(Variant::Tessellated, [0.0; 3]),
        "gjorup-distorted" => gjorup_rooms(Variant::Distorted, [0.0; 3]),
        "gjorup-cavern" => gjorup_cavern([0.0; 3]),
        name => {
            let found = mixed::all().into_iter().find(|g| g.truth.scene == name);
            found.ok_or(format!("no scene {name}\n{USAGE}"))?
        }
    };
    if turn != 0.0 {
        generated = rotated(generated, turn);
    }
    if scale != 1.0 {
        generated = scaled(generated, scale);
    }
    if let Some(seed) = shuffle {
        generated = shuffled(generated, seed);
    }
    std::fs::create_dir_all(&folder)?;
    std::fs::write(
        folder.join("scene.glb"),
        export_glb(&generated.only(Role::Structural)),
    )?;
    let detail = generated.only(Role::Detail);
    if !detail.objects.is_empty() {
        std::fs::write(folder.join("detail.glb"), export_glb(&detail))?;
    }
    std::fs::write(folder.join("truth.json"), generated.truth_json())?;
    eprintln!(
        "{} rooms, {} openings, {} structural and {} detail triangles in {}",
        generated.truth.rooms.len(),
        generated.truth.openings.len(),
        generated.n_triangles(Role::Structural),
        generated.n_triangles(Role::Detail),
        folder.display()
    );
    Ok(())
}
