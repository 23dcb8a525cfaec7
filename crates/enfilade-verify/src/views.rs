//! *Conservative per frame*: the first hit of every ray inside a view is in the answer.
//!
//! The caller provides the queries, so that this crate does not depend on the run-time and shares only the geometry
//! below both. All structural triangles of the world block.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

use enfilade_cpg::{CellId, World};
use enfilade_geom::{Bvh, DVec3, Ray, Triangle, shown};
use rayon::prelude::*;
use serde::Serialize;

use crate::details::triangles_of;
use crate::options::VerifyOptions;
use crate::rng::Rng;
use crate::subject::{Subject, point_in, to_dvec};

/// Views that share a random sequence and a seer. Fixed, so that the number of threads does not change the views.
const CHUNK: u64 = 64;

/// A camera: the input of a seer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ViewQuery {
    /// Position. [Units: wu]
    pub eye: [f32; 3],
    /// View direction, of any length.
    pub toward: [f32; 3],
    /// Up direction of the picture, of any length, not parallel to `toward`.
    pub up: [f32; 3],
    /// Vertical angle of view; all around if larger than pi. [Units: rad]
    pub fov_y: f32,
    /// Width of the picture divided by its height.
    pub aspect: f32,
}

/// The answer of a seer: marks on triangles, details and cells. Marking twice has no further effect.
#[derive(Debug)]
pub struct ViewAnswer<'a> {
    first_of_batch: &'a [u32],
    stamp: u32,
    triangles: Vec<u32>,
    details: Vec<u32>,
    cells: Vec<u32>,
    n: [u64; 3],
}

impl ViewAnswer<'_> {
    /// Marks triangle `index` of structural batch `batch` as visible.
    pub fn add_triangle(&mut self, batch: u32, index: u32) {
        let Some(&first) = self.first_of_batch.get(batch as usize) else {
            return;
        };
        mark(
            &mut self.triangles,
            first + index,
            self.stamp,
            &mut self.n[0],
        );
    }

    /// Marks a detail object as visible.
    pub fn add_detail(&mut self, detail: u32) {
        mark(&mut self.details, detail, self.stamp, &mut self.n[1]);
    }

    /// Marks a cell as visible. Only counted, not judged.
    pub fn add_cell(&mut self, cell: u32) {
        mark(&mut self.cells, cell, self.stamp, &mut self.n[2]);
    }
}

fn mark(stamps: &mut [u32], at: u32, stamp: u32, n: &mut u64) {
    if let Some(s) = stamps.get_mut(at as usize)
        && *s != stamp
    {
        *s = stamp;
        *n += 1;
    }
}

/// Answers views; one is made for each chunk of them.
pub type Seer<'a> = Box<dyn FnMut(&ViewQuery, &mut ViewAnswer<'_>) + 'a>;

/// Extent of a check of views.
#[derive(Clone, Copy, Debug)]
pub struct ViewOptions {
    /// Views tried.
    pub views: u64,
    /// Rays per view.
    pub rays_per_view: u64,
    /// Seed of the random sequences; equal seeds give equal reports.
    pub seed: u64,
    /// Half the distance below which nothing is judged; `None` for [`tolerance`](crate::tolerance) of the triangles.
    /// [Units: wu]
    pub tolerance: Option<f64>,
    /// True to place eyes in indoor cells only, at ordinary positions and angles, to measure how tight answers are.
    /// Otherwise they also stand in portals, in walls and outside of everything.
    pub ordinary: bool,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            views: 10_000,
            rays_per_view: 100,
            seed: 1,
            tolerance: None,
            ordinary: false,
        }
    }
}

/// An object that a ray hit but the answer lacks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Missed {
    /// The view.
    pub view: ViewQuery,
    /// Index of the view.
    pub number: u64,
    /// The cell that the eye is in.
    pub eye_cell: Option<u32>,
    /// Its name.
    #[serde(skip)]
    pub eye_cell_name: Option<String>,
    /// The batch of the triangle hit, or none for a detail.
    pub batch: Option<u32>,
    /// Index of the triangle in its batch, or of the detail.
    pub index: u32,
    /// Position of the hit. [Units: wu]
    pub at: [f64; 3],
}

