//! Viewpoints: found automatically, or on a walk.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{Cell, CellId, DetailObject, PortalId, World};
use enfilade_geom::DVec3;
use enfilade_runtime::{DetailId, Sight, Sightlines};
use enfilade_world::{PartId, Space};

use crate::camera::Camera;
use crate::frame::Style;
use crate::gpu::RenderError;
use crate::ids::PixelContent;
use crate::studio::{Culling, Studio};

/// Height of an eye above the floor. [Units: wu]
pub const EYE_HEIGHT: f32 = 1.6;

/// Angle from the lower to the upper edge of what one sees on a walk. [Units: rad]
pub const FOV: f32 = 1.1;

/// Default angle of a picture from its lower to its upper edge: 70° from side to side at 16:9, as wide as photographs of
/// rooms are before their edges look stretched. [Units: rad]
pub const PHOTO_FOV: f32 = 0.75;

fn center(cell: &Cell) -> [f32; 3] {
    [0, 1, 2].map(|k| (cell.aabb[0][k] + cell.aabb[1][k]) * 0.5)
}

/// The eye of a person who stands below `p`.
fn standing(lines: &Sightlines, p: [f32; 3]) -> Option<[f32; 3]> {
    let hit = lines.first_hit(p, [p[0], p[1] - 100.0, p[2]])?;
    let floor = p[1] - 100.0 * hit.t as f32;
    Some([p[0], floor + EYE_HEIGHT, p[2]])
}

/// Most rooms that a photographer looks into.
const ROOMS: usize = 8;
/// Least distance of a photographer from walls. [Units: wu]
const ELBOW: f32 = 0.3;
/// Size of the pictures by which views are compared. [Units: px]
const SMALL: [u32; 2] = [48, 27];
/// Directions probed for the longest view.
const HEADINGS: usize = 24;

/// Finds the place a photographer would choose: where two walls of a large, preferably furnished, room meet, at eye
/// height, along one of the longest views or towards what stands in the room. Among these, takes the place whose picture
/// shows most objects and openings, far away and whole, with nothing right before it. For a world without rooms, shows all
/// of it from outside. Draws some 200 small pictures.
///
/// # Errors
///
/// If a picture cannot be drawn.
pub fn good_camera(studio: &mut Studio, world: &World) -> Result<Camera, RenderError> {
    let lines = Sightlines::build(world);
    let mut best = (f32::NEG_INFINITY, overview(studio));
    for (id, cell, worth) in rooms(&studio.sight, world) {
        let objects = objects_in(&studio.sight, world, id);
        for eye in corners(&studio.sight, &lines, id, cell) {
            for toward in headings(&lines, cell, eye, &objects) {
                let camera = Camera {
                    eye,
                    toward,
                    fov_y: PHOTO_FOV,
                };
                let score = interest(studio, world, &camera)? + 0.5 * worth.ln_1p();
                if score > best.0 {
                    best = (score, camera);
                }
            }
        }
    }
    Ok(best.1)
}

/// Returns the details other than door leaves.
fn furniture<'a>(sight: &'a Sight, world: &'a World) -> impl Iterator<Item = &'a DetailObject> {
    let is_leaf = |k: u32| sight.portals_of(DetailId(k)).next().is_some();
    let numbered = (0..).zip(&world.details);
    numbered.filter(move |(k, _)| !is_leaf(*k)).map(|(_, d)| d)
}

/// The centers of the objects that stand in a room.
fn objects_in(sight: &Sight, world: &World, id: CellId) -> Vec<[f32; 3]> {
    let here = furniture(sight, world).filter(|d| d.cells.contains(&id));
    here.map(|d| [d.transform[12], d.transform[13], d.transform[14]])
        .filter(|&p| sight.locate([p[0], p[1] + 0.3, p[2]]) == Some(id))
        .collect()
}

