//! Casts of bodies: impacts that casts miss, compared with a test of every reachable triangle; and the number of
//! triangles tested and the time, compared with `parry3d` on one mesh of the whole world.
//!
//! Bodies are spheres, upright capsules and rotated boxes of 0.1 to 0.5 m, free at their start, anywhere in rooms.
//! They move in random directions by 5 cm to 10 m, uniform in the logarithm. Leaves of doors stand as modeled,
//! portals are open.

use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Instant;

use anyhow::{Context, ensure};
use enfilade::geom::{Aabb, DMat4, DQuat, DVec3, Triangle};
use enfilade::internals::geom::closest_point_on_triangle;
use enfilade::internals::geom::ray::segment_to_triangle_distance;
use enfilade::runtime::DetailId;
use enfilade::world::{Body, Cast, Caster, Impact, Layout, PartId, Place, Space};
use enfilade::{CellId, World};
use enfilade_testkit::oracle::box_to_triangle_distance;
use enfilade_testkit::{GridParams, Rng, room_grid, with_doors};
use parry3d::math::{Pose, Vector};
use parry3d::query::{Ray, RayCast, ShapeCastHit, ShapeCastOptions, cast_shapes};
use parry3d::shape::{Ball, Capsule, Cuboid, Shape, TriMesh};

use crate::measure::point;
use crate::rows::Figure;

const CASTS: usize = 1_000_000;
/// Largest penetration of a body that counts as free. [Units: wu]
const FREE: f64 = 1e-3;

/// Generates a world by the name of its scene.
pub(super) fn made(scene: &str) -> anyhow::Result<World> {
    let n = scene.strip_prefix("offices-").context("offices-N")?;
    let world = room_grid(&GridParams::offices(n.parse()?, 1));
    Ok(with_doors(world, |_| false))
}

const ROOT: PartId = PartId::ROOT;

/// A world prepared for casts.
struct Site {
    space: Space,
}

impl Site {
    fn new(world: &World) -> anyhow::Result<Self> {
        let mut space = Space::new(world.clone())?;
        // Most doors are shut as modeled; open half of them.
        for portal in world.graph.portal_ids().filter(|p| p.0 % 2 == 0) {
            space.open(ROOT, portal);
        }
        Ok(Self { space })
    }

    fn world(&self) -> &World {
        self.space.world(ROOT)
    }

    fn layout(&self) -> &Layout {
        self.space.layout(ROOT)
    }

    /// Returns a free body in some room, and a motion.
    fn any(&self, rng: &mut Rng, caster: &mut Caster) -> Way {
        loop {
            let kind = rng.below(10);
            let size = rng.range(0.1, 0.5);
            let body = match kind {
                0 => Body::Box {
                    half: DVec3::new(size, rng.range(0.1, 0.5), rng.range(0.1, 0.5)),
                    turn: DQuat::from_scaled_axis(DVec3::new(rng.unit(), rng.unit(), rng.unit())),
                },
                1..=5 => Body::Sphere { radius: size },
                _ => Body::upright(1.7, size.min(0.4)),
            };
            let cell = CellId(rng.below(self.layout().n_cells()) as u32);
            let shape = self.layout().cell(cell);
            let share = DVec3::new(rng.unit(), rng.unit(), rng.unit());
            let from = shape.bounds.min + shape.bounds.size() * share;
            if shape.is_outdoor || self.layout().locate(from) != Some(cell) {
                continue;
            }
            let mut is_free = true;
            let grown = grown(&body, FREE);
            let (at, place) = ((ROOT, from), Place { part: ROOT, cell });
            caster.for_each_contact(&self.space, &grown, at.0, at.1, place, |_| is_free = false);
            if !is_free {
                continue;
            }
            let direction = loop {
                let d = DVec3::from([0; 3].map(|_| rng.range(-1.0, 1.0)));
                if (0.01..1.0).contains(&d.length()) {
                    break d.normalize();
                }
            };
            let by = direction * 0.05 * 200_f64.powf(rng.unit());
            return Way {
                body,
                from,
                by,
                cell,
            };
        }
    }

    fn cast(&self, caster: &mut Caster, way: &Way) -> Option<Impact> {
        let cast = Cast {
            body: &way.body,
            frame: ROOT,
            from: way.from,
            by: way.by,
            place: Place {
                part: ROOT,
                cell: way.cell,
            },
        };
        caster.cast(&self.space, &cast)
    }

    fn ways(&self, n: usize) -> Vec<Way> {
        let (mut rng, mut caster) = (Rng::new(7), Caster::new());
        (0..n).map(|_| self.any(&mut rng, &mut caster)).collect()
    }

