//! Vessels: tubes with round ends that run into one another.

use enfilade_geom::scene::{Mesh, Role};
use enfilade_geom::{Aabb, DMat4, DVec3};

use crate::cave::distance_to_segment;
use crate::site::{Generated, Site};
use crate::surface_net::surface_net;

/// The points nearer than `radius` to the line between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    /// Ends of its axis, which differ. [Units: wu]
    pub ends: [DVec3; 2],
    /// [Units: wu] [Limit: above 0]
    pub radius: f64,
}

/// The surface of what lies in any of some tubes, closed and facing the air. There is no way out.
///
/// It is meshed with triangles of about `grid`, which a tube should be six of across for its radius to be right to a
/// hundredth or so. Its truth is empty: which tubes are cells of their own is the tests' question.
///
/// # Panics
/// Without tubes, since there is no surface then.
#[must_use]
pub fn tubes(tubes: &[Tube], grid: f64) -> Generated {
    assert!(!tubes.is_empty(), "there is no surface without tubes");
    let mut bounds = Aabb::EMPTY;
    for t in tubes {
        for end in t.ends {
            bounds = bounds.including(end - t.radius).including(end + t.radius);
        }
    }
    let field = |p: DVec3| {
        let distance = |t: &Tube| distance_to_segment(p, t.ends[0], t.ends[1]) - t.radius;
        tubes.iter().map(distance).fold(f64::INFINITY, f64::min)
    };
    let mut site = Site::new("tubes");
    let material = site.material("wall", [0.62, 0.25, 0.22]);
    let net = surface_net(field, bounds.expanded(2.0 * grid), grid, material);
    let mesh = site.add_mesh(Mesh {
        name: "walls".into(),
        primitives: vec![net],
    });
    site.place("walls", mesh, DMat4::IDENTITY, Role::Structural);
    site.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_lie_on_a_tube() {
        let tube = Tube {
            ends: [DVec3::ZERO, DVec3::new(3.0, 1.0, 0.5)],
            radius: 0.7,
        };
        let g = tubes(&[tube], 0.1);
        let positions = &g.scene.meshes[0].primitives[0].positions;
        assert!(positions.len() > 1000);
        for p in positions {
            let p = DVec3::from_array(p.map(f64::from));
            let d = distance_to_segment(p, tube.ends[0], tube.ends[1]);
            // A cell's corner is the mean of points on the surface: below it by h² / 8r or so.
            assert!((d - tube.radius).abs() < 0.1 * 0.1 / 0.7, "{d} at {p}");
        }
    }
}
