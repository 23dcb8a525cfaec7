//! Merged objects: one mesh of many things, as optimizers and formats without objects (STL, PLY) write them.
//!
//! The shells of such an object are decided one by one, as if each were an object. Those found to be detail become
//! objects of their own; the rest stays together.

use enfilade_geom::filler::LEAF;
use enfilade_geom::scene::{Mesh, Object, Primitive, Role, Scene, TriangleSource};
use enfilade_geom::{Aabb, Sets, Triangle};

use super::furniture::{BAR, LONG};
use super::units::for_near;
use super::{DEFAULT, SMALL, Shape, is_by_name, is_open};

/// An object of more triangles is one thing: telling the shells of a scan apart would take a gigabyte.
const MOST_TRIANGLES: usize = 2_000_000;

/// Returns `true` if an object may be several things: it is longer than any furniture, as large as a room in all directions,
/// and no user's rule says that all of it is structure. A name does not: merged meshes keep that of their first part.
pub(super) fn may_be_merged(object: &Object, triangles: &[Triangle]) -> bool {
    let bounds = Aabb::of_points(triangles.as_flattened());
    is_roomy(bounds)
        && bounds.size().max_element() > LONG
        && triangles.len() <= MOST_TRIANGLES
        && (is_open(object) || is_by_name(&object.reason))
}

/// Returns `true` for a box in which a room has space: no furniture is as large in all directions.
fn is_roomy(bounds: Aabb) -> bool {
    bounds.size().min_element() > SMALL
}

/// Forgets names by which all objects are detail, for those as large as a room: the first part of a merged one was a door,
/// and a room alone may be called `box`.
pub(super) fn forget_misleading_names(scene: &mut Scene) {
    if scene.objects.iter().any(|o| o.role == Role::Structural) {
        return;
    }
    for i in 0..scene.objects.len() {
        if is_by_name(&scene.objects[i].reason) && is_roomy(scene.object_aabb(i)) {
            let object = &mut scene.objects[i];
            object.role = Role::Structural;
            object.reason = DEFAULT.to_owned();
            object.filling = None;
        }
    }
}

/// Joins bars of merged objects with the bars and plates that they nearly touch: the frame of a window and its panes.
pub(super) fn join_bars(shapes: Vec<Shape>) -> Vec<Shape> {
    let edges = |s: &Shape| {
        let mut edges = s.bounds.size().to_array();
        edges.sort_by(f64::total_cmp);
        edges
    };
    let is_bar = |s: &Shape| edges(s)[1] < BAR;
    let is_plate = |s: &Shape| edges(s)[0] <= LEAF;
    join(shapes, &|s| is_bar(s) || is_plate(s), &|a, b| {
        is_bar(a) || is_bar(b)
    })
}

/// Joins what is left of merged objects into things, small shells that nearly touch: seat and legs of a chair.
pub(super) fn join_small(shapes: Vec<Shape>) -> Vec<Shape> {
    let is_small = |s: &Shape| s.bounds.size().max_element() <= SMALL;
    join(shapes, &is_small, &|_, _| true)
}

/// Joins parts of a merged object that nearly touch, out of those that may be joined, if a pair is one thing.
fn join(
    shapes: Vec<Shape>,
    may_be: &dyn Fn(&Shape) -> bool,
    is_one: &dyn Fn(&Shape, &Shape) -> bool,
) -> Vec<Shape> {
    let may_be = |s: &Shape| s.is_part && may_be(s);
    let (some, mut joined): (Vec<Shape>, Vec<Shape>) = shapes.into_iter().partition(may_be);
    let boxes: Vec<Aabb> = some.iter().map(|s| s.bounds).collect();
    let mut sets = Sets::new(some.len());
    for_near(&boxes, |a, b| {
        let [one, other] = [a, b].map(|i| &some[i as usize]);
        if one.object == other.object && is_one(one, other) {
            sets.join(a, b);
        }
    });
    let mut slot = vec![usize::MAX; some.len()];
    for (i, shape) in (0..).zip(some) {
        let slot = &mut slot[sets.find(i) as usize];
        if *slot == usize::MAX {
            *slot = joined.len();
            joined.push(shape);
        } else {
            joined[*slot].take(shape);
        }
    }
    joined
}

