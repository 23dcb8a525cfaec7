//! The minimal graph for computing visibility: cells joined by convex openings.

use enfilade_geom::DVec3;

use crate::CellPortalGraph;

/// A convex opening between two cells.
#[derive(Clone, Debug, PartialEq)]
pub struct SightPortal {
    /// The two cells; the winding's normal points from the first to the second.
    pub cells: [u32; 2],
    /// Vertices, counter-clockwise seen from the second cell. [Units: wu]
    pub winding: Vec<DVec3>,
    /// The open convex parts of the winding, each with at least three vertices in the same orientation; empty if all
    /// of it is open.
    pub pieces: Vec<Vec<DVec3>>,
}

/// Cells and the openings between them, from any source: a world, a portal file of a game, a generator.
///
/// Directed portals have numbers: `2 i` leads from the first cell of portal `i` to its second, `2 i + 1` the other
/// way.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SightGraph {
    /// Number of cells.
    pub n_cells: u32,
    /// The openings.
    pub portals: Vec<SightPortal>,
}

/// The reasons why cells and windings are not a valid [`SightGraph`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SightGraphError {
    /// A portal refers to a cell that does not exist.
    #[error("portal {portal} refers to cell {cell}, but there are only {n_cells} cells")]
    NoSuchCell {
        /// The portal's number.
        portal: usize,
        /// The cell that it refers to.
        cell: u32,
        /// Number of cells.
        n_cells: u32,
    },
    /// A portal leads from a cell to itself.
    #[error("portal {portal} joins cell {cell} to itself; remove it")]
    SelfLoop {
        /// The portal's number.
        portal: usize,
        /// The cell.
        cell: u32,
    },
    /// A portal has no area.
    #[error("portal {portal} has {n} vertices, but needs at least 3; remove it")]
    TooFewCorners {
        /// The portal's number.
        portal: usize,
        /// Its number of vertices.
        n: usize,
    },
    /// A coordinate is not a number or beyond [`SightGraph::MAX_COORDINATE`].
    #[error("portal {portal}, vertex {corner}: coordinate {value} is out of range")]
    BadCoordinate {
        /// The portal's number.
        portal: usize,
        /// Index of the vertex.
        corner: usize,
        /// The coordinate.
        value: f64,
    },
    /// More vertices or portals than ids can hold.
    #[error("{n} {what}, more than the limit of {limit}; split the graph")]
    TooMany {
        /// Plural name of the items.
        what: &'static str,
        /// Their number.
        n: usize,
        /// The largest number allowed.
        limit: usize,
    },
}

impl SightGraph {
    /// Largest coordinate. Sums of products of three stay far inside `f64`. [Units: wu]
    pub const MAX_COORDINATE: f64 = 1e9;
    /// Most portals. The search keeps a bit for each pair of directions.
    pub const MAX_PORTALS: usize = 1 << 20;
    /// Most vertices of one portal.
    pub const MAX_CORNERS: usize = 1024;
    /// Most cells.
    pub const MAX_CELLS: usize = 1 << 20;

    /// Makes the graph of a world: each portal by its convex outline.
    #[must_use]
    pub fn of_graph(graph: &CellPortalGraph) -> Self {
        Self {
            n_cells: u32::try_from(graph.cells.len()).unwrap_or(u32::MAX),
            portals: graph
                .portals
                .iter()
                .map(|portal| SightPortal {
                    cells: [portal.cells[0].0, portal.cells[1].0],
                    winding: corners(&portal.outline),
                    pieces: portal.pieces.iter().map(|piece| corners(piece)).collect(),
                })
                .collect(),
        }
    }