    /// Returns the triangles of an object in the world.
    fn of_detail(&self, id: DetailId) -> impl Iterator<Item = Triangle> + '_ {
        let object = &self.world()[id];
        let pose = self.space.state(ROOT).pose(id).unwrap_or(DMat4::IDENTITY);
        let place = pose * object.placement();
        let primitives = &self.world().detail_meshes[object.mesh as usize].primitives;
        primitives.iter().flat_map(move |p| {
            let at = move |i: u32| place.transform_point3(point(p.positions[i as usize]));
            let corners = p.indices.chunks_exact(3);
            corners.map(move |t| [at(t[0]), at(t[1]), at(t[2])])
        })
    }

    /// Returns all triangles of the world, each once.
    fn mesh(&self) -> anyhow::Result<TriMesh> {
        let mut all: Vec<Triangle> = Vec::new();
        for batch in self.world().batches.iter().filter(|b| !b.cells.is_empty()) {
            let at = |i: u32| point(batch.primitive.positions[i as usize]);
            let corners = batch.primitive.indices.chunks_exact(3);
            all.extend(corners.map(|t| [at(t[0]), at(t[1]), at(t[2])]));
        }
        for id in (0..self.world().details.len() as u32).map(DetailId) {
            all.extend(self.of_detail(id));
        }
        let indices = (0..all.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        let corners = all.iter().flatten().map(|p| vector(*p)).collect();
        Ok(TriMesh::new(corners, indices.collect())?)
    }
}

struct Way {
    body: Body,
    from: DVec3,
    by: DVec3,
    cell: CellId,
}

fn vector(p: DVec3) -> Vector {
    Vector::new(p.x as f32, p.y as f32, p.z as f32)
}

fn grown(body: &Body, margin: f64) -> Body {
    let mut grown = *body;
    match &mut grown {
        Body::Sphere { radius } | Body::Capsule { radius, .. } => {
            *radius = (*radius + margin).max(0.0);
        }
        Body::Box { half, .. } => *half = (*half + margin).max(DVec3::ZERO),
    }
    grown
}

/// Obstacles and openings of each cell with their boxes, for exhaustive tests.
struct Brute {
    obstacles: Vec<Vec<(Aabb, Triangle)>>,
    openings: Vec<Vec<(CellId, Aabb, Triangle)>>,
}

impl Brute {
    fn new(site: &Site) -> Self {
        let world = site.world();
        let n_cells = world.graph.cells.len();
        let mut obstacles = vec![Vec::new(); n_cells];
        let mut openings = vec![Vec::new(); n_cells];
        let boxed = |t: Triangle| (Aabb::of_points(&t), t);
        for batch in &world.batches {
            let at = |i: u32| point(batch.primitive.positions[i as usize]);
            for t in batch.primitive.indices.chunks_exact(3) {
                for cell in &batch.cells {
                    obstacles[cell.idx()].push(boxed([at(t[0]), at(t[1]), at(t[2])]));
                }
            }
        }
        for id in (0..world.details.len() as u32).map(DetailId) {
            for cell in site.space.sight(ROOT).cells_of_detail(world, id) {
                obstacles[cell.idx()].extend(site.of_detail(id).map(boxed));
            }
        }
        for cell in world.graph.cell_ids() {
            for exit in world.graph.exits(cell) {
                for piece in &exit.portal.pieces {
                    for k in 2..piece.len() {
                        let (b, t) = boxed([0, k - 1, k].map(|i| point(piece[i])));
                        openings[cell.idx()].push((exit.to, b, t));
                    }
                }
            }
        }
        Self {
            obstacles,
            openings,
        }
    }

    /// Returns `true` if a body penetrates some reachable triangle by more than `margin` on its way before `until`.
    fn touches_before(&self, way: &Way, until: f64, margin: f64) -> bool {
        let body = grown(&way.body, -margin);
        let mut since: Vec<(CellId, f64)> = vec![(way.cell, 0.0)];
        let mut done: Vec<CellId> = Vec::new();
        while let Some(i) = (0..since.len()).min_by(|&a, &b| since[a].1.total_cmp(&since[b].1)) {
            let (cell, reached) = since.swap_remove(i);
            if done.contains(&cell) {
                continue;
            }
            done.push(cell);
            let times = [reached, until];
            let (a, b) = (
                body.bounds(way.from + way.by * reached),
                body.bounds(way.from + way.by * until),
            );
            let swept = a.union(b);
            for (to, bounds, t) in &self.openings[cell.idx()] {
                if swept.overlaps(bounds) && !done.contains(to) {
                    let at = first_touch(&body, way, times, t);
                    since.extend(at.map(|at| (*to, at)));
                }
            }
            for (bounds, t) in &self.obstacles[cell.idx()] {
                if swept.overlaps(bounds) && first_touch(&body, way, times, t).is_some() {
                    return true;
                }
            }
        }
        false
    }
}

