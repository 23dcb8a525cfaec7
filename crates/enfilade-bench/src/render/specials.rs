//! Pictures through mirrors, teleporters and tinted, reflecting panes, against traced rays that know no cells.
//!
//! A pixel is compared where its color is certain: the same a fiftieth of a pixel away, and not that of one of two surfaces in
//! one place. All others are edges. The bar is that none of the certain pixels differs.

use std::cell::Cell;
use std::collections::HashSet;
use std::time::{Duration, Instant};

use anyhow::ensure;
use enfilade::cpg::{Pass, PortalId, SpecialId, SpecialPortal, SpecialShape, Way};
use enfilade::geom::scene::Mesh;
use enfilade::geom::{DMat3, DQuat, DVec3, Similarity};
use enfilade::world::{PartId, Place, Space, SpaceSeen, SpaceViewer};
use enfilade::{CellId, World};
use enfilade_render::{AdapterChoice, Camera, Gpu, SpaceShot, Studio, Style};
use enfilade_testkit::{
    Chain, GridParams, Rng, Traced, TracedCamera, chains_of, painted, room_grid, with_specials,
};

use crate::measure::point;
use crate::rows::Figure;

/// Views of a generated world.
const MADE_VIEWS: usize = 1000;
/// Views of each building.
const VIEWS: usize = 1000;
const SIZE: [u32; 2] = [96, 72];
const ROOT: PartId = PartId::ROOT;

/// Most special portals of a building.
const MOST_SPECIALS: usize = 40;

pub(super) fn mirrors_in(scene: &str) -> anyhow::Result<Figure> {
    let world = keep(made(scene)?, |way| *way == Way::Mirror);
    compared(world, MADE_VIEWS)
}

pub(super) fn teleporters_in(scene: &str) -> anyhow::Result<Figure> {
    let world = keep(made(scene)?, |way| matches!(way, Way::Lead { .. }));
    compared(world, MADE_VIEWS)
}

pub(super) fn passes_in(scene: &str) -> anyhow::Result<Figure> {
    let mut world = made(scene)?;
    for (i, side) in world.graph.specials.iter_mut().enumerate() {
        side.passes[0].tint = [0.9, 0.6, 0.8, 1.0];
        if side.passes[0].way != Way::Mirror && i % 2 == 0 {
            side.passes.push(tinted(Way::Mirror, [1.0, 0.9, 0.7, 0.4]));
        }
    }
    let doorways: Vec<PortalId> = world.graph.portal_ids().collect();
    for portal in doorways {
        let cell = world.graph[portal].cells[0];
        add(&mut world, portal, cell, glass());
    }
    compared(world, MADE_VIEWS)
}

pub(super) fn mirrors(world: &World) -> anyhow::Result<Figure> {
    let mut world = world.clone();
    for portal in doorways(&world) {
        for cell in world.graph[portal].cells {
            add(&mut world, portal, cell, vec![Pass::new(Way::Mirror)]);
        }
    }
    compared(world, VIEWS)
}

pub(super) fn teleporters(world: &World) -> anyhow::Result<Figure> {
    let mut world = world.clone();
    let all = doorways(&world);
    for (i, &portal) in all.iter().enumerate() {
        for (k, cell) in world.graph[portal].cells.into_iter().enumerate() {
            let goal = all[(i * 7 + 3 + k) % all.len()];
            let lead = lead(&world, portal, cell, goal);
            add(&mut world, portal, cell, vec![Pass::new(lead)]);
        }
    }
    compared(world, VIEWS)
}

pub(super) fn passes(world: &World) -> anyhow::Result<Figure> {
    let mut world = world.clone();
    let all = doorways(&world);
    for (i, &portal) in all.iter().enumerate() {
        let [first, second] = world.graph[portal].cells;
        add(&mut world, portal, first, glass());
        let goal = all[(i * 5 + 2) % all.len()];
        let lead = lead(&world, portal, second, goal);
        let passes = vec![
            tinted(lead, [0.9, 0.7, 0.8, 1.0]),
            tinted(Way::Mirror, [1.0, 0.9, 0.7, 0.4]),
        ];
        add(&mut world, portal, second, passes);
    }
    compared(world, VIEWS)
}

fn made(scene: &str) -> anyhow::Result<World> {
    let n: usize = scene.trim_start_matches("offices-").parse()?;
    let params = GridParams {
        outdoors: true,
        windows: 0.2,
        furniture: 0,
        ..GridParams::offices(n, 4)
    };
    Ok(with_specials(room_grid(&params), n, 4))
}

/// Returns the world with those of its special portals whose first pass is wanted; links lead one way.
fn keep(mut world: World, is_wanted: impl Fn(&Way) -> bool) -> World {
    let specials = &mut world.graph.specials;
    specials.retain(|side| is_wanted(&side.passes[0].way));
    for side in specials {
        if let Way::Lead { back, .. } = &mut side.passes[0].way {
            *back = None;
        }
    }
    world
}

