//! Openings that a designer marked: by objects of their own, or as the format says.

use enfilade_geom::scene::{GivenPortal, Mesh, Primitive};
use enfilade_geom::{DMat4, DVec3, Rectangle, Triangle, facing, triangle_area_normal};

use super::{Builder, Placement};
use crate::ImportError;

impl Builder<'_> {
    /// Keeps openings that a designer marked.
    pub(crate) fn add_given_portals(&mut self, portals: Vec<GivenPortal>) {
        self.scene.given_portals.extend(portals);
    }

    /// Keeps the rectangles in the middle of objects as marked openings.
    pub(super) fn mark_openings(&mut self, placement: &Placement<'_>) -> Result<(), ImportError> {
        let [own, of_mesh] = placement.names;
        let name = if own.is_empty() { of_mesh } else { own };
        let n_bytes = size_of::<GivenPortal>() + 4 * size_of::<DVec3>() + name.len();
        let n_placed = placement.transforms.len() as u64;
        self.charge_memory(placement.place, n_placed, n_bytes as u64)?;
        for &transform in placement.transforms {
            let primitives = self.primitives(placement.mesh);
            let n_triangles: usize = primitives.iter().map(|p| p.indices.len() / 3).sum();
            self.spend(placement.place, n_triangles as u64)?;
            let around = rectangle_around(self.primitives(placement.mesh), transform);
            let [half, other] = around.middle();
            let Some(normal) = triangle_area_normal(&half).try_normalize() else {
                self.note(placement.place, "a mark of an opening without an area");
                continue;
            };
            self.scene.given_portals.push(GivenPortal {
                name: name.to_owned(),
                outline: [&half[..], &other[2..]].concat(),
                normal,
                thickness: around.size().z,
            });
        }
        Ok(())
    }
}

/// Returns the least extent of a mesh along its own axes, over all its placements. [Units: wu]
pub(super) fn thickness(mesh: &Mesh, transforms: &[DMat4]) -> f64 {
    let sizes = transforms
        .iter()
        .map(|&t| rectangle_around(&mesh.primitives, t).size());
    sizes.map(DVec3::min_element).fold(f64::INFINITY, f64::min)
}

fn rectangle_around(primitives: &[Primitive], transform: DMat4) -> Rectangle {
    let placed = primitives
        .iter()
        .flat_map(|p| p.placed_triangles(transform));
    let triangles: Vec<Triangle> = placed.collect();
    Rectangle::around(facing(&triangles), triangles.as_flattened())
}
