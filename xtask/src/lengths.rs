//! Limits on the length of files and functions, and on blocks within blocks.
//!
//! Test functions are exempt, and files of tests may be longer: a list of cases is read one by one.

use std::collections::BTreeMap;

/// Most lines of a source file.
const MAX_FILE: usize = 600;
/// Most lines of a file of tests.
const MAX_TEST_FILE: usize = 800;
/// Most lines of a function, from `fn` to its closing brace.
const MAX_FUNCTION: usize = 100;
/// Most blocks of a function within each other, its body included.
const MAX_NESTED: usize = 6;

/// Returns a line for each file and function in `sources` (path in the repository, text) that is too long, and each
/// function that is nested too deep. O(length of all files).
pub(crate) fn problems(sources: &BTreeMap<String, String>) -> Vec<String> {
    let line = |((file, function), n): ((&str, &str), usize)| {
        let (place, limit) = match function {
            "" => (file.to_owned(), max_lines(file)),
            _ => (format!("{file}: {function}"), MAX_FUNCTION),
        };
        format!("{place}: {n} lines, more than {limit}; split it by the questions it answers")
    };
    let deep = too_deep(sources).into_iter().map(|(file, name, n)| {
        format!("{file}: {name}: {n} blocks within each other, more than {MAX_NESTED}; name what the inner ones do")
    });
    too_long(sources)
        .into_iter()
        .map(line)
        .chain(deep)
        .collect()
}

/// Lines by file and function; the function is empty if the file itself is too long.
type Lengths<'a> = BTreeMap<(&'a str, &'a str), usize>;

fn too_long(sources: &BTreeMap<String, String>) -> Lengths<'_> {
    let mut out = BTreeMap::new();
    for (file, text) in sources {
        let n = text.lines().count();
        if n > max_lines(file) {
            out.insert((file.as_str(), ""), n);
        }
        if is_test(file) {
            continue;
        }
        for (name, body) in functions(text) {
            let n = body.matches('\n').count() + 1;
            if n > MAX_FUNCTION {
                let longest = out.entry((file.as_str(), name)).or_insert(n);
                *longest = n.max(*longest);
            }
        }
    }
    out
}

/// Returns file, name and depth of functions that are nested too deep.
fn too_deep(sources: &BTreeMap<String, String>) -> Vec<(&str, &str, usize)> {
    let mut out = Vec::new();
    for (file, text) in sources.iter().filter(|(file, _)| !is_test(file)) {
        for (name, body) in functions(text) {
            let (mut depth, mut deepest) = (0_usize, 0);
            for c in body.chars() {
                match c {
                    '{' => depth += 1,
                    '}' => depth = depth.saturating_sub(1),
                    _ => {}
                }
                deepest = deepest.max(depth);
            }
            if deepest > MAX_NESTED {
                out.push((file.as_str(), name, deepest));
            }
        }
    }
    out
}

fn max_lines(file: &str) -> usize {
    if is_test(file) {
        MAX_TEST_FILE
    } else {
        MAX_FILE
    }
}

pub(crate) fn is_test(file: &str) -> bool {
    file.contains("/tests/") || file.ends_with("tests.rs")
}

/// Returns the names of functions with bodies, and their code from `fn` to the closing brace. Unit tests, which stand
/// at the end of a file, are left out.
fn functions(text: &str) -> Vec<(&str, String)> {
    let end = text.find("\n#[cfg(test)]\nmod tests {");
    let code = without_literals(&text[..end.unwrap_or(text.len())]);
    let mut out = Vec::new();
    for (at, _) in code.match_indices("fn ") {
        if code[..at].ends_with(is_word) {
            continue;
        }
        let name = &text[at + 3..];
        let name = &name[..name.find(|c| !is_word(c)).unwrap_or(name.len())];
        // The type of a function pointer and a macro's variable have no name here, a trait's declaration no body.
        if let Some(end) = body_end(&code[at..]).filter(|_| !name.is_empty()) {
            out.push((name, code[at..=at + end].to_owned()));
        }
    }
    out
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Returns the end of the body of the function at the start of `code`; `None` if a semicolon comes first.
fn body_end(code: &str) -> Option<usize> {
    // Braces within brackets of the signature, as in `[u8; { N }]`, do not start the body.
    let mut depth = 0_usize;
    let mut is_body = false;
    for (i, c) in code.char_indices() {
        match c {
            '{' if depth == 0 => (is_body, depth) = (true, 1),
            '{' | '(' | '[' => depth += 1,
            '}' | ')' | ']' => depth = depth.checked_sub(1)?,
            ';' if depth == 0 => return None,
            _ => {}
        }
        if is_body && depth == 0 {
            return Some(i);
        }
    }
    None
}

/// Returns the text with comments, strings and characters blanked, byte for byte; line breaks stay.
pub(crate) fn without_literals(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let is_in_word = out.ends_with(is_word);
        let n = literal(rest, is_in_word).unwrap_or(0);
        if n == 0 {
            out.push(c);
            rest = &rest[c.len_utf8()..];
        } else {
            let blank = |b: u8| if b == b'\n' { '\n' } else { ' ' };
            out.extend(rest.bytes().take(n).map(blank));
            rest = &rest[n..];
        }
    }
    out
}

