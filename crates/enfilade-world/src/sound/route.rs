//! One sequence of openings between a listener and a source: its string, pulled taut around walls, and the energy along it.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use crate::layout::Layout;
use crate::paths::{Corner, Seen};
use crate::sound::acoustics::Acoustics;
use crate::sound::bands::{N_BANDS, OCTAVES};
use crate::sound::edge::{
    arrival_direction, bend_loss, detour, straight_end, through_area, wall_share,
};
use crate::sound::graph::SoundGraph;
use crate::sound::reverb::SPEED_OF_SOUND;
use crate::sound::taut::TautString;

/// Rounds of finding the bends of a string and pulling it taut; bends move the crossings, and crossings the bends.
const ROUNDS: usize = 3;

/// A portal that a string passes, or the edge of a wall about which it bends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Gate {
    Portal(PortalId),
    Edge([DVec3; 2]),
}

/// An end of a string.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) cell: CellId,
    pub(super) at: DVec3,
}

/// A sequence of portals, with its string when last pulled.
#[derive(Clone, Debug, Default)]
pub(super) struct Route {
    pub(super) gates: Vec<Gate>,
    /// A point in each gate.
    pub(super) points: Vec<DVec3>,
    /// A point in each portal, of the string without bends.
    plain: Vec<DVec3>,
    pub(super) length: f64,
    /// Towards its first bend.
    pub(super) toward: DVec3,
    /// The direction in which it is heard.
    pub(super) arrival: DVec3,
    /// Energy when last heard, by octave band, and the share of it that counts.
    pub(super) energy: [f64; N_BANDS],
    pub(super) fade: f64,
    /// Too faint until all may have risen by as much, in decibels since the first position of the listener.
    pub(super) quiet: f64,
    /// `false` if it is only measured.
    pub(super) is_heard: bool,
    /// The ends between which it was last pulled.
    pulled: Option<[DVec3; 2]>,
}

impl Route {
    /// Makes it another sequence: portals, each with a point near the crossing.
    pub(super) fn begin(
        &mut self,
        is_heard: bool,
        portals: impl Iterator<Item = (PortalId, DVec3)>,
    ) {
        self.gates.clear();
        self.points.clear();
        for (portal, point) in portals {
            self.gates.push(Gate::Portal(portal));
            self.points.push(point);
        }
        // Few sizes, as strings change places.
        let room = self.points.len().next_power_of_two().max(32);
        self.gates.reserve(room - self.points.len());
        self.points.reserve(room - self.points.len());
        self.plain.clear();
        self.plain.reserve(room);
        self.plain.extend_from_slice(&self.points);
        (self.is_heard, self.pulled, self.quiet) = (is_heard, None, 0.0);
    }

    /// Returns `true` if its string is that between two ends.
    pub(super) fn is_pulled_for(&self, ends: [Spot; 2]) -> bool {
        self.pulled == Some(ends.map(|e| e.at))
    }

    /// Returns bounds of its length between two ends: the string is no longer than the last one, extended to these.
    pub(super) fn bounds(&self, ends: [Spot; 2]) -> (f64, f64) {
        let Some(pulled) = self.pulled else {
            return (0.0, f64::INFINITY);
        };
        let moved = pulled[0].distance(ends[0].at) + pulled[1].distance(ends[1].at);
        (self.length - moved, self.length + moved)
    }

    /// Returns the sum of its portals' tolls.
    pub(super) fn toll(&self, tolls: &[f64]) -> f64 {
        self.portals().map(|p| tolls[p.idx()]).sum()
    }

    /// Returns its portals.
    pub(super) fn portals(&self) -> impl Iterator<Item = PortalId> {
        self.gates.iter().filter_map(|gate| match gate {
            Gate::Portal(portal) => Some(*portal),
            Gate::Edge(_) => None,
        })
    }
}

