//! Points and bodies that pass special portals, and views that recur, against worlds without special portals.
//!
//! A building with a doorway that leads into a copy of itself, far away and turned, cannot be told from the building itself: what
//! bodies meet is the same up to the rounding of the copy's vertices, and the plain building is the judge.

use anyhow::ensure;
use enfilade::cpg::{Pass, PortalId, PortalKind, SpecialId, SpecialPortal, SpecialShape, Way};
use enfilade::geom::{DQuat, DVec3, Similarity};
use enfilade::internals::geom::world_tolerance;
use enfilade::runtime::View;
use enfilade::world::{Body, Cast, Caster, PartId, Place, Space, SpaceViewer};
use enfilade::{CellId, World};
use enfilade_testkit::{
    GridParams, Rng, endless_room, linked_copies, room_grid, traced_step, with_specials,
};

use crate::measure::point;
use crate::rows::Figure;

const ROOT: PartId = PartId::ROOT;
/// Segments followed.
const N_STEPS: usize = 1_000_000;
/// Doorways of a building, and bodies at each.
const N_DOORWAYS: usize = 8;
const N_BODIES: usize = 4_000;

fn random_axis(rng: &mut Rng) -> DVec3 {
    let v = DVec3::from_array([0, 1, 2].map(|_| rng.range(-1.0, 1.0)));
    v.normalize_or(DVec3::Y)
}

/// Follows steps through up to 20 special portals each; counts those that end more than a nanometer astray, in another place, or
/// do not lead back.
pub(super) fn steps(_: &str) -> anyhow::Result<Figure> {
    let (mut wrong, mut n_passed, mut worst) = (0, 0, 0.0_f64);
    for turned in [false, true] {
        let world = endless_room(turned);
        let space = Space::new(world.clone())?;
        let [low, high] = world.graph.cells[0].aabb.map(point);
        let (mut rng, mut n) = (Rng::new(17), 0);
        while n < N_STEPS / 2 {
            let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.3, 0.7)));
            let from = low + (high - low) * share;
            let angle = rng.range(0.0, std::f64::consts::TAU);
            let by = DVec3::new(angle.cos(), 0.0, angle.sin()) * rng.range(0.0, 80.0);
            let (end, matrix, crossings, rim) = traced_step(&world, from, by);
            // Within the tolerance of a rim, either answer is right.
            if crossings.len() > 20 || rim < 1e-4 {
                continue;
            }
            n += 1;
            let step = space.follow(ROOT, from, by);
            let is_inside = step.at.cmpge(low).all() && step.at.cmple(high).all();
            let error = step.at.distance(end);
            let back = step.map.inverse().after(&step.map);
            worst = worst.max(error);
            n_passed += crossings.len();
            let is_right = step.n_passed as usize == crossings.len()
                && error <= 1e-9
                && step.map.matrix().abs_diff_eq(matrix, 1e-9)
                && back.is_near(&Similarity::IDENTITY, 100.0, 1e-9)
                && step.place.is_some() == is_inside;
            wrong += usize::from(!is_right);
        }
    }
    let note = format!(
        "{N_STEPS} steps, {n_passed} passages, at most 20 in a step; farthest astray {worst:.1e} m"
    );
    Ok(Figure::new(wrong as f64, 0.0, note))
}

/// A doorway that leads into a copy of its world.
struct Linked {
    plain: Space,
    linked: Space,
    portal: PortalId,
    map: Similarity,
}

impl Linked {
    fn new(world: &World, portal: PortalId, scale: f64, rng: &mut Rng) -> anyhow::Result<Self> {
        let extent = world.graph.cells.iter().flat_map(|c| c.aabb).flatten();
        let extent = extent.fold(0.0_f32, |m, x| m.max(x.abs()));
        let map = Similarity {
            turn: DQuat::from_axis_angle(random_axis(rng), rng.range(-3.0, 3.0)),
            at: DVec3::X * 3.0 * f64::from(extent),
            scale,
        };
        Ok(Self {
            linked: Space::new(linked_copies(world, portal, &map))?,
            plain: Space::new(world.clone())?,
            portal,
            map,
        })
    }

    /// Returns how far the vertices of the copy are from those of the world, by rounding.
    fn rounding(&self) -> f64 {
        let far = self.map.at.length() * 1.5;
        4.0 * world_tolerance(far) * self.map.scale.recip().max(1.0)
    }

