//! *Sealed*, without chance: where the locator's answer changes, there is a wall, a seal or a portal.
//!
//! Cells change at faces of the convex leaves of the locator's tree. A few short segments through each face find any
//! slit that ends at a leaf, however short, if it is wider than the distance below which nothing is judged.

use enfilade_geom::DVec3;
use enfilade_geom::poly;
use rayon::prelude::*;

use crate::locator_cells::for_each_leaf;
use crate::report::Tally;
use crate::rng::Rng;
use crate::sealed::check_segment;
use crate::subject::Subject;

/// Half the length of a segment across a face or portal, in tolerances. Hairs between surfaces closer than that may
/// belong to either cell.
const ASIDE: f64 = 20.0;
/// Segments per batch.
const TOGETHER: usize = 1 << 15;

/// Tries short segments across all faces of the locator's leaves at which its answer changes. Linear in faces.
pub(crate) fn try_all(subject: &Subject, seed: u64) -> Tally {
    let (mut waiting, mut all) = (Vec::new(), Tally::default());
    let mut n = 0;
    let mut flush = |waiting: &mut Vec<[DVec3; 2]>| {
        let found = try_some(subject, seed, n, waiting);
        all = std::mem::take(&mut all).merged(found);
        n += 1;
        waiting.clear();
    };
    for_each_leaf(subject.locator, |_, body| {
        for face in body {
            let Some(normal) = poly::area_normal(face).try_normalize() else {
                continue;
            };
            let step = normal * (ASIDE * subject.eps);
            // A point towards each of its edges: half of a seal may be missing.
            let middle = face.iter().sum::<DVec3>() / face.len() as f64;
            for (k, &p) in face.iter().enumerate() {
                let p = (middle + p + face[(k + 1) % face.len()]) / 3.0;
                waiting.push([p - step, p + step]);
            }
        }
        if waiting.len() >= TOGETHER {
            flush(&mut waiting);
        }
    });
    flush(&mut waiting);
    all
}

/// Tries segments between two answers of the locator; counts them apart from random segments.
fn try_some(subject: &Subject, seed: u64, n: u64, segments: &[[DVec3; 2]]) -> Tally {
    let chunks = segments.par_chunks(TOGETHER / 16).enumerate();
    let tried = chunks.map(|(chunk, segments)| {
        let mut rng = Rng::new(seed, (1 << 60) + 64 * n + chunk as u64);
        let mut tally = Tally::default();
        for &[a, b] in segments {
            if subject.locator.locate(a) == subject.locator.locate(b) {
                continue;
            }
            // Most are blocked by walls.
            if subject.blockers.any_hit(a, b, |_| false) {
                tally.sealed.drawn += 1;
                tally.sealed.blocked += 1;
            } else if [a, b]
                .iter()
                .all(|&p| subject.is_clear(p, 0.9 * ASIDE * subject.eps))
            {
                check_segment(subject, &mut rng, 0, [a, b], &mut tally);
            }
        }
        tally.across = std::mem::take(&mut tally.sealed);
        tally
    });
    tried.reduce(Tally::default, Tally::merged)
}
