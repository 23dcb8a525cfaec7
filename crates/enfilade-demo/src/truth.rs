//! Truth of a generated scene by construction: its rooms and openings.

use enfilade_geom::{Aabb, DMat4, DVec3};

use crate::rng::Rng;
use crate::solid::newell;

/// Rooms and openings of a generated scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Name of the scene.
    pub scene: String,
    /// Rooms; openings refer to them by index.
    pub rooms: Vec<Room>,
    /// Openings between rooms, or between a room and the outside.
    pub openings: Vec<Opening>,
    /// Storeys as name and height of the floor, ascending. [Units: wu]
    pub storeys: Vec<(String, f64)>,
    /// Points inside closed solids that might be mistaken for rooms.
    pub matter: Vec<DVec3>,
}

/// A room.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// Name, unique in the scene.
    pub name: String,
    /// Index into [`Truth::storeys`].
    pub storey: usize,
    /// Convex parts of the room. For caverns, whose rooms narrow gradually into passages, parts well inside
    /// it.
    pub parts: Vec<Convex>,
    /// Volume of its free air, without door reveals. [Units: wu³]
    pub volume: f64,
    /// Points well inside: in a part and away from every solid.
    pub sample_points: Vec<DVec3>,
}

/// Kind of an opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum OpeningKind {
    /// Walked through, with or without a leaf.
    Door,
    /// Above a parapet, or glazed.
    Window,
    /// Another hole: passage, stair hole, hatch, cave neck.
    Opening,
    /// An open boundary without a wall, between two parts of an open plan.
    Virtual,
}

impl OpeningKind {
    /// Returns the word used in `truth.json`.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Door => "door",
            Self::Window => "window",
            Self::Opening => "opening",
            Self::Virtual => "virtual",
        }
    }
}

/// One side of an opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// Index into [`Truth::rooms`].
    Room(usize),
    /// The world around the building.
    Outside,
}

/// An opening between two rooms, or to the outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Opening {
    /// Its kind.
    pub kind: OpeningKind,
    /// Name, unique in the scene.
    pub name: String,
    /// Middle of the hole.
    pub center: DVec3,
    /// Unit normal, from `rooms[0]` to `rooms[1]`.
    pub normal: DVec3,
    /// Clear width; for holes in slabs the size along x. [Units: wu]
    pub width: f64,
    /// Clear height; for holes in slabs the size along z. [Units: wu]
    pub height: f64,
    /// Length of the hole along the normal: the wall's thickness. [Units: wu]
    pub thickness: f64,
    /// Rectangle at mid-wall, counter-clockwise seen from `rooms[1]`.
    pub corners: [DVec3; 4],
    /// The side that the normal leaves, and the side that it points to.
    pub rooms: [Side; 2],
}

/// A closed convex polyhedron, faces counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Convex {
    /// Vertex positions. [Units: wu]
    pub corners: Vec<DVec3>,
    /// Faces as loops of indices into `corners`.
    pub faces: Vec<Vec<u32>>,
}

impl Convex {
    /// Makes a box.
    #[must_use]
    pub fn of_aabb(b: &Aabb) -> Self {
        let profile = [
            b.min,
            DVec3::new(b.max.x, b.min.y, b.min.z),
            DVec3::new(b.max.x, b.min.y, b.max.z),
            DVec3::new(b.min.x, b.min.y, b.max.z),
        ];
        Self::prism(&profile, DVec3::Y * (b.max.y - b.min.y))
    }

    /// Makes the prism over a planar convex polygon, swept by `along`.
    #[must_use]
    pub fn prism(profile: &[DVec3], along: DVec3) -> Self {
        let mut base = profile.to_vec();
        if newell(&base).dot(along) < 0.0 {
            base.reverse();
        }
        let n = base.len() as u32;
        let mut faces = vec![(n..2 * n).collect(), (0..n).rev().collect()];
        faces.extend((0..n).map(|i| vec![i, (i + 1) % n, n + (i + 1) % n, n + i]));
        let top: Vec<DVec3> = base.iter().map(|&p| p + along).collect();
        base.extend(top);
        Self {
            corners: base,
            faces,
        }
    }

