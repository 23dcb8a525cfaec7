//! A world that is lived in, played by the clock.

use std::path::Path;

use enfilade::cpg::{CellId, PortalId, World};
use enfilade::geom::{DVec3, shown};
use enfilade::runtime::{Stops, View};
use enfilade::world::{
    Acoustics, ActorId, AwakeCells, Lamp, LampId, Lights, Listener, PartId, Pose, Space, SpaceSeen,
    SpaceViewer, Transmission,
};
use enfilade_render::{
    Camera, LampLight, Picture, Prop, PropMesh, RenderError, SpaceShot, Studio, Style, lamp_lights,
};

use super::doors::AutoDoors;
use super::file::{LivingFile, SoundEntry};
use super::lift::{Lift, LiftPlace};
use super::people::People;
use super::radar::{Blip, Radar};
use super::read::read_living;
use crate::walk::WorldFile;

/// Time that a cell stays awake after it was seen last. [Units: s]
const LINGER: f64 = 5.0;
/// Longest step in which doors move. [Units: s]
const LONGEST: f64 = 0.1;
/// Step of a recorded walk. [Units: s]
pub(crate) const STEP: f64 = 1.0 / 30.0;
/// Radius of a bulb. [Units: wu]
const BULB: f32 = 0.06;

/// Where the player is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Player {
    pub(crate) frame: PartId,
    pub(crate) eye: DVec3,
}

impl Player {
    /// Places a player in the world itself.
    pub(crate) fn at(eye: [f32; 3]) -> Self {
        Self {
            frame: PartId::ROOT,
            eye: DVec3::from(eye.map(f64::from)),
        }
    }
}

/// A sound as the player hears it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Heard {
    pub(crate) name: String,
    /// Level relative to that at 1 m. [Units: dB]
    pub(crate) level: f64,
    /// Length of the way to it. [Units: wu]
    pub(crate) length: f64,
}

/// Numbers of what is simulated, and of what is awake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LivedCounts {
    pub(crate) n_people: usize,
    pub(crate) n_awake: usize,
    pub(crate) n_awake_cells: usize,
    pub(crate) n_lamps: usize,
    pub(crate) n_lamps_seen: usize,
}

/// A world with lifts, doors, people, lamps and sounds.
pub(crate) struct Lived {
    pub(crate) space: Space,
    time: f64,
    file: LivingFile,
    lifts: Vec<Lift>,
    lift_places: Vec<LiftPlace>,
    doors: AutoDoors,
    people: People,
    /// Those of the world, then those of the file; as in `lights`.
    lamps: Vec<LampLight>,
    lights: Lights,
    viewer: SpaceViewer,
    awake: AwakeCells,
    /// Made if there are sounds.
    acoustics: Option<Acoustics>,
    listener: Listener,
    /// Points of those who may open doors.
    near: Vec<DVec3>,
    seen_lamps: Vec<u32>,
    pub(crate) counts: LivedCounts,
    /// Made when it is asked for.
    radar: Option<Radar>,
}

impl Lived {
    /// Reads a file that says what lives in a world, and prepares it.
    ///
    /// # Errors
    ///
    /// As [`read_living`] and [`Lived::new`].
    pub(crate) fn read(
        path: &Path,
        world: &World,
        world_file: Option<WorldFile<'_>>,
    ) -> anyhow::Result<Self> {
        let (file, lifts) = read_living(path)?;
        Self::new(world.clone(), file, lifts, world_file)
    }

    /// Prepares a world and what lives in it, at time 0. A map of floors beside the world's file is used.
    ///
    /// # Errors
    ///
    /// If a world cannot be prepared.
    pub(crate) fn new(
        world: World,
        file: LivingFile,
        lift_worlds: Vec<World>,
        world_file: Option<WorldFile<'_>>,
    ) -> anyhow::Result<Self> {
        Self::in_space(Space::new(world)?, file, lift_worlds, world_file)
    }

