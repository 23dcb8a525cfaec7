//! Sound of sources as a listener hears it: direction, distance and level of the paths through openings.
//!
//! Two [length searches](LengthSearch) from the listener serve all sources: one for the shortest way, whatever is shut, and one that
//! counts shut doors as longer, for what is heard. From these come the best few sequences of portals for each source, any number
//! deep, [pulled taut](TautString). Along a string each portal reduces the level, in six octave bands, by
//!
//! - diffraction at its edge: Maekawa ("Noise reduction by screens", 1968) in the closed form of Kurze & Anderson ("Sound
//!   attenuation by barriers", 1971), by the Fresnel number of the detour over the edge; on the bright side, by that of the
//!   distance of the string from the edge, below 0: 5 dB at grazing, fading to none in the clear. In the opening itself there is
//!   nothing to go around: the loss counts by the share of directions that the wall around the opening takes there;
//! - its limited area: the share of the first Fresnel zone that its clear area takes (Born & Wolf, "Principles of Optics", §8.2);
//! - the transmission loss of a leaf or pane, by [kind](Transmission), for the rest.
//!
//! Distances count as 1 / r beyond a meter. Sequences add up by energy, and fade out towards the longest that counts, or the
//! first that is not counted. Each of these is a continuous function of both places, so levels need no smoothing, and the answer
//! does not depend on earlier ones, but for sequences being searched anew only after some movement. O(portals of a sequence)
//! per source and band.
//!
//! Detours are differences of lengths: they round at 1e-15 of these, against wavelengths of 0.09 m and more. Within a concave
//! cell strings are straight, too short where a wall of the cell is in between.

mod auralize;
mod blocks;
mod ears;
mod edge;
mod reverb;
mod taut;

use enfilade_cpg::{CellId, FittingPart, PortalId, PortalKind, World};
use enfilade_geom::{DVec3, Winding};
use enfilade_runtime::SightState;

use self::edge::{arrival_direction, detour, edge_loss, straight_end, through_area, wall_share};

use crate::layout::Layout;
use crate::paths::{LengthSearch, Limit, Sampling, Sequences, Ways};

pub use auralize::{AUDIO_BLOCK, AudioBlock, Auralizer, test_sound};
pub use ears::at_ears;
pub use reverb::{DecayLaw, DiffuseFields, Reverb, SPEED_OF_SOUND, absorption_of_name};
pub use taut::TautString;

/// Transmission loss of shut openings. [Units: dB] [Limit: ≥ 0]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    /// Leaves of doors.
    pub door: f64,
    /// Panes and shut windows.
    pub window: f64,
    /// Closures of other openings.
    pub other: f64,
}

impl Default for Transmission {
    /// A light door leaf, single glass: weighted reductions of 25 and 30 dB (EN 12354-1).
    fn default() -> Self {
        Self {
            door: 25.0,
            window: 30.0,
            other: 30.0,
        }
    }
}

/// Acoustic data of a world. Made once, read by all listeners.
#[derive(Clone, Debug)]
pub struct Acoustics {
    ways: Ways,
    /// Per portal, edges with wall beside them, and the number of all.
    first_rim: Vec<u32>,
    rims: Vec<[DVec3; 2]>,
    /// Per portal, the energy that passes it while shut.
    shut: Vec<f64>,
    has_pane: Vec<bool>,
}

/// Number of octave bands.
const N_BANDS: usize = 6;
/// Centers of the octave bands, those in which materials are measured (ISO 354). [Units: Hz]
pub const OCTAVES: [f64; N_BANDS] = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0];
/// Sequences of a source that are heard. Longer ones by half, and by 5 m, count, as these are mostly more than 10 dB down in rooms;
/// 24 are more than the doors of most corridors.
const HEARD: Limit = Limit {
    n: 24,
    longest: [1.5, 5.0],
    steps: 1500,
};
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
impl Acoustics {
    /// Prepares a world. O(portals).
    #[must_use]
    pub fn new(layout: &Layout, world: &World, transmission: &Transmission) -> Self {
        Self::with_ways(
            layout,
            world,
            transmission,
            Ways::new(layout, Sampling::default()),
        )
    }

