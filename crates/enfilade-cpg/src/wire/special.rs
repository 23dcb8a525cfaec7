//! Special portals in the form of the file.

use enfilade_geom::{DQuat, DVec3, Similarity};

use super::json::{Graph, PassJson, SpecialJson, WayJson};
use super::rows::take_polygon;
use super::{WireError, broken};
use crate::{CellId, MonitorCamera, Pass, PortalId, SpecialId, SpecialPortal, SpecialShape, Way};

/// The pieces of a special portal that covers a part of a wall; those of doorways are the portal's.
pub(super) fn surface(special: &SpecialPortal) -> Option<&Vec<Vec<[f32; 3]>>> {
    match &special.shape {
        SpecialShape::Portal(_) => None,
        SpecialShape::Surface { pieces, .. } => Some(pieces),
    }
}

pub(super) fn written(special: &SpecialPortal) -> SpecialJson {
    let (portal, normal) = match &special.shape {
        SpecialShape::Portal(portal) => (Some(portal.0), None),
        SpecialShape::Surface { normal, .. } => (None, Some(normal.map(f64::from))),
    };
    let lengths = |pieces: &Vec<Vec<_>>| pieces.iter().map(|p| p.len() as u32).collect();
    SpecialJson {
        name: special.name.clone(),
        cell: special.cell.0,
        portal,
        normal,
        pieces: surface(special).map(lengths),
        passes: special.passes.iter().map(written_pass).collect(),
    }
}

fn written_pass(pass: &Pass) -> PassJson {
    let tint = (pass.tint != Pass::CLEAR).then(|| pass.tint.map(f64::from));
    let of = |way| PassJson {
        way,
        tint,
        ..PassJson::default()
    };
    match &pass.way {
        Way::Through => of(WayJson::Through),
        Way::Mirror => of(WayJson::Mirror),
        Way::Lead { to, map, back } => {
            let Similarity { turn, at, scale } = map;
            PassJson {
                to: Some(to.0),
                translation: (*at != DVec3::ZERO).then(|| at.to_array()),
                rotation: (*turn != DQuat::IDENTITY).then(|| turn.to_array()),
                scale: (*scale != 1.0).then_some(*scale),
                back: back.map(|b| b.0),
                ..of(WayJson::Lead)
            }
        }
        Way::Monitor(camera) => PassJson {
            eye: Some(camera.eye.map(f64::from)),
            toward: Some(camera.toward.map(f64::from)),
            up: Some(camera.up.map(f64::from)),
            fov_y: Some(camera.fov_y.into()),
            ..of(WayJson::Monitor)
        },
    }
}

/// Name of the vertices, for errors.
pub(super) const CORNERS: &str = "the vertices of special portals";

/// Reads all special portals; `bytes` are their vertices.
pub(super) fn read_all(graph: &Graph, bytes: &[u8]) -> Result<Vec<SpecialPortal>, WireError> {
    if graph.version < 2 && !(graph.specials.is_empty() && graph.special_corners.is_none()) {
        return Err(broken("specials", "special portals need version 2"));
    }
    let (mut corners, rest) = bytes.as_chunks::<12>();
    if !rest.is_empty() {
        return Err(broken(CORNERS, "their buffer view is cut off"));
    }
    let specials = (graph.specials.iter().enumerate())
        .map(|(i, s)| read(i, s, &mut corners))
        .collect::<Result<_, _>>()?;
    if !corners.is_empty() {
        return Err(broken(CORNERS, "there are more than special portals use"));
    }
    Ok(specials)
}

/// Reads special portal `i`; takes its vertices from the front of `corners`.
fn read(
    i: usize,
    special: &SpecialJson,
    corners: &mut &[[u8; 12]],
) -> Result<SpecialPortal, WireError> {
    let owner = || SpecialId(i as u32).to_string();
    let shape = match (special.portal, special.normal, &special.pieces) {
        (Some(portal), None, None) => SpecialShape::Portal(PortalId(portal)),
        (None, Some(normal), Some(pieces)) => SpecialShape::Surface {
            normal: normal.map(|v| v as f32),
            pieces: (pieces.iter().map(|&n| take_polygon(corners, n, owner)))
                .collect::<Result<_, _>>()?,
        },
        _ => {
            let problem = "must have either a portal, or a normal and pieces";
            return Err(broken(owner(), problem));
        }
    };
    let passes = special.passes.iter().enumerate().map(|(k, pass)| {
        read_pass(pass).map_err(|problem| broken(format!("{}, pass {k}", owner()), problem))
    });
    Ok(SpecialPortal {
        name: special.name.clone(),
        cell: CellId(special.cell),
        shape,
        passes: passes.collect::<Result<_, _>>()?,
    })
}

fn read_pass(pass: &PassJson) -> Result<Pass, &'static str> {
    let single = |v: [f64; 3]| v.map(|x| x as f32);
    let is_placed = pass.translation.is_some() || pass.rotation.is_some() || pass.scale.is_some();
    let is_lead = pass.to.is_some() || pass.back.is_some() || is_placed;
    let is_camera =
        pass.eye.is_some() || pass.toward.is_some() || pass.up.is_some() || pass.fov_y.is_some();
    let (leads, shows) = match pass.way {
        WayJson::Through | WayJson::Mirror => (false, false),
        WayJson::Lead => (true, false),
        WayJson::Monitor => (false, true),
    };
    if is_lead && !leads {
        return Err("only a lead has to, back, translation, rotation and scale");
    }
    if is_camera && !shows {
        return Err("only a monitor has eye, toward, up and fovY");
    }
    let way = match pass.way {
        WayJson::Through => Way::Through,
        WayJson::Mirror => Way::Mirror,
        WayJson::Lead => Way::Lead {
            to: CellId(pass.to.ok_or("a lead needs the cell that it leads to")?),
            map: Similarity {
                turn: pass.rotation.map_or(DQuat::IDENTITY, DQuat::from_array),
                at: pass.translation.map_or(DVec3::ZERO, DVec3::from_array),
                scale: pass.scale.unwrap_or(1.0),
            },
            back: pass.back.map(SpecialId),
        },
        WayJson::Monitor => {
            let (Some(eye), Some(toward), Some(up), Some(fov_y)) =
                (pass.eye, pass.toward, pass.up, pass.fov_y)
            else {
                return Err("a monitor needs eye, toward, up and fovY");
            };
            Way::Monitor(MonitorCamera {
                eye: single(eye),
                toward: single(toward),
                up: single(up),
                fov_y: fov_y as f32,
            })
        }
    };
    Ok(Pass {
        way,
        tint: pass.tint.map_or(Pass::CLEAR, |t| t.map(|v| v as f32)),
    })
}
