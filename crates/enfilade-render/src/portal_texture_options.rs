//! Settings of portal textures.

/// The places from which portal textures are taken (Aliaga & Lastra 1997, sections 2.2 and 3.2). One portal has those of each
/// side.
#[derive(Clone, Debug, PartialEq)]
pub enum Viewpoints {
    /// The vertices of a lattice around the eye: directions to the middle of the portal, and distances from its plane in
    /// powers. A view is composed of the four nearest textures, each warped by its depths, with weights that change evenly; so
    /// nothing pops when the eye moves on.
    Warped {
        /// Distance between neighbors, as a share of that from the portal. [Limit: 0.01 to 2]
        spacing: f64,
    },
    /// A semicircle at viewing height, flat: of the textures the one nearest by angle.
    Semicircle {
        /// Sampling distance: the radius around the middle of the portal. [Units: wu]
        radius: f64,
        /// Height of the viewpoints above the portal's lower edge. [Units: wu]
        height: f64,
        /// Angle between neighbors. [Units: deg] [Limit: 0.1 to 90]
        step: f64,
        /// Angles with viewpoints, from the right edge of the portal's plane (0) to the left (180), for example
        /// `[[30.0, 120.0]]`. [Units: deg]
        spans: Vec<[f64; 2]>,
    },
    /// A square grid before the portal at the eye's height, flat: of the textures the nearest.
    Grid {
        /// Distance between neighbors. [Units: wu] [Limit: at least 0.01]
        spacing: f64,
    },
    /// One viewpoint in front of the portal, flat.
    Single {
        /// Distance from the portal. [Units: wu]
        radius: f64,
        /// Height above the portal's lower edge. [Units: wu]
        height: f64,
    },
}

impl Viewpoints {
    /// Returns those of the source: a semicircle with a texture every `step` degrees, 30 to 150 degrees.
    #[must_use]
    pub fn semicircle(step: f64) -> Self {
        Self::Semicircle {
            radius: 4.0,
            height: 1.6,
            step,
            spans: vec![[30.0, 150.0]],
        }
    }

    /// Returns `true` if textures are warped by their depths.
    #[must_use]
    pub(crate) fn are_warped(&self) -> bool {
        matches!(self, Self::Warped { .. })
    }
}

/// Settings of [portal textures](crate::Studio::add_portal_textures).
#[derive(Clone, Debug, PartialEq)]
pub struct PortalTextureOptions {
    /// The places from which they are taken.
    pub viewpoints: Viewpoints,
    /// Width and height of each. [Units: px] [Limit: 16 to 1024]
    pub side: u32,
    /// Distance of the eye from a portal within which it is drawn as geometry. [Units: wu]
    pub transition_distance: f32,
    /// Number of frames in which a texture turns into geometry, and back; 0 for at once.
    pub transition_frames: u32,
    /// Memory on the adapter; textures out of view give way to others. [Units: byte]
    pub max_bytes: u64,
    /// Textures made in one frame at most. One that was made ahead counts half.
    pub max_made: u32,
    /// Triangles drawn in one frame at most; `u64::MAX` for no bound. Nearer portals become textures until it holds, then
    /// portals without a texture get one color, and at last the farthest surfaces are left out.
    pub max_triangles: u64,
    /// The coloring of pixels from textures.
    pub paint: PortalTexturePaint,
}

/// The coloring of pixels from portal textures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PortalTexturePaint {
    /// As the textures are.
    #[default]
    Plain,
    /// Magenta where no texture shows what is seen there, and another surface goes on.
    Holes,
    /// Tinted, to show which portals are textures.
    Tinted,
}

impl Default for PortalTextureOptions {
    /// Warped textures of 256 × 256, geometry within 2.5 m, 5 frames of transition, 64 MiB, 2 textures a frame.
    fn default() -> Self {
        Self {
            viewpoints: Viewpoints::Warped { spacing: 0.0625 },
            side: 256,
            transition_distance: 2.5,
            transition_frames: 5,
            max_bytes: 64 << 20,
            max_made: 2,
            max_triangles: u64::MAX,
            paint: PortalTexturePaint::Plain,
        }
    }
}

