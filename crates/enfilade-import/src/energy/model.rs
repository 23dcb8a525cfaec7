//! Surfaces, openings and spaces as both formats have them, and their way into the scene.

use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{DMat4, DVec2, DVec3};

use crate::ImportError;
use crate::builder::{Builder, Placement};
use crate::options::Up;
use crate::polygon::MAX_CORNERS;
use crate::soup;

/// A closed line. [Units: those of the file, Z up]
pub(super) type Loop = Vec<DVec3>;

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
}

/// A space: a room of the truth.
pub(super) struct Space {
    pub(super) id: String,
    pub(super) name: String,
    /// Polygons around it.
    pub(super) shell: Vec<Loop>,
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
        for sheet in self.sheets.iter().filter(|s| s.class != Class::Air) {
            let place = format!("surface '{}'", soup::shortened(&sheet.id));
            let mesh = cutter.mesh(
                [(&sheet.outline, &sheet.holes)].into_iter(),
                &place,
                builder,
            )?;
            let name = format!("{}/{}", sheet.class.name(), sheet.id);
            put(builder, mesh, &name, "", base, &place)?;
        }
        for space in &self.spaces {
            let place = format!("space '{}'", soup::shortened(&space.id));
            let loops = space.shell.iter().map(|l| (l, NO_HOLES));
            let mesh = cutter.mesh(loops, &place, builder)?;
            let extras = serde_json::json!({ "ifc": { "Name": space.name } }).to_string();
            let name = format!("IfcSpace/{}", space.id);
            put(builder, mesh, &name, &extras, base, &place)?;
        }
        Ok(())
    }
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
    /// Returns one mesh of some polygons. Holes leave them also where they touch their edge, as doors do.
    fn mesh<'l>(
        &mut self,
        polygons: impl Iterator<Item = (&'l Loop, &'l Vec<Loop>)>,
        place: &str,
        builder: &mut Builder<'_>,
    ) -> Result<Draft, ImportError> {
        let (mut positions, mut indices) = (Vec::new(), Vec::new());
        for (outline, holes) in polygons {
            let n = outline.len() + holes.iter().map(Vec::len).sum::<usize>();
            if n > MAX_CORNERS {
                return Err(builder.malformed(
                    place,
                    format!("a polygon of {n} vertices; at most {MAX_CORNERS} are read: split it"),
                ));
            }
            let first = positions.len() as u32;
            let mut loops = vec![outline];
            loops.extend(holes.iter().filter(|h| h.len() >= 3));
            positions.extend(loops.iter().copied().flatten().map(DVec3::to_array));
            self.split(&loops);
            indices.extend(self.triangles.iter().map(|i| first + i));
        }
        Ok((positions, indices))
    }

    /// Cuts the first loop without the others, in the plane of its area vector. Nothing is left of one without an area.
    fn split(&mut self, loops: &[&Loop]) {
        self.triangles.clear();
        let Some((origin, normal)) = plane(loops[0]) else {
            return;
        };
        let (u, v) = normal.any_orthonormal_pair();
        let flat = |p: &DVec3| DVec2::new((*p - origin).dot(u), (*p - origin).dot(v)).to_array();
        let points: Vec<[f64; 2]> = loops.iter().copied().flatten().map(flat).collect();
        let mut starts = Vec::new();
        let mut n = 0;
        for part in &loops[..loops.len() - 1] {
            n += part.len();
            starts.push(n as u32);
        }
        (self.ears).earcut(points.iter().copied(), &starts, &mut self.triangles);
        let area = |t: &[u32]| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| DVec2::from_array(points[i as usize]));
            (b - a).perp_dot(c - a)
        };
        for t in self.triangles.chunks_exact_mut(3) {
            if area(t) < 0.0 {
                t.swap(1, 2);
            }
        }
    }
}

/// Returns a point and the normal of a polygon's plane.
fn plane(outline: &Loop) -> Option<(DVec3, DVec3)> {
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

    #[test]
    fn a_door_at_the_floor_leaves_the_rest_of_its_wall() {
        let rectangle = |x: [f64; 2], z: [f64; 2]| -> Loop {
            let at = |x, z| DVec3::new(x, 7.0, z);
            vec![
                at(x[0], z[0]),
                at(x[1], z[0]),
                at(x[1], z[1]),
                at(x[0], z[1]),
            ]
        };
        let mut cutter = Cutter::default();
        let (wall, holes) = (
            rectangle([0.0, 4.0], [0.0, 3.0]),
            vec![
                rectangle([1.0, 2.0], [0.0, 2.0]),
                rectangle([2.5, 3.5], [1.0, 2.0]),
            ],
        );
        let mut loops = vec![&wall];
        loops.extend(&holes);
        cutter.split(&loops);
        let points: Vec<DVec3> = loops.into_iter().flatten().copied().collect();
        let area = |t: &[u32]| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| points[i as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        let left: f64 = cutter.triangles.chunks_exact(3).map(area).sum();
        assert!((left - (12.0 - 2.0 - 1.0)).abs() < 1e-12, "{left}");
    }
}
