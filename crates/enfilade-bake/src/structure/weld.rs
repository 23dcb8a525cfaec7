//! Joins vertices that drifted apart.

use std::collections::HashMap;

use enfilade_geom::{DVec3, Triangle};
use rayon::prelude::*;

/// Triangles over shared points.
pub(super) struct PointMesh {
    pub(super) points: Vec<DVec3>,
    /// The points of each triangle.
    pub(super) corners: Vec<[u32; 3]>,
}

impl PointMesh {
    /// Joins vertices within `reach` of the least one not yet joined.
    pub(super) fn of(triangles: &[Triangle], reach: f64) -> Self {
        let vertex = |i: u32| triangles[i as usize / 3][i as usize % 3];
        let mut order: Vec<u32> = (0..3 * triangles.len() as u32).collect();
        order.par_sort_by(|&i, &j| {
            let (a, b) = (vertex(i), vertex(j));
            let by = |k: usize| a[k].total_cmp(&b[k]);
            by(0).then_with(|| by(1)).then_with(|| by(2))
        });
        // Lists of the distinct positions in each box of the grid, linked.
        let mut distinct: Vec<(DVec3, u32)> = Vec::new();
        let mut position_of = vec![0_u32; order.len()];
        for &i in &order {
            let p = vertex(i);
            match distinct.last_mut() {
                Some((last, n)) if *last == p => *n += 1,
                _ => distinct.push((p, 1)),
            }
            position_of[i as usize] = distinct.len() as u32 - 1;
        }
        let cell = |p: DVec3| (p / reach).floor().to_array().map(|x| x as i64);
        let mut first: HashMap<[i64; 3], u32> = HashMap::with_capacity(distinct.len());
        let mut next = vec![NONE; distinct.len()];
        for (i, (p, _)) in distinct.iter().enumerate().rev() {
            next[i] = first.insert(cell(*p), i as u32).unwrap_or(NONE);
        }
        let mut point_of = vec![NONE; distinct.len()];
        let mut points: Vec<DVec3> = Vec::new();
        for i in 0..distinct.len() {
            if point_of[i] != NONE {
                continue;
            }
            let (p, _) = distinct[i];
            let at = cell(p);
            let mut sum = (DVec3::ZERO, 0.0);
            for around in 0..27_i64 {
                let by = [around % 3 - 1, around / 3 % 3 - 1, around / 9 - 1];
                let key = std::array::from_fn(|k| at[k] + by[k]);
                let mut j = first.get(&key).copied().unwrap_or(NONE);
                while j != NONE {
                    let (q, n) = distinct[j as usize];
                    if point_of[j as usize] == NONE && q.distance(p) <= reach {
                        point_of[j as usize] = points.len() as u32;
                        sum = (sum.0 + (q - p) * f64::from(n), sum.1 + f64::from(n));
                    }
                    j = next[j as usize];
                }
            }
            points.push(p + sum.0 / sum.1);
        }
        let point = |i: usize| point_of[position_of[i] as usize];
        Self {
            points,
            corners: (0..triangles.len())
                .map(|t| [0, 1, 2].map(|k| point(3 * t + k)))
                .collect(),
        }
    }

    /// Returns the triangles with their vertices at the points.
    pub(super) fn triangles(&self) -> Vec<Triangle> {
        let place = |ids: &[u32; 3]| ids.map(|i| self.points[i as usize]);
        self.corners.iter().map(place).collect()
    }
}

/// End of a list.
const NONE: u32 = u32::MAX;
