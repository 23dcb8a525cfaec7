//! Trees of planes put together: one locator from those of many pieces.
//!
//! Axis-parallel planes between pieces part them as long as they can. Where pieces reach around each other, the tree of one is
//! grown in each leaf of another, without the parts that lie outside (Naylor, Amanatides & Thibault, "Merging BSP trees yields
//! polyhedral set operations", SIGGRAPH 1990).

use enfilade_cpg::{CellId, Locator, LocatorNode};
use enfilade_geom::poly::Side;
use enfilade_geom::{Aabb, DVec3, Plane};
use enfilade_world::Pose;

use crate::region::{Region, plane_of};

/// Boxes that overlap by less count as apart. [Units: wu]
const TOUCH: f64 = 1e-5;

/// A locator at a pose. Where two hold, cells win over solid matter, and solid matter over what belongs to neither.
pub(crate) struct Planted<'a> {
    pub(crate) locator: &'a Locator,
    pub(crate) pose: Pose,
    /// Box around all its parts, in the common frame.
    pub(crate) bounds: Aabb,
    /// The cell of the whole for each of its own; `None` for those that do not belong to it.
    pub(crate) cells: &'a dyn Fn(CellId) -> Option<CellId>,
}

/// Returns the locator of all; the rest is in the cell `around`.
pub(crate) fn grown(bounds: Aabb, around: CellId, planted: &[Planted<'_>]) -> Locator {
    let mut grower = Grower {
        planted,
        out: Locator {
            bounds,
            outside: Some(around),
            ..Locator::default()
        },
    };
    let alive = (0..planted.len()).map(|tree| (tree, planted[tree].locator.root));
    let root = grower.grow(
        &Region::of_box(&bounds),
        alive.collect(),
        Locator::leaf(Some(around)),
    );
    grower.out.root = root;
    grower.out
}

struct Grower<'a> {
    planted: &'a [Planted<'a>],
    out: Locator,
}

impl Grower<'_> {
    /// Adds the tree of a region in which parts of trees hold: each its index, and the node or leaf that covers the region.
    fn grow(&mut self, region: &Region, alive: Vec<(usize, i32)>, mut rest: i32) -> i32 {
        let mut inner = Vec::with_capacity(alive.len());
        for (tree, at) in alive {
            let at = self.descended(tree, at, region);
            if at >= 0 {
                inner.push((tree, at));
            } else if at == -1 {
                rest = -1;
            } else if let Some(cell) = (self.planted[tree].cells)(CellId((-2 - at) as u32)) {
                return Locator::leaf(Some(cell));
            }
        }
        let plane = match inner[..] {
            [] => return rest,
            [(tree, at)] => self.plane(tree, at),
            _ => {
                (self.between(region, &inner)).unwrap_or_else(|| self.plane(inner[0].0, inner[0].1))
            }
        };
        let [front, back] = region.split(&plane);
        // A sliver on one side.
        let (front, back) = match (front, back) {
            (Some(front), Some(back)) => (front, back),
            (Some(one), None) | (None, Some(one)) => {
                let inner = inner
                    .iter()
                    .map(|&(tree, at)| (tree, self.stepped(tree, at, &one, &plane)));
                let inner = inner.collect();
                return self.grow(&one, inner, rest);
            }
            (None, None) => return rest,
        };
        let node = self.out.nodes.len();
        self.out
            .planes
            .push([plane.normal.x, plane.normal.y, plane.normal.z, plane.d]);
        self.out.nodes.push(LocatorNode {
            plane: self.out.planes.len() as u32 - 1,
            children: [-1, -1],
        });
        let first = self.grow(&front, self.within(&inner, &front), rest);
        let second = self.grow(&back, self.within(&inner, &back), rest);
        self.out.nodes[node].children = [first, second];
        node as i32
    }

    /// Returns the trees whose boxes reach into a region.
    fn within(&self, inner: &[(usize, i32)], region: &Region) -> Vec<(usize, i32)> {
        let bounds = region.bounds().expanded(-TOUCH);
        let reaches = |one: &&(usize, i32)| self.planted[one.0].bounds.overlaps(&bounds);
        inner.iter().filter(reaches).copied().collect()
    }

    /// Returns the plane of a tree's node in the common frame.
    fn plane(&self, tree: usize, at: i32) -> Plane {
        let Planted { locator, pose, .. } = &self.planted[tree];
        let own = plane_of(locator, at as usize);
        let normal = pose.direction(own.normal);
        Plane {
            normal,
            d: own.d - normal.dot(pose.at),
        }
    }

    /// Returns the deepest node or leaf of a tree that covers all of a region.
    fn descended(&self, tree: usize, mut at: i32, region: &Region) -> i32 {
        while at >= 0 {
            let children = self.planted[tree].locator.nodes[at as usize].children;
            at = match region.side(&self.plane(tree, at)) {
                Side::Front | Side::On => children[0],
                Side::Back => children[1],
                Side::Both => break,
            };
        }
        at
    }

    /// Returns the child of a tree's node on the side of its plane on which most of the region lies, if the plane is `plane`, by
    /// which the region could not be cut; otherwise the node.
    fn stepped(&self, tree: usize, at: i32, region: &Region, plane: &Plane) -> i32 {
        let own = self.plane(tree, at);
        if own != *plane {
            return at;
        }
        let n_points = region.points().count().max(1) as f64;
        let middle = region.points().sum::<DVec3>() / n_points;
        let children = self.planted[tree].locator.nodes[at as usize].children;
        children[usize::from(own.signed_distance(middle) < 0.0)]
    }

    /// Returns the axis-parallel plane that parts the boxes of trees best: the fewest on the fuller side, and fewer on both
    /// than all.
    fn between(&self, region: &Region, inner: &[(usize, i32)]) -> Option<Plane> {
        let bounds = region.bounds();
        let n = inner.len();
        let mut best: Option<(usize, usize, f64)> = None;
        for axis in 0..3 {
            let ends = |of: fn(&Aabb) -> DVec3| {
                let mut ends: Vec<f64> = (inner.iter())
                    .map(|one| of(&self.planted[one.0].bounds)[axis])
                    .collect();
                ends.sort_by(f64::total_cmp);
                ends
            };
            let (lows, highs) = (ends(|b| b.min), ends(|b| b.max));
            for &x in lows.iter().chain(&highs) {
                if x <= bounds.min[axis] + TOUCH || x >= bounds.max[axis] - TOUCH {
                    continue;
                }
                let n_back = lows.partition_point(|low| *low < x - TOUCH);
                let n_front = n - highs.partition_point(|high| *high <= x + TOUCH);
                let worst = n_back.max(n_front);
                if worst < n && best.is_none_or(|b| worst < b.0) {
                    best = Some((worst, axis, x));
                }
            }
        }
        best.map(|(_, axis, x)| Plane {
            normal: DVec3::AXES[axis],
            d: -x,
        })
    }
}
