//! Door leaves and panes: detail objects that close an opening.
//!
//! Detail is left out of the decomposition (Haumont et al. 2003, §6.1), but a door leaf is better
//! evidence of a room's end than any measure of the opening behind it. So flat detail objects are
//! drawn into a volume of their own: the flood stops there, and no merge crosses an opening that such an
//! object fills. The object need not be named a door. A flat object elsewhere (a shelf against a wall,
//! a table top) fills no opening between two rooms, so it changes nothing.

use enfilade_geom::scene::{Role, Scene, TriangleSource};
use enfilade_geom::{
    Aabb, Bvh, DVec3, NearSeries, Triangle, is_rather_level, triangle_area_normal,
};

/// Largest thickness of a flat object. [Units: wu] A door with its frame and handles has about 0.3.
pub(crate) const MAX_THICKNESS: f64 = 0.4;
/// Least length and width of a closure. [Units: wu]
const MIN_EXTENT: f64 = 0.35;
/// … and least ratio of its width to its thickness.
const MIN_FLATNESS: f64 = 2.0;
/// Least height of a door leaf. [Units: wu]
const MIN_LEAF_HEIGHT: f64 = 1.6;
/// Least share of its bounding rectangle that a door leaf fills; the bars of a railing fill less.
const MIN_FILL: f64 = 0.5;
/// A point of a plate's rim is held if a wall or another plate is this near, which bridges a frame. [Units: wu]
const HELD_WITHIN: f64 = 0.2;
/// Least held share of the rim of a shut leaf: nearly three of its four sides.
const MIN_HELD: f64 = 0.7;
/// Samples along each side of a plate's rim.
const RIM_SAMPLES: usize = 8;

/// Least share of an object's surface in a sheet that stands for all of it: a leaf with its rails, drive or closer.
const MOST: f64 = 0.5;

/// Returns the triangles of each detail object that is flat enough to close an opening, and the leaves of those that
/// reach farther: the panels of an overhead door without its rails.
#[must_use]
pub(crate) fn plates(scene: &Scene) -> Vec<Vec<Triangle>> {
    let mut out = Vec::new();
    let mut object: Vec<Triangle> = Vec::new();
    let mut current = None;
    let mut sources: Vec<TriangleSource> = scene.triangle_sources(Role::Detail).collect();
    sources.push(TriangleSource {
        object: u32::MAX,
        primitive: 0,
        triangle: 0,
    });
    for source in sources {
        if current != Some(source.object) {
            if is_flat(&object) {
                out.push(std::mem::take(&mut object));
            } else {
                out.extend(leaf_among(&object));
            }
            object.clear();
            current = Some(source.object);
        }
        if source.object != u32::MAX {
            object.push(scene.world_triangle(source));
        }
    }
    out
}

/// Returns all plates except door leaves that stand open. The rim of an open leaf does not run along walls or other
/// plates nearly all around, but is held only below and at the hinges. Such leaves shut nothing, and would cut a
/// corridor in two.
///
/// Eight box tree queries for each side of a plate.
#[must_use]
pub(crate) fn without_open_leaves(plates: Vec<Vec<Triangle>>, walls: &Bvh) -> Vec<Vec<Triangle>> {
    let owner: Vec<usize> = (0..plates.len())
        .flat_map(|i| std::iter::repeat_n(i, plates[i].len()))
        .collect();
    let all = Bvh::build(&plates.concat());
    let is_held = |(i, plate): (usize, &Vec<Triangle>)| {
        let is_near = |p: DVec3| {
            let reach = Aabb::new(p, p).expanded(HELD_WITHIN);
            let mut is_near_other = false;
            all.for_each_in_box(&reach, |t| is_near_other |= owner[t as usize] != i);
            is_near_other
                || walls
                    .any_within(p, HELD_WITHIN, &mut NearSeries::default())
                    .is_some()
        };
        let area: f64 = plate
            .iter()
            .map(|t| 0.5 * triangle_area_normal(t).length())
            .sum();
        let plate = Plate::of(plate);
        if !plate.is_leaf(area) {
            return true;
        }
        let rim = plate.rim();
        let n_held = rim.iter().filter(|&&p| is_near(p)).count();
        n_held as f64 >= MIN_HELD * rim.len() as f64
    };
    let held: Vec<bool> = plates.iter().enumerate().map(is_held).collect();
    let mut held = held.into_iter();
    let mut plates = plates;
    plates.retain(|_| held.next() == Some(true));
    plates
}

/// The box around an object, oriented along its thin direction.
struct Plate {
    center: DVec3,
    /// Half extents along the two sides of the plate.
    sides: [DVec3; 2],
    thickness: f64,
}

