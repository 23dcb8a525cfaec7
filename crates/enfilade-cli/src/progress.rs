//! Progress on standard error: a bar on a terminal, occasional lines in a log.

use std::io::Write as _;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use enfilade::bake::{BakeConfig, Method, Progress, Resolution, Stage};
use enfilade::geom::Aabb;
use enfilade::geom::scene::{Role, Scene};
use enfilade_cli::memory::most_held_memory;
use indicatif::{ProgressBar, ProgressState, ProgressStyle};

use crate::progress_lines::{Now, Pace, Ticker};
use crate::screen::{Told, Warned, is_quiet, is_watched};

/// Returns `true` if bars are drawn.
fn is_shown() -> bool {
    is_watched() && !is_quiet()
}

/// Starts occasional log lines about the work under way, if standard error is a log.
fn log(now: impl Fn() -> Option<Now> + Send + 'static) -> Option<Ticker> {
    let is_logged = !is_watched() && !is_quiet();
    is_logged.then(|| Ticker::start(Pace::default(), now, Told))
}

/// A line on the terminal that shows the stage under way, its progress and the time left.
///
/// If standard error is not a terminal, writes occasional log lines. The line disappears when dropped.
pub(crate) struct StageBar {
    bar: ProgressBar,
    _log: Option<Ticker>,
}

/// The log line for a stage without a time estimate of its own.
fn stage_line(bar: &ProgressBar) -> Option<Now> {
    let stage = bar.message();
    if bar.is_finished() || stage.is_empty() {
        return None;
    }
    let gone = clock(bar.elapsed().as_secs_f64());
    let share = match bar.length() {
        Some(n) if n > 0 => format!(", {} %", bar.position().saturating_mul(100) / n),
        _ => String::new(),
    };
    Some(Now {
        line: format!("{stage}{share}, {gone} gone"),
        stage,
    })
}

impl StageBar {
    /// A bar without a stage.
    pub(crate) fn new() -> Self {
        let bar = if is_shown() {
            ProgressBar::new(0)
        } else {
            ProgressBar::hidden()
        };
        let logged = bar.clone();
        Self {
            bar,
            _log: log(move || stage_line(&logged)),
        }
    }

    /// Begins a stage of `total` steps; 0 if the number is unknown.
    pub(crate) fn start(&self, stage: &str, total: u64) {
        let template = if total > 0 {
            "{msg:>24} {wide_bar} {percent:>3} %  {eta} left"
        } else {
            "{msg:>24} {spinner}  {elapsed}"
        };
        // Templates are constants; a style that does not parse would be noticed at once.
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
        self.bar.reset();
        self.bar.set_length(total);
        self.bar.set_message(stage.to_owned());
    }

    /// Sets the number of steps done.
    pub(crate) fn set(&self, done: u64) {
        self.bar.set_position(done);
    }

    /// Removes the line.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for StageBar {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Expected seconds of a stage per million voxels and per thousand triangles.
///
/// For the watershed they add up to 0.10 s per million voxels of the box and 0.15 s per thousand triangles, fitted to buildings of 1
/// to 83 million voxels and 1,600 to 383,000 triangles on two cores. Soon only the proportions matter: the measured times of the
/// first stages scale the rest.
fn cost(stage: Stage) -> [f64; 2] {
    match stage {
        Stage::Structure => [0.0, 0.005],
        Stage::Voxelize => [0.003, 0.001],
        Stage::Distance => [0.008, 0.0],
        Stage::Flood => [0.021, 0.0],
        Stage::Rooms => [0.053, 0.0],
        Stage::Candidates => [0.014, 0.048],
        Stage::Tree => [0.0, 0.08],
        Stage::Tetrahedra => [0.0, 0.1],
        Stage::Decimation => [0.0, 0.5],
        Stage::Separators => [0.0, 0.2],
        Stage::Complex => [0.0, 0.06],
        Stage::Partition => [0.001, 0.03],
        Stage::Geometry => [0.0, 0.001],
        // A stage without measurements.
        _ => [0.005, 0.005],
    }
}

/// Estimates the time left of a run of stages, from expected times and from the times that earlier stages took.
struct TimeLeft {
    /// Expected seconds of each stage.
    expected: Vec<f64>,
    /// The stage under way.
    at: usize,
    /// Seconds that the earlier stages took.
    spent: f64,
}

impl TimeLeft {
    /// The expected seconds weigh as much as this long of measuring. [Units: s]
    const TRUST: f64 = 0.5;

