//! The plane tree: axis-aligned splits while a box holds many surfaces, then splits by the planes of the surfaces.
//!
//! The lower part is the BSP of Lefebvre & Hornus 2003 (§2, step 1), split by the surfaces' own planes; their notes
//! after §3.0.2 mention that it may begin with given planes, such as a grid's. A pure autopartition lets every wall's
//! plane cut the whole building. Boxes first keep each plane local, which makes the number of leaves near-linear. If
//! possible, a box side lies on a large axis-aligned surface, which then needs no split of its own.

use enfilade_geom::poly::{self, Poly, Side};
use enfilade_geom::{Aabb, DVec3, Plane, Purse};

use rayon::prelude::*;

use super::surface::{NO_PLANE, SurfaceSet, Tolerance, lies_in};

/// A box with this many fragments or fewer is split by their own planes.
///
/// With fewer, there are more boxes; with more, planes cut more of each other.
const MAX_BOX_FRAGMENTS: usize = 8;

/// Boxes are not split below this edge length. [Units: wu]
const MIN_BOX: f64 = 0.02;

/// In boxes that cannot be split any more, fragments beyond this number stay in leaves uncut.
///
/// An uncut fragment does not block: cells join there, which keeps every promise.
const MAX_BSP_FRAGMENTS: usize = 512;

/// Subtrees with more fragments are built in parallel. A fixed number, so that the tree is the same for any number of
/// threads.
const PARALLEL_FRAGMENTS: usize = 1000;

/// Larger sets choose splits by a sample of this many fragments.
const SAMPLE: usize = 1024;

/// An inner node. A child is a node index (`>= 0`) or `-1 - leaf`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    /// Index into [`Tree::planes`].
    pub(super) plane: u32,
    /// Start of its surfaces in [`Tree::on_plane`]; they end where the next node's start.
    pub(super) on_start: u32,
    /// Children on the positive and on the negative side.
    pub(super) children: [i32; 2],
}

/// The plane tree. Nodes are in preorder, leaves are numbered from left to right.
pub(super) struct Tree {
    /// The box that it covers.
    pub(super) bounds: Aabb,
    /// Planes of surfaces, then of box sides.
    pub(super) planes: Vec<Plane>,
    /// Inner nodes.
    pub(super) nodes: Vec<Node>,
    /// Surfaces that lie in a node's plane within the node's region.
    pub(super) on_plane: Vec<u32>,
    /// The root.
    pub(super) root: i32,
    /// Number of leaves.
    pub(super) n_leaves: u32,
}

impl Tree {
    /// Returns the surfaces that lie in a node's plane.
    pub(super) fn surfaces_on(&self, node: usize) -> &[u32] {
        let end = self
            .nodes
            .get(node + 1)
            .map_or(self.on_plane.len(), |n| n.on_start as usize);
        &self.on_plane[self.nodes[node].on_start as usize..end]
    }

    /// Returns the leaf that holds `p`; points in a plane count as in front.
    pub(super) fn leaf_of(&self, p: DVec3) -> u32 {
        let mut at = self.root;
        while at >= 0 {
            let node = &self.nodes[at as usize];
            let n = &self.planes[node.plane as usize];
            // The same expression as in the locator, so that both always agree.
            let side = n.normal.x * p.x + n.normal.y * p.y + n.normal.z * p.z + n.d;
            at = node.children[usize::from(side < 0.0)];
        }
        leaf_index(at)
    }

    /// Returns the range of the leaves below `child`.
    pub(super) fn leaf_range(&self, child: i32) -> std::ops::Range<u32> {
        let end = |side: usize| {
            let mut at = child;
            while at >= 0 {
                at = self.nodes[at as usize].children[side];
            }
            leaf_index(at)
        };
        end(0)..end(1) + 1
    }
}

/// Returns the leaf of a child value.
pub(super) fn leaf_index(child: i32) -> u32 {
    (-1 - child) as u32
}

/// A piece of a surface in a box or a region of it. Small, since each moves once for each node above it.
struct Fragment {
    surface: u32,
    plane: u32,
    bounds: Aabb,
    /// Its vertices, unless they are those of the surface.
    cut: Option<Box<Poly>>,
}

