//! Modes of culling in the window.

use enfilade_render::Culling;

/// The method that decides what is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Mode {
    /// Portals, clipped by the processor.
    #[default]
    Portals,
    /// Portals; far ones are textures of what lies behind them.
    PortalTextures,
    /// Portals, each tested on the adapter by an occlusion query.
    Queries,
    /// The view frustum.
    Frustum,
    /// No culling: everything is drawn.
    Everything,
}

impl Mode {
    pub(super) fn next(self) -> Self {
        match self {
            Self::Portals => Self::PortalTextures,
            Self::PortalTextures => Self::Queries,
            Self::Queries => Self::Frustum,
            Self::Frustum => Self::Everything,
            Self::Everything => Self::Portals,
        }
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Portals => "portals",
            Self::PortalTextures => "portal textures",
            Self::Queries => "portals, occlusion queries",
            Self::Frustum => "frustum culling",
            Self::Everything => "everything",
        }
    }

    /// The culling for pictures of this mode: occlusion queries and the processor show the same.
    pub(super) fn culling(self) -> Culling {
        match self {
            Self::Portals | Self::Queries => Culling::Portals,
            Self::PortalTextures => Culling::PortalTextures,
            Self::Frustum => Culling::Frustum,
            Self::Everything => Culling::Everything,
        }
    }
}