    /// Makes the graph of cells and outlines, as in a portal file. Leaves out outlines with fewer than three
    /// vertices, which have no area.
    #[must_use]
    pub fn of_windings(
        n_cells: u32,
        portals: impl IntoIterator<Item = ([u32; 2], Vec<DVec3>)>,
    ) -> Self {
        let has_area = |(_, winding): &([u32; 2], Vec<DVec3>)| winding.len() >= 3;
        let portal = |(cells, winding)| SightPortal {
            cells,
            winding,
            pieces: Vec::new(),
        };
        Self {
            n_cells,
            portals: portals.into_iter().filter(has_area).map(portal).collect(),
        }
    }

    /// Returns a hash of the graph: FNV-1a, 64 bits, over the numbers of cells and portals, then for each portal its
    /// cells, and for its winding and each of its pieces the number of vertices and the vertices, all little-endian,
    /// counts as 32 bits and coordinates as `f64`.
    #[must_use]
    #[doc(hidden)]
    pub fn content_hash(&self) -> u64 {
        let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
        hash.count(self.n_cells as usize);
        hash.count(self.portals.len());
        for portal in &self.portals {
            hash.count(portal.cells[0] as usize);
            hash.count(portal.cells[1] as usize);
            hash.winding(&portal.winding);
            hash.count(portal.pieces.len());
            for piece in &portal.pieces {
                hash.winding(piece);
            }
        }
        hash.0
    }

    /// Checks ids, numbers and limits.
    ///
    /// Windings with area zero are allowed: lines through them only touch.
    ///
    /// # Errors
    ///
    /// The first fault found.
    pub fn validate(&self) -> Result<(), SightGraphError> {
        let limits = [
            ("portals", self.portals.len(), Self::MAX_PORTALS),
            ("cells", self.n_cells as usize, Self::MAX_CELLS),
        ];
        for (what, n, limit) in limits {
            if n > limit {
                return Err(SightGraphError::TooMany { what, n, limit });
            }
        }
        for (i, portal) in self.portals.iter().enumerate() {
            check_portal(i, portal, self.n_cells)?;
        }
        Ok(())
    }
}

struct Fnv(u64);

impl Fnv {
    fn bytes(&mut self, bytes: &[u8]) {
        for &b in bytes {
            self.0 = (self.0 ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn count(&mut self, n: usize) {
        self.bytes(&(n as u32).to_le_bytes());
    }

    fn winding(&mut self, winding: &[DVec3]) {
        self.count(winding.len());
        for x in winding.iter().flat_map(DVec3::to_array) {
            self.bytes(&x.to_le_bytes());
        }
    }
}

fn check_portal(i: usize, portal: &SightPortal, n_cells: u32) -> Result<(), SightGraphError> {
    if let Some(&cell) = portal.cells.iter().find(|&&c| c >= n_cells) {
        return Err(SightGraphError::NoSuchCell {
            portal: i,
            cell,
            n_cells,
        });
    }
    if portal.cells[0] == portal.cells[1] {
        return Err(SightGraphError::SelfLoop {
            portal: i,
            cell: portal.cells[0],
        });
    }
    check_winding(i, &portal.winding)?;
    portal
        .pieces
        .iter()
        .try_for_each(|piece| check_winding(i, piece))
}

fn check_winding(portal: usize, winding: &[DVec3]) -> Result<(), SightGraphError> {
    let n = winding.len();
    if n < 3 {
        return Err(SightGraphError::TooFewCorners { portal, n });
    }
    if n > SightGraph::MAX_CORNERS {
        return Err(SightGraphError::TooMany {
            what: "vertices of a portal",
            n,
            limit: SightGraph::MAX_CORNERS,
        });
    }
    for (corner, p) in winding.iter().enumerate() {
        for value in p.to_array() {
            if value.is_nan() || value.abs() > SightGraph::MAX_COORDINATE {
                return Err(SightGraphError::BadCoordinate {
                    portal,
                    corner,
                    value,
                });
            }
        }
    }
    Ok(())
}

fn corners(outline: &[[f32; 3]]) -> Vec<DVec3> {
    outline
        .iter()
        .map(|p| DVec3::from_array(p.map(f64::from)))
        .collect()
}
