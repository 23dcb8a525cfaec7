//! Fronts: the voxel faces where two cells of a flooded volume meet, grouped into openings.

use std::collections::BTreeMap;

use enfilade_geom::{DVec3, Plane, Sets};

pub(super) use super::flooded::Faces;
use super::flooded::Flooded;
use crate::structure::Opening;
use crate::voxel::{Grid, SparseVolume};

/// A connected or coplanar group of faces between two cells.
#[derive(Clone, Debug)]
pub(crate) struct Front {
    /// The opening that they fill; its plane's normal points from the lower to the greater label.
    pub(crate) opening: Opening,
    /// The faces.
    pub(crate) faces: Faces,
}

/// Returns the center of a face. [Units: wu]
#[must_use]
pub(crate) fn face_center(grid: &Grid, face: u64) -> DVec3 {
    center_of(grid, grid.coords((face / 4) as usize), (face % 4) as usize)
}

fn center_of(grid: &Grid, [i, j, k]: [usize; 3], axis: usize) -> DVec3 {
    let mut p = grid.center(i, j, k);
    p[axis] += grid.voxel * 0.5;
    p
}

/// Returns `true` if one of a face's two voxels is in a set.
#[must_use]
pub(crate) fn is_in(grid: &Grid, voxels: &SparseVolume, face: u64) -> bool {
    is_beside(
        voxels,
        grid.coords((face / 4) as usize),
        (face % 4) as usize,
    )
}

/// Returns `true` if a voxel or the next one along an axis is in a set.
fn is_beside(voxels: &SparseVolume, at: [usize; 3], axis: usize) -> bool {
    let mut next = at;
    next[axis] += 1;
    [at, next].iter().any(|&[i, j, k]| voxels.get(i, j, k))
}

/// Cost per face of finding patches, in units of [`Allowance`](enfilade_geom::Allowance).
pub(super) const WORK_A_FACE: u64 = 8;

/// Splits the faces between two cells into fronts, one for each opening, largest first.
///
/// Faces that touch (or nearly: within two voxels) belong together. Groups that share a plane are also
/// one opening, because a column in the middle of a wide opening does not make two doors of it.
/// `is_lesser` returns `true` if a voxel lies in the cell with the lower label.
#[must_use]
pub(crate) fn group_faces(
    flooded: Flooded<'_>,
    faces: &[u64],
    is_lesser: &dyn Fn([usize; 3]) -> bool,
) -> Vec<Front> {
    let Flooded {
        grid,
        closures,
        allowance,
        ..
    } = flooded;
    if !allowance.spend(WORK_A_FACE * faces.len() as u64) {
        return Vec::new();
    }
    let mut patches = connected_patches(grid, faces)
        .into_iter()
        .map(|faces| front_of(grid, faces, is_lesser, closures))
        .collect::<Vec<_>>();
    patches.sort_by(|p, q| {
        q.opening
            .area
            .total_cmp(&p.opening.area)
            .then(p.faces[0].cmp(&q.faces[0]))
    });
    let mut groups: Vec<Vec<Front>> = Vec::new();
    for patch in patches {
        if !allowance.spend(1 + groups.len() as u64 / 4) {
            break;
        }
        let home = groups.iter_mut().find(|g| {
            let lead = &g[0].opening;
            lead.plane.normal.dot(patch.opening.plane.normal) > 0.9
                && lead.plane.signed_distance(patch.opening.center).abs() < 0.5
        });
        match home {
            Some(group) => group.push(patch),
            None => groups.push(vec![patch]),
        }
    }
    let mut fronts: Vec<Front> = groups
        .into_iter()
        .map(|mut g| {
            if g.len() == 1 {
                return g.swap_remove(0);
            }
            let faces = g.into_iter().flat_map(|f| f.faces).collect();
            front_of(grid, faces, is_lesser, closures)
        })
        .collect();
    fronts.sort_by(|p, q| {
        q.opening
            .area
            .total_cmp(&p.opening.area)
            .then(p.faces[0].cmp(&q.faces[0]))
    });
    fronts
}

/// Groups faces by nearness: two faces are linked if their voxels are at most one step apart
/// along each axis. Each group is ascending, groups are in order of their first face.
#[must_use]
pub(crate) fn connected_patches(grid: &Grid, faces: &[u64]) -> Vec<Faces> {
    let [nx, ny, _] = grid.dims;
    let mut sorted = faces.to_vec();
    sorted.sort_unstable();
    // Voxels that carry a face, each once; groups are found over voxels.
    let mut voxels: Vec<u64> = sorted.iter().map(|f| f / 4).collect();
    voxels.dedup();
    let mut sets = Sets::new(voxels.len());
    let (nx64, layer) = (nx as i64, (nx * ny) as i64);
    // Half of the 26 neighbors lie ahead, three by three; the other half finds this voxel.
    let rows = [nx64, layer - nx64, layer, layer + nx64];
    let mut ahead = [0; 4];
    for (at, &voxel) in voxels.iter().enumerate() {
        if voxels.get(at + 1) == Some(&(voxel + 1)) {
            sets.join(at as u32, at as u32 + 1);
        }
        for (next, row) in ahead.iter_mut().zip(rows) {
            let first = voxel.saturating_add_signed(row - 1);
            while voxels.get(*next).is_some_and(|&v| v < first) {
                *next += 1;
            }
            let near = voxels[*next..].iter().take_while(|&&v| v <= first + 2);
            for (other, _) in (*next..).zip(near) {
                sets.join(at as u32, other as u32);
            }
        }
    }
    let mut patches: BTreeMap<u32, Faces> = BTreeMap::new();
    let mut at = 0;
    for &face in &sorted {
        while voxels[at] != face / 4 {
            at += 1;
        }
        patches.entry(sets.find(at as u32)).or_default().push(face);
    }
    patches.into_values().collect()
}

