//! Walks of paths: the share of walkers that reach the end of the path planned for them, in furnished buildings, opening
//! doors on the way.
//!
//! Ends are places where a body can stand, chosen without the map: uniform over the cells, then over the box of each.

use anyhow::ensure;
use enfilade::cpg::{CellId, World};
use enfilade::geom::DVec3;
use enfilade::runtime::{SightState, Target};
use enfilade::world::{
    Agent, Body, Cast, Caster, Layout, NoPath, PartId, Path, PathFollower, PathSearch, Place,
    Space, WalkMap, WalkProgress, Walker,
};
use enfilade_testkit::Rng;

use crate::rows::Figure;

const ROOT: PartId = PartId::ROOT;

/// Number of paths walked.
const PATHS: usize = 100;
/// Most pairs of places tried for each.
const TRIES: usize = 50;
/// Speed of walking. [Units: wu/s]
const SPEED: f64 = 1.4;
/// Time step. [Units: s]
const SECONDS: f64 = 1.0 / 60.0;
/// Shortest path walked. [Units: wu]
const SHORTEST: f64 = 2.0;

/// A walk of a path.
pub(super) struct Walk {
    pub(super) path: Path,
    pub(super) progress: WalkProgress,
    /// Where it ended.
    pub(super) at: DVec3,
    /// Length of the path passed. [Units: wu]
    pub(super) passed: f64,
    /// Names of the obstacles that it touches there.
    pub(super) touched: Vec<String>,
}

/// All walks of a building.
#[derive(Default)]
pub(super) struct Walks {
    pub(super) walks: Vec<Walk>,
    /// Pairs without a way.
    pub(super) n_no_way: usize,
    /// Pairs of which one has no floor on the map.
    pub(super) n_no_floor: usize,
}

/// Plans paths between random places of a building and walks them.
pub(super) fn walks(world: &World) -> anyhow::Result<Walks> {
    let mut space = Space::new(world.clone())?;
    let agent = Agent::default();
    let map = WalkMap::new(&space, agent);
    let as_modeled = SightState::new(space.sight(ROOT));
    let mut places = Places::new(agent);
    let (mut search, mut all) = (PathSearch::new(), Walks::default());
    for _ in 0..PATHS * TRIES {
        if all.walks.len() == PATHS {
            break;
        }
        space.set_state(ROOT, as_modeled.clone());
        let (Some(from), Some(to)) = (places.any(&space), places.any(&space)) else {
            break;
        };
        let mut path = Path::default();
        let ends = [from, to].map(|p| (ROOT, p));
        match search.find(&map, &space, ends, |_, _| true, &mut path) {
            Ok(()) if path.length < SHORTEST => continue,
            Ok(()) => {}
            Err(NoPath::NoWay) => {
                all.n_no_way += 1;
                continue;
            }
            Err(NoPath::NoFloorAtStart | NoPath::NoFloorAtEnd) => {
                all.n_no_floor += 1;
                continue;
            }
        }
        let eye = path.points[0].at + DVec3::Y * agent.eye;
        let mut walker = Walker::new(agent, ROOT, eye);
        let mut follower = PathFollower::new(&space, path.clone(), SPEED);
        // A walker that follows its path takes no longer, whatever it slides along.
        let most = (10.0 + 2.0 * path.length / SPEED) / SECONDS;
        let mut progress = WalkProgress::Walking;
        for _ in 0..most as usize {
            progress = follower.step(&mut walker, &mut space, SECONDS);
            if progress != WalkProgress::Walking {
                break;
            }
        }
        let at = walker.feet();
        let mut touched = Vec::new();
        if progress != WalkProgress::Arrived {
            touched = places.touched_at(&space, at);
        }
        all.walks.push(Walk {
            path,
            progress,
            at,
            passed: follower.passed(),
            touched,
        });
    }
    Ok(all)
}

/// Places where a body can stand.
pub(super) struct Places {
    caster: Caster,
    rng: Rng,
    agent: Agent,
}

