//! The color scale of overdraw pictures.

use crate::picture::Picture;

/// The count of the last color, which stands for more, too: as in `post.wgsl`.
const MOST: u32 = 16;

/// Returns the color of a number of draws as the shader paints it. Linear.
fn heat(n: f32) -> [f32; 3] {
    const STOPS: [[f32; 3]; 5] = [
        [0.0; 3],
        [0.05, 0.08, 0.5],
        [0.75, 0.08, 0.15],
        [1.0, 0.75, 0.1],
        [1.0; 3],
    ];
    let t = (n / MOST as f32).clamp(0.0, 1.0) * 4.0;
    let i = (t as usize).min(3);
    [0, 1, 2].map(|k| STOPS[i][k] + (STOPS[i + 1][k] - STOPS[i][k]) * (t - i as f32))
}

/// Returns the color of a number of draws in a finished picture. sRGB.
fn pixel_of(n: u32) -> [u8; 4] {
    let encoded = |x: f32| {
        let x = if x <= 0.003_130_8 {
            x * 12.92
        } else {
            1.055 * x.powf(1.0 / 2.4) - 0.055
        };
        (x * 255.0).round() as u8
    };
    let [r, g, b] = heat(n as f32).map(encoded);
    [r, g, b, 255]
}

/// Digits and a plus, three pixels wide and five high: three bits per row, the highest on the left.
const GLYPHS: [(char, [u8; 5]); 11] = [
    ('0', [0b111, 0b101, 0b101, 0b101, 0b111]),
    ('1', [0b010, 0b110, 0b010, 0b010, 0b111]),
    ('2', [0b111, 0b001, 0b111, 0b100, 0b111]),
    ('3', [0b111, 0b001, 0b111, 0b001, 0b111]),
    ('4', [0b101, 0b101, 0b111, 0b001, 0b001]),
    ('5', [0b111, 0b100, 0b111, 0b001, 0b111]),
    ('6', [0b111, 0b100, 0b111, 0b101, 0b111]),
    ('7', [0b111, 0b001, 0b010, 0b010, 0b010]),
    ('8', [0b111, 0b101, 0b111, 0b101, 0b111]),
    ('9', [0b111, 0b101, 0b111, 0b001, 0b111]),
    ('+', [0b000, 0b010, 0b111, 0b010, 0b000]),
];

impl Picture {
    fn fill(&mut self, [x, y, w, h]: [u32; 4], color: [u8; 4]) {
        for row in y..(y + h).min(self.height) {
            for column in x..(x + w).min(self.width) {
                let i = ((row * self.width + column) * 4) as usize;
                self.rgba[i..i + 4].copy_from_slice(&color);
            }
        }
    }

    fn write(&mut self, text: &str, [x, y]: [u32; 2], dot: u32) {
        for (i, c) in (0..).zip(text.chars()) {
            let glyph = GLYPHS.iter().find(|g| g.0 == c).map_or([0; 5], |g| g.1);
            for (row, bits) in (0..).zip(glyph) {
                for column in (0..3).filter(|k| bits >> (2 - k) & 1 == 1) {
                    let at = [x + (i * 4 + column) * dot, y + row * dot, dot, dot];
                    self.fill(at, [235, 235, 235, 255]);
                }
            }
        }
    }

    /// Draws the scale of [`Paint::Overdraw`](crate::Paint::Overdraw) at the lower left: a color for each number
    /// of draws of a pixel, up to 16 and more. Pictures less than 160 pixels wide have no room for it.
    #[doc(hidden)]
    pub fn add_overdraw_scale(&mut self) {
        // As legible in a large picture as in a small one.
        let dot = (self.width / 480).max(1);
        let (swatch, margin) = (7 * dot, 4 * dot);
        let (wide, high) = (
            (MOST + 1) * swatch + 4 * margin,
            3 * margin + swatch + 5 * dot,
        );
        if self.width < 160 || self.height < high + 2 * margin {
            return;
        }
        let (left, top) = (margin, self.height - high - margin);
        self.fill([left, top, wide, high], [18, 18, 20, 255]);
        for n in 0..=MOST {
            let x = left + margin + n * swatch;
            self.fill([x, top + margin, swatch - dot, swatch], pixel_of(n));
            if n % 4 == 0 {
                let mut text = n.to_string();
                text += if n == MOST { "+" } else { "" };
                self.write(&text, [x, top + 2 * margin + swatch], dot);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_shows_each_count_in_its_color_and_leaves_small_pictures_alone() {
        let picture = |width| Picture {
            width,
            height: 100,
            rgba: vec![77; width as usize * 400],
        };
        let mut large = picture(200);
        large.add_overdraw_scale();
        let has = |n| large.rgba.chunks_exact(4).any(|p| p == pixel_of(n));
        assert!((0..=MOST).all(has));
        assert_eq!(large.pixel(199, 0), [77; 4], "elsewhere it is as it was");
        let mut small = picture(100);
        small.add_overdraw_scale();
        assert_eq!(small, picture(100));
    }
}
