//! Rooms that move, all askers: casts, lines of sight, walkers and paths through the door between a building and a cabin, at many
//! poses of both, against the same at rest: all their triangles without cells, and both put together as one world.

use std::f64::consts::PI;

use anyhow::{Context, ensure};
use enfilade::geom::{DQuat, DVec3, Triangle};
use enfilade::internals::geom::{Bvh, Ray};
use enfilade::world::{
    Acoustics, Agent, Body, Cast, Caster, Heard, Listener, PartId, Path, PathSearch, Place, Pose,
    Space, Transmission, WalkMap, Walker,
};
use enfilade::{CellId, PortalId, PortalKind, World};
use enfilade_testkit::{Beyond, Rng, Standing, assembled, chamber, lift_tower};

use crate::rows::{Figure, baked};

/// Number of poses, and of those at which walks and paths are compared: each makes a map of the whole building.
const POSES: usize = 1000;
const WALKS: usize = 10;
/// Casts and lines of sight at each pose, and sources heard at each of the latter.
const CASTS: usize = 4;
const SOUNDS: usize = 16;
/// Greatest difference of an impact: the triangles are the same, in frames of `f64`. [Units: wu]
const EXACT: f64 = 1e-5;
/// Tolerance of a walker: the vertices of one world are rounded to `f32`, a thousandth of this, and each step slides along what the last one
/// left. [Units: wu]
const WALKED: f64 = 5e-3;
/// Tolerance of a path, in squares of its floors: lines bend at walls where squares do, up to 0.7 squares off, and those of the two maps are
/// turned and shifted. Two ends of walls at the door, from both sides.
const SQUARES: f64 = 3.0;

/// Tolerance of a sound, in decibels and in length: a door is pushed into the other by up to a centimeter and 1°, two at its edges, and
/// levels change by up to a decibel per centimeter of way. [Units: dB, wu]
const HEARD: [f64; 2] = [1.0, 0.03];

/// Width and height by which a gangway is smaller than its doorway, more than it is shifted. [Units: wu]
const FREE: f64 = 0.14;

/// A building and a cabin at its door.
struct DockSite {
    space: Space,
    building: PartId,
    cabin: PartId,
    /// The cabin's door, and what it leads to in one world.
    door: PortalId,
    room: CellId,
    beyond: Beyond,
    /// The cabin's pose in the building's frame if both were at rest.
    home: Pose,
    /// Greatest shifts and turn from there. [Units: wu, rad]
    off: Offset,
    /// Heights at which the cabin stops. [Units: wu]
    stops: Vec<f64>,
    /// Per part, all triangles with leaves open.
    bvhs: [Bvh; 2],
}

/// Kinds of questions.
const NAMES: [&str; 5] = ["casts", "lines of sight", "walks", "paths", "sounds"];

/// Counts the answers that differ.
#[derive(Default)]
struct Counts {
    /// Counts of each kind: asked, through the door, different.
    kinds: [[usize; 3]; 5],
    notes: Vec<String>,
}

impl Counts {
    fn add(&mut self, kind: usize, is_through: bool, is_same: bool, note: impl FnOnce() -> String) {
        let [n, n_through, n_off] = &mut self.kinds[kind];
        *n += 1;
        *n_through += usize::from(is_through);
        *n_off += usize::from(!is_same);
        if !is_same
            && self
                .notes
                .iter()
                .filter(|n| n.starts_with(NAMES[kind]))
                .count()
                < 3
        {
            self.notes.push(format!("{} {}", NAMES[kind], note()));
        }
    }
}

