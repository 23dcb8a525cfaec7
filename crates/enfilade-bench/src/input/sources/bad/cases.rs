//! Cases, and where to cut files off.

/// Files, the first of which is baked, and options.
pub(super) struct BadSource {
    pub(super) name: String,
    pub(super) files: Vec<(String, Vec<u8>)>,
    pub(super) options: Vec<String>,
}

impl BadSource {
    /// A case of one file without options. The name of the file ends with `ending`.
    pub(super) fn new(name: impl Into<String>, ending: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Self {
            name: name.into(),
            files: vec![(format!("case.{ending}"), bytes.into())],
            options: Vec::new(),
        }
    }

    pub(super) fn with(mut self, options: &[&str]) -> Self {
        self.options.extend(options.iter().map(|o| (*o).to_owned()));
        self
    }

    pub(super) fn beside(mut self, name: &str, bytes: Vec<u8>) -> Self {
        self.files.push((name.into(), bytes));
        self
    }
}

/// Cases of one ending and with the same options.
pub(super) struct Cases {
    pub(super) ending: &'static str,
    pub(super) options: &'static [&'static str],
    pub(super) all: Vec<BadSource>,
}

impl Cases {
    pub(super) fn new(ending: &'static str, options: &'static [&'static str]) -> Self {
        Self {
            ending,
            options,
            all: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, name: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        let case = BadSource::new(name, self.ending, bytes);
        self.all.push(case.with(self.options));
    }

    /// Adds a file cut off at many places, of which `is_wanted` are.
    pub(super) fn cut(&mut self, before: &str, whole: &[u8], is_wanted: impl Fn(usize) -> bool) {
        for cut in cuts(whole.len()).into_iter().filter(|c| is_wanted(*c)) {
            self.add(format!("{before}cut after {cut}"), &whole[..cut]);
        }
    }
}

/// Returns names and texts of a table that has one of each on a line.
pub(super) fn table(lines: &'static str) -> impl Iterator<Item = (&'static str, &'static str)> {
    lines.lines().filter_map(|line| line.split_once(" | "))
}

/// Returns lengths at which a file of `n` bytes is cut off: in its head, and evenly.
pub(super) fn cuts(n: usize) -> Vec<usize> {
    let head = [0, 1, 3, 4, 12, 40, 100, 300, 347, 348, 351, 352, 353];
    let even = (1..16).map(|k| n * k / 16);
    let mut all: Vec<usize> = head.into_iter().chain(even).chain([n - 1]).collect();
    all.retain(|&c| c < n);
    all.sort_unstable();
    all.dedup();
    all
}