impl Places {
    pub(super) fn new(agent: Agent) -> Self {
        Self {
            caster: Caster::new(),
            rng: Rng::new(1),
            agent,
        }
    }

    /// Returns what a body a little wider than the walker touches, by name.
    fn touched_at(&mut self, space: &Space, feet: DVec3) -> Vec<String> {
        let world: &World = space.world(ROOT);
        let Agent {
            radius,
            height,
            step,
            ..
        } = self.agent;
        let body = Body::upright(height - step + 0.06, radius + 0.03);
        let middle = feet + DVec3::Y * 0.5 * (height + step);
        let mut names = Vec::new();
        if let Some(place) = space.locate(ROOT, middle) {
            self.caster
                .for_each_contact(space, &body, ROOT, middle, place, |contact| {
                    let [x, _, z] = contact.normal.to_array();
                    names.push(match contact.target {
                        Target::Detail { detail, .. } => {
                            format!("{} ({x:.1} {z:.1})", world[detail].name)
                        }
                        Target::Wall { .. } => format!("wall ({x:.1} {z:.1})"),
                        Target::Portal(p) => format!("{p} ({x:.1} {z:.1})"),
                    });
                });
        }
        names.sort();
        names.dedup();
        names
    }

    /// Returns a place where the body stands free, with doors as in the model.
    pub(super) fn any(&mut self, space: &Space) -> Option<DVec3> {
        let layout: &Layout = space.layout(ROOT);
        let Agent {
            radius,
            height,
            step,
            ..
        } = self.agent;
        let body = Body::upright(height - step, radius);
        let point = Body::Sphere { radius: 0.0 };
        for _ in 0..100_000 {
            let cell = CellId(self.rng.below(layout.n_cells()) as u32);
            let bounds = layout.cell(cell).bounds;
            let rng = &mut self.rng;
            let share = DVec3::new(rng.unit(), rng.unit(), rng.unit());
            let from = bounds.min + bounds.size() * share;
            if layout.locate(from) != Some(cell) {
                continue;
            }
            let cast = Cast {
                body: &point,
                frame: ROOT,
                from,
                by: DVec3::Y * -20.0,
                place: Place { part: ROOT, cell },
            };
            let floor = self.caster.cast(space, &cast);
            let Some(floor) = floor.filter(|f| f.normal.y >= self.agent.slope.cos()) else {
                continue;
            };
            let middle = floor.point + DVec3::Y * 0.5 * (height + step);
            let Some(place) = space.locate(ROOT, middle) else {
                continue;
            };
            let mut is_free = true;
            self.caster
                .for_each_contact(space, &body, ROOT, middle, place, |_| {
                    is_free = false;
                });
            if is_free {
                return Some(floor.point);
            }
        }
        None
    }
}

/// Measures the share of walkers that do not reach the end of their path.
pub(super) fn walk(world: &World) -> anyhow::Result<Figure> {
    let all = walks(world)?;
    let n = all.walks.len();
    ensure!(n >= PATHS / 2, "only {n} paths in {} pairs", PATHS * TRIES);
    let is_lost = |walk: &&Walk| walk.progress != WalkProgress::Arrived;
    let lost: Vec<String> = (all.walks.iter().filter(is_lost))
        .map(|w| {
            let [passed, length] = [w.passed, w.path.length_in_plan];
            let touched = w.touched.join(", ");
            format!(
                "; lost at {:.2} after {passed:.1} of {length:.1} m, touches {touched}",
                w.at
            )
        })
        .collect();
    let meters: f64 = all.walks.iter().map(|w| w.path.length).sum();
    let n_portals: usize = all.walks.iter().map(|w| w.path.portals.len()).sum();
    let note = format!(
        "of {n} walkers, the share that does not reach the end; {meters:.0} m through {n_portals} portals; {} pairs of \
             places have no way, {} no floor on the map{}",
        all.n_no_way,
        all.n_no_floor,
        lost.concat()
    );
    Ok(Figure::new(lost.len() as f64 / n as f64, 0.01, note))
}
