//! A pair of ears: searches sequences of openings from it, and adds up what is heard along them.

use std::sync::Arc;

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use crate::layout::LayoutExit;
use crate::paths::{Corner, End, LengthSearch, Limit, Seen, Sequences};
use crate::sound::acoustics::{Acoustics, Heard, rise, toll};
use crate::sound::bands::N_BANDS;
use crate::sound::graph::SoundGraph;
use crate::sound::route::{Puller, Route, Spot};
use crate::sound::starts::{NEAR, lengths_from, spot};
use crate::space::{Place, Space};

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
    /// All parts as they stand, and the acoustics for which they are.
    graph: Option<Arc<SoundGraph>>,
    of: Option<Arc<SoundGraph>>,
    /// The last change of the space that it knows.
    known: Option<u64>,
    moved_parts: Vec<bool>,
    /// The place of the ears.
    place: Option<Place>,
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
    /// Per portal, its clear share, and what the rest lets through.
    gates: Vec<(f64, f64)>,
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

    /// Sets the position of the ears, in the frame of their place's part, and takes over the state of doors and parts. O(portals),
    /// plus an occasional search; allocates when parts have moved. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn listen(&mut self, acoustics: &Acoustics, space: &Space, place: Place, at: DVec3) {
        self.update(acoustics, space);
        let graph = self.graph.clone();
        let is_known = place.part.idx() < acoustics.parts.len();
        let Some(graph) = graph.filter(|_| is_known) else {
            (self.here, self.searched) = (None, None);
            return;
        };
        self.place = Some(place);
        let (cell, at) = (graph.joined.cell(place), graph.to_root(place.part, at));
        self.listen_at(acoustics, space, &graph, Spot { cell, at });
    }

    /// Takes over the poses of parts that have moved.
    fn update(&mut self, acoustics: &Acoustics, space: &Space) {
        let known = self.of.as_ref();
        let is_new = !known.is_some_and(|of| Arc::ptr_eq(of, &acoustics.graph));
        if is_new {
            self.of = Some(acoustics.graph.clone());
            self.known = None;
        }
        let n = acoustics.parts.len();
        if n == 1 {
            if is_new {
                self.graph = self.of.clone();
                self.forget();
            }
            return;
        }
        if space.moved_since(&mut self.known, &mut self.moved_parts) {
            let moved = self.moved_parts.iter().take(n);
            if is_new || moved.skip(1).any(|moved| *moved) {
                self.graph = Some(Arc::new(SoundGraph::new(space, &acoustics.parts)));
                self.forget();
            }
        }
    }

    /// Forgets all that depends on where parts stand.
    fn forget(&mut self) {
        (self.here, self.searched) = (None, None);
        self.gates.fill((f64::NAN, f64::NAN));
        self.searched_tolls.fill(f64::INFINITY);
        for source in &mut self.sources {
            (source.n_routes, source.measured, source.place) = (0, None, None);
            source.quiet = None;
        }
    }

    fn listen_at(&mut self, acoustics: &Acoustics, space: &Space, graph: &SoundGraph, here: Spot) {
        let Spot { cell, at } = here;
        let before = self.here.replace(Spot { cell, at }).filter(|b| {
            let mut exits = graph.ways.exits_of(b.cell).iter();
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
        self.gates.resize(n, (f64::NAN, f64::NAN));
        self.searched_tolls.resize(n, f64::INFINITY);
        self.time += 1;
        let mut swung = 0.0;
        let mut moved = self.searched.map_or(f64::INFINITY, |s| s.1.distance(at));
        for i in 0..n {
            let portal = PortalId(i as u32);
            let gate = acoustics.gate(space, graph, portal);
            if self.gates[i] != gate {
                self.risen += rise(self.gates[i], gate);
                self.gates[i] = gate;
                let is_spare = graph.is_spare(portal);
                self.tolls[i] = if is_spare {
                    0.0
                } else {
                    toll(graph.area[i], gate)
                };
            }
            let square = graph.bounds[i].distance_squared(at);
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
        let ways = &graph.ways;
        lengths_from(acoustics, graph, cell, at, &mut self.lengths);
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
    fn search(&mut self, graph: &SoundGraph) {
        if let Some((cell, at)) = self.searched.filter(|_| self.is_stale) {
            self.is_stale = false;
            let (lengths, tolls) = (&self.lengths, &self.searched_tolls);
            let first = |place: usize, _| lengths[place];
            let pass = |exit: LayoutExit| Some(tolls[exit.portal.idx()]);
            (self.search).run_from(&graph.ways, cell, at, first, FIRST_REACH, pass);
        }
    }

    /// Returns `true` if a door that has moved since a source's sequences were found may have changed which ones they are.
    fn is_changed(&self, graph: &SoundGraph, source: &Source, ends: [Spot; 2]) -> bool {
        let most = source.best * HEARD.longest[0] + HEARD.longest[1];
        let moved = self.moved.iter().filter(|m| m.1 > source.time);
        let mut lengths = moved.map(|(portal, _)| {
            let bounds = &graph.bounds[portal.idx()];
            let squares = ends.map(|e| bounds.distance_squared(e.at));
            squares[0].sqrt() + squares[1].sqrt()
        });
        lengths.any(|length| length < most)
    }

    /// Returns the number of searches of sequences, for cost statistics.
    #[must_use]
    #[doc(hidden)]
    pub fn n_searches(&self) -> u64 {
        self.n_searches
    }

    /// Returns a source as heard, in directions of the frame of the listener's part. The source is given by its place, and its
    /// position in the frame of that place's part. `id` numbers sources from 0, without large gaps. `None` before the first
    /// [`Listener::listen`], if no path exists, and if it is fainter than 100 dB below its level at a meter. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn hear(
        &mut self,
        acoustics: &Acoustics,
        id: usize,
        place: Place,
        at: DVec3,
    ) -> Option<Heard> {
        let graph = &self.graph.clone()?;
        let there = spot(graph, place, at)?;
        let Spot { cell, at } = there;
        if let Some(Some((spot, until))) = self.sources.get(id).map(|s| s.quiet) {
            let come = STEEPEST * spot.at.distance(at);
            if spot.cell == cell && self.risen + come < until {
                return None;
            }
        }
        let ends = self.choose_routes(acoustics, graph, id, there)?;
        self.pull_heard(acoustics, graph, id, ends);
        let energy = self.sum_up(acoustics, graph, id, ends);
        let level = energy.map_or(f64::NEG_INFINITY, |h| 20.0 * h.gain.log10());
        let source = &mut self.sources[id];
        if level < FAINTEST {
            source.quiet = Some((there, self.risen + (FAINTEST - level)));
            return None;
        }
        source.quiet = None;
        let (length, nearest) = self.pull_shortest(acoustics, graph, id, ends)?;
        let heard = energy?;
        let part = self.place?.part;
        Some(Heard {
            length,
            nearest: graph.toward(part, nearest),
            direction: graph.toward(part, heard.direction.normalize_or(nearest)),
            ..heard
        })
    }

    /// Returns the length of the shortest path from a source, and the unit vector towards its last bend, zero if the source is at
    /// the listener. As in [`Heard`], but also for sources that are too faint to be heard. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such place.
    pub fn shortest(
        &mut self,
        acoustics: &Acoustics,
        id: usize,
        place: Place,
        at: DVec3,
    ) -> Option<(f64, DVec3)> {
        let graph = &self.graph.clone()?;
        let there = spot(graph, place, at)?;
        let ends = self.choose_routes(acoustics, graph, id, there)?;
        let (length, nearest) = self.pull_shortest(acoustics, graph, id, ends)?;
        Some((length, graph.toward(self.place?.part, nearest)))
    }

    /// Finds the sequences of a source, unless they are kept. Returns both ends.
    fn choose_routes(
        &mut self,
        acoustics: &Acoustics,
        graph: &SoundGraph,
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
            if !self.is_changed(graph, source, ends) {
                return Some(ends);
            }
        }
        self.search(graph);
        let source = &mut self.sources[id];
        let ways = &graph.ways;
        if source.measured != Some((there.cell, there.at)) {
            source.measured = Some((there.cell, there.at));
            lengths_from(acoustics, graph, there.cell, there.at, &mut source.lengths);
        }
        let mut direct = f64::INFINITY;
        if there.cell == cell {
            let (line, seen) = ([at, there.at], &mut self.seen);
            let found = graph.way(&acoustics.parts, cell, line, seen, &mut self.bends);
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
                let portals = self.sequences.portals(found);
                let portals = portals.filter(|p| !graph.is_spare(p.0));
                source.add_route(&mut n_known, is_heard, portals);
            }
        }
        Some(ends)
    }

    /// Pulls the strings that may be heard.
    fn pull_heard(
        &mut self,
        acoustics: &Acoustics,
        graph: &SoundGraph,
        id: usize,
        ends: [Spot; 2],
    ) {
        let source = &mut self.sources[id];
        let routes = &mut source.routes[..source.n_routes];
        let n_heard = routes.iter().filter(|r| r.is_heard).count();
        // The former best comes first, so that others need not be pulled.
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
                    self.puller.pull(acoustics, graph, ends, route);
                    most = most.min(route.length + toll);
                }
            }
        }
    }

    fn pull_shortest(
        &mut self,
        acoustics: &Acoustics,
        graph: &SoundGraph,
        id: usize,
        ends: [Spot; 2],
    ) -> Option<(f64, DVec3)> {
        let source = &mut self.sources[id];
        let mut best = None;
        for route in &mut source.routes[..source.n_routes] {
            let least = best.map_or(f64::INFINITY, |b: (f64, DVec3)| b.0);
            if route.bounds(ends).0 < least {
                self.puller.pull(acoustics, graph, ends, route);
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
        graph: &SoundGraph,
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
        // Sequences too faint in any case are not evaluated.
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
                route.energy = (self.puller).energy(acoustics, graph, ends, &self.gates, route);
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
