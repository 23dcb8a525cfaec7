//! The input's object from which each triangle comes.

/// The source of each triangle of a list, as runs of triangles with one source.
///
/// Triangles of one object are mostly consecutive, so this is far shorter than one number per triangle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceRuns {
    /// Index into [`World::sources`](crate::World::sources), and number of triangles, at least one.
    runs: Vec<[u32; 2]>,
}

impl SourceRuns {
    /// Takes runs as they are, e.g. from a file; [`World::validate`](crate::World::validate) checks them.
    #[must_use]
    #[doc(hidden)]
    pub fn from_runs(runs: Vec<[u32; 2]>) -> Self {
        Self { runs }
    }

    /// Returns source and number of triangles of each run, in the order of the triangles.
    #[must_use]
    pub fn runs(&self) -> &[[u32; 2]] {
        &self.runs
    }

    /// Returns `true` if no triangle has a source.
    #[must_use]
    #[doc(hidden)]
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Appends `n` triangles from `source`.
    pub fn push(&mut self, source: u32, n: u32) {
        match self.runs.last_mut() {
            _ if n == 0 => {}
            Some([last, count]) if *last == source => *count += n,
            _ => self.runs.push([source, n]),
        }
    }

    /// Appends the runs of further triangles.
    #[doc(hidden)]
    pub fn extend(&mut self, other: &Self) {
        for &[source, n] in &other.runs {
            self.push(source, n);
        }
    }

    /// Returns these runs if they cover all of `n_triangles`, and no runs otherwise.
    #[must_use]
    #[doc(hidden)]
    pub fn of_all(self, n_triangles: usize) -> Self {
        let n: u64 = self.runs.iter().map(|r| u64::from(r[1])).sum();
        if n == n_triangles as u64 {
            self
        } else {
            Self::default()
        }
    }

    /// Returns the source of each triangle, in order.
    pub fn of_triangles(&self) -> impl Iterator<Item = u32> {
        let run = |&[source, n]: &[u32; 2]| std::iter::repeat_n(source, n as usize);
        self.runs.iter().flat_map(run)
    }

    /// Returns the source of one triangle. O(runs).
    #[must_use]
    pub fn of(&self, triangle: u32) -> Option<u32> {
        let mut end = 0_u64;
        let holds = |&&[_, n]: &&[u32; 2]| {
            end += u64::from(n);
            u64::from(triangle) < end
        };
        self.runs.iter().find(holds).map(|&[source, _]| source)
    }

    /// Returns a problem of these runs as the sources of `n_triangles`, if any.
    pub(crate) fn problem(&self, n_triangles: usize, n_sources: usize) -> Option<String> {
        if let Some([source, _]) = self.runs.iter().find(|r| r[0] as usize >= n_sources) {
            return Some(format!(
                "refers to source {source}, but there are {n_sources}"
            ));
        }
        if self.runs.iter().any(|r| r[1] == 0) {
            return Some("a run of sources is empty".into());
        }
        let n: u64 = self.runs.iter().map(|r| u64::from(r[1])).sum();
        (n != 0 && n != n_triangles as u64)
            .then(|| format!("has sources for {n} triangles, but {n_triangles} triangles"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_triangle_finds_its_source() {
        let mut sources = SourceRuns::default();
        for (source, n) in [(3, 2), (3, 1), (0, 0), (1, 2)] {
            sources.push(source, n);
        }
        assert_eq!(sources.runs(), [[3, 3], [1, 2]]);
        let all: Vec<u32> = sources.of_triangles().collect();
        assert_eq!(all, [3, 3, 3, 1, 1]);
        let one_by_one: Vec<_> = (0..6).map(|t| sources.of(t)).collect();
        assert_eq!(
            one_by_one,
            [Some(3), Some(3), Some(3), Some(1), Some(1), None]
        );
    }

    #[test]
    fn where_some_triangles_have_no_source_none_has() {
        let runs = SourceRuns::from_runs(vec![[0, 2], [7, 1]]);
        assert_eq!(runs.clone().of_all(3), runs);
        assert!(runs.of_all(4).is_empty());
    }

    #[test]
    fn runs_that_fit_no_triangles_are_found() {
        let problem = |runs: &[[u32; 2]]| SourceRuns::from_runs(runs.to_vec()).problem(5, 2);
        assert_eq!(problem(&[]), None);
        assert_eq!(problem(&[[1, 2], [0, 3]]), None);
        assert!(problem(&[[1, 2]]).is_some());
        assert!(problem(&[[2, 5]]).is_some());
        assert!(problem(&[[1, 5], [0, 0]]).is_some());
        assert!(problem(&[[1, u32::MAX], [0, 6]]).is_some());
    }
}
