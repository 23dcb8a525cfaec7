//! Promises of the head of a LAS file, compared with the file before it is read.
//!
//! The readers of LAS and LAZ allocate what a file announces, and a process that gets less memory than it asks for is aborted. So
//! the lengths that they believe are checked here: those of extended records, of points, and of the table of compressed chunks.
//! Offsets are those of the specification of LAS 1.4, R15, and of LASzip (Isenburg 2013).

/// Returns the problem with the lengths in the head, if there is one. What is too short for a head, its reader refuses.
pub(crate) fn problem(bytes: &[u8]) -> Option<String> {
    let Some(head) = LasHead::of(bytes) else {
        return Some("is cut off within its head".into());
    };
    head.records()
        .or_else(|| head.points())
        .or_else(|| head.chunks())
}

/// Bytes of a record of a point; 1 at least.
pub(crate) fn point_length(bytes: &[u8]) -> u64 {
    number::<2>(bytes, 105).unwrap_or(0).max(1)
}

fn number<const N: usize>(bytes: &[u8], at: u64) -> Option<u64> {
    let at = usize::try_from(at).ok()?;
    let mut all = [0; 8];
    all[..N].copy_from_slice(bytes.get(at..at.checked_add(N)?)?);
    Some(u64::from_le_bytes(all))
}

struct LasHead<'b> {
    bytes: &'b [u8],
    has_extended: bool,
    to_points: u64,
    is_compressed: bool,
    n_points: u64,
}

/// Bytes of an extended record before its data.
const EXTENDED_HEAD: u64 = 60;

impl<'b> LasHead<'b> {
    fn of(bytes: &'b [u8]) -> Option<Self> {
        let has_extended = number::<1>(bytes, 25)? >= 4;
        let few = number::<4>(bytes, 107)?;
        let n_points = match has_extended {
            true => number::<8>(bytes, 247).filter(|n| *n > 0).unwrap_or(few),
            false => few,
        };
        Some(Self {
            bytes,
            has_extended,
            to_points: number::<4>(bytes, 96)?,
            // Two bits of the format tell of LASzip.
            is_compressed: number::<1>(bytes, 104)? & 0xc0 != 0,
            n_points,
        })
    }

    fn length(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Checks the lengths of extended records.
    fn records(&self) -> Option<String> {
        if !self.has_extended {
            return None;
        }
        let mut at = number::<8>(self.bytes, 235)?;
        for k in 0..number::<4>(self.bytes, 243)? {
            let data = number::<8>(self.bytes, at.saturating_add(20));
            let end = data.map(|n| at.saturating_add(EXTENDED_HEAD).saturating_add(n));
            match end.filter(|end| *end <= self.length()) {
                Some(end) => at = end,
                None => {
                    return Some(format!(
                        "extended record {k} goes beyond the end of the file"
                    ));
                }
            }
        }
        None
    }

    /// Checks that uncompressed points are there.
    fn points(&self) -> Option<String> {
        if self.is_compressed {
            return None;
        }
        let n = self.length().saturating_sub(self.to_points) / point_length(self.bytes);
        (n < self.n_points).then(|| {
            let promised = self.n_points;
            format!("has {n} points, and its head promises {promised}; is it cut off?")
        })
    }

    /// Checks the number of compressed chunks: each has a byte at least.
    fn chunks(&self) -> Option<String> {
        if !self.is_compressed {
            return None;
        }
        let mut table = number::<8>(self.bytes, self.to_points)?;
        // Unknown when the file was begun: then at its end.
        if table as i64 <= self.to_points as i64 {
            table = number::<8>(self.bytes, self.length().checked_sub(8)?)?;
        }
        let n = number::<4>(self.bytes, table.checked_add(4)?)?;
        (n > self.length())
            .then(|| format!("promises {n} chunks of points, more than it has bytes"))
    }
}
