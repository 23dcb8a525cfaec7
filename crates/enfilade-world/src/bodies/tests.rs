//! Covers W12: casts and contacts against trying every triangle, by distances that share no code with the kernels.

use std::cell::RefCell;

use enfilade_cpg::{CellId, DetailObject, PortalId, World};
use enfilade_geom::ray::segment_to_triangle_distance;
use enfilade_geom::scene::{Mesh, Primitive};
use enfilade_geom::{Aabb, DMat4, DQuat, DVec3, Triangle, closest_point_on_triangle};
use enfilade_runtime::{DetailId, Sightlines, Target};
use enfilade_testkit::oracle::box_to_triangle_distance;
use enfilade_testkit::{GridParams, Rng, room_grid, with_doors};

use super::{Body, Cast, Caster, Contact, Impact};
use crate::layout::Layout;
use crate::space::{PartId, Place, Space};

/// A world without moving parts, and a caster in it.
struct Site {
    space: Space,
    caster: RefCell<Caster>,
}

const ROOT: PartId = PartId::ROOT;

impl Site {
    fn new(world: World) -> Self {
        Self {
            space: Space::new(world).unwrap(),
            caster: RefCell::new(Caster::new()),
        }
    }

    fn world(&self) -> &World {
        self.space.world(ROOT)
    }

    fn layout(&self) -> &Layout {
        self.space.layout(ROOT)
    }

    fn cells(&self) -> Vec<CellId> {
        let caster = self.caster.borrow();
        caster.places().iter().map(|p| p.cell).collect()
    }

    fn place(&self, p: DVec3) -> Place {
        self.space.locate(ROOT, p).unwrap()
    }

    fn cast(&self, body: &Body, from: DVec3, by: DVec3) -> Option<Impact> {
        let cast = Cast {
            body,
            frame: ROOT,
            from,
            by,
            place: self.place(from),
        };
        self.caster.borrow_mut().cast(&self.space, &cast)
    }

    fn touched(&self, body: &Body, at: DVec3) -> Vec<Contact> {
        let mut all = Vec::new();
        let mut caster = self.caster.borrow_mut();
        caster.for_each_contact(&self.space, body, ROOT, at, self.place(at), |c| {
            all.push(*c);
        });
        all
    }

    /// Returns all obstacles of a cell in world space.
    fn obstacles(&self, cell: CellId) -> Vec<Triangle> {
        let mut all = Vec::new();
        for batch in self.world().batches_of(cell) {
            let corners = batch.primitive.indices.chunks_exact(3);
            let at = |i: u32| point(batch.primitive.positions[i as usize]);
            all.extend(corners.map(|t| [at(t[0]), at(t[1]), at(t[2])]));
        }
        for (id, object) in (0..).map(DetailId).zip(&self.world().details) {
            if !(self.space.sight(ROOT).cells_of_detail(self.world(), id)).contains(&cell) {
                continue;
            }
            let pose = self.space.state(ROOT).pose(id).unwrap_or(DMat4::IDENTITY);
            let place = pose * object.placement();
            for p in &self.world().detail_meshes[object.mesh as usize].primitives {
                let at = |i: u32| place.transform_point3(point(p.positions[i as usize]));
                let corners = p.indices.chunks_exact(3);
                all.extend(corners.map(|t| [at(t[0]), at(t[1]), at(t[2])]));
            }
        }
        for exit in self.world().graph.exits(cell) {
            if !self.space.state(ROOT).is_open(exit.id) {
                let off = f64::from(self.space.sight(ROOT).depth_of_leaves(exit.id));
                let off = point(exit.portal.normal).normalize() * off;
                all.extend(self.opening(exit.id).map(|t| t.map(|p| p + off)));
            }
        }
        all
    }

