//! Lines cut off at a rectangle.

use enfilade_geom::DVec2;

/// The part of the line from `a` to `b` inside the rectangle from `low` to `high`; `None` if there is none. Ends that
/// lie inside stay as they are.
pub(crate) fn clipped(a: DVec2, b: DVec2, [low, high]: [DVec2; 2]) -> Option<(DVec2, DVec2)> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let way = b - a;
    for k in 0..2 {
        if way[k] == 0.0 {
            if a[k] < low[k] || a[k] > high[k] {
                return None;
            }
            continue;
        }
        let (s, t) = ((low[k] - a[k]) / way[k], (high[k] - a[k]) / way[k]);
        enter = enter.max(s.min(t));
        leave = leave.min(s.max(t));
    }
    // Far ends leave little but rounding error, which must not lead out of the rectangle.
    let at = |t: f64| (a + way * t).clamp(low, high);
    let start = if enter > 0.0 { at(enter) } else { a };
    let end = if leave < 1.0 { at(leave) } else { b };
    (enter <= leave).then_some((start, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_at_the_rectangle_however_far_they_reach() {
        let page = [DVec2::splat(-0.4), DVec2::new(2.4, 1.4)];
        let [low, high] = page;
        let inside = (DVec2::new(0.3, 0.2), DVec2::new(1.9, 0.7));
        assert_eq!(clipped(inside.0, inside.1, page), Some(inside));
        for far in [3.0, 1e6, 1e20, 1e38] {
            let (a, b) = (DVec2::new(-far, 0.5), DVec2::new(far, 0.5));
            let (a, b) = clipped(a, b, page).unwrap();
            // As exact as numbers of that size allow.
            let off = (a.x - low.x).abs().max((b.x - high.x).abs());
            assert!(off <= 1e-15 * far, "{far}: {a} {b}");
            // The ends of a slanting line are rounded, but still in the rectangle.
            let slanting = clipped(DVec2::splat(-far), DVec2::splat(far), page);
            for p in slanting.map(|(a, b)| [a, b]).into_iter().flatten() {
                assert!(p.cmpge(low).all() && p.cmple(high).all(), "{p}");
            }
        }
        let (a, b) = (DVec2::new(-9.0, 3.0), DVec2::new(9.0, 3.0));
        assert_eq!(clipped(a, b, page), None);
    }
}
