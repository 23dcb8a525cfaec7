//! Pieces of surface in one cell of a lattice.
//!
//! A vertex stands for each piece, so that walls which pass through one cell without touching stay apart, after Nielson,
//! "Dual marching cubes" (2004). A piece runs from face to face of the cell, as in the cells beside it.

/// Edges of a cell as pairs of its vertices; vertex `i` lies at the bits of `i`: x, y, z. Edges along x first.
pub(crate) const EDGES: [[usize; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7],
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

/// For all 256 cells by the set of their vertices in matter: the piece that crosses each edge, or [`NONE`].
pub(crate) struct Pieces([[u8; 12]; 256]);

/// The surface does not cross the edge.
pub(crate) const NONE: u8 = u8::MAX;

impl Pieces {
    pub(crate) fn new() -> Self {
        let mut all = [[NONE; 12]; 256];
        for (matter, pieces) in all.iter_mut().enumerate() {
            *pieces = of_cell(matter);
        }
        Self(all)
    }

    /// Returns the piece at each edge of a cell.
    pub(crate) fn of(&self, matter: u8) -> &[u8; 12] {
        &self.0[usize::from(matter)]
    }
}

fn of_cell(matter: usize) -> [u8; 12] {
    let is_in = |v: usize| matter >> v & 1 == 1;
    let is_crossed = |e: usize| is_in(EDGES[e][0]) != is_in(EDGES[e][1]);
    let mut piece: [u8; 12] = std::array::from_fn(|e| if is_crossed(e) { e as u8 } else { NONE });
    let mut join = |a: usize, b: usize| {
        let (from, to) = (piece[a].max(piece[b]), piece[a].min(piece[b]));
        piece
            .iter_mut()
            .filter(|p| **p == from)
            .for_each(|p| *p = to);
    };
    for face in 0..6 {
        let (axis, side) = (face / 2, face % 2);
        let is_of_face = |e: &usize| EDGES[*e].iter().all(|v| v >> axis & 1 == side);
        let crossed: Vec<usize> = (0..12)
            .filter(is_of_face)
            .filter(|&e| is_crossed(e))
            .collect();
        // Where a face has two vertices in matter that share no edge, they stay apart.
        for (i, &a) in crossed.iter().enumerate() {
            for &b in &crossed[i + 1..] {
                let shares = EDGES[a].iter().any(|v| is_in(*v) && EDGES[b].contains(v));
                if crossed.len() == 2 || shares {
                    join(a, b);
                }
            }
        }
    }
    let mut known: Vec<u8> = Vec::new();
    piece.map(|p| {
        if p == NONE {
            return NONE;
        }
        let at = known.iter().position(|&k| k == p).unwrap_or_else(|| {
            known.push(p);
            known.len() - 1
        });
        at as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_a_piece_for_each_loop_through_its_faces() {
        let pieces = Pieces::new();
        let n = |matter: u8| {
            let found = pieces.of(matter).iter().filter(|&&p| p != NONE);
            found.max().map_or(0, |&p| p + 1)
        };
        assert_eq!(n(0), 0);
        assert_eq!(n(255), 0);
        assert_eq!(n(1), 1);
        assert_eq!(n(0b0000_1111), 1);
        // Opposite vertices of a face, and of the cell.
        assert_eq!(n(0b0000_1001), 2);
        assert_eq!(n(0b1000_0001), 2);
        // Four vertices, no two of which share an edge.
        assert_eq!(n(0b0110_1001), 4);
    }
}