    fn opening(&self, portal: PortalId) -> impl Iterator<Item = Triangle> + '_ {
        let pieces = self.world().graph[portal].pieces.iter();
        pieces
            .flat_map(|piece| (2..piece.len()).map(move |k| [0, k - 1, k].map(|i| point(piece[i]))))
    }

    /// Brute force: the first impact of a body on any triangle of the cells in the order in which it reaches them, and the time
    /// at which it reaches each cell.
    fn brute(&self, body: &Body, margin: f64, from: DVec3, by: DVec3) -> (Option<f64>, Vec<f64>) {
        let grown = |margin: f64| body.grown(margin);
        let n_cells = self.world().graph.cells.len();
        let mut since = vec![f64::INFINITY; n_cells];
        let mut is_done = vec![false; n_cells];
        since[self.layout().locate(from).unwrap().idx()] = 0.0;
        let mut first = f64::INFINITY;
        loop {
            let waiting = (0..n_cells).filter(|&c| !is_done[c] && since[c] <= first.min(1.0));
            let next = waiting.min_by(|&a, &b| since[a].total_cmp(&since[b]));
            let Some(c) = next else { break };
            is_done[c] = true;
            let cell = CellId(c as u32);
            let reach = since[c];
            for exit in self.world().graph.exits(cell) {
                // Openings are grown by the layout's tolerance: a lower bound for impacts that must happen, an upper bound for
                // others.
                let more = if margin > 0.0 {
                    self.layout().tolerance() + margin
                } else {
                    margin
                };
                for t in self.opening(exit.id) {
                    if let Some(at) = first_touch(&grown(more), from, by, reach, &t) {
                        since[exit.to.idx()] = since[exit.to.idx()].min(at);
                    }
                }
            }
            for t in self.obstacles(cell) {
                if let Some(at) = first_touch(&grown(margin), from, by, reach, &t) {
                    first = first.min(at);
                }
            }
        }
        (first.is_finite().then_some(first), since)
    }
}

fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

/// Distance of a body from a triangle; at most 0 if they touch.
fn gap(body: &Body, at: DVec3, t: &Triangle) -> f64 {
    match *body {
        Body::Sphere { radius } => closest_point_on_triangle(at, t).distance(at) - radius,
        Body::Capsule { half, radius } => {
            segment_to_triangle_distance(at - half, at + half, t) - radius
        }
        Body::Box { half, turn } => box_to_triangle_distance(half, turn, at, t),
    }
}

/// First time from `since` on: the gap of two convex bodies is a convex function of time, so sectioning finds its minimum, and
/// bisection the first zero before that.
fn first_touch(body: &Body, from: DVec3, by: DVec3, since: f64, t: &Triangle) -> Option<f64> {
    let (a, b) = (body.bounds(from + by * since), body.bounds(from + by));
    if !a.union(b).overlaps(&Aabb::of_points(t)) {
        return None;
    }
    let gap_at = |s: f64| gap(body, from + by * s, t);
    let (mut low, mut high) = (since, 1.0);
    if gap_at(low) <= 0.0 {
        return Some(low);
    }
    for _ in 0..70 {
        let (x, y) = (low + (high - low) * 0.382, low + (high - low) * 0.618);
        let (gx, gy) = (gap_at(x), gap_at(y));
        if gx <= 0.0 || gy > gx {
            high = y;
        } else {
            low = x;
        }
        if gx <= 0.0 {
            high = x;
            break;
        }
    }
    let (mut before, mut after) = (since, high);
    if gap_at(after) > 0.0 {
        return None;
    }
    for _ in 0..50 {
        let middle = 0.5 * (before + after);
        if gap_at(middle) <= 0.0 {
            after = middle;
        } else {
            before = middle;
        }
    }
    Some(after)
}

fn grid(seed: u64) -> GridParams {
    GridParams {
        size: [3, 2, 3],
        holes: 0.3,
        merges: 0.2,
        furniture: 3,
        ..GridParams::offices(18, seed)
    }
}