/// The outcome of [`verify_views`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ViewReport {
    /// Views judged.
    pub views: u64,
    /// Skipped views: the eye was on a surface in every attempt.
    pub on_surface: u64,
    /// Views from a point outside all cells.
    pub lost_eyes: u64,
    /// Rays cast.
    pub rays: u64,
    /// Hits of structural triangles and details, repeated ones included.
    pub hits: u64,
    /// Hits missing in the answer that passed an edge within twice the tolerance: not judged.
    pub grazing: u64,
    /// Hits missing in the answer.
    pub missed: u64,
    /// The first few of these.
    pub examples: Vec<Missed>,
    /// Sums over views: triangles, details and cells in the answer.
    pub answered: [u64; 3],
    /// Sums over views: distinct triangles and details hit, and cells in which rays ended.
    pub hit: [u64; 3],
    /// Sums over views: triangles of the details in the answer, and of those hit.
    pub detail_triangles: [u64; 2],
    /// For each view, for medians: triangles (structural and detail) in the answer, and of the hit objects.
    #[serde(skip)]
    pub by_view: Vec<[u64; 2]>,
}

impl ViewReport {
    /// Returns `true` if nothing was found missing. Means nothing if nothing was judged.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.missed == 0
    }

    fn merged(mut self, other: Self) -> Self {
        self.views += other.views;
        self.on_surface += other.on_surface;
        self.lost_eyes += other.lost_eyes;
        self.rays += other.rays;
        self.hits += other.hits;
        self.grazing += other.grazing;
        self.missed += other.missed;
        self.examples.extend(other.examples);
        self.examples.sort_by_key(|m| m.number);
        self.examples.truncate(8);
        for k in 0..3 {
            self.answered[k] += other.answered[k];
            self.hit[k] += other.hit[k];
        }
        for k in 0..2 {
            self.detail_triangles[k] += other.detail_triangles[k];
        }
        self.by_view.extend(other.by_view);
        self
    }
}

impl fmt::Display for ViewReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "conservative per frame: {} of {} hits missed ({} rays in {} views; {} grazing, {} eyes in no cell)",
            self.missed, self.hits, self.rays, self.views, self.grazing, self.lost_eyes
        )?;
        let per_view = |n: u64| n as f64 / self.views.max(1) as f64;
        writeln!(
            f,
            "  per view: {:.1} triangles answered, {:.1} hit; {:.2} details answered, {:.2} hit; {:.2} cells answered, {:.2} reached",
            per_view(self.answered[0]),
            per_view(self.hit[0]),
            per_view(self.answered[1]),
            per_view(self.hit[1]),
            per_view(self.answered[2]),
            per_view(self.hit[2]),
        )?;
        for m in &self.examples {
            let what = m
                .batch
                .map_or("detail".into(), |b| format!("batch {b}, triangle"));
            writeln!(
                f,
                "  missed: {what} {} at {:?}, view {} from {:?} (in {}) along {:?}, fov {}, aspect {}",
                m.index,
                m.at,
                m.number,
                m.view.eye,
                shown(m.eye_cell_name.as_deref().unwrap_or("no cell")),
                m.view.toward,
                m.view.fov_y,
                m.view.aspect
            )?;
        }
        Ok(())
    }
}

/// Data for judging views.
struct Court<'a> {
    subject: Subject<'a>,
    first_of_batch: Vec<u32>,
    n_triangles: usize,
    details: Bvh,
    /// For each triangle of details, its detail.
    detail_of: Vec<u32>,
    detail_sizes: Vec<u64>,
    indoors: Vec<CellId>,
}

/// Tries random views on `world` with random rays in each; `make_seer` answers them.
///
/// `world` must be valid. Uses the current rayon pool; the report does not depend on it.
#[must_use]
pub fn verify_views<'s>(
    world: &World,
    options: &ViewOptions,
    make_seer: &(dyn Fn() -> Seer<'s> + Sync),
    progress: &(dyn Fn(u64, u64) + Sync),
) -> ViewReport {
    let court = Court::new(world, options);
    let done = AtomicU64::new(0);
    let reports: Vec<ViewReport> = (0..options.views.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut seer = make_seer();
            let mut rng = Rng::new(options.seed ^ 0x5eed_0f5e_e500_0000, chunk);
            let mut answer = ViewAnswer {
                first_of_batch: &court.first_of_batch,
                stamp: 0,
                triangles: vec![0; court.n_triangles],
                details: vec![0; world.details.len()],
                cells: vec![0; world.graph.cells.len()],
                n: [0; 3],
            };
            let mut hits = Hits::new(&court);
            let mut report = ViewReport::default();
            let first = chunk * CHUNK;
            let n = CHUNK.min(options.views - first);
            for i in first..first + n {
                court.try_view(
                    i,
                    options,
                    &mut rng,
                    &mut *seer,
                    &mut answer,
                    &mut hits,
                    &mut report,
                );
            }
            progress(done.fetch_add(n, Ordering::Relaxed) + n, options.views);
            report
        })
        .collect();
    reports
        .into_iter()
        .fold(ViewReport::default(), ViewReport::merged)
}

