//! Finds and counts defects of a scene's surface, and changes nothing.
//!
//! Vertices closer than the welding distance count as one. Edges are sorted, not hashed, and every search in space
//! has a budget, so that a million triangles take seconds.

use crate::finding::{Example, Finding, MAX_EXAMPLES};
use crate::repair::holes_of;
use crate::shells::Shells;
use crate::{BadOption, crossing, tjunction};
use enfilade_geom::scene::{Object, Primitive, Role, Scene, TriangleSource};
use enfilade_geom::{DVec3, Triangle, shown, triangle_area_normal};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::fmt;

/// Thresholds and scope of the search for defects.
#[derive(Clone, Debug, PartialEq)]
pub struct CleaningOptions {
    /// Largest distance of vertices that count as one. [Units: wu] [Limit: 1e-9 to 1]
    pub weld: f64,
    /// Largest distance of a vertex from the inside of an open edge that makes a T-junction. [Units: wu]
    /// [Limit: at least `weld`, at most 1]
    pub t_junction: f64,
    /// Include detail objects.
    pub has_detail: bool,
    /// Most pairs of triangles tested for crossing; 0 tests none.
    pub crossing_pairs: u64,
}

impl Default for CleaningOptions {
    fn default() -> Self {
        Self {
            weld: 1e-5,
            t_junction: 1e-4,
            has_detail: false,
            crossing_pairs: 20_000_000,
        }
    }
}

/// Defects of a scene's surface: counts with a few places each, in world space.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct CleaningReport {
    /// Triangles examined.
    pub n_triangles: u64,
    /// Vertices equal to an earlier one of their primitive in every attribute.
    pub duplicate_vertices: Finding,
    /// Triangles with the same three vertices as an earlier one, in any order and object.
    pub duplicate_triangles: Finding,
    /// Triangles lower than the welding distance: a point or a line.
    pub degenerate_triangles: Finding,
    /// Ends of open edges that lie inside another open edge.
    pub t_junctions: Finding,
    /// The search for T-junctions was completed.
    pub is_complete: bool,
    /// Edges used by one triangle only, over all objects.
    pub open_edges: Finding,
    /// Loops of open edges across which the surrounding surface continues, largest first: triangles are missing. Rims
    /// of sheets do not count, nor does a missing whole face: a box may be meant to be open.
    pub holes: Finding,
    /// The search for holes was completed. It is skipped above two million triangles.
    pub is_holes_complete: bool,
    /// Edges used by more than two triangles of one object.
    pub non_manifold_edges: Finding,
    /// Triangles turned against most of their shell.
    pub flipped_triangles: Finding,
    /// Closed shells whose front faces look inwards: inside out, or rooms modeled from within.
    pub inverted_shells: Finding,
    /// Pairs of triangles of one object that share no vertex and run through each other.
    pub crossing_triangles: Finding,
    /// The search for crossing triangles was completed.
    pub is_crossing_complete: bool,
    /// Shells of the objects, by kind.
    pub shells: ShellCounts,
    /// From the import: polygons with a reflex vertex.
    pub concave_polygons: Finding,
    /// From the import: polygons whose outline crosses itself.
    pub crossing_polygons: Finding,
    /// From the import: polygons with a vertex more than 1 mm off their plane.
    pub non_planar_polygons: Finding,
    /// From the import: vertices with a coordinate that is not finite, dropped with their triangles.
    pub nonfinite_vertices: Finding,
}

/// Numbers of shells by kind. A shell is triangles of an object connected over edges with exactly two of them (after
/// Gjørup 1999, §2.4.1).
///
/// Where triangles disagree in orientation, the majority decides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ShellCounts {
    /// Closed, front faces outwards: solid matter inside.
    pub solids: u64,
    /// Closed, front faces inwards: a room inside, or a shell that is inside out.
    pub rooms: u64,
    /// With a rim, an edge that more than two triangles use, or one side only.
    pub open: u64,
}

