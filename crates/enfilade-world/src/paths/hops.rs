//! Distance and next portal from any cell to any other, part by part.
//!
//! Each part has its own table ([`PartHops`]), which motion does not change. The doors that currently lead from part to part join
//! them: a small graph, searched by Dijkstra's algorithm at the query, with lengths from the tables between its doors. A part with
//! one such door is not a way through, so a lift at a floor costs the others nothing.

use enfilade_cpg::PortalId;

use super::all_pairs::{FAR, sum};
use super::part_hops::{PartHops, UNITS};
use crate::layout::LayoutExit;
use crate::space::{PartId, Place, Space};

/// Distances and next portals between all cells of a space.
#[derive(Clone, Debug)]
pub struct Hops {
    parts: Vec<PartHops>,
    /// Per part and portal to its surroundings, the length from the middle of the room to the door.
    thresholds: Vec<Vec<(PortalId, u32)>>,
    links: Vec<HopLink>,
    /// Per part, the number of its links.
    n_links: Vec<u32>,
    /// `true` if a path within a part may lead through others.
    has_ways_through: bool,
    /// Ends of the links that matter, both in turn.
    ends: Vec<LinkEnd>,
    known: Option<u64>,
    moved: Vec<bool>,
    /// Doors of parts that have moved: the part, and the indices of the threshold and the door.
    joined: Vec<(PartId, usize, usize)>,
}

/// An end of a link in a search.
#[derive(Clone, Copy, Debug)]
struct LinkEnd {
    link: usize,
    end: usize,
    length: u32,
    is_done: bool,
}

/// A door of a part that leads to a place of another.
#[derive(Clone, Copy, Debug)]
struct HopLink {
    ends: [Place; 2],
    /// The door of the first end's part, and that of the second, if they meet.
    doors: [Option<PortalId>; 2],
    length: u32,
}

/// A step from a cell to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Hop {
    /// The part whose portal it is.
    pub part: PartId,
    /// The portal.
    pub portal: PortalId,
    /// The place entered.
    pub to: Place,
}

impl Hops {
    /// Makes the tables of a space. `step` returns the length of a step through a portal, from the middle of one of its cells to
    /// that of the other, or for a door to a part's surroundings, from the middle of the room to the door; `None` if it is never
    /// passed. All portals are open at first. [Units: wu]
    ///
    /// For each part O(cells) and, for `n` junctions with `l` chains, `O(n · l · log n)` time and 6 · n² bytes. A length that is
    /// not finite or below 0 counts as `None`. Parts that are added later have no table. Panics if a junction has more than 65,535
    /// chains.
    #[must_use]
    pub fn new(space: &Space, mut step: impl FnMut(PartId, PortalId) -> Option<f64>) -> Self {
        let (mut parts, mut thresholds) = (Vec::new(), Vec::new());
        for id in (0..space.n_parts() as u32).map(PartId) {
            let part = &space.parts[id.idx()];
            let mut own: Vec<(PortalId, u32)> = Vec::new();
            parts.push(PartHops::new(&part.layout, |portal| {
                let length = step(id, portal).filter(|l| (0.0..4e5).contains(l))?;
                if part.doors.iter().any(|d| d.portal == portal) {
                    own.push((portal, (length * UNITS).round() as u32));
                    return None;
                }
                Some(length)
            }));
            thresholds.push(own);
        }
        Self {
            n_links: vec![0; parts.len()],
            parts,
            thresholds,
            links: Vec::new(),
            has_ways_through: false,
            ends: Vec::new(),
            known: None,
            moved: Vec::new(),
            joined: Vec::new(),
        }
    }

    /// Returns the number of junctions of a part; its table has the square of it.
    ///
    /// # Panics
    ///
    /// If there was no such part when it was made; likewise in the other queries of one.
    #[must_use]
    #[doc(hidden)]
    pub fn n_junctions(&self, part: PartId) -> usize {
        self.parts[part.idx()].n_junctions()
    }

    /// Returns `true` if a portal is open; all are at first.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    #[must_use]
    pub fn is_open(&self, part: PartId, portal: PortalId) -> bool {
        self.parts[part.idx()].is_open(portal)
    }

    /// Opens or closes a portal. O(size of its tree or chain), and in the table the pairs of junctions whose path changes.
    ///
    /// # Panics
    ///
    /// If there is no such portal.
    pub fn set_open(&mut self, part: PartId, portal: PortalId, is_open: bool) {
        self.parts[part.idx()].set_open(portal, is_open);
    }

    /// Returns the least length from the middle of a cell to that of another, through open portals and doors that currently lead
    /// from part to part; `None` if there is no path. O(1) in a part, plus the depth of a dead end if both are in it; otherwise
    /// O(n²) for n doors of parts that are ways through. [Units: wu]
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    #[must_use]
    pub fn distance(&mut self, space: &Space, from: Place, to: Place) -> Option<f64> {
        let (length, _) = self.search(space, from, to);
        (length < FAR).then(|| f64::from(length) / UNITS)
    }

    /// Returns the first step on the shortest path from a cell to another; `None` in the cell itself, and if there is no path. As
    /// fast as [`Hops::distance`], plus a binary search among the dead ends at the cell.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    #[must_use]
    pub fn next(&mut self, space: &Space, from: Place, to: Place) -> Option<Hop> {
        self.update(space);
        let part = from.part;
        let mut near = to.cell;
        // Without ways through, no length is needed in a part.
        if part != to.part || self.has_ways_through {
            let (length, link) = self.search(space, from, to);
            if length == FAR {
                return None;
            }
            if let Some((link, end)) = link {
                let HopLink { ends, doors, .. } = self.links[link];
                if ends[end] == from {
                    let own = if doors[end].is_some() { end } else { 1 - end };
                    return Some(Hop {
                        part: ends[own].part,
                        portal: doors[own]?,
                        to: ends[1 - end],
                    });
                }
                near = ends[end].cell;
            }
        }
        let LayoutExit { portal, to: cell } = self.parts[part.idx()].next(from.cell, near)?;
        Some(Hop {
            part,
            portal,
            to: Place { part, cell },
        })
    }

