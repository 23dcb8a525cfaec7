//! Sound through portals: lengths, directions, doorways, cost.

use std::time::Instant;

use anyhow::Context;
use enfilade::geom::DVec3;
use enfilade::internals::world::TautString;
use enfilade::world::{
    Acoustics, Agent, DecayLaw, DiffuseFields, Layout, Listener, PartId, Path, PathSearch, Place,
    Reverb, Space, Transmission, WalkMap,
};
use enfilade::{CellId, PortalId, World};
use enfilade_testkit::{GridParams, Rng, room_grid};

use crate::rows::Figure;

fn office_grid(n: usize, seed: u64) -> World {
    room_grid(&GridParams {
        outdoors: false,
        windows: 0.0,
        furniture: 0,
        doors: 0.7,
        ..GridParams::offices(n, seed)
    })
}

pub(super) struct Office {
    pub(super) space: Space,
    pub(super) acoustics: Acoustics,
}

impl Office {
    pub(super) fn new(world: &World) -> anyhow::Result<Self> {
        let space = Space::new(world.clone())?;
        let acoustics = Acoustics::new(&space, &Transmission::default());
        Ok(Self { space, acoustics })
    }

    pub(super) fn layout(&self) -> &Layout {
        self.space.layout(PartId::ROOT)
    }

    pub(super) fn offices(n: usize, seed: u64) -> anyhow::Result<Self> {
        Self::new(&office_grid(n, seed))
    }

    /// Opens all that can be opened.
    pub(super) fn open_all(&mut self) {
        for portal in (0..self.layout().n_portals() as u32).map(PortalId) {
            self.space.open(PartId::ROOT, portal);
            self.space.set_leaves(PartId::ROOT, portal, 1.0);
        }
    }

    pub(super) fn locate(&self, at: DVec3) -> Option<Place> {
        self.space.locate(PartId::ROOT, at)
    }

    pub(super) fn place(&self, rng: &mut Rng) -> Option<(Place, DVec3)> {
        let indoors = |c: &CellId| !self.layout().cell(*c).is_outdoor;
        (0..10_000).find_map(|_| {
            let cell = CellId(rng.below(self.layout().n_cells()) as u32);
            let bounds = self.layout().cell(cell).bounds;
            let share = DVec3::from([0; 3].map(|_| rng.range(0.05, 0.95)));
            let at = bounds.min + (bounds.max - bounds.min) * share;
            let place = self.locate(at)?;
            Some((place, at)).filter(|_| indoors(&cell) && place.cell == cell)
        })
    }
}

/// Returns the worst length relative to the least over all sequences of at most 8 portals, and the worst angle of
/// arrival.
fn worst(name: &str) -> anyhow::Result<(f64, f64, usize)> {
    let n_seeds = if name == "offices-16" { 20 } else { 5 };
    let (mut length, mut angle, mut n): (f64, f64, usize) = (0.0, 0.0, 0);
    let mut rng = Rng::new(4);
    for seed in 0..n_seeds {
        let site = Office::offices(16, seed)?;
        for _ in 0..25 {
            let from = site.place(&mut rng).context("no place")?;
            let to = site.place(&mut rng).context("no place")?;
            let mut ears = Listener::new();
            ears.listen(&site.acoustics, &site.space, from.0, from.1);
            let found = ears.shortest(&site.acoustics, 0, to.0, to.1);
            let Some((found, nearest)) = found else {
                continue;
            };
            let mut best = LeastWay {
                length: f64::INFINITY,
                departure: DVec3::ZERO,
            };
            let mut string = TautString::new();
            least(
                site.layout(),
                from.0.cell,
                from.1,
                &Goal {
                    cell: to.0.cell,
                    at: to.1,
                },
                &mut Vec::new(),
                &mut string,
                &mut best,
            );
            if best.length < f64::INFINITY {
                n += 1;
                length = length.max(found / best.length);
                angle = angle.max(nearest.angle_between(best.departure).to_degrees());
            }
        }
    }
    Ok((length, angle, n))
}

/// The end of a way.
struct Goal {
    cell: CellId,
    at: DVec3,
}

/// The least length found, and the direction in which its string departs.
struct LeastWay {
    length: f64,
    departure: DVec3,
}

/// Searches all sequences, bounded by the string through the portals so far, which tests compare with `clarabel`.
fn least(
    layout: &Layout,
    cell: CellId,
    from: DVec3,
    to: &Goal,
    chain: &mut Vec<PortalId>,
    string: &mut TautString,
    best: &mut LeastWay,
) {
    let length = string.pull(from, to.at, chain.len(), |i| {
        layout.opening(chain[i]).pieces()
    });
    if string.bound() >= best.length {
        return;
    }
    if cell == to.cell && length < best.length {
        *best = LeastWay {
            length,
            departure: string.departure(),
        };
    }
    if chain.len() == 8 {
        return;
    }
    for exit in layout.exits(cell) {
        if !chain.contains(&exit.portal) {
            chain.push(exit.portal);
            least(layout, exit.to, from, to, chain, string, best);
            chain.pop();
        }
    }
}

