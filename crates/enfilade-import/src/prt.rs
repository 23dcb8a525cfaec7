//! Quake portal files: `PRT1` (Quake, Quake 2, Quake 3), `PRT2` and `PRT1-AM`.
//!
//! The text is a header, then one portal per line, `<points> <c0> <c1> (x y z ) …`, whose right-hand normal points
//! from cluster `c0` to `c1`. A game's vis data is about leaves; visibility is about clusters, to which leaves
//! belong; the variants differ in how they record that. Input is not trusted: every count is checked against the
//! bytes present before memory is allocated for it.

use std::fmt::Write;

/// Variants of portal files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PrtFormat {
    /// Quake and Quake 2: a leaf is a cluster.
    Prt1,
    /// ericw-tools and tyrutils: a list of leaves per cluster.
    Prt2,
    /// bjptools: the cluster of each leaf.
    Prt1Am,
    /// Quake 3: flags per portal, solid faces at the end.
    Quake3,
}

/// A portal, or a solid face of a Quake 3 file.
#[derive(Clone, Debug, PartialEq)]
pub struct PrtPortal {
    /// The clusters it joins; the right-hand normal of the points points from the first to the second.
    pub clusters: [u32; 2],
    /// Quake 3's flags: 1 hint, 2 sky. 0 elsewhere.
    pub flags: u32,
    /// Vertices, convex and planar up to rounding. [Units: those of the map]
    pub points: Vec<[f64; 3]>,
}

/// A face that blocks sight, in Quake 3 files.
#[derive(Clone, Debug, PartialEq)]
pub struct PrtFace {
    /// The cluster that sees it.
    pub cluster: u32,
    /// Vertices. [Units: those of the map]
    pub points: Vec<[f64; 3]>,
}

/// Contents of a portal file.
#[derive(Clone, Debug, PartialEq)]
pub struct PrtFile {
    /// Its variant.
    pub format: PrtFormat,
    /// Number of clusters.
    pub n_clusters: u32,
    /// The portals in the file's order.
    pub portals: Vec<PrtPortal>,
    /// Solid faces, in Quake 3 files.
    pub faces: Vec<PrtFace>,
    /// Cluster of each leaf.
    pub leaf_cluster: Vec<u32>,
}

/// The reason why a text is not a portal file or PVS, with its place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, word {word}: {}", enfilade_geom::shown(problem))]
#[non_exhaustive]
pub struct PrtError {
    /// Line, from 1.
    pub line: usize,
    /// Word on that line, from 1; brackets count as words.
    pub word: usize,
    /// The problem.
    pub problem: String,
}

/// Most clusters or leaves in a file. The file's size bounds the portals, but clusters without portals take no bytes.
const MAX_CLUSTERS: u32 = 1 << 20;
/// Larger coordinates are rejected as damage.
const MAX_COORDINATE: f64 = 1e9;

/// Reads a portal file of any variant.
///
/// Keeps portals with fewer than three points; the caller decides about them. Linear time and memory.
///
/// # Errors
///
/// The first unexpected word, with its place.
pub fn read_prt(text: &str) -> Result<PrtFile, PrtError> {
    let mut words = PrtWords::new(text);
    let magic = words.next("the magic word `PRT1`, `PRT2` or `PRT1-AM`")?;
    let (mut format, header) = match magic {
        "PRT1" => (PrtFormat::Prt1, 2),
        "PRT2" => (PrtFormat::Prt2, 3),
        "PRT1-AM" => (PrtFormat::Prt1Am, 3),
        other => {
            let shown: String = other.chars().take(20).collect();
            return Err(words.error(format!(
                "'{shown}' is not the magic word of a portal file: PRT1, PRT2 or PRT1-AM"
            )));
        }
    };
    let mut counts = [0u32; 4];
    for count in counts.iter_mut().take(header) {
        *count = words.number("a count")?;
    }
    let mut n_faces = 0;
    if format == PrtFormat::Prt1 && words.starts_number_line() {
        // Quake 3's header has one more count, on a line of its own. A portal begins with three numbers and a
        // bracket, so a line with a single number is not a portal.
        n_faces = words.number("the number of solid faces")?;
        format = PrtFormat::Quake3;
    }
    let (n_leaves, n_clusters, n_portals) = match format {
        PrtFormat::Prt1 | PrtFormat::Quake3 => (counts[0], counts[0], counts[1]),
        PrtFormat::Prt2 => (counts[0], counts[1], counts[2]),
        PrtFormat::Prt1Am => (counts[2], counts[0], counts[1]),
    };
    for (what, n) in [("clusters", n_clusters), ("leaves", n_leaves)] {
        if n > MAX_CLUSTERS {
            return Err(words.error(format!("{n} {what}, more than the limit of {MAX_CLUSTERS}")));
        }
    }
    let mut portals = Vec::with_capacity((n_portals as usize).min(text.len() / 6));
    for _ in 0..n_portals {
        portals.push(read_portal(&mut words, format, n_clusters)?);
    }
    let mut faces = Vec::with_capacity((n_faces as usize).min(text.len() / 4));
    for _ in 0..n_faces {
        let n = words.number("the number of points of a solid face")?;
        let cluster = words.below(n_clusters, "a cluster")?;
        let points = words.points(n)?;
        faces.push(PrtFace { cluster, points });
    }
    let leaf_cluster = read_leaves(&mut words, format, n_leaves, n_clusters)?;
    Ok(PrtFile {
        format,
        n_clusters,
        portals,
        faces,
        leaf_cluster,
    })
}

