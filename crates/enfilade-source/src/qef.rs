//! The point nearest to several planes: where a surface has an edge or a vertex.

use enfilade_geom::{DMat3, DVec3};

/// Directions in which the planes constrain the point less than this share of the most constrained one are left as in the
/// mean: along a flat or smooth surface, rounding would move the vertex anywhere.
const FLAT: f64 = 0.03;

/// Returns the point with the least sum of squared distances from planes through `points` with unit `normals`; where they leave
/// it free, it stays near the mean of the points.
///
/// After Ju, Losasso, Schaefer & Warren, "Dual contouring of Hermite data" (2002), section 2.1.
pub(crate) fn nearest_to_planes(points: &[DVec3], normals: &[DVec3]) -> DVec3 {
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for (p, n) in points.iter().zip(normals) {
        matrix += DMat3::from_cols(*n * n.x, *n * n.y, *n * n.z);
        right += *n * n.dot(*p - mean);
    }
    let (values, vectors) = eigen(matrix);
    let most = values.into_iter().fold(0.0, f64::max);
    let mut x = mean;
    for (value, vector) in values.into_iter().zip(vectors) {
        if value > FLAT * most {
            x += vector * (vector.dot(right) / value);
        }
    }
    x
}

/// Returns the eigenvalues and unit eigenvectors of a symmetric matrix, by Jacobi's rotations.
pub(crate) fn eigen(matrix: DMat3) -> ([f64; 3], [DVec3; 3]) {
    let mut a = matrix.to_cols_array_2d();
    let mut vectors = DMat3::IDENTITY.to_cols_array_2d();
    for _ in 0..12 {
        let scale = a[0][0].abs() + a[1][1].abs() + a[2][2].abs();
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q].abs() <= 1e-15 * scale {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let turned = |x: f64, y: f64| (c * x - s * y, s * x + c * y);
            for row in &mut a {
                (row[p], row[q]) = turned(row[p], row[q]);
            }
            // Rows of the matrix, and vectors, which are the columns of the rotation.
            for rows in [&mut a, &mut vectors] {
                let [x, y] = [rows[p], rows[q]].map(DVec3::from_array);
                rows[p] = (x * c - y * s).to_array();
                rows[q] = (x * s + y * c).to_array();
            }
        }
    }
    let values = [a[0][0], a[1][1], a[2][2]];
    (values, vectors.map(DVec3::from_array))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_in_their_vertex_and_one_leaves_the_mean() {
        let points = [
            DVec3::new(1.0, 0.2, 0.3),
            DVec3::new(0.1, 2.0, 0.4),
            DVec3::new(0.3, 0.1, 3.0),
        ];
        let x = nearest_to_planes(&points, &DVec3::AXES);
        assert!(x.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-12, "{x}");
        let flat = points.map(|p| p.with_y(0.5));
        let x = nearest_to_planes(&flat, &[DVec3::Y; 3]);
        assert!(x.distance(flat.iter().sum::<DVec3>() / 3.0) < 1e-12, "{x}");
    }

    #[test]
    fn eigenvectors_are_those_of_the_matrix() {
        let m = DMat3::from_cols(
            DVec3::new(4.0, 1.0, -2.0),
            DVec3::new(1.0, 3.0, 0.5),
            DVec3::new(-2.0, 0.5, 1.0),
        );
        let (values, vectors) = eigen(m);
        for (value, vector) in values.into_iter().zip(vectors) {
            assert!((m * vector - vector * value).length() < 1e-12);
        }
    }
}
