//! The journal of a session: a file with a line for each operation, undo and redo.
//!
//! The last field of a line is a sum of the whole journal up to it, so a line that was changed, moved or comes from another journal
//! is refused. It detects damage, not forgery.

use std::fs::{File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

use crate::operation::EditOperation;

/// First field of a journal, with the version of its format.
const HEADER: &str = "enfilade edits 2";

/// Reason why a journal cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JournalError {
    /// The file cannot be read or written.
    #[error("the journal cannot be read or written: {0}")]
    Io(#[from] io::Error),
    /// Another session writes it.
    #[error("another session is open with this journal; close it first")]
    InUse,
    /// The file is none.
    #[error("this is no journal of edits: its first line is not '{HEADER}'; move the file away")]
    NotAJournal,
    /// The journal was begun over another world.
    #[error(
        "the journal was begun over another world than this one; give that world, or move the journal away to begin anew"
    )]
    OtherGround,
    /// A line is none.
    #[error(
        "line {line} of the journal: {why}; remove the line and those after it to go back to before it"
    )]
    Line {
        /// Its number, from 1.
        line: usize,
        /// The reason.
        why: String,
    },
}

/// A line of a journal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Entry {
    Operation(EditOperation),
    Undo,
    Redo,
}

impl Entry {
    fn of_line(line: &str) -> Result<Self, String> {
        match line {
            "undo" => Ok(Self::Undo),
            "redo" => Ok(Self::Redo),
            line => EditOperation::of_line(line).map(Self::Operation),
        }
    }
}

/// The sum of a journal so far: FNV-1a, 64 bits.
#[derive(Clone, Copy, Debug)]
struct Sum(u64);

impl Sum {
    /// Begins a journal over a ground.
    fn of_header(ground: &str) -> Self {
        Self(0xcbf2_9ce4_8422_2325).with(&header(ground))
    }

    /// Adds a line.
    fn with(self, line: &str) -> Self {
        let bytes = line.bytes().chain([b'\n']);
        Self(bytes.fold(self.0, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        }))
    }

    /// Returns a line with the sum after it.
    fn sealed(self, line: &str) -> String {
        format!("{line}\t{:016x}", self.with(line).0)
    }

    /// Returns a line without the sum after it; `None` if it has another.
    fn unsealed(self, line: &str) -> Option<&str> {
        let (own, _) = line.rsplit_once('\t')?;
        (self.sealed(own) == line).then_some(own)
    }
}

fn header(ground: &str) -> String {
    format!("{HEADER}\t{ground}")
}

/// Returns the text of a journal over a `ground` with these lines, for tests of journals that no session writes.
#[doc(hidden)]
#[must_use]
pub fn journal_of<'a>(ground: &str, lines: impl IntoIterator<Item = &'a str>) -> String {
    let mut sum = Sum::of_header(ground);
    let mut text = header(ground) + "\n";
    for line in lines {
        text += &(sum.sealed(line) + "\n");
        sum = sum.with(line);
    }
    text
}

/// An open journal, which nobody else writes.
#[derive(Debug)]
pub(crate) struct Journal {
    file: File,
    /// Length of what is written whole. [Units: bytes]
    length: u64,
    sum: Sum,
}

/// The contents of a journal that was opened.
pub(crate) struct Contents {
    /// The entries, each with its line.
    pub(crate) entries: Vec<(usize, Entry)>,
    /// The last line, which was cut off because it had no end.
    pub(crate) cut: Option<String>,
}

impl Journal {
    /// Opens a journal over a `ground`, a word without tabs that tells worlds apart, or begins one.
    ///
    /// # Errors
    ///
    /// If the file cannot be read and written, is in use, or is not a journal over this ground. It stays as it is then.
    pub(crate) fn open(path: &Path, ground: &str) -> Result<(Self, Contents), JournalError> {
        let mut options = File::options();
        let mut file = (options.read(true).write(true).create(true).truncate(false)).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(JournalError::InUse),
            Err(TryLockError::Error(why)) => return Err(why.into()),
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        let whole = bytes
            .iter()
            .rposition(|b| *b == b'\n')
            .map_or(0, |at| at + 1);
        let (lines, rest) = bytes.split_at(whole);
        let header = header(ground);
        // A file of something else is not cut.
        if whole == 0 && !format!("{header}\n").as_bytes().starts_with(rest) {
            return Err(JournalError::NotAJournal);
        }
        let text = std::str::from_utf8(lines).map_err(|_| JournalError::NotAJournal)?;
        let mut contents = Contents {
            entries: Vec::new(),
            cut: (!rest.is_empty()).then(|| String::from_utf8_lossy(rest).into_owned()),
        };
        let mut numbered = (1..).zip(text.lines());
        if let Some((_, first)) = numbered.next() {
            match first.split_once('\t') {
                Some((HEADER, over)) if over == ground => {}
                Some((HEADER, _)) => return Err(JournalError::OtherGround),
                _ => return Err(JournalError::NotAJournal),
            }
        }
        let mut sum = Sum::of_header(ground);
        for (line, text) in numbered {
            let refused = |why| JournalError::Line { line, why };
            let own = sum.unsealed(text).ok_or_else(|| {
                refused("it or one before it was changed, for its sum is another".to_owned())
            })?;
            sum = sum.with(own);
            let entry = Entry::of_line(own).map_err(refused)?;
            contents.entries.push((line, entry));
        }
        let mut journal = Self {
            file,
            length: whole as u64,
            sum,
        };
        if !rest.is_empty() {
            journal.file.set_len(journal.length)?;
        }
        if whole == 0 {
            journal.append(&header)?;
        }
        Ok((journal, contents))
    }

    /// Writes an entry. If that fails, the journal is as before, or at worst has a line without an end.
    pub(crate) fn write(&mut self, entry: &Entry) -> Result<(), JournalError> {
        let line = match entry {
            Entry::Operation(operation) => operation.line(),
            Entry::Undo => "undo".to_owned(),
            Entry::Redo => "redo".to_owned(),
        };
        self.append(&self.sum.sealed(&line))?;
        self.sum = self.sum.with(&line);
        Ok(())
    }

    fn append(&mut self, line: &str) -> Result<(), JournalError> {
        let bytes = format!("{line}\n");
        self.file.seek(SeekFrom::Start(self.length))?;
        // Without a buffer: once this returns, only the system's own end loses it.
        if let Err(why) = self.file.write_all(bytes.as_bytes()) {
            // Ignore the error: the rest is cut off when the journal is opened.
            let _ = self.file.set_len(self.length);
            return Err(why.into());
        }
        self.length += bytes.len() as u64;
        Ok(())
    }

    /// Waits until all that was written is on the disk.
    pub(crate) fn sync(&self) -> Result<(), JournalError> {
        Ok(self.file.sync_data()?)
    }
}
