//! Fittings in the form of the file.

use super::json::{FittingJson, PartJson, SlideJson, TurnJson};
use super::{WireError, broken};
use crate::{Fitting, FittingPart, Motion, MotionKind};

pub(super) fn written(fitting: &Fitting) -> FittingJson {
    let (mut turn, mut slide) = (None, None);
    if let Some(Motion { kind, shut, open }) = fitting.motion {
        let (shut, open) = (shut.into(), open.into());
        match kind {
            MotionKind::Turn { through, axis } => {
                turn = Some(TurnJson {
                    through: through.map(f64::from),
                    axis: axis.map(f64::from),
                    shut,
                    open,
                });
            }
            MotionKind::Slide { along } => {
                slide = Some(SlideJson {
                    along: along.map(f64::from),
                    shut,
                    open,
                });
            }
        }
    }
    FittingJson {
        detail: fitting.detail,
        part: match fitting.part {
            FittingPart::Leaf => PartJson::Leaf,
            FittingPart::Frame => PartJson::Frame,
            FittingPart::Pane => PartJson::Pane,
        },
        turn,
        slide,
    }
}

pub(super) fn read(portal: usize, fitting: &FittingJson) -> Result<Fitting, WireError> {
    let single = |v: [f64; 3]| v.map(|x| x as f32);
    let motion = match (&fitting.turn, &fitting.slide) {
        (Some(_), Some(_)) => {
            let what = format!("portal {portal}");
            return Err(broken(what, "a leaf cannot both turn and slide"));
        }
        (Some(t), None) => Some(Motion {
            kind: MotionKind::Turn {
                through: single(t.through),
                axis: single(t.axis),
            },
            shut: t.shut as f32,
            open: t.open as f32,
        }),
        (None, Some(s)) => Some(Motion {
            kind: MotionKind::Slide {
                along: single(s.along),
            },
            shut: s.shut as f32,
            open: s.open as f32,
        }),
        (None, None) => None,
    };
    Ok(Fitting {
        detail: fitting.detail,
        part: match fitting.part {
            PartJson::Leaf => FittingPart::Leaf,
            PartJson::Frame => FittingPart::Frame,
            PartJson::Pane => FittingPart::Pane,
        },
        motion,
    })
}
