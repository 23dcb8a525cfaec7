//! Things that fill openings (leaves, panes and their frames), judged by facts: of shape, and of the hole that one is in.
//!
//! Pure functions over one table of numbers, for all who ask: roles of objects without names, what shuts an opening, what
//! divides one, and what moves in it. [`Rectangle`] measures the facts of a shape.

use crate::{DVec3, Mask, Rectangle, is_rather_level};

/// Greatest depth of a filler with its frame and handles, and its greatest distance from the plane of an opening in a wall.
/// Higher, and cupboards shut openings; a door with its frame and handles has about 0.3. [Units: wu]
pub const DEEPEST: f64 = 0.4;
/// Greatest depth of an upright thing as high as a door that may be a leaf, ÷ its lesser side: gates of levels are 0.5 to 1 m thick and up to
/// 4 m wide. Higher, and wardrobes between walls shut rooms.
pub const STOUTEST: f64 = 0.3;
/// Least edge of a leaf or pane. Higher, and one of two narrow leaves is lost; lower, and boards fill openings. [Units: wu]
pub const NARROWEST: f64 = 0.35;
/// Least height of a door. Higher, and hatches and the doors of cellars are windows; lower, and windows are doors.
/// [Units: wu]
pub const LOWEST_DOOR: f64 = 1.5;
/// Greatest thickness of a leaf without its frame: leaves are 4 to 6 cm. Higher, and the thinnest partitions, set between
/// columns and under beams, are leaves. [Units: wu]
pub const LEAF: f64 = 0.07;
/// Least share of its rectangle that a leaf or a pane covers. Higher, and leaves with windows are frames; lower, and frames
/// and railings are leaves.
pub const FILLED: f64 = 0.6;
/// Least share of a rim, or of one of its sides, along which something holds it: the rest is a threshold, a shutter's box, a
/// rounded end. Higher, and leaves over such a threshold stand open; lower, and open leaves shut a corridor.
pub const HELD: f64 = 0.7;
/// Least number of sides on which a wall holds what is in its hole: a lintel and two jambs, or three sides of a window beside
/// a pillar. Fewer, and a piece of wall between two others is in a hole.
const SIDES: usize = 3;
/// Greatest share of the thickness of the wall around a leaf, holes counted. Higher, and panels of a wall are leaves.
const THIN: f64 = 0.5;
/// Greatest distance by which what fills a hole stands out of its wall, with a sill or a shutter. Higher, and what goes
/// through a wall fills a hole in it. [Units: wu]
const OUT: f64 = 0.05;

/// The shape of a thing that may fill an opening.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillerFacts {
    /// Width, height and depth of the box around it. [Units: wu]
    pub size: DVec3,
    /// It stands rather than lies.
    pub is_upright: bool,
    /// Share of its rectangle that it covers, seen from the front.
    pub covered: f64,
}

/// Returns the greatest depth of a leaf as wide and high as this, with its frame and handles. [Units: wu]
#[must_use]
pub fn deepest_leaf(size: DVec3) -> f64 {
    DEEPEST.max(STOUTEST * size.x.min(size.y))
}

/// Kind of a thing by its shape alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filler {
    /// Upright, as high as a door.
    Leaf,
    /// Flat, but lower than a door or lying.
    Pane,
    /// Flat, but mostly open: a frame, the rails of a leaf, a railing.
    Ring,
    /// Not flat.
    Deep,
    /// Too narrow to fill an opening.
    Narrow,
}

impl FillerFacts {
    /// Returns the facts of what is in a rectangle, and covers these samples of it.
    #[must_use]
    pub fn of(around: &Rectangle, mask: &Mask) -> Self {
        Self {
            size: around.size(),
            is_upright: !is_rather_level(around.normal),
            covered: mask.share(),
        }
    }

    /// Returns what it is.
    #[must_use]
    pub fn kind(&self) -> Filler {
        let [width, height, depth] = self.size.to_array();
        let is_high = self.is_upright && height >= LOWEST_DOOR;
        let deepest = if is_high {
            deepest_leaf(self.size)
        } else {
            DEEPEST
        };
        if depth > deepest {
            Filler::Deep
        } else if width.min(height) < NARROWEST {
            Filler::Narrow
        } else if self.covered < FILLED {
            Filler::Ring
        } else if is_high {
            Filler::Leaf
        } else {
            Filler::Pane
        }
    }
}

/// A thing that may fill a hole in a wall, and what holds it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HoleFacts {
    /// It stands rather than lies.
    pub is_upright: bool,
    /// Its matter from front to back, averaged over its face. [Units: wu]
    pub thickness: f64,
    /// The same over the thinnest quarter of its face, holes not counted: a leaf or a pane without its frame. 0 for a mere
    /// frame. [Units: wu]
    pub leaf: f64,
    /// Sides that a wall holds: left, right, below, above.
    pub sides: [bool; 4],
    /// Anything at all is there, on the left and on the right.
    pub ends: [bool; 2],
    /// Sides that one connected surface holds: walls are built beside each other, and only openings are cut out of one.
    pub n_by_one: usize,
    /// Thickness of the thinnest of the walls that hold it; 0 for a sheet. [Units: wu]
    pub wall: f64,
}

/// Why a thing fills a hole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FillsHole {
    /// It is much thinner than the wall around it.
    Thin,
    /// One wall goes round it.
    Surrounded,
}

