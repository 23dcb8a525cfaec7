//! Gaps of the model that a bake closed.

use crate::World;

/// Number and size of a world's seals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seals {
    /// Number of convex polygons.
    pub count: usize,
    /// Their total area. [Units: wu²]
    pub area: f64,
    /// Area and centroid of the largest. [Units: wu², wu]
    pub largest: (f64, [f64; 3]),
}

impl Seals {
    /// Counts the seals of a world. Linear in their triangles; each polygon is a fan about its first vertex.
    #[must_use]
    pub fn of(world: &World) -> Self {
        let mut out = Self::default();
        for batch in world.batches.iter().filter(|b| b.is_seal) {
            let p = &batch.primitive;
            for fan in p.triples().chunk_by(|a, b| a[0] == b[0]) {
                let (mut area, mut middle) = (0.0, [0.0; 3]);
                for t in fan {
                    let [a, b, c] = t.map(|i| {
                        let corner = p.positions.get(i as usize);
                        corner.copied().unwrap_or_default().map(f64::from)
                    });
                    let part = area_of(a, b, c);
                    area += part;
                    for k in 0..3 {
                        middle[k] += part * (a[k] + b[k] + c[k]) / 3.0;
                    }
                }
                out.count += 1;
                out.area += area;
                if area > out.largest.0 {
                    out.largest = (area, middle.map(|x| x / area));
                }
            }
        }
        out
    }
}

fn area_of(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    let cross = [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ];
    cross.iter().map(|x| x * x).sum::<f64>().sqrt() * 0.5
}