impl Plate {
    fn of(triangles: &[Triangle]) -> Self {
        let n = thin_direction(triangles);
        // The other two extents run along the horizontal and the vertical of the plate.
        let level = if is_rather_level(n) {
            DVec3::X
        } else {
            DVec3::Y
        };
        let u = (level - n * n.dot(level)).normalize();
        let range = |d: DVec3| {
            let points = triangles.iter().flatten();
            points.fold((f64::MAX, f64::MIN), |(lo, hi), p| {
                let t = d.dot(*p);
                (lo.min(t), hi.max(t))
            })
        };
        let axes = [n, u, n.cross(u)];
        let ranges = axes.map(range);
        let half = |k: usize| axes[k] * (0.5 * (ranges[k].1 - ranges[k].0));
        Self {
            center: (0..3)
                .map(|k| axes[k] * (0.5 * (ranges[k].0 + ranges[k].1)))
                .sum(),
            sides: [half(1), half(2)],
            thickness: ranges[0].1 - ranges[0].0,
        }
    }

    fn is_flat(&self) -> bool {
        let least = 2.0 * self.sides[0].length().min(self.sides[1].length());
        self.thickness < MAX_THICKNESS
            && least > MIN_EXTENT
            && least > MIN_FLATNESS * self.thickness
    }

    /// Returns `true` for a possible door leaf, given its area on all sides: upright, above counter height, no railing.
    fn is_leaf(&self, area: f64) -> bool {
        let [u, v] = self.sides;
        let height = 2.0 * u.y.abs().max(v.y.abs());
        // Two sides of half extents u and v.
        height >= MIN_LEAF_HEIGHT && area >= MIN_FILL * 8.0 * u.length() * v.length()
    }

    /// Returns points along its rim, the same number on each side.
    fn rim(&self) -> Vec<DVec3> {
        let [u, v] = self.sides;
        let corners = [u + v, v - u, -u - v, u - v].map(|c| self.center + c);
        let along = |k: usize| {
            (0..RIM_SAMPLES).map(move |i| {
                corners[k].lerp(corners[(k + 1) % 4], (i as f64 + 0.5) / RIM_SAMPLES as f64)
            })
        };
        (0..4).flat_map(along).collect()
    }
}

/// Returns the triangles in the sheet that holds most of an object's surface, if it is a leaf.
///
/// `O(n log n)`.
fn leaf_among(triangles: &[Triangle]) -> Option<Vec<Triangle>> {
    let area = |t: &Triangle| 0.5 * triangle_area_normal(t).length();
    let total: f64 = triangles.iter().map(area).sum();
    if total == 0.0 {
        return None;
    }
    let n = thin_direction(triangles);
    let range = |t: &Triangle| {
        let d = t.map(|p| n.dot(p));
        (d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2]))
    };
    let mut by_place: Vec<(f64, f64, f64)> = triangles
        .iter()
        .map(|t| (range(t).0, range(t).1, area(t)))
        .filter(|(low, high, _)| high - low < MAX_THICKNESS)
        .collect();
    by_place.sort_by(|a, b| a.0.total_cmp(&b.0));
    let sheet = |first: usize| {
        let low = by_place[first].0;
        let from = by_place[first..].iter();
        let within = from.take_while(|t| t.0 < low + MAX_THICKNESS);
        let held = within.filter(|t| t.1 < low + MAX_THICKNESS);
        (low, held.map(|t| t.2).sum::<f64>())
    };
    let (low, most) = (0..by_place.len())
        .map(sheet)
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_in = |t: &&Triangle| range(t).0 >= low && range(t).1 < low + MAX_THICKNESS;
    let leaf: Vec<Triangle> = triangles.iter().filter(is_in).copied().collect();
    let plate = Plate::of(&leaf);
    (most >= MOST * total && plate.is_flat() && plate.is_leaf(most)).then_some(leaf)
}

fn is_flat(triangles: &[Triangle]) -> bool {
    !triangles.is_empty() && Plate::of(triangles).is_flat()
}

/// Most directions that surfaces are sorted into.
const MAX_DIRECTIONS: usize = 64;

