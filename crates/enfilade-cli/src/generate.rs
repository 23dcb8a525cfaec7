//! `enfilade generate`: makes a level by chance, from pieces made in code.

use std::path::PathBuf;

use anyhow::{Context, bail};
use enfilade::cpg::wire::encode_glb;
use enfilade::import::{ImportOptions, decode_gltf, export_glb};
use enfilade::kit::{Assembly, Choice, Kit, Piece, generate};
use enfilade_demo::{PieceScene, dungeon_kit, maze_kit, office_kit};

use crate::formats::Format;
use crate::kit::{bake_piece, write_level};
use crate::limits::Limits;
use crate::output::{Outputs, make_folder, write_unnamed};

/// Most rooms of a generated level.
const MOST_ROOMS: u64 = 100_000;

/// Generates a level: bakes a few pieces made in code, and puts instances of them together by chance.
///
/// An example of `enfilade::kit`; equal seeds give equal levels.
#[derive(clap::Args)]
pub(crate) struct Generate {
    /// Kind of the level.
    #[arg(value_enum)]
    kind: LevelKind,
    /// Seed of all choices.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Rooms to reach; fewer if no more fit. A maze has the next square number of tiles.
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u64).range(1..=MOST_ROOMS))]
    rooms: u64,
    /// World to write, one GLB; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Also write the baked pieces to this folder, as a kit for levels of your own.
    #[arg(long, value_name = "DIR")]
    pieces: Option<PathBuf>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum LevelKind {
    /// Halls and chambers at the ends of corridors and stairs.
    Dungeon,
    /// Wings of corridors with rooms on both sides, between lobbies.
    Office,
    /// Square tiles with ways between all of them.
    Maze,
}

impl LevelKind {
    fn pieces(self) -> Vec<PieceScene> {
        match self {
            Self::Dungeon => dungeon_kit(),
            Self::Office => office_kit(),
            Self::Maze => maze_kit(),
        }
    }
}

pub(crate) fn run(args: &Generate) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::default();
    outputs.write("-o", Format::World, &args.output)?;
    let mut pieces = Vec::new();
    let mut files = Vec::new();
    for scene in args.kind.pieces() {
        // As `bake` does: read from its file.
        let model = export_glb(&scene.scene);
        let read = decode_gltf(&model, &ImportOptions::default())?.scene;
        let world = bake_piece(&read)?;
        if let Some(folder) = &args.pieces {
            let bytes =
                encode_glb(&world).context("the baked piece breaks an invariant (a bug)")?;
            files.push((folder.join(format!("{}.glb", scene.name)), bytes));
        }
        pieces.push(Piece::new(scene.name, world, &Choice::Doorways)?);
    }
    if let Some(folder) = &args.pieces {
        make_folder("--pieces", folder)?;
        for (path, _) in &files {
            outputs.write("--pieces", Format::World, path)?;
        }
        write_unnamed("--pieces", &files, |_, _| false)?;
    }
    let mut level = Assembly::new(Kit::new(pieces)?);
    let n = args.rooms as usize;
    let made = match args.kind {
        LevelKind::Dungeon => generate::dungeon(&mut level, n, args.seed)?,
        LevelKind::Office => generate::office(&mut level, n, args.seed)?,
        LevelKind::Maze => {
            let side = n.isqrt() + usize::from(n.isqrt().pow(2) < n);
            generate::maze(&mut level, side, args.seed)?
        }
    };
    if made == 0 {
        bail!("nothing fits; try another --seed");
    }
    write_level(&level, &args.output, &outputs, args.json)
}