impl HoleFacts {
    /// Returns the facts of this thing as one of a group that is held like that.
    #[must_use]
    pub fn held_as(&self, group: &Self) -> Self {
        Self {
            is_upright: self.is_upright,
            thickness: self.thickness,
            leaf: self.leaf,
            ..*group
        }
    }

    /// Returns the number of sides that a wall holds.
    #[must_use]
    pub fn n_sides(&self) -> usize {
        self.sides.iter().filter(|&&is_held| is_held).count()
    }

    /// Returns why it fills a hole; `None` if it does not.
    #[must_use]
    pub fn kind(&self) -> Option<FillsHole> {
        let [left, right, _, above] = self.sides;
        let is_leaf = self.leaf <= LEAF;
        // A leaf where two walls meet: a lintel and one jamb hold it, and another wall replaces the other jamb.
        let is_beside_wall = above && (left && self.ends[1] || right && self.ends[0]);
        // One as high as the room has no lintel.
        let is_hung = is_leaf && self.is_upright && (left && right || is_beside_wall);
        if self.n_sides() < SIDES && !is_hung {
            None
        } else if is_leaf && self.thickness < THIN * self.wall {
            Some(FillsHole::Thin)
        } else if self.n_by_one >= SIDES && self.thickness <= self.wall + OUT {
            Some(FillsHole::Surrounded)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_on_either_side_of_each_number() {
        let leaf = FillerFacts {
            size: DVec3::new(0.9, 2.0, 0.05),
            is_upright: true,
            covered: 0.9,
        };
        let sized = |x: f64, y: f64, z: f64| FillerFacts {
            size: DVec3::new(x, y, z),
            ..leaf
        };
        let covered = |covered: f64| FillerFacts { covered, ..leaf };
        let is_upright = false;
        let cases = [
            (leaf, Filler::Leaf),
            (FillerFacts { is_upright, ..leaf }, Filler::Pane),
            (sized(0.9, 2.0, 0.39), Filler::Leaf),
            (sized(0.9, 2.0, 0.41), Filler::Deep),
            (sized(4.0, 2.0, 0.59), Filler::Leaf),
            (sized(4.0, 2.0, 0.61), Filler::Deep),
            (sized(1.6, 4.0, 0.49), Filler::Deep),
            (sized(4.0, 1.45, 0.42), Filler::Deep),
            (sized(0.36, 2.0, 0.05), Filler::Leaf),
            (sized(0.34, 2.0, 0.05), Filler::Narrow),
            (sized(0.9, 0.34, 0.05), Filler::Narrow),
            (sized(0.9, 1.51, 0.05), Filler::Leaf),
            (sized(0.9, 1.49, 0.05), Filler::Pane),
            (covered(0.61), Filler::Leaf),
            (covered(0.59), Filler::Ring),
        ];
        for (facts, verdict) in cases {
            assert_eq!(facts.kind(), verdict, "{facts:?}");
        }
    }

    #[test]
    fn a_hole_on_either_side_of_each_number() {
        use FillsHole::{Surrounded, Thin};
        // A leaf with its frame in a doorway of a wall made of several pieces.
        let door = HoleFacts {
            is_upright: true,
            thickness: 0.06,
            leaf: 0.05,
            sides: [true, true, false, true],
            ends: [true; 2],
            n_by_one: 1,
            wall: 0.24,
        };
        let sides = |sides: [bool; 4]| HoleFacts { sides, ..door };
        let two = sides([true, true, false, false]);
        let one = sides([true, false, false, true]);
        let thick = HoleFacts { leaf: 0.2, ..door };
        let set_in = HoleFacts {
            n_by_one: 3,
            ..thick
        };
        let cases = [
            (door, Some(Thin)),
            (
                HoleFacts {
                    leaf: 0.069,
                    ..door
                },
                Some(Thin),
            ),
            (
                HoleFacts {
                    leaf: 0.071,
                    ..door
                },
                None,
            ),
            (
                HoleFacts {
                    thickness: 0.119,
                    ..door
                },
                Some(Thin),
            ),
            (
                HoleFacts {
                    thickness: 0.121,
                    ..door
                },
                None,
            ),
            // A sheet among sheets.
            (
                HoleFacts {
                    thickness: 0.0,
                    leaf: 0.0,
                    wall: 0.0,
                    n_by_one: 2,
                    ..door
                },
                None,
            ),
            // As high as the room, but not if it lies, or is a piece of wall.
            (two, Some(Thin)),
            (
                HoleFacts {
                    is_upright: false,
                    ..two
                },
                None,
            ),
            (
                HoleFacts {
                    leaf: 0.071,
                    n_by_one: 3,
                    ..two
                },
                None,
            ),
            (one, Some(Thin)),
            (
                HoleFacts {
                    ends: [true, false],
                    ..one
                },
                None,
            ),
            (sides([true, false, true, false]), None),
            (thick, None),
            (set_in, Some(Surrounded)),
            (
                HoleFacts {
                    n_by_one: 2,
                    ..set_in
                },
                None,
            ),
            (
                HoleFacts {
                    thickness: 0.289,
                    ..set_in
                },
                Some(Surrounded),
            ),
            (
                HoleFacts {
                    thickness: 0.291,
                    ..set_in
                },
                None,
            ),
        ];
        for (facts, verdict) in cases {
            assert_eq!(facts.kind(), verdict, "{facts:?}");
        }
    }
}
