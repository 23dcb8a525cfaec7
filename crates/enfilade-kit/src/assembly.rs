//! Levels put together: instances of pieces, placed by their attachments, taken away, undone.
//!
//! After Gjørup 1999, section 3.3.3: a world is built of instances of a few hundred prototype segments whose portals snap to
//! each other. His portals snap on a grid; here, they snap to each other, in any direction.

use std::collections::HashMap;
use std::sync::Arc;

use enfilade_geom::{Aabb, DVec3, LooseGrid};
use enfilade_world::Pose;

use crate::error::PlaceError;
use crate::instance::{End, Instance, InstanceId, Instances, Link, PlaceOptions};
use crate::kit::{DEFAULT_TOLERANCE, Kit};
use crate::meet::{Links, Rules, meetings};
use crate::piece::Piece;

/// A change, with what is needed to take it back.
#[derive(Clone, Debug)]
enum Step {
    /// The last instance was placed.
    Placed,
    Removed(InstanceId),
}

/// Instances of the pieces of a kit.
#[derive(Clone, Debug)]
pub struct Assembly {
    tolerance: f64,
    instances: Instances,
    grid: LooseGrid,
    by_name: HashMap<String, InstanceId>,
    done: Vec<Step>,
    undone: Vec<(Step, Option<Instance>)>,
    n_standing: usize,
}

impl Assembly {
    /// Makes an empty level.
    #[must_use]
    pub fn new(kit: impl Into<Arc<Kit>>) -> Self {
        Self {
            tolerance: DEFAULT_TOLERANCE,
            instances: Instances {
                kit: kit.into(),
                all: Vec::new(),
            },
            grid: LooseGrid::default(),
            by_name: HashMap::new(),
            done: Vec::new(),
            undone: Vec::new(),
            n_standing: 0,
        }
    }

    /// Sets the most that outlines may differ to fit, that openings may be apart to be joined, and that instances may overlap, for
    /// what is placed from now on. [Units: wu] [Limit: above 0] [Default: [`DEFAULT_TOLERANCE`]]
    pub fn set_tolerance(&mut self, tolerance: f64) {
        self.tolerance = tolerance;
    }

    /// Returns the kit.
    #[must_use]
    pub fn kit(&self) -> &Arc<Kit> {
        &self.instances.kit
    }

    /// Returns the most that openings may differ and be apart to be joined. [Units: wu]
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Places an instance at a pose, where no opening needs to meet another.
    ///
    /// # Errors
    ///
    /// If there is no such piece, the pose is not a rigid motion or tilts it, the name is taken, or the instance would overlap another
    /// or wall up a part of an opening.
    pub fn put(
        &mut self,
        piece: usize,
        pose: Pose,
        options: &PlaceOptions,
    ) -> Result<InstanceId, PlaceError> {
        if piece >= self.kit().pieces().len() {
            return Err(PlaceError::NoPiece(piece.to_string()));
        }
        if !pose.is_rigid() {
            return Err(PlaceError::NotRigid);
        }
        let up = pose.direction(DVec3::Y).angle_between(DVec3::Y);
        if up > 1e-6 && !options.tilt {
            let piece = self.kit().pieces()[piece].name().to_owned();
            return Err(PlaceError::Tilted {
                piece,
                degrees: up.to_degrees(),
            });
        }
        let name = match &options.name {
            Some(name) if self.by_name.contains_key(name) => {
                return Err(PlaceError::NamedTwice(name.clone()));
            }
            Some(name) => name.clone(),
            None => self.free_name(piece),
        };
        let bounds = self.bounds(piece, &pose);
        let links = self.meetings(piece, &pose, &self.near(&bounds), options.overlap)?;
        self.undone.clear();
        self.done.push(Step::Placed);
        self.stand(Instance {
            piece,
            name,
            pose,
            links: links.own.clone(),
            overlaps: options.overlap,
            is_standing: true,
        });
        let id = InstanceId(self.instances.all.len() as u32 - 1);
        self.link(id, &links);
        Ok(id)
    }