fn tinted(way: Way, tint: [f32; 4]) -> Pass {
    Pass { way, tint }
}

/// A greenish pane that reflects.
fn glass() -> Vec<Pass> {
    vec![
        tinted(Way::Through, [0.7, 0.9, 0.8, 1.0]),
        tinted(Way::Mirror, [1.0, 1.0, 1.0, 0.3]),
    ]
}

fn add(world: &mut World, portal: PortalId, cell: CellId, passes: Vec<Pass>) {
    world.graph.specials.push(SpecialPortal {
        name: String::new(),
        cell,
        shape: SpecialShape::Portal(portal),
        passes,
    });
}

/// Returns upright, rectangular openings between rooms, evenly from all without leaves, or, if these are few, from all.
fn doorways(world: &World) -> Vec<PortalId> {
    let is_indoor = |cell: CellId| !world.graph[cell].outdoor;
    let all: Vec<PortalId> = (world.graph.portal_ids())
        .filter(|id| {
            let portal = &world.graph[*id];
            let [_, w, h] = frame(world, *id, portal.cells[0]);
            let area: f64 = (portal.pieces.iter())
                .map(|piece| {
                    let fan = (2..piece.len()).map(|i| [0, i - 1, i].map(|k| point(piece[k])));
                    fan.map(|[a, b, c]| (b - a).cross(c - a).length() * 0.5)
                        .sum::<f64>()
                })
                .sum();
            let box_area = w.length() * h.length();
            portal.cells.into_iter().all(is_indoor)
                && portal.normal[1].abs() < 0.01
                && area > 0.9
                && area > 0.99 * box_area
        })
        .collect();
    let is_bare = |id: &PortalId| world.graph[*id].fittings.is_empty();
    let bare: Vec<PortalId> = all.iter().copied().filter(is_bare).collect();
    let all = if bare.len() < 4 { all } else { bare };
    let step = all.len().div_ceil(MOST_SPECIALS / 2).max(1);
    all.into_iter().step_by(step).collect()
}

/// Returns the center of an opening and its edges, to the right and up, as seen from a cell.
fn frame(world: &World, portal: PortalId, from: CellId) -> [DVec3; 3] {
    let own = &world.graph[portal];
    let sign = if own.cells[0] == from { 1.0 } else { -1.0 };
    let right = (point(own.normal) * sign)
        .cross(DVec3::Y)
        .normalize_or_zero();
    let corners = || own.pieces.iter().flatten().map(|p| point(*p));
    let range = |axis: DVec3| {
        let along = corners().map(|p| axis.dot(p));
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| {
            [a.min(x), b.max(x)]
        })
    };
    let [[l, r], [b, t]] = [right, DVec3::Y].map(range);
    let normal = right.cross(DVec3::Y);
    let depth = normal.dot(corners().next().unwrap_or_default());
    let center = right * ((l + r) * 0.5) + DVec3::Y * ((b + t) * 0.5) + normal * depth;
    [center, right * (r - l), DVec3::Y * (t - b)]
}

/// Returns the way from one opening into the cell behind another: turned, and scaled so that it fits in there.
fn lead(world: &World, from: PortalId, cell: CellId, goal: PortalId) -> Way {
    let [before, to] = world.graph[goal].cells;
    let [a, aw, ah] = frame(world, from, cell);
    let [b, bw, bh] = frame(world, goal, before);
    let fit = (bw.length() / aw.length()).min(bh.length() / ah.length());
    let scale = 0.98 * fit.min(1.5);
    let axes = |w: DVec3| {
        let right = w.normalize();
        DMat3::from_cols(right, DVec3::Y, right.cross(DVec3::Y))
    };
    let turn = DQuat::from_mat3(&(axes(bw) * axes(aw).transpose())).normalize();
    let map = Similarity {
        turn,
        at: b - turn * (a * scale),
        scale,
    };
    let back = None;
    Way::Lead { to, map, back }
}

/// Returns the world without the leaves of its doors: they stand as the state has them, which the rays do not know.
fn without_leaves(mut world: World) -> World {
    let empty = world.detail_meshes.len() as u32;
    world.detail_meshes.push(Mesh::default());
    for portal in &mut world.graph.portals {
        for fitting in portal.fittings.drain(..) {
            world.details[fitting.detail as usize].mesh = empty;
        }
    }
    world
}

