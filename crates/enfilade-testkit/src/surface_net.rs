//! Triangulated surface of a field's inside.

use std::collections::HashMap;

use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, DVec3};

use enfilade_demo::solid::newell;

/// Naive surface nets (Gibson 1998, "Constrained elastic surface nets"): a vertex in each cell of a grid that
/// the surface passes, at the mean of its crossings with the cell's edges; a quadrangle for each edge of the
/// grid that it crosses.
///
/// `field` is negative in the air, which the faces face; `bounds` contains the air with a margin of one cell.
/// `grid` is the size of a cell. [Units: wu]
pub(crate) fn surface_net(
    field: impl Fn(DVec3) -> f64,
    bounds: Aabb,
    grid: f64,
    material: u32,
) -> Primitive {
    let gradient = |p: DVec3| {
        let h = grid * 0.5;
        let d = |axis: DVec3| field(p + axis * h) - field(p - axis * h);
        DVec3::new(d(DVec3::X), d(DVec3::Y), d(DVec3::Z))
    };
    let n = (bounds.size() / grid)
        .ceil()
        .to_array()
        .map(|x| x as usize + 1);
    let stride = [1, n[0], n[0] * n[1]];
    let cell_of = |i: usize| [i % n[0], i / n[0] % n[1], i / (n[0] * n[1])];
    let at = |c: [usize; 3]| bounds.min + DVec3::new(c[0] as f64, c[1] as f64, c[2] as f64) * grid;
    let values: Vec<f64> = (0..n[0] * n[1] * n[2])
        .map(|i| field(at(cell_of(i))))
        .collect();
    let offset = |corner: usize| (0..3).map(|a| (corner >> a & 1) * stride[a]).sum::<usize>();

    let mut p = Primitive {
        material: Some(material),
        ..Primitive::default()
    };
    let mut positions: Vec<DVec3> = Vec::new();
    let mut corner_of: HashMap<usize, u32> = HashMap::new();
    for i in 0..values.len() {
        let cell = cell_of(i);
        if (0..3).any(|a| cell[a] + 1 >= n[a]) {
            continue;
        }
        let (mut sum, mut count) = (DVec3::ZERO, 0);
        for corner in 0..8 {
            for axis in (0..3).filter(|a| corner >> a & 1 == 0) {
                let (a, b) = (i + offset(corner), i + offset(corner | 1 << axis));
                let (va, vb) = (values[a], values[b]);
                if (va < 0.0) != (vb < 0.0) {
                    sum += at(cell_of(a)).lerp(at(cell_of(b)), va / (va - vb));
                    count += 1;
                }
            }
        }
        if count > 0 {
            corner_of.insert(i, positions.len() as u32);
            positions.push(sum / f64::from(count));
        }
    }
    for i in 0..values.len() {
        let cell = cell_of(i);
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            if cell[axis] + 1 >= n[axis] || cell[u] == 0 || cell[v] == 0 {
                continue;
            }
            let (inside, ahead) = (values[i] < 0.0, values[i + stride[axis]] < 0.0);
            if inside == ahead {
                continue;
            }
            let cells = [i - stride[u] - stride[v], i - stride[v], i, i - stride[u]];
            let quad = cells.map(|c| corner_of[&c]);
            // As listed it faces along the axis, where the air must be.
            let [a, b, c, d] = if ahead {
                quad
            } else {
                [quad[3], quad[2], quad[1], quad[0]]
            };
            p.indices.extend([a, b, c, a, c, d]);
        }
    }
    for &q in &positions {
        p.positions.push(q.as_vec3().to_array());
        p.normals
            .push((-gradient(q)).normalize_or(DVec3::Y).as_vec3().to_array());
    }
    debug_assert!(p.triples().iter().any(|t| {
        let t = t.map(|i| positions[i as usize]);
        newell(&t).dot(-gradient(t[0])) > 0.0
    }));
    p
}
