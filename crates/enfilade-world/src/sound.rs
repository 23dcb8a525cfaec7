//! Sound of sources as a listener hears it: direction, distance and level of the paths through openings.
//!
//! One [length search](LengthSearch) from the listener serves all sources: the best few sequences of portals for each, any number
//! deep, [pulled taut](TautString). Along a string each portal reduces the level by
//!
//! - diffraction at its edge: Maekawa ("Noise reduction by screens", 1968) in the closed form of Kurze & Anderson ("Sound
//!   attenuation by barriers", 1971) by the Fresnel number of the detour over the edge, below 0 on the bright side: 5 dB at
//!   grazing, none in the clear;
//! - its limited area: the share of the first Fresnel zone that is open (Born & Wolf, "Principles of Optics", §8.2);
//! - the transmission loss of a leaf or pane, by [kind](Transmission), where it is shut, and by the open share where it is not.
//!
//! Distances count as 1 / r beyond a meter. Sequences add up by energy, and fade out towards the longest that counts, so that
//! none appears or vanishes abruptly. The search may still replace a sequence by another of equal length but different level, so
//! levels change by at most 0.4 dB per centimeter walked. All of this is for one wavelength, that of 500 Hz. O(portals of a
//! sequence) per source.
//!
//! Detours are differences of lengths: they round at 1e-15 of these, against wavelengths of 0.7 m. Within a concave cell strings
//! are straight, too short where a wall of the cell is in between.

use enfilade_cpg::{CellId, FittingPart, PortalId, PortalKind, World};
use enfilade_geom::{DVec3, Winding};
use enfilade_runtime::SightState;

use crate::layout::Layout;
use crate::sampling::Sampling;
use crate::search::{Arrival, LengthSearch, Ways};
use crate::taut::{TautString, best_on_edge};

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

/// Wavelength of 500 Hz. [Units: wu]
const WAVELENGTH: f64 = 0.686;
/// Maximum number of sequences per source, and how much longer than the best they may be.
const N_ROUTES: usize = 4;
const LONGEST: f64 = 1.5;
/// A listener or source that has moved by less keeps its sequences. [Units: wu]
const KEPT: f64 = 0.25;
/// Maximum loss at one edge. [Units: dB]
const MOST_LOSS: f64 = 24.0;
/// Maximum change of levels per meter that listener and source move. [Units: dB]
const SLEW: f64 = 40.0;
/// Larger jumps count as teleports, at which levels change at once. [Units: wu]
const TELEPORT: f64 = 0.5;

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
    /// Unit vector towards the sound, averaged over all paths by energy.
    pub direction: DVec3,
    /// Amplitude relative to that at one meter in the open, without the room's reverberation.
    pub gain: f64,
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
    last: Option<LastHeard>,
}

#[derive(Clone, Copy, Debug)]
struct LastHeard {
    listener: DVec3,
    source: DVec3,
    doors: u64,
    gain: f64,
}

#[derive(Clone, Copy, Debug)]
struct Route {
    first: u32,
    n: u32,
    /// Length added for shut portals when routes are compared. [Units: wu]
    toll: f64,
    length: f64,
    toward: DVec3,
}

