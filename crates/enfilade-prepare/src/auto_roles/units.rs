//! Objects divided into units, their separate things: all windows of a facade may be one mesh.

use std::collections::HashMap;

use enfilade_geom::filler::NARROWEST;
use enfilade_geom::{Aabb, DVec3, Rectangle, Sets, Triangle};

/// Parts nearer than this are one unit: a handle and its leaf, the triangles of a mesh without shared vertices.
/// [Units: wu]
const TOGETHER: f64 = 0.01;
/// An object of more parts is one unit: comparing parts takes quadratic time at worst.
const MOST_PARTS: usize = 2_000;
/// Reach of casings, sills and handles beyond their unit: across a thick wall, and along it by the width of a
/// board. [Units: wu]
const BESIDE: DVec3 = DVec3::new(0.6, 0.2, 0.2);

/// A thing in one piece, and its box along its own faces.
pub(super) struct Unit {
    pub(super) object: u32,
    /// Its triangles in the list of all.
    pub(super) triangles: Vec<u32>,
    pub(super) center: DVec3,
    /// Right-handed: across the unit where it is thinnest, level along it, and up along it.
    pub(super) axes: [DVec3; 3],
    /// Half the edges of its box along the axes. [Units: wu]
    pub(super) half: DVec3,
}

impl Unit {
    /// Returns `true` if it is too small for a door or a window.
    pub(super) fn is_small(&self) -> bool {
        2.0 * self.half.y.min(self.half.z) < NARROWEST
    }

    /// Returns `true` if the other is a casing, a sill or a handle of this one: before its face, in the same
    /// wall.
    pub(super) fn has_beside(&self, other: &Self) -> bool {
        self.has_within(other, BESIDE)
    }

    /// Returns `true` if the other is a handle, a bar or a pane in the same hole.
    pub(super) fn has_before(&self, other: &Self) -> bool {
        self.has_within(other, DVec3::new(BESIDE.x, TOGETHER, TOGETHER))
    }

    fn has_within(&self, other: &Self, beyond: DVec3) -> bool {
        let reach = self.half + beyond;
        (0..8).all(|corner| {
            let sign = |k: usize| if corner >> k & 1 == 1 { 1.0 } else { -1.0 };
            let p = (0..3).fold(other.center, |p, k| {
                p + other.axes[k] * (sign(k) * other.half[k])
            });
            (0..3).all(|k| (p - self.center).dot(self.axes[k]).abs() <= reach[k])
        })
    }
}

/// Returns the units of an object's triangles; `first` is the object's first triangle among all.
pub(super) fn units_of(object: u32, first: u32, triangles: &[Triangle]) -> Vec<Unit> {
    let (set_of, boxes) = parts(triangles);
    let mut sets = Sets::new(boxes.len());
    if boxes.len() > MOST_PARTS {
        (1..boxes.len() as u32).for_each(|i| {
            sets.join(0, i);
        });
    } else {
        join_near(&boxes, &mut sets);
    }
    let mut slot = vec![usize::MAX; boxes.len()];
    let mut members: Vec<Vec<u32>> = Vec::new();
    for (i, part) in (0..).zip(set_of) {
        let slot = &mut slot[sets.find(part) as usize];
        if *slot == usize::MAX {
            *slot = members.len();
            members.push(Vec::new());
        }
        members[*slot].push(i);
    }
    members
        .into_iter()
        .map(|own| {
            let all: Vec<Triangle> = own.iter().map(|&i| triangles[i as usize]).collect();
            Unit {
                triangles: own.iter().map(|i| first + i).collect(),
                ..whole(object, &all)
            }
        })
        .collect()
}

/// Returns the connected parts of an object, without their triangles.
pub(super) fn parts_of(triangles: &[Triangle]) -> Vec<Unit> {
    let (part_of, boxes) = parts(triangles);
    let mut members: Vec<Vec<Triangle>> = vec![Vec::new(); boxes.len()];
    for (t, part) in triangles.iter().zip(part_of) {
        members[part as usize].push(*t);
    }
    members.iter().map(|own| whole(0, own)).collect()
}

/// Returns an object as one unit, without its triangles.
pub(super) fn whole(object: u32, triangles: &[Triangle]) -> Unit {
    in_box(object, &Rectangle::of(triangles))
}

/// Returns an object as one unit with an upright box: the third axis is up.
pub(super) fn upright(object: u32, triangles: &[Triangle]) -> Unit {
    in_box(object, &Rectangle::upright(triangles))
}

fn in_box(object: u32, around: &Rectangle) -> Unit {
    let size = around.size();
    Unit {
        object,
        triangles: Vec::new(),
        center: around.center(),
        axes: [around.normal, around.across, around.up],
        half: 0.5 * DVec3::new(size.z, size.x, size.y),
    }
}

/// Joins boxes that nearly touch.
fn join_near(boxes: &[Aabb], sets: &mut Sets) {
    for_near(boxes, |a, b| {
        sets.join(a, b);
    });
}

/// Calls `on_pair` for boxes that nearly touch. Time: O(n log n + pairs that overlap along x).
pub(super) fn for_near(boxes: &[Aabb], mut on_pair: impl FnMut(u32, u32)) {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.sort_by(|&a, &b| boxes[a as usize].min.x.total_cmp(&boxes[b as usize].min.x));
    for (k, &a) in order.iter().enumerate() {
        let near = boxes[a as usize].expanded(TOGETHER);
        for &b in order[k + 1..]
            .iter()
            .take_while(|&&b| boxes[b as usize].min.x <= near.max.x)
        {
            if near.overlaps(&boxes[b as usize]) {
                on_pair(a, b);
            }
        }
    }
}

/// Returns the position of a vertex as a hash key.
pub(super) fn key(p: DVec3) -> [u64; 3] {
    // Turns -0 into 0.
    (p + 0.0).to_array().map(f64::to_bits)
}

/// Returns the connected part of each triangle, and the box of each part. Triangles that share a vertex are
/// connected.
fn parts(triangles: &[Triangle]) -> (Vec<u32>, Vec<Aabb>) {
    let mut first_at: HashMap<[u64; 3], u32> = HashMap::new();
    let mut sets = Sets::new(triangles.len());
    for (i, t) in (0..).zip(triangles) {
        for p in t {
            sets.join(i, *first_at.entry(key(*p)).or_insert(i));
        }
    }
    let mut part_of = vec![u32::MAX; triangles.len()];
    let mut boxes: Vec<Aabb> = Vec::new();
    let of_triangles = (0..)
        .zip(triangles)
        .map(|(i, t)| {
            let part = &mut part_of[sets.find(i) as usize];
            if *part == u32::MAX {
                *part = boxes.len() as u32;
                boxes.push(Aabb::EMPTY);
            }
            let own = &mut boxes[*part as usize];
            *own = own.union(Aabb::of_points(t));
            *part
        })
        .collect();
    (of_triangles, boxes)
}
