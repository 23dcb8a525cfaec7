//! Files of a crate that import each other: neither can be read, moved or tested without the other.
//!
//! Considers paths that begin with `crate`, `super`, `self` or a child module, in `use` and elsewhere. A re-export
//! (`pub use`) is followed to its source, and is not an import. Tests are exempt.

use std::collections::{BTreeMap, BTreeSet};

/// Most re-exports followed for a name.
const MAX_HOPS: usize = 8;

/// Returns a line for each pair in `sources` (path in the repository, text) that imports each other. O(length of all
/// files).
pub(crate) fn problems(sources: &BTreeMap<String, String>) -> Vec<String> {
    let found = pairs(sources).into_iter();
    found
        .map(|(a, b)| format!("{a} and {b} import each other; move what both need to a third file"))
        .collect()
}

/// A source file and its paths.
struct File {
    /// Modules from the crate's root down.
    module: Vec<String>,
    imports: Vec<Vec<String>>,
    /// Re-exported names, and their sources.
    exports: BTreeMap<String, Vec<String>>,
}

/// The file of each module.
type Modules<'a> = BTreeMap<&'a [String], &'a str>;

fn pairs(sources: &BTreeMap<String, String>) -> BTreeSet<(String, String)> {
    let mut crates: BTreeMap<&str, BTreeMap<&str, File>> = BTreeMap::new();
    for (path, text) in sources {
        if let Some((name, file)) = read(path, text) {
            crates.entry(name).or_default().insert(path, file);
        }
    }
    let mut out = BTreeSet::new();
    for files in crates.values() {
        // If a folder holds a library and a program, the root is the program's: it comes last.
        let modules: Modules<'_> = files.iter().map(|(p, f)| (&f.module[..], *p)).collect();
        let mut edges = BTreeSet::new();
        for (&path, file) in files {
            let targets = file.imports.iter();
            let targets =
                targets.filter_map(|i| target(files, &modules, &file.module, i, MAX_HOPS));
            edges.extend(targets.filter(|&t| t != path).map(|t| (path, t)));
        }
        let mutual = edges
            .iter()
            .filter(|&&(a, b)| a < b && edges.contains(&(b, a)));
        out.extend(mutual.map(|&(a, b)| (a.to_owned(), b.to_owned())));
    }
    out
}

/// Returns the crate's name and the file's contents; `None` for tests and files that are not sources of a crate.
fn read<'a>(path: &'a str, text: &str) -> Option<(&'a str, File)> {
    let (name, rest) = path
        .strip_prefix("crates/")
        .unwrap_or(path)
        .split_once("/src/")?;
    let stem = rest.strip_suffix(".rs")?;
    if stem.ends_with("tests") {
        return None;
    }
    let mut module: Vec<String> = stem.split('/').map(str::to_owned).collect();
    if ["lib", "main", "mod"].contains(&module[module.len() - 1].as_str()) {
        module.pop();
    }
    let end = text.find("\n#[cfg(test)]\nmod tests");
    let (mut imports, mut exports) = (Vec::new(), BTreeMap::new());
    let mut lines = text[..end.unwrap_or(text.len())]
        .lines()
        .map(|l| l.split("//").next().unwrap_or_default());
    while let Some(line) = lines.next() {
        let Some((is_public, start)) = used(line) else {
            imports.extend(inline(line));
            continue;
        };
        let mut tree = start.to_owned();
        while !tree.contains(';') {
            let Some(more) = lines.next() else { break };
            tree += more.trim();
        }
        let mut found = Vec::new();
        expand(tree.split(';').next().unwrap_or_default(), &[], &mut found);
        if is_public {
            exports.extend(found.into_iter().map(|(path, name)| (name, path)));
        } else {
            imports.extend(found.into_iter().map(|(path, _)| path));
        }
    }
    Some((
        name,
        File {
            module,
            imports,
            exports,
        },
    ))
}

/// Returns the rest of a line that begins with `use`, and true for a re-export.
fn used(line: &str) -> Option<(bool, &str)> {
    let line = line.trim_start();
    if let Some(tree) = line.strip_prefix("use ") {
        return Some((false, tree));
    }
    let rest = line.strip_prefix("pub")?;
    let rest = match rest.strip_prefix('(') {
        Some(scope) => scope.split_once(')')?.1,
        None => rest,
    };
    Some((true, rest.trim_start().strip_prefix("use ")?))
}

