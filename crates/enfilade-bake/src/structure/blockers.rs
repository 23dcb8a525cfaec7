//! Door leaves and panes: detail objects that close an opening.
//!
//! Detail is left out of the decomposition (Haumont et al. 2003, §6.1), but a door leaf is better
//! evidence of a room's end than any measure of the opening behind it. So flat detail objects are
//! drawn into a volume of their own: the flood stops there, and no merge crosses an opening that such an
//! object fills. The object need not be named a door. A flat object elsewhere (a shelf against a wall,
//! a table top) fills no opening between two rooms, so it changes nothing.

use std::borrow::Cow;

use enfilade_geom::filler::{DEEPEST, Filler, FillerFacts, HELD};
use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{
    Aabb, BoxTree, Bvh, DVec3, NearSeries, Rectangle, Triangle, facing, triangle_area_normal,
};

use super::Frame;

/// A point of a plate's rim is held if a wall or another plate is this near, which bridges a frame. [Units: wu]
const HELD_WITHIN: f64 = 0.2;
/// Samples along each side of a plate's rim.
const RIM_SAMPLES: usize = 8;
/// Least share of an object's surface in a sheet that stands for all of it: a leaf with its rails, drive or closer.
const MOST: f64 = 0.5;

/// A detail object flat enough to close an opening, or the leaf in one that reaches farther.
pub(crate) struct Plate<'a> {
    surface: PlateSurface<'a>,
    pub(crate) aabb: Aabb,
    /// Along its own faces.
    pub(crate) around: Rectangle,
    /// A door leaf by its shape, no window or railing.
    pub(crate) is_leaf: bool,
}

/// The triangles of a plate.
enum PlateSurface<'a> {
    /// All of an object. A building has millions of them in all, and few are asked for.
    Object(&'a Scene, u32),
    Own(Vec<Triangle>),
}

impl<'a> Plate<'a> {
    /// Returns its triangles, or the rectangle in the middle of a gate so thick that its inside would be a room.
    pub(crate) fn triangles(&self) -> Cow<'_, [Triangle]> {
        match &self.surface {
            PlateSurface::Object(scene, object) => Cow::Owned(scene.world_triangles_of(*object)),
            PlateSurface::Own(triangles) => Cow::Borrowed(triangles),
        }
    }

    /// Returns an object of a scene as a plate, or its leaf if it reaches farther: the panels of an overhead door without its
    /// rails.
    fn of_object(scene: &'a Scene, object: u32) -> Option<Self> {
        let own = scene.world_triangles_of(object);
        if own.is_empty() {
            return None;
        }
        let leaf = leaf_among(&own);
        match Self::of(own) {
            Some(whole) if whole.around.size().z <= DEEPEST => Some(Self {
                surface: PlateSurface::Object(scene, object),
                ..whole
            }),
            whole => leaf.or(whole),
        }
    }

    /// Returns an object as a plate; `None` if it is not flat, or too narrow.
    pub(crate) fn of(triangles: Vec<Triangle>) -> Option<Self> {
        // The bars of a railing face along it, so it is deep, and shuts nothing.
        let around = Rectangle::around(facing(&triangles), triangles.as_flattened());
        let facts = FillerFacts::of(&around, &around.mask(triangles.iter().copied()));
        let shape = facts.kind();
        let is_stout = around.size().z > DEEPEST;
        (!matches!(shape, Filler::Deep | Filler::Narrow)).then(|| Self {
            aabb: Aabb::of_points(triangles.as_flattened()),
            is_leaf: shape == Filler::Leaf,
            surface: PlateSurface::Own(if is_stout {
                around.middle().to_vec()
            } else {
                triangles
            }),
            around,
        })
    }
}

/// Returns the plates among the detail objects.
#[must_use]
pub(crate) fn plates(scene: &Scene) -> Vec<Plate<'_>> {
    let objects = (0..).zip(&scene.objects);
    let details = objects.filter(|(_, o)| o.role == Role::Detail);
    let plates = details.filter_map(|(i, _)| Plate::of_object(scene, i));
    plates.collect()
}

/// Returns the triangles of each plate, turned by `frame`, but for door leaves that stand open. The rim of an open leaf does
/// not run along `walls` or other plates nearly all around, but is held only below and at the hinges. Such leaves shut
/// nothing, and would cut a corridor in two.
///
/// Eight box tree queries for each side of a leaf.
pub(crate) fn without_open_leaves<'a>(
    plates: &'a [Plate<'a>],
    frame: Frame,
    walls: &'a Bvh,
) -> impl Iterator<Item = Vec<Triangle>> + 'a {
    let turned = move |i: usize| -> Vec<Triangle> {
        frame.triangles_to_grid(&plates[i].triangles()).into_owned()
    };
    let boxes = (0..plates.len()).map(|i| Aabb::of_points(turned(i).as_flattened()));
    let tree = BoxTree::new(&boxes.collect::<Vec<Aabb>>());
    let shuts = move |i: usize| {
        if !plates[i].is_leaf {
            return true;
        }
        let rim: Vec<DVec3> = (plates[i].around.rim(RIM_SAMPLES))
            .map(|p| frame.to_grid(p))
            .collect();
        let mut others: Vec<Triangle> = Vec::new();
        let reach = Aabb::of_points(&rim).expanded(HELD_WITHIN);
        tree.for_each_in_box(&reach, |other| {
            if other as usize != i {
                others.extend(turned(other as usize));
            }
        });
        let others = Bvh::build(&others);
        let is_near = |p: &&DVec3| {
            let reach = Aabb::new(**p, **p).expanded(HELD_WITHIN);
            let near = || walls.any_within(**p, HELD_WITHIN, &mut NearSeries::default());
            others.any_in_box(&reach, |_| true) || near().is_some()
        };
        let n_held = rim.iter().filter(is_near).count();
        n_held as f64 >= HELD * (4 * RIM_SAMPLES) as f64
    };
    (0..plates.len()).filter(move |&i| shuts(i)).map(turned)
}

/// Returns the triangles in the sheet that holds most of an object's surface, if it is a leaf.
///
/// `O(n log n)`.
fn leaf_among<'a>(triangles: &[Triangle]) -> Option<Plate<'a>> {
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
                without_open_leaves(&[Plate::of(plate).unwrap()], Frame::SCENE, &walls).count(),
                usize::from(stays)
            );
        }
    }

    #[test]
    fn plates_of_a_scene_have_the_triangles_of_their_objects() {
        let scene = enfilade_testkit::furnished_house().scene;
        let plates = plates(&scene);
        assert!(plates.iter().any(|p| p.is_leaf));
        for plate in plates {
            let triangles = plate.triangles();
            assert_eq!(Aabb::of_points(triangles.as_flattened()), plate.aabb);
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
        let middle = gate.triangles().into_owned();
        assert!(
            middle
                .as_flattened()
                .iter()
                .all(|p| (p.z - 0.5).abs() < 1e-9)
        );
        assert_eq!(gate.aabb.size(), DVec3::new(4.0, 3.9, 1.0));
        let door = Plate::of(box_triangles(DVec3::new(4.0, 3.9, 0.3))).unwrap();
        assert_eq!(door.triangles().len(), 12);
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
            assert_eq!(*leaf_among(&door).unwrap().triangles(), leaf);
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