/// A problem of [`PortalTextureOptions`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PortalTextureError {
    /// A value out of range.
    #[error("{what} is {value}; it must be {range}")]
    OutOfRange {
        /// Its name.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The values allowed.
        range: &'static str,
    },
    /// Not even one texture fits.
    #[error("a budget of {budget} bytes holds no portal texture: one takes {needed} bytes")]
    NoRoom {
        /// The budget. [Units: byte]
        budget: u64,
        /// Size of one texture. [Units: byte]
        needed: u64,
    },
}

impl PortalTextureOptions {
    /// Returns the bytes of one texture: color, and depth of 32 bits.
    #[must_use]
    #[doc(hidden)]
    pub fn bytes_each(&self) -> u64 {
        u64::from(self.side) * u64::from(self.side) * 8
    }

    /// Checks the limits.
    ///
    /// # Errors
    ///
    /// The first value out of range, or a budget too small for one texture.
    pub fn check(&self) -> Result<(), PortalTextureError> {
        let check = |what, value: f64, is_fine: bool, range| {
            let out = PortalTextureError::OutOfRange { what, value, range };
            is_fine.then_some(()).ok_or(out)
        };
        let side = f64::from(self.side);
        check(
            "the side of portal textures",
            side,
            (16..=1024).contains(&self.side),
            "16 to 1024",
        )?;
        let distance = f64::from(self.transition_distance);
        let is_fine = distance > 0.0 && distance.is_finite();
        check(
            "the transition distance",
            distance,
            is_fine,
            "greater than 0",
        )?;
        match &self.viewpoints {
            Viewpoints::Warped { spacing } => {
                let is_fine = (0.01..=2.0).contains(spacing);
                check("the spacing of viewpoints", *spacing, is_fine, "0.01 to 2")?;
            }
            Viewpoints::Semicircle {
                radius,
                step,
                spans,
                ..
            } => {
                check(
                    "the sampling distance",
                    *radius,
                    *radius > 0.0,
                    "greater than 0",
                )?;
                let is_fine = (0.1..=90.0).contains(step);
                check("the angle between viewpoints", *step, is_fine, "0.1 to 90")?;
                for [from, to] in spans {
                    let is_fine = 0.0 < *from && from <= to && *to < 180.0;
                    check(
                        "an angle of viewpoints",
                        *from,
                        is_fine,
                        "above 0, below 180, in order",
                    )?;
                }
                let n = spans.len() as f64;
                check(
                    "the number of spans of viewpoints",
                    n,
                    n > 0.0,
                    "at least 1",
                )?;
            }
            Viewpoints::Grid { spacing } => {
                check(
                    "the spacing of viewpoints",
                    *spacing,
                    *spacing >= 0.01,
                    "at least 0.01",
                )?;
            }
            Viewpoints::Single { radius, .. } => {
                check(
                    "the sampling distance",
                    *radius,
                    *radius > 0.0,
                    "greater than 0",
                )?;
            }
        }
        let (budget, needed) = (self.max_bytes, self.bytes_each());
        let no_room = PortalTextureError::NoRoom { budget, needed };
        (budget >= needed).then_some(()).ok_or(no_room)
    }
}

/// Textures in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PortalTextureCounts {
    /// Portals drawn as textures.
    pub n_textured: usize,
    /// Portals of one color, because the bound on triangles left no other choice.
    pub n_plain: usize,
    /// Textures made in this frame.
    pub n_made: usize,
    /// Textures taken in this frame from those [made ahead](crate::Studio::load_portal_textures).
    pub n_loaded: usize,
    /// Portals in transition; for each, a texture was drawn in this frame that is not counted as made.
    pub n_turning: usize,
    /// Triangles drawn to make textures.
    pub n_made_triangles: u64,
    /// Textures on the adapter.
    pub n_held: usize,
    /// Their memory. [Units: byte]
    pub n_bytes: u64,
}
