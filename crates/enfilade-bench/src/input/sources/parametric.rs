//! Free-form patches, compared with triangles that closed formulas give: fine, evenly spaced, by no code of the reader of patches.

use std::fmt::Write as _;

use anyhow::bail;
use enfilade::cpg::World;
use enfilade::geom::DMat4;
use enfilade::import::{ArrayMesh, ImportOptions, import_arrays};
use enfilade::internals::import::decode_patches;

use super::twins;
use crate::rows::{Figure, baked};

/// Patches in JSON, and the same surfaces as triangles.
#[derive(Default)]
struct Twin {
    patches: Vec<String>,
    mesh: Vec<[[f64; 3]; 3]>,
}

impl Twin {
    /// Adds a patch: rows of points with weights, and further keys.
    fn patch(&mut self, degrees: [usize; 2], rows: &[Vec<[f64; 4]>], more: &str) {
        self.patches.push(format!(
            r#"{{"degrees":{degrees:?},"points":{rows:?}{more}}}"#
        ));
    }

    /// Adds a flat patch with four vertices, `u` from the first to the second and `v` from the first to the third, to both; without
    /// `holes`, each from `[u, v]` to `[u, v]`.
    fn quad(&mut self, [a, b, c]: [[f64; 3]; 3], holes: &[[[f64; 2]; 2]]) {
        let at = |u: f64, v: f64| [0, 1, 2].map(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]));
        let w = |[x, y, z]: [f64; 3]| [x, y, z, 1.0];
        let rows = [0.0, 1.0].map(|v| vec![w(at(0.0, v)), w(at(1.0, v))]);
        self.patch([1, 1], &rows, &holes_of(holes));
        self.grid([12, 8], at, holes);
    }

    /// Adds triangles of a function of two parameters from 0 to 1, without holes.
    fn grid(&mut self, n: [usize; 2], at: impl Fn(f64, f64) -> [f64; 3], holes: &[[[f64; 2]; 2]]) {
        let [lines_u, lines_v] = [0, 1].map(|axis| {
            let even = (0..=n[axis]).map(|k| k as f64 / n[axis] as f64);
            let sides = holes.iter().flatten().map(|p| p[axis]);
            let mut all: Vec<f64> = even.chain(sides).collect();
            all.sort_by(f64::total_cmp);
            all.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
            all
        });
        for u in lines_u.windows(2) {
            for v in lines_v.windows(2) {
                let middle = [(u[0] + u[1]) / 2.0, (v[0] + v[1]) / 2.0];
                let is_in =
                    |h: &[[f64; 2]; 2]| (0..2).all(|k| h[0][k] < middle[k] && middle[k] < h[1][k]);
                if holes.iter().any(is_in) {
                    continue;
                }
                let [a, b, c, d] = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, j]| at(u[i], v[j]));
                self.mesh.extend([[a, b, c], [a, c, d]]);
            }
        }
    }

    fn json(&self) -> String {
        let patches = self.patches.join(",");
        format!(r#"{{"enfilade":"patches","patches":[{patches}]}}"#)
    }
}

