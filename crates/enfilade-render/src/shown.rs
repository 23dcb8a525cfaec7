//! Contents of a frame: its worlds, and all else.

use enfilade_world::{PartId, Pose};

use crate::camera::Projection;
use crate::copies::PropCopy;
use crate::frame::Style;
use crate::lamps::ActiveLamp;
use crate::list::RenderList;
use crate::marks::PictureMark;
use crate::portal_textures::DoorwayDraw;
use crate::scene::GpuWorld;
use crate::stage::{RenderStage, StageView};

/// One world of a frame.
pub(crate) struct DrawnPart<'a> {
    pub(crate) id: PartId,
    pub(crate) world: &'a GpuWorld,
    pub(crate) stage: &'a mut RenderStage,
    pub(crate) list: &'a RenderList,
}

impl DrawnPart<'_> {
    pub(crate) fn as_view(&self) -> PartView<'_> {
        PartView {
            world: self.world,
            view: self.stage.first(),
            list: self.list,
        }
    }
}

/// One world of a frame, ready to draw.
#[derive(Clone, Copy)]
pub(crate) struct PartView<'a> {
    pub(crate) world: &'a GpuWorld,
    pub(crate) view: &'a StageView,
    pub(crate) list: &'a RenderList,
}

/// A frame apart from its worlds.
#[derive(Clone, Copy)]
pub(crate) struct Shown<'a> {
    /// The projection in the frame of the camera.
    pub(crate) projection: Projection,
    /// Motion from that frame to that of the first world.
    pub(crate) pose: Pose,
    pub(crate) style: Style,
    pub(crate) marks: &'a [PictureMark],
    pub(crate) props: &'a [PropCopy],
    pub(crate) lamps: &'a [ActiveLamp],
    pub(crate) exposure: f32,
    /// Share of the daylight that is left, 0 to 1.
    pub(crate) day: f32,
    /// Portals of the first world that textures fill.
    pub(crate) textures: Option<DoorwayDraw<'a>>,
}

impl Shown<'_> {
    /// Returns the projection in the frame of a world.
    pub(crate) fn projection_in(&self, stage: &RenderStage) -> Projection {
        if stage.pose == self.pose {
            return self.projection;
        }
        let motion = self.pose.inverse().after(&stage.pose);
        self.projection.in_frame(&motion)
    }
}