    /// Returns the least length, and the first link passed with the end at which it is entered, if any.
    fn search(&mut self, space: &Space, from: Place, to: Place) -> (u32, Option<(usize, usize)>) {
        self.update(space);
        let mut best = (FAR, None);
        if from.part == to.part {
            best.0 = self.within(from, to);
            if !self.has_ways_through || from == to {
                return best;
            }
        }
        // From the end: the least length from each end of a link.
        self.ends.clear();
        for (i, link) in self.links.iter().enumerate() {
            let leads_on = |end: &Place| {
                [from.part, to.part].contains(&end.part) || self.n_links[end.part.idx()] > 1
            };
            let is_open = |k: usize| {
                let own = &self.parts[link.ends[k].part.idx()];
                link.doors[k].is_none_or(|door| own.is_open(door))
            };
            if link.ends.iter().all(leads_on) && is_open(0) && is_open(1) {
                let length = |k: usize| self.within(link.ends[k], to);
                self.ends.extend([0, 1].map(|k| LinkEnd {
                    link: i,
                    end: k,
                    length: length(k),
                    is_done: false,
                }));
            }
        }
        loop {
            let open = (0..self.ends.len()).filter(|i| !self.ends[*i].is_done);
            let nearest = open.min_by_key(|i| self.ends[*i].length);
            let Some(at) = nearest.filter(|i| self.ends[*i].length < FAR) else {
                break;
            };
            self.ends[at].is_done = true;
            let LinkEnd {
                link, end, length, ..
            } = self.ends[at];
            let place = self.links[link].ends[end];
            for i in 0..self.ends.len() {
                let other = self.ends[i];
                let step = if i == at ^ 1 {
                    self.links[link].length
                } else {
                    self.within(self.links[other.link].ends[other.end], place)
                };
                self.ends[i].length = other.length.min(sum(length, step));
            }
        }
        for (i, near) in self.ends.iter().enumerate() {
            let link = &self.links[near.link];
            let beyond = sum(link.length, self.ends[i ^ 1].length);
            let length = sum(self.within(from, link.ends[near.end]), beyond);
            if length < best.0 {
                best = (length, Some((near.link, near.end)));
            }
        }
        best
    }

    /// Returns the least length within a part.
    fn within(&self, from: Place, to: Place) -> u32 {
        if from.part == to.part {
            self.parts[from.part.idx()].length(from.cell, to.cell)
        } else {
            FAR
        }
    }

    /// Finds the links of parts that have moved.
    fn update(&mut self, space: &Space) {
        if !space.moved_since(&mut self.known, &mut self.moved) {
            return;
        }
        let has_moved = |part: PartId| self.moved[part.idx()];
        (self.links).retain(|link| !link.ends.iter().any(|end| has_moved(end.part)));
        let n_parts = self.parts.len();
        for id in (1..n_parts as u32).map(PartId).filter(|p| has_moved(*p)) {
            let part = &space.parts[id.idx()];
            let _open = self.thresholds[id.idx()].iter();
            for (k, &(portal, _)) in self.thresholds[id.idx()].iter().enumerate() {
                if let Some(door) = part.doors.iter().position(|d| d.portal == portal) {
                    self.joined.push((id, k, door));
                }
            }
        }
        let mut joined = std::mem::take(&mut self.joined);
        for (id, threshold, door) in joined.drain(..) {
            self.link(space, id, threshold, door);
        }
        self.joined = joined;
        (self.links).retain(|link| link.ends.iter().all(|end| end.part.idx() < n_parts));
        self.n_links.fill(0);
        for end in self.links.iter().flat_map(|link| link.ends) {
            self.n_links[end.part.idx()] += 1;
        }
        self.has_ways_through = self.n_links.iter().skip(1).any(|n| *n > 1);
    }

    /// Adds the links of a door of a part that has moved.
    fn link(&mut self, space: &Space, id: PartId, threshold: usize, door: usize) {
        let (portal, length) = self.thresholds[id.idx()][threshold];
        let part = &space.parts[id.idx()];
        let door = &part.doors[door];
        let own = Place {
            part: id,
            cell: door.inner,
        };
        let center = part.layout.opening(portal).center();
        for &place in &door.leads_to {
            let layout = &space.parts[place.part.idx()].layout;
            let middle = layout.cell(place.cell).bounds.center();
            let beyond = space.between(id, place.part).point(center).distance(middle);
            self.links.push(HopLink {
                ends: [own, place],
                doors: [Some(portal), None],
                length: sum(length, (beyond.min(4e5) * UNITS).round() as u32),
            });
        }
        // If both have moved, once.
        for &(other, door) in &door.meets {
            if self.moved[other.idx()] && id >= other {
                continue;
            }
            let its = &space.parts[other.idx()].doors;
            let beyond = self.thresholds.get(other.idx());
            let beyond = beyond.and_then(|all| all.iter().find(|own| own.0 == door));
            let inner = its.iter().find(|d| d.portal == door).map(|d| d.inner);
            if let Some((&(_, beyond), cell)) = beyond.zip(inner) {
                self.links.push(HopLink {
                    ends: [own, Place { part: other, cell }],
                    doors: [Some(portal), Some(door)],
                    length: sum(length, beyond),
                });
            }
        }
    }
}