    /// As [`Acoustics::new`], with more exact lengths within cells, such as those of [`Geodesics`](crate::Geodesics).
    #[must_use]
    pub fn with_ways(
        layout: &Layout,
        world: &World,
        transmission: &Transmission,
        ways: Ways,
    ) -> Self {
        let (mut first_rim, mut rims) = (vec![0], Vec::new());
        let (mut shut, mut has_pane) = (Vec::new(), Vec::new());
        for (i, portal) in world.graph.portals.iter().enumerate() {
            add_rims(layout, PortalId(i as u32), &mut rims);
            first_rim.push(rims.len() as u32);
            let loss = match portal.kind {
                PortalKind::Door => transmission.door,
                PortalKind::Window => transmission.window,
                PortalKind::Open | PortalKind::Crack => transmission.other,
            };
            shut.push(10f64.powf(-0.1 * loss));
            has_pane.push(portal.fittings.iter().any(|f| f.part == FittingPart::Pane));
        }
        Self {
            ways,
            first_rim,
            rims,
            shut,
            has_pane,
        }
    }

    /// Returns the fraction of a portal's opening that lets sound pass freely, 0 to 1, from the pose of its leaves; 0 behind a
    /// pane.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    #[must_use]
    pub fn open_share(&self, state: &SightState, portal: PortalId) -> f64 {
        if self.has_pane[portal.idx()] || !state.is_open(portal) {
            return 0.0;
        }
        f64::from(state.leaves(portal).unwrap_or(1.0))
    }

    /// Returns the fraction of energy that a portal lets through, above 0.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    #[must_use]
    pub fn transmitted(&self, state: &SightState, portal: PortalId) -> f64 {
        let open = self.open_share(state, portal);
        open + (1.0 - open) * self.shut[portal.idx()]
    }

    fn rims(&self, portal: PortalId) -> &[[DVec3; 2]] {
        let first = &self.first_rim[portal.idx()..];
        &self.rims[first[0] as usize..first[1] as usize]
    }
}

/// Adds the edges of an opening's pieces with no other piece behind them.
fn add_rims(layout: &Layout, portal: PortalId, rims: &mut Vec<[DVec3; 2]>) {
    let opening = layout.opening(portal);
    let hulls: Vec<Winding> = opening.pieces().map(|p| Winding::new(p.to_vec())).collect();
    for (i, piece) in opening.pieces().enumerate() {
        for (k, &a) in piece.iter().enumerate() {
            let b = piece[(k + 1) % piece.len()];
            let out = (b - a).cross(opening.normal()).normalize_or_zero();
            let beside = a.midpoint(b) + out * 1e-3;
            let mut others = hulls.iter().enumerate().filter(|(j, _)| *j != i);
            if !others.any(|(_, hull)| hull.contains_in_plane(beside, 0.0)) {
                rims.push([a, b]);
            }
        }
    }
}

/// A source as heard.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Heard {
    /// Length of the shortest path. [Units: wu]
    pub length: f64,
    /// Unit vector towards the last bend of the shortest path; zero if the source is at the listener.
    pub nearest: DVec3,
    /// Unit vector towards the sound, averaged over all paths by energy, and over the first half wave of each at 500 Hz.
    pub direction: DVec3,
    /// Amplitude relative to that at one meter in the open, without the room's reverberation: the mean over the bands by energy.
    pub gain: f64,
    /// The same in each [octave band](OCTAVES).
    pub bands: [f64; N_BANDS],
    /// Number of paths counted.
    pub n_ways: u32,
}

#[derive(Clone, Debug, Default)]
struct Source {
    /// The search that found the routes.
    search: u64,
    cell: Option<CellId>,
    at: DVec3,
    routes: Vec<Route>,
    portals: Vec<PortalId>,
    /// Crossings of the strings when last pulled.
    points: Vec<DVec3>,
    /// Length beyond that of the best at which sequences have faded out. [Units: wu]
    cut: f64,
}

#[derive(Clone, Copy, Debug)]
struct Route {
    first: u32,
    n: u32,
    /// Length added for shut portals when routes are compared. [Units: wu]
    toll: f64,
    length: f64,
    toward: DVec3,
    /// The direction in which it is heard.
    arrival: DVec3,
    /// Energy when last heard, the sum over the bands.
    loudness: f64,
    /// `false` if it is only measured.
    is_heard: bool,
}

impl Route {
    /// Length, with what is added for shut portals. [Units: wu]
    fn total(&self) -> f64 {
        self.length + self.toll
    }
}

impl Source {
    fn best(&self) -> f64 {
        let heard = self.routes.iter().filter(|r| r.is_heard);
        heard.map(Route::total).fold(f64::INFINITY, f64::min)
    }