    /// Makes a polyhedron with its vertices on an ellipsoid: 16 meridians, 7 parallels and the poles.
    #[must_use]
    pub fn ellipsoid(center: DVec3, radii: DVec3) -> Self {
        const MERIDIANS: u32 = 16;
        const PARALLELS: u32 = 7;
        let mut corners = vec![center - DVec3::Y * radii.y, center + DVec3::Y * radii.y];
        for ring in 1..=PARALLELS {
            let latitude =
                std::f64::consts::PI * (f64::from(ring) / f64::from(PARALLELS + 1) - 0.5);
            for m in 0..MERIDIANS {
                let (sin, cos) =
                    (std::f64::consts::TAU * f64::from(m) / f64::from(MERIDIANS)).sin_cos();
                let level = latitude.cos();
                let direction = DVec3::new(level * cos, latitude.sin(), level * sin);
                corners.push(center + direction * radii);
            }
        }
        let at = |ring: u32, m: u32| 2 + ring * MERIDIANS + m % MERIDIANS;
        let mut faces = Vec::new();
        for m in 0..MERIDIANS {
            faces.push(vec![0, at(0, m), at(0, m + 1)]);
            faces.push(vec![1, at(PARALLELS - 1, m + 1), at(PARALLELS - 1, m)]);
            for ring in 0..PARALLELS - 1 {
                faces.push(vec![
                    at(ring, m + 1),
                    at(ring, m),
                    at(ring + 1, m),
                    at(ring + 1, m + 1),
                ]);
            }
        }
        Self { corners, faces }
    }

    /// Returns a point and the outward unit normal of each face.
    fn planes(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        self.faces.iter().map(|f| {
            let loop_: Vec<DVec3> = f.iter().map(|&i| self.corners[i as usize]).collect();
            (newell(&loop_).normalize_or_zero(), loop_[0])
        })
    }

    /// Returns `true` if `p` lies inside, at least `margin` from every face.
    #[must_use]
    pub fn contains(&self, p: DVec3, margin: f64) -> bool {
        self.planes()
            .all(|(normal, on)| normal.dot(p - on) <= -margin)
    }

    /// Returns the faces as triangles of vertex indices.
    #[must_use]
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let fan = |f: &Vec<u32>| {
            (2..f.len())
                .map(|i| [f[0], f[i - 1], f[i]])
                .collect::<Vec<_>>()
        };
        self.faces.iter().flat_map(fan).collect()
    }

    /// Returns the volume. [Units: wu³]
    #[must_use]
    pub fn volume(&self) -> f64 {
        let corner = |i: u32| self.corners[i as usize];
        let six: f64 = self
            .triangles()
            .iter()
            .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))))
            .sum();
        six / 6.0
    }

    /// Returns the smallest box around it.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        Aabb::of_points(&self.corners)
    }
}

/// Maximum number of sample points of a room, as in the shared scenes' truth.
const N_SAMPLES: usize = 30;

/// Distance of sample points from the room's surface, if the room allows. [Units: wu]
const SAMPLE_MARGIN: f64 = 0.2;

impl Room {
    /// Makes a room of `parts` that do not overlap, minus the `solids` that stand in it.
    ///
    /// `solids` holds boxes around stairs and the like, with their true volume.
    #[must_use]
    pub fn new(name: &str, storey: usize, parts: Vec<Convex>, solids: &[(Aabb, f64)]) -> Self {
        let volume = parts.iter().map(Convex::volume).sum::<f64>()
            - solids.iter().map(|(_, v)| v).sum::<f64>();
        let mut room = Self {
            name: name.into(),
            storey,
            parts,
            volume,
            sample_points: Vec::new(),
        };
        room.sample(solids);
        room
    }

    /// Returns the smallest box around the room.
    #[must_use]
    pub fn aabb(&self) -> Aabb {
        self.parts
            .iter()
            .fold(Aabb::EMPTY, |b, p| b.union(p.aabb()))
    }

    /// Returns `true` if `p` lies in the room, at least `margin` from the surface of one of its parts.
    #[must_use]
    pub fn contains(&self, p: DVec3, margin: f64) -> bool {
        self.parts.iter().any(|part| part.contains(p, margin))
    }

