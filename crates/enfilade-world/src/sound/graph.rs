//! The cells and portals of all parts as they stand, for sound: lengths within cells from each part, in its own frame, where
//! motion does not change them; points and openings in the frame of the root.
//!
//! Two doors that meet are one gate: sound passes the narrower one, with the leaves of both. The thin space between them has no
//! length to speak of, but would count as a bend where the doors are pushed into each other.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::{Aabb, DVec3};

use crate::paths::{Corner, Seen, Ways, into_cell};
use crate::pose::Pose;
use crate::sound::part::PartSound;
use crate::space::{Joined, PartId, Place, Space};

/// Cells and portals of all parts at one instant.
#[derive(Clone, Debug)]
pub(super) struct SoundGraph {
    pub(super) joined: Joined,
    pub(super) ways: Ways,
    /// Per portal, edges with wall beside them, and the number of all.
    first_rim: Vec<u32>,
    rims: Vec<[DVec3; 2]>,
    /// Per portal, the area of its opening, and the box around it. [Units: wu², wu]
    pub(super) area: Vec<f64>,
    pub(super) bounds: Vec<Aabb>,
    /// Per portal, `true` for the wider one of two that meet.
    is_spare: Vec<bool>,
    poses: Vec<Pose>,
}

impl SoundGraph {
    /// O(portals and their points); for a door that leads to a concave cell, lines of sight to its edges.
    pub(super) fn new(space: &Space, parts: &[PartSound]) -> Self {
        let joined = Joined::new(space, parts.len());
        let layout = &joined.layout;
        let poses: Vec<Pose> = (0..parts.len() as u32)
            .map(|part| *space.pose(PartId(part)))
            .collect();
        let mut ways = Ways::with_points(layout, |portal, points| {
            let (part, own) = joined.of_portal(portal);
            let own = parts[part.idx()].ways.points(own).iter();
            points.extend(own.map(|p| moved(&poses, part, *p)));
        });
        let (mut first_rim, mut rims) = (vec![0], Vec::new());
        let portals = (0..layout.n_portals() as u32).map(PortalId);
        for portal in portals.clone() {
            let (part, own) = joined.of_portal(portal);
            let own = parts[part.idx()].rims(own).iter();
            rims.extend(own.map(|rim| rim.map(|p| moved(&poses, part, p))));
            first_rim.push(rims.len() as u32);
        }
        let area: Vec<f64> = portals.clone().map(|p| layout.opening(p).area()).collect();
        let is_wider =
            |p: PortalId, other: PortalId| (area[p.idx()], p.0) > (area[other.idx()], other.0);
        let is_spare = |p: PortalId| joined.docked[p.idx()].is_some_and(|other| is_wider(p, other));
        let is_spare = portals.clone().map(is_spare).collect();
        let bounds = portals.map(|p| *layout.opening(p).bounds()).collect();
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            if let Some(place) = joined.place(cell) {
                let own = &parts[place.part.idx()];
                // Before lengths are known, those of what stands in the cell.
                ways.share_lengths(cell, &own.ways, place.cell, Vec::new());
            }
        }
        let mut graph = Self {
            joined,
            ways,
            first_rim,
            rims,
            area,
            bounds,
            is_spare,
            poses,
        };
        graph.add_hosts(parts);
        graph
    }

    /// Adds the lengths from the doors of parts that stand in concave cells.
    fn add_hosts(&mut self, parts: &[PartSound]) {
        let mut hosts: Vec<CellId> = self.joined.hosted.iter().map(|h| h.1).collect();
        hosts.sort_unstable();
        hosts.dedup();
        let mut lengths = Vec::new();
        for cell in hosts {
            let Some(place) = self.joined.place(cell) else {
                continue;
            };
            let own = &parts[place.part.idx()];
            if !own.geodesics.is_concave(place.cell) {
                continue;
            }
            let n_own = own.ways.n_points(place.cell);
            let points: Vec<_> = self.ways.points_of(cell).skip(n_own).collect();
            let mut rows = Vec::new();
            for (portal, q) in points {
                let q = self.off_door(parts, portal, cell, q);
                self.lengths_from(parts, cell, q, &mut lengths);
                rows.extend_from_slice(&lengths);
            }
            self.ways.share_lengths(cell, &own.ways, place.cell, rows);
        }
    }

    /// Returns the edges of an opening with wall beside them.
    pub(super) fn rims(&self, portal: PortalId) -> &[[DVec3; 2]] {
        let first = &self.first_rim[portal.idx()..];
        &self.rims[first[0] as usize..first[1] as usize]
    }

    /// Returns `true` for the wider one of two portals that meet: strings do not pass it.
    pub(super) fn is_spare(&self, portal: PortalId) -> bool {
        self.is_spare[portal.idx()]
    }

    /// Maps a point of a part's frame to that of the root.
    pub(super) fn to_root(&self, part: PartId, p: DVec3) -> DVec3 {
        moved(&self.poses, part, p)
    }

    /// Maps a direction of the root's frame to that of a part.
    pub(super) fn toward(&self, part: PartId, direction: DVec3) -> DVec3 {
        if part == PartId::ROOT {
            return direction;
        }
        self.poses[part.idx()].turn.conjugate() * direction
    }

    fn to_part(&self, part: PartId, p: DVec3) -> DVec3 {
        if part == PartId::ROOT {
            return p;
        }
        self.poses[part.idx()].point_back(p)
    }

    fn place_of<'a>(&self, parts: &'a [PartSound], cell: CellId) -> Option<(Place, &'a PartSound)> {
        let place = self.joined.place(cell)?;
        Some((place, &parts[place.part.idx()]))
    }

    /// Returns `true` if walls of a cell may be between its points.
    pub(super) fn is_concave(&self, parts: &[PartSound], cell: CellId) -> bool {
        let place = self.place_of(parts, cell);
        place.is_some_and(|(place, own)| own.geodesics.is_concave(place.cell))
    }

    /// Moves a point of an opening a little into a cell: off the doors of parts before which it lies, as far as they may be
    /// pushed into it.
    pub(super) fn off_door(
        &self,
        parts: &[PartSound],
        portal: PortalId,
        cell: CellId,
        p: DVec3,
    ) -> DVec3 {
        let off = self.place_of(parts, cell).map_or(0.0, |(place, own)| {
            let hosted = &self.joined.hosted;
            let known = hosted.binary_search_by_key(&portal, |h| h.0).ok();
            let before = known.filter(|_| self.joined.of_portal(portal).0 != place.part);
            own.geodesics.off() + before.map_or(0.0, |k| hosted[k].2)
        });
        into_cell(&self.joined.layout.opening(portal), cell, p, off)
    }

    /// Writes the lengths from a point of a cell to the points of its portals.
    pub(super) fn lengths_from(
        &self,
        parts: &[PartSound],
        cell: CellId,
        at: DVec3,
        lengths: &mut Vec<f64>,
    ) {
        lengths.clear();
        let n = self.ways.n_points(cell);
        if let Some((place, own)) = self.place_of(parts, cell) {
            let p = self.to_part(place.part, at);
            (own.geodesics).lengths_from(&own.ways, place.cell, p, lengths);
            lengths.truncate(n);
        }
        if lengths.len() == n {
            return;
        }
        let (mut seen, mut bends) = (Seen::default(), Vec::new());
        let is_concave = self.is_concave(parts, cell);
        for (portal, q) in self.ways.points_of(cell).skip(lengths.len()) {
            let length = if is_concave {
                let q = self.off_door(parts, portal, cell, q);
                let way = self.way(parts, cell, [at, q], &mut seen, &mut bends);
                way.unwrap_or(f64::INFINITY)
            } else {
                at.distance(q)
            };
            lengths.push(length);
        }
    }

    /// Returns the length of the shortest path between two points of a cell, and its bends, cleared first.
    pub(super) fn way(
        &self,
        parts: &[PartSound],
        cell: CellId,
        ends: [DVec3; 2],
        seen: &mut Seen,
        bends: &mut Vec<Corner>,
    ) -> Option<f64> {
        let Some((place, own)) = self.place_of(parts, cell) else {
            bends.clear();
            return Some(ends[0].distance(ends[1]));
        };
        let ends = ends.map(|p| self.to_part(place.part, p));
        let length = own.geodesics.way_with(place.cell, ends, seen, bends);
        if place.part != PartId::ROOT {
            for bend in bends {
                bend.at = self.to_root(place.part, bend.at);
                bend.edge = bend.edge.map(|p| self.to_root(place.part, p));
            }
        }
        length
    }
}

fn moved(poses: &[Pose], part: PartId, p: DVec3) -> DVec3 {
    if part == PartId::ROOT {
        return p;
    }
    poses[part.idx()].point(p)
}
