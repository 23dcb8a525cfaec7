//! A small solid modeller: boxes with rectangular holes, prisms, stairs, spheres.
//!
//! Every solid is closed, with outward counter-clockwise faces: each directed edge of its triangles has an
//! opposite one. Within one solid there are no T-junctions.

use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DVec2, DVec3};

/// Lengths closer than this are equal. [Units: wu]
///
/// A tenth of a millimeter: far below any wall or crack in our models, far above rounding in `f64` and, in
/// scenes up to a kilometer, above the spacing of `f32`.
const SNAP: f64 = 1e-4;

/// Rounds `x` to the grid of `SNAP`, so that neighbors that compute a coordinate in different ways still
/// share it to the last bit.
#[must_use]
pub fn snapped(x: f64) -> f64 {
    // Divide by the exact reciprocal: 0.3 then is the double nearest to 0.3.
    (x / SNAP).round() / (1.0 / SNAP)
}

/// Makes the box from `min` to `max`, given as arrays.
#[must_use]
pub fn aabb(min: [f64; 3], max: [f64; 3]) -> Aabb {
    Aabb::new(DVec3::from_array(min), DVec3::from_array(max))
}

/// Collects faces by material into a [`Mesh`].
#[derive(Clone, Debug, Default)]
pub struct MeshBuilder {
    material: u32,
    top_material: Option<u32>,
    parts: Vec<(u32, Primitive)>,
}

impl MeshBuilder {
    /// Makes an empty mesh whose faces get `material`.
    #[must_use]
    pub fn new(material: u32) -> Self {
        Self {
            material,
            ..Self::default()
        }
    }

    /// Sets the material of the faces to come.
    pub fn paint(&mut self, material: u32) -> &mut Self {
        self.material = material;
        self.top_material = None;
        self
    }

    /// Sets another material for those later faces that face straight up.
    pub fn paint_top(&mut self, material: u32) -> &mut Self {
        self.top_material = Some(material);
        self
    }

    /// Returns the number of triangles so far.
    #[must_use]
    pub fn n_triangles(&self) -> usize {
        self.parts.iter().map(|(_, p)| p.indices.len() / 3).sum()
    }

    /// Adds a planar convex polygon, counter-clockwise seen from its front. [Limit: >= 3 vertices]
    pub fn convex(&mut self, corners: &[DVec3]) -> &mut Self {
        let fan: Vec<[usize; 3]> = (2..corners.len()).map(|i| [0, i - 1, i]).collect();
        self.face(corners, &fan)
    }

    /// Adds a planar simple polygon, counter-clockwise seen from its front; may be concave and have vertices in
    /// the middle of straight edges.
    pub fn polygon(&mut self, corners: &[DVec3]) -> &mut Self {
        let triangles = triangulate(corners);
        self.face(corners, &triangles)
    }

    fn face(&mut self, corners: &[DVec3], triangles: &[[usize; 3]]) -> &mut Self {
        let normal = newell(corners).normalize_or_zero();
        let material = self
            .top_material
            .filter(|_| normal.y > 0.99)
            .unwrap_or(self.material);
        let part = match self.parts.iter().position(|(m, _)| *m == material) {
            Some(i) => &mut self.parts[i].1,
            None => {
                let empty = Primitive {
                    material: Some(material),
                    ..Primitive::default()
                };
                self.parts.push((material, empty));
                &mut self.parts.last_mut().expect("just pushed").1
            }
        };
        let first = part.positions.len() as u32;
        part.positions
            .extend(corners.iter().map(|c| c.as_vec3().to_array()));
        part.normals
            .extend(corners.iter().map(|_| normal.as_vec3().to_array()));
        part.indices
            .extend(triangles.iter().flatten().map(|&i| first + i as u32));
        self
    }

    /// Adds a box.
    pub fn cuboid(&mut self, b: Aabb) -> &mut Self {
        self.carved(&[b], &[])
    }

