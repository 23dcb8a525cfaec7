//! Leaves for the doorways of a generated world.

use enfilade_cpg::{CellId, DetailObject, Fitting, FittingPart, Motion, MotionKind, World};
use enfilade_geom::scene::{Material, Mesh, Primitive};
use enfilade_geom::{Aabb, DVec3};

use super::world::box_indices;

/// Half the thickness of a leaf, and the distance of its middle from the portal's plane. [Units: wu]
const HALF: f64 = 0.02;
const OFF: f64 = 0.06;
/// Minimum height of an opening with a leaf. [Units: wu]
const LEAST_HEIGHT: f64 = 1.5;

/// Adds to `world` a leaf in each upright opening that is high enough: a plate that fills it, shut, 6 cm off the portal's
/// plane on the side of its second cell; it turns by a right angle to that side. Leaves are of glass where `is_glass(portal)`
/// is `true`. The walls of the world must lie along x and z.
#[must_use]
pub fn with_doors(mut world: World, is_glass: impl Fn(usize) -> bool) -> World {
    world.materials.push(Material {
        name: "glass".into(),
        transparent: true,
        ..Material::default()
    });
    let glass = world.materials.len() as u32 - 1;
    for i in 0..world.graph.portals.len() {
        let portal = &world.graph.portals[i];
        let normal = DVec3::from(portal.normal.map(f64::from));
        let corners = portal.outline.iter().map(|p| DVec3::from(p.map(f64::from)));
        let hole = Aabb::of_points(&corners.collect::<Vec<_>>());
        if normal.y.abs() > 0.1 || hole.size().y < LEAST_HEIGHT {
            continue;
        }
        let across = DVec3::Y.cross(normal).normalize();
        let (u, v) = (
            across * across.abs().dot(hole.size()),
            DVec3::Y * hole.size().y,
        );
        let hinge = hole.center() - (u + v) * 0.5 + normal * (OFF + HALF);
        let plate = plate(hinge, u, v, normal * (-2.0 * HALF));
        let cells: Vec<CellId> = {
            let mut cells = Vec::new();
            for triangle in plate.triangles() {
                world.graph.locator.cells_touching(&triangle, &mut cells);
            }
            cells
        };
        for c in &cells {
            world.graph.cells[c.0 as usize].n_detail_triangles += 12;
        }
        let detail = world.details.len() as u32;
        world.details.push(DetailObject {
            name: format!("leaf of portal {i}"),
            mesh: world.detail_meshes.len() as u32,
            transform: std::array::from_fn(|k| f32::from(u8::from(k % 5 == 0))),
            cells,
            source: None,
            part_of: None,
        });
        world.detail_meshes.push(Mesh {
            name: "leaf".into(),
            primitives: vec![Primitive {
                material: is_glass(i).then_some(glass),
                ..plate
            }],
        });
        // Seen from above, `across` turned to the right is the normal.
        let motion = Motion {
            kind: MotionKind::Turn {
                through: hinge.as_vec3().to_array(),
                axis: [0.0, 1.0, 0.0],
            },
            shut: 0.0,
            open: -std::f32::consts::FRAC_PI_2,
        };
        world.graph.portals[i].fittings.push(Fitting {
            detail,
            part: FittingPart::Leaf,
            motion: Some(motion),
        });
    }
    world
}

/// The box at a vertex along three directions.
fn plate(corner: DVec3, u: DVec3, v: DVec3, w: DVec3) -> Primitive {
    let at = |k: usize| {
        let bit = |b: usize| f64::from(u8::from(k & b != 0));
        corner + u * bit(1) + v * bit(2) + w * bit(4)
    };
    Primitive {
        positions: (0..8).map(|k| at(k).as_vec3().to_array()).collect(),
        indices: box_indices(),
        ..Primitive::default()
    }
}
