//! Paths of walkers against plain geometry (W10).
//!
//! Covers W10.

use std::collections::BTreeSet;
use std::sync::Arc;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, Fitting, FittingPart, Locator, PortalId, PortalKind,
    World,
};
use enfilade_geom::scene::Primitive;
use enfilade_geom::{Aabb, Bvh, DVec3, Triangle};
use enfilade_runtime::SightState;
use enfilade_testkit::{GridParams, Rng, room_grid, with_doors};
use enfilade_world::{
    Agent, Layout, NoPath, PartId, Path, PathFollower, PathPortal, PathSearch, Space, WalkMap,
    WalkProgress, Walker,
};

/// One storey of rooms, some of them concave, with doorways and no windows.
fn rooms(seed: u64) -> (World, Space, WalkMap) {
    let world = room_grid(&GridParams {
        size: [4, 1, 3],
        seed,
        doors: 0.8,
        windows: 0.0,
        merges: 0.3,
        furniture: 0,
        outdoors: false,
        ..GridParams::offices(12, seed)
    });
    let space = Space::new(world.clone()).unwrap();
    let map = WalkMap::new(&space, Agent::default());
    (world, space, map)
}

/// Points in the frame of the root.
fn at_root(ends: [DVec3; 2]) -> [(PartId, DVec3); 2] {
    ends.map(|p| (PartId::ROOT, p))
}

fn triangles(world: &World) -> Vec<Triangle> {
    let mut all = Vec::new();
    for b in &world.batches {
        all.extend(b.primitive.triangles());
    }
    all
}

fn point_on_floor(layout: &Layout, rng: &mut Rng) -> DVec3 {
    loop {
        let bounds = layout
            .cell(CellId(rng.below(layout.n_cells()) as u32))
            .bounds;
        let share = DVec3::new(rng.unit(), 0.0, rng.unit());
        let p = bounds.min + bounds.size() * share;
        if layout.locate(p + DVec3::Y).is_some() {
            return p;
        }
    }
}

/// W10: a path keeps the radius from walls, stays on the floor, and passes open portals of its cells.
#[test]
fn a_path_keeps_clear_of_walls_and_passes_open_portals_only() {
    let (mut path, mut search) = (Path::default(), PathSearch::new());
    let (mut n_found, mut n_turned) = (0, 0);
    for seed in 0..3 {
        let (world, space, map) = rooms(seed);
        let layout = space.layout(PartId::ROOT);
        let walls: Vec<Triangle> = (triangles(&world).into_iter())
            .filter(|t| (t[1] - t[0]).cross(t[2] - t[0]).normalize().y.abs() < 0.5)
            .collect();
        let (bvh, mut rng) = (Bvh::build(&walls), Rng::new(seed));
        for _ in 0..30 {
            let ends = [(); 2].map(|()| point_on_floor(layout, &mut rng));
            let closed: BTreeSet<u32> = (0..2)
                .map(|_| rng.below(layout.n_portals()) as u32)
                .collect();
            let is_open = |_, p: PortalId| !closed.contains(&p.0);
            if search
                .find(&map, &space, at_root(ends), is_open, &mut path)
                .is_err()
            {
                assert!(path.points.is_empty() && path.portals.is_empty());
                continue;
            }
            n_found += 1;
            n_turned += usize::from(path.points.len() > 2);
            let mut cell = layout.locate(path.points[0].at + DVec3::Y);
            for PathPortal { exit, .. } in &path.portals {
                assert!(
                    layout.exits(cell.unwrap()).contains(exit)
                        && is_open(PartId::ROOT, exit.portal)
                );
                cell = Some(exit.to);
            }
            assert_eq!(
                cell,
                layout.locate(path.points[path.points.len() - 1].at + DVec3::Y)
            );
            let mut length = 0.0;
            let points: Vec<DVec3> = path.points.iter().map(|p| p.at).collect();
            for w in points.windows(2) {
                length += w[0].distance(w[1]);
                for i in 0..=20 {
                    let p = w[0].lerp(w[1], f64::from(i) / 20.0);
                    assert!(p.y.abs() < 1e-6, "on the floor");
                    let near = bvh.nearest(p + DVec3::Y, 1.0).map_or(1.0, |n| n.distance);
                    // A square is 0.075 m wide; the ends may be closer.
                    let is_end = ends.iter().any(|e| e.with_y(0.0).distance(p) < 1.0);
                    assert!(near > 0.3 - 0.09 || is_end, "{near} at {p}, seed {seed}");
                }
            }
            assert!((length - path.length).abs() < 1e-9);
        }
    }
    assert!(n_found > 40 && n_turned > 20, "{n_found} {n_turned}");
}

