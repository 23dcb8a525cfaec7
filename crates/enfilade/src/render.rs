//! Pictures of a world with wgpu.

pub use enfilade_render::{
    AdapterChoice, Camera, Culling, Frame, Gpu, LampCone, LampLight, LampOptions,
    MadePortalTextures, MarkShape, Paint, Picture, PictureMark, PieceOf, PortalTextureCounts,
    PortalTextureError, PortalTextureFileError, PortalTextureMaking, PortalTextureOptions,
    PortalTexturePaint, PortalTextureProgress, Projection, Prop, PropMesh, RenderError, RenderList,
    SpaceCounts, SpaceShot, Studio, StudioTarget, Style, Viewpoints, good_camera,
};
