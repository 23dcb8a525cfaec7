//! A verdict on a world in plain words: how far to trust it, and the option of `enfilade bake` to try if not.

use std::fmt::Write as _;

use enfilade_cpg::{CellPortalGraph, DecidedPlace, Doubt, Reason as Decision, Why, World};
use serde::Serialize;

/// A foot. [Units: wu]
const FOOT: f32 = 0.3048;
/// Usual heights of doors, up to those of public buildings with a light above. In no other unit but feet do the numbers
/// come near. [Units: wu]
const DOOR: [f32; 2] = [1.8, 3.0];

/// Share of rooms expected to be wrong from which a world is not good: one in ten.
const GOOD: f32 = 0.1;
/// … and from which it is probably not the building that was meant.
const LOW: f32 = 0.4;
/// Options that are tried before they are proposed.
const TRIED: [&str; 3] = ["--unit", "--up", "--min-cost"];
/// Spaces that are named, and close decisions in JSON. The sentence names the closest alone.
const NAMED: usize = 3;

/// How far to trust a world, by the margins of the decisions that made its rooms, and by signs in it that it is another than was meant.
#[derive(Clone, Debug, Serialize)]
pub struct Verdict {
    trust: Trust,
    /// A sentence about what was found.
    summary: String,
    /// Share of the rooms that are expected to be wrong.
    doubt: f32,
    /// The places most in doubt.
    close: Vec<Close>,
    reasons: Vec<Reason>,
    #[serde(skip)]
    n_rooms: usize,
}

/// A place most in doubt.
#[derive(Clone, Debug, Serialize)]
struct Close {
    position: [f32; 3],
    /// Chance that the decision is wrong, 0.5 at most.
    chance: f32,
    /// The outcome.
    is: Made,
    text: String,
    /// The text without the facts that did not decide; `None` if a reason names the place.
    #[serde(skip)]
    short: Option<String>,
}

/// The outcome at a place, as far as people can decide otherwise.
#[derive(Clone, Copy, Debug, Serialize)]
enum Made {
    /// An opening within one room.
    #[serde(rename = "one room")]
    OneRoom,
    /// A portal.
    #[serde(rename = "two rooms")]
    TwoRooms,
    /// A whole cell, or none.
    #[serde(rename = "space")]
    Space,
}

impl Made {
    fn of(why: &Why) -> Self {
        match why.reason {
            Decision::Wide | Decision::Unframed => Self::OneRoom,
            Decision::Narrow
            | Decision::Neck
            | Decision::Mouth
            | Decision::Shut
            | Decision::Unjoined => Self::TwoRooms,
            _ => Self::Space,
        }
    }
}

/// A doubt about the input that was reported before the bake.
#[derive(Clone, Debug)]
pub struct InputDoubt {
    /// The doubt, and the option that settles it.
    pub text: String,
    /// It is about the axis that points up, which a world shows by its floors and doorways.
    pub is_about_up: bool,
}

/// Trust, the most first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
enum Trust {
    /// Nothing speaks against it.
    Good,
    /// Parts of it may be wrong.
    Fair,
    /// It is probably not the building that was meant.
    Low,
    /// There is no room.
    None,
}

/// A reason for less trust.
#[derive(Clone, Debug, Serialize)]
struct Reason {
    /// The sign, and the usual cause.
    text: String,
    /// Options to try.
    options: Vec<String>,
}

