//! Things as plain values, and back.

use enfilade_geom::DVec3;

use super::{Slot, Thing, ThingError, ThingId, Things, Tie};
use crate::saved::{SavedError, SavedPose, SavedThing, SavedThings, SavedTie};
use crate::shape::Shape;
use crate::space::{PartId, Space};

impl Things {
    /// Returns the state of all as plain values.
    #[must_use]
    pub fn saved(&mut self, space: &Space) -> SavedThings {
        self.update(space);
        let thing = |t: &Thing| SavedThing {
            points: t.shape.points().iter().map(DVec3::to_array).collect(),
            radius: t.shape.radius(),
            tie: match t.tie {
                Tie::Carried => SavedTie::Carried,
                Tie::Free => SavedTie::Free,
                Tie::Child(parent) => SavedTie::Child(parent.index),
                Tie::Global => SavedTie::Global,
            },
            frame: t.frame.0,
            pose: SavedPose::new(&t.pose),
        };
        let slots = self.slots.iter();
        SavedThings {
            slots: slots
                .map(|s| (s.generation, s.thing.as_ref().map(thing)))
                .collect(),
            free: self.free_slots.clone(),
        }
    }

    /// Makes things from a saved state, with the same ids.
    ///
    /// # Errors
    ///
    /// If a shape or pose is invalid, or a part or parent does not exist.
    pub fn restored(space: &Space, saved: &SavedThings) -> Result<Self, SavedError> {
        let mut things = Self::new();
        let what = "thing";
        let n = saved.slots.len() as u32;
        things.slots = saved
            .slots
            .iter()
            .map(|(generation, _)| Slot {
                generation: *generation,
                thing: None,
            })
            .collect();
        if let Some(index) = saved.free.iter().position(|f| *f >= n) {
            return Err(SavedError::NoSuch { what, index });
        }
        // Parents first: a thing whose parent is not there yet waits for the next round.
        let mut left: Vec<u32> = (0..n).collect();
        while !left.is_empty() {
            let before = left.len();
            let mut failed = None;
            left.retain(|&index| match things.put(space, saved, index) {
                Ok(is_done) => !is_done,
                Err(e) => {
                    failed.get_or_insert(e);
                    false
                }
            });
            if let Some(e) = failed {
                return Err(e);
            }
            if left.len() == before {
                let index = left[0] as usize;
                return Err(SavedError::NoSuch { what, index });
            }
        }
        things.free_slots.clone_from(&saved.free);
        Ok(things)
    }

    /// Puts a saved thing into its slot; returns `false` if its parent is not there yet.
    fn put(&mut self, space: &Space, saved: &SavedThings, at: u32) -> Result<bool, SavedError> {
        let (what, index) = ("thing", at as usize);
        let Some(it) = &saved.slots[index].1 else {
            return Ok(true);
        };
        let tie = match it.tie {
            SavedTie::Carried => Tie::Carried,
            SavedTie::Free => Tie::Free,
            SavedTie::Global => Tie::Global,
            SavedTie::Child(parent) => {
                let Some(slot) = self.slots.get(parent as usize) else {
                    return Err(SavedError::NoSuch { what, index });
                };
                if slot.thing.is_none() {
                    return Ok(false);
                }
                Tie::Child(ThingId {
                    index: parent,
                    generation: slot.generation,
                })
            }
        };
        let points = it.points.iter().map(|p| DVec3::from_array(*p)).collect();
        let bad = |_| SavedError::NotFinite { what, index };
        let shape = Shape::hull(points, it.radius).map_err(bad)?;
        self.free_slots.push(at);
        let added = self.add(space, shape, PartId(it.frame), it.pose.pose(), tie);
        added.map_err(|e| match e {
            ThingError::NotRigid => SavedError::NotFinite { what, index },
            _ => SavedError::NoSuch { what, index },
        })?;
        Ok(true)
    }
}
