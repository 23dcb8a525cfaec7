//! Vertices that are one if they are closer than a distance.

use std::collections::HashMap;

use enfilade_geom::DVec3;

/// Vertices on limits of patches by the cube in which they lie.
pub(super) struct Weld {
    distance: f64,
    known: HashMap<[i64; 3], Vec<u32>>,
}

impl Weld {
    pub(super) fn new(distance: f64) -> Self {
        Self {
            distance,
            known: HashMap::new(),
        }
    }

    /// Returns the index of the first vertex within the distance, or of a new one.
    pub(super) fn index(&mut self, p: DVec3, positions: &mut Vec<DVec3>) -> u32 {
        let cube = (p / self.distance).floor().to_array().map(|c| c as i64);
        for k in 0..27 {
            let near = [k % 3, k / 3 % 3, k / 9];
            let near = [0, 1, 2].map(|a| cube[a].saturating_add(near[a] - 1));
            let all = self.known.get(&near).into_iter().flatten();
            let found = all
                .copied()
                .find(|&i| positions[i as usize].distance(p) < self.distance);
            if let Some(found) = found {
                return found;
            }
        }
        let new = push(p, positions);
        self.known.entry(cube).or_default().push(new);
        new
    }
}

/// Adds a vertex, and returns its index.
pub(super) fn push(p: DVec3, positions: &mut Vec<DVec3>) -> u32 {
    positions.push(p);
    positions.len() as u32 - 1
}
