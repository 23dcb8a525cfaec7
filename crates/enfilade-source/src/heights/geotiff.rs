//! Reads TIFF and GeoTIFF.

use std::io::Cursor;

use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::raster::{HeightMap, checked, error};
use crate::SourceError;

/// Key of a GeoTIFF's directory that tells the kind of its coordinates, and the kinds in meters and in degrees.
pub(super) const MODEL_TYPE: u16 = 1024;
pub(super) const GEOGRAPHIC: u16 = 2;

pub(super) fn of_tiff(bytes: &[u8], most: u64) -> Result<HeightMap, SourceError> {
    let damaged = |e: tiff::TiffError| error("TIFF", format!("{e}; is the file cut off?"));
    let most_bytes = usize::try_from(most.saturating_mul(8)).unwrap_or(usize::MAX);
    let mut limits = Limits::default();
    limits.decoding_buffer_size = most_bytes;
    limits.intermediate_buffer_size = most_bytes;
    let mut decoder = Decoder::new(Cursor::new(bytes))
        .map_err(damaged)?
        .with_limits(limits);
    let (nx, nz) = decoder.dimensions().map_err(damaged)?;
    let dims = checked([nx, nz], most)?;
    let color = decoder.colortype().map_err(damaged)?;
    if !matches!(color, tiff::ColorType::Gray(_)) {
        let problem = format!("{color:?}, but heights are one number a sample: a picture?");
        return Err(error("TIFF", problem));
    }
    let numbers = |decoder: &mut Decoder<_>, tag: Tag| -> Option<Vec<f64>> {
        let value = decoder.find_tag(tag).ok()??;
        value.into_f64_vec().ok()
    };
    let keys = decoder
        .get_tag_u16_vec(Tag::GeoKeyDirectoryTag)
        .unwrap_or_default();
    let is_geographic = |key: &[u16; 4]| key[0] == MODEL_TYPE && key[3] == GEOGRAPHIC;
    if keys.as_chunks::<4>().0.iter().any(is_geographic) {
        let problem = "its squares are in degrees; put them into meters: gdalwarp -t_srs EPSG:CODE in.tif out.tif";
        return Err(error("GeoTIFF", problem));
    }
    let scale = numbers(&mut decoder, Tag::ModelPixelScaleTag);
    let cell = scale.and_then(|s| Some([*s.first()?, *s.get(1)?]));
    let cell = cell.filter(|c| c.iter().all(|c| c.is_finite() && *c > 0.0));
    let tie = numbers(&mut decoder, Tag::ModelTiepointTag);
    let place = tie.and_then(|t| match t[..] {
        [column, row, _, east, north, ..] => {
            let [dx, dz] = cell?;
            Some([east - column * dx, north + row * dz])
        }
        _ => None,
    });
    let none = decoder.get_tag_ascii_string(Tag::GdalNodata).ok();
    let none = none.and_then(|text| text.trim_matches(['\0', ' ']).parse::<f64>().ok());
    let (samples, is_gray) = samples_of(decoder.read_image().map_err(damaged)?)?;
    if samples.len() != dims[0] * dims[1] {
        let problem = format!("{} samples for {nx} × {nz}", samples.len());
        return Err(error("TIFF", problem));
    }
    let valid = |s: f64| {
        let is_one = s.is_finite() && none != Some(s) && s.abs() < 1e6;
        if is_one { s as f32 } else { f32::NAN }
    };
    Ok(HeightMap {
        dims,
        // A raster of bytes or words without a place is a picture.
        white: is_gray.filter(|_| cell.is_none()),
        samples: samples.into_iter().map(valid).collect(),
        cell,
        place: place.filter(|p| p.iter().all(|c| c.is_finite())),
    })
}

/// Returns the samples as numbers, and the greatest of them if they are unsigned.
fn samples_of(read: DecodingResult) -> Result<(Vec<f64>, Option<f64>), SourceError> {
    Ok(match read {
        DecodingResult::U8(v) => (v.into_iter().map(f64::from).collect(), Some(255.0)),
        DecodingResult::U16(v) => (v.into_iter().map(f64::from).collect(), Some(65_535.0)),
        DecodingResult::U32(v) => (v.into_iter().map(f64::from).collect(), None),
        DecodingResult::I8(v) => (v.into_iter().map(f64::from).collect(), None),
        DecodingResult::I16(v) => (v.into_iter().map(f64::from).collect(), None),
        DecodingResult::I32(v) => (v.into_iter().map(f64::from).collect(), None),
        DecodingResult::F32(v) => (v.into_iter().map(f64::from).collect(), None),
        DecodingResult::F64(v) => (v, None),
        _ => {
            let problem = "heights of a kind that is not read; use 16-bit or 32-bit numbers: gdal_translate -ot Float32 in.tif out.tif";
            return Err(error("TIFF", problem));
        }
    })
}
