//! Sample points of an opening for length searches: its vertices, points along its edges, and a lattice in it.
//!
//! Paths bend at vertices and edges, and cross elsewhere: both are needed. O(points).

use enfilade_geom::{DVec3, Winding};

/// Density of the sample points in an opening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Maximum distance between neighboring points. Infinite: one point per piece, its middle. [Units: wu] [Limit: above 0]
    pub spacing: f64,
    /// Maximum number of points of one piece: a larger piece has them farther apart. [Limit: above 0]
    pub most: usize,
}

impl Default for Sampling {
    /// About ten points in a doorway.
    fn default() -> Self {
        Self {
            spacing: 1.0,
            most: 64,
        }
    }
}

impl Sampling {
    /// One point per piece: the fastest search, if a few percent do not matter.
    pub const MIDDLES: Self = Self {
        spacing: f64::INFINITY,
        most: 1,
    };
}

/// Adds points of a convex piece: its vertices, points along its edges, and a lattice in it.
pub(crate) fn sample(piece: &[DVec3], sampling: Sampling, points: &mut Vec<DVec3>) {
    let winding = Winding::new(piece.to_vec());
    let first = points.len();
    let mut spacing = sampling.spacing;
    if sampling.most > 1 && spacing.is_finite() {
        loop {
            add_edges(piece, spacing, points);
            add_lattice(&winding, spacing, points);
            if points.len() - first <= sampling.most || points.len() - first <= piece.len() + 1 {
                break;
            }
            points.truncate(first);
            spacing *= 1.25;
        }
    }
    if points.len() == first {
        points.push(winding.centroid());
    }
}

fn add_edges(piece: &[DVec3], spacing: f64, points: &mut Vec<DVec3>) {
    for (i, &a) in piece.iter().enumerate() {
        let b = piece[(i + 1) % piece.len()];
        let n = (a.distance(b) / spacing).ceil().clamp(1.0, 1e4);
        points.extend((0..n as usize).map(|k| a.lerp(b, k as f64 / n)));
    }
}

fn add_lattice(winding: &Winding, spacing: f64, points: &mut Vec<DVec3>) {
    let corners = &winding.points;
    let longest = (0..corners.len())
        .map(|i| corners[(i + 1) % corners.len()] - corners[i])
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let u = longest.unwrap_or_default().normalize_or_zero();
    let v = winding.area_normal().normalize_or_zero().cross(u);
    let range = |axis: DVec3| {
        let along = corners.iter().map(|p| p.dot(axis));
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        })
    };
    let (u_range, v_range) = (range(u), range(v));
    let n = |(low, high): (f64, f64)| ((high - low) / spacing).ceil().clamp(1.0, 1e3) as usize;
    // For a piece narrower than the spacing the edges and its middle suffice.
    let [n_u, n_v] = [n(u_range), n(v_range)].map(|n| n.max(2));
    let at = |(low, high): (f64, f64), k: usize, n: usize| low + (high - low) * k as f64 / n as f64;
    let origin = corners[0] - u * corners[0].dot(u) - v * corners[0].dot(v);
    for i in 1..n_u {
        for j in 1..n_v {
            let p = origin + u * at(u_range, i, n_u) + v * at(v_range, j, n_v);
            if winding.contains_in_plane(p, -0.2 * spacing.min(u_range.1 - u_range.0) / n_u as f64)
            {
                points.push(p);
            }
        }
    }
}
