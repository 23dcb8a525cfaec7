//! Pictures of worlds with special portals by tracing rays, to hold renderers against: flat polygons and matrices, without
//! cells, views or depth buffers.
//!
//! Worlds are [painted](painted): each triangle emits one plain color and nothing is lit, so a pixel tells what it shows. A
//! pixel whose color is the same a fiftieth of a pixel away in each direction is *decided*: a renderer must have exactly this
//! color there. At other pixels, an edge passes, and rounding may show either side.

use enfilade_cpg::{MonitorCamera, SpecialId, Way, World};
use enfilade_geom::scene::Material;
use enfilade_geom::{Bvh, DMat3, DVec3, Ray, Triangle};

use enfilade_demo::Rng;

/// Distance of the samples that must agree. [Units: px]
const JITTER: f64 = 0.02;

/// Longest chain of special portals followed.
const DEEPEST: usize = 8;

/// Relative distance of two surfaces between which rounding decides.
const COINCIDENT: f64 = 2e-4;

/// Relative distance of a special portal and a surface between which rounding decides.
const IN_WALL: f64 = 5e-5;

/// Distances behind a special portal's plane up to which surfaces count as in it, and so as before it, and from which on as
/// behind it: rounding decides between. [Units: wu]
const IN_PLANE: [f64; 2] = [5e-5, 3e-4];

/// Distance up to which an eye may be on either side of a surface: a few roundings of single precision. [Units: wu]
const AT_SURFACE: f64 = 1e-5;

/// Share of a monitor's picture within which its colors must agree.
const BLUR: f64 = 0.04;

/// The special portals and passes on the way to a surface.
pub type Chain = Vec<(u32, usize)>;

/// Returns the chains of the views of a frame. Each view is given by the view in which its special portal is seen, that portal and the
/// pass, or nothing for the first.
pub fn chains_of(vias: impl IntoIterator<Item = Option<(usize, u32, usize)>>) -> Vec<Chain> {
    let mut all: Vec<Chain> = Vec::new();
    for via in vias {
        let chain = via.map_or_else(Vec::new, |(parent, special, pass)| {
            let mut chain = all[parent].clone();
            chain.push((special, pass));
            chain
        });
        all.push(chain);
    }
    all
}

/// A camera: eye, axes right, up and forward, and tangents of half its angles across and up.
#[derive(Clone, Copy, Debug)]
pub struct TracedCamera {
    /// Position. [Units: wu]
    pub eye: DVec3,
    /// Unit vectors to the right, up and forward.
    pub axes: [DVec3; 3],
    /// Tangents of half the angles of view.
    pub tangents: [f64; 2],
}

/// A world for rays.
pub struct Traced {
    structure: Bvh,
    /// Linear color of each triangle. [Units: 1/255]
    colors: Vec<[u8; 3]>,
    specials: Vec<TracedSide>,
}

struct TracedSide {
    pieces: Vec<Vec<DVec3>>,
    normal: DVec3,
    passes: Vec<SidePass>,
}

struct SidePass {
    shows: Shows,
    tint: [f64; 4],
}

enum Shows {
    Through,
    /// Matrix and offset applied to a ray.
    Place(DMat3, DVec3),
    /// A camera, and a vertex and the edges of the rectangle that its picture fills.
    Monitor(TracedCamera, [DVec3; 3]),
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}

/// Returns the world with `n` colors, each triangle in one; neighbors seldom share theirs. All surfaces are opaque. Draw it at
/// night, without lamps and effects.
#[must_use]
pub fn painted(mut world: World, n: u32) -> World {
    let n = n.max(1);
    let mut rng = Rng::new(77);
    world.materials = (0..n)
        .map(|_| {
            let c = [0, 1, 2].map(|_| rng.range(20.0, 255.0).floor() / 255.0);
            Material {
                gltf: format!(
                    r#"{{"emissiveFactor":[{},{},{}],"pbrMetallicRoughness":{{"baseColorFactor":[0,0,0,1]}}}}"#,
                    c[0], c[1], c[2]
                ),
                double_sided: true,
                base_color: [0.0, 0.0, 0.0, 1.0],
                ..Material::default()
            }
        })
        .collect();
    (world.textures, world.images) = (Vec::new(), Vec::new());
    let batches = std::mem::take(&mut world.batches);
    for (b, batch) in (0..).zip(batches) {
        // Four colors a batch.
        for k in 0..4 {
            let mut own = batch.clone();
            own.sources = enfilade_cpg::SourceRuns::default();
            let triples = batch.primitive.triples().iter();
            let of_k = triples.enumerate().filter(|(i, _)| i % 4 == k);
            own.primitive.indices = of_k.flat_map(|(_, t)| *t).collect();
            own.primitive.colors.clear();
            own.primitive.material = Some((4 * b + k as u32) * 7 % n);
            if !own.primitive.indices.is_empty() {
                world.batches.push(own);
            }
        }
    }
    for (i, mesh) in (0..).zip(&mut world.detail_meshes) {
        for (k, primitive) in (0..).zip(&mut mesh.primitives) {
            primitive.colors.clear();
            primitive.material = Some((i * 3 + k * 5) % n);
        }
    }
    world
}

