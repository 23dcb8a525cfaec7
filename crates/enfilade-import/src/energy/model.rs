//! Surfaces, openings and spaces as both formats have them, and their way into the scene.

use enfilade_geom::scene::{GivenPortal, Mesh, Primitive};
use enfilade_geom::{DMat4, DVec2, DVec3};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::core::solver::Solver;
use i_overlay::float::overlay::{FloatOverlay, OverlayOptions};

use crate::ImportError;
use crate::builder::{Builder, Placement};
use crate::options::Up;
use crate::polygon::MAX_CORNERS;
use crate::soup;

/// A closed line. [Units: those of the file, Z up]
pub(super) type Loop = Vec<DVec3>;

/// A closed line in a plane.
pub(super) type Ring = Vec<[f64; 2]>;

/// The class of a surface or an opening in IFC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    Wall,
    Slab,
    Roof,
    Column,
    Shade,
    Door,
    Window,
    /// Lets everything pass.
    Air,
}

impl Class {
    fn name(self) -> &'static str {
        match self {
            Self::Wall => "IfcWall",
            Self::Slab => "IfcSlab",
            Self::Roof => "IfcRoof",
            Self::Column => "IfcColumn",
            Self::Shade => "IfcShadingDevice",
            Self::Door => "IfcDoor",
            Self::Window => "IfcWindow",
            Self::Air => "",
        }
    }
}

/// A polygon with a name and a class.
pub(super) struct Sheet {
    pub(super) id: String,
    pub(super) class: Class,
    pub(super) outline: Loop,
    /// Parts of it that are not there.
    pub(super) holes: Vec<Loop>,
    /// Openings in it, which are not there either, by their place in [`EnergyModel::sheets`].
    pub(super) openings: Vec<usize>,
    /// Ids of the spaces at its sides, as far as the file tells.
    pub(super) spaces: Vec<String>,
    /// Shells of spaces take its place.
    pub(super) is_left_out: bool,
}

impl Sheet {
    pub(super) fn new(id: String, class: Class, outline: Loop) -> Self {
        Self {
            id,
            class,
            outline,
            holes: Vec::new(),
            openings: Vec::new(),
            spaces: Vec::new(),
            is_left_out: false,
        }
    }

    /// Returns `true` if air or people pass, or light.
    pub(super) fn is_opening(&self) -> bool {
        matches!(self.class, Class::Door | Class::Window | Class::Air)
    }
}

/// A space: a room of the truth.
pub(super) struct Space {
    pub(super) id: String,
    pub(super) name: String,
    /// Polygons around it.
    pub(super) shell: Vec<Loop>,
    /// Where these are its walls: what is not there of each.
    pub(super) walls: Vec<Vec<Loop>>,
}

/// A model as both formats have it.
pub(super) struct EnergyModel {
    pub(super) format: &'static str,
    /// Length of the unit. [Units: m]
    pub(super) unit: f64,
    /// Surfaces and openings.
    pub(super) sheets: Vec<Sheet>,
    pub(super) spaces: Vec<Space>,
}

impl EnergyModel {
    /// Places everything. Linear but for triangulation.
    pub(super) fn place(self, builder: &mut Builder<'_>) -> Result<(), ImportError> {
        builder.set_format(self.format);
        let mut options = builder.options.clone();
        options.unit = options.unit.or(Some(self.unit));
        options.up = options.up.or(Some(Up::Z));
        let base = options.base_transform()?;
        let mut cutter = Cutter::default();
        for sheet in (self.sheets.iter()).filter(|s| s.class != Class::Air && !s.is_left_out) {
            let place = format!("surface '{}'", soup::shortened(&sheet.id));
            let openings = sheet.openings.iter().map(|&i| &self.sheets[i].outline);
            let holes = sheet.holes.iter().chain(openings).cloned().collect();
            let polygon = (&sheet.outline, &holes);
            let mesh = cutter.mesh(std::iter::once(polygon), &place, builder)?;
            let name = format!("{}/{}", sheet.class.name(), sheet.id);
            put(builder, mesh, &name, "", base, &place)?;
        }
        let air = self.sheets.iter().filter(|s| s.class == Class::Air);
        let given = air.filter_map(|sheet| given_portal(sheet, base));
        builder.add_given_portals(given.collect());
        for space in &self.spaces {
            let place = format!("space '{}'", soup::shortened(&space.id));
            if !space.walls.is_empty() {
                // As one mesh, a closed shell is one thing.
                let polygons = space.shell.iter().zip(&space.walls);
                let mesh = cutter.mesh(polygons, &place, builder)?;
                let name = format!("{}/{}", Class::Wall.name(), space.id);
                put(builder, mesh, &name, "", base, &place)?;
            }
            let loops = space.shell.iter().map(|l| (l, NO_HOLES));
            let mesh = cutter.mesh(loops, &place, builder)?;
            let extras = serde_json::json!({ "ifc": { "Name": space.name } }).to_string();
            let name = format!("IfcSpace/{}", space.id);
            put(builder, mesh, &name, &extras, base, &place)?;
        }
        Ok(())
    }
}