    /// Places an instance so that its attachment meets that of another.
    ///
    /// O(cells, openings and outdoor surfaces of the piece and the instances beside it), whatever the size of the level.
    ///
    /// # Errors
    ///
    /// If there is no such piece or attachment, the attachment placed onto is in use, the openings do not fit, or for the reasons of
    /// [`Assembly::put`]. Nothing changes then.
    pub fn place(
        &mut self,
        piece: usize,
        attachment: usize,
        onto: End,
        options: &PlaceOptions,
    ) -> Result<InstanceId, PlaceError> {
        let pose = self.pose_onto(piece, attachment, onto, options.spin)?;
        self.put(piece, pose, options)
    }

    /// Returns the pose at which [`Assembly::place`] would place an instance, as for a preview.
    ///
    /// # Errors
    ///
    /// If there is no such piece or attachment, the attachment placed onto is in use, or the openings do not fit.
    pub fn pose_onto(
        &self,
        piece: usize,
        attachment: usize,
        onto: End,
        spin: f64,
    ) -> Result<Pose, PlaceError> {
        let pieces = self.kit().pieces();
        let own = pieces
            .get(piece)
            .ok_or_else(|| PlaceError::NoPiece(piece.to_string()))?;
        let end = own
            .attachments()
            .get(attachment)
            .ok_or_else(|| PlaceError::NoAttachment {
                of: own.name().to_owned(),
                name: attachment.to_string(),
                known: own.attachments().iter().map(|a| a.name.clone()).collect(),
            })?;
        let host = self.standing(onto.instance)?;
        let link = host
            .links
            .get(onto.attachment)
            .ok_or_else(|| PlaceError::NoAttachment {
                of: host.name.clone(),
                name: onto.attachment.to_string(),
                known: pieces[host.piece]
                    .attachments()
                    .iter()
                    .map(|a| a.name.clone())
                    .collect(),
            })?;
        match link {
            Link::Open => {}
            Link::Joined(other) => {
                return Err(PlaceError::Used {
                    end: self.end_name(onto),
                    by: self.end_name(*other),
                });
            }
            Link::Blocked(other) => {
                let by = self.instances.all[other.idx()].name.clone();
                return Err(PlaceError::Used {
                    end: self.end_name(onto),
                    by,
                });
            }
        }
        let its = &pieces[host.piece].attachments()[onto.attachment];
        let by = its.mouth.misfit(&end.mouth, spin);
        if by > self.tolerance {
            return Err(PlaceError::DoesNotFit {
                end: format!("{}.{}", own.name(), end.name),
                size: end.mouth.size(),
                onto: self.end_name(onto),
                onto_size: its.mouth.size(),
                by,
            });
        }
        Ok(host.pose.after(&its.mouth.meeting(&end.mouth, spin)))
    }

    /// Checks that two attachments are joined, as at the end of a loop. Openings that meet are joined when they are placed.
    ///
    /// # Errors
    ///
    /// If they are apart, with their distance.
    pub fn close(&self, a: End, b: End) -> Result<(), PlaceError> {
        let mouths = [a, b].map(|end| {
            let instance = self.standing(end.instance)?;
            let attachments = self.kit().pieces()[instance.piece].attachments();
            let attachment = attachments.get(end.attachment);
            let attachment = attachment.ok_or_else(|| PlaceError::NoAttachment {
                of: instance.name.clone(),
                name: end.attachment.to_string(),
                known: attachments.iter().map(|a| a.name.clone()).collect(),
            })?;
            Ok((instance, &attachment.mouth))
        });
        let [first, second] = mouths;
        let ((own, mouth), (other, its)) = (first?, second?);
        if own.links[a.attachment] == Link::Joined(b) {
            return Ok(());
        }
        let [p, q] = [
            own.pose.point(mouth.frame.at),
            other.pose.point(its.frame.at),
        ];
        let facing = |pose: &Pose, frame: &Pose| pose.direction(frame.direction(DVec3::Z));
        let [u, v] = [
            facing(&own.pose, &mouth.frame),
            facing(&other.pose, &its.frame),
        ];
        Err(PlaceError::StaysOpen {
            ends: [self.end_name(a), self.end_name(b)],
            gap: p.distance(q),
            degrees: u.angle_between(-v).to_degrees(),
            by: mouth.misfit(its, 0.0),
        })
    }