/// Counts the certain pixels that differ.
fn compared(world: World, n_views: usize) -> anyhow::Result<Figure> {
    let world = without_leaves(painted(world, 251));
    ensure!(!world.graph.specials.is_empty(), "no doorway is special");
    let is_valid = world.graph.validate();
    is_valid.map_err(|e| anyhow::anyhow!("{e:?}"))?;
    let traced = Traced::new(&world);
    let space = Space::new(world.clone())?;
    let mut studio = Studio::new(Gpu::open(&AdapterChoice::Software)?, &world)?;
    studio.day = 0.0;
    let mut viewer = SpaceViewer::new(&space);
    viewer.specials_mut().max_contexts = 100;
    viewer.specials_mut().min_share = 1e-4;
    viewer.specials_mut().max_apart = 1e3;
    let mut rng = Rng::new(21);
    let [
        mut n_certain,
        mut n_special,
        mut n_wrong,
        mut n_contexts,
        mut n_left_out,
    ] = [0; 5];
    let mut time = Duration::ZERO;
    let (mut n, mut n_tried) = (0, 0);
    while n < n_views {
        n_tried += 1;
        ensure!(n_tried < 100 * n_views, "no room before a special portal");
        let Some(camera) = camera(&world, &space, &mut rng) else {
            continue;
        };
        if traced.is_in_surface(point(camera.eye)) {
            continue;
        }
        n += 1;
        let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32)?;
        let start = Instant::now();
        let seen = viewer.see(&space, ROOT, &view);
        let shot = SpaceShot {
            space: &space,
            frame: ROOT,
            camera,
            seen: Some(seen),
            style: Style {
                dark_corners: false,
                shadows: false,
                daylight: false,
                ..Style::default()
            },
            marks: &[],
            props: &[],
            lamps: None,
        };
        let (picture, counts) = studio.space_picture(&shot, SIZE)?;
        time += start.elapsed();
        n_contexts += counts.n_contexts;
        n_left_out += counts.n_left_out;
        let known = chains(&seen);
        let own = traced_camera(&camera);
        for i in 0..SIZE[0] * SIZE[1] {
            let depth = Cell::new(0);
            let is_known = |chain: &Chain| {
                depth.set(depth.get().max(chain.len()));
                known.contains(chain)
            };
            let at = [i % SIZE[0], i / SIZE[0]];
            let Some(expected) = traced.pixel(&own, at, SIZE, &is_known) else {
                continue;
            };
            n_certain += 1;
            n_special += usize::from(depth.get() > 0);
            let found = &picture.rgba[4 * i as usize..][..3];
            let differs = found.iter().zip(expected).any(|(a, b)| a.abs_diff(b) > 1);
            n_wrong += usize::from(differs);
        }
    }
    let n_pixels = n_views * (SIZE[0] * SIZE[1]) as usize;
    ensure!(
        n_special * 50 > n_pixels,
        "only {n_special} pixels show special portals"
    );
    ensure!(
        n_certain * 2 > n_pixels,
        "only {n_certain} pixels are certain"
    );
    let each = |x: usize| x as f64 / n_views as f64;
    let note = format!(
        "of {n_certain} certain pixels of {n_pixels} in {n_views} views, {n_special} of them seen in {} special portals; \
             {:.1} contexts a view, {:.1} left out, {:.1} ms in software",
        world.graph.specials.len(),
        each(n_contexts),
        each(n_left_out),
        time.as_secs_f64() * 1e3 / n_views as f64
    );
    Ok(Figure::new(n_wrong as f64, 0.0, note))
}

/// Returns a camera in the cell of a random special portal that looks about at it, often from close by.
fn camera(world: &World, space: &Space, rng: &mut Rng) -> Option<Camera> {
    let special = SpecialId(rng.below(world.graph.specials.len()) as u32);
    let cell = world.graph.specials[special.idx()].cell;
    let (normal, pieces) = world.graph.special_opening(special);
    let right = normal.cross(DVec3::Y);
    let aside = right * rng.range(-0.3, 0.3) + DVec3::Y * rng.range(-0.3, 0.3);
    let distance = [1e-5, 1e-3, 0.05, 0.3, 1.0, 2.0, 4.0][rng.below(7)];
    let spread = 1.0 + 0.7 * distance;
    let middle = pieces[0].mean();
    let eye = (middle - normal * distance + aside * spread).as_vec3();
    if space.locate(ROOT, eye.as_dvec3()) != Some(Place { part: ROOT, cell }) {
        return None;
    }
    let side = DVec3::from_array([0, 1, 2].map(|_| rng.range(-0.4, 0.4)));
    let toward = (middle - eye.as_dvec3()).normalize_or(normal) + side;
    Some(Camera {
        eye: eye.to_array(),
        toward: toward.as_vec3().to_array(),
        fov_y: rng.range(0.8, 1.6) as f32,
    })
}

fn traced_camera(camera: &Camera) -> TracedCamera {
    let tan = f64::from((camera.fov_y * 0.5).tan());
    TracedCamera {
        eye: point(camera.eye),
        axes: camera.axes().map(|a| a.as_dvec3()),
        tangents: [tan * f64::from(SIZE[0]) / f64::from(SIZE[1]), tan],
    }
}

/// Returns the chains of special portals that are looked into.
fn chains(seen: &SpaceSeen<'_>) -> HashSet<Chain> {
    let vias = seen.contexts().map(|context| context.via());
    let vias = vias.map(|via| via.map(|via| (via.parent, via.special.0, via.pass)));
    chains_of(vias).into_iter().collect()
}
