//! Branches in the form that the rest of the builder uses: a label for each part, and a weight for each mouth.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use smallvec::SmallVec;

use super::space::Space;
use crate::rooms::THICKER;

/// The parts that lie in branches.
pub(super) struct Branches {
    /// Branch of each part; 0 for none.
    pub(super) label_of_part: Vec<u32>,
    /// Mouth of each branch, from label 1 on.
    pub(super) mouths: Vec<BranchMouth>,
}

/// Weight of a branch's mouth, and a radius to compare it with others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BranchMouth {
    /// Radius of the trunk's largest ball near the mouth ÷ that of the branch's largest ball well inside.
    pub(super) weight: f64,
    /// Radius of the branch's largest ball well inside; half-width of a limb. [Units: wu]
    pub(super) radius: f64,
    /// It is that of a limb in plan.
    pub(super) is_limb: bool,
}

impl Branches {
    /// Returns branches of which no part has any.
    pub(super) fn none(n_parts: usize) -> Self {
        Self {
            label_of_part: vec![0; n_parts],
            mouths: Vec::new(),
        }
    }

    /// Drops each label whose share of a cell is less than one ball: that share takes the label of most of the cell.
    /// Cells are those of [`flow_together`](super::cells::flow_together).
    pub(super) fn without_leftovers(mut self, space: &Space, cell_of_part: &[u32]) -> Self {
        let mut shares: BTreeMap<(u32, u32), (f64, f64)> = BTreeMap::new();
        for (t, (&cell, &label)) in cell_of_part.iter().zip(&self.label_of_part).enumerate() {
            let (volume, radius) = shares.entry((cell, label)).or_default();
            *volume += space.volumes[t];
            *radius = radius.max(space.radii[t]);
        }
        let mut most: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
        for (&(cell, label), &(volume, _)) in &shares {
            let of_cell = most.entry(cell).or_insert((volume, label));
            if volume > of_cell.0 {
                *of_cell = (volume, label);
            }
        }
        for (label, cell) in self.label_of_part.iter_mut().zip(cell_of_part) {
            let (volume, radius) = shares[&(*cell, *label)];
            if volume < 4.0 / 3.0 * PI * radius.powi(3) {
                *label = most[cell].1;
            }
        }
        self
    }

    pub(super) fn is_empty(&self) -> bool {
        self.mouths.is_empty()
    }

    /// Returns the weight of an opening between two parts as a mouth, by their labels: the narrower branch ends there.
    /// 0 within a branch, away from branches, and between limbs of which neither is thick enough to be a room beside the
    /// other: they meet in a corridor.
    pub(super) fn weight(&self, [a, b]: [u32; 2]) -> f64 {
        if a == b {
            return 0.0;
        }
        let mouths = [a, b].into_iter().filter(|&l| l > 0);
        let mut mouths: SmallVec<[BranchMouth; 2]> =
            mouths.map(|l| self.mouths[l as usize - 1]).collect();
        mouths.sort_by(|p, q| p.radius.total_cmp(&q.radius));
        match mouths[..] {
            [p, q] if p.is_limb && q.is_limb && q.radius < THICKER * p.radius => 0.0,
            [narrower, ..] => narrower.weight,
            [] => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::space::divide;
    use super::*;
    use crate::structure::structural_triangles;
    use enfilade_geom::{Bvh, DVec3};
    use enfilade_testkit::{Tube, tubes};

    #[test]
    fn less_than_a_ball_goes_with_its_cell() {
        let tube = Tube {
            ends: [DVec3::X * -4.0, DVec3::X * 4.0],
            radius: 0.7,
        };
        let walls = structural_triangles(&tubes(&[tube], 0.2).scene).1;
        let space = divide(&walls, &[], &Bvh::build(&walls), 0.6).unwrap();
        let n = space.radii.len();
        let is_in = |t: usize| {
            space.middles[t].with_x(0.0).length() < 0.6 && space.middles[t].x.abs() < 4.0
        };
        let cell_of_part: Vec<u32> = (0..n).map(|t| u32::from(is_in(t))).collect();
        // One half is a branch, and so is one tetrahedron in the other: across the tube, and much less than its ball.
        let lone = (0..n)
            .filter(|&t| is_in(t) && space.middles[t].x < -1.0)
            .max_by(|&a, &b| space.radii[a].total_cmp(&space.radii[b]))
            .unwrap();
        let label = |t: usize| match t {
            t if t == lone => 2,
            t => u32::from(is_in(t) && space.middles[t].x > 1.0),
        };
        let labels: Vec<u32> = (0..n).map(label).collect();
        let mouth = BranchMouth {
            weight: 2.0,
            radius: 0.7,
            is_limb: false,
        };
        let branches = Branches {
            label_of_part: labels.clone(),
            mouths: vec![mouth; 2],
        };
        let mended = branches
            .without_leftovers(&space, &cell_of_part)
            .label_of_part;
        for t in 0..n {
            let expected = if t == lone { 0 } else { labels[t] };
            assert_eq!(mended[t], expected, "{t}");
        }
    }
}
