//! Small generated textures.

use crate::rng::Rng;

/// Oak planks, 64 × 64 pixels that repeat on all sides, as a PNG file.
#[must_use]
pub fn oak_planks() -> Vec<u8> {
    const SIZE: usize = 64;
    const PLANK: usize = 16;
    let mut pixels = Vec::with_capacity(SIZE * SIZE * 3);
    for y in 0..SIZE {
        let row = y / PLANK;
        for x in 0..SIZE {
            // Joints are staggered from plank to plank.
            let shifted = (x + row * 23) % SIZE;
            let mut grain = Rng::stream(y as u64, row as u64);
            let shade = grain.range(-10.0, 10.0) + Rng::stream(9, row as u64).range(-16.0, 16.0);
            let joint = y % PLANK == 0 || shifted == 0;
            let color = if joint {
                [92.0, 62.0, 36.0]
            } else {
                [176.0, 128.0, 80.0]
            };
            pixels.extend(color.map(|c: f64| (c + shade).clamp(0.0, 255.0) as u8));
        }
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, SIZE as u32, SIZE as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let written = encoder
        .write_header()
        .and_then(|mut w| w.write_image_data(&pixels));
    // Writing to memory fails only if the sizes above contradict each other.
    written.expect("the picture has as many bytes as its header says");
    file
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_texture_is_a_small_png() {
        let file = super::oak_planks();
        assert!(file.len() < 8_000, "{} bytes", file.len());
        let mut reader = png::Decoder::new(std::io::Cursor::new(&file))
            .read_info()
            .expect("a PNG");
        let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
        let frame = reader.next_frame(&mut pixels).expect("a picture");
        assert_eq!((frame.width, frame.height), (64, 64));
        assert!(pixels.iter().any(|&p| p != pixels[0]));
    }
}
