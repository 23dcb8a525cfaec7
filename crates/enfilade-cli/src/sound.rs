//! `enfilade sound`: what a walking listener hears of a source.

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::cpg::{PortalId, World};
use enfilade::geom::DVec3;
use enfilade::runtime::{Sight, SightState};
use enfilade::world::{
    Acoustics, DecayLaw, DiffuseFields, Layout, Listener, Reverb, Transmission, absorption_of_name,
    at_ears,
};

use crate::auralize::{BLOCK, Block, render, test_sound};
use crate::formats::Format;
use crate::output::{Outputs, write_whole};
use crate::screen::print_json;
use enfilade_cli::values::point;
use enfilade_cli::world::read_world;

/// Renders what a listener hears of a source while walking from point to point: through openings and closed doors, from where the
/// sound comes, with the rooms' reverberation.
#[derive(clap::Args)]
pub(crate) struct Sound {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// Where the listener's ears are, in meters: points to walk along, at 1.4 m/s; at one point for 3 seconds.
    #[arg(long, value_name = "X,Y,Z;…", value_parser = point, value_delimiter = ';', required = true, allow_hyphen_values = true)]
    listener: Vec<[f32; 3]>,
    /// Where the source is, in meters.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    source: [f32; 3],
    /// What it plays, over and over: the first channel of a WAV file. A test sound without it.
    #[arg(long, value_name = "FILE")]
    wav: Option<PathBuf>,
    /// Portals that are closed, by number.
    #[arg(long, value_name = "PORTAL,…", value_delimiter = ',')]
    closed: Vec<u32>,
    /// Where to write the sound, a WAV file of two channels of 16 bits.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Print JSON for machines: what is heard along the walk, ten times a second.
    #[arg(long)]
    json: bool,
}

/// [Units: wu/s]
const SPEED: f64 = 1.4;
/// How long one stands at a single point. [Units: s]
const STANDING: f64 = 3.0;
const RATE: u32 = 44100;

/// A line of what is heard.
#[derive(serde::Serialize)]
struct HeardLine {
    seconds: f64,
    position: [f64; 3],
    cell: u32,
    /// Of the shortest way; `null` where none leads.
    length: Option<f64>,
    direction: [f64; 3],
    gain_db: Option<f64>,
    room_db: Option<f64>,
    rt60: f64,
}

pub(crate) fn run(args: &Sound) -> anyhow::Result<()> {
    let mut outputs = Outputs::reading(std::iter::once(&args.world).chain(&args.wav))?;
    if let Some(path) = &args.output {
        outputs.write("-o", Format::Sound, path)?;
    }
    let world = read_world(&args.world)?;
    let n = world.graph.portals.len();
    if let Some(p) = args.closed.iter().find(|p| **p as usize >= n) {
        bail!(
            "--closed {p}: the world has portals 0 to {}",
            n.saturating_sub(1)
        );
    }
    let (rate, source) = match &args.wav {
        Some(path) => read_wav(path)?,
        None => (RATE, test_sound(RATE)),
    };
    let (rows, blocks) = walk(args, &world, rate)?;
    if let Some(path) = &args.output {
        write_whole(path, &wav_of(&render(&source, rate, &blocks), rate)?)?;
    }
    let out = outputs.printed();
    if args.json {
        return print_json(
            out,
            &serde_json::json!({ "file": args.output.as_ref().map(|p| p.display().to_string()), "heard": rows }),
        );
    }
    print_table(out, &rows)
}

/// What is heard block by block, and lines for the reader.
fn walk(args: &Sound, world: &World, rate: u32) -> anyhow::Result<(Vec<HeardLine>, Vec<Block>)> {
    let layout = Layout::new(world);
    let sight = Sight::build(world).with_context(|| args.world.display().to_string())?;
    let mut state = SightState::new(&sight);
    args.closed.iter().for_each(|&p| state.close(PortalId(p)));
    let acoustics = Acoustics::new(&layout, world, &Transmission::default());
    let reverb = Reverb::new(&layout, world, DecayLaw::Eyring, |material| {
        let named = material.and_then(|m| world.materials.get(m as usize));
        absorption_of_name(named.map_or("", |m| m.name.as_str()))
    });
    let source = exact(args.source);
    let source_cell = layout.locate(source).context("the source is in no cell")?;
    let mut fields = DiffuseFields::new();
    fields.solve(&reverb, source_cell, |p| acoustics.transmitted(&state, p));
    let (mut ears, mut rows, mut blocks) = (Listener::new(), Vec::new(), Vec::new());
    let seconds_of_block = BLOCK as f64 / f64::from(rate);
    let (points, seconds) = path(&args.listener);
    let mut is_row_due = 0.0;
    for k in 0..(seconds / seconds_of_block).ceil() as usize {
        let time = k as f64 * seconds_of_block;
        let (at, ahead) = place(&points, time * SPEED, source);
        // In a doorway's solid frame one hears what one heard before it.
        let Some(cell) = layout.locate(at) else {
            match blocks.last().copied() {
                Some(last) => blocks.push(last),
                None => bail!("the listener starts in no cell, at {at}"),
            }
            continue;
        };
        ears.listen(&acoustics, &state, cell, at);
        let heard = ears.hear(&acoustics, &layout, 0, source_cell, source);
        let (toward, gain) = heard.map_or((DVec3::ZERO, 0.0), |h| (h.direction, h.gain));
        let (room, rt60) = (fields.gain(cell), fields.rt60(cell));
        blocks.push(Block {
            length: heard.map_or(0.0, |h| h.length),
            ears: at_ears(toward, ahead, DVec3::Y).map(|(g, late)| (g * gain, late)),
            room: follow(
                blocks.last().map(|b: &Block| b.room),
                room,
                seconds_of_block,
            ),
            rt60: follow(
                blocks.last().map(|b: &Block| b.rt60),
                rt60,
                seconds_of_block,
            ),
        });
        if time >= is_row_due {
            is_row_due += 0.1;
            rows.push(HeardLine {
                seconds: time,
                position: at.to_array(),
                cell: cell.0,
                length: heard.map(|h| h.length),
                direction: toward.to_array(),
                gain_db: decibels(gain),
                room_db: decibels(room),
                rt60,
            });
        }
    }
    Ok((rows, blocks))
}

