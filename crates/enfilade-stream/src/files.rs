//! Packed worlds on disk.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::head::{PackError, PackedHead};
use crate::{Fetch, PackedWorld, ThreadSource};

/// Name of the head in the folder of a packed world.
pub const HEAD: &str = "head.enfp";
/// Name of the pieces in the folder of a packed world.
pub(crate) const PIECES: &str = "pieces.enfp";

impl PackedWorld {
    /// Returns the files of its folder, by name.
    ///
    /// # Errors
    ///
    /// A world that breaks invariants.
    pub fn files(&self) -> Result<[(&'static str, Vec<u8>); 2], PackError> {
        Ok([(HEAD, self.head.encode()?), (PIECES, self.body.clone())])
    }

    /// Returns it as one file.
    ///
    /// # Errors
    ///
    /// As [`PackedWorld::files`].
    pub fn one_file(&self) -> Result<Vec<u8>, PackError> {
        let mut out = self.head.encode()?;
        out.extend_from_slice(&self.body);
        Ok(out)
    }
}

/// Place of a packed world on disk: a folder with a head and pieces, or one file with both.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedFiles {
    /// The file with the pieces.
    pub pieces: PathBuf,
    /// Offset of the first piece there. [Units: bytes]
    pub offset: u64,
}

impl PackedFiles {
    /// Opens a packed world: reads its head, and finds its pieces. Takes the memory of the head.
    ///
    /// # Errors
    ///
    /// A path without a packed world, damage.
    pub fn open(path: &Path) -> Result<(PackedHead, Self), PackError> {
        let in_one = !path.is_dir();
        let of_head = if in_one {
            path.to_owned()
        } else {
            path.join(HEAD)
        };
        let mut file = File::open(&of_head).map_err(|e| at(&of_head, &e))?;
        let mut bytes = Vec::new();
        let limited = (&mut file).take(64);
        read(limited, &mut bytes, &of_head)?;
        let n = PackedHead::size(&bytes)?;
        let limited = (&mut file).take(n.saturating_sub(bytes.len() as u64));
        read(limited, &mut bytes, &of_head)?;
        let head = PackedHead::decode(&bytes)?;
        let files = if in_one {
            Self {
                pieces: of_head,
                offset: n,
            }
        } else {
            Self {
                pieces: path.join(PIECES),
                offset: 0,
            }
        };
        Ok((head, files))
    }

    /// Returns `true` if a path looks like a packed world.
    #[must_use]
    pub fn is_packed(path: &Path) -> bool {
        let file = if path.is_dir() {
            path.join(HEAD)
        } else {
            path.to_owned()
        };
        if !file.is_file() {
            // Reading from a pipe would take away its beginning.
            return false;
        }
        let mut first = [0; 64];
        let n = File::open(file).and_then(|mut f| f.read(&mut first));
        n.is_ok_and(|n| PackedHead::size(&first[..n]).is_ok())
    }

    /// Reads a packed world whole.
    ///
    /// # Errors
    ///
    /// As [`PackedFiles::open`].
    #[doc(hidden)]
    pub fn read_all(path: &Path) -> Result<PackedWorld, PackError> {
        let (head, files) = Self::open(path)?;
        let mut file = File::open(&files.pieces).map_err(|e| at(&files.pieces, &e))?;
        let mut body = Vec::new();
        let start = file.seek(SeekFrom::Start(files.offset));
        start.map_err(|e| at(&files.pieces, &e))?;
        read(file, &mut body, &files.pieces)?;
        Ok(PackedWorld { head, body })
    }

    /// Returns a source of its pieces, which reads on a thread.
    #[must_use]
    pub fn source(&self, head: &Arc<PackedHead>) -> ThreadSource {
        let fetch = FileFetch::new(self);
        ThreadSource::new(head, &self.pieces.display().to_string(), vec![fetch])
    }
}

fn read(mut from: impl Read, to: &mut Vec<u8>, path: &Path) -> Result<(), PackError> {
    from.read_to_end(to).map(|_| ()).map_err(|e| at(path, &e))
}

fn at(path: &Path, error: &std::io::Error) -> PackError {
    PackError::File {
        path: path.display().to_string(),
        problem: error.to_string(),
    }
}

/// Fetches from a file, which is opened anew after a failure.
#[derive(Debug)]
pub struct FileFetch {
    files: PackedFiles,
    file: Option<File>,
}

impl FileFetch {
    /// Makes one that has not opened its file yet.
    #[must_use]
    pub fn new(files: &PackedFiles) -> Self {
        Self {
            files: files.clone(),
            file: None,
        }
    }
}

impl Fetch for FileFetch {
    fn fetch(&mut self, offset: u64, n: u64) -> Result<Vec<u8>, String> {
        let path = &self.files.pieces;
        let mut file = match self.file.take() {
            Some(file) => file,
            None => File::open(path).map_err(|e| e.to_string())?,
        };
        let start = self.files.offset.saturating_add(offset);
        let mut out = Vec::new();
        file.seek(SeekFrom::Start(start))
            .and_then(|_| (&mut file).take(n).read_to_end(&mut out))
            .map_err(|e| e.to_string())?;
        self.file = Some(file);
        Ok(out)
    }
}
