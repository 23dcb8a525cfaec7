//! The potentially visible volume: the part of each cell that may be seen, through portals, from each other cell.
//!
//! After Dirkse 2002, section 7.4: every sequence of portals from one cell to another bounds the space seen behind it
//! by planes that separate its first portal from its last ([`Hourglass`]). We walk all sequences that the search
//! left, and keep the union of these spaces as a list of pieces.
//!
//! A sequence never returns to the cell that it began in: from there, a shorter one sees as much.
//!
//! Errs to visible. If a walk takes more than [`MAX_STEPS`], or a pair gets more than [`VisibleVolumes::MAX_PIECES`]
//! pieces, those with the same first and last portal become the piece of these two, regardless of the portals
//! between; if that is still too much, the whole cell counts as seen.

use std::collections::BTreeMap;

use enfilade_cpg::{Pvs, VisibleVolumes, World};
use enfilade_geom::{Aabb, DVec3, Plane, world_tolerance};
use rayon::prelude::*;

use crate::bits::{self, BitTable};
use crate::dirs::Dirs;
use crate::hourglass::{Hourglass, Hourglasses};
use crate::narrow::narrow_might;
use crate::polytope::faces_in_box;

/// Most portals pushed in the walk from one portal of a cell.
const MAX_STEPS: usize = 20_000;

/// Longest sequence followed. Bounds the stack.
const MAX_SEQUENCE: usize = 256;

/// Vertices this near to a plane count as on it; far below the tolerance of any reader. [Units: wu]
const EPS: f64 = 1e-9;

/// Marks the portals of a piece that is not seen through a single one.
pub(crate) const ANY_PORTAL: u32 = u32::MAX;

/// Returns the volumes of each pair of cells, and for each piece its first and its last portal: directions of the
/// graph, or [`ANY_PORTAL`]. Pairs of `through` are seen whole.
pub(crate) fn volumes_of(
    world: &World,
    (pvs, through): (&Pvs, &Pvs),
    glasses: &Hourglasses,
) -> (VisibleVolumes, Vec<[u32; 2]>) {
    let dirs = glasses.dirs();
    let mut might = dirs.might_see(glasses.clearance(), None);
    let mut settled = BitTable::new(dirs.len(), dirs.len());
    narrow_might(dirs, &mut might, &mut settled, glasses.tolerance());
    let walk = Walk {
        world,
        pvs,
        through,
        glasses,
        might: &might,
        slack: world_tolerance(dirs.scale),
    };
    let rows: Vec<Vec<Vec<Piece>>> = (0..pvs.n_cells() as u32)
        .into_par_iter()
        .with_max_len(1)
        .map(|cell| walk.pieces_seen_from(cell))
        .collect();
    let pairs = || rows.iter().flatten();
    let four = |p: &Plane| [p.normal.x, p.normal.y, p.normal.z, p.d];
    let planes = |piece: &Piece| piece.planes.iter().map(four).collect();
    let volumes = VisibleVolumes::of_pairs(pairs().map(|pair| pair.iter().map(planes).collect()));
    let ends = pairs().flatten().map(|piece| piece.ends).collect();
    (volumes, ends)
}

/// Returns the faces of a piece of a cell's visible volume, for drawing: convex polygons around the part of the
/// cell's box inside the piece. [Units: wu]
#[must_use]
pub fn piece_faces(piece: &[[f64; 4]], bounds: &Aabb) -> Vec<Vec<DVec3>> {
    let plane = |&[x, y, z, d]: &[f64; 4]| Plane {
        normal: DVec3::new(x, y, z),
        d,
    };
    let planes: Vec<Plane> = piece.iter().map(plane).collect();
    faces_in_box(&planes, bounds, EPS)
}

/// A convex piece and its origin.
struct Piece {
    /// First portal and last, as directions of the graph.
    ends: [u32; 2],
    /// Moved outwards by the world's tolerance, so that queries need none.
    planes: Vec<Plane>,
    /// Its vertices in the cell's box.
    corners: Vec<DVec3>,
}

struct Walk<'a> {
    world: &'a World,
    pvs: &'a Pvs,
    /// Pairs of which all is seen: through special portals.
    through: &'a Pvs,
    glasses: &'a Hourglasses,
    might: &'a BitTable,
    /// Distance by which visible parts may lie outside their cell's box or behind planes: the world's tolerance.
    /// [Units: wu]
    slack: f64,
}

