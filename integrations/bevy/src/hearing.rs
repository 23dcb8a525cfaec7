//! Sounds as they are heard through doorways: level, direction and delay, for whatever audio engine a program has.

use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};
use enfilade::PortalId;
use enfilade::geom::DVec3;
use enfilade::world::{
    Acoustics, Listener, OCTAVES, PartId, Place, SPEED_OF_SOUND, Space, Transmission,
};

use crate::labels::PortalRoot;
use crate::space::into_root;
use crate::state::PortalState;
use crate::world::PortalWorld;

/// Most emitters that are heard anew in a frame; of more, each has its turn.
const MOST: usize = 32;

/// Marks what makes sounds: a radio, a fountain, a voice. Its [`Heard`] is kept up to date for the entity with [`Ears`].
#[derive(Component, Reflect, Default, Clone, Copy, Debug)]
#[reflect(Component, Default)]
#[require(Transform, Heard)]
pub struct Emitter;

/// Marks who hears: mostly the camera. Of several, the first one is it.
#[derive(Component, Reflect, Default, Clone, Copy, Debug)]
#[reflect(Component, Default)]
#[require(Transform)]
pub struct Ears;

/// An [`Emitter`] as the entity with [`Ears`] hears it, without reverberation: over all ways through openings, by how far doors are open.
///
/// For an audio engine, play the sound at `gain` times its volume, `direction` from the ears, filtered so that octaves are as `bands`.
/// Nothing is smoothed over time, and values of a walking listener mostly change slowly; engines smooth volumes anyway.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default)]
pub struct Heard {
    /// Amplitude, relative to that at one meter in the open; 0 if nothing is heard, and before the world is ready.
    pub gain: f32,
    /// The same in each octave from 125 Hz to 4 kHz; doors and walls dampen the higher ones more.
    pub bands: [f32; OCTAVES.len()],
    /// Unit vector from the ears towards where it seems to come from, such as a doorway; zero at the ears, and if nothing is heard.
    pub direction: Vec3,
    /// Length of the shortest way. [Units: wu]
    pub length: f32,
}

impl Heard {
    /// Returns the level relative to that at one meter in the open; negative infinity if nothing is heard. [Units: dB]
    #[must_use]
    pub fn level(&self) -> f32 {
        20.0 * self.gain.log10()
    }

    /// Returns the time that the sound takes. [Units: s]
    #[must_use]
    pub fn delay(&self) -> f32 {
        self.length / SPEED_OF_SOUND as f32
    }

    /// Returns a point in the direction that it comes from, as far from the ears as an unhindered source of the same level is. An engine
    /// for sources in the open plays it there.
    #[must_use]
    pub fn position(&self, ears: Vec3) -> Vec3 {
        ears + self.direction / self.gain.max(1e-5)
    }
}

/// Hearing in a spawned world, once there are emitters.
#[derive(Component)]
pub(crate) struct Hearing {
    revision: u32,
    stage: Stage,
}

enum Stage {
    /// A thread measures the ways around walls, which takes a second or two for a large building.
    Preparing(Task<Box<Prepared>>),
    Ready(Box<Prepared>),
}

struct Prepared {
    space: Space,
    acoustics: Acoustics,
    listener: Listener,
    /// Emitters by the numbers that the listener knows them by.
    emitters: Vec<Entity>,
    /// The one whose turn is next.
    next: usize,
}

impl Hearing {
    fn prepare(world: &PortalWorld, revision: u32) -> Self {
        let (world, sight) = (world.world.clone(), world.sight.clone());
        let task = AsyncComputeTaskPool::get().spawn(async move {
            let space = Space::with_sight(world, sight);
            Box::new(Prepared {
                acoustics: Acoustics::new(&space, &Transmission::default()),
                space,
                listener: Listener::new(),
                emitters: Vec::new(),
                next: 0,
            })
        });
        Self {
            revision,
            stage: Stage::Preparing(task),
        }
    }

    fn ready(&mut self) -> Option<&mut Prepared> {
        if let Stage::Preparing(task) = &mut self.stage {
            let ready = block_on(poll_once(task))?;
            self.stage = Stage::Ready(ready);
        }
        match &mut self.stage {
            Stage::Ready(ready) => Some(ready),
            Stage::Preparing(_) => None,
        }
    }
}