impl Verdict {
    /// Judges a valid world. `said` are doubts about its input that were reported before the bake.
    #[must_use]
    pub fn of(world: &World, said: &[InputDoubt]) -> Self {
        let doubts = world.doubts();
        let is_grave = |doubt: &Doubt| {
            !matches!(
                doubt,
                Doubt::NoDoorway(..) | Doubt::OpenToSky(..) | Doubt::MoreCracks { .. }
            )
        };
        let is_on_its_side =
            |doubt: &Doubt| matches!(doubt, Doubt::FlatDoorways(..) | Doubt::NoFloors(..));
        // Rooms with floors and upright doorways refute the doubt about the axis.
        let lies = doubts.iter().any(is_on_its_side);
        let said: Vec<&InputDoubt> = said.iter().filter(|d| lies || !d.is_about_up).collect();
        let of_rooms = world.graph.room_doubt();
        let taken = taken(&world.graph);
        let places = world.graph.places.iter().filter(|p| p.why.takes_room());
        let is_taken = |at: [f32; 3]| places.clone().any(|place| place.at == at);
        let trust = if is_empty(world) {
            Trust::None
        } else if !said.is_empty() || doubts.iter().any(is_grave) || of_rooms.share >= LOW {
            Trust::Low
        } else if doubts.is_empty() && of_rooms.share < GOOD && taken.is_none() {
            Trust::Good
        } else {
            Trust::Fair
        };
        let of_input = said.iter().map(|doubt| Reason {
            text: doubt.text.clone(),
            options: Vec::new(),
        });
        let close = of_rooms.close.iter().take(NAMED).map(|close| Close {
            position: close.at,
            chance: close.chance,
            is: Made::of(&close.why),
            text: close.why.to_string(),
            short: (!is_taken(close.at)).then(|| format!("{:#}", close.why)),
        });
        Self {
            trust,
            summary: found(world),
            n_rooms: world.graph.rooms().count(),
            doubt: of_rooms.share,
            close: close.collect(),
            reasons: of_input
                .chain(taken)
                .chain(doubts.iter().map(reason))
                .collect(),
        }
    }
}

impl Verdict {
    /// Replaces each option that is proposed by the one that `tried` makes of it, and takes back those of which it makes nothing.
    pub fn advise(&mut self, mut tried: impl FnMut(&str) -> Option<String>) {
        for reason in &mut self.reasons {
            let options = reason.options.iter().filter_map(|option| tried(option));
            reason.options = options.collect();
        }
    }

    /// Returns it without options that read the input in another way, for callers that do not try them.
    #[must_use]
    pub fn untried(mut self) -> Self {
        let is_tried = |option: &str| TRIED.iter().any(|name| option.starts_with(name));
        self.advise(|option| (!is_tried(option)).then(|| option.to_owned()));
        self
    }

    /// Returns `true` if a world deserves more trust than another one of the same input; of equal trust, if fewer of its rooms are in
    /// doubt.
    #[must_use]
    pub fn is_better_than(&self, other: &Self) -> bool {
        self.trust < other.trust || self.trust == other.trust && self.doubt < other.doubt
    }

    /// Returns `true` if nothing speaks against the world.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.trust == Trust::Good
    }

    /// Number of its rooms.
    #[must_use]
    pub fn n_rooms(&self) -> usize {
        self.n_rooms
    }

    /// Returns the reasons for less trust, with the options to try.
    #[must_use]
    pub fn why(&self) -> String {
        Reason::all(&self.reasons)
    }

    /// Returns the verdict as a sentence of a page.
    #[must_use]
    pub fn sentence(&self) -> String {
        let text = self.to_string();
        let mut letters = text.chars();
        let first = letters.next().map(|c| c.to_ascii_uppercase());
        format!("{}{}.", first.unwrap_or_default(), letters.as_str())
    }
}

/// Returns `true` if no cell is indoors.
#[must_use]
pub fn is_empty(world: &World) -> bool {
    world.graph.indoor_cells().next().is_none()
}

/// Returns the reasons why a world has no room, with the options to try.
#[must_use]
pub fn why_empty(world: &World) -> String {
    Verdict::of(world, &[]).untried().why()
}

impl Reason {
    fn all(reasons: &[Self]) -> String {
        let texts = reasons.iter().map(|reason| {
            let mut text = reason.text.clone();
            if !reason.options.is_empty() {
                let _ = write!(text, " (try {})", reason.options.join(" or "));
            }
            text
        });
        texts.collect::<Vec<_>>().join("; ")
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let trust = match self.trust {
            Trust::Good => "good",
            Trust::Fair => "fair",
            Trust::Low => "low",
            Trust::None => "none",
        };
        write!(f, "trust: {trust}: {}", self.summary)?;
        if !self.reasons.is_empty() {
            write!(f, "; {}", Reason::all(&self.reasons))?;
        }
        if self.close.is_empty() {
            return Ok(());
        }
        let percent = (100.0 * self.doubt).ceil();
        write!(f, "; {percent} % of the rooms in doubt")?;
        let closest = self
            .close
            .iter()
            .find_map(|c| Some((c.position, c.short.as_ref()?)));
        if let Some(([x, y, z], text)) = closest {
            write!(f, ", most of all at {x:.2} {y:.2} {z:.2}: {text}")?;
        }
        f.write_str(" (inspect --why all)")
    }
}

