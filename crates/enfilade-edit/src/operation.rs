//! Operations of a session, and their lines in a journal.

use enfilade_geom::{DQuat, DVec3};
use enfilade_kit::InstanceId;
use enfilade_world::Pose;

use crate::hand::{HandEdit, HandEditKind};

/// A change of a session's world.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum EditOperation {
    /// Places a piece.
    Put {
        /// Name of the piece.
        piece: String,
        /// Name of the instance; that of the piece and a number if absent.
        name: Option<String>,
        /// Its pose.
        pose: Pose,
    },
    /// Takes an instance away.
    Take(InstanceId),
    /// Moves or turns an instance.
    Move(InstanceId, Pose),
    /// Changes the world by hand.
    Make(HandEdit),
    /// Takes a change by hand away, by its place among those that there are.
    Unmake(usize),
}

impl EditOperation {
    /// Returns the operation that places a piece.
    #[must_use]
    pub fn put(piece: &str, name: Option<&str>, pose: Pose) -> Self {
        Self::Put {
            piece: piece.to_owned(),
            name: name.map(str::to_owned),
            pose,
        }
    }

    /// Returns its line in a journal, without its end: fields between tabs. Numbers are read back as they were.
    pub(crate) fn line(&self) -> String {
        match self {
            Self::Put { piece, name, pose } => {
                // A name that is absent has no field.
                let name = name.as_ref().map(|n| format!("\t{}", escaped(n)));
                format!(
                    "put\t{}\t{}{}",
                    escaped(piece),
                    pose_text(pose),
                    name.unwrap_or_default()
                )
            }
            Self::Take(id) => format!("take\t{}", id.0),
            Self::Move(id, pose) => format!("move\t{}\t{}", id.0, pose_text(pose)),
            Self::Make(edit) => {
                let host = edit.host.map_or("-".into(), |id| id.0.to_string());
                let (word, points, turn) = match &edit.kind {
                    HandEditKind::Portal(corners) => ("portal", corners.clone(), None),
                    HandEditKind::Mirror(corners) => ("mirror", corners.clone(), None),
                    HandEditKind::NoPortal(at) => ("no-portal", vec![*at], None),
                    HandEditKind::Door(at) => ("door", vec![*at], None),
                    HandEditKind::Lamp(at) => ("lamp", vec![*at], None),
                    HandEditKind::Crate(at, turn) => ("crate", vec![*at], Some(*turn)),
                };
                let numbers = points.iter().flat_map(DVec3::to_array).chain(turn);
                format!("make\t{host}\t{word}\t{}", numbers_text(numbers))
            }
            Self::Unmake(at) => format!("unmake\t{at}"),
        }
    }

    /// Reads a line of a journal.
    ///
    /// # Errors
    ///
    /// The reason, in words.
    pub(crate) fn of_line(line: &str) -> Result<Self, String> {
        let fields: Vec<&str> = line.split('\t').collect();
        let number = |text: &str| {
            text.parse::<u32>()
                .map_err(|_| format!("'{text}' is not a number"))
        };
        match fields[..] {
            ["put", piece, pose, ref name @ ..] if name.len() < 2 => Ok(Self::Put {
                piece: unescaped(piece),
                name: name.first().map(|n| unescaped(n)),
                pose: pose_of(pose)?,
            }),
            ["take", id] => Ok(Self::Take(InstanceId(number(id)?))),
            ["move", id, pose] => Ok(Self::Move(InstanceId(number(id)?), pose_of(pose)?)),
            ["unmake", at] => Ok(Self::Unmake(number(at)? as usize)),
            ["make", host, word, numbers] => {
                let host = match host {
                    "-" => None,
                    id => Some(InstanceId(number(id)?)),
                };
                let kind = kind_of(word, &numbers_of(numbers)?)?;
                Ok(Self::Make(HandEdit { host, kind }))
            }
            _ => Err(format!(
                "'{}' with {} fields is no operation",
                fields[0],
                fields.len()
            )),
        }
    }
}

fn kind_of(word: &str, numbers: &[f64]) -> Result<HandEditKind, String> {
    let (points, rest) = numbers.as_chunks::<3>();
    let corners: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(*p)).collect();
    match (word, &corners[..], rest) {
        ("portal", [_, _, _, ..], []) => Ok(HandEditKind::Portal(corners)),
        ("mirror", [_, _, _, ..], []) => Ok(HandEditKind::Mirror(corners)),
        ("no-portal", [at], []) => Ok(HandEditKind::NoPortal(*at)),
        ("door", [at], []) => Ok(HandEditKind::Door(*at)),
        ("lamp", [at], []) => Ok(HandEditKind::Lamp(*at)),
        ("crate", [at], [turn]) => Ok(HandEditKind::Crate(*at, *turn)),
        _ => Err(format!(
            "'{word}' with {} numbers is no change by hand",
            numbers.len()
        )),
    }
}

