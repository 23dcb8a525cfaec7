//! How wide basins are, and how wide the places where they touch: for basins that no flood has made.

use std::collections::BTreeMap;

use enfilade_geom::Allowance;
use rayon::prelude::*;

use super::super::labels::{EDGE, Labels};
use super::DistanceField;
use super::basins::STEPS;
use super::levels::level;

/// Greatest distances in basins and where they touch, rounded down to 1/64. [Units: vx]
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Touching {
    /// In each basin.
    pub peaks: BTreeMap<u32, f64>,
    /// Where two touch, lower label first.
    pub saddles: BTreeMap<(u32, u32), f64>,
}

/// Raises the value of a key, if it is less.
fn raise<K: Ord>(values: &mut BTreeMap<K, f64>, key: K, value: f64) {
    let most = values.entry(key).or_insert(0.0);
    *most = most.max(value);
}

impl Touching {
    fn with(mut self, other: Self) -> Self {
        for (label, peak) in other.peaks {
            raise(&mut self.peaks, label, peak);
        }
        for (pair, saddle) in other.saddles {
            raise(&mut self.saddles, pair, saddle);
        }
        self
    }
}

impl DistanceField {
    /// Measures the basins that are `wanted`, and their contacts with any. Label 0 is not a basin.
    ///
    /// Linear in voxels; a layer of bricks of labels at a time in each thread. Incomplete if the allowance is over.
    ///
    /// # Panics
    /// If `labels` is not of the field's size.
    #[must_use]
    pub fn touching(
        &self,
        labels: &Labels,
        wanted: impl Fn(u32) -> bool + Sync,
        allowance: &Allowance,
    ) -> Touching {
        let [nx, _, nz] = self.shape.dims;
        assert_eq!(labels.dims(), self.shape.dims, "labels of the same box");
        let n = self.shape.layer();
        let distance = |word: u16| f64::from(level(word)) / f64::from(STEPS);
        let of_layer = |buffer: &mut Vec<u16>, layer: usize| {
            let mut found = Touching::default();
            let [from, to] = [layer, layer + 1].map(|l| nz.min(EDGE * l));
            if !allowance.spend(1 + ((to - from) * n) as u64 / 32) {
                return found;
            }
            let span = [from, nz.min(to + 1)];
            let words = self.levels.read(self.shape, span, buffer);
            labels.for_runs(n * from..n * to, |run, label| {
                if label != 0 && wanted(label) {
                    let words = &words[run.start - n * from..run.end - n * from];
                    let most = words.iter().map(|&w| level(w)).max().unwrap_or(0);
                    raise(&mut found.peaks, label, distance(most));
                }
            });
            labels.for_faces(layer, |i, axis, [a, b]| {
                if a != 0 && b != 0 && (wanted(a) || wanted(b)) {
                    let sides = [i, i + [1, nx, n][axis]].map(|v| distance(words[v - n * from]));
                    let pair = (a.min(b), a.max(b));
                    raise(&mut found.saddles, pair, sides[0].min(sides[1]));
                }
            });
            found
        };
        let layers = (0..labels.n_layers()).into_par_iter();
        layers
            .map_init(Vec::new, of_layer)
            .reduce(Touching::default, Touching::with)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::BitVolume;
    use crate::{SparseVolume, WatershedOptions, distance_squared, watershed};

    /// Two rooms of 9 × 9 × 20 voxels, a wall with a doorway 5 wide between them.
    fn two_rooms() -> (BitVolume, BitVolume) {
        let dims = [21, 11, 22];
        let mut occupied = BitVolume::new(dims);
        for (z, y, x) in
            (0..22).flat_map(|z| (0..11).flat_map(move |y| (0..21).map(move |x| (z, y, x))))
        {
            let is_shell = [0, 20].contains(&x) || [0, 10].contains(&y) || [0, 21].contains(&z);
            let is_wall = x == 10 && !(8..13).contains(&z);
            if is_shell || is_wall {
                occupied.set(x, y, z, true);
            }
        }
        let outdoors = BitVolume::new(dims);
        (occupied, outdoors)
    }

    #[test]
    fn touching_measures_what_a_flood_finds() {
        let (occupied, outdoors) = two_rooms();
        let allowance = Allowance::default();
        let squared = distance_squared(&occupied, &allowance);
        let options = WatershedOptions {
            h: 1.0,
            outdoors: None,
        };
        let flood = watershed(occupied.dims(), squared.clone(), &options, &allowance);
        assert_eq!(flood.basins.len(), 2);
        let [blocked, far] = [&occupied, &outdoors].map(SparseVolume::of);
        for field in [
            DistanceField::of(&blocked, &far, &allowance),
            DistanceField::of_squared(occupied.dims(), squared, &outdoors),
        ] {
            let all = field.touching(&flood.labels, |_| true, &allowance);
            let peaks: Vec<f64> = flood.basins.iter().map(|b| b.peak).collect();
            assert_eq!(all.peaks.into_values().collect::<Vec<f64>>(), peaks);
            let saddles = flood.saddles.iter().map(|s| ((s.a, s.b), s.distance));
            assert_eq!(all.saddles, saddles.collect());
            let one = field.touching(&flood.labels, |l| l == 2, &allowance);
            assert_eq!((one.peaks.len(), one.saddles.len()), (1, 1));
            let none = field.touching(&flood.labels, |_| false, &allowance);
            assert_eq!(none, Touching::default());
        }
    }
}