/// A room is left and entered over a fifth of a second.
fn follow(before: Option<f64>, now: f64, seconds: f64) -> f64 {
    let share = 1.0 - (-seconds / 0.2).exp();
    before.map_or(now, |b| b + (now - b) * share)
}

fn exact(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// The points of a walk, and how long it takes. [Units: wu, s]
fn path(listener: &[[f32; 3]]) -> (Vec<DVec3>, f64) {
    let points: Vec<DVec3> = listener.iter().copied().map(exact).collect();
    let length: f64 = points.windows(2).map(|p| p[0].distance(p[1])).sum();
    let seconds = if length > 0.0 {
        length / SPEED
    } else {
        STANDING
    };
    (points, seconds)
}

/// Where the walker is after a length, and where the walker looks: ahead, and towards the source if standing.
fn place(points: &[DVec3], mut length: f64, source: DVec3) -> (DVec3, DVec3) {
    let mut ahead = (source - points[0]) * DVec3::new(1.0, 0.0, 1.0);
    for leg in points.windows(2) {
        let along = leg[1] - leg[0];
        if along.length() > 0.0 {
            ahead = along * DVec3::new(1.0, 0.0, 1.0);
        }
        if length <= along.length() {
            let at = leg[0] + along.normalize_or_zero() * length;
            return (at, ahead.normalize_or(DVec3::X));
        }
        length -= along.length();
    }
    (points[points.len() - 1], ahead.normalize_or(DVec3::X))
}

fn decibels(gain: f64) -> Option<f64> {
    (gain > 0.0).then(|| 20.0 * gain.log10())
}

fn read_wav(path: &Path) -> anyhow::Result<(u32, Vec<f32>)> {
    let name = || path.display().to_string();
    let mut reader = hound::WavReader::open(path).with_context(name)?;
    let spec = reader.spec();
    let channels = usize::from(spec.channels.max(1));
    let samples: Result<Vec<f32>, _> = match spec.sample_format {
        hound::SampleFormat::Float => reader.samples::<f32>().step_by(channels).collect(),
        hound::SampleFormat::Int => {
            let scale = 2f32.powi(1 - i32::from(spec.bits_per_sample));
            let whole = reader.samples::<i32>().step_by(channels);
            whole.map(|s| s.map(|s| s as f32 * scale)).collect()
        }
    };
    let samples = samples.with_context(name)?;
    if samples.is_empty() || !(8000..=192_000).contains(&spec.sample_rate) {
        bail!(
            "{}: a sound of 8 to 192 kHz is needed, of a sample or more",
            name()
        );
    }
    Ok((spec.sample_rate, samples))
}

fn wav_of(samples: &[[f32; 2]], rate: u32) -> anyhow::Result<Vec<u8>> {
    let spec = hound::WavSpec {
        channels: 2,
        sample_rate: rate,
        bits_per_sample: 16,
        sample_format: hound::SampleFormat::Int,
    };
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = hound::WavWriter::new(&mut bytes, spec)?;
    for sample in samples.iter().flatten() {
        writer.write_sample((sample * 32767.0).round() as i16)?;
    }
    writer.finalize()?;
    Ok(bytes.into_inner())
}

fn print_table(mut out: impl Write, rows: &[HeardLine]) -> anyhow::Result<()> {
    writeln!(
        out,
        "{:>6} {:>6} {:>8} {:>8} {:>8} {:>6}",
        "s", "cell", "length", "gain dB", "room dB", "RT60"
    )?;
    let number = |x: Option<f64>| x.map_or_else(|| "-".into(), |x| format!("{x:.2}"));
    for row in rows {
        let (length, gain, room) = (number(row.length), number(row.gain_db), number(row.room_db));
        writeln!(
            out,
            "{:>6.1} {:>6} {length:>8} {gain:>8} {room:>8} {:>6.2}",
            row.seconds, row.cell, row.rt60
        )?;
    }
    out.flush().context("cannot write to standard output")
}
