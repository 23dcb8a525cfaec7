//! Point to cell: a tree of planes whose leaves are cells.

use enfilade_geom::poly::{self, Sides};
use enfilade_geom::{Aabb, DVec3, Plane, Winding};

use crate::CellId;

/// Geometry this close to a plane of the locator touches both its sides. [Units: wu]
const TOUCH: f64 = 1e-4;

/// Returns the vertices of `polygon` that lie on `plane`: one of its vertices or edges.
fn on_plane(polygon: &Winding, plane: &Plane) -> Winding {
    let near = |p: &&DVec3| plane.signed_distance(**p).abs() <= TOUCH;
    Winding::new(polygon.points.iter().filter(near).copied().collect())
}

/// Finds the cell of a point, for graphs of any builder.
///
/// A binary tree of planes over the box `bounds`; every leaf is one cell or solid. Points outside the box belong to
/// `outside`. Cost: one plane test per level, about 20 levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Locator {
    /// The box that the tree covers. [Units: wu]
    pub bounds: Aabb,
    /// The cell of everything beyond `bounds`; `None` for worlds without an outdoors.
    pub outside: Option<CellId>,
    /// Distinct planes as `[nx, ny, nz, d]`.
    pub planes: Vec<[f64; 4]>,
    /// Inner nodes. Each has one parent, and children come after it, so that no walk can loop.
    pub nodes: Vec<LocatorNode>,
    /// The tree: a node (`>= 0`) or a leaf (see [`Locator::leaf`]).
    pub root: i32,
}

/// An inner node of the [`Locator`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocatorNode {
    /// Index into [`Locator::planes`].
    pub plane: u32,
    /// Child on the positive side (points on the plane included) and on the negative side: a node
    /// index, or a leaf as [`Locator::leaf`] encodes it.
    pub children: [i32; 2],
}

impl Default for Locator {
    fn default() -> Self {
        Self {
            bounds: Aabb::EMPTY,
            outside: None,
            planes: Vec::new(),
            nodes: Vec::new(),
            root: Self::leaf(None),
        }
    }
}

impl Locator {
    /// Most nodes on a walk from the root to a leaf. Trees of real buildings have some tens. Cutting space by a tree
    /// takes time by its nodes times its depth, so without a limit a file of a megabyte could take hours.
    pub const MAX_DEPTH: u32 = 1024;

    /// Returns the child value of a leaf: `-1` for solid, `-2 - cell` for a cell.
    #[must_use]
    pub const fn leaf(cell: Option<CellId>) -> i32 {
        match cell {
            None => -1,
            Some(CellId(id)) => -2 - id as i32,
        }
    }

    /// Adds the cells that a convex polygon touches to `cells`, which stays ascending and without duplicates. Parts
    /// within 0.1 mm of a plane are on both sides of it: errs to "touches".
    ///
    /// `corners` are its vertices in order, any number of them. Vertices that are not finite touch nothing.
    #[doc(hidden)]
    pub fn cells_touching(&self, corners: &[DVec3], cells: &mut Vec<CellId>) {
        if corners.is_empty() || corners.iter().any(|p| !p.is_finite()) {
            return;
        }
        let mut add = |cell: Option<CellId>| {
            if let Some(cell) = cell
                && let Err(at) = cells.binary_search(&cell)
            {
                cells.insert(at, cell);
            }
        };
        if corners.iter().any(|&p| !self.bounds.contains(p)) {
            add(self.outside);
        }
        let mut stack = vec![(self.root, Winding::new(corners.to_vec()))];
        while let Some((at, polygon)) = stack.pop() {
            if at < 0 {
                add((at <= -2).then(|| CellId((-2 - at) as u32)));
                continue;
            }
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let plane = Plane {
                normal: DVec3::new(x, y, z),
                d,
            };
            let (front, back) = polygon.split(&plane, TOUCH);
            // In the plane: visit both sides.
            if front.is_none() && back.is_none() {
                stack.push((node.children[0], polygon.clone()));
                stack.push((node.children[1], polygon));
                continue;
            }
            let mut points = polygon.points.iter();
            let touches = points.any(|&p| plane.signed_distance(p).abs() <= TOUCH);
            for (child, part) in node.children.into_iter().zip([front, back]) {
                match part {
                    Some(part) => stack.push((child, part)),
                    // The polygon ends at the plane: only an edge or vertex of it touches the space behind.
                    None if touches => stack.push((child, on_plane(&polygon, &plane))),
                    None => {}
                }
            }
        }
    }