impl Fragment {
    fn cut_to(&self, points: Poly) -> Self {
        Self {
            bounds: Aabb::of_points(&points),
            cut: Some(Box::new(points)),
            ..*self
        }
    }

    fn points<'a>(&'a self, set: &'a SurfaceSet) -> &'a [DVec3] {
        match &self.cut {
            Some(points) => points,
            None => &set.surfaces[self.surface as usize].points,
        }
    }

    /// Returns its side of a plane across an axis, as [`poly::side`] does.
    fn side(&self, axis: usize, at: f64, eps: f64) -> Side {
        let [is_front, is_back] = [
            self.bounds.max[axis] - at > eps,
            self.bounds.min[axis] - at < -eps,
        ];
        match (is_front, is_back) {
            (false, false) => Side::On,
            (true, false) => Side::Front,
            (false, true) => Side::Back,
            (true, true) => Side::Both,
        }
    }
}

/// A subtree under construction. Planes of box sides are numbered after those of surfaces.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    on_plane: Vec<u32>,
    sides: Vec<(u8, f64)>,
    n_leaves: u32,
}

impl Part {
    fn leaf(&mut self) -> i32 {
        self.n_leaves += 1;
        -(self.n_leaves as i32)
    }

    /// Appends a part built separately; returns its root in this one.
    fn append(&mut self, part: &Part, root: i32, n_surface_planes: u32) -> i32 {
        let (node0, on0) = (self.nodes.len() as i32, self.on_plane.len() as u32);
        let (side0, leaf0) = (self.sides.len() as u32, self.n_leaves as i32);
        let shifted = |child: i32| {
            if child >= 0 {
                child + node0
            } else {
                child - leaf0
            }
        };
        self.nodes.extend(part.nodes.iter().map(|n| Node {
            plane: if n.plane >= n_surface_planes {
                n.plane + side0
            } else {
                n.plane
            },
            on_start: n.on_start + on0,
            children: n.children.map(shifted),
        }));
        self.on_plane.extend_from_slice(&part.on_plane);
        self.sides.extend_from_slice(&part.sides);
        self.n_leaves += part.n_leaves;
        shifted(root)
    }
}

/// Builds the tree. Near-linear in fragments for scenes with surfaces spread out; a knot of `k` surfaces through one
/// point makes up to `k²` leaves.
pub(super) fn build(
    set: &SurfaceSet,
    bounds: Aabb,
    tolerance: &Tolerance,
    purse: Purse<'_>,
) -> Tree {
    let fragments: Vec<Fragment> = (0..set.surfaces.len() as u32)
        .into_par_iter()
        .with_min_len(1024)
        .filter_map(|surface| {
            let s = &set.surfaces[surface as usize];
            if s.plane == NO_PLANE {
                return None;
            }
            let points = poly::clip_to_box(&s.points, &bounds, tolerance.cut)?;
            Some(Fragment {
                surface,
                plane: s.plane,
                bounds: Aabb::of_points(&points),
                cut: (points[..] != s.points[..]).then(|| Box::new(points)),
            })
        })
        .collect();
    let axis_of: Vec<Option<u8>> = set
        .planes
        .planes()
        .iter()
        .map(|p| (0..3).find(|&a| p.normal[a] == 1.0).map(|a| a as u8))
        .collect();
    let builder = Builder {
        set,
        axis_of,
        tolerance: *tolerance,
        purse,
    };
    let mut part = Part::default();
    let root = builder.split_box(fragments, bounds, &mut part);
    let mut planes = set.planes.planes().to_vec();
    // Adjacent boxes are often split at the same place; keep each plane once.
    let mut distinct: Vec<(u8, u64)> = part.sides.iter().map(|&(a, x)| (a, x.to_bits())).collect();
    distinct.sort_unstable();
    distinct.dedup();
    let n_surface_planes = planes.len() as u32;
    for node in &mut part.nodes {
        if node.plane >= n_surface_planes {
            let (axis, at) = part.sides[(node.plane - n_surface_planes) as usize];
            let rank = distinct.partition_point(|&k| k < (axis, at.to_bits()));
            node.plane = n_surface_planes + rank as u32;
        }
    }
    planes.extend(distinct.iter().map(|&(axis, bits)| {
        let mut normal = DVec3::ZERO;
        normal[axis as usize] = 1.0;
        Plane {
            normal,
            d: -f64::from_bits(bits),
        }
    }));
    Tree {
        bounds,
        planes,
        nodes: part.nodes,
        on_plane: part.on_plane,
        root,
        n_leaves: part.n_leaves,
    }
}

