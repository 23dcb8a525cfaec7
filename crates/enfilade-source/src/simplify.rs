//! Fewer triangles for a closed surface, within a distance.
//!
//! Edges are collapsed in the order of their quadric error (Garland & Heckbert, "Surface simplification using quadric error
//! metrics", 1997). The error is only the order: what bounds the distance are the vertices of the input, which stay assigned to
//! the triangles nearest to them, after Ciampalini, Cignoni, Montani & Scopigno, "Multiresolution decimation based on global
//! error" (1997). A collapse that would leave one of them farther than the tolerance is not made.

mod collapse;
mod quadric;

use enfilade_geom::{DVec3, Purse};

use collapse::Mesh;

/// Collapses edges while every vertex of the input stays within `tolerance` of the result, and returns the largest distance
/// that one has. The surface stays closed and keeps its pieces and holes. It stays as it is where the purse is empty.
pub(crate) fn simplify(
    positions: &mut Vec<DVec3>,
    triangles: &mut Vec<[u32; 3]>,
    tolerance: f64,
    purse: Purse<'_>,
) -> f64 {
    let mut mesh = Mesh::new(positions, triangles, tolerance, purse);
    mesh.collapse_all();
    let (kept, left, distance) = mesh.finish();
    (*positions, *triangles) = (kept, left);
    distance
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    use enfilade_geom::{Aabb, closest_point_on_triangle};

    use crate::implicit::ImplicitScene;
    use crate::{ExtractOptions, SourceLimits, Surface, extract};

    fn surface(text: &str, tolerance: f64) -> Surface {
        let limits = SourceLimits::default();
        let scene = ImplicitScene::parse(text.as_bytes(), &limits).unwrap();
        let mut options = ExtractOptions::of_step(scene.bounds(), scene.step());
        options.tolerance = tolerance;
        extract(&scene, &options, &limits).unwrap()
    }

    fn assert_closed(s: &Surface) {
        let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for t in &s.triangles {
            for i in 0..3 {
                let (a, b) = (t[i], t[(i + 1) % 3]);
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|&n| n == 0));
    }

    #[test]
    fn every_vertex_of_the_input_stays_within_the_tolerance_and_the_surface_stays_closed() {
        let text = r#"{"enfilade":"implicit","step":0.1,"air":{"smooth_union":{"by":0.4,"of":[
            {"ball":{"at":[0,0,0],"radius":1}},{"tube":{"points":[[0,0,0],[2,0.3,0.5]],"radius":0.5}}]}}}"#;
        let (fine, coarse) = (surface(text, 0.0), surface(text, 0.02));
        assert_closed(&fine);
        assert_closed(&coarse);
        assert!(coarse.triangles.len() * 4 < fine.triangles.len());
        let corners = |t: &[u32; 3]| t.map(|i| coarse.positions[i as usize]);
        for p in &fine.positions {
            let nearest = coarse
                .triangles
                .iter()
                .map(|t| closest_point_on_triangle(*p, &corners(t)));
            let d = nearest
                .map(|q| q.distance(*p))
                .fold(f64::INFINITY, f64::min);
            assert!(d <= 0.02 + 1e-12, "{d}");
        }
        assert!(
            coarse.distance >= fine.distance && coarse.distance <= fine.distance + 0.02 + 1e-12
        );
    }

    #[test]
    fn a_box_becomes_twelve_triangles_with_its_own_vertices() {
        let text =
            r#"{"enfilade":"implicit","step":0.25,"matter":{"box":{"min":[0,0,0],"max":[3,2,1]}}}"#;
        let s = surface(text, 0.01);
        assert_closed(&s);
        assert_eq!(s.triangles.len(), 12, "{:?}", s.positions);
        let bounds = Aabb::of_points(&s.positions);
        assert!(
            bounds.min.length() < 1e-6 && bounds.max.distance(DVec3::new(3.0, 2.0, 1.0)) < 1e-6
        );
    }
}
