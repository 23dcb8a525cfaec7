//! Counts on a lattice of points in a plane: connected points, and their surroundings.

/// Jambs that take a smaller part of the width of the space are pilasters, and what spans it between them is a beam.
const PILASTERS: f64 = 0.125;

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

/// The sides of an opening: the share of each at which the space beside it reaches past the rim. Where it does not, a wall or the
/// ceiling runs through.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Jambs {
    pub(crate) left: f64,
    pub(crate) right: f64,
    pub(crate) lintel: f64,
    /// The part of the width of the space that lies beside the opening.
    pub(crate) share: f64,
}

/// A value for each of a range of bands, as far as they have one.
struct Bands<T> {
    first: i64,
    values: Vec<Option<T>>,
}

impl<T: Copy> Bands<T> {
    /// Makes room for the least to the greatest of some bands.
    fn over(bands: impl Iterator<Item = i64> + Clone) -> Self {
        let first = bands.clone().min().unwrap_or(0);
        let n = bands.max().map_or(0, |last| last - first + 1);
        Self {
            first,
            values: vec![None; n as usize],
        }
    }

    fn entry(&mut self, band: i64) -> Option<&mut Option<T>> {
        self.values
            .get_mut(usize::try_from(band - self.first).ok()?)
    }

    fn get(&self, band: i64) -> Option<T> {
        *self.values.get(usize::try_from(band - self.first).ok()?)?
    }
}

impl Jambs {
    /// Returns the share of the lesser jamb, or of a jamb and the lintel, whichever is more: high for an opening in a wall, low for a
    /// bend, an alcove, an arm of a room, and for a beam across one, with or without pilasters.
    pub(crate) fn frame(self) -> f64 {
        let jamb = if self.share < PILASTERS {
            0.0
        } else {
            self.left.max(self.right)
        };
        self.left.min(self.right).max(jamb.min(self.lintel))
    }

