//! Tables printed row by row, since a row may take minutes.

use std::io::{self, Write};

use serde_json::{Map, Value};

/// Receives the lines of Markdown tables and the text between them, and prints each at once: as it is, or as JSON.
#[derive(Default)]
pub(crate) struct Table {
    /// Names of the columns; empty between tables.
    columns: Vec<String>,
    is_json: bool,
    /// The first error.
    problem: Option<io::Error>,
}

impl Table {
    /// Returns a table that prints Markdown, or a JSON object for each row and for each line outside tables (`note`).
    pub(crate) fn new(is_json: bool) -> Self {
        Self {
            is_json,
            ..Self::default()
        }
    }

    /// Prints a line.
    pub(crate) fn push(&mut self, line: impl Into<String>) {
        let line = line.into();
        let line = if self.is_json {
            self.as_json(&line)
        } else {
            Some(line)
        };
        if let (Some(mut line), None) = (line, &self.problem) {
            line.push('\n');
            let mut out = io::stdout().lock();
            let printed = out.write_all(line.as_bytes()).and_then(|()| out.flush());
            self.problem = printed.err();
        }
    }

    /// Prints lines.
    pub(crate) fn push_text(&mut self, text: &str) {
        text.lines().for_each(|line| self.push(line));
    }

    /// # Errors
    ///
    /// The first failure to print.
    pub(crate) fn finish(self) -> anyhow::Result<()> {
        self.problem.map_or(Ok(()), |problem| Err(problem.into()))
    }

    /// Returns a row as an object with the column names as keys, numbers as numbers; nothing for lines of pure form.
    fn as_json(&mut self, line: &str) -> Option<String> {
        let Some(row) = line.strip_prefix("| ").and_then(|l| l.strip_suffix(" |")) else {
            self.columns.clear();
            return (!line.is_empty()).then(|| serde_json::json!({"note": line}).to_string());
        };
        let cells: Vec<&str> = row.split(" | ").map(str::trim).collect();
        if self.columns.is_empty() {
            self.columns = distinct(&cells);
            return None;
        }
        if cells[0].starts_with("---") || cells[0].starts_with(":--") {
            return None;
        }
        let value = |text: &str| {
            text.parse()
                .map_or_else(|_| Value::from(text), |x: f64| Value::from(x))
        };
        let pairs = self.columns.iter().cloned().zip(cells);
        let row: Map<String, Value> = pairs.map(|(name, text)| (name, value(text))).collect();
        Some(Value::from(row).to_string())
    }
}

/// Returns distinct names of columns; a repeated name is qualified by the column before it.
fn distinct(names: &[&str]) -> Vec<String> {
    let name = |i: usize| {
        if i > 0 && names[..i].contains(&names[i]) {
            format!("{}, {}", names[i - 1], names[i])
        } else {
            names[i].to_owned()
        }
    };
    (0..names.len()).map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_objects_by_the_names_of_columns() {
        let mut table = Table::new(true);
        assert_eq!(
            table.as_json("| scene | cells | fewer | portals | fewer |"),
            None
        );
        assert_eq!(table.as_json("| --- | ---: | ---: | ---: | ---: |"), None);
        assert_eq!(
            table.as_json("| a hall | 12 | 9.5 % | 3 | - |").unwrap(),
            r#"{"cells":12.0,"fewer":"9.5 %","portals":3.0,"portals, fewer":"-","scene":"a hall"}"#
        );
        assert_eq!(
            table.as_json("that was all").unwrap(),
            r#"{"note":"that was all"}"#
        );
        assert_eq!(table.as_json(""), None);
        // Another table begins.
        assert_eq!(table.as_json("| scene |"), None);
    }
}
