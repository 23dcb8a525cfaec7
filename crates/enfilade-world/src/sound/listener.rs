//! A pair of ears: searches sequences of openings from it, and adds up what is heard along them.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;
use enfilade_runtime::SightState;

use crate::layout::{Exit, Layout};
use crate::paths::{Corner, End, LengthSearch, Limit, Seen, Sequences};
use crate::sound::route::{Puller, Route, Spot};
use crate::sound::{Acoustics, Heard, N_BANDS};

/// Level below which nothing is heard, relative to that at one meter in the open: sources of 100 dB there, as loud as power tools,
/// are at the threshold of hearing (ISO 389-7). [Units: dB]
const FAINTEST: f64 = -100.0;
/// Share of the energy of the loudest sequence at which others have faded to nothing: all of them together are 0.1 dB at most.
const LEAST: f64 = 1e-3;
/// Greatest rise of a level on the way of a listener or source, ten times what it is mostly: how far a source that is fainter
/// must at least come before it can be heard. [Units: dB/wu]
const STEEPEST: f64 = 100.0;
/// Longest step that counts as one along a way; a longer one may lead anywhere. [Units: wu]
const STRIDE: f64 = 1.0;
/// Sequences of a source that are heard: 24 are more than the doors of most corridors.
const N_HEARD: usize = 24;
/// Those found, as lengths through sample points are a few percent too long, and change until the next search.
const HEARD: Limit = Limit {
    n: N_HEARD + 8,
    longest: [1.0 + FADED[0] + 0.1, FADED[1] + 1.5],
    steps: 1500,
};
/// Length beyond that of the best at which sequences have faded out: as a share of the best, and added. These are mostly more than
/// 10 dB down in rooms. [Units: 1, wu]
const FADED: [f64; 2] = [0.25, 3.0];
/// Sequences of a source that may be the shortest, as lengths through sample points are a few percent too long.
const SHORT: Limit = Limit {
    n: 6,
    longest: [1.1, 1.0],
    steps: 400,
};
/// Sequences are kept until lengths to some places may have changed by as much. [Units: wu]
const KEPT: f64 = 0.25;
/// The same for tolls of doors away from the listener, all together. [Units: wu]
const SWUNG: f64 = 0.5;
/// Length up to which openings are searched at first. [Units: wu]
const FIRST_REACH: f64 = 24.0;
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
    /// The call of [`Listener::listen`] in which they were found, and the length of the best one.
    time: u64,
    best: f64,
    /// From the source to the points of its cell, where it was when these were found.
    lengths: Vec<f64>,
    measured: Option<(CellId, DVec3)>,
    /// The first `n_routes` count.
    routes: Vec<Route>,
    n_routes: usize,
    /// Too faint, from here, until [`Listener::risen`] has reached a value.
    quiet: Option<(Spot, f64)>,
}

impl Source {
    fn routes(&self) -> impl Iterator<Item = &Route> {
        self.routes[..self.n_routes].iter()
    }

    fn routes_mut(&mut self) -> impl Iterator<Item = &mut Route> {
        self.routes[..self.n_routes].iter_mut()
    }

    /// Adds a sequence, with its string if it is known, but not to measure it alone if it is heard. The routes of before are
    /// those from `n_routes` to `n_known`.
    fn add_route(
        &mut self,
        n_known: &mut usize,
        is_heard: bool,
        portals: impl Iterator<Item = (PortalId, DVec3)> + Clone,
    ) {
        let own = portals.clone().map(|p| p.0);
        if !is_heard && self.routes().any(|r| r.portals().eq(own.clone())) {
            return;
        }
        let mut known = self.routes[self.n_routes..*n_known].iter();
        if let Some(i) = known.position(|r| r.portals().eq(own.clone())) {
            self.routes.swap(self.n_routes, self.n_routes + i);
            self.routes[self.n_routes].is_heard = is_heard;
        } else {
            if self.routes.len() == HEARD.n + SHORT.n {
                // The last of before gives up its room.
                *n_known -= usize::from(self.routes.len() == *n_known);
            } else if self.routes.len() == *n_known {
                self.routes.push(Route::default());
            }
            self.routes.swap(self.n_routes, *n_known);
            *n_known += 1;
            self.routes[self.n_routes].begin(is_heard, portals);
        }
        self.n_routes += 1;
    }
}

