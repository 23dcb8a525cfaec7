//! Advice on models with more cracks than doors.

use std::io::{self, Write};

use enfilade::bake::BakeOutput;
use enfilade::cpg::PortalKind;
use enfilade::internals::bake::complex::CRACK_WIDTH;

/// Least fraction of the cracks that the proposed width closes.
const MOST: f64 = 0.9;
/// A gap is closed if no ball passes, and balls are slightly wider than cracks where vertices are moved.
const MARGIN: f64 = 1.1;
/// Proposed widths are multiples of this. [Units: wu]
const STEP: f64 = 0.005;

/// Reports if there are more cracks than doorways and windows, with the width that closes most of them. Returns `true`
/// if so.
pub(super) fn write_cracks(out: &mut impl Write, baked: &BakeOutput) -> io::Result<bool> {
    let portals = &baked.world.graph.portals;
    let n = portals
        .iter()
        .filter(|p| p.kind == PortalKind::Crack)
        .count();
    if n <= portals.len() - n {
        return Ok(false);
    }
    let widths = baked.leaks.iter().map(|l| l.width);
    let proposal = closing(widths.filter(|&w| w < CRACK_WIDTH).collect());
    let plural = if n == 1 { "" } else { "s" };
    writeln!(
        out,
        "{n} crack{plural}, and {} doorways and windows: surfaces that should meet do not{}",
        portals.len() - n,
        match proposal {
            Some((width, n_closed)) =>
                format!("; --smallest-hole {width} closes {n_closed} of the cracks"),
            None => String::new(),
        }
    )?;
    Ok(true)
}

/// Returns a round width that exceeds most of the crack widths, and the number of cracks below it. [Units: wu]
fn closing(mut widths: Vec<f64>) -> Option<(f64, usize)> {
    widths.sort_by(f64::total_cmp);
    let most = (widths.len() as f64 * MOST).ceil() as usize;
    let widest = *widths.get(most.checked_sub(1)?)?;
    // In whole steps, so that the printed width is exact.
    let steps = (widest * MARGIN / STEP).ceil();
    let width = (steps * STEP * 1000.0).round() / 1000.0;
    Some((width, widths.partition_point(|&w| w < width)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_width_is_round_and_above_most_cracks() {
        assert_eq!(closing(vec![]), None);
        assert_eq!(closing(vec![0.012]), Some((0.015, 1)));
        assert_eq!(closing(vec![0.015]), Some((0.02, 1)));
        let mut many = vec![0.049];
        many.extend([0.021; 9]);
        assert_eq!(closing(many), Some((0.025, 9)));
    }
}
