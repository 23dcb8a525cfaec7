//! Finds the fittings of openings: which objects are leaves, frames and panes of which portal, and how leaves move.
//!
//! Decides by shape and place alone, not by name. An object that combines a leaf with its frame is split: the leaf
//! becomes an object of its own, so that an engine can turn it.
//!
//! Each pair of a portal and a nearby object is examined on its own; a leaf that several portals claim goes to the best
//! fit. `O(portals · objects)` comparisons of boxes, and `O(n log n)` in the triangles of objects near openings.

mod parts;
mod split;
mod swing;

use std::collections::{BTreeMap, BTreeSet, HashMap};

use enfilade_cpg::{CellId, DetailObject, Fitting, FittingPart, Motion, PortalKind, World};
use enfilade_geom::scene::Mesh;
use enfilade_geom::{Aabb, Allowance, Bvh, DMat4, DVec3, NearSeries, Rectangle, Triangle, shells};
use rayon::prelude::*;

use super::kinds::without_leaf;
use parts::{Aperture, InShells, Leaf, Pose, Roles, roles};
use swing::Around;

/// Least distance from an open leaf to other objects. [Units: wu]
const ROOM: f64 = 0.06;
/// An object with more triangles is one shell: doors have fewer.
const MAX_TRIANGLES: usize = 50_000;

/// A detail object near an opening.
struct Object {
    detail: u32,
    triangles: Vec<Triangle>,
    /// Shell of each triangle.
    shells: Vec<u32>,
    /// Bounding box of each shell.
    bounds: Vec<Aabb>,
}

/// Roles of an object at a portal.
struct Role {
    portal: u32,
    object: u32,
    roles: Roles,
}

/// A leaf assigned to a portal.
struct Hung {
    portal: u32,
    object: u32,
    leaf: Leaf,
    /// All portals that it shuts, including `portal`.
    portals: Vec<u32>,
}

/// Cost of finding the roles of an object at an opening, in units of [`Allowance`].
const WORK_A_ROLE: u64 = 200;

/// Finds the fittings of each opening, and splits leaves off the objects that include their frames.
pub(super) fn fit(world: &mut World, walls: &Bvh, allowance: &Allowance) {
    let openings: Vec<Option<Aperture>> =
        (world.graph.portals.par_iter()).map(Aperture::of).collect();
    let bounds: Vec<Aabb> = (world.details.par_iter())
        .map(|d| Aabb::of_points(&corners_of(world, d)))
        .collect();
    let near: Vec<Vec<u32>> = (openings.par_iter())
        .map(|o| {
            let work = 1 + bounds.len() as u64 / 16;
            let o = o.as_ref().filter(|_| allowance.spend(work));
            o.map_or_else(Vec::new, |o| touching(&o.reach(), &bounds))
        })
        .collect();
    let mut asked: Vec<u32> = near.iter().flatten().copied().collect();
    asked.sort_unstable();
    asked.dedup();
    let objects: Vec<Object> = (asked.par_iter()).map(|&d| Object::of(world, d)).collect();
    let found: Vec<Vec<Role>> = (openings.par_iter().zip(&near).enumerate())
        .filter_map(|(p, (opening, near))| Some((p as u32, opening.as_ref()?, near)))
        .map(|(portal, opening, near)| {
            let near = near.iter().filter_map(|d| asked.binary_search(d).ok());
            let near = near.filter(allowance.each(WORK_A_ROLE));
            near.map(|o| Role {
                portal,
                object: o as u32,
                roles: roles(opening, &objects[o].in_shells()),
            })
            .collect()
        })
        .collect();
    let found: Vec<Role> = found.into_iter().flatten().collect();
    let hung = hang(&found);
    let mut of_portal = vec![Vec::new(); openings.len()];
    let mut of_object = vec![Vec::new(); objects.len()];
    for (h, leaf) in hung.iter().enumerate() {
        of_object[leaf.object as usize].push(h);
        for &p in &leaf.portals {
            of_portal[p as usize].push(h);
        }
    }
    let fitted = Fitted {
        world,
        walls,
        openings: &openings,
        near: &near,
        objects: &objects,
        found: &found,
        hung: &hung,
        of_portal,
        of_object,
    };
    let motions: Vec<Motion> = (0..hung.len())
        .into_par_iter()
        .map(|h| fitted.motion(h))
        .collect();
    let still = fitted.still();
    let carried = fitted.carried();
    let numbers = split::take_out(world, &objects, &hung);
    let mut moving: BTreeSet<u32> = carried.iter().map(|c| c.0).collect();
    moving.extend(&numbers);
    for ((leaf, number), motion) in hung.iter().zip(numbers).zip(&motions) {
        for &p in &leaf.portals {
            let portal = &mut world.graph.portals[p as usize];
            // An opening with a leaf is a door, even if the leaf stands open.
            portal.kind = PortalKind::Door;
            portal.fittings.push(Fitting {
                detail: number,
                part: FittingPart::Leaf,
                motion: Some(*motion),
            });
        }
    }
    for (detail, h) in carried {
        for &p in &hung[h].portals {
            world.graph.portals[p as usize].fittings.push(Fitting {
                detail,
                part: FittingPart::Leaf,
                motion: Some(motions[h]),
            });
        }
    }
    for (portal, detail, part) in still {
        // An object that is only a leaf, here or in another portal, has nothing left to be a frame.
        if !moving.contains(&detail) {
            world.graph.portals[portal as usize].fittings.push(Fitting {
                detail,
                part,
                motion: None,
            });
        }
    }
    for portal in &mut world.graph.portals {
        portal.fittings.sort_by_key(|f| f.detail);
        let mut fittings = portal.fittings.iter();
        // A door that one opens has a leaf that moves.
        if portal.kind == PortalKind::Door && !fittings.any(|f| f.part == FittingPart::Leaf) {
            portal.kind = without_leaf(portal, walls);
        }
    }
}