/// A pair of ears, with reusable buffers: allocates nothing once they have grown.
///
/// Searches sequences again when the listener enters a cell or has moved by a quarter of a meter, and when doors moved; finds
/// more than count, so that it hears what a new listener hears. A string that is too long to matter is not pulled until it may
/// have become shorter, and a source that is too faint to be heard is not asked until it may have become louder.
#[derive(Clone, Debug, Default)]
pub struct Listener {
    search: LengthSearch,
    /// `true` if that is to be done again.
    is_stale: bool,
    /// The search without regard to shut doors.
    shortest: LengthSearch,
    n_searches: u64,
    /// At the last search.
    searched: Option<(CellId, DVec3)>,
    /// From there to the points of its cell.
    lengths: Vec<f64>,
    here: Option<Spot>,
    open: Vec<f64>,
    /// Per portal, the length that it adds when sequences are compared: far from it, from here, and at the last search.
    tolls: Vec<f64>,
    near_tolls: Vec<f64>,
    searched_tolls: Vec<f64>,
    /// Number of calls of [`Listener::listen`].
    time: u64,
    /// Doors that moved after the listener's last search, with the time when they did.
    moved: Vec<(PortalId, u64)>,
    /// How much louder any source may have become since the first position. [Units: dB]
    risen: f64,
    sources: Vec<Source>,
    sequences: Sequences,
    totals: Vec<f64>,
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
        let before = self.here.replace(Spot { cell, at }).filter(|b| {
            let mut exits = acoustics.ways.exits_of(b.cell).iter();
            b.at.distance(at) < STRIDE && (cell == b.cell || exits.any(|e| e.to == cell))
        });
        match before {
            Some(before) => self.risen += STEEPEST * before.at.distance(at),
            None => self.sources.iter_mut().for_each(|s| s.quiet = None),
        }
        let n = acoustics.shut.len();
        for list in [&mut self.tolls, &mut self.near_tolls] {
            list.resize(n, 0.0);
        }
        self.open.resize(n, f64::NAN);
        self.searched_tolls.resize(n, f64::INFINITY);
        self.time += 1;
        let mut swung = 0.0;
        let mut moved = self.searched.map_or(f64::INFINITY, |s| s.1.distance(at));
        for i in 0..n {
            let portal = PortalId(i as u32);
            let open = acoustics.open_share(state, portal);
            if self.open[i] != open {
                self.risen += acoustics.rise(portal, self.open[i], open);
                self.open[i] = open;
                self.tolls[i] = acoustics.toll(state, portal);
            }
            let square = acoustics.bounds[i].distance_squared(at);
            let share = (square / (NEAR * NEAR)).min(1.0).sqrt();
            self.near_tolls[i] = share * self.tolls[i];
            let change = (self.near_tolls[i] - self.searched_tolls[i]).abs();
            if share < 1.0 {
                moved += change;
            } else {
                swung += change;
            }
        }
        if swung > SWUNG {
            self.note_swung();
        }
        if moved < KEPT && self.searched.is_some_and(|s| s.0 == cell) {
            return;
        }
        self.searched = Some((cell, at));
        self.searched_tolls.clone_from(&self.near_tolls);
        self.moved.clear();
        self.is_stale = true;
        self.n_searches += 1;
        let ways = &acoustics.ways;
        lengths_from(acoustics, cell, at, &mut self.lengths);
        let lengths = &self.lengths;
        let first = |place: usize, _| lengths[place];
        self.shortest
            .run_from(ways, cell, at, first, FIRST_REACH, |_| Some(0.0));
    }

    /// Notes which doors have moved, for the sources that may be heard through these.
    fn note_swung(&mut self) {
        let tolls = self.searched_tolls.iter_mut().zip(&self.near_tolls);
        for (i, (searched, toll)) in tolls.enumerate().filter(|(_, (a, b))| a != b) {
            *searched = *toll;
            let portal = PortalId(i as u32);
            match self.moved.iter_mut().find(|m| m.0 == portal) {
                Some(known) => known.1 = self.time,
                None => self.moved.push((portal, self.time)),
            }
        }
        self.is_stale = true;
    }

    /// Searches anew if doors have moved.
    fn search(&mut self, acoustics: &Acoustics) {
        if let Some((cell, at)) = self.searched.filter(|_| self.is_stale) {
            self.is_stale = false;
            let (lengths, tolls) = (&self.lengths, &self.searched_tolls);
            let first = |place: usize, _| lengths[place];
            let pass = |exit: Exit| Some(tolls[exit.portal.idx()]);
            (self.search).run_from(&acoustics.ways, cell, at, first, FIRST_REACH, pass);
        }
    }

    /// Returns `true` if a door that has moved since a source's sequences were found may have changed which ones they are.
    fn is_changed(&self, acoustics: &Acoustics, source: &Source, ends: [Spot; 2]) -> bool {
        let most = source.best * HEARD.longest[0] + HEARD.longest[1];
        let moved = self.moved.iter().filter(|m| m.1 > source.time);
        let mut lengths = moved.map(|(portal, _)| {
            let bounds = &acoustics.bounds[portal.idx()];
            let squares = ends.map(|e| bounds.distance_squared(e.at));
            squares[0].sqrt() + squares[1].sqrt()
        });
        lengths.any(|length| length < most)
    }

    /// Returns the number of searches of sequences, for cost statistics.
    #[must_use]
    pub fn n_searches(&self) -> u64 {
        self.n_searches
    }

    /// Returns a source in `cell` as heard. `id` numbers sources from 0, without large gaps. `None` before the first
    /// [`Listener::listen`], if no path exists, and if it is fainter than 100 dB below its level at a meter. [Units: wu]
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
        let there = Spot { cell, at };
        if let Some(Some((spot, until))) = self.sources.get(id).map(|s| s.quiet) {
            let come = STEEPEST * spot.at.distance(at);
            if spot.cell == cell && self.risen + come < until {
                return None;
            }
        }
        let ends = self.choose_routes(acoustics, id, there)?;
        self.pull_heard(acoustics, layout, id, ends);
        let energy = self.sum_up(acoustics, layout, id, ends);
        let level = energy.map_or(f64::NEG_INFINITY, |h| 20.0 * h.gain.log10());
        let source = &mut self.sources[id];
        if level < FAINTEST {
            source.quiet = Some((there, self.risen + (FAINTEST - level)));
            return None;
        }
        source.quiet = None;
        let (length, nearest) = self.pull_shortest(acoustics, layout, id, ends)?;
        let heard = energy?;
        Some(Heard {
            length,
            nearest,
            direction: heard.direction.normalize_or(nearest),
            ..heard
        })
    }

    /// Returns the length of the shortest path from a source, and the unit vector towards its last bend, zero if the source is at
    /// the listener. As in [`Heard`], but also for sources that are too faint to be heard. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn shortest(
        &mut self,
        acoustics: &Acoustics,
        layout: &Layout,
        id: usize,
        cell: CellId,
        at: DVec3,
    ) -> Option<(f64, DVec3)> {
        let ends = self.choose_routes(acoustics, id, Spot { cell, at })?;
        self.pull_shortest(acoustics, layout, id, ends)
    }

    /// Finds the sequences of a source, unless they are kept. Returns both ends.
    fn choose_routes(
        &mut self,
        acoustics: &Acoustics,
        id: usize,
        there: Spot,
    ) -> Option<[Spot; 2]> {
        let (cell, at) = self.searched?;
        let ends = [self.here?, there];
        if self.sources.len() <= id {
            self.sources.resize_with(id + 1, Source::default);
        }
        let source = &mut self.sources[id];
        let is_near = |p: Spot| p.cell == there.cell && p.at.distance(there.at) < KEPT;
        if source.search == self.n_searches && source.place.is_some_and(is_near) {
            let source = &self.sources[id];
            if !self.is_changed(acoustics, source, ends) {
                return Some(ends);
            }
        }
        self.search(acoustics);
        let source = &mut self.sources[id];
        let (ways, geodesics) = (&acoustics.ways, &acoustics.geodesics);
        if source.measured != Some((there.cell, there.at)) {
            source.measured = Some((there.cell, there.at));
            lengths_from(acoustics, there.cell, there.at, &mut source.lengths);
        }
        let mut direct = f64::INFINITY;
        if there.cell == cell {
            let found = geodesics.way_with(cell, [at, there.at], &mut self.seen, &mut self.bends);
            direct = found.unwrap_or(f64::INFINITY);
        }
        (source.search, source.place, source.time) = (self.n_searches, Some(there), self.time);
        let mut n_known = std::mem::take(&mut source.n_routes);
        let tolls = &self.searched_tolls;
        for (search, limit, is_heard) in [
            (&mut self.search, HEARD, true),
            (&mut self.shortest, SHORT, false),
        ] {
            let [start, end] = [
                (ends[0].cell, at, &self.lengths),
                (there.cell, there.at, &source.lengths),
            ]
            .map(|(cell, at, lengths)| End { cell, at, lengths });
            search.reach(ways, end, direct, limit, |exit| {
                Some(if is_heard {
                    tolls[exit.portal.idx()]
                } else {
                    0.0
                })
            });
            let n = (self.sequences).find(search, ways, [start, end], direct, limit);
            if is_heard {
                source.best = self.sequences.least();
            }
            for found in 0..n {
                source.add_route(&mut n_known, is_heard, self.sequences.portals(found));
            }
        }
        Some(ends)
    }

    /// Pulls the strings that may be heard.
    fn pull_heard(&mut self, acoustics: &Acoustics, layout: &Layout, id: usize, ends: [Spot; 2]) {
        let source = &mut self.sources[id];
        let routes = &mut source.routes[..source.n_routes];
        let n_heard = routes.iter().filter(|r| r.is_heard).count();
        // What was the best comes first, so that others need not be pulled.
        let known = |r: &Route| r.bounds(ends).1 + r.toll(&self.near_tolls);
        let mut most =
            (routes.iter().filter(|r| r.is_heard).map(known)).fold(f64::INFINITY, f64::min);
        for is_first in [true, false] {
            for route in routes.iter_mut().filter(|r| r.is_heard) {
                let toll = route.toll(&self.near_tolls);
                let low = route.bounds(ends).0 + toll;
                let longest = if is_first || n_heard <= N_HEARD && route.quiet > self.risen {
                    most
                } else {
                    (1.0 + FADED[0]) * most + FADED[1]
                };
                if low <= longest {
                    self.puller.pull(acoustics, layout, ends, route);
                    most = most.min(route.length + toll);
                }
            }
        }
    }

    fn pull_shortest(
        &mut self,
        acoustics: &Acoustics,
        layout: &Layout,
        id: usize,
        ends: [Spot; 2],
    ) -> Option<(f64, DVec3)> {
        let source = &mut self.sources[id];
        let mut best = None;
        for route in &mut source.routes[..source.n_routes] {
            let least = best.map_or(f64::INFINITY, |b: (f64, DVec3)| b.0);
            if route.bounds(ends).0 < least {
                self.puller.pull(acoustics, layout, ends, route);
                if route.length < least {
                    best = Some((route.length, route.toward));
                }
            }
        }
        best
    }

    /// Adds up what is heard along the sequences of a source.
    fn sum_up(
        &mut self,
        acoustics: &Acoustics,
        layout: &Layout,
        id: usize,
        ends: [Spot; 2],
    ) -> Option<Heard> {
        let source = &mut self.sources[id];
        let tolls = &self.near_tolls;
        let is_pulled = |r: &Route| r.is_heard && r.is_pulled_for(ends);
        self.totals.clear();
        let totals = source.routes().filter(|r| is_pulled(r));
        self.totals.extend(totals.map(|r| r.length + r.toll(tolls)));
        let totals = &mut self.totals;
        let best = totals.iter().copied().reduce(f64::min)?;
        let mut cut = FADED[0] * best + FADED[1];
        if totals.len() > N_HEARD {
            // The first that is not counted ends the fading.
            let (_, next, _) = totals.select_nth_unstable_by(N_HEARD, f64::total_cmp);
            cut = cut.min(*next - best);
        }
        // What is too faint in any case is not evaluated.
        let mut loudest: f64 = 0.0;
        for route in source.routes_mut().filter(|r| is_pulled(r)) {
            let total = route.length + route.toll(tolls);
            // A tie of more sequences than are counted has no room to fade.
            let fade = if cut > 0.0 {
                ((best + cut - total) / cut).clamp(0.0, 1.0)
            } else {
                1.0
            };
            route.fade = fade;
            if fade > 0.0 && route.quiet <= self.risen {
                route.energy = (self.puller).energy(acoustics, layout, ends, &self.open, route);
                loudest = loudest.max(fade * route.energy.iter().sum::<f64>());
            }
        }
        let mut heard = Heard::default();
        let mut energy = [0.0; N_BANDS];
        for route in source.routes_mut().filter(|r| is_pulled(r)) {
            if route.fade == 0.0 || route.quiet > self.risen {
                continue;
            }
            let loudness = route.energy.iter().sum::<f64>();
            let excess = route.fade * loudness - LEAST * loudest;
            if loudness < LEAST * loudest {
                // Both may change.
                let faint = 10.0 * (LEAST * loudest / loudness).log10();
                route.quiet = self.risen + 0.5 * faint;
            }
            if excess <= 0.0 {
                continue;
            }
            let share = excess / loudness;
            for (sum, gain) in energy.iter_mut().zip(route.energy) {
                *sum += share * gain;
            }
            heard.direction += route.arrival * excess;
            heard.n_ways += 1;
        }
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
