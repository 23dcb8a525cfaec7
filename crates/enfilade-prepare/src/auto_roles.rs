//! Roles of objects that no name or rule decides, from the openings they fill and how little they hide.
//!
//! Door leaves and panes are found first (`fillers`), then small objects with free space around them, large
//! objects one sees through, and other furniture (`furniture`); only these become detail. The test errs to
//! *structural*: a chair taken for a wall costs a portal or two, a piece of a wall taken for a chair opens a
//! room. So everything that stands between two things stays: the piece of a wall between floor and ceiling, the
//! lintel between two jambs, the tile between its neighbors.

use enfilade_geom::scene::{Role, Scene, TriangleSource};
use enfilade_geom::{Aabb, Bvh, DVec3, Triangle, is_flight, shells, triangle_area_normal};
use fillers::Surroundings;
use std::borrow::Cow;
use std::ops::Range;
use units::{Unit, key};

mod fillers;
mod furniture;
mod merged;
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

/// Measures of one structural object, or of a part of a merged one.
struct Shape {
    object: usize,
    /// Part of a merged object.
    is_part: bool,
    /// Its triangles in the list of all.
    triangles: Vec<Range<usize>>,
    bounds: Aabb,
    /// Area of its surface, one side. [Units: wu²]
    area: f64,
    /// Area projected along each axis, front and back counted. [Units: wu²]
    shadow: DVec3,
    /// No rule decides its role.
    is_open: bool,
    /// … or its name is that of a wall and of a door: it may fill an opening.
    may_fill: bool,
}

impl Shape {
    /// Returns its triangles.
    fn of<'t>(&self, all: &'t [Triangle]) -> Cow<'t, [Triangle]> {
        if let [range] = &*self.triangles {
            return Cow::Borrowed(&all[range.clone()]);
        }
        let own = self.triangles.iter().cloned();
        Cow::Owned(own.flat_map(|range| all[range].iter().copied()).collect())
    }

    /// Takes in another part of the same merged object.
    fn take(&mut self, other: Self) {
        self.triangles.extend(other.triangles);
        self.bounds = self.bounds.union(other.bounds);
        self.area += other.area;
        self.shadow += other.shadow;
    }
}

/// Shapes that are detail, each with the reason.
type Decided = Vec<(Shape, String)>;

/// The structure of a scene.
struct Structure {
    shapes: Vec<Shape>,
    triangles: Vec<Triangle>,
    /// The origin of each triangle.
    sources: Vec<TriangleSource>,
}

/// Decides by size and occlusion the role of objects that no rule decides, and records the reason. Parts of merged objects
/// become objects.
///
/// Leaves scenes of fewer than three structural things unchanged: there is nothing to compare with. O(t log t)
/// for t structural triangles, and O(log t) per small object.
pub fn decide(scene: &mut Scene) {
    merged::forget_misleading_names(scene);
    let Structure {
        shapes,
        triangles,
        sources,
    } = structure_of(scene);
    let shapes = merged::join_bars(shapes);
    let n_open = shapes.iter().filter(|s| s.may_fill).count();
    let n_structural = shapes.len();
    if n_open == 0 || n_structural < 3 {
        return;
    }
    let bvh = if n_open <= MOST_OBJECTS {
        Some(Bvh::build(&triangles))
    } else {
        None
    };
    let mut reasons: Vec<Option<String>> = vec![None; n_structural];
    if let Some(bvh) = &bvh {
        reasons = filler_reasons(&shapes, &triangles, bvh);
    }
    let (mut found, mut left) = (Vec::new(), Vec::new());
    for (shape, reason) in shapes.into_iter().zip(reasons) {
        match reason {
            Some(reason) => found.push((shape, reason)),
            None => left.push(shape),
        }
    }
    let left = merged::join_small(left);
    match furniture_of(left, &triangles, bvh.as_ref(), n_structural) {
        Ok(more) => found.extend(more),
        Err(kept) => {
            for (shape, reason) in kept.iter().filter(|(shape, _)| !shape.is_part) {
                scene.objects[shape.object].reason =
                    format!("default: {reason}, but so is too much of the scene");
            }
        }
    }
    found.sort_by_key(|(shape, _)| shape.object);
    for own in found.chunk_by(|a, b| a.0.object == b.0.object) {
        let (shape, reason) = &own[0];
        if shape.is_part {
            merged::split(scene, shape.object, own, &sources);
        } else {
            let object = &mut scene.objects[shape.object];
            object.role = Role::Detail;
            object.reason.clone_from(reason);
        }
    }
}