    /// Adds the union of the boxes `solids` minus the boxes `voids`, closed and free of T-junctions.
    ///
    /// Faces are cut along every plane of every box, which suits walls with a few openings and small buildings;
    /// the work grows with the product of the numbers of planes along the axes. Two parts that touch only along
    /// an edge share an edge of four triangles.
    pub fn carved(&mut self, solids: &[Aabb], voids: &[Aabb]) -> &mut Self {
        let cuts: [Vec<f64>; 3] = [0, 1, 2].map(|axis| {
            let bounds = solids.iter().fold(Aabb::EMPTY, |b, s| b.union(*s));
            let mut cuts: Vec<f64> = solids
                .iter()
                .chain(voids)
                .flat_map(|b| [b.min[axis], b.max[axis]])
                .map(|x| snapped(x.clamp(bounds.min[axis], bounds.max[axis])))
                .collect();
            cuts.sort_by(f64::total_cmp);
            cuts.dedup();
            cuts
        });
        if cuts.iter().any(|c| c.len() < 2) {
            return self;
        }
        let n = [0, 1, 2].map(|axis: usize| cuts[axis].len() - 1);
        let index = |c: [usize; 3]| (c[2] * n[1] + c[1]) * n[0] + c[0];
        let mut filled = vec![false; n[0] * n[1] * n[2]];
        for (boxes, value) in [(solids, true), (voids, false)] {
            for b in boxes {
                let span = [0, 1, 2].map(|axis: usize| {
                    let at = |x: f64| cuts[axis].partition_point(|&c| c < snapped(x)).min(n[axis]);
                    at(b.min[axis])..at(b.max[axis])
                });
                for z in span[2].clone() {
                    for y in span[1].clone() {
                        for x in span[0].clone() {
                            filled[index([x, y, z])] = value;
                        }
                    }
                }
            }
        }
        let corner = |c: [usize; 3]| DVec3::new(cuts[0][c[0]], cuts[1][c[1]], cuts[2][c[2]]);
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for iv in 0..n[v] {
                for iu in 0..n[u] {
                    for iw in 0..=n[axis] {
                        let at = |w: usize| {
                            let mut c = [0; 3];
                            (c[axis], c[u], c[v]) = (w, iu, iv);
                            c
                        };
                        let below = iw > 0 && filled[index(at(iw - 1))];
                        let above = iw < n[axis] && filled[index(at(iw))];
                        if below == above {
                            continue;
                        }
                        let mut quad = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(du, dv)| {
                            let mut c = at(iw);
                            c[u] += du;
                            c[v] += dv;
                            corner(c)
                        });
                        if above {
                            quad.reverse();
                        }
                        self.convex(&quad);
                    }
                }
            }
        }
        self
    }

    /// Adds a rectangle without thickness, `face` being flat across `axis`, minus `holes`, which are cut as in
    /// [`MeshBuilder::carved`]. It faces along the axis, or against it.
    pub fn sheet(&mut self, face: Aabb, axis: usize, along: bool, holes: &[Aabb]) -> &mut Self {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let cuts = [u, v].map(|a: usize| {
            let mut cuts: Vec<f64> = std::iter::once(&face)
                .chain(holes)
                .flat_map(|b| [b.min[a], b.max[a]])
                .map(|x| snapped(x.clamp(face.min[a], face.max[a])))
                .collect();
            cuts.sort_by(f64::total_cmp);
            cuts.dedup();
            cuts
        });
        for q in cuts[1].windows(2) {
            for p in cuts[0].windows(2) {
                let mut corners =
                    [(p[0], q[0]), (p[1], q[0]), (p[1], q[1]), (p[0], q[1])].map(|(a, b)| {
                        let mut c = face.min;
                        (c[u], c[v]) = (a, b);
                        c
                    });
                let middle = (corners[0] + corners[2]) * 0.5;
                let open = |h: &Aabb| {
                    [u, v]
                        .iter()
                        .all(|&a| h.min[a] < middle[a] && middle[a] < h.max[a])
                };
                if holes.iter().any(open) {
                    continue;
                }
                if !along {
                    corners.reverse();
                }
                self.convex(&corners);
            }
        }
        self
    }

    /// Adds the prism over the planar simple polygon `profile`, swept by `along`.
    pub fn prism(&mut self, profile: &[DVec3], along: DVec3) -> &mut Self {
        let mut base = profile.to_vec();
        if newell(&base).dot(along) < 0.0 {
            base.reverse();
        }
        let top: Vec<DVec3> = base.iter().map(|&p| p + along).collect();
        self.polygon(&top);
        for i in 0..base.len() {
            let j = (i + 1) % base.len();
            self.convex(&[base[i], base[j], top[j], top[i]]);
        }
        base.reverse();
        self.polygon(&base)
    }

    /// Adds an upright prism over a regular polygon of `n` sides, from `low` to `high`.
    pub fn column(
        &mut self,
        center: DVec2,
        radius: f64,
        n: usize,
        low: f64,
        high: f64,
    ) -> &mut Self {
        let profile: Vec<DVec3> = (0..n)
            .map(|i| {
                let (s, c) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
                DVec3::new(center.x + radius * c, low, center.y + radius * s)
            })
            .collect();
        self.prism(&profile, DVec3::Y * (high - low))
    }

    /// Adds an icosahedron (20 triangles) with vertices at `radius`, scaled along the axes.
    pub fn icosahedron(&mut self, center: DVec3, radius: DVec3) -> &mut Self {
        let (corners, faces) = icosahedron();
        for f in faces {
            self.convex(&f.map(|i| center + corners[i] * radius));
        }
        self
    }

    /// Adds a straight flight of stairs.
    ///
    /// Treads rise from `foot` (middle of the lowest edge) towards `uphill` (unit, level): `n` risers of
    /// `riser` each, `n - 1` treads of `going`, so the top riser meets the upper floor. The soffit runs `waist`
    /// below the steps. [Limit: n >= 2]
    pub fn flight(&mut self, foot: DVec3, uphill: DVec3, width: f64, steps: &Steps) -> &mut Self {
        let point = |run: f64, rise: f64| foot + uphill * run + DVec3::Y * rise;
        let slope = steps.riser / steps.going;
        let run = steps.run();
        let mut profile = vec![point(0.0, 0.0)];
        for i in 0..steps.n - 1 {
            let rise = (i + 1) as f64 * steps.riser;
            profile.push(point(i as f64 * steps.going, rise));
            profile.push(point((i + 1) as f64 * steps.going, rise));
        }
        profile.push(point(run, slope * run - steps.waist));
        // Point where the soffit comes out of the lower floor.
        profile.push(point((steps.waist / slope).min(run * 0.5), 0.0));
        let side = DVec3::Y.cross(uphill) * width;
        for p in &mut profile {
            *p -= side * 0.5;
        }
        self.prism(&profile, side)
    }

    /// Returns the finished mesh. Primitives whose material is in `textured` get texture coordinates: one unit
    /// per meter, projected along the dominant axis of each face.
    #[must_use]
    pub fn build(self, name: &str, textured: &[u32]) -> Mesh {
        let mut primitives: Vec<Primitive> = self.parts.into_iter().map(|(_, p)| p).collect();
        for p in &mut primitives {
            if p.material.is_some_and(|m| textured.contains(&m)) {
                p.uvs = vec![p.positions.iter().zip(&p.normals).map(planar_uv).collect()];
            }
        }
        Mesh {
            name: name.into(),
            primitives,
        }
    }
}