/// Returns the cells of a graph by kind in words, always in this order: rooms, voids, land, outdoors.
#[must_use]
pub fn cells_in_words(graph: &CellPortalGraph) -> String {
    let rooms = graph.rooms().count();
    let indoors = graph.indoor_cells().count();
    let n_land = graph.cells.iter().filter(|c| c.is_land).count();
    let land = match n_land {
        0 => String::new(),
        1 => ", 1 area of land".to_owned(),
        n => format!(", {n} areas of land"),
    };
    let voids = match indoors - rooms - n_land {
        0 => String::new(),
        n => format!(", {}", count(n, "void")),
    };
    let outdoors = match graph.cells.len() - indoors {
        0 => "",
        _ => " and outdoors",
    };
    format!("{}{voids}{land}{outdoors}", count(rooms, "room"))
}

/// Number of things, with the noun.
fn count(n: usize, noun: &str) -> String {
    let plural = if n == 1 { "" } else { "s" };
    format!("{n} {noun}{plural}")
}

fn found(world: &World) -> String {
    let graph = &world.graph;
    let rooms = graph.rooms().count();
    let n_land = graph.cells.iter().filter(|c| c.is_land).count();
    if rooms == 0 && n_land == 0 {
        return "no rooms".into();
    }
    if n_land > 0 {
        return cells_in_words(graph);
    }
    let rooms = count(rooms, "room");
    if world.doubts().is_empty() {
        let has_doorways = !graph.portals.is_empty();
        return match has_doorways {
            true => format!("{rooms}, with floors and doorways for people"),
            false => format!("{rooms}, closed on all sides"),
        };
    }
    rooms
}

/// Returns the reason for less trust if spaces as large as rooms are not rooms of their own.
fn taken(graph: &CellPortalGraph) -> Option<Reason> {
    let taken: Vec<&DecidedPlace> = (graph.places.iter())
        .filter(|place| place.why.takes_room())
        .collect();
    let mut text = match taken.len() {
        0 => return None,
        1 => "a space as large as a room is none of its own:".to_owned(),
        n => format!("{n} spaces as large as rooms are none of their own:"),
    };
    for (i, place) in taken.iter().take(NAMED).enumerate() {
        let [x, y, z] = place.at;
        let comma = if i == 0 { "" } else { "," };
        let _ = write!(text, "{comma} at {x:.2} {y:.2} {z:.2} {:#}", place.why);
    }
    let is_merged = taken.iter().any(|p| p.why.reason == Decision::Merged);
    Some(Reason {
        text,
        options: is_merged
            .then(|| "--min-cost 0".to_owned())
            .into_iter()
            .collect(),
    })
}

