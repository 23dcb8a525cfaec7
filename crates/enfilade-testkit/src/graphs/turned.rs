//! Furniture of curved, detailed surfaces: turned legs, cushions, vases, leaves.
//!
//! Each stands on the origin, its back towards -z, within a circle of 0.85 m. How finely its surfaces are divided is a number
//! that the caller chooses, so that a house can be furnished to a given number of triangles.

use std::f64::consts::{PI, TAU};

use enfilade_geom::DVec3;
use enfilade_geom::scene::{Mesh, Primitive};

/// A kind of furniture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Turned {
    Chair,
    Sofa,
    Table,
    Lamp,
    Vase,
    Shelf,
    Bed,
    Plant,
}

impl Turned {
    pub(super) const ALL: [Self; 8] = [
        Self::Chair,
        Self::Sofa,
        Self::Table,
        Self::Lamp,
        Self::Vase,
        Self::Shelf,
        Self::Bed,
        Self::Plant,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Chair => "chair",
            Self::Sofa => "sofa",
            Self::Table => "table",
            Self::Lamp => "lamp",
            Self::Vase => "vase",
            Self::Shelf => "shelf",
            Self::Bed => "bed",
            Self::Plant => "plant",
        }
    }

    /// Returns the number of triangles of [`Turned::mesh`].
    pub(super) fn n_triangles(self, fineness: f64) -> u64 {
        let size = |piece: &Piece| {
            let [around, along] = piece.divisions(fineness);
            2 * around as u64 * along as u64
        };
        self.pieces().iter().map(size).sum()
    }

    /// Builds the mesh. `colors` are materials: two for its wood and fabric, one to accent. `fineness` is about the number of
    /// divisions of a leg's circumference. [Limit: > 0]
    pub(super) fn mesh(self, colors: [u32; 3], fineness: f64) -> Mesh {
        let mut primitives: Vec<Primitive> = Vec::new();
        for piece in self.pieces() {
            let material = Some(colors[piece.color]);
            let at = primitives.iter().position(|p| p.material == material);
            let at = at.unwrap_or_else(|| {
                primitives.push(Primitive {
                    material,
                    ..Primitive::default()
                });
                primitives.len() - 1
            });
            piece.add(&mut primitives[at], fineness);
        }
        Mesh {
            name: self.name().into(),
            primitives,
        }
    }

    fn pieces(self) -> Vec<Piece> {
        match self {
            Self::Chair => chair(),
            Self::Sofa => sofa(),
            Self::Table => table(),
            Self::Lamp => lamp(),
            Self::Vase => vase(),
            Self::Shelf => shelf(),
            Self::Bed => bed(),
            Self::Plant => plant(),
        }
    }
}

/// The surface of a piece.
#[derive(Clone, Copy)]
enum TurnedShape {
    /// Radii and heights, turned about the vertical through the piece's place.
    Lathe(&'static [[f64; 2]]),
    /// Half its size; edges are the sharper, the smaller the power. 1 makes an ellipsoid.
    Cushion(DVec3, f64),
}

/// A surface of one color; its ends may be open.
#[derive(Clone, Copy)]
struct Piece {
    shape: TurnedShape,
    at: DVec3,
    /// 0 to 2.
    color: usize,
    /// Divisions relative to those of a leg.
    weight: f64,
}

impl Piece {
    fn divisions(&self, fineness: f64) -> [usize; 2] {
        let n = self.weight * fineness;
        let along = match self.shape {
            TurnedShape::Lathe(profile) => n.max(profile.len() as f64 - 1.0),
            TurnedShape::Cushion(..) => n * 0.6,
        };
        [(n.round() as usize).max(5), (along.round() as usize).max(3)]
    }

    /// Returns a point of the surface, both numbers from 0 to 1: around the vertical, and from bottom to top.
    fn point(&self, around: f64, along: f64) -> DVec3 {
        let (sin, cos) = (around * TAU).sin_cos();
        self.at
            + match self.shape {
                TurnedShape::Lathe(profile) => {
                    let t = along * (profile.len() - 1) as f64;
                    let i = (t as usize).min(profile.len() - 2);
                    let ([r0, y0], [r1, y1]) = (profile[i], profile[i + 1]);
                    // Eased, so that the turner's grooves are round.
                    let t = t - i as f64;
                    let r = r0 + (r1 - r0) * t * t * (3.0 - 2.0 * t);
                    DVec3::new(r * cos, y0 + (y1 - y0) * t, -r * sin)
                }
                TurnedShape::Cushion(half, power) => {
                    let bent = |x: f64| x.signum() * x.abs().powf(power);
                    // A thousandth short of the poles, where triangles would have no area.
                    let (up, out) = ((along - 0.5) * PI * 0.999).sin_cos();
                    half * DVec3::new(bent(out) * bent(cos), bent(up), -bent(out) * bent(sin))
                }
            }
    }

