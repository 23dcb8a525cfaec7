//! A town larger than memory: 10,000 rooms and 2 GB, packed on disk, walked through within a budget.
//!
//! Two processes of this program do it, so that the memory of one is that of a program that walks: the first generates and packs
//! the town, the second opens it, looks around at many places, and walks, with pieces read from disk when a simulated link would
//! have brought them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, ensure};
use enfilade::cpg::wire::{encode_glb, read_piece};
use enfilade::stream::{
    Changes, Fetch, FetchError, FileFetch, PackedFiles, PackedHead, PackedWorld, PieceId, Reply,
    SimulatedLink, SimulatedLinkOptions, Source, StreamFrame, StreamOptions, Streamer, WorldPieces,
};
use serde_json::{Value, json};

use super::first::furnished;
use super::replay::frame_of;
use super::settled::draw_stands;
use super::site::{FRAME, Recorder, Streamed, offices, route, visible_sets};
use crate::kept::Kept;
use crate::measure::memory;
use crate::process::{step, target_dir};
use crate::rows::Figure;

/// Triangles of the furnished town: 2 GB.
const TRIANGLES: u64 = 110_000_000;
/// Most memory of pieces. [Units: bytes]
const MOST_RESIDENT: u64 = 256 << 20;
/// Places from which it is looked at first.
const VIEWS: usize = 20;
const STRETCHES: usize = 100;
/// Most frames until a view is settled: five minutes.
const MOST_FRAMES: u32 = 18_000;

/// The steps of the measurement, each a process.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum TownStep {
    /// Generate the town and pack it.
    Make,
    /// Open the packed town and walk through it.
    Walk,
}

/// Runs a step on a folder; the walk prints its figures as a line of JSON.
pub(crate) fn run_step(step: TownStep, scene: &str, dir: &Path) -> anyhow::Result<()> {
    match step {
        TownStep::Make => make(scene, dir),
        TownStep::Walk => {
            println!("{}", walk(dir)?);
            Ok(())
        }
    }
}

fn make(scene: &str, dir: &Path) -> anyhow::Result<()> {
    let mut town = offices(scene)?;
    town.pvs = Some(visible_sets(&town)?);
    let file = encode_glb(&furnished(&town, TRIANGLES)?)?;
    let packed = PackedWorld::pack(&file)?;
    drop(file);
    for (name, bytes) in packed.files()? {
        std::fs::write(dir.join(name), bytes)?;
    }
    Ok(())
}

/// A link in virtual time that brings what is on disk.
struct Disk<'a> {
    link: SimulatedLink,
    head: &'a PackedHead,
    file: FileFetch,
}

impl<'a> Disk<'a> {
    fn new(head: &'a PackedHead, files: &PackedFiles, options: SimulatedLinkOptions) -> Self {
        Self {
            link: SimulatedLink::new(&head.catalog, options),
            head,
            file: FileFetch::new(files),
        }
    }

    fn read(&mut self, piece: PieceId) -> Result<Vec<u8>, String> {
        let n = self.head.catalog.pieces()[piece.idx()].n_packed;
        let packed = self.file.fetch(self.head.places[piece.idx()].offset, n)?;
        self.head.expand(piece, &packed)
    }
}

impl Source for Disk<'_> {
    fn request(&mut self, piece: PieceId) {
        self.link.request(piece);
    }

    fn cancel(&mut self, piece: PieceId) {
        self.link.cancel(piece);
    }

    fn poll(&mut self, replies: &mut Vec<Reply>) {
        let first = replies.len();
        self.link.poll(replies);
        for reply in &mut replies[first..] {
            if reply.bytes.is_ok() {
                let piece = reply.piece;
                reply.bytes = self.read(piece).map_err(|problem| FetchError::Damaged {
                    piece,
                    place: "the disk".to_owned(),
                    problem,
                });
            }
        }
    }
}

/// A program that draws pieces: it keeps their bytes.
struct Walker<'a> {
    streamer: Streamer,
    disk: Disk<'a>,
    changes: Changes,
    /// The bytes of pieces in memory.
    kept: HashMap<PieceId, Vec<u8>>,
    n_kept: u64,
    most_kept: u64,
    now: Duration,
}

impl<'a> Walker<'a> {
    fn new(site: &Streamed, head: &'a PackedHead, files: &PackedFiles) -> Self {
        let options = StreamOptions {
            max_resident: MOST_RESIDENT,
            ..StreamOptions::default()
        };
        let (catalog, pvs) = (head.catalog.clone(), Some(site.pvs.clone()));
        Self {
            streamer: Streamer::new(catalog, &site.world.graph, pvs, options),
            disk: Disk::new(head, files, link()),
            changes: Changes::default(),
            kept: HashMap::new(),
            n_kept: 0,
            most_kept: 0,
            now: Duration::ZERO,
        }
    }

    fn frame(&mut self, frame: StreamFrame<'_>) -> anyhow::Result<()> {
        self.now += FRAME;
        self.disk.link.advance(self.now);
        let frame = StreamFrame {
            now: self.now,
            ..frame
        };
        self.streamer
            .update(&mut self.disk, &frame, &mut self.changes);
        for piece in self.changes.removed.drain(..) {
            let bytes = self.kept.remove(&piece).context("freed twice")?;
            self.n_kept -= bytes.len() as u64;
        }
        for loaded in self.changes.added.drain(..) {
            read_piece(&loaded.bytes)?;
            self.n_kept += loaded.bytes.len() as u64;
            self.kept.insert(loaded.piece, loaded.bytes);
        }
        self.most_kept = self.most_kept.max(self.n_kept);
        ensure!(self.changes.failed.is_empty(), "{:?}", self.changes.failed);
        Ok(())
    }
}