/// Returns a building among nothing, and a cabin of its own at its widest door.
fn at_entrance(world: &World) -> anyhow::Result<DockSite> {
    let root = chamber(DVec3::new(600.0, 100.0, 600.0), [1.0, 2.0], 2.0);
    let mut space = Space::new(root)?;
    let middle = Pose::from_translation(DVec3::new(300.0, 50.0, 300.0));
    let building = space.add_part(world.clone(), PartId::ROOT, middle)?;
    let layout = space.layout(building);
    let outdoors = layout.outdoors().context("a building in the open")?;
    let mut best: Option<(f64, PortalId)> = None;
    for exit in layout.exits(outdoors) {
        let opening = layout.opening(exit.portal);
        let size = opening.bounds().size();
        let is_door = matches!(opening.kind(), PortalKind::Door | PortalKind::Open)
            && opening.normal().y.abs() < 0.01
            && size.y > 1.95
            && size.with_y(0.0).length() > 0.85;
        if is_door && best.is_none_or(|b| opening.area() > b.0) {
            best = Some((opening.area(), exit.portal));
        }
    }
    let (_, portal) = best.context("no door to the outdoors")?;
    let opening = layout.opening(portal);
    let size = opening.bounds().size();
    let (width, height) = (size.with_y(0.0).length(), size.y);
    let is_second = opening.cells()[1] == outdoors;
    let out = if is_second {
        opening.normal()
    } else {
        -opening.normal()
    };
    // A gangway that fits into the doorway: the opening is within the wall, which would stand in a wider room.
    let room = DVec3::new(width - FREE, height - FREE, 3.0);
    let cabin = chamber(room, [0.01, room.x - 0.01], room.y - 0.01);
    let sill = opening.center().with_y(opening.bounds().min.y);
    // Its door is in its wall of greatest z.
    let turn = DQuat::from_rotation_y((-out.x).atan2(-out.z));
    let home = Pose {
        turn,
        at: sill - turn * DVec3::new(0.5 * room.x, -0.02, room.z),
    };
    let cabin = space.add_part(cabin, PartId::ROOT, middle.after(&home))?;
    site(
        space,
        [building, cabin],
        Beyond::Door(0, portal),
        home,
        Offset {
            by: [0.05, 0.0, 0.0099],
            turn: 0.99_f64.to_radians(),
        },
    )
}

/// Returns the tower of the demo with its lift.
fn in_tower() -> anyhow::Result<DockSite> {
    let models = lift_tower();
    let mut space = Space::new(baked(&models.tower.scene)?)?;
    let cabin = baked(&models.cabin.scene)?;
    let cabin = space.add_part(cabin, PartId::ROOT, Pose::IDENTITY)?;
    let shaft = space.layout(PartId::ROOT).locate(models.cabin_lamp);
    let beyond = Beyond::Cell(shaft.context("a shaft")?);
    let parts = [PartId::ROOT, cabin];
    let off = Offset {
        by: [0.01, 0.1, 0.01],
        turn: 0.3_f64.to_radians(),
    };
    let mut site = site(space, parts, beyond, Pose::IDENTITY, off)?;
    site.stops = models.stops.iter().map(|p| p.y).collect();
    Ok(site)
}

/// Distance of a cabin from its stop, and the angle by which it is turned. [Units: wu, rad]
#[derive(Clone, Copy)]
struct Offset {
    by: [f64; 3],
    turn: f64,
}

fn site(
    mut space: Space,
    [building, cabin]: [PartId; 2],
    beyond: Beyond,
    home: Pose,
    off: Offset,
) -> anyhow::Result<DockSite> {
    for part in [building, cabin] {
        for portal in (0..space.layout(part).n_portals() as u32).map(PortalId) {
            space.open(part, portal);
        }
    }
    let bvhs = [building, cabin].map(|part| Bvh::build(&triangles(&space, part)));
    let layout = space.layout(cabin);
    let outdoors = layout.outdoors().context("a cabin in the open")?;
    let door = layout
        .exits(outdoors)
        .first()
        .context("a cabin with a door")?;
    Ok(DockSite {
        door: door.portal,
        room: door.to,
        stops: vec![0.0],
        space,
        building,
        cabin,
        beyond,
        home,
        off,
        bvhs,
    })
}

/// Returns all triangles of a part in its frame, with leaves as they are.
fn triangles(space: &Space, part: PartId) -> Vec<Triangle> {
    let (world, state): (&World, _) = (space.world(part), space.state(part));
    let mut all = Vec::new();
    for batch in &world.batches {
        all.extend(batch.primitive.triangles());
    }
    for (i, object) in (0..).zip(&world.details) {
        let pose = state
            .pose(enfilade::runtime::DetailId(i))
            .unwrap_or_default();
        let place = pose * object.placement();
        for p in &world.detail_meshes[object.mesh as usize].primitives {
            all.extend(p.placed_triangles(place));
        }
    }
    all
}

