//! Shortest paths through the air of concave cells, against plane geometry.
//!
//! Covers W10.

use enfilade_cpg::{CellId, World};
use enfilade_geom::{Bvh, DVec3, Triangle};
use enfilade_testkit::{GridParams, Rng, room_grid};
use enfilade_world::{Geodesics, Layout, LengthSearch, PartId, Sampling, Space, Ways};

/// One storey of rooms, many of them concave.
fn rooms(seed: u64) -> (World, Space, Ways, Geodesics) {
    let world = room_grid(&GridParams {
        size: [5, 1, 5],
        doors: 0.7,
        windows: 0.0,
        merges: 0.5,
        furniture: 0,
        outdoors: false,
        ..GridParams::offices(25, seed)
    });
    let space = Space::new(world.clone()).unwrap();
    let mut ways = Ways::new(space.layout(PartId::ROOT), Sampling::default());
    let geodesics = Geodesics::new(&space, PartId::ROOT, &mut ways);
    (world, space, ways, geodesics)
}

fn walls(world: &World) -> Vec<Triangle> {
    let mut all = Vec::new();
    for b in &world.batches {
        all.extend(b.primitive.triangles());
    }
    all
}

fn points_in(layout: &Layout, cell: CellId, rng: &mut Rng) -> [DVec3; 2] {
    let bounds = layout.cell(cell).bounds;
    [(); 2].map(|()| {
        loop {
            let share = DVec3::new(rng.unit(), rng.unit(), rng.unit());
            let p = bounds.min + bounds.size() * (0.02 + 0.96 * share);
            if layout.locate(p) == Some(cell) {
                return p;
            }
        }
    })
}

/// Ends of the walls of a cell in plan: all points where a shortest path may bend.
fn corners_in_plan(walls: &[Triangle]) -> Vec<DVec3> {
    let mut corners: Vec<DVec3> = walls.iter().flatten().map(|p| p.with_y(0.0)).collect();
    corners.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.z.total_cmp(&b.z)));
    corners.dedup_by(|a, b| a.distance(*b) < 1e-3);
    corners
}

/// The shortest path in plan within one cell, by a graph of all wall ends that see each other: paths about vertical edges are as
/// long as those in plan, unrolled.
fn by_visibility(
    layout: &Layout,
    cell: CellId,
    bvh: &Bvh,
    corners: &[DVec3],
    [a, b]: [DVec3; 2],
) -> f64 {
    let height = 1.0;
    let mut points = vec![a.with_y(height), b.with_y(height)];
    for corner in corners {
        for k in 0..4 {
            let off = DVec3::new([1.0, -1.0][k % 2], 0.0, [1.0, -1.0][k / 2]) * 1e-3;
            let p = (*corner + off).with_y(height);
            if layout.locate(p) == Some(cell) {
                points.push(p);
            }
        }
    }
    let sees = |a: DVec3, b: DVec3| {
        let n = (a.distance(b) / 0.05).ceil() as usize;
        let is_in = |k: usize| layout.locate(a.lerp(b, k as f64 / n.max(1) as f64)) == Some(cell);
        !bvh.any_hit(a, b, |_| false) && (0..=n).all(is_in)
    };
    let mut least = vec![f64::INFINITY; points.len()];
    let mut is_done = vec![false; points.len()];
    least[0] = 0.0;
    loop {
        let open = (0..points.len()).filter(|&i| !is_done[i] && least[i] < f64::INFINITY);
        let at = open
            .min_by(|&i, &j| least[i].total_cmp(&least[j]))
            .expect("cells are connected");
        if at == 1 {
            return least[1].hypot(a.y - b.y);
        }
        is_done[at] = true;
        for to in 0..points.len() {
            let through = least[at] + points[at].distance(points[to]);
            if through < least[to] && sees(points[at], points[to]) {
                least[to] = through;
            }
        }
    }
}