impl Traced {
    /// Prepares a [painted] world.
    ///
    /// # Panics
    ///
    /// If it is not painted.
    #[must_use]
    pub fn new(world: &World) -> Self {
        let palette: Vec<[u8; 3]> = world.materials.iter().map(emitted).collect();
        let (mut triangles, mut colors): (Vec<Triangle>, Vec<[u8; 3]>) = Default::default();
        let color = |m: Option<u32>| palette[m.expect("painted") as usize];
        for batch in &world.batches {
            let own = batch.primitive.triangles();
            colors.extend(std::iter::repeat_n(
                color(batch.primitive.material),
                own.len(),
            ));
            triangles.extend(own);
        }
        for detail in &world.details {
            let m = glam_matrix(&detail.transform);
            for primitive in &world.detail_meshes[detail.mesh as usize].primitives {
                let own = primitive.triangles().map(|t| t.map(|p| m.0 * p + m.1));
                colors.extend(std::iter::repeat_n(color(primitive.material), own.len()));
                triangles.extend(own);
            }
        }
        let specials = world.graph.special_ids();
        Self {
            structure: Bvh::build(&triangles),
            colors,
            specials: specials.map(|id| side(world, id)).collect(),
        }
    }

    /// Returns the bytes of a decided pixel. `at` is its place in a picture of `size`; `is_known` tells whether the renderer
    /// was to look into the special portals of a chain.
    pub fn pixel(
        &self,
        camera: &TracedCamera,
        at: [u32; 2],
        size: [u32; 2],
        is_known: &dyn Fn(&Chain) -> bool,
    ) -> Option<[u8; 3]> {
        let color = |dx: f64, dy: f64| {
            let [x, y] =
                [(0, dx), (1, dy)].map(|(k, d)| (f64::from(at[k]) + 0.5 + d) / f64::from(size[k]));
            let ray = camera.ray(x, y);
            let linear = self.color(ray, &mut Vec::new(), is_known)?;
            Some(linear.map(encoded))
        };
        let first = color(0.0, 0.0)?;
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let agrees = |[x, y]: [f64; 2]| color(x * JITTER, y * JITTER) == Some(first);
        corners.into_iter().all(agrees).then_some(first)
    }

    /// Returns the linear color along a ray; `None` if rounding decides.
    fn color(
        &self,
        mut ray: Ray,
        chain: &mut Chain,
        is_known: &dyn Fn(&Chain) -> bool,
    ) -> Option<[f64; 3]> {
        ray.t_max = f64::INFINITY;
        let wall = self.structure.closest_hit(&ray, |_| false);
        // On: a special portal may lie in a wall.
        ray.t_max = wall.map_or(f64::INFINITY, |hit| hit.t * (1.0 + IN_WALL));
        let wall_before = |i: usize, t: f64| {
            let along = self.specials[i].normal.dot(ray.direction);
            wall.is_some_and(|hit| (hit.t - t) * along < IN_PLANE[1] || hit.t < t * (1.0 + IN_WALL))
        };
        if let Some((t, i)) = self.special(&ray, None) {
            if wall_before(i, t) {
                return None;
            }
            ray.t_max = t * (1.0 + COINCIDENT);
            if self.special(&ray, Some(i)).is_some() {
                return None;
            }
            return self.color_in(i, &ray, t, chain, is_known);
        }
        let Some(hit) = wall else {
            return Some([0.0; 3]);
        };
        // A special portal in the wall, from the wall on.
        let on = Ray {
            origin: ray.origin + ray.direction * hit.t,
            direction: ray.direction,
            t_max: f64::INFINITY,
        };
        let is_in_wall = |(t, i): (f64, usize)| {
            let along = self.specials[i].normal.dot(ray.direction);
            t * along < IN_PLANE[1]
        };
        if self.special(&on, None).is_some_and(is_in_wall) {
            return None;
        }
        let color = self.colors[hit.triangle as usize];
        // Behind it, nothing of another color is as near.
        ray.t_max = hit.t * (1.0 + COINCIDENT);
        let other = self
            .structure
            .closest_hit(&ray, |id| self.colors[id as usize] == color);
        other.is_none().then(|| toned(color))
    }