    /// Counts the questions whose answers differ, those asked, and those answered beyond the doorway.
    fn compare(&self, n: usize, rng: &mut Rng) -> [usize; 3] {
        let door = self.plain.layout(ROOT).opening(self.portal);
        let [here, _] = door.cells();
        let place = Place {
            part: ROOT,
            cell: here,
        };
        let off = self.rounding();
        let mut casters = [Caster::new(), Caster::new()];
        let [mut differ, mut asked, mut beyond] = [0; 3];
        let pieces: Vec<&[DVec3]> = door.pieces().collect();
        for _ in 0..n {
            // Through a point of the opening.
            let piece = pieces[rng.below(pieces.len())];
            let k = 1 + rng.below(piece.len() - 2);
            let (u, v) = (rng.unit(), rng.unit());
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            let on = piece[0] + (piece[k] - piece[0]) * u + (piece[k + 1] - piece[0]) * v;
            let mut along = random_axis(rng);
            if along.dot(door.normal()) < 0.0 {
                along = -along;
            }
            let farthest = [0.3, 1.5][rng.below(2)];
            let from = on - along * rng.range(0.0, farthest);
            if self.plain.locate(ROOT, from) != Some(place) || -door.height_of(from) < 1e-3 {
                continue;
            }
            let body = random_body(rng);
            let mut deepest = [0.0_f64; 2];
            for (i, space) in [&self.plain, &self.linked].into_iter().enumerate() {
                casters[i].for_each_contact(space, &body, ROOT, from, place, |contact| {
                    deepest[i] = deepest[i].max(contact.depth);
                    beyond += usize::from(i == 1 && contact.map != Similarity::IDENTITY);
                });
            }
            asked += 1;
            // How deep it is in a wall, and which way out is the shortest, depends on how the wall is cut into triangles.
            let [a, b] = deepest;
            differ += usize::from(a.min(b) == 0.0 && a.max(b) > off);
            if deepest[0] > 0.0 {
                continue;
            }
            let by = along * rng.range(0.0, 4.0);
            let cast = Cast {
                body: &body,
                frame: ROOT,
                from,
                by,
                place,
            };
            let [a, b] = [(&self.plain, 0), (&self.linked, 1)]
                .map(|(space, i)| casters[i].cast(space, &cast));
            asked += 1;
            // Faces almost along the motion amplify the rounding of their vertices.
            let slant = |n: DVec3| (n.dot(along)).abs().max(1e-3);
            let is_same = match (a, b) {
                (None, None) => true,
                (Some(a), Some(b)) => {
                    (a.t - b.t).abs() * by.length() * slant(a.normal).min(slant(b.normal)) <= off
                }
                (Some(hit), None) | (None, Some(hit)) => {
                    let slant = slant(hit.normal);
                    slant <= 1e-3 || (1.0 - hit.t) * by.length() * slant <= off
                }
            };
            differ += usize::from(!is_same);
            beyond += usize::from(b.is_some_and(|hit| hit.map != Similarity::IDENTITY));
        }
        [differ, asked, beyond]
    }
}

fn random_body(rng: &mut Rng) -> Body {
    match rng.below(3) {
        0 => Body::Sphere {
            radius: [0.0, 0.02, 0.15][rng.below(3)],
        },
        1 => Body::Capsule {
            half: random_axis(rng) * rng.range(0.05, 0.4),
            radius: rng.range(0.02, 0.2),
        },
        _ => Body::Box {
            half: DVec3::from_array([0, 1, 2].map(|_| rng.range(0.02, 0.3))),
            turn: DQuat::from_axis_angle(random_axis(rng), rng.range(0.0, 3.0)),
        },
    }
}

fn figure([differ, asked, beyond]: [usize; 3], n: usize) -> anyhow::Result<Figure> {
    ensure!(beyond > 0, "nothing was met beyond a special portal");
    let note = format!("{asked} casts and contacts at {n} doorways, {beyond} met beyond them");
    Ok(Figure::new(differ as f64, 0.0, note))
}

