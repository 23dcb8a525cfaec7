//! Exact lines of sight per pixel, to separate losses by culling from rounding by the adapter.
//!
//! Adapters round vertices to a grid of 1/256 pixel before they fill triangles. Where two triangles share an edge, or a
//! hidden one ends at it, rounding decides which of them a pixel on that edge shows; and pictures with more
//! triangles have more such edges. So each differing pixel is tested by a ray in 64-bit arithmetic: it counts as lost
//! unless the ray, moved by less than a 64th of a pixel, confirms the drawn surface.

use enfilade_cpg::World;
use enfilade_geom::scene::Primitive;
use enfilade_geom::{Bvh, DMat4, DVec3, Ray, Triangle};
use enfilade_runtime::{DetailId, Sight, SightState};

use crate::camera::Camera;
use crate::ids::{LostPixel, PixelContent};
use crate::materials::{Look, looks_of};
use crate::scene::plug;

/// Distance by which a line of sight is moved: slightly more than the rounding of adapters. [Units: px]
const NUDGE: f64 = 1.0 / 64.0;

/// Opaque and transparent triangles, each with its object in id pictures.
struct Layers {
    bvhs: [Bvh; 2],
    keys: [Vec<PixelContent>; 2],
}

/// Layers in construction.
struct LayersBuilder<'w> {
    looks: &'w [Look],
    triangles: [Vec<Triangle>; 2],
    keys: [Vec<PixelContent>; 2],
}

impl<'w> LayersBuilder<'w> {
    fn new(looks: &'w [Look]) -> Self {
        Self {
            looks,
            triangles: Default::default(),
            keys: Default::default(),
        }
    }

    fn add(
        &mut self,
        primitive: &Primitive,
        indices: &[u32],
        place: &dyn Fn(DVec3) -> DVec3,
        key: &dyn Fn(u32) -> PixelContent,
    ) {
        let look = (primitive.material).and_then(|m| self.looks.get(m as usize));
        let to = usize::from(look.is_some_and(|l| l.is_transparent));
        for (i, t) in (0..).zip(indices.chunks_exact(3)) {
            let corners = [0, 1, 2].map(|k| place(dvec(primitive.positions[t[k] as usize])));
            self.triangles[to].push(corners);
            self.keys[to].push(key(i));
        }
    }

    fn finish(self) -> Layers {
        Layers {
            bvhs: self.triangles.map(|t| Bvh::build(&t)),
            keys: self.keys,
        }
    }
}

/// The triangles of a world, for exact lines of sight.
///
/// Memory: about 200 bytes per triangle. A query takes microseconds.
pub struct Oracle<'w> {
    world: &'w World,
    looks: Vec<Look>,
    /// For each detail mesh, the index of its first triangle.
    first_of_mesh: Vec<u32>,
    /// Fixed triangles, and those that a state has moved or added.
    layers: [Layers; 2],
    tolerance: f64,
}

fn dvec(p: [f32; 3]) -> DVec3 {
    DVec3::new(p[0].into(), p[1].into(), p[2].into())
}

impl<'w> Oracle<'w> {
    /// Prepares a world as modeled; `sight`, built from the same world, numbers the triangles as pictures do.
    #[must_use]
    pub fn new(world: &'w World, sight: &Sight) -> Self {
        let looks = looks_of(world);
        let mut filling = LayersBuilder::new(&looks);
        let mut n = 0;
        for (i, batch) in (0..).zip(&world.batches) {
            let indices = sight.indices(i);
            let key = |t| PixelContent::Structure { triangle: n + t };
            filling.add(&batch.primitive, indices, &|p| p, &key);
            n += indices.len() as u32 / 3;
        }
        let mut first_of_mesh = Vec::new();
        for mesh in &world.detail_meshes {
            first_of_mesh.push(n);
            let primitives = mesh.primitives.iter();
            n += primitives.map(|p| p.indices.len() as u32 / 3).sum::<u32>();
        }
        for detail in (0..).map(DetailId).take(world.details.len()) {
            if sight.portals_of(detail).next().is_none() {
                add_detail(&mut filling, world, &first_of_mesh, detail, None);
            }
        }
        let stays = filling.finish();
        let moves = moving(
            world,
            &looks,
            &first_of_mesh,
            sight,
            &SightState::new(sight),
        );
        Self {
            world,
            looks,
            first_of_mesh,
            layers: [stays, moves],
            tolerance: sight.tolerance(),
        }
    }