    fn new(stages: &[Stage], n_voxels: f64, n_triangles: f64) -> Self {
        let seconds = |&stage: &Stage| {
            let [of_voxels, of_triangles] = cost(stage);
            // Even a stage with nothing to do is visible for a moment.
            1e-3 + n_voxels / 1e6 * of_voxels + n_triangles / 1e3 * of_triangles
        };
        Self {
            expected: stages.iter().map(seconds).collect(),
            at: 0,
            spent: 0.0,
        }
    }

    /// Stage `index` begins `spent` seconds after the first one did.
    fn begin(&mut self, index: usize, spent: f64) {
        self.at = index.min(self.expected.len());
        self.spent = spent;
    }

    /// Seconds left, `elapsed` seconds into the stage under way.
    fn left(&self, elapsed: f64) -> f64 {
        let rest: f64 = self.expected[self.at..].iter().skip(1).sum();
        let now = self.expected.get(self.at).copied().unwrap_or(0.0);
        // A late stage suggests that later ones take longer, too.
        let pace = self.pace().max(elapsed / now.max(1e-3) * 0.5);
        (pace * now - elapsed).max(0.1 * elapsed) + pace * rest
    }

    /// The time left in words, `elapsed` seconds into the stage under way; not a number if the stage takes longer
    /// than expected.
    fn in_words(&self, elapsed: f64) -> String {
        let now = self.expected.get(self.at).copied().unwrap_or(0.0);
        if elapsed > self.pace() * now + Self::TRUST {
            return "longer than expected".to_owned();
        }
        format!("about {} left", clock(self.left(elapsed)))
    }

    /// Ratio of actual to expected time of the earlier stages.
    fn pace(&self) -> f64 {
        let done: f64 = self.expected[..self.at].iter().sum();
        (self.spent + Self::TRUST) / (done + Self::TRUST)
    }

    /// The fraction done, from 0 to 1, `elapsed` seconds into the stage under way.
    fn share(&self, elapsed: f64) -> f64 {
        let done = self.spent + elapsed;
        done / (done + self.left(elapsed)).max(1e-9)
    }
}

/// `1:05` for 65 seconds; hours only if there are any.
fn clock(seconds: f64) -> String {
    let s = seconds.round() as u64;
    match s / 3600 {
        0 => format!("{}:{:02}", s / 60, s % 60),
        h => format!("{h}:{:02}:{:02}", s / 60 % 60, s % 60),
    }
}

/// `65 s` for 65 seconds, `4 min` for 245: no more digits than an estimate deserves.
fn in_words(seconds: f64) -> String {
    match seconds.round() {
        0.0 => "less than 1 s".into(),
        s if s < 100.0 => format!("{s} s"),
        s if s < 6000.0 => format!("{} min", (s / 60.0).round()),
        s => format!("{} h", (s / 3600.0).round()),
    }
}

/// The progress of a bake: name of the stage, fraction done and time left.
pub(crate) struct BakeBar {
    bar: ProgressBar,
    _log: Option<Ticker>,
    state: Arc<Mutex<Clock>>,
    /// Numbers of voxels and triangles to process.
    work: (f64, f64),
    /// Requested edge of a voxel. [Units: wu]
    wanted: f64,
}

struct Clock {
    stages: &'static [Stage],
    left: TimeLeft,
    began: Instant,
    stage_began: Instant,
}

impl Clock {
    fn elapsed(&self) -> f64 {
        self.stage_began.elapsed().as_secs_f64()
    }