    /// Takes an instance away. What it was joined to is open again.
    ///
    /// # Errors
    ///
    /// If there is no such instance.
    pub fn remove(&mut self, id: InstanceId) -> Result<(), PlaceError> {
        self.standing(id)?;
        self.fall(id);
        self.undone.clear();
        self.done.push(Step::Removed(id));
        Ok(())
    }

    /// Takes back the last change that was not taken back; returns `false` if there is none. The level is then as before it.
    pub fn undo(&mut self) -> bool {
        let Some(step) = self.done.pop() else {
            return false;
        };
        match step {
            Step::Placed => {
                let last = InstanceId(self.instances.all.len() as u32 - 1);
                self.fall(last);
                self.grid.pop();
                let instance = self.instances.all.pop();
                self.undone.push((Step::Placed, instance));
            }
            Step::Removed(id) => {
                self.rise(id);
                self.undone.push((Step::Removed(id), None));
            }
        }
        true
    }

    /// Makes the last change again that was taken back; returns `false` if there is none.
    pub fn redo(&mut self) -> bool {
        match self.undone.pop() {
            None => return false,
            Some((Step::Removed(id), _)) => {
                self.fall(id);
                self.done.push(Step::Removed(id));
            }
            Some((Step::Placed, instance)) => {
                if let Some(instance) = instance {
                    self.stand(instance);
                    self.n_standing -= 1;
                    self.rise(InstanceId(self.instances.all.len() as u32 - 1));
                }
                self.done.push(Step::Placed);
            }
        }
        true
    }

    /// Returns the instances that stand, in the order in which they were placed.
    pub fn instances(&self) -> impl Iterator<Item = (InstanceId, &Instance)> {
        let numbered = (0..).map(InstanceId).zip(&self.instances.all);
        numbered.filter(|(_, instance)| instance.is_standing)
    }

    /// Returns the number of instances that stand.
    #[must_use]
    pub fn len(&self) -> usize {
        self.n_standing
    }