/// Returns the least distance of two segments in plan.
fn distance(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let cross = |u: DVec3, v: DVec3| u.x * v.z - u.z * v.x;
    let side = |s: [DVec3; 2], p: DVec3| cross(s[1] - s[0], p - s[0]);
    if side(a, b[0]) * side(a, b[1]) < 0.0 && side(b, a[0]) * side(b, a[1]) < 0.0 {
        return 0.0;
    }
    let to = |s: [DVec3; 2], p: DVec3| {
        let d = s[1] - s[0];
        let t = (p - s[0]).dot(d) / d.length_squared().max(1e-12);
        p.distance(s[0] + d * t.clamp(0.0, 1.0))
    };
    [to(a, b[0]), to(a, b[1]), to(b, a[0]), to(b, a[1])]
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// Returns the walls in plan, at a height where doorways are open.
fn walls_in_plan(world: &World) -> Vec<[DVec3; 2]> {
    let mut walls = Vec::new();
    for t in triangles(world) {
        let mut cut: Vec<DVec3> = Vec::new();
        for i in 0..3 {
            let [a, b] = [t[i], t[(i + 1) % 3]];
            if (a.y < 1.0) != (b.y < 1.0) {
                cut.push(a.lerp(b, (1.0 - a.y) / (b.y - a.y)).with_y(0.0));
            }
        }
        if let [a, b] = cut[..] {
            walls.push([a, b]);
        }
    }
    walls
}

/// Returns the shortest length in a graph of points around ends of walls that see each other with room for the walker.
fn by_visibility(walls: &[[DVec3; 2]], ends: [DVec3; 2], radius: f64) -> Option<f64> {
    let clear = |a: DVec3, b: DVec3| walls.iter().all(|&w| distance(w, [a, b]) >= radius);
    let mut points = ends.to_vec();
    for end in walls.iter().flatten() {
        for k in 0..16 {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 16.0).sin_cos();
            let p = *end + DVec3::new(cos, 0.0, sin) * radius * 1.03;
            if clear(p, p) && points.iter().all(|q| q.distance(p) > 1e-6) {
                points.push(p);
            }
        }
    }
    let mut least = vec![f64::INFINITY; points.len()];
    let mut is_done = vec![false; points.len()];
    least[0] = 0.0;
    loop {
        let open = (0..points.len()).filter(|&i| !is_done[i] && least[i] < f64::INFINITY);
        let at = open.min_by(|&a, &b| least[a].total_cmp(&least[b]))?;
        if at == 1 {
            return Some(least[1]);
        }
        is_done[at] = true;
        for to in 0..points.len() {
            let through = least[at] + points[at].distance(points[to]);
            if through < least[to] && clear(points[at], points[to]) {
                least[to] = through;
            }
        }
    }
}

/// W10: paths are within a hundredth or two of the shortest in a visibility graph, also around bends within a cell.
#[test]
fn paths_are_hardly_longer_than_the_shortest() {
    let (mut path, mut search) = (Path::default(), PathSearch::new());
    let (mut ours, mut shortest, mut n) = (0.0, 0.0, 0);
    for seed in 0..3 {
        let (world, space, map) = rooms(seed);
        let layout = space.layout(PartId::ROOT);
        let (walls, mut rng) = (walls_in_plan(&world), Rng::new(seed + 10));
        for _ in 0..8 {
            let ends = [(); 2].map(|()| point_on_floor(layout, &mut rng).with_y(0.0));
            let Some(least) = by_visibility(&walls, ends, 0.3) else {
                continue;
            };
            search
                .find(&map, &space, at_root(ends), |_, _| true, &mut path)
                .unwrap();
            assert!(
                path.length <= 1.03 * least + 0.05,
                "{} {least} {ends:?}",
                path.length
            );
            assert!(
                path.length >= 0.98 * least - 0.05,
                "{} {least} {ends:?}",
                path.length
            );
            (ours, shortest, n) = (ours + path.length, shortest + least, n + 1);
        }
    }
    assert!(n > 10);
    assert!(ours <= 1.01 * shortest, "{ours} {shortest}");
}

