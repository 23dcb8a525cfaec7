//! Height maps: rasters of gray (PNG) and of heights (TIFF, GeoTIFF) as the surface of land.
//!
//! Samples lie on a square lattice, the first at the north-west: x grows to the east, z to the south, y is up. A PNG
//! says neither how wide its squares are nor how high its grays; both are given. A GeoTIFF has heights in its samples, and the
//! width of its squares and its place in its tags.

#[cfg(feature = "tiff")]
mod geotiff;
mod raster;
mod terrain;

use std::io::Cursor;

use enfilade_geom::DVec3;

use crate::{SourceError, SourceLimits, Surface};
#[cfg(feature = "tiff")]
use geotiff::of_tiff;
pub use raster::HeightMap;
use raster::{checked, error};
use terrain::triangulate;

/// Refuses a TIFF: this build has no reader.
#[cfg(not(feature = "tiff"))]
fn of_tiff(_: &[u8], _: u64) -> Result<HeightMap, SourceError> {
    let problem =
        "is TIFF, which this build cannot read: build it with the feature `tiff`, or give a PNG";
    Err(error("file", problem))
}

/// Share of a square's edge that the land may be off its samples, in height.
const OFF: f64 = 0.1;
/// Most samples of a map: those of a square of 8,192.
const MAX_SAMPLES: u64 = 1 << 26;

/// Settings of height maps that files may not tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HeightOptions {
    /// Distance between samples. [Units: wu]
    pub cell: Option<f64>,
    /// Heights of black and of white. [Units: wu]
    pub heights: Option<[f64; 2]>,
}

impl HeightMap {
    /// Returns `true` for the first bytes of a PNG or a TIFF.
    #[must_use]
    pub fn is_one(bytes: &[u8]) -> bool {
        Self::is_png(bytes) || Self::is_tiff(bytes)
    }

    fn is_png(bytes: &[u8]) -> bool {
        bytes.starts_with(b"\x89PNG\r\n\x1a\n")
    }

    fn is_tiff(bytes: &[u8]) -> bool {
        [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"]
            .iter()
            .any(|magic| bytes.starts_with(*magic))
    }

    /// Returns the name of the format that begins with these bytes.
    #[must_use]
    pub fn format(bytes: &[u8]) -> &'static str {
        if Self::is_png(bytes) { "PNG" } else { "TIFF" }
    }

    /// Reads a map.
    ///
    /// # Errors
    /// If the file is damaged, is not a map of heights, or has too many samples.
    pub fn parse(bytes: &[u8], limits: &SourceLimits) -> Result<Self, SourceError> {
        let most = limits.max_samples.min(MAX_SAMPLES);
        if Self::is_png(bytes) {
            of_png(bytes, most)
        } else {
            of_tiff(bytes, most)
        }
    }

    /// Makes the surface of the land, with its middle at the origin, as seen from above. Triangles are as few as keep all samples
    /// within a tenth of a square's edge.
    ///
    /// # Errors
    /// If a setting is missing that the file does not tell, or the surface has too many triangles.
    pub fn surface(
        &self,
        options: &HeightOptions,
        limits: &SourceLimits,
    ) -> Result<Surface, SourceError> {
        let cell = self.cell(options)?;
        let range = match (self.white, options.heights) {
            (None, _) => None,
            (Some(white), Some([low, high])) => Some([low, (high - low) / white]),
            (Some(white), None) => {
                let problem = format!(
                    "its samples are grays from 0 to {white}; give --heights MIN,MAX, the heights of black and white in meters"
                );
                return Err(error("samples", problem));
            }
        };
        let height = |sample: f32| {
            let sample = f64::from(sample);
            (range.map_or(sample, |[low, step]| low + step * sample)) as f32
        };
        let heights: Vec<f32> = self.samples.iter().map(|&s| height(s)).collect();
        let off = OFF * cell[0].min(cell[1]);
        let most = usize::try_from(limits.max_triangles).unwrap_or(usize::MAX);
        let land = triangulate(self.dims, &heights, off as f32, most, limits.purse());
        limits.go_on()?;
        let land = land.ok_or_else(|| {
            let problem = format!("its surface has more than {most} triangles; give a coarser map");
            error("surface", problem)
        })?;
        let middle = self.dims.map(|n| 0.5 * (n - 1) as f64);
        let position = |&[x, z]: &[u32; 2]| {
            let height = heights[x as usize + z as usize * self.dims[0]];
            DVec3::new(
                (f64::from(x) - middle[0]) * cell[0],
                f64::from(height),
                (f64::from(z) - middle[1]) * cell[1],
            )
        };
        Ok(Surface {
            positions: land.vertices.iter().map(position).collect(),
            n_extracted: land.triangles.len() as u64,
            triangles: land.triangles,
            distance: off,
            n_samples: self.samples.len() as u64,
            n_dropped: 0,
        })
    }

