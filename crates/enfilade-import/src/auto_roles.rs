//! Roles of objects that nothing is said about, by size and by what they hide.
//!
//! Only small objects that one can see around, and large ones that one sees through, become detail.
//! The judge errs to *structural*: a chair taken for a wall costs a portal or two, a piece of a wall
//! taken for a chair opens a room. So whatever stands between two things stays: the piece of a wall
//! between floor and ceiling, the lintel between two jambs, the tile between its neighbors.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, Bvh, DVec3, Triangle, triangle_area_normal};
use std::collections::HashMap;
use std::ops::Range;

/// The reason of objects that no rule fitted.
pub(crate) const DEFAULT: &str = "default";

/// Longest edge of what may stand in a room: a bed or a sofa, not a door. [Units: wu]
const SMALL: f64 = 2.0;
/// The same as a share of the scene's diagonal: chairs are not large in their room.
const SMALL_SHARE: f64 = 0.25;
/// A plate is thinner than this share of its middle edge.
const PLATE: f64 = 0.2;
/// What is nearer than this touches. [Units: wu]
const NEAR: f64 = 0.05;
/// How far into the object that is looked for, as kits let their pieces overlap. [Units: wu]
const INTO: f64 = 0.02;
/// Cells along each edge of a side; one in four of them touched, and the side is.
const CELLS: usize = 3;
const TOUCHED: usize = CELLS * CELLS / 4;
/// A side that others touch must go on beyond the object in so many of four directions, as the floor
/// around a chair does. The next brick of a wall ends where this one does.
const GOES_ON: usize = 3;
/// Where it is looked for beyond the object. [Units: wu]
const BEYOND: [f64; 2] = [0.03, 0.12];
/// Rails and grilles fill less than this share of their box. Piers beside a wide opening may, too,
/// and so the following limits.
const SPARSE: f64 = 0.15;
/// Rails and grilles are no thicker than this. [Units: wu]
const FLAT: f64 = 0.3;
/// Each connected part of a rail is a bar, and no wider than this. [Units: wu]
const BAR: f64 = 0.12;
/// Where more than this share of the surface that nothing is said about would be detail, the scene is
/// built of small pieces and nothing in it is furniture.
const MOST: f64 = 0.3;
/// So many small objects are no furniture, either; and looking at each takes time.
const MOST_OBJECTS: usize = 50_000;

/// What is known of one structural object.
struct Shape {
    object: usize,
    /// Its own, in the list of all.
    triangles: Range<usize>,
    bounds: Aabb,
    /// Surface, one side. [Units: wu²]
    area: f64,
    /// Surface as seen along each axis, front and back counted. [Units: wu²]
    shadow: DVec3,
    /// Nothing is said about it.
    is_open: bool,
}

/// Gives objects that nothing is said about a role by size and occlusion, with the reason.
///
/// Leaves scenes of fewer than three structural objects as they are: there is nothing to compare
/// with. O(t log t) for t structural triangles, and O(log t) a small object.
pub(crate) fn judge(scene: &mut Scene) {
    let n_open = scene.objects.iter().filter(|o| is_open(o)).count();
    let n_structural = scene
        .objects
        .iter()
        .filter(|o| o.role == Role::Structural)
        .count();
    if n_open == 0 || n_structural < 3 {
        return;
    }
    let (shapes, triangles, owners) = shapes_of(scene);
    let bounds = shapes.iter().fold(Aabb::EMPTY, |b, s| b.union(s.bounds));
    let small = SMALL.min(SMALL_SHARE * bounds.size().length());
    let n_small = shapes
        .iter()
        .filter(|s| s.is_open && s.bounds.size().max_element() <= small)
        .count();
    let bvh = if n_small > 0 && n_small <= MOST_OBJECTS {
        Some(Bvh::build(&triangles))
    } else {
        None
    };
    let mut found: Vec<(usize, String)> = Vec::new();
    let (mut open_area, mut detail_area) = (0.0, 0.0);
    for shape in shapes.iter().filter(|s| s.is_open) {
        open_area += shape.area;
        let size = shape.bounds.size();
        let reason = if size.max_element() <= small {
            bvh.as_ref().and_then(|bvh| {
                let touches = |b: &Aabb| {
                    let mut is_touched = false;
                    bvh.for_each_in_box(b, |t| {
                        is_touched |= owners[t as usize] != shape.object as u32;
                    });
                    is_touched
                };
                seen_around(&shape.bounds, &touches)
            })
        } else {
            let is_rail = size.min_element() <= FLAT
                && fill(shape) < SPARSE
                && parts(&triangles[shape.triangles.clone()]).iter().all(|b| {
                    let mut edges = b.size().to_array();
                    edges.sort_by(f64::total_cmp);
                    edges[1] <= BAR
                });
            is_rail.then(|| {
                let percent = fill(shape) * 100.0;
                format!("hides little: bars that fill {percent:.0} % of their box")
            })
        };
        if let Some(reason) = reason {
            detail_area += shape.area;
            found.push((shape.object, reason));
        }
    }
    let share = detail_area / open_area.max(f64::MIN_POSITIVE);
    let structural_area: f64 = shapes.iter().map(|s| s.area).sum();
    if detail_area > MOST * structural_area || found.len() == n_structural {
        for (object, _) in found {
            scene.objects[object].reason = format!(
                "default: {:.0} % of the scene is such small pieces, so they are what it is built of",
                share * 100.0
            );
        }
        return;
    }
    for (object, reason) in found {
        let object = &mut scene.objects[object];
        object.role = Role::Detail;
        object.reason = reason;
    }
}

