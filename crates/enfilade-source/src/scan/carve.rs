//! The air that the stations saw.

use enfilade_geom::{Aabb, DVec3, Purse};
use rayon::prelude::*;

use super::cells::ScanGrid;
use super::view::Panorama;
use super::{REACH, Scan};

/// Vertices of a row that are tested with the same stations.
const RUN: usize = 16;

/// A station, and what it saw.
struct Station {
    at: DVec3,
    view: Panorama,
    /// Greatest distance of what it saw.
    reach: f64,
}

impl Station {
    /// Returns `true` if a place is in front of what was seen in its direction, by more than `least`.
    fn sees(&self, p: DVec3, least: f64) -> bool {
        let way = p - self.at;
        let is_before = |depth: f64| way.length() + least < depth;
        self.view.depth(way).is_some_and(is_before)
    }
}

/// Marks the vertices that lie between a station and what it saw, except near that.
///
/// Each vertex looks for itself up in the views of the stations, so that nothing is left between two ways: time goes by vertices times the
/// stations within reach. Meaningless once the purse is empty.
pub(super) fn carve(scan: &Scan, grid: &ScanGrid, purse: Purse<'_>) -> Vec<bool> {
    let stations = stations_of(scan, purse);
    let least = (REACH - 0.5) * grid.step;
    let [nx, ny, _] = grid.size;
    let row_of = |row: usize| {
        let mut free = vec![false; nx];
        for from in (0..nx).step_by(RUN) {
            let to = nx.min(from + RUN);
            let at = |x: usize| grid.point([x, row % ny, row / ny]);
            let run = Aabb::of_points(&[at(from), at(to - 1)]);
            let is_near = |s: &&Station| s.at.distance(s.at.clamp(run.min, run.max)) < s.reach;
            let mut near: Vec<&Station> = stations.iter().filter(is_near).collect();
            // A look into a view takes as long as twenty distances.
            if !purse.spend(((stations.len() + 20 * near.len()) / 16 + 1) as u64) {
                break;
            }
            for (x, free) in (from..to).zip(&mut free[from..to]) {
                let seen_by = near.iter().position(|s| s.sees(at(x), least));
                *free = seen_by.is_some();
                if let Some(k) = seen_by {
                    near.swap(0, k); // it probably sees the next one, too
                }
            }
        }
        free
    };
    let n_rows = ny * grid.size[2];
    let rows: Vec<Vec<bool>> = (0..n_rows).into_par_iter().map(row_of).collect();
    rows.concat()
}

fn stations_of(scan: &Scan, purse: Purse<'_>) -> Vec<Station> {
    let mut ways: Vec<Vec<DVec3>> = vec![Vec::new(); scan.stations.len()];
    for (p, &s) in scan.points.iter().zip(&scan.station_of) {
        ways[usize::from(s)].push(*p - scan.stations[usize::from(s)]);
    }
    let of = |(&at, ways): (&DVec3, Vec<DVec3>)| {
        let mut view = Panorama::of(&ways);
        view.close_gaps(purse);
        let reach = view.reach();
        Station { at, view, reach }
    };
    scan.stations.par_iter().zip(ways).map(of).collect()
}
