//! Trees of boxes, culled against sets of planes.
//!
//! Four boxes are tested at a time. After Assarsson & Möller, "Optimized View Frustum Culling Algorithms
//! for Bounding Boxes" (2000): only the vertex farthest along a plane's normal is tested. Errs to
//! "inside".

use glam::{DVec3, Vec3, Vec4};

use enfilade_geom::Aabb;

/// An absent child.
const NONE: u32 = u32::MAX;
/// Marks a child that is an item, not a node.
const ITEM: u32 = 1 << 31;
/// Stack depth: levels of a tree of 2³¹ items, three siblings waiting at each, and a margin.
const STACK: usize = 64;

/// Four children: their boxes as `[min, max][axis]`, and their references.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Node {
    bounds: [[Vec4; 3]; 2],
    children: [u32; 4],
}

/// Many trees in one list of nodes.
#[derive(Clone, Debug, Default)]
pub(crate) struct BoxTrees {
    nodes: Vec<Node>,
}

/// The root of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Root(u32);

impl Root {
    pub(crate) const EMPTY: Self = Self(NONE);
}

/// An item and its box.
pub(crate) struct Boxed {
    pub(crate) bounds: Aabb,
    pub(crate) item: u32,
}

impl BoxTrees {
    /// Adds a tree over `items` and returns its root. Sorts `items`. O(n log² n).
    ///
    /// Boxes are grown by `margin` and rounded outwards.
    pub(crate) fn add(&mut self, items: &mut [Boxed], margin: f64) -> Root {
        if items.is_empty() {
            return Root::EMPTY;
        }
        let at = self.nodes.len() as u32;
        self.nodes.push(Node {
            bounds: [[Vec4::INFINITY; 3], [Vec4::NEG_INFINITY; 3]],
            children: [NONE; 4],
        });
        let n = items.len();
        if n > 4 {
            sort_longest(items);
            let (low, high) = items.split_at_mut(n / 2);
            sort_longest(low);
            sort_longest(high);
        }
        let cuts = [0, n / 4, n / 2, n / 2 + (n - n / 2) / 2, n];
        for k in 0..4 {
            let part = if n > 4 {
                &mut items[cuts[k]..cuts[k + 1]]
            } else if k < n {
                &mut items[k..=k]
            } else {
                break;
            };
            let bounds = part.iter().fold(Aabb::EMPTY, |b, i| b.union(i.bounds));
            let child = match part {
                [] => continue,
                [one] => ITEM | one.item,
                _ => self.add(part, margin).0,
            };
            let node = &mut self.nodes[at as usize];
            node.children[k] = child;
            for axis in 0..3 {
                node.bounds[0][axis][k] = ((bounds.min[axis] - margin) as f32).next_down();
                node.bounds[1][axis][k] = ((bounds.max[axis] + margin) as f32).next_up();
            }
        }
        Root(at)
    }

    /// Calls `visit` for each item of a tree whose box is not entirely outside one of the planes.
    #[inline]
    pub(crate) fn for_each_inside(
        &self,
        root: Root,
        planes: &Planes,
        mut visit: impl FnMut(u32, [Vec4; 2]),
    ) {
        if root.0 == NONE {
            return;
        }
        let mut stack = [0; STACK];
        stack[0] = root.0;
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let node = &self.nodes[stack[len] as usize];
            let mut mask = planes.boxes_inside(&node.bounds);
            while mask != 0 {
                let k = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                let child = node.children[k];
                if child == NONE {
                    continue;
                }
                if child & ITEM == 0 {
                    stack[len] = child;
                    len += 1;
                    continue;
                }
                let corner = |side: usize| {
                    let b = &node.bounds[side];
                    Vec4::new(b[0][k], b[1][k], b[2][k], 1.0)
                };
                visit(child & !ITEM, [corner(0), corner(1)]);
            }
        }
    }
}

/// A ray prepared for box tests. Its parameter `t` is the caller's.
pub(crate) struct BoxRay {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    is_back: [usize; 3],
}