impl DockSite {
    /// Moves the building anywhere, and the cabin to its door; returns the cabin's pose in the building's frame.
    fn set_pose(&mut self, rng: &mut Rng) -> anyhow::Result<Pose> {
        let Offset { by, turn } = self.off;
        let stop = self.stops[rng.below(self.stops.len())];
        let mut shift = DVec3::from_array(by.map(|x| rng.range(-x, x)));
        // A shaft's floor would stand in the room of a cabin that is sunk into it: two solids in one place have no answer.
        if stop == self.stops[0] {
            shift.y = shift.y.abs();
        }
        // About the middle of its door, along its own axes.
        let sill = self.space.layout(self.cabin).opening(self.door).center();
        let turned = Pose::about(sill, DVec3::Y, rng.range(-turn, turn));
        let shifted = Pose::from_translation(shift + DVec3::Y * stop);
        let rel = self.home.after(&shifted).after(&turned);
        let mut there = rel;
        if self.building != PartId::ROOT {
            let at = DVec3::new(300.0, 50.0, 300.0) + rng.turn() * DVec3::X * 20.0;
            let turn = DQuat::from_rotation_y(rng.range(-PI, PI));
            let pose = Pose { turn, at };
            self.space.set_pose(self.building, pose)?;
            there = pose.after(&rel);
        }
        self.space.set_pose(self.cabin, there)?;
        Ok(rel)
    }

    /// Returns two points on either side of the door, in the building's frame: in the cabin, and beyond the door.
    fn ends(&self, rel: &Pose, rng: &mut Rng) -> [DVec3; 2] {
        let layout = self.space.layout(self.cabin);
        let opening = layout.opening(self.door);
        let inside = layout.cell(self.room).bounds;
        let bounds = inside.expanded(-0.3);
        let from = rng.point_in(&bounds);
        let through = rng.point_in(&opening.bounds().expanded(-0.02));
        let through = through - opening.normal() * opening.height_of(through);
        let to = from + (through - from) * rng.range(1.0, 4.0);
        [from, to].map(|p| rel.point(p))
    }

    /// Casts through the door, both ways.
    fn cast(&self, rel: &Pose, caster: &mut Caster, rng: &mut Rng, counts: &mut Counts) {
        for _ in 0..CASTS {
            let mut ends = self.ends(rel, rng);
            if rng.chance(0.5) {
                ends.reverse();
            }
            let [from, to] = ends;
            let Some(place) = self.space.locate(self.building, from) else {
                continue;
            };
            for radius in [0.0, rng.range(0.01, 0.3)] {
                let by = to - from;
                let cast = Cast {
                    body: &Body::Sphere { radius },
                    frame: self.building,
                    from,
                    by,
                    place,
                };
                let starts = self.nearest(rel, from);
                if starts < radius + 1e-3 {
                    continue;
                }
                let found = caster.cast(&self.space, &cast).map_or(1.0, |hit| hit.t);
                let first = caster.places()[0].part;
                let is_through = caster.places().iter().any(|p| p.part != first);
                let length = by.length();
                let [early, late] = if radius == 0.0 {
                    [self.first_hit(rel, from, by); 2]
                } else {
                    [1.0, -1.0].map(|sign| self.first_touch(rel, radius + sign * EXACT, from, by))
                };
                let is_same = found * length > early * length - EXACT
                    && found * length < late * length + EXACT;
                counts.add(usize::from(radius == 0.0), is_through, is_same, || {
                    format!("r {radius:.3} {from:.3} {to:.3}: {found:.5} not {early:.5}..{late:.5}")
                });
            }
        }
    }

    /// Returns the share of a line up to its first hit of a triangle.
    fn first_hit(&self, rel: &Pose, from: DVec3, by: DVec3) -> f64 {
        let inverse = rel.inverse();
        let rays = [(from, by), (inverse.point(from), inverse.direction(by))];
        let hits = rays
            .iter()
            .zip(&self.bvhs)
            .filter_map(|((origin, direction), bvh)| {
                let ray = Ray {
                    origin: *origin,
                    direction: *direction,
                    t_max: 1.0,
                };
                bvh.closest_hit(&ray, |_| false).map(|hit| hit.t)
            });
        hits.fold(1.0, f64::min)
    }

    fn nearest(&self, rel: &Pose, p: DVec3) -> f64 {
        let points = [p, rel.point_back(p)];
        let near = points
            .iter()
            .zip(&self.bvhs)
            .filter_map(|(p, bvh)| bvh.nearest(*p, 20.0));
        near.map(|n| n.distance).fold(20.0, f64::min)
    }