type Worlds<'a> = (
    Entity,
    &'a PortalRoot,
    &'a PortalState,
    &'a GlobalTransform,
    Option<&'a mut Hearing>,
);

/// Hears all emitters, or some of many.
pub(crate) fn hear(
    mut commands: Commands,
    ears: Query<&GlobalTransform, With<Ears>>,
    mut emitters: Query<(Entity, &GlobalTransform, &mut Heard), With<Emitter>>,
    mut roots: Query<Worlds>,
    worlds: Res<Assets<PortalWorld>>,
) {
    let Some(ears) = ears.iter().next() else {
        return;
    };
    if emitters.is_empty() {
        return;
    }
    for (root, own, state, place, hearing) in &mut roots {
        let Some(world) = worlds.get(&own.world) else {
            continue;
        };
        let Some(mut hearing) = hearing.filter(|h| h.revision == state.revision) else {
            let hearing = Hearing::prepare(world, state.revision);
            commands.entity(root).insert(hearing);
            continue;
        };
        let (Some(ready), Some(into)) = (hearing.ready(), into_root(place)) else {
            continue;
        };
        let local = |p: Vec3| into.transform_point3(p).as_dvec3().to_array();
        let local = |p: Vec3| DVec3::from_array(local(p));
        let at = local(ears.translation());
        // In solid matter, and in the next world, what was heard last goes on.
        let Some(here) = ready.space.locate(PartId::ROOT, at) else {
            continue;
        };
        ready.follow_doors(state);
        ready
            .listener
            .listen(&ready.acoustics, &ready.space, here, at);
        ready.count(
            |entity| emitters.contains(entity),
            emitters.iter().map(|e| e.0),
        );
        let n = ready.emitters.len();
        for _ in 0..n.min(MOST) {
            let id = ready.next % n;
            ready.next = id + 1;
            let Ok((_, emitter, mut heard)) = emitters.get_mut(ready.emitters[id]) else {
                continue;
            };
            let at = local(emitter.translation());
            let now = ready.hear(id, at, |d| place.affine().transform_vector3(d));
            heard.set_if_neq(now);
        }
        return;
    }
}

impl Prepared {
    /// Takes over how far doors are open.
    fn follow_doors(&mut self, state: &PortalState) {
        let n = self.space.world(PartId::ROOT).graph.portals.len();
        for portal in (0..n as u32).map(PortalId) {
            let known = self.space.state(PartId::ROOT);
            let is_open = state.doors.is_open(portal);
            match state.doors.leaves(portal) {
                Some(share) if known.leaves(portal) != Some(share) => {
                    self.space.set_leaves(PartId::ROOT, portal, share);
                }
                None if known.is_open(portal) != is_open => match is_open {
                    true => self.space.open(PartId::ROOT, portal),
                    false => self.space.close(PartId::ROOT, portal),
                },
                _ => {}
            }
        }
    }

    /// Gives each emitter a number, those of emitters that are gone first.
    fn count(&mut self, is_there: impl Fn(Entity) -> bool, all: impl Iterator<Item = Entity>) {
        let mut new: Vec<Entity> = all.filter(|e| !self.emitters.contains(e)).collect();
        for slot in &mut self.emitters {
            if !is_there(*slot)
                && let Some(entity) = new.pop()
            {
                *slot = entity;
            }
        }
        self.emitters.extend(new);
    }

    /// Returns an emitter as heard.
    fn hear(&mut self, id: usize, at: DVec3, out: impl Fn(Vec3) -> Vec3) -> Heard {
        let there: Option<Place> = self.space.locate(PartId::ROOT, at);
        let heard = there.and_then(|there| self.listener.hear(&self.acoustics, id, there, at));
        heard.map_or_else(Heard::default, |heard| {
            let direction = Vec3::from_array(heard.direction.to_array().map(|x| x as f32));
            Heard {
                gain: heard.gain as f32,
                bands: heard.bands.map(|b| b as f32),
                direction: out(direction).normalize_or_zero(),
                length: heard.length as f32,
            }
        })
    }
}