/// Compares bodies at doorways of a generated world.
pub(super) fn bodies_in(scene: &str) -> anyhow::Result<Figure> {
    let n: usize = scene.trim_start_matches("offices-").parse()?;
    let mut rng = Rng::new(3);
    let world = room_grid(&GridParams {
        outdoors: false,
        merges: 0.4,
        ..GridParams::offices(n, 3)
    });
    bodies_at(&world, &[1.0, 0.5, 2.0], &mut rng)
}

/// Compares bodies at doorways of a building.
pub(super) fn bodies(world: &World) -> anyhow::Result<Figure> {
    bodies_at(world, &[1.0], &mut Rng::new(4))
}

fn bodies_at(world: &World, scales: &[f64], rng: &mut Rng) -> anyhow::Result<Figure> {
    let graph = &world.graph;
    let is_inner = |p: &PortalId| {
        let portal = &graph[*p];
        let is_way = matches!(portal.kind, PortalKind::Open | PortalKind::Door);
        is_way && portal.area > 1.0 && portal.cells.iter().all(|c| !graph[*c].outdoor)
    };
    let all: Vec<PortalId> = graph.portal_ids().filter(is_inner).collect();
    ensure!(!all.is_empty(), "no doorway between rooms");
    let n = all.len().min(N_DOORWAYS);
    let mut sum = [0; 3];
    for i in 0..n {
        let portal = all[i * all.len() / n];
        let linked = Linked::new(world, portal, scales[i % scales.len()], rng)?;
        let counts = linked.compare(N_BODIES, rng);
        sum = [0, 1, 2].map(|k| sum[k] + counts[k]);
    }
    figure(sum, n)
}

/// Counts the views of mirrors in mirrors, rooms in themselves and rings whose recursion does not end as promised.
pub(super) fn recursion(scene: &str) -> anyhow::Result<Figure> {
    let world = match scene {
        "endless" => endless_room(false),
        "turned" => endless_room(true),
        "facing-mirrors" => facing_mirrors(),
        _ => ring(100),
    };
    let space = Space::new(world)?;
    let [low, high] = space.world(ROOT).graph.cells[0].aabb.map(point);
    let (mut rng, mut wrong, mut most, mut n_capped) = (Rng::new(6), 0, 0, 0);
    let mut viewer = SpaceViewer::new(&space);
    for i in 0..500 {
        let max_contexts = [1, 8, 64, 500][i % 4];
        let min_share = [0.0, 1e-4, 1e-2][i % 3];
        viewer.specials_mut().max_contexts = max_contexts;
        viewer.specials_mut().min_share = min_share;
        let share = DVec3::from_array([0, 1, 2].map(|_| rng.range(0.1, 0.9)));
        let eye = (low + (high - low) * share).as_vec3().to_array();
        let toward = random_axis(&mut rng).with_y(0.1).as_vec3().to_array();
        let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.2, 1.5)?;
        let seen = viewer.see(&space, ROOT, &view);
        let n = seen.contexts().len();
        most = most.max(n);
        n_capped += usize::from(seen.is_capped());
        let stopped = seen.stopped_specials();
        // Each context covers its least share; who stops says so.
        let covers = seen.contexts().skip(1).all(|c| {
            let [l, b, r, t] = c.rectangle();
            (r - l) * (t - b) * 0.25 >= f64::from(min_share) * 0.999
        });
        let is_told = seen.is_capped() == (n == max_contexts && !stopped.is_empty())
            || stopped.iter().all(|s| s.share < min_share);
        let is_bounded = n <= max_contexts;
        wrong += usize::from(!(covers && is_told && is_bounded));
    }
    let note = format!("500 views; at most {most} contexts; {n_capped} told of the cap");
    Ok(Figure::new(f64::from(wrong as u32), 0.0, note))
}

fn facing_mirrors() -> World {
    let mut world = endless_room(false);
    for side in &mut world.graph.specials {
        side.passes = vec![Pass::new(Way::Mirror)];
    }
    world
}

