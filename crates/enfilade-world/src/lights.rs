//! Lamps: the cells that each may light, and the lamps that matter to a view.
//!
//! A lamp lights everything within its range that can be seen from it: portals narrow its light as they narrow a view (Dirkse
//! 2002, section 5.1.3, figure 39), closed doors stop it, and moving rooms carry it along. So no light shines through a wall into
//! the next room, and no lamp is switched off while anything that it lights is in view, wherever the lamp itself is.
//!
//! The lit cells are computed on the first query after a change, O(cells lit), and kept.

use std::fmt;

use enfilade_cpg::PortalId;
use enfilade_geom::DVec3;
use enfilade_runtime::{SeeOptions, View};

use crate::space::{Change, PartId, Place, Space, SpaceSeen, SpaceViewer};

/// Index of a lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LampId(pub u32);

/// A lamp that shines in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// The part in whose frame it stands, and with which it moves.
    pub frame: PartId,
    /// Position. [Units: wu]
    pub at: [f32; 3],
    /// Range of its light. [Units: wu] [Limit: above 0]
    pub range: f32,
}

/// Reason why a lamp is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LampError {
    /// A position that is not finite, or a range that is not above 0.
    #[error("a lamp's position must be finite, and its range above 0")]
    NotPositive,
    /// A frame that does not exist.
    #[error("there is no such part")]
    NoPart,
    /// A lamp that does not exist.
    #[error("there is no such lamp")]
    NoLamp,
}

/// A cell that a lamp lights, through one part of an opening.
#[derive(Clone, Copy, Debug)]
struct Beam {
    place: Place,
    /// Index of the first of its half-spaces, in the frame of the cell's part.
    first_plane: u32,
    n_planes: u32,
}

#[derive(Clone, Debug)]
struct Lit {
    lamp: Lamp,
    is_current: bool,
    beams: Vec<Beam>,
    planes: Vec<[f32; 4]>,
}

/// The lamps of a [`Space`].
pub struct Lights {
    lamps: Vec<Lit>,
    viewer: SpaceViewer,
    seen: Vec<LampId>,
    /// Number of the last change of the space that it knows.
    known: u64,
}

impl fmt::Debug for Lights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Lights")
            .field("n_lamps", &self.lamps.len())
            .finish_non_exhaustive()
    }
}

impl Lights {
    /// Makes an empty set.
    #[must_use]
    pub fn new(space: &Space) -> Self {
        let options = SeeOptions {
            // Large polygons inside a cell hide a part of it from the lamp as from an eye.
            occlusion: true,
            ..SeeOptions::default()
        };
        Self {
            lamps: Vec::new(),
            viewer: SpaceViewer::with_options(space, options),
            seen: Vec::new(),
            known: 0,
        }
    }

    /// Adds a lamp.
    ///
    /// # Errors
    ///
    /// If the position is not finite, the range is not above 0, or the frame does not exist.
    pub fn add(&mut self, space: &Space, lamp: Lamp) -> Result<LampId, LampError> {
        check(space, &lamp)?;
        self.lamps.push(Lit {
            lamp,
            is_current: false,
            beams: Vec::new(),
            planes: Vec::new(),
        });
        Ok(LampId(self.lamps.len() as u32 - 1))
    }

    /// Moves a lamp, or changes its range.
    ///
    /// # Errors
    ///
    /// As [`Lights::add`], and if the lamp does not exist.
    pub fn set(&mut self, space: &Space, id: LampId, lamp: Lamp) -> Result<(), LampError> {
        check(space, &lamp)?;
        let lit = self.lamps.get_mut(id.0 as usize);
        let lit = lit.ok_or(LampError::NoLamp)?;
        lit.is_current &= lit.lamp == lamp;
        lit.lamp = lamp;
        Ok(())
    }

    /// Marks for update the lamps in a part that has moved, and those whose light may reach it.
    fn mark_at(&mut self, space: &Space, part: PartId) {
        let own = &space.parts[part.idx()];
        for lit in &mut self.lamps {
            let meets = || own.doors.iter().flat_map(|d| &d.meets);
            let comes = |b: &Beam| {
                b.place.part == part
                    || own.stands_in.contains(&b.place)
                    || meets().any(|(other, _)| b.place.part == *other)
            };
            lit.is_current &= lit.lamp.frame != part && !lit.beams.iter().any(comes);
        }
        for &child in &own.children {
            self.mark_at(space, child);
        }
    }

    /// Marks for update the lamps that shine into a cell beside a door.
    fn mark_beside(&mut self, space: &Space, part: PartId, portal: PortalId) {
        let own = &space.parts[part.idx()];
        let cells = own.layout.opening(portal).cells();
        let around = space.leads_to(part, portal);
        for lit in &mut self.lamps {
            let is_beside = |b: &Beam| {
                let meets = space.meets(part, portal);
                b.place.part == part && cells.contains(&b.place.cell)
                    || around.contains(&b.place)
                    || meets.iter().any(|m| m.0 == b.place.part)
            };
            lit.is_current &= !lit.beams.iter().any(is_beside);
        }
    }

