//! A world prepared for streaming, and walks recorded in it.

use std::time::Duration;

use anyhow::Context;
use enfilade::cpg::Pvs;
use enfilade::geom::DVec3;
use enfilade::internals::stream::images_of;
use enfilade::runtime::{Sight, SightState, View, Viewer};
use enfilade::stream::{Catalog, InView, PieceId, WorldPieces};
use enfilade::{CellId, World};
use enfilade_testkit::{GridParams, Rng, room_grid};

use crate::measure::point;
use crate::sight::visible;

/// Length of a frame.
pub(super) const FRAME: Duration = Duration::from_micros(16_667);

/// A world, its visible sets and its pieces.
pub(super) struct Streamed {
    pub(super) world: World,
    pub(super) sight: Sight,
    pub(super) pvs: Pvs,
    pub(super) pieces: WorldPieces,
}

impl Streamed {
    /// Prepares a world; finds what may be seen from each cell.
    pub(super) fn of(world: &World) -> anyhow::Result<Self> {
        Self::with_pvs(world, visible_sets(world)?)
    }

    pub(super) fn with_pvs(world: &World, pvs: Pvs) -> anyhow::Result<Self> {
        let images = |material: u32| images_of(world, material);
        Ok(Self {
            sight: Sight::build(world)?,
            pieces: WorldPieces::of_world(world, &images),
            world: world.clone(),
            pvs,
        })
    }

    pub(super) fn catalog(&self) -> &Catalog {
        &self.pieces.catalog
    }

    /// Returns the size in transit of pieces. [Units: bytes]
    pub(super) fn packed(&self, pieces: impl IntoIterator<Item = PieceId>) -> u64 {
        let all = self.catalog().pieces();
        pieces.into_iter().map(|p| all[p.idx()].n_packed).sum()
    }

    /// Returns the size in memory of pieces. [Units: bytes]
    pub(super) fn resident(&self, pieces: impl IntoIterator<Item = PieceId>) -> u64 {
        let all = self.catalog().pieces();
        pieces.into_iter().map(|p| all[p.idx()].n_resident).sum()
    }
}

/// Finds what may be seen from each cell.
pub(super) fn visible_sets(world: &World) -> anyhow::Result<Pvs> {
    Ok(visible(&world.graph)?.vis.cells)
}

/// Generates offices by name, such as `offices-1000`.
pub(super) fn offices(scene: &str) -> anyhow::Result<World> {
    let (_, n) = scene.rsplit_once('-').context("no number of rooms")?;
    Ok(room_grid(&GridParams::offices(n.parse()?, 1)))
}

/// A frame of a recorded walk.
pub(super) struct Step {
    pub(super) now: Duration,
    pub(super) cell: CellId,
    pub(super) at: [f32; 3],
    /// The cells in view with their shares of the screen.
    pub(super) in_view: Vec<InView>,
    /// The pieces of which something is in view.
    pub(super) visible: Vec<PieceId>,
}

/// A walk, frame by frame.
pub(super) struct Recording {
    pub(super) speed: f32,
    pub(super) steps: Vec<Step>,
}

/// Records walks through a world.
pub(super) struct Recorder<'a> {
    site: &'a Streamed,
    state: SightState,
    viewer: Viewer,
    marks: Vec<u32>,
    frame: u32,
}

impl<'a> Recorder<'a> {
    pub(super) fn new(site: &'a Streamed) -> Self {
        Self {
            state: SightState::new(&site.sight),
            viewer: Viewer::new(&site.sight),
            marks: vec![0; site.catalog().pieces().len()],
            frame: 0,
            site,
        }
    }

    /// Walks a route at a speed. Where it bends, the walker stops and turns by 180 degrees a second; every eight stretches it
    /// looks all around.
    pub(super) fn walk(&mut self, route: &[DVec3], speed: f32) -> anyhow::Result<Recording> {
        let seconds = FRAME.as_secs_f64();
        let (step, turn) = (f64::from(speed) * seconds, std::f64::consts::PI * seconds);
        let (mut steps, mut heading) = (Vec::new(), 0.0_f64);
        for (i, pair) in route.windows(2).enumerate() {
            let along = pair[1] - pair[0];
            let toward = if along.x.hypot(along.z) > 1e-3 {
                along.z.atan2(along.x)
            } else {
                heading
            };
            let mut left = (toward - heading + std::f64::consts::PI)
                .rem_euclid(std::f64::consts::TAU)
                - std::f64::consts::PI;
            if i % 8 == 0 {
                left += std::f64::consts::TAU;
            }
            while left.abs() > 1e-9 {
                let by = left.clamp(-turn, turn);
                (heading, left) = (heading + by, left - by);
                self.look(pair[0], heading, &mut steps)?;
            }
            let n = (along.length() / step).ceil().max(1.0);
            for k in 1..=n as u32 {
                self.look(pair[0] + along * (f64::from(k) / n), heading, &mut steps)?;
            }
        }
        Ok(Recording { speed, steps })
    }

