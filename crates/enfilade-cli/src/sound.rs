//! `enfilade sound`: renders a source as a walking listener hears it.

mod materials;
mod walked;

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::cpg::{PortalId, World};
use enfilade::geom::DVec3;
use enfilade::internals::geom::Allowance;
use enfilade::internals::world::{AUDIO_BLOCK, AudioBlock, Auralizer, at_ears, test_sound};
use enfilade::world::{
    Acoustics, DecayLaw, DiffuseFields, Listener, OCTAVES, PartId, Reverb, Space, Transmission,
};

use self::materials::{Absorption, Absorptions, Given, given, tell};
use crate::formats::Format;
use crate::limits::Limits;
use crate::output::{Outputs, write_streamed};
use crate::screen::{At, Warned, print_json};
use enfilade_cli::values::point;
use enfilade_cli::world::read_world_hashed;

/// Renders a source as a listener hears it who walks from point to point: through openings and closed doors, from the
/// direction of the sound, with the rooms' reverberation.
#[derive(clap::Args)]
pub(crate) struct Sound {
    /// World written by `enfilade bake`; `-` for standard input.
    world: PathBuf,
    /// Positions of the listener's ears, in meters: points to walk along at 1.4 m/s, for an hour at most; a single
    /// point lasts 3 seconds.
    #[arg(long, value_name = "X,Y,Z;…", value_parser = point, value_delimiter = ';', required = true, allow_hyphen_values = true)]
    listener: Vec<[f32; 3]>,
    /// Position of the source, in meters.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    source: [f32; 3],
    /// Lead the listener along the walking path from point to point, over floors, with the ears at 1.6 m: through doors, which stay as
    /// they are for the sound, but not through portals that are `--closed`.
    #[arg(long)]
    walk: bool,
    /// Sound that the source repeats: the first channel of a WAV file. A test sound if not given.
    #[arg(long, value_name = "FILE")]
    wav: Option<PathBuf>,
    /// Portals whose leaves are opened, by number, or `all`; repeatable. Otherwise doors stand as in the model, mostly shut.
    #[arg(long, value_name = "all|PORTAL")]
    open: Vec<String>,
    /// Closed portals, by number; after those opened.
    #[arg(long, value_name = "PORTAL,…", value_delimiter = ',')]
    closed: Vec<u32>,
    /// Absorption of a material, 0 to 1: one coefficient, or six, for the octave bands from 125 Hz to 4 kHz; repeatable. For other
    /// materials it is assumed from their names, and what was assumed is told.
    #[arg(long, value_name = "NAME=A[,…]", value_parser = given)]
    absorption: Vec<Given>,
    /// File for the sound, a WAV file of two channels of 16 bits.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Print JSON for machines: the sound along the walk, ten times a second.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// Speed of walking. [Units: wu/s]
const SPEED: f64 = 1.4;
/// Time at a single point. [Units: s]
const STANDING: f64 = 3.0;
/// The longest walk: at 192 kHz it still fits a WAV file, which has at most 4 GiB. [Units: s]
const LONGEST: f64 = 3600.0;
/// Most samples of `--wav` held in memory: 25 minutes at 44.1 kHz.
const MOST_SAMPLES: usize = 1 << 26;
const RATE: u32 = 44100;
/// Work of a block, in units of [`Allowance`]: mostly the search for paths.
const WORK_A_BLOCK: u64 = 500;

const N_OCTAVES: usize = OCTAVES.len();

/// A line of the report.
#[derive(serde::Serialize)]
struct HeardLine {
    seconds: f64,
    position: [f64; 3],
    cell: u32,
    /// Length of the shortest path; `null` if there is none.
    length: Option<f64>,
    direction: [f64; 3],
    gain_db: Option<f64>,
    room_db: Option<f64>,
    /// At mid frequencies, the mean of the bands of 500 and 1,000 Hz.
    rt60: f64,
}

pub(crate) fn run(args: &Sound) -> anyhow::Result<()> {
    let allowance = args.limits.begin()?;
    let mut outputs = Outputs::reading(std::iter::once(&args.world).chain(&args.wav))?;
    if let Some(path) = &args.output {
        outputs.write("-o", Format::Sound, path)?;
    }
    let given: Vec<DVec3> = args.listener.iter().copied().map(exact).collect();
    let mut seconds = duration(&given)?;
    let (world, hash) = read_world_hashed(&args.world)?;
    let n = world.graph.portals.len();
    if let Some(p) = args.closed.iter().find(|p| **p as usize >= n) {
        bail!(
            "--closed {p}: the world has portals 0 to {}",
            n.saturating_sub(1)
        );
    }
    let opened = opened(&args.open, n)?;
    let (mut points, mut warnings) = (given, Vec::new());
    if args.walk {
        points = walked::along_paths(args, &world, hash, &points, &mut warnings)?;
        seconds = duration(&points)?;
    } else {
        walked::check(&world, &points, &mut warnings)?;
    }
    for warning in &warnings {
        writeln!(Warned, "{warning}")?;
    }
    let (rate, source) = match &args.wav {
        Some(path) => read_wav(path, seconds)?,
        None => (RATE, test_sound(RATE)),
    };
    let walk = HeardWalk {
        points: &points,
        n_blocks: n_blocks(seconds, rate),
        seconds_of_block: AUDIO_BLOCK as f64 / f64::from(rate),
        source: exact(args.source),
        opened: &opened,
    };
    let heard = match &args.output {
        None => walk.hear(args, &world, &allowance, |_| Ok(()))?,
        Some(path) => {
            let mut heard = HeardWhole::default();
            let mut renderer = Auralizer::new(&source, rate);
            write_streamed(path, |out| {
                let mut out = BufWriter::with_capacity(1 << 16, out);
                out.write_all(&wav_head(walk.n_blocks * AUDIO_BLOCK, rate))?;
                heard = walk.hear(args, &world, &allowance, |block| {
                    for sample in renderer.render(block).iter().flatten() {
                        out.write_all(&((sample * 32767.0).round() as i16).to_le_bytes())?;
                    }
                    Ok(())
                })?;
                Ok(out.flush()?)
            })?;
            heard
        }
    };
    let out = outputs.printed();
    if args.json {
        return print_json(
            out,
            &serde_json::json!({
                "file": args.output.as_ref().map(|p| p.display().to_string()),
                "heard": heard.rows,
                "absorption": heard.absorption,
                "warnings": warnings,
            }),
        );
    }
    tell(&heard.absorption)?;
    print_table(out, &heard.rows)
}

/// Sound along a walk, and the walls that were assumed.
#[derive(Default)]
struct HeardWhole {
    rows: Vec<HeardLine>,
    absorption: Vec<Absorption>,
}

/// A walk, with the source to hear.
struct HeardWalk<'a> {
    points: &'a [DVec3],
    n_blocks: usize,
    seconds_of_block: f64,
    source: DVec3,
    opened: &'a [PortalId],
}