impl CleaningReport {
    /// Returns the findings with their names, in display order.
    #[must_use]
    pub fn findings(&self) -> [(&'static str, &Finding); 14] {
        [
            ("duplicate vertices", &self.duplicate_vertices),
            ("duplicate triangles", &self.duplicate_triangles),
            ("degenerate triangles", &self.degenerate_triangles),
            ("T-junctions", &self.t_junctions),
            ("open edges", &self.open_edges),
            ("holes in surfaces", &self.holes),
            ("non-manifold edges", &self.non_manifold_edges),
            ("flipped triangles", &self.flipped_triangles),
            ("inverted shells", &self.inverted_shells),
            ("crossing triangles", &self.crossing_triangles),
            ("concave polygons", &self.concave_polygons),
            ("crossing polygons", &self.crossing_polygons),
            ("non-planar polygons", &self.non_planar_polygons),
            ("non-finite vertices", &self.nonfinite_vertices),
        ]
    }
}

/// One row for each finding that occurs.
impl fmt::Display for CleaningReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut found = self
            .findings()
            .into_iter()
            .filter(|(_, f)| f.n > 0)
            .peekable();
        if found.peek().is_some() {
            writeln!(f, "{:<22} {:>9}  example", "finding", "count")?;
        }
        for (name, finding) in found {
            write!(f, "{name:<22} {:>9}", finding.n)?;
            if let Some(e) = finding.examples.first() {
                let p = e.position;
                write!(f, "  {:.3} {:.3} {:.3}", p.x, p.y, p.z)?;
                if !e.name.is_empty() {
                    write!(f, " in '{}'", shown(&e.name))?;
                }
            }
            writeln!(f)?;
        }
        if !self.is_complete {
            writeln!(f, "T-junctions: lower bound; the search was stopped")?;
        }
        if !self.is_crossing_complete {
            writeln!(f, "crossing triangles: lower bound; the search was stopped")?;
        }
        if !self.is_holes_complete {
            writeln!(f, "holes in surfaces: lower bound; the search was stopped")?;
        }
        let ShellCounts {
            solids,
            rooms,
            open,
        } = self.shells;
        for (name, n) in [("solids", solids), ("rooms", rooms), ("open", open)] {
            if n > 0 {
                writeln!(f, "{:<22} {n:>9}", format!("shells: {name}"))?;
            }
        }
        write!(f, "{:<22} {:>9}", "of triangles", self.n_triangles)
    }
}

/// Finds defects in a scene; those that only an importer sees are left empty.
///
/// Time: `n log n` for `n` triangles; memory: about 150 bytes per triangle.
///
/// # Errors
///
/// When an option is out of range.
///
/// # Panics
///
/// When the scene breaks its own promises (an index out of range).
pub fn cleaning_report(
    scene: &Scene,
    options: &CleaningOptions,
) -> Result<CleaningReport, BadOption> {
    let is_length = |x: f64, least: f64| x.is_finite() && (least..=1.0).contains(&x);
    for (option, x, least) in [
        ("weld", options.weld, 1e-9),
        ("t_junction", options.t_junction, options.weld),
    ] {
        if !is_length(x, least) {
            let problem = format!("{x} m is not between {least} and 1");
            return Err(BadOption { option, problem });
        }
    }
    let mut report = CleaningReport::default();
    let chosen: Vec<usize> = (0..scene.objects.len())
        .filter(|&i| options.has_detail || scene.objects[i].role == Role::Structural)
        .collect();
    find_duplicate_vertices(&mut report, scene, &chosen);
    let soup = Soup::weld(scene, &chosen, options.weld);
    report.n_triangles = soup.triangles.len() as u64;
    find_odd_triangles(&mut report, scene, &soup, options.weld);
    find_odd_edges(&mut report, scene, &soup, options);
    let (crossing, ()) = rayon::join(
        || crossing_triangles(scene, &soup, options),
        || find_holes(&mut report, scene),
    );
    (report.crossing_triangles, report.is_crossing_complete) = crossing;
    Ok(report)
}

