//! Openings as rectangles inside of faces, apart from their edges and from each other.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, PortalId, PortalKind, World};
use enfilade_geom::{DVec2, DVec3};

use crate::coarse::CoarseRooms;
use crate::surfaces::{Behind, BoundarySurface};

/// Distance of an opening from edges of its face and from others: more than the client's tolerance. [Units: wu]
const APART: f64 = 0.015;
/// Smallest side of an opening: clients drop those with an area of 0.01. [Units: wu]
const NARROW: f64 = 0.11;
/// Least part of an opening that must fit, as a share.
const LEFT: f64 = 0.2;
/// Farthest distance of an opening from the face that holds it. [Units: wu]
const DEEPEST: f64 = 1.0;
/// Part of a face that is a way without a door, from which on all of it is air.
const AIR: f64 = 0.5;

/// An opening in a face.
pub(super) struct SubFace {
    pub(super) portal: PortalId,
    /// Room and surface.
    face: [usize; 2],
    /// Counter-clockwise seen from outside of the room, with the axes of the frame. [Units: wu]
    pub(super) outline: Vec<[f64; 3]>,
}

/// All openings, by face.
pub(super) struct Openings {
    sub_faces: Vec<SubFace>,
    /// Room and surface of the faces that are ways without a door.
    pub(super) air: BTreeSet<[usize; 2]>,
    /// Those of the rooms that fit into no face; cracks do not count.
    pub(super) left_out: Vec<PortalId>,
}

/// A rectangle in the plane of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Area {
    low: DVec2,
    high: DVec2,
}

impl Area {
    fn around(points: impl Iterator<Item = DVec2>) -> Self {
        let (low, high) = points.fold((DVec2::MAX, DVec2::MIN), |(l, h), p| (l.min(p), h.max(p)));
        Self { low, high }
    }

    fn size(&self) -> f64 {
        (self.high - self.low).max(DVec2::ZERO).element_product()
    }

    fn grown(&self, by: f64) -> Self {
        Self {
            low: self.low - by,
            high: self.high + by,
        }
    }

    fn common(&self, other: &Self) -> Self {
        Self {
            low: self.low.max(other.low),
            high: self.high.min(other.high),
        }
    }

    /// Returns the largest part on one side of another rectangle, `APART` from it.
    fn beside(&self, other: &Self) -> Self {
        let far = other.grown(APART + 1e-6);
        let mut parts = [*self; 4];
        parts[0].high.x = far.low.x;
        parts[1].low.x = far.high.x;
        parts[2].high.y = far.low.y;
        parts[3].low.y = far.high.y;
        let largest = parts
            .into_iter()
            .max_by(|a, b| a.size().total_cmp(&b.size()));
        largest.unwrap_or(*self)
    }

    fn corners(&self) -> [DVec2; 4] {
        let (l, h) = (self.low, self.high);
        [l, DVec2::new(h.x, l.y), h, DVec2::new(l.x, h.y)]
    }
}

/// A face with axes in its plane.
struct Plane {
    origin: DVec3,
    normal: DVec3,
    u: DVec3,
    v: DVec3,
    edges: Vec<[DVec2; 2]>,
}

impl Plane {
    fn of(surface: &BoundarySurface) -> Self {
        let normal = DVec3::from(surface.normal);
        let u = DVec3::Y.cross(normal).try_normalize().unwrap_or(DVec3::X);
        let mut plane = Self {
            origin: DVec3::from(surface.loops[0][0]),
            normal,
            u,
            v: normal.cross(u),
            edges: Vec::new(),
        };
        for ring in &surface.loops {
            let flat: Vec<DVec2> = ring.iter().map(|&p| plane.flat(p.into())).collect();
            let n = flat.len();
            plane
                .edges
                .extend((0..n).map(|i| [flat[i], flat[(i + 1) % n]]));
        }
        plane
    }

    fn flat(&self, p: DVec3) -> DVec2 {
        let d = p - self.origin;
        DVec2::new(d.dot(self.u), d.dot(self.v))
    }

    fn place(&self, p: DVec2) -> DVec3 {
        self.origin + self.u * p.x + self.v * p.y
    }

    fn bounds(&self) -> Area {
        Area::around(self.edges.iter().map(|e| e[0]))
    }

