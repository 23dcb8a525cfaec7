//! Kits: pieces by name, and whether they fit each other.

use std::collections::BTreeMap;
use std::fmt;

use enfilade_geom::shown;

use crate::piece::Piece;

/// Most that outlines of two attachments may differ to fit, and that poses may be off to meet, unless set. [Units: wu]
pub const DEFAULT_TOLERANCE: f64 = 1e-3;

/// Pieces with names of their own.
#[derive(Clone, Debug, Default)]
pub struct Kit {
    pieces: Vec<Piece>,
    by_name: BTreeMap<String, usize>,
}

/// Two pieces have one name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("two pieces are named {:?}; rename one of them", shown(.0).to_string())]
pub struct PieceNamedTwice(pub String);

/// A fault of a kit, which does not keep it from being used.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum KitFault {
    /// A piece with rooms has no attachment. Walls and other pieces without rooms need none.
    Detached {
        /// Name of the piece.
        piece: String,
    },
    /// An attachment fits no other one of the kit.
    FitsNone {
        /// Name of the piece.
        piece: String,
        /// Name of the attachment.
        attachment: String,
        /// Its width and height. [Units: wu]
        size: [f64; 2],
        /// The attachment that comes nearest, as `PIECE.ATTACHMENT`, and by how much it misses. [Units: wu]
        nearest: Option<(String, f64)>,
    },
}

impl fmt::Display for KitFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Detached { piece } => write!(
                f,
                "{}: it has no attachment: no doorway of it leads outdoors",
                shown(piece)
            ),
            Self::FitsNone {
                piece,
                attachment,
                size: [w, h],
                nearest,
            } => {
                write!(
                    f,
                    "{}.{}: its opening of {w:.3} × {h:.3} m fits no other",
                    shown(piece),
                    shown(attachment)
                )?;
                match nearest {
                    Some((name, by)) => write!(
                        f,
                        "; {} comes nearest, and misses it by {by:.3} m",
                        shown(name)
                    ),
                    None => Ok(()),
                }
            }
        }
    }
}

impl Kit {
    /// Makes a kit.
    ///
    /// # Errors
    ///
    /// If two pieces share a name.
    pub fn new(pieces: Vec<Piece>) -> Result<Self, PieceNamedTwice> {
        let mut by_name = BTreeMap::new();
        for (i, piece) in pieces.iter().enumerate() {
            if by_name.insert(piece.name().to_owned(), i).is_some() {
                return Err(PieceNamedTwice(piece.name().to_owned()));
            }
        }
        Ok(Self { pieces, by_name })
    }

    /// Returns the pieces.
    #[must_use]
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Returns the number of the piece of a name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    /// Returns the attachments in groups that fit each other within a tolerance, as pairs of piece and attachment, the largest group
    /// first. O(attachments × groups).
    #[must_use]
    #[doc(hidden)]
    pub fn groups(&self, tolerance: f64) -> Vec<Vec<[usize; 2]>> {
        let mut groups: Vec<Vec<[usize; 2]>> = Vec::new();
        for (i, piece) in self.pieces.iter().enumerate() {
            for (k, attachment) in piece.attachments().iter().enumerate() {
                let fits = |group: &&mut Vec<[usize; 2]>| {
                    let [j, l] = group[0];
                    let its = &self.pieces[j].attachments()[l].mouth;
                    attachment.mouth.misfit(its, 0.0) <= tolerance
                };
                match groups.iter_mut().find(fits) {
                    Some(group) => group.push([i, k]),
                    None => groups.push(vec![[i, k]]),
                }
            }
        }
        groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
        groups
    }

    /// Returns pieces that cannot be attached, and attachments that fit nothing. O(attachments²).
    #[must_use]
    pub fn faults(&self, tolerance: f64) -> Vec<KitFault> {
        let mut faults = Vec::new();
        let all = self.pieces.iter().flat_map(|p| {
            let own = p.attachments().iter();
            own.map(move |a| (p, a))
        });
        for piece in &self.pieces {
            if piece.attachments().is_empty() && piece.world().graph.rooms().next().is_some() {
                let piece = piece.name().to_owned();
                faults.push(KitFault::Detached { piece });
            }
            for own in piece.attachments() {
                let others = all.clone().filter(|other| !std::ptr::eq(other.1, own));
                let misses = others.map(|(p, a)| (own.mouth.misfit(&a.mouth, 0.0), p, a));
                let nearest = misses.min_by(|a, b| a.0.total_cmp(&b.0));
                if nearest.is_some_and(|n| n.0 <= tolerance) {
                    continue;
                }
                faults.push(KitFault::FitsNone {
                    piece: piece.name().to_owned(),
                    attachment: own.name.clone(),
                    size: own.mouth.size(),
                    nearest: nearest.map(|(by, p, a)| (format!("{}.{}", p.name(), a.name), by)),
                });
            }
        }
        faults
    }
}