/// Most triangles for the search for holes, which takes 300 bytes per triangle.
const MAX_HOLE_TRIANGLES: u64 = 2_000_000;

fn find_holes(report: &mut CleaningReport, scene: &Scene) {
    report.is_holes_complete = report.open_edges.n == 0;
    if report.is_holes_complete || report.n_triangles > MAX_HOLE_TRIANGLES {
        return;
    }
    let (holes, is_complete) = holes_of(scene);
    report.is_holes_complete = is_complete;
    for hole in holes.into_iter().filter(|h| h.is_torn) {
        let name = || scene.objects[hole.object as usize].name.clone();
        report.holes.add(hole.position, name);
    }
}

/// Triangles over welded points.
struct Soup {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    sources: Vec<TriangleSource>,
}

impl Soup {
    fn weld(scene: &Scene, chosen: &[usize], distance: f64) -> Self {
        let mut welder = Welder::new(distance);
        let mut soup = Self {
            points: Vec::new(),
            triangles: Vec::new(),
            sources: Vec::new(),
        };
        for &o in chosen {
            let object = &scene.objects[o];
            for (p, primitive) in scene.meshes[object.mesh as usize]
                .primitives
                .iter()
                .enumerate()
            {
                let points = world_points(object, primitive);
                let welded: Vec<u32> = points.iter().map(|&x| welder.weld(x)).collect();
                for (t, corners) in primitive.triples().iter().enumerate() {
                    // Points that are not finite cannot be welded.
                    if corners.iter().any(|&i| !points[i as usize].is_finite()) {
                        continue;
                    }
                    soup.triangles.push(corners.map(|i| welded[i as usize]));
                    soup.sources.push(TriangleSource {
                        object: o as u32,
                        primitive: p as u32,
                        triangle: t as u32,
                    });
                }
            }
        }
        soup.points = welder.points;
        soup
    }

    fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|i| self.points[i as usize])
    }

    fn center(&self, t: usize) -> DVec3 {
        self.corners(t).iter().sum::<DVec3>() / 3.0
    }

    fn name(&self, scene: &Scene, t: usize) -> String {
        scene.objects[self.sources[t].object as usize].name.clone()
    }
}

/// World positions, rounded as [`Scene::world_triangle`] rounds them.
fn world_points(object: &Object, primitive: &Primitive) -> Vec<DVec3> {
    primitive
        .positions
        .iter()
        .map(|p| {
            let local = DVec3::from_array(p.map(f64::from));
            object
                .transform
                .transform_point3(local)
                .as_vec3()
                .as_dvec3()
        })
        .collect()
}

/// Numbers points; a point within the distance of an earlier one gets its number.
struct Welder {
    distance: f64,
    points: Vec<DVec3>,
    grid: HashMap<[i64; 3], u32>,
    /// Next point in the same grid cell.
    next: Vec<u32>,
}

impl Welder {
    fn new(distance: f64) -> Self {
        Self {
            distance,
            points: Vec::new(),
            grid: HashMap::new(),
            next: Vec::new(),
        }
    }

    fn weld(&mut self, p: DVec3) -> u32 {
        // Cells four distances wide: most points lie well inside and need one lookup.
        let width = 4.0 * self.distance;
        let cell = |q: DVec3| (q / width).floor().to_array().map(|c| c as i64);
        let reach = DVec3::splat(self.distance);
        let (low, high) = (cell(p - reach), cell(p + reach));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let mut at = self.grid.get(&[x, y, z]).copied().unwrap_or(u32::MAX);
                    while let Some(q) = self.points.get(at as usize) {
                        if q.distance_squared(p) <= self.distance * self.distance {
                            return at;
                        }
                        at = self.next[at as usize];
                    }
                }
            }
        }
        let number = self.points.len() as u32;
        let head = self.grid.insert(cell(p), number);
        self.points.push(p);
        self.next.push(head.unwrap_or(u32::MAX));
        number
    }
}

