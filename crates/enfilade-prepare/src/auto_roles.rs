//! Roles of objects that no name or rule decides, from the openings they fill and how little they hide.
//!
//! Door leaves and panes are found first (`fillers`), then small objects with free space around them, large
//! objects one sees through, and other furniture (`furniture`); only these become detail. The test errs to
//! *structural*: a chair taken for a wall costs a portal or two, a piece of a wall taken for a chair opens a
//! room. So everything that stands between two things stays: the piece of a wall between floor and ceiling, the
//! lintel between two jambs, the tile between its neighbors.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Aabb, Bvh, DVec3, Triangle, triangle_area_normal};
use fillers::Surroundings;
use std::ops::Range;
use units::{Unit, key};

mod fillers;
mod furniture;
mod units;

/// Reason of objects that match no rule.
pub(crate) const DEFAULT: &str = "default";

/// Longest edge of an object that may stand in a room: a bed or a sofa, not a door. [Units: wu]
const SMALL: f64 = 2.0;
/// The same as a share of the scene's diagonal: chairs are not large in their room.
const SMALL_SHARE: f64 = 0.25;
/// A plate is thinner than this share of its middle edge.
const PLATE: f64 = 0.2;
/// Objects nearer than this touch. [Units: wu]
const NEAR: f64 = 0.05;
/// Depth below the surface from which contact is searched, as kits let their pieces overlap. [Units: wu]
const INTO: f64 = 0.02;
/// Cells along each edge of a side. A side is touched if a quarter of its cells are.
const CELLS: usize = 3;
const TOUCHED: usize = CELLS * CELLS / 4;
/// The surface that touches a side must continue beyond the object in this many of four directions, as the
/// floor around a chair does. The next brick of a wall ends where this one does.
const GOES_ON: usize = 3;
/// Distances beyond the object at which it must continue. [Units: wu]
const BEYOND: [f64; 2] = [0.03, 0.12];
/// Rails and grilles fill less than this share of their box. Piers beside a wide opening may, too; hence the
/// next two limits.
const SPARSE: f64 = 0.15;
/// Largest thickness of rails and grilles. [Units: wu]
const FLAT: f64 = 0.3;
/// Largest width of a bar. Each connected part of a rail is a bar. [Units: wu]
const BAR: f64 = 0.12;
/// A surface whose open rim lies on others is a piece of a shell, such as the reveal of a doorway that was
/// split from its wall. A rim shorter than this, in edges of its box, may be the open ends of a chair's legs.
const RIM_SHARE: f64 = 0.25;
/// Distance within which a rim lies on another surface. [Units: wu]
const ON: f64 = 1e-3;
/// If detail would exceed this share of the structural surface, the scene is built of small pieces and none of
/// them is furniture.
const MOST: f64 = 0.3;
/// More small objects than this are not furniture, either; and testing each takes time.
const MOST_OBJECTS: usize = 50_000;

/// Passes over the objects that are left: a stack of this many boxes is furniture.
const ROUNDS: usize = 4;

/// Measures of one structural object.
struct Shape {
    object: usize,
    /// Its triangles in the list of all.
    triangles: Range<usize>,
    bounds: Aabb,
    /// Area of its surface, one side. [Units: wu²]
    area: f64,
    /// Area projected along each axis, front and back counted. [Units: wu²]
    shadow: DVec3,
    /// No rule decides its role.
    is_open: bool,
}