pub(super) fn length(name: &str) -> anyhow::Result<Figure> {
    let (value, _, n) = worst(name)?;
    let note =
        format!("the worst of {n} pairs, by the least over all sequences of up to 8 portals");
    Ok(Figure::new(value, 1.001, note))
}

pub(super) fn direction(name: &str) -> anyhow::Result<Figure> {
    let (_, value, n) = worst(name)?;
    Ok(Figure::new(
        value,
        1.0,
        format!("degrees, the worst of {n} pairs"),
    ))
}

/// Compares levels of coupled rooms with the closed-form balance of energy: worst relative error.
pub(super) fn reverb(_: &str) -> anyhow::Result<Figure> {
    let space = Space::new(room_grid(&GridParams::two_rooms()))?;
    let door = space.layout(PartId::ROOT).opening(PortalId(0)).area();
    let mut rng = Rng::new(2);
    let at = |cell: u32| Place {
        part: PartId::ROOT,
        cell: CellId(cell),
    };
    let mut fields = DiffuseFields::new();
    let mut value: f64 = 0.0;
    for _ in 0..1000 {
        let room = [0; 2].map(|_| {
            (
                rng.range(20.0, 400.0),
                rng.range(60.0, 400.0),
                rng.range(0.02, 0.5),
            )
        });
        let reverb = Reverb::of_rooms(&space, DecayLaw::Sabine, &room);
        let share = rng.unit();
        fields.solve(&reverb, &space, at(0), |_, _| share);
        let s = door * share;
        let [m, n] = room.map(|r| r.1 * r.2 + s);
        let det = m * n - s * s;
        let w = [n / det, s / det];
        let off = [0, 1].map(|k| fields.density(at(k)) / w[k as usize]);
        value = off.iter().fold(value, |most, x| most.max((x - 1.0).abs()));
    }
    let note = "1,000 pairs of rooms, levels in both, against the balance of energy in closed form";
    Ok(Figure::new(value, 0.1, note))
}

/// Sources of a walk.
const N_SOURCES: usize = 64;
/// Frames of a walk: half a minute at 60 Hz.
const N_FRAMES: usize = 1800;
/// Way of a walker in a frame. [Units: wu]
const PACE: f64 = 1.4 / 60.0;

/// Measures the time of a source and frame on a walk through a building, its doors open: the mean of all frames. [Units: µs]
pub(super) fn mean_cost(world: &World) -> anyhow::Result<Figure> {
    let (micros, note) = walked(world)?;
    let mean = micros.iter().sum::<f64>() / micros.len() as f64;
    Ok(Figure::new(mean, 20.0, note))
}

/// As [`mean_cost`], the 99th percentile.
pub(super) fn most_cost(world: &World) -> anyhow::Result<Figure> {
    let (mut micros, note) = walked(world)?;
    micros.sort_by(f64::total_cmp);
    Ok(Figure::new(micros[micros.len() * 99 / 100], 60.0, note))
}

/// Walks from room to room; returns the time of a source in each frame, the first included. [Units: µs]
fn walked(world: &World) -> anyhow::Result<(Vec<f64>, String)> {
    let mut site = Office::new(world)?;
    site.open_all();
    let mut rng = Rng::new(3);
    let sources: Vec<_> = (0..N_SOURCES)
        .filter_map(|_| site.place(&mut rng))
        .collect();
    let map = WalkMap::new(&site.space, Agent::default());
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let mut ears = Listener::new();
    let (mut micros, mut n_heard) = (Vec::new(), 0);
    let mut from = site.place(&mut rng).context("no place")?.1;
    for _ in 0..1000 {
        let to = site.place(&mut rng).context("no place")?.1;
        let ends = [(PartId::ROOT, from), (PartId::ROOT, to)];
        if (search.find(&map, &site.space, ends, |_, _| true, &mut path)).is_err() {
            from = to;
            continue;
        }
        let up = DVec3::Y * Agent::default().eye;
        for leg in path.points.windows(2) {
            let [a, b] = [leg[0].at + up, leg[1].at + up];
            let n = (a.distance(b) / PACE).ceil() as usize;
            for k in 0..n {
                let at = a.lerp(b, k as f64 / n as f64);
                let Some(place) = site.locate(at) else {
                    continue;
                };
                let start = Instant::now();
                ears.listen(&site.acoustics, &site.space, place, at);
                for (id, source) in sources.iter().enumerate() {
                    let heard = ears.hear(&site.acoustics, id, source.0, source.1);
                    n_heard += usize::from(std::hint::black_box(heard).is_some());
                }
                micros.push(start.elapsed().as_secs_f64() * 1e6 / sources.len() as f64);
            }
        }
        if micros.len() >= N_FRAMES {
            break;
        }
        from = to;
    }
    anyhow::ensure!(!micros.is_empty(), "no two places with a path between them");
    let share = n_heard as f64 / (micros.len() * sources.len()) as f64;
    let note = format!(
        "{} frames, {} searches, {:.0} of {} sources heard on the mean",
        micros.len(),
        ears.n_searches(),
        share * sources.len() as f64,
        sources.len()
    );
    Ok((micros, note))
}