/// W10: cells within a length come in ascending order, and distances of things equal lengths of paths, even in
/// concave cells.
#[test]
fn what_is_near_is_as_far_as_one_walks() {
    let (mut path, mut search, mut paths) = (Path::default(), PathSearch::new(), PathSearch::new());
    let (mut n_near, mut n_far) = (0, 0);
    for seed in 0..6 {
        let (_, space, map) = rooms(seed);
        let layout = space.layout(PartId::ROOT);
        let mut rng = Rng::new(seed);
        let from = point_on_floor(layout, &mut rng);
        let cells = search
            .cells_within(&map, &space, PartId::ROOT, from, 8.0, |_, _| true)
            .unwrap();
        n_far += layout.n_cells() - cells.len();
        assert!(cells.is_sorted_by(|a, b| a.1 <= b.1) && cells.iter().all(|c| c.1 <= 8.0));
        for _ in 0..80 {
            let to = point_on_floor(layout, &mut rng);
            let found = paths.find(&map, &space, at_root([from, to]), |_, _| true, &mut path);
            if let Some(far) = search.distance(&map, &space, PartId::ROOT, to) {
                n_near += 1;
                assert!(
                    found.is_ok() && far > 0.97 * path.length - 0.2,
                    "{far} {}",
                    path.length
                );
                // A path that leaves the radius and comes back is not found.
                assert!(
                    far < 1.05 * path.length + 0.3 || path.length > 8.0,
                    "{far} {path:?}"
                );
            } else {
                assert!(found.is_err() || path.length > 7.9);
            }
        }
    }
    assert!(n_near > 50 && n_far > 10);
}

/// W10: a walker passes no crack and no window that holds something, but an opening with a sill on one side only.
#[test]
fn cracks_and_panes_are_not_passed() {
    let world = room_grid(&GridParams {
        furniture: 1,
        ..GridParams::two_rooms()
    });
    let pane = Fitting {
        detail: 0,
        part: FittingPart::Pane,
        motion: None,
    };
    for (kind, fittings, is_walked) in [
        (PortalKind::Open, vec![], true),
        (PortalKind::Door, vec![pane.clone()], true),
        (PortalKind::Window, vec![], true),
        (PortalKind::Window, vec![pane], false),
        (PortalKind::Crack, vec![], false),
    ] {
        let mut world = world.clone();
        let portal = &mut world.graph.portals[0];
        (portal.kind, portal.fittings) = (kind, fittings);
        let map = WalkMap::new(&Space::new(world).unwrap(), Agent::default());
        assert_eq!(
            map.is_walkable(PartId::ROOT, PortalId(0)),
            is_walked,
            "{kind:?}"
        );
    }
}

/// W10: lengths between a concave cell's portals go around its walls.
#[test]
fn lengths_between_portals_go_around_walls() {
    let mut n_bent = 0;
    for seed in 0..6 {
        let (world, space, map) = rooms(seed);
        let layout = space.layout(PartId::ROOT);
        let walls = walls_in_plan(&world);
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let points: Vec<DVec3> = map
                .ways(PartId::ROOT)
                .points_of(cell)
                .map(|p| p.1)
                .collect();
            for (i, &from) in points.iter().enumerate() {
                for (j, (portal, to)) in map.ways(PartId::ROOT).points_of(cell).enumerate() {
                    let sees = walls.iter().all(|&w| distance(w, [from, to]) > 0.0);
                    let length = map.ways(PartId::ROOT).length(cell, i, j);
                    n_bent += usize::from(!sees);
                    let straight = from.distance(to);
                    assert!(length > straight - 1e-6, "{portal}");
                    if !sees {
                        assert!(
                            length > straight + 0.01,
                            "{cell} {portal}: {length} {straight}"
                        );
                    }
                }
            }
        }
    }
    assert!(n_bent > 10, "{n_bent}");
}