fn read_portal(
    words: &mut PrtWords<'_>,
    format: PrtFormat,
    n_clusters: u32,
) -> Result<PrtPortal, PrtError> {
    let n = words.number("the number of points of a portal")?;
    let clusters = [
        words.below(n_clusters, "a cluster")?,
        words.below(n_clusters, "a cluster")?,
    ];
    let flags = if format == PrtFormat::Quake3 {
        words.number("the flags of a portal")?
    } else {
        0
    };
    let points = words.points(n)?;
    Ok(PrtPortal {
        clusters,
        flags,
        points,
    })
}

fn read_leaves(
    words: &mut PrtWords<'_>,
    format: PrtFormat,
    n_leaves: u32,
    n_clusters: u32,
) -> Result<Vec<u32>, PrtError> {
    match format {
        PrtFormat::Prt1 | PrtFormat::Quake3 => Ok((0..n_clusters).collect()),
        PrtFormat::Prt1Am => (0..n_leaves)
            .map(|_| words.below(n_clusters, "the cluster of a leaf"))
            .collect(),
        PrtFormat::Prt2 => {
            let mut leaf_cluster = vec![u32::MAX; n_leaves as usize];
            for cluster in 0..n_clusters {
                while let Some(leaf) = words.leaf(n_leaves)? {
                    leaf_cluster[leaf as usize] = cluster;
                }
            }
            if let Some(leaf) = leaf_cluster.iter().position(|&c| c == u32::MAX) {
                return Err(words.error(format!("leaf {leaf} is in no cluster's list")));
            }
            Ok(leaf_cluster)
        }
    }
}

impl PrtFile {
    /// Returns the file with clusters merged: cluster `c` becomes `cluster_of[c]` of `n_clusters`.
    ///
    /// Drops portals inside a merged cluster. `PRT1`, in which a leaf is a cluster, becomes `PRT2`, whose leaves are
    /// the old clusters: data about leaves stays valid. Quake 3's files have clusters only. Linear.
    ///
    /// # Panics
    ///
    /// When `cluster_of` lacks a cluster.
    #[must_use]
    #[doc(hidden)]
    pub fn merged(&self, cluster_of: &[u32], n_clusters: u32) -> Self {
        let of = |c: u32| cluster_of[c as usize];
        let portals = self.portals.iter().map(|p| PrtPortal {
            clusters: p.clusters.map(of),
            ..p.clone()
        });
        let leaf_cluster = self.leaf_cluster.iter().map(|&c| of(c)).collect();
        let (format, leaf_cluster) = match self.format {
            PrtFormat::Prt1 => (PrtFormat::Prt2, leaf_cluster),
            PrtFormat::Quake3 => (PrtFormat::Quake3, (0..n_clusters).collect()),
            format => (format, leaf_cluster),
        };
        Self {
            format,
            n_clusters,
            portals: portals.filter(|p| p.clusters[0] != p.clusters[1]).collect(),
            faces: (self.faces.iter())
                .map(|f| PrtFace {
                    cluster: of(f.cluster),
                    points: f.points.clone(),
                })
                .collect(),
            leaf_cluster,
        }
    }
}