/// Adds the paths of a tree as in `a::{b, c::{self, d as e}}`, each with its new name.
fn expand(tree: &str, before: &[String], out: &mut Vec<(Vec<String>, String)>) {
    let mut path = before.to_vec();
    let (head, list) = match tree.find('{') {
        Some(at) => (&tree[..at], tree[at + 1..].rsplit_once('}').map(|r| r.0)),
        None => (tree, None),
    };
    let (head, alias) = head.split_once(" as ").unwrap_or((head, ""));
    let segments = head.split("::").map(str::trim).filter(|s| !s.is_empty());
    path.extend(segments.map(str::to_owned));
    let Some(list) = list else {
        if path.last().is_some_and(|last| last == "self") && path.len() > 1 {
            path.pop();
        }
        let last = path.last().cloned().unwrap_or_default();
        let name = if alias.is_empty() {
            last
        } else {
            alias.trim().to_owned()
        };
        out.push((path, name));
        return;
    };
    let (mut depth, mut start) = (0_usize, 0);
    for (i, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                expand(&list[start..i], &path, out);
                start = i + 1;
            }
            _ => {}
        }
    }
    if !list[start..].trim().is_empty() {
        expand(&list[start..], &path, out);
    }
}

/// Returns the paths in code that begin with `crate` or `super`.
fn inline(line: &str) -> Vec<Vec<String>> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let starts = ["crate::", "super::"]
        .into_iter()
        .flat_map(|s| line.match_indices(s));
    starts
        .filter(|(at, _)| !line[..*at].ends_with(|c: char| is_word(c) || c == ':'))
        .map(|(at, _)| {
            let rest = &line[at..];
            let end = rest.find(|c: char| !is_word(c) && c != ':');
            let path = rest[..end.unwrap_or(rest.len())].split("::");
            path.filter(|s| !s.is_empty()).map(str::to_owned).collect()
        })
        .collect()
}

/// Returns the file to which a path in `module` leads; `None` for other crates.
fn target<'a>(
    files: &BTreeMap<&'a str, File>,
    modules: &Modules<'a>,
    module: &[String],
    path: &[String],
    n_hops: usize,
) -> Option<&'a str> {
    let mut at = module.to_vec();
    let mut rest = path;
    match path.first()?.as_str() {
        "crate" => {
            at.clear();
            rest = &path[1..];
        }
        "self" => rest = &path[1..],
        "super" => {
            while rest.first().is_some_and(|s| s == "super") {
                at.pop();
                rest = &rest[1..];
            }
        }
        child => {
            at.push(child.to_owned());
            if !modules.contains_key(&at[..]) {
                return None;
            }
            rest = &path[1..];
        }
    }
    let mut file = *modules.get(&at[..])?;
    while let Some(next) = rest.first() {
        at.push(next.clone());
        let Some(inner) = modules.get(&at[..]) else {
            at.pop();
            break;
        };
        (file, rest) = (*inner, &rest[1..]);
    }
    let source = rest.first().and_then(|name| files[file].exports.get(name));
    let followed = source
        .filter(|_| n_hops > 0)
        .and_then(|source| target(files, modules, &at, source, n_hops - 1));
    followed.or(Some(file))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(files: &[(&str, &str)]) -> Vec<(String, String)> {
        let of = |(path, text): &(&str, &str)| (format!("crates/x/src/{path}"), (*text).to_owned());
        pairs(&files.iter().map(of).collect()).into_iter().collect()
    }

    #[test]
    fn files_that_import_each_other_are_found_however_it_is_written() {
        for (a, b) in [
            ("use super::b::{self, T};\n", "use crate::a::f;\n"),
            (
                "use crate::{b::T,\n    c};\n",
                "fn g() {\n    super::a::f();\n}\n",
            ),
            ("use crate::T;\n", "use super::a;\n"),
        ] {
            let lib = "mod a;\nmod b;\npub use b::T;\n";
            let pair = (
                "crates/x/src/a.rs".to_owned(),
                "crates/x/src/b.rs".to_owned(),
            );
            assert_eq!(found(&[("lib.rs", lib), ("a.rs", a), ("b.rs", b)]), [pair]);
        }
    }

    #[test]
    fn one_way_front_doors_and_tests_are_no_pairs() {
        let lib = ("lib.rs", "mod a;\nmod b;\npub use a::f;\n");
        let b = (
            "b.rs",
            "// use crate::a;\nuse std::fmt;\n#[cfg(test)]\nmod tests {\n    use crate::a;\n}\n",
        );
        assert!(found(&[lib, ("a.rs", "use crate::b::T;\n"), b]).is_empty());
        assert!(found(&[lib, ("a.rs", "use crate::T;\n")]).is_empty());
    }

    #[test]
    fn parents_and_children_are_pairs_too() {
        let parent = ("a/mod.rs", "mod c;\nuse c::f;\n");
        let pair = ["crates/x/src/a/c.rs", "crates/x/src/a/mod.rs"].map(str::to_owned);
        assert_eq!(
            found(&[parent, ("a/c.rs", "use super::T;\n")]),
            [pair.into()]
        );
    }
}