/// Decides by size and occlusion the role of objects that no rule decides, and records the reason.
///
/// Leaves scenes of fewer than three structural objects unchanged: there is nothing to compare with. O(t log t)
/// for t structural triangles, and O(log t) per small object.
pub fn judge(scene: &mut Scene) {
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
    let bvh = if n_open <= MOST_OBJECTS {
        Some(Bvh::build(&triangles))
    } else {
        None
    };
    if let Some(bvh) = &bvh {
        judge_fillers(scene, &shapes, &triangles, bvh);
    }
    let is_gone: Vec<bool> = scene
        .objects
        .iter()
        .map(|o| o.role == Role::Detail)
        .collect();
    let shapes: Vec<Shape> = shapes.into_iter().filter(|s| !is_gone[s.object]).collect();
    let bounds = shapes.iter().fold(Aabb::EMPTY, |b, s| b.union(s.bounds));
    let mut judge = Judge {
        triangles: &triangles,
        owners: &owners,
        bvh: bvh.as_ref(),
        diagonal: bounds.size().length(),
        is_gone,
    };
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut detail_area = 0.0;
    // Objects on or below furniture become free once it is gone.
    for _ in 0..ROUNDS {
        let before = found.len();
        for shape in shapes
            .iter()
            .filter(|s| s.is_open && !judge.is_gone[s.object])
        {
            if let Some(reason) = judge.reason(shape) {
                // The leaves of a plant have more area than they hide.
                detail_area += shape.area.min(shape.bounds.surface_area());
                found.push((shape.object, reason));
            }
        }
        for (object, _) in &found[before..] {
            judge.is_gone[*object] = true;
        }
        if found.len() == before {
            break;
        }
    }
    let structural_area: f64 = shapes.iter().map(|s| s.area).sum();
    if detail_area > MOST * structural_area || found.len() == n_structural {
        for (object, reason) in found {
            scene.objects[object].reason =
                format!("default: {reason}, but so is too much of the scene");
        }
        return;
    }
    for (object, reason) in found {
        let object = &mut scene.objects[object];
        object.role = Role::Detail;
        object.reason = reason;
    }
}

/// Tests of each object that is not a filler.
struct Judge<'a> {
    triangles: &'a [Triangle],
    owners: &'a [u32],
    bvh: Option<&'a Bvh>,
    /// Diagonal of the structure's box. [Units: wu]
    diagonal: f64,
    /// Objects known to be detail.
    is_gone: Vec<bool>,
}

impl Judge<'_> {
    /// Returns the reason why an object is detail; `None` if it is structural.
    fn reason(&self, shape: &Shape) -> Option<String> {
        let own = &self.triangles[shape.triangles.clone()];
        let size = shape.bounds.size();
        let reach = SMALL_SHARE * self.diagonal;
        if size.max_element() > SMALL.min(reach) && is_rail(shape, own) {
            let percent = fill(shape) * 100.0;
            return Some(format!(
                "hides little: bars that fill {percent:.0} % of their box"
            ));
        }
        let bvh = self.bvh?;
        let is_own = |t: u32| self.owners[t as usize] == shape.object as u32;
        let touches = |b: &Aabb| {
            let mut is_touched = false;
            bvh.for_each_in_box(b, |t| is_touched |= !is_own(t));
            is_touched
        };
        let mut reason = None;
        if size.max_element() <= SMALL.min(reach) {
            reason = seen_around(&shape.bounds, &touches);
        }
        if reason.is_none() && size.y <= SMALL {
            let meets = |a, b| {
                bvh.any_hit(a, b, |t| {
                    is_own(t) || self.is_gone[self.owners[t as usize] as usize]
                })
            };
            let upright = units::upright(shape.object as u32, own);
            reason = furniture::reason(&upright, &shape.bounds, self.diagonal, &meets, &touches);
        }
        // The rim comes last, as it costs most.
        reason.filter(|_| !goes_on_at_its_rim(own, &shape.bounds, &touches))
    }
}

/// Returns `true` if an object is a row of bars, level, upright or inclined.
fn is_rail(shape: &Shape, own: &[Triangle]) -> bool {
    if shape.bounds.size().min_element() > FLAT || fill(shape) >= SPARSE {
        return false;
    }
    units::parts_of(own).iter().all(|part| {
        let mut edges = (part.half * 2.0).to_array();
        edges.sort_by(f64::total_cmp);
        edges[1] <= BAR
    })
}

