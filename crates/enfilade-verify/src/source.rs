//! Is the source what the world was baked from?

use std::collections::HashSet;

use enfilade_geom::{Bvh, Triangle};

/// Triangles of each that are looked for on the other's surface, at most.
const ASKED: usize = 2000;
/// Percent of triangles that must be the same, corner by corner. Both round once, so that of one's own nearly all are; two
/// scenes share next to none.
const SAME: usize = 50;
/// Percent of triangles that must lie on the other's surface where fewer are the same: a world may have cut all of them.
const ON_SURFACE: usize = 95;

/// What is wrong with the source, if it is another scene's. `reach` is for rounding.
pub(crate) fn problem(own: &[Triangle], source: &[Triangle], reach: f64) -> Option<String> {
    let known: HashSet<Key> = own.iter().map(key).collect();
    let same = source.iter().filter(|t| known.contains(&key(t))).count();
    let most = own.len().max(source.len());
    if 100 * same >= SAME * most {
        return None;
    }
    let share = percent_on(source, own, reach).min(percent_on(own, source, reach));
    (share < ON_SURFACE).then(|| {
        format!(
            "the source is another scene, or was read by other settings than in the bake: {same} of its {} triangles are among the \
             world's {}",
            source.len(),
            own.len()
        )
    })
}

/// A triangle by the bits of its corners, whichever comes first.
type Key = [[u32; 3]; 3];

fn key(t: &Triangle) -> Key {
    // Adding zero makes one of the two zeros.
    let mut key = t.map(|p| p.as_vec3().to_array().map(|v| (v + 0.0).to_bits()));
    key.sort_unstable();
    key
}

fn percent_on(of: &[Triangle], within: &[Triangle], reach: f64) -> usize {
    let bvh = Bvh::build(within);
    let asked = of.iter().step_by(of.len().div_ceil(ASKED).max(1));
    let (mut there, mut n) = (0, 0);
    for t in asked {
        let middle = (t[0] + t[1] + t[2]) / 3.0;
        there += usize::from(bvh.nearest(middle, reach).is_some());
        n += 1;
    }
    100 * there / n.max(1)
}