fn numbers_text(numbers: impl Iterator<Item = f64>) -> String {
    // The shortest decimal that is read back as the same number.
    let texts: Vec<String> = numbers.map(|x| format!("{x:?}")).collect();
    texts.join(" ")
}

fn numbers_of(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| {
        let read = word.parse::<f64>().ok().filter(|x| x.is_finite());
        read.ok_or_else(|| format!("'{word}' is not a number"))
    };
    text.split(' ').map(number).collect()
}

fn pose_text(pose: &Pose) -> String {
    let (at, turn) = (pose.at.to_array(), pose.turn.to_array());
    numbers_text(at.into_iter().chain(turn))
}

fn pose_of(text: &str) -> Result<Pose, String> {
    match numbers_of(text)?[..] {
        [x, y, z, a, b, c, d] => Ok(Pose {
            at: DVec3::new(x, y, z),
            turn: DQuat::from_xyzw(a, b, c, d),
        }),
        ref other => Err(format!("a pose has 7 numbers, not {}", other.len())),
    }
}

/// Replaces what would end a field or a line.
fn escaped(name: &str) -> String {
    let mut out = String::with_capacity(name.len());
    for c in name.chars() {
        match c {
            '\\' => out += "\\\\",
            '\t' => out += "\\t",
            '\n' => out += "\\n",
            '\r' => out += "\\r",
            c => out.push(c),
        }
    }
    out
}

fn unescaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut chars = text.chars();
    while let Some(c) = chars.next() {
        let next = if c == '\\' { chars.next() } else { None };
        out.push(match next {
            None => c,
            Some('t') => '\t',
            Some('n') => '\n',
            Some('r') => '\r',
            Some(other) => other,
        });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_back_as_they_were() {
        let odd = Pose {
            at: DVec3::new(0.1 + 0.2, -0.0, 1e-300),
            turn: DQuat::from_rotation_y(0.3),
        };
        let corner = |x: f64| DVec3::new(x / 3.0, 1.0, -2.5);
        let hosted = |kind| {
            EditOperation::Make(HandEdit {
                host: Some(InstanceId(7)),
                kind,
            })
        };
        let all = [
            EditOperation::put("a\tb\\n\n", Some("ünder\r\\"), odd),
            EditOperation::put("plain", None, odd),
            EditOperation::put("plain", Some(""), odd),
            EditOperation::Take(InstanceId(3)),
            EditOperation::Move(InstanceId(0), odd),
            EditOperation::Unmake(12),
            hosted(HandEditKind::Portal([0.1, 0.7, 4.0].map(corner).to_vec())),
            hosted(HandEditKind::Mirror([0.1, 0.7, 4.0].map(corner).to_vec())),
            hosted(HandEditKind::NoPortal(corner(1.0))),
            hosted(HandEditKind::Door(corner(1.0))),
            hosted(HandEditKind::Lamp(corner(1.0))),
            EditOperation::Make(HandEdit {
                host: None,
                kind: HandEditKind::Crate(corner(2.0), 0.1),
            }),
        ];
        for operation in all {
            let line = operation.line();
            assert!(!line.contains(['\n', '\r']), "{line}");
            assert_eq!(EditOperation::of_line(&line), Ok(operation), "{line}");
        }
    }

    #[test]
    fn lines_that_are_none_are_refused_with_what_is_wrong() {
        for (line, says) in [
            ("", "no operation"),
            ("take", "no operation"),
            ("take\tx", "'x' is not a number"),
            ("move\t1\t0 0 0", "7 numbers, not 3"),
            ("put\ta\t0 0 0 0 0 0 inf", "'inf' is not a number"),
            ("make\t-\tlamp\t1 2", "'lamp' with 2 numbers"),
            ("make\t-\tportal\t1 2 3 4 5 6", "'portal' with 6 numbers"),
            ("put\ta\t0 0 0 0 0 0 1\tb\tc", "no operation"),
        ] {
            let why = EditOperation::of_line(line).unwrap_err();
            assert!(why.contains(says), "{line}: {why}");
        }
    }
}
