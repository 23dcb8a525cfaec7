//! Implicit scenes and volumes of samples.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::cases::{BadSource, Cases, table};
use enfilade_testkit::Rng;

const BALL: &str = r#"{"ball":{"at":[0,2,0],"radius":3}}"#;

fn scene(fields: &str) -> String {
    format!(r#"{{"enfilade":"implicit",{fields}}}"#)
}

/// Shapes by name.
const SHAPES: &str = r#"
a gyroid of nothing | {"gyroid":{"period":0,"at":[0,0,0]}}
a fine gyroid | {"gyroid":{"period":1e-9,"at":[0,0,0]}}
a thin shell | {"shell":{"of":{"ball":{"at":[0,0,0],"radius":3}},"thickness":1e-300}}
grown to the moon | {"grow":{"of":{"ball":{"at":[0,0,0],"radius":3}},"by":1e300}}
shrunk to nothing | {"grow":{"of":{"ball":{"at":[0,0,0],"radius":3}},"by":-9}}
scaled to nothing | {"place":{"of":{"ball":{"at":[0,0,0],"radius":3}},"scale":0}}
scaled by the least | {"place":{"of":{"ball":{"at":[0,0,0],"radius":3}},"scale":1e-308}}
turned by the most | {"place":{"of":{"ball":{"at":[0,0,0],"radius":3}},"turn":[1e308,1e308,1e308]}}
a box inside out | {"box":{"min":[3,3,3],"max":[0,0,0]}}
a flat box | {"box":{"min":[0,0,0],"max":[3,0,3]}}
a tube of one point | {"tube":{"points":[[0,0,0]],"radius":1}}
a tube of equal points | {"tube":{"points":[[0,0,0],[0,0,0]],"radius":1}}
a torus without an axis | {"torus":{"at":[0,0,0],"axis":[0,0,0],"radii":[3,1]}}
a plane without an end | {"plane":{"at":[0,0,0],"normal":[0,1,0]}}
a plane without a normal | {"plane":{"at":[0,0,0],"normal":[0,0,0]}}
a union of nothing | {"union":[]}
a smooth union by too much | {"smooth_union":{"by":1e300,"of":[{"ball":{"at":[0,0,0],"radius":3}},{"ball":{"at":[1,0,0],"radius":3}}]}}
nothing in common | {"intersection":[{"ball":{"at":[0,0,0],"radius":1}},{"ball":{"at":[9,0,0],"radius":1}}]}
not a shape | {"sphere":{"at":[0,0,0],"radius":3}}
two shapes | {"ball":{"at":[0,0,0],"radius":3},"box":{"min":[0,0,0],"max":[1,1,1]}}
"#;

/// Steps, sizes and numbers out of all proportion, expressions without end, and text cut off.
pub(super) fn implicit() -> Vec<BadSource> {
    let mut all = Cases::new("json", &[]);
    sizes(&mut all);
    for (name, shape) in table(SHAPES) {
        all.add(name, scene(&format!(r#""air":{shape}"#)));
    }
    endless(&mut all);
    texts(&mut all);
    all.all
}

fn sizes(all: &mut Cases) {
    for step in [
        "0.0002", "1e-9", "1e-300", "0", "-1", "1e300", "1e999", "null", "\"a\"",
    ] {
        all.add(
            format!("step {step}"),
            scene(&format!(r#""step":{step},"air":{BALL}"#)),
        );
    }
    for radius in ["0", "-1", "1e-300", "1e9", "1e30", "1e308", "1e999", "[]"] {
        let ball = format!(r#"{{"ball":{{"at":[0,2,0],"radius":{radius}}}}}"#);
        all.add(
            format!("radius {radius}"),
            scene(&format!(r#""air":{ball}"#)),
        );
        all.add(
            format!("radius {radius}, step"),
            scene(&format!(r#""step":0.05,"air":{ball}"#)),
        );
    }
}

fn endless(all: &mut Cases) {
    for depth in [65, 120, 1000, 200_000] {
        let text = format!("{}{BALL}{}", r#"{"not":"#.repeat(depth), "}".repeat(depth));
        all.add(format!("{depth} deep"), scene(&format!(r#""air":{text}"#)));
    }
    for n in [20_000, 99_000, 100_001] {
        let mut random = Rng::new(n as u64);
        let near: Vec<String> = (0..n)
            .map(|_| {
                let [x, y, z] = [0; 3].map(|_| random.unit());
                format!(r#"{{"ball":{{"at":[{x},{y},{z}],"radius":1}}}}"#)
            })
            .collect();
        let near = near.join(",");
        all.add(
            format!("{n} balls at one place"),
            scene(&format!(r#""air":{{"union":[{near}]}}"#)),
        );
        all.add(
            format!("{n} smooth balls"),
            scene(&format!(
                r#""step":0.01,"air":{{"smooth_union":{{"by":0.3,"of":[{near}]}}}}"#
            )),
        );
    }
    let points: Vec<String> = (0..90_000)
        .map(|k| format!("[{},{},0]", k % 300, k / 300))
        .collect();
    let tube = format!(
        r#"{{"tube":{{"points":[{}],"radius":0.4}}}}"#,
        points.join(",")
    );
    all.add(
        "a tube of 90,000 points",
        scene(&format!(r#""air":{tube}"#)),
    );
}

fn texts(all: &mut Cases) {
    all.add(
        "air and matter",
        scene(&format!(r#""air":{BALL},"matter":{BALL}"#)),
    );
    all.add("neither", scene(r#""step":1"#));
    all.add(
        "an endless box",
        scene(&format!(
            r#""box":[[-1e308,-1e308,-1e308],[1e308,1e308,1e308]],"air":{BALL}"#
        )),
    );
    let whole = scene(&format!(r#""step":0.1,"air":{{"union":[{BALL},{BALL}]}}"#));
    for n in 0..whole.len() {
        // The name alone tells no format.
        if n > 24 && n % 5 == 0 {
            all.add(format!("cut after {n}"), &whole[..n]);
        }
    }
}

/// Contents of a header of NIfTI-1.
struct Nifti {
    dims: [i16; 8],
    kind: i16,
    spacing: [f32; 3],
    offset: f32,
    scale: [f32; 2],
}

impl Nifti {
    fn of(size: [i16; 3], kind: i16) -> Self {
        Self {
            dims: [3, size[0], size[1], size[2], 1, 1, 1, 1],
            kind,
            spacing: [1.0; 3],
            offset: 352.0,
            scale: [1.0, 0.0],
        }
    }

    fn bytes(&self, samples: &[u8]) -> Vec<u8> {
        let mut head = vec![0_u8; 352];
        head[..4].copy_from_slice(&348_i32.to_le_bytes());
        for (k, d) in self.dims.iter().enumerate() {
            head[40 + 2 * k..][..2].copy_from_slice(&d.to_le_bytes());
        }
        head[70..72].copy_from_slice(&self.kind.to_le_bytes());
        let bits: i16 = match self.kind {
            2 => 8,
            4 => 16,
            64 => 64,
            _ => 32,
        };
        head[72..74].copy_from_slice(&bits.to_le_bytes());
        head[76..80].copy_from_slice(&1_f32.to_le_bytes());
        for (k, s) in self.spacing.iter().enumerate() {
            head[80 + 4 * k..][..4].copy_from_slice(&s.to_le_bytes());
        }
        head[108..112].copy_from_slice(&self.offset.to_le_bytes());
        head[112..116].copy_from_slice(&self.scale[0].to_le_bytes());
        head[116..120].copy_from_slice(&self.scale[1].to_le_bytes());
        head[123] = 2; // millimeters
        head[344..348].copy_from_slice(b"n+1\0");
        [&head, samples].concat()
    }
}

const F32: i16 = 16;
const U8: i16 = 2;

/// The distance from a ball in a box of `n` samples along each edge.
fn ball(n: usize) -> Vec<u8> {
    let middle = (n as f32 - 1.0) * 0.5;
    let value = |i: usize| {
        let at = [i % n, i / n % n, i / (n * n)].map(|c| c as f32 - middle);
        n as f32 / 3.0 - at.iter().map(|c| c * c).sum::<f32>().sqrt()
    };
    (0..n * n * n)
        .flat_map(|i| value(i).to_le_bytes())
        .collect()
}

fn zipped(bytes: &[u8]) -> Vec<u8> {
    let mut out = GzEncoder::new(Vec::new(), Compression::fast());
    // A vector takes all.
    let _ = out.write_all(bytes);
    out.finish().unwrap_or_default()
}

fn floats(n: usize, value: impl FnMut(usize) -> f32) -> Vec<u8> {
    (0..n).map(value).flat_map(f32::to_le_bytes).collect()
}

/// Options of all volumes, and the number of samples of most along each edge.
const LEVEL: [&str; 4] = ["--level", "0", "--air", "above"];
const N: usize = 20;

fn nrrd(head: &str, samples: &[u8]) -> Vec<u8> {
    let head = format!("NRRD0004\ntype: float\ndimension: 3\n{head}\n\n");
    [head.as_bytes(), samples].concat()
}

/// Volumes cut off, of wrong sizes, without values, with more samples than there are, and of noise.
pub(super) fn volumes() -> Vec<BadSource> {
    let mut all = Cases::new("nii", &LEVEL);
    cut_off(&mut all);
    niftis(&mut all);
    values(&mut all);
    nrrds(&mut all);
    raws(&mut all);
    all.all
}

fn cut_off(all: &mut Cases) {
    let samples = ball(N);
    let good = Nifti::of([20; 3], F32).bytes(&samples);
    let zip = zipped(&good);
    let sized = nrrd("sizes: 20 20 20\nencoding: raw\nendian: little", &samples);
    for (ending, whole) in [("nii", &good), ("nii.gz", &zip), ("nrrd", &sized)] {
        all.ending = ending;
        all.cut(&format!("{ending} "), whole, |_| true);
    }
    all.ending = "nii";
}

fn niftis(all: &mut Cases) {
    let samples = ball(N);
    for size in [
        [0; 3],
        [-1, 20, 20],
        [1, 1, 1],
        [32767; 3],
        [20, 20, 21],
        [8000, 1, 1],
    ] {
        all.add(
            format!("nii of {size:?}"),
            Nifti::of(size, F32).bytes(&samples),
        );
    }
    for kind in [0, 1, 32, 128, 1024, -7] {
        all.add(
            format!("nii of type {kind}"),
            Nifti::of([20; 3], kind).bytes(&samples),
        );
    }
    for dims in [0, -1, 1, 4, 8, i16::MAX] {
        let mut head = Nifti::of([20; 3], F32);
        head.dims[0] = dims;
        all.add(format!("nii of {dims} dimensions"), head.bytes(&samples));
    }
    for spacing in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-30, 1e30] {
        let mut head = Nifti::of([20; 3], F32);
        head.spacing[1] = spacing;
        all.add(
            format!("nii with a spacing of {spacing}"),
            head.bytes(&samples),
        );
    }
    for offset in [0.0, -1.0, f32::NAN, 1e30, 8000.0] {
        let mut head = Nifti::of([20; 3], F32);
        head.offset = offset;
        all.add(
            format!("nii with an offset of {offset}"),
            head.bytes(&samples),
        );
    }
    for scale in [
        [f32::NAN, 0.0],
        [1.0, f32::NAN],
        [1e38, 1e38],
        [f32::INFINITY, 0.0],
    ] {
        let mut head = Nifti::of([20; 3], F32);
        head.scale = scale;
        all.add(format!("nii scaled by {scale:?}"), head.bytes(&samples));
    }
}

fn values(all: &mut Cases) {
    let cube = N * N * N;
    for (name, values) in [
        ("all NaN", floats(cube, |_| f32::NAN)),
        (
            "every second NaN",
            floats(cube, |i| if i % 2 == 0 { f32::NAN } else { 1.0 }),
        ),
        (
            "infinite",
            floats(cube, |i| {
                if i % 3 == 0 {
                    f32::INFINITY
                } else {
                    f32::NEG_INFINITY
                }
            }),
        ),
        ("all zero", floats(cube, |_| 0.0)),
        (
            "least",
            floats(cube, |i| if i % 2 == 0 { 1e-45 } else { -1e-45 }),
        ),
    ] {
        all.add(name, Nifti::of([20; 3], F32).bytes(&values));
    }
    let mut random = Rng::new(7);
    for edge in [60_i16, 160] {
        let n = edge as usize;
        let noise = floats(n * n * n, |_| random.unit() as f32 - 0.5);
        all.add(
            format!("noise of {edge} samples"),
            Nifti::of([edge; 3], F32).bytes(&noise),
        );
    }
    // Few bytes that unpack to a thousand million samples.
    let head = Nifti::of([1000; 3], U8).bytes(&[]);
    let mut bomb = GzEncoder::new(Vec::new(), Compression::fast());
    let _ = bomb.write_all(&head);
    for _ in 0..1000 {
        let _ = bomb.write_all(&vec![0_u8; 1_000_000]);
    }
    all.ending = "nii.gz";
    all.add("1e9 samples of nothing", bomb.finish().unwrap_or_default());
}

fn nrrds(all: &mut Cases) {
    all.ending = "nrrd";
    let samples = ball(N);
    for head in [
        "sizes: 1000 1000 1000\nencoding: raw\nendian: little",
        "sizes: 1000000 1000000 1000000\nencoding: raw\nendian: little",
        "sizes: 99999999999999999999 1 1\nencoding: raw\nendian: little",
        "sizes: -20 20 20\nencoding: raw\nendian: little",
        "sizes: 20 20\nencoding: raw\nendian: little",
        "sizes: 20 20 20\nencoding: bzip2\nendian: little",
        "sizes: 20 20 20\nencoding: gzip\nendian: little",
        "sizes: 20 20 20\nencoding: text",
        "sizes: 20 20 20\nencoding: raw\nendian: little\nbyte skip: 18446744073709551615",
        "sizes: 20 20 20\nencoding: raw\nendian: little\nline skip: 18446744073709551615",
        "sizes: 20 20 20\nencoding: raw\nendian: little\nspacings: nan nan nan",
        "sizes: 20 20 20\nencoding: raw\nendian: little\nspace directions: (1,0,0) (1,0,0) (1,0,0)",
        "sizes: 20 20 20\nencoding: raw\ndata file: ../../../../../../etc/passwd",
        "encoding: raw\nendian: little",
    ] {
        all.add(
            format!("nrrd {}", head.replace('\n', ", ")),
            nrrd(head, &samples),
        );
    }
}

fn raws(all: &mut Cases) {
    let samples = ball(N);
    let mut raw = |name: &str, fields: &str| {
        let head = format!(r#"{{"enfilade":"volume","file":"case.raw",{fields}}}"#);
        let case = BadSource::new(format!("raw: {name}"), "json", head).with(&LEVEL);
        all.all.push(case.beside("case.raw", samples.clone()));
    };
    for size in [
        "[20,20,21]",
        "[1e9,1e9,1e9]",
        "[1000,1000,1000]",
        "[0,0,0]",
        "[20,20]",
        "[-20,20,20]",
        "[20.5,20,20]",
        "null",
    ] {
        raw(size, &format!(r#""size":{size},"type":"float32""#));
    }
    raw("no type", r#""size":[20,20,20]"#);
    raw("another type", r#""size":[20,20,20],"type":"complex""#);
    raw(
        "skip",
        r#""size":[20,20,20],"type":"float32","skip":18446744073709551615"#,
    );
    raw(
        "spacing",
        r#""size":[20,20,20],"type":"float32","spacing":[0,1,1]"#,
    );
    raw(
        "far",
        r#""size":[20,20,20],"type":"float32","origin":[1e300,0,0]"#,
    );
    raw(
        "other file",
        r#""size":[20,20,20],"type":"float32","file":"none.raw""#,
    );
}
