//! Mirrors and links of objects that the scene marks ([`Scene::marks`]).
//!
//! Each connected part of a marked object that is flat and convex becomes a special portal of its own, as if its outline were given to
//! [`special::mirror`] or [`special::link`]. The object stays as it is: it may be what closes a wall, and it is what the back of a
//! mirror shows. It hides nothing, as a special portal wins over what lies in its plane; so the plane is that of the object's
//! foremost vertex. What cannot become one is told in a note, and is nothing but geometry.

use std::collections::{BTreeMap, HashMap};

use enfilade_cpg::{SpecialId, World};
use enfilade_geom::scene::{Mark, MarkKind, Scene, TriangleSource};
use enfilade_geom::{Aabb, DVec3, Plane, Triangle, Winding, shown, triangle_area_normal};

use crate::edit::special::{self, LinkOptions, SpecialSpot};

/// Greatest distance of a vertex from the plane of its panel, and width of dents that are filled. [Units: wu]
const FLAT: f64 = 0.005;

/// Distances before a panel at which a wall in front of it is looked for. [Units: wu]
const IN_FRONT: [f64; 3] = [0.05, 0.1, 0.25];

/// Most objects of one problem that are told one by one.
const MOST_TOLD: usize = 3;

/// A connected part of a marked object.
struct Panel<'s> {
    name: &'s str,
    kind: &'s MarkKind,
    /// Middle of its box. [Units: wu]
    at: DVec3,
    outline: Result<Vec<DVec3>, Unfit>,
}

/// The reason why a panel has no outline.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unfit {
    /// Distance of its farthest vertex from its plane. [Units: wu]
    Bent(f64),
    /// Area of its faces and of their convex hull. [Units: wu²]
    Concave([f64; 2]),
    Narrow,
}

/// Makes special portals of the scene's marked objects, and adds a note for each that cannot become one.
pub(crate) fn make_marked(world: &mut World, notes: &mut Vec<String>, scene: &Scene) {
    if scene.marks.is_empty() {
        return;
    }
    let panels: Vec<Panel<'_>> = (scene.marks.iter())
        .flat_map(|mark| panels(scene, mark))
        .collect();
    // Nobody edited this world.
    let edits = world.graph.statistics.counts.get("edits").copied();
    let mut problems = Problems::default();
    let mut portals: BTreeMap<&str, Vec<&Panel<'_>>> = BTreeMap::new();
    for panel in &panels {
        match (panel.kind, &panel.outline) {
            (_, Err(unfit)) => problems.add(panel, unfit.says()),
            (MarkKind::Portal(name), Ok(_)) => portals.entry(name).or_default().push(panel),
            (MarkKind::Mirror, Ok(outline)) => {
                match special::mirror(world, &spot(world, outline)) {
                    Ok(made) => panel.names(world, made),
                    Err(error) => problems.add(panel, [error.to_string(), String::new()]),
                }
            }
        }
    }
    for (name, ends) in portals {
        link(world, name, &ends, &mut problems);
    }
    let counts = &mut world.graph.statistics.counts;
    counts.remove("edits");
    counts.extend(edits.map(|n| ("edits".to_owned(), n)));
    problems.tell(notes);
}