impl HeardWalk<'_> {
    /// Passes the sound of each block to `each`; returns lines for the reader.
    fn hear(
        &self,
        args: &Sound,
        world: &World,
        allowance: &Allowance,
        mut each: impl FnMut(&AudioBlock) -> anyhow::Result<()>,
    ) -> anyhow::Result<HeardWhole> {
        let root = PartId::ROOT;
        let mut space =
            Space::new(world.clone()).with_context(|| args.world.display().to_string())?;
        self.opened.iter().for_each(|&p| space.open(root, p));
        args.closed
            .iter()
            .for_each(|&p| space.close(root, PortalId(p)));
        let acoustics = Acoustics::new(&space, &Transmission::default());
        let absorptions = Absorptions::new(world, &args.absorption)?;
        let reverb = Reverb::new(&space, DecayLaw::Kuttruff, |_, m| absorptions.of(m));
        let source = self.source;
        let source_cell = space
            .locate(root, source)
            .with_context(|| {
                format!(
                    "--source: it is in solid matter or outside of all cells, at {}; `enfilade locate` tells the cell of a point",
                    At(source.into())
                )
            })?;
        let mut fields = DiffuseFields::new();
        let passes = |part, portal| acoustics.transmitted(&space, part, portal);
        fields.solve(&reverb, &space, source_cell, passes);
        let (mut ears, mut rows) = (Listener::new(), Vec::new());
        let mut before: Option<AudioBlock> = None;
        let mut is_row_due = 0.0;
        for k in 0..self.n_blocks {
            if !allowance.spend(WORK_A_BLOCK) {
                return Err(args.limits.time_is_up());
            }
            let time = k as f64 * self.seconds_of_block;
            let (at, ahead) = place(self.points, time * SPEED, source);
            // In solid matter, such as a door frame, the last sound continues.
            let Some(cell) = space.locate(root, at) else {
                match &before {
                    Some(last) => each(last)?,
                    None => bail!(
                        "--listener: the walk starts in solid matter or outside of all cells, at {}; `enfilade locate` tells the cell \
                         of a point",
                        At(at.into())
                    ),
                }
                continue;
            };
            ears.listen(&acoustics, &space, cell, at);
            let heard = ears.hear(&acoustics, 0, source_cell, source);
            // Too faint, it keeps its delay.
            let way = ears.shortest(&acoustics, 0, source_cell, source);
            let (toward, gain) = heard.map_or((DVec3::ZERO, 0.0), |h| (h.direction, h.gain));
            let follow = |before: Option<[f64; N_OCTAVES]>, now: [f64; N_OCTAVES]| {
                let before = before.unwrap_or(now);
                std::array::from_fn(|k| follow(before[k], now[k], self.seconds_of_block))
            };
            let block = AudioBlock {
                length: way.map_or(0.0, |w| w.0),
                bands: heard.map_or([0.0; N_OCTAVES], |h| h.bands),
                ears: at_ears(toward, ahead, DVec3::Y),
                room: follow(before.map(|b| b.room), fields.gain_bands(cell)),
                rt60: follow(before.map(|b| b.rt60), fields.rt60_bands(cell)),
            };
            each(&block)?;
            before = Some(block);
            if time >= is_row_due {
                is_row_due += 0.1;
                rows.push(HeardLine {
                    seconds: time,
                    position: at.to_array(),
                    cell: cell.cell.0,
                    length: heard.map(|h| h.length),
                    direction: toward.to_array(),
                    gain_db: decibels(gain),
                    room_db: decibels(fields.gain(cell)),
                    rt60: fields.rt60(cell),
                });
            }
        }
        let absorption = absorptions.by_area(&reverb);
        Ok(HeardWhole { rows, absorption })
    }
}