/// The hits of the rays of one view.
struct Hits {
    stamp: u32,
    triangles: Vec<u32>,
    details: Vec<u32>,
    cells: Vec<u32>,
    n: [u64; 3],
    n_detail_triangles: u64,
}

impl Hits {
    fn new(court: &Court<'_>) -> Self {
        Self {
            stamp: 0,
            triangles: vec![0; court.n_triangles],
            details: vec![0; court.detail_sizes.len()],
            cells: vec![0; court.subject.cells.len()],
            n: [0; 3],
            n_detail_triangles: 0,
        }
    }
}

impl<'a> Court<'a> {
    fn new(world: &'a World, options: &ViewOptions) -> Self {
        let verify = VerifyOptions {
            seed: options.seed,
            tolerance: options.tolerance,
            ..VerifyOptions::default()
        };
        let subject = Subject::new(world, None, &verify);
        let mut first_of_batch = Vec::new();
        let mut n_triangles = 0;
        for batch in &world.batches {
            first_of_batch.push(n_triangles as u32);
            n_triangles += batch.primitive.indices.len() / 3;
        }
        let mut triangles: Vec<Triangle> = Vec::new();
        let mut detail_of = Vec::new();
        let mut detail_sizes = Vec::new();
        for (i, detail) in world.details.iter().enumerate() {
            let before = triangles.len();
            triangles.extend(triangles_of(world, detail));
            detail_sizes.push((triangles.len() - before) as u64);
            detail_of.resize(triangles.len(), i as u32);
        }
        let indoors = subject
            .sampled
            .iter()
            .copied()
            .filter(|c| !world.graph[*c].outdoor)
            .collect();
        Self {
            subject,
            first_of_batch,
            n_triangles,
            details: Bvh::build(&triangles),
            detail_of,
            detail_sizes,
            indoors,
        }
    }

    fn draw_eye(&self, rng: &mut Rng, i: u64, ordinary: bool) -> DVec3 {
        let s = &self.subject;
        let indoors = &self.indoors;
        if ordinary && !indoors.is_empty() {
            let cell = indoors[rng.below(indoors.len())];
            return s.point_in_cell(rng, cell);
        }
        match i % 4 {
            0 | 1 if !s.sampled.is_empty() => {
                let cell = s.sampled[rng.below(s.sampled.len())];
                s.point_in_cell(rng, cell)
            }
            // In a doorway: on its plane, or a little off it.
            2 if !s.crossable.is_empty() => {
                let portal = s.crossable[rng.below(s.crossable.len())];
                let p = s.point_of_portal(rng, portal);
                match i % 3 {
                    0 => p,
                    1 => p + rng.direction() * rng.log_range(1e-7, 1e-2),
                    _ => p + rng.direction() * rng.log_range(1e-3, 1.0),
                }
            }
            _ => point_in(rng, &s.padded),
        }
    }