    /// As [`Lived::new`], given the space of the world.
    ///
    /// # Errors
    ///
    /// As [`Lived::new`].
    pub(crate) fn in_space(
        mut space: Space,
        file: LivingFile,
        lift_worlds: Vec<World>,
        world_file: Option<WorldFile<'_>>,
    ) -> anyhow::Result<Self> {
        let mut lifts = Vec::new();
        for (entry, world) in file.lifts.iter().zip(lift_worlds) {
            let at = Pose::from_translation(DVec3::from_array(entry.stops[0]));
            lifts.push(Lift::new(space.add_part(world, PartId::ROOT, at)?, entry));
        }
        let has_company = file.people.count > 0 || !lifts.is_empty();
        let doors = if has_company {
            AutoDoors::new(&space, &lifts)
        } else {
            AutoDoors::default()
        };
        doors.shut(&mut space);
        let lamps = lamps_of(&space, &file, &lifts);
        let mut lights = Lights::new(&space);
        for lamp in &lamps {
            lights.add(
                &space,
                Lamp {
                    frame: lamp.part,
                    at: lamp.at,
                    range: lamp.range,
                },
            )?;
        }
        let layout = space.layout(PartId::ROOT);
        let mut lived = Self {
            time: 0.0,
            lift_places: lifts.iter().map(|l| l.place(0.0)).collect(),
            people: People::new(&space, &file.people, world_file),
            viewer: SpaceViewer::new(&space),
            awake: AwakeCells::new(layout.n_cells(), LINGER),
            acoustics: (!file.sounds.is_empty())
                .then(|| Acoustics::new(&space, &Transmission::default())),
            listener: Listener::new(),
            near: Vec::new(),
            seen_lamps: Vec::new(),
            counts: LivedCounts::default(),
            radar: None,
            lamps,
            lights,
            doors,
            lifts,
            file,
            space,
        };
        let doors = &lived.doors;
        let is_way = |portal| !doors.is_gate(portal);
        lived
            .people
            .fill(&lived.space, lived.file.people.count, is_way);
        Ok(lived)
    }

    /// Adds the lifts and the lamps to a studio of the world.
    ///
    /// # Errors
    ///
    /// If the adapter cannot hold them.
    pub(crate) fn furnish(&self, studio: &mut Studio) -> Result<(), RenderError> {
        studio.follow_parts(&self.space)?;
        for lift in &self.lifts {
            let (world, sight) = (self.space.world(lift.part), self.space.sight(lift.part));
            studio.add_part_light(lift.part, world, sight)?;
        }
        studio.set_lamps(self.lamps.clone())
    }

    /// Plays until a time with nobody there. Small steps, in which doors move as in a window. [Units: s]
    pub(crate) fn play(&mut self, player: &Player, seconds: f64) {
        let n = (seconds / STEP).round() as u64;
        for _ in 0..n {
            self.step(player, STEP);
        }
    }

    /// Draws a picture of what a player sees.
    ///
    /// # Errors
    ///
    /// As [`Studio::space_picture`], and if the camera has no direction.
    pub(crate) fn picture(
        &mut self,
        studio: &mut Studio,
        frame: PartId,
        camera: &Camera,
        style: Style,
        size: [u32; 2],
    ) -> anyhow::Result<Picture> {
        let view = camera.view(size[0] as f32 / size[1] as f32)?;
        let eye = DVec3::from(camera.eye.map(f64::from));
        let mut props = Vec::new();
        let (space, seen, lamps) = self.see(&Player { frame, eye }, &view, &mut props);
        let shot = SpaceShot {
            space,
            frame,
            camera: *camera,
            seen: Some(seen),
            style,
            marks: &[],
            props: &props,
            lamps: Some(lamps),
        };
        Ok(studio.space_picture(&shot, size)?.0)
    }

    /// Makes the radar anew when it is asked for next, as after parts came or went.
    pub(crate) fn forget_radar(&mut self) {
        self.radar = None;
    }

    /// Leaves a door to whoever opens and closes it by hand.
    pub(crate) fn leave_alone(&mut self, portal: PortalId) {
        self.doors.leave_alone(portal);
    }

    /// Returns counters and sounds in words, a line each.
    pub(crate) fn words(&mut self, player: &Player) -> String {
        let LivedCounts {
            n_people,
            n_awake,
            n_awake_cells,
            n_lamps,
            n_lamps_seen,
        } = self.counts;
        let mut text = format!(
            "{n_people} people, {n_awake} awake in {n_awake_cells} cells\n{n_lamps_seen} of {n_lamps} lamps shine into the view"
        );
        for Heard {
            name,
            level,
            length,
        } in self.hear(player)
        {
            text += &format!("\n{}: {level:.0} dB, {length:.1} m off", shown(name));
        }
        text
    }

