//! Writes a generated scene as `scene.glb` (structure), `detail.glb` and `truth.json`, optionally disturbed; or
//! disturbs or shuffles an existing scene:
//!
//! `cargo run -p enfilade-testkit --example generate -- tower --rooms 64 --jitter 1e-4 -o DIR`

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use enfilade_geom::scene::{Role, Scene};
use enfilade_import::{ImportOptions, RoleRules, export_glb, import};
use enfilade_testkit::{
    Disturbance, Fault, Generated, TowerParams, Variant, cave, dirkse_maze, disturb, disturbed,
    furnished_house, gjorup_cavern, gjorup_rooms, mixed, office_tower, rotated, scaled, shuffled,
    shuffled_glb, shuffled_map, shuffled_obj,
};

const USAGE: &str = "\
usage: generate SCENE [OPTIONS] -o DIR
SCENE    house, tower, maze, cave, gjorup-optimised, gjorup-tessellated, gjorup-distorted,
         gjorup-cavern, or a small building: two-rooms, two-rooms-crack, zero-thickness-rooms,
         open-courtyard, room-within-room, l-corridor, stair-hall, rooms-with-closet,
         double-door-corridor, glass-facade-office, pitched-roof-attic;
         or one with a fault: {FAULTS};
         faults: all of these, each in a folder of its own below DIR;
         or a folder with a scene.glb, to be disturbed or shuffled;
         or a file (GLB, OBJ, Quake map), to be shuffled
OPTIONS  --rooms N     rooms of the tower (64)     --seed N      of tower, maze, cave, disturbance (1)
         --cracks, --double-walls, --leaves        of the tower
         --turn DEG    about +Y                    --scale F     about the origin
         --shuffle N   triangles in another order, by seed; of files also nodes, vertices
                       and all other lists, each file by itself
DISTURB  --jitter M    each vertex of each triangle moved, standard deviation M meters
         --drop SHARE  that share of the triangles is missing
         --snap M      vertices rounded to a grid of M meters per object
         --strip       names and materials gone; structure and detail are one file";

/// Returns the usage with the names of the faults.
fn usage() -> String {
    let indent = " ".repeat(9);
    let mut names = String::new();
    // Columns used in the current line, after the words before the names.
    let mut used = indent.len() + "or one with a fault: ".len();
    for name in Fault::ALL.map(Fault::name) {
        if !names.is_empty() {
            names.push(',');
            used += 2 + name.len();
            if used > 98 {
                names += &format!("\n{indent}");
                used = indent.len() + name.len();
            } else {
                names.push(' ');
            }
        } else {
            used += name.len();
        }
        names += name;
    }
    USAGE.replace("{FAULTS}", &names)
}

/// The parsed arguments.
#[derive(Default)]
struct Options {
    folder: PathBuf,
    tower: TowerParams,
    turn: f64,
    scale: f64,
    shuffle: Option<u64>,
    spoilt: Disturbance,
}

impl Options {
    fn parse(mut args: impl Iterator<Item = String>) -> Result<Self, Box<dyn Error>> {
        let (mut folder, mut rooms) = (None, 64);
        let mut o = Self {
            scale: 1.0,
            ..Self::default()
        };
        o.spoilt.seed = 1;
        while let Some(option) = args.next() {
            let mut value = || {
                args.next()
                    .ok_or(format!("{option} needs a value\n{}", usage()))
            };
            match option.as_str() {
                "-o" => folder = Some(PathBuf::from(value()?)),
                "--rooms" => rooms = value()?.parse()?,
                "--seed" => o.spoilt.seed = value()?.parse()?,
                "--turn" => o.turn = value()?.parse()?,
                "--scale" => o.scale = value()?.parse()?,
                "--shuffle" => o.shuffle = Some(value()?.parse()?),
                "--cracks" => o.tower.cracks = true,
                "--double-walls" => o.tower.double_walls = true,
                "--leaves" => o.tower.leaves = true,
                "--jitter" => o.spoilt.jitter = value()?.parse()?,
                "--drop" => o.spoilt.drop = value()?.parse()?,
                "--snap" => o.spoilt.snap = value()?.parse()?,
                "--strip" => o.spoilt.strip = true,
                _ => return Err(format!("unknown option {option}\n{}", usage()).into()),
            }
        }
        o.folder = folder.ok_or_else(usage)?;
        o.tower = TowerParams {
            cracks: o.tower.cracks,
            double_walls: o.tower.double_walls,
            leaves: o.tower.leaves,
            ..TowerParams::with_rooms(rooms, o.spoilt.seed)
        };
        Ok(o)
    }

    fn is_spoilt(&self) -> bool {
        let d = &self.spoilt;
        d.strip || [d.jitter, d.drop, d.snap].iter().any(|&x| x > 0.0)
    }