impl BoxRay {
    pub(crate) fn new(origin: DVec3, direction: DVec3) -> Self {
        // Raise a vanishing component to one that moves the ray by a negligible distance.
        let least = direction.abs().max_element() * 1e-12;
        let direction = direction
            .abs()
            .max(DVec3::splat(least))
            .copysign(direction)
            .as_vec3();
        let inverse = direction.recip();
        let origin = origin.as_vec3();
        Self {
            origin: [0, 1, 2].map(|k| Vec4::splat(origin[k])),
            inverse: [0, 1, 2].map(|k| Vec4::splat(inverse[k])),
            is_back: [0, 1, 2].map(|k| usize::from(direction[k] < 0.0)),
        }
    }
}

impl BoxTrees {
    /// Calls `visit` for each item of a tree whose box the ray meets at `t` from 0 to `limit`, roughly near
    /// to far; `visit` returns the new limit. Boxes must already be grown by the rounding of `f32`.
    #[inline]
    pub(crate) fn for_each_on_ray(
        &self,
        root: Root,
        ray: &BoxRay,
        mut limit: f32,
        mut visit: impl FnMut(u32) -> f32,
    ) {
        if root.0 == NONE {
            return;
        }
        let mut stack = [(0, 0.0_f32); STACK];
        stack[0] = (root.0, 0.0);
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let (child, near) = stack[len];
            if near > limit {
                continue;
            }
            if child & ITEM != 0 {
                limit = visit(child & !ITEM);
                continue;
            }
            let node = &self.nodes[child as usize];
            let at = |far: usize, axis: usize| {
                (node.bounds[ray.is_back[axis] ^ far][axis] - ray.origin[axis]) * ray.inverse[axis]
            };
            let near = at(0, 0).max(at(0, 1)).max(at(0, 2)).max(Vec4::ZERO);
            let far = at(1, 0).min(at(1, 1)).min(at(1, 2));
            // Four roundings on either side.
            let far = (far * (1.0 + 1e-6)).min(Vec4::splat(limit));
            let mut mask = (near * (1.0 - 1e-6)).cmple(far).bitmask();
            let base = len;
            let near = near.to_array();
            while mask != 0 {
                let k = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                if node.children[k] == NONE {
                    continue;
                }
                // The nearest last: it is popped first.
                let mut i = len;
                while i > base && stack[i - 1].1 < near[k] {
                    stack[i] = stack[i - 1];
                    i -= 1;
                }
                stack[i] = (node.children[k], near[k] * (1.0 - 1e-6));
                len += 1;
            }
        }
    }
}

fn sort_longest(items: &mut [Boxed]) {
    let centers = items
        .iter()
        .fold(Aabb::EMPTY, |b, i| b.including(i.bounds.center()));
    let size = centers.size();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    // Ties by item, so that the same world gives the same tree.
    items.sort_unstable_by(|a, b| {
        let (x, y) = (a.bounds.center()[axis], b.bounds.center()[axis]);
        x.total_cmp(&y).then(a.item.cmp(&b.item))
    });
}

/// Maximum number of planes of a region: its edges, four sides, entry, far.
const MAX_PLANES: usize = crate::region::MAX_EDGES + 6;

/// Half-spaces `n · p + d >= 0` in world space, widened so that rounding excludes nothing.
#[derive(Clone, Debug)]
pub(crate) struct Planes {
    planes: [Vec4; MAX_PLANES],
    len: usize,
    eye: DVec3,
    /// Outward shift of each plane. [Units: wu]
    margin: f64,
}

impl Planes {
    /// An empty set of planes, for boxes with coordinates up to `extent` seen from `eye`.
    pub(crate) fn new(eye: DVec3, extent: f64) -> Self {
        // Three products and sums of up to twice the reach in `f32`, doubled.
        let reach = extent.max(eye.abs().max_element());
        Self {
            planes: [Vec4::ZERO; MAX_PLANES],
            len: 0,
            eye,
            margin: reach * (12.0 / 16_777_216.0),
        }
    }