/// Dimensions of a flight of stairs.
#[derive(Clone, Copy, Debug)]
pub struct Steps {
    /// Number of risers, the one up to the next floor included.
    pub n: usize,
    /// Height of a step. [Units: wu]
    pub riser: f64,
    /// Depth of a tread. [Units: wu]
    pub going: f64,
    /// Height of the body below the inner edges of the steps. [Units: wu]
    pub waist: f64,
}

impl Steps {
    /// Returns the length of the flight in plan. [Units: wu]
    #[must_use]
    pub fn run(&self) -> f64 {
        (self.n - 1) as f64 * self.going
    }

    /// Returns the volume of the part of a flight of `width` below the height `top`. [Units: wu³]
    #[must_use]
    pub fn volume_below(&self, width: f64, top: f64) -> f64 {
        let soffit = |run: f64| (run * self.riser / self.going - self.waist).max(0.0);
        // Midpoint rule, fine enough for a liter.
        let n = self.n * 40;
        let dx = self.run() / n as f64;
        let column = |i: usize| {
            let run = (i as f64 + 0.5) * dx;
            let tread = ((run / self.going).floor() + 1.0) * self.riser;
            (tread.min(top) - soffit(run).min(top)).max(0.0) * dx * width
        };
        (0..n).map(column).sum()
    }
}

