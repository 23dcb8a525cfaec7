//! The thing at the pointer: straight ahead, or as a mirror or a link shows it.

use enfilade::geom::DVec3;
use enfilade::runtime::Target;
use enfilade::world::{PartId, SightRay, Space, TraceEnd};
use enfilade_render::Camera;

/// Distance up to which the cell ahead is named. [Units: wu]
pub(super) const FAR: f32 = 1000.0;

/// A surface at the pointer.
#[derive(Clone, Copy)]
pub(super) struct PointedAt {
    pub(super) part: PartId,
    pub(super) target: Target,
    /// Point and unit normal, in the frame of the root.
    pub(super) at: DVec3,
    pub(super) normal: DVec3,
}

/// The end of a ray from an eye.
pub(super) struct Pointed {
    /// The surface, if one is near enough.
    pub(super) hit: Option<PointedAt>,
    /// The camera from where the ray leaves the last special portal, along it; otherwise the eye's own.
    pub(super) ray: Camera,
}

impl Pointed {
    /// Follows the direction of a camera in the root's frame, up to `most` times its length.
    pub(super) fn at(space: &Space, camera: &Camera, most: f32) -> Self {
        let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let by = vector(camera.toward) * f64::from(most);
        let ray = SightRay::new(PartId::ROOT, vector(camera.eye), by);
        let Ok(traced) = space.pick(&ray, &mut Vec::new()) else {
            let ray = *camera;
            return Self { hit: None, ray };
        };
        let mut ray = *camera;
        if traced.n_passed > 0 {
            let to_root = space.between(traced.frame, PartId::ROOT);
            ray.eye = to_root.point(traced.since).as_vec3().to_array();
            let toward = to_root.direction(traced.map.direction(vector(camera.toward)));
            ray.toward = toward.as_vec3().to_array();
        }
        let hit = match traced.end {
            TraceEnd::Surface((part, hit)) => {
                let pose = space.pose(part);
                Some(PointedAt {
                    part,
                    target: hit.target,
                    at: pose.point(vector(hit.position)),
                    normal: pose.direction(vector(hit.normal)),
                })
            }
            _ => None,
        };
        Self { hit, ray }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::bake::edit::special::SpecialSpot;
    use enfilade::cpg::PortalId;
    use enfilade::internals::bake::edit::special::mirror;
    use enfilade_render::portal_looked_at;
    use enfilade_testkit::{GridParams, room_grid};

    #[test]
    fn the_pointer_in_a_mirror_picks_the_doorway_that_it_shows() {
        let mut world = room_grid(&GridParams {
            size: [2, 1, 1],
            doors: 1.0,
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(1, 1)
        });
        let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
        let portal = world.graph.portals[0].clone();
        let [low, high] = world.graph[portal.cells[0]].aabb.map(vector);
        let corners = portal.outline.iter().map(|p| vector(*p));
        let door = corners.sum::<DVec3>() / portal.outline.len() as f64;
        // The wall across from the doorway, which is at larger x.
        let corner = |y: f64, z: f64| DVec3::new(low.x, y, z);
        let wall = [
            corner(low.y, low.z),
            corner(high.y, low.z),
            corner(high.y, high.z),
            corner(low.y, high.z),
        ];
        let eye = DVec3::new(low.x + 1.0, door.y, (low.z + high.z) * 0.5);
        // The doorway seems to be behind the wall.
        let seems = DVec3::new(2.0 * low.x - door.x, door.y, door.z);
        let camera = Camera {
            eye: eye.as_vec3().to_array(),
            toward: (seems - eye).normalize().as_vec3().to_array(),
            fov_y: 1.0,
        };
        let found = |world: &enfilade::cpg::World| {
            let space = Space::new(world.clone()).unwrap();
            let pointed = Pointed::at(&space, &camera, 50.0);
            portal_looked_at(&space, &pointed.ray).map(|f| f.1)
        };
        assert_eq!(found(&world), None);
        mirror(&mut world, &SpecialSpot::Wall(wall.to_vec())).unwrap();
        assert_eq!(found(&world), Some(PortalId(0)));
    }
}
