//! Levels put together: instances of pieces, placed by their attachments, taken away, undone.
//!
//! After Gjørup 1999, section 3.3.3: a world is built of instances of a few hundred prototype segments whose portals snap to
//! each other. His portals snap on a grid; here, they snap to each other, in any direction.

use std::sync::Arc;

use enfilade_geom::{Aabb, DVec3};
use enfilade_world::Pose;

use crate::error::PlaceError;
use crate::instance::{End, Instance, InstanceId, Link, PlaceOptions};
use crate::kit::Kit;
use crate::piece::Piece;
use crate::state::{LevelState, Relinked};

/// A change, with what is needed to take it back and to make it again.
#[derive(Clone, Debug)]
struct Step {
    change: Change,
    /// Links of instances other than the one placed or removed.
    relinked: Vec<Relinked>,
}

#[derive(Clone, Debug)]
enum Change {
    /// The last instance was placed. It is held here while that is taken back.
    Placed(Option<Instance>),
    Removed(InstanceId),
    /// Moved from one pose to the other.
    Moved(InstanceId, [Pose; 2]),
}

/// Instances of the pieces of a kit.
#[derive(Clone, Debug)]
pub struct Assembly {
    state: LevelState,
    done: Vec<Step>,
    undone: Vec<Step>,
}

impl Assembly {
    /// Makes an empty level.
    #[must_use]
    pub fn new(kit: impl Into<Arc<Kit>>) -> Self {
        Self {
            state: LevelState::new(kit.into()),
            done: Vec::new(),
            undone: Vec::new(),
        }
    }

    /// Sets the most that outlines may differ to fit, that openings may be apart to be joined, and that instances may overlap, for
    /// what is placed from now on. [Units: wu] [Limit: above 0] [Default: [`DEFAULT_TOLERANCE`](crate::DEFAULT_TOLERANCE)]
    pub fn set_tolerance(&mut self, tolerance: f64) {
        self.state.tolerance = tolerance;
    }

    /// Returns the kit.
    #[must_use]
    pub fn kit(&self) -> &Arc<Kit> {
        &self.state.instances.kit
    }