fn random_body(rng: &mut Rng, kind: usize) -> Body {
    let mut any = |low: f64, high: f64| rng.range(low, high);
    match kind {
        0 => Body::Sphere {
            radius: any(0.0, 0.5),
        },
        1 => Body::Capsule {
            half: DVec3::new(any(-0.2, 0.2), any(0.1, 0.8), any(-0.2, 0.2)),
            radius: any(0.05, 0.4),
        },
        _ => Body::Box {
            half: DVec3::new(any(0.05, 0.5), any(0.05, 0.5), any(0.05, 0.5)),
            turn: DQuat::from_scaled_axis(DVec3::new(any(-2.0, 2.0), any(-2.0, 2.0), 1.0)),
        },
    }
}

fn random_point(rng: &mut Rng, world: &World) -> DVec3 {
    let rooms = world.graph.cells.iter().filter(|c| !c.outdoor);
    let corners: Vec<DVec3> = rooms.flat_map(|c| c.aabb.map(point)).collect();
    let all = Aabb::of_points(&corners).expanded(1.0);
    let share = DVec3::new(rng.unit(), rng.unit(), rng.unit());
    all.min + all.size() * share
}

/// Compares casts of one kind of body in one world with brute force; returns the numbers of impacts and of cells.
fn compare(site: &Site, rng: &mut Rng, kind: usize, n: usize) -> [usize; 2] {
    let margin = 1e-7;
    let (mut n_impacts, mut n_cells) = (0, 0);
    for _ in 0..n {
        let body = random_body(rng, kind);
        let from = random_point(rng, site.world());
        let Some(cell) = site.layout().locate(from) else {
            continue;
        };
        // Contacts at the start belong to another test.
        let is_free = site.touched(&body.grown(1e-4), from).is_empty();
        if !is_free || site.layout().cell(cell).is_outdoor && rng.chance(0.7) {
            continue;
        }
        let by = DVec3::new(
            rng.range(-6.0, 6.0),
            rng.range(-3.0, 3.0),
            rng.range(-6.0, 6.0),
        );
        let found = site.cast(&body, from, by);
        n_cells += site.cells().len();
        n_impacts += usize::from(found.is_some());
        let (latest, _) = site.brute(&body, -margin, from, by);
        let (earliest, since) = site.brute(&body, margin, from, by);
        let t = found.map_or(f64::INFINITY, |i| i.t);
        let [latest, earliest] = [latest, earliest].map(|t| t.unwrap_or(f64::INFINITY));
        assert!(
            t <= latest + 1e-9,
            "missed: {body:?} {from} {by}: {t} {latest}"
        );
        assert!(
            t >= earliest - 1e-9,
            "too early: {body:?} {from} {by}: {t} {earliest}"
        );
        for cell in site.cells() {
            assert!(since[cell.idx()] <= t + 1e-9, "{cell} is behind the impact");
        }
        if let Some(impact) = found {
            let at = from + by * impact.t;
            let own = body.bounds(at).expanded(1e-5);
            assert!(own.contains(impact.point), "{body:?} {impact:?}");
            assert!(impact.normal.dot(by) < 0.0 && (impact.normal.length() - 1.0).abs() < 1e-9);
            // Moved off along the normal, nothing is touched there.
            assert!(gap(&body, at + impact.normal * 1e-6, &around(impact.point)) > -1e-5);
        }
    }
    [n_impacts, n_cells]
}

/// A speck at a point.
fn around(p: DVec3) -> Triangle {
    [p, p + DVec3::X * 1e-9, p + DVec3::Z * 1e-9]
}