/// Links the two panels of one name.
fn link(world: &mut World, name: &str, ends: &[&Panel<'_>], problems: &mut Problems) {
    let (&[one, other], false) = (ends, name.is_empty()) else {
        let says = match ends.len() {
            _ if name.is_empty() => {
                "'portal:' needs a name behind it, the same for both ends".to_owned()
            }
            1 => format!(
                "no other flat object is called portal:{}, and a link needs two",
                shown(name)
            ),
            n => format!(
                "{n} objects are called portal:{}, and a link needs two: give each pair a name of its own",
                shown(name)
            ),
        };
        for end in ends {
            problems.add(end, [says.clone(), String::new()]);
        }
        return;
    };
    let (Ok(from), Ok(into)) = (&one.outline, &other.outline) else {
        return;
    };
    let (from, into) = (spot(world, from), spot(world, into));
    match special::link(world, &from, &into, &LinkOptions::default()) {
        Ok((first, second)) => {
            one.names(world, first);
            if let Some(second) = second {
                other.names(world, second);
            }
        }
        Err(error) => {
            let partner = format!("to {} at {}", shown(other.name), place(other.at));
            problems.add(one, [format!("{error}"), partner]);
        }
    }
}

/// Returns the place of an outline. One that faces a wall close by hangs on it and is seen from behind.
fn spot(world: &World, outline: &[DVec3]) -> SpecialSpot {
    let polygon = Winding::new(outline.to_vec());
    let (at, normal) = (
        polygon.centroid(),
        polygon.area_normal().normalize_or_zero(),
    );
    let is_walled = |toward: DVec3| {
        let solid = |d: &f64| world.graph.locator.locate(at + toward * *d).is_none();
        IN_FRONT.iter().any(solid)
    };
    let mut corners = polygon.points;
    if is_walled(normal) && !is_walled(-normal) {
        corners.reverse();
    }
    SpecialSpot::Wall(corners)
}

impl Panel<'_> {
    /// Gives a special portal the panel's name.
    fn names(&self, world: &mut World, special: SpecialId) {
        self.name
            .clone_into(&mut world.graph.specials[special.idx()].name);
    }
}

impl Unfit {
    /// Returns the reason without numbers, and the numbers.
    fn says(self) -> [String; 2] {
        let at_most = FLAT * 1e3;
        match self {
            Self::Bent(off) => [
                format!("only flat objects can become special portals, to {at_most} mm; mark one face as an object of its own"),
                format!("{:.0} mm off its plane", off * 1e3),
            ],
            Self::Concave([area, hull]) => [
                "only convex outlines without holes can become special portals; divide the object into convex ones".to_owned(),
                format!("{area:.3} m² of a hull of {hull:.3} m²"),
            ],
            Self::Narrow => ["it has no area".to_owned(), String::new()],
        }
    }
}

fn place(p: DVec3) -> String {
    format!("{:.2},{:.2},{:.2}", p.x, p.y, p.z)
}

/// Objects that stay geometry, by reason.
#[derive(Default)]
struct Problems {
    /// The reason, its objects with their places, and their number; in order of the first.
    found: Vec<(String, Vec<String>, usize)>,
}

impl Problems {
    fn add(&mut self, panel: &Panel<'_>, [reason, detail]: [String; 2]) {
        let known = self.found.iter().position(|f| f.0 == reason);
        let known = known.unwrap_or_else(|| {
            self.found.push((reason, Vec::new(), 0));
            self.found.len() - 1
        });
        let (_, told, n) = &mut self.found[known];
        *n += 1;
        if *n <= MOST_TOLD {
            let detail = if detail.is_empty() {
                detail
            } else {
                format!(" ({detail})")
            };
            told.push(format!(
                "'{}' at {}{detail}",
                shown(panel.name),
                place(panel.at)
            ));
        }
    }