    /// Records a frame; nothing if the eye is in no cell.
    fn look(&mut self, at: DVec3, heading: f64, steps: &mut Vec<Step>) -> anyhow::Result<()> {
        let at = at.as_vec3().to_array();
        let toward = [heading.cos() as f32, 0.0, heading.sin() as f32];
        let view = View::perspective(at, toward, [0.0, 1.0, 0.0], 1.047, 16.0 / 9.0)?;
        let now = FRAME * steps.len() as u32;
        if let Some((cell, in_view, visible)) = self.see(&view, at) {
            steps.push(Step {
                now,
                cell,
                at,
                in_view,
                visible,
            });
        }
        Ok(())
    }

    /// Returns the cell of an eye, and the cells and pieces in view.
    pub(super) fn see(
        &mut self,
        view: &View,
        at: [f32; 3],
    ) -> Option<(CellId, Vec<InView>, Vec<PieceId>)> {
        let site = self.site;
        let cell = site.sight.locate(at)?;
        let seen = self.viewer.see(&site.sight, &self.state, view);
        let mut in_view: Vec<InView> = Vec::new();
        for &cell in seen.cells() {
            let of_cell = seen.visits().iter().filter(|v| v.cell == cell);
            let area = of_cell.map(|v| {
                let [left, bottom, right, top] = v.rectangle;
                (right - left) * (top - bottom) / 4.0
            });
            let share = area.sum::<f32>().min(1.0);
            in_view.push(InView { cell, share });
        }
        self.frame += 1;
        let mut visible = Vec::new();
        let (marks, frame) = (&mut self.marks, self.frame);
        let mut add = |piece: PieceId| {
            if std::mem::replace(&mut marks[piece.idx()], frame) != frame {
                visible.push(piece);
            }
        };
        for chunk in seen.chunks() {
            let batch = site.sight.chunks()[chunk.0 as usize].batch;
            add(site.pieces.of_batch[batch as usize]);
        }
        for detail in seen.details() {
            let mesh = site.world.details[detail.0 as usize].mesh;
            add(site.pieces.of_mesh[mesh as usize]);
        }
        Some((cell, in_view, visible))
    }
}

/// Draws a route through a world: from room to room through doorways, the least visited next, in straight stretches that stay
/// in the air.
pub(super) fn route(site: &Streamed, seed: u64, n_stretches: usize) -> anyhow::Result<Vec<DVec3>> {
    let mut rng = Rng::new(seed);
    let graph = &site.world.graph;
    let mut been = vec![0_u32; graph.cells.len()];
    let indoors: Vec<CellId> = graph.indoor_cells().map(|c| c.0).collect();
    let is_free = |a: DVec3, b: DVec3| {
        let n = (a.distance(b) / 0.05).ceil().max(1.0) as u32;
        let at = |k| a.lerp(b, f64::from(k) / f64::from(n));
        (0..=n).all(|k| site.sight.locate(at(k).as_vec3().to_array()).is_some())
    };
    let start = |rng: &mut Rng| {
        let cell = *indoors.get(rng.below(indoors.len().max(1)))?;
        let [low, high] = graph[cell].aabb.map(point);
        let p = low + (high - low) * DVec3::new(rng.unit(), 0.5, rng.unit());
        (site.sight.locate(p.as_vec3().to_array()) == Some(cell)).then_some((cell, p))
    };
    let first = (0..10_000).find_map(|_| start(&mut rng));
    let (mut cell, p) = first.context("no room to start in")?;
    let mut route = vec![p];
    for _ in 0..20 * n_stretches {
        if route.len() > n_stretches {
            break;
        }
        let p = route[route.len() - 1];
        // Through a doorway and a little beyond.
        let ways = graph.exits(cell).filter(|e| !graph[e.to].outdoor);
        let ways = ways.filter_map(|exit| {
            let normal = point(exit.portal.normal);
            let side = if exit.portal.cells[0] == cell {
                1.0
            } else {
                -1.0
            };
            let center = point(exit.portal.center());
            let (near, far) = (center - 0.3 * side * normal, center + 0.6 * side * normal);
            let is_there = site.sight.locate(far.as_vec3().to_array()) == Some(exit.to);
            let is_way = is_there && is_free(p, near) && is_free(near, far);
            is_way.then_some((exit.to, near, far))
        });
        let ways: Vec<_> = ways.collect();
        let least = ways.iter().map(|w| been[w.0.idx()]).min();
        let best: Vec<_> = ways
            .iter()
            .filter(|w| Some(been[w.0.idx()]) == least)
            .collect();
        if !best.is_empty() && rng.chance(0.6) {
            let &&(to, near, far) = &best[rng.below(best.len())];
            route.extend([near, far]);
            (cell, been[to.idx()]) = (to, been[to.idx()] + 1);
            continue;
        }
        // To another place of the room.
        let [low, high] = graph[cell].aabb.map(point);
        let mut q = low + (high - low) * DVec3::new(rng.unit(), 0.0, rng.unit());
        q.y = p.y;
        let is_in = site.sight.locate(q.as_vec3().to_array()) == Some(cell);
        if is_in && p.distance(q) > 0.5 && is_free(p, q) {
            route.push(q);
        }
    }
    Ok(route)
}
