//! Changes by hand: portals, doors, mirrors, lamps and crates in a finished world.

use enfilade_bake::edit::special::{SpecialError, SpecialSpot, mirror};
use enfilade_bake::edit::{AddPortalError, add_portal};
use enfilade_bake::simplify::delete_portal;
use enfilade_cpg::{CellId, CellPortalGraph, DetailObject, PortalId, PortalKind, World};
use enfilade_geom::scene::{Fixture, FixtureKind, Material, Mesh, Primitive};
use enfilade_geom::{Aabb, DMat4, DVec3, shown};
use enfilade_kit::InstanceId;
use enfilade_world::Pose;

/// Distance from a portal within which a point tells it. [Units: wu]
const AT: f64 = 0.05;
/// Side of a crate. [Units: wu]
const CRATE: f64 = 0.6;
/// Name of a crate's mesh and material.
const CRATE_NAME: &str = "crate";
/// The look of a crate, as glTF: brown wood.
const CRATE_LOOK: &str = r#"{"name":"crate","pbrMetallicRoughness":{"baseColorFactor":[0.45,0.28,0.13,1.0],"metallicFactor":0.0}}"#;
/// The light of a lamp, as glTF: a warm bulb of 10 candela.
const LAMP: &str = r#"{"type":"point","color":[1.0,0.78,0.5],"intensity":10.0}"#;

/// A change by hand, and the instance that it moves with.
#[derive(Clone, Debug, PartialEq)]
pub struct HandEdit {
    /// The instance in whose frame its points are; `None` for the frame of the world.
    pub host: Option<InstanceId>,
    /// The change.
    pub kind: HandEditKind,
}

/// Kind of a [`HandEdit`], with its points in the frame of its host. [Units: wu]
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum HandEditKind {
    /// A portal across a cell, given by a convex planar polygon that may reach into walls.
    Portal(Vec<DVec3>),
    /// No portal at this point: its two cells are one.
    NoPortal(DVec3),
    /// A door, or with a second time none, in the portal at this point.
    Door(DVec3),
    /// A mirror on a wall, given by a convex planar polygon.
    Mirror(Vec<DVec3>),
    /// A lamp that shines in all directions.
    Lamp(DVec3),
    /// A crate of 0.6 m that stands on this point, turned about the vertical. [Units: rad]
    Crate(DVec3, f64),
}

/// Reason why a change by hand cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HandEditError {
    /// The polygon cannot be a portal.
    #[error(transparent)]
    Portal(AddPortalError),
    /// The polygon cannot be a mirror.
    #[error(transparent)]
    Mirror(SpecialError),
    /// No portal is at the point.
    #[error("no portal is at {}{}", place(*.at), nearest_words(.nearest))]
    NoPortalAt {
        /// The point. [Units: wu]
        at: DVec3,
        /// The nearest portal, and its distance. [Units: wu]
        nearest: Option<(PortalId, f64)>,
    },
    /// A room would become a part of the outdoors.
    #[error("{portal} leads outdoors: without it, {} would be outdoors", shown(.cell))]
    Outdoors {
        /// The portal.
        portal: PortalId,
        /// Name of the room.
        cell: String,
    },
    /// The point is in solid matter.
    #[error("{} is in solid matter: a {what} needs air", place(*.at))]
    InSolid {
        /// The point. [Units: wu]
        at: DVec3,
        /// The kind of what would be there.
        what: &'static str,
    },
    /// A number is not finite.
    #[error("its numbers must be finite")]
    NotFinite,
    /// The instance that it moves with does not stand.
    #[error("its room is gone")]
    HostGone,
}

fn place(p: DVec3) -> String {
    format!("{:.2},{:.2},{:.2}", p.x, p.y, p.z)
}

fn nearest_words(nearest: &Option<(PortalId, f64)>) -> String {
    match nearest {
        Some((portal, by)) => format!("; {portal} is nearest, {by:.2} m off"),
        None => String::new(),
    }
}

