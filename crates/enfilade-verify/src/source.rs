//! Tests that a source is the one from which the world was baked, and comparison of details.

use std::collections::HashSet;

use enfilade_cpg::World;
use enfilade_geom::{Aabb, Bvh, Triangle};

use crate::{VerifyOptions, details, structural_triangles, tolerance};

/// Most triangles of each side that are searched on the other's surface.
const ASKED: usize = 2000;
/// Least percentage of equal triangles, vertex by vertex. Both sides round once, so nearly all triangles of the right
/// source are equal; two scenes share next to none.
const SAME: usize = 50;
/// Least percentage of triangles on the other's surface if fewer are equal: a world may have cut all of them.
const ON_SURFACE: usize = 95;

/// Returns the problem, and what to do, if `source` is another scene than the one that a world was baked from, or the bake moved its
/// vertices: nothing else is then worth counting. `None` for a world that is broken, too.
///
/// O(n log n) for n triangles; no ray is cast.
#[must_use]
pub fn other_scene(world: &World, source: &[Triangle], options: &VerifyOptions) -> Option<String> {
    world.validate().ok()?;
    let own = structural_triangles(world).into_iter();
    let own = own.filter(|t| !world.batches[t.1 as usize].is_seal);
    let own: Vec<Triangle> = own.map(|t| t.0).collect();
    let bounds = own
        .iter()
        .fold(Aabb::EMPTY, |b, t| b.union(Aabb::of_points(t)));
    let eps = options.tolerance.unwrap_or_else(|| tolerance(&bounds));
    let other = problem(&own, source, REACH * eps)?;
    let hole = world.graph.provenance.settings.get("smallest_hole");
    let hole = hole.and_then(|h| h.parse::<f64>().ok()).unwrap_or_default();
    let hole = hole.max(LEAST_HOLE);
    if percent_on_both(&own, source, hole) < ON_SURFACE {
        return Some(format!(
            "{other}; give the scene of its bake, with the same --unit, --up, --detail-name and so on"
        ));
    }
    Some(format!(
        "the scene's triangles miss each other, so the bake moved its vertices by up to {:.0} mm, and they are not those of the world; \
         verify the world by itself, without --source",
        hole * 1e3
    ))
}

/// Width of the gaps of a bake that says none. [Units: wu]
const LEAST_HOLE: f64 = 0.01;

/// Distance at which a triangle lies on a surface, in tolerances.
pub(crate) const REACH: f64 = 4.0;

/// Returns the problem if the source is another scene's. `reach` allows for rounding.
pub(crate) fn problem(own: &[Triangle], source: &[Triangle], reach: f64) -> Option<String> {
    let known: HashSet<Key> = own.iter().map(key).collect();
    let same = source.iter().filter(|t| known.contains(&key(t))).count();
    let most = own.len().max(source.len());
    if 100 * same >= SAME * most {
        return None;
    }
    let share = percent_on_both(own, source, reach);
    (share < ON_SURFACE).then(|| {
        format!(
            "the source is another scene, or was read with other settings than in the bake: {same} of its {} triangles are among the \
             world's {}",
            source.len(),
            own.len()
        )
    })
}

/// Key of a triangle: the bits of its vertices, in any order.
pub(crate) type Key = [[u32; 3]; 3];

pub(crate) fn key(t: &Triangle) -> Key {
    // Adding zero makes -0 and 0 the same key.
    let mut key = t.map(|p| p.as_vec3().to_array().map(|v| (v + 0.0).to_bits()));
    key.sort_unstable();
    key
}

fn percent_on_both(a: &[Triangle], b: &[Triangle], reach: f64) -> usize {
    percent_on(a, b, reach).min(percent_on(b, a, reach))
}

fn percent_on(of: &[Triangle], within: &[Triangle], reach: f64) -> usize {
    let bvh = Bvh::build(within);
    let asked = of.iter().step_by(of.len().div_ceil(ASKED).max(1));
    let (mut there, mut n) = (0, 0);
    for t in asked {
        let middle = (t[0] + t[1] + t[2]) / 3.0;
        there += usize::from(bvh.nearest(middle, reach).is_some());
        n += 1;
    }
    100 * there / n.max(1)
}

/// A detail object of the source scene, in world space.
pub struct SourceDetail {
    /// Its name.
    pub name: String,
    /// Its source, numbered as in the world.
    pub source: Option<u32>,
    /// Its triangles.
    pub triangles: Vec<Triangle>,
}

/// One object of either side.
struct Shape {
    /// Its index on its side.
    id: usize,
    name: String,
    source: Option<u32>,
    n: usize,
    bounds: Aabb,
    is_met: bool,
}

impl Shape {
    /// Returns `None` without triangles.
    fn of(id: usize, name: &str, source: Option<u32>, triangles: &[Triangle]) -> Option<Self> {
        (!triangles.is_empty()).then(|| Self {
            id,
            name: name.to_owned(),
            source,
            n: triangles.len(),
            bounds: Aabb::of_points(triangles.iter().flatten()),
            is_met: false,
        })
    }

    /// Returns the largest move of its vertices by rounding. [Units: wu]
    fn slack(&self) -> f64 {
        let largest = self.bounds.min.abs().max(self.bounds.max.abs());
        SLACK + ROUNDING * largest.max_element()
    }

    fn is_before(&self, other: &Self) -> bool {
        let is_left = || self.bounds.min.x < other.bounds.min.x - other.slack();
        self.n < other.n || (self.n == other.n && is_left())
    }
}