/// W10: queries allocate nothing once the buffers have grown.
#[test]
fn a_second_path_allocates_nothing() {
    let (_, space, map) = rooms(2);
    let layout = space.layout(PartId::ROOT);
    let (mut path, mut search, mut rng) = (Path::default(), PathSearch::new(), Rng::new(1));
    let ends = [(); 2].map(|()| point_on_floor(layout, &mut rng));
    let mut ask = || {
        let _ = search.find(&map, &space, at_root(ends), |_, _| true, &mut path);
        let _ = search.cells_within(&map, &space, PartId::ROOT, ends[0], 20.0, |_, _| true);
        let _ = search.distance(&map, &space, PartId::ROOT, ends[1]);
    };
    // Buffers change places, so several queries are needed to grow all.
    (0..4).for_each(|_| ask());
    assert_eq!(allocation_counter::measure(ask).count_total, 0);
}

/// Returns one cell with these boxes in it, and a floor of 10 m by 4 m.
fn hall(boxes: &[Aabb]) -> Space {
    let bounds = Aabb::new(DVec3::new(0.0, -0.5, 0.0), DVec3::new(10.0, 6.0, 4.0));
    let floor = Aabb::new(bounds.min, bounds.max.with_y(0.0));
    let corners: Vec<DVec3> = (boxes.iter().chain([&floor]))
        .flat_map(Aabb::triangles)
        .flatten()
        .collect();
    let positions: Vec<[f32; 3]> = corners.iter().map(|p| p.as_vec3().to_array()).collect();
    let world = World {
        graph: CellPortalGraph {
            cells: vec![Cell {
                aabb: [bounds.min, bounds.max].map(|p| p.as_vec3().to_array()),
                ..Cell::default()
            }],
            locator: Arc::new(Locator {
                bounds,
                root: Locator::leaf(Some(CellId(0))),
                ..Locator::default()
            }),
            ..CellPortalGraph::default()
        },
        batches: vec![Batch {
            cells: vec![CellId(0)],
            primitive: Primitive {
                indices: (0..positions.len() as u32).collect(),
                positions,
                ..Primitive::default()
            },
            ..Batch::default()
        }],
        ..World::default()
    };
    Space::new(world).unwrap()
}

fn walk(boxes: &[Aabb], to_y: f64) -> Result<Path, NoPath> {
    let space = hall(boxes);
    let map = WalkMap::new(&space, Agent::default());
    let mut path = Path::default();
    let ends = [DVec3::new(1.0, 0.0, 2.0), DVec3::new(9.0, to_y, 2.0)];
    PathSearch::new().find(&map, &space, at_root(ends), |_, _| true, &mut path)?;
    Ok(path)
}

fn block(low: [f64; 3], high: [f64; 3]) -> Aabb {
    Aabb::new(DVec3::from_array(low), DVec3::from_array(high))
}

/// W10: walkers climb stairs, at the height of the steps; they do not climb a step that is too high.
#[test]
fn stairs_are_walked_and_ledges_are_not() {
    let stairs = |rise: f64| -> Vec<Aabb> {
        (0..20)
            .map(|i| {
                let x = 3.0 + 0.3 * f64::from(i.min(9));
                block([x, 0.0, 0.0], [10.0, rise * f64::from(i.min(9) + 1), 4.0])
            })
            .collect()
    };
    let path = walk(&stairs(0.17), 1.7).unwrap();
    assert!((path.length_in_plan - 8.0).abs() < 0.05);
    assert!(path.length > 8.2 && path.length < 8.7, "{}", path.length);
    // At each place the line is as high as the floor, up to half a step of a walker.
    for p in path.points.iter().map(|p| p.at) {
        let n = ((p.x - 3.0) / 0.3).floor().clamp(-1.0, 9.0) + 1.0;
        assert!((p.y - 0.17 * n).abs() < 0.21, "{p}");
    }
    assert_eq!(walk(&stairs(0.5), 5.0).unwrap_err(), NoPath::NoWay);
}

