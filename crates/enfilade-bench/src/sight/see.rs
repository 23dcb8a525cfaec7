//! `bench see`, `tight`, `maze` and `los`: the tables of `docs/benchmarks/sight.md`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use enfilade::cpg::{Cell, CellId};
use enfilade::runtime::{
    Narrowing, SeeOptions, Sight, SightOptions, SightState, Sightlines, View, Viewer,
};
use enfilade_cli::answers::Answers;
use enfilade_cli::world::read_world;
use enfilade_render::walk;
use enfilade_testkit::{Rng, courtyard};
use enfilade_verify::{ViewOptions, ViewReport, verify_views};

use super::subject::{Eyes, Subject, draw_view, subjects};
use crate::measure::quantile;
use crate::table::Table;

const MODES: [(&str, Narrowing); 3] = [
    ("rectangle", Narrowing::Rectangle),
    ("polygon", Narrowing::Polygon),
    ("8 edges", Narrowing::PolygonOf(8)),
];

pub(crate) fn bench_see(
    table: &mut Table,
    scenes: &[PathBuf],
    rooms: &[usize],
    views: usize,
) -> anyhow::Result<()> {
    let mut all = subjects(scenes, rooms)?;
    if scenes.is_empty() {
        for (label, one_room) in [("64 rooms", false), ("a ring", true)] {
            all.push(Subject {
                name: format!("courtyard, 64 windows of {label}"),
                world: courtyard(16, one_room),
                eyes: Eyes::Located,
            });
        }
    }
    table.push("| scene | cells | portals | narrowed by | warm µs | cold µs | p99 µs | worst µs | visits | cells seen | clips | most clips | triangles |");
    table.push("| --- | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for subject in &all {
        let sight = Sight::build(&subject.world).with_context(|| subject.name.clone())?;
        let state = SightState::new(&sight);
        let mut rng = Rng::new(1);
        let mut drawn = Vec::new();
        for _ in 0..views {
            drawn.extend(draw_view(&mut rng, subject, &sight)?);
        }
        for (mode, narrowing) in MODES {
            let options = SeeOptions {
                narrowing,
                ..SeeOptions::default()
            };
            let mut viewer = Viewer::with_options(&sight, options);
            let mut ask = |view: &View, cell: CellId| {
                let start = Instant::now();
                let seen = match subject.eyes {
                    Eyes::Located => viewer.see(&sight, &state, view),
                    Eyes::Known(_) => viewer.see_from(&sight, &state, view, cell),
                };
                let seconds = start.elapsed().as_secs_f64() * 1e6;
                let counts = seen.counts();
                let n = [
                    seen.visits().len() as f64,
                    seen.cells().len() as f64,
                    f64::from(counts.clips),
                    seen.n_triangles() as f64,
                ];
                (seconds, n)
            };
            // Once to grow the buffers.
            for (view, cell) in &drawn {
                ask(view, *cell);
            }
            let (mut cold, mut warm, mut sums, mut most) = (Vec::new(), Vec::new(), [0.0; 4], 0.0);
            for (view, cell) in &drawn {
                let (first, n) = ask(view, *cell);
                cold.push(first);
                // The fastest of five, as when the same place is viewed frame after frame.
                let least = (0..5).fold(f64::INFINITY, |t, _| t.min(ask(view, *cell).0));
                warm.push(least);
                for k in 0..4 {
                    sums[k] += n[k] / drawn.len() as f64;
                }
                most = f64::max(most, n[2]);
            }
            table.push(format!(
                "| {} | {} | {} | {mode} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {:.1} | {most} | {:.0} |",
                subject.name,
                sight.n_cells(),
                sight.n_portals(),
                quantile(&mut warm, 0.5),
                quantile(&mut cold, 0.5),
                quantile(&mut warm, 0.99),
                quantile(&mut warm, 1.0),
                sums[0],
                sums[1],
                sums[2],
                sums[3],
            ));
        }
    }
    Ok(())
}

pub(crate) fn bench_tight(
    table: &mut Table,
    scenes: &[PathBuf],
    views: u64,
    rays: u64,
) -> anyhow::Result<()> {
    table.push(
        "| scene | narrowed by | triangles ÷ hit | details ÷ hit | cells ÷ reached | missed |",
    );
    table.push("| --- | --- | ---: | ---: | ---: | ---: |");
    for subject in subjects(scenes, &[])? {
        let sight = Sight::build(&subject.world).with_context(|| subject.name.clone())?;
        let answers = Answers::new(&subject.world, &sight);
        let modes = MODES
            .iter()
            .map(|&(mode, narrowing)| {
                let options = SeeOptions {
                    narrowing,
                    ..SeeOptions::default()
                };
                (mode, Some(options))
            })
            .chain([("view frustum alone", None)]);
        for (mode, options) in modes {
            let asked = ViewOptions {
                views,
                rays_per_view: rays,
                ordinary: true,
                ..ViewOptions::default()
            };
            let report: ViewReport = verify_views(
                &subject.world,
                &asked,
                &|| answers.seer(options),
                &|_, _| (),
            );
            let ratio = |k: usize| match report.hit[k] {
                0 => "-".to_owned(),
                hit => format!("{:.2}", report.answered[k] as f64 / hit as f64),
            };
            table.push(format!(
                "| {} | {mode} | {} | {} | {} | {} |",
                subject.name,
                ratio(0),
                ratio(1),
                ratio(2),
                report.missed
            ));
        }
    }
    Ok(())
}

