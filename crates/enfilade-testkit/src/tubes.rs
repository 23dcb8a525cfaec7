//! Vessels: tubes with round ends that merge.

use enfilade_geom::scene::{Mesh, Role};
use enfilade_geom::{Aabb, DMat4, DVec3};

use crate::cave::distance_to_segment;
use crate::surface_net::surface_net;
use enfilade_demo::{Generated, Site};

/// The points within `radius` of the segment between two ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    /// Ends of its axis, which differ. [Units: wu]
    pub ends: [DVec3; 2],
    /// Radius. [Units: wu] [Limit: above 0]
    pub radius: f64,
}

/// The surface of the union of some tubes, closed and facing the air, without a way out.
///
/// The mesh has triangles of about `grid`; a tube should be six of these across for its radius to be correct to a hundredth or
/// so. Its truth is empty: the division into cells is left to the tests.
///
/// # Panics
/// If there are no tubes, since there is no surface then.
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
    surface_of("tubes", field, bounds.expanded(2.0 * grid), grid)
}

/// The surface of any field, negative in the air, which the faces face.
///
/// `bounds` contains the air with a margin of one `grid`, the size of the triangles. The truth is empty. [Units: wu]
#[must_use]
pub fn surface_of(name: &str, field: impl Fn(DVec3) -> f64, bounds: Aabb, grid: f64) -> Generated {
    let mut site = Site::new(name);
    let material = site.material("wall", [0.62, 0.25, 0.22]);
    let net = surface_net(field, bounds, grid, material);
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
    fn vertices_lie_on_a_tube() {
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
            // A cell's vertex is the mean of points on the surface: below it by h² / 8r or so.
            assert!((d - tube.radius).abs() < 0.1 * 0.1 / 0.7, "{d} at {p}");
        }
    }
}