struct Builder<'a> {
    set: &'a SurfaceSet,
    axis_of: Vec<Option<u8>>,
    tolerance: Tolerance,
    purse: Purse<'a>,
}

/// A split of a box.
struct BoxSplit {
    axis: usize,
    at: f64,
    plane: Option<u32>,
}

/// Counts the intervals on both sides of a place that moves up.
struct Sweep<'a> {
    /// Those not yet passed, ascending.
    mins: &'a [f64],
    maxs: &'a [f64],
    /// Number of intervals that begin before the place.
    n_back: usize,
    slack: f64,
}

impl<'a> Sweep<'a> {
    fn over(mins: &'a [f64], maxs: &'a [f64], slack: f64) -> Self {
        Self {
            mins,
            maxs,
            n_back: 0,
            slack,
        }
    }

    /// Returns the number of intervals that reach behind a place by more than the slack, and of those that reach in front
    /// of it. Places must ascend.
    fn sides(&mut self, at: f64) -> [usize; 2] {
        let is_back = |x: &&f64| **x < at - self.slack;
        let n = self.mins.iter().take_while(is_back).count();
        self.mins = &self.mins[n..];
        self.n_back += n;
        let is_behind = |x: &&f64| **x <= at + self.slack;
        self.maxs = &self.maxs[self.maxs.iter().take_while(is_behind).count()..];
        [self.n_back, self.maxs.len()]
    }
}