/// The portals named by `--open`.
fn opened(names: &[String], n: usize) -> anyhow::Result<Vec<PortalId>> {
    let mut portals = Vec::new();
    for name in names {
        if name == "all" {
            portals.extend((0..n as u32).map(PortalId));
            continue;
        }
        match name.parse::<u32>() {
            Ok(p) if (p as usize) < n => portals.push(PortalId(p)),
            _ => bail!(
                "--open {name}: give `all` or one of the portals 0 to {}",
                n.saturating_sub(1)
            ),
        }
    }
    Ok(portals)
}

/// Moves a value towards another with a time constant of a fifth of a second: leaving and entering a room is gradual.
fn follow(before: f64, now: f64, seconds: f64) -> f64 {
    before + (now - before) * (1.0 - (-seconds / 0.2).exp())
}

fn exact(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// The duration of a walk. [Units: s] Refused if it is longer than is rendered.
fn duration(points: &[DVec3]) -> anyhow::Result<f64> {
    let length: f64 = points.windows(2).map(|p| p[0].distance(p[1])).sum();
    let seconds = if length > 0.0 {
        length / SPEED
    } else {
        STANDING
    };
    if seconds > LONGEST {
        bail!(
            "--listener: the walk takes longer than {LONGEST} s, {:.2} km, the most that is rendered; give closer points, \
             or render the walk in parts",
            LONGEST * SPEED / 1000.0
        );
    }
    Ok(seconds)
}

fn n_blocks(seconds: f64, rate: u32) -> usize {
    (seconds * f64::from(rate) / AUDIO_BLOCK as f64).ceil() as usize
}

/// The position of the walker after a length, and the direction of view: ahead, or towards the source if standing.
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

/// The rate of a WAV file, and as much of its first channel as is heard in so many seconds.
fn read_wav(path: &Path, seconds: f64) -> anyhow::Result<(u32, Vec<f32>)> {
    let name = || path.display().to_string();
    let mut reader = hound::WavReader::open(path).with_context(name)?;
    let spec = reader.spec();
    if !(8000..=192_000).contains(&spec.sample_rate) {
        bail!(
            "{}: a sound of 8 to 192 kHz is needed, not of {} Hz",
            name(),
            spec.sample_rate
        );
    }
    let channels = usize::from(spec.channels.max(1));
    // One more, to interpolate after the last sample.
    let n = n_blocks(seconds, spec.sample_rate) * AUDIO_BLOCK + 1;
    let most = n.min(MOST_SAMPLES + 1);
    let samples: Result<Vec<f32>, _> = match spec.sample_format {
        hound::SampleFormat::Float => {
            let all = reader.samples::<f32>();
            all.step_by(channels).take(most).collect()
        }
        hound::SampleFormat::Int => {
            let scale = 2f32.powi(1 - i32::from(spec.bits_per_sample));
            let whole = reader.samples::<i32>().step_by(channels).take(most);
            whole.map(|s| s.map(|s| s as f32 * scale)).collect()
        }
    };
    let samples = samples.with_context(name)?;
    if samples.is_empty() {
        bail!("{}: the sound has no samples", name());
    }
    if samples.len() > MOST_SAMPLES {
        bail!(
            "{}: more than {MOST_SAMPLES} samples, {} s, would be played; cut it, or lower its rate",
            name(),
            MOST_SAMPLES / spec.sample_rate as usize
        );
    }
    Ok((spec.sample_rate, samples))
}

/// The head of a WAV file of two channels of 16 bits. The length is known beforehand, so that the file can be
/// streamed.
fn wav_head(n_samples: usize, rate: u32) -> Vec<u8> {
    const FRAME: u32 = 4;
    let n_bytes = n_samples as u32 * FRAME;
    let mut out = Vec::with_capacity(44);
    let number = |out: &mut Vec<u8>, n: u32| out.extend(n.to_le_bytes());
    out.extend(b"RIFF");
    number(&mut out, n_bytes + 36);
    out.extend(b"WAVEfmt ");
    number(&mut out, 16);
    // PCM, two channels.
    out.extend([1, 0, 2, 0]);
    number(&mut out, rate);
    number(&mut out, rate * FRAME);
    out.extend([FRAME as u8, 0, 16, 0]);
    out.extend(b"data");
    number(&mut out, n_bytes);
    out
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
