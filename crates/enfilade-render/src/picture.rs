//! Color pictures read back from the adapter.

use crate::gpu::RenderError;

/// A picture: RGBA, 8 bits each, sRGB, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four bytes a pixel.
    pub rgba: Vec<u8>,
}

impl Picture {
    /// Encodes the picture as PNG.
    ///
    /// # Errors
    ///
    /// A number of bytes that does not fit width and height.
    pub fn to_png(&self) -> Result<Vec<u8>, RenderError> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        // Pictures are opaque, so three bytes per pixel suffice.
        let mut rgb = Vec::with_capacity(self.rgba.len() / 4 * 3);
        for pixel in self.rgba.chunks_exact(4) {
            rgb.extend_from_slice(&pixel[..3]);
        }
        image::RgbImage::from_raw(self.width, self.height, rgb)
            .ok_or_else(|| RenderError::Encode("too few bytes for its size".into()))?
            .write_to(&mut bytes, image::ImageFormat::Png)
            .map_err(|why| RenderError::Decode(why.to_string()))?;
        Ok(bytes.into_inner())
    }

    /// Decodes a PNG file.
    ///
    /// # Errors
    ///
    /// Bytes that are not a PNG.
    #[doc(hidden)]
    pub fn from_png(bytes: &[u8]) -> Result<Self, RenderError> {
        let image = image::load_from_memory_with_format(bytes, image::ImageFormat::Png)
            .map_err(|why| RenderError::Encode(why.to_string()))?
            .into_rgba8();
        let (width, height) = image.dimensions();
        Ok(Self {
            width,
            height,
            rgba: image.into_raw(),
        })
    }

    /// Returns the picture at half the width and height; each pixel is the mean of four in linear light.
    #[must_use]
    #[doc(hidden)]
    pub fn halved(&self) -> Self {
        let to_light: Vec<f32> = (0..256).map(|c| (c as f32 / 255.0).powf(2.2)).collect();
        let (width, height) = (self.width / 2, self.height / 2);
        let mut rgba = Vec::with_capacity((width * height * 4) as usize);
        for y in 0..height {
            for x in 0..width {
                for k in 0..3 {
                    let at = |dx, dy| {
                        let i = ((y * 2 + dy) * self.width + x * 2 + dx) * 4 + k;
                        to_light[usize::from(self.rgba[i as usize])]
                    };
                    let sum = at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1);
                    rgba.push(((sum * 0.25).powf(1.0 / 2.2) * 255.0).round() as u8);
                }
                rgba.push(255);
            }
        }
        Self {
            width,
            height,
            rgba,
        }
    }

    /// Returns the color of a pixel.
    ///
    /// # Panics
    ///
    /// If the pixel lies outside the picture.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        let i = ((y * self.width + x) * 4) as usize;
        [0, 1, 2, 3].map(|k| self.rgba[i + k])
    }

    /// Draws another picture over this one with its upper left pixel at `(x, y)`; parts outside are clipped.
    #[doc(hidden)]
    pub fn put(&mut self, other: &Self, x: u32, y: u32) {
        let columns = other.width.min(self.width.saturating_sub(x)) as usize;
        for row in 0..other.height.min(self.height.saturating_sub(y)) {
            let to = (((y + row) * self.width + x) * 4) as usize;
            let from = (row * other.width * 4) as usize;
            self.rgba[to..to + columns * 4].copy_from_slice(&other.rgba[from..from + columns * 4]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_comes_back_from_its_png() {
        let rgba = [9, 8, 7, 255, 1, 2, 3, 255].to_vec();
        let picture = Picture {
            width: 2,
            height: 1,
            rgba,
        };
        let png = picture.to_png().unwrap();
        assert_eq!(Picture::from_png(&png).unwrap(), picture);
        let short = Picture {
            rgba: vec![0; 3],
            ..picture
        };
        assert!(short.to_png().is_err());
    }

    #[test]
    fn half_black_half_white_is_half_the_light() {
        let rgba = [[0, 0, 0, 255], [255; 4], [255; 4], [0, 0, 0, 255]].concat();
        let half = Picture {
            width: 2,
            height: 2,
            rgba,
        }
        .halved();
        assert_eq!((half.width, half.height), (1, 1));
        assert!(
            (185..190).contains(&half.pixel(0, 0)[0]),
            "{:?}",
            half.pixel(0, 0)
        );
    }
}