/// The rooms with the most floor, with their worth: floor area, increased by each object.
fn rooms<'w>(sight: &Sight, world: &'w World) -> Vec<(CellId, &'w Cell, f32)> {
    let mut objects = vec![0_u32; world.graph.cells.len()];
    for cell in furniture(sight, world).flat_map(|d| &d.cells) {
        objects[cell.idx()] += 1;
    }
    let worth = |id: CellId, cell: &Cell| {
        let height = (cell.aabb[1][1] - cell.aabb[0][1]).clamp(2.0, 4.0);
        let floor = cell.volume / height;
        // Beyond this size, a larger hall is not better.
        floor.min(150.0) * (1.0 + (objects[id.idx()] as f32).ln_1p())
    };
    let mut out: Vec<_> = (world.graph.rooms())
        .filter(|(_, cell)| cell.volume > 0.0)
        .map(|(id, cell)| (id, cell, worth(id, cell)))
        .collect();
    out.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
    out.truncate(ROOMS);
    out
}

/// Eyes of a person in a room: where two walls meet, and in the middle.
fn corners(sight: &Sight, lines: &Sightlines, id: CellId, cell: &Cell) -> Vec<[f32; 3]> {
    let [low, high] = cell.aabb;
    let middle = center(cell);
    let is_clear = |eye: [f32; 3]| {
        (0..8).all(|i| {
            let (z, x) = (i as f32 * std::f32::consts::FRAC_PI_4).sin_cos();
            let arm = [eye[0] + x * ELBOW, eye[1], eye[2] + z * ELBOW];
            lines.first_hit(eye, arm).is_none()
        })
    };
    let stand = |p: [f32; 3]| {
        let is_here = |e: &[f32; 3]| sight.locate(*e) == Some(id);
        if !is_here(&p) {
            return None;
        }
        // At half the height of the cell if it is lower than a person or has no floor.
        Some(standing(lines, p).filter(is_here).unwrap_or(p))
    };
    let mut out: Vec<[f32; 3]> = Vec::new();
    for [u, v] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
        let corner = [[low[0], high[0]][u], middle[1], [low[2], high[2]][v]];
        // On the way from the walls to the middle, the first place with elbow room.
        let place = (1..=10).find_map(|step| {
            let t = step as f32 * 0.05;
            let p = [0, 1, 2].map(|k| corner[k] + (middle[k] - corner[k]) * t);
            stand(p).filter(|&eye| is_clear(eye))
        });
        out.extend(place);
    }
    out.extend(stand(middle));
    out
}

/// Directions worth a picture: across the room, along the longest view, between the two, and towards the middle of the
/// objects; slightly downwards.
fn headings(lines: &Sightlines, cell: &Cell, eye: [f32; 3], objects: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let angle = |i: usize| i as f32 * std::f32::consts::TAU / HEADINGS as f32;
    let free: Vec<f32> = (0..HEADINGS)
        .map(|i| {
            let (z, x) = angle(i).sin_cos();
            let end = [eye[0] + x * 40.0, eye[1], eye[2] + z * 40.0];
            lines
                .first_hit(eye, end)
                .map_or(40.0, |h| h.t as f32 * 40.0)
        })
        .collect();
    // A view counts with its neighbors on both sides.
    let open = |i: usize| {
        let at = |d: usize| free[(i + HEADINGS + d - 2) % HEADINGS];
        (0..5).map(at).sum::<f32>()
    };
    let mut longest = 0;
    for i in 1..HEADINGS {
        if open(i) > open(longest) + 1e-3 {
            longest = i;
        }
    }
    let (z, x) = angle(longest).sin_cos();
    let along = [x, z];
    let to = center(cell);
    let across = [to[0] - eye[0], to[2] - eye[2]];
    let length = across[0].hypot(across[1]);
    let level = |[x, z]: [f32; 2]| [x, -0.12, z];
    let mut out = vec![level(along)];
    let mut middle = [0.0; 2];
    for p in objects {
        // Near ones spread over many directions.
        let to = [p[0] - eye[0], p[2] - eye[2]];
        let length = to[0].hypot(to[1]).max(1.0);
        middle = [0, 1].map(|k| middle[k] + to[k] / length);
    }
    let reach = middle[0].hypot(middle[1]);
    if reach > 0.1 {
        out.push(level(middle.map(|d| d / reach)));
    }
    // In the middle of a room, no direction leads across it.
    if length > 0.5 {
        let across = across.map(|d| d / length);
        out.push(level(across));
        let between = [along[0] + across[0], along[1] + across[1]];
        let length = between[0].hypot(between[1]);
        if length > 0.3 {
            out.push(level(between.map(|d| d / length)));
        }
    }
    out
}

