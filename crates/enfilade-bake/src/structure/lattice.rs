//! Counts on a lattice of points in a plane: connected points, and their surroundings.

/// Returns the share of the rim of `mask` (points within two steps of it) where `is_wall` holds.
pub(crate) fn rim_share(mask: &[bool], side: [usize; 2], is_wall: impl Fn(usize) -> bool) -> f64 {
    let (mut rim, mut wall) = (0_usize, 0_usize);
    for_rim(mask, side, |k| {
        rim += 1;
        wall += usize::from(is_wall(k));
    });
    wall as f64 / rim.max(1) as f64
}

/// Visits the points outside `mask` within two steps of it.
fn for_rim(mask: &[bool], side: [usize; 2], mut visit: impl FnMut(usize)) {
    for j in 0..side[1] {
        for i in 0..side[0] {
            let k = j * side[0] + i;
            let near = |k: usize, n: usize| k.saturating_sub(2)..(k + 3).min(n);
            if !mask[k] && near(j, side[1]).any(|y| near(i, side[0]).any(|x| mask[y * side[0] + x]))
            {
                visit(k);
            }
        }
    }
}

/// Least share of one side of an opening's rim at which the space beside it must reach farther, for a lintel or jamb.
const FRAMED: f64 = 0.5;

/// The sides of an opening at which the space beside it reaches past its rim. Where it does not, a wall or the ceiling
/// runs through.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Jambs {
    pub(crate) left: bool,
    pub(crate) right: bool,
    pub(crate) lintel: bool,
}

impl Jambs {
    /// Returns `true` for an opening in a wall. Any other is a bend, an alcove, an arm of a room.
    pub(crate) fn frame(self) -> bool {
        self.lintel || self.left && self.right
    }

    /// Measures the opening `mask`; `is_beside` holds where there is space beside it. `up` is the height gained with each
    /// step along a row and along a column.
    pub(crate) fn of(
        mask: &[bool],
        side: [usize; 2],
        up: [f64; 2],
        is_beside: impl Fn(usize) -> bool,
    ) -> Self {
        // Position across and up.
        let at = |k: usize| {
            let [i, j] = [(k % side[0]) as f64, (k / side[0]) as f64];
            [i * up[1] - j * up[0], i * up[0] + j * up[1]]
        };
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for p in (0..mask.len()).filter(|&k| mask[k]).map(at) {
            low = [low[0].min(p[0]), low[1].min(p[1])];
            high = [high[0].max(p[0]), high[1].max(p[1])];
        }
        // Left, right, above.
        let (mut rim, mut beside) = ([0_usize; 3], [0_usize; 3]);
        for_rim(mask, side, |k| {
            let p = at(k);
            for (n, is_there) in [p[0] < low[0], p[0] > high[0], p[1] > high[1]]
                .into_iter()
                .enumerate()
            {
                rim[n] += usize::from(is_there);
                beside[n] += usize::from(is_there && is_beside(k));
            }
        });
        let [left, right, lintel] =
            [0, 1, 2].map(|n| rim[n] > 0 && beside[n] as f64 >= FRAMED * rim[n] as f64);
        Self {
            left,
            right,
            lintel,
        }
    }
}

/// Returns the number of points of `inside` (a lattice of size `side`) connected to a seed. Clears those
/// points. Points behind a wall beside the opening do not belong to the section at the opening.
pub(crate) fn connected_count(
    inside: &mut [bool],
    side: [usize; 2],
    seeds: &[bool],
    stack: &mut Vec<usize>,
    mut visit_point: impl FnMut(usize),
) -> usize {
    let mut count = 0;
    for start in 0..inside.len() {
        if !(seeds[start] && inside[start]) {
            continue;
        }
        inside[start] = false;
        stack.push(start);
        while let Some(k) = stack.pop() {
            count += 1;
            visit_point(k);
            let (i, j) = (k % side[0], k / side[0]);
            let mut visit = |exists: bool, next: usize| {
                if exists && inside[next] {
                    inside[next] = false;
                    stack.push(next);
                }
            };
            visit(i > 0, k.wrapping_sub(1));
            visit(i + 1 < side[0], k + 1);
            visit(j > 0, k.wrapping_sub(side[0]));
            visit(j + 1 < side[1], k + side[0]);
        }
    }
    count
}