    /// Returns the most that openings may differ and be apart to be joined. [Units: wu]
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        self.state.tolerance
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
        let named = options.name.as_ref();
        if let Some(name) = named.filter(|name| self.state.by_name.contains_key(*name)) {
            return Err(PlaceError::NamedTwice(name.clone()));
        }
        let links = self.state.links_at(piece, &pose, options)?;
        let name = named.cloned();
        let name = name.unwrap_or_else(|| self.state.free_name(piece));
        let id = InstanceId(self.state.instances.all.len() as u32);
        let relinked = self.state.links_to(id, &links);
        self.state.stand(Instance {
            piece,
            name,
            pose,
            links: links.own,
            overlaps: options.overlap,
            is_standing: true,
        });
        self.made(Change::Placed(None), relinked);
        Ok(id)
    }

    /// Checks that [`Assembly::put`] would place a piece at a pose, as for a preview.
    ///
    /// # Errors
    ///
    /// As [`Assembly::put`], except for names.
    pub fn fits(
        &self,
        piece: usize,
        pose: &Pose,
        options: &PlaceOptions,
    ) -> Result<(), PlaceError> {
        self.state.links_at(piece, pose, options).map(|_| ())
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
                let by = self.state.instances.all[other.idx()].name.clone();
                return Err(PlaceError::Used {
                    end: self.end_name(onto),
                    by,
                });
            }
        }
        let its = &pieces[host.piece].attachments()[onto.attachment];
        let by = its.mouth.misfit(&end.mouth, spin);
        if by > self.state.tolerance {
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
        let relinked = self.state.fall(id);
        self.made(Change::Removed(id), relinked);
        Ok(())
    }

    /// Moves an instance to another pose. It keeps its number and name, and may overlap others if it did so before.
    ///
    /// # Errors
    ///
    /// If there is no such instance, or for the reasons of [`Assembly::put`]. Nothing changes then.
    pub fn move_to(&mut self, id: InstanceId, pose: Pose, tilt: bool) -> Result<(), PlaceError> {
        let from = self.standing(id)?.pose;
        let relinked = self.state.moved(id, &pose, tilt)?;
        self.made(Change::Moved(id, [from, pose]), relinked);
        Ok(())
    }

    /// Checks that [`Assembly::move_to`] would move an instance, as for a preview. Nothing changes.
    ///
    /// # Errors
    ///
    /// As [`Assembly::move_to`].
    pub fn fits_moved(
        &mut self,
        id: InstanceId,
        pose: &Pose,
        tilt: bool,
    ) -> Result<(), PlaceError> {
        let from = self.standing(id)?.pose;
        let relinked = self.state.moved(id, pose, tilt)?;
        self.state.relink(&relinked, false);
        self.state.shift(id, from);
        Ok(())
    }

    /// Takes back the last change that was not taken back; returns `false` if there is none. The level is then as before it.
    pub fn undo(&mut self) -> bool {
        let Some(mut step) = self.done.pop() else {
            return false;
        };
        match &mut step.change {
            Change::Placed(held) => {
                *held = self.state.pop();
            }
            Change::Removed(id) => self.state.rise(*id),
            Change::Moved(id, [from, _]) => self.state.shift(*id, *from),
        }
        self.state.relink(&step.relinked, false);
        self.undone.push(step);
        true
    }

    /// Makes the last change again that was taken back; returns `false` if there is none.
    pub fn redo(&mut self) -> bool {
        let Some(mut step) = self.undone.pop() else {
            return false;
        };
        match &mut step.change {
            Change::Placed(held) => {
                if let Some(mut instance) = held.take() {
                    instance.is_standing = true;
                    self.state.stand(instance);
                }
            }
            Change::Removed(id) => self.state.lie_down(*id),
            Change::Moved(id, [_, to]) => self.state.shift(*id, *to),
        }
        self.state.relink(&step.relinked, true);
        self.done.push(step);
        true
    }

    /// Returns the instances that stand, in the order in which they were placed.
    pub fn instances(&self) -> impl Iterator<Item = (InstanceId, &Instance)> {
        let numbered = (0..).map(InstanceId).zip(&self.state.instances.all);
        numbered.filter(|(_, instance)| instance.is_standing)
    }

    /// Returns the number of instances that stand.
    #[must_use]
    pub fn len(&self) -> usize {
        self.state.n_standing
    }

    /// Returns `true` if no instance stands.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.state.n_standing == 0
    }

    /// Returns the instance of a name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<InstanceId> {
        self.state.by_name.get(name).copied()
    }

    /// Returns the piece of an instance that stands or stood.
    ///
    /// # Panics
    ///
    /// If there never was one of this number.
    #[must_use]
    pub fn piece(&self, id: InstanceId) -> &Piece {
        self.state.instances.piece(id)
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
    pub(crate) fn open_ends_of(&self, instance: InstanceId) -> impl Iterator<Item = End> {
        let links = self.state.instances.get(instance).links.iter().enumerate();
        let open = links.filter(|(_, link)| **link == Link::Open);
        open.map(move |(attachment, _)| End {
            instance,
            attachment,
        })
    }

    /// Returns the instance that has a point in a room of it, or else in a wall.
    #[must_use]
    #[doc(hidden)]
    pub fn instance_at(&self, p: DVec3) -> Option<InstanceId> {
        let cell_in = |id: &InstanceId| {
            let own = self.state.instances.get(*id).pose.point_back(p);
            self.piece(*id).world().graph.locator.locate(own)
        };
        let is_outdoors = |id: &InstanceId| cell_in(id) == Some(self.piece(*id).outdoors);
        let mut near = self.state.near(&Aabb::of_points(&[p]));
        near.retain(|id| !is_outdoors(id));
        let in_room = near.iter().find(|id| cell_in(id).is_some());
        in_room.or(near.first()).copied()
    }

    /// Returns an instance that stands.
    ///
    /// # Errors
    ///
    /// If there is none of this number.
    pub fn standing(&self, id: InstanceId) -> Result<&Instance, PlaceError> {
        self.state.standing(id)
    }

    /// Returns the name of an attachment: `INSTANCE.ATTACHMENT`.
    ///
    /// # Panics
    ///
    /// If there never was such an instance, as [`Assembly::piece`].
    #[must_use]
    #[doc(hidden)]
    pub fn end_name(&self, end: End) -> String {
        self.state.instances.end_name(end)
    }

    pub(crate) fn instance(&self, id: InstanceId) -> &Instance {
        &self.state.instances.all[id.idx()]
    }

    /// Returns the standing instances near another, in the order of their numbers.
    pub(crate) fn beside(&self, id: InstanceId) -> Vec<InstanceId> {
        self.state.beside(id)
    }

    /// Remembers a change that was made.
    fn made(&mut self, change: Change, relinked: Vec<Relinked>) {
        self.undone.clear();
        self.done.push(Step { change, relinked });
    }
}
