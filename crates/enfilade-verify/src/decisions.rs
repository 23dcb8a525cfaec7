//! Decisions: each agrees with its own numbers, with what the cell, portal or place is, and with what verification measures on the
//! world's triangles.
//!
//! The facts of a bake are measured on voxels or tetrahedra and in columns, and are those of a whole space, of which a cell may be a part. So they
//! are compared with bounds, each several times the largest difference on forty bakes of buildings and levels of known truth.

mod measure;
mod spaces;

use enfilade_cpg::{Cell, CellPortalGraph, DecidedPlace, Fact, Portal, Reason, Why};
use enfilade_geom::Triangle;

use crate::kinds::is_by_rule;
use crate::subject::{Subject, to_dvec};

/// A kind of thing that a decision is about.
#[derive(Clone, Copy, Debug, PartialEq)]
enum About {
    Portal,
    Room,
    Void,
    /// A cell of air, whether a room or a void.
    Air,
    Outdoors,
    Land,
    /// A place within a cell.
    Inside,
    /// A place without a cell.
    Matter,
    /// A reason of a later version: a finding wherever it stands.
    Unknown,
}

impl About {
    fn of(reason: Reason) -> Self {
        match reason {
            Reason::Shut
            | Reason::Narrow
            | Reason::Neck
            | Reason::Mouth
            | Reason::Kept
            | Reason::Plane
            | Reason::Gap
            | Reason::Lid
            | Reason::Sealed
            | Reason::Unjoined
            | Reason::Border
            | Reason::Asked => Self::Portal,
            Reason::Standing | Reason::Entered | Reason::Unscaled => Self::Room,
            Reason::Low => Self::Void,
            Reason::Enclosed | Reason::Facing | Reason::Turned | Reason::Shell => Self::Air,
            Reason::Outside => Self::Outdoors,
            Reason::Land => Self::Land,
            Reason::Wide | Reason::Unframed | Reason::Merged | Reason::Sheltered => Self::Inside,
            Reason::Solid | Reason::Crevice => Self::Matter,
            _ => Self::Unknown,
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Portal => "portals",
            Self::Room => "rooms",
            Self::Void => "voids",
            Self::Air => "rooms and voids",
            Self::Outdoors => "the outdoors",
            Self::Land => "land",
            Self::Inside => "places within a cell",
            Self::Matter => "matter",
            Self::Unknown => "nothing known",
        }
    }
}

/// Returns problems, a line each. `own` are the structural triangles of the world.
pub(crate) fn check(subject: &Subject, own: &[Triangle], seed: u64) -> Vec<String> {
    let world = subject.world;
    let graph = &world.graph;
    let mut out = Vec::new();
    for cell in &graph.cells {
        let problems = cell.why.iter().filter_map(own_problem);
        out.extend(problems.map(|what| format!("{}: {what}", cell.name)));
        out.extend(label_problem(cell).map(|what| format!("{}: {what}", cell.name)));
    }
    for (i, portal) in graph.portals.iter().enumerate() {
        let problems = portal.why.iter().filter_map(|why| {
            own_problem(why).or_else(|| foreign_problem(why, &[About::Portal], "a portal"))
        });
        out.extend(problems.map(|what| format!("portal {i}: {what}")));
    }
    for (i, place) in graph.places.iter().enumerate() {
        let wanted = [About::Inside, About::Matter];
        let problem = own_problem(&place.why)
            .or_else(|| foreign_problem(&place.why, &wanted, "a place"))
            .or_else(|| matter_problem(subject, place));
        out.extend(problem.map(|what| format!("place {i}: {what}")));
    }
    // Later work changes what was measured.
    if is_by_rule(world) && is_decided(graph) {
        out.extend(lacking(graph));
        for (i, portal) in graph.portals.iter().enumerate() {
            let problem = portal
                .why
                .iter()
                .find_map(|why| area_problem(graph, portal, why));
            out.extend(problem.map(|what| format!("portal {i}: {what}")));
        }
        out.extend(border_problems(graph));
        out.extend(spaces::check(subject, own, seed));
    }
    out
}

/// Returns a contradiction between a decision's own numbers.
fn own_problem(why: &Why) -> Option<String> {
    let name = why.reason.name();
    // A mouth may be told by its shape, and a doubtful opening by its frame.
    let is_weighed = !matches!(why.reason, Reason::Mouth | Reason::Unjoined);
    if !why.holds() {
        Some(format!("its numbers contradict the decision \"{why}\""))
    } else if is_weighed && why.reason.fact().is_some() && why.comparison().is_none() {
        Some(format!("the decision '{name}' lacks what it weighed"))
    } else {
        None
    }
}