/// Rectangular holes in JSON.
fn holes_of(holes: &[[[f64; 2]; 2]]) -> String {
    let mut text = String::new();
    for [[a, b], [c, d]] in holes {
        let points = [[*a, *b], [*c, *b], [*c, *d], [*a, *d], [*a, *b]];
        let _ = write!(text, r#"[{{"points":{points:?}}}],"#);
    }
    match text.pop() {
        None => text,
        Some(_) => format!(r#","holes":[{text}]"#),
    }
}

fn scene(name: &str) -> anyhow::Result<Twin> {
    Ok(match name {
        "patch-house" => house(),
        "patch-vault" => vault(),
        "patch-tube" => tube(),
        _ => bail!("no scene {name}"),
    })
}

/// Three rooms on 10 m by 8 m, the largest with a bowed wall with a window; two doorways.
fn house() -> Twin {
    let mut twin = Twin::default();
    // The bow: a chord of 8 m along z, 1.5 m deep.
    let radius: f64 = (16.0 + 2.25) / 3.0;
    let w = (1.0 - 16.0 / (radius * radius)).sqrt();
    let tip = radius - 1.5 - radius / w;
    let bow = |u: f64| {
        let [a, b, c] = [(1.0 - u) * (1.0 - u), 2.0 * u * (1.0 - u) * w, u * u];
        [b * tip / (a + b + c), (4.0 * b + 8.0 * c) / (a + b + c)]
    };
    let arc = |y: f64| vec![[0.0, y, 0.0, 1.0], [tip, y, 4.0, w], [0.0, y, 8.0, 1.0]];
    let window = [[0.4, 0.3], [0.6, 0.8]];
    twin.patch([2, 1], &[arc(0.0), arc(2.6)], &holes_of(&[window]));
    twin.grid([80, 8], |u, v| [bow(u)[0], 2.6 * v, bow(u)[1]], &[window]);
    // Floor and ceiling end at the bow.
    let far = |y: f64| vec![[10.0, y, 0.0, 1.0], [10.0, y, 4.0, w], [10.0, y, 8.0, 1.0]];
    for y in [0.0, 2.6] {
        twin.patch([2, 1], &[arc(y), far(y)], "");
        let at = |u: f64, v: f64| [bow(u)[0] * (1.0 - v) + 10.0 * v, y, bow(u)[1]];
        twin.grid([80, 8], at, &[]);
    }
    let wall = |a: [f64; 2], b: [f64; 2]| [[a[0], 0.0, a[1]], [b[0], 0.0, b[1]], [a[0], 2.6, a[1]]];
    twin.quad(wall([0.0, 0.0], [10.0, 0.0]), &[]);
    twin.quad(wall([0.0, 8.0], [10.0, 8.0]), &[]);
    twin.quad(wall([10.0, 0.0], [10.0, 8.0]), &[]);
    let door = |at: f64| [[at, 0.0], [at + 0.12, 0.8]];
    twin.quad(wall([5.0, 0.0], [5.0, 8.0]), &[door(0.2)]);
    twin.quad(wall([5.0, 4.0], [10.0, 4.0]), &[[[0.4, 0.0], [0.6, 0.8]]]);
    twin
}

/// A hall of 6 m by 12 m below a barrel vault, with a wall across, and a doorway in it.
fn vault() -> Twin {
    let mut twin = Twin::default();
    let d = std::f64::consts::FRAC_1_SQRT_2;
    let row = |z: f64| {
        let points = [
            [0.0, 2.5, 1.0],
            [0.0, 5.5, d],
            [3.0, 5.5, 1.0],
            [6.0, 5.5, d],
            [6.0, 2.5, 1.0],
        ];
        points.map(|[x, y, w]| [x, y, z, w]).to_vec()
    };
    let knots = r#","knots":[[0,0,0,1,1,2,2,2],[0,0,1,1]]"#;
    twin.patch([2, 1], &[row(0.0), row(12.0)], knots);
    let at = |u: f64, v: f64| {
        let (sin, cos) = (std::f64::consts::PI * u).sin_cos();
        [3.0 - 3.0 * cos, 2.5 + 3.0 * sin, 12.0 * v]
    };
    twin.grid([80, 10], at, &[]);
    twin.quad([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 0.0, 12.0]], &[]);
    twin.quad([[0.0, 0.0, 0.0], [0.0, 2.5, 0.0], [0.0, 0.0, 12.0]], &[]);
    twin.quad([[6.0, 0.0, 0.0], [6.0, 2.5, 0.0], [6.0, 0.0, 12.0]], &[]);
    for (z, has_door) in [(0.0, false), (12.0, false), (6.0, true)] {
        // A rectangle of 6 m by 6 m, trimmed to walls and half a circle.
        let door = [[2.5, 0.0], [2.5, 2.1], [3.4, 2.1], [3.4, 0.0]];
        let door: &[[f64; 2]] = if has_door { &door } else { &[] };
        let points = [
            &[[0.0, 2.5], [0.0, 0.0]][..],
            door,
            &[[6.0, 0.0], [6.0, 2.5]],
        ]
        .concat();
        let unit = |p: &[f64; 2]| p.map(|c| c / 6.0);
        let points: Vec<[f64; 2]> = points.iter().map(unit).collect();
        let arc = row(0.0)
            .into_iter()
            .rev()
            .map(|[x, y, _, w]| [x / 6.0, y / 6.0, w]);
        let arc: Vec<[f64; 3]> = arc.collect();
        let trim = format!(
            r#","trim":[[{{"points":{points:?}}},{{"degree":2,"points":{arc:?},"knots":[0,0,0,1,1,2,2,2]}}]]"#
        );
        let corner = |x: f64, y: f64| [x, y, z, 1.0];
        let rows = [
            vec![corner(0.0, 0.0), corner(6.0, 0.0)],
            vec![corner(0.0, 6.0), corner(6.0, 6.0)],
        ];
        twin.patch([1, 1], &rows, &trim);
        let top = |x: f64| 2.5 + (9.0 - (x - 3.0) * (x - 3.0)).max(0.0).sqrt();
        // Columns between the sides of the doorway, above it and beside it.
        let column = |from: f64, to: f64, above: f64| {
            move |u: f64, v: f64| {
                let angle = |x: f64| (1.0 - x / 3.0).acos();
                let x = 3.0 - 3.0 * (angle(from) + u * (angle(to) - angle(from))).cos();
                [x, above + v * (top(x) - above), z]
            }
        };
        let above = if has_door { 2.1 } else { 0.0 };
        twin.grid([40, 8], column(0.0, 2.5, 0.0), &[]);
        twin.grid([20, 8], column(2.5, 3.4, above), &[]);
        twin.grid([40, 8], column(3.4, 6.0, 0.0), &[]);
    }
    twin
}

/// Three bulbs in a row, joined by necks: a surface of revolution, closed at its ends.
fn tube() -> Twin {
    let mut twin = Twin::default();
    let radii = [
        2.4, 2.4, 2.4, 0.7, 0.7, 2.4, 2.4, 2.4, 0.7, 0.7, 2.4, 2.4, 2.4,
    ];
    let d = std::f64::consts::FRAC_1_SQRT_2;
    // A square with a weight at every second point is a circle.
    let ring = |x: f64, r: f64| {
        let point = |k: usize| {
            let (sin, cos) = (k as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
            let (far, w) = if k.is_multiple_of(2) {
                (r, 1.0)
            } else {
                (r / d, d)
            };
            [x, far * sin, far * cos, w]
        };
        (0..9).map(point).collect::<Vec<_>>()
    };
    let rows: Vec<_> = (0..radii.len())
        .map(|k| ring(2.0 * k as f64, radii[k]))
        .collect();
    // Even knots that do not end at control points.
    let along: Vec<usize> = (0..radii.len() + 3).collect();
    let around = "[0,0,0,1,1,2,2,3,3,4,4,4]";
    twin.patch([2, 2], &rows, &format!(r#","knots":[{around},{along:?}]"#));
    // An even quadratic spline on each of its parts.
    let profile = |t: f64| {
        let k = (t.floor() as usize).min(radii.len() - 3);
        let s = t - k as f64;
        let weights = [(1.0 - s) * (1.0 - s) / 2.0, 0.5 + s - s * s, s * s / 2.0];
        let sum = |at: &dyn Fn(usize) -> f64| (0..3).map(|i| weights[i] * at(k + i)).sum::<f64>();
        [sum(&|i| 2.0 * i as f64), sum(&|i| radii[i])]
    };
    let n = (radii.len() - 2) as f64;
    let turned = |u: f64, [x, r]: [f64; 2]| {
        let (sin, cos) = (std::f64::consts::TAU * u).sin_cos();
        [x, r * sin, r * cos]
    };
    twin.grid([96, 220], |u, v| turned(u, profile(n * v)), &[]);
    for end in [profile(0.0), profile(n)] {
        let rows = [ring(end[0], end[1]), ring(end[0], 0.0)];
        twin.patch([2, 1], &rows, &format!(r#","knots":[{around},[0,0,1,1]]"#));
        twin.grid(
            [96, 10],
            |u, v| turned(u, [end[0], end[1] * (1.0 - v)]),
            &[],
        );
    }
    twin
}

/// Worlds of the patches, and of the triangles.
fn worlds(name: &str) -> anyhow::Result<[World; 2]> {
    let twin = scene(name)?;
    let options = ImportOptions::default();
    let patches = decode_patches(twin.json().as_bytes(), &options)?;
    let n = twin.mesh.len() as u32;
    let mesh = ArrayMesh {
        names: [name.to_owned(), String::new()],
        positions: twin.mesh.into_iter().flatten().collect(),
        triangles: (0..n).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        transform: DMat4::IDENTITY,
        is_detail: false,
    };
    let triangles = import_arrays(name, vec![mesh], &options)?;
    Ok([baked(&patches.scene)?, baked(&triangles.scene)?])
}

/// Cells of patches and of triangles that differ in number, and those whose volumes do.
pub(super) fn cells(name: &str) -> anyhow::Result<Figure> {
    let [patches, triangles] = worlds(name)?;
    Ok(twins::cells(&patches, &triangles))
}

/// Portals of patches more or fewer than those of triangles.
pub(super) fn portals(name: &str) -> anyhow::Result<Figure> {
    let [patches, triangles] = worlds(name)?;
    Ok(twins::portals(&patches, &triangles))
}