impl Builder<'_> {
    fn split_box(&self, fragments: Vec<Fragment>, bounds: Aabb, out: &mut Part) -> i32 {
        let n = fragments.len();
        if !self.purse.spend(2 * n as u64) {
            return out.leaf();
        }
        let split = if n > MAX_BOX_FRAGMENTS {
            self.choose_box_split(&fragments, &bounds)
        } else {
            None
        };
        let Some(split) = split else {
            return self.split_by_planes(fragments, out);
        };
        let n_surface_planes = self.set.planes.planes().len() as u32;
        let node = out.nodes.len();
        let plane = split
            .plane
            .unwrap_or(n_surface_planes + out.sides.len() as u32);
        if split.plane.is_none() {
            out.sides.push((split.axis as u8, split.at));
        }
        out.nodes.push(Node {
            plane,
            on_start: out.on_plane.len() as u32,
            children: [0; 2],
        });
        let mut normal = DVec3::ZERO;
        normal[split.axis] = 1.0;
        let cut = Plane {
            normal,
            d: -split.at,
        };
        let (front, back) = self.distribute(fragments, split.plane, &cut, &mut out.on_plane);
        let (mut front_box, mut back_box) = (bounds, bounds);
        front_box.min[split.axis] = split.at;
        back_box.max[split.axis] = split.at;
        let children = if n > PARALLEL_FRAGMENTS {
            let build = |fragments, bounds| {
                let mut part = Part::default();
                let root = self.split_box(fragments, bounds, &mut part);
                (part, root)
            };
            let ((f, f_root), (b, b_root)) =
                rayon::join(|| build(front, front_box), || build(back, back_box));
            let f_root = out.append(&f, f_root, n_surface_planes);
            drop(f);
            [f_root, out.append(&b, b_root, n_surface_planes)]
        } else {
            [
                self.split_box(front, front_box, out),
                self.split_box(back, back_box, out),
            ]
        };
        out.nodes[node].children = children;
        node as i32
    }

    /// Distributes fragments to the sides of a plane; records those in it in `on_plane`.
    fn distribute(
        &self,
        fragments: Vec<Fragment>,
        plane_id: Option<u32>,
        cut: &Plane,
        on_plane: &mut Vec<u32>,
    ) -> (Vec<Fragment>, Vec<Fragment>) {
        let on_start = on_plane.len();
        let [mut front, mut back] = [0; 2].map(|_| Vec::with_capacity(fragments.len() / 2 + 1));
        let axis = (0..3).find(|&a| cut.normal[a] == 1.0);
        let eps = self.tolerance.cut;
        for f in fragments {
            if let Some(id) = plane_id
                && lies_in(
                    f.plane,
                    || &self.set.surfaces[f.surface as usize].points,
                    id,
                    self.set.planes.planes(),
                    &self.tolerance,
                )
            {
                on_plane.push(f.surface);
                continue;
            }
            let side = match axis {
                Some(axis) => f.side(axis, -cut.d, eps),
                None => poly::side(f.points(self.set), cut, eps),
            };
            match side {
                Side::Front => front.push(f),
                Side::Back => back.push(f),
                Side::Both => {
                    let [mut a, mut b] = [Poly::new(), Poly::new()];
                    poly::add_parts(f.points(self.set), cut, eps, &mut a, &mut b);
                    front.push(f.cut_to(a));
                    back.push(f.cut_to(b));
                }
                // Too small to have a side; nothing of it is left.
                Side::On => {}
            }
        }
        // A surface may arrive in several fragments if regions were cut before.
        on_plane[on_start..].sort_unstable();
        let mut kept = on_start;
        for i in on_start..on_plane.len() {
            if i == on_start || on_plane[i] != on_plane[kept - 1] {
                on_plane[kept] = on_plane[i];
                kept += 1;
            }
        }
        on_plane.truncate(kept);
        (front, back)
    }

    /// Returns the split with the least surface-area cost; `None` if splitting the box does not pay.
    fn choose_box_split(&self, fragments: &[Fragment], bounds: &Aabb) -> Option<BoxSplit> {
        let stride = fragments.len().div_ceil(SAMPLE);
        let sample: Vec<&Fragment> = fragments.iter().step_by(stride).collect();
        let total = sample.len() as f64;
        let size = bounds.size();
        let mut best: Option<(f64, BoxSplit)> = None;
        // Stay away from vertices of surfaces, so that no cut shaves off a part thinner than an epsilon.
        let gap = 50.0 * self.tolerance.plane;
        for axis in 0..3 {
            if size[axis] < MIN_BOX {
                continue;
            }
            let (lo, hi) = (bounds.min[axis], bounds.max[axis]);
            let mut mins: Vec<f64> = sample.iter().map(|f| f.bounds.min[axis]).collect();
            let mut maxs: Vec<f64> = sample.iter().map(|f| f.bounds.max[axis]).collect();
            mins.sort_unstable_by(f64::total_cmp);
            maxs.sort_unstable_by(f64::total_cmp);
            let (u, v) = (size[(axis + 1) % 3], size[(axis + 2) % 3]);
            let share = |extent: f64| 2.0 * (u * v + extent * (u + v));
            let cost = |[n_back, n_front]: [usize; 2], at: f64| {
                let weighed = share(at - lo) * n_back as f64 + share(hi - at) * n_front as f64;
                weighed / share(hi - lo)
            };
            // The planes of axis-aligned surfaces; those that cover much of the section are preferred.
            let mut flat: Vec<(f64, u32, f64)> = sample
                .iter()
                .filter(|f| self.axis_of[f.plane as usize] == Some(axis as u8))
                .map(|f| {
                    let at = -self.set.planes.planes()[f.plane as usize].d;
                    (at, f.plane, poly::area(f.points(self.set)))
                })
                .filter(|&(at, ..)| at > lo + self.tolerance.cut && at < hi - self.tolerance.cut)
                .collect();
            flat.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut sweep = Sweep::over(&mins, &maxs, self.tolerance.plane);
            for group in flat.chunk_by(|a, b| a.1 == b.1) {
                let (at, id, _) = group[0];
                let covered: f64 = group.iter().map(|g| g.2).sum::<f64>() * stride as f64;
                let coverage = (covered / (u * v)).min(1.0);
                let c = cost(sweep.sides(at), at) * (1.0 - 0.3 * coverage);
                if best.as_ref().is_none_or(|b| c < b.0) {
                    best = Some((
                        c,
                        BoxSplit {
                            axis,
                            at,
                            plane: Some(id),
                        },
                    ));
                }
            }
            let mut ends = [&mins[..], &maxs, &[lo, hi]].concat();
            // Joins ascending runs.
            ends.sort_by(f64::total_cmp);
            let step = (ends.len() / 128).max(1);
            let mut sweep = Sweep::over(&mins, &maxs, 0.0);
            for pair in ends.windows(2).step_by(step) {
                let at = 0.5 * (pair[0] + pair[1]);
                if pair[1] - pair[0] < 2.0 * gap
                    || at - lo < MIN_BOX * 0.25
                    || hi - at < MIN_BOX * 0.25
                {
                    continue;
                }
                let c = cost(sweep.sides(at), at);
                if best.as_ref().is_none_or(|b| c < b.0) {
                    best = Some((
                        c,
                        BoxSplit {
                            axis,
                            at,
                            plane: None,
                        },
                    ));
                }
            }
        }
        let Some((cost, split)) = best else {
            return self.halve(fragments.len(), bounds);
        };
        // A split that separates almost nothing only multiplies fragments.
        let useful =
            cost < 0.9 * total || (fragments.len() > 4 * MAX_BOX_FRAGMENTS && cost < 0.99 * total);
        if useful {
            Some(split)
        } else {
            self.halve(fragments.len(), bounds)
        }
    }

    /// Returns a split in the middle of the longest side, for boxes too dense for their surfaces' planes and without
    /// a good split: costly, but it ends at [`MIN_BOX`].
    fn halve(&self, n_fragments: usize, bounds: &Aabb) -> Option<BoxSplit> {
        let size = bounds.size();
        let axis = (0..3)
            .max_by(|&a, &b| size[a].total_cmp(&size[b]))
            .unwrap_or(0);
        if n_fragments <= MAX_BSP_FRAGMENTS || size[axis] < MIN_BOX {
            return None;
        }
        // Not the exact middle, where vertices are common.
        let at = bounds.min[axis] + 0.483_217 * size[axis];
        Some(BoxSplit {
            axis,
            at,
            plane: None,
        })
    }

    /// Splits a convex region by the planes of its surfaces.
    fn split_by_planes(&self, fragments: Vec<Fragment>, out: &mut Part) -> i32 {
        if fragments.is_empty() {
            return out.leaf();
        }
        let fragments = bounded(fragments);
        // Choosing a plane examines most fragments several times.
        if !self.purse.spend(3 * fragments.len() as u64) {
            return out.leaf();
        }
        let plane = self.choose_plane(&fragments);
        let node = out.nodes.len();
        out.nodes.push(Node {
            plane,
            on_start: out.on_plane.len() as u32,
            children: [0; 2],
        });
        let cut = self.set.planes.planes()[plane as usize];
        let (front, back) = self.distribute(fragments, Some(plane), &cut, &mut out.on_plane);
        let children = [
            self.split_by_planes(front, out),
            self.split_by_planes(back, out),
        ];
        out.nodes[node].children = children;
        node as i32
    }

    /// Returns the plane that splits the fewest fragments, then balances best, then covers most, then comes first.
    fn choose_plane(&self, fragments: &[Fragment]) -> u32 {
        let mut ids: Vec<u32> = fragments.iter().map(|f| f.plane).collect();
        ids.sort_unstable();
        ids.dedup();
        // Ids are in order of falling area, so the first few are the large surfaces.
        ids.truncate(16);
        let mut best: Option<(i64, u32)> = None;
        for &id in &ids {
            let plane = &self.set.planes.planes()[id as usize];
            let (mut n_front, mut n_back, mut n_cut) = (0i64, 0i64, 0i64);
            for f in fragments {
                if f.plane == id {
                    continue;
                }
                let (mut front, mut back) = (false, false);
                for &p in f.points(self.set) {
                    let d = plane.signed_distance(p);
                    front |= d > self.tolerance.plane;
                    back |= d < -self.tolerance.plane;
                }
                n_cut += i64::from(front && back);
                n_front += i64::from(front);
                n_back += i64::from(back);
            }
            let score = 4 * n_cut + (n_front - n_back).abs();
            if best.is_none_or(|b| (score, id) < b) {
                best = Some((score, id));
            }
        }
        best.map_or(0, |b| b.1)
    }
}

/// Keeps the largest fragments of a knot; see [`MAX_BSP_FRAGMENTS`].
fn bounded(mut fragments: Vec<Fragment>) -> Vec<Fragment> {
    if fragments.len() > MAX_BSP_FRAGMENTS {
        // Surfaces are numbered by falling area.
        fragments.sort_by_key(|f| f.surface);
        fragments.truncate(MAX_BSP_FRAGMENTS);
    }
    fragments
}
