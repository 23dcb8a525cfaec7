//! Portal textures: a far portal is drawn as pictures of what lies behind it (Aliaga & Lastra 1997).
//!
//! Each frame, [`Studio::plan_portal_textures`] looks for the portals in view that are farther than the transition distance, and
//! composes each of a few textures: pictures with depths, taken from viewpoints before it, through its rectangle. It makes those
//! that are missing, a few a frame, and chooses the ones that give way; a portal without any stays geometry. The view then
//! [stops](enfilade_runtime::Stops) at these portals, and the draw fills their outlines.
//!
//! Warped textures (McMillan & Bishop, "Plenoptic modeling", SIGGRAPH 1995; here searched per pixel, in
//! `shaders/portal_textures.wgsl`) show each pixel's line of sight where it meets the first surface. Four textures around the
//! eye fill each other's holes, with weights that change evenly while the eye moves. The pixels have the depth of that surface,
//! so whatever stands or moves before and behind a portal is hidden rightly.
//!
//! A transition to geometry takes a few frames. In each, one more texture is drawn from a viewpoint on the way from the
//! texture's to the eye: what the source does with a matrix for the vertices (section 3.3), it projects the geometry to the plane of
//! the portal from that point. But the depth is that of the surface after the homogeneous divide, too.
//!
//! Textures can be made ahead, for all places where a walker may stand (`file.rs`, `ahead.rs`): they wait in host memory,
//! compressed, and are taken from there instead of drawn.

mod ahead;
mod arrays;
mod conditions;
mod doorway;
mod draw;
mod file;
mod store;
mod texels;
mod viewpoints;

use crate::camera::Projection;
use crate::gpu::Gpu;
use crate::list::RenderList;
use crate::pipelines::Layouts;

pub(crate) use ahead::{ANCHOR_REACH, AheadTextures, millimeters};
pub(crate) use arrays::{DoorwayDraw, TextureArrays};
pub(crate) use conditions::{TextureConditions, textured_light, textured_world};
pub(crate) use doorway::{Doorway, DoorwayPlace};
pub(crate) use draw::Component;
pub(crate) use file::{PtxEntry, PtxHead, PtxWriter, decode_ptx};
pub(crate) use store::{HeldTexture, PortalTextures};
pub(crate) use texels::pack;
pub(crate) use viewpoints::{DoorwayId, TextureKey};

use arrays::DoorwayVariant;
use draw::{DoorwayFrame, add_corners};

impl PortalTextures {
    /// Moves the doorways that textures fill out of the list of those of one color.
    pub(crate) fn sort_out(&self, list: &mut RenderList) {
        let (shown, doorways) = (&self.shown, &mut list.doorways);
        list.stand_ins.retain(|id| {
            let is_textured = shown.contains_key(id);
            doorways.extend(is_textured.then_some(*id));
            !is_textured
        });
        list.cut_to((self.options.max_triangles).saturating_sub(self.n_made_triangles));
    }

    /// Writes the vertices of the doorways of a list; returns their number. `projection` is in the frame of the first world.
    pub(crate) fn write(
        &mut self,
        gpu: &Gpu,
        layouts: &Layouts,
        list: &RenderList,
        projection: &Projection,
        exposure: f32,
        marks: bool,
    ) -> DoorwayDraw<'_> {
        let variant = DoorwayVariant {
            warps: self.options.viewpoints.are_warped(),
            marks,
        };
        let frame = DoorwayFrame {
            eye: projection.exact_origin(),
            exposure,
            side: self.options.side,
            paint: self.options.paint,
        };
        let mut corners = Vec::new();
        for id in &list.doorways {
            let doorway = self.doorways.get(id).and_then(|d| d.doorway.as_ref());
            if let (Some(doorway), Some(components)) = (doorway, self.shown.get(id)) {
                add_corners(&mut corners, doorway, components, &frame);
            }
        }
        if !corners.is_empty() {
            self.arrays.prepare(gpu, layouts, variant);
            self.arrays
                .corners
                .write(gpu, bytemuck::cast_slice(&corners));
        }
        DoorwayDraw {
            arrays: &self.arrays,
            variant,
            n_corners: corners.len() as u32,
        }
    }
}