    /// Moves leaves as `state` has them, and adds plugs to shut portals. Linear in their triangles.
    pub fn follow(&mut self, sight: &Sight, state: &SightState) {
        let (world, looks) = (self.world, &self.looks);
        self.layers[1] = moving(world, looks, &self.first_of_mesh, sight, state);
    }

    /// Returns `true` if the eye is so close to a surface that the near plane cuts it.
    #[must_use]
    pub fn is_at_surface(&self, eye: [f32; 3]) -> bool {
        let near = f64::from(Camera::NEAR) * 8.0;
        (self.layers.iter().flat_map(|l| &l.bvhs)).any(|b| b.nearest(dvec(eye), near).is_some())
    }

    /// Returns `true` if the surface drawn at a pixel, `found` meters away along the view direction (infinity for
    /// the sky), is right up to a shift of less than a 64th of a pixel. `at` is column and row of a picture of
    /// `size`; transparent surfaces are tested apart from opaque ones.
    #[must_use]
    pub fn is_right(
        &self,
        camera: &Camera,
        at: [u32; 2],
        size: [u32; 2],
        found: f64,
        is_transparent: bool,
    ) -> bool {
        let same = |a: f64, b: f64| {
            if a.is_infinite() || b.is_infinite() {
                return a == b;
            }
            // Rounding of positions, and of depths in 32 bits.
            (a - b).abs() <= 2.0 * self.tolerance + 4e-6 * a
        };
        if same(
            self.distance(camera, at, [0.0; 2], size, is_transparent),
            found,
        ) {
            return true;
        }
        // Nearby, the position where the ray meets an oblique surface moves as well.
        let near = |a: f64, b: f64| same(a, b) || (a - b).abs() <= 0.02 * a.min(b);
        around().any(|nudge| {
            near(
                self.distance(camera, at, nudge, size, is_transparent),
                found,
            )
        })
    }

    /// Returns `true` if a differing pixel is lost: it shows a wrong surface, and the expected one is more than a
    /// crack.
    #[must_use]
    pub fn is_lost(
        &self,
        camera: &Camera,
        pixel: &LostPixel,
        size: [u32; 2],
        is_transparent: bool,
    ) -> bool {
        let found = f64::from(Camera::distance_of(pixel.found.1));
        !self.is_right(camera, pixel.at, size, found, is_transparent)
            && self.is_met(camera, pixel.at, size, pixel.expected.0, is_transparent)
    }

    /// Returns `true` if an exact ray through the center of the pixel meets `shown` first, alone or among several
    /// at the same place, and so do rays moved by a 64th of a pixel and twice the world's tolerance, in at least
    /// three of eight directions, where opposite directions count as one.
    ///
    /// A surface visible only at the center, or only along a line through it, is seen through a slit between
    /// triangles. Such slits arise where vertices are rounded, by the adapter or to 32 bits, or move within the
    /// tolerance. A world promises nothing about them.
    #[must_use]
    pub fn is_met(
        &self,
        camera: &Camera,
        at: [u32; 2],
        size: [u32; 2],
        shown: PixelContent,
        is_transparent: bool,
    ) -> bool {
        let [right, up, _] = camera.axes().map(|v| dvec(v.to_array()));
        let met = |nudge: [f64; 2], aside: f64| {
            // Rows run downwards.
            let by = (right * nudge[0] - up * nudge[1]) * (aside / NUDGE);
            let ray = ray_through(camera, at, nudge, size);
            let origin = ray.origin + by;
            self.is_met_by(&Ray { origin, ..ray }, shown, is_transparent)
        };
        let nudges: Vec<[f64; 2]> = around().collect();
        let half = nudges.len() / 2;
        let aside = 2.0 * self.tolerance;
        let is_way = |i: &usize| met(nudges[*i], aside) || met(nudges[i + half], aside);
        met([0.0; 2], 0.0) && (0..half).filter(is_way).nth(2).is_some()
    }

    fn is_met_by(&self, ray: &Ray, shown: PixelContent, is_transparent: bool) -> bool {
        let first = self.first_on(ray, is_transparent);
        if first.is_infinite() {
            return shown == PixelContent::Sky;
        }
        let ray = Ray {
            t_max: first + 1e-6 * (first + f64::from(Camera::NEAR)),
            ..*ray
        };
        let mut is_met = false;
        for Layers { bvhs, keys } in &self.layers {
            let layer = usize::from(is_transparent);
            bvhs[layer].for_each_hit(&ray, |hit| {
                is_met |= keys[layer][hit.triangle as usize] == shown;
            });
        }
        is_met
    }

