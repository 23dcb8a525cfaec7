//! Organic caves: chambers and tunnels as a noisy distance field, meshed by a surface net.

use enfilade_geom::scene::{Mesh, Role};
use enfilade_geom::{Aabb, DMat4, DVec3, closest_point_on_segment};

use crate::surface_net::surface_net;
use enfilade_demo::Rng;
use enfilade_demo::{Convex, Opening, OpeningKind, Room, Side};
use enfilade_demo::{Generated, Site};

const N_CHAMBERS: usize = 7;
/// Region of the chambers' centers. [Units: wu]
const REGION: DVec3 = DVec3::new(34.0, 8.0, 28.0);
/// Minimum rock between chambers, and between a tunnel and a chamber that it passes. [Units: wu]
const ROCK: f64 = 2.5;
/// Largest displacement of the walls in or out. [Units: wu]
const ROUGHNESS: f64 = 0.3;
/// Cell size of the meshing grid. [Units: wu]
const GRID: f64 = 0.4;

struct Chamber {
    center: DVec3,
    radii: DVec3,
}

struct Tunnel {
    chambers: [usize; 2],
    radius: f64,
}

struct Field {
    chambers: Vec<Chamber>,
    tunnels: Vec<Tunnel>,
    seed: u64,
}

/// Returns the distance of a point from a segment. [Units: wu]
pub(crate) fn distance_to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    p.distance(closest_point_on_segment(p, a, b))
}

impl Field {
    /// Returns the field at a point: negative in the air, near a wall about the distance to it. [Units: wu]
    fn at(&self, p: DVec3) -> f64 {
        let mut d = f64::INFINITY;
        for c in &self.chambers {
            let q = (p - c.center) / c.radii;
            d = d.min((q.length() - 1.0) * c.radii.min_element());
        }
        for t in &self.tunnels {
            let [a, b] = t.chambers.map(|i| self.chambers[i].center);
            d = d.min(distance_to_segment(p, a, b) - t.radius);
        }
        let rough = self.noise(p * 0.55) * 0.7 + self.noise(p * 1.3 + 17.0) * 0.3;
        d + rough * ROUGHNESS
    }

    /// Smooth noise in -1..1 with a period of about one unit.
    fn noise(&self, p: DVec3) -> f64 {
        let cell = p.floor();
        let f = p - cell;
        let s = f * f * (3.0 - 2.0 * f);
        let mut sum = 0.0;
        for corner in 0..8 {
            let offset = DVec3::new(
                f64::from(corner & 1),
                f64::from(corner >> 1 & 1),
                f64::from(corner >> 2),
            );
            let lattice = (cell + offset).to_array().map(|x| x as i64 as u64);
            let key = lattice.iter().fold(self.seed, |h, x| {
                (h ^ x).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
            });
            let weight = (1.0 - offset - s).abs();
            sum += weight.x * weight.y * weight.z * Rng::new(key).range(-1.0, 1.0);
        }
        sum
    }
}

