//! Writing SVG: numbers, text and colors, the same bytes every time.

use enfilade_geom::DVec2;

/// Drawing units a meter: centimeters, so that one decimal is a millimeter.
pub(crate) const SCALE: f64 = 100.0;

/// A number with at most one decimal and without a useless one.
pub(crate) fn number(x: f64) -> String {
    let tenths = (x * 10.0).round() as i64;
    if tenths % 10 == 0 {
        return (tenths / 10).to_string();
    }
    let sign = if tenths < 0 { "-" } else { "" };
    // The smallest number of all has no absolute value of its own type.
    let tenths = tenths.unsigned_abs();
    format!("{sign}{}.{}", tenths / 10, tenths % 10)
}

/// `x y` of a point in meters, as drawn.
pub(crate) fn point(p: DVec2) -> String {
    format!("{} {}", number(p.x * SCALE), number(p.y * SCALE))
}

/// Path data of a polygon.
pub(crate) fn closed(points: &[DVec2]) -> String {
    let corners: Vec<String> = points.iter().map(|&p| point(p)).collect();
    format!("M{}Z", corners.join("L"))
}

/// Path data of a line.
pub(crate) fn line(a: DVec2, b: DVec2) -> String {
    format!("M{}L{}", point(a), point(b))
}

/// Text safe between tags and in attributes; what XML cannot hold at all is replaced.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => out.push(' '),
            '\0'..='\x1f' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A light color of its own for each number; neighbors in number are far apart in hue.
pub(crate) fn color(id: u32) -> String {
    // The golden angle spreads any run of hues evenly; lightness alternates over three steps so
    // that hues that come round again still differ.
    let hue = (f64::from(id) * 137.507_764 + 40.0) % 360.0;
    let lightness = [0.82, 0.75, 0.87][(id % 3) as usize];
    let saturation = 0.62;
    let reach = saturation * f64::min(lightness, 1.0 - lightness);
    let channel = |n: f64| {
        let k = (n + hue / 30.0) % 12.0;
        let value = lightness - reach * f64::min(k - 3.0, 9.0 - k).clamp(-1.0, 1.0);
        (value * 255.0).round() as u8
    };
    format!(
        "#{:02x}{:02x}{:02x}",
        channel(0.0),
        channel(8.0),
        channel(4.0)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_size_are_numbers() {
        assert_eq!(number(-0.04), "0");
        assert_eq!(number(-1.25), "-1.3");
        assert_eq!(number(f64::MAX), "922337203685477580.7");
        assert_eq!(number(f64::MIN), "-922337203685477580.8");
    }
}
