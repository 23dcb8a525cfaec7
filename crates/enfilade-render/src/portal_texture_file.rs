//! Errors of files of portal textures.

/// Portal textures that cannot be made ahead, or a file of them that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PortalTextureFileError {
    /// Portal textures are off.
    #[error("portal textures are off; turn them on before they are made ahead or loaded")]
    Off,
    /// Not a file of portal textures.
    #[error("this is not a file of portal textures; give one that `enfilade portals` wrote")]
    Foreign,
    /// A file of another version.
    #[error(
        "the portal textures have version {found}, but {known} is needed; make them again with `enfilade portals`"
    )]
    Version {
        /// Its version.
        found: u16,
        /// The only one that is read.
        known: u16,
    },
    /// A file that was cut off or changed.
    #[error(
        "the portal textures are damaged at byte {at}: {what}; copy the file again, or make it again with `enfilade portals`"
    )]
    Damaged {
        /// The place.
        at: u64,
        /// The problem.
        what: &'static str,
    },
    /// A file for another world.
    #[error(
        "the portal textures were made for another world, or before this one was changed; make them again with `enfilade portals`"
    )]
    OtherWorld,
    /// A file for other lamps or daylight.
    #[error(
        "the portal textures were made with other lamps, or with daylight on or off; make them again with `enfilade portals`"
    )]
    OtherLight,
    /// A file of textures of another size.
    #[error(
        "the portal textures are {found} pixels wide, but {wanted} are wanted; choose that size, or make them again with `enfilade portals --side {wanted}`"
    )]
    OtherSide {
        /// Their side. [Units: px]
        found: u32,
        /// The [side](crate::PortalTextureOptions::side) wanted. [Units: px]
        wanted: u32,
    },
    /// A file of textures from other viewpoints.
    #[error(
        "the portal textures were taken from other viewpoints than those wanted; make them again with `enfilade portals`"
    )]
    OtherViewpoints,
    /// A budget without room for anything.
    #[error(
        "a file of {budget} bytes has no room for portal textures: without any it takes {needed} bytes; raise the budget"
    )]
    NoRoom {
        /// The budget. [Units: byte]
        budget: u64,
        /// Size of a file without textures. [Units: byte]
        needed: u64,
    },
}