/// Rooms of which each leads into the next by a rectangle on a wall, and the last into the first.
fn ring(n: usize) -> World {
    let mut world = room_grid(&GridParams {
        outdoors: false,
        furniture: 0,
        ..GridParams::offices(n, 2)
    });
    let of_cell = |world: &World, cell: usize, side: f64| {
        let [low, high] = world.graph.cells[cell].aabb.map(point);
        let middle = (low + high) * 0.5;
        middle + DVec3::X * side * ((high - low).x * 0.5 - 1e-3)
    };
    let n_cells = world.graph.cells.len();
    for cell in 0..n_cells {
        let next = (cell + 1) % n_cells;
        let (out, into) = (of_cell(&world, cell, 1.0), of_cell(&world, next, -1.0));
        let corners = [
            -DVec3::Y - DVec3::Z,
            DVec3::Y - DVec3::Z,
            DVec3::Y + DVec3::Z,
            DVec3::Z - DVec3::Y,
        ];
        world.graph.specials.push(SpecialPortal {
            name: String::new(),
            cell: CellId(cell as u32),
            shape: SpecialShape::Surface {
                normal: [1.0, 0.0, 0.0],
                pieces: vec![corners.map(|c| (out + c).as_vec3().to_array()).to_vec()],
            },
            passes: vec![Pass::new(Way::Lead {
                to: CellId(next as u32),
                map: Similarity::rigid(DQuat::IDENTITY, into - out),
                back: None,
            })],
        });
    }
    world
}

/// Spoils special portals in each way that they can be wrong; counts those that validation accepts, or refuses without naming the
/// special portal.
pub(super) fn bad_input(_: &str) -> anyhow::Result<Figure> {
    let params = GridParams {
        outdoors: false,
        ..GridParams::offices(4, 1)
    };
    let world = with_specials(room_grid(&params), 2, 1);
    ensure!(world.graph.validate().is_ok(), "the world itself is valid");
    type Spoil = fn(&mut SpecialPortal);
    fn lead(side: &mut SpecialPortal) -> (&mut CellId, &mut Similarity, &mut Option<SpecialId>) {
        match &mut side.passes[0].way {
            Way::Lead { to, map, back } => (to, map, back),
            _ => panic!("the second leads"),
        }
    }
    let spoils: &[(&str, Spoil)] = &[
        ("no passes", |s| s.passes.clear()),
        ("a cell that is not there", |s| s.cell = CellId(99)),
        ("a doorway that is not there", |s| {
            s.shape = SpecialShape::Portal(PortalId(999));
        }),
        ("through a wall", |s| s.passes[0].way = Way::Through),
        ("a tint of 2", |s| s.passes[0].tint[1] = 2.0),
        ("a share of the first pass", |s| s.passes[0].tint[3] = 0.5),
        ("a tint that is no number", |s| {
            s.passes[0].tint[0] = f32::NAN;
        }),
        ("a target that is not there", |s| *lead(s).0 = CellId(99)),
        ("a rotation that is none", |s| {
            lead(s).1.turn = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.5);
        }),
        ("a place at infinity", |s| lead(s).1.at.x = f64::INFINITY),
        ("a scale of 0", |s| lead(s).1.scale = 0.0),
        ("another size", |s| lead(s).1.scale = 1.1),
        ("another place", |s| lead(s).1.at.y += 0.05),
        ("a way back that is not there", |s| {
            *lead(s).2 = Some(SpecialId(99));
        }),
        ("a way back by a mirror", |s| {
            *lead(s).2 = Some(SpecialId(0));
        }),
        ("a bent polygon", |s| {
            if let SpecialShape::Surface { pieces, .. } = &mut s.shape {
                pieces[0][1][0] += 0.1;
                pieces[0][1][2] += 0.1;
            }
        }),
        ("two vertices", |s| {
            if let SpecialShape::Surface { pieces, .. } = &mut s.shape {
                pieces[0].truncate(2);
            }
        }),
        ("a normal of no length", |s| {
            if let SpecialShape::Surface { normal, .. } = &mut s.shape {
                *normal = [0.0; 3];
            }
        }),
    ];
    let mut accepted = Vec::new();
    for (what, spoil) in spoils {
        let mut world = world.clone();
        // The second of the world leads there and back.
        spoil(&mut world.graph.specials[1]);
        let is_refused = match world.graph.validate() {
            Ok(()) => false,
            Err(errors) => errors.iter().all(|e| e.to_string().contains("special")),
        };
        if !is_refused {
            accepted.push(*what);
        }
    }
    let note = format!(
        "{} faults; accepted or not placed: {accepted:?}",
        spoils.len()
    );
    Ok(Figure::new(accepted.len() as f64, 0.0, note))
}