    fn add(&self, to: &mut Primitive, fineness: f64) {
        let [n_around, n_along] = self.divisions(fineness);
        let first = to.positions.len() as u32;
        let mut points = Vec::new();
        for j in 0..=n_along {
            for i in 0..n_around {
                let [u, v] = [i as f64 / n_around as f64, j as f64 / n_along as f64];
                points.push(self.point(u, v));
            }
        }
        let mut normals = vec![DVec3::ZERO; points.len()];
        for j in 0..n_along {
            for i in 0..n_around {
                let at = |i: usize, j: usize| j * n_around + i % n_around;
                let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let normal = (points[q[2]] - points[q[0]]).cross(points[q[3]] - points[q[1]]);
                q.iter().for_each(|&k| normals[k] += normal);
                let indices = [0, 1, 2, 0, 2, 3].map(|k: usize| first + q[k] as u32);
                to.indices.extend(indices);
            }
        }
        let unit = |n: &DVec3| n.normalize_or(DVec3::Y).as_vec3().to_array();
        to.positions
            .extend(points.iter().map(|p| p.as_vec3().to_array()));
        to.normals.extend(normals.iter().map(unit));
    }
}

fn lathe(profile: &'static [[f64; 2]], at: [f64; 3], color: usize, weight: f64) -> Piece {
    Piece {
        shape: TurnedShape::Lathe(profile),
        at: at.into(),
        color,
        weight,
    }
}

/// Makes a block with rounded edges between two points.
fn block(low: [f64; 3], high: [f64; 3], color: usize, weight: f64) -> Piece {
    cushion(low, high, 0.25, color, weight)
}

fn cushion(low: [f64; 3], high: [f64; 3], power: f64, color: usize, weight: f64) -> Piece {
    let (low, high) = (DVec3::from(low), DVec3::from(high));
    Piece {
        shape: TurnedShape::Cushion((high - low) * 0.5, power),
        at: (low + high) * 0.5,
        color,
        weight,
    }
}

fn legs(profile: &'static [[f64; 2]], x: f64, z: f64) -> impl Iterator<Item = Piece> {
    [[-x, -z], [x, -z], [-x, z], [x, z]]
        .into_iter()
        .map(move |[x, z]| lathe(profile, [x, 0.0, z], 0, 1.0))
}

fn chair() -> Vec<Piece> {
    const LEG: &[[f64; 2]] = &[
        [0.004, 0.0],
        [0.018, 0.01],
        [0.013, 0.08],
        [0.024, 0.16],
        [0.014, 0.2],
        [0.024, 0.32],
        [0.018, 0.43],
    ];
    const SPINDLE: &[[f64; 2]] = &[[0.012, 0.0], [0.008, 0.1], [0.016, 0.2], [0.008, 0.4]];
    let mut out: Vec<Piece> = legs(LEG, 0.17, 0.17).collect();
    let spindle = |i: i32| lathe(SPINDLE, [0.075 * f64::from(i), 0.45, -0.18], 0, 0.7);
    out.extend((-2..=2).map(spindle));
    out.push(block([-0.21, 0.42, -0.2], [0.21, 0.46, 0.2], 0, 1.6));
    out.push(cushion(
        [-0.19, 0.45, -0.17],
        [0.19, 0.5, 0.19],
        0.5,
        1,
        2.2,
    ));
    out.push(block([-0.21, 0.84, -0.2], [0.21, 0.93, -0.16], 0, 1.6));
    out
}

fn sofa() -> Vec<Piece> {
    const FOOT: &[[f64; 2]] = &[[0.004, 0.0], [0.03, 0.02], [0.02, 0.08], [0.03, 0.12]];
    let mut out: Vec<Piece> = legs(FOOT, 0.66, 0.3).collect();
    out.push(block([-0.76, 0.1, -0.38], [0.76, 0.3, 0.38], 1, 2.0));
    for side in [-1.0_f64, 1.0] {
        let [a, b] = [0.8 * side, 0.58 * side];
        out.push(cushion(
            [a.min(b), 0.12, -0.38],
            [a.max(b), 0.62, 0.4],
            0.4,
            1,
            2.4,
        ));
    }
    for i in 0..3 {
        let x = -0.57 + 0.38 * f64::from(i);
        out.push(cushion(
            [x, 0.28, -0.3],
            [x + 0.38, 0.48, 0.4],
            0.45,
            1,
            2.6,
        ));
        out.push(cushion(
            [x, 0.4, -0.4],
            [x + 0.38, 0.86, -0.16],
            0.5,
            1,
            2.6,
        ));
    }
    for x in [-0.42, 0.3] {
        out.push(cushion([x, 0.46, -0.2], [x + 0.3, 0.76, 0.0], 0.6, 2, 2.2));
    }
    out
}

fn table() -> Vec<Piece> {
    const LEG: &[[f64; 2]] = &[
        [0.01, 0.0],
        [0.035, 0.02],
        [0.02, 0.1],
        [0.045, 0.3],
        [0.02, 0.42],
        [0.04, 0.5],
        [0.03, 0.7],
    ];
    const TOP: &[[f64; 2]] = &[
        [0.02, 0.7],
        [0.42, 0.7],
        [0.46, 0.72],
        [0.43, 0.74],
        [0.01, 0.74],
    ];
    const BOWL: &[[f64; 2]] = &[
        [0.01, 0.74],
        [0.06, 0.75],
        [0.15, 0.83],
        [0.14, 0.84],
        [0.05, 0.77],
        [0.005, 0.76],
    ];
    let mut out: Vec<Piece> = legs(LEG, 0.26, 0.26).collect();
    out.push(lathe(TOP, [0.0; 3], 0, 3.0));
    out.push(lathe(BOWL, [0.0; 3], 2, 2.0));
    for i in 0..6 {
        let (sin, cos) = (f64::from(i) * PI / 3.0).sin_cos();
        let p = [0.07 * cos, 0.83, 0.07 * sin];
        out.push(ball(p, 0.035, 1, 1.2));
    }
    out
}

fn ball(at: [f64; 3], radius: f64, color: usize, weight: f64) -> Piece {
    Piece {
        shape: TurnedShape::Cushion(DVec3::splat(radius), 1.0),
        at: at.into(),
        color,
        weight,
    }
}

fn lamp() -> Vec<Piece> {
    const STAND: &[[f64; 2]] = &[
        [0.01, 0.0],
        [0.16, 0.01],
        [0.15, 0.03],
        [0.03, 0.06],
        [0.014, 0.3],
        [0.03, 0.6],
        [0.012, 0.7],
        [0.012, 1.3],
    ];
    const SHADE: &[[f64; 2]] = &[
        [0.24, 1.18],
        [0.2, 1.3],
        [0.15, 1.5],
        [0.14, 1.5],
        [0.19, 1.3],
        [0.235, 1.18],
    ];
    vec![
        lathe(STAND, [0.0; 3], 0, 2.0),
        lathe(SHADE, [0.0; 3], 2, 2.8),
        ball([0.0, 1.34, 0.0], 0.05, 1, 1.4),
    ]
}

fn vase() -> Vec<Piece> {
    const BODY: &[[f64; 2]] = &[
        [0.01, 0.0],
        [0.09, 0.01],
        [0.12, 0.15],
        [0.17, 0.35],
        [0.06, 0.55],
        [0.1, 0.65],
        [0.09, 0.65],
        [0.05, 0.55],
    ];
    const STEM: &[[f64; 2]] = &[[0.006, 0.0], [0.005, 0.25], [0.006, 0.5]];
    let mut out = vec![lathe(BODY, [0.0; 3], 2, 3.4)];
    for i in 0..9 {
        let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
        let r = 0.01 + 0.008 * f64::from(i);
        let [x, z] = [r * cos, r * sin];
        let y = 0.45 + 0.02 * f64::from(i % 4);
        out.push(lathe(STEM, [x, y, z], 0, 0.7));
        out.push(ball([x, y + 0.52, z], 0.045, 1, 1.3));
    }
    out
}

fn shelf() -> Vec<Piece> {
    let mut out = Vec::new();
    for x in [-0.5, 0.47] {
        out.push(block([x, 0.0, -0.16], [x + 0.03, 1.9, 0.16], 0, 1.2));
    }
    for board in 0..5 {
        let y = 0.05 + 0.44 * f64::from(board);
        out.push(block([-0.49, y, -0.15], [0.49, y + 0.03, 0.15], 0, 1.2));
        for book in 0..(if board < 4 { 11 } else { 0 }) {
            // Irregular in a regular manner: each board another.
            let odd = f64::from((book * 7 + board * 5) % 11) / 11.0;
            let x = -0.46 + 0.08 * f64::from(book);
            let high = y + 0.22 + 0.14 * odd;
            let low = [x, y + 0.03, -0.13];
            let color = if odd < 0.5 { 1 } else { 2 };
            out.push(block(low, [x + 0.05 + 0.025 * odd, high, 0.06], color, 0.8));
        }
    }
    out
}

fn bed() -> Vec<Piece> {
    const POST: &[[f64; 2]] = &[
        [0.03, 0.0],
        [0.02, 0.2],
        [0.04, 0.3],
        [0.02, 0.6],
        [0.04, 0.8],
        [0.005, 0.85],
    ];
    let mut out: Vec<Piece> = legs(POST, 0.44, 0.7).collect();
    out.push(block([-0.45, 0.2, -0.7], [0.45, 0.34, 0.7], 0, 1.6));
    out.push(cushion(
        [-0.44, 0.32, -0.68],
        [0.44, 0.52, 0.7],
        0.35,
        2,
        3.0,
    ));
    out.push(cushion(
        [-0.46, 0.34, -0.25],
        [0.46, 0.56, 0.72],
        0.3,
        1,
        3.4,
    ));
    for x in [-0.4, 0.02] {
        out.push(cushion(
            [x, 0.48, -0.66],
            [x + 0.38, 0.62, -0.36],
            0.6,
            2,
            2.4,
        ));
    }
    out.push(block([-0.44, 0.4, -0.72], [0.44, 0.75, -0.69], 0, 1.6));
    out
}

fn plant() -> Vec<Piece> {
    const POT: &[[f64; 2]] = &[
        [0.01, 0.0],
        [0.13, 0.01],
        [0.19, 0.32],
        [0.2, 0.36],
        [0.17, 0.36],
        [0.01, 0.33],
    ];
    const TRUNK: &[[f64; 2]] = &[[0.025, 0.3], [0.018, 0.7], [0.014, 1.2]];
    let mut out = vec![lathe(POT, [0.0; 3], 2, 2.6), lathe(TRUNK, [0.0; 3], 0, 1.0)];
    for i in 0..24 {
        let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
        let r = 0.12 + 0.16 * f64::from(i % 5) / 5.0;
        let y = 0.62 + 0.028 * f64::from(i);
        let half = [0.05 + 0.09 * cos.abs(), 0.015, 0.05 + 0.09 * sin.abs()];
        let at = [r * cos, y, r * sin];
        let [low, high] = [-1.0, 1.0].map(|s| [0, 1, 2].map(|k| at[k] + s * half[k]));
        out.push(cushion(low, high, 1.0, 1, 1.1));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn furniture_has_the_triangles_it_claims_and_faces_outwards() {
        for kind in Turned::ALL {
            for fineness in [4.0, 9.7] {
                let mesh = kind.mesh([0, 1, 2], fineness);
                let all = || mesh.primitives.iter();
                let n: usize = all().map(|p| p.indices.len() / 3).sum();
                assert_eq!(n as u64, kind.n_triangles(fineness), "{}", kind.name());
                let triangles = || all().flat_map(Primitive::triangles);
                let volume: f64 = triangles().map(|[a, b, c]| a.dot(b.cross(c))).sum();
                assert!(volume > 0.0, "{}", kind.name());
                for [a, b, c] in triangles() {
                    assert!((b - a).cross(c - a).length() > 1e-12, "{}", kind.name());
                }
                let out = all().flat_map(|p| &p.positions);
                let far = out.map(|p| p[0].hypot(p[2])).fold(0.0, f32::max);
                let low = all().flat_map(|p| &p.positions).map(|p| p[1]);
                assert!(far < 0.95, "{}: {far}", kind.name());
                assert!(low.fold(1.0, f32::min) > -1e-3, "{}", kind.name());
            }
        }
    }
}
