//! Open land around buildings.

use enfilade_geom::DVec3;
use enfilade_geom::scene::{Mesh, Primitive};

/// Side of the land, a square around the origin. [Units: wu]
const SIDE: f64 = 1000.0;
/// Width of the slope between level ground and hills. [Units: wu]
const SLOPE: f64 = 60.0;

/// Makes a square kilometer of hills of `square` wide quads, level at the height `ground` as far as `level` around each place.
#[must_use]
pub fn hills(places: &[DVec3], ground: f64, level: f64, square: f64) -> Mesh {
    quads(square, |x, z| {
        let distances = places.iter().map(|p| (p.x - x).hypot(p.z - z));
        let nearest = distances.fold(f64::INFINITY, f64::min);
        let hill = ((nearest - level) / SLOPE).clamp(0.0, 1.0);
        ground + 15.0 * hill * (x / 70.0).sin() * (z / 50.0).cos()
    })
}

/// Makes a square kilometer of `square` wide quads, with the given height at each x and z.
pub(crate) fn quads(square: f64, height: impl Fn(f64, f64) -> f64) -> Mesh {
    let n = (SIDE / square) as u32;
    let mut primitive = Primitive::default();
    for k in 0..=n {
        for i in 0..=n {
            let [x, z] = [i, k].map(|v| f64::from(v) * square - 0.5 * SIDE);
            let y = height(x, z);
            primitive.positions.push([x as f32, y as f32, z as f32]);
        }
    }
    for k in 0..n {
        for i in 0..n {
            let a = i + k * (n + 1);
            let [b, c, d] = [a + 1, a + n + 1, a + n + 2];
            primitive.indices.extend([a, c, d, a, d, b]);
        }
    }
    Mesh {
        name: "land".to_owned(),
        primitives: vec![primitive],
    }
}