    /// Returns the distance between samples to the east and to the south. [Units: wu]
    ///
    /// # Errors
    /// If neither the file nor the options tell it.
    pub fn cell(&self, options: &HeightOptions) -> Result<[f64; 2], SourceError> {
        options.cell.map(|c| [c; 2]).or(self.cell).ok_or_else(|| {
            error(
                "samples",
                "the file does not tell how far its samples are apart; give --cell METERS",
            )
        })
    }

    /// Returns east and north of the middle, if the file tells them. [Units: wu]
    #[must_use]
    pub fn middle(&self) -> Option<[f64; 2]> {
        let ([east, north], cell) = (self.place?, self.cell?);
        let half = [0, 1].map(|k| 0.5 * (self.dims[k] - 1) as f64 * cell[k]);
        Some([east + half[0], north - half[1]])
    }
}

fn of_png(bytes: &[u8], most: u64) -> Result<HeightMap, SourceError> {
    let damaged = |e: png::DecodingError| error("PNG", format!("{e}; is the file cut off?"));
    let limits = png::Limits {
        bytes: usize::try_from(most.saturating_mul(4)).unwrap_or(usize::MAX),
    };
    let decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let info = reader.info();
    let dims = checked([info.width, info.height], most)?;
    let (color, depth) = (info.color_type, info.bit_depth);
    let bits = match (color, depth) {
        (png::ColorType::Grayscale, png::BitDepth::Eight) => 8,
        (png::ColorType::Grayscale, png::BitDepth::Sixteen) => 16,
        _ => {
            let problem = format!(
                "{color:?} of {} bits, but heights are gray of 8 or 16 bits: a picture? convert in.png -colorspace gray -depth 16 out.png",
                depth as u8
            );
            return Err(error("PNG", problem));
        }
    };
    let n_bytes = dims[0] * dims[1] * bits / 8;
    let mut buffer = vec![0; reader.output_buffer_size().unwrap_or(n_bytes).max(n_bytes)];
    reader.next_frame(&mut buffer).map_err(damaged)?;
    buffer.truncate(n_bytes);
    let samples = match bits {
        8 => buffer.iter().map(|&b| f32::from(b)).collect(),
        _ => (buffer.as_chunks::<2>().0.iter())
            .map(|&b| f32::from(u16::from_be_bytes(b)))
            .collect(),
    };
    Ok(HeightMap {
        dims,
        samples,
        white: Some(f64::from((1_u32 << bits) - 1)),
        cell: None,
        place: None,
    })
}

#[cfg(test)]
mod tests {
    use tiff::encoder::{TiffEncoder, colortype};
    use tiff::tags::Tag;

    use super::geotiff::{GEOGRAPHIC, MODEL_TYPE};
    use super::*;

