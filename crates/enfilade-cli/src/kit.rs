//! `enfilade kit`: checks a folder of pieces, and shows them.

mod folder;
mod level;

use std::io::Write;
use std::path::PathBuf;

use anyhow::bail;
use enfilade::geom::{DVec3, shown};
use enfilade::kit::{Kit, Piece};
use enfilade_report::{PaletteEntry, palette_html};
use serde::Serialize;

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, Written, write_whole};
use crate::screen::{Warned, print_json, write_lines};

pub(crate) use folder::{KitFolder, bake_piece, read_kit};
pub(crate) use level::{build_level, read_level, write_level};

/// Checks a kit, a folder of pieces to put levels together from: which attachments fit which, and which fit none.
///
/// A piece is a world, or a scene that is baked each time. Its attachments are its doorways and doors to the outdoors, or those that
/// `kit.toml` in the folder names. Exit code 1 if a piece cannot be attached.
#[derive(clap::Args)]
pub(crate) struct KitCheck {
    /// Folder of worlds (.glb) and scenes, each a piece named as its file.
    #[arg(value_name = "DIR")]
    kit: PathBuf,
    /// Write a palette: a page with the plan of each piece, .html. `-` for standard output.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The output of `--json`.
#[derive(Serialize)]
struct KitReport {
    tolerance: f64,
    pieces: Vec<PieceReport>,
    /// Attachments that fit each other, as `PIECE.ATTACHMENT`.
    groups: Vec<Vec<String>>,
    faults: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    palette: Option<Written>,
}

#[derive(Serialize)]
struct PieceReport {
    name: String,
    rooms: usize,
    triangles: usize,
    /// Outer measures. [Units: wu]
    size: [f64; 3],
    attachments: Vec<AttachmentReport>,
}

#[derive(Serialize)]
struct AttachmentReport {
    name: String,
    portal: u32,
    kind: &'static str,
    /// Width and height. [Units: wu]
    size: [f64; 2],
    /// Middle of the sill, and the way out.
    sill: [f64; 3],
    out: [f64; 3],
    /// Index into the groups.
    group: usize,
}

pub(crate) fn run(args: &KitCheck) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::default();
    if let Some(path) = &args.output {
        outputs.write("-o", Format::Page, path)?;
    }
    let folder = read_kit(&args.kit)?;
    let KitFolder { kit, tolerance, .. } = &folder;
    let groups = kit.groups(*tolerance);
    let faults = kit.faults(*tolerance);
    let faults: Vec<String> = faults.iter().map(ToString::to_string).collect();
    let mut report = KitReport {
        tolerance: *tolerance,
        pieces: kit
            .pieces()
            .iter()
            .enumerate()
            .map(|(i, p)| piece_report(p, i, &groups))
            .collect(),
        groups: groups
            .iter()
            .map(|g| g.iter().map(|end| end_name(kit, *end)).collect())
            .collect(),
        faults,
        palette: None,
    };
    if let Some(path) = &args.output {
        let entries = kit.pieces().iter().zip(&report.pieces);
        let entries: Vec<PaletteEntry<'_>> = entries
            .map(|(piece, told)| PaletteEntry {
                name: piece.name(),
                world: piece.world(),
                facts: told.facts(),
            })
            .collect();
        let page = palette_html(&folder.name, &entries, &report.faults);
        write_whole(path, page.as_bytes())?;
        report.palette = Some(Written::new(path, page.as_bytes()));
    }
    let mut out = outputs.printed();
    if args.json {
        print_json(&mut out, &report)?;
    } else {
        report.print(&mut out)?;
    }
    for fault in &report.faults {
        write_lines(&mut Warned, fault)?;
    }
    match report.faults.len() {
        0 => Ok(()),
        1 => bail!("{} has a fault", shown(&folder.name)),
        n => bail!("{} has {n} faults", shown(&folder.name)),
    }
}

fn end_name(kit: &Kit, [piece, attachment]: [usize; 2]) -> String {
    let piece = &kit.pieces()[piece];
    format!("{}.{}", piece.name(), piece.attachments()[attachment].name)
}

fn piece_report(piece: &Piece, number: usize, groups: &[Vec<[usize; 2]>]) -> PieceReport {
    let world = piece.world();
    let attachments = piece
        .attachments()
        .iter()
        .enumerate()
        .map(|(k, a)| AttachmentReport {
            name: a.name.clone(),
            portal: a.portal.0,
            kind: if a.kind == enfilade::PortalKind::Door {
                "door"
            } else {
                "opening"
            },
            size: a.mouth.size(),
            sill: a.mouth.frame.at.to_array(),
            out: a.mouth.frame.direction(DVec3::Z).to_array(),
            group: groups
                .iter()
                .position(|g| g.contains(&[number, k]))
                .unwrap_or_default(),
        });
    PieceReport {
        name: piece.name().to_owned(),
        rooms: world.graph.rooms().count(),
        triangles: world
            .batches
            .iter()
            .map(|b| b.primitive.indices.len() / 3)
            .sum(),
        size: piece.bounds().size().max(DVec3::ZERO).to_array(),
        attachments: attachments.collect(),
    }
}

impl PieceReport {
    fn facts(&self) -> Vec<String> {
        let [x, y, z] = self.size;
        let rooms = if self.rooms == 1 { "room" } else { "rooms" };
        let mut facts = vec![
            format!("{x:.2} × {z:.2} m, {y:.2} m high"),
            format!("{} {rooms}, {} triangles", self.rooms, self.triangles),
        ];
        facts.extend(self.attachments.iter().map(AttachmentReport::told));
        facts
    }
}

impl AttachmentReport {
    fn told(&self) -> String {
        // Without the sign of zero.
        let ([w, h], [x, y, z]) = (
            self.size,
            self.sill.map(|x| (x * 100.0).round() / 100.0 + 0.0),
        );
        let kind = self.kind;
        format!(
            "{}: {kind} of {w:.2} × {h:.2} m at {x:.2},{y:.2},{z:.2}",
            self.name
        )
    }
}

impl KitReport {
    fn print(&self, mut out: impl Write) -> anyhow::Result<()> {
        for piece in &self.pieces {
            write_lines(&mut out, &piece.name)?;
            for fact in piece.facts() {
                write_lines(&mut out, &format!("  {fact}"))?;
            }
        }
        for (i, group) in self.groups.iter().enumerate() {
            let n = i + 1;
            write_lines(
                &mut out,
                &format!("group {n}, fit each other: {}", group.join(" ")),
            )?;
        }
        if let Some(palette) = &self.palette {
            writeln!(out, "{palette}")?;
        }
        Ok(())
    }
}
