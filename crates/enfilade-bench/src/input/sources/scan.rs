//! Scans of shared buildings, rendered: rays from stations, with the noise of a scanner, holes, and clutter in the rooms.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::cpg::wire::encode_glb;
use enfilade::geom::scene::Role;
use enfilade::geom::{Aabb, DVec3, Triangle};
use enfilade::import::{ImportOptions, decode_ply, import};
use enfilade::internals::geom::{Bvh, Ray};
use enfilade_testkit::Rng;
use serde_json::{Value, json};

use crate::kept::Kept;
use crate::rooms::score::{Score, inspect, list, score_world, text, vec3};
use crate::rows::{Figure, baked, folder_of};

/// Bars of the issue: shares of rooms and of doors that are not found.
const ROOMS: f64 = 0.15;
const DOORS: f64 = 0.2;

/// Rays of a station around, and from pole to pole.
const RAYS: [usize; 2] = [1000, 500];
/// Noise of distances, one standard deviation. [Units: wu]
const NOISE: f64 = 0.005;
/// Squares of rays, of which a share is lost: black, shiny or wet surfaces.
const HOLE: usize = 12;
const LOST: f64 = 0.03;
/// Variable with a folder in which scans, their worlds and truths are kept.
const KEPT: &str = "ENFILADE_SCANS";
/// Boxes of clutter in each room.
const CLUTTER: usize = 3;

/// A building with places to stand in each room.
struct Building {
    triangles: Vec<Triangle>,
    truth: Value,
    /// For each room, points with much room around, the best first; their least height is the floor.
    places: Vec<(String, Vec<DVec3>)>,
    outdoors: Vec<DVec3>,
}