/// How far a mark reaches into the walls around it, so that nothing leads past its edge: the tolerance of most such models.
/// [Units: m]
const MARK_REACH: f64 = 0.01;

/// Returns a surface of air as an opening that its author marked.
fn given_portal(sheet: &Sheet, base: DMat4) -> Option<GivenPortal> {
    let (_, normal) = plane(&sheet.outline)?;
    let outline = sheet.outline.iter().map(|&p| base.transform_point3(p));
    let outline: Vec<DVec3> = outline.collect();
    let middle = outline.iter().sum::<DVec3>() / outline.len() as f64;
    let reaching = |&p: &DVec3| p + (p - middle).normalize_or_zero() * MARK_REACH;
    Some(GivenPortal {
        name: format!("air {}", sheet.id),
        outline: outline.iter().map(reaching).collect(),
        normal: base.transform_vector3(normal).try_normalize()?,
        thickness: 0.0,
    })
}

const NO_HOLES: &Vec<Loop> = &Vec::new();

/// Vertices of a mesh that are not yet rounded, and its triangles.
type Draft = (Vec<[f64; 3]>, Vec<u32>);

fn put(
    builder: &mut Builder<'_>,
    (mut positions, indices): Draft,
    name: &str,
    extras: &str,
    base: DMat4,
    place: &str,
) -> Result<(), ImportError> {
    builder.charge_vertices(place, positions.len() as u64)?;
    builder.check_triangles(place, indices.len() as u64 / 3)?;
    let offset = soup::recenter(&mut positions);
    let mut primitive = Primitive {
        positions: positions.iter().map(|p| p.map(|c| c as f32)).collect(),
        indices,
        ..Primitive::default()
    };
    builder.drop_nonfinite(place, &mut primitive);
    let source = builder.add_source(place, None, name, extras)?;
    let mesh = builder.push_mesh(Mesh {
        name: name.to_owned(),
        primitives: vec![primitive],
    });
    builder.place(&Placement {
        mesh,
        names: [name, ""],
        ancestors: &[],
        transforms: &[base * DMat4::from_translation(offset)],
        moves: None,
        place,
        source,
    })
}

/// Splits polygons with holes into triangles; reuses its buffers.
#[derive(Default)]
struct Cutter {
    ears: earcut::Earcut<f64>,
    triangles: Vec<u32>,
}

impl Cutter {
    /// Returns one mesh of some polygons. Holes may touch the edge, as doors do, lie outside of it or over one another.
    fn mesh<'l>(
        &mut self,
        polygons: impl Iterator<Item = (&'l Loop, &'l Vec<Loop>)>,
        place: &str,
        builder: &mut Builder<'_>,
    ) -> Result<Draft, ImportError> {
        let mut draft = Draft::default();
        for (outline, holes) in polygons {
            let n = outline.len() + holes.iter().map(Vec::len).sum::<usize>();
            if n > MAX_CORNERS {
                return Err(builder.malformed(
                    place,
                    format!("a polygon of {n} vertices; at most {MAX_CORNERS} are read: split it"),
                ));
            }
            self.cut(outline, holes, &mut draft);
        }
        Ok(draft)
    }

    /// Adds the triangles of a polygon without its holes, in the plane of its area vector; nothing of one without an area.
    fn cut(&mut self, outline: &Loop, holes: &[Loop], (positions, indices): &mut Draft) {
        let Some((origin, normal)) = plane(outline) else {
            return;
        };
        let (u, v) = normal.any_orthonormal_pair();
        let flat = |p: &DVec3| DVec2::new((*p - origin).dot(u), (*p - origin).dot(v)).to_array();
        let outer: Ring = outline.iter().map(flat).collect();
        let known: Vec<(&DVec3, [f64; 2])> = (outline.iter().chain(holes.iter().flatten()))
            .map(|p| (p, flat(p)))
            .collect();
        // Vertices keep the bits that those of the next surface have; only crossings are new.
        let placed = |p: &[f64; 2]| {
            let is_near = |q: &[f64; 2]| (0..2).all(|k| (p[k] - q[k]).abs() < SAME);
            let old = known.iter().find(|(_, q)| is_near(q));
            old.map_or_else(|| origin + u * p[0] + v * p[1], |(at, _)| **at)
        };
        let holes: Vec<Ring> = holes
            .iter()
            .map(|hole| turned_left(hole.iter().map(flat).collect()))
            .collect();
        let shapes = match holes.is_empty() {
            true => vec![vec![outer]],
            false => overlay(&[outer], &holes, OverlayRule::Difference),
        };
        for loops in shapes {
            let (first, mut starts, mut n) = (positions.len() as u32, Vec::new(), 0);
            for ring in &loops {
                positions.extend(ring.iter().map(|p| placed(p).to_array()));
                starts.push(n);
                n += ring.len() as u32;
            }
            let points = loops.iter().flatten().copied();
            (self.ears).earcut(points, &starts[1..], &mut self.triangles);
            let at = |i: u32| DVec3::from(positions[(first + i) as usize]);
            for t in self.triangles.chunks_exact_mut(3) {
                let [a, b, c] = [t[0], t[1], t[2]].map(at);
                if (b - a).cross(c - a).dot(normal) < 0.0 {
                    t.swap(1, 2);
                }
            }
            indices.extend(self.triangles.iter().map(|i| first + i));
        }
    }
}

