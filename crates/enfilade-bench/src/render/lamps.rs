//! Lamps in pictures: those that matter, with maps of what they reach, against all lamps with maps of everything.
//!
//! Both keep lamps from cells that they do not reach. Maps alone, without that table, light surfaces that lie a few
//! millimeters behind others: the note counts these pixels, too.

use std::time::{Duration, Instant};

use anyhow::ensure;
use enfilade::geom::DVec3;
use enfilade::world::{Lamp, LampId, Lights, PartId, Place, Space, SpaceSeen, SpaceViewer};
use enfilade::{CellId, PortalId, World};
use enfilade_render::{
    AdapterChoice, Camera, Gpu, LampLight, LampOptions, Picture, SpaceShot, Studio, Style,
};
use enfilade_testkit::Rng;

use crate::measure::point;
use crate::rows::Figure;

const VIEWS: usize = 200;
const SIZE: [u32; 2] = [160, 120];
/// Height of lamps above the floor. [Units: wu]
const HEIGHT: f64 = 2.2;
const RANGE: f32 = 9.0;
const SIDE: u32 = 512;

/// Counts pixels that differ from brute force.
pub(super) fn pictures(world: &World) -> anyhow::Result<Figure> {
    let mut space = Space::new(world.clone())?;
    let mut rng = Rng::new(11);
    for portal in (0..space.sight(PartId::ROOT).n_portals() as u32).map(PortalId) {
        let share = rng.range(-0.5, 1.0).max(0.0) as f32;
        space.set_leaves(PartId::ROOT, portal, share);
    }
    let (rooms, lamps) = lamps_of(world, &space);
    ensure!(!lamps.is_empty(), "no room has a place for a lamp");
    let mut lights = Lights::new(&space);
    for lamp in &lamps {
        let (frame, at, range) = (lamp.part, lamp.at, lamp.range);
        lights.add(&space, Lamp { frame, at, range })?;
    }
    let mut culled = studio(world, &lamps, true)?;
    let mut whole = studio(world, &lamps, false)?;
    let mut maps_only = bare(world, &lamps)?;
    let all: Vec<u32> = (0..lamps.len() as u32).collect();
    let mut viewer = SpaceViewer::new(&space);
    let (mut n_differing, mut n_lit, mut n_lamps, mut n_seeping) = (0, 0, 0, 0);
    let mut times = [Duration::ZERO; 2];
    let mut n_views = 0;
    while n_views < VIEWS {
        // In rooms, not in the hollows of walls and ceilings.
        let cell = rooms[rng.below(rooms.len())];
        let [low, high] = world.graph[cell].aabb.map(point);
        let eye = DVec3::from_array([0, 1, 2].map(|k| rng.range(low[k], high[k])));
        let part = PartId::ROOT;
        if space.locate(part, eye) != Some(Place { part, cell }) {
            continue;
        }
        n_views += 1;
        let angle = rng.range(0.0, std::f64::consts::TAU);
        let toward = DVec3::new(angle.cos(), rng.range(-0.5, 0.3), angle.sin());
        let camera = Camera {
            eye: eye.as_vec3().to_array(),
            toward: toward.as_vec3().to_array(),
            fov_y: 1.2,
        };
        let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32)?;
        let seen = viewer.see(&space, PartId::ROOT, &view);
        let matter: Vec<u32> = lights
            .that_matter(&space, &seen)
            .iter()
            .map(number)
            .collect();
        n_lamps += matter.len();
        let mut draw = |studio: &mut Studio, k: usize, chosen: Option<&[u32]>| {
            let start = Instant::now();
            let picture = draw_lit(studio, &space, camera, seen, chosen);
            times[k] += start.elapsed();
            picture
        };
        let found = draw(&mut culled, 0, Some(&matter))?;
        let expected = draw(&mut whole, 1, Some(&all))?;
        n_differing += n_unequal(&found, &expected);
        let seeping = draw_lit(&mut maps_only, &space, camera, seen, Some(&all))?;
        n_seeping += n_unequal(&found, &seeping);
        let pixels = expected.rgba.chunks_exact(4);
        n_lit += pixels.filter(|p| p[..3] != [0; 3]).count();
    }
    ensure!(n_lit > 0, "no pixel was lit");
    let [fast, slow] = times.map(|t| t.as_secs_f64() * 1e3 / VIEWS as f64);
    let note = format!(
        "of {} pixels of {VIEWS} views, {n_lit} of them lit by {} lamps; {:.1} lamps a view, {fast:.0} ms, not {slow:.0}, \
             in software, maps included; {n_seeping} differ from maps without a table of cells",
        VIEWS * (SIZE[0] * SIZE[1]) as usize,
        lamps.len(),
        n_lamps as f64 / VIEWS as f64
    );
    Ok(Figure::new(n_differing as f64, 0.0, note))
}

fn number(id: &LampId) -> u32 {
    id.0
}

fn n_unequal(a: &Picture, b: &Picture) -> usize {
    let pixels = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
    pixels.filter(|(a, b)| a != b).count()
}

/// Returns the rooms whose middle is in their air, with a lamp there.
fn lamps_of(world: &World, space: &Space) -> (Vec<CellId>, Vec<LampLight>) {
    let (mut rooms, mut lamps) = (Vec::new(), Vec::new());
    for (cell, room) in world.graph.indoor_cells() {
        let [low, high] = room.aabb.map(point);
        let mut at = (low + high) * 0.5;
        at.y = (low.y + HEIGHT).min(high.y - 0.1);
        let part = PartId::ROOT;
        if space.locate(part, at) == Some(Place { part, cell }) {
            rooms.push(cell);
            lamps.push(LampLight {
                part,
                at: at.as_vec3().to_array(),
                color: [2.0, 1.8, 1.5],
                range: RANGE,
                cone: None,
            });
        }
    }
    (rooms, lamps)
}

fn studio(world: &World, lamps: &[LampLight], is_culled: bool) -> anyhow::Result<Studio> {
    let mut studio = bare(world, lamps)?;
    studio.add_light(world)?;
    studio.set_lamp_options(options(lamps, is_culled))?;
    Ok(studio)
}

fn options(lamps: &[LampLight], is_culled: bool) -> LampOptions {
    LampOptions {
        most: lamps.len(),
        side: SIDE,
        is_culled,
    }
}

/// Returns a studio that does not know the cells of points, with maps of everything.
fn bare(world: &World, lamps: &[LampLight]) -> anyhow::Result<Studio> {
    let mut studio = Studio::new(Gpu::open(&AdapterChoice::Software)?, world)?;
    // At night, so that each lit pixel shows it.
    studio.day = 0.0;
    studio.set_lamp_options(options(lamps, false))?;
    studio.set_lamps(lamps.to_vec())?;
    Ok(studio)
}

fn draw_lit(
    studio: &mut Studio,
    space: &Space,
    camera: Camera,
    seen: SpaceSeen<'_>,
    lamps: Option<&[u32]>,
) -> anyhow::Result<Picture> {
    let shot = SpaceShot {
        space,
        frame: PartId::ROOT,
        camera,
        seen: Some(seen),
        style: Style {
            shadows: false,
            dark_corners: false,
            ..Style::default()
        },
        marks: &[],
        props: &[],
        lamps,
    };
    Ok(studio.space_picture(&shot, SIZE)?.0)
}