    /// Returns the time at which a ball first touches a triangle: steps by its distance, so it never passes one.
    fn first_touch(&self, rel: &Pose, radius: f64, from: DVec3, by: DVec3) -> f64 {
        let mut t = 0.0;
        for _ in 0..10_000 {
            let gap = self.nearest(rel, from + by * t) - radius;
            if gap < 1e-7 {
                break;
            }
            t += gap / by.length();
            if t > 1.0 {
                return 1.0;
            }
        }
        t
    }

    /// Walks and finds paths in both.
    fn walk(
        &self,
        rel: &Pose,
        map: &WalkMap,
        acoustics: &Acoustics,
        rng: &mut Rng,
        counts: &mut Counts,
    ) -> anyhow::Result<()> {
        let (building, cabin) = (
            self.space.world(self.building),
            self.space.world(self.cabin),
        );
        let standing = [(building, &Pose::IDENTITY), (cabin, rel)].map(|(world, pose)| Standing {
            world,
            turn: pose.turn,
            at: pose.at,
        });
        let truth = assembled(&standing, &[(1, self.door, self.beyond)]).world;
        let mut one = Space::new(truth)?;
        for portal in (0..one.layout(PartId::ROOT).n_portals() as u32).map(PortalId) {
            one.open(PartId::ROOT, portal);
        }
        let agent = Agent::default();
        let one_map = WalkMap::new(&one, agent);
        let (mut search, mut path) = (PathSearch::new(), Path::default());
        let (mut one_search, mut one_path) = (PathSearch::new(), Path::default());
        let layout = self.space.layout(self.building);
        let bounds = self.space.layout(self.cabin).cell(self.room).bounds;
        let floor = bounds.center().with_y(bounds.min.y);
        let start = floor + DVec3::new(rng.range(-0.2, 0.2), 0.0, rng.range(-0.2, 0.2));
        let own = [(self.cabin, start), (PartId::ROOT, rel.point(start))];
        for _ in 0..8 {
            let cell = CellId(rng.below(layout.n_cells()) as u32);
            let to = rng.point_in(&layout.cell(cell).bounds);
            if layout.cell(cell).is_outdoor {
                continue;
            }
            let all = |_, _| true;
            // The cabin may be where the point is.
            let there = self.space.locate(self.building, to);
            // In the air of a shaft, the nearest floor may be its own or the cabin's.
            let is_shaft = |place: Place| match self.beyond {
                Beyond::Cell(cell) => (place.part, place.cell) == (self.building, cell),
                Beyond::Door(..) => false,
            };
            if there.is_some_and(is_shaft) {
                continue;
            }
            let part = there.map_or(self.building, |place| place.part);
            let goal = self.space.between(self.building, part).point(to);
            let ends = [own[0], (part, goal)];
            let found = search.find(map, &self.space, ends, all, &mut path);
            let ends = [own[1], (PartId::ROOT, to)];
            let one_found = one_search.find(&one_map, &one, ends, all, &mut one_path);
            let side = map
                .floors(self.building)
                .side()
                .max(map.floors(self.cabin).side());
            let off = (path.length - one_path.length).abs();
            let is_same = found.is_ok() == one_found.is_ok() && off <= SQUARES * side;
            if found.is_ok() || one_found.is_ok() {
                counts.add(3, found.is_ok(), is_same, || {
                    format!(
                        "path to {to:.2}: {found:?} {:.3} not {one_found:?} {:.3}",
                        path.length, one_path.length
                    )
                });
            }
        }
        self.hear(rel, acoustics, &one, rng, counts);
        // Straight out through the door, a little aslant.
        let up = DVec3::Y * agent.eye;
        let mut walker = Walker::new(agent, own[0].0, own[0].1 + up);
        let mut one_walker = Walker::new(agent, own[1].0, own[1].1 + up);
        let opening = self.space.layout(self.cabin).opening(self.door);
        let out = (opening.center() - start).with_y(0.0).normalize();
        let wish = DQuat::from_rotation_y(rng.range(-0.15, 0.15)) * out * 1.4;
        for _ in 0..90 {
            let own = self.space.between(self.cabin, walker.frame).direction(wish);
            walker.step(&self.space, own, 1.0 / 30.0);
            one_walker.step(&one, rel.direction(wish), 1.0 / 30.0);
        }
        let at = self
            .space
            .between(walker.frame, self.building)
            .point(walker.eye);
        let off = at.distance(one_walker.eye);
        counts.add(2, walker.frame != self.cabin, off <= WALKED, || {
            format!("walk from {start:.2}: {at:.4} not {:.4}", one_walker.eye)
        });
        Ok(())
    }
}