/// Distance up to which two vertices of a polygon are one. [Units: those of the file]
const SAME: f64 = 1e-7;

/// Returns the area of a ring, negative if its inside is on the right.
pub(super) fn area(ring: &[[f64; 2]]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    let pairs = ring.iter().zip(next);
    0.5 * pairs.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

/// Returns a ring with its inside on the left.
pub(super) fn turned_left(mut ring: Ring) -> Ring {
    if area(&ring) < 0.0 {
        ring.reverse();
    }
    ring
}

/// Returns what a rule leaves of rings and of others, whose insides are on their left: shapes of an outline and its holes each.
///
/// On a grid of 2⁶² steps, so that crossings are sound. O(n log n) for n vertices.
pub(super) fn overlay(rings: &[Ring], others: &[Ring], rule: OverlayRule) -> Vec<Vec<Ring>> {
    let mut options = OverlayOptions::default();
    options.preserve_output_collinear = true;
    let mut overlay = FloatOverlay::<[f64; 2], i64>::from_subj_and_clip_custom(
        rings,
        others,
        options,
        Solver::default(),
    );
    overlay.overlay(rule, FillRule::NonZero)
}

/// Returns a point and the normal of a polygon's plane.
pub(super) fn plane(outline: &Loop) -> Option<(DVec3, DVec3)> {
    let origin = *outline.first()?;
    let next = outline.iter().cycle().skip(1);
    let pairs = outline.iter().zip(next);
    let area: DVec3 = pairs.map(|(a, b)| (a - origin).cross(b - origin)).sum();
    let normal = area.try_normalize()?;
    Some((origin, normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(x: [f64; 2], z: [f64; 2]) -> Loop {
        let corners = [[x[0], z[0]], [x[1], z[0]], [x[1], z[1]], [x[0], z[1]]];
        corners.map(|[x, z]| DVec3::new(x, 7.0, z)).to_vec()
    }

    fn area_left(outline: &Loop, holes: &[Loop]) -> f64 {
        let (mut cutter, mut draft) = (Cutter::default(), Draft::default());
        cutter.cut(outline, holes, &mut draft);
        let (points, triangles) = draft;
        let area = |t: &[u32]| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| DVec3::from(points[i as usize]));
            0.5 * (b - a).cross(c - a).length()
        };
        triangles.chunks_exact(3).map(area).sum()
    }

    #[test]
    fn a_door_at_the_floor_leaves_the_rest_of_its_wall() {
        let wall = rectangle([0.0, 4.0], [0.0, 3.0]);
        let door = rectangle([1.0, 2.0], [0.0, 2.0]);
        let window = rectangle([2.5, 3.5], [1.0, 2.0]);
        let left = area_left(&wall, &[door, window]);
        assert!((left - (12.0 - 2.0 - 1.0)).abs() < 1e-9, "{left}");
    }

    #[test]
    fn what_lies_outside_of_a_wall_takes_nothing_from_it() {
        // A wall around its door, which is told as well, and sticks out of the floor; a window twice; one of another wall.
        let mut wall = rectangle([0.0, 4.0], [0.0, 3.0]);
        let door = rectangle([1.0, 2.0], [0.0, 2.0]);
        wall.splice(1..1, [door[0], door[3], door[2], door[1]]);
        let low = rectangle([1.0, 2.0], [-0.1, 2.0]);
        let window = rectangle([2.5, 3.5], [1.0, 2.0]);
        let again = rectangle([2.6, 3.6], [1.0, 2.0]);
        let far = rectangle([5.0, 6.0], [0.0, 2.0]);
        let left = area_left(&wall, &[low, window, again, far]);
        assert!((left - (12.0 - 2.0 - 1.1)).abs() < 1e-9, "{left}");
    }

    #[test]
    fn a_line_to_a_hole_and_back_is_no_edge() {
        let mut wall = rectangle([0.0, 4.0], [0.0, 3.0]);
        let mut hole = rectangle([1.0, 2.0], [1.0, 2.0]);
        hole.reverse();
        let bridge = [hole.clone(), vec![hole[0], wall[0]]].concat();
        wall.splice(1..1, bridge);
        assert!((area_left(&wall, &[]) - 11.0).abs() < 1e-12);
        // And with a door cut from it.
        let door = rectangle([3.0, 3.5], [0.0, 2.0]);
        let left = area_left(&wall, &[door]);
        assert!((left - 10.0).abs() < 1e-9, "{left}");
    }
}