    /// Returns the things around the player, nearest first, by the way through openings.
    pub(crate) fn radar(&mut self, player: &Player) -> &[Blip] {
        let radar = self.radar.get_or_insert_with(|| Radar::new(&self.space));
        let ids = (0..self.people.actors.len() as u32).map(ActorId);
        let actors = &self.people.actors;
        let people = ids.filter_map(|id| Some((id.0, actors.place(id)?.at)));
        radar.follow(&self.space, people);
        let lamps = self.lamps.iter().map(|l| (l.part, l.at.map(f64::from)));
        radar.place_fixed(&self.space, lamps, &self.file.sounds);
        radar.look(&self.space, player.frame, player.eye, &self.awake)
    }

    /// Plays some seconds: lifts, people, and the doors that they and the player open.
    pub(crate) fn step(&mut self, player: &Player, seconds: f64) {
        self.time += seconds.max(0.0);
        for (lift, known) in self.lifts.iter().zip(&mut self.lift_places) {
            let place = lift.place(self.time);
            if place.at != known.at {
                // A rigid motion of a part that exists.
                let moved = self
                    .space
                    .set_pose(lift.part, Pose::from_translation(place.at));
                debug_assert!(moved.is_ok());
            }
            *known = place;
        }
        let doors = &self.doors;
        let is_way = |portal| !doors.is_gate(portal);
        self.people.advance(&self.space, self.time, is_way);
        self.near.clear();
        let to_root = self.space.between(player.frame, PartId::ROOT);
        self.near.push(to_root.point(player.eye));
        let ids = (0..self.people.actors.len() as u32).map(ActorId);
        let all = ids.filter_map(|id| self.people.actors.place(id));
        self.near.extend(all.map(|p| p.at + DVec3::Y));
        let step = seconds.clamp(0.0, LONGEST);
        self.doors
            .step(&mut self.space, &self.near, &self.lift_places, step);
    }

    /// Looks from a player's eye: returns everything seen, for the renderer, with the indices of the lamps that matter; adds the
    /// people and bulbs in view to `props`.
    pub(crate) fn see(
        &mut self,
        player: &Player,
        view: &View,
        props: &mut Vec<Prop>,
    ) -> (&Space, SpaceSeen<'_>, &[u32]) {
        self.see_to(
            player,
            view,
            props,
            None::<(&Stops, std::iter::Empty<CellId>)>,
        )
    }

    /// As [`Lived::see`], up to stops, where textures show some cells. A view with special portals in it has no stops.
    pub(crate) fn see_to(
        &mut self,
        player: &Player,
        view: &View,
        props: &mut Vec<Prop>,
        stops: Option<(&Stops, impl Iterator<Item = CellId>)>,
    ) -> (&Space, SpaceSeen<'_>, &[u32]) {
        let Self {
            space,
            viewer,
            lights,
            people,
            awake,
            ..
        } = self;
        viewer.stops_mut().clear();
        let mut behind = Vec::new();
        if let Some((stops, cells)) = stops {
            viewer.stops_mut().clone_from(stops);
            let seen = viewer.see(space, player.frame, view);
            if seen.contexts().len() > 1 || !seen.stopped_specials().is_empty() {
                viewer.stops_mut().clear();
            } else {
                behind.extend(cells);
                behind.sort_unstable();
                behind.dedup();
            }
        }
        let seen = viewer.see(space, player.frame, view);
        let of_root = seen.of_part(PartId::ROOT);
        let direct = of_root.iter().flat_map(enfilade::Seen::cells).copied();
        behind.retain(|cell| !direct.clone().any(|own| own == *cell));
        let cells = direct.chain(behind);
        awake.update(self.time, cells.clone());
        for cell in cells {
            props.extend(
                people
                    .actors
                    .in_cell(cell)
                    .filter_map(|id| person(people, id)),
            );
        }
        let matter = lights.that_matter(space, &seen);
        self.seen_lamps.clear();
        self.seen_lamps.extend(matter.iter().map(|LampId(i)| *i));
        let n_of_world = self.lamps.len() - self.file.lamps.len();
        let own = self.seen_lamps.iter().map(|i| *i as usize);
        // The world has bulbs of its own.
        let own = own.filter(|i| *i >= n_of_world);
        props.extend(own.map(|i| bulb(&self.lamps[i])));
        props.extend(self.file.sounds.iter().map(radio));
        let n_awake = |cell: &CellId| people.actors.in_cell(*cell).count();
        self.counts = LivedCounts {
            n_people: people.actors.len(),
            n_awake: awake.cells().iter().map(n_awake).sum(),
            n_awake_cells: awake.cells().len(),
            n_lamps: self.lamps.len(),
            n_lamps_seen: self.seen_lamps.len(),
        };
        (space, seen, &self.seen_lamps)
    }