    fn has_inside(&self, p: DVec2) -> bool {
        let crosses = |[a, b]: &[DVec2; 2]| {
            (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * ((p.y - a.y) / (b.y - a.y))
        };
        self.edges.iter().filter(|e| crosses(e)).count() % 2 == 1
    }

    /// Returns a part of a rectangle that is inside of the face, and apart from those taken.
    fn fitted(&self, wanted: Area, taken: &[Area]) -> Option<Area> {
        let mut area = wanted.common(&self.bounds().grown(-APART - 1e-6));
        let edges = self.edges.iter();
        let edges: Vec<Area> = edges.map(|e| Area::around(e.iter().copied())).collect();
        // Each step cuts off what one of them needs, so each is met once.
        while let Some(other) = (edges.iter().chain(taken)).find(|other| {
            let near = area.common(&other.grown(APART));
            near.low.cmplt(near.high).all()
        }) {
            area = area.beside(other);
        }
        let sides = area.high - area.low;
        let is_left = sides.min_element() >= NARROW && area.size() >= LEFT * wanted.size();
        (is_left && self.has_inside((area.low + area.high) / 2.0)).then_some(area)
    }
}

impl Openings {
    /// Finds the faces of all openings, the largest first.
    pub(super) fn new(world: &World, coarse: &CoarseRooms) -> Self {
        let mut openings = Self {
            sub_faces: Vec::new(),
            air: BTreeSet::new(),
            left_out: Vec::new(),
        };
        let mut order: Vec<usize> = (0..world.graph.portals.len()).collect();
        order.sort_by(|&a, &b| {
            world.graph.portals[b]
                .area
                .total_cmp(&world.graph.portals[a].area)
        });
        // The taken parts of faces, each in its own plane.
        let mut taken: Vec<Vec<Vec<Area>>> = coarse
            .rooms
            .iter()
            .map(|r| vec![Vec::new(); r.shell.surfaces.len()])
            .collect();
        for portal in order.into_iter().map(|p| PortalId(p as u32)) {
            openings.add(world, coarse, portal, &mut taken);
        }
        openings
    }

    /// Returns the openings in a face.
    pub(super) fn in_face(&self, room: usize, surface: usize) -> impl Iterator<Item = &SubFace> {
        self.sub_faces
            .iter()
            .filter(move |s| s.face == [room, surface])
    }

    fn add(
        &mut self,
        world: &World,
        coarse: &CoarseRooms,
        id: PortalId,
        taken: &mut [Vec<Vec<Area>>],
    ) {
        let portal = &world.graph[id];
        let [a, b] = portal.cells;
        let at = |cell: CellId| coarse.rooms.iter().position(|r| r.shell.cell == cell);
        let (Some((r, other)), true) = (
            at(a).map(|r| (r, b)).or_else(|| at(b).map(|r| (r, a))),
            portal.kind != PortalKind::Crack,
        ) else {
            return;
        };
        let outline = coarse.frame.outline(&portal.outline);
        let middle = outline.iter().sum::<DVec3>() / outline.len() as f64;
        let normal = DVec3::from(coarse.frame.to_frame(portal.normal.map(f64::from)));
        let room = &coarse.rooms[r].shell;
        let mut found: Vec<(f64, usize, Plane, Area)> = Vec::new();
        for (s, surface) in room.surfaces.iter().enumerate() {
            let plane = Plane::of(surface);
            let depth = (middle - plane.origin).dot(plane.normal).abs();
            let is_behind = match surface.behind {
                Behind::Cell(cell) if at(other).is_some() => {
                    cell == other && surface.pair.is_some()
                }
                Behind::Cell(cell) => [cell, other].iter().all(|&c| !world.graph[c].is_indoors()),
                Behind::Ground | Behind::Matter => false,
            };
            if is_behind && depth <= DEEPEST && normal.dot(plane.normal).abs() > 0.9 {
                let whole = Area::around(outline.iter().map(|&p| plane.flat(p)));
                // As large as the opening where that is not a rectangle.
                let share = (f64::from(portal.area) / whole.size())
                    .clamp(0.0, 1.0)
                    .sqrt();
                let off = (whole.high - whole.low) * (0.5 - 0.5 * share);
                let wanted = Area {
                    low: whole.low + off,
                    high: whole.high - off,
                };
                let common = wanted.common(&plane.bounds()).size();
                found.push((common * (1.0 - 0.5 * depth), s, plane, wanted));
            }
        }
        found.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        for (common, s, plane, wanted) in found {
            let surface = &room.surfaces[s];
            if common <= 0.0 || self.air.contains(&[r, s]) {
                continue;
            }
            let answer = surface.pair.and_then(|pair| Some([at(other)?, pair]));
            if let Some(answer) = answer
                && portal.kind == PortalKind::Open
                && surface.thickness < 1e-6
                && common > AIR * surface.area
            {
                self.air.extend([[r, s], answer]);
                return;
            }
            let Some(area) = plane.fitted(wanted, &taken[r][s]) else {
                continue;
            };
            taken[r][s].push(area);
            let corners = area.corners().map(|p| plane.place(p));
            let own = corners.iter().map(DVec3::to_array);
            self.sub_faces.push(SubFace {
                portal: id,
                face: [r, s],
                outline: own.collect(),
            });
            if let Some(face) = answer {
                let across = corners
                    .iter()
                    .rev()
                    .map(|&p| p + plane.normal * surface.thickness);
                let outline: Vec<[f64; 3]> = across.map(|p| p.to_array()).collect();
                let theirs = Plane::of(&coarse.rooms[face[0]].shell.surfaces[face[1]]);
                let flat = outline.iter().map(|&p| theirs.flat(p.into()));
                taken[face[0]][face[1]].push(Area::around(flat));
                self.sub_faces.push(SubFace {
                    portal: id,
                    face,
                    outline,
                });
            }
            return;
        }
        self.left_out.push(id);
    }
}