/// Computes the opening that a set of faces fills.
#[must_use]
pub(crate) fn front_of(
    grid: &Grid,
    faces: Faces,
    is_lesser: &dyn Fn([usize; 3]) -> bool,
    closures: Option<&SparseVolume>,
) -> Front {
    let unit = grid.voxel * grid.voxel;
    let (mut vector, mut center, mut closed) = (DVec3::ZERO, DVec3::ZERO, 0_usize);
    let mut per_axis = [0_usize; 3];
    for &face in &faces {
        let axis = (face % 4) as usize;
        let at = grid.coords((face / 4) as usize);
        vector[axis] += if is_lesser(at) { 1.0 } else { -1.0 };
        per_axis[axis] += 1;
        center += center_of(grid, at, axis);
        closed += usize::from(closures.is_some_and(|bits| is_beside(bits, at, axis)));
    }
    center /= faces.len() as f64;
    // A flat front seen along the worst diagonal has √3 times its area in voxel faces. If the vector area
    // is far below that, the front wraps around something, and its silhouette along the axis of most
    // faces is a better measure.
    let total = faces.len() as f64;
    let wraps = vector.length() < 0.4 * total;
    let (normal, area) = if wraps {
        let axis = (0..3).max_by_key(|&k| (per_axis[k], 2 - k)).unwrap_or(0);
        let mut columns: Vec<usize> = faces
            .iter()
            .filter(|&&f| (f % 4) as usize == axis)
            .map(|&f| {
                let i = (f / 4) as usize;
                let [nx, ny, _] = grid.dims;
                let at = grid.coords(i);
                match axis {
                    0 => at[1] + at[2] * ny,
                    1 => at[0] + at[2] * nx,
                    _ => at[0] + at[1] * nx,
                }
            })
            .collect();
        columns.sort_unstable();
        columns.dedup();
        let mut n = DVec3::ZERO;
        n[axis] = 1.0;
        (
            vector
                .try_normalize()
                .filter(|v| v.dot(n).abs() > 0.5)
                .unwrap_or(n),
            columns.len() as f64,
        )
    } else {
        (vector.normalize(), vector.length())
    };
    Front {
        opening: Opening {
            plane: Plane::through(center, normal),
            center,
            area: area * unit,
            closed: closed as f64 / total,
        },
        faces,
    }
}

/// Least share of a front's faces that lie flat on each side of a bend.
const CORNER_SHARE: f64 = 0.2;

/// Splits a front that bends around a post into its two or three parts, each across one axis of the grid; returns any
/// other front whole. The panes on both sides of a building's "corner" form such a front.
///
/// A front askew to the grid consists of steps, and is flat across no axis. `O(n log n)` in faces.
#[must_use]
pub(crate) fn without_corners(grid: &Grid, faces: Faces) -> Vec<Faces> {
    let mut per_axis: [Faces; 3] = Default::default();
    for &f in &faces {
        per_axis[(f % 4) as usize].push(f);
    }
    let is_flat = |axis: usize| {
        let at = |f: &u64| grid.coords((f / 4) as usize)[axis];
        connected_patches(grid, &per_axis[axis])
            .iter()
            .any(|patch| {
                let (low, high) = (patch.iter().map(at).min(), patch.iter().map(at).max());
                let is_level = low.zip(high).is_some_and(|(low, high)| high - low <= 1);
                is_level && patch.len() as f64 >= CORNER_SHARE * faces.len() as f64
            })
    };
    let flat: [bool; 3] = std::array::from_fn(is_flat);
    if flat.iter().filter(|&&f| f).count() < 2 {
        return vec![faces];
    }
    // The few faces across another axis are steps of these parts.
    let parts = per_axis.iter().zip(flat).filter(|p| p.1);
    parts.flat_map(|p| connected_patches(grid, p.0)).collect()
}

#[cfg(test)]
mod tests {
    use enfilade_geom::Aabb;

    use super::*;

    /// The faces of voxels across `axis`.
    fn faces(grid: &Grid, axis: u64, voxels: impl Iterator<Item = [usize; 3]>) -> Faces {
        voxels
            .map(|[x, y, z]| grid.index(x, y, z) as u64 * 4 + axis)
            .collect()
    }

    #[test]
    fn a_front_around_a_corner_is_two_and_one_askew_is_one() {
        let grid = Grid::covering(&Aabb::new(DVec3::ZERO, DVec3::splat(2.0)), 0.1, 1);
        let panes = |axis, at: fn(usize) -> [usize; 3]| {
            let column = (5..15).map(at);
            faces(
                &grid,
                axis,
                column.flat_map(|[x, _, z]| (3..12).map(move |y| [x, y, z])),
            )
        };
        // Two panes that meet at a right angle.
        let mut corner = panes(0, |i| [15, 0, i]);
        corner.extend(panes(2, |i| [i, 0, 15]));
        let parts = without_corners(&grid, corner);
        assert_eq!(parts.iter().map(Vec::len).collect::<Vec<_>>(), [90, 90]);
        // One pane at 45 degrees: steps along both axes.
        let mut askew = panes(0, |i| [i, 0, i]);
        askew.extend(panes(2, |i| [i, 0, i]));
        let n = askew.len();
        assert_eq!(
            without_corners(&grid, askew)
                .iter()
                .map(Vec::len)
                .collect::<Vec<_>>(),
            [n]
        );
    }
}