    /// Returns the sounds that reach the player, loudest first, wherever the player is: in a lift, through its door.
    fn hear(&mut self, player: &Player) -> Vec<Heard> {
        let mut heard = Vec::new();
        let Some(acoustics) = &self.acoustics else {
            return heard;
        };
        let Some(here) = self.space.locate(player.frame, player.eye) else {
            return heard;
        };
        let ears = self
            .space
            .between(player.frame, here.part)
            .point(player.eye);
        self.listener.listen(acoustics, &self.space, here, ears);
        for (i, sound) in self.file.sounds.iter().enumerate() {
            let at = DVec3::from_array(sound.at);
            let there = self.space.locate(PartId::ROOT, at);
            let found = there.and_then(|there| {
                let at = self.space.between(PartId::ROOT, there.part).point(at);
                self.listener.hear(acoustics, i, there, at)
            });
            if let Some(found) = found {
                heard.push(Heard {
                    name: sound.name.clone(),
                    level: 20.0 * found.gain.log10(),
                    length: found.length,
                });
            }
        }
        heard.sort_by(|a, b| b.level.total_cmp(&a.level));
        heard
    }
}

/// Returns a person as drawn.
fn person(people: &People, id: ActorId) -> Option<Prop> {
    const COLORS: [[f32; 3]; 6] = [
        [0.55, 0.10, 0.09],
        [0.09, 0.22, 0.45],
        [0.12, 0.34, 0.16],
        [0.55, 0.38, 0.08],
        [0.30, 0.14, 0.38],
        [0.30, 0.30, 0.32],
    ];
    let (at, ahead) = people.pose(id)?;
    // The figure faces -z.
    let yaw = (-ahead.x).atan2(-ahead.z);
    let turn = Pose::about(DVec3::ZERO, DVec3::Y, yaw).turn;
    Some(Prop {
        mesh: PropMesh::PERSON,
        pose: Pose { turn, at },
        color: COLORS[id.0 as usize % COLORS.len()],
        ..Prop::default()
    })
}

/// Returns the lamps of a world and of what lives in it, as drawn.
fn lamps_of(space: &Space, file: &LivingFile, lifts: &[Lift]) -> Vec<LampLight> {
    let mut lamps = lamp_lights(space.world(PartId::ROOT), PartId::ROOT);
    // The program cannot draw others.
    lamps.retain(|lamp| lamp.range > 0.0 && lamp.range.is_finite());
    lamps.extend(file.lamps.iter().map(|lamp| LampLight {
        part: lamp.lift.map_or(PartId::ROOT, |l| lifts[l].part),
        at: lamp.at,
        color: lamp.color,
        range: lamp.range,
        cone: None,
    }));
    lamps
}

fn bulb(lamp: &LampLight) -> Prop {
    let brightest = lamp.color.iter().fold(0.0, |a: f32, b| a.max(*b));
    Prop {
        mesh: PropMesh::BALL,
        part: lamp.part,
        pose: Pose::from_translation(DVec3::from_array(lamp.at.map(f64::from))),
        size: [BULB; 3],
        color: lamp.color.map(|c| c / brightest.max(1e-6)),
        glow: 1.0,
    }
}

fn radio(sound: &SoundEntry) -> Prop {
    Prop {
        mesh: PropMesh::BOX,
        pose: Pose::from_translation(DVec3::from_array(sound.at)),
        size: [0.34, 0.2, 0.12],
        color: [0.45, 0.05, 0.05],
        ..Prop::default()
    }
}