fn reason(doubt: &Doubt) -> Reason {
    let (text, options): (String, &[&str]) = match *doubt {
        Doubt::NoRooms => (
            "all air is open to the outdoors: a roof, a wall or a floor is missing, walls were taken for furniture, or openings \
             are as wide as rooms"
                .into(),
            &[
                "--leak-path",
                "--structural-name 'PATTERN'",
                "--unit UNIT",
                "--up z",
            ],
        ),
        Doubt::OnlyVoids(n) => (
            format!("{} in which nobody can stand", count(n, "space")),
            &["--unit UNIT", "--up z"],
        ),
        Doubt::FlatDoorways(flat, all) => (
            format!("{flat} of {all} doorways lie in floors and ceilings, as if it lay on its side"),
            &["--up z"],
        ),
        Doubt::NoFloors(n, of) => (
            format!("{n} of {} have no floor", count(of, "room")),
            &["--up z", "--structural-name 'PATTERN'"],
        ),
        Doubt::DoorHeight(height) => {
            let feet = height * FOOT;
            let options: &[&str] = if (DOOR[0]..=DOOR[1]).contains(&feet) {
                &["--unit ft"]
            } else {
                &["--unit UNIT"]
            };
            (format!("doors are {height:.1} m high"), options)
        }
        Doubt::MoreVoids { voids, rooms } => (
            format!(
                "{} too low or narrow to stand in, more than the {}: hollow walls and ceilings, or a wrong unit",
                count(voids, "space"),
                count(rooms, "room")
            ),
            &["--unit UNIT"],
        ),
        Doubt::NoDoorways { openings, .. } => (
            format!(
                "no doorway among {}: door leaves were taken for walls, or the input has no doors",
                count(openings, "opening")
            ),
            &["--detail-name 'PATTERN'"],
        ),
        Doubt::ManyOpenings { openings, cells } => (
            format!(
                "{} for {}: furniture was taken for walls",
                count(openings, "opening"),
                count(cells, "space")
            ),
            &["--detail-name 'PATTERN'"],
        ),
        Doubt::OpenToSky(n, of) => (
            format!("{n} of {} open to the sky", count(of, "room")),
            &[],
        ),
        Doubt::MoreCracks { cracks, others } => (
            format!(
                "{}, but {others} doorways and windows: surfaces that should meet do not",
                count(cracks, "crack")
            ),
            &["--smallest-hole WIDTH", "--repair"],
        ),
        Doubt::NoDoorway(n, of) => (
            format!("{n} of {} without a doorway", count(of, "room")),
            &["--detail-name 'PATTERN'"],
        ),
        // A later version may have more.
        _ => ("it has a doubt that this version has no words for".into(), &[]),
    };
    Reason {
        text,
        options: options.iter().map(|&option| option.to_owned()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_space_that_is_no_room_of_its_own_is_named_with_its_place() {
        let place = |reason| DecidedPlace {
            at: [1.0, 2.0, 3.5],
            why: enfilade_cpg::Why::given(reason),
        };
        let of = |places| {
            taken(&CellPortalGraph {
                places,
                ..CellPortalGraph::default()
            })
        };
        assert!(of(vec![]).is_none());
        assert!(of(vec![place(Decision::Wide)]).is_none());
        let merged = of(vec![place(Decision::Wide), place(Decision::Merged)]).unwrap();
        assert!(
            merged.text.contains("at 1.00 2.00 3.50 one cell"),
            "{}",
            merged.text
        );
        assert_eq!(merged.options, ["--min-cost 0"]);
        assert!(of(vec![place(Decision::Solid)]).unwrap().options.is_empty());
    }

    #[test]
    fn doors_as_high_in_feet_as_doors_are_name_feet() {
        for (height, option) in [
            (6.6, "--unit ft"),
            (8.25, "--unit ft"),
            (79.0, "--unit UNIT"),
        ] {
            let reason = reason(&Doubt::DoorHeight(height));
            assert_eq!(reason.options, [option], "{height}");
        }
    }

    #[test]
    fn advice_is_what_was_tried_and_a_verdict_is_better_by_trust_then_by_doubt() {
        let verdict = |trust, doubt| Verdict {
            trust,
            summary: String::new(),
            doubt,
            close: Vec::new(),
            reasons: vec![reason(&Doubt::NoFloors(1, 2))],
            n_rooms: 2,
        };
        let mut low = verdict(Trust::Low, 0.2);
        low.advise(|option| (option == "--up z").then(|| "--up y".to_owned()));
        assert!(
            low.why().ends_with("have no floor (try --up y)"),
            "{}",
            low.why()
        );
        assert!(
            verdict(Trust::Low, 0.2)
                .untried()
                .why()
                .ends_with("(try --structural-name 'PATTERN')")
        );
        low.advise(|_| None);
        assert!(low.why().ends_with("have no floor"), "{}", low.why());
        assert!(verdict(Trust::Fair, 0.5).is_better_than(&low));
        assert!(verdict(Trust::Low, 0.1).is_better_than(&low));
        assert!(!verdict(Trust::Low, 0.2).is_better_than(&low));
        assert!(!verdict(Trust::None, 0.0).is_better_than(&low));
    }
}