/// Pulls routes taut and evaluates them, with reusable buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Puller {
    string: TautString,
    seen: Seen,
    bends: Vec<Corner>,
    gates: Vec<Gate>,
    points: Vec<DVec3>,
    /// The ends, and the points of portals between.
    crossings: Vec<DVec3>,
    /// Extra length around walls before each crossing, from the one before it.
    extra: Vec<f64>,
}

impl Puller {
    /// Pulls a route taut.
    pub(super) fn pull(
        &mut self,
        acoustics: &Acoustics,
        graph: &SoundGraph,
        [from, to]: [Spot; 2],
        route: &mut Route,
    ) {
        if route.is_pulled_for([from, to]) {
            return;
        }
        route.pulled = Some([from.at, to.at]);
        // First through the portals alone, where there is one shortest string, whatever was before: so is what follows.
        route.gates.retain(|gate| matches!(gate, Gate::Portal(_)));
        route.points.clone_from(&route.plain);
        let layout = &graph.joined.layout;
        self.tighten(layout, [from, to], route);
        route.plain.clone_from(&route.points);
        for _ in 0..ROUNDS {
            if !self.bend(acoustics, graph, [from, to], route) {
                break;
            }
            self.tighten(layout, [from, to], route);
        }
        route.toward = self.string.departure();
        route.arrival = arrival_direction(self.string.points());
    }

    /// Pulls a route's string through its gates, starting from its points.
    fn tighten(&mut self, layout: &Layout, [from, to]: [Spot; 2], route: &mut Route) {
        let gates = &route.gates;
        let pieces = |i: usize| match &gates[i] {
            Gate::Portal(portal) => Pieces::Portal(layout.opening(*portal).pieces()),
            Gate::Edge(edge) => Pieces::Edge(Some(edge)),
        };
        let start = route.points.iter().copied();
        route.length = self.string.pull_from(from.at, to.at, start, pieces);
        let points = self.string.points();
        route.points.clear();
        route.points.extend_from_slice(&points[1..points.len() - 1]);
    }

    /// Finds the bends around walls between the crossings of a route. Returns `true` if they are others than before.
    fn bend(
        &mut self,
        acoustics: &Acoustics,
        graph: &SoundGraph,
        [from, to]: [Spot; 2],
        route: &mut Route,
    ) -> bool {
        self.gates.clear();
        self.points.clear();
        let parts = &acoustics.parts;
        let (mut cell, mut at, mut through) = (from.cell, from.at, None);
        let nexts = route.gates.iter().zip(&route.points);
        let nexts = nexts.filter_map(|(gate, p)| match gate {
            Gate::Portal(portal) => Some((Some(*portal), *p)),
            Gate::Edge(_) => None,
        });
        for (portal, p) in nexts.chain([(None, to.at)]) {
            if graph.is_concave(parts, cell) {
                let inside = |portal: Option<PortalId>, p: DVec3| match portal {
                    Some(portal) => graph.off_door(parts, portal, cell, p),
                    None => p,
                };
                let ends = [inside(through, at), inside(portal, p)];
                // Without a path, as through a slit thinner than points are kept off walls, it stays straight.
                let found = graph.way(parts, cell, ends, &mut self.seen, &mut self.bends);
                if found.is_some() {
                    self.gates
                        .extend(self.bends.iter().map(|b| Gate::Edge(b.edge)));
                    self.points.extend(self.bends.iter().map(|b| b.at));
                }
            }
            if let Some(portal) = portal {
                self.gates.push(Gate::Portal(portal));
                self.points.push(p);
                cell = graph.joined.behind(portal, cell);
            }
            (at, through) = (p, portal);
        }
        if self.gates == route.gates {
            return false;
        }
        route.gates.clone_from(&self.gates);
        route.points.clone_from(&self.points);
        true
    }

