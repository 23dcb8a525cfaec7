//! Implicit scenes beside triangles of the same surface: a net around fields that are written here a second time, as plain
//! functions, by none of the code that reads or extracts the scenes.

use std::f64::consts::TAU;
use std::time::Instant;

use anyhow::{Context, bail};
use enfilade::cpg::World;
use enfilade::geom::{Aabb, DVec3};
use enfilade_testkit::surface_of;

use super::implicit::{GYROID, HOUSE, read};
use super::twins;
use crate::rows::{Figure, baked};

/// Largest exponent of the time in the surface.
const MOST_EXPONENT: f64 = 1.15;
/// Steps of the extractions that are timed, in meters.
const STEPS: [f64; 3] = [0.12, 0.06, 0.03];
/// Extractions of each, of which the fastest counts.
const TIMES: usize = 3;

/// Distance between the ends of two tubes that meet in a neck: less than their width. [Units: wu]
const NECK: f64 = 1.2;

/// A part of the air: the points within a radius of the line through some points.
struct Hollow {
    points: Vec<DVec3>,
    radius: f64,
}

impl Hollow {
    fn ball(at: DVec3, radius: f64) -> Self {
        let points = vec![at];
        Self { points, radius }
    }

    fn tube(points: Vec<DVec3>, radius: f64) -> Self {
        Self { points, radius }
    }

