//! Packed worlds wherever they are.

use std::path::Path;
use std::sync::Arc;

#[cfg(feature = "http")]
use crate::PackedHttp;
use crate::{PackError, PackedFiles, PackedHead, PackedWorld, ThreadSource};

/// Place of a packed world: on disk or, with feature `http`, on a server.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PackedPlace {
    /// On disk.
    Files(PackedFiles),
    /// On a server.
    #[cfg(feature = "http")]
    Http(PackedHttp),
}

impl PackedPlace {
    /// Returns `true` for addresses: what begins with `http://` or `https://`, in capitals or not.
    #[must_use]
    #[doc(hidden)]
    pub fn is_url(place: impl AsRef<Path>) -> bool {
        let place = place.as_ref().to_string_lossy();
        let begins = |scheme: &str| {
            let start = place.get(..scheme.len());
            start.is_some_and(|s| s.eq_ignore_ascii_case(scheme))
        };
        begins("http://") || begins("https://")
    }

    /// Opens a packed world by its path or address, as [`PackedFiles::open`] and `PackedHttp::open` do.
    ///
    /// # Errors
    ///
    /// A place without a packed world, damage; an address, without feature `http`.
    pub fn open(place: impl AsRef<Path>) -> Result<(PackedHead, Self), PackError> {
        let place = place.as_ref();
        if Self::is_url(place) {
            #[cfg(feature = "http")]
            return PackedHttp::open(&place.to_string_lossy()).map(|(h, p)| (h, Self::Http(p)));
            #[cfg(not(feature = "http"))]
            return Err(unsupported(place));
        }
        PackedFiles::open(place).map(|(head, files)| (head, Self::Files(files)))
    }

    /// Reads a packed world whole by its path or address.
    ///
    /// # Errors
    ///
    /// As [`PackedPlace::open`].
    pub fn read_all(place: impl AsRef<Path>) -> Result<PackedWorld, PackError> {
        let place = place.as_ref();
        if Self::is_url(place) {
            #[cfg(feature = "http")]
            return PackedHttp::read_all(&place.to_string_lossy());
            #[cfg(not(feature = "http"))]
            return Err(unsupported(place));
        }
        PackedFiles::read_all(place)
    }

    /// Returns a source of its pieces, which reads on threads.
    #[must_use]
    pub fn source(&self, head: &Arc<PackedHead>) -> ThreadSource {
        match self {
            Self::Files(files) => files.source(head),
            #[cfg(feature = "http")]
            Self::Http(http) => http.source(head),
        }
    }
}

#[cfg(not(feature = "http"))]
fn unsupported(place: &Path) -> PackError {
    PackError::File {
        path: place.display().to_string(),
        problem: "this program does not read from servers; build it with the feature `http`".into(),
    }
}