/// Writes a portal file, with the shortest numbers that read back the same.
///
/// `read_prt(write_prt(file)) == file`.
#[must_use]
pub fn write_prt(file: &PrtFile) -> String {
    let mut out = String::new();
    let n_portals = file.portals.len();
    let n_leaves = file.leaf_cluster.len();
    // Writing to a string cannot fail.
    let _ = match file.format {
        PrtFormat::Prt1 => writeln!(out, "PRT1\n{}\n{n_portals}", file.n_clusters),
        PrtFormat::Quake3 => {
            let n_faces = file.faces.len();
            writeln!(out, "PRT1\n{}\n{n_portals}\n{n_faces}", file.n_clusters)
        }
        PrtFormat::Prt2 => writeln!(out, "PRT2\n{n_leaves}\n{}\n{n_portals}", file.n_clusters),
        PrtFormat::Prt1Am => {
            writeln!(out, "PRT1-AM\n{}\n{n_portals}\n{n_leaves}", file.n_clusters)
        }
    };
    for portal in &file.portals {
        let [a, b] = portal.clusters;
        let _ = write!(out, "{} {a} {b}", portal.points.len());
        if file.format == PrtFormat::Quake3 {
            let _ = write!(out, " {}", portal.flags);
        }
        write_points(&mut out, &portal.points);
    }
    for face in &file.faces {
        let _ = write!(out, "{} {}", face.points.len(), face.cluster);
        write_points(&mut out, &face.points);
    }
    match file.format {
        PrtFormat::Prt1 | PrtFormat::Quake3 => {}
        PrtFormat::Prt1Am => {
            for cluster in &file.leaf_cluster {
                let _ = writeln!(out, "{cluster}");
            }
        }
        PrtFormat::Prt2 => {
            let mut leaves = vec![Vec::new(); file.n_clusters as usize];
            for (leaf, &cluster) in file.leaf_cluster.iter().enumerate() {
                leaves[cluster as usize].push(leaf);
            }
            for list in leaves {
                for leaf in list {
                    let _ = write!(out, "{leaf} ");
                }
                out.push_str("-1\n");
            }
        }
    }
    out
}

fn write_points(out: &mut String, points: &[[f64; 3]]) {
    for [x, y, z] in points {
        let _ = write!(out, " ({x} {y} {z} )");
    }
    out.push('\n');
}

/// Splits a text into words; brackets are words of their own.
struct PrtWords<'a> {
    text: &'a str,
    at: usize,
    line: usize,
    word: usize,
}

impl<'a> PrtWords<'a> {
    fn new(text: &'a str) -> Self {
        Self {
            text,
            at: 0,
            line: 1,
            word: 0,
        }
    }

    fn error(&self, problem: impl Into<String>) -> PrtError {
        PrtError {
            line: self.line,
            word: self.word,
            problem: problem.into(),
        }
    }

    fn skip_space(&mut self) {
        let bytes = self.text.as_bytes();
        while let Some(&b) = bytes.get(self.at) {
            if !b.is_ascii_whitespace() {
                break;
            }
            if b == b'\n' {
                self.line += 1;
                self.word = 0;
            }
            self.at += 1;
        }
    }

    /// Returns the length in bytes of the word that starts at `at`.
    fn word_len(&self) -> usize {
        let rest = &self.text.as_bytes()[self.at..];
        match rest.first() {
            Some(b'(' | b')') => 1,
            _ => rest
                .iter()
                .position(|&b| b.is_ascii_whitespace() || b == b'(' || b == b')')
                .unwrap_or(rest.len()),
        }
    }

    fn next(&mut self, wanted: &str) -> Result<&'a str, PrtError> {
        self.skip_space();
        self.word += 1;
        if self.at >= self.text.len() {
            return Err(self.error(format!("the file ends before {wanted}")));
        }
        let start = self.at;
        self.at += self.word_len();
        Ok(&self.text[start..self.at])
    }

    fn number(&mut self, wanted: &str) -> Result<u32, PrtError> {
        let word = self.next(wanted)?;
        word.parse()
            .map_err(|_| self.error(format!("'{}' is not {wanted}", shown(word))))
    }

    fn below(&mut self, limit: u32, wanted: &str) -> Result<u32, PrtError> {
        let n = self.number(wanted)?;
        if n >= limit {
            return Err(self.error(format!("{n} is not {wanted}: there are {limit}")));
        }
        Ok(n)
    }

    /// Returns the next leaf of a list, `None` at its end.
    fn leaf(&mut self, n_leaves: u32) -> Result<Option<u32>, PrtError> {
        self.skip_space();
        let len = self.word_len();
        if self.text.get(self.at..self.at + len) == Some("-1") {
            self.next("-1")?;
            return Ok(None);
        }
        self.below(n_leaves, "a leaf").map(Some)
    }

    fn points(&mut self, n: u32) -> Result<Vec<[f64; 3]>, PrtError> {
        // A point takes at least seven bytes: "(0 0 0)".
        let mut points = Vec::with_capacity((n as usize).min((self.text.len() - self.at) / 7));
        for _ in 0..n {
            self.bracket("(")?;
            let point = [self.coordinate()?, self.coordinate()?, self.coordinate()?];
            self.bracket(")")?;
            points.push(point);
        }
        Ok(points)
    }

    fn bracket(&mut self, wanted: &'static str) -> Result<(), PrtError> {
        let word = self.next(wanted)?;
        if word != wanted {
            return Err(self.error(format!("expected '{wanted}', found '{}'", shown(word))));
        }
        Ok(())
    }

    fn coordinate(&mut self) -> Result<f64, PrtError> {
        let word = self.next("a coordinate")?;
        match word.parse::<f64>() {
            Ok(x) if x.abs() <= MAX_COORDINATE => Ok(x),
            _ => Err(self.error(format!("'{}' is not a valid coordinate", shown(word)))),
        }
    }

    /// Returns `true` if the next line that is not empty holds a single number.
    fn starts_number_line(&self) -> bool {
        let line = self.text[self.at..].trim_start().lines().next();
        line.is_some_and(|l| l.trim().parse::<u32>().is_ok())
    }
}

