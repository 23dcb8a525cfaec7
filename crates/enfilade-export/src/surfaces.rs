//! Facts of surfaces: the planar polygons around each room, what they are made of, and what lies behind.
//!
//! | stage | file |
//! | --- | --- |
//! | the exact faces between cells, from the tree that locates points | `faces` |
//! | cut by portals and by the objects whose triangles lie in them | `cover` |
//! | cut again where what lies behind the construction changes | `behind` |
//! | one set of vertices for each room, so that polygons close | `weld` |
//! | pieces of one plane with the same answers merged to polygons with holes | `merge`, `slivers`, `outline` |
//! | surfaces that answer each other, and the walls of openings | `pairs` |
//! | walls together with their openings, for writers | `hosted` |
//! | if asked for, openings moved to the faces of their walls | `recess` |
//!
//! **Complexity:** O(n log n) for n triangles spread out in space, and O(k²) for k surfaces over one another in one construction.
//! **Numerics:** faces are exact to the rounding of `f64`; then vertices within 2 mm become one, which is what coordinates of models
//! are worth, and makes a boundary closed by its topology, not by luck.

mod behind;
mod cover;
mod faces;
mod ground;
mod hosted;
mod merge;
mod outline;
mod pairs;
mod part;
mod piece;
mod planes;
mod recess;
mod room;
mod slivers;
mod weld;

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, World};
use enfilade_geom::DVec3;

use behind::Backs;
use cover::Coverings;
pub(crate) use ground::{ground_level, is_ground};
use merge::Rings;
pub(crate) use part::{Key, Part};
use piece::Piece;

use slivers::Told;

pub(crate) use hosted::{HostedFace, hosted_faces};
pub use piece::SurfaceCover;
pub use room::{Behind, BoundarySurface, RoomSurfaces};

/// Level of detail of boundary surfaces, in the words of IFC.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SurfaceLevel {
    /// As the room sees them: one for each plane and object. What lies behind is that of the largest part.
    First,
    /// Cut where what lies behind changes, so that surfaces of two rooms answer each other.
    #[default]
    Second,
}

/// Settings of [`room_surfaces`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// Level of detail.
    pub level: SurfaceLevel,
    /// Thickest construction: what lies farther behind does not count. [Units: wu] [Limit: above 0]
    pub max_thickness: f64,
    /// Height of the ground; `None` is that at which people step out of the building. [Units: wu]
    pub ground: Option<f64>,
    /// Cut surfaces where the object that makes them changes. Otherwise only openings and planes part them.
    pub by_object: bool,
    /// Count the recesses of openings, where they are prisms, to their walls: then an opening lies in the face of its wall, and the
    /// sides of its reveal are not surfaces. Volumes are smaller by the recesses.
    pub fills_recesses: bool,
    /// Vertices that are closer are one, and thinner pieces vanish: finer than what builders draw, coarser than the steps of
    /// coordinates. [Units: wu] [Limit: above 0]
    pub tolerance: f64,
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        Self {
            level: SurfaceLevel::Second,
            max_thickness: 1.5,
            ground: None,
            by_object: true,
            fills_recesses: false,
            tolerance: 2e-3,
        }
    }
}

/// Returns the settings for models of energy: second level, with openings in the faces of their walls.
pub(crate) fn flat_openings() -> SurfaceOptions {
    SurfaceOptions {
        fills_recesses: true,
        // Finer than that of the files' own tolerance, within which they want their faces planar.
        tolerance: 5e-4,
        ..SurfaceOptions::default()
    }
}

/// Returns the boundary surfaces of all rooms and voids, by cell. The world must be valid.
///
/// Time: that of finding what lies behind each piece, which grows with the number of small triangles in walls.
#[must_use]
pub fn room_surfaces(world: &World, options: &SurfaceOptions) -> Vec<RoomSurfaces> {
    let mut pieces = pieces_of(world, options);
    planes::number_planes(&mut pieces);
    let backs = Backs::new(&pieces, options.max_thickness);
    let ground = (options.ground).or_else(|| ground_level(world));
    let mut by_cell: BTreeMap<CellId, Vec<Part>> = BTreeMap::new();
    for (cell, _) in world.graph.indoor_cells() {
        by_cell.insert(cell, Vec::new());
    }
    for piece in &pieces {
        if let Some(parts) = by_cell.get_mut(&piece.cell) {
            add_parts(world, piece, &pieces, &backs, ground, parts);
        }
    }
    let mut rooms = all_assembled(&by_cell, options);
    if options.fills_recesses {
        recess::fill(&rooms, &mut by_cell);
        rooms = all_assembled(&by_cell, options);
    }
    pairs::pair(&mut rooms);
    rooms
}

/// Merges the parts of all cells, and finds the walls of openings.
fn all_assembled(
    by_cell: &BTreeMap<CellId, Vec<Part>>,
    options: &SurfaceOptions,
) -> Vec<RoomSurfaces> {
    let cells = by_cell.iter();
    let mut rooms: Vec<RoomSurfaces> = cells
        .map(|(&cell, parts)| assembled(cell, parts, options))
        .collect();
    rooms.iter_mut().for_each(pairs::find_hosts);
    rooms
}