impl Object {
    fn of(world: &World, detail: u32) -> Self {
        let triangles = triangles_of(world, &world.details[detail as usize]);
        let (shells, n_shells) = if triangles.len() > MAX_TRIANGLES {
            (vec![0; triangles.len()], 1)
        } else {
            shells(&triangles)
        };
        let mut bounds = vec![Aabb::EMPTY; n_shells];
        for (t, &shell) in triangles.iter().zip(&shells) {
            let own = &mut bounds[shell as usize];
            *own = own.union(Aabb::of_points(t));
        }
        Self {
            detail,
            triangles,
            shells,
            bounds,
        }
    }
}

impl Object {
    fn in_shells(&self) -> InShells<'_> {
        InShells {
            triangles: &self.triangles,
            shells: &self.shells,
            bounds: &self.bounds,
        }
    }
}

/// Assigns each leaf to the portal that it fits best, and to others that it shuts as well.
fn hang(found: &[Role]) -> Vec<Hung> {
    let mut claims: Vec<(&Role, &Leaf)> = (found.iter())
        .flat_map(|r| r.roles.leaves.iter().map(move |l| (r, l)))
        .collect();
    claims.sort_by(|(a, x), (b, y)| {
        let by_fit = y.fit.total_cmp(&x.fit);
        by_fit.then_with(|| (a.portal, a.object, &x.shells).cmp(&(b.portal, b.object, &y.shells)))
    });
    let mut owner: HashMap<(u32, u32), usize> = HashMap::new();
    let mut hung: Vec<Hung> = Vec::new();
    for (role, leaf) in claims {
        let known = leaf
            .shells
            .iter()
            .find_map(|s| owner.get(&(role.object, *s)));
        let Some(&h) = known else {
            owner.extend(leaf.shells.iter().map(|&s| ((role.object, s), hung.len())));
            hung.push(Hung {
                portal: role.portal,
                object: role.object,
                leaf: leaf.clone(),
                portals: vec![role.portal],
            });
            continue;
        };
        let other = &mut hung[h];
        let is_shut = leaf.pose == Pose::Shut && other.leaf.pose == Pose::Shut;
        let n_shared = leaf
            .shells
            .iter()
            .filter(|s| other.leaf.shells.contains(s))
            .count();
        if is_shut && 2 * n_shared >= leaf.shells.len() && !other.portals.contains(&role.portal) {
            other.portals.push(role.portal);
        }
    }
    hung
}

/// All findings, before they are written to the world.
struct Fitted<'a> {
    world: &'a World,
    walls: &'a Bvh,
    openings: &'a [Option<Aperture>],
    /// For each portal, details near its opening.
    near: &'a [Vec<u32>],
    objects: &'a [Object],
    /// Sorted by portal.
    found: &'a [Role],
    hung: &'a [Hung],
    /// Indices into `hung`, for each portal and each object.
    of_portal: Vec<Vec<usize>>,
    of_object: Vec<Vec<usize>>,
}