    /// Returns `true` if no instance stands.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n_standing == 0
    }

    /// Returns an instance that stands.
    ///
    /// # Errors
    ///
    /// If there is none of this number.
    pub fn standing(&self, id: InstanceId) -> Result<&Instance, PlaceError> {
        let instance = self.instances.all.get(id.idx()).filter(|i| i.is_standing);
        instance.ok_or_else(|| PlaceError::NoInstance(id.0.to_string()))
    }

    /// Returns the instance of a name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<InstanceId> {
        self.by_name.get(name).copied()
    }

    /// Returns the piece of an instance that stands or stood.
    ///
    /// # Panics
    ///
    /// If there never was one of this number.
    #[must_use]
    pub fn piece(&self, id: InstanceId) -> &Piece {
        self.instances.piece(id)
    }

    /// Returns the attachments that lead outdoors, in the order of instances.
    pub fn open_ends(&self) -> impl Iterator<Item = End> {
        self.instances().flat_map(|(id, _)| self.open_ends_of(id))
    }

    /// Returns the attachments of an instance that lead outdoors.
    ///
    /// # Panics
    ///
    /// If there never was such an instance, as [`Assembly::piece`].
    pub fn open_ends_of(&self, instance: InstanceId) -> impl Iterator<Item = End> {
        let links = self.instances.get(instance).links.iter().enumerate();
        let open = links.filter(|(_, link)| **link == Link::Open);
        open.map(move |(attachment, _)| End {
            instance,
            attachment,
        })
    }

    /// Returns the name of an attachment: `INSTANCE.ATTACHMENT`.
    ///
    /// # Panics
    ///
    /// If there never was such an instance, as [`Assembly::piece`].
    #[must_use]
    pub fn end_name(&self, end: End) -> String {
        self.instances.end_name(end)
    }

    pub(crate) fn instance(&self, id: InstanceId) -> &Instance {
        &self.instances.all[id.idx()]
    }

    /// Returns the standing instances near another, in the order of their numbers.
    pub(crate) fn beside(&self, id: InstanceId) -> Vec<InstanceId> {
        let mut near = self.near(self.grid.bounds(id.0));
        near.retain(|other| *other != id);
        near
    }

    /// Returns the standing instances near a box, in the order of their numbers.
    fn near(&self, bounds: &Aabb) -> Vec<InstanceId> {
        let mut near = Vec::new();
        let reach = bounds.expanded(4.0 * self.tolerance);
        self.grid
            .for_each_near(&reach, |number| near.push(InstanceId(number)));
        near.sort_unstable();
        near
    }

    fn bounds(&self, piece: usize, pose: &Pose) -> Aabb {
        let hull = self.kit().pieces()[piece].shape.hull;
        if hull.is_empty() {
            return hull;
        }
        Aabb::of_points(&hull.corners().map(|p| pose.point(p)))
    }

    /// Returns what a piece meets at a pose.
    fn meetings(
        &self,
        piece: usize,
        pose: &Pose,
        near: &[InstanceId],
        overlap: bool,
    ) -> Result<Links, PlaceError> {
        let rules = Rules {
            tolerance: self.tolerance,
            overlap,
        };
        meetings(&self.instances, piece, pose, near, rules)
    }

    fn free_name(&self, piece: usize) -> String {
        let base = self.kit().pieces()[piece].name();
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
    fn stand(&mut self, instance: Instance) {
        let id = InstanceId(self.instances.all.len() as u32);
        self.grid.push(self.bounds(instance.piece, &instance.pose));
        self.by_name.insert(instance.name.clone(), id);
        self.instances.all.push(instance);
        self.n_standing += 1;
    }

    /// Sets the links of others to a new instance.
    fn link(&mut self, id: InstanceId, links: &Links) {
        for (attachment, link) in links.own.iter().enumerate() {
            if let Link::Joined(other) = link {
                let back = Link::Joined(End {
                    instance: id,
                    attachment,
                });
                self.instances.all[other.instance.idx()].links[other.attachment] = back;
            }
        }
        for other in &links.blocked {
            self.instances.all[other.instance.idx()].links[other.attachment] = Link::Blocked(id);
        }
    }

    /// Lets an instance no longer stand.
    fn fall(&mut self, id: InstanceId) {
        self.instances.all[id.idx()].is_standing = false;
        self.by_name.remove(&self.instances.all[id.idx()].name);
        self.n_standing -= 1;
        let bounds = *self.grid.bounds(id.0);
        self.grid.set(id.0, Aabb::EMPTY);
        for near in self.near(&bounds) {
            for link in &mut self.instances.all[near.idx()].links {
                let is_to_it = match link {
                    Link::Joined(end) => end.instance == id,
                    Link::Blocked(by) => *by == id,
                    Link::Open => false,
                };
                if is_to_it {
                    *link = Link::Open;
                }
            }
        }
    }

    /// Lets an instance stand again, among the same others as before.
    fn rise(&mut self, id: InstanceId) {
        let (piece, pose, overlaps) = {
            let own = &mut self.instances.all[id.idx()];
            own.is_standing = true;
            (own.piece, own.pose, own.overlaps)
        };
        let bounds = self.bounds(piece, &pose);
        self.grid.set(id.0, Aabb::EMPTY);
        let near = self.near(&bounds);
        self.grid.set(id.0, bounds);
        self.by_name
            .insert(self.instances.all[id.idx()].name.clone(), id);
        self.n_standing += 1;
        // It stood there before, so nothing refuses it.
        if let Ok(links) = self.meetings(piece, &pose, &near, overlaps) {
            self.instances.all[id.idx()].links.clone_from(&links.own);
            self.link(id, &links);
        }
    }
}
