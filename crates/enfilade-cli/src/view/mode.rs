//! What decides what is drawn in the window.

use enfilade_render::Culling;

/// What decides what is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Mode {
    /// Portals, clipped by the processor.
    #[default]
    Portals,
    /// Portals, each asked of the adapter by an occlusion query.
    Queries,
    /// The view frustum.
    Frustum,
    /// Nothing: all is drawn.
    Everything,
}

impl Mode {
    pub(super) fn next(self) -> Self {
        match self {
            Self::Portals => Self::Queries,
            Self::Queries => Self::Frustum,
            Self::Frustum => Self::Everything,
            Self::Everything => Self::Portals,
        }
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Portals => "portals",
            Self::Queries => "portals, asked of the adapter",
            Self::Frustum => "frustum culling",
            Self::Everything => "everything",
        }
    }

    /// What pictures of it are drawn by: the adapter's answer and the processor's show the same.
    pub(super) fn culling(self) -> Culling {
        match self {
            Self::Portals | Self::Queries => Culling::Portals,
            Self::Frustum => Culling::Frustum,
            Self::Everything => Culling::Everything,
        }
    }
}
