//! Levels as spaces: instances that share worlds, and everything prepared from them.

use std::collections::BTreeMap;
use std::sync::Arc;

use enfilade_cpg::{Cell, CellId, Locator, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_world::{PartId, Pose, Space, SpaceError};

use crate::assembly::Assembly;
use crate::instance::{InstanceId, Link};

/// A level as a space: each instance is a part in an empty world that is all outdoors.
#[derive(Debug)]
pub struct LevelSpace {
    /// The parts; each docks where its attachments are joined.
    pub space: Space,
    /// The part of each instance.
    pub parts: LevelParts,
}

/// The parts of a space that are the instances of a level.
#[derive(Debug, Default)]
pub struct LevelParts {
    by_instance: BTreeMap<InstanceId, StandingPart>,
    /// Per piece, its first part, which later instances copy.
    first: BTreeMap<usize, PartId>,
    /// Per piece, withdrawn parts, which later instances use.
    spare: BTreeMap<usize, Vec<PartId>>,
}

/// An instance as its part has it.
#[derive(Debug)]
struct StandingPart {
    part: PartId,
    piece: usize,
    pose: Pose,
    links: Vec<Link>,
    /// Its world, if it is not that of its piece.
    own: Option<Arc<World>>,
}

impl LevelParts {
    /// Returns the part of an instance, if it stands.
    #[must_use]
    pub fn part_of(&self, id: InstanceId) -> Option<PartId> {
        Some(self.by_instance.get(&id)?.part)
    }

    /// Returns the instance of a part, if it is one of them. O(instances).
    #[must_use]
    pub fn instance_of(&self, part: PartId) -> Option<InstanceId> {
        let mut all = self.by_instance.iter();
        all.find(|(_, standing)| standing.part == part)
            .map(|(id, _)| *id)
    }

    /// Brings a space to what a level is now: instances that came, went or moved since the last call come, go and move. Doorways in
    /// front of walls are closed. `own` returns the world of an instance that differs from its piece, and keeps it from call to call.
    ///
    /// A comparison for each instance; O(cells and portals of the piece, parts beside it) for each that changed. The first
    /// instance of a piece, and each with a world of its own, prepares that world.
    ///
    /// # Errors
    ///
    /// As [`Space::add_part`].
    pub fn follow(
        &mut self,
        space: &mut Space,
        level: &Assembly,
        own: impl Fn(InstanceId) -> Option<Arc<World>>,
    ) -> Result<(), SpaceError> {
        let is_same = |a: &Option<Arc<World>>, b: &Option<Arc<World>>| match (a, b) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        };
        let is_gone = |id: &InstanceId, known: &StandingPart| {
            // After an undo, its number may be that of another piece.
            let piece = level.standing(*id).map(|instance| instance.piece);
            piece != Ok(known.piece) || !is_same(&known.own, &own(*id))
        };
        let all = self.by_instance.iter();
        let gone: Vec<InstanceId> = all.filter(|(id, k)| is_gone(id, k)).map(|g| *g.0).collect();
        for id in gone {
            self.drop_instance(space, id)?;
        }
        for (id, instance) in level.instances() {
            let known = self.by_instance.get_mut(&id);
            let is_new = known.is_none();
            match known {
                None => {
                    let own = own(id);
                    let part = self.part_for(space, level, id, own.as_ref())?;
                    let standing = StandingPart {
                        part,
                        piece: instance.piece,
                        pose: instance.pose,
                        links: Vec::new(),
                        own,
                    };
                    self.by_instance.insert(id, standing);
                }
                Some(known) if known.pose != instance.pose => {
                    known.pose = instance.pose;
                    space.set_pose(known.part, instance.pose)?;
                }
                Some(_) => {}
            }
            if let Some(known) = self.by_instance.get_mut(&id)
                && (is_new || known.links != instance.links)
            {
                known.links.clone_from(&instance.links);
                known.shut(space, level, id);
            }
        }
        Ok(())
    }

    fn drop_instance(&mut self, space: &mut Space, id: InstanceId) -> Result<(), SpaceError> {
        match self.by_instance.remove(&id) {
            Some(known) if known.own.is_some() => space.forget(known.part),
            Some(known) => {
                self.spare.entry(known.piece).or_default().push(known.part);
                space.withdraw(known.part)
            }
            None => Ok(()),
        }
    }

    /// Returns a part that stands where an instance does.
    fn part_for(
        &mut self,
        space: &mut Space,
        level: &Assembly,
        id: InstanceId,
        own: Option<&Arc<World>>,
    ) -> Result<PartId, SpaceError> {
        let (piece, pose) = (level.instance(id).piece, level.instance(id).pose);
        if let Some(own) = own {
            return space.add_part(Arc::clone(own), PartId::ROOT, pose);
        }
        if let Some(spare) = self.spare.get_mut(&piece).and_then(Vec::pop) {
            space.set_pose(spare, pose)?;
            return Ok(spare);
        }
        if let Some(first) = self.first.get(&piece) {
            return space.add_copy(*first, PartId::ROOT, pose);
        }
        let world = level.piece(id).world().clone();
        let part = space.add_part(world, PartId::ROOT, pose)?;
        self.first.insert(piece, part);
        Ok(part)
    }
}

impl StandingPart {
    /// Closes its doorways in front of walls, and opens the others.
    fn shut(&self, space: &mut Space, level: &Assembly, id: InstanceId) {
        let attachments = level.piece(id).attachments();
        for (attachment, link) in attachments.iter().zip(&self.links) {
            let portal = match &self.own {
                None => attachment.portal,
                Some(own) => {
                    let center = level.piece(id).world().graph[attachment.portal].center();
                    nearest(own, center)
                }
            };
            match link {
                Link::Blocked(_) => space.close(self.part, portal),
                _ => space.open(self.part, portal),
            }
        }
    }
}

/// Returns the portal whose middle is nearest to a point: numbers of portals differ after changes.
fn nearest(world: &World, at: [f32; 3]) -> PortalId {
    let point = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let distance = |p: &PortalId| point(world.graph[*p].center()).distance(point(at));
    let all = world.graph.portal_ids();
    let nearest = all.min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.unwrap_or(PortalId(u32::MAX))
}

impl LevelSpace {
    /// Makes a space without instances.
    ///
    /// # Errors
    ///
    /// None for the empty world; as [`Space::new`].
    pub fn new() -> Result<Self, SpaceError> {
        Ok(Self {
            space: Space::new(open_air())?,
            parts: LevelParts::default(),
        })
    }

    /// As [`LevelParts::follow`], with the worlds of the pieces.
    ///
    /// # Errors
    ///
    /// As [`Space::add_part`].
    pub fn follow(&mut self, level: &Assembly) -> Result<(), SpaceError> {
        self.parts.follow(&mut self.space, level, |_| None)
    }
}

/// Returns a world without walls that is all outdoors.
#[must_use]
pub fn open_air() -> World {
    let mut open = World::default();
    open.graph.cells.push(Cell {
        name: "outdoors".into(),
        outdoor: true,
        ..Cell::default()
    });
    open.graph.locator = Arc::new(Locator {
        outside: Some(CellId(0)),
        ..Locator::default()
    });
    open
}

impl Assembly {
    /// Returns the level as a space, in which sight, sound, paths and things pass from instance to instance.
    ///
    /// # Errors
    ///
    /// As [`Space::add_part`].
    pub fn space(&self) -> Result<LevelSpace, SpaceError> {
        let mut level = LevelSpace::new()?;
        level.follow(self)?;
        Ok(level)
    }
}
