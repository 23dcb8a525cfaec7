//! Walks as the command was asked for them: messages on those that are not possible, or not between the points that were asked for.

use anyhow::anyhow;
use enfilade::cpg::PortalId;
use enfilade::geom::DVec3;
use enfilade::internals::world::{AskedWalk, WalkWords};
use enfilade::world::{PartId, Path, Space, WalkMap};
use serde::Serialize;

use crate::screen::At;
use crate::walk::Walks;

/// A walk as it was asked for.
pub(crate) struct Wanted<'a> {
    pub(crate) space: &'a Space,
    pub(crate) map: &'a WalkMap,
    pub(crate) walks: Walks,
    /// Start and end. [Units: wu]
    pub(crate) ends: [DVec3; 2],
    /// Options that give start and end.
    pub(crate) options: [&'a str; 2],
    pub(crate) closed: &'a [u32],
}

/// An end of a path that is elsewhere than it was asked for.
#[derive(Serialize)]
pub(crate) struct MovedEnd {
    /// The option that gave it.
    option: String,
    asked: [f64; 3],
    reached: [f64; 3],
    /// Cell in which it was asked for; `null` in solid matter.
    asked_cell: Option<u32>,
    reached_cell: Option<u32>,
    /// Between both, in plan. [Units: wu]
    distance: f64,
}

/// An end that is moved less, in plan, is where it was asked. [Units: wu]
const BESIDE: f64 = 0.1;

impl Wanted<'_> {
    /// Finds the path; the error says what is in the way.
    pub(crate) fn find(&self, path: &mut Path) -> anyhow::Result<()> {
        let closed: Vec<PortalId> = self.closed.iter().map(|&p| PortalId(p)).collect();
        self.asked(&closed)
            .find(path)
            .map_err(|why| anyhow!("{why}"))
    }

    fn asked<'a>(&'a self, closed: &'a [PortalId]) -> AskedWalk<'a> {
        AskedWalk {
            space: self.space,
            map: self.map,
            walker: self.walks.agent,
            has_objects: self.walks.objects,
            ends: self.ends,
            closed,
            has_others: true,
            words: WalkWords {
                ends: self.options,
                step: "--step",
                height: "--height",
                radius: "--radius",
                no_objects: "--no-objects",
            },
        }
    }

    /// Returns words for the surroundings of a point.
    fn around(&self, p: DVec3) -> String {
        self.asked(&[]).around(p)
    }

    /// Returns the ends of a path that are elsewhere than they were asked for.
    pub(crate) fn moved(&self, path: &Path) -> Vec<MovedEnd> {
        let (Some(first), Some(last)) = (path.points.first(), path.points.last()) else {
            return Vec::new();
        };
        let layout = self.space.layout(PartId::ROOT);
        let half = DVec3::Y * 0.5 * self.walks.agent.height;
        let ends = self.ends.into_iter().zip([first.at, last.at]);
        let all = ends
            .zip(self.options)
            .filter_map(|((asked, reached), option)| {
                let distance = (reached - asked).with_y(0.0).length();
                let [before, after] =
                    [above(asked, reached), reached + half].map(|p| layout.locate(p));
                let is_other = before.is_some() && before != after;
                (distance > BESIDE || is_other).then(|| MovedEnd {
                    option: option.to_owned(),
                    asked: asked.to_array(),
                    reached: reached.to_array(),
                    asked_cell: before.map(|c| c.0),
                    reached_cell: after.map(|c| c.0),
                    distance,
                })
            });
        all.collect()
    }

    /// Returns a moved end in words.
    pub(crate) fn told(&self, moved: &MovedEnd) -> String {
        let [asked, reached] = [moved.asked, moved.reached];
        let half = DVec3::Y * 0.5 * self.walks.agent.height;
        format!(
            "{}: a walker cannot stand at {}, {}; the path leads {} {} {}, {:.2} m beside and {:.2} m below",
            moved.option,
            At(asked),
            self.around(above(asked.into(), reached.into())),
            if moved.option == self.options[0] {
                "from"
            } else {
                "to"
            },
            At(reached),
            self.around(DVec3::from(reached) + half),
            moved.distance,
            asked[1] - reached[1]
        )
    }
}

/// The point of an end that tells its cell: one at the feet may be in the floor.
fn above(asked: DVec3, reached: DVec3) -> DVec3 {
    asked.with_y(asked.y.max(reached.y + BESIDE))
}