/// W10: a walker passes no opening that is too low or too narrow, and walks around free-standing obstacles.
#[test]
fn a_walker_needs_its_room() {
    let straight = walk(&[], 0.0).unwrap();
    assert!((straight.length - 8.0).abs() < 1e-6 && straight.points.len() == 2);
    let pillar = walk(&[block([4.0, 0.0, 1.0], [5.0, 3.0, 3.2])], 0.0).unwrap();
    // Along the side of z = 1, which is nearer, at 0.3 m from it: tangents, arcs about two vertices, and the meter
    // between.
    let corner = |far: f64| {
        let d = far.hypot(1.0);
        (d * d - 0.09).sqrt() + 0.3 * ((1.0 / far).atan() + (0.3 / d).asin())
    };
    let around = corner(3.0) + 1.0 + corner(4.0);
    let off = pillar.length - around;
    assert!(off > -0.04 && off < 0.08, "{} {around}", pillar.length);
    assert!(pillar.points.iter().all(|p| p.at.z < 2.1));
    let wall_with_gap = |gap: f64, lintel: f64| {
        [
            block([4.0, 0.0, 0.0], [4.2, 3.0, 2.0]),
            block([4.0, 0.0, 2.0 + gap], [4.2, 3.0, 4.0]),
            block([4.0, lintel, 2.0], [4.2, 3.0, 2.0 + gap]),
        ]
    };
    assert!(walk(&wall_with_gap(0.9, 2.1), 0.0).is_ok());
    assert_eq!(
        walk(&wall_with_gap(0.5, 2.1), 0.0).unwrap_err(),
        NoPath::NoWay
    );
    assert_eq!(
        walk(&wall_with_gap(0.9, 1.7), 0.0).unwrap_err(),
        NoPath::NoWay
    );
    assert_eq!(walk(&[], 3.0).unwrap_err(), NoPath::NoFloorAtEnd);
}

/// W10: invalid points, and points far from everything, have no floor; nor does an empty world. Nothing panics.
#[test]
fn points_from_nowhere_have_no_floor() {
    let space = hall(&[]);
    let map = WalkMap::new(&space, Agent::default());
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let inside = DVec3::new(5.0, 0.0, 2.0);
    for x in [
        f64::NAN,
        f64::INFINITY,
        -f64::INFINITY,
        1e300,
        -1e300,
        1e9,
        11.0,
    ] {
        for axis in 0..3 {
            let mut p = inside;
            p[axis] = x;
            let found = search.find(&map, &space, at_root([p, inside]), |_, _| true, &mut path);
            assert_eq!(found, Err(NoPath::NoFloorAtStart), "{p}");
            let found = search.find(&map, &space, at_root([inside, p]), |_, _| true, &mut path);
            assert_eq!(found, Err(NoPath::NoFloorAtEnd), "{p}");
        }
    }
    let space = Space::new(World::default()).unwrap();
    let map = WalkMap::new(&space, Agent::default());
    let found = search.find(&map, &space, at_root([inside; 2]), |_, _| true, &mut path);
    assert_eq!(found, Err(NoPath::NoFloorAtStart));
    assert_eq!(search.distance(&map, &space, PartId::ROOT, inside), None);
}

/// W10: a path from a point to itself has no length.
#[test]
fn a_path_to_where_one_stands_has_no_length() {
    let space = hall(&[]);
    let map = WalkMap::new(&space, Agent::default());
    let (mut search, mut path) = (PathSearch::new(), Path::default());
    let p = DVec3::new(5.0, 0.0, 2.0);
    search
        .find(&map, &space, at_root([p; 2]), |_, _| true, &mut path)
        .unwrap();
    assert!(path.length < 1e-9 && path.portals.is_empty() && !path.points.is_empty());
}

/// W10: a thinner walker finds the same path as one with a radius of 0.1 m, with no more squares.
#[test]
fn a_thin_walker_finds_a_way_on_no_finer_floors() {
    let world = room_grid(&GridParams {
        windows: 0.0,
        ..GridParams::two_rooms()
    });
    let space = Space::new(world).unwrap();
    let layout = space.layout(PartId::ROOT);
    let ends = [0, 1].map(|c| {
        let bounds = layout.cell(CellId(c)).bounds;
        bounds.center().with_y(bounds.min.y)
    });
    let found = |radius: f64| {
        let walker = Agent {
            radius,
            ..Agent::default()
        };
        let map = WalkMap::new(&space, walker);
        let mut path = Path::default();
        let way = PathSearch::new().find(&map, &space, at_root(ends), |_, _| true, &mut path);
        way.unwrap_or_else(|why| panic!("{radius}: {why}"));
        (path.length, map.floors(PartId::ROOT).n_floors())
    };
    let (length, _) = found(0.1);
    for radius in [1e-9, 0.01] {
        let (thin, n) = found(radius);
        assert!(thin < length + 1e-6 && thin > ends[0].distance(ends[1]) - 1e-6);
        assert!(n < 600_000, "{radius}: {n} floors");
    }
}