    /// Returns the energy along a route, by octave band. `gates` has the clear share of each portal, and what the rest lets
    /// through.
    pub(super) fn energy(
        &mut self,
        acoustics: &Acoustics,
        graph: &SoundGraph,
        [from, to]: [Spot; 2],
        gates: &[(f64, f64)],
        route: &Route,
    ) -> [f64; N_BANDS] {
        self.set_crossings([from, to], route);
        let mut energy = [route.length.max(1.0).powi(-2); N_BANDS];
        let mut losses = [0.0; N_BANDS];
        for &extra in self.extra.iter().filter(|extra| **extra > 0.0) {
            for (loss, frequency) in losses.iter_mut().zip(OCTAVES) {
                *loss += bend_loss(2.0 * extra * frequency / SPEED_OF_SOUND);
            }
        }
        const LONGEST_WAVE: f64 = SPEED_OF_SOUND / OCTAVES[0];
        for (i, portal) in route.portals().enumerate() {
            let at = self.crossings[i + 1];
            let back = self.crossings[..=i].iter().rev().copied();
            let before = straight_end(at, back);
            let after = straight_end(at, self.crossings[i + 2..].iter().copied());
            let opening = graph.joined.layout.opening(portal);
            let rims = graph.rims(portal);
            let beside = || wall_share(&opening, rims, before) * wall_share(&opening, rims, after);
            let fresnel = 2.0 * detour(rims, before, at, after) / LONGEST_WAVE;
            (acoustics.edge_losses).add(fresnel, beside, &mut losses);
            let (open, leaf) = gates[portal.idx()];
            let area = opening.area() * open;
            let free = through_area(area, LONGEST_WAVE, before, at, after);
            // Sound through the leaf passes its whole area.
            let leaf = through_leaf(leaf);
            for (k, (energy, free)) in energy.iter_mut().zip(free).enumerate() {
                *energy *= free + (1.0 - free) * leaf[k];
            }
        }
        for (energy, loss) in energy.iter_mut().zip(losses) {
            *energy *= 10f64.powf(-0.1 * loss);
        }
        energy
    }

    fn set_crossings(&mut self, [from, to]: [Spot; 2], route: &Route) {
        self.crossings.clear();
        self.extra.clear();
        self.crossings.push(from.at);
        let (mut start, mut at, mut length) = (from.at, from.at, 0.0);
        let gates = route.gates.iter().zip(&route.points);
        let gates = gates.map(|(gate, p)| (matches!(gate, Gate::Portal(_)), *p));
        for (is_portal, p) in gates.chain([(true, to.at)]) {
            length += at.distance(p);
            at = p;
            if is_portal {
                let extra = length - start.distance(p);
                // Less is rounding.
                self.extra
                    .push(if extra > 1e-9 * length { extra } else { 0.0 });
                self.crossings.push(p);
                (start, length) = (p, 0.0);
            }
        }
    }
}

/// Loss of a leaf in octave bands, by the loss that it is given: light doors and panes lose more at high frequencies (EN 12354-1,
/// annex B). At the loss of a door, the mean of the bands by energy is the one given.
const LEAF: [f64; N_BANDS] = [0.82, 0.94, 1.06, 1.14, 1.18, 1.22];

/// Returns the energy that a leaf lets through in octave bands, from that at mid frequencies.
fn through_leaf(leaf: f64) -> [f64; N_BANDS] {
    if leaf >= 1.0 {
        return [1.0; N_BANDS];
    }
    let loss = leaf.ln();
    LEAF.map(|share| (share * loss).exp())
}

/// The convex pieces of a gate.
enum Pieces<'a, I> {
    Portal(I),
    Edge(Option<&'a [DVec3; 2]>),
}

impl<'a, I: Iterator<Item = &'a [DVec3]>> Iterator for Pieces<'a, I> {
    type Item = &'a [DVec3];

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Pieces::Portal(pieces) => pieces.next(),
            Pieces::Edge(edge) => edge.take().map(<[DVec3; 2]>::as_slice),
        }
    }
}
