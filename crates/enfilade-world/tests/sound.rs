//! Sources as listeners hear them. Covers W11.

mod cone;

use cone::least_length;
use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_runtime::{Sight, SightState};
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_world::{Acoustics, Heard, Layout, Listener, Transmission};

struct Site {
    world: World,
    layout: Layout,
    acoustics: Acoustics,
    state: SightState,
}

fn site(params: &GridParams) -> Site {
    let world = room_grid(params);
    let layout = Layout::new(&world);
    let acoustics = Acoustics::new(&layout, &world, &Transmission::default());
    let state = SightState::new(&Sight::build(&world).unwrap());
    Site {
        world,
        layout,
        acoustics,
        state,
    }
}

fn rooms(n: usize, seed: u64) -> GridParams {
    GridParams {
        outdoors: false,
        windows: 0.0,
        furniture: 0,
        doors: 0.7,
        ..GridParams::offices(n, seed)
    }
}

impl Site {
    fn place(&self, rng: &mut Rng) -> (CellId, DVec3) {
        loop {
            let cell = CellId(rng.below(self.layout.n_cells()) as u32);
            let bounds = self.layout.cell(cell).bounds;
            let share = DVec3::from([0; 3].map(|_| rng.range(0.05, 0.95)));
            let at = bounds.min + (bounds.max - bounds.min) * share;
            if self.layout.locate(at) == Some(cell) {
                return (cell, at);
            }
        }
    }

    fn hear(&self, listener: (CellId, DVec3), source: (CellId, DVec3)) -> Option<Heard> {
        let mut ears = Listener::new();
        ears.listen(&self.acoustics, &self.state, listener.0, listener.1);
        ears.hear(&self.acoustics, &self.layout, 0, source.0, source.1)
    }

    /// The least length over all sequences of at most `most` portals, and that sequence: depth first, cut off if the string
    /// through the portals so far, straight on to the end, is at least as long as the best.
    fn least(
        &self,
        from: (CellId, DVec3),
        to: (CellId, DVec3),
        most: usize,
    ) -> (f64, Vec<Vec<DVec3>>) {
        let mut best = (f64::INFINITY, Vec::new());
        let mut chain = Vec::new();
        self.extend(from, to, most, &mut chain, &mut Vec::new(), &mut best);
        best
    }

    fn extend(
        &self,
        (cell, from): (CellId, DVec3),
        to: (CellId, DVec3),
        most: usize,
        chain: &mut Vec<Vec<DVec3>>,
        used: &mut Vec<PortalId>,
        best: &mut (f64, Vec<Vec<DVec3>>),
    ) {
        let length = least_length(from, to.1, chain);
        if length >= best.0 {
            return;
        }
        if cell == to.0 {
            *best = (length, chain.clone());
        }
        if chain.len() == most {
            return;
        }
        for exit in self.layout.exits(cell) {
            if used.contains(&exit.portal) {
                continue;
            }
            let pieces: Vec<_> = self.layout.opening(exit.portal).pieces().collect();
            assert_eq!(pieces.len(), 1, "openings of these worlds are rectangles");
            chain.push(pieces[0].to_vec());
            used.push(exit.portal);
            self.extend((exit.to, from), to, most, chain, used, best);
            chain.pop();
            used.pop();
        }
    }
}

/// W11: length ≤ 1.001 × the least over all sequences, and arrival from the direction of that string.
#[test]
fn the_shortest_of_all_sequences_is_found() {
    let mut rng = Rng::new(4);
    let mut n_checked = 0;
    for seed in 0..6 {
        let site = site(&rooms(16, seed));
        for _ in 0..12 {
            let (listener, source) = (site.place(&mut rng), site.place(&mut rng));
            let Some(heard) = site.hear(listener, source) else {
                continue;
            };
            let (least, chain) = site.least(listener, source, 8);
            if least == f64::INFINITY {
                continue;
            }
            n_checked += 1;
            assert!(
                heard.length <= 1.001 * least + 1e-6,
                "{} {least}",
                heard.length
            );
            if chain.is_empty() {
                let straight = (source.1 - listener.1).normalize();
                assert!((heard.nearest - straight).length() < 1e-9);
            }
        }
    }
    assert!(n_checked > 50, "{n_checked}");
}

