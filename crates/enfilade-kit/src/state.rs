//! The state of a level: its instances, where they stand, and what their attachments lead to.

use std::collections::HashMap;
use std::sync::Arc;

use enfilade_geom::{Aabb, DVec3, LooseGrid};
use enfilade_world::Pose;

use crate::error::PlaceError;
use crate::instance::{End, Instance, InstanceId, Instances, Link, PlaceOptions};
use crate::kit::{DEFAULT_TOLERANCE, Kit};
use crate::meet::{Links, Rules, meetings, walled_up};

/// Change of a link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Relinked {
    pub(crate) end: End,
    pub(crate) from: Link,
    pub(crate) to: Link,
}

/// Instances of a level, and an index of those that stand.
#[derive(Clone, Debug)]
pub(crate) struct LevelState {
    pub(crate) tolerance: f64,
    pub(crate) instances: Instances,
    grid: LooseGrid,
    pub(crate) by_name: HashMap<String, InstanceId>,
    pub(crate) n_standing: usize,
}

impl LevelState {
    pub(crate) fn new(kit: Arc<Kit>) -> Self {
        Self {
            tolerance: DEFAULT_TOLERANCE,
            instances: Instances {
                kit,
                all: Vec::new(),
            },
            grid: LooseGrid::default(),
            by_name: HashMap::new(),
            n_standing: 0,
        }
    }

    /// Returns an instance that stands.
    ///
    /// # Errors
    ///
    /// If there is none of this number.
    pub(crate) fn standing(&self, id: InstanceId) -> Result<&Instance, PlaceError> {
        let instance = self.instances.all.get(id.idx()).filter(|i| i.is_standing);
        instance.ok_or_else(|| PlaceError::NoInstance(id.0.to_string()))
    }

    /// Returns the standing instances near another, in the order of their numbers.
    pub(crate) fn beside(&self, id: InstanceId) -> Vec<InstanceId> {
        let mut near = self.near(self.grid.bounds(id.0));
        near.retain(|other| *other != id);
        near
    }

    /// Returns the standing instances near a box, in the order of their numbers.
    pub(crate) fn near(&self, bounds: &Aabb) -> Vec<InstanceId> {
        let mut near = Vec::new();
        let reach = bounds.expanded(4.0 * self.tolerance);
        self.grid
            .for_each_near(&reach, |number| near.push(InstanceId(number)));
        near.sort_unstable();
        near
    }

    fn bounds(&self, piece: usize, pose: &Pose) -> Aabb {
        let hull = self.instances.kit.pieces()[piece].shape.hull;
        if hull.is_empty() {
            return hull;
        }
        Aabb::of_points(&hull.corners().map(|p| pose.point(p)))
    }

    /// Returns what a piece would meet at a pose.
    pub(crate) fn links_at(
        &self,
        piece: usize,
        pose: &Pose,
        options: &PlaceOptions,
    ) -> Result<Links, PlaceError> {
        if piece >= self.instances.kit.pieces().len() {
            return Err(PlaceError::NoPiece(piece.to_string()));
        }
        if !pose.is_rigid() {
            return Err(PlaceError::NotRigid);
        }
        let up = pose.direction(DVec3::Y).angle_between(DVec3::Y);
        if up > 1e-6 && !options.tilt {
            let piece = self.instances.kit.pieces()[piece].name().to_owned();
            return Err(PlaceError::Tilted {
                piece,
                degrees: up.to_degrees(),
            });
        }
        let rules = Rules {
            tolerance: self.tolerance,
            overlap: options.overlap,
        };
        let near = self.near(&self.bounds(piece, pose));
        meetings(&self.instances, piece, pose, &near, rules)
    }

    /// Moves an instance to another pose; returns the changes of links, its own included. Where it is refused, nothing changes.
    pub(crate) fn moved(
        &mut self,
        id: InstanceId,
        pose: &Pose,
        tilt: bool,
    ) -> Result<Vec<Relinked>, PlaceError> {
        let own = self.standing(id)?;
        let (piece, options) = (
            own.piece,
            PlaceOptions {
                tilt,
                overlap: own.overlaps,
                ..PlaceOptions::default()
            },
        );
        let mut changes = self.fall(id);
        let links = match self.links_at(piece, pose, &options) {
            Ok(links) => links,
            Err(why) => {
                self.relink(&changes, false);
                self.rise(id);
                return Err(why);
            }
        };
        let own = self.instances.all[id.idx()].links.iter().zip(&links.own);
        let own = (0..).zip(own).map(|(attachment, (from, to))| Relinked {
            end: End {
                instance: id,
                attachment,
            },
            from: *from,
            to: *to,
        });
        let own: Vec<Relinked> = own.collect();
        self.relink(&own, true);
        changes.extend(own);
        changes.extend(self.links_to(id, &links));
        self.instances.all[id.idx()].pose = *pose;
        self.rise(id);
        Ok(changes)
    }

