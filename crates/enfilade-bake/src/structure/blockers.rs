//! Door leaves and panes: detail objects that close an opening.
//!
//! Detail is left out of the decomposition (Haumont et al. 2003, §6.1), but a door leaf is better
//! evidence of a room's end than any measure of the opening behind it. So flat detail objects are
//! drawn into a volume of their own: the flood stops there, and no merge crosses an opening that such an
//! object fills. The object need not be named a door. A flat object elsewhere (a shelf against a wall,
//! a table top) fills no opening between two rooms, so it changes nothing.

use enfilade_geom::filler::{DEEPEST, Filler, FillerFacts, HELD};
use enfilade_geom::scene::{Role, Scene, TriangleSource};
use enfilade_geom::{
    Aabb, Bvh, DVec3, NearSeries, Rectangle, Triangle, facing, triangle_area_normal,
};

use super::Frame;

/// A point of a plate's rim is held if a wall or another plate is this near, which bridges a frame. [Units: wu]
const HELD_WITHIN: f64 = 0.2;
/// Samples along each side of a plate's rim.
const RIM_SAMPLES: usize = 8;
/// Least share of an object's surface in a sheet that stands for all of it: a leaf with its rails, drive or closer.
const MOST: f64 = 0.5;

/// A detail object flat enough to close an opening, or the leaf in one that reaches farther.
pub(crate) struct Plate {
    /// Its triangles, or the rectangle in the middle of a gate so thick that its inside would be a room.
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) aabb: Aabb,
    /// Along its own faces.
    pub(crate) around: Rectangle,
    /// A door leaf by its shape, no window or railing.
    pub(crate) is_leaf: bool,
}

impl Plate {
    /// Returns an object as a plate; `None` if it is not flat, or too narrow.
    pub(crate) fn of(triangles: Vec<Triangle>) -> Option<Self> {
        // The bars of a railing face along it, so it is deep, and shuts nothing.
        let around = Rectangle::around(facing(&triangles), triangles.as_flattened());
        let facts = FillerFacts::of(&around, &around.mask(triangles.iter().copied()));
        let shape = facts.judge();
        let is_stout = around.size().z > DEEPEST;
        (!matches!(shape, Filler::Deep | Filler::Narrow)).then(|| Self {
            aabb: Aabb::of_points(triangles.as_flattened()),
            is_leaf: shape == Filler::Leaf,
            triangles: if is_stout {
                around.middle().to_vec()
            } else {
                triangles
            },
            around,
        })
    }
}

/// Returns the plates among the detail objects, and the leaves of those that reach farther: the panels of an overhead door
/// without its rails.
#[must_use]
pub(crate) fn plates(scene: &Scene) -> Vec<Plate> {
    let sources: Vec<TriangleSource> = scene.triangle_sources(Role::Detail).collect();
    let objects = sources.chunk_by(|a, b| a.object == b.object);
    let plates = objects.filter_map(|own| {
        let own: Vec<Triangle> = own.iter().map(|&s| scene.world_triangle(s)).collect();
        let leaf = leaf_among(&own);
        let whole = Plate::of(own);
        match leaf {
            Some(leaf) if whole.as_ref().is_none_or(|w| w.around.size().z > DEEPEST) => Some(leaf),
            _ => whole,
        }
    });
    plates.collect()
}

/// Returns the triangles of all plates, turned by `frame`, except door leaves that stand open. The rim of an open leaf does
/// not run along `walls` or other plates nearly all around, but is held only below and at the hinges. Such leaves shut
/// nothing, and would cut a corridor in two.
///
/// Eight box tree queries for each side of a plate.
#[must_use]
pub(crate) fn without_open_leaves(plates: &[Plate], frame: Frame, walls: &Bvh) -> Vec<Triangle> {
    let of = |p: &Plate| frame.triangles_to_grid(&p.triangles).into_owned();
    let turned: Vec<Vec<Triangle>> = plates.iter().map(of).collect();
    let owner: Vec<usize> = (0..plates.len())
        .flat_map(|i| std::iter::repeat_n(i, turned[i].len()))
        .collect();
    let all = Bvh::build(&turned.concat());
    let shuts = |i: usize| {
        let is_near = |p: &DVec3| {
            let reach = Aabb::new(*p, *p).expanded(HELD_WITHIN);
            let mut is_near_other = false;
            all.for_each_in_box(&reach, |t| is_near_other |= owner[t as usize] != i);
            let near = || walls.any_within(*p, HELD_WITHIN, &mut NearSeries::default());
            is_near_other || near().is_some()
        };
        let rim = plates[i].around.rim(RIM_SAMPLES).map(|p| frame.to_grid(p));
        let n_held = rim.filter(is_near).count();
        !plates[i].is_leaf || n_held as f64 >= HELD * (4 * RIM_SAMPLES) as f64
    };
    let shut = (0..plates.len()).filter(|&i| shuts(i));
    shut.flat_map(|i| turned[i].iter().copied()).collect()
}