/// Returns the distance of a body from a triangle; at most 0 if it touches.
fn gap(body: &Body, at: DVec3, t: &Triangle) -> f64 {
    match *body {
        Body::Sphere { radius } => closest_point_on_triangle(at, t).distance(at) - radius,
        Body::Capsule { half, radius } => {
            segment_to_triangle_distance(at - half, at + half, t) - radius
        }
        Body::Box { half, turn } => box_to_triangle_distance(half, turn, at, t),
    }
}

/// Returns the first time in a range at which a body touches a triangle. Its gap is a convex function of time, so
/// golden sections find the minimum, and bisection the first zero before it.
fn first_touch(body: &Body, way: &Way, times: [f64; 2], t: &Triangle) -> Option<f64> {
    let gap_at = |s: f64| gap(body, way.from + way.by * s, t);
    let [since, until] = times;
    let (mut low, mut high) = (since, until);
    if gap_at(low) <= 0.0 {
        return Some(low);
    }
    let end = gap_at(high);
    // Still approaching at the end without touching, or receding from the start.
    let step = (high - low) * 1e-6;
    if end > 0.0 && (gap_at(high - step) > end || gap_at(low + step) > gap_at(low)) {
        return None;
    }
    while end > 0.0 && high - low > 1e-12 {
        let (x, y) = (low + (high - low) * 0.382, low + (high - low) * 0.618);
        let (gx, gy) = (gap_at(x), gap_at(y));
        if gx <= 0.0 {
            high = x;
            break;
        }
        if gy > gx {
            high = y;
        } else {
            low = x;
        }
    }
    if gap_at(high) > 0.0 {
        return None;
    }
    let (mut before, mut after) = (since, high);
    for _ in 0..45 {
        let middle = 0.5 * (before + after);
        if gap_at(middle) <= 0.0 {
            after = middle;
        } else {
            before = middle;
        }
    }
    Some(after)
}

/// Counts casts that miss an impact of the exhaustive test, or report it late.
pub(super) fn missed(world: &World) -> anyhow::Result<Figure> {
    let site = &Site::new(world)?;
    let brute = &Brute::new(site);
    let counts = [const { AtomicU64::new(0) }; 3];
    let [n_missed, n_impacts, n_empty] = &counts;
    let n_threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for thread in 0..n_threads {
            scope.spawn(move || {
                let mut rng = Rng::stream(11, thread as u64);
                let mut caster = Caster::new();
                for _ in (thread..CASTS).step_by(n_threads) {
                    let way = site.any(&mut rng, &mut caster);
                    let impact = site.cast(&mut caster, &way);
                    let t = impact.map_or(1.0, |i| i.t);
                    // Deeper than a micrometer, or than the layout's tolerance.
                    let margin = 1e-6_f64.max(site.layout().tolerance());
                    let is_missed = brute.touches_before(&way, t, margin);
                    n_missed.fetch_add(u64::from(is_missed), Ordering::Relaxed);
                    n_impacts.fetch_add(u64::from(impact.is_some()), Ordering::Relaxed);
                    // The reported impact must touch something.
                    let at = way.from + way.by * t;
                    let is_off = impact.is_some_and(|i| {
                        let cell = brute.obstacles[i.place.cell.idx()].iter();
                        let near = grown(&way.body, margin);
                        let mine = near.bounds(at);
                        let mut met = cell.filter(|(b, _)| b.overlaps(&mine));
                        !met.any(|(_, t)| gap(&near, at, t) <= 0.0)
                    });
                    n_empty.fetch_add(u64::from(is_off), Ordering::Relaxed);
                }
            });
        }
    });
    let [n_missed, n_impacts, n_empty] = counts.map(AtomicU64::into_inner);
    let note = format!(
        "of {CASTS} casts, {n_impacts} of them with an impact; {n_empty} impacts with nothing"
    );
    Ok(Figure::new((n_missed + n_empty) as f64, 0.0, note))
}

/// Converts a body for the peer.
fn peer(body: &Body) -> (Box<dyn Shape>, Pose) {
    match *body {
        Body::Sphere { radius } => (Box::new(Ball::new(radius as f32)), Pose::IDENTITY),
        Body::Capsule { half, radius } => {
            let half = vector(half);
            (
                Box::new(Capsule::new(-half, half, radius as f32)),
                Pose::IDENTITY,
            )
        }
        Body::Box { half, turn } => {
            let mut pose = Pose::IDENTITY;
            let turn = [turn.x, turn.y, turn.z, turn.w].map(|x| x as f32);
            pose.rotation = parry3d::math::Rotation::from_array(turn);
            (Box::new(Cuboid::new(vector(half))), pose)
        }
    }
}