/// A pair of ears, with reusable buffers: allocates nothing once they have grown.
///
/// Searches sequences again when the listener enters a cell or has moved by a quarter of a meter, and when doors moved; pulls
/// strings at each query.
#[derive(Clone, Debug, Default)]
pub struct Listener {
    search: LengthSearch,
    n_searches: u64,
    /// Number of times that doors have moved.
    doors: u64,
    place: Option<(CellId, DVec3)>,
    at: DVec3,
    transmitted: Vec<f64>,
    open: Vec<f64>,
    sources: Vec<Source>,
    arrivals: Vec<Arrival>,
    crossings: Vec<(crate::layout::Exit, DVec3)>,
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
        self.doors += u64::from(!is_same);
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
        let mut heard = self.sum_up(acoustics, layout, id, at)?;
        let last = &mut self.sources[id].last;
        if let Some(last) = last.filter(|l| l.doors == self.doors) {
            let moved = last.listener.distance(self.at) + last.source.distance(at);
            let most = 10f64.powf(0.05 * SLEW * moved);
            if moved < TELEPORT {
                heard.gain = heard.gain.clamp(last.gain / most, last.gain * most);
            }
        }
        *last = Some(LastHeard {
            listener: self.at,
            source: at,
            doors: self.doors,
            gain: heard.gain,
        });
        Some(heard)
    }

    fn choose_routes(&mut self, acoustics: &Acoustics, id: usize, cell: CellId, at: DVec3) {
        let ways = &acoustics.ways;
        self.search
            .arrivals(ways, cell, at, LONGEST, N_ROUTES, &mut self.arrivals);
        let source = &mut self.sources[id];
        (source.search, source.cell, source.at) = (self.n_searches, Some(cell), at);
        source.routes.clear();
        source.portals.clear();
        source.points.clear();
        for arrival in &self.arrivals {
            self.search.crossings(ways, arrival, &mut self.crossings);
            let tolls = self
                .crossings
                .iter()
                .map(|(exit, _)| toll(self.transmitted[exit.portal.idx()]));
            source.routes.push(Route {
                first: source.portals.len() as u32,
                n: self.crossings.len() as u32,
                toll: tolls.sum(),
                length: 0.0,
                toward: DVec3::ZERO,
            });
            source
                .portals
                .extend(self.crossings.iter().map(|c| c.0.portal));
            source.points.extend(self.crossings.iter().map(|c| c.1));
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
        source.points[range].copy_from_slice(&points[1..points.len() - 1]);
    }

    fn sum_up(
        &self,
        acoustics: &Acoustics,
        layout: &Layout,
        id: usize,
        at: DVec3,
    ) -> Option<Heard> {
        let source = &self.sources[id];
        let total = |r: &Route| r.length + r.toll;
        let best = source
            .routes
            .iter()
            .map(total)
            .fold(f64::INFINITY, f64::min);
        let shortest = source
            .routes
            .iter()
            .min_by(|a, b| a.length.total_cmp(&b.length))?;
        let mut heard = Heard {
            length: shortest.length,
            nearest: shortest.toward,
            ..Heard::default()
        };
        let mut energy = 0.0;
        for route in &source.routes {
            let over = (LONGEST - total(route) / best.max(1.0)) / (LONGEST - 1.0);
            let fade = over.clamp(0.0, 1.0).powi(2);
            let gain = self.route_gain(acoustics, layout, source, route, at);
            let own = fade * gain * gain;
            energy += own;
            heard.direction += route.toward * own;
            heard.n_ways += 1;
        }
        heard.direction = heard.direction.normalize_or(heard.nearest);
        heard.gain = energy.sqrt();
        Some(heard)
    }

    /// Returns the amplitude along a route.
    fn route_gain(
        &self,
        acoustics: &Acoustics,
        layout: &Layout,
        source: &Source,
        route: &Route,
        at: DVec3,
    ) -> f64 {
        let range = route.first as usize..(route.first + route.n) as usize;
        let (portals, points) = (&source.portals[range.clone()], &source.points[range]);
        let mut gain = 1.0 / route.length.max(1.0);
        for (i, &portal) in portals.iter().enumerate() {
            let before = if i == 0 { self.at } else { points[i - 1] };
            let after = points.get(i + 1).copied().unwrap_or(at);
            let transmitted = self.transmitted[portal.idx()];
            let area = layout.opening(portal).area() * self.open[portal.idx()];
            // Sound through the leaf passes its whole area.
            let leaf = (transmitted - self.open[portal.idx()]).max(0.0);
            let free =
                self.open[portal.idx()] * through_area(area, before, points[i], after).powi(2);
            gain *= (free + leaf).sqrt();
            let detour = detour(acoustics.rims(portal), before, points[i], after);
            gain *= 10f64.powf(-0.05 * edge_loss(2.0 * detour / WAVELENGTH));
        }
        gain
    }
}

/// Extra length of a shut portal in comparisons of sequences: a meter for each decibel. [Units: wu]
fn toll(transmitted: f64) -> f64 {
    -10.0 * transmitted.max(1e-12).log10()
}

/// Returns the amplitude that passes an area on the way between two points, relative to a large area.
fn through_area(area: f64, before: DVec3, at: DVec3, after: DVec3) -> f64 {
    let (d1, d2) = (before.distance(at), after.distance(at));
    // Number of first Fresnel zones in the area, times π; the zone vanishes at the opening itself.
    let zone = WAVELENGTH * d1 * d2 / (d1 + d2).max(1e-9);
    area / area.hypot(zone).max(1e-12)
}

/// Returns the extra length over the nearest edge: above 0 where the string bends about it, below 0 where it passes in the clear.
/// [Units: wu]
fn detour(rims: &[[DVec3; 2]], before: DVec3, at: DVec3, after: DVec3) -> f64 {
    let straight = before.distance(after);
    let bent = before.distance(at) + at.distance(after) - straight;
    if bent > 1e-9 * (1.0 + straight) {
        return bent;
    }
    let over = rims.iter().map(|&[a, b]| {
        let (edge, _) = best_on_edge(before, after, a, b);
        before.distance(edge) + edge.distance(after) - straight
    });
    -over.fold(f64::INFINITY, f64::min).max(0.0)
}

/// Returns the loss at an edge, by the Fresnel number of the detour over it. [Units: dB]
fn edge_loss(fresnel: f64) -> f64 {
    let x = (std::f64::consts::TAU * fresnel.abs()).sqrt();
    if x < 1e-6 {
        return 5.0;
    }
    if fresnel > 0.0 {
        return (5.0 + 20.0 * (x / x.tanh()).log10()).min(MOST_LOSS);
    }
    // In the clear from about -0.19 on.
    if x > 1.2 {
        return 0.0;
    }
    (5.0 + 20.0 * (x / x.tan()).log10()).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W11: Maekawa's chart.
    #[test]
    fn edge_losses_equal_maekawas_chart() {
        for (fresnel, decibels) in [
            (0.0, 5.0),
            (1.0, 13.0),
            (10.0, 23.0),
            (100.0, 24.0),
            (-1.0, 0.0),
        ] {
            let loss = edge_loss(fresnel);
            assert!((loss - decibels).abs() < 0.3, "{fresnel}: {loss}");
        }
        for k in -4000..4000 {
            let x = f64::from(k) * 1e-3;
            assert!((edge_loss(x) - edge_loss(x + 1e-3)).abs() < 0.15, "{x}");
        }
    }

    /// W11.
    #[test]
    fn a_small_hole_lets_less_through_but_not_close_by() {
        let (a, x, b) = (DVec3::ZERO, DVec3::X * 3.0, DVec3::X * 6.0);
        assert!(through_area(4.0, a, x, b) > 0.95);
        assert!(through_area(0.01, a, x, b) < 0.02);
        assert_eq!(through_area(0.01, x, x, b), 1.0);
    }
}