/// W10: paths within concave cells are as long as the shortest about vertical edges, to a thousandth, and meet no wall.
#[test]
fn ways_within_a_cell_bend_about_its_edges() {
    let (mut bends, mut n_bent, mut n_cells) = (Vec::new(), 0, 0);
    for seed in 0..8 {
        let (world, space, _, geodesics) = rooms(seed);
        let layout = space.layout(PartId::ROOT);
        let walls = walls(&world);
        let (bvh, corners) = (Bvh::build(&walls), corners_in_plan(&walls));
        let mut rng = Rng::new(seed);
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            n_cells += usize::from(geodesics.is_concave(cell));
            for _ in 0..20 {
                let ends = points_in(layout, cell, &mut rng);
                let length = geodesics
                    .way(cell, ends, &mut bends)
                    .expect("cells are connected");
                let least = by_visibility(layout, cell, &bvh, &corners, ends);
                assert!(
                    length < 1.001 * least + 0.01,
                    "{cell} seed {seed}: {length} {least} {ends:?}"
                );
                assert!(
                    length > least - 0.01,
                    "{cell} seed {seed}: {length} {least}"
                );
                n_bent += usize::from(!bends.is_empty());
                let all: Vec<DVec3> = bends.iter().map(|b| b.at).collect();
                let line = [&ends[..1], &all, &ends[1..]].concat();
                for w in line.windows(2) {
                    assert!(!bvh.any_hit(w[0], w[1], |_| false));
                }
            }
        }
    }
    assert!(n_bent > 15 && n_cells > 5, "{n_bent} {n_cells}");
}

/// W10: rooms that are boxes are not concave, whatever holes are in their walls.
#[test]
fn boxes_are_not_concave() {
    let world = room_grid(&GridParams::offices(30, 1));
    let space = Space::new(world.clone()).unwrap();
    let layout = space.layout(PartId::ROOT);
    let mut ways = Ways::new(layout, Sampling::MIDDLES);
    let geodesics = Geodesics::new(&space, PartId::ROOT, &mut ways);
    for cell in (0..layout.n_cells() as u32).map(CellId) {
        assert_eq!(
            geodesics.is_concave(cell),
            layout.cell(cell).is_outdoor,
            "{cell}"
        );
    }
}

/// W10: the search uses the lengths within concave cells, also from and to points in them.
#[test]
fn searches_walk_around_walls_of_a_cell() {
    let (mut search, mut arrivals, mut lengths) = (LengthSearch::new(), Vec::new(), Vec::new());
    let (mut bends, mut n_bent) = (Vec::new(), 0);
    for seed in 0..8 {
        let (_, space, ways, geodesics) = rooms(seed);
        let layout = space.layout(PartId::ROOT);
        let mut rng = Rng::new(seed);
        for cell in (0..layout.n_cells() as u32).map(CellId) {
            let [from, _] = points_in(layout, cell, &mut rng);
            geodesics.lengths_from(&ways, cell, from, &mut lengths);
            assert_eq!(lengths.len(), ways.points_of(cell).count());
            for ((_, p), &length) in ways.points_of(cell).zip(&lengths) {
                assert!(length > from.distance(p) - 0.01);
                n_bent += usize::from(length > from.distance(p) + 0.05);
            }
            let first = |place: usize, _| lengths[place];
            search.run_from(&ways, cell, from, first, f64::INFINITY, |_| Some(0.0));
            // Each portal of the cell is reached from its own side at no more than the given length.
            for exit in layout.exits(cell) {
                let own = search.reached().iter().find(|r| r.exit == *exit).unwrap();
                let of_portal = ways
                    .points_of(cell)
                    .zip(&lengths)
                    .filter(|p| p.0.0 == exit.portal);
                let least = of_portal.map(|p| *p.1).fold(f64::INFINITY, f64::min);
                assert!(own.length <= least + 1e-9);
            }
            let other = CellId(rng.below(layout.n_cells()) as u32);
            let [to, _] = points_in(layout, other, &mut rng);
            geodesics.lengths_from(&ways, other, to, &mut lengths);
            let direct = geodesics.way(cell, [from, to], &mut bends);
            let last = |place: usize, _| {
                lengths
                    .get(place)
                    .copied()
                    .or(direct)
                    .unwrap_or(f64::INFINITY)
            };
            search.arrivals_by(&ways, other, to, last, 1.1, 3, &mut arrivals);
            assert!(arrivals.iter().all(|a| a.length > from.distance(to) - 0.05));
        }
    }
    assert!(n_bent > 30, "{n_bent}");
}
