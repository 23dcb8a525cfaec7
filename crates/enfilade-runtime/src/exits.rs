//! Groups of exits: a cell with thousands of portals costs only those in view.
//!
//! Portal hierarchies after Gjørup, *Portal techniques* (1999), section 2.3.3: films without volume over
//! a wall of windows, each with one portal around those behind it, which can be skipped together with
//! everything behind it; the far side bypasses them. Here films are not cells. They are made from the exits
//! of one cell when a world is loaded, so the far side never meets them. Nor need they be flat: a box and
//! the range of the normals decide for a round tower, too, that all of it faces away or lies out of view.
//!
//! **Skips nothing visible:** a group is skipped only if each exit in it would be, by the same planes and
//! tolerances (`see.rs`). So the answers equal those of testing each exit.

use glam::{DVec3, Vec3};

use crate::point::point;

/// Largest number of exits left ungrouped. Offices with 4 to 15 exits per room gain nothing; a facade of
/// 64 windows does.
const MIN_EXITS: usize = 16;

/// A portal as left from one cell. 48 bytes; the exits of a cell are contiguous.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exit {
    /// Midpoint of the outline, on the portal's plane.
    pub(crate) center: [f32; 3],
    /// Radius of the sphere around `center` that holds the outline. [Units: wu]
    pub(crate) radius: f32,
    /// Unit normal, towards `to`.
    pub(crate) normal: [f32; 3],
    /// The cell behind it; or [`SPECIAL`] plus the index of a special portal.
    pub(crate) to: u32,
    /// [`NO_PORTAL`] for a special portal on a wall.
    pub(crate) portal: u32,
    pub(crate) first_corner: u32,
    pub(crate) n_corners: u32,
    /// True if the vertices run counter-clockwise about `normal`.
    pub(crate) is_turned: bool,
}

/// Marks an exit by a special portal.
pub(crate) const SPECIAL: u32 = 1 << 31;

/// Stands for no portal: open, without planes that narrow it.
pub(crate) const NO_PORTAL: u32 = u32::MAX;

impl Exit {
    /// Returns the index of the special portal that it leads through.
    #[inline]
    pub(crate) fn special(&self) -> Option<u32> {
        (self.to & SPECIAL != 0).then_some(self.to & !SPECIAL)
    }
}

/// A contiguous run of exits of one cell, or of groups of them. Fits one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Group {
    /// Box around the outlines, grown by the tolerance.
    min: [f32; 3],
    max: [f32; 3],
    /// Minimum and maximum of the normals' coordinates.
    normals: [[f32; 3]; 2],
    /// Greatest distance of an exit's plane from the center of the box, along the plane's normal.
    ahead: f32,
    /// First exit; there are none where subgroups follow.
    first: u32,
    n: u32,
    /// Index of the next group that is not a part of this one.
    after: u32,
}

impl Group {
    /// Returns the box around all outlines and their tolerance.
    #[inline]
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        [self.min.into(), self.max.into()]
    }

    /// Returns `true` if the eye is behind all planes by more than rounding.
    #[inline]
    pub(crate) fn faces_away(&self, eye: DVec3, tolerance: f64) -> bool {
        let [min, max] = [self.min, self.max].map(|p| point(p) - eye);
        let to_middle = self.middle() - eye;
        let [low, high] = self.normals.map(|n| point(n) * to_middle);
        // For any normal within the range, and any plane no farther ahead.
        let ahead = f64::from(self.ahead) + low.max(high).element_sum();
        // As for one exit, but at the farthest possible place.
        let reach = min.abs().max(max.abs()).max_element() + (max - min).length();
        ahead < -2.0 * tolerance - 1e-6 * reach
    }

    /// Returns `true` if a box is disjoint from this one.
    #[inline]
    pub(crate) fn is_apart_from(&self, low: DVec3, high: DVec3) -> bool {
        (low.cmpgt(point(self.max)) | high.cmplt(point(self.min))).any()
    }

    fn middle(&self) -> DVec3 {
        point([0, 1, 2].map(|k| (self.min[k] + self.max[k]) * 0.5))
    }
}

/// The exits of a cell, one run at a time.
pub(crate) struct Runs<'a> {
    exits: &'a [Exit],
    groups: &'a [Group],
    at: usize,
    /// True if the exits are not grouped.
    is_whole: bool,
}

impl<'a> Runs<'a> {
    /// Iterates over the exits `exits` of a cell with groups `groups`, possibly none. Indices of both count from 0.
    pub(crate) fn new(exits: &'a [Exit], groups: &'a [Group]) -> Self {
        Self {
            exits,
            groups,
            at: 0,
            is_whole: groups.is_empty(),
        }
    }

    /// Returns the next exits, in list order, that lie in no skipped group.
    #[inline]
    pub(crate) fn next(
        &mut self,
        mut is_skipped: impl FnMut(&Group) -> bool,
    ) -> Option<&'a [Exit]> {
        if self.is_whole {
            self.is_whole = false;
            return Some(self.exits);
        }
        while let Some(group) = self.groups.get(self.at) {
            if is_skipped(group) {
                self.at = group.after as usize;
                continue;
            }
            self.at += 1;
            if group.n > 0 {
                let first = group.first as usize;
                return Some(&self.exits[first..first + group.n as usize]);
            }
        }
        None
    }
}