    pub(crate) fn free_name(&self, piece: usize) -> String {
        let base = self.instances.kit.pieces()[piece].name();
        let mut n = self.instances.all.len() + 1;
        loop {
            let name = format!("{base}-{n}");
            if !self.by_name.contains_key(&name) {
                return name;
            }
            n += 1;
        }
    }

    /// Adds an instance that stands.
    pub(crate) fn stand(&mut self, instance: Instance) {
        let id = InstanceId(self.instances.all.len() as u32);
        self.grid.push(self.bounds(instance.piece, &instance.pose));
        self.by_name.insert(instance.name.clone(), id);
        self.instances.all.push(instance);
        self.n_standing += 1;
    }

    /// Sets the links of others to an instance; returns the changes.
    pub(crate) fn links_to(&mut self, id: InstanceId, links: &Links) -> Vec<Relinked> {
        let own = links.own.iter().enumerate();
        let joined = own.filter_map(|(attachment, link)| match link {
            Link::Joined(other) => Some((
                *other,
                Link::Joined(End {
                    instance: id,
                    attachment,
                }),
            )),
            _ => None,
        });
        let blocked = links
            .blocked
            .iter()
            .map(|other| (*other, Link::Blocked(id)));
        let changes: Vec<Relinked> = (joined.chain(blocked))
            .map(|(end, to)| Relinked {
                end,
                from: self.link_of(end),
                to,
            })
            .collect();
        self.relink(&changes, true);
        changes
    }

    fn link_of(&self, end: End) -> Link {
        self.instances.all[end.instance.idx()].links[end.attachment]
    }

    /// Makes changes of links, or takes them back.
    pub(crate) fn relink(&mut self, changes: &[Relinked], forward: bool) {
        let mut set = |end: End, link: Link| {
            self.instances.all[end.instance.idx()].links[end.attachment] = link;
        };
        if forward {
            changes.iter().for_each(|c| set(c.end, c.to));
        } else {
            // A link may change twice: when what it led to goes, and when that comes to stand again.
            changes.iter().rev().for_each(|c| set(c.end, c.from));
        }
    }

    /// Lets an instance no longer stand, and opens what led to it; returns the changes of others' links.
    pub(crate) fn fall(&mut self, id: InstanceId) -> Vec<Relinked> {
        let bounds = *self.grid.bounds(id.0);
        self.lie_down(id);
        let mut changes = Vec::new();
        for near in self.near(&bounds) {
            let own = self.instances.get(near).links.iter().enumerate();
            let to_it = own.filter(|(_, link)| match link {
                Link::Joined(end) => end.instance == id,
                Link::Blocked(by) => *by == id,
                Link::Open => false,
            });
            changes.extend(to_it.map(|(attachment, from)| Relinked {
                end: End {
                    instance: near,
                    attachment,
                },
                from: *from,
                to: Link::Open,
            }));
        }
        for change in &mut changes {
            // Another wall may be there, too.
            let beside = self.beside(change.end.instance);
            let wall = walled_up(&self.instances, change.end, &beside, self.tolerance);
            change.to = wall.map_or(Link::Open, Link::Blocked);
        }
        self.relink(&changes, true);
        changes
    }

    /// Lets an instance no longer stand; links stay as they are.
    pub(crate) fn lie_down(&mut self, id: InstanceId) {
        self.instances.all[id.idx()].is_standing = false;
        self.by_name.remove(&self.instances.all[id.idx()].name);
        self.n_standing -= 1;
        self.grid.set(id.0, Aabb::EMPTY);
    }

    /// Lets an instance stand again at its pose; links stay as they are.
    pub(crate) fn rise(&mut self, id: InstanceId) {
        let own = &mut self.instances.all[id.idx()];
        own.is_standing = true;
        let (piece, pose, name) = (own.piece, own.pose, own.name.clone());
        self.grid.set(id.0, self.bounds(piece, &pose));
        self.by_name.insert(name, id);
        self.n_standing += 1;
    }

    /// Takes the last instance, which was placed last, off the level.
    pub(crate) fn pop(&mut self) -> Option<Instance> {
        let last = InstanceId(self.instances.all.len() as u32 - 1);
        self.lie_down(last);
        self.grid.pop();
        self.instances.all.pop()
    }

    /// Moves an instance; links stay as they are.
    pub(crate) fn shift(&mut self, id: InstanceId, pose: Pose) {
        let own = &mut self.instances.all[id.idx()];
        own.pose = pose;
        let piece = own.piece;
        self.grid.set(id.0, self.bounds(piece, &pose));
    }
}