/// Makes detail of some shapes of an object that are not all of it: an object each, with the reason.
pub(super) fn split(
    scene: &mut Scene,
    object: usize,
    parts: &[(Shape, String)],
    sources: &[TriangleSource],
) {
    let original = scene.objects[object].clone();
    let mesh = scene.meshes[original.mesh as usize].clone();
    // One more than the number of the part, 0 for what stays; by primitive and triangle.
    let mut part_of: Vec<Vec<u32>> = mesh
        .primitives
        .iter()
        .map(|p| vec![0; p.indices.len() / 3])
        .collect();
    for (number, (shape, _)) in (1..).zip(parts) {
        for range in &shape.triangles {
            for source in &sources[range.clone()] {
                part_of[source.primitive as usize][source.triangle as usize] = number;
            }
        }
    }
    let mut meshes = parts_of(&mesh, &part_of, parts.len() + 1).into_iter();
    let rest = meshes.next().filter(|rest| !rest.primitives.is_empty());
    let details = meshes.zip(parts).map(|(mesh, (_, reason))| {
        let reason = format!("part of a merged mesh: {reason}");
        (mesh, Role::Detail, reason)
    });
    let rest = rest.map(|mesh| (mesh, original.role, original.reason.clone()));
    let is_shared = (0..)
        .zip(&scene.objects)
        .any(|(i, o)| i != object && o.mesh == original.mesh);
    for (i, (mesh, role, reason)) in rest.into_iter().chain(details).enumerate() {
        let mut at = original.mesh;
        if i > 0 || is_shared {
            at = scene.meshes.len() as u32;
            scene.meshes.push(mesh);
        } else {
            scene.meshes[at as usize] = mesh;
        }
        let own = Object {
            mesh: at,
            role,
            reason,
            // The name is that of the first part.
            filling: None,
            ..original.clone()
        };
        if i == 0 {
            scene.objects[object] = own;
        } else {
            scene.objects.push(own);
        }
    }
}

/// Returns a mesh for each number, of the triangles that have it. Time: O(n log n).
fn parts_of(mesh: &Mesh, part_of: &[Vec<u32>], n: usize) -> Vec<Mesh> {
    let empty = Mesh {
        name: mesh.name.clone(),
        primitives: Vec::new(),
    };
    let mut parts = vec![empty; n];
    for (primitive, numbers) in mesh.primitives.iter().zip(part_of) {
        let number = |t: &u32| numbers[*t as usize];
        let mut order: Vec<u32> = (0..numbers.len() as u32).collect();
        order.sort_by_key(number);
        let mut slot = vec![u32::MAX; primitive.positions.len()];
        for own in order.chunk_by(|a, b| number(a) == number(b)) {
            let part = part_of_primitive(primitive, own, &mut slot);
            parts[number(&own[0]) as usize].primitives.push(part);
        }
    }
    parts
}

/// Returns some triangles of a primitive with the vertices that they use. `slot` is `u32::MAX` for each vertex, before and
/// after.
fn part_of_primitive(all: &Primitive, triangles: &[u32], slot: &mut [u32]) -> Primitive {
    let mut kept: Vec<u32> = Vec::new();
    let mut indices = Vec::with_capacity(3 * triangles.len());
    for &t in triangles {
        for v in all.triples()[t as usize] {
            let own = &mut slot[v as usize];
            if *own == u32::MAX {
                *own = kept.len() as u32;
                kept.push(v);
            }
            indices.push(*own);
        }
    }
    for &v in &kept {
        slot[v as usize] = u32::MAX;
    }
    fn pick<T: Copy>(list: &[T], kept: &[u32]) -> Vec<T> {
        if list.is_empty() {
            return Vec::new();
        }
        kept.iter().map(|&v| list[v as usize]).collect()
    }
    Primitive {
        positions: pick(&all.positions, &kept),
        normals: pick(&all.normals, &kept),
        tangents: pick(&all.tangents, &kept),
        uvs: all.uvs.iter().map(|set| pick(set, &kept)).collect(),
        colors: pick(&all.colors, &kept),
        indices,
        material: all.material,
    }
}
