//! Volumes: a vessel rasterised, and a tree of airways as a scanner would see it.

use std::collections::BTreeMap;

use anyhow::Context;
use enfilade::cpg::{CellId, World};
use enfilade::geom::scene::Role;
use enfilade::geom::{Aabb, DVec3};
use enfilade::import::{AirSide, ImportOptions, VolumeOptions};
use enfilade::internals::geom::{Bvh, Ray, closest_point_on_segment};
use enfilade::internals::import::decode_volume;
use enfilade_testkit::Rng;

use crate::measure::imported;
use crate::rows::{Figure, baked, folder_of};

/// Enlargement that the importer gives to bodies: meters for a millimeter.
const METERS: f64 = 0.128;

/// A NIfTI file of 16-bit samples, with y up: `at` gives the value at a point. [Units: mm]
fn nifti(bounds: Aabb, spacing: f64, mut at: impl FnMut(DVec3) -> f64) -> Vec<u8> {
    let n = (bounds.size() / spacing)
        .ceil()
        .to_array()
        .map(|n| n as usize + 1);
    let mut head = vec![0_u8; 352];
    let mut put = |i: usize, b: &[u8]| head[i..i + b.len()].copy_from_slice(b);
    put(0, &348_i32.to_le_bytes());
    for (i, n) in [3, n[0], n[1], n[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(40 + 2 * i, &(n as i16).to_le_bytes());
    }
    put(70, &4_i16.to_le_bytes());
    put(108, &352_f32.to_le_bytes());
    put(254, &1_i16.to_le_bytes());
    for (row, first) in bounds.min.to_array().into_iter().enumerate() {
        put(280 + 20 * row, &(spacing as f32).to_le_bytes());
        put(280 + 16 * row + 12, &(first as f32).to_le_bytes());
    }
    put(123, &[2]);
    put(344, b"n+1");
    for i in 0..n[0] * n[1] * n[2] {
        let of = [i % n[0], i / n[0] % n[1], i / (n[0] * n[1])].map(|c| c as f64);
        let value = at(bounds.min + DVec3::from_array(of) * spacing);
        head.extend((value.round() as i16).to_le_bytes());
    }
    head
}

fn options(level: f64, air: AirSide) -> ImportOptions {
    ImportOptions {
        // The files made here have y up.
        up: Some(enfilade::import::Up::Y),
        volume: VolumeOptions {
            level: Some(level),
            air: Some(air),
        },
        ..ImportOptions::default()
    }
}

/// Cells of the rasterised aorta, at so many tenths of a millimeter, more or fewer than those of its triangles. Contrast has 300 units, tissue 40, with noise of 20.
pub(super) fn cells<const TENTHS: u32>(world: &World, name: &str) -> anyhow::Result<Figure> {
    let spacing = f64::from(TENTHS) / 10.0;
    let folder = folder_of(name).context("the scene is missing")?;
    let scene = imported(&folder)?;
    let sources = scene.triangle_sources(Role::Structural);
    let triangles: Vec<_> = sources.map(|s| scene.world_triangle(s)).collect();
    let bvh = Bvh::build(&triangles);
    let bounds = bvh.bounds();
    let millimeters = Aabb::new(bounds.min / METERS, bounds.max / METERS).expanded(2.3 * spacing);
    let mut rng = Rng::new(1);
    let bytes = nifti(millimeters, spacing, |p| {
        let ray = Ray {
            origin: p * METERS,
            direction: DVec3::new(1.0, 0.000_37, 0.000_71),
            t_max: f64::INFINITY,
        };
        let mut n = 0;
        bvh.for_each_hit(&ray, |_| n += 1);
        let noise: f64 = (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        (if n % 2 == 1 { 300.0 } else { 40.0 }) + noise * 20.0
    });
    let imported = decode_volume(&bytes, &options(170.0, AirSide::Above))?;
    let found = baked(&imported.scene)?.graph.indoor_cells().count();
    let wanted = world.graph.indoor_cells().count();
    let note = format!("{found} cells, {wanted} of the triangles");
    Ok(Figure::new(found.abs_diff(wanted) as f64, 0.0, note))
}

/// Branches of an airway: ends and radius. [Units: mm]
fn airways() -> Vec<([DVec3; 2], f64)> {
    let mut all = vec![([DVec3::ZERO, DVec3::new(0.0, -100.0, 0.0)], 9.0)];
    let mut last = vec![(0, DVec3::NEG_Y, DVec3::X)];
    for generation in 1..4 {
        let length = 62.0 * 0.8_f64.powi(generation);
        let mut next = Vec::new();
        for (parent, along, side) in last {
            let ([_, from], radius): ([DVec3; 2], f64) = all[parent];
            for sign in [-1.0, 1.0] {
                let way = (along * 0.75 + side * sign * 0.66).normalize();
                next.push((
                    all.len(),
                    way,
                    way.cross(side * sign).cross(way).cross(way).normalize(),
                ));
                all.push(([from, from + way * length], radius * 0.77));
            }
        }
        last = next;
    }
    all
}

/// Share of the branches of an airway whose middle is not in a cell of their own.
pub(super) fn missed(scene: &str) -> anyhow::Result<Figure> {
    let noise: f64 = scene.rsplit('-').next().unwrap_or("0").parse()?;
    let branches = airways();
    let ends: Vec<DVec3> = branches.iter().flat_map(|b| b.0).collect();
    let bounds = Aabb::of_points(&ends).expanded(14.0);
    let mut rng = Rng::new(2);
    let bytes = nifti(bounds, 0.8, |p| {
        let to =
            |b: &([DVec3; 2], f64)| p.distance(closest_point_on_segment(p, b.0[0], b.0[1])) - b.1;
        let nearest = branches.iter().map(to).fold(f64::INFINITY, f64::min);
        // A voxel at the wall holds both.
        let share = (0.5 - nearest / 0.8).clamp(0.0, 1.0);
        let sum: f64 = (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        50.0 - 1050.0 * share + sum * noise
    });
    let imported = decode_volume(&bytes, &options(-400.0, AirSide::Below))?;
    let world = baked(&imported.scene)?;
    let middles = branches.iter().map(|b| (b.0[0] + b.0[1]) * 0.5 * METERS);
    let rooms: Vec<CellId> = world.graph.indoor_cells().map(|(id, _)| id).collect();
    let cell = |p: DVec3| world.graph.locator.locate(p).filter(|c| rooms.contains(c));
    let cells: Vec<_> = middles.map(cell).collect();
    let mut n_in: BTreeMap<_, usize> = BTreeMap::new();
    for cell in cells.iter().flatten() {
        *n_in.entry(*cell).or_default() += 1;
    }
    let is_own = |c: &&Option<CellId>| c.is_some_and(|c| n_in.get(&c) == Some(&1));
    let found = cells.iter().filter(is_own).count();
    let value = 1.0 - found as f64 / branches.len() as f64;
    let note = format!(
        "{found} of {} branches, {} cells",
        branches.len(),
        world.graph.indoor_cells().count()
    );
    Ok(Figure::new(value, 0.05, note))
}