/// A world to walk in.
struct Scene {
    space: Space,
}

impl Scene {
    fn new(world: &World) -> Self {
        let space = Space::new(world.clone()).unwrap();
        Self { space }
    }

    fn layout(&self) -> &Layout {
        self.space.layout(PartId::ROOT)
    }

    /// Walks a path; returns the end of the walk.
    fn walk(&mut self, path: &Path, agent: Agent) -> (WalkProgress, DVec3) {
        let eye = path.points[0].at + DVec3::Y * agent.eye;
        let mut walker = Walker::new(agent, PartId::ROOT, eye);
        let mut follower = PathFollower::new(&self.space, path.clone(), 1.4);
        for _ in 0..(60.0 * (5.0 + path.length)) as usize {
            let progress = follower.step(&mut walker, &mut self.space, 1.0 / 60.0);
            if progress != WalkProgress::Walking {
                return (progress, walker.feet());
            }
        }
        (WalkProgress::Walking, walker.feet())
    }
}

/// W10, W12: what a path says can be walked, among furniture, through doors that the walker opens.
#[test]
fn paths_are_walked_to_their_end() {
    let (mut path, mut search) = (Path::default(), PathSearch::new());
    let agent = Agent::default();
    let (mut n_walked, mut n_doors) = (0, 0);
    for seed in 0..3 {
        let world = with_doors(room_grid(&GridParams::offices(12, seed)), |_| false);
        let mut scene = Scene::new(&world);
        let map = WalkMap::new(&scene.space, agent);
        let mut rng = Rng::new(seed);
        for _ in 0..80 {
            let ends = [(); 2].map(|()| point_on_floor(scene.layout(), &mut rng));
            let found = search.find(&map, &scene.space, at_root(ends), |_, _| true, &mut path);
            if found.is_err() {
                continue;
            }
            // Nobody stands in a shut door.
            let near = |p: u32| {
                let bounds = scene.layout().opening(PortalId(p)).bounds();
                ends.iter().any(|e| bounds.distance_squared(*e) < 0.25)
            };
            if (0..scene.layout().n_portals() as u32).any(near) {
                continue;
            }
            let state = SightState::new(scene.space.sight(PartId::ROOT));
            scene.space.set_state(PartId::ROOT, state);
            let (progress, at) = scene.walk(&path, agent);
            assert_eq!(
                progress,
                WalkProgress::Arrived,
                "seed {seed}, {ends:?}: {at} {path:?}"
            );
            n_walked += 1;
            n_doors += path.portals.len();
        }
    }
    assert!(n_walked > 50 && n_doors > 100, "{n_walked} {n_doors}");
}

/// W10, W12: an obstacle that the path does not know of stops the walker, who says so; an open leaf is shut.
#[test]
fn a_walker_that_is_stopped_is_stuck() {
    let agent = Agent::default();
    let space = hall(&[block([5.0, 0.0, 0.0], [5.2, 3.0, 4.0])]);
    let free = hall(&[]);
    let map = WalkMap::new(&free, agent);
    let mut path = Path::default();
    let ends = [DVec3::new(1.0, 0.0, 2.0), DVec3::new(9.0, 0.0, 2.0)];
    PathSearch::new()
        .find(&map, &free, at_root(ends), |_, _| true, &mut path)
        .unwrap();
    let mut scene = Scene { space };
    let (progress, at) = scene.walk(&path, agent);
    assert_eq!(progress, WalkProgress::Stuck);
    assert!(at.x > 4.6 && at.x < 5.0 - agent.radius, "{at}");
}