fn is_open(object: &enfilade_geom::scene::Object) -> bool {
    object.role == Role::Structural && object.reason == DEFAULT
}

/// Each structural object's shape; all their triangles, and the object of each.
fn shapes_of(scene: &Scene) -> (Vec<Shape>, Vec<Triangle>, Vec<u32>) {
    let mut shapes: Vec<Shape> = Vec::new();
    let mut triangles = Vec::new();
    let mut owners = Vec::new();
    for source in scene.triangle_sources(Role::Structural) {
        let t = scene.world_triangle(source);
        if shapes
            .last()
            .is_none_or(|s| s.object != source.object as usize)
        {
            shapes.push(Shape {
                object: source.object as usize,
                triangles: triangles.len()..triangles.len(),
                bounds: Aabb::EMPTY,
                area: 0.0,
                shadow: DVec3::ZERO,
                is_open: is_open(&scene.objects[source.object as usize]),
            });
        }
        let normal = 0.5 * triangle_area_normal(&t);
        if let Some(shape) = shapes.last_mut() {
            shape.triangles.end += 1;
            shape.bounds = shape.bounds.union(Aabb::of_points(&t));
            shape.area += normal.length();
            shape.shadow += normal.abs();
        }
        triangles.push(t);
        owners.push(source.object);
    }
    (shapes, triangles, owners)
}

/// The largest surface that a shape shows along an axis, as a share of its box's largest side. Both
/// sides of a closed shape count, as half each.
fn fill(shape: &Shape) -> f64 {
    let size = shape.bounds.size();
    let sides = DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
    0.5 * shape.shadow.max_element() / sides.max_element().max(f64::MIN_POSITIVE)
}

