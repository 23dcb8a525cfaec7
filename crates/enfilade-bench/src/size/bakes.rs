//! Bakes of large scenes: time, memory, growth, and rooms of buildings on wide land.

use std::time::Instant;

use anyhow::{Context, bail};
use enfilade::cpg::{Cell, World};
use enfilade::geom::scene::{Object, Role, Scene};
use enfilade::geom::{Aabb, DMat4, DVec3};
use enfilade_testkit::hills;

use super::growth::{Used, bake_tower, used_by};
use crate::measure::imported;
use crate::process::{bake_command, target_dir};
use crate::rows::{Figure, baked, folder_of};

/// Bars of the issue for wall time and memory. [Units: s, bytes]
const SECONDS: [(&str, f64); 3] = [("tower-1024", 6.0), ("tower-10240", 75.0), ("clinic", 10.0)];
const SECONDS_ON_LAND: f64 = 10.0;
const MOST_MEMORY: f64 = 2.0 * (1 << 30) as f64;
/// Tower whose growth towards larger ones is measured.
const SMALL_TOWER: usize = 64;
/// Side of the land's squares, and distance between buildings. [Units: wu]
const SQUARE: f64 = 4.0;
const APART: f64 = 300.0;
/// Rooms of the same place whose volumes differ by a smaller share are the same.
const SAME: f64 = 0.03;

fn rooms_of(scene: &str) -> anyhow::Result<usize> {
    let n = scene.strip_prefix("tower-").context("tower-N")?;
    Ok(n.parse()?)
}

fn used_for(scene: &str) -> anyhow::Result<Used> {
    if scene.starts_with("tower") {
        return Ok(bake_tower(rooms_of(scene)?)?.used);
    }
    let dir = folder_of(scene).context("the scene is missing")?;
    let world = target_dir().join(format!("any-size-{scene}.glb"));
    used_by(&bake_command(&dir, &world))
}

/// Wall seconds of `enfilade bake`.
pub(super) fn seconds(scene: &str) -> anyhow::Result<Figure> {
    let used = used_for(scene)?;
    let bar = SECONDS.iter().find(|bar| bar.0 == scene);
    let note = format!("{:.1} s of processor time", used.user);
    Ok(Figure::new(
        used.wall,
        bar.context("a bar for this scene")?.1,
        note,
    ))
}

/// Does [`seconds`] for a shared scene.
pub(super) fn seconds_shared(_: &World, scene: &str) -> anyhow::Result<Figure> {
    seconds(scene)
}

/// Peak memory of `enfilade bake`. [Units: GiB]
pub(super) fn memory(scene: &str) -> anyhow::Result<Figure> {
    let value = used_for(scene)?.peak / f64::from(1 << 30);
    Ok(Figure::new(value, MOST_MEMORY / f64::from(1 << 30), "GiB"))
}

/// Processor time of a bake by binary space partition ÷ that of the default method.
pub(super) fn bsp_time(scene: &str) -> anyhow::Result<Figure> {
    let [bsp, own] = [bsp_of(scene)?, used_for(scene)?];
    let note = format!("{:.1} s instead of {:.1} s", bsp.user, own.user);
    Ok(Figure::new(bsp.user / own.user, 2.0, note))
}

/// Peak memory of a bake by binary space partition. [Units: GiB]
pub(super) fn bsp_memory(scene: &str) -> anyhow::Result<Figure> {
    Ok(Figure::new(
        bsp_of(scene)?.peak / f64::from(1 << 30),
        0.6,
        "GiB",
    ))
}

fn bsp_of(scene: &str) -> anyhow::Result<Used> {
    let dir = target_dir().join(scene);
    bake_tower(rooms_of(scene)?)?;
    let world = dir.join("bsp.glb");
    used_by(bake_command(&dir, &world).args(["--method", "bsp"]))
}

/// Exponent of processor time in occupied voxels, from a small tower to this one.
pub(super) fn growth(scene: &str) -> anyhow::Result<Figure> {
    let [small, large] = [SMALL_TOWER, rooms_of(scene)?].map(bake_tower);
    let (small, large) = (small?, large?);
    let more = (large.used.user / small.used.user).ln();
    let value = more / (large.occupied / small.occupied).ln();
    let note = format!("from {} to {} rooms", small.n_rooms, large.n_rooms);
    Ok(Figure::new(value, 1.05, note))
}