impl Fitted<'_> {
    /// Returns the roles found at a portal.
    fn found_at(&self, portal: u32) -> &[Role] {
        let first = self.found.partition_point(|r| r.portal < portal);
        let rest = &self.found[first..];
        &rest[..rest.partition_point(|r| r.portal == portal)]
    }

    /// Returns how a leaf moves.
    fn motion(&self, h: usize) -> Motion {
        let Hung { portal, leaf, .. } = &self.hung[h];
        let graph = &self.world.graph;
        let opening = self.openings[*portal as usize].as_ref();
        let around = opening.map_or(&leaf.around, |o| &o.around);
        let cells = graph.portals[*portal as usize].cells;
        let volume = |c: CellId| {
            let cell = &graph[c];
            if cell.outdoor {
                f64::INFINITY
            } else {
                f64::from(cell.volume)
            }
        };
        let frame = self.frame(*portal, around);
        let own: Vec<u32> = (self.found_at(*portal).iter())
            .filter(|r| is_part(&r.roles))
            .map(|r| self.objects[r.object as usize].detail)
            .collect();
        let reach = opening.map_or(Aabb::EMPTY, Aperture::reach);
        let others: Vec<Triangle> = (self.near[*portal as usize].iter())
            .filter(|d| !own.contains(d))
            .filter_map(|d| self.objects.binary_search_by_key(d, |o| o.detail).ok())
            .flat_map(|o| &self.objects[o].triangles)
            .filter(|t| Aabb::of_points(*t).overlaps(&reach))
            .copied()
            .collect();
        let others = Bvh::build(&others);
        Around {
            locator: &graph.locator,
            walls: self.walls,
            opening: around,
            cells,
            volumes: cells.map(volume),
            frame,
            n_leaves: self.of_portal[*portal as usize].len(),
            is_furnished: &|p| {
                let near = others.any_within(p, ROOM, &mut NearSeries::default());
                near.is_some()
            },
        }
        .motion(leaf)
    }

    /// Returns the middle, along the opening's normal, of the fixed parts around it. [Units: wu]
    fn frame(&self, portal: u32, around: &Rectangle) -> Option<f64> {
        let mut bounds = Aabb::EMPTY;
        for role in self.found_at(portal).iter().filter(|r| is_part(&r.roles)) {
            let object = &self.objects[role.object as usize];
            let is_leaf = |shell: u32| {
                let mut own = self.of_object[role.object as usize].iter();
                own.any(|&h| self.hung[h].leaf.shells.contains(&shell))
            };
            for (t, &shell) in object.triangles.iter().zip(&object.shells) {
                if !is_leaf(shell) {
                    bounds = t.iter().fold(bounds, |b, p| b.including(around.place(*p)));
                }
            }
        }
        (!bounds.is_empty()).then_some((bounds.min.z + bounds.max.z) * 0.5)
    }

    /// Returns frames and panes: portal, detail, part.
    fn still(&self) -> Vec<(u32, u32, FittingPart)> {
        let part = |r: &Role| {
            let claimed = !r.roles.leaves.is_empty();
            let mut own = self.of_portal[r.portal as usize].iter();
            let hung = own.any(|&h| self.hung[h].object == r.object);
            if r.roles.is_pane {
                Some(FittingPart::Pane)
            } else {
                (r.roles.is_frame && (hung || !claimed)).then_some(FittingPart::Frame)
            }
        };
        (self.found.iter())
            .filter_map(|r| Some((r.portal, self.objects[r.object as usize].detail, part(r)?)))
            .collect()
    }

    /// Returns objects that lie on a leaf and move with it, such as handles and glass: detail, index of the leaf.
    fn carried(&self) -> Vec<(u32, usize)> {
        let mut out: BTreeMap<u32, usize> = BTreeMap::new();
        for role in self.found.iter().filter(|r| !is_part(&r.roles)) {
            let object = &self.objects[role.object as usize];
            let is_hung = !self.of_object[role.object as usize].is_empty();
            if is_hung || out.contains_key(&object.detail) {
                continue;
            }
            let mut own = self.of_portal[role.portal as usize].iter();
            let on = own.find(|&&h| {
                let leaf = &self.hung[h];
                leaf.portal == role.portal && leaf.leaf.carries(&object.triangles)
            });
            out.extend(on.map(|&h| (object.detail, h)));
        }
        out.into_iter().collect()
    }
}

/// Returns `true` if an object is a fitting of the opening.
fn is_part(roles: &Roles) -> bool {
    !roles.leaves.is_empty() || roles.is_frame || roles.is_pane
}

fn touching(reach: &Aabb, bounds: &[Aabb]) -> Vec<u32> {
    let touches = |(_, b): &(usize, &Aabb)| !b.is_empty() && b.overlaps(reach);
    (bounds.iter().enumerate().filter(touches))
        .map(|(i, _)| i as u32)
        .collect()
}

fn placed<'a>(world: &'a World, detail: &DetailObject) -> (&'a Mesh, DMat4) {
    let mesh = &world.detail_meshes[detail.mesh as usize];
    (mesh, detail.placement())
}

fn corners_of(world: &World, detail: &DetailObject) -> Vec<DVec3> {
    let (mesh, transform) = placed(world, detail);
    let corners = mesh.primitives.iter().flat_map(|p| &p.positions);
    corners
        .map(|p| transform.transform_point3(DVec3::from(p.map(f64::from))))
        .collect()
}

/// Returns the triangles in world space, primitive after primitive.
fn triangles_of(world: &World, detail: &DetailObject) -> Vec<Triangle> {
    let (mesh, transform) = placed(world, detail);
    let primitives = mesh.primitives.iter();
    primitives
        .flat_map(|p| p.placed_triangles(transform))
        .collect()
}
