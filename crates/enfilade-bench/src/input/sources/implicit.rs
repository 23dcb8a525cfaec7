//! Implicit scenes.

use anyhow::{Context, bail};
use enfilade::import::{ImportOptions, Imported};
use enfilade::internals::import::decode_implicit;

use crate::rows::{Figure, baked};

/// Share by which the evaluated points may grow when the volume around a surface grows 64 times.
const MOST_GROWTH: f64 = 1.05;

/// Rooms and openings of a scene, and its text.
fn scene(name: &str) -> anyhow::Result<([usize; 2], String)> {
    let ball = |x: f64, z: f64, r: f64| format!(r#"{{"ball":{{"at":[{x},0,{z}],"radius":{r}}}}}"#);
    let tube = |a: [f64; 2], b: [f64; 2]| {
        let points = format!("[{},0,{}],[{},0,{}]", a[0], a[1], b[0], b[1]);
        format!(r#"{{"tube":{{"points":[{points}],"radius":0.9}}}}"#)
    };
    let air = |parts: &[String]| {
        let parts = parts.join(",");
        format!(r#"{{"enfilade":"implicit","air":{{"smooth_union":{{"by":0.4,"of":[{parts}]}}}}}}"#)
    };
    Ok(match name {
        "balls" => {
            let balls = [
                ball(0.0, 0.0, 2.5),
                ball(9.0, 1.0, 3.0),
                ball(4.0, 9.0, 2.8),
            ];
            let tubes = [tube([0.0, 0.0], [9.0, 1.0]), tube([9.0, 1.0], [4.0, 9.0])];
            ([3, 2], air(&[&balls[..], &tubes[..]].concat()))
        }
        // Six rooms in two rows, joined by seven ways, as in the cavern of Gjørup.
        "cavern" => {
            let at = |i: usize| [(i % 3) as f64 * 9.0, (i / 3) as f64 * 9.0];
            let balls = (0..6).map(|i| ball(at(i)[0], at(i)[1], 2.8));
            let ways = [[0, 1], [1, 2], [3, 4], [4, 5], [0, 3], [1, 4], [2, 5]];
            let tubes = ways.iter().map(|&[a, b]| tube(at(a), at(b)));
            ([6, 7], air(&balls.chain(tubes).collect::<Vec<_>>()))
        }
        "house" => ([3, 5], HOUSE.to_owned()),
        "gyroid" => (counts(&GYROID.replace("0.15", "0.1"))?, GYROID.to_owned()),
        _ => bail!("no scene {name}"),
    })
}

/// Three rooms with two doorways, a door to the outdoors, and two windows.
pub(super) const HOUSE: &str = r#"{"enfilade":"implicit","matter":{"difference":[
    {"box":{"min":[0,-0.3,0],"max":[10,3.1,8]}},
    {"box":{"min":[0.3,0,0.3],"max":[4.9,2.6,7.7]}},
    {"box":{"min":[5.1,0,0.3],"max":[9.7,2.6,3.9]}},
    {"box":{"min":[5.1,0,4.1],"max":[9.7,2.6,7.7]}},
    {"box":{"min":[4.8,0,1.5],"max":[5.2,2.1,2.4]}},
    {"box":{"min":[7,0,3.8],"max":[7.9,2.1,4.2]}},
    {"box":{"min":[-0.1,0,3],"max":[0.4,2.1,4]}},
    {"box":{"min":[9.6,0.9,1.5],"max":[10.1,2.1,2.7]}},
    {"box":{"min":[2,0.9,7.6],"max":[3.2,2.1,8.1]}}]}}"#;

/// A cave that was not made of rooms: it has those of its surface in finer steps.
pub(super) const GYROID: &str = r#"{"enfilade":"implicit","box":[[0,0,0],[8,8,8]],"outside":"matter","step":0.15,
    "matter":{"gyroid":{"period":8}}}"#;

/// Rooms and openings found.
fn counts(text: &str) -> anyhow::Result<[usize; 2]> {
    let world = baked(&read(text)?.scene)?;
    Ok([
        world.graph.indoor_cells().count(),
        world.graph.portals.len(),
    ])
}

pub(super) fn read(text: &str) -> anyhow::Result<Imported> {
    Ok(decode_implicit(text.as_bytes(), &ImportOptions::default())?)
}

/// Rooms more or fewer than the scene was made with.
pub(super) fn cells(name: &str) -> anyhow::Result<Figure> {
    let ([n, _], text) = scene(name)?;
    let [found, _] = counts(&text)?;
    let note = format!("{found} rooms of {n}");
    Ok(Figure::new(found.abs_diff(n) as f64, 0.0, note))
}

/// Openings more or fewer than the scene was made with.
pub(super) fn portals(name: &str) -> anyhow::Result<Figure> {
    let ([_, n], text) = scene(name)?;
    let [_, found] = counts(&text)?;
    let note = format!("{found} openings of {n}");
    Ok(Figure::new(found.abs_diff(n) as f64, 0.0, note))
}

/// Points evaluated in a large volume around a surface, in multiples of those in a small one.
pub(super) fn samples(name: &str) -> anyhow::Result<Figure> {
    let (_, text) = scene(name)?;
    let of = |size: f64| -> anyhow::Result<f64> {
        let bounds = format!(
            r#""step":0.15,"outside":"matter","box":[[-{size},-{size},-{size}],[{size},{size},{size}]],"air""#
        );
        let imported = read(&text.replacen("\"air\"", &bounds, 1))?;
        let surface = imported.report.files[0]
            .surface
            .as_ref()
            .context("has no surface")?;
        Ok(surface.n_samples as f64)
    };
    let (small, large) = (of(16.0)?, of(64.0)?);
    let note = format!("{large:.0} and {small:.0} points, 64 times the volume");
    Ok(Figure::new(large / small, MOST_GROWTH, note))
}
