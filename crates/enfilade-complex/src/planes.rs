//! A list of distinct planes, shared by the surfaces that lie in them.

use std::collections::HashMap;
use std::hash::{BuildHasher, Hasher, RandomState};

use enfilade_geom::{DVec3, Plane};

/// Distinct planes, looked up by rounded normal and offset.
///
/// Tries both neighbors where a value is near a step. A pair missed even so (tiny polygon, far from the center) makes
/// two planes of one.
pub struct PlaneList {
    planes: Vec<Plane>,
    buckets: HashMap<[i32; 4], Vec<u32>, Seed>,
    /// Offsets are measured from here, so that they change little with the normal. [Units: wu]
    center: DVec3,
    /// Points this near to a plane lie in it. [Units: wu]
    tolerance: f64,
    n_looked: u64,
}

/// Hashes in a few steps, since each plane is looked up in sixteen buckets. Its seed is secret, so that no scene can be made
/// whose planes collide.
#[derive(Clone, Copy)]
struct Seed([u64; 2]);

impl Default for Seed {
    fn default() -> Self {
        let random = RandomState::new();
        Self([0, 1].map(|i: u8| random.hash_one(i)))
    }
}

impl BuildHasher for Seed {
    type Hasher = KeyHasher;

    fn build_hasher(&self) -> KeyHasher {
        let Self([state, factor]) = *self;
        KeyHasher { state, factor }
    }
}

struct KeyHasher {
    state: u64,
    factor: u64,
}

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.state
    }

    fn write(&mut self, bytes: &[u8]) {
        for part in bytes.chunks(8) {
            let mut eight = [0; 8];
            eight[..part.len()].copy_from_slice(part);
            let mixed = self.state ^ u64::from_le_bytes(eight);
            let product = u128::from(mixed) * u128::from(self.factor | 1);
            self.state = product as u64 ^ (product >> 64) as u64;
        }
    }
}

impl PlaneList {
    /// Makes an empty list. `center` is the middle of the surfaces to come, and points up to `tolerance` from a plane
    /// lie in it. [Units: wu]
    #[must_use]
    pub fn new(center: DVec3, tolerance: f64) -> Self {
        Self {
            planes: Vec::new(),
            buckets: HashMap::default(),
            center,
            tolerance,
            n_looked: 0,
        }
    }

    /// Returns the planes, by id.
    #[must_use]
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Returns the number of buckets and planes examined so far, as a measure of work.
    #[must_use]
    pub fn n_looked(&self) -> u64 {
        self.n_looked
    }

    /// Returns the planes, by id.
    #[must_use]
    pub fn into_planes(self) -> Vec<Plane> {
        self.planes
    }

    /// Returns the id of the plane that best holds all vertices of a polygon; if none does, adds `plane` and returns
    /// its id.
    ///
    /// `plane` is the polygon's own, with a normal for which [`faces_ahead`] is `true`. Among equally good planes,
    /// returns the first.
    pub fn find_or_add(&mut self, plane: &Plane, points: &[DVec3]) -> u32 {
        let at = [
            plane.normal.x * 256.0,
            plane.normal.y * 256.0,
            plane.normal.z * 256.0,
            plane.signed_distance(self.center) * 100.0,
        ];
        let mut best: Option<(f64, u32)> = None;
        for choice in 0..16_u32 {
            let key: [i32; 4] =
                std::array::from_fn(|i| (at[i] - 0.5).floor() as i32 + (choice >> i & 1) as i32);
            let near = self.buckets.get(&key).map_or(&[][..], Vec::as_slice);
            self.n_looked += 1 + near.len() as u64;
            for &id in near {
                let p = &self.planes[id as usize];
                let stray = points
                    .iter()
                    .map(|&q| p.signed_distance(q).abs())
                    .fold(0.0, f64::max);
                if stray <= self.tolerance && best.is_none_or(|b| (stray, id) < b) {
                    best = Some((stray, id));
                }
            }
        }
        if let Some((_, id)) = best {
            return id;
        }
        let id = self.planes.len() as u32;
        self.planes.push(*plane);
        let key = at.map(|x| x.floor() as i32);
        self.buckets.entry(key).or_default().push(id);
        id
    }
}

/// Returns `true` for one of the two normals of a plane, the one used in lists.
///
/// Compares with an odd direction: the largest component would tie on every 45 degree wall.
#[must_use]
pub fn faces_ahead(normal: DVec3) -> bool {
    normal.dot(DVec3::new(1.0, 0.618_034, 0.324_718)) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_in_one_plane_share_it_whatever_the_rounding() {
        let mut list = PlaneList::new(DVec3::ZERO, 1e-5);
        let floor = |y: f64| {
            let points = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(|(x, z)| DVec3::new(x, y, z));
            (Plane::through(points[0], DVec3::Y), points)
        };
        let mut ids = Vec::new();
        for y in [0.25, 0.25 + 9e-6, 0.26, 0.25 - 9e-6, 0.25 + 2e-5] {
            let (plane, points) = floor(y);
            ids.push(list.find_or_add(&plane, &points));
        }
        assert_eq!(ids, [0, 0, 1, 0, 2]);
        assert_eq!(list.planes().len(), 3);
    }

    #[test]
    fn of_two_opposite_normals_one_faces_ahead() {
        let diagonal = DVec3::new(1.0, 0.0, -1.0).normalize();
        for n in [DVec3::X, DVec3::NEG_Y, DVec3::Z, diagonal] {
            assert_ne!(faces_ahead(n), faces_ahead(-n));
        }
    }
}
