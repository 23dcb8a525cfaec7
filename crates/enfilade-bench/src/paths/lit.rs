//! Samples of the light of lamps: a point that a straight line from a lamp reaches must be reported as lit.

use enfilade::geom::DVec3;
use enfilade::world::{Lamp, LampId, Lights, PartId, Space};
use enfilade_testkit::Rng;

const LAMPS: usize = 200;

/// Counts of samples.
#[derive(Default)]
pub(super) struct Lit {
    /// Those in a straight line from the lamp, and those of them that the space does not report.
    pub(super) n_lit: usize,
    pub(super) n_lost: usize,
    /// Those that the space reports.
    pub(super) n_known: usize,
    /// Those that are lit in another cell than the lamp's.
    pub(super) n_beyond: usize,
}

impl Lit {
    /// Places lamps and tries points in their range; `is_clear` judges a line.
    pub(super) fn sampled(
        space: &Space,
        n_samples: usize,
        mut any: impl FnMut(&mut Rng) -> DVec3,
        is_clear: impl Fn(DVec3, DVec3) -> bool,
    ) -> anyhow::Result<Self> {
        let mut rng = Rng::new(2);
        let mut lights = Lights::new(space);
        let mut lamps = Vec::new();
        for _ in 0..LAMPS {
            let at = any(&mut rng).as_vec3();
            let lamp = Lamp {
                frame: PartId::ROOT,
                at: at.to_array(),
                range: rng.range(2.0, 12.0) as f32,
            };
            lights.add(space, lamp)?;
            lamps.push((at.as_dvec3(), f64::from(lamp.range)));
        }
        let mut own = Self::default();
        for _ in 0..n_samples {
            let k = rng.below(LAMPS);
            let (at, range) = lamps[k];
            // Within its range, so that most samples matter.
            let p = at + rng.turn() * DVec3::X * range * rng.unit();
            let Some(place) = space.locate(PartId::ROOT, p) else {
                continue;
            };
            let may = lights.may_light(space, LampId(k as u32), place, p);
            own.n_known += usize::from(may);
            // And slightly beyond: after rounding, a point on a wall may be on either side.
            let tolerance = space.layout(PartId::ROOT).tolerance();
            let beyond = p + (p - at).normalize_or_zero() * 8.0 * tolerance;
            if is_clear(at, beyond) {
                own.n_lit += 1;
                own.n_lost += usize::from(!may);
                own.n_beyond += usize::from(space.locate(PartId::ROOT, at) != Some(place));
            }
        }
        Ok(own)
    }
}