    /// The log line for the stage under way.
    fn line(&self) -> Option<Now> {
        let at = self.left.at;
        let stage = self.stages.get(at)?.name();
        Some(Now {
            stage: stage.to_owned(),
            line: format!(
                "{}/{} {stage}, {} gone, {}",
                at + 1,
                self.stages.len(),
                clock(self.began.elapsed().as_secs_f64()),
                self.left.in_words(self.elapsed())
            ),
        })
    }
}

impl BakeBar {
    /// Cells of the drawn bar.
    const CELLS: usize = 30;

    /// Makes the bar for a bake of `scene`; log lines if standard error is not a terminal.
    pub(crate) fn new(scene: &Scene, config: &BakeConfig) -> Self {
        let now = Instant::now();
        let is_shown = is_shown();
        let work = work_of(scene, config);
        let state = Arc::new(Mutex::new(Clock {
            stages: &[],
            left: TimeLeft::new(&[], work.0, work.1),
            began: now,
            stage_began: now,
        }));
        let bar = if is_shown {
            ProgressBar::new_spinner()
        } else {
            ProgressBar::hidden()
        };
        let read = |write: fn(&Clock, &mut dyn std::fmt::Write)| {
            let state = Arc::clone(&state);
            move |_: &ProgressState, out: &mut dyn std::fmt::Write| {
                write(&state.lock().expect("no panic holds it"), out);
            }
        };
        // The template is a constant; one that does not parse would be noticed at once.
        if let Ok(style) = ProgressStyle::with_template("{msg:>24} {share} {left}") {
            let style = style
                .with_key(
                    "share",
                    read(|clock, out| {
                        let share = clock.left.share(clock.elapsed());
                        let n = (share * Self::CELLS as f64) as usize;
                        let n = n.min(Self::CELLS);
                        let _ = write!(
                            out,
                            "{}{} {:>3.0} % ",
                            "█".repeat(n),
                            "░".repeat(Self::CELLS - n),
                            share * 100.0
                        );
                    }),
                )
                .with_key(
                    "left",
                    read(|c, out| {
                        let _ = write!(out, "{}", c.left.in_words(c.elapsed()));
                    }),
                );
            bar.set_style(style);
        }
        if is_shown {
            bar.enable_steady_tick(Duration::from_millis(200));
        }
        let wanted = config.voxel.unwrap_or(config.min_opening / 6.0);
        let logged = Arc::clone(&state);
        Self {
            bar,
            _log: log(move || logged.lock().ok()?.line()),
            state,
            work,
            wanted,
        }
    }
}

impl Progress for BakeBar {
    fn method(&self, method: Method, reason: &str) {
        // If standard error is closed, nobody reads it: ignore the failure.
        self.bar.suspend(|| {
            let _ = writeln!(Told, "method {}: {reason}", method.name());
        });
        let mut clock = self.state.lock().expect("no panic holds it");
        clock.stages = method.stages();
        clock.left = TimeLeft::new(clock.stages, self.work.0, self.work.1);
        clock.began = Instant::now();
    }

    fn stage(&self, stage: Stage) {
        let (index, count) = {
            let mut clock = self.state.lock().expect("no panic holds it");
            clock.stage_began = Instant::now();
            let spent = clock.began.elapsed().as_secs_f64();
            let index = clock.stages.iter().position(|s| *s == stage).unwrap_or(0);
            clock.left.begin(index, spent);
            (index, clock.stages.len())
        };
        let name = stage.name();
        self.bar
            .set_message(format!("{}/{count} {name}", index + 1));
    }