/// Largest move by writing positions and transforms in `f32`: at the origin, and per distance from it. [Units: wu]
const SLACK: f64 = 1e-4;
const ROUNDING: f64 = 2e-6;

/// Most listed objects without a partner.
const NAMED: usize = 10;

/// Checks that a world has the details of its source, each in its place; returns problems, a line each. `source`
/// returns the detail of an index below `n`, and may be called several times for each.
///
/// Finds a detail that was moved, changed, added or removed, whatever the world's counts are. Compares triangles in
/// their order, which our writers keep, even if parts were taken out of an object; objects in any order. Linear in
/// triangles and O(n log n) in objects, if few that differ lie in one place.
#[must_use]
pub fn compare_details(
    world: &World,
    n: usize,
    source: impl Fn(usize) -> SourceDetail,
) -> Vec<String> {
    let mut parts: Vec<Vec<usize>> = vec![Vec::new(); world.details.len()];
    for (i, d) in world.details.iter().enumerate() {
        let whole = d.part_of.map_or(i, |w| w as usize);
        parts[whole].push(i);
    }
    // A whole, followed by the parts taken out of it.
    let of_world = |i: usize| -> Vec<Vec<Triangle>> {
        let own = parts[i].iter().map(|&p| &world.details[p]);
        own.map(|d| details::triangles_of(world, d)).collect()
    };
    let wholes = (0..world.details.len()).filter(|&i| world.details[i].part_of.is_none());
    let mut own: Vec<Shape> = wholes
        .filter_map(|i| {
            let detail = &world.details[i];
            Shape::of(i, &detail.name, detail.source, &of_world(i).concat())
        })
        .collect();
    let mut theirs: Vec<Shape> = (0..n)
        .filter_map(|i| {
            let detail = source(i);
            Shape::of(i, &detail.name, detail.source, &detail.triangles)
        })
        .collect();
    // Sorted by the start of their boxes, so that only near ones are compared.
    for shapes in [&mut own, &mut theirs] {
        shapes.sort_by(|a, b| {
            let by_place = a.bounds.min.x.total_cmp(&b.bounds.min.x);
            a.n.cmp(&b.n).then(by_place).then(a.id.cmp(&b.id))
        });
    }
    let (mut first, mut renamed) = (0, Vec::new());
    for shape in &mut theirs {
        while own
            .get(first)
            .is_some_and(|o| o.is_met || o.is_before(shape))
        {
            first += 1;
        }
        let triangles = source(shape.id).triangles;
        let near = own[first..].iter_mut();
        let near = near.take_while(|o| !shape.is_before(o));
        let is_there = |o: &&mut Shape| {
            let bounds = [
                o.bounds.min - shape.bounds.min,
                o.bounds.max - shape.bounds.max,
            ];
            let is_near = bounds
                .iter()
                .all(|d| d.abs().max_element() <= shape.slack());
            !o.is_met && is_near && is_same(&of_world(o.id), &triangles, shape.slack())
        };
        // Among several in one place, prefer that of the same name.
        let mut met: Vec<&mut Shape> = near.filter(is_there).collect();
        met.sort_by_key(|o| (o.name != shape.name, o.source != shape.source));
        if let Some(met) = met.into_iter().next() {
            met.is_met = true;
            shape.is_met = true;
            if met.name != shape.name || met.source != shape.source {
                renamed.push(format!(
                    "detail {} ({}): the source names it {:?}, or has it at another node",
                    met.id, met.name, shape.name
                ));
            }
        }
    }
    let mut out = unmet(&theirs, &own);
    let more = renamed.len().saturating_sub(NAMED);
    out.extend(renamed.into_iter().take(NAMED));
    if more > 0 {
        out.push(format!(
            "{more} more details differ in name or node from the source"
        ));
    }
    out
}

/// Returns `true` if triangles are those of the parts taken out of them, each part in its order.
fn is_same(parts: &[Vec<Triangle>], of: &[Triangle], slack: f64) -> bool {
    let is_near = |a: &Triangle, b: &Triangle| {
        let mut corners = a.iter().zip(b);
        corners.all(|(p, q)| (*p - *q).abs().max_element() <= slack)
    };
    let mut rest: Vec<&[Triangle]> = parts.iter().map(Vec::as_slice).collect();
    of.iter().all(|t| {
        let next = rest
            .iter_mut()
            .find(|r| r.first().is_some_and(|f| is_near(f, t)));
        next.is_some_and(|r| {
            *r = &r[1..];
            true
        })
    })
}

/// Returns the objects that lack a partner, a line each.
fn unmet(theirs: &[Shape], own: &[Shape]) -> Vec<String> {
    let n_met = own.iter().filter(|s| s.is_met).count();
    if 2 * n_met < own.len().max(theirs.len()) {
        return vec![format!(
            "the source's details are those of another scene, or were read with other settings than in the bake: {n_met} of its {} \
             are among the world's {}",
            theirs.len(),
            own.len()
        )];
    }
    let mut out = Vec::new();
    for (shapes, lack) in [
        (theirs, "the world lacks a detail of the source"),
        (own, "the source has no such detail there"),
    ] {
        let alone = || shapes.iter().filter(|s| !s.is_met);
        out.extend(alone().take(NAMED).map(|s| {
            let c = s.bounds.center();
            format!("{lack}: {:?}, {} triangles around {c:.3}", s.name, s.n)
        }));
        let more = alone().count().saturating_sub(NAMED);
        if more > 0 {
            out.push(format!("{lack}: {more} more"));
        }
    }
    out
}