impl DockSite {
    /// Listens in the cabin to sources in the building, in both.
    fn hear(
        &self,
        rel: &Pose,
        acoustics: &Acoustics,
        one: &Space,
        rng: &mut Rng,
        counts: &mut Counts,
    ) {
        let of_one = Acoustics::new(one, &Transmission::default());
        let (mut ears, mut one_ears) = (Listener::new(), Listener::new());
        let inside = self.space.layout(self.cabin).cell(self.room).bounds;
        let layout = self.space.layout(self.building);
        for id in 0..SOUNDS {
            let at = rng.point_in(&inside.expanded(-0.2));
            let cell = CellId(rng.below(layout.n_cells()) as u32);
            let source = rng.point_in(&layout.cell(cell).bounds);
            let there = [
                self.space.locate(self.building, source),
                one.locate(PartId::ROOT, source),
            ];
            let here = [
                self.space.locate(self.cabin, at),
                one.locate(PartId::ROOT, rel.point(at)),
            ];
            let ([Some(here), Some(one_here)], [Some(there), Some(one_there)]) = (here, there)
            else {
                continue;
            };
            if layout.cell(cell).is_outdoor || there.part != self.building {
                continue;
            }
            ears.listen(acoustics, &self.space, here, at);
            one_ears.listen(&of_one, one, one_here, rel.point(at));
            let found = ears.hear(acoustics, id, there, source);
            let known = one_ears.hear(&of_one, id, one_there, source);
            let is_same = match (&found, &known) {
                (Some(a), Some(b)) => {
                    let level = 20.0 * (a.gain / b.gain).log10();
                    level.abs() < HEARD[0] && (a.length - b.length).abs() < HEARD[1]
                }
                (a, b) => a.is_none() && b.is_none(),
            };
            counts.add(4, found.is_some(), is_same, || {
                let told = |heard: Option<Heard>| {
                    heard.map(|h| format!("{:.2} dB {:.3} m", 20.0 * h.gain.log10(), h.length))
                };
                format!(
                    "of {source:.2} at {at:.2}: {:?} not {:?}",
                    told(found),
                    told(known)
                )
            });
        }
    }
}

fn measure(mut site: DockSite) -> anyhow::Result<Figure> {
    let (mut rng, mut caster, mut counts) = (Rng::new(5), Caster::new(), Counts::default());
    let map = WalkMap::new(&site.space, Agent::default());
    let acoustics = Acoustics::new(&site.space, &Transmission::default());
    for i in 0..POSES {
        let rel = site.set_pose(&mut rng)?;
        site.cast(&rel, &mut caster, &mut rng, &mut counts);
        if i % (POSES / WALKS) == 0 {
            site.walk(&rel, &map, &acoustics, &mut rng, &mut counts)?;
        }
    }
    let told = NAMES
        .iter()
        .zip(&counts.kinds)
        .map(|(name, [n, through, off])| {
            format!("{off} of {n} {name} ({through} through the door)")
        });
    let told: Vec<String> = told.collect();
    ensure!(
        counts.kinds.iter().all(|k| k[1] > 0),
        "none through the door: {}; {}",
        told.join(", "),
        counts.notes.join("; ")
    );
    let value = counts.kinds.iter().map(|k| k[2]).sum::<usize>() as f64;
    let note = format!(
        "answers that differ: {}; {POSES} poses {}",
        told.join(", "),
        counts.notes.join("; ")
    );
    Ok(Figure::new(value, 0.0, note))
}

/// Counts the answers that differ at the entrance of a building.
pub(super) fn entrance(world: &World) -> anyhow::Result<Figure> {
    measure(at_entrance(world)?)
}

/// Counts those in the lift of the demo's tower.
pub(super) fn tower(_: &str) -> anyhow::Result<Figure> {
    measure(in_tower()?)
}