/// Returns the problem of a decision about something else.
fn foreign_problem(why: &Why, wanted: &[About], what: &str) -> Option<String> {
    let about = About::of(why.reason);
    // A person may ask for portals and for parts of cells.
    (why.reason != Reason::Asked && !wanted.contains(&about)).then(|| {
        let (name, about) = (why.reason.name(), about.words());
        format!("it is {what}, but the decision '{name}' is about {about}")
    })
}

/// Returns a contradiction between what a cell is and its decisions.
fn label_problem(cell: &Cell) -> Option<String> {
    let (wanted, what): (&[About], _) = match cell {
        _ if cell.outdoor => (&[About::Outdoors], "the outdoors"),
        _ if cell.is_land => (&[About::Land], "land"),
        _ if cell.is_void => (&[About::Void, About::Air], "a void"),
        _ => (&[About::Room, About::Air], "a room"),
    };
    let mut whys = cell.why.iter();
    let foreign = whys.find_map(|why| foreign_problem(why, wanted, what));
    foreign.or_else(|| {
        let has_main = cell
            .why
            .iter()
            .any(|why| why.reason == Reason::Asked || About::of(why.reason) == wanted[0]);
        (!cell.why.is_empty() && !has_main)
            .then(|| format!("it is {what}, but no decision says so"))
    })
}

/// Returns the problem of a place that is not a cell, but lies in one. Where an opening was, the middle of what was cut may be in a wall.
fn matter_problem(subject: &Subject, place: &DecidedPlace) -> Option<String> {
    let cell = subject.locator.locate(to_dvec(place.at))?;
    let (name, what) = (place.why.reason.name(), subject.cell_name(cell));
    let is_matter = About::of(place.why.reason) == About::Matter;
    (is_matter && is_by_rule(subject.world))
        .then(|| format!("the decision '{name}' is about matter, but it is in {what}"))
}

/// Returns `true` if the world is of a version that keeps decisions.
fn is_decided(graph: &CellPortalGraph) -> bool {
    let of_cells = graph.cells.iter().map(|c| &c.why);
    let mut all = of_cells.chain(graph.portals.iter().map(|p| &p.why));
    all.any(|whys| !whys.is_empty())
}

/// Returns contradictions between land and the borders that part it: each area has one, and each is that of an area.
fn border_problems(graph: &CellPortalGraph) -> Vec<String> {
    let is_border = |p: &Portal| p.why.iter().any(|why| why.reason == Reason::Border);
    let land = graph.cells.iter().filter(|c| c.is_land);
    let bare = land.filter(|c| !c.portals.iter().any(|&p| is_border(&graph[p])));
    let mut out: Vec<String> = bare
        .map(|c| {
            format!(
                "{}: it is land, but no border parts it from other land",
                c.name
            )
        })
        .collect();
    for (i, portal) in graph.portals.iter().enumerate() {
        if is_border(portal) && !portal.cells.iter().any(|&c| graph[c].is_land) {
            out.push(format!(
                "portal {i}: a border of open land, but no land is beside it"
            ));
        }
    }
    out
}

/// Names the first cell and the first portal without a decision.
fn lacking(graph: &CellPortalGraph) -> impl Iterator<Item = String> {
    let cell = graph.cells.iter().find(|c| c.why.is_empty());
    let cell = cell.map(|c| format!("{}: nothing tells why it is there", c.name));
    let portal = graph.portals.iter().position(|p| p.why.is_empty());
    let portal = portal.map(|i| format!("portal {i}: nothing tells why it is there"));
    cell.into_iter().chain(portal)
}

/// Most that a portal is larger than what was measured of its opening: its outline follows a plane through air that a coarse grid fills. It
/// was 12 at most.
const MOST_PLANE: f64 = 24.0;
/// The same both ways, for an opening that a leaf shuts or that a decimation kept: 3.3 at most.
const MOST_FRAMED: f64 = 6.0;

/// Returns a contradiction between the area of an opening and that of the portals that are made of it.
///
/// In the open, portals may be the little of an opening that walls of other cells left, so an area is never too large there.
fn area_problem(graph: &CellPortalGraph, portal: &Portal, why: &Why) -> Option<String> {
    let said = f64::from(*why.facts.get(&Fact::Area)?);
    let own = f64::from(portal.area);
    let is_framed = matches!(why.reason, Reason::Shut | Reason::Kept);
    let too_small = own / if is_framed { MOST_FRAMED } else { MOST_PLANE };
    // Several portals of one opening have the same decision.
    let beside = graph[portal.cells[0]].portals.iter().map(|&p| &graph[p]);
    let of_opening = beside.filter(|p| p.why.contains(why));
    let all: f64 = of_opening.map(|p| f64::from(p.area)).sum();
    let is_wrong = said < too_small || is_framed && said > MOST_FRAMED * all;
    is_wrong.then(|| {
        let name = why.reason.name();
        format!("the decision '{name}' is about an opening of {said:.3} m², but it has {own:.3} m²")
    })
}