    /// Divides a convex polygon into its parts by cell, and passes on each; `None` is solid matter. What lies in a plane of
    /// the tree goes to its positive side, as points do. O(parts × depth).
    #[doc(hidden)]
    pub fn for_parts(&self, polygon: Winding, mut use_part: impl FnMut(Option<CellId>, Winding)) {
        let mut rest = Some(polygon);
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for (side, inward) in [(self.bounds.min, axis), (self.bounds.max, -axis)] {
                rest =
                    rest.and_then(
                        |whole| match whole.split(&Plane::through(side, inward), 0.0) {
                            (None, None) => Some(whole),
                            (inside, beyond) => {
                                beyond
                                    .into_iter()
                                    .for_each(|part| use_part(self.outside, part));
                                inside
                            }
                        },
                    );
            }
        }
        let mut stack: Vec<(i32, Winding)> = rest.map(|w| (self.root, w)).into_iter().collect();
        while let Some((at, polygon)) = stack.pop() {
            if at < 0 {
                use_part((at <= -2).then(|| CellId((-2 - at) as u32)), polygon);
                continue;
            }
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let normal = DVec3::new(x, y, z);
            let plane = Plane { normal, d };
            match poly::split(&polygon.points, &plane, 0.0) {
                Sides::On | Sides::Front => stack.push((node.children[0], polygon)),
                Sides::Back => stack.push((node.children[1], polygon)),
                Sides::Both(front, back) => {
                    let parts = node.children.into_iter().zip([front, back]);
                    stack.extend(parts.map(|(child, part)| (child, Winding::new(part.to_vec()))));
                }
            }
        }
    }

    /// Returns the share of the segment from `from` to `to` that lies in one cell, from its start on: 0 if its start does not,
    /// 1 if all of it does. O(leaves on the way × depth).
    #[must_use]
    #[doc(hidden)]
    pub fn share_in(&self, cell: CellId, from: DVec3, to: DVec3) -> f64 {
        let mut reached = 0.0;
        let mut stack = vec![(self.root, 0.0, 1.0)];
        while let Some((at, low, high)) = stack.pop() {
            if at < 0 {
                if at != Self::leaf(Some(cell)) {
                    return reached;
                }
                reached = high;
                continue;
            }
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let side = |share: f64| from.lerp(to, share).dot(DVec3::new(x, y, z)) + d;
            let (a, b) = (side(low), side(high));
            let first = node.children[usize::from(a < 0.0)];
            if (a < 0.0) == (b < 0.0) {
                stack.push((first, low, high));
                continue;
            }
            let middle = low + (high - low) * (a / (a - b));
            let second = node.children[usize::from(b < 0.0)];
            // The nearer part is popped first; a part without length is in neither.
            stack.extend((middle < high).then_some((second, middle, high)));
            stack.extend((low < middle).then_some((first, low, middle)));
        }
        reached
    }

    /// Adds the cells that the convex hull of `points`, grown by `margin`, may touch to `cells`, which stays
    /// ascending and without duplicates. [Units: wu]
    ///
    /// Includes every cell that it touches, and may include some that it only comes near. Points that are not finite
    /// touch nothing. `O(points)` for each node that the hull reaches.
    pub fn cells_near(&self, points: &[DVec3], margin: f64, cells: &mut Vec<CellId>) {
        self.cells_near_with(points, margin, cells, &mut Vec::new());
    }

    /// Does [`Locator::cells_near`] with a buffer kept between queries, so that nothing is allocated once it has
    /// grown. The buffer's contents do not matter.
    #[doc(hidden)]
    pub fn cells_near_with(
        &self,
        points: &[DVec3],
        margin: f64,
        cells: &mut Vec<CellId>,
        stack: &mut Vec<i32>,
    ) {
        if points.is_empty() || points.iter().any(|p| !p.is_finite()) {
            return;
        }
        let mut add = |cell: Option<CellId>| {
            if let Some(cell) = cell
                && let Err(at) = cells.binary_search(&cell)
            {
                cells.insert(at, cell);
            }
        };
        let margin = margin.max(0.0) + TOUCH;
        let reach = Aabb::of_points(points).expanded(margin);
        if !(self.bounds.contains(reach.min) && self.bounds.contains(reach.max)) {
            add(self.outside);
        }
        stack.clear();
        stack.push(self.root);
        while let Some(at) = stack.pop() {
            if at < 0 {
                add((at <= -2).then(|| CellId((-2 - at) as u32)));
                continue;
            }
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let normal = DVec3::new(x, y, z);
            let far = margin * normal.length();
            let sides = points.iter().map(|p| normal.dot(*p) + d);
            let (low, high) = sides.fold((f64::MAX, f64::MIN), |(l, h), s| (l.min(s), h.max(s)));
            if high >= -far {
                stack.push(node.children[0]);
            }
            if low <= far {
                stack.push(node.children[1]);
            }
        }
    }

    /// Returns the cell of `p`, as [`Locator::locate`], and a distance from `p` within which it is surely the same:
    /// that to the nearest plane on the way down the tree. 0 outside the box. [Units: wu]
    #[must_use]
    #[doc(hidden)]
    pub fn locate_with_room(&self, p: DVec3) -> (Option<CellId>, f64) {
        if !p.is_finite() || !self.bounds.contains(p) {
            return (self.locate(p), 0.0);
        }
        let walls = (p - self.bounds.min).min(self.bounds.max - p);
        let mut room = walls.min_element();
        let mut at = self.root;
        while at >= 0 {
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let side = x * p.x + y * p.y + z * p.z + d;
            // Normals have unit length only up to rounding.
            room = room.min(side.abs() * (1.0 - 1e-6));
            at = node.children[usize::from(side < 0.0)];
        }
        ((at <= -2).then(|| CellId((-2 - at) as u32)), room)
    }

    /// Returns the cell of `p`; `None` inside solids and for points that are not finite.
    #[must_use]
    pub fn locate(&self, p: DVec3) -> Option<CellId> {
        if !p.is_finite() {
            return None;
        }
        if !self.bounds.contains(p) {
            return self.outside;
        }
        self.locate_below(self.root, p)
    }

    /// Returns the smallest part of the tree that answers for all points of a convex hull, so that many points close to one
    /// another share the walk from the root. O(points × depth).
    #[must_use]
    #[doc(hidden)]
    pub fn around(&self, hull: &[DVec3]) -> Around<'_> {
        let is_inside = |p: &DVec3| p.is_finite() && self.bounds.contains(*p);
        if !hull.iter().all(is_inside) {
            return Around {
                locator: self,
                top: None,
            };
        }
        let mut at = self.root;
        while at >= 0 {
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let is_behind = |p: &DVec3| x * p.x + y * p.y + z * p.z + d < 0.0;
            let n_behind = hull.iter().filter(|p| is_behind(p)).count();
            if n_behind != 0 && n_behind != hull.len() {
                break;
            }
            at = node.children[usize::from(n_behind != 0)];
        }
        Around {
            locator: self,
            top: Some(at),
        }
    }

    fn locate_below(&self, top: i32, p: DVec3) -> Option<CellId> {
        let mut at = top;
        while at >= 0 {
            let node = &self.nodes[at as usize];
            let [x, y, z, d] = self.planes[node.plane as usize];
            let side = x * p.x + y * p.y + z * p.z + d;
            at = node.children[usize::from(side < 0.0)];
        }
        (at <= -2).then(|| CellId((-2 - at) as u32))
    }
}

/// A part of a [`Locator`], made by [`Locator::around`].
#[derive(Clone, Copy, Debug)]
pub struct Around<'l> {
    locator: &'l Locator,
    /// `None` if the hull leaves the box of the tree.
    top: Option<i32>,
}

impl Around<'_> {
    /// Returns the cell of a point of the hull, as [`Locator::locate`] does.
    #[must_use]
    pub fn locate(&self, p: DVec3) -> Option<CellId> {
        match self.top {
            Some(top) => self.locator.locate_below(top, p),
            None => self.locator.locate(p),
        }
    }
}