/// Returns the shapes that are furniture, each with the reason; or as an error those that would be, if they are too much of
/// the scene.
fn furniture_of(
    shapes: Vec<Shape>,
    triangles: &[Triangle],
    bvh: Option<&Bvh>,
    n_structural: usize,
) -> Result<Decided, Decided> {
    let bounds = shapes.iter().fold(Aabb::EMPTY, |b, s| b.union(s.bounds));
    let mut owners = vec![FILLER; triangles.len()];
    for (i, shape) in (0..).zip(&shapes) {
        for range in &shape.triangles {
            owners[range.clone()].fill(i);
        }
    }
    let mut rules = ShapeRules {
        triangles,
        owners: &owners,
        bvh,
        diagonal: bounds.size().length(),
        is_gone: vec![false; shapes.len()],
    };
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut detail_area = 0.0;
    // Objects on or below furniture become free once it is gone.
    for _ in 0..ROUNDS {
        let before = found.len();
        for (i, shape) in shapes.iter().enumerate() {
            if !shape.is_open || rules.is_gone[i] {
                continue;
            }
            if let Some(reason) = rules.reason(i, shape) {
                // The leaves of a plant have more area than they hide.
                detail_area += shape.area.min(shape.bounds.surface_area());
                found.push((i, reason));
            }
        }
        for (i, _) in &found[before..] {
            rules.is_gone[*i] = true;
        }
        if found.len() == before {
            break;
        }
    }
    let structural_area: f64 = shapes.iter().map(|s| s.area).sum();
    let is_too_much = detail_area > MOST * structural_area || found.len() == n_structural;
    let mut shapes: Vec<Option<Shape>> = shapes.into_iter().map(Some).collect();
    let found = found.into_iter();
    let found = found.filter_map(|(i, reason)| Some((shapes[i].take()?, reason)));
    let found = found.collect();
    if is_too_much { Err(found) } else { Ok(found) }
}

/// Owner of triangles of fillers.
const FILLER: u32 = u32::MAX;

/// Tests of each object that is not a filler.
struct ShapeRules<'a> {
    triangles: &'a [Triangle],
    /// The shape of each triangle.
    owners: &'a [u32],
    bvh: Option<&'a Bvh>,
    /// Diagonal of the structure's box. [Units: wu]
    diagonal: f64,
    /// Shapes known to be furniture.
    is_gone: Vec<bool>,
}

impl ShapeRules<'_> {
    /// Returns the reason why a shape is detail; `None` if it is structural.
    fn reason(&self, index: usize, shape: &Shape) -> Option<String> {
        let own = &*shape.of(self.triangles);
        let size = shape.bounds.size();
        let reach = SMALL_SHARE * self.diagonal;
        if size.max_element() > SMALL.min(reach) && is_rail(shape, own) {
            let percent = fill(shape) * 100.0;
            return Some(format!(
                "hides little: bars that fill {percent:.0} % of their box"
            ));
        }
        let bvh = self.bvh?;
        let is_own = |t: u32| self.owners[t as usize] == index as u32;
        let touches = |b: &Aabb| bvh.any_in_box(b, |t| !is_own(t));
        let mut reason = None;
        if size.max_element() <= SMALL.min(reach) {
            reason = seen_around(&shape.bounds, &touches);
        }
        if reason.is_none() && size.y <= SMALL {
            let meets = |a, b| bvh.any_hit(a, b, |t| is_own(t) || self.is_gone(t));
            let upright = units::upright(index as u32, own);
            reason = furniture::reason(&upright, &shape.bounds, self.diagonal, &meets, &touches);
        }
        // The rim comes last, as it costs most.
        reason.filter(|_| !is_flight(own) && !goes_on_at_its_rim(own, &shape.bounds, &touches))
    }
}