    fn png_of(dims: [u32; 2], at: impl Fn(u32, u32) -> u16) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, dims[0], dims[1]);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        let mut writer = encoder.write_header().unwrap();
        let samples = (0..dims[0] * dims[1]).map(|i| at(i % dims[0], i / dims[0]));
        let bytes: Vec<u8> = samples.flat_map(u16::to_be_bytes).collect();
        writer.write_image_data(&bytes).unwrap();
        writer.finish().unwrap();
        out
    }

    fn geotiff(dims: [u32; 2], samples: &[f32], keys: &[u16]) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut out).unwrap();
        let mut image = encoder
            .new_image::<colortype::Gray32Float>(dims[0], dims[1])
            .unwrap();
        let tags = image.encoder();
        tags.write_tag(Tag::ModelPixelScaleTag, &[2.0, 3.0, 0.0][..])
            .unwrap();
        tags.write_tag(
            Tag::ModelTiepointTag,
            &[0.0, 0.0, 0.0, 500_000.0, 4_000_000.0, 0.0][..],
        )
        .unwrap();
        tags.write_tag(Tag::GeoKeyDirectoryTag, keys).unwrap();
        tags.write_tag(Tag::GdalNodata, "-9999").unwrap();
        image.write_data(samples).unwrap();
        out.into_inner()
    }

    // Covers V11.
    #[test]
    fn a_png_needs_the_size_of_its_squares_and_its_heights() {
        let limits = SourceLimits::default();
        let map = HeightMap::parse(&png_of([5, 4], |x, _| x as u16 * 16_383), &limits).unwrap();
        assert_eq!((map.dims, map.white), ([5, 4], Some(65_535.0)));
        let mut options = HeightOptions::default();
        let problem = |o: &HeightOptions| map.surface(o, &limits).unwrap_err().problem;
        assert!(problem(&options).contains("--cell"));
        options.cell = Some(2.0);
        assert!(problem(&options).contains("--heights"));
        options.heights = Some([10.0, 30.0]);
        let land = map.surface(&options, &limits).unwrap();
        let west = land.positions.iter().find(|p| p.x == -4.0).unwrap();
        let east = land.positions.iter().find(|p| p.x == 4.0).unwrap();
        assert_eq!(west.y, 10.0);
        assert!((east.y - 30.0).abs() < 0.01, "{east}");
    }

    #[test]
    fn a_geotiff_has_heights_and_scale_and_holes_where_it_has_no_data() {
        let limits = SourceLimits::default();
        let mut samples = vec![7.5_f32; 12];
        samples[5] = -9999.0;
        let projected = [1, 1, 0, 1, MODEL_TYPE, 0, 1, 1];
        let map = HeightMap::parse(&geotiff([4, 3], &samples, &projected), &limits).unwrap();
        assert_eq!((map.cell, map.white), (Some([2.0, 3.0]), None));
        assert_eq!(map.middle(), Some([500_003.0, 3_999_997.0]));
        let land = map.surface(&HeightOptions::default(), &limits).unwrap();
        // Those of the twelve triangles around the hole are left out.
        assert!(
            (4..12).contains(&land.triangles.len()),
            "{}",
            land.triangles.len()
        );
        let degrees = [1, 1, 0, 1, MODEL_TYPE, 0, 1, GEOGRAPHIC];
        let e = HeightMap::parse(&geotiff([4, 3], &samples, &degrees), &limits).unwrap_err();
        assert!(e.problem.contains("gdalwarp"), "{e}");
    }

    #[test]
    fn damaged_and_large_maps_are_refused() {
        let limits = SourceLimits::default();
        let png = png_of([40, 30], |x, z| (x * z) as u16);
        let tiff = geotiff([40, 30], &vec![1.0; 1200], &[1, 1, 0, 0]);
        for whole in [&png, &tiff] {
            for n in (0..whole.len()).step_by(7) {
                let _ = HeightMap::parse(&whole[..n], &limits);
            }
            assert!(HeightMap::parse(&whole[..whole.len() / 2], &limits).is_err());
            let few = SourceLimits {
                max_samples: 1000,
                ..SourceLimits::default()
            };
            let e = HeightMap::parse(whole, &few).unwrap_err();
            assert!(e.problem.contains("40 × 30"), "{e}");
        }
    }
}