    fn color_in(
        &self,
        special: usize,
        ray: &Ray,
        t: f64,
        chain: &mut Chain,
        is_known: &dyn Fn(&Chain) -> bool,
    ) -> Option<[f64; 3]> {
        if chain.len() == DEEPEST {
            return None;
        }
        let on = ray.origin + ray.direction * t;
        let mut out = [0.0; 3];
        for (pass, own) in self.specials[special].passes.iter().enumerate() {
            let mut shown = |own: &SidePass| {
                let mut next = Ray {
                    origin: on,
                    direction: ray.direction,
                    t_max: f64::INFINITY,
                };
                if let Shows::Through = own.shows {
                    next.origin = on + ray.direction * 1e-9;
                    return self.color(next, chain, is_known);
                }
                chain.push((special as u32, pass));
                let color = match &own.shows {
                    _ if !is_known(chain) => None,
                    Shows::Place(linear, offset) => {
                        next.origin = *linear * on + *offset;
                        next.direction = *linear * ray.direction;
                        let normal = (*linear * self.specials[special].normal).normalize();
                        let next = self.behind(next, normal);
                        next.and_then(|ray| self.color(ray, chain, is_known))
                    }
                    Shows::Monitor(camera, [corner, right, up]) => {
                        let [u, v] =
                            [right, up].map(|edge| edge.dot(on - *corner) / edge.length_squared());
                        let at = |du: f64, dv: f64| {
                            self.color(
                                camera.ray(u + du, 1.0 - v + dv),
                                &mut chain.clone(),
                                is_known,
                            )
                        };
                        let first = at(0.0, 0.0);
                        let steps = [-BLUR, -0.5 * BLUR, 0.0, 0.5 * BLUR, BLUR];
                        let around: Vec<[f64; 2]> = (steps.iter())
                            .flat_map(|u| steps.map(|v| [*u, v]))
                            .collect();
                        first.filter(|_| around.iter().all(|[u, v]| at(*u, *v) == first))
                    }
                    Shows::Through => None,
                };
                chain.pop();
                color
            };
            let color = shown(own)?;
            let [r, g, b, share] = own.tint;
            let tint = [r, g, b];
            for k in 0..3 {
                let above = color[k] * tint[k];
                out[k] = if pass == 0 {
                    above
                } else {
                    out[k] * (1.0 - share) + above * share
                };
            }
        }
        Some(out)
    }

    /// Returns `true` if a surface is so near to a point that rounding decides which side of it is seen from there.
    #[must_use]
    pub fn is_in_surface(&self, p: DVec3) -> bool {
        self.structure.nearest(p, AT_SURFACE).is_some()
    }

    /// Returns a ray that begins in a plane, from behind the surfaces in it on; `None` if one is neither in it nor behind it.
    fn behind(&self, mut ray: Ray, normal: DVec3) -> Option<Ray> {
        let along = normal.dot(ray.direction).abs();
        let [first, last] = IN_PLANE.map(|distance| distance / along);
        ray.origin += ray.direction * first;
        ray.t_max = last - first;
        let is_clear = self.structure.closest_hit(&ray, |_| false).is_none();
        ray.t_max = f64::INFINITY;
        is_clear.then_some(ray)
    }

    /// Returns the special portal but one that a ray meets first, before `t_max`.
    fn special(&self, ray: &Ray, but: Option<usize>) -> Option<(f64, usize)> {
        let mut first: Option<(f64, usize)> = None;
        for (i, side) in self.specials.iter().enumerate() {
            let along = side.normal.dot(ray.direction);
            let t = side.normal.dot(side.pieces[0][0] - ray.origin) / along;
            if but == Some(i) || along <= 0.0 || t <= 1e-9 || t >= first.map_or(ray.t_max, |f| f.0)
            {
                continue;
            }
            let p = ray.origin + ray.direction * t;
            let is_in = side.pieces.iter().any(|piece| {
                let n = piece.len();
                (0..n).all(|k| {
                    let (a, b) = (piece[k], piece[(k + 1) % n]);
                    side.normal.cross(b - a).dot(p - a) > 0.0
                })
            });
            if is_in {
                first = Some((t, i));
            }
        }
        first
    }
}