/// Makes detail of objects whose units all fill openings.
fn judge_fillers(scene: &mut Scene, shapes: &[Shape], triangles: &[Triangle], bvh: &Bvh) {
    let units: Vec<Unit> = shapes
        .iter()
        .flat_map(|s| {
            let own = &triangles[s.triangles.clone()];
            units::units_of(s.object as u32, s.triangles.start as u32, own)
        })
        .collect();
    let mut unit_of = vec![0; triangles.len()];
    for (i, unit) in (0..).zip(&units) {
        for &t in &unit.triangles {
            unit_of[t as usize] = i;
        }
    }
    let around = Surroundings {
        bvh,
        triangles,
        unit_of: &unit_of,
    };
    let is_open = |unit: &Unit| is_open(&scene.objects[unit.object as usize]);
    let found = fillers::fillers(&units, &is_open, &around);
    // An object has one role, so each of its units must fill an opening or belong to one that does.
    let mut reasons = vec![None; units.len()];
    for (unit, reason) in found {
        reasons[unit as usize] = Some(reason);
    }
    let of_object = |a: &(&Unit, _), b: &(&Unit, _)| a.0.object == b.0.object;
    let all: Vec<(&Unit, Option<String>)> = units.iter().zip(reasons).collect();
    for own in all.chunk_by(of_object) {
        let mut filling = own.iter().filter(|u| u.1.is_some());
        let belongs = |unit: &Unit| filling.clone().any(|(filler, _)| filler.has_beside(unit));
        if own.iter().all(|u| u.1.is_some() || belongs(u.0))
            && let Some((unit, Some(reason))) = filling.next()
        {
            let object = &mut scene.objects[unit.object as usize];
            object.role = Role::Detail;
            object.reason.clone_from(reason);
        }
    }
}

fn is_open(object: &enfilade_geom::scene::Object) -> bool {
    object.role == Role::Structural && object.reason == DEFAULT
}

/// Returns the shape of each structural object, the triangles of all, and the object of each triangle.
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

/// Returns the largest projected area along an axis, as a share of the box's largest side. Both sides of a
/// closed shape count, each as half.
fn fill(shape: &Shape) -> f64 {
    let size = shape.bounds.size();
    let sides = DVec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
    0.5 * shape.shadow.max_element() / sides.max_element().max(f64::MIN_POSITIVE)
}

/// Returns `true` if other objects begin where the surface ends.
fn goes_on_at_its_rim(
    triangles: &[Triangle],
    bounds: &Aabb,
    touches: &dyn Fn(&Aabb) -> bool,
) -> bool {
    let mut edges: Vec<[[u64; 3]; 2]> = triangles
        .iter()
        .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
        .map(|e| {
            let mut key = e.map(key);
            key.sort_unstable();
            key
        })
        .collect();
    edges.sort_unstable();
    let on_others: f64 = edges
        .chunk_by(|a, b| a == b)
        .filter(|same| same.len() == 1)
        .map(|same| same[0].map(|p| DVec3::from_array(p.map(f64::from_bits))))
        .filter(|[a, b]| touches(&Aabb::of_points(&[(*a + *b) * 0.5]).expanded(ON)))
        .map(|[a, b]| a.distance(b))
        .sum();
    on_others > RIM_SHARE * 4.0 * bounds.size().element_sum()
}

/// Returns the reason why a small object has free space around it: it stands, hangs or leans, and not between
/// two things. `None` if it has not.
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
        // Touched on both sides, or at the rim of a plate, which continues in its neighbor.
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

/// Returns `true` if other objects touch a side of the box. Ignores the side's margin, which the floor below
/// touches on every other side.
fn is_side_touched(
    bounds: &Aabb,
    axis: usize,
    high: bool,
    touches: &dyn Fn(&Aabb) -> bool,
) -> bool {
    /// Rounding to `f32` moves flush surfaces by less. [Units: wu]
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

/// Returns the range across a side in which contact is searched.
fn skin(bounds: &Aabb, axis: usize, high: bool) -> (f64, f64) {
    let into = INTO.min(0.25 * bounds.size()[axis]);
    if high {
        (bounds.max[axis] - into, bounds.max[axis] + NEAR)
    } else {
        (bounds.min[axis] - NEAR, bounds.min[axis] + into)
    }
}

/// Returns the number of directions, of four, in which the surface that touches a side continues beyond it.
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
mod filler_tests;
#[cfg(test)]
mod furniture_tests;
#[cfg(test)]
mod tests;