/// W10: an open leaf is in the way of paths through its own door, and of no other.
#[test]
fn an_open_leaf_is_in_the_way_of_its_own_door_only() {
    let world = with_doors(room_grid(&GridParams::two_rooms()), |_| false);
    let space = Space::new(world).unwrap();
    let layout = space.layout(PartId::ROOT);
    let map = WalkMap::new(&space, Agent::default());
    let door = layout.opening(PortalId(0));
    let (middle, size) = (door.center(), door.bounds().size());
    // Its leaf turns into the second room, about a jamb; both ends are as far from the doorway.
    let beyond =
        |side: f64| middle + DVec3::new(0.35, 0.0, side * (0.5 * size.z + 0.4)).with_y(0.0);
    let from = middle - DVec3::X * 1.5;
    let mut path = Path::default();
    let mut length = |from: DVec3, to: DVec3| {
        let mut search = PathSearch::new();
        let floor = |p: DVec3| p.with_y(0.0);
        search
            .find(
                &map,
                &space,
                at_root([floor(from), floor(to)]),
                |_, _| true,
                &mut path,
            )
            .unwrap();
        path.length
    };
    let [a, b] = [-1.0, 1.0].map(|side| length(from, beyond(side)));
    let (around, direct) = (a.max(b), a.min(b));
    // Around the leaf's end, which is as far from its hinge as the doorway is wide.
    assert!(around > direct + 0.5, "{a} {b}");
    let across = length(beyond(-1.0), beyond(1.0));
    assert!(across < size.z + 0.8 + 0.01, "{across}");
}

/// W10: one that is wider than it is high, such as a robot, goes below a table, and through no gap narrower than itself.
#[test]
fn a_flat_robot_goes_below_a_table() {
    let robot = Agent {
        radius: 0.35,
        height: 0.3,
        eye: 0.2,
        step: 0.02,
        ..Agent::default()
    };
    let found = |boxes: &[Aabb]| {
        let space = hall(boxes);
        let map = WalkMap::new(&space, robot);
        let ends = [DVec3::new(1.0, 0.0, 2.0), DVec3::new(9.0, 0.0, 2.0)];
        let mut path = Path::default();
        let found = PathSearch::new().find(&map, &space, at_root(ends), |_, _| true, &mut path);
        found.map(|()| {
            let (progress, at) = Scene { space }.walk(&path, robot);
            assert_eq!(progress, WalkProgress::Arrived, "{at}");
            path.length
        })
    };
    let table = block([4.0, 0.7, 0.0], [6.0, 0.75, 4.0]);
    assert!(found(&[table]).is_ok_and(|length| length < 8.01));
    let gap = |width: f64| {
        [
            block([4.0, 0.0, 0.0], [4.2, 3.0, 2.0]),
            block([4.0, 0.0, 2.0 + width], [4.2, 3.0, 4.0]),
        ]
    };
    assert!(found(&gap(0.9)).is_ok());
    assert_eq!(found(&gap(0.65)).unwrap_err(), NoPath::NoWay);
}

/// W10: a path leads through a void only if it begins or ends in one.
#[test]
fn a_path_avoids_voids_unless_an_end_is_in_one() {
    let mut world = room_grid(&GridParams {
        size: [3, 1, 1],
        doors: 1.0,
        merges: 0.0,
        ..GridParams::two_rooms()
    });
    let middles = [0, 1, 2].map(|c: usize| {
        let [low, high] = world.graph.cells[c]
            .aabb
            .map(|p| DVec3::from_array(p.map(f64::from)));
        ((low + high) * 0.5).with_y(low.y)
    });
    let found = |world: &World, ends: [usize; 2]| {
        let space = Space::new(world.clone()).unwrap();
        let map = WalkMap::new(&space, Agent::default());
        let mut path = Path::default();
        let ends = at_root(ends.map(|k| middles[k]));
        let found = PathSearch::new().find(&map, &space, ends, |_, _| true, &mut path);
        found.map(|()| path.portals.len())
    };
    assert_eq!(found(&world, [0, 2]), Ok(2));
    world.graph.cells[1].is_void = true;
    assert_eq!(found(&world, [0, 2]), Err(NoPath::NoWay));
    assert_eq!(found(&world, [0, 1]), Ok(1));
    assert_eq!(found(&world, [1, 2]), Ok(1));
}