impl HandEditKind {
    /// Returns a word for it.
    #[must_use]
    #[doc(hidden)]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Portal(_) => "portal",
            Self::NoPortal(_) => "no portal",
            Self::Door(_) => "door",
            Self::Mirror(_) => "mirror",
            Self::Lamp(_) => "lamp",
            Self::Crate(..) => CRATE_NAME,
        }
    }

    /// Returns the reason for which it rests where its portal is gone.
    pub(crate) fn unfound(&self) -> HandEditError {
        HandEditError::NoPortalAt {
            at: self.at(),
            nearest: None,
        }
    }

    /// Returns its middle.
    #[must_use]
    #[doc(hidden)]
    pub fn at(&self) -> DVec3 {
        match self {
            Self::Portal(corners) | Self::Mirror(corners) => {
                corners.iter().sum::<DVec3>() / corners.len().max(1) as f64
            }
            Self::NoPortal(at) | Self::Door(at) | Self::Lamp(at) | Self::Crate(at, _) => *at,
        }
    }

    /// Returns it with all points moved by a map; `by` is the angle about the vertical by which the map turns.
    pub(crate) fn mapped(&self, map: impl Fn(DVec3) -> DVec3, by: f64) -> Self {
        let all = |corners: &[DVec3]| corners.iter().map(|p| map(*p)).collect();
        match self {
            Self::Portal(corners) => Self::Portal(all(corners)),
            Self::Mirror(corners) => Self::Mirror(all(corners)),
            Self::NoPortal(at) => Self::NoPortal(map(*at)),
            Self::Door(at) => Self::Door(map(*at)),
            Self::Lamp(at) => Self::Lamp(map(*at)),
            Self::Crate(at, turn) => Self::Crate(map(*at), turn + by),
        }
    }

    fn is_finite(&self) -> bool {
        let turn = match self {
            Self::Crate(_, turn) => *turn,
            _ => 0.0,
        };
        let corners = match self {
            Self::Portal(corners) | Self::Mirror(corners) => corners.as_slice(),
            _ => &[],
        };
        self.at().is_finite() && turn.is_finite() && corners.iter().all(|p| p.is_finite())
    }

    /// Makes the change in a world, where its points are.
    pub(crate) fn make(&self, world: &mut World) -> Result<(), HandEditError> {
        if !self.is_finite() {
            return Err(HandEditError::NotFinite);
        }
        match self {
            Self::Portal(corners) => {
                *world = add_portal(world, corners)
                    .map_err(HandEditError::Portal)?
                    .world;
            }
            Self::NoPortal(at) => {
                let portal = portal_at(&world.graph, *at)?;
                let cells = world.graph[portal].cells.map(|c| &world.graph[c]);
                if cells.iter().any(|c| c.outdoor) {
                    let room = cells.iter().find(|c| !c.outdoor);
                    let cell = room.map_or_else(String::new, |c| c.name.clone());
                    return Err(HandEditError::Outdoors { portal, cell });
                }
                if let Some(merged) = delete_portal(world, portal) {
                    *world = merged.world;
                }
            }
            Self::Door(at) => {
                let portal = portal_at(&world.graph, *at)?;
                let kind = &mut world.graph.portals[portal.0 as usize].kind;
                *kind = match kind {
                    PortalKind::Door => PortalKind::Open,
                    _ => PortalKind::Door,
                };
            }
            Self::Mirror(corners) => {
                mirror(world, &SpecialSpot::Wall(corners.clone()))
                    .map_err(HandEditError::Mirror)?;
            }
            Self::Lamp(at) => {
                in_air(world, *at, "lamp")?;
                world.fixtures.push(Fixture {
                    kind: FixtureKind::Light,
                    name: "lamp".into(),
                    transform: DMat4::from_translation(*at),
                    gltf: LAMP.into(),
                    extras: String::new(),
                });
            }
            Self::Crate(at, turn) => add_crate(world, *at, *turn)?,
        }
        Ok(())
    }
}

fn in_air(world: &World, at: DVec3, what: &'static str) -> Result<CellId, HandEditError> {
    let cell = world.graph.locator.locate(at);
    cell.ok_or(HandEditError::InSolid { at, what })
}

/// Returns `true` if a point is in a portal.
pub(crate) fn is_portal_at(graph: &CellPortalGraph, portal: PortalId, at: DVec3) -> bool {
    graph[portal].distance(at) <= AT
}

/// Returns the portal that a point is in.
fn portal_at(graph: &CellPortalGraph, at: DVec3) -> Result<PortalId, HandEditError> {
    let distances = graph.portal_ids().map(|id| (id, graph[id].distance(at)));
    let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
    match nearest {
        Some((id, by)) if by <= AT => Ok(id),
        _ => Err(HandEditError::NoPortalAt { at, nearest }),
    }
}

/// Adds a crate that stands on a point.
fn add_crate(world: &mut World, at: DVec3, turn: f64) -> Result<(), HandEditError> {
    in_air(world, at + DVec3::Y * (CRATE * 0.5), CRATE_NAME)?;
    let own = crate_box();
    let is_own = |mesh: &Mesh| {
        mesh.name == CRATE_NAME
            && mesh
                .primitives
                .first()
                .is_some_and(|p| p.positions == own.positions)
    };
    let known = world.detail_meshes.iter().position(is_own);
    let mesh = known.unwrap_or_else(|| {
        let material = Some(world.materials.len() as u32);
        world.materials.push(Material {
            name: CRATE_NAME.into(),
            gltf: CRATE_LOOK.into(),
            base_color: [0.45, 0.28, 0.13, 1.0],
            ..Material::default()
        });
        let primitives = vec![Primitive { material, ..own }];
        world.detail_meshes.push(Mesh {
            name: CRATE_NAME.into(),
            primitives,
        });
        world.detail_meshes.len() - 1
    });
    let pose = Pose::about(DVec3::ZERO, DVec3::Y, turn);
    let transform = DMat4::from_translation(at) * pose.matrix();
    let mut cells = Vec::new();
    for triangle in world.detail_meshes[mesh].primitives[0].triangles() {
        let placed = triangle.map(|p| transform.transform_point3(p));
        world.graph.locator.cells_touching(&placed, &mut cells);
    }
    let n = world.detail_meshes[mesh].primitives[0].indices.len() / 3;
    for cell in &cells {
        world.graph.cells[cell.0 as usize].n_detail_triangles += n as u32;
    }
    // It may list the objects that are seen.
    world.pvs = None;
    world.details.push(DetailObject {
        name: CRATE_NAME.into(),
        mesh: mesh as u32,
        transform: transform.to_cols_array().map(|x| x as f32),
        cells,
        source: None,
        part_of: None,
    });
    Ok(())
}

/// Returns a box that stands on its origin, with flat sides.
fn crate_box() -> Primitive {
    let half = CRATE * 0.5;
    // Off the floor by less than is seen, so that it only touches its own room.
    let bounds = Aabb::new(
        DVec3::new(-half, 1e-3, -half),
        DVec3::new(half, CRATE, half),
    );
    let mut out = Primitive::default();
    for triangle in bounds.triangles() {
        let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
        for p in triangle {
            out.indices.push(out.positions.len() as u32);
            out.positions.push(p.as_vec3().to_array());
            out.normals.push(normal.normalize().as_vec3().to_array());
        }
    }
    out
}