    fn json(&self) -> String {
        let at = |p: &DVec3| format!("[{},{},{}]", p.x, p.y, p.z);
        let points: Vec<_> = self.points.iter().map(at).collect();
        match &points[..] {
            [at] => format!(r#"{{"ball":{{"at":{at},"radius":{}}}}}"#, self.radius),
            all => format!(
                r#"{{"tube":{{"points":[{}],"radius":{}}}}}"#,
                all.join(","),
                self.radius
            ),
        }
    }

    fn at(&self, p: DVec3) -> f64 {
        let along = |w: &[DVec3]| {
            let way = w[1] - w[0];
            let t = ((p - w[0]).dot(way) / way.length_squared()).clamp(0.0, 1.0);
            (p - w[0] - way * t).length()
        };
        let line = self.points.windows(2).map(along);
        let first = (p - self.points[0]).length();
        line.fold(first, f64::min) - self.radius
    }
}

/// Balls and tubes of a scene.
fn parts(name: &str) -> anyhow::Result<Vec<Hollow>> {
    let flat = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    // Two tubes whose round ends meet in a neck, since in a tube of one width a portal may be anywhere.
    let way = |a: DVec3, b: DVec3| {
        let short = (b - a).normalize() * NECK / 2.0;
        let middle = (a + b) / 2.0;
        [[a, middle - short], [middle + short, b]].map(|ends| Hollow::tube(ends.to_vec(), 0.9))
    };
    Ok(match name {
        "balls" => {
            let [a, b, c] = [flat(0.0, 0.0), flat(9.0, 1.0), flat(4.0, 9.0)];
            let balls = [(a, 2.5), (b, 3.0), (c, 2.8)].map(|(at, r)| Hollow::ball(at, r));
            balls
                .into_iter()
                .chain(way(a, b))
                .chain(way(b, c))
                .collect()
        }
        "cavern" => {
            let at = |i: usize| flat((i % 3) as f64 * 9.0, (i / 3) as f64 * 9.0);
            let balls = (0..6).map(|i| Hollow::ball(at(i), 2.8));
            let ways = [[0, 1], [1, 2], [3, 4], [4, 5], [0, 3], [1, 4], [2, 5]];
            balls
                .chain(ways.into_iter().flat_map(|[a, b]| way(at(a), at(b))))
                .collect()
        }
        "knot" => vec![knot()],
        _ => bail!("no scene {name}"),
    })
}

/// A point of a torus knot that goes twice around the axis and three times around the ring, `t` from 0 to 1.
fn knot_at(t: f64) -> DVec3 {
    let r = 9.0 + 4.0 * (3.0 * TAU * t).cos();
    let (sin, cos) = (2.0 * TAU * t).sin_cos();
    DVec3::new(r * cos, 4.0 * (3.0 * TAU * t).sin(), r * sin)
}

fn knot() -> Hollow {
    let points = (0..=180).map(|k| knot_at(f64::from(k) / 180.0)).collect();
    Hollow::tube(points, 1.0)
}

/// Boxes of the house: matter, and what is cut from it.
const BOXES: [[[f64; 3]; 2]; 9] = [
    [[0.0, -0.3, 0.0], [10.0, 3.1, 8.0]],
    [[0.3, 0.0, 0.3], [4.9, 2.6, 7.7]],
    [[5.1, 0.0, 0.3], [9.7, 2.6, 3.9]],
    [[5.1, 0.0, 4.1], [9.7, 2.6, 7.7]],
    [[4.8, 0.0, 1.5], [5.2, 2.1, 2.4]],
    [[7.0, 0.0, 3.8], [7.9, 2.1, 4.2]],
    [[-0.1, 0.0, 3.0], [0.4, 2.1, 4.0]],
    [[9.6, 0.9, 1.5], [10.1, 2.1, 2.7]],
    [[2.0, 0.9, 7.6], [3.2, 2.1, 8.1]],
];

/// Positive in matter, as the net expects it of air.
fn house_at(p: DVec3) -> f64 {
    let within = |[low, high]: [[f64; 3]; 2]| {
        let side = |k: usize| (low[k] - p[k]).max(p[k] - high[k]);
        side(0).max(side(1)).max(side(2))
    };
    let cut = BOXES[1..].iter().map(|b| within(*b));
    -within(BOXES[0]).max(-cut.fold(f64::INFINITY, f64::min))
}

/// Positive in matter: the side of a gyroid within its box, and all outside.
fn gyroid_at(p: DVec3) -> f64 {
    let [(sx, cx), (sy, cy), (sz, cz)] = (p * (TAU / 8.0)).to_array().map(f64::sin_cos);
    let outside = (p - 4.0).abs().max_element() - 4.0;
    outside.max(-(sx * cy + sy * cz + sz * cx))
}

fn text(name: &str, step: Option<f64>) -> anyhow::Result<String> {
    let parts: Vec<_> = parts(name)?.iter().map(Hollow::json).collect();
    let step = step.map_or(String::new(), |s| format!(r#""step":{s},"#));
    let parts = parts.join(",");
    Ok(format!(
        r#"{{"enfilade":"implicit",{step}"air":{{"union":[{parts}]}}}}"#
    ))
}

/// Worlds of an implicit scene, and of its triangles.
fn worlds(name: &str) -> anyhow::Result<[World; 2]> {
    let cube = |low: DVec3, high: DVec3| Aabb::new(low, high).expanded(0.31);
    let (text, net) = match name {
        "house" => {
            let [low, high] = BOXES[0].map(DVec3::from_array);
            let net = surface_of(name, house_at, cube(low, high), 0.05);
            (HOUSE.to_owned(), net)
        }
        "gyroid" => {
            let bounds = cube(DVec3::ZERO, DVec3::splat(8.0));
            let fine = GYROID.replace("0.15", "0.1");
            (fine, surface_of(name, gyroid_at, bounds, 0.1))
        }
        _ => {
            let parts = parts(name)?;
            let reach = |p: &Hollow| {
                let balls = p.points.iter().map(|&c| [c - p.radius, c + p.radius]);
                balls.collect::<Vec<_>>()
            };
            let ends: Vec<_> = parts.iter().flat_map(reach).flatten().collect();
            let low = ends.iter().copied().reduce(DVec3::min);
            let high = ends.iter().copied().reduce(DVec3::max);
            let (low, high) = low.zip(high).context("no parts")?;
            let at = |p: DVec3| parts.iter().map(|q| q.at(p)).fold(f64::INFINITY, f64::min);
            (
                text(name, None)?,
                surface_of(name, at, cube(low, high), 0.1),
            )
        }
    };
    Ok([baked(&read(&text)?.scene)?, baked(&net.scene)?])
}

/// Cells that differ in number, those whose volumes do, and portals more or fewer than those of the triangles.
pub(super) fn differences(name: &str) -> anyhow::Result<Figure> {
    let [source, triangles] = worlds(name)?;
    let [cells, portals] = [twins::cells, twins::portals].map(|f| f(&source, &triangles));
    let note = format!("{}; {}", cells.note, portals.note);
    Ok(Figure::new(cells.value + portals.value, cells.most, note))
}

/// Exponent of the time of an extraction in the squares of a step that the surface has, between the first and the last of some
/// steps.
pub(super) fn time(name: &str) -> anyhow::Result<Figure> {
    let mut seen = Vec::new();
    for step in STEPS {
        let text = text(name, Some(step))?;
        let mut seconds = f64::INFINITY;
        for _ in 0..TIMES {
            let start = Instant::now();
            read(&text)?;
            seconds = seconds.min(start.elapsed().as_secs_f64());
        }
        seen.push((step, seconds));
    }
    let [first, .., last] = seen[..] else {
        bail!("too few steps");
    };
    let value = (last.1 / first.1).ln() / (2.0 * (first.0 / last.0).ln());
    let note = format!("steps and seconds {seen:.2?}");
    Ok(Figure::new(value, MOST_EXPONENT, note))
}
