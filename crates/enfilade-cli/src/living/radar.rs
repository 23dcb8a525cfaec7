//! The radar: people, lamps and sounds around the player, by the way through openings, as registered things.

use std::collections::VecDeque;

use enfilade::cpg::CellId;
use enfilade::geom::{DVec3, shown};
use enfilade::world::{
    Arrival, AwakeCells, LengthSearch, PartId, Place, Pose, Sampling, Shape, Space, ThingId,
    Things, Tie, Ways,
};

use super::file::SoundEntry;

/// Longest way to a thing that the radar shows. [Units: wu]
pub(crate) const RADAR_REACH: f64 = 20.0;
/// Things named in words.
const NAMED: usize = 6;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BlipKind {
    Person,
    Lamp,
    Sound,
}

/// A thing on the radar.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Blip {
    pub(crate) kind: BlipKind,
    /// Its number among those of its kind.
    pub(crate) number: u32,
    /// Position in the world. [Units: wu]
    pub(crate) at: DVec3,
    /// The cells that list it, ascending.
    pub(crate) cells: Vec<CellId>,
    /// `true` if one of them is awake.
    pub(crate) is_awake: bool,
    /// Length of the way through openings, open or shut. [Units: wu]
    pub(crate) length: f64,
    /// Fewest portals on a way to it.
    pub(crate) n_portals: u32,
}

/// All things of a world that is lived in.
pub(crate) struct Radar {
    things: Things,
    known: Vec<(ThingId, BlipKind, u32)>,
    people: Vec<Option<ThingId>>,
    is_fixed: bool,
    ways: Ways,
    search: LengthSearch,
    arrivals: Vec<Arrival>,
    blips: Vec<Blip>,
}

impl Radar {
    pub(super) fn new(space: &Space) -> Self {
        Self {
            things: Things::new(),
            known: Vec::new(),
            people: Vec::new(),
            is_fixed: false,
            ways: Ways::new(space.layout(PartId::ROOT), Sampling::MIDDLES),
            search: LengthSearch::new(),
            arrivals: Vec::new(),
            blips: Vec::new(),
        }
    }

    fn add(
        &mut self,
        space: &Space,
        kind: BlipKind,
        number: u32,
        part: PartId,
        at: DVec3,
    ) -> Option<ThingId> {
        let shape = match kind {
            BlipKind::Person => Shape::capsule(DVec3::Y * 0.25, DVec3::Y * 1.55, 0.25),
            BlipKind::Lamp => Shape::sphere(0.06),
            BlipKind::Sound => Shape::sphere(0.15),
        };
        let pose = Pose::from_translation(at);
        let id = self
            .things
            .add(space, shape.ok()?, part, pose, Tie::Carried)
            .ok()?;
        self.known.push((id, kind, number));
        Some(id)
    }

    /// Moves people to where they are; their origin is half a meter above the floor.
    pub(super) fn follow(&mut self, space: &Space, people: impl Iterator<Item = (u32, DVec3)>) {
        for (number, feet) in people {
            let i = number as usize;
            self.people.resize(self.people.len().max(i + 1), None);
            // A point of the floor itself has no place.
            let at = feet + DVec3::Y * 0.05;
            match self.people[i] {
                Some(id) => {
                    let pose = Pose::from_translation(at);
                    // Neither is it removed, nor is the pose invalid.
                    let moved = self.things.set_pose(space, id, PartId::ROOT, pose);
                    debug_assert!(moved.is_ok());
                }
                None => {
                    let person = (BlipKind::Person, number);
                    self.people[i] = self.add(space, person.0, person.1, PartId::ROOT, at);
                }
            }
        }
    }

    /// Registers what does not move by itself, once.
    pub(super) fn place_fixed(
        &mut self,
        space: &Space,
        lamps: impl Iterator<Item = (PartId, [f64; 3])>,
        sounds: &[SoundEntry],
    ) {
        if std::mem::replace(&mut self.is_fixed, true) {
            return;
        }
        for (i, (part, at)) in (0..).zip(lamps) {
            self.add(space, BlipKind::Lamp, i, part, DVec3::from_array(at));
        }
        for (i, sound) in (0..).zip(sounds) {
            self.add(
                space,
                BlipKind::Sound,
                i,
                PartId::ROOT,
                DVec3::from_array(sound.at),
            );
        }
    }

