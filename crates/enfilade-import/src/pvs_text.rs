//! Potentially visible sets as text, `PVS1`.
//!
//! The first line is `PVS1 <clusters>`, followed by metadata lines `# …`, then one line per cluster:
//! `4: 0-7 12 30-41`, ascending, both ends inclusive. `all` stands for every cluster. A cluster sees itself.

use std::fmt::Write;

use crate::PrtError;

/// One set per cluster, as ascending half-open ranges.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PvsText {
    /// Metadata: the `# …` lines without the mark.
    pub notes: Vec<String>,
    /// Visible clusters of each cluster.
    pub rows: Vec<Vec<(u32, u32)>>,
}

/// Most clusters. A row without ranges takes only a few bytes; the text's size bounds the rest.
const MAX_CLUSTERS: usize = 1 << 20;

/// Reads a text PVS. Time and memory are linear in the text.
///
/// # Errors
///
/// The first invalid line, with its place; also a cluster with no line or with two.
pub fn read_pvs_text(text: &str) -> Result<PvsText, PrtError> {
    let fail = |line: usize, word: usize, problem: String| {
        Err(PrtError {
            line,
            word,
            problem,
        })
    };
    let mut lines = text.lines().enumerate();
    let head = lines.next().map(|(_, l)| l).unwrap_or_default();
    let n = match head.split_ascii_whitespace().collect::<Vec<_>>()[..] {
        ["PVS1", n] => n.parse::<usize>().ok(),
        _ => None,
    };
    let Some(n) = n else {
        return fail(
            1,
            1,
            "`PVS1 <clusters>` is missing: this is not a text PVS".into(),
        );
    };
    if n > MAX_CLUSTERS || n > text.len() {
        return fail(
            1,
            2,
            format!("{n} clusters, more than the text has lines for"),
        );
    }
    let mut rows: Vec<Option<Vec<(u32, u32)>>> = vec![None; n];
    let mut notes = Vec::new();
    for (i, line) in lines {
        if let Some(note) = line.strip_prefix('#') {
            notes.push(note.trim().to_owned());
            continue;
        }
        if line.trim().is_empty() {
            continue;
        }
        let Some((cluster, ranges)) = line.split_once(':') else {
            return fail(i + 1, 1, "`<cluster>:` is missing".into());
        };
        let Some(slot) = cluster
            .trim()
            .parse()
            .ok()
            .and_then(|c: usize| rows.get_mut(c))
        else {
            return fail(i + 1, 1, format!("no such cluster; there are {n}"));
        };
        if slot.is_some() {
            return fail(i + 1, 1, "this cluster has a line already".into());
        }
        match read_ranges(ranges, n) {
            Ok(row) => *slot = Some(row),
            Err((word, problem)) => return fail(i + 1, word + 1, problem),
        }
    }
    let missing = rows.iter().position(Option::is_none);
    if let Some(cluster) = missing {
        let line = text.lines().count();
        return fail(line, 1, format!("cluster {cluster} has no line"));
    }
    Ok(PvsText {
        notes,
        rows: rows.into_iter().flatten().collect(),
    })
}

fn read_ranges(text: &str, n: usize) -> Result<Vec<(u32, u32)>, (usize, String)> {
    let mut row: Vec<(u32, u32)> = Vec::new();
    for (i, part) in text.split_ascii_whitespace().enumerate() {
        if part == "all" {
            return Ok(vec![(0, n as u32)]);
        }
        let (a, b) = part.split_once('-').unwrap_or((part, part));
        let (Ok(a), Ok(b)) = (a.parse::<u32>(), b.parse::<u32>()) else {
            return Err((i + 1, "this is not a number or range".into()));
        };
        if a > b || b as usize >= n || row.last().is_some_and(|&(_, end)| a < end) {
            return Err((i + 1, format!("ranges must ascend and stay below {n}")));
        }
        row.push((a, b + 1));
    }
    Ok(row)
}

/// Writes a text PVS.
#[must_use]
pub fn write_pvs_text(pvs: &PvsText) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(out, "PVS1 {}", pvs.rows.len());
    for note in &pvs.notes {
        let _ = writeln!(out, "# {note}");
    }
    for (cluster, row) in pvs.rows.iter().enumerate() {
        let _ = write!(out, "{cluster}:");
        for &(a, end) in row {
            let _ = match end - a {
                1 => write!(out, " {a}"),
                _ => write!(out, " {a}-{}", end - 1),
            };
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_pvs_is_read_and_written_alike() {
        let text = "PVS1 4\n# kind test\n0: 0-1 3\n1: 0-1\n2: 2\n3: 0 3\n";
        let pvs = read_pvs_text(text).unwrap();
        assert_eq!(pvs.rows[0], [(0, 2), (3, 4)]);
        assert_eq!(write_pvs_text(&pvs), text);
        assert_eq!(read_pvs_text("PVS1 1\n0: all\n").unwrap().rows[0], [(0, 1)]);
    }

    #[test]
    fn a_broken_text_pvs_is_named_with_its_place() {
        let cases = [
            ("PVS2 1\n0: 0", 1, "PVS1"),
            ("PVS1 99999999\n", 1, "99999999"),
            ("PVS1 2\n0: 0\n", 2, "cluster 1 has no line"),
            ("PVS1 2\n0: 0\n0: 0\n", 3, "already"),
            ("PVS1 2\n0: 0\n1: 5\n", 3, "below 2"),
            ("PVS1 2\n0: 1 0\n", 2, "ascend"),
            ("PVS1 2\n7: 1 0\n", 2, "no such cluster"),
        ];
        for (text, line, part) in cases {
            let error = read_pvs_text(text).unwrap_err();
            assert!(error.problem.contains(part), "{text:?}: {error}");
            assert_eq!(error.line, line, "{text:?}: {error}");
        }
    }
}