    /// Writes a scene with the requested changes.
    fn write(&self, mut generated: Generated, folder: &Path) -> Result<(), Box<dyn Error>> {
        if self.turn != 0.0 {
            generated = rotated(generated, self.turn);
        }
        if self.scale != 1.0 {
            generated = scaled(generated, self.scale);
        }
        if let Some(seed) = self.shuffle {
            generated = shuffled(generated, seed);
        }
        if self.is_spoilt() {
            generated = disturbed(&generated, &self.spoilt);
        }
        std::fs::create_dir_all(folder)?;
        let structure = generated.only(Role::Structural);
        std::fs::write(folder.join("scene.glb"), export_glb(&structure))?;
        write_or_remove(&folder.join("detail.glb"), &generated.only(Role::Detail))?;
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

    /// Writes a file in another order, under its name.
    fn shuffle(&self, from: &Path) -> Result<(), Box<dyn Error>> {
        let seed = self.shuffle.ok_or("a single file needs --shuffle")?;
        let bytes = std::fs::read(from)?;
        let text = || String::from_utf8_lossy(&bytes);
        let ending = from.extension().unwrap_or_default().to_string_lossy();
        let shuffled = match &*ending {
            "glb" => shuffled_glb(&bytes, seed),
            "obj" => shuffled_obj(&text(), seed).into(),
            "map" => shuffled_map(&text(), seed).into(),
            _ => return Err(format!("cannot shuffle a .{ending} file").into()),
        };
        std::fs::create_dir_all(&self.folder)?;
        let name = from.file_name().ok_or("the path has no file name")?;
        Ok(std::fs::write(self.folder.join(name), shuffled)?)
    }

    /// Disturbs or shuffles the files of a folder, each by itself, and copies the truth.
    fn change(&self, from: &Path) -> Result<(), Box<dyn Error>> {
        let spoils = self.is_spoilt() || self.shuffle.is_none();
        if spoils {
            self.spoil(from)?;
        }
        let from = if spoils { &self.folder } else { from };
        for name in ["scene.glb", "detail.glb"] {
            let file = from.join(name);
            if self.shuffle.is_some() && file.is_file() {
                self.shuffle(&file)?;
            }
        }
        let truth = from.join("truth.json");
        if !spoils && truth.is_file() {
            std::fs::copy(truth, self.folder.join("truth.json"))?;
        }
        Ok(())
    }

    /// Disturbs the files of a folder, each by itself, and copies the truth.
    fn spoil(&self, from: &Path) -> Result<(), Box<dyn Error>> {
        // Roles are decided when the result is imported; no object may be left out here.
        let options = ImportOptions {
            roles: RoleRules {
                is_manual: true,
                ..RoleRules::default()
            },
            ..ImportOptions::default()
        };
        let read = |name: &str| -> Result<Scene, Box<dyn Error>> {
            let path = from.join(name);
            Ok(if path.is_file() {
                import(&[path], &[], &options)?.scene
            } else {
                Scene::default()
            })
        };
        let (scene, detail) = (read("scene.glb")?, read("detail.glb")?);
        std::fs::create_dir_all(&self.folder)?;
        let spoilt = |scene: &Scene, first: u64| {
            let seed = self.spoilt.seed ^ (first << 32);
            disturb(
                scene,
                &Disturbance {
                    seed,
                    ..self.spoilt
                },
            )
        };
        let (mut scene, mut detail) = (spoilt(&scene, 0), spoilt(&detail, 1));
        if self.spoilt.strip {
            append(&mut scene, std::mem::take(&mut detail));
        }
        std::fs::write(self.folder.join("scene.glb"), export_glb(&scene))?;
        write_or_remove(&self.folder.join("detail.glb"), &detail)?;
        let truth = from.join("truth.json");
        if truth.is_file() {
            std::fs::copy(truth, self.folder.join("truth.json"))?;
        }
        Ok(())
    }
}

/// Adds a scene without materials to another.
fn append(scene: &mut Scene, other: Scene) {
    let n_meshes = scene.meshes.len() as u32;
    scene.meshes.extend(other.meshes);
    for mut object in other.objects {
        object.mesh += n_meshes;
        object.name = format!("object-{}", scene.objects.len() + 1);
        scene.objects.push(object);
    }
}

/// Writes a scene, or removes the file of an earlier scene if there is nothing to write.
fn write_or_remove(path: &Path, scene: &Scene) -> Result<(), Box<dyn Error>> {
    if !scene.objects.is_empty() {
        std::fs::write(path, export_glb(scene))?;
    } else if path.exists() {
        std::fs::remove_file(path)?;
    }
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let name = args.next().ok_or_else(usage)?;
    let options = Options::parse(args)?;
    let seed = options.spoilt.seed;
    let generated = match name.as_str() {
        "house" => furnished_house(),
        "tower" => office_tower(&options.tower),
        "maze" => dirkse_maze(seed),
        "cave" => cave(seed),
        "gjorup-optimised" => gjorup_rooms(Variant::Optimised, [0.0; 3]),
        "gjorup-tessellated" => gjorup_rooms(Variant::Tessellated, [0.0; 3]),
        "gjorup-distorted" => gjorup_rooms(Variant::Distorted, [0.0; 3]),
        "gjorup-cavern" => gjorup_cavern([0.0; 3]),
        "faults" => {
            for fault in Fault::ALL {
                options.write(fault.build(), &options.folder.join(fault.name()))?;
            }
            return Ok(());
        }
        name if Path::new(name).join("scene.glb").is_file() => {
            return options.change(Path::new(name));
        }
        name if Path::new(name).is_file() => return options.shuffle(Path::new(name)),
        name => {
            let fault = Fault::ALL.into_iter().find(|f| f.name() == name);
            let small = || mixed::all().into_iter().find(|g| g.truth.scene == name);
            fault
                .map(Fault::build)
                .or_else(small)
                .ok_or(format!("no scene {name}\n{}", usage()))?
        }
    };
    let folder = options.folder.clone();
    options.write(generated, &folder)
}