    fn sample(&mut self, solids: &[(Aabb, f64)]) {
        // Seeded by name: a room keeps its points if another is added.
        let seed = self.name.bytes().fold(0xcbf2_9ce4_8422_2325, |h: u64, b| {
            (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
        });
        let mut rng = Rng::new(seed);
        let volumes: Vec<f64> = self.parts.iter().map(Convex::volume).collect();
        let total: f64 = volumes.iter().sum();
        let mut margin = SAMPLE_MARGIN;
        while self.sample_points.len() < N_SAMPLES && margin > SAMPLE_MARGIN / 16.0 {
            for _ in 0..400 {
                let mut pick = rng.range(0.0, total);
                let part = volumes.iter().position(|v| {
                    pick -= v;
                    pick < 0.0
                });
                let part = &self.parts[part.unwrap_or(0)];
                let b = part.aabb();
                let p = b.min + b.size() * DVec3::new(rng.unit(), rng.unit(), rng.unit());
                let free = solids.iter().all(|(s, _)| !s.expanded(margin).contains(p));
                if free && part.contains(p, margin) && self.sample_points.len() < N_SAMPLES {
                    self.sample_points.push(p);
                }
            }
            // For closets narrower than twice the margin.
            margin /= 2.0;
        }
    }
}

impl Opening {
    /// Makes the opening of the air box `hole` through a wall or slab across `axis` (0, 1, 2 for x, y, z);
    /// `rooms` in ascending order along it.
    #[must_use]
    pub fn of_hole(
        kind: OpeningKind,
        name: &str,
        hole: &Aabb,
        axis: usize,
        rooms: [Side; 2],
    ) -> Self {
        let (center, size) = (hole.center(), hole.size());
        // (u, v, axis) right-handed, v up for walls.
        let (u, v, signs) = match axis {
            0 => (2, 1, -1.0),
            1 => (0, 2, -1.0),
            _ => (0, 1, 1.0),
        };
        let unit =
            |axis: usize| DVec3::from_array([0, 1, 2].map(|a| f64::from(u8::from(a == axis))));
        let du = unit(u) * size[u] * 0.5 * signs;
        let dv = unit(v) * size[v] * 0.5;
        Self {
            kind,
            name: name.into(),
            center,
            normal: unit(axis),
            width: size[u],
            height: size[v],
            thickness: size[axis],
            corners: [
                center - du - dv,
                center + du - dv,
                center + du + dv,
                center - du + dv,
            ],
            rooms,
        }
    }

    /// Returns the area of the hole. [Units: wu²]
    #[must_use]
    pub fn area(&self) -> f64 {
        newell(&self.corners).length() * 0.5
    }
}

impl Truth {
    /// Returns the index of the room named `name`.
    #[must_use]
    pub fn room(&self, name: &str) -> Option<usize> {
        self.rooms.iter().position(|r| r.name == name)
    }

    /// Returns the room that contains `p`, if any.
    #[must_use]
    pub fn room_at(&self, p: DVec3) -> Option<usize> {
        self.rooms.iter().position(|r| r.contains(p, 0.0))
    }

    /// Moves everything by a rotation, uniform scaling and translation.
    pub fn transform(&mut self, by: &DMat4) {
        let scale = by.x_axis.truncate().length();
        for room in &mut self.rooms {
            for p in room.parts.iter_mut().flat_map(|part| &mut part.corners) {
                *p = by.transform_point3(*p);
            }
            for p in &mut room.sample_points {
                *p = by.transform_point3(*p);
            }
            room.volume *= scale.powi(3);
        }
        for o in &mut self.openings {
            o.center = by.transform_point3(o.center);
            o.normal = by.transform_vector3(o.normal).normalize();
            o.corners = o.corners.map(|c| by.transform_point3(c));
            o.width *= scale;
            o.height *= scale;
            o.thickness *= scale;
        }
        for p in &mut self.matter {
            *p = by.transform_point3(*p);
        }
        for (_, elevation) in &mut self.storeys {
            *elevation = by.transform_point3(DVec3::Y * *elevation).y;
        }
    }

    /// Returns its inconsistencies; empty if there are none.
    #[must_use]
    pub fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        for (i, r) in self.rooms.iter().enumerate() {
            if r.sample_points.len() < 5 {
                faults.push(format!(
                    "room {} has {} points",
                    r.name,
                    r.sample_points.len()
                ));
            }
            if self.rooms[..i].iter().any(|other| other.name == r.name) {
                faults.push(format!("two rooms named {}", r.name));
            }
            if r.volume.is_nan() || r.volume <= 0.0 || r.storey >= self.storeys.len() {
                faults.push(format!("room {} has no volume or storey", r.name));
            }
        }
        for o in &self.openings {
            let known = |s: &Side| {
                matches!(s, Side::Room(i) if *i < self.rooms.len()) || *s == Side::Outside
            };
            if !o.rooms.iter().all(known) || o.rooms[0] == o.rooms[1] {
                faults.push(format!("opening {} joins {:?}", o.name, o.rooms));
            }
            if newell(&o.corners).dot(o.normal) <= 0.0 {
                faults.push(format!("opening {} turns the wrong way", o.name));
            }
        }
        faults
    }
}