/// Boxes of the connected parts: triangles that share a corner hang together.
fn parts(triangles: &[Triangle]) -> Vec<Aabb> {
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    let mut first_at: HashMap<[u64; 3], usize> = HashMap::new();
    let mut parent: Vec<usize> = (0..triangles.len()).collect();
    for (i, t) in triangles.iter().enumerate() {
        for p in t {
            // + 0.0 makes one zero of two.
            let key = (*p + 0.0).to_array().map(f64::to_bits);
            let other = *first_at.entry(key).or_insert(i);
            let (a, b) = (root(&mut parent, i), root(&mut parent, other));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut boxes = vec![Aabb::EMPTY; triangles.len()];
    for (i, t) in triangles.iter().enumerate() {
        let r = root(&mut parent, i);
        boxes[r] = boxes[r].union(Aabb::of_points(t));
    }
    boxes.retain(|b| !b.is_empty());
    boxes
}

/// Why one sees around a small object, if one does: it stands, hangs or leans, and stands between
/// nothing.
fn seen_around(bounds: &Aabb, touches: &dyn Fn(&Aabb) -> bool) -> Option<String> {
    const SIDES: [[&str; 2]; 3] = [
        ["a side", "a side"],
        ["its bottom", "its top"],
        ["a side", "a side"],
    ];
    let size = bounds.size();
    let mut sorted = size.to_array();
    sorted.sort_by(f64::total_cmp);
    let is_plate = sorted[0] < PLATE * sorted[1];
    let mut touched = Vec::new();
    for axis in 0..3 {
        let sides = [false, true].map(|high| is_side_touched(bounds, axis, high, touches));
        // Between two things; or the rim of a plate, which goes on in what it touches.
        let is_rim = is_plate && size[axis] > sorted[0];
        if sides == [true, true] || is_rim && sides != [false, false] {
            return None;
        }
        for side in (0..2).filter(|&side| sides[side]) {
            if n_goes_on(bounds, axis, side == 1, touches) < GOES_ON {
                return None;
            }
            touched.push(SIDES[axis][side]);
        }
    }
    let at = if touched.is_empty() {
        "nothing".to_owned()
    } else {
        format!("{} only", touched.join(" and "))
    };
    Some(format!(
        "small, hides little: {:.1} x {:.1} x {:.1} m, touches {at}",
        size.x, size.y, size.z
    ))
}

/// Whether others touch a side of the box. Its margin is not looked at: the floor below touches that
/// of every other side.
fn is_side_touched(
    bounds: &Aabb,
    axis: usize,
    high: bool,
    touches: &dyn Fn(&Aabb) -> bool,
) -> bool {
    /// Rounding to `f32` moves what was flush. [Units: wu]
    const FLUSH: f64 = 1e-4;
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let size = bounds.size();
    let mut n = 0;
    for cell in 0..CELLS * CELLS {
        let mut b = *bounds;
        for (k, at) in [(u, cell % CELLS), (v, cell / CELLS)] {
            let step = 0.8 * size[k] / CELLS as f64;
            b.min[k] = bounds.min[k] + 0.1 * size[k] + step * at as f64 - FLUSH;
            b.max[k] = b.min[k] + step + 2.0 * FLUSH;
        }
        (b.min[axis], b.max[axis]) = skin(bounds, axis, high);
        n += usize::from(touches(&b));
    }
    n >= TOUCHED.max(1)
}

/// Where contact is looked for at a side, across it.
fn skin(bounds: &Aabb, axis: usize, high: bool) -> (f64, f64) {
    let into = INTO.min(0.25 * bounds.size()[axis]);
    if high {
        (bounds.max[axis] - into, bounds.max[axis] + NEAR)
    } else {
        (bounds.min[axis] - NEAR, bounds.min[axis] + into)
    }
}

/// In how many of four directions what touches a side goes on beyond it.
fn n_goes_on(bounds: &Aabb, axis: usize, high: bool, touches: &dyn Fn(&Aabb) -> bool) -> usize {
    let mut n = 0;
    for k in [(axis + 1) % 3, (axis + 2) % 3] {
        let other = 3 - axis - k;
        for is_up in [false, true] {
            let mut b = *bounds;
            let margin = 0.1 * bounds.size()[other];
            b.min[other] += margin;
            b.max[other] -= margin;
            (b.min[axis], b.max[axis]) = skin(bounds, axis, high);
            (b.min[k], b.max[k]) = if is_up {
                (bounds.max[k] + BEYOND[0], bounds.max[k] + BEYOND[1])
            } else {
                (bounds.min[k] - BEYOND[1], bounds.min[k] - BEYOND[0])
            };
            n += usize::from(touches(&b));
        }
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::DMat4;
    use enfilade_geom::scene::{Mesh, Object, Primitive};

    #[derive(Default)]
    struct Build(Scene);

    impl Build {
        fn block(&mut self, name: &str, min: [f64; 3], max: [f64; 3]) -> &mut Self {
            self.blocks(name, &[(min, max)])
        }

        /// Boxes as one object that nothing is said about.
        fn blocks(&mut self, name: &str, boxes: &[([f64; 3], [f64; 3])]) -> &mut Self {
            let mut p = Primitive::default();
            for (min, max) in boxes {
                let first = p.positions.len() as u32;
                for i in 0..8 {
                    let c = |k: usize| if i >> k & 1 == 1 { max[k] } else { min[k] } as f32;
                    p.positions.push([c(0), c(1), c(2)]);
                }
                for f in [
                    [0, 2, 3, 1],
                    [4, 5, 7, 6],
                    [0, 1, 5, 4],
                    [2, 6, 7, 3],
                    [0, 4, 6, 2],
                    [1, 3, 7, 5],
                ] {
                    let quad = [f[0], f[1], f[2], f[0], f[2], f[3]];
                    p.indices.extend(quad.map(|i: u32| first + i));
                }
            }
            self.0.objects.push(Object {
                name: name.into(),
                mesh: self.0.meshes.len() as u32,
                transform: DMat4::IDENTITY,
                role: Role::Structural,
                reason: DEFAULT.into(),
            });
            self.0.meshes.push(Mesh {
                name: String::new(),
                primitives: vec![p],
            });
            self
        }

        /// A room of 5 x 4 x 2.6 m, its east wall with a doorway made of three pieces.
        fn room() -> Self {
            let mut b = Self::default();
            b.block("floor", [0.0, -0.2, 0.0], [5.0, 0.0, 4.0])
                .block("ceiling", [0.0, 2.6, 0.0], [5.0, 2.8, 4.0])
                .block("west", [-0.2, 0.0, 0.0], [0.0, 2.6, 4.0])
                .block("north", [0.0, 0.0, -0.2], [5.0, 2.6, 0.0])
                .block("south", [0.0, 0.0, 4.0], [5.0, 2.6, 4.2])
                .block("east, short", [5.0, 0.0, 0.0], [5.2, 2.6, 0.6])
                .block("east, long", [5.0, 0.0, 1.5], [5.2, 2.6, 4.0])
                .block("lintel", [5.0, 2.1, 0.6], [5.2, 2.6, 1.5])
                .block("threshold", [5.0, -0.2, 0.6], [5.2, 0.0, 1.5])
                .block("post", [2.0, 0.0, 2.0], [2.15, 2.6, 2.15]);
            b
        }

        fn details(mut self) -> Vec<String> {
            judge(&mut self.0);
            let is_detail = |o: &&Object| o.role == Role::Detail;
            self.0
                .objects
                .iter()
                .filter(is_detail)
                .map(|o| o.name.clone())
                .collect()
        }
    }

    #[test]
    fn what_a_room_is_built_of_stays() {
        assert_eq!(Build::room().details(), [""; 0]);
    }

    #[test]
    fn what_stands_in_a_room_is_detail() {
        let mut b = Build::room();
        b.blocks(
            "chair",
            &[
                ([3.0, 0.4, 3.0], [3.4, 0.45, 3.4]),
                ([3.0, 0.0, 3.0], [3.05, 0.4, 3.05]),
                ([3.35, 0.0, 3.35], [3.4, 0.4, 3.4]),
                ([3.0, 0.45, 3.0], [3.05, 0.9, 3.4]),
            ],
        )
        .block("lamp", [1.0, 2.3, 1.0], [1.3, 2.6, 1.3])
        .block("picture", [0.0, 1.2, 1.0], [0.03, 1.8, 1.8])
        .block("rug", [0.8, 0.0, 2.2], [1.6, 0.01, 3.2])
        .block("ball", [4.0, 1.0, 1.0], [4.2, 1.2, 1.2])
        // To the ceiling, between floor and ceiling: it may be a pier.
        .block("wardrobe", [3.0, 0.0, 0.0], [4.2, 2.6, 0.6]);
        assert_eq!(b.details(), ["chair", "lamp", "picture", "rug", "ball"]);
    }

    #[test]
    fn the_reason_is_told() {
        let mut b = Build::room();
        b.block("stool", [3.0, 0.0, 3.0], [3.4, 0.5, 3.4]);
        judge(&mut b.0);
        let stool = b.0.objects.last().unwrap();
        assert_eq!(
            stool.reason,
            "small, hides little: 0.4 x 0.5 x 0.4 m, touches its bottom only"
        );
    }

    #[test]
    fn a_railing_hides_little_and_a_wall_with_windows_does_not() {
        let mut b = Build::room();
        let bars: Vec<_> = (0..16)
            .map(|i| 0.3 * f64::from(i))
            .map(|x| ([x, 0.0, 8.0], [x + 0.012, 1.0, 8.012]))
            .collect();
        b.blocks("railing", &bars).blocks(
            "facade",
            &[
                ([0.0, 0.0, 9.0], [8.0, 0.4, 9.2]),
                ([0.0, 2.4, 9.0], [8.0, 2.6, 9.2]),
                ([0.0, 0.4, 9.0], [0.2, 2.4, 9.2]),
                ([7.8, 0.4, 9.0], [8.0, 2.4, 9.2]),
            ],
        );
        assert_eq!(b.details(), ["railing"]);
    }

    #[test]
    fn walls_and_floors_of_small_tiles_stay() {
        let mut b = Build::default();
        for i in 0..6 {
            for k in 0..6 {
                let (x, z) = (f64::from(i), f64::from(k));
                b.block("tile", [x, -0.1, z], [x + 1.0, 0.0, z + 1.0]);
                b.block("roof", [x, 2.0, z], [x + 1.0, 2.1, z + 1.0]);
            }
            for y in [0.0, 1.0] {
                let x = f64::from(i);
                b.block("brick", [x, y, -0.2], [x + 1.0, y + 1.0, 0.0]);
            }
        }
        assert_eq!(b.details(), [""; 0]);
    }

    #[test]
    fn a_heap_of_loose_blocks_is_no_furniture() {
        let mut b = Build::default();
        for i in 0..5 {
            let x = 2.0 * f64::from(i);
            b.block("block", [x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
        }
        judge(&mut b.0);
        assert!(b.0.objects.iter().all(|o| o.role == Role::Structural));
        assert!(b.0.objects[0].reason.contains("what it is built of"));
    }

    #[test]
    fn what_somebody_said_is_kept() {
        let mut b = Build::room();
        b.block("stool", [3.0, 0.0, 3.0], [3.4, 0.5, 3.4]);
        b.0.objects.last_mut().unwrap().reason = "name: 'wall'".into();
        assert_eq!(b.details(), [""; 0]);
    }
}