/// The whole world, obliquely from above.
fn overview(studio: &Studio) -> Camera {
    let [low, high] = studio.world.bounds();
    let center = [0, 1, 2].map(|k| (low[k] + high[k]) * 0.5);
    let size = [0, 1, 2].map(|k| high[k] - low[k]);
    let radius = (size[0] * size[0] + size[1] * size[1] + size[2] * size[2]).sqrt() * 0.5;
    // The ball around the world fills the picture from edge to edge.
    let distance = radius / (0.5 * PHOTO_FOV).sin();
    let back = [0.55, 0.45, 0.70].map(|d| d * distance);
    Camera {
        fov_y: PHOTO_FOV,
        ..Camera::looking_at([0, 1, 2].map(|k| center[k] + back[k]), center)
    }
}

/// The interest of a picture: objects above all, openings of the room, depth; less if something is right before the
/// eye.
fn interest(studio: &mut Studio, world: &World, camera: &Camera) -> Result<f32, RenderError> {
    let [solid, _] = studio.ids(camera, Culling::Portals, SMALL)?;
    let (mut walls, mut objects) = (Vec::new(), Vec::new());
    let mut shut = BTreeSet::new();
    let (mut near, mut sky, mut cropped, mut depths) = (0_u32, 0_u32, 0_u32, Vec::new());
    for (i, (shown, depth)) in (0_u32..).zip(&solid.pixels) {
        let [x, y] = [i % SMALL[0], i / SMALL[0]];
        let is_edge = x == 0 || y == 0 || x + 1 == SMALL[0] || y + 1 == SMALL[1];
        let leaf_of = match *shown {
            PixelContent::Plug { portal } => Some(portal),
            PixelContent::Detail { detail, .. } => studio.sight.portals_of(DetailId(detail)).next(),
            _ => None,
        };
        let is_object = matches!(shown, PixelContent::Detail { .. }) && leaf_of.is_none();
        cropped += u32::from(is_edge && is_object);
        match *shown {
            PixelContent::Sky => sky += 1,
            PixelContent::Structure { triangle } => {
                let chunk = studio.world.chunk_of_triangle(triangle);
                walls.push(chunk.and_then(|c| studio.world.batch_of_chunk(c)));
            }
            // A shut door is as dull as a wall.
            _ if leaf_of.is_some() => {
                walls.push(None);
                shut.extend(leaf_of);
            }
            PixelContent::Detail { detail, .. } => objects.push(detail),
            PixelContent::Plug { .. } => {}
        }
        if *depth > 0.0 {
            let distance = Camera::distance_of(*depth);
            near += u32::from(distance < 1.5);
            depths.push(distance.min(30.0).ln_1p());
        }
    }
    walls.sort_unstable();
    walls.dedup();
    let furnished = objects.len() as u32;
    objects.sort_unstable();
    objects.dedup();
    // Deep on the whole, without a wall that fills one side.
    depths.sort_unstable_by(f32::total_cmp);
    let quarter = depths.get(depths.len() / 4).copied().unwrap_or_default();
    let view = camera.view(SMALL[0] as f32 / SMALL[1] as f32)?;
    let seen = studio.viewer.see(&studio.sight, &studio.state, &view);
    // Openings of a few pixels are not visible as such.
    let is_wide = |r: [f32; 4]| (r[2] - r[0]) * (r[3] - r[1]) > 0.01;
    let mut reached: BTreeSet<CellId> = BTreeSet::new();
    let mut openings = 0;
    for visit in seen.visits() {
        // Rooms behind a shut door are not in the picture, though a portal leads to them.
        let is_open = visit.via.is_none_or(|via| {
            let from = world.graph[via]
                .cells
                .into_iter()
                .find(|&c| c != visit.cell);
            !shut.contains(&via) && from.is_some_and(|from| reached.contains(&from))
        });
        if is_open {
            reached.insert(visit.cell);
            openings += usize::from(visit.via.is_some() && is_wide(visit.rectangle));
        }
    }
    let n = (SMALL[0] * SMALL[1]) as f32;
    let share = |count: u32| count as f32 / n;
    Ok(1.2 * (objects.len() as f32).ln_1p()
        + 0.4 * (walls.len() as f32).ln_1p()
        + 0.35 * (openings.min(8) as f32)
        + 1.5 * depths.iter().sum::<f32>() / n
        + 1.5 * quarter
        + 2.0 * share(furnished).min(0.4)
        + 10.0 * contrast(studio, camera)?
        - 5.0 * share(near)
        - 8.0 * (largest_wall(camera, &solid.pixels) - 0.2).max(0.0)
        - 2.5 * (cropped as f32 / (2 * (SMALL[0] + SMALL[1])) as f32)
        - share(sky))
}

