//! Objects in openings, as `inspect` shows them.

use enfilade::cpg::{Fitting, FittingPart, MotionKind, PortalKind, World};
use serde::Serialize;

/// An object in an opening.
#[derive(Serialize)]
pub(super) struct FittingReport {
    detail: u32,
    part: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    turns: Option<Turn>,
    #[serde(skip_serializing_if = "Option::is_none")]
    slides: Option<Slide>,
}

#[derive(Serialize)]
struct Turn {
    through: [f32; 3],
    axis: [f32; 3],
    shut_degrees: f32,
    open_degrees: f32,
}

#[derive(Serialize)]
struct Slide {
    along: [f32; 3],
    shut: f32,
    open: f32,
}

impl FittingReport {
    pub(super) fn of(fitting: &Fitting) -> Self {
        let (mut turns, mut slides) = (None, None);
        if let Some(m) = fitting.motion {
            match m.kind {
                MotionKind::Turn { through, axis } => {
                    turns = Some(Turn {
                        through,
                        axis,
                        shut_degrees: m.shut.to_degrees(),
                        open_degrees: m.open.to_degrees(),
                    });
                }
                MotionKind::Slide { along } => {
                    let (shut, open) = (m.shut, m.open);
                    slides = Some(Slide { along, shut, open });
                }
            }
        }
        Self {
            detail: fitting.detail,
            part: match fitting.part {
                FittingPart::Leaf => "leaf",
                FittingPart::Frame => "frame",
                FittingPart::Pane => "pane",
            },
            turns,
            slides,
        }
    }
}

/// The number of doors with leaves, and the motion of these; `None` if there are no doors.
pub(super) fn summary(world: &World) -> Option<String> {
    let is_door = |kind| kind == PortalKind::Door;
    let doors = world.graph.portals.iter().filter(|p| is_door(p.kind));
    let (mut n_doors, mut n_with) = (0_usize, 0_usize);
    let mut moving = [Vec::new(), Vec::new()];
    for door in doors {
        n_doors += 1;
        let leaves = door.fittings.iter().filter(|f| f.part == FittingPart::Leaf);
        let leaves: Vec<_> = leaves.filter_map(|f| Some((f.detail, f.motion?))).collect();
        n_with += usize::from(!leaves.is_empty());
        for (detail, motion) in leaves {
            let slides = matches!(motion.kind, MotionKind::Slide { .. });
            moving[usize::from(slides)].push(detail);
        }
    }
    let [turn, slide] = moving.map(|mut details| {
        // A leaf may shut several openings.
        details.sort_unstable();
        details.dedup();
        details.len()
    });
    (n_doors > 0).then(|| {
        format!(
            "{n_doors}, {n_with} of them with leaves: {turn} objects that turn, {slide} that slide"
        )
    })
}
