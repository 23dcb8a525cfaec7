//! Sources as listeners hear them. Covers W11.

use crate::cone;

use cone::least_length;
use enfilade_cpg::{CellId, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_testkit::{GridParams, Rng, room_grid, with_doors};
use enfilade_world::{Acoustics, Heard, Layout, Listener, PartId, Place, Space, Transmission};

struct Site {
    space: Space,
    acoustics: Acoustics,
}

fn site(params: &GridParams) -> Site {
    site_of(room_grid(params))
}

fn site_of(world: World) -> Site {
    let space = Space::new(world).unwrap();
    let acoustics = Acoustics::new(&space, &Transmission::default());
    Site { space, acoustics }
}

/// A cell of the root.
fn place(cell: CellId) -> Place {
    Place {
        part: PartId::ROOT,
        cell,
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
    fn layout(&self) -> &Layout {
        self.space.layout(PartId::ROOT)
    }

    fn place(&self, rng: &mut Rng) -> (CellId, DVec3) {
        loop {
            let cell = CellId(rng.below(self.layout().n_cells()) as u32);
            let bounds = self.layout().cell(cell).bounds;
            let share = DVec3::from([0; 3].map(|_| rng.range(0.05, 0.95)));
            let at = bounds.min + (bounds.max - bounds.min) * share;
            if self.layout().locate(at) == Some(cell) {
                return (cell, at);
            }
        }
    }

    fn hear(&self, listener: (CellId, DVec3), source: (CellId, DVec3)) -> Option<Heard> {
        let mut ears = Listener::new();
        ears.listen(&self.acoustics, &self.space, place(listener.0), listener.1);
        ears.hear(&self.acoustics, 0, place(source.0), source.1)
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
        for exit in self.layout().exits(cell) {
            if used.contains(&exit.portal) {
                continue;
            }
            let pieces: Vec<_> = self.layout().opening(exit.portal).pieces().collect();
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
            let mut ears = Listener::new();
            ears.listen(&site.acoustics, &site.space, place(listener.0), listener.1);
            let found = ears.shortest(&site.acoustics, 0, place(source.0), source.1);
            let Some((length, nearest)) = found else {
                continue;
            };
            let (least, chain) = site.least(listener, source, 8);
            if least == f64::INFINITY {
                continue;
            }
            n_checked += 1;
            assert!(length <= 1.001 * least + 1e-6, "{length} {least}");
            if chain.is_empty() {
                let straight = (source.1 - listener.1).normalize();
                assert!((nearest - straight).length() < 1e-9);
            }
        }
    }
    assert!(n_checked > 50, "{n_checked}");
}

/// The least length of a line that bends at a point of each of two parallel edges, by trying points 5 cm apart.
fn over_two_edges([a, b]: [DVec3; 2], edges: [[DVec3; 2]; 2]) -> f64 {
    let n = (edges[0][0].distance(edges[0][1]) * 20.0) as usize;
    let at = |edge: [DVec3; 2], k: usize| edge[0].lerp(edge[1], k as f64 / n as f64);
    let mut least = f64::INFINITY;
    for k in 0..=n {
        let p = at(edges[0], k);
        let rest = (0..=n).map(|j| {
            let q = at(edges[1], j);
            a.distance(p) + p.distance(q) + q.distance(b)
        });
        least = rest.fold(least, f64::min);
    }
    least
}

/// W11: outdoors, from one side of a building without openings to the other, sound goes around it, and its level falls as about a
/// screen.
#[test]
fn sound_goes_around_a_building() {
    let closed = site(&GridParams {
        size: [3, 1, 2],
        doors: 0.0,
        windows: 0.0,
        furniture: 0,
        outdoors: true,
        ..GridParams::offices(6, 1)
    });
    let mut walls = enfilade_geom::Aabb::EMPTY;
    for b in &closed.space.world(PartId::ROOT).batches {
        for p in b.primitive.triangles().flatten() {
            walls = walls.including(p);
        }
    }
    let (low, high) = (walls.min, walls.max);
    let mut rng = Rng::new(3);
    let outdoors = closed.layout().outdoors().expect("there is an outdoors");
    for _ in 0..20 {
        let ends = [low.z - 1.5, high.z + 1.5]
            .map(|z| DVec3::new(rng.range(low.x, high.x), rng.range(low.y, high.y), z));
        assert!(
            ends.iter()
                .all(|p| closed.layout().locate(*p) == Some(outdoors))
        );
        let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let mut least = f64::INFINITY;
        for x in [low.x, high.x] {
            let edges = [low.z, high.z].map(|z| [corner(x, low.y, z), corner(x, high.y, z)]);
            least = least.min(over_two_edges(ends, edges));
        }
        for y in [low.y, high.y] {
            let edges = [low.z, high.z].map(|z| [corner(low.x, y, z), corner(high.x, y, z)]);
            least = least.min(over_two_edges(ends, edges));
        }
        let heard = closed
            .hear((outdoors, ends[0]), (outdoors, ends[1]))
            .expect("a way around");
        assert!(
            (heard.length / least - 1.0).abs() < 0.005,
            "{} {least}",
            heard.length
        );
        let free = 1.0 / heard.length;
        assert!(
            heard.bands[0] < 0.9 * free && heard.bands[5] < 0.2 * free,
            "{heard:?}"
        );
    }
}

/// W11: on a walk through each doorway the level changes by at most 0.5 dB per centimeter, the direction by 5° and the length by
/// 2 cm, for a listener without memory.
#[test]
fn walking_through_doorways_changes_the_level_little_by_little() {
    let mut rng = Rng::new(9);
    let mut n_checked = 0;
    for seed in 0..4 {
        let site = site(&rooms(16, seed));
        for p in (0..site.layout().n_portals() as u32).map(PortalId) {
            let opening = site.layout().opening(p);
            let source = site.place(&mut rng);
            let mut before: Option<Heard> = None;
            for k in -150..150 {
                let at = opening.center() + opening.normal() * (f64::from(k) + 0.5) * 0.01;
                let Some(cell) = site.layout().locate(at) else {
                    continue;
                };
                let mut ears = Listener::new();
                ears.listen(&site.acoustics, &site.space, place(cell), at);
                let heard = ears.hear(&site.acoustics, 0, place(source.0), source.1);
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

/// How far a listener and one without memory are apart: share of the gain, radians and lengths; infinite if only one hears.
fn apart(a: Option<Heard>, b: Option<Heard>) -> f64 {
    match (a, b) {
        (Some(a), Some(b)) => {
            let level = (a.gain / b.gain - 1.0).abs();
            let turn = (a.direction - b.direction).length();
            level.max(turn).max((a.length - b.length).abs())
        }
        (None, None) => 0.0,
        _ => f64::INFINITY,
    }
}

/// W11: a walking listener hears what one without memory hears, to 1e-6 of the gain, a radian and a meter, and is as deaf to
/// what is too faint.
#[test]
fn a_walking_listener_hears_as_a_new_one() {
    let mut rng = Rng::new(12);
    let (mut n, mut n_faint) = (0, 0);
    for seed in 0..3 {
        // The last with walls to go around within rooms.
        let merges = if seed == 2 { 0.3 } else { 0.0 };
        let site = site(&GridParams {
            merges,
            ..rooms(36, seed)
        });
        for p in (0..site.layout().n_portals() as u32).map(PortalId) {
            let opening = site.layout().opening(p);
            let source = site.place(&mut rng);
            let mut walker = Listener::new();
            for k in -50..50 {
                let at = opening.center() + opening.normal() * (f64::from(k) + 0.5) * 0.02;
                let Some(cell) = site.layout().locate(at) else {
                    continue;
                };
                walker.listen(&site.acoustics, &site.space, place(cell), at);
                let heard = walker.hear(&site.acoustics, 0, place(source.0), source.1);
                let fresh = site.hear((cell, at), source);
                assert!(
                    apart(heard, fresh) < 1e-6,
                    "{seed} {p:?} {k}: {heard:?} {fresh:?}"
                );
                n += 1;
                n_faint += usize::from(heard.is_none());
            }
        }
    }
    assert!(n > 8000 && n_faint > 1000, "{n} {n_faint}");
}

/// W11: nor does it matter since when a listener has listened when doors swing, near and
/// far, from shut to open.
#[test]
fn a_listener_hears_doors_that_swing_as_a_new_one() {
    let mut rng = Rng::new(5);
    let mut site = site_of(with_doors(room_grid(&rooms(36, 1)), |_| false));
    let portals = (0..site.layout().n_portals() as u32).map(PortalId);
    portals.clone().for_each(|p| {
        site.space.open(PartId::ROOT, p);
        site.space.set_leaves(PartId::ROOT, p, 1.0);
    });
    let mut n = 0;
    for p in portals {
        let (here, there) = (site.place(&mut rng), site.place(&mut rng));
        let mut ears = Listener::new();
        for k in 0..60 {
            let open = (0.5 - 0.5 * (f64::from(k) * 0.1).cos()) as f32;
            site.space.set_leaves(PartId::ROOT, p, open);
            ears.listen(&site.acoustics, &site.space, place(here.0), here.1);
            let heard = ears.hear(&site.acoustics, 0, place(there.0), there.1);
            let fresh = site.hear(here, there);
            assert!(apart(heard, fresh) < 1e-6, "{p:?} {k}: {heard:?} {fresh:?}");
            n += usize::from(heard.is_some());
        }
        site.space.set_leaves(PartId::ROOT, p, 1.0);
    }
    assert!(n > 500, "{n}");
}

/// W11.
#[test]
fn a_door_that_shuts_takes_its_loss() {
    let mut two = site(&GridParams::two_rooms());
    let door = PortalId(0);
    let middle = two.layout().opening(door).center();
    let normal = two.layout().opening(door).normal();
    let ends = [-1.0, 1.0].map(|k| middle + normal * k);
    let places = ends.map(|p| (two.layout().locate(p).unwrap(), p));
    let open = two.hear(places[0], places[1]).unwrap();
    two.space.close(PartId::ROOT, door);
    let shut = two.hear(places[0], places[1]).unwrap();
    assert!((open.length - 2.0).abs() < 1e-9 && (shut.length - 2.0).abs() < 1e-9);
    let loss = 20.0 * (open.gain / shut.gain).log10();
    let kind = two.space.world(PartId::ROOT).graph.portals[0].kind;
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
        for p in (0..site.layout().n_portals() as u32).map(PortalId) {
            let at = site.layout().opening(p).center() + site.layout().opening(p).normal() * 0.3;
            let Some(cell) = site.layout().locate(at) else {
                continue;
            };
            ears.listen(&site.acoustics, &site.space, place(cell), at);
            for (id, source) in sources.iter().enumerate() {
                ears.hear(&site.acoustics, id, place(source.0), source.1);
            }
        }
    };
    // Strings change places, so that it takes some walks until each has room.
    for _ in 0..4 {
        walk(&mut ears);
    }
    let counted = allocation_counter::measure(|| walk(&mut ears));
    assert_eq!(counted.count_total, 0);
}