fn find_duplicate_vertices(report: &mut CleaningReport, scene: &Scene, chosen: &[usize]) {
    let mut is_done = vec![false; scene.meshes.len()];
    for &o in chosen {
        let object = &scene.objects[o];
        if std::mem::replace(&mut is_done[object.mesh as usize], true) {
            continue;
        }
        for p in &scene.meshes[object.mesh as usize].primitives {
            let mut seen: HashSet<Box<[u32]>> = HashSet::with_capacity(p.positions.len());
            let mut key: Vec<u32> = Vec::new();
            for (i, position) in p.positions.iter().enumerate() {
                key.clear();
                // Adding zero turns -0 into 0.
                let bits = |c: &f32| (c + 0.0).to_bits();
                key.extend(position.iter().map(bits));
                key.extend(p.normals.get(i).into_iter().flatten().map(bits));
                key.extend(p.tangents.get(i).into_iter().flatten().map(bits));
                key.extend(p.colors.get(i).into_iter().flatten().map(bits));
                key.extend(p.uvs.iter().filter_map(|s| s.get(i)).flatten().map(bits));
                if !seen.insert(key.as_slice().into()) {
                    let local = DVec3::from_array(position.map(f64::from));
                    let world = object.transform.transform_point3(local);
                    report.duplicate_vertices.add(world, || object.name.clone());
                }
            }
        }
    }
}

fn find_odd_triangles(report: &mut CleaningReport, scene: &Scene, soup: &Soup, weld: f64) {
    let mut order: Vec<([u32; 3], u32)> = Vec::with_capacity(soup.triangles.len());
    for (t, corners) in soup.triangles.iter().enumerate() {
        let [a, b, c] = soup.corners(t);
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        let area = triangle_area_normal(&[a, b, c]).length();
        if is_collapsed(corners) || area <= weld * longest {
            report
                .degenerate_triangles
                .add(soup.center(t), || soup.name(scene, t));
        }
        let mut sorted = *corners;
        sorted.sort_unstable();
        order.push((sorted, t as u32));
    }
    order.par_sort_unstable();
    for pair in order.windows(2) {
        if pair[0].0 == pair[1].0 && !is_collapsed(&pair[0].0) {
            let t = pair[1].1 as usize;
            report
                .duplicate_triangles
                .add(soup.center(t), || soup.name(scene, t));
        }
    }
}

fn is_collapsed(t: &[u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[2] == t[0]
}

/// One triangle's use of an edge.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeUse {
    ends: [u32; 2],
    object: u32,
    triangle: u32,
    /// Traversed from the greater end to the lesser.
    is_reverse: bool,
}

fn find_odd_edges(
    report: &mut CleaningReport,
    scene: &Scene,
    soup: &Soup,
    options: &CleaningOptions,
) {
    let mut uses: Vec<EdgeUse> = Vec::with_capacity(soup.triangles.len() * 3);
    for (t, corners) in soup.triangles.iter().enumerate() {
        if is_collapsed(corners) {
            continue;
        }
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            uses.push(EdgeUse {
                ends: [a.min(b), a.max(b)],
                object: soup.sources[t].object,
                triangle: t as u32,
                is_reverse: a > b,
            });
        }
    }
    uses.par_sort_unstable();
    let mut shells = Shells::new(soup.triangles.len());
    let mut open: Vec<[u32; 2]> = Vec::new();
    for edge in uses.chunk_by(|a, b| a.ends == b.ends) {
        let middle = || {
            let [a, b] = edge[0].ends.map(|i| soup.points[i as usize]);
            (a + b) * 0.5
        };
        let name = |u: &EdgeUse| scene.objects[u.object as usize].name.clone();
        if edge.len() == 1 {
            open.push(edge[0].ends);
            report.open_edges.add(middle(), || name(&edge[0]));
        }
        for of_object in edge.chunk_by(|a, b| a.object == b.object) {
            match of_object {
                [one, other] => {
                    let is_same = one.is_reverse == other.is_reverse;
                    shells.join(one.triangle, other.triangle, is_same);
                }
                [one] => shells.mark_unclosed(one.triangle),
                many => {
                    report.non_manifold_edges.add(middle(), || name(&many[0]));
                    many.iter().for_each(|u| shells.mark_unclosed(u.triangle));
                }
            }
        }
    }
    find_odd_shells(report, scene, soup, &mut shells);
    let found = tjunction::find(&soup.points, &open, options.t_junction, MAX_EXAMPLES);
    report.is_complete = found.is_complete;
    report.t_junctions.n = found.n;
    for point in found.examples {
        let p = soup.points[point as usize];
        let owner = soup.triangles.iter().position(|t| t.contains(&point));
        let name = owner.map_or_else(String::new, |t| soup.name(scene, t));
        report
            .t_junctions
            .examples
            .push(Example { name, position: p });
    }
}