    #[allow(
        clippy::too_many_arguments,
        reason = "one call, all of them the caller's own state"
    )]
    fn try_view(
        &self,
        i: u64,
        options: &ViewOptions,
        rng: &mut Rng,
        seer: &mut dyn FnMut(&ViewQuery, &mut ViewAnswer<'_>),
        answer: &mut ViewAnswer<'_>,
        hits: &mut Hits,
        report: &mut ViewReport,
    ) {
        let s = &self.subject;
        let near = 2.0 * s.eps;
        let eye = (0..8).find_map(|_| {
            // The seer's input is in `f32`; start the rays from exactly the same point.
            let eye = self.draw_eye(rng, i, options.ordinary).as_vec3().as_dvec3();
            let on_surface = s.blockers.nearest(eye, near).is_some();
            let is_usable = !on_surface && (!options.ordinary || s.locator.locate(eye).is_some());
            is_usable.then_some(eye)
        });
        let Some(eye) = eye else {
            report.on_surface += 1;
            return;
        };
        let (view, frame) = draw_view(rng, i, eye, options.ordinary);
        let eye_cell = s.locator.locate(eye);
        report.views += 1;
        report.lost_eyes += u64::from(eye_cell.is_none());
        answer.stamp += 1;
        answer.n = [0; 3];
        seer(&view, answer);
        hits.stamp += 1;
        hits.n = [0; 3];
        hits.n_detail_triangles = 0;

        for _ in 0..options.rays_per_view {
            let direction = match frame {
                None => rng.direction(),
                Some([right, up, forward]) => {
                    // A millionth short of the edge, where rounding decides what is inside.
                    let inside = 1.0 - 1e-6;
                    let (x, y) = (rng.range(-inside, inside), rng.range(-inside, inside));
                    forward + right * x + up * y
                }
            };
            report.rays += 1;
            let mut ray = Ray {
                origin: eye,
                direction,
                t_max: f64::INFINITY,
            };
            if let Some(hit) = s.blockers.closest_hit(&ray, |_| false) {
                ray.t_max = hit.t;
                report.hits += 1;
                mark(
                    &mut hits.triangles,
                    hit.triangle,
                    hits.stamp,
                    &mut hits.n[0],
                );
                let before = ray.at(hit.t - near / direction.length());
                if let Some(cell) = s.locator.locate(before) {
                    mark(&mut hits.cells, cell.0, hits.stamp, &mut hits.n[2]);
                }
                if answer.triangles[hit.triangle as usize] != answer.stamp
                    && !s.is_thin(hit.triangle)
                {
                    let batch = s.own[hit.triangle as usize].1;
                    let index = hit.triangle - self.first_of_batch[batch as usize];
                    self.miss(i, &view, eye_cell, &ray, hit.t, Some(batch), index, report);
                }
            }
            // Details do not block: all of them before the wall are visible.
            self.details.for_each_hit(&ray, |hit| {
                let detail = self.detail_of[hit.triangle as usize];
                report.hits += 1;
                let before = hits.n[1];
                mark(&mut hits.details, detail, hits.stamp, &mut hits.n[1]);
                if hits.n[1] > before {
                    hits.n_detail_triangles += self.detail_sizes[detail as usize];
                }
                if answer.details[detail as usize] != answer.stamp {
                    self.miss(i, &view, eye_cell, &ray, hit.t, None, detail, report);
                }
            });
        }
        let answered_details: u64 = (0..self.detail_sizes.len())
            .filter(|&d| answer.details[d] == answer.stamp)
            .map(|d| self.detail_sizes[d])
            .sum();
        for k in 0..3 {
            report.answered[k] += answer.n[k];
            report.hit[k] += hits.n[k];
        }
        report.detail_triangles[0] += answered_details;
        report.detail_triangles[1] += hits.n_detail_triangles;
        report.by_view.push([
            answer.n[0] + answered_details,
            hits.n[0] + hits.n_detail_triangles,
        ]);
    }

    #[allow(clippy::too_many_arguments, reason = "the fields of a `Missed`")]
    fn miss(
        &self,
        number: u64,
        view: &ViewQuery,
        eye_cell: Option<CellId>,
        ray: &Ray,
        t: f64,
        batch: Option<u32>,
        index: u32,
        report: &mut ViewReport,
    ) {
        let at = ray.at(t);
        let past = at + ray.direction.normalize() * (2.0 * self.subject.eps);
        if self.subject.is_grazing(ray.origin, past) {
            report.grazing += 1;
            return;
        }
        report.missed += 1;
        if report.examples.len() < 8 {
            report.examples.push(Missed {
                view: *view,
                number,
                eye_cell: eye_cell.map(|c| c.0),
                eye_cell_name: eye_cell.map(|c| self.subject.world.graph[c].name.clone()),
                batch,
                index,
                at: at.to_array(),
            });
        }
    }
}

/// Returns a camera at `eye`, with half the picture's axes and the direction to its center; `None` for a view all
/// around.
fn draw_view(rng: &mut Rng, i: u64, eye: DVec3, ordinary: bool) -> (ViewQuery, Option<[DVec3; 3]>) {
    let around = !ordinary && i % 16 == 5;
    let (toward, up) = if ordinary || rng.unit() < 0.5 {
        // A person's view: upright, slightly up or down.
        let angle = rng.range(0.0, std::f64::consts::TAU);
        let level = rng.range(-0.3, 0.3);
        (DVec3::new(angle.cos(), level, angle.sin()), DVec3::Y)
    } else {
        (rng.direction(), rng.direction())
    };
    let fov_y = if around {
        rng.range(3.2, 6.0)
    } else if ordinary {
        1.0
    } else {
        rng.log_range(0.05, 2.4)
    };
    let aspect = if ordinary { 1.6 } else { rng.range(0.4, 2.5) };
    let view = ViewQuery {
        eye: eye.as_vec3().to_array(),
        toward: toward.as_vec3().to_array(),
        up: up.as_vec3().to_array(),
        fov_y: fov_y as f32,
        aspect: aspect as f32,
    };
    // Start from the rounded values, as the seer does.
    let forward = to_dvec(view.toward).normalize();
    let right = forward.cross(to_dvec(view.up)).normalize_or(DVec3::X);
    let tan_y = (f64::from(view.fov_y) * 0.5).tan();
    let tan_x = tan_y * f64::from(view.aspect);
    let frame = [right * tan_x, right.cross(forward) * tan_y, forward];
    (view, (!around).then_some(frame))
}