/// Returns the pieces of the boundaries of all cells.
fn pieces_of(world: &World, options: &SurfaceOptions) -> Vec<Piece> {
    let coverings = Coverings::new(world, options.by_object);
    let mut pieces = Vec::new();
    for face in faces::faces_between_cells(&world.graph.locator) {
        coverings.pieces_of(&face, &mut pieces);
    }
    pieces
}

/// Cuts a piece where what lies behind it changes, and appends the parts.
fn add_parts(
    world: &World,
    piece: &Piece,
    pieces: &[Piece],
    backs: &Backs<'_>,
    ground: Option<f64>,
    parts: &mut Vec<Part>,
) {
    let mut add = |points: Vec<DVec3>, behind: Behind, far: Option<(u32, SurfaceCover)>, depth| {
        let key = Key {
            plane: piece.plane,
            cover: piece.cover,
            behind,
            far,
        };
        parts.push(Part {
            key,
            normal: piece.normal,
            points,
            depth,
        });
    };
    let told = |cell: CellId, points: &[DVec3]| {
        if world.graph[cell].outdoor && is_ground(ground, points, piece.normal) {
            Behind::Ground
        } else {
            Behind::Cell(cell)
        }
    };
    if let Some(cell) = piece.across {
        // An opening leads outdoors, however deep it is.
        let behind = match piece.cover {
            SurfaceCover::Opening(_) => Behind::Cell(cell),
            _ => told(cell, &piece.points),
        };
        return add(piece.points.clone(), behind, None, 0.0);
    }
    for backed in backs.behind(piece) {
        let points = backed.points.to_vec();
        match backed.far {
            Some(id) => {
                let other = &pieces[id as usize];
                let behind = told(other.cell, &points);
                // The outdoors has no surfaces that answer.
                let answers = world.graph[other.cell].is_indoors();
                let far = answers.then_some((other.plane, other.cover));
                add(points, behind, far, backed.depth);
            }
            None => {
                let behind = if is_ground(ground, &points, piece.normal) && piece.normal.y < -0.5 {
                    Behind::Ground
                } else {
                    Behind::Matter
                };
                add(points, behind, None, backed.depth);
            }
        }
    }
}

/// Welds the parts of a cell's boundary and merges them to surfaces.
pub(crate) fn assembled(cell: CellId, parts: &[Part], options: &SurfaceOptions) -> RoomSurfaces {
    let welded = weld::weld(parts.iter().map(|p| p.points.as_slice()), options.tolerance);
    let mut groups: BTreeMap<Key, Vec<usize>> = BTreeMap::new();
    for (i, part) in parts.iter().enumerate() {
        let mut key = part.key;
        if options.level == SurfaceLevel::First && !matches!(key.cover, SurfaceCover::Opening(_)) {
            (key.behind, key.far) = (Behind::Matter, None);
        }
        if !welded.polygons[i].is_empty() {
            groups.entry(key).or_default().push(i);
        }
    }
    let mut told: Vec<Told<(SurfaceCover, Behind, f64)>> = Vec::new();
    for (key, members) in &groups {
        let weight = |i: usize| enfilade_geom::poly::area(&parts[i].points);
        let normal: DVec3 = members.iter().map(|&i| parts[i].normal * weight(i)).sum();
        let polygons: Vec<&[u32]> = members
            .iter()
            .map(|&i| welded.polygons[i].as_slice())
            .collect();
        let mut by_behind: BTreeMap<Behind, [f64; 2]> = BTreeMap::new();
        for &i in members {
            let sums = by_behind.entry(parts[i].key.behind).or_default();
            sums[0] += weight(i);
            sums[1] += weight(i) * parts[i].depth;
        }
        let most = by_behind.iter().max_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        let Some((&behind, &[area, depth])) = most else {
            continue;
        };
        let normal = normal.normalize_or_zero();
        for rings in merge::merged(&welded.points, normal, &polygons) {
            told.push(Told {
                rings,
                normal,
                about: (key.cover, behind, depth / area.max(f64::MIN_POSITIVE)),
            });
        }
    }
    slivers::collapse(&welded.points, &mut told, options.tolerance);
    let answers: Vec<_> = told.iter().map(|t| t.about).collect();
    let mut rings: Vec<Rings> = told.into_iter().map(|t| t.rings).collect();
    outline::straightened(&welded.points, &mut rings);
    let about = welded.points.first().copied().unwrap_or_default();
    let (vector, volume) = room::sums(&welded.points, about, rings.iter());
    let open = merge::open_edges(rings.iter().flatten().map(Vec::as_slice));
    let mut surfaces: Vec<BoundarySurface> = rings
        .iter()
        .zip(&answers)
        .map(|(rings, &(cover, behind, thickness))| {
            let area: DVec3 = rings
                .iter()
                .map(|r| merge::ring_area(&welded.points, r))
                .sum();
            let at = |&v: &u32| welded.points[v as usize].to_array();
            BoundarySurface {
                loops: rings.iter().map(|r| r.iter().map(at).collect()).collect(),
                normal: area.normalize_or_zero().to_array(),
                area: area.length(),
                cover,
                behind,
                thickness,
                pair: None,
                host: None,
            }
        })
        .collect();
    surfaces.sort_by_key(|s| s.opening().is_some());
    RoomSurfaces {
        cell,
        surfaces,
        gap: vector.length(),
        n_open_edges: open.values().map(|&n| n as usize).sum(),
        volume,
    }
}
