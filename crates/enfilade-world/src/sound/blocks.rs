//! Block tridiagonal systems of 2 × 2 blocks that are symmetric and positive definite.
//!
//! Elimination by blocks (Golub & Van Loan, "Matrix Computations", §4.5.1) without pivoting, which such systems do not need.
//! O(rows). Fails at a block that rounding has made singular.

/// A row of the system; overwritten by the solver.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Block {
    pub(crate) diagonal: [[f64; 2]; 2],
    /// Coefficients of the next row; their transpose couples the next row to this one.
    pub(crate) above: [[f64; 2]; 2],
    /// The right side; afterwards the solution.
    pub(crate) right: [f64; 2],
}

/// Solves a system in place; returns `true` on success.
pub(crate) fn solve(blocks: &mut [Block]) -> bool {
    for i in 0..blocks.len() {
        if i > 0 {
            let before = blocks[i - 1];
            let transposed = [0, 1].map(|k| [before.above[0][k], before.above[1][k]]);
            let down = product(transposed, before.diagonal);
            let less = product(down, before.above);
            let block = &mut blocks[i];
            for k in 0..2 {
                for (x, y) in block.diagonal[k].iter_mut().zip(less[k]) {
                    *x -= y;
                }
                block.right[k] -= down[k][0] * before.right[0] + down[k][1] * before.right[1];
            }
        }
        // From here on the inverse replaces the diagonal.
        let Some(inverse) = inverse(blocks[i].diagonal) else {
            return false;
        };
        blocks[i].diagonal = inverse;
    }
    for i in (0..blocks.len()).rev() {
        let after = blocks.get(i + 1).map_or([0.0; 2], |b| b.right);
        let block = &mut blocks[i];
        let right = [0, 1]
            .map(|k| block.right[k] - block.above[k][0] * after[0] - block.above[k][1] * after[1]);
        block.right =
            [0, 1].map(|k| block.diagonal[k][0] * right[0] + block.diagonal[k][1] * right[1]);
    }
    blocks.iter().all(|b| b.right.iter().all(|x| x.is_finite()))
}

fn product(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    a.map(|row| [0, 1].map(|l| row[0] * b[0][l] + row[1] * b[1][l]))
}

fn inverse(m: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    // Where a string is straight, moving a point along it changes nothing: add a little.
    let little = 1e-12 * (m[0][0] + m[1][1]);
    let [[a, b], [c, d]] = [[m[0][0] + little, m[0][1]], [m[1][0], m[1][1] + little]];
    let determinant = a * d - b * c;
    let is_regular = determinant > 0.0 && determinant.is_finite();
    is_regular.then(|| [[d, -b], [-c, a]].map(|row| row.map(|x| x / determinant)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W11.
    #[test]
    fn a_chain_of_springs_is_in_balance() {
        // Each row: 2 to itself, -1 to its neighbors; the last pulled by 1: xᵢ = i + 1.
        let row = |last: f64| Block {
            diagonal: [[2.0, 0.0], [0.0, 2.0]],
            above: [[-1.0, 0.0], [0.0, -1.0]],
            right: [last, 2.0 * last],
        };
        let mut blocks = [row(0.0), row(0.0), row(0.0), row(5.0)];
        assert!(solve(&mut blocks));
        for (i, block) in blocks.iter().enumerate() {
            let x = (i + 1) as f64;
            assert!((block.right[0] - x).abs() < 1e-9 && (block.right[1] - 2.0 * x).abs() < 1e-9);
        }
    }
}