impl ShapeRules<'_> {
    /// Returns `true` for triangles of fillers and furniture.
    fn is_gone(&self, triangle: u32) -> bool {
        let owner = self.owners[triangle as usize];
        owner == FILLER || self.is_gone[owner as usize]
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

/// Returns for each shape the reason why it fills an opening, or belongs to one that does.
fn filler_reasons(shapes: &[Shape], triangles: &[Triangle], bvh: &Bvh) -> Vec<Option<String>> {
    let units: Vec<Unit> = (0..)
        .zip(shapes)
        .flat_map(|(i, s)| {
            let own = s.of(triangles);
            if s.is_part {
                let all = s.triangles.iter().cloned().flatten();
                let triangles = all.map(|t| t as u32).collect();
                vec![Unit {
                    triangles,
                    ..units::whole(i, &own)
                }]
            } else {
                units::units_of(i, s.triangles[0].start as u32, &own)
            }
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
    let may_fill = |unit: &Unit| shapes[unit.object as usize].may_fill;
    let found = fillers::fillers(&units, &may_fill, &around);
    let mut reasons = vec![None; units.len()];
    for (unit, reason) in found {
        reasons[unit as usize] = Some(reason);
    }
    let mut of_shapes = vec![None; shapes.len()];
    // A shape has one role, so each of its units must fill an opening or belong to one that does.
    let of_shape = |a: &(&Unit, _), b: &(&Unit, _)| a.0.object == b.0.object;
    let all: Vec<(&Unit, Option<String>)> = units.iter().zip(reasons).collect();
    for own in all.chunk_by(of_shape) {
        let mut filling = own.iter().filter(|u| u.1.is_some());
        let belongs = |unit: &Unit| filling.clone().any(|(filler, _)| filler.has_beside(unit));
        if own.iter().all(|u| u.1.is_some() || belongs(u.0))
            && let Some((unit, reason)) = filling.next()
        {
            of_shapes[unit.object as usize].clone_from(reason);
        }
    }
    // Handles and panes of merged objects are units of their own.
    let filling: Vec<&(&Unit, Option<String>)> = all.iter().filter(|u| u.1.is_some()).collect();
    for (unit, reason) in &all {
        let shape = &shapes[unit.object as usize];
        if shape.is_part
            && shape.is_open
            && reason.is_none()
            && filling.iter().any(|(filler, _)| filler.has_before(unit))
        {
            of_shapes[unit.object as usize] =
                Some("lies in an opening, before a filler".to_owned());
        }
    }
    of_shapes
}

/// Returns `true` if an object's or a class's name led to this reason.
fn is_by_name(reason: &str) -> bool {
    reason.starts_with("name: ") || reason.starts_with("IFC class ")
}

fn is_open(object: &enfilade_geom::scene::Object) -> bool {
    object.role == Role::Structural && object.reason == DEFAULT
}

/// Returns `true` if an object's name is that of structure and of what fills an opening, the latter last: its filling is known.
fn may_fill(object: &enfilade_geom::scene::Object) -> bool {
    object.role == Role::Structural && is_by_name(&object.reason) && object.filling.is_some()
}

/// Returns the shapes of structural objects, and of the parts of merged ones.
fn structure_of(scene: &Scene) -> Structure {
    let mut all = Structure {
        shapes: Vec::new(),
        triangles: Vec::new(),
        sources: Vec::new(),
    };
    let sources: Vec<TriangleSource> = scene.triangle_sources(Role::Structural).collect();
    for own in sources.chunk_by(|a, b| a.object == b.object) {
        let object = own[0].object as usize;
        let triangles: Vec<Triangle> = own.iter().map(|&s| scene.world_triangle(s)).collect();
        let (shell_of, n) = if merged::may_be_merged(&scene.objects[object], &triangles) {
            shells(&triangles)
        } else {
            (Vec::new(), 1)
        };
        let is_part = n > 1 && n + all.shapes.len() <= MOST_OBJECTS;
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        if is_part {
            order.sort_by_key(|&t| (shell_of[t], t));
        }
        let is_open = is_part || is_open(&scene.objects[object]);
        for part in order.chunk_by(|&a, &b| !is_part || shell_of[a] == shell_of[b]) {
            let first = all.triangles.len();
            all.triangles.extend(part.iter().map(|&t| triangles[t]));
            all.sources.extend(part.iter().map(|&t| own[t]));
            let range = first..all.triangles.len();
            let area_normal = |t: &Triangle| 0.5 * triangle_area_normal(t);
            let normals = all.triangles[range.clone()].iter().map(area_normal);
            all.shapes.push(Shape {
                object,
                is_part,
                bounds: Aabb::of_points(all.triangles[range.clone()].as_flattened()),
                area: normals.clone().map(DVec3::length).sum(),
                shadow: normals.map(DVec3::abs).sum(),
                triangles: vec![range],
                is_open,
                may_fill: is_open || may_fill(&scene.objects[object]),
            });
        }
    }
    all
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
mod merged_tests;
#[cfg(test)]
mod tests;
