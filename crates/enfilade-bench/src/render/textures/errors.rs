//! Errors of pictures within the pixels of portals: against the truth, and from frame to frame.

use enfilade::cpg::Portal;
use enfilade::geom::DVec3;
use enfilade_render::{Camera, Picture};

use crate::measure::point;

/// Pixels of a picture, rows from the top: `true` for those that count.
pub(super) type Mask = Vec<bool>;

/// Returns the pixels whose middles lie in the outline of a portal, whatever stands before it. Time grows with portals times
/// pixels.
pub(super) fn portal_mask<'p>(
    camera: &Camera,
    portals: impl IntoIterator<Item = &'p Portal>,
    [width, height]: [u32; 2],
) -> Mask {
    let tan = f64::from((camera.fov_y * 0.5).tan());
    let aspect = f64::from(width) / f64::from(height);
    let [right, up, forward] = camera.axes().map(|a| a.as_dvec3());
    let eye = point(camera.eye);
    let mut mask = vec![false; (width * height) as usize];
    for portal in portals {
        let outline: Vec<DVec3> = portal.outline.iter().map(|p| point(*p) - eye).collect();
        let next = outline.iter().cycle().skip(1);
        // Planes through the eye and the edges; facing inwards from one side of the portal, outwards from the other.
        let planes: Vec<DVec3> = outline.iter().zip(next).map(|(a, b)| a.cross(*b)).collect();
        for (i, pixel) in mask.iter_mut().enumerate() {
            let [x, y] = [i as u32 % width, i as u32 / width].map(|k| f64::from(k) + 0.5);
            let across = (x / f64::from(width) * 2.0 - 1.0) * tan * aspect;
            let above = (1.0 - y / f64::from(height) * 2.0) * tan;
            let ray = forward + right * across + up * above;
            let is_inside = |sign: f64| planes.iter().all(|p| p.dot(ray) * sign > 0.0);
            let is_ahead = outline.iter().map(|p| p.dot(ray)).sum::<f64>() > 0.0;
            *pixel |= is_ahead && (is_inside(1.0) || is_inside(-1.0));
        }
    }
    mask
}

/// Returns the mean of a value over the channels of the masked pixels; 0 if there are none.
fn mean_in(mask: &[bool], value: impl Fn(usize) -> f64) -> f64 {
    let pixels = mask.iter().enumerate().filter(|(_, is_in)| **is_in);
    let channels = pixels.flat_map(|(i, _)| (0..3).map(move |k| 4 * i + k));
    let (sum, n) = channels.fold((0.0, 0_u64), |(sum, n), at| (sum + value(at), n + 1));
    sum / n.max(1) as f64
}

/// Returns the mean absolute difference of two pictures in the masked pixels. [Units: 1/255 a channel]
pub(super) fn mean_difference(picture: &Picture, truth: &Picture, mask: &[bool]) -> f64 {
    let value = |i: usize| f64::from(picture.rgba[i].abs_diff(truth.rgba[i]));
    mean_in(mask, value)
}

/// Returns how much two frames change beyond what the truth changes, in the masked pixels: the mean of
/// |(a₁ − a₀) − (b₁ − b₀)|. [Units: 1/255 a channel]
pub(super) fn mean_pop(frames: [&Picture; 2], truths: [&Picture; 2], mask: &[bool]) -> f64 {
    let value = |i: usize| {
        let change =
            |[before, now]: [&Picture; 2]| i32::from(now.rgba[i]) - i32::from(before.rgba[i]);
        f64::from((change(frames) - change(truths)).abs())
    };
    mean_in(mask, value)
}

#[cfg(test)]
mod tests {
    use enfilade_testkit::{GridParams, room_grid};

    use super::*;

    fn row(reds: &[u8]) -> Picture {
        Picture {
            width: reds.len() as u32,
            height: 1,
            rgba: reds.iter().flat_map(|r| [*r, 7, 7, 255]).collect(),
        }
    }

    #[test]
    fn differences_count_in_the_mask_only() {
        let [a, b] = [row(&[10, 20, 200]), row(&[13, 14, 0])];
        // 3 and 6 in one of three channels each.
        let found = mean_difference(&a, &b, &[true, true, false]);
        assert!((found - 9.0 / 6.0).abs() < 1e-12, "{found}");
        assert_eq!(mean_difference(&a, &b, &[false; 3]), 0.0);
    }

    #[test]
    fn a_change_that_the_truth_makes_as_well_is_not_a_pop() {
        let [before, now] = [row(&[10, 20]), row(&[60, 20])];
        let shifted = [row(&[15, 20]), row(&[65, 20])];
        let mask = [true, true];
        let still = mean_pop([&shifted[0], &shifted[1]], [&before, &now], &mask);
        assert_eq!(still, 0.0, "a constant error does not pop");
        // One channel of six jumps by 50 where the truth stays.
        let pop = mean_pop([&before, &now], [&before, &before], &mask);
        assert!((pop - 50.0 / 6.0).abs() < 1e-12, "{pop}");
        let opposite = mean_pop([&before, &now], [&now, &before], &mask);
        assert!((opposite - 100.0 / 6.0).abs() < 1e-12, "{opposite}");
    }

    #[test]
    fn the_mask_is_where_the_portal_is_in_view() {
        let mut world = room_grid(&GridParams::two_rooms());
        let portal = &mut world.graph.portals[0];
        portal.outline = vec![
            [-1.0, -1.0, -4.0],
            [1.0, -1.0, -4.0],
            [1.0, 1.0, -4.0],
            [-1.0, 1.0, -4.0],
        ];
        let portal = &*portal;
        let camera = |z: f32| Camera {
            eye: [0.0; 3],
            toward: [0.0, 0.0, z],
            fov_y: std::f32::consts::FRAC_PI_2,
        };
        // A quarter of the picture's width and height.
        let mask = portal_mask(&camera(-1.0), [portal], [16, 16]);
        assert_eq!(mask.iter().filter(|m| **m).count(), 16);
        assert!(mask[6 * 16 + 6] && !mask[5 * 16 + 6] && mask[9 * 16 + 9]);
        let mask = portal_mask(&camera(1.0), [portal], [16, 16]);
        assert!(!mask.contains(&true), "it is behind the eye");
    }
}