    fn resolution(&self, resolution: Resolution, memory: f64) {
        let Resolution::Voxels { edge, n_voxels, .. } = resolution else {
            return;
        };
        let seconds = {
            let mut clock = self.state.lock().expect("no panic holds it");
            clock.left = TimeLeft::new(clock.stages, n_voxels as f64, self.work.1);
            clock.left.expected.iter().sum::<f64>()
        };
        // The tree of a partition is largest before.
        let memory = memory.max(most_held_memory().unwrap_or_default() as f64);
        self.bar.suspend(|| {
            let _ = write!(Told, "{}", plan(resolution, memory, seconds));
            let _ = write!(Warned, "{}", coarser(edge, self.wanted));
        });
    }
}

/// The work ahead, as a line; empty without voxels.
fn plan(resolution: Resolution, memory: f64, seconds: f64) -> String {
    let Resolution::Voxels {
        edge,
        dims: [nx, ny, nz],
        n_grids,
        n_voxels,
    } = resolution
    else {
        return String::new();
    };
    let grids = if n_grids == 1 {
        format!("{nx} × {ny} × {nz}")
    } else {
        format!("{n_grids} buildings, at most {nx} × {ny} × {nz}")
    };
    let (n, memory) = (n_voxels as f64 / 1e6, memory / 1e6);
    format!(
        "voxels of {edge:.3} m, {grids}: {n:.1} million, about {memory:.0} MB and {}\n",
        in_words(seconds)
    )
}

/// A line that reports larger voxels than requested, or nothing.
fn coarser(edge: f64, wanted: f64) -> String {
    // The grid enlarges its voxels by tenths.
    if edge <= wanted * 1.05 {
        return String::new();
    }
    format!(
        "coarser than the {} m requested, which would exceed the number of voxels allowed (--max-memory, and max_voxels in a \
         --config file)\n",
        (wanted * 1e9).round() / 1e9
    )
}

impl Drop for BakeBar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Approximate numbers of voxels and structural triangles of a bake.
fn work_of(scene: &Scene, config: &BakeConfig) -> (f64, f64) {
    let mut bounds = Aabb::EMPTY;
    let mut n_triangles = 0;
    for (i, o) in scene.objects.iter().enumerate() {
        if o.role == Role::Structural {
            bounds = bounds.union(scene.object_aabb(i));
            let mesh = &scene.meshes[o.mesh as usize];
            n_triangles += mesh
                .primitives
                .iter()
                .map(|p| p.indices.len() / 3)
                .sum::<usize>();
        }
    }
    let voxel = config.voxel.unwrap_or(config.min_opening / 6.0);
    // About two meters of air around the scene.
    let size = (bounds.size() + 2.0) / voxel;
    let n_voxels = (size.x * size.y * size.z).min(config.max_voxels as f64);
    (
        if n_voxels.is_finite() { n_voxels } else { 0.0 },
        n_triangles as f64,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_stages(expected: &[f64]) -> TimeLeft {
        TimeLeft {
            expected: expected.to_vec(),
            at: 0,
            spent: 0.0,
        }
    }

    #[test]
    fn a_machine_as_measured_takes_what_was_measured() {
        let mut t = of_stages(&[2.0, 10.0, 8.0]);
        // Sums of a few numbers near 20: rounding is far below 1e-9.
        assert!((t.left(0.0) - 20.0).abs() < 1e-9);
        t.begin(1, 2.0);
        assert!((t.left(4.0) - 14.0).abs() < 1e-9);
        assert!((t.share(4.0) - 0.3).abs() < 1e-9);
    }

    #[test]
    fn a_slow_machine_stretches_what_is_to_come() {
        let mut t = of_stages(&[2.0, 10.0, 8.0]);
        t.begin(1, 20.0);
        // Ten times as slow, as far as two seconds can show.
        let left = t.left(0.0);
        assert!((130.0..180.0).contains(&left), "{left}");
    }

    #[test]
    fn a_late_stage_never_says_that_nothing_is_left() {
        let mut t = of_stages(&[2.0, 1.0]);
        t.begin(1, 2.0);
        let mut last = 0.0;
        for late in [10.0, 100.0, 1000.0] {
            let left = t.left(late);
            assert!(left > last && t.share(late) < 1.0, "{late}: {left}");
            last = left;
        }
    }

    #[test]
    fn a_stage_that_is_late_gives_no_time_left() {
        let mut t = of_stages(&[2.0, 1.0, 3.0]);
        t.begin(1, 2.0);
        assert_eq!(t.in_words(0.5), "about 0:04 left");
        assert_eq!(t.in_words(1.6), "longer than expected");
        // A machine half as fast is late later.
        t.begin(1, 4.5);
        assert!(t.in_words(1.6).ends_with("left"));
        assert_eq!(t.in_words(10.0), "longer than expected");
    }

    #[test]
    fn every_stage_of_every_bake_has_a_measured_cost() {
        for method in [Method::Watershed, Method::Bsp, Method::Delaunay] {
            for &stage in method.stages() {
                assert_ne!(cost(stage), [0.005; 2], "{stage:?}");
            }
        }
        let t = TimeLeft::new(Method::Watershed.stages(), 0.0, 0.0);
        assert!(t.left(0.0) > 0.0 && t.left(0.0) < 0.1);
    }

    #[test]
    fn the_announced_time_is_near_the_measured_one_for_few_and_many_triangles() {
        // Millions of voxels, thousands of structural triangles, seconds. The first six were fitted, the others not.
        for (scene, voxels, triangles, seconds) in [
            ("samplehouse4", 1.2, 1.6, 0.30),
            ("fzk-haus", 1.7, 5.3, 1.37),
            ("institute", 16.9, 11.4, 3.87),
            ("smiley-west", 6.4, 11.5, 2.94),
            ("janesville", 75.3, 19.0, 9.67),
            ("clinic", 82.6, 383.1, 42.32),
            ("aws-small-house", 1.5, 0.3, 0.41),
            ("clearpath-office", 5.8, 1.1, 1.12),
            ("duplex", 3.3, 6.1, 1.27),
            ("jasmin-sun", 1.5, 4.1, 0.49),
            ("kit-edc", 13.3, 4.0, 2.75),
            ("procthor4", 26.3, 0.9, 1.58),
            ("sports-hall", 12.1, 11.3, 3.51),
            ("recast-dungeon", 325.6, 10.1, 29.39),
        ] {
            let stages = Method::Watershed.stages();
            let expected: f64 = TimeLeft::new(stages, voxels * 1e6, triangles * 1e3)
                .expected
                .iter()
                .sum();
            let ratio = expected / seconds;
            assert!(
                (0.45..1.9).contains(&ratio),
                "{scene}: {expected:.2} s, {ratio:.2}"
            );
        }
    }

    #[test]
    fn a_line_of_a_log_says_the_stage_and_how_far_it_is() {
        let now = Instant::now();
        let mut state = Clock {
            stages: &[],
            left: of_stages(&[2.0, 10.0, 8.0]),
            began: now,
            stage_began: now,
        };
        assert!(state.line().is_none(), "no method has begun");
        state.stages = Method::Watershed.stages();
        state.left.begin(1, 2.0);
        let line = state.line().unwrap().line;
        let name = Method::Watershed.stages()[1].name();
        let n = Method::Watershed.stages().len();
        assert_eq!(line, format!("2/{n} {name}, 0:00 gone, about 0:18 left"));

        let bar = ProgressBar::hidden();
        assert!(stage_line(&bar).is_none(), "no stage has begun");
        bar.set_length(200);
        bar.set_message("searching");
        bar.set_position(50);
        assert_eq!(stage_line(&bar).unwrap().line, "searching, 25 %, 0:00 gone");
        bar.finish_and_clear();
        assert!(stage_line(&bar).is_none());
    }

    #[test]
    fn clocks_are_short() {
        assert_eq!(clock(0.2), "0:00");
        assert_eq!(clock(65.4), "1:05");
        assert_eq!(clock(3725.0), "1:02:05");
        let words = [0.2, 65.4, 245.0, 9000.0].map(in_words);
        assert_eq!(words, ["less than 1 s", "65 s", "4 min", "3 h"]);
    }
}