pub(crate) fn bench_maze(
    table: &mut Table,
    path: &Path,
    views: usize,
    fov: f32,
    chunk: usize,
) -> anyhow::Result<()> {
    let world = read_world(path)?;
    let options = SightOptions {
        chunk_triangles: chunk,
        ..SightOptions::default()
    };
    let sight = Sight::build_with(&world, &options)?;
    let state = SightState::new(&sight);
    let steps = walk(&world, &sight, views);
    let all = sight.n_triangles() as f64;
    table.push(format!(
        "{} views of {fov} degrees on a path, chunks of {chunk}; {} cells, {} portals, {} triangles.",
        steps.len(),
        sight.n_cells(),
        sight.n_portals(),
        all
    ));
    table.push(String::new());
    table.push("| processed | least | mean | most |");
    table.push("| --- | ---: | ---: | ---: |");
    let modes = [("view frustum alone", None)]
        .into_iter()
        .chain(MODES.map(|(mode, narrowing)| (mode, Some(narrowing))));
    for (mode, narrowing) in modes {
        let mut viewer = Viewer::new(&sight);
        if let Some(narrowing) = narrowing {
            viewer.options_mut().narrowing = narrowing;
        }
        let mut shares = Vec::new();
        for &(eye, toward) in &steps {
            let view =
                View::perspective(eye, toward, [0.0, 1.0, 0.0], fov.to_radians(), 4.0 / 3.0)?;
            let seen = match narrowing {
                None => viewer.see_through_walls(&sight, &view),
                Some(_) => viewer.see(&sight, &state, &view),
            };
            shares.push(seen.n_triangles() as f64 / all * 100.0);
        }
        let mean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
        let label = narrowing.map_or(mode.to_owned(), |_| format!("portals, by {mode}"));
        table.push(format!(
            "| {label} | {:.2} % | {mean:.2} % | {:.2} % |",
            quantile(&mut shares, 0.0),
            quantile(&mut shares, 1.0)
        ));
    }
    Ok(())
}

pub(crate) fn bench_los(
    table: &mut Table,
    scenes: &[PathBuf],
    rooms: &[usize],
    pairs: usize,
) -> anyhow::Result<()> {
    table.push("| scene | triangles | pairs | hit | differ | by cells | ns by cells | ns by one tree | ratio |");
    table.push("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for subject in subjects(scenes, rooms)? {
        let world = &subject.world;
        let lines = Sightlines::build(world);
        let mut rng = Rng::new(3);
        let cells: Vec<&Cell> = world.graph.cells.iter().filter(|c| !c.outdoor).collect();
        let mut point = || {
            let b = cells[rng.below(cells.len())].aabb;
            [0, 1, 2].map(|k| b[0][k] + (b[1][k] - b[0][k]) * rng.unit() as f32)
        };
        let segments: Vec<_> = (0..pairs).map(|_| (point(), point())).collect();
        let start = Instant::now();
        let by_cells: Vec<_> = segments
            .iter()
            .map(|(a, b)| lines.first_hit_by_cells(*a, *b))
            .collect();
        let cells_ns = start.elapsed().as_secs_f64() * 1e9 / pairs.max(1) as f64;
        let start = Instant::now();
        let whole: Vec<_> = segments
            .iter()
            .map(|(a, b)| lines.first_hit(*a, *b))
            .collect();
        let whole_ns = start.elapsed().as_secs_f64() * 1e9 / pairs.max(1) as f64;
        let same =
            |a: &Option<enfilade::internals::runtime::SightHit>,
             b: &Option<enfilade::internals::runtime::SightHit>| match (a, b) {
                (Some(a), Some(b)) => {
                    (a.t, a.batch, a.triangle, a.front) == (b.t, b.batch, b.triangle, b.front)
                }
                (a, b) => a.is_none() && b.is_none(),
            };
        let differ = by_cells
            .iter()
            .zip(&whole)
            .filter(|(a, b)| !same(a, b))
            .count();
        let hit = whole.iter().flatten().count();
        let walked = by_cells
            .iter()
            .flatten()
            .filter(|h| h.cell.is_some())
            .count();
        let n_triangles: usize = world
            .batches
            .iter()
            .map(|b| b.primitive.indices.len() / 3)
            .sum();
        table.push(format!(
            "| {} | {n_triangles} | {pairs} | {hit} | {differ} | {:.1} % | {cells_ns:.0} | {whole_ns:.0} | {:.2} |",
            subject.name,
            walked as f64 / hit.max(1) as f64 * 100.0,
            whole_ns / cells_ns
        ));
    }
    Ok(())
}
