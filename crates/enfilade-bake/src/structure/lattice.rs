//! Counts on a lattice of points in a plane: connected points, and their surroundings.

/// Returns the share of the rim of `mask` (points within two steps of it) where `is_wall` holds.
pub(crate) fn rim_share(mask: &[bool], side: [usize; 2], is_wall: impl Fn(usize) -> bool) -> f64 {
    let (mut rim, mut wall) = (0_usize, 0_usize);
    for j in 0..side[1] {
        for i in 0..side[0] {
            let k = j * side[0] + i;
            let near = |k: usize, n: usize| k.saturating_sub(2)..(k + 3).min(n);
            if mask[k] || !near(j, side[1]).any(|y| near(i, side[0]).any(|x| mask[y * side[0] + x]))
            {
                continue;
            }
            rim += 1;
            wall += usize::from(is_wall(k));
        }
    }
    wall as f64 / rim.max(1) as f64
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