fn shown(word: &str) -> String {
    word.chars().take(30).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PRT2: &str = "PRT2\n3\n2\n1\n3 0 1 (0 0 0 ) (0 1 0 ) (0 0 1.5 )\n0 2 -1\n1 -1\n";

    #[test]
    fn prt2_is_read_with_its_leaves() {
        let file = read_prt(PRT2).unwrap();
        assert_eq!(file.format, PrtFormat::Prt2);
        assert_eq!(file.n_clusters, 2);
        assert_eq!(file.leaf_cluster, [0, 1, 0]);
        assert_eq!(file.portals[0].clusters, [0, 1]);
        assert_eq!(file.portals[0].points[2], [0.0, 0.0, 1.5]);
        assert_eq!(write_prt(&file), PRT2);
    }

    #[test]
    fn quake_3_is_told_from_quake_by_its_header() {
        let text = "PRT1\n2\n1\n1\n3 0 1 2(0 0 0 )(0 1 0 )(0 0 1 )\n3 1(0 0 0 )(0 1 0 )(0 0 1 )\n";
        let file = read_prt(text).unwrap();
        assert_eq!(file.format, PrtFormat::Quake3);
        assert_eq!(file.portals[0].flags, 2);
        assert_eq!(file.faces[0].cluster, 1);
        assert_eq!(read_prt(&write_prt(&file)).unwrap(), file);
        let quake = "PRT1\n2\n1\n3 0 1 (0 0 0 ) (0 1 0 ) (0 0 1 )\n";
        assert_eq!(read_prt(quake).unwrap().format, PrtFormat::Prt1);
    }

    #[test]
    fn a_fault_is_named_with_its_place() {
        let cases = [
            ("", 1, "the file ends"),
            ("PRT9\n", 1, "PRT9"),
            ("PRT1\n2\n1\n3 0 7 (0 0 0 )", 4, "there are 2"),
            ("PRT1\n2\n1\n3 0 1 (0 0 0 ) (0 nan 0 )", 4, "nan"),
            ("PRT1\n2\n1\n3 0 1 (0 0 0 ) (0 1e300 0 )", 4, "1e300"),
            ("PRT1\n2\n1\n4000000000 0 1 (0 0 0 )", 4, "the file ends"),
            ("PRT1\n2\n4000000000\n", 4, "the file ends"),
            ("PRT1\n4000000000\n1\n", 3, "limit"),
            ("PRT1\n2\n-1\n", 3, "-1"),
            ("PRT2\n3\n2\n0\n0 -1\n1 -1\n", 6, "leaf 2"),
            ("PRT1-AM\n2\n0\n2\n0\n9\n", 6, "9"),
        ];
        for (text, line, part) in cases {
            let error = read_prt(text).unwrap_err();
            assert!(error.problem.contains(part), "{text:?}: {error}");
            assert_eq!(error.line, line, "{text:?}: {error}");
        }
    }

    #[test]
    fn a_changed_byte_ends_in_a_file_or_an_error() {
        let mut n_read = 0;
        for i in 0..PRT2.len() {
            for byte in [b'0', b'1', b'3', b'-', b'.', b' ', b'\n'] {
                let mut changed = PRT2.as_bytes().to_vec();
                changed[i] = byte;
                let text = String::from_utf8(changed).unwrap();
                if let Ok(file) = read_prt(&text) {
                    assert_eq!(read_prt(&write_prt(&file)).unwrap(), file, "{text:?}");
                    n_read += 1;
                }
            }
        }
        assert!((1..PRT2.len() * 7).contains(&n_read), "{n_read}");
    }

    proptest! {
        #[test]
        fn any_text_ends_in_a_file_or_an_error(text in "(PRT1|PRT2|PRT1-AM)[ \n0-9().-]{0,200}") {
            if let Ok(file) = read_prt(&text) {
                prop_assert_eq!(read_prt(&write_prt(&file)).unwrap(), file);
            }
        }

        #[test]
        fn every_prefix_of_a_file_is_an_error(len in 0..PRT2.trim_end().len()) {
            prop_assert!(read_prt(&PRT2[..len]).is_err());
        }
    }
}