#[test]
fn casts_equal_a_test_of_every_reachable_triangle() {
    let mut rng = Rng::new(12);
    let mut n = [0; 2];
    for seed in 0..4 {
        let turn = if seed == 3 { 0.4 } else { 0.0 };
        let mut world = room_grid(&GridParams { turn, ..grid(seed) });
        if seed < 2 {
            world = with_doors(world, |i| i % 3 == 0);
        }
        let mut site = Site::new(world);
        for portal in site.world().graph.portal_ids() {
            match rng.below(4) {
                0 => site.space.close(ROOT, portal),
                1 => site.space.set_leaves(ROOT, portal, rng.unit() as f32),
                2 => site.space.open(ROOT, portal),
                _ => {}
            }
        }
        for (kind, casts) in [(0, 150), (1, 100), (2, 25)] {
            let more = compare(&site, &mut rng, kind, casts);
            n = [n[0] + more[0], n[1] + more[1]];
        }
    }
    assert!(n[0] > 200 && n[1] > 2 * n[0] / 2, "{n:?}");
}

#[test]
fn points_hit_the_same_as_lines_of_sight() {
    let mut rng = Rng::new(8);
    let (mut n_hits, mut n_flat) = (0, 0);
    for (seed, turn) in [(1, 0.0), (2, 0.7)] {
        let mut site = Site::new(room_grid(&GridParams { turn, ..grid(seed) }));
        for portal in site.world().graph.portal_ids().filter(|p| p.0 % 3 == 0) {
            site.space.close(ROOT, portal);
        }
        let lines = Sightlines::build(site.world());
        for _ in 0..2000 {
            // Rounded as for lines of sight.
            let from = random_point(&mut rng, site.world()).as_vec3();
            let to = random_point(&mut rng, site.world()).as_vec3();
            let (a, b) = (from.as_dvec3(), to.as_dvec3());
            if site.layout().locate(a).is_none() {
                continue;
            }
            let hit = lines
                .pick(site.space.state(ROOT), from.to_array(), to.to_array())
                .unwrap();
            let found = site.cast(&Body::Sphere { radius: 0.0 }, a, b - a);
            assert_eq!(found.is_some(), hit.is_some(), "{a} {b} {found:?} {hit:?}");
            if let (Some(found), Some(hit)) = (found, hit) {
                assert!((found.t - hit.t).abs() < 1e-7, "{a} {b} {found:?} {hit:?}");
                n_hits += 1;
            }
            // A box without any size is a point, too.
            let speck = Body::Box {
                half: DVec3::ZERO,
                turn: DQuat::from_rotation_x(0.4),
            };
            let flat = site.cast(&speck, a, b - a);
            assert_eq!(flat.is_some(), found.is_some());
            n_flat += usize::from(flat.is_some());
        }
    }
    assert!(n_hits > 1000 && n_flat == n_hits, "{n_hits}");
}

/// Two rooms in a row with a doorway, the middle of the first, and the doorway's middle.
fn two_rooms(doors: bool) -> (Site, DVec3, DVec3) {
    let world = room_grid(&GridParams::two_rooms());
    let world = if doors {
        with_doors(world, |_| false)
    } else {
        world
    };
    let site = Site::new(world);
    let middle = site.layout().cell(CellId(0)).bounds.center();
    let door = site.layout().opening(PortalId(0)).center();
    (site, middle, door)
}

#[test]
fn bodies_pass_open_doorways_and_stop_at_shut_ones_and_at_leaves() {
    let (mut site, _, door) = two_rooms(true);
    let body = Body::Sphere { radius: 0.3 };
    let from = door - DVec3::X * 1.5;
    let stop = |site: &Site| {
        site.cast(&body, from, DVec3::X * 3.0)
            .map(|i| (i.target, i.t * 3.0))
    };
    // In the model's pose, the leaf is shut 6 to 8 cm behind the opening.
    let (target, at) = stop(&site).unwrap();
    assert!(
        matches!(target, Target::Detail { .. }) && (at - 1.24).abs() < 1e-6,
        "{at}"
    );
    site.space.open(ROOT, PortalId(0));
    assert_eq!(stop(&site), None);
    site.space.set_leaves(ROOT, PortalId(0), 0.3);
    assert!(stop(&site).is_some());
    site.space.close(ROOT, PortalId(0));
    let (_, at) = stop(&site).unwrap();
    assert!((at - 1.24).abs() < 1e-6, "not before the leaf: {at}");
    let (mut site, _, _) = two_rooms(false);
    assert_eq!(stop(&site), None);
    site.space.close(ROOT, PortalId(0));
    let (target, at) = stop(&site).unwrap();
    assert_eq!(target, Target::Portal(PortalId(0)));
    assert!((at - 1.2).abs() < 1e-6, "{at}");
}

