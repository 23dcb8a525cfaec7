//! Flood of a shape through cells: finds the cells that it reaches through openings that it meets.
//!
//! After Dirkse 2002, section 5.1.2, figure 36, but with stamps instead of locks that are undone on return, which enumerate all
//! simple paths: each cell is entered once, each opening tested once from either side. O(openings of the cells reached).

use enfilade_cpg::PortalId;
use enfilade_geom::DVec3;

use crate::layout::Opening;
use crate::pose::Pose;
use crate::shape::{Shape, is_near};
use crate::space::{PartId, Place, Space};

/// The flood; keeps its buffers.
#[derive(Clone, Debug, Default)]
pub struct Flood {
    /// Per cell of all parts.
    stamps: Vec<u32>,
    stamp: u32,
    places: Vec<Place>,
    /// The shape in the frames of the parts that it reached, `n_posed` of them.
    posed: Vec<Posed>,
    n_posed: usize,
    clearance: f64,
}

#[derive(Clone, Debug, Default)]
struct Posed {
    part: u32,
    origin: DVec3,
    points: Vec<DVec3>,
}

/// A shape at a pose.
#[derive(Clone, Copy, Debug)]
pub struct Posted<'a> {
    /// The shape.
    pub shape: &'a Shape,
    /// Its [reach](Shape::reach). [Units: wu]
    pub reach: f64,
    /// The part in whose frame it stands.
    pub frame: PartId,
    /// Its pose there.
    pub pose: &'a Pose,
}

impl<'a> Posted<'a> {
    /// Places a shape at a pose in the frame of a part.
    #[must_use]
    pub fn new(shape: &'a Shape, frame: PartId, pose: &'a Pose) -> Self {
        Self {
            shape,
            reach: shape.reach(),
            frame,
            pose,
        }
    }
}

impl Flood {
    /// Returns the places that a shape reaches from `start`, through openings that it meets and for which `passes` returns
    /// `true`: first `start`, then the others in the order in which they are reached. A shape within the tolerance of an opening
    /// meets it.
    ///
    /// # Panics
    ///
    /// If `start` or the shape's frame is not of `space`.
    pub fn reach(
        &mut self,
        space: &Space,
        start: Place,
        posted: &Posted,
        mut passes: impl FnMut(PartId, PortalId) -> bool,
    ) -> &[Place] {
        self.begin(space);
        self.add(space, start);
        let mut at = 0;
        while let Some(&Place { part: id, cell }) = self.places.get(at) {
            at += 1;
            let part = &space.parts[id.idx()];
            for exit in part.layout.exits(cell) {
                let is_border = part.border == Some(exit.to);
                let to = Place {
                    part: id,
                    cell: exit.to,
                };
                if !is_border && self.has(space, to) {
                    continue;
                }
                if !self.meets(space, posted, id, exit.portal) || !passes(id, exit.portal) {
                    continue;
                }
                if is_border {
                    self.leave(space, posted, id, exit.portal, &mut passes);
                } else {
                    self.add(space, to);
                }
            }
            for &guest in &part.guests[cell.idx()] {
                self.clearance = 0.0;
                for door in &space.parts[guest.idx()].doors {
                    let to = Place {
                        part: guest,
                        cell: door.inner,
                    };
                    if !self.has(space, to)
                        && self.meets(space, posted, guest, door.portal)
                        && passes(guest, door.portal)
                    {
                        self.add(space, to);
                    }
                }
            }
        }
        &self.places
    }

    /// Returns the distance by which the shape of the last flood may move without meeting another opening: a lower bound, and 0
    /// where parts stand in a cell that it reached. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn clearance(&self) -> f64 {
        self.clearance
    }

    fn begin(&mut self, space: &Space) {
        if self.stamp == u32::MAX {
            self.stamps.fill(0);
            self.stamp = 0;
        }
        self.stamp += 1;
        self.stamps.resize(space.n_cells(), 0);
        self.places.clear();
        self.n_posed = 0;
        self.clearance = f64::INFINITY;
    }

    /// Continues in the surroundings of a part, behind one of its doors.
    fn leave(
        &mut self,
        space: &Space,
        posted: &Posted,
        id: PartId,
        portal: PortalId,
        passes: &mut impl FnMut(PartId, PortalId) -> bool,
    ) {
        let doors = &space.parts[id.idx()].doors;
        let Some(door) = doors.iter().find(|d| d.portal == portal) else {
            return;
        };
        for &place in &door.leads_to {
            self.add(space, place);
        }
        for &(other, portal) in &door.meets {
            let doors = &space.parts[other.idx()].doors;
            let Some(beyond) = doors.iter().find(|d| d.portal == portal) else {
                continue;
            };
            // As if they touched: through the prism between the two.
            let radius = space.parts[other.idx()].layout.opening(portal).radius();
            let depth = space.docking.depth(radius);
            if self.is_within(space, posted, other, portal, depth) && passes(other, portal) {
                let cell = beyond.inner;
                self.add(space, Place { part: other, cell });
            }
        }
    }

    fn index(space: &Space, place: Place) -> usize {
        space.parts[place.part.idx()].first_cell as usize + place.cell.idx()
    }

    fn has(&self, space: &Space, place: Place) -> bool {
        self.stamps[Self::index(space, place)] == self.stamp
    }

    fn add(&mut self, space: &Space, place: Place) {
        let stamp = &mut self.stamps[Self::index(space, place)];
        if *stamp != self.stamp {
            *stamp = self.stamp;
            self.places.push(place);
        }
    }

    /// Returns `true` if the shape meets a portal's opening.
    fn meets(&mut self, space: &Space, posted: &Posted, id: PartId, portal: PortalId) -> bool {
        self.is_within(space, posted, id, portal, 0.0)
    }

    /// Returns `true` if the shape is within a distance of a portal's opening.
    fn is_within(
        &mut self,
        space: &Space,
        posted: &Posted,
        id: PartId,
        portal: PortalId,
        distance: f64,
    ) -> bool {
        let layout = &space.parts[id.idx()].layout;
        let opening = layout.opening(portal);
        let posed = self.posed_in(space, posted, id);
        let margin = layout.tolerance() + distance;
        let distance = opening.bounds().distance_squared(posed.origin).sqrt();
        let clearance = distance - posted.reach - margin;
        let is_met = clearance <= 0.0 && {
            let points = &posed.points;
            let radius = posted.shape.radius() + margin;
            is_beside(&opening, posed.origin, posted.reach + margin)
                && opening.pieces().any(|piece| is_near(points, piece, radius))
        };
        self.clearance = if is_met {
            0.0
        } else {
            self.clearance.min(clearance.max(0.0))
        };
        is_met
    }

    /// Returns the shape in the frame of a part.
    fn posed_in(&mut self, space: &Space, posted: &Posted, id: PartId) -> &Posed {
        let known = self.posed[..self.n_posed]
            .iter()
            .position(|p| p.part == id.0);
        let at = known.unwrap_or_else(|| {
            if self.n_posed == self.posed.len() {
                self.posed.push(Posed::default());
            }
            let pose = if id == posted.frame {
                *posted.pose
            } else {
                space.between(posted.frame, id).after(posted.pose)
            };
            let posed = &mut self.posed[self.n_posed];
            posed.part = id.0;
            posed.origin = pose.at;
            posted.shape.place(&pose, &mut posed.points);
            self.n_posed += 1;
            self.n_posed - 1
        });
        &self.posed[at]
    }
}

/// Returns `true` if a ball reaches the plane of an opening.
fn is_beside(opening: &Opening, center: DVec3, reach: f64) -> bool {
    opening.height_of(center).abs() <= reach
}