/// Returns the length of the comment, string or character at the start of `rest`, in bytes; `None` if there is none.
fn literal(rest: &str, is_in_word: bool) -> Option<usize> {
    let to = |end: Option<usize>| Some(end.unwrap_or(rest.len()));
    if rest.starts_with("//") {
        return to(rest.find('\n'));
    }
    if rest.starts_with("/*") {
        return to(block_comment(rest));
    }
    if rest.starts_with('"') {
        return to(quoted(rest, '"'));
    }
    if let Some(inner) = rest.strip_prefix('\'') {
        // A character literal holds one character or an escape; a lifetime has no second quote there.
        let mut inner = inner.chars();
        let first = inner.next()?;
        let is_char = first == '\\' || inner.next() == Some('\'');
        return if is_char {
            to(quoted(rest, '\''))
        } else {
            None
        };
    }
    if is_in_word {
        return None;
    }
    let raw = rest.strip_prefix("br").or_else(|| rest.strip_prefix('r'))?;
    let hashes = &raw[..raw.len() - raw.trim_start_matches('#').len()];
    let inner = raw[hashes.len()..].strip_prefix('"')?;
    let close = format!("\"{hashes}");
    let end = inner.find(&close).map(|at| at + close.len());
    to(end.map(|end| rest.len() - inner.len() + end))
}

/// Returns the end of a comment that may contain others.
fn block_comment(rest: &str) -> Option<usize> {
    let (mut depth, mut at) = (0_usize, 0);
    loop {
        let tail = rest.get(at..)?;
        let open = tail.find("/*").unwrap_or(usize::MAX);
        let close = tail.find("*/")?;
        depth = if open < close { depth + 1 } else { depth - 1 };
        at += open.min(close) + 2;
        if depth == 0 {
            return Some(at);
        }
    }
}

/// Returns the end of a literal that begins and ends with `quote`, and may contain escaped quotes.
fn quoted(rest: &str, quote: char) -> Option<usize> {
    let mut is_escaped = false;
    for (i, c) in rest.char_indices().skip(1) {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            _ if c == quote => return Some(i + 1),
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources(files: &[(&str, String)]) -> BTreeMap<String, String> {
        let owned = |(path, text): &(&str, String)| ((*path).to_owned(), text.clone());
        files.iter().map(owned).collect()
    }

    fn function(name: &str, n_lines: usize) -> String {
        format!("fn {name}() {{{}}}\n", "\n".repeat(n_lines - 1))
    }

    #[test]
    fn a_file_that_is_too_long_is_found_and_tests_may_be_longer() {
        let found = |path, n| {
            let sources = sources(&[(path, "\n".repeat(n))]);
            too_long(&sources).get(&(path, "")).copied()
        };
        assert_eq!(found("crates/x/src/a.rs", MAX_FILE), None);
        assert_eq!(found("crates/x/src/a.rs", MAX_FILE + 1), Some(MAX_FILE + 1));
        for path in ["crates/x/src/a/tests.rs", "crates/x/tests/b.rs"] {
            assert_eq!(found(path, MAX_TEST_FILE), None);
            assert!(found(path, MAX_TEST_FILE + 1).is_some());
        }
    }

    #[test]
    fn a_function_that_is_too_long_is_found_outside_tests() {
        let long = function("long", MAX_FUNCTION + 1);
        let files = sources(&[
            ("a.rs", function("short", MAX_FUNCTION) + &long),
            ("b.rs", format!("\n#[cfg(test)]\nmod tests {{\n{long}}}\n")),
            ("c/tests.rs", long.clone()),
        ]);
        let found: Vec<_> = too_long(&files).into_iter().collect();
        assert_eq!(found, [(("a.rs", "long"), MAX_FUNCTION + 1)]);
    }

    #[test]
    fn braces_that_are_no_code_do_not_end_a_function() {
        let body = [
            "    // }",
            "    /* } /* } */ } */",
            "    let s = \"}\\\"}\";",
            "    let r = (r\"}\\\", br##\"}\"#}\"##, b'}');",
            "    let c: &'static [char] = &['}', '\\'', '{'];",
            "    'outer: loop {}",
            "    fn inner() {}",
            "}",
        ];
        let text = format!(
            "pub const fn f<'a>(n: [u8; {{ 3 }}]) -> u8 {{\n{}\n",
            body.join("\n")
        );
        let lengths = functions(&text)
            .into_iter()
            .map(|(name, code)| (name, code.lines().count()));
        assert!(lengths.eq([("f", 9), ("inner", 1)]));
    }

    #[test]
    fn what_has_no_body_is_no_function() {
        let text = "trait T {\n    fn declared(&self) -> [u8; 3];\n}\ntype F = fn (u8);\n\
                    // fn said() {}\nstatic S: &str = \"fn quoted() {}\";\nstruct Gfn {}\n";
        assert!(functions(text).is_empty());
    }

    #[test]
    fn a_function_that_is_nested_too_deep_is_found_outside_tests() {
        let nested = |n: usize| {
            format!(
                "fn f(_: [u8; {{ 1 }}]) {}\n",
                "{".repeat(n) + &"}".repeat(n)
            )
        };
        let tests = format!("\n#[cfg(test)]\nmod tests {{\n{}}}\n", nested(9));
        let files = sources(&[
            ("a.rs", nested(MAX_NESTED) + &tests),
            ("b.rs", nested(MAX_NESTED + 1)),
            ("c/tests.rs", nested(9)),
        ]);
        assert_eq!(too_deep(&files), [("b.rs", "f", MAX_NESTED + 1)]);
        let said = problems(&files);
        assert!(said[0].starts_with("b.rs: f: 7 blocks within each other, more than 6;"));
    }

    #[test]
    fn an_offender_is_named_with_its_length_and_the_limit() {
        let files = sources(&[("b.rs", function("f", MAX_FUNCTION + 1))]);
        assert_eq!(
            problems(&files),
            ["b.rs: f: 101 lines, more than 100; split it by the questions it answers"]
        );
    }
}