    fn tell(self, notes: &mut Vec<String>) {
        for (reason, told, n) in self.found {
            let more = match n - told.len() {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let verb = if n == 1 { "stays" } else { "stay" };
            notes.push(format!(
                "{}{more} {verb} plain geometry: {reason}",
                told.join(", ")
            ));
        }
    }
}

/// Returns the connected parts of a marked object, in the order of their first triangles.
fn panels<'s>(scene: &'s Scene, mark: &'s Mark) -> Vec<Panel<'s>> {
    let object = &scene.objects[mark.object as usize];
    let primitives = &scene.meshes[object.mesh as usize].primitives;
    let mut triangles: Vec<Triangle> = Vec::new();
    for (primitive, p) in (0..).zip(primitives) {
        if mark.primitive.is_none_or(|m| m == primitive) {
            let source = |triangle| TriangleSource {
                object: mark.object,
                primitive,
                triangle,
            };
            let n = p.triples().len() as u32;
            triangles.extend((0..n).map(|t| scene.world_triangle(source(t))));
        }
    }
    let parts = connected(&triangles).into_iter();
    let panel = |part: Vec<Triangle>| {
        let corners = part.iter().flatten().copied();
        Panel {
            name: &object.name,
            kind: &mark.kind,
            at: corners.fold(Aabb::EMPTY, Aabb::including).center(),
            outline: outline(&part),
        }
    };
    parts.map(panel).collect()
}

/// Returns the triangles by connected part; those with a vertex in common are connected.
fn connected(triangles: &[Triangle]) -> Vec<Vec<Triangle>> {
    let mut number: HashMap<[u64; 3], usize> = HashMap::new();
    let mut parent: Vec<usize> = Vec::new();
    let root = |parent: &mut Vec<usize>, mut i: usize| {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    };
    let corners: Vec<[usize; 3]> = (triangles.iter())
        .map(|t| {
            t.map(|p| {
                // Adding zero makes both zeros one.
                let bits = (p + DVec3::ZERO).to_array().map(f64::to_bits);
                *number.entry(bits).or_insert_with(|| {
                    parent.push(parent.len());
                    parent.len() - 1
                })
            })
        })
        .collect();
    for &[a, b, c] in &corners {
        for other in [b, c] {
            let (a, b) = (root(&mut parent, a), root(&mut parent, other));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut parts: Vec<Vec<Triangle>> = Vec::new();
    let mut part_of: HashMap<usize, usize> = HashMap::new();
    for (t, &[a, ..]) in triangles.iter().zip(&corners) {
        let part = *part_of.entry(root(&mut parent, a)).or_insert_with(|| {
            parts.push(Vec::new());
            parts.len() - 1
        });
        parts[part].push(*t);
    }
    parts
}

/// Returns the outline of flat triangles that fill their convex hull, counter-clockwise as they are.
fn outline(triangles: &[Triangle]) -> Result<Vec<DVec3>, Unfit> {
    let areas: Vec<DVec3> = triangles.iter().map(triangle_area_normal).collect();
    let sum: DVec3 = areas.iter().sum();
    let total: f64 = areas.iter().map(|a| a.length()).sum();
    let largest = areas
        .iter()
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    // Faces on both sides cancel out.
    let is_two_sided = sum.length() < 1e-3 * total;
    let normal = if is_two_sided {
        *largest.ok_or(Unfit::Narrow)?
    } else {
        sum
    };
    let normal = normal.try_normalize().ok_or(Unfit::Narrow)?;
    let points: Vec<DVec3> = triangles.iter().flatten().copied().collect();
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let heights = points.iter().map(|p| normal.dot(*p - mean));
    let (low, high) = heights.fold((0.0_f64, 0.0_f64), |(low, high), h| {
        (low.min(h), high.max(h))
    });
    let off = high.max(-low);
    if off > FLAT {
        return Err(Unfit::Bent(off));
    }
    let plane = Plane::through(mean + normal * high, normal);
    let flat: Vec<DVec3> = points.iter().map(|&p| plane.project(p)).collect();
    let hull = Winding::hull_in_plane(&plane, &flat);
    let size = hull.aabb().size().max_element();
    if hull.points.len() < 3 || hull.area() <= FLAT * size {
        return Err(Unfit::Narrow);
    }
    let along = areas.iter().map(|a| a.dot(normal) / 2.0);
    let [front, back] =
        [1.0, -1.0].map(|side| along.clone().map(|a| (a * side).max(0.0)).sum::<f64>());
    let (area, n) = (front.max(back), hull.points.len());
    let around: f64 = (0..n)
        .map(|i| hull.points[i].distance(hull.points[(i + 1) % n]))
        .sum();
    if hull.area() - area > FLAT * around {
        return Err(Unfit::Concave([area, hull.area()]));
    }
    Ok(hull.points)
}
