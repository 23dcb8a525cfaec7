//! A pair of ears: searches sequences of openings from it, and adds up what is heard along them.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;
use enfilade_runtime::SightState;

use crate::layout::Layout;
use crate::paths::{Corner, End, LengthSearch, Limit, Seen, Sequences};
use crate::sound::route::{Gate, Puller, Route, Spot};
use crate::sound::{Acoustics, Heard, N_BANDS};

/// Sequences of a source that are heard. Longer ones by half, and by 5 m, count, as these are mostly more than 10 dB down in rooms;
/// 24 are more than the doors of most corridors.
const HEARD: Limit = Limit {
    n: 24,
    // A little more than fades to nothing, as lengths through sample points are a few percent too long.
    longest: [1.55, 5.5],
    steps: 1500,
};
/// Length beyond that of the best at which sequences have faded out: as a share of the best, and added. [Units: 1, wu]
const FADED: [f64; 2] = [0.5, 5.0];
/// Sequences of a source that may be the shortest, as lengths through sample points are a few percent too long.
const SHORT: Limit = Limit {
    n: 6,
    longest: [1.1, 0.5],
    steps: 400,
};
/// Share of the energy below which a sequence is dropped until the next search: 24 of them are 0.1 dB at most.
const LEAST: f64 = 1e-3;
/// A listener or source that has moved by less keeps its sequences. [Units: wu]
const KEPT: f64 = 0.25;
/// Distance from an opening within which its toll fades to nothing, so that it does not matter on which side of it one is.
/// [Units: wu]
const NEAR: f64 = 2.0;

/// Greatest distance of a point of an opening from those at which searches cross it. [Units: wu]
const APART: f64 = 0.71;

#[derive(Clone, Debug, Default)]
struct Source {
    /// The search that found the routes.
    search: u64,
    place: Option<Spot>,
    /// From the source to the points of its cell, where it was when these were found.
    lengths: Vec<f64>,
    measured: Option<(CellId, DVec3)>,
    /// The first `n_routes` count.
    routes: Vec<Route>,
    n_routes: usize,
    /// Length beyond that of the best at which sequences have faded out. [Units: wu]
    cut: f64,
}

impl Source {
    fn routes(&self) -> impl Iterator<Item = &Route> {
        self.routes[..self.n_routes]
            .iter()
            .filter(|r| !r.is_dropped)
    }

    fn routes_mut(&mut self) -> impl Iterator<Item = &mut Route> {
        let routes = self.routes[..self.n_routes].iter_mut();
        routes.filter(|r| !r.is_dropped)
    }

    /// Drops sequences that need not be pulled again until the next search.
    fn drop_faint(&mut self, least: f64) {
        let lengths = self.routes().map(|r| r.length);
        let shortest = lengths.fold(f64::INFINITY, f64::min);
        for r in self.routes_mut() {
            r.is_dropped = if r.is_heard {
                r.loudness < least
            } else {
                r.length > shortest + KEPT
            };
        }
    }

    fn add_route(&mut self, is_heard: bool, portals: impl Iterator<Item = (PortalId, DVec3)>) {
        if self.routes.len() == self.n_routes {
            self.routes.push(Route::default());
        }
        let route = &mut self.routes[self.n_routes];
        self.n_routes += 1;
        route.reset(is_heard);
        for (portal, point) in portals {
            route.gates.push(Gate::Portal(portal));
            route.points.push(point);
        }
    }
}

/// A pair of ears, with reusable buffers: allocates nothing once they have grown.
///
/// Searches sequences again when the listener enters a cell or has moved by a quarter of a meter, and when doors moved; pulls
/// strings at each query. What it hears differs from what a new listener hears by 0.3 dB, 1° and a millimeter at most in offices.
#[derive(Clone, Debug, Default)]
pub struct Listener {
    search: LengthSearch,
    /// The search without regard to shut doors.
    shortest: LengthSearch,
    n_searches: u64,
    /// At the last search.
    searched: Option<(CellId, DVec3)>,
    /// From there to the points of its cell.
    lengths: Vec<f64>,
    at: DVec3,
    open: Vec<f64>,
    /// Per portal, the length that it adds when sequences are compared: far from it, and from here.
    tolls: Vec<f64>,
    near_tolls: Vec<f64>,
    sources: Vec<Source>,
    sequences: Sequences,
    puller: Puller,
    seen: Seen,
    bends: Vec<Corner>,
}

