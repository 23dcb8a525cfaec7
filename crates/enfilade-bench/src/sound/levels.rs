//! Jumps of what is heard on walks through doorways, centimeter by centimeter. A listener hears what a fresh one hears, so that nothing
//! is smoothed: compared every 29 cm.

use std::sync::Arc;

use anyhow::Context;
use enfilade::cpg::PortalKind;
use enfilade::geom::DVec3;
use enfilade::world::{Heard, Listener, PartId, Place};
use enfilade::{PortalId, World};
use enfilade_testkit::Rng;

use super::heard::Office;
use crate::kept::Kept;
use crate::rows::Figure;

/// Number of walks in a building, half of them through doors that stand half open.
const N_WALKS: usize = 1000;
/// Number of sources heard on one walk, each counted as a walk.
const N_SOURCES: usize = 5;
/// Length of a walk on either side of the opening, in centimeters.
const REACH: i32 = 150;
/// Smallest opening to walk through. [Units: wu²]
const DOORWAY: f64 = 1.0;

/// The largest change from one centimeter to the next, and the walk on which it was.
#[derive(Debug, Default)]
struct Jump {
    value: f64,
    at: String,
}

impl Jump {
    fn raise(&mut self, value: f64, at: impl FnOnce() -> String) {
        if value > self.value {
            (self.value, self.at) = (value, at());
        }
    }
}

#[derive(Debug, Default)]
struct Jumps {
    /// Largest changes of level, direction and length.
    most: [Jump; 3],
    n_walks: usize,
    n_steps: usize,
    /// Steps with a change of level, direction or length above the bar.
    n_above: [usize; 3],
}

impl Jumps {
    fn add(&mut self, a: &Heard, b: &Heard, place: impl Fn() -> String) {
        self.n_steps += 1;
        let level = (20.0 * (a.gain / b.gain).log10()).abs();
        let turn = a.direction.angle_between(b.direction).to_degrees();
        let length = (a.length - b.length).abs();
        for (i, value) in [level, turn, length].into_iter().enumerate() {
            self.n_above[i] += usize::from(value > BARS[i]);
            self.most[i].raise(value, &place);
        }
    }
}

/// Bars of changes per centimeter. [Units: dB, degrees, wu]
const BARS: [f64; 3] = [1.0, 5.0, 0.02];

/// Portals to walk through.
fn doorways(site: &Office) -> Vec<PortalId> {
    let portals = (0..site.layout().n_portals() as u32).map(PortalId);
    let is_doorway = |p: &PortalId| {
        let opening = site.layout().opening(*p);
        let is_upright = opening.normal().y.abs() < 0.1;
        let kinds = [PortalKind::Door, PortalKind::Open];
        is_upright && kinds.contains(&opening.kind()) && opening.area() >= DOORWAY
    };
    portals.filter(is_doorway).collect()
}

/// Greatest difference from a fresh listener, as a share of the gain, in radians and in lengths.
const SAME: f64 = 1e-5;

fn ensure_same(walked: Option<Heard>, fresh: Option<Heard>) -> anyhow::Result<()> {
    let is_same = match (&walked, &fresh) {
        (Some(a), Some(b)) => {
            let level = (a.gain / b.gain - 1.0).abs();
            level < SAME
                && (a.direction - b.direction).length() < SAME
                && (a.length - b.length).abs() < SAME
        }
        (a, b) => a.is_none() && b.is_none(),
    };
    anyhow::ensure!(is_same, "a fresh listener hears {fresh:?}, not {walked:?}");
    Ok(())
}

fn walk(
    site: &Office,
    door: PortalId,
    share: f32,
    sources: &[(Place, DVec3)],
    jumps: &mut Jumps,
) -> anyhow::Result<()> {
    let opening = site.layout().opening(door);
    let mut before: Vec<Option<Heard>> = vec![None; sources.len()];
    let mut ears = Listener::new();
    for k in -REACH..REACH {
        let at = opening.center() + opening.normal() * (f64::from(k) + 0.5) * 0.01;
        let place = site.locate(at);
        let Some(place) = place.filter(|p| opening.cells().contains(&p.cell)) else {
            before.fill(None);
            continue;
        };
        ears.listen(&site.acoustics, &site.space, place, at);
        for (id, &source) in sources.iter().enumerate() {
            let heard = ears.hear(&site.acoustics, id, source.0, source.1);
            if k % 29 == 0 {
                let mut fresh = Listener::new();
                fresh.listen(&site.acoustics, &site.space, place, at);
                let other = fresh.hear(&site.acoustics, id, source.0, source.1);
                ensure_same(heard, other)?;
            }
            let place = || {
                format!(
                    "portal {}, open {share}, {k} cm, source {}",
                    door.0, source.1
                )
            };
            if let (Some(a), Some(b)) = (before[id], heard) {
                jumps.add(&a, &b, place);
            }
            before[id] = heard;
        }
    }
    Ok(())
}

fn jumps_of(site: &mut Office) -> anyhow::Result<Jumps> {
    let mut rng = Rng::new(9);
    let doors = doorways(site);
    let mut jumps = Jumps::default();
    for share in [1.0, 0.5] {
        for &p in &doors {
            if site.layout().opening(p).kind() == PortalKind::Door {
                site.space.open(PartId::ROOT, p);
                site.space.set_leaves(PartId::ROOT, p, share);
            }
        }
        for k in 0..N_WALKS / 2 / N_SOURCES {
            let door = *doors.get(k % doors.len().max(1)).context("no doorway")?;
            let places = (0..N_SOURCES).map(|_| site.place(&mut rng));
            let sources: Vec<_> = places.collect::<Option<_>>().context("no place")?;
            walk(site, door, share, &sources, &mut jumps)?;
            jumps.n_walks += N_SOURCES;
        }
    }
    Ok(jumps)
}

/// Returns the jumps of a site: three rows share them.
fn jumps(name: &str, site: impl FnOnce() -> anyhow::Result<Office>) -> anyhow::Result<Arc<Jumps>> {
    static KNOWN: Kept<Jumps> = Kept::new();
    KNOWN.get(name, || jumps_of(&mut site()?))
}

/// The rows: levels, directions and lengths.
pub(super) const LEVEL: usize = 0;
pub(super) const DIRECTION: usize = 1;
pub(super) const LENGTH: usize = 2;

fn figure(jumps: &Jumps, kind: usize) -> Figure {
    let scale = [1.0, 1.0, 100.0][kind];
    let unit = ["dB", "degrees", "centimeters"][kind];
    let jump = &jumps.most[kind];
    let note = format!(
        "{unit} per centimeter, the largest on {} walks, {} of {} steps above the bar; {}",
        jumps.n_walks, jumps.n_above[kind], jumps.n_steps, jump.at
    );
    Figure::new(jump.value * scale, BARS[kind] * scale, note)
}

/// Measures the largest change of a kind in a building.
pub(super) fn baked<const KIND: usize>(world: &World) -> anyhow::Result<Figure> {
    let graph = &world.graph;
    let sizes = [graph.cells.len(), graph.portals.len(), world.batches.len()];
    let jumps = jumps(&format!("{sizes:?}"), || Office::new(world))?;
    Ok(figure(&jumps, KIND))
}

/// Measures the same in generated offices.
pub(super) fn made<const KIND: usize>(name: &str) -> anyhow::Result<Figure> {
    let jumps = jumps(name, || Office::offices(100, 5))?;
    Ok(figure(&jumps, KIND))
}