/// For each cell seen from a cell, its pieces.
type Pieces = BTreeMap<u32, Vec<Piece>>;

impl Walk<'_> {
    /// Returns the pieces of each cell that `cell` sees, in the order of ids.
    fn pieces_seen_from(&self, cell: u32) -> Vec<Vec<Piece>> {
        let dirs = self.dirs();
        let mut found = Pieces::new();
        let at = dirs.cells.partition_point(|&c| c < cell);
        if dirs.cells.get(at) == Some(&cell) {
            for exit in dirs.exits(at as u32) {
                self.add_exit(exit, &mut found);
            }
        }
        let row = self.pvs.visible_from(enfilade_cpg::CellId(cell));
        let whole = || vec![self.whole(cell)];
        row.map(|to| {
            if to.0 == cell || self.through.sees(enfilade_cpg::CellId(cell), to) {
                whole()
            } else {
                found.remove(&to.0).unwrap_or_default()
            }
        })
        .collect()
    }

    /// Returns the piece that is a whole cell.
    fn whole(&self, cell: u32) -> Piece {
        Piece {
            ends: [ANY_PORTAL; 2],
            planes: Vec::new(),
            corners: self.bounds(cell).corners().to_vec(),
        }
    }

    fn dirs(&self) -> &Dirs {
        self.glasses.dirs()
    }

    /// Returns the cell that a direction leads into, in the graph's numbers.
    fn cell_after(&self, dir: usize) -> u32 {
        let dirs = self.dirs();
        dirs.cells[dirs.all[dir].to as usize]
    }

    fn sees(&self, from: u32, to: u32) -> bool {
        let id = enfilade_cpg::CellId;
        self.pvs.sees(id(from), id(to))
    }

    fn add_exit(&self, exit: usize, found: &mut Pieces) {
        let dirs = self.dirs();
        let Some(glass) = self.glasses.of_portal(dirs.all[exit].id) else {
            return;
        };
        let mut pieces = Vec::new();
        let mut state = State {
            source: dirs.cells[dirs.all[exit].from as usize],
            chain: vec![exit],
            reach: vec![self.might.row(exit).to_vec()],
            n_left: MAX_STEPS,
            out: &mut pieces,
        };
        let is_complete = self.follow(&glass, &mut state);
        if !is_complete {
            pieces = self.between_all(exit);
        }
        for (to, piece) in pieces {
            self.add(found, to, piece);
        }
    }

    /// Adds the space seen behind a sequence and all its extensions; returns `false` if that takes too long.
    fn follow(&self, glass: &Hourglass, state: &mut State<'_>) -> bool {
        let dirs = self.dirs();
        let depth = state.chain.len() - 1;
        let last = state.chain[depth];
        let to = self.cell_after(last);
        if let Some(piece) = self.piece(glass, to) {
            state.out.push((to, piece));
        } else {
            // Nothing is seen behind the next portals either.
            return true;
        }
        if depth + 1 >= MAX_SEQUENCE {
            return false;
        }
        for q in dirs.after(last) {
            let next = self.cell_after(q);
            let is_allowed = q != dirs.reverse[last] as usize
                && next != state.source
                && bits::get(&state.reach[depth], q)
                && self.sees(state.source, next)
                && (state.chain.iter()).all(|&d| self.sees(self.cell_after(d), next));
            if !is_allowed {
                continue;
            }
            if state.n_left == 0 {
                return false;
            }
            state.n_left -= 1;
            let Some(longer) = self.glasses.push(glass, dirs.all[q].id) else {
                continue;
            };
            let both = state.reach[depth].iter().zip(self.might.row(q));
            let reach = both.map(|(a, b)| a & b).collect();
            state.reach.push(reach);
            state.chain.push(q);
            let is_complete = self.follow(&longer, state);
            state.chain.pop();
            state.reach.pop();
            if !is_complete {
                return false;
            }
        }
        true
    }

    /// Returns the pieces seen through a portal and any later one, regardless of those between.
    fn between_all(&self, exit: usize) -> Vec<(u32, Piece)> {
        let dirs = self.dirs();
        let source = dirs.cells[dirs.all[exit].from as usize];
        let first = dirs.all[exit].id;
        let mut out = Vec::new();
        let glass = self.glasses.of_portal(first);
        out.extend(glass.and_then(|g| {
            let to = self.cell_after(exit);
            Some((to, self.piece(&g, to)?))
        }));
        for q in bits::ones(self.might.row(exit)) {
            let to = self.cell_after(q);
            if to == source || !self.sees(source, to) {
                continue;
            }
            let glass = self.glasses.between(first, dirs.all[q].id);
            out.extend(glass.and_then(|g| Some((to, self.piece(&g, to)?))));
        }
        out
    }

    /// Returns the part of a cell's box that a sequence leaves; `None` if it is empty.
    fn piece(&self, glass: &Hourglass, to: u32) -> Option<Piece> {
        let bounds = self.bounds(to);
        let wide: Vec<Plane> = glass
            .planes()
            .iter()
            .map(|p| Plane {
                normal: p.normal,
                d: p.d + self.slack,
            })
            .collect();
        let corners: Vec<DVec3> = faces_in_box(&wide, &bounds, EPS)
            .into_iter()
            .flatten()
            .collect();
        // Keep only planes that cut something off.
        let cuts = |p: &&Plane| bounds.corners().iter().any(|&c| p.signed_distance(c) < 0.0);
        let most = VisibleVolumes::MAX_PLANES;
        let ends = [
            glass.sequence()[0],
            glass.sequence()[glass.sequence().len() - 1],
        ];
        (!corners.is_empty()).then(|| Piece {
            ends,
            planes: wide.iter().filter(cuts).take(most).copied().collect(),
            corners,
        })
    }

    /// Returns the box of a cell and of everything seen of it.
    fn bounds(&self, cell: u32) -> Aabb {
        let corners = self.world.graph.cells[cell as usize].aabb;
        let [low, high] = corners.map(|p| DVec3::from_array(p.map(f64::from)));
        Aabb::new(low, high).expanded(self.slack)
    }

    /// Adds a piece unless another holds it; drops those that it holds.
    fn add(&self, found: &mut Pieces, to: u32, piece: Piece) {
        let pieces = found.entry(to).or_default();
        if pieces.iter().any(|p| p.holds(&piece)) {
            return;
        }
        pieces.retain(|p| !piece.holds(p));
        pieces.push(piece);
        if pieces.len() > VisibleVolumes::MAX_PIECES {
            self.merge(pieces, to);
        }
    }

    /// Merges pieces with the same first and last portal; if that is not enough, keeps the whole cell.
    fn merge(&self, pieces: &mut Vec<Piece>, to: u32) {
        let mut ends: Vec<[u32; 2]> = pieces.iter().map(|p| p.ends).collect();
        ends.sort_unstable();
        ends.dedup();
        let whole = |ends: &[u32; 2]| {
            if ends[0] == ANY_PORTAL {
                return Some(self.whole(to));
            }
            let glass = if ends[0] == ends[1] {
                self.glasses.of_portal(ends[0])
            } else {
                self.glasses.between(ends[0], ends[1])
            };
            self.piece(&glass?, to)
        };
        let merged = ends.iter().filter_map(whole);
        let mut kept: Vec<Piece> = Vec::new();
        for piece in merged {
            if !kept.iter().any(|p| p.holds(&piece)) {
                kept.retain(|p| !piece.holds(p));
                kept.push(piece);
            }
        }
        // Half of the limit, so that merging is rare.
        if kept.is_empty() || kept.len() > VisibleVolumes::MAX_PIECES / 2 {
            kept = vec![self.whole(to)];
        }
        *pieces = kept;
    }
}

/// State of a walk, and its results.
struct State<'o> {
    source: u32,
    chain: Vec<usize>,
    /// For each depth, the directions that all portals of the sequence might see.
    reach: Vec<Vec<u64>>,
    n_left: usize,
    out: &'o mut Vec<(u32, Piece)>,
}

impl Piece {
    /// Returns `true` if another piece of the same cell, seen through the same portals, lies inside it.
    fn holds(&self, other: &Self) -> bool {
        if self.ends[1] != ANY_PORTAL && self.ends != other.ends {
            return false;
        }
        let is_in = |plane: &Plane| {
            let mut corners = other.corners.iter();
            corners.all(|&c| plane.signed_distance(c) >= -EPS)
        };
        self.planes.iter().all(is_in)
    }
}
