//! Time of an operation in the window: the work of the processor from a click to the next view, without the adapter's own.

use std::sync::Arc;
use std::time::Instant;

use anyhow::ensure;
use enfilade::View;
use enfilade::edit::{EditGround, EditOperation, EditSession, EditedSpace};
use enfilade::geom::DVec3;
use enfilade::internals::edit::random::random_operation;
use enfilade::kit::{Assembly, InstanceId};
use enfilade::world::{PartId, Pose, Space, SpaceViewer};
use enfilade_cli::adapter;
use enfilade_render::{AdapterChoice, Studio};
use enfilade_testkit::Rng;

use super::scenes::level;
use crate::measure::quantile;
use crate::rows::Figure;

/// Operations that are timed, undos and redos included.
const OPERATIONS: usize = 400;

/// A session with everything that the window keeps of it.
struct Shown {
    session: EditSession,
    parts: EditedSpace,
    space: Space,
    studio: Studio,
    viewer: SpaceViewer,
}

impl Shown {
    fn new(level: &Assembly) -> anyhow::Result<Self> {
        let mut session = EditSession::new(Arc::clone(level.kit()), EditGround::Open)?;
        for (_, instance) in level.instances() {
            let piece = level.kit().pieces()[instance.piece].name();
            session.apply(EditOperation::put(piece, None, instance.pose))?;
        }
        let (parts, space) = EditedSpace::new(&mut session)?;
        let gpu = adapter::open(&AdapterChoice::Software)?;
        let mut studio = Studio::new(gpu, space.world(PartId::ROOT))?;
        studio.follow_parts(&space)?;
        Ok(Self {
            viewer: SpaceViewer::new(&space),
            session,
            parts,
            space,
            studio,
        })
    }

    /// Shows what has changed in a view from a place.
    fn show(&mut self, eye: DVec3) -> anyhow::Result<usize> {
        self.parts.follow(&mut self.space, &mut self.session)?;
        self.studio.follow_parts(&self.space)?;
        let eye = eye.as_vec3().to_array();
        let view = View::perspective(eye, [1.0, 0.0, 0.3], [0.0, 1.0, 0.0], 1.0, 16.0 / 9.0)?;
        let seen = self.viewer.see(&self.space, PartId::ROOT, &view);
        Ok(seen.parts().len())
    }
}

/// A step of the window.
enum EditStep {
    Made(EditOperation),
    Undo,
    Redo,
}

/// Returns a step by chance: a change by hand or of a piece in turn, with an undo and a redo between them.
fn step(session: &EditSession, n: usize, rng: &mut Rng) -> EditStep {
    let wants_hand = match n % 6 {
        1 | 4 => return EditStep::Undo,
        2 | 5 => return EditStep::Redo,
        turn => turn == 0,
    };
    loop {
        let operation = random_operation(session, &mut |n| rng.below(n));
        let is_by_hand = matches!(operation, EditOperation::Make(_) | EditOperation::Unmake(_));
        if is_by_hand == wants_hand {
            return EditStep::Made(operation);
        }
    }
}

/// Milliseconds of an operation in a level and of the view after it: the slowest of a hundred.
pub(super) fn operation(scene: &str) -> anyhow::Result<Figure> {
    let level = level(scene)?.level;
    let mut shown = Shown::new(&level)?;
    let mut rng = Rng::new(5);
    let (mut times, mut n_refused) = (Vec::new(), 0);
    while times.len() < OPERATIONS {
        let eye = eye(shown.session.level(), &mut rng);
        let step = step(&shown.session, times.len(), &mut rng);
        let start = Instant::now();
        let is_made = match step {
            EditStep::Undo => shown.session.undo()?,
            EditStep::Redo => shown.session.redo()?,
            EditStep::Made(operation) => shown.session.apply(operation).is_ok(),
        };
        shown.show(eye)?;
        if !is_made {
            n_refused += 1;
            ensure!(n_refused < 10 * OPERATIONS, "most operations are refused");
            continue;
        }
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    let slow = quantile(&mut times, 0.99);
    let note = format!(
        "ms, 99 of 100, of {OPERATIONS} operations, undos and redos with the view after each; {:.2} ms in the middle; {} instances",
        quantile(&mut times, 0.5),
        level.len()
    );
    Ok(Figure::new(slow, 16.0, note))
}

/// Returns the middle of a random room.
fn eye(level: &Assembly, rng: &mut Rng) -> DVec3 {
    let all: Vec<InstanceId> = level.instances().map(|(id, _)| id).collect();
    let id = all[rng.below(all.len())];
    let pose = level.standing(id).map_or(Pose::IDENTITY, |i| i.pose);
    let rooms = level.piece(id).world().graph.rooms();
    let middles = rooms.map(|(_, c)| {
        let [low, high] = c.aabb.map(|p| DVec3::from(p.map(f64::from)));
        (low + high) * 0.5
    });
    pose.point(middles.last().unwrap_or(DVec3::Y))
}