/// Returns the direction that most of the surface faces, up to sign.
///
/// The largest triangles define the directions: the many small ones of moldings, handles and scanned edges may
/// face anywhere.
pub(crate) fn thin_direction(triangles: &[Triangle]) -> DVec3 {
    let mut normals: Vec<DVec3> = triangles.iter().map(triangle_area_normal).collect();
    normals.sort_by(|a, b| b.length_squared().total_cmp(&a.length_squared()));
    let mut clusters: Vec<(DVec3, f64)> = Vec::new();
    for n in normals {
        let area = n.length();
        if area < 1e-12 {
            break;
        }
        let n = n / area;
        if let Some((_, a)) = clusters.iter_mut().find(|(m, _)| m.dot(n).abs() > 0.98) {
            *a += area;
        } else if clusters.len() < MAX_DIRECTIONS {
            clusters.push((n, area));
        }
    }
    clusters
        .iter()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(DVec3::Y, |c| c.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn box_triangles(size: DVec3) -> Vec<Triangle> {
        Aabb::new(DVec3::ZERO, size).triangles()
    }

    #[test]
    fn a_leaf_that_stands_open_shuts_nothing() {
        let at = |origin: DVec3, size: DVec3| -> Vec<Triangle> {
            let corners = |t: Triangle| t.map(|p| p + origin);
            box_triangles(size).into_iter().map(corners).collect()
        };
        // A wall with a doorway 0.9 m wide and 2 m high, and the floor.
        let walls = [
            at(DVec3::new(-3.0, 0.0, 0.0), DVec3::new(3.0, 2.5, 0.1)),
            at(DVec3::new(0.9, 0.0, 0.0), DVec3::new(3.0, 2.5, 0.1)),
            at(DVec3::new(0.0, 2.0, 0.0), DVec3::new(0.9, 0.5, 0.1)),
            at(DVec3::new(-3.0, -0.1, -3.0), DVec3::new(7.0, 0.1, 6.0)),
        ];
        let walls = Bvh::build(&walls.concat());
        let shut = at(DVec3::ZERO, DVec3::new(0.9, 2.0, 0.04));
        let ajar = at(DVec3::ZERO, DVec3::new(0.04, 2.0, 0.9));
        // As low as a railing: it counts as a plate wherever it stands.
        let low = at(DVec3::ZERO, DVec3::new(0.04, 1.0, 0.9));
        for (plate, stays) in [(shut, true), (ajar, false), (low, true)] {
            assert_eq!(
                without_open_leaves(vec![plate], &walls).len(),
                usize::from(stays)
            );
        }
    }

    #[test]
    fn a_door_leaf_is_flat_and_a_wardrobe_is_not() {
        assert!(is_flat(&box_triangles(DVec3::new(0.9, 2.0, 0.04))));
        assert!(!is_flat(&box_triangles(DVec3::new(0.9, 2.0, 0.6))));
        assert!(!is_flat(&box_triangles(DVec3::new(0.05, 2.0, 0.04))));
    }

    #[test]
    fn an_overhead_door_is_its_leaf_without_the_rails() {
        let leaf = box_triangles(DVec3::new(3.0, 3.0, 0.05));
        // Open profiles: an upright and a level strip each.
        let strip = |x: f64, side: DVec3| {
            let (a, along) = (DVec3::new(x, 2.95, 0.05), DVec3::Z * 3.0);
            [
                [a, a + along, a + along + side],
                [a, a + along + side, a + side],
            ]
        };
        let rails = [0.0, 2.95].map(|x| [DVec3::X, DVec3::Y].map(|d| strip(x, d * 0.05)));
        let rails = rails.as_flattened().as_flattened();
        for door in [[rails, &leaf].concat(), [&leaf, rails].concat()] {
            assert!(!is_flat(&door));
            assert_eq!(leaf_among(&door).as_ref(), Some(&leaf));
        }
        let wardrobe = box_triangles(DVec3::new(1.2, 2.0, 0.6));
        assert_eq!(leaf_among(&wardrobe), None);
        // Neither are a board and its posts, lower than a door.
        let low = box_triangles(DVec3::new(3.0, 1.2, 0.05));
        assert_eq!(leaf_among(&[rails, &low].concat()), None);
    }

    #[test]
    fn small_triangles_that_face_anywhere_do_not_hide_which_way_a_leaf_faces() {
        // Moldings with vertices moved by a scanner come first in the file, in more directions than the limit.
        let mut rng = enfilade_testkit::Rng::new(7);
        let mut within = |size: DVec3| DVec3::new(rng.unit(), rng.unit(), rng.unit()) * size;
        let mut leaf: Vec<Triangle> = (0..400)
            .map(|_| {
                let at = within(DVec3::new(0.88, 1.98, 0.03));
                [
                    at,
                    at + within(DVec3::splat(0.01)),
                    at + within(DVec3::splat(0.01)),
                ]
            })
            .collect();
        leaf.extend(box_triangles(DVec3::new(0.9, 2.0, 0.04)));
        assert!(thin_direction(&leaf).z.abs() > 0.999);
        assert!(is_flat(&leaf));
    }
}