    /// Returns the distance of the first surface along the view direction. [Units: wu]
    fn distance(
        &self,
        camera: &Camera,
        at: [u32; 2],
        nudge: [f64; 2],
        size: [u32; 2],
        is_transparent: bool,
    ) -> f64 {
        let ray = ray_through(camera, at, nudge, size);
        self.first_on(&ray, is_transparent) + f64::from(Camera::NEAR)
    }

    /// Returns the position where a ray meets the first surface, in lengths of the view direction from the near
    /// plane on.
    fn first_on(&self, ray: &Ray, is_transparent: bool) -> f64 {
        let first = |layer: usize| {
            let hits = self.layers.iter().map(|l| &l.bvhs[layer]);
            let hits = hits.filter_map(|b| b.closest_hit(ray, |_| false));
            hits.map(|h| h.t).fold(f64::INFINITY, f64::min)
        };
        let solid = first(0);
        if !is_transparent {
            return solid;
        }
        let t = first(1);
        if t < solid { t } else { f64::INFINITY }
    }
}

/// Builds the layers of leaves and plugs.
fn moving(
    world: &World,
    looks: &[Look],
    first_of_mesh: &[u32],
    sight: &Sight,
    state: &SightState,
) -> Layers {
    let mut filling = LayersBuilder::new(looks);
    for detail in (0..).map(DetailId).take(world.details.len()) {
        if sight.portals_of(detail).next().is_some() {
            let pose = state.pose(detail);
            add_detail(&mut filling, world, first_of_mesh, detail, pose);
        }
    }
    for portal in state.shut_portals() {
        let plug = plug(world, sight, portal);
        let key = |_| PixelContent::Plug { portal };
        filling.add(&plug, &plug.indices, &|p| p, &key);
    }
    filling.finish()
}

/// Adds a detail object moved by `pose`.
fn add_detail(
    filling: &mut LayersBuilder<'_>,
    world: &World,
    first_of_mesh: &[u32],
    id: DetailId,
    pose: Option<DMat4>,
) {
    let object = &world[id];
    let own = object.placement();
    let m = pose.map_or(own, |pose| pose * own);
    let mut n = first_of_mesh[object.mesh as usize];
    for primitive in &world.detail_meshes[object.mesh as usize].primitives {
        let key = |t| PixelContent::Detail {
            detail: id.0,
            triangle: n + t,
        };
        filling.add(
            primitive,
            &primitive.indices,
            &|p| m.transform_point3(p),
            &key,
        );
        n += primitive.indices.len() as u32 / 3;
    }
}

/// Returns sixteen offsets around the center of a pixel.
fn around() -> impl Iterator<Item = [f64; 2]> {
    (0..16).map(|i| {
        let angle = (f64::from(i) + 0.31) * std::f64::consts::FRAC_PI_8;
        [angle.cos() * NUDGE, angle.sin() * NUDGE]
    })
}