/// Places chambers and tunnels; `None` if this attempt does not connect them.
fn layout(rng: &mut Rng) -> Option<(Vec<Chamber>, Vec<Tunnel>)> {
    let mut chambers: Vec<Chamber> = Vec::new();
    for _ in 0..400 {
        let center = DVec3::new(rng.unit(), rng.unit(), rng.unit()) * REGION;
        let radii = DVec3::new(
            rng.range(2.4, 4.4),
            rng.range(1.9, 2.8),
            rng.range(2.4, 4.4),
        );
        let reach = radii.max_element();
        let apart = |c: &Chamber| c.center.distance(center) > c.radii.max_element() + reach + ROCK;
        if chambers.len() < N_CHAMBERS && chambers.iter().all(apart) {
            chambers.push(Chamber { center, radii });
        }
    }
    let mut pairs: Vec<[usize; 2]> = (0..chambers.len())
        .flat_map(|a| (a + 1..chambers.len()).map(move |b| [a, b]))
        .collect();
    let length = |p: &[usize; 2]| chambers[p[0]].center.distance(chambers[p[1]].center);
    pairs.sort_by(|a, b| length(a).total_cmp(&length(b)));
    // A tunnel keeps clear of the chambers and tunnels that it does not join. Shortest first.
    let mut tunnels: Vec<Tunnel> = Vec::new();
    let mut group: Vec<usize> = (0..chambers.len()).collect();
    let mut spare = 2;
    for [a, b] in pairs {
        let ends = [chambers[a].center, chambers[b].center];
        let clear_of_chambers = chambers.iter().enumerate().all(|(i, c)| {
            i == a
                || i == b
                || distance_to_segment(c.center, ends[0], ends[1]) > c.radii.max_element() + ROCK
        });
        let clear_of_tunnels = tunnels.iter().all(|t| {
            let shares = t.chambers.iter().any(|c| [a, b].contains(c));
            let other = t.chambers.map(|i| chambers[i].center);
            let near = (0..=40)
                .map(|i| ends[0].lerp(ends[1], f64::from(i) / 40.0))
                .map(|p| distance_to_segment(p, other[0], other[1]))
                .fold(f64::INFINITY, f64::min);
            // Tunnels from one chamber diverge; require a minimum angle between them.
            let angle = (ends[1] - ends[0])
                .normalize()
                .dot((other[1] - other[0]).normalize());
            if shares {
                angle.abs() < 0.85
            } else {
                near > 2.5 + ROCK
            }
        });
        let joins = group[a] != group[b];
        if clear_of_chambers && clear_of_tunnels && (joins || spare > 0) {
            if joins {
                let (from, to) = (group[a], group[b]);
                group
                    .iter_mut()
                    .filter(|g| **g == from)
                    .for_each(|g| *g = to);
            } else {
                spare -= 1;
            }
            tunnels.push(Tunnel {
                chambers: [a, b],
                radius: rng.range(0.85, 1.15),
            });
        }
    }
    let whole = chambers.len() == N_CHAMBERS && group.iter().all(|&g| g == group[0]);
    whole.then_some((chambers, tunnels))
}

/// A cave of seven chambers joined by straight tunnels, all with rough walls: the surface of its air,
/// closed and facing the air, without a way out.
///
/// Its truth: chambers, given by an ellipsoid well inside each and the volume of the smooth ellipsoid;
/// tunnels as openings, each a square in its middle with the tunnel's length for thickness. About 20,000
/// triangles.
#[must_use]
pub fn cave(seed: u64) -> Generated {
    let mut site = Site::new("cave");
    let storey = site.storey("cave", 0.0);
    let mut rng = Rng::stream(seed, 5);
    let (chambers, tunnels) = loop {
        if let Some(found) = layout(&mut rng) {
            break found;
        }
    };
    let field = Field {
        chambers,
        tunnels,
        seed,
    };
    for (i, c) in field.chambers.iter().enumerate() {
        let part = Convex::ellipsoid(c.center, c.radii - ROUGHNESS - GRID);
        let mut room = Room::new(&format!("chamber {i}"), storey, vec![part], &[]);
        room.volume = c.radii.element_product() * std::f64::consts::PI * 4.0 / 3.0;
        site.add_room(room);
    }
    for t in &field.tunnels {
        site.add_opening(tunnel_opening(&field.chambers, t));
    }
    let material = site.material("rock", [0.35, 0.31, 0.28]);
    let mut bounds = Aabb::EMPTY;
    for c in &field.chambers {
        bounds = bounds
            .including(c.center - c.radii)
            .including(c.center + c.radii);
    }
    let bounds = bounds.expanded(2.0 * ROUGHNESS + 2.0 * GRID);
    let net = surface_net(|p| field.at(p), bounds, GRID, material);
    let mesh = site.add_mesh(Mesh {
        name: "cave walls".into(),
        primitives: vec![net],
    });
    site.place("cave walls", mesh, DMat4::IDENTITY, Role::Structural);
    site.finish()
}

fn tunnel_opening(chambers: &[Chamber], t: &Tunnel) -> Opening {
    let [a, b] = t.chambers.map(|i| &chambers[i]);
    let normal = (b.center - a.center).normalize();
    // Points where the tunnel's axis leaves the ellipsoids.
    let exit = |c: &Chamber| 1.0 / (normal / c.radii).length();
    let (start, end) = (a.center + normal * exit(a), b.center - normal * exit(b));
    let right = DVec3::Y.cross(normal).normalize();
    let up = normal.cross(right);
    // A square of the round tunnel's area.
    let half = t.radius * std::f64::consts::PI.sqrt() * 0.5;
    let center = start.midpoint(end);
    Opening {
        kind: OpeningKind::Opening,
        name: format!("tunnel {} to {}", t.chambers[0], t.chambers[1]),
        center,
        normal,
        width: 2.0 * half,
        height: 2.0 * half,
        thickness: start.distance(end),
        corners: [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(u, v)| center + right * u + up * v),
        rooms: t.chambers.map(Side::Room),
    }
}