#[derive(Clone, Copy, Default)]
struct ShellSum {
    n: [u64; 2],
    is_unclosed: bool,
    /// Six times the volume with all triangles oriented as the root is, front faces outwards.
    volume: f64,
}

/// Counts crossing pairs of triangles of one object; `false` if the search was stopped.
fn crossing_triangles(scene: &Scene, soup: &Soup, options: &CleaningOptions) -> (Finding, bool) {
    let mut found = Finding::default();
    let corners: Vec<Triangle> = (0..soup.triangles.len()).map(|t| soup.corners(t)).collect();
    let is_pair = |a: usize, b: usize| {
        let (t, u) = (soup.triangles[a], soup.triangles[b]);
        soup.sources[a].object == soup.sources[b].object && !t.iter().any(|p| u.contains(p))
    };
    let is_complete = crossing::for_each(
        &corners,
        options.weld,
        options.crossing_pairs,
        is_pair,
        |t, at| found.add(at, || soup.name(scene, t)),
    );
    (found, is_complete)
}

fn find_odd_shells(report: &mut CleaningReport, scene: &Scene, soup: &Soup, shells: &mut Shells) {
    let n = soup.triangles.len();
    let mut sums = vec![ShellSum::default(); n];
    let mut roots = vec![(0, false); n];
    for (t, slot) in roots.iter_mut().enumerate() {
        if is_collapsed(&soup.triangles[t]) {
            continue;
        }
        let (root, is_turned) = shells.root(t as u32);
        *slot = (root, is_turned);
        // Relative to a point of the shell, to keep precision far from the origin.
        let origin = soup.corners(root as usize)[0];
        let [a, b, c] = soup.corners(t).map(|p| p - origin);
        let sum = &mut sums[root as usize];
        sum.n[usize::from(is_turned)] += 1;
        sum.is_unclosed |= shells.is_unclosed[t] || shells.is_one_sided[t];
        sum.volume += a.dot(b.cross(c)) * if is_turned { -1.0 } else { 1.0 };
    }
    for (t, &(root, is_turned)) in roots.iter().enumerate() {
        let sum = sums[root as usize];
        if is_collapsed(&soup.triangles[t]) {
            continue;
        }
        let is_root_minor = sum.n[0] < sum.n[1];
        if is_turned != is_root_minor && sum.n[0] > 0 && sum.n[1] > 0 {
            report
                .flipped_triangles
                .add(soup.center(t), || soup.name(scene, t));
        }
        let volume = if is_root_minor {
            -sum.volume
        } else {
            sum.volume
        };
        if root as usize != t {
            continue;
        }
        let shells = &mut report.shells;
        if sum.is_unclosed {
            shells.open += 1;
        } else if volume < 0.0 {
            shells.rooms += 1;
            report
                .inverted_shells
                .add(soup.center(t), || soup.name(scene, t));
        } else {
            shells.solids += 1;
        }
    }
}
