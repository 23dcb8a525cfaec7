//! Reasons why a piece cannot be placed.

use enfilade_geom::shown;

/// Reason why an instance cannot be placed, taken away or joined. Places are in the frame of the level.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlaceError {
    /// The kit has no such piece.
    #[error("the kit has no piece {:?}", shown(.0).to_string())]
    NoPiece(String),
    /// A piece or instance has no such attachment.
    #[error("{} has no attachment {:?}; it has {}", shown(.of), shown(.name).to_string(), listed(.known))]
    NoAttachment {
        /// The piece or instance.
        of: String,
        /// The requested name or number.
        name: String,
        /// Those that it has.
        known: Vec<String>,
    },
    /// No such instance stands.
    #[error("there is no instance {:?}", shown(.0).to_string())]
    NoInstance(String),
    /// The name is taken.
    #[error("another instance is named {:?}; give each a name of its own", shown(.0).to_string())]
    NamedTwice(String),
    /// The pose is not finite or not a rotation and translation.
    #[error(
        "the pose is not a rigid motion: its numbers must be finite and its rotation of unit length"
    )]
    NotRigid,
    /// The instance would not stand upright.
    #[error("{} would be tilted by {degrees:.1}°; turn it by another angle, or allow it to tilt", shown(.piece))]
    Tilted {
        /// The piece.
        piece: String,
        /// Angle between its vertical and that of the level.
        degrees: f64,
    },
    /// The attachment placed onto leads somewhere already.
    #[error("{} is in use: it leads to {}", shown(.end), shown(.by))]
    Used {
        /// The attachment.
        end: String,
        /// The attachment or instance that it leads to.
        by: String,
    },
    /// The openings differ.
    #[error(
        "{} ({:.3} × {:.3} m) does not fit {} ({:.3} × {:.3} m): their outlines differ by {by:.4} m",
        shown(.end), .size[0], .size[1], shown(.onto), .onto_size[0], .onto_size[1]
    )]
    DoesNotFit {
        /// The attachment of the piece.
        end: String,
        /// Its width and height. [Units: wu]
        size: [f64; 2],
        /// The attachment placed onto.
        onto: String,
        /// Its width and height. [Units: wu]
        onto_size: [f64; 2],
        /// Largest distance between the outlines. [Units: wu]
        by: f64,
    },
    /// The instance would overlap another.
    #[error(
        "it would overlap {} by at least {by:.3} m around {:.2},{:.2},{:.2}; place it elsewhere, or allow overlaps",
        shown(.with), .at[0], .at[1], .at[2]
    )]
    Overlaps {
        /// The other instance.
        with: String,
        /// Depth of the convex part of one that is deepest in a part of the other. [Units: wu]
        by: f64,
        /// Middle of that part. [Units: wu]
        at: [f64; 3],
    },
    /// An opening would be walled up in part, or meet another that does not fit.
    #[error(
        "{:.0} % of the opening {} at {:.2},{:.2},{:.2} would be in front of {}; openings must meet one that fits, or be free or \
         walled up as a whole",
        .share * 100.0, shown(.end), .at[0], .at[1], .at[2], shown(.behind)
    )]
    PartlyBlocked {
        /// The attachment.
        end: String,
        /// Share of its outline that is not free. [Limit: 0 to 1]
        share: f64,
        /// The instance in front of it.
        behind: String,
        /// Middle of its sill. [Units: wu]
        at: [f64; 3],
    },
    /// Two attachments that should be joined do not meet.
    #[error(
        "the loop does not close: {} and {} are {gap:.3} m apart, at an angle of {degrees:.1}°, and their outlines differ by {by:.4} m",
        shown(&.ends[0]), shown(&.ends[1])
    )]
    StaysOpen {
        /// The attachments.
        ends: [String; 2],
        /// Distance of their sills. [Units: wu]
        gap: f64,
        /// Angle by which they do not face each other.
        degrees: f64,
        /// Largest distance between the outlines, as they would face each other. [Units: wu]
        by: f64,
    },
}

fn listed(names: &[String]) -> String {
    let names: Vec<String> = names.iter().map(|n| shown(n).to_string()).collect();
    if names.is_empty() {
        "none".into()
    } else {
        names.join(", ")
    }
}