/// Returns the standard deviation of a picture's brightness: greater where the sun shines in. 0 if the studio's pictures cannot be
/// read. [0, 0.5]
fn contrast(studio: &mut Studio, camera: &Camera) -> Result<f32, RenderError> {
    let style = Style {
        dark_corners: false,
        ..Style::default()
    };
    if !studio.renderer.can_be_read() {
        return Ok(0.0);
    }
    let picture = studio.picture(camera, Culling::Portals, style, &[], SMALL)?;
    let brightness = |p: &[u8]| {
        let [r, g, b] = [0, 1, 2].map(|k| f32::from(p[k]) / 255.0);
        0.3 * r + 0.59 * g + 0.11 * b
    };
    let values: Vec<f32> = picture.rgba.chunks_exact(4).map(brightness).collect();
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    let off = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>();
    Ok((off / values.len() as f32).sqrt())
}

/// Returns the share of a picture that its largest flat upright surface fills.
fn largest_wall(camera: &Camera, pixels: &[(PixelContent, f32)]) -> f32 {
    let [width, height] = SMALL.map(|n| n as usize);
    let [right, up, forward] = camera.axes();
    let tan = (camera.fov_y * 0.5).tan();
    let point = |x: usize, y: usize| {
        let depth = pixels[x + y * width].1;
        let across = (x as f32 + 0.5 - 0.5 * width as f32) * 2.0 / height as f32;
        let above = 1.0 - (y as f32 + 0.5) * 2.0 / height as f32;
        let ray = forward + right * (across * tan) + up * (above * tan);
        (depth > 0.0).then(|| ray * Camera::distance_of(depth))
    };
    let mut walls: BTreeMap<[i32; 3], u32> = BTreeMap::new();
    for (x, y) in (0..height - 1).flat_map(|y| (0..width - 1).map(move |x| (x, y))) {
        let (Some(p), Some(q), Some(r)) = (point(x, y), point(x + 1, y), point(x, y + 1)) else {
            continue;
        };
        let normal = (r - p).cross(q - p).normalize_or_zero();
        if normal.y.abs() < 0.3 {
            // Alike within a few degrees and half a meter.
            let key = [normal.x * 8.0, normal.z * 8.0, normal.dot(p) * 2.0];
            *walls.entry(key.map(|n| n.round() as i32)).or_default() += 1;
        }
    }
    walls.into_values().max().unwrap_or(0) as f32 / pixels.len() as f32
}

