//! Pieces: baked worlds with attachments, prepared once and shared by all their instances.

use std::collections::BTreeMap;
use std::sync::Arc;

use enfilade_cpg::{CellId, GraphError, PortalId, PortalKind, World};
use enfilade_geom::{Aabb, DVec3, shown};

use crate::fit::{Mouth, point};
use crate::prepare;
use crate::shape::{Attachment, PieceShape};

/// A chosen attachment: its name, and where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// Name for it.
    pub name: String,
    /// The opening.
    pub spot: Spot,
}

/// A way to tell an opening of a piece.
#[derive(Clone, Debug, PartialEq)]
pub enum Spot {
    /// Its number.
    Portal(PortalId),
    /// The opening to the outdoors whose middle is nearest. [Units: wu]
    Near(DVec3),
}

/// Openings of a piece that are attachments.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Choice {
    /// All doorways and doors to the outdoors, named by the side of the piece: `east` (+x), `south` (+z), `west`, `north`, `up` and
    /// `down`, with a number from the second on. Windows and cracks are none.
    #[default]
    Doorways,
    /// These, of any kind.
    Only(Vec<Chosen>),
}

/// Reason why a world cannot be a piece.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PieceError {
    /// The world breaks an invariant.
    #[error("the world is broken: {0}")]
    Invalid(GraphError),
    /// The world has no outdoors.
    #[error(
        "it has no outdoors, so nothing can be attached to it; bake it as a closed solid that stands in the open"
    )]
    NoOutdoors,
    /// The world has mirrors or other special portals.
    #[error("{} is a special portal, which pieces cannot have; remove it with `enfilade edit --delete-special`", shown(.0))]
    Special(String),
    /// Two attachments have one name.
    #[error("two attachments are named {:?}; give each a name of its own", shown(.0).to_string())]
    NamedTwice(String),
    /// A chosen portal does not exist or does not lead outdoors.
    #[error("attachment {:?}: {portal} does not lead outdoors; portals that do: {}", shown(.name).to_string(), list(.outward))]
    NotOutward {
        /// Name of the attachment.
        name: String,
        /// The portal.
        portal: PortalId,
        /// Those that lead outdoors.
        outward: Vec<PortalId>,
    },
}

fn list(portals: &[PortalId]) -> String {
    let names: Vec<String> = portals.iter().map(ToString::to_string).collect();
    if names.is_empty() {
        "none".into()
    } else {
        names.join(", ")
    }
}

/// A baked world with attachments.
///
/// Its world is that of the bake, except that the portals of attachments stand in the outer faces of their walls.
#[derive(Clone, Debug)]
pub struct Piece {
    name: String,
    world: Arc<World>,
    attachments: Vec<Attachment>,
    pub(crate) outdoors: CellId,
    pub(crate) shape: PieceShape,
}

impl Piece {
    /// Prepares a world as a piece. O(its size).
    ///
    /// # Errors
    ///
    /// If the world is invalid, has no outdoors or has special portals, or if a chosen opening does not lead outdoors or shares a
    /// name.
    pub fn new(
        name: impl Into<String>,
        mut world: World,
        choice: &Choice,
    ) -> Result<Self, PieceError> {
        if let Err(errors) = world.validate()
            && let Some(first) = errors.into_iter().next()
        {
            return Err(PieceError::Invalid(first));
        }
        let outdoors = world.graph.outdoors().ok_or(PieceError::NoOutdoors)?;
        if let Some(special) = world.graph.specials.first() {
            return Err(PieceError::Special(special.name.clone()));
        }
        world.pvs = None;
        world.room_facts = None;
        let chosen = chosen(&world, outdoors, choice)?;
        let mut attachments: Vec<Attachment> = (chosen.into_iter())
            .map(|(name, portal)| attachment(&world, outdoors, name, portal))
            .collect();
        prepare::move_to_faces(&mut world, outdoors, &mut attachments);
        let shape = prepare::shape(&mut world, outdoors);
        Ok(Self {
            name: name.into(),
            world: Arc::new(world),
            attachments,
            outdoors,
            shape,
        })
    }

    /// Returns its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns its world.
    #[must_use]
    pub fn world(&self) -> &Arc<World> {
        &self.world
    }

    /// Returns its attachments.
    #[must_use]
    pub fn attachments(&self) -> &[Attachment] {
        &self.attachments
    }

    /// Returns the number of the attachment of a name.
    #[must_use]
    pub fn attachment_named(&self, name: &str) -> Option<usize> {
        self.attachments.iter().position(|a| a.name == name)
    }

    /// Returns the box around its rooms and walls. [Units: wu]
    #[must_use]
    pub fn bounds(&self) -> &Aabb {
        &self.shape.bounds
    }
}

fn attachment(world: &World, outdoors: CellId, name: String, portal: PortalId) -> Attachment {
    let own = &world.graph[portal];
    let out = if own.cells[1] == outdoors { 1.0 } else { -1.0 };
    Attachment {
        name,
        portal,
        cell: own.beyond(outdoors),
        kind: own.kind,
        mouth: Mouth::of_portal(own, point(own.normal) * out),
    }
}

/// Returns the portals that are attachments, with their names.
fn chosen(
    world: &World,
    outdoors: CellId,
    choice: &Choice,
) -> Result<Vec<(String, PortalId)>, PieceError> {
    let graph = &world.graph;
    let outward: Vec<PortalId> = graph.exits(outdoors).map(|exit| exit.id).collect();
    let middle = |id: PortalId| {
        let corners = graph[id].outline.iter().map(|p| point(*p));
        corners.sum::<DVec3>() / graph[id].outline.len().max(1) as f64
    };
    let Choice::Only(wanted) = choice else {
        let mut n_named: BTreeMap<&str, usize> = BTreeMap::new();
        let is_way = |id: &PortalId| matches!(graph[*id].kind, PortalKind::Open | PortalKind::Door);
        let named = outward.into_iter().filter(is_way).map(|id| {
            let sign = if graph[id].cells[1] == outdoors {
                1.0
            } else {
                -1.0
            };
            let side = side(point(graph[id].normal) * sign);
            let n = n_named.entry(side).or_default();
            *n += 1;
            let name = if *n == 1 {
                side.to_owned()
            } else {
                format!("{side}-{n}")
            };
            (name, id)
        });
        return Ok(named.collect());
    };
    let mut named: Vec<(String, PortalId)> = Vec::new();
    for Chosen { name, spot } in wanted {
        let portal = match spot {
            Spot::Portal(portal) => *portal,
            Spot::Near(p) => {
                let distance = |id: &PortalId| middle(*id).distance(*p);
                let nearest =
                    (outward.iter().copied()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
                nearest.unwrap_or(PortalId(u32::MAX))
            }
        };
        if !outward.contains(&portal) {
            let name = name.clone();
            return Err(PieceError::NotOutward {
                name,
                portal,
                outward,
            });
        }
        if named.iter().any(|known| known.0 == *name) {
            return Err(PieceError::NamedTwice(name.clone()));
        }
        named.push((name.clone(), portal));
    }
    Ok(named)
}

/// Returns the name of the side of a piece with this outer normal.
fn side(out: DVec3) -> &'static str {
    let axis = (0..3).max_by(|a, b| out[*a].abs().total_cmp(&out[*b].abs()));
    let axis = axis.unwrap_or(0);
    [["west", "east"], ["down", "up"], ["north", "south"]][axis][usize::from(out[axis] > 0.0)]
}