/// Sorts the exits of one cell so that neighbors in the list are close in space and in direction, and adds
/// groups of at most `size` exits; adds none if `size` is 0. The order does not depend on `size`.
///
/// O(n log² n).
pub(crate) fn group(
    exits: &mut [Exit],
    corners: &[[f32; 3]],
    size: usize,
    tolerance: f64,
    groups: &mut Vec<Group>,
) {
    if exits.len() <= MIN_EXITS {
        return;
    }
    sort(exits);
    if size > 0 {
        let base = groups.len();
        add(exits, 0, corners, size, tolerance, base, groups);
    }
}

/// Sorts by halves, split by direction first, then by position.
fn sort(exits: &mut [Exit]) {
    if exits.len() < 2 {
        return;
    }
    let widest = |of: fn(&Exit) -> [f32; 3]| {
        let (low, high) = range(exits.iter().map(of));
        let size = high - low;
        (size.max_element(), size.max_position())
    };
    let (spread, normal_axis) = widest(|e| e.normal);
    let (_, axis) = widest(|e| e.center);
    // Planes within 30 degrees are separated better by position.
    let by_normal = spread > 0.5;
    let key = |e: &Exit| {
        if by_normal {
            e.normal[normal_axis]
        } else {
            e.center[axis]
        }
    };
    exits.sort_unstable_by(|a, b| {
        let by_name = (a.portal, a.first_corner).cmp(&(b.portal, b.first_corner));
        key(a).total_cmp(&key(b)).then(by_name)
    });
    let (low, high) = exits.split_at_mut(exits.len() / 2);
    sort(low);
    sort(high);
}

fn range(points: impl Iterator<Item = [f32; 3]>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| {
        (low.min(p.into()), high.max(p.into()))
    })
}

fn add(
    exits: &[Exit],
    first: u32,
    corners: &[[f32; 3]],
    size: usize,
    tolerance: f64,
    base: usize,
    groups: &mut Vec<Group>,
) {
    let n = exits.len();
    let outlines = exits.iter().flat_map(|e| {
        let first = e.first_corner as usize;
        corners[first..first + e.n_corners as usize].iter().copied()
    });
    let (min, max) = range(outlines);
    let (low, high) = range(exits.iter().map(|e| e.normal));
    let mut group = Group {
        min: min
            .to_array()
            .map(|x| ((f64::from(x) - tolerance) as f32).next_down()),
        max: max
            .to_array()
            .map(|x| ((f64::from(x) + tolerance) as f32).next_up()),
        normals: [low.to_array(), high.to_array()],
        ahead: 0.0,
        first,
        n: if n <= size { n as u32 } else { 0 },
        after: 0,
    };
    let middle = group.middle();
    let ahead = exits
        .iter()
        .map(|e| point(e.normal).dot(point(e.center) - middle))
        .fold(f64::NEG_INFINITY, f64::max);
    group.ahead = (ahead as f32).next_up();
    let at = groups.len();
    groups.push(group);
    if n > size {
        let (low, high) = exits.split_at(n / 2);
        add(low, first, corners, size, tolerance, base, groups);
        let middle = first + low.len() as u32;
        add(high, middle, corners, size, tolerance, base, groups);
    }
    groups[at].after = (groups.len() - base) as u32;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sight::Sight;
    use enfilade_testkit::window_tower;

    /// Returns the numbers of groups and exits that a query visits in a cell.
    fn looked_at(sight: &Sight, cell: u32, is_skipped: impl Fn(&Group) -> bool) -> [usize; 2] {
        let (mut n_groups, mut n_exits) = (0, 0);
        let mut runs = sight.runs_of(cell);
        while let Some(run) = runs.next(|group| {
            n_groups += 1;
            is_skipped(group)
        }) {
            n_exits += run.len();
        }
        [n_groups, n_exits]
    }

    #[test]
    fn facades_that_face_away_and_places_far_away_cost_a_few_tests() {
        // 60 m wide and high, 400 windows on each facade; the outdoors is the last cell.
        let sight = Sight::build(&window_tower(20, 20, false)).unwrap();
        let outdoors = sight.n_cells() as u32 - 1;
        let tolerance = sight.tolerance;
        assert_eq!(looked_at(&sight, outdoors, |_| false)[1], 1600);
        let faces_away = |eye: DVec3| looked_at(&sight, outdoors, |g| g.faces_away(eye, tolerance));
        // In front of one facade, in front of two, and inside the tower, whose facades all face away.
        for (eye, n) in [
            ([30.0, 30.0, -20.0], 400),
            ([-20.0, 30.0, -20.0], 800),
            ([30.0; 3], 0),
        ] {
            let [n_groups, n_exits] = faces_away(eye.into());
            assert_eq!(n_exits, n);
            // Groups of 6 or 7: together with their parents, a third as many as windows.
            assert!(n_groups <= 8 + n / 3, "{n_groups}");
        }
        let at = |p: DVec3| looked_at(&sight, outdoors, |g| g.is_apart_from(p, p));
        let [n_groups, n_exits] = at([31.5, 31.5, 0.0].into());
        assert!(
            (1..=8).contains(&n_exits) && n_groups < 30,
            "{n_groups} {n_exits}"
        );
        assert_eq!(at([31.5, 31.5, -1.0].into())[1], 0);
    }
}