#[test]
fn only_cells_whose_openings_are_touched_are_searched() {
    let (site, middle, door) = two_rooms(false);
    let body = Body::Sphere { radius: 0.4 };
    let cells = || site.cells();
    assert!(site.touched(&body, middle).is_empty());
    assert_eq!(cells(), [CellId(0)]);
    let _ = site.touched(&body, door - DVec3::X * 0.39);
    assert_eq!(cells(), [CellId(0), CellId(1)]);
    // Beside the opening, at the wall between both rooms.
    let beside = DVec3::new(
        door.x - 0.39,
        site.layout().cell(CellId(0)).bounds.max.y - 0.5,
        door.z,
    );
    assert!(!site.touched(&body, beside).is_empty());
    assert_eq!(cells(), [CellId(0)]);
    // A body that stops at the wall reaches nothing behind it, nor does one that turns back before the opening.
    let _ = site.cast(&body, middle, DVec3::Z * 20.0);
    assert_eq!(cells(), [CellId(0)]);
}

#[test]
fn objects_behind_a_wall_count_once_their_cell_is_reached() {
    // A ball that bulges through the wall beside a doorway, and a box behind the wall, in front of the doorway. The wall's own
    // triangles would stop it at their seams.
    let mut world = room_grid(&GridParams::two_rooms());
    world.batches.clear();
    let hole = *Layout::new(&world).opening(PortalId(0)).bounds();
    let at = DVec3::new(hole.min.x - 0.3, 0.6, hole.min.z - 0.5);
    let low = DVec3::new(hole.min.x + 0.02, 0.2, at.z + 0.31);
    let block = Aabb::new(low, low + DVec3::new(0.3, 0.8, 0.1)).triangles();
    let positions: Vec<[f32; 3]> =
        (block.iter().flatten().map(|p| p.as_vec3().to_array())).collect();
    world.detail_meshes.push(Mesh {
        primitives: vec![Primitive {
            indices: (0..positions.len() as u32).collect(),
            positions,
            ..Primitive::default()
        }],
        ..Mesh::default()
    });
    world.details.push(DetailObject {
        name: String::new(),
        mesh: world.detail_meshes.len() as u32 - 1,
        transform: DMat4::IDENTITY.to_cols_array().map(|x| x as f32),
        cells: vec![CellId(1)],
        source: None,
        part_of: None,
    });
    let site = Site::new(world);
    let body = Body::Sphere { radius: 0.4 };
    let bulge = (0.4_f64.powi(2) - 0.3_f64.powi(2)).sqrt();
    assert_eq!(site.cast(&body, at, DVec3::Z * 0.2), None, "passes the box");
    let impact = site.cast(&body, at, DVec3::Z * 0.4).unwrap();
    assert!(matches!(impact.target, Target::Detail { .. }), "{impact:?}");
    let when = (0.5 - bulge) / 0.4;
    assert!((impact.t - when).abs() < 1e-3, "{} {when}", impact.t);
}