fn link() -> SimulatedLinkOptions {
    SimulatedLinkOptions {
        bandwidth: 1e7,
        ..SimulatedLinkOptions::default()
    }
}

/// Opens the town; returns the figures.
fn walk(dir: &Path) -> anyhow::Result<Value> {
    let (head, files) = PackedFiles::open(dir)?;
    let n_head = std::fs::metadata(dir.join(enfilade::stream::HEAD))?.len();
    let n_pieces = std::fs::metadata(&files.pieces)?.len();
    let all = head.catalog.pieces().iter();
    let n_resident: u64 = all.map(|p| p.n_resident).sum();
    let before = memory("VmHWM");
    let site = Streamed {
        sight: head.sight()?,
        pvs: (head.world.pvs.clone()).context("the town has no visible sets")?,
        pieces: WorldPieces {
            catalog: head.catalog.clone(),
            ..WorldPieces::of_world(&head.world, &|_| Vec::new())
        },
        world: head.world.clone(),
    };
    let mut first = Vec::new();
    for stand in draw_stands(&site, VIEWS)? {
        let mut walker = Walker::new(&site, &head, &files);
        let mut frames = 0..MOST_FRAMES;
        while frames.next().is_some() {
            let (now, eye, in_view) = (walker.now, stand.eye, &stand.in_view[..]);
            walker.frame(StreamFrame { now, eye, in_view })?;
            if walker.streamer.view_settled() {
                break;
            }
        }
        let is_here = |p| walker.kept.contains_key(p);
        ensure!(stand.visible.iter().all(is_here), "a view is not complete");
        first.push(n_head as f64 + walker.disk.link.n_bytes());
    }
    let steps = Recorder::new(&site).walk(&route(&site, 1, STRETCHES)?, 1.4)?;
    let mut walker = Walker::new(&site, &head, &files);
    let start = steps.steps.first().context("no walk")?;
    for _ in 0..MOST_FRAMES {
        if walker.streamer.settled() {
            break;
        }
        walker.frame(frame_of(&steps, start, walker.now))?;
    }
    let (mut n_absent, mut n_late) = (0, 0);
    for step in &steps.steps {
        walker.frame(frame_of(&steps, step, walker.now))?;
        let absent = |p: &&PieceId| !walker.kept.contains_key(*p);
        let n = step.visible.iter().filter(absent).count();
        n_absent += n;
        n_late += usize::from(n > 0);
    }
    first.sort_by(f64::total_cmp);
    Ok(json!({
        "cells": site.world.graph.cells.len(),
        "pieces": head.catalog.pieces().len(),
        "unpacked": n_resident,
        "packed": n_head + n_pieces,
        "head": n_head,
        "first": first,
        "frames": steps.steps.len(),
        "absent": n_absent,
        "late": n_late,
        "kept": walker.most_kept,
        "requested": walker.streamer.counts().bytes_requested,
        "peakOfHead": before,
        "peak": memory("VmHWM"),
    }))
}

/// Returns the figures of the walk through a town, made once.
fn measured(scene: &str) -> anyhow::Result<Arc<Value>> {
    static FOUND: Kept<Value> = Kept::new();
    FOUND.get(scene, || {
        let dir: PathBuf = target_dir().join("town");
        std::fs::create_dir_all(&dir)?;
        let place = dir.display().to_string();
        let run = |name: &str| step(&["town", name, scene, &place]);
        let found = run("make").and_then(|_| run("walk"));
        std::fs::remove_dir_all(&dir)?;
        found
    })
}

fn number(found: &Value, name: &str) -> f64 {
    found[name].as_f64().unwrap_or(f64::NAN)
}

fn megabytes(found: &Value, name: &str) -> String {
    format!("{:.1} MB", number(found, name) / 1e6)
}

/// Returns the most memory of pieces on the walk.
pub(super) fn memory_of(scene: &str) -> anyhow::Result<Figure> {
    let found = measured(scene)?;
    let value = number(&found, "kept") / f64::from(1 << 20);
    let note = format!(
        "MiB of pieces; {} cells, {} pieces, {} unpacked, {} packed; the process {} at most, {} after opening",
        found["cells"],
        found["pieces"],
        megabytes(&found, "unpacked"),
        megabytes(&found, "packed"),
        megabytes(&found, "peak"),
        megabytes(&found, "peakOfHead"),
    );
    Ok(Figure::new(value, 256.0, note))
}

/// Returns the number of frame × piece in view and absent on the walk.
pub(super) fn absent(scene: &str) -> anyhow::Result<Figure> {
    let found = measured(scene)?;
    let note = format!(
        "frame × piece; {} of {} frames, 10 MB/s, 50 ms, 1.4 m/s; {} asked for",
        found["late"],
        found["frames"],
        megabytes(&found, "requested"),
    );
    Ok(Figure::new(number(&found, "absent"), 0.0, note))
}

/// Returns the share of bytes after which all that is in view is complete: the worst of several places.
pub(super) fn first_picture(scene: &str) -> anyhow::Result<Figure> {
    let found = measured(scene)?;
    let first = found["first"].as_array().context("no first pictures")?;
    let bytes: Vec<f64> = first.iter().filter_map(Value::as_f64).collect();
    let packed = number(&found, "packed");
    let last = bytes.last().context("no first pictures")?;
    let note = format!(
        "all in view from the worst of {VIEWS} places after {:.1} MB of {}, the median after {:.1} MB; head {}",
        last / 1e6,
        megabytes(&found, "packed"),
        bytes[bytes.len() / 2] / 1e6,
        megabytes(&found, "head"),
    );
    Ok(Figure::new(last / packed, 0.01, note))
}