/// Share of the rooms of a building that is not found again on a square kilometer of land.
pub(super) fn lost_on_land(alone: &World, scene: &str) -> anyhow::Result<Figure> {
    lost(alone, scene, &[DVec3::ZERO])
}

/// Share of the rooms of a building that is not found again in any of three copies, far apart on the same land.
pub(super) fn lost_on_site(alone: &World, scene: &str) -> anyhow::Result<Figure> {
    let places = [
        DVec3::ZERO,
        DVec3::new(APART, 0.0, 0.4 * APART),
        DVec3::new(-0.5 * APART, 0.0, -APART),
    ];
    lost(alone, scene, &places)
}

/// Wall seconds of the bake of a building on a square kilometer of land, without reading it.
pub(super) fn seconds_on_land(alone: &World, scene: &str) -> anyhow::Result<Figure> {
    let scene = on_land(alone, scene, &[DVec3::ZERO])?;
    let start = Instant::now();
    baked(&scene)?;
    let value = start.elapsed().as_secs_f64();
    Ok(Figure::new(
        value,
        SECONDS_ON_LAND,
        "a square kilometer of land",
    ))
}

fn lost(alone: &World, scene: &str, places: &[DVec3]) -> anyhow::Result<Figure> {
    let there = baked(&on_land(alone, scene, places)?)?;
    let rooms = alone
        .graph
        .cells
        .iter()
        .filter(|c| !c.outdoor && !c.is_void);
    let rooms: Vec<_> = rooms.collect();
    let mut others: Vec<_> = there.graph.cells.iter().filter(|c| !c.outdoor).collect();
    let n = rooms.len() * places.len();
    let mut n_lost = 0;
    for &place in places {
        for room in &rooms {
            let is_same = |other: &&Cell| {
                let moved = |p: [f32; 3]| DVec3::from(p.map(f64::from)) + place;
                let middle = |aabb: [[f32; 3]; 2]| {
                    let [min, max] = aabb.map(|p| DVec3::from(p.map(f64::from)));
                    0.5 * (min + max)
                };
                let expected = 0.5 * (moved(room.aabb[0]) + moved(room.aabb[1]));
                middle(other.aabb).distance(expected) < 0.5
                    && f64::from((other.volume - room.volume).abs()) < SAME * f64::from(room.volume)
            };
            match others.iter().position(is_same) {
                Some(at) => drop(others.swap_remove(at)),
                None => n_lost += 1,
            }
        }
    }
    let voxel = there.graph.statistics.counts.get("voxel_size");
    let note = format!("of {n} rooms; voxels of {:.3} m", voxel.unwrap_or(&0.0));
    Ok(Figure::new(f64::from(n_lost) / n as f64, 0.0, note))
}

/// Places copies of a scene on hills, each on level ground of its own.
pub(super) fn on_land(alone: &World, name: &str, places: &[DVec3]) -> anyhow::Result<Scene> {
    let dir = folder_of(name).context("the scene is missing")?;
    let mut scene = imported(&dir)?;
    if !scene.solids.is_empty() {
        bail!("brushes have no land");
    }
    let cells = alone.graph.cells.iter().filter(|c| !c.outdoor);
    let corners = cells
        .flat_map(|c| c.aabb)
        .map(|p| DVec3::from(p.map(f64::from)));
    let bounds = corners.fold(Aabb::EMPTY, Aabb::including);
    let objects = std::mem::take(&mut scene.objects);
    for &place in places {
        scene
            .objects
            .extend(objects.iter().cloned().map(|mut object| {
                object.transform = DMat4::from_translation(place) * object.transform;
                object
            }));
    }
    let middles: Vec<DVec3> = places.iter().map(|&p| p + bounds.center()).collect();
    let ground = bounds.min.y - 0.5;
    let level = 0.7 * bounds.size().x.max(bounds.size().z) + 10.0;
    scene.meshes.push(hills(&middles, ground, level, SQUARE));
    scene.objects.push(Object {
        name: "land".to_owned(),
        mesh: scene.meshes.len() as u32 - 1,
        transform: DMat4::IDENTITY,
        role: Role::Structural,
        reason: String::new(),
        filling: None,
        node: None,
    });
    Ok(scene)
}