#[test]
fn contacts_at_the_start_stop_only_motion_into_them() {
    let (site, middle, _) = two_rooms(false);
    let floor = site.layout().cell(CellId(0)).bounds.min.y;
    let turn = DQuat::from_rotation_y(0.3);
    let half = DVec3::splat(0.3);
    let bodies = [
        Body::Sphere { radius: 0.3 },
        Body::upright(0.6, 0.2),
        Body::Box { half, turn },
    ];
    for body in bodies {
        // Sunk by a centimeter, away from the seam of the floor's triangles.
        let at = DVec3::new(middle.x + 0.7, floor + 0.29, middle.z);
        assert_eq!(site.cast(&body, at, DVec3::Y), None, "{body:?}");
        let into = site.cast(&body, at, DVec3::new(0.2, -0.1, 0.0)).unwrap();
        assert_eq!(into.t, 0.0);
        assert!(into.normal.distance(DVec3::Y) < 1e-9, "{body:?} {into:?}");
        assert_eq!(site.cast(&body, at, DVec3::X * 0.2), None, "along");
        assert_eq!(site.cast(&body, at, DVec3::ZERO), None);
        let contacts = site.touched(&body, at);
        assert!(!contacts.is_empty());
        for c in contacts {
            assert!((c.depth - 0.01).abs() < 1e-6 && c.normal.distance(DVec3::Y) < 1e-9);
            assert!((c.point.y - floor).abs() < 1e-6, "{c:?}");
        }
        for bad in [DVec3::NAN, DVec3::splat(f64::INFINITY)] {
            assert_eq!(site.cast(&body, at, bad), None);
        }
    }
}

#[test]
fn contacts_are_those_of_every_reachable_triangle() {
    let mut rng = Rng::new(77);
    let site = Site::new(with_doors(room_grid(&grid(9)), |_| false));
    let mut n = 0;
    for i in 0..600 {
        let body = random_body(&mut rng, i % 3);
        let at = random_point(&mut rng, site.world());
        if site.layout().locate(at).is_none() {
            continue;
        }
        let found = site.touched(&body, at);
        let cells = site.cells();
        let all: Vec<Triangle> = cells.iter().flat_map(|&c| site.obstacles(c)).collect();
        let touching = |margin: f64| {
            let body = body.grown(margin);
            all.iter().filter(|t| gap(&body, at, t) <= 0.0).count()
        };
        assert!(
            (touching(-1e-6)..=touching(1e-6)).contains(&found.len()),
            "{body:?} {at}"
        );
        for c in &found {
            // A little farther than its depth, it no longer reaches the deepest point.
            let out = at + c.normal * (c.depth + 1e-6);
            if let Body::Sphere { radius } = body {
                assert!(out.distance(c.point) >= radius - 1e-9);
            }
            n += 1;
        }
        let mut candidates = 0;
        let mut caster = site.caster.borrow_mut();
        caster.for_each_candidate(&site.space, &body, ROOT, at, site.place(at), |_, _, t| {
            assert!(body.bounds(at).expanded(1e-9).overlaps(&Aabb::of_points(t)));
            candidates += 1;
        });
        assert!(candidates >= found.len());
    }
    assert!(n > 300, "{n}");
}

#[test]
fn queries_allocate_nothing_once_warm() {
    let site = Site::new(with_doors(room_grid(&grid(3)), |_| false));
    let mut rng = Rng::new(4);
    let points: Vec<DVec3> = (0..300)
        .map(|_| random_point(&mut rng, site.world()))
        .collect();
    let mut next = 0;
    let mut ask = || {
        let body = random_body(&mut rng, next % 3);
        let at = points[next % 300];
        next += 1;
        if site.layout().locate(at).is_some() {
            let _ = site.cast(&body, at, DVec3::new(rng.range(-3.0, 3.0), -0.5, 2.0));
            let mut caster = site.caster.borrow_mut();
            let mut deepest = 0.0_f64;
            caster.for_each_contact(&site.space, &body, ROOT, at, site.place(at), |c| {
                deepest = deepest.max(c.depth);
            });
        }
    };
    for _ in 0..300 {
        ask();
    }
    let counted = allocation_counter::measure(|| (0..300).for_each(|_| ask()));
    assert_eq!(counted.count_total, 0);
}