fn options() -> ShapeCastOptions {
    ShapeCastOptions::with_max_time_of_impact(1.0)
}

fn peer_pose(way: &Way, own: Pose) -> Pose {
    Pose {
        translation: vector(way.from),
        ..own
    }
}

/// Counts the triangles that the peer tests in a cast on a mesh.
fn peer_candidates(mesh: &TriMesh, way: &Way) -> u64 {
    let (shape, own) = peer(&way.body);
    let (pose, by) = (peer_pose(way, own), vector(way.by));
    let bounds = shape.compute_aabb(&pose);
    let ray = Ray::new(Vector::ZERO, by);
    let n = Cell::new(0);
    let _ = mesh.bvh().find_best(
        1.0,
        |node, best| {
            let sum = parry3d::bounding_volume::Aabb {
                mins: node.mins() - bounds.center() - bounds.half_extents(),
                maxs: node.maxs() - bounds.center() + bounds.half_extents(),
            };
            sum.cast_local_ray(&ray, best, true).unwrap_or(f32::MAX)
        },
        |i, _| -> Option<ShapeCastHit> {
            n.set(n.get() + 1);
            let triangle = mesh.triangle(i);
            let still = (Pose::IDENTITY, Vector::ZERO);
            cast_shapes(&still.0, still.1, &triangle, &pose, by, &*shape, options()).ok()?
        },
    );
    n.get()
}

/// Compares the triangles that casts test with those of the peer.
pub(super) fn candidates(world: &World) -> anyhow::Result<Figure> {
    let site = Site::new(world)?;
    let mesh = site.mesh()?;
    let mut caster = Caster::new();
    let (mut own, mut openings, mut others, mut cells) = (0, 0, 0, 0);
    for way in site.ways(CASTS) {
        let _ = site.cast(&mut caster, &way);
        own += u64::from(caster.counts().triangles);
        openings += u64::from(caster.counts().openings);
        cells += u64::from(caster.counts().cells);
        others += peer_candidates(&mesh, &way);
    }
    let each = |n: u64| n as f64 / CASTS as f64;
    let value = (own + openings) as f64 / others as f64;
    let note = format!(
        "{:.3} triangles of obstacles and {:.3} of openings tried a cast, in {:.2} cells, to {:.3} of parry3d's in {} of the whole mesh",
        each(own),
        each(openings),
        each(cells),
        each(others),
        mesh.num_triangles(),
    );
    Ok(Figure::new(value, 0.999, note))
}

/// Compares the time of casts with that of the peer.
pub(super) fn time(world: &World) -> anyhow::Result<Figure> {
    let site = Site::new(world)?;
    let mesh = site.mesh()?;
    let ways = site.ways(CASTS);
    let peers: Vec<_> = ways.iter().map(|w| peer(&w.body)).collect();
    let mut caster = Caster::new();
    let mut best = [f64::INFINITY; 2];
    let (mut late, mut impacts) = (0, 0);
    for round in 0..2 {
        let start = Instant::now();
        let own: Vec<f64> = ways
            .iter()
            .map(|w| site.cast(&mut caster, w).map_or(1.0, |i| i.t))
            .collect();
        best[0] = best[0].min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        let theirs: Vec<f64> = ways
            .iter()
            .zip(&peers)
            .map(|(w, (shape, pose))| {
                let (pose, by) = (peer_pose(w, *pose), vector(w.by));
                let still = (Pose::IDENTITY, Vector::ZERO);
                let hit = cast_shapes(&still.0, still.1, &mesh, &pose, by, &**shape, options());
                let hit = hit.ok().flatten();
                hit.map_or(1.0, |h| f64::from(h.time_of_impact))
            })
            .collect();
        best[1] = best[1].min(start.elapsed().as_secs_f64());
        if round == 0 {
            impacts = own.iter().filter(|t| **t < 1.0).count();
            let pairs = own.iter().zip(&theirs).zip(&ways);
            let is_late = |((a, b), w): &((&f64, &f64), &Way)| (*b - *a) * w.by.length() > 1e-3;
            late = pairs.filter(is_late).count();
        }
    }
    ensure!(impacts > 0, "casts meet nothing");
    let each = best.map(|s| s / CASTS as f64 * 1e9);
    let note = format!(
        "{:.0} ns a cast to {:.0} of parry3d's, which passes through something by more than 1 mm in {late} of {impacts} impacts",
        each[0], each[1]
    );
    Ok(Figure::new(each[0] / each[1], 1.0, note))
}
