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

/// Values of a ball in a unit of work.
const VALUES: u64 = 16;

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
        let work = n.saturating_mul(field.cost());
        self.limits.spend(work / VALUES + 1)?;
        self.n_work = self.n_work.saturating_add(work);
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

/// Blocks whose number is enough to tell that of smaller ones from.
const ENOUGH: u64 = 256;
/// Triangles of a block that is visited, on average: many have no zero in the end.
const TRIANGLES_OF_BLOCK: f64 = 70.0;
/// How far beyond a limit a forecast has to be for certain: it is never off by as much.
const CERTAIN: f64 = 4.0;

/// Refuses an extraction that will exceed a limit by far, before its work is done.
///
/// A surface passes through four times as many blocks of half the size; what is finer than the blocks that are looked at makes them
/// more. Where time is limited, that ends the work instead.
pub(crate) fn forecast(
    field: &dyn Field,
    lattice: &Lattice,
    unit: f64,
    spent: &mut Spent<'_>,
) -> Result<(), SourceError> {
    if spent.limits.is_timed() {
        return Ok(());
    }
    let limits = spent.limits;
    let (n_blocks, cost) = expected(field, lattice, spent)?;
    let points = n_blocks * f64::from(BLOCK + 1).powi(3);
    let triangles = n_blocks * TRIANGLES_OF_BLOCK;
    let excess = [
        points / limits.max_samples as f64,
        triangles / limits.max_triangles as f64,
        points * cost / limits.max_work as f64,
    ];
    let excess = excess.into_iter().fold(0.0, f64::max);
    if excess <= CERTAIN {
        return Ok(());
    }
    let step = lattice.step * unit;
    let coarser = step * excess.sqrt();
    let problem = format!(
        "at a step of {step}, it takes about {points:.0e} points and {triangles:.0e} triangles, {excess:.0} times what is allowed; \
         give a step of {coarser:.1e} or more, or limit only the time (--max-time)"
    );
    Err(SourceError::new("surface", problem))
}

/// Returns the number of blocks that an extraction is expected to visit, and the mean cost of a value in them.
fn expected(
    field: &dyn Field,
    lattice: &Lattice,
    spent: &mut Spent<'_>,
) -> Result<(f64, f64), SourceError> {
    let mut size = root(lattice);
    let (mut n, mut cost) = (0_u64, 0_u64);
    while size > BLOCK {
        (n, cost) = (0, 0);
        let mut count = |field: &dyn Field, _: [i32; 3], _: &mut Spent<'_>| {
            n += 1;
            cost += field.cost();
            Ok(())
        };
        let to = [size, root(lattice)];
        descend(field, lattice, [0; 3], to, spent, &mut count)?;
        if n >= ENOUGH || size / 2 == BLOCK {
            break;
        }
        size /= 2;
    }
    let of_each = (f64::from(size) / f64::from(BLOCK)).powi(2);
    let n_seen = n as f64;
    Ok((n_seen * of_each, cost as f64 / n_seen.max(1.0)))
}

fn root(lattice: &Lattice) -> i32 {
    let longest = lattice.n_cells.into_iter().max().unwrap_or(0);
    let mut size = BLOCK;
    while size < longest {
        size *= 2;
    }
    size
}

/// Visits all blocks that may have zeros, in a fixed order, each with a field that has the right values in it.
pub(crate) fn for_blocks(
    field: &dyn Field,
    lattice: &Lattice,
    spent: &mut Spent<'_>,
    visit: &mut Visit<'_>,
) -> Result<(), SourceError> {
    let mut counted = |field: &dyn Field, from: [i32; 3], spent: &mut Spent<'_>| {
        spent.count_samples((BLOCK as u64 + 1).pow(3))?;
        visit(field, from, spent)
    };
    let sizes = [BLOCK, root(lattice)];
    descend(field, lattice, [0; 3], sizes, spent, &mut counted)
}

/// Visits the blocks of some size that may have zeros, in one of another size.
fn descend(
    field: &dyn Field,
    lattice: &Lattice,
    from: [i32; 3],
    [to, size]: [i32; 2],
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
    if size == to {
        return visit(field, from, spent);
    }
    let half = size / 2;
    for part in 0..8 {
        let at = [0, 1, 2].map(|a| from[a] + (part >> a & 1) * half);
        descend(field, lattice, at, [to, half], spent, visit)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ExtractOptions, ImplicitScene, extract};

    fn parsed(shape: &str, step: f64) -> ImplicitScene {
        let text = format!(r#"{{"enfilade":"implicit","step":{step},"air":{shape}}}"#);
        ImplicitScene::parse(text.as_bytes(), &SourceLimits::default()).unwrap()
    }

    const BALL: &str = r#"{"ball":{"at":[0,2,0],"radius":3}}"#;

    #[test]
    fn a_forecast_is_near_the_blocks_and_triangles_that_come() {
        let shapes = [
            BALL,
            r#"{"box":{"min":[0,0,0],"max":[9,3,5]}}"#,
            r#"{"smooth_union":{"by":0.5,"of":[{"ball":{"at":[0,0,0],"radius":2}},{"tube":{"points":[[0,0,0],[9,0,1]],"radius":0.9}}]}}"#,
            r#"{"intersection":[{"gyroid":{"period":4,"at":[0,0,0]}},{"box":{"min":[0,0,0],"max":[8,8,8]}}]}"#,
            r#"{"shell":{"of":{"box":{"min":[0,0,0],"max":[9,3,5]}},"thickness":0.4}}"#,
        ];
        for shape in shapes {
            let scene = parsed(shape, 0.1);
            let options = ExtractOptions::of_step(scene.bounds(), scene.step());
            let limits = SourceLimits::default();
            let mut spent = Spent::new(&limits);
            let (n, cost) = expected(&scene, &options.lattice, &mut spent).unwrap();
            assert!(cost >= 1.0, "{shape}");
            let surface = extract(&scene, &options, &limits).unwrap();
            let blocks = surface.n_samples as f64 / f64::from(BLOCK + 1).powi(3);
            let triangles = surface.n_extracted as f64;
            for (forecast, found) in [(n, blocks), (n * TRIANGLES_OF_BLOCK, triangles)] {
                let ratio = forecast / found;
                assert!((1.0 / CERTAIN..CERTAIN).contains(&ratio), "{ratio} {shape}");
            }
        }
    }

    #[test]
    fn work_out_of_proportion_is_refused_before_it_is_done() {
        let scene = parsed(BALL, 0.0002);
        let options = ExtractOptions::of_step(scene.bounds(), scene.step());
        let limits = SourceLimits::default();
        let mut spent = Spent::new(&limits);
        let e = forecast(&scene, &options.lattice, 1.0, &mut spent).unwrap_err();
        for word in ["0.0002", "points", "step of", "--max-time"] {
            assert!(e.problem.contains(word), "{e}");
        }
        assert!(spent.n_work < 100_000, "{}", spent.n_work);
    }

    #[test]
    fn limited_time_ends_an_extraction_instead() {
        let scene = parsed(BALL, 0.0002);
        let limits = SourceLimits {
            allowance: Some(std::sync::Arc::new(enfilade_geom::Allowance::new(
                1 << 20,
                Some(std::time::Instant::now() + std::time::Duration::from_secs(1000)),
            ))),
            ..SourceLimits::default()
        };
        let e = scene.surface(&limits).unwrap_err();
        assert!(e.problem.contains("allowance"), "{e}");
    }
}
