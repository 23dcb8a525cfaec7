//! The place of a point, in parts that move.

use std::fmt;

use enfilade_geom::{Aabb, DVec3};

use super::{PartId, Place, Space};

/// Most parts in a cell that are asked one by one for a point, rather than found by their boxes.
const FEW: usize = 8;

impl Space {
    /// Returns the number of cells of all parts.
    #[must_use]
    #[doc(hidden)]
    pub fn n_cells(&self) -> usize {
        self.n_cells
    }

    /// Returns the number of a cell among those of all parts; those of the root come first.
    #[must_use]
    #[doc(hidden)]
    pub fn cell_number(&self, place: Place) -> u32 {
        self.parts[place.part.idx()].first_cell + place.cell.0
    }

    /// Returns the place of a point of a part's frame: a cell of the innermost part that contains it; `None` in solid matter of
    /// all. O(depth of the locators), for each part at the point. A point in the walls of a part counts as in that part's
    /// surroundings.
    #[must_use]
    pub fn locate(&self, frame: PartId, p: DVec3) -> Option<Place> {
        let p = if frame == PartId::ROOT {
            p
        } else {
            self.pose(frame).point(p)
        };
        self.locate_within(PartId::ROOT, p, p)
    }

    /// Locates a point in a part or in parts that stand in it. `own` is `p`, of the root's frame, in the part's frame.
    fn locate_within(&self, id: PartId, p: DVec3, own: DVec3) -> Option<Place> {
        let part = &self.parts[id.idx()];
        let cell = part.layout.locate(own).filter(|c| part.border != Some(*c));
        let guests = match cell {
            Some(cell) if part.has_guests[cell.idx()] => &part.guests[cell.idx()],
            Some(_) => &[][..],
            None => &part.children,
        };
        let in_guest = |guest: PartId| {
            let its = &self.parts[guest.idx()];
            let q = its.pose.point_back(p);
            let place = || self.locate_within(guest, p, q);
            its.hull.contains(q).then(place).flatten()
        };
        let found = if guests.len() <= FEW {
            guests.iter().find_map(|guest| in_guest(*guest))
        } else {
            // The first in the order of their numbers, as above.
            let mut first: Option<(PartId, Place)> = None;
            self.neighbors.for_each_near(&Aabb::new(p, p), |near| {
                let near = PartId(near);
                let is_earlier = first.is_none_or(|f| near < f.0);
                if is_earlier && guests.binary_search(&near).is_ok() {
                    first = in_guest(near).map(|place| (near, place)).or(first);
                }
            });
            first.map(|f| f.1)
        };
        found.or(cell.map(|cell| Place { part: id, cell }))
    }
}

impl fmt::Debug for Space {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Space")
            .field("n_parts", &self.parts.len())
            .field("n_cells", &self.n_cells)
            .finish_non_exhaustive()
    }
}
