//! Tools of the palette.

use enfilade::kit::Kit;

/// A tool: a piece to place, or a change by hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tool {
    /// A piece of the kit, by its number.
    Piece(usize),
    Portal,
    Door,
    Mirror,
    Lamp,
    Crate,
}

impl Tool {
    /// The changes by hand, F6 to F10.
    pub(super) const BY_HAND: [Self; 5] = [
        Self::Portal,
        Self::Door,
        Self::Mirror,
        Self::Lamp,
        Self::Crate,
    ];

    /// Returns the tools of a palette: pieces first.
    pub(super) fn all(kit: &Kit, takes_pieces: bool) -> Vec<Self> {
        let n = if takes_pieces { kit.pieces().len() } else { 0 };
        (0..n).map(Self::Piece).chain(Self::BY_HAND).collect()
    }

    pub(super) fn name(self, kit: &Kit) -> String {
        match self {
            Self::Piece(number) => kit.pieces()[number].name().to_owned(),
            tool => tool.word().unwrap_or_default().to_owned(),
        }
    }

    /// Returns the word for the changes by hand that it makes.
    pub(super) fn word(self) -> Option<&'static str> {
        match self {
            Self::Piece(_) => None,
            Self::Portal => Some("portal"),
            Self::Door => Some("door"),
            Self::Mirror => Some("mirror"),
            Self::Lamp => Some("lamp"),
            Self::Crate => Some("crate"),
        }
    }

    /// Returns how it is used.
    pub(super) fn hint(self) -> &'static str {
        match self {
            Self::Piece(_) => "click: place it; , .: turn it",
            Self::Portal => {
                "click two corners of an upright rectangle, which reaches out to the walls; X: delete the portal there"
            }
            Self::Door => "click a doorway: a door, or none",
            Self::Mirror => "click two opposite corners on a wall; X: delete the mirror there",
            Self::Lamp => "click: a lamp before the wall there; X: delete it",
            Self::Crate => "click the floor; , .: turn it; X: delete it",
        }
    }

    /// Returns `true` if it is drawn vertex by vertex.
    pub(super) fn is_drawn(self) -> bool {
        matches!(self, Self::Portal | Self::Mirror)
    }
}
