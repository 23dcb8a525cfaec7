//! Facts about the surfaces of a room.

use enfilade_cpg::{CellId, PortalId};
use enfilade_geom::DVec3;

use super::merge::{Rings, ring_area};
use super::piece::SurfaceCover;

/// The space behind a boundary surface, through the thickness of the construction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Behind {
    /// Another cell: a room, a void, open land or the outdoors. The room itself behind a pier that stands in it.
    Cell(CellId),
    /// The ground: the outdoors of the model, below the level at which people step out.
    Ground,
    /// Only matter, as far as a construction reaches: the end of a wall, the side of a reveal, rock.
    Matter,
}

/// A planar piece of the surface of a room.
#[derive(Clone, Debug)]
pub struct BoundarySurface {
    /// Loops of vertices: the outer one, counter-clockwise seen from outside of the room, then holes, clockwise. Neighbors share
    /// their vertices. [Units: wu]
    pub loops: Vec<Vec<[f64; 3]>>,
    /// Unit normal, out of the room.
    pub normal: [f64; 3],
    /// Area without the holes. [Units: wu²]
    pub area: f64,
    /// Thing that it is made of.
    pub cover: SurfaceCover,
    /// Space behind it.
    pub behind: Behind,
    /// Thickness of the construction in the middle; 0 for openings and sheets. The reach of the search where only matter was
    /// found. [Units: wu]
    pub thickness: f64,
    /// The surface of the room behind that answers this one, as an index into [`RoomSurfaces::surfaces`] of that room.
    pub pair: Option<usize>,
    /// For an opening, the wall, floor or roof of the same room in which it is, as an index into the same list.
    pub host: Option<usize>,
}

impl BoundarySurface {
    /// Returns the portal if it is an opening.
    #[must_use]
    pub fn opening(&self) -> Option<PortalId> {
        match self.cover {
            SurfaceCover::Opening(portal) => Some(portal),
            SurfaceCover::Object { .. } | SurfaceCover::Bare => None,
        }
    }

    /// Returns the mean of the outer loop's vertices. [Units: wu]
    #[must_use]
    pub fn center(&self) -> [f64; 3] {
        let outer = self.loops.first().map_or(&[][..], Vec::as_slice);
        let sum: DVec3 = outer.iter().map(|&p| DVec3::from(p)).sum();
        (sum / outer.len().max(1) as f64).to_array()
    }
}

/// The boundary of a room: closed, as planar polygons.
#[derive(Clone, Debug)]
pub struct RoomSurfaces {
    /// The cell.
    pub cell: CellId,
    /// The surfaces; openings after all others.
    pub surfaces: Vec<BoundarySurface>,
    /// Length of the sum of all area vectors; 0 for a closed boundary. [Units: wu²]
    pub gap: f64,
    /// Edges of polygons without an opposite; none in a closed boundary.
    pub n_open_edges: usize,
    /// Volume inside by divergence. [Units: wu³]
    pub volume: f64,
}

impl RoomSurfaces {
    /// Returns the openings in a surface, ascending. O(surfaces).
    pub fn openings_in(&self, surface: usize) -> impl Iterator<Item = usize> {
        let numbered = self.surfaces.iter().enumerate();
        numbered
            .filter(move |(_, s)| s.host == Some(surface))
            .map(|(i, _)| i)
    }
}

/// Returns the sum of area vectors, and the volume, of polygons about a point. [Units: wu², wu³]
pub(crate) fn sums<'r>(
    points: &[DVec3],
    about: DVec3,
    polygons: impl Iterator<Item = &'r Rings>,
) -> (DVec3, f64) {
    let (mut vector, mut volume) = (DVec3::ZERO, 0.0);
    for ring in polygons.flatten() {
        let area = ring_area(points, ring);
        vector += area;
        // A fan of tetrahedra, exact also where welding bent the polygon.
        let o = points[ring[0] as usize] - about;
        for e in ring.windows(2) {
            let [a, b] = [e[0], e[1]].map(|v| points[v as usize] - about);
            volume += o.dot(a.cross(b)) / 6.0;
        }
    }
    (vector, volume)
}