    /// Returns the share of the lesser jamb, if the two are more than pilasters.
    pub(crate) fn both(self) -> f64 {
        if self.share < PILASTERS {
            0.0
        } else {
            self.left.min(self.right)
        }
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
        // The opening may lean: its ends at each height, and its top at each place across.
        let band = |t: f64| t.round() as i64;
        let open: Vec<[f64; 2]> = (0..mask.len()).filter(|&k| mask[k]).map(at).collect();
        let mut ends = Bands::over(open.iter().map(|p| band(p[1])));
        let mut tops = Bands::over(open.iter().map(|p| band(p[0])));
        for [across, height] in open {
            if let Some(of) = ends.entry(band(height)) {
                let [least, most] = of.unwrap_or([across; 2]);
                *of = Some([least.min(across), most.max(across)]);
            }
            if let Some(top) = tops.entry(band(across)) {
                *top = Some(top.unwrap_or(height).max(height));
            }
        }
        let n_open = mask.iter().filter(|&&is_open| is_open).count();
        let is_at_side = |k: usize| {
            let [across, height] = at(k);
            let of = ends.get(band(height));
            of.is_some_and(|e| across < e[0] || across > e[1])
        };
        let n_beside = (0..mask.len()).filter(|&k| !mask[k] && is_beside(k) && is_at_side(k));
        let n_beside = n_beside.count();
        // Left, right, above.
        let (mut rim, mut beside) = ([0_usize; 3], [0_usize; 3]);
        for_rim(mask, side, |k| {
            let [across, height] = at(k);
            let of = ends.get(band(height));
            let is_there = [
                of.is_some_and(|e| across < e[0]),
                of.is_some_and(|e| across > e[1]),
                tops.get(band(across)).is_some_and(|top| height > top),
            ];
            for (n, is_there) in is_there.into_iter().enumerate() {
                rim[n] += usize::from(is_there);
                beside[n] += usize::from(is_there && is_beside(k));
            }
        });
        let [left, right, lintel] = [0, 1, 2].map(|n| beside[n] as f64 / rim[n].max(1) as f64);
        Self {
            left,
            right,
            lintel,
            share: n_beside as f64 / (n_beside + n_open).max(1) as f64,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::FRAMED;

    const SIDE: [usize; 2] = [61, 57];

    /// Range across and range up, from the middle of the lattice. [Units: lattice steps]
    type Rectangle = [[f64; 2]; 2];

    const ROOM: Rectangle = [[-15.0, 15.0], [-10.0, 12.0]];

    /// Ways that a lattice lies in an upright plane: the height gained along a row and along a column.
    const LIES: [[f64; 2]; 6] = [
        [0.0, 1.0],
        [1.0, 0.0],
        [0.0, -1.0],
        [-1.0, 0.0],
        [0.6, 0.8],
        [-0.8, 0.6],
    ];

    /// Returns left jamb, right jamb and lintel of an opening in front of a room.
    fn jambs(opening: Rectangle, room: Rectangle, up: [f64; 2]) -> [bool; 3] {
        let is_in = |[across, height]: Rectangle| {
            move |k: usize| {
                let i = (k % SIDE[0]) as f64 - 30.0;
                let j = (k / SIDE[0]) as f64 - 28.0;
                let (x, y) = (i * up[1] - j * up[0], i * up[0] + j * up[1]);
                (across[0]..=across[1]).contains(&x) && (height[0]..=height[1]).contains(&y)
            }
        };
        let mask: Vec<bool> = (0..SIDE[0] * SIDE[1]).map(is_in(opening)).collect();
        let jambs = Jambs::of(&mask, SIDE, up, is_in(room));
        [jambs.left, jambs.right, jambs.lintel].map(|share| share >= FRAMED)
    }

    #[test]
    fn an_opening_in_a_wall_is_told_from_a_niche_and_a_bend() {
        let [floor, ceiling] = ROOM[1];
        for up in LIES {
            let doorway = [[-5.0, 5.0], [floor, 5.0]];
            assert_eq!(jambs(doorway, ROOM, up), [true; 3], "doorway, {up:?}");
            // As high as the room.
            let gap = [[-5.0, 5.0], [floor, ceiling]];
            assert_eq!(jambs(gap, ROOM, up), [true, true, false], "gap, {up:?}");
            let niche = [[-5.0, 15.0], [floor, ceiling]];
            let mirrored = [[-15.0, 5.0], [floor, ceiling]];
            assert_eq!(jambs(niche, ROOM, up), [true, false, false], "{up:?}");
            assert_eq!(jambs(mirrored, ROOM, up), [false, true, false], "{up:?}");
            assert_eq!(jambs(ROOM, ROOM, up), [false; 3], "bend, {up:?}");
            let below_beam = [ROOM[0], [floor, 5.0]];
            let [left, right, lintel] = jambs(below_beam, ROOM, up);
            assert!(lintel && !left && !right, "beam, {up:?}");
        }
    }

    #[test]
    fn the_share_of_jambs_is_that_of_the_width_beside_the_opening() {
        let [floor, ceiling] = ROOM[1];
        for height in [5.0, ceiling] {
            let side = SIDE;
            let opening = [[-10.0, 12.0], [floor, height]];
            let is_in = |[across, up]: Rectangle| {
                move |k: usize| {
                    let (x, y) = ((k % side[0]) as f64 - 30.0, (k / side[0]) as f64 - 28.0);
                    (across[0]..=across[1]).contains(&x) && (up[0]..=up[1]).contains(&y)
                }
            };
            let mask: Vec<bool> = (0..side[0] * side[1]).map(is_in(opening)).collect();
            let jambs = Jambs::of(&mask, side, [0.0, 1.0], is_in(ROOM));
            // 31 points of the room, 23 of them open.
            assert!((jambs.share - 8.0 / 31.0).abs() < 1e-9, "{jambs:?}");
        }
    }

    #[test]
    fn an_opening_has_a_frame_with_two_jambs_or_a_lintel_and_a_jamb_that_is_no_pilaster() {
        for bits in 0..8_u32 {
            let [left, right, lintel] = [1, 2, 4].map(|bit| f64::from(u8::from(bits & bit != 0)));
            for (share, is_wide) in [(0.13, true), (0.12, false)] {
                let jambs = Jambs {
                    left,
                    right,
                    lintel,
                    share,
                };
                let is_framed = bits & 3 == 3 || is_wide && bits.count_ones() >= 2;
                assert_eq!(jambs.frame() >= FRAMED, is_framed, "{jambs:?}");
            }
        }
    }
}