/// Returns a ray that starts at the near plane and whose direction has length 1 along the view direction.
fn ray_through(camera: &Camera, at: [u32; 2], nudge: [f64; 2], size: [u32; 2]) -> Ray {
    let [right, up, forward] = camera.axes().map(|v| dvec(v.to_array()));
    let tan = f64::from(camera.fov_y * 0.5).tan();
    let [w, h] = size.map(f64::from);
    let x = (f64::from(at[0]) + 0.5 + nudge[0]) / w * 2.0 - 1.0;
    let y = 1.0 - (f64::from(at[1]) + 0.5 + nudge[1]) / h * 2.0;
    let direction = forward + right * (x * tan * w / h) + up * (y * tan);
    Ray {
        origin: dvec(camera.eye) + direction * f64::from(Camera::NEAR),
        direction,
        t_max: f64::INFINITY,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_cpg::Batch;

    /// A wall 5 m ahead, from x = 0 to the right.
    fn wall() -> World {
        let primitive = Primitive {
            positions: vec![
                [0.0, -9.0, -5.0],
                [9.0, -9.0, -5.0],
                [9.0, 9.0, -5.0],
                [0.0, 9.0, -5.0],
            ],
            indices: vec![0, 1, 2, 0, 2, 3],
            ..Primitive::default()
        };
        World {
            batches: vec![Batch {
                primitive,
                ..Batch::default()
            }],
            ..World::default()
        }
    }

    fn oracle(world: &World) -> Oracle<'_> {
        Oracle::new(world, &Sight::build(world).unwrap())
    }

    #[test]
    fn only_what_an_exact_ray_shows_is_right() {
        let world = wall();
        let oracle = oracle(&world);
        // 4 pixels wide: the wall's edge lies between the second and the third.
        let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
        let right = |x, d| oracle.is_right(&camera, [x, 2], [4, 4], d, false);
        assert!(right(2, 5.0) && !right(2, f64::INFINITY) && !right(2, 4.0));
        assert!(right(1, f64::INFINITY) && !right(1, 5.0));
    }

    #[test]
    fn on_an_edge_both_sides_are_right() {
        let world = wall();
        let oracle = oracle(&world);
        let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
        // 5 pixels: the center of the third lies on the edge.
        for d in [5.0, f64::INFINITY] {
            assert!(oracle.is_right(&camera, [2, 2], [5, 5], d, false));
        }
        assert!(!oracle.is_right(&camera, [2, 2], [5, 5], 7.0, false));
    }

    #[test]
    fn what_is_behind_a_wall_is_not_met() {
        let world = wall();
        let oracle = oracle(&world);
        let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
        let met = |x, shown| oracle.is_met(&camera, [x, 2], [4, 4], shown, false);
        // Chunks reorder the two triangles.
        let wall = [0, 1].map(|triangle| PixelContent::Structure { triangle });
        assert!(wall.iter().any(|&t| met(2, t)) && !met(2, PixelContent::Sky));
        assert!(met(1, PixelContent::Sky) && !wall.iter().any(|&t| met(1, t)));
        assert!(!met(2, PixelContent::Structure { triangle: 9 }));
    }

    #[test]
    fn what_is_seen_through_a_slit_is_not_met() {
        // Two walls 5 m ahead with a leaning slit between them, and a third behind.
        let slit = |width: f32| {
            let wall = |edge: [f32; 2], x: f32, z: f32| Batch {
                primitive: Primitive {
                    positions: vec![
                        [x, -9.0, z],
                        [edge[0], -9.0, z],
                        [edge[1], 9.0, z],
                        [x, 9.0, z],
                    ],
                    indices: vec![0, 1, 2, 0, 2, 3],
                    ..Primitive::default()
                },
                ..Batch::default()
            };
            // Parallel to one of the tested directions.
            let (a, b) = (2.5 - width * 0.5, -2.5 - width * 0.5);
            World {
                batches: vec![
                    wall([a, b], -9.0, -5.0),
                    wall([a + width, b + width], 9.0, -5.0),
                    wall([30.0; 2], -30.0, -6.0),
                ],
                ..World::default()
            }
        };
        let camera = Camera::looking_at([0.0; 3], [0.0, 0.0, -1.0]);
        // The center of the third of 5 pixels, each 2 m wide there; a 64th of one is 3 cm.
        for (width, is_there) in [(0.004, false), (0.06, true)] {
            let world = slit(width);
            let oracle = oracle(&world);
            let behind = [4, 5].map(|triangle| PixelContent::Structure { triangle });
            let met = |t: &PixelContent| oracle.is_met(&camera, [2, 2], [5, 5], *t, false);
            assert_eq!(behind.iter().any(met), is_there, "{width}");
        }
        // 10 cm before the wall, a pixel is smaller than the tolerance, by which walls may be off.
        let camera = Camera::looking_at([0.0, 0.0, -4.9], [0.0, 0.0, -6.0]);
        let tolerance = oracle(&slit(1.0)).tolerance;
        for (width, is_there) in [(tolerance, false), (4.0 * tolerance, true)] {
            let world = slit(width as f32);
            let oracle = oracle(&world);
            let behind = [4, 5].map(|triangle| PixelContent::Structure { triangle });
            let met = |t: &PixelContent| oracle.is_met(&camera, [1000; 2], [2001; 2], *t, false);
            assert_eq!(behind.iter().any(met), is_there, "{width}");
        }
    }

    #[test]
    fn an_eye_at_a_wall_is_known() {
        let world = wall();
        let oracle = oracle(&world);
        assert!(oracle.is_at_surface([1.0, 0.0, -4.99999]));
        assert!(!oracle.is_at_surface([1.0, 0.0, -4.9]));
    }
}