    /// Sets where sequences have faded out, after all are pulled: the last of those found stands for all that were not.
    fn set_cut(&mut self) {
        let best = self.best();
        let heard = self.routes.iter().filter(|r| r.is_heard);
        let last = heard.map(Route::total).fold(0.0, f64::max);
        let whole = best * (HEARD.longest[0] - 1.0) + HEARD.longest[1];
        self.cut = if self.cut == 0.0 {
            whole.min(last - best)
        } else {
            whole
        };
    }

    /// Drops sequences that need not be pulled again until the next search.
    fn drop_faint(&mut self, least: f64) {
        let lengths = self.routes.iter().map(|r| r.length);
        let shortest = lengths.fold(f64::INFINITY, f64::min);
        self.routes.retain(|r| {
            r.is_heard && r.loudness >= least || !r.is_heard && r.length <= shortest + KEPT
        });
    }
}

/// A pair of ears, with reusable buffers: allocates nothing once they have grown.
///
/// Searches sequences again when the listener enters a cell or has moved by a quarter of a meter, and when doors moved; pulls
/// strings at each query.
#[derive(Clone, Debug, Default)]
pub struct Listener {
    search: LengthSearch,
    /// The search without regard to shut doors.
    shortest: LengthSearch,
    n_searches: u64,
    place: Option<(CellId, DVec3)>,
    at: DVec3,
    transmitted: Vec<f64>,
    open: Vec<f64>,
    sources: Vec<Source>,
    sequences: Sequences,
    string: TautString,
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
        let mut is_same = self.transmitted.len() == n;
        self.transmitted.resize(n, 0.0);
        self.open.resize(n, 0.0);
        for i in 0..n {
            let portal = PortalId(i as u32);
            let transmitted = acoustics.transmitted(state, portal);
            is_same &= self.transmitted[i] == transmitted;
            self.transmitted[i] = transmitted;
            self.open[i] = acoustics.open_share(state, portal);
        }
        let is_near = |(c, p): (CellId, DVec3)| c == cell && p.distance(at) < KEPT;
        if is_same && self.place.is_some_and(is_near) {
            return;
        }
        self.place = Some((cell, at));
        self.n_searches += 1;
        let transmitted = &self.transmitted;
        self.search
            .run(&acoustics.ways, cell, at, f64::INFINITY, |exit| {
                Some(toll(transmitted[exit.portal.idx()]))
            });
        self.shortest
            .run(&acoustics.ways, cell, at, f64::INFINITY, |_| Some(0.0));
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
        self.place?;
        if self.sources.len() <= id {
            self.sources.resize_with(id + 1, Source::default);
        }
        let source = &self.sources[id];
        let is_kept = source.search == self.n_searches
            && source.cell == Some(cell)
            && source.at.distance(at) < KEPT;
        if !is_kept {
            self.choose_routes(acoustics, id, cell, at);
        }
        for k in 0..self.sources[id].routes.len() {
            self.pull(layout, id, k, at);
        }
        if is_kept {
            return self.sum_up(acoustics, layout, id, at);
        }
        self.sources[id].set_cut();
        let heard = self.sum_up(acoustics, layout, id, at);
        let loudest = heard.map_or(0.0, |h| h.gain * h.gain) * N_BANDS as f64;
        self.sources[id].drop_faint(LEAST * loudest);
        heard
    }

    fn choose_routes(&mut self, acoustics: &Acoustics, id: usize, cell: CellId, at: DVec3) {
        let source = &mut self.sources[id];
        (source.search, source.cell, source.at) = (self.n_searches, Some(cell), at);
        source.routes.clear();
        source.portals.clear();
        source.points.clear();
        for (search, limit, is_heard) in
            [(&self.search, HEARD, true), (&self.shortest, SHORT, false)]
        {
            let ends = (cell, at);
            let n = self.sequences.find(search, &acoustics.ways, ends, limit);
            for found in 0..n {
                let first = source.portals.len();
                for (portal, point) in self.sequences.portals(found) {
                    source.portals.push(portal);
                    source.points.push(point);
                }
                let own = source.portals[first..].iter();
                let tolls = own.map(|p| toll(self.transmitted[p.idx()]));
                source.routes.push(Route {
                    first: first as u32,
                    n: (source.portals.len() - first) as u32,
                    toll: tolls.sum(),
                    length: 0.0,
                    toward: DVec3::ZERO,
                    arrival: DVec3::ZERO,
                    loudness: 0.0,
                    is_heard,
                });
            }
            if is_heard {
                source.cut = if n == limit.n { 0.0 } else { f64::INFINITY };
            }
        }
    }

    /// Pulls the string of a source's route taut, starting from its last position.
    fn pull(&mut self, layout: &Layout, id: usize, route: usize, at: DVec3) {
        let source = &mut self.sources[id];
        let route = &mut source.routes[route];
        let range = route.first as usize..(route.first + route.n) as usize;
        let portals = &source.portals[range.clone()];
        let start = source.points[range.clone()].iter().copied();
        let pieces = |i: usize| layout.opening(portals[i]).pieces();
        route.length = self.string.pull_from(self.at, at, start, pieces);
        route.toward = self.string.departure();
        let points = self.string.points();
        route.arrival = arrival_direction(points);
        source.points[range].copy_from_slice(&points[1..points.len() - 1]);
    }

    fn sum_up(
        &mut self,
        acoustics: &Acoustics,
        layout: &Layout,
        id: usize,
        at: DVec3,
    ) -> Option<Heard> {
        let source = &self.sources[id];
        let best = source.best();
        let end = best + source.cut;
        let shortest = source
            .routes
            .iter()
            .min_by(|a, b| a.length.total_cmp(&b.length))?;
        let mut heard = Heard {
            length: shortest.length,
            nearest: shortest.toward,
            ..Heard::default()
        };
        let mut energy = [0.0; N_BANDS];
        let mut loudness = [0.0; HEARD.n];
        let routes = source.routes.iter().filter(|r| r.is_heard);
        for (loudness, route) in loudness.iter_mut().zip(routes) {
            // A tie of more sequences than are counted has no room to fade.
            let fade = if source.cut > 0.0 {
                ((end - route.total()) / source.cut).clamp(0.0, 1.0)
            } else {
                1.0
            };
            let gains = self.route_energy(acoustics, layout, source, route, at);
            let mut own = 0.0;
            for (sum, gain) in energy.iter_mut().zip(gains) {
                *sum += fade * gain;
                own += fade * gain;
            }
            *loudness = own;
            heard.direction += route.arrival * own;
            heard.n_ways += 1;
        }
        heard.direction = heard.direction.normalize_or(heard.nearest);
        heard.gain = (energy.iter().sum::<f64>() / N_BANDS as f64).sqrt();
        heard.bands = energy.map(f64::sqrt);
        let routes = self.sources[id].routes.iter_mut().filter(|r| r.is_heard);
        for (route, loudness) in routes.zip(loudness) {
            route.loudness = loudness;
        }
        Some(heard)
    }

    /// Returns the energy along a route, by octave band.
    fn route_energy(
        &self,
        acoustics: &Acoustics,
        layout: &Layout,
        source: &Source,
        route: &Route,
        at: DVec3,
    ) -> [f64; N_BANDS] {
        let range = route.first as usize..(route.first + route.n) as usize;
        let (portals, points) = (&source.portals[range.clone()], &source.points[range]);
        let mut energy = [route.length.max(1.0).powi(-2); N_BANDS];
        for (i, &portal) in portals.iter().enumerate() {
            let back = (0..i).rev().map(|k| points[k]).chain([self.at]);
            let before = straight_end(points[i], back);
            let onward = points[i + 1..].iter().copied().chain([at]);
            let after = straight_end(points[i], onward);
            let opening = layout.opening(portal);
            let area = opening.area() * self.open[portal.idx()];
            let rims = acoustics.rims(portal);
            let beside = wall_share(&opening, rims, before) * wall_share(&opening, rims, after);
            let detour = detour(rims, before, points[i], after);
            for (energy, frequency) in energy.iter_mut().zip(OCTAVES) {
                let wave = SPEED_OF_SOUND / frequency;
                // Sound through the leaf passes its whole area.
                let free = through_area(area, wave, before, points[i], after).powi(2);
                let through = free + (1.0 - free) * acoustics.shut[portal.idx()];
                let loss = beside * edge_loss(2.0 * detour / wave);
                *energy *= through * 10f64.powf(-0.1 * loss);
            }
        }
        energy
    }
}

/// Extra length of a shut portal in comparisons of sequences: a meter for each decibel. [Units: wu]
fn toll(transmitted: f64) -> f64 {
    -10.0 * transmitted.max(1e-12).log10()
}