impl Building {
    fn read(folder: &Path) -> anyhow::Result<Self> {
        let options = ImportOptions::default();
        let scene = import(&[folder.join("scene.glb")], &[], &options)?.scene;
        let sources = scene.triangle_sources(Role::Structural);
        let triangles: Vec<Triangle> = sources.map(|s| scene.world_triangle(s)).collect();
        let truth = std::fs::read_to_string(folder.join("truth.json"))?;
        let truth: Value = serde_json::from_str(&truth)?;
        let bvh = Bvh::build(&triangles);
        let clearance = |p: DVec3| bvh.nearest(p, 10.0).map_or(10.0, |n| n.distance);
        let place = |room: &Value| {
            let floor = room["aabb"]["min"][1].as_f64().unwrap_or(0.0);
            let eye = |p: [f64; 3]| DVec3::new(p[0], floor + 1.5, p[2]);
            let mut points: Vec<DVec3> = (list(&room["sample_points"]).iter())
                .filter_map(vec3)
                .map(eye)
                .collect();
            points.sort_by(|a, b| clearance(*b).total_cmp(&clearance(*a)));
            (text(&room["id"]), points)
        };
        let mut places: Vec<_> = list(&truth["rooms"]).iter().map(place).collect();
        places.retain(|(_, points)| !points.is_empty());
        // One storey after the other, each from one side.
        places.sort_by(|(_, a), (_, b)| {
            let key = |p: &DVec3| ((p.y / 2.0).round(), p.x);
            key(&a[0])
                .partial_cmp(&key(&b[0]))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        let around = bvh.bounds().expanded(4.0);
        let eye = bvh.bounds().min.y.max(0.0) + 1.6;
        let outdoors = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[i, j]| {
            let at = |k: usize, low: f64, high: f64| if k == 0 { low } else { high };
            DVec3::new(
                at(i, around.min.x, around.max.x),
                eye,
                at(j, around.min.z, around.max.z),
            )
        });
        Ok(Self {
            triangles,
            truth,
            places,
            outdoors: outdoors.to_vec(),
        })
    }

    /// Returns `n` stations in rooms: one in each of as many as there are stations, then the second in each, and so on; and those
    /// outdoors.
    fn stations(&self, n: usize, is_outdoors_too: bool) -> Vec<DVec3> {
        let apart = |points: &[DVec3]| {
            let mut chosen: Vec<DVec3> = vec![points[0]];
            for p in points {
                if chosen.iter().all(|c| c.distance(*p) > 1.5) {
                    chosen.push(*p);
                }
            }
            chosen
        };
        let places: Vec<Vec<DVec3>> = self.places.iter().map(|(_, p)| apart(p)).collect();
        let most = places.iter().map(Vec::len).max().unwrap_or(0);
        let all = (0..most).flat_map(|k| places.iter().filter_map(move |p| p.get(k).copied()));
        let mut all: Vec<DVec3> = all.take(n).collect();
        if is_outdoors_too {
            all.extend(&self.outdoors);
        }
        all
    }

    /// Puts boxes on the floors of rooms, away from stations, and returns them.
    fn clutter(&mut self, stations: &[DVec3], rng: &mut Rng) -> Vec<Aabb> {
        let mut boxes = Vec::new();
        for (_, points) in &self.places {
            for _ in 0..CLUTTER {
                let at = points[rng.below(points.len())];
                let half = DVec3::new(rng.range(0.2, 0.45), 0.0, rng.range(0.2, 0.45));
                let (low, high) = (at - DVec3::Y * 1.5 - half, at + half);
                let top = low.y + rng.range(0.4, 1.6);
                let found = Aabb::new(low, high.with_y(top));
                let is_free = |s: &DVec3| (*s - found.center()).with_y(0.0).length() > 1.0;
                if stations.iter().all(is_free) {
                    boxes.push(found);
                }
            }
        }
        for b in &boxes {
            let p = |k: usize| {
                let pick =
                    |bit: usize, low: f64, high: f64| if k >> bit & 1 == 0 { low } else { high };
                DVec3::new(
                    pick(0, b.min.x, b.max.x),
                    pick(1, b.min.y, b.max.y),
                    pick(2, b.min.z, b.max.z),
                )
            };
            for [a, b, c, d] in [
                [0, 1, 3, 2],
                [4, 5, 7, 6],
                [0, 1, 5, 4],
                [2, 3, 7, 6],
                [0, 2, 6, 4],
                [1, 3, 7, 5],
            ] {
                self.triangles
                    .extend([[p(a), p(b), p(c)], [p(a), p(c), p(d)]]);
            }
        }
        boxes
    }

    /// Returns the truth of the rooms with a station, and the share of their points that it leaves out: those in boxes, and
    /// those that the triangles hide from all stations. What is unknown is not air to a scan.
    fn truth_of(&self, stations: &[DVec3], boxes: &[Aabb]) -> (Value, f64) {
        let bvh = Bvh::build(&self.triangles);
        let is_hidden = |from: &DVec3, p: DVec3| bvh.any_hit(*from, p, |_| false);
        let is_seen = |(id, points): &(String, Vec<DVec3>)| {
            points
                .iter()
                .any(|p| stations.contains(p))
                .then(|| id.clone())
        };
        let seen: BTreeSet<String> = self.places.iter().filter_map(is_seen).collect();
        let mut rooms: Vec<Value> = list(&self.truth["rooms"]).to_vec();
        rooms.retain(|r| seen.contains(&text(&r["id"])));
        let [mut n_points, mut n_left] = [0, 0];
        for room in &mut rooms {
            let is_in_known_air = |p: &&Value| {
                let p = vec3(p).map_or(DVec3::ZERO, DVec3::from_array);
                !boxes.iter().any(|b| b.expanded(0.1).contains(p))
                    && !stations.iter().all(|s| is_hidden(s, p))
            };
            let points = list(&room["sample_points"]);
            n_points += points.len();
            let known: Vec<Value> = points.iter().filter(is_in_known_air).cloned().collect();
            n_left += known.len();
            room["sample_points"] = known.into();
        }
        let is_known = |id: &Value| id == "outside" || seen.contains(&text(id));
        let openings = list(&self.truth["openings"]).iter();
        let openings: Vec<&Value> = openings
            .filter(|o| list(&o["rooms"]).iter().all(is_known))
            .collect();
        let unknown = 1.0 - n_left as f64 / n_points.max(1) as f64;
        (json!({"rooms": rooms, "openings": openings}), unknown)
    }
}

/// Returns points with their stations in PLY.
fn ply(triangles: &[Triangle], stations: &[DVec3], rng: &mut Rng) -> Vec<u8> {
    let bvh = Bvh::build(triangles);
    let mut points: Vec<u8> = Vec::new();
    let mut n = 0;
    for (s, &origin) in stations.iter().enumerate() {
        let n_holes = RAYS[0].div_ceil(HOLE) * RAYS[1].div_ceil(HOLE);
        let is_lost: Vec<bool> = (0..n_holes).map(|_| rng.chance(LOST)).collect();
        for j in 0..RAYS[1] {
            for i in 0..RAYS[0] {
                let noise = ((0..12).map(|_| rng.unit()).sum::<f64>() - 6.0) * NOISE;
                if is_lost[i / HOLE + j / HOLE * RAYS[0].div_ceil(HOLE)] {
                    continue;
                }
                let (up, turn) = (
                    std::f64::consts::PI * (j as f64 + 0.5) / RAYS[1] as f64,
                    std::f64::consts::TAU * (i as f64 + 0.5) / RAYS[0] as f64,
                );
                let direction = DVec3::new(up.sin() * turn.cos(), up.cos(), up.sin() * turn.sin());
                let ray = Ray {
                    origin,
                    direction,
                    t_max: 60.0,
                };
                if let Some(hit) = bvh.closest_hit(&ray, |_| false) {
                    let p = origin + direction * (hit.t + noise);
                    points.extend(p.to_array().iter().flat_map(|c| (*c as f32).to_le_bytes()));
                    points.push(s as u8);
                    n += 1;
                }
            }
        }
    }
    let mut file = b"ply\nformat binary_little_endian 1.0\n".to_vec();
    for p in stations {
        file.extend(format!("comment station {} {} {}\n", p.x, p.y, p.z).bytes());
    }
    file.extend(format!("element vertex {n}\n").bytes());
    file.extend(b"property float x\nproperty float y\nproperty float z\nproperty uchar station\nend_header\n");
    file.extend(points);
    file
}

/// Number of stations in rooms; and whether there are some outdoors.
pub(super) type Stations = (usize, bool);

/// Returns a score, or the reason why a scan could not be baked.
fn score(name: &str, stations: Stations) -> anyhow::Result<Arc<Result<Score, String>>> {
    static SCORES: Kept<Result<Score, String>> = Kept::new();
    let key = format!("{name} {stations:?}");
    let new = || Ok(scored(name, stations).map_err(|e| format!("{e:#}")));
    SCORES.get(&key, new)
}

fn scored(name: &str, n_stations: Stations) -> anyhow::Result<Score> {
    let folder = folder_of(name).context("the scene is missing")?;
    let mut building = Building::read(&folder)?;
    let stations = building.stations(n_stations.0, n_stations.1);
    let mut rng = Rng::new(3);
    let boxes = building.clutter(&stations, &mut rng);
    let file = ply(&building.triangles, &stations, &mut rng);
    let world = baked(&decode_ply(&file, &ImportOptions::default())?.scene)?;
    let kept = std::env::var_os(KEPT).map(|f| Path::new(&f).join(format!("{name}-{n_stations:?}")));
    let scratch = kept.clone().unwrap_or_else(|| {
        std::env::temp_dir().join(format!("enfilade-scan-{}", std::process::id()))
    });
    std::fs::create_dir_all(&scratch)?;
    let scored = (|| {
        let (truth, glb) = (scratch.join("truth.json"), scratch.join("world.glb"));
        let (known, unknown) = building.truth_of(&stations, &boxes);
        std::fs::write(truth, known.to_string())?;
        std::fs::write(&glb, encode_glb(&world)?)?;
        let mut score = score_world(&scratch, &glb, &inspect(&glb)?)?;
        let text = format!(
            "{:.0} % of the points hidden or in clutter",
            100.0 * unknown
        );
        score.failed.insert(0, text);
        anyhow::Ok(score)
    })();
    match kept {
        Some(folder) => std::fs::write(folder.join("scan.ply"), file)?,
        None => std::fs::remove_dir_all(&scratch)?,
    }
    scored
}

/// Returns what a score lacks to 1; all of it if the scan was not baked.
fn lacking(
    name: &str,
    stations: Stations,
    most: f64,
    share: usize,
    note: impl Fn(&Score) -> String,
) -> anyhow::Result<Figure> {
    Ok(match &*score(name, stations)? {
        Ok(score) => {
            let value = 1.0 - score.figures[share].unwrap_or(0.0);
            Figure::new(value, most, note(score))
        }
        Err(reason) => Figure::new(1.0, most, reason.as_str()),
    })
}

/// Share of the rooms with a station without a cell of their own.
pub(super) fn rooms(_: &World, name: &str, stations: Stations) -> anyhow::Result<Figure> {
    lacking(name, stations, ROOMS, 0, |score| {
        let (n, n_cells) = (score.n_rooms, score.n_cells);
        let failed = score.failed.join("; ");
        format!("{n} rooms with a station; {n_cells} cells; {failed}")
    })
}

/// Share of the doors between rooms with stations and to the outdoors without a portal.
pub(super) fn doors(_: &World, name: &str, stations: Stations) -> anyhow::Result<Figure> {
    lacking(name, stations, DOORS, 1, |score| {
        format!("{} doors", score.n_doors)
    })
}