fn planar_uv((p, n): (&[f32; 3], &[f32; 3])) -> [f32; 2] {
    let [x, y, z] = n.map(f32::abs);
    if y >= x && y >= z {
        [p[0], p[2]]
    } else if x >= z {
        [p[2], -p[1]]
    } else {
        [p[0], -p[1]]
    }
}

/// Returns the normal of a planar polygon with twice its area as length.
pub fn newell(corners: &[DVec3]) -> DVec3 {
    let first = corners[0];
    (2..corners.len())
        .map(|i| (corners[i - 1] - first).cross(corners[i] - first))
        .sum()
}

/// Returns the triangles (vertex indices) of a planar simple polygon, in its own orientation.
///
/// Ear clipping, each time the ear with the largest least height, so that walls do not fall into needles if
/// there is another choice. Vertices in the middle of straight edges are kept: none ends up on the side of a
/// triangle. O(n³) in the number of vertices of a wall.
#[must_use]
pub fn triangulate(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let normal = newell(corners);
    // Drop the dominant axis of the normal, keeping the orientation.
    let axis = [0, 1, 2]
        .into_iter()
        .max_by(|&a: &usize, &b: &usize| normal[a].abs().total_cmp(&normal[b].abs()));
    let axis = axis.unwrap_or(0);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let sign = normal[axis].signum();
    let flat: Vec<DVec2> = corners
        .iter()
        .map(|c| DVec2::new(c[u] * sign, c[v]))
        .collect();
    let area = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let scale = flat
        .iter()
        .fold(0.0_f64, |m, p| m.max((*p - flat[0]).length_squared()));
    // Twice the area below which three vertices count as collinear.
    let flatness = scale * 1e-12;

    let mut left: Vec<usize> = (0..corners.len()).collect();
    let mut triangles = Vec::with_capacity(corners.len().saturating_sub(2));
    while left.len() > 3 {
        let n = left.len();
        let mut best: Option<(f64, usize)> = None;
        for i in 0..n {
            let [a, b, c] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let doubled = area(a, b, c);
            if doubled <= flatness {
                continue;
            }
            let blocked = left.iter().any(|&p| {
                p != a
                    && p != b
                    && p != c
                    && area(a, b, p) >= -flatness
                    && area(b, c, p) >= -flatness
                    && area(c, a, p) >= -flatness
            });
            let longest = [(a, b), (b, c), (c, a)]
                .map(|(p, q)| flat[p].distance_squared(flat[q]))
                .into_iter()
                .fold(0.0, f64::max);
            let height = doubled / longest.sqrt();
            if !blocked && best.is_none_or(|(h, _)| height > h) {
                best = Some((height, i));
            }
        }
        // Only a polygon that is not simple has no ear; clipping any vertex still terminates.
        let i = best.map_or(0, |(_, i)| i);
        triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    if let [a, b, c] = left[..] {
        triangles.push([a, b, c]);
    }
    triangles
}

/// Returns unit vertices and outward faces of an icosahedron.
#[must_use]
pub fn icosahedron() -> ([DVec3; 12], [[usize; 3]; 20]) {
    let p = f64::midpoint(1.0, 5.0_f64.sqrt());
    let corners = [
        [-1.0, p, 0.0],
        [1.0, p, 0.0],
        [-1.0, -p, 0.0],
        [1.0, -p, 0.0],
        [0.0, -1.0, p],
        [0.0, 1.0, p],
        [0.0, -1.0, -p],
        [0.0, 1.0, -p],
        [p, 0.0, -1.0],
        [p, 0.0, 1.0],
        [-p, 0.0, -1.0],
        [-p, 0.0, 1.0],
    ]
    .map(|c| DVec3::from_array(c).normalize());
    let mut faces = [[0; 3]; 20];
    let mut n = 0;
    // Faces are the triples of mutually nearest vertices; finding them avoids a table with typing errors.
    // 1.2 lies between the edge (1.05) and the next distance (1.70).
    let near = |a: usize, b: usize| corners[a].distance(corners[b]) < 1.2;
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let out = newell(&[corners[a], corners[b], corners[c]]).dot(corners[a]) > 0.0;
                    faces[n] = if out { [a, b, c] } else { [a, c, b] };
                    n += 1;
                }
            }
        }
    }
    (corners, faces)
}