    /// Updates the lamps that something has changed for; queries do it by themselves. Allocates only while buffers grow.
    fn update(&mut self, space: &Space) {
        match space.changes_since(&mut self.known) {
            Some(changes) => changes.for_each(|change| match change {
                Change::Part(part) => self.mark_at(space, part),
                Change::Door(part, portal) => self.mark_beside(space, part, portal),
            }),
            None => self.lamps.iter_mut().for_each(|lit| lit.is_current = false),
        }
        for lit in &mut self.lamps {
            if !lit.is_current {
                lit.find(space, &mut self.viewer);
                lit.is_current = true;
            }
        }
    }

    /// Returns the places that a lamp lights, each at least once and none missing; none for a lamp that does not exist.
    #[doc(hidden)]
    pub fn lit_by(&mut self, space: &Space, id: LampId) -> impl Iterator<Item = Place> + use<'_> {
        self.update(space);
        let lit = self.lamps.get(id.0 as usize);
        lit.into_iter().flat_map(|l| &l.beams).map(|b| b.place)
    }

    /// Returns `true` if a lamp may light a point of a place, in the frame of its part; never `false` for a point that it does
    /// light.
    #[must_use]
    pub fn may_light(&mut self, space: &Space, id: LampId, place: Place, p: DVec3) -> bool {
        self.update(space);
        let Some(lit) = self.lamps.get(id.0 as usize) else {
            return false;
        };
        let at = DVec3::from_array(lit.lamp.at.map(f64::from));
        let at = space.between(lit.lamp.frame, place.part).point(at);
        let range = f64::from(lit.lamp.range) + space.layout(place.part).tolerance();
        at.distance(p) <= range
            && lit.beams.iter().any(|b| {
                b.place == place
                    && lit.planes_of(b).iter().all(|&[x, y, z, d]| {
                        let n = DVec3::new(x.into(), y.into(), z.into());
                        n.dot(p) + f64::from(d) >= -1e-4 * n.length()
                    })
            })
    }

    /// Returns the lamps whose light may fall on anything in a view, ascending: those that light a cell that it sees, and whose
    /// range reaches into the visible part of it.
    pub fn that_matter(&mut self, space: &Space, seen: &SpaceSeen) -> &[LampId] {
        self.update(space);
        self.seen.clear();
        for (id, lit) in (0..).map(LampId).zip(&self.lamps) {
            if lit.matters(space, seen) {
                self.seen.push(id);
            }
        }
        &self.seen
    }
}

impl Lit {
    fn planes_of(&self, beam: &Beam) -> &[[f32; 4]] {
        let first = beam.first_plane as usize;
        &self.planes[first..first + beam.n_planes as usize]
    }

    fn find(&mut self, space: &Space, viewer: &mut SpaceViewer) {
        self.beams.clear();
        self.planes.clear();
        let around = View::around(self.lamp.at).and_then(|v| v.with_far(self.lamp.range));
        let Ok(view) = around else {
            return; // Lamps are checked when they are added.
        };
        let seen = viewer.see(space, self.lamp.frame, &view);
        for (part, seen) in seen.parts() {
            let border = space.parts[part.idx()].border;
            for visit in seen.visits().iter().filter(|v| border != Some(v.cell)) {
                let planes = seen.planes(visit);
                self.beams.push(Beam {
                    place: Place {
                        part,
                        cell: visit.cell,
                    },
                    first_plane: self.planes.len() as u32,
                    n_planes: planes.len() as u32,
                });
                self.planes.extend_from_slice(planes);
            }
        }
    }

    fn matters(&self, space: &Space, seen: &SpaceSeen) -> bool {
        let at = DVec3::from_array(self.lamp.at.map(f64::from));
        self.beams.iter().any(|beam| {
            let Some(seen) = seen.of_part(beam.place.part) else {
                return false;
            };
            let at = space.between(self.lamp.frame, beam.place.part).point(at);
            let mut visits = seen.visits().iter();
            visits.any(|visit| {
                visit.cell == beam.place.cell
                    && seen.planes(visit).iter().all(|&[x, y, z, d]| {
                        let n = DVec3::new(x.into(), y.into(), z.into());
                        n.dot(at) + f64::from(d) >= -f64::from(self.lamp.range) * n.length()
                    })
            })
        })
    }
}

fn check(space: &Space, lamp: &Lamp) -> Result<(), LampError> {
    if lamp.frame.idx() >= space.n_parts() {
        return Err(LampError::NoPart);
    }
    let is_finite = lamp.at.iter().all(|x| x.is_finite()) && lamp.range.is_finite();
    if is_finite && lamp.range > 0.0 {
        Ok(())
    } else {
        Err(LampError::NotPositive)
    }
}