/// A walk through the doorways of a world, one view per meter: points, each with the direction of walking.
/// [Units: wu]
#[must_use]
pub fn walk(world: &World, sight: &Sight, views: usize) -> Vec<([f32; 3], [f32; 3])> {
    let mut stops = Vec::new();
    let graph = &world.graph;
    let mut been = vec![0_u32; graph.cells.len()];
    // A closed pocket may come first.
    let goes_on = |c: &CellId| graph.exits(*c).any(|exit| graph[exit.to].is_room());
    let mut rooms = graph.rooms().map(|(c, _)| c);
    let Some(first) = rooms.clone().find(goes_on).or_else(|| rooms.next()) else {
        return Vec::new();
    };
    let (mut cell, mut came_by) = (first, None);
    stops.push(center(&graph[cell]));
    // Always go to the least visited neighbor, through the first such portal.
    while stops.len() < 2 * views {
        been[cell.idx()] += 1;
        let next = graph
            .exits(cell)
            .filter(|exit| graph[exit.to].is_room())
            .min_by_key(|exit| (been[exit.to.idx()], Some(exit.id) == came_by, exit.id));
        let Some(exit) = next else { break };
        stops.push(exit.portal.center());
        stops.push(center(&graph[exit.to]));
        (cell, came_by) = (exit.to, Some(exit.id));
    }
    // One view per meter.
    let mut out = Vec::new();
    for pair in stops.windows(2) {
        let d = [0, 1, 2].map(|k| pair[1][k] - pair[0][k]);
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let n = (length.ceil() as usize).max(1);
        for i in 0..n {
            let t = i as f32 / n as f32;
            let at = [0, 1, 2].map(|k| pair[0][k] + d[k] * t);
            if length > 0.0 && sight.locate(at).is_some() && out.len() < views {
                out.push((at, [d[0], 0.0, d[2]]));
            }
        }
    }
    out
}

/// The cameras of a [`walk`], at eye height where there is a floor; `fov_y` in radians.
#[must_use]
pub fn walk_cameras(world: &World, sight: &Sight, views: usize, fov_y: f32) -> Vec<Camera> {
    let lines = Sightlines::build(world);
    let mut last = [1.0, 0.0, 0.0];
    walk(world, sight, views)
        .into_iter()
        .map(|(p, toward)| {
            // A vertical direction has no heading: keep the last one.
            if toward[0].hypot(toward[2]) > 1e-3 {
                last = toward;
            }
            let eye = standing(&lines, p).filter(|&e| sight.locate(e).is_some());
            Camera {
                eye: eye.unwrap_or(p),
                toward: last,
                fov_y,
            }
        })
        .collect()
}

/// The openable portal of any part nearest to the center of a camera's view, with its distance. The camera is in the frame of the
/// root. [Units: wu] Time grows with the portals of parts on the way.
#[must_use]
pub fn portal_looked_at(space: &Space, camera: &Camera) -> Option<(PartId, PortalId, f32)> {
    const FAR: f64 = 30.0;
    let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let (eye, forward) = (
        vector(camera.eye),
        vector(camera.toward).normalize_or_zero(),
    );
    let ends = [eye, eye + forward * FAR];
    let wall = space.first_wall(PartId::ROOT, ends).unwrap_or(1.0) * FAR;
    let mut best: Option<(PartId, PortalId, f64)> = None;
    for part in space.parts_along(PartId::ROOT, ends) {
        let pose = space.pose(part);
        let (eye, forward) = (pose.point_back(eye), pose.inverse().direction(forward));
        for (i, portal) in (0..).zip(&space.world(part).graph.portals) {
            let normal = vector(portal.normal);
            let facing = normal.dot(forward);
            let t = normal.dot(vector(portal.outline[0]) - eye) / facing;
            let is_near = t > 0.0 && t <= wall + 0.05 && best.is_none_or(|b| t < b.2);
            if facing.abs() < 1e-6 || !is_near {
                continue;
            }
            let p = eye + forward * t;
            let next = portal.outline.iter().cycle().skip(1);
            let mut sides = portal.outline.iter().zip(next).map(|(a, b)| {
                let (a, b) = (vector(*a), vector(*b));
                normal.dot((b - a).cross(p - a))
            });
            if sides.all(|side| side >= 0.0) {
                best = Some((part, PortalId(i), t));
            }
        }
    }
    best.map(|(part, portal, t)| (part, portal, t as f32))
}