impl TracedCamera {
    /// Returns the ray through a place of the picture, 0 to 1 from the upper left.
    fn ray(&self, x: f64, y: f64) -> Ray {
        let [right, up, forward] = self.axes;
        let [across, above] = self.tangents;
        Ray {
            origin: self.eye,
            direction: forward + right * (across * (2.0 * x - 1.0))
                - up * (above * (2.0 * y - 1.0)),
            t_max: f64::INFINITY,
        }
    }
}

fn side(world: &World, id: SpecialId) -> TracedSide {
    let (normal, pieces) = world.graph.special_opening(id);
    let pieces: Vec<Vec<DVec3>> = pieces.into_iter().map(|p| p.points).collect();
    let passes = world.graph.specials[id.idx()].passes.iter().map(|pass| {
        let shows = match &pass.way {
            Way::Through => Shows::Through,
            Way::Mirror => {
                let n = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
                let linear = DMat3::IDENTITY - n * 2.0;
                Shows::Place(linear, pieces[0][0] - linear * pieces[0][0])
            }
            Way::Lead { map, .. } => Shows::Place(DMat3::from_quat(map.turn) * map.scale, map.at),
            Way::Monitor(camera) => {
                let rectangle = rectangle(normal, &pieces);
                let aspect = rectangle[1].length() / rectangle[2].length();
                Shows::Monitor(traced_camera(camera, aspect), rectangle)
            }
        };
        SidePass {
            shows,
            tint: pass.tint.map(f64::from),
        }
    });
    TracedSide {
        passes: passes.collect(),
        normal,
        pieces,
    }
}

/// Returns the upright rectangle around polygons of a wall: its lower left vertex and its edges to the right and up.
fn rectangle(normal: DVec3, pieces: &[Vec<DVec3>]) -> [DVec3; 3] {
    let right = normal.cross(DVec3::Y).normalize();
    let up = right.cross(normal);
    let [left, bottom] = [right, up].map(|axis| {
        pieces
            .iter()
            .flatten()
            .map(|p| axis.dot(*p))
            .fold(f64::INFINITY, f64::min)
    });
    let [r, top] = [right, up].map(|axis| {
        pieces
            .iter()
            .flatten()
            .map(|p| axis.dot(*p))
            .fold(f64::NEG_INFINITY, f64::max)
    });
    let on = normal * normal.dot(pieces[0][0]);
    [
        on + right * left + up * bottom,
        right * (r - left),
        up * (top - bottom),
    ]
}

fn traced_camera(camera: &MonitorCamera, aspect: f64) -> TracedCamera {
    let forward = point(camera.toward).normalize();
    let right = forward.cross(point(camera.up)).normalize();
    let tan = (f64::from(camera.fov_y) * 0.5).tan();
    TracedCamera {
        eye: point(camera.eye),
        axes: [right, right.cross(forward), forward],
        tangents: [tan * aspect, tan],
    }
}

fn glam_matrix(m: &[f32; 16]) -> (DMat3, DVec3) {
    let c = |i: usize| DVec3::new(f64::from(m[i]), f64::from(m[i + 1]), f64::from(m[i + 2]));
    (DMat3::from_cols(c(0), c(4), c(8)), c(12))
}

fn emitted(material: &Material) -> [u8; 3] {
    let value: serde_json::Value = serde_json::from_str(&material.gltf).unwrap_or_default();
    [0, 1, 2].map(|k| {
        let c = value["emissiveFactor"][k].as_f64().expect("painted");
        (c * 255.0).round() as u8
    })
}

/// Exponent of the contrast of the renderer's pictures.
const CONTRAST: f64 = 1.35;

/// Returns the linear color of a surface that emits a color, as the renderer compresses bright values and adds contrast.
fn toned(color: [u8; 3]) -> [f64; 3] {
    let c = color.map(|x| f64::from(x) / 255.0);
    let most = c[0].max(c[1]).max(c[2]);
    let fitted = 1.0 / (1.0 + most.powi(3)).cbrt();
    let contrast = (most * fitted).max(1e-6).powf(CONTRAST - 1.0);
    c.map(|x| x * fitted * contrast)
}

fn encoded(x: f64) -> u8 {
    let s = if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    };
    (s.clamp(0.0, 1.0) * 255.0).round() as u8
}