impl Listener {
    /// Makes it without buffers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the position of the ears, in `cell`, and the state of doors. O(portals), plus an occasional search. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn listen(&mut self, acoustics: &Acoustics, state: &SightState, cell: CellId, at: DVec3) {
        self.at = at;
        let n = acoustics.shut.len();
        let mut is_same = self.open.len() == n;
        self.open.resize(n, f64::NAN);
        self.tolls.resize(n, 0.0);
        self.near_tolls.resize(n, 0.0);
        for i in 0..n {
            let portal = PortalId(i as u32);
            let open = acoustics.open_share(state, portal);
            if self.open[i] != open {
                is_same = false;
                self.open[i] = open;
                self.tolls[i] = acoustics.toll(state, portal);
            }
            let square = acoustics.bounds[i].distance_squared(at);
            let share = (square / (NEAR * NEAR)).min(1.0).sqrt();
            self.near_tolls[i] = share * self.tolls[i];
        }
        let is_near = |(c, p): (CellId, DVec3)| c == cell && p.distance(at) < KEPT;
        if is_same && self.searched.is_some_and(is_near) {
            return;
        }
        self.searched = Some((cell, at));
        self.n_searches += 1;
        let ways = &acoustics.ways;
        lengths_from(acoustics, cell, at, &mut self.lengths);
        let lengths = &self.lengths;
        let first = |place: usize, _| lengths[place];
        let tolls = &self.near_tolls;
        self.search
            .run_from(ways, cell, at, first, f64::INFINITY, |exit| {
                Some(tolls[exit.portal.idx()])
            });
        self.shortest
            .run_from(ways, cell, at, first, f64::INFINITY, |_| Some(0.0));
    }

    /// Returns the number of searches of sequences, for cost statistics.
    #[must_use]
    pub fn n_searches(&self) -> u64 {
        self.n_searches
    }

    /// Returns a source in `cell` as heard. `id` numbers sources from 0, without large gaps. `None` before the first
    /// [`Listener::listen`], and if no path exists. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn hear(
        &mut self,
        acoustics: &Acoustics,
        layout: &Layout,
        id: usize,
        cell: CellId,
        at: DVec3,
    ) -> Option<Heard> {
        let here = Spot {
            cell: self.searched?.0,
            at: self.at,
        };
        let there = Spot { cell, at };
        if self.sources.len() <= id {
            self.sources.resize_with(id + 1, Source::default);
        }
        let source = &self.sources[id];
        let is_near = |p: Spot| p.cell == cell && p.at.distance(at) < KEPT;
        let is_kept = source.search == self.n_searches && source.place.is_some_and(is_near);
        if !is_kept {
            self.choose_routes(acoustics, id, there);
        }
        let source = &mut self.sources[id];
        for route in source.routes_mut() {
            self.puller.pull(acoustics, layout, [here, there], route);
        }
        let heard = self.sum_up(acoustics, layout, id, [here, there]);
        if !is_kept {
            let loudest = heard.map_or(0.0, |h| h.gain * h.gain) * N_BANDS as f64;
            self.sources[id].drop_faint(LEAST * loudest);
        }
        heard
    }

    fn choose_routes(&mut self, acoustics: &Acoustics, id: usize, there: Spot) {
        let Some((cell, at)) = self.searched else {
            return;
        };
        let (ways, geodesics) = (&acoustics.ways, &acoustics.geodesics);
        let source = &mut self.sources[id];
        if source.measured != Some((there.cell, there.at)) {
            source.measured = Some((there.cell, there.at));
            lengths_from(acoustics, there.cell, there.at, &mut source.lengths);
        }
        let mut direct = f64::INFINITY;
        if there.cell == cell {
            let found = geodesics.way_with(cell, [at, there.at], &mut self.seen, &mut self.bends);
            direct = found.unwrap_or(f64::INFINITY);
        }
        (source.search, source.place) = (self.n_searches, Some(there));
        source.n_routes = 0;
        for (search, limit, is_heard) in
            [(&self.search, HEARD, true), (&self.shortest, SHORT, false)]
        {
            let start = End {
                cell,
                at,
                lengths: &self.lengths,
            };
            let end = End {
                cell: there.cell,
                at: there.at,
                lengths: &source.lengths,
            };
            let n = (self.sequences).find(search, ways, [start, end], direct, limit);
            for found in 0..n {
                source.add_route(is_heard, self.sequences.portals(found));
            }
            if is_heard {
                source.cut = self.sequences.reach() - self.sequences.least();
            }
        }
    }

    fn sum_up(
        &mut self,
        acoustics: &Acoustics,
        layout: &Layout,
        id: usize,
        ends: [Spot; 2],
    ) -> Option<Heard> {
        let source = &mut self.sources[id];
        let tolls = &self.near_tolls;
        let total = |route: &Route| {
            let own = route.portals().map(|p| tolls[p.idx()]);
            route.length + own.sum::<f64>()
        };
        let shortest = (source.routes()).min_by(|a, b| a.length.total_cmp(&b.length))?;
        let mut heard = Heard {
            length: shortest.length,
            nearest: shortest.toward,
            ..Heard::default()
        };
        let best = (source.routes().filter(|r| r.is_heard))
            .map(total)
            .fold(f64::INFINITY, f64::min);
        let cut = source.cut.min(FADED[0] * best + FADED[1]);
        let mut energy = [0.0; N_BANDS];
        for route in source.routes_mut().filter(|r| r.is_heard) {
            // A tie of more sequences than are counted has no room to fade.
            let fade = if cut > 0.0 {
                ((best + cut - total(route)) / cut).clamp(0.0, 1.0)
            } else {
                1.0
            };
            route.loudness = 0.0;
            if fade > 0.0 {
                let gains = (self.puller).energy(acoustics, layout, ends, &self.open, route);
                for (sum, gain) in energy.iter_mut().zip(gains) {
                    *sum += fade * gain;
                    route.loudness += fade * gain;
                }
            }
            heard.direction += route.arrival * route.loudness;
            heard.n_ways += 1;
        }
        heard.direction = heard.direction.normalize_or(heard.nearest);
        heard.gain = (energy.iter().sum::<f64>() / N_BANDS as f64).sqrt();
        heard.bands = energy.map(f64::sqrt);
        Some(heard)
    }
}

/// Writes the lengths from a place to the points of its cell. Openings close by are crossed at any point of them, not only at those,
/// which are a meter apart: less than the distance from the opening to the nearest of them, so that sequences through an
/// opening in which one stands do not seem longer than others.
fn lengths_from(acoustics: &Acoustics, cell: CellId, at: DVec3, lengths: &mut Vec<f64>) {
    let ways = &acoustics.ways;
    (acoustics.geodesics).lengths_from(ways, cell, at, lengths);
    for exit in ways.exits_of(cell) {
        let distance = acoustics.bounds[exit.portal.idx()]
            .distance_squared(at)
            .sqrt();
        if distance >= NEAR {
            continue;
        }
        let own = &mut lengths[ways.places(exit.portal, cell)];
        let nearest = own.iter().copied().fold(f64::INFINITY, f64::min);
        let extra = (nearest - distance).clamp(0.0, APART) * (1.0 - distance / NEAR);
        own.iter_mut().for_each(|length| *length -= extra);
    }
}