    /// Largest shift of a plane by rounding. [Units: wu]
    pub(crate) fn margin(&self) -> f64 {
        self.margin
    }

    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Adds the half-space `normal · (p - eye) >= least`; `normal` may have any length.
    pub(crate) fn add(&mut self, normal: DVec3, least: f64) {
        let scale = 1.0 / normal.length();
        if !scale.is_finite() || self.len == MAX_PLANES {
            return;
        }
        let n = normal * scale;
        let d = self.margin - least * scale - n.dot(self.eye);
        self.planes[self.len] = n.extend(d).as_vec4();
        self.len += 1;
    }

    pub(crate) fn as_slice(&self) -> &[Vec4] {
        &self.planes[..self.len]
    }

    /// Returns `true` if a box is entirely outside one of the planes.
    #[inline]
    pub(crate) fn leave_out(&self, min: Vec3, max: Vec3) -> bool {
        self.as_slice().iter().any(|plane| {
            let n = plane.truncate();
            let far = Vec3::select(n.cmpge(Vec3::ZERO), max, min);
            n.dot(far) + plane.w < 0.0
        })
    }

    /// Bit `k` is set if box `k` of four is not outside any plane. Empty boxes are outside.
    #[inline]
    fn boxes_inside(&self, bounds: &[[Vec4; 3]; 2]) -> u32 {
        let mut inside = bounds[0][0].cmple(bounds[1][0]);
        for plane in self.as_slice() {
            let far = |axis: usize| bounds[usize::from(plane[axis] >= 0.0)][axis];
            let reach = far(0) * plane.x + far(1) * plane.y + far(2) * plane.z + plane.w;
            // NaN, from an infinite box, counts as inside.
            inside &= !reach.cmplt(Vec4::ZERO);
            if !inside.any() {
                return 0;
            }
        }
        inside.bitmask()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        // Covers R5.
        #[test]
        fn a_tree_visits_the_same_boxes_as_brute_force(
            corners in prop::collection::vec((prop::array::uniform3(-9.0f64..9.0),
                prop::array::uniform3(0.0f64..3.0)), 0..70),
            planes in prop::collection::vec((prop::array::uniform3(-1.0f64..1.0), -4.0f64..4.0), 0..6),
        ) {
            let boxes: Vec<Aabb> = corners.iter()
                .map(|(a, s)| Aabb::new((*a).into(), DVec3::from(*a) + DVec3::from(*s)))
                .collect();
            let mut items: Vec<Boxed> = boxes.iter().enumerate()
                .map(|(i, &bounds)| Boxed { bounds, item: i as u32 })
                .collect();
            let mut trees = BoxTrees::default();
            trees.add(&mut [Boxed { bounds: Aabb::new(DVec3::ZERO, DVec3::ONE), item: 7 }], 0.0);
            let root = trees.add(&mut items, 0.0);
            let eye = DVec3::new(0.5, 1.0, -2.0);
            let mut set = Planes::new(eye, 12.0);
            for (n, d) in &planes {
                set.add((*n).into(), *d);
            }
            let mut found = Vec::new();
            trees.for_each_inside(root, &set, |i, _| found.push(i));
            found.sort_unstable();
            prop_assert!(found.windows(2).all(|w| w[0] < w[1]), "twice");
            for (i, b) in boxes.iter().enumerate() {
                // The best vertex for each plane, in f64, without margin.
                let is_inside = |slack: f64| planes.iter().all(|(n, d)| {
                    let n = DVec3::from(*n);
                    n.length() < 1e-300 || (0..8).any(|c| {
                        let p = DVec3::select(glam::BVec3::new(c & 1 > 0, c & 2 > 0, c & 4 > 0), b.min, b.max);
                        n.dot(p - eye) - d >= -slack * n.length()
                    })
                });
                let is_found = found.binary_search(&(i as u32)).is_ok();
                prop_assert!(is_found || !is_inside(0.0), "lost {b:?}");
                prop_assert!(!is_found || is_inside(1e-4), "kept {b:?}");
            }
        }
    }
}
