//! Descent to the blocks of a lattice in which a field has zeros.

use enfilade_geom::{Aabb, DVec3};

use crate::{Field, SourceError, SourceLimits};

/// Cells along the edge of a block.
pub(crate) const BLOCK: i32 = 8;

/// Points of space in rows along x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// The point with all indices 0.
    pub origin: DVec3,
    /// Distance between neighbors along each axis. [Limit: above 0]
    pub step: f64,
    /// Cells along each axis, each between two neighbors. [Limit: at most 2^30]
    pub n_cells: [i32; 3],
}

impl Lattice {
    /// Returns a point by its indices. Equal indices give equal points, to the bit.
    pub(crate) fn point(&self, at: [i32; 3]) -> DVec3 {
        self.origin + DVec3::from_array(at.map(f64::from)) * self.step
    }

    fn cells(&self, from: [i32; 3], n: i32) -> Aabb {
        Aabb::new(self.point(from), self.point(from.map(|c| c + n)))
    }
}

/// Work done by an extraction so far.
pub(crate) struct Spent<'l> {
    pub(crate) limits: &'l SourceLimits,
    pub(crate) n_samples: u64,
    n_work: u64,
}

impl<'l> Spent<'l> {
    pub(crate) fn new(limits: &'l SourceLimits) -> Self {
        Self {
            limits,
            n_samples: 0,
            n_work: 0,
        }
    }

    /// Counts values of a field.
    pub(crate) fn count(&mut self, field: &dyn Field, n: u64) -> Result<(), SourceError> {
        self.n_work = self.n_work.saturating_add(n.saturating_mul(field.cost()));
        if self.n_work > self.limits.max_work {
            let most = self.limits.max_work;
            let problem = format!(
                "takes more than {most} values of shapes; give a coarser step, or fewer shapes at one place"
            );
            return Err(SourceError::new("surface", problem));
        }
        Ok(())
    }

    fn count_samples(&mut self, n: u64) -> Result<(), SourceError> {
        self.n_samples += n;
        if self.n_samples > self.limits.max_samples {
            let most = self.limits.max_samples;
            let problem = format!("needs more than {most} points near it; give a coarser step");
            return Err(SourceError::new("surface", problem));
        }
        Ok(())
    }
}

/// Work on a block: a field for it, its first cell, and what was spent.
pub(crate) type Visit<'v> =
    dyn FnMut(&dyn Field, [i32; 3], &mut Spent<'_>) -> Result<(), SourceError> + 'v;

/// Visits all blocks that may have zeros, in a fixed order, each with a field that has the right values in it.
pub(crate) fn for_blocks(
    field: &dyn Field,
    lattice: &Lattice,
    spent: &mut Spent<'_>,
    visit: &mut Visit<'_>,
) -> Result<(), SourceError> {
    let longest = lattice.n_cells.into_iter().max().unwrap_or(0);
    let mut size = BLOCK;
    while size < longest {
        size *= 2;
    }
    descend(field, lattice, [0; 3], size, spent, visit)
}

fn descend(
    field: &dyn Field,
    lattice: &Lattice,
    from: [i32; 3],
    size: i32,
    spent: &mut Spent<'_>,
    visit: &mut Visit<'_>,
) -> Result<(), SourceError> {
    if (0..3).any(|a| from[a] >= lattice.n_cells[a]) {
        return Ok(());
    }
    let within = lattice.cells(from, size);
    spent.count(field, 2)?;
    if !field.range(&within).has_zero() {
        return Ok(());
    }
    let narrowed = field.narrowed(&within);
    let field = narrowed.as_deref().unwrap_or(field);
    if size == BLOCK {
        spent.count_samples((BLOCK as u64 + 1).pow(3))?;
        return visit(field, from, spent);
    }
    let half = size / 2;
    for part in 0..8 {
        let at = [0, 1, 2].map(|a| from[a] + (part >> a & 1) * half);
        descend(field, lattice, at, half, spent, visit)?;
    }
    Ok(())
}