    /// Finds the things within reach of an eye in a part: those that the cells reached list, each once.
    pub(super) fn look(
        &mut self,
        space: &Space,
        frame: PartId,
        eye: DVec3,
        awake: &AwakeCells,
    ) -> &[Blip] {
        self.blips.clear();
        let layout = space.layout(PartId::ROOT);
        let eye = space.between(frame, PartId::ROOT).point(eye);
        let Some(here) = layout.locate(eye) else {
            return &self.blips;
        };
        self.search
            .run(&self.ways, here, eye, RADAR_REACH, |_| Some(0.0));
        let mut n_portals = vec![u32::MAX; layout.n_cells()];
        n_portals[here.idx()] = 0;
        let mut queue = VecDeque::from([here]);
        while let Some(cell) = queue.pop_front() {
            for exit in layout.exits(cell) {
                if n_portals[exit.to.idx()] == u32::MAX {
                    n_portals[exit.to.idx()] = n_portals[cell.idx()] + 1;
                    queue.push_back(exit.to);
                }
            }
        }
        let part = PartId::ROOT;
        let reached: Vec<CellId> = self.search.cells().iter().map(|c| c.0).collect();
        let mut listed: Vec<ThingId> = Vec::new();
        for &cell in &reached {
            listed.extend(self.things.things_in(space, Place { part, cell }));
        }
        listed.sort_unstable();
        listed.dedup();
        for id in listed {
            let known = self.known.iter().find(|k| k.0 == id);
            let (Some(&(_, kind, number)), Ok((frame, pose))) =
                (known, self.things.pose(space, id))
            else {
                continue;
            };
            let at = space.between(frame, PartId::ROOT).point(pose.at);
            let places = self.things.places(space, id).filter(|p| p.part == part);
            let mut cells: Vec<CellId> = places.map(|p| p.cell).collect();
            cells.sort_unstable();
            let mut length = f64::INFINITY;
            for &cell in &cells {
                self.search
                    .arrivals(&self.ways, cell, at, 1.0, 1, &mut self.arrivals);
                length = self
                    .arrivals
                    .first()
                    .map_or(length, |a| a.length.min(length));
            }
            if length <= RADAR_REACH {
                self.blips.push(Blip {
                    kind,
                    number,
                    at,
                    is_awake: cells.iter().any(|c| awake.is_awake(*c)),
                    length,
                    n_portals: cells.iter().map(|c| n_portals[c.idx()]).min().unwrap_or(0),
                    cells,
                });
            }
        }
        self.blips.sort_by(|a, b| a.length.total_cmp(&b.length));
        &self.blips
    }
}

/// Returns what is on the radar in words, in lines: how many, by cell, and the nearest.
pub(crate) fn radar_words(blips: &[Blip], name: impl Fn(CellId) -> String) -> String {
    let n_awake = blips.iter().filter(|b| b.is_awake).count();
    let many = |n: usize| if n == 1 { "" } else { "s" };
    let mut text = format!(
        "radar: {} thing{} within {RADAR_REACH} m, {n_awake} in cells that are awake",
        blips.len(),
        many(blips.len())
    );
    let mut by_cell: Vec<(CellId, usize)> = Vec::new();
    for cell in blips.iter().flat_map(|b| &b.cells) {
        match by_cell.iter_mut().find(|c| c.0 == *cell) {
            Some((_, n)) => *n += 1,
            None => by_cell.push((*cell, 1)),
        }
    }
    let cells: Vec<String> = (by_cell.iter().take(NAMED))
        .map(|(cell, n)| format!("{n} in {}", shown(&name(*cell))))
        .collect();
    if !cells.is_empty() {
        text += &format!("\n  {}", cells.join(", "));
    }
    for blip in blips.iter().take(NAMED) {
        let kind = match blip.kind {
            BlipKind::Person => "person",
            BlipKind::Lamp => "lamp",
            BlipKind::Sound => "sound",
        };
        let n = blip.n_portals as usize;
        let state = if blip.is_awake { "awake" } else { "asleep" };
        text += &format!(
            "\n  {kind} {}: {:.1} m, {n} portal{}, {state}",
            blip.number,
            blip.length,
            many(n)
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::{GridParams, room_grid};

    #[test]
    fn the_radar_shows_what_is_within_reach_and_where() {
        let world = room_grid(&GridParams {
            size: [4, 1, 1],
            ..GridParams::two_rooms()
        });
        let space = Space::new(world).unwrap();
        let layout = space.layout(PartId::ROOT);
        let middle = |c: u32| layout.cell(CellId(c)).bounds.center();
        let feet = |c: u32| middle(c).with_y(0.0);
        let mut radar = Radar::new(&space);
        radar.follow(
            &space,
            [(0, feet(0)), (1, feet(1)), (2, feet(3))].into_iter(),
        );
        let mut awake = AwakeCells::new(layout.n_cells(), 1.0);
        awake.update(0.0, [CellId(0)]);
        let player = (PartId::ROOT, middle(0));
        let blips = radar.look(&space, player.0, player.1, &awake).to_vec();
        let told: Vec<_> = blips
            .iter()
            .map(|b| (b.number, b.n_portals, b.is_awake))
            .collect();
        let all = [(0, 0, true), (1, 1, false), (2, 3, false)];
        let far = middle(0).distance(middle(3));
        assert_eq!(told, all[..if far < RADAR_REACH - 1.0 { 3 } else { 2 }]);
        assert_eq!(blips[1].cells, [CellId(1)]);
        assert!((blips[1].length - middle(0).distance(feet(1))).abs() < 1.0);
        // A person in a doorway is in both rooms, and listed once.
        let door = layout.opening(enfilade::PortalId(0));
        radar.follow(&space, [(1, door.center().with_y(0.0))].into_iter());
        let blips = radar.look(&space, player.0, player.1, &awake).to_vec();
        let one: Vec<&Blip> = blips.iter().filter(|b| b.number == 1).collect();
        assert!(one.len() == 1 && one[0].cells.len() == 2 && one[0].is_awake);
        let words = radar_words(&blips, |c| c.to_string());
        assert!(words.contains("person 1: "), "{words}");
    }
}
