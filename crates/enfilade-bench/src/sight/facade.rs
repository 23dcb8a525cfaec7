//! `bench facade`: views of towers with many windows, with portals in groups and one by one.

use std::time::Instant;

use enfilade::runtime::{Seen, Sight, SightOptions, SightState, View, Viewer};
use enfilade_testkit::{Rng, window_tower};

use crate::measure::quantile;
use crate::table::Table;

/// Draws eye and view direction, for a tower of this many squares a side and storeys.
type Place = fn(&mut Rng, f64, f64) -> ([f64; 3], [f64; 3]);

/// Side of a square of the generated tower. [Units: wu]
const SQUARE: f64 = 3.0;

const PLACES: [(&str, Place); 5] = [
    ("3 m before a facade", |rng, side, high| {
        (
            [rng.range(0.0, side), rng.range(0.0, high), -3.0],
            [rng.range(-0.3, 0.3), 0.0, 1.0],
        )
    }),
    ("the same, turned away", |rng, side, high| {
        (
            [rng.range(0.0, side), rng.range(0.0, high), -3.0],
            [rng.range(-0.3, 0.3), 0.0, -1.0],
        )
    }),
    ("far enough to see all of it", |rng, side, high| {
        let far = 2.0 * side.max(high);
        let angle = rng.range(0.0, std::f64::consts::TAU);
        let toward = [angle.cos(), 0.0, angle.sin()];
        let eye = [0, 2].map(|k| side * 0.5 - toward[k] * (far + side));
        ([eye[0], high * 0.5, eye[1]], toward)
    }),
    ("in a room", |rng, side, high| {
        let eye = [
            rng.range(SQUARE, side - SQUARE),
            rng.range(0.0, high),
            SQUARE * 0.5,
        ];
        (eye, [rng.range(-1.0, 1.0), 0.0, rng.range(-1.0, 1.0)])
    }),
    ("in the core, 2 m from doors", |rng, side, high| {
        let eye = [
            rng.range(SQUARE, side - SQUARE),
            rng.range(0.0, high),
            SQUARE + 2.0,
        ];
        (eye, [rng.range(-0.3, 0.3), 0.0, -1.0])
    }),
];

/// Prints one line per tower and place.
pub(crate) fn bench_facade(
    table: &mut Table,
    windows: &[usize],
    views: usize,
) -> anyhow::Result<()> {
    table.push("| windows | portals | eye | cells seen | clips | one by one, µs | in groups, µs | ratio | p99 one by one | p99 in groups |");
    table.push("| ---: | ---: | --- |".to_owned() + &" ---: |".repeat(7));
    for &n in windows {
        // As many storeys as squares a side, four windows each: n = 4 k².
        let k = ((n as f64 / 4.0).sqrt().round() as usize).max(3);
        let world = window_tower(k, k, false);
        let sights = [0, SightOptions::default().portal_group].map(|portal_group| {
            let options = SightOptions {
                portal_group,
                ..SightOptions::default()
            };
            Sight::build_with(&world, &options)
        });
        let [single, grouped] = sights;
        let sights = [single?, grouped?];
        let mut viewers = [0, 1].map(|i| Viewer::new(&sights[i]));
        let size = k as f64 * SQUARE;
        for (place, draw) in PLACES {
            let mut rng = Rng::new(1);
            let mut times = [Vec::new(), Vec::new()];
            let (mut cells, mut clips) = (0, 0);
            for _ in 0..views {
                let (eye, toward) = draw(&mut rng, size, size);
                let to_f32 = |v: [f64; 3]| v.map(|x| x as f32);
                let view = View::perspective(
                    to_f32(eye),
                    to_f32(toward),
                    [0.0, 1.0, 0.0],
                    1.047,
                    16.0 / 9.0,
                )?;
                for (i, sight) in sights.iter().enumerate() {
                    let (least, seen) = least_time(&mut viewers[i], sight, &view);
                    times[i].push(least);
                    if i == 1 {
                        cells += seen.cells().len();
                        clips += seen.counts().clips;
                    }
                }
            }
            let asked = views as f64;
            let [one, many] = &mut times;
            let (a, b) = (quantile(one, 0.5), quantile(many, 0.5));
            table.push(format!(
                "| {} | {} | {place} | {:.1} | {:.1} | {a:.1} | {b:.1} | {:.2} | {:.1} | {:.1} |",
                4 * k * k,
                world.graph.portals.len(),
                cells as f64 / asked,
                f64::from(clips) / asked,
                b / a,
                quantile(one, 0.99),
                quantile(many, 0.99),
            ));
        }
    }
    Ok(())
}

/// Returns the least time of five equal views, and the answer. [Units: µs]
fn least_time<'v>(viewer: &'v mut Viewer, sight: &Sight, view: &View) -> (f64, Seen<'v>) {
    let state = SightState::new(sight);
    let mut least = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        std::hint::black_box(viewer.see(sight, &state, view));
        least = least.min(start.elapsed().as_secs_f64() * 1e6);
    }
    (least, viewer.see(sight, &state, view))
}