/// Returns the triangles in the sheet that holds most of an object's surface, if it is a leaf.
///
/// `O(n log n)`.
fn leaf_among(triangles: &[Triangle]) -> Option<Plate> {
    let area = |t: &Triangle| 0.5 * triangle_area_normal(t).length();
    let n = facing(triangles);
    let range = |t: &Triangle| {
        let d = t.map(|p| n.dot(p));
        [d[0].min(d[1]).min(d[2]), d[0].max(d[1]).max(d[2])]
    };
    let mut by_place: Vec<([f64; 2], f64)> =
        triangles.iter().map(|t| (range(t), area(t))).collect();
    by_place.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    let sheet = |first: usize| {
        let low = by_place[first].0[0];
        let from = by_place[first..].iter();
        let within = from.take_while(|t| t.0[0] < low + DEEPEST);
        let held = within.filter(|t| t.0[1] < low + DEEPEST);
        (low, held.map(|t| t.1).sum::<f64>())
    };
    let sheets = (0..by_place.len()).map(sheet);
    let (low, most) = sheets.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_in = |t: &&Triangle| range(t)[0] >= low && range(t)[1] < low + DEEPEST;
    let total: f64 = by_place.iter().map(|t| t.1).sum();
    let leaf = Plate::of(triangles.iter().filter(is_in).copied().collect())?;
    (most >= MOST * total && leaf.is_leaf).then_some(leaf)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn box_triangles(size: DVec3) -> Vec<Triangle> {
        Aabb::new(DVec3::ZERO, size).triangles()
    }

    fn is_flat(triangles: Vec<Triangle>) -> bool {
        Plate::of(triangles).is_some()
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
                !without_open_leaves(&[Plate::of(plate).unwrap()], Frame::SCENE, &walls).is_empty(),
                stays
            );
        }
    }

    #[test]
    fn a_door_leaf_is_flat_and_a_wardrobe_is_not() {
        assert!(is_flat(box_triangles(DVec3::new(0.9, 2.0, 0.04))));
        assert!(!is_flat(box_triangles(DVec3::new(0.9, 2.0, 0.6))));
        assert!(!is_flat(box_triangles(DVec3::new(0.05, 2.0, 0.04))));
    }

    #[test]
    fn a_thick_gate_is_the_rectangle_in_its_middle() {
        let gate = Plate::of(box_triangles(DVec3::new(4.0, 3.9, 1.0))).unwrap();
        assert!(gate.is_leaf);
        let middle = gate.triangles.as_flattened();
        assert!(middle.iter().all(|p| (p.z - 0.5).abs() < 1e-9));
        assert_eq!(gate.aabb.size(), DVec3::new(4.0, 3.9, 1.0));
        let door = Plate::of(box_triangles(DVec3::new(4.0, 3.9, 0.3))).unwrap();
        assert_eq!(door.triangles.len(), 12);
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
            assert!(!is_flat(door.clone()));
            assert_eq!(leaf_among(&door).unwrap().triangles, leaf);
        }
        let wardrobe = box_triangles(DVec3::new(1.2, 2.0, 0.6));
        assert!(leaf_among(&wardrobe).is_none());
        // Neither are a board and its posts, lower than a door.
        let low = box_triangles(DVec3::new(3.0, 1.2, 0.05));
        assert!(leaf_among(&[rails, &low].concat()).is_none());
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
        assert!(Rectangle::of(&leaf).normal.z.abs() > 0.999);
        assert!(is_flat(leaf));
    }
}