/// W11: on a walk through each doorway the level changes by at most 0.5 dB per centimeter, the direction by 5° and the length by
/// 2 cm, for a listener without memory.
#[test]
fn walking_through_doorways_changes_the_level_little_by_little() {
    let mut rng = Rng::new(9);
    let mut n_checked = 0;
    for seed in 0..4 {
        let site = site(&rooms(16, seed));
        for p in (0..site.layout.n_portals() as u32).map(PortalId) {
            let opening = site.layout.opening(p);
            let source = site.place(&mut rng);
            let mut before: Option<Heard> = None;
            for k in -150..150 {
                let at = opening.center() + opening.normal() * (f64::from(k) + 0.5) * 0.01;
                let Some(cell) = site.layout.locate(at) else {
                    continue;
                };
                let mut ears = Listener::new();
                ears.listen(&site.acoustics, &site.state, cell, at);
                let heard = ears.hear(&site.acoustics, &site.layout, 0, source.0, source.1);
                let Some(heard) = heard else { break };
                if let Some(before) = before {
                    n_checked += 1;
                    let level = 20.0 * (heard.gain / before.gain).log10();
                    let turn = heard.direction.angle_between(before.direction);
                    let length = heard.length - before.length;
                    let is_small = [level / 0.5, turn.to_degrees() / 5.0, length / 0.02];
                    assert!(
                        is_small.iter().all(|x| x.abs() <= 1.0),
                        "portal {p:?} at {k}: {before:?} to {heard:?}"
                    );
                }
                before = Some(heard);
            }
        }
    }
    assert!(n_checked > 5000, "{n_checked}");
}

/// W11.
#[test]
fn a_door_that_shuts_takes_its_loss() {
    let mut two = site(&GridParams::two_rooms());
    let door = PortalId(0);
    let middle = two.layout.opening(door).center();
    let normal = two.layout.opening(door).normal();
    let ends = [-1.0, 1.0].map(|k| middle + normal * k);
    let places = ends.map(|p| (two.layout.locate(p).unwrap(), p));
    let open = two.hear(places[0], places[1]).unwrap();
    two.state.close(door);
    let shut = two.hear(places[0], places[1]).unwrap();
    assert!((open.length - 2.0).abs() < 1e-9 && (shut.length - 2.0).abs() < 1e-9);
    let loss = 20.0 * (open.gain / shut.gain).log10();
    let kind = two.world.graph.portals[0].kind;
    assert!((27.0..=30.5).contains(&loss), "{loss} dB of {kind:?}");
}

/// W11: a walking listener allocates nothing once its buffers have grown.
#[test]
fn hearing_allocates_nothing_once_warm() {
    let site = site(&rooms(36, 3));
    let mut rng = Rng::new(6);
    let sources: Vec<_> = (0..16).map(|_| site.place(&mut rng)).collect();
    let mut ears = Listener::new();
    let walk = |ears: &mut Listener| {
        for p in (0..site.layout.n_portals() as u32).map(PortalId) {
            let at = site.layout.opening(p).center() + site.layout.opening(p).normal() * 0.3;
            let Some(cell) = site.layout.locate(at) else {
                continue;
            };
            ears.listen(&site.acoustics, &site.state, cell, at);
            for (id, source) in sources.iter().enumerate() {
                ears.hear(&site.acoustics, &site.layout, id, source.0, source.1);
            }
        }
    };
    walk(&mut ears);
    let counted = allocation_counter::measure(|| walk(&mut ears));
    assert_eq!(counted.count_total, 0);
}
