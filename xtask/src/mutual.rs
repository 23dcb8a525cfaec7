//! Circles of imports among the files and folders of a crate: no member can be read, moved or tested without the others.
//!
//! Considers paths that begin with `crate`, `super`, `self` or a child module, in `use` and elsewhere. A re-export
//! (`pub use`) is followed to its source, and is not an import. Tests are exempt. A folder imports all that its files
//! import, and belongs together with the file of the same name; so circles of files are among those of folders.

use std::collections::{BTreeMap, BTreeSet};

/// Most re-exports followed for a name.
const MAX_HOPS: usize = 8;

/// Returns a line for each circle in `sources` (path in the repository, text). About O(length of all files).
pub(crate) fn problems(sources: &BTreeMap<String, String>) -> Vec<String> {
    let found = circles(sources).into_iter();
    found
        .map(|imports| format!("{} form a circle; move what they share", imports.join(", ")))
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

/// Imports between the entries of a folder, each with two files that show it. The empty entry is the folder's own file.
type Graph<'a> = BTreeMap<[&'a str; 2], [&'a str; 2]>;

/// Returns the imports within each circle, as `file → file`.
fn circles(sources: &BTreeMap<String, String>) -> Vec<Vec<String>> {
    let mut crates: BTreeMap<&str, BTreeMap<&str, File>> = BTreeMap::new();
    for (path, text) in sources {
        if let Some((name, file)) = read(path, text) {
            crates.entry(name).or_default().insert(path, file);
        }
    }
    let mut out = Vec::new();
    for files in crates.values() {
        // If a folder holds a library and a program, the root is the program's: it comes last.
        let modules: Modules<'_> = files.iter().map(|(p, f)| (&f.module[..], *p)).collect();
        let mut folders: BTreeMap<&[String], Graph<'_>> = BTreeMap::new();
        for (&path, file) in files {
            let from = &file.module;
            for import in &file.imports {
                let Some(to) = target(files, &modules, from, import, MAX_HOPS) else {
                    continue;
                };
                let modules = [from, &files[to].module];
                let n = from
                    .iter()
                    .zip(modules[1])
                    .take_while(|(a, b)| a == b)
                    .count();
                let entries = modules.map(|m| m.get(n).map_or("", String::as_str));
                if entries[0] != entries[1] {
                    let graph = folders.entry(&from[..n]).or_default();
                    graph.entry(entries).or_insert([path, to]);
                }
            }
        }
        out.extend(folders.values().flat_map(circles_of));
    }
    out
}

/// Returns the imports within each strongly connected component of more than one entry.
fn circles_of(graph: &Graph<'_>) -> Vec<Vec<String>> {
    let reached_from = |from| {
        let (mut reached, mut stack) = (BTreeSet::new(), vec![from]);
        while let Some(at) = stack.pop() {
            let next = graph.range([at, ""]..).take_while(|(k, _)| k[0] == at);
            stack.extend(next.map(|(k, _)| k[1]).filter(|&to| reached.insert(to)));
        }
        reached
    };
    let entries: BTreeSet<&str> = graph.keys().map(|k| k[0]).collect();
    let reached: BTreeMap<_, _> = entries.into_iter().map(|e| (e, reached_from(e))).collect();
    let leads = |from: &str, to: &str| reached.get(from).is_some_and(|r| r.contains(to));
    // An import lies on a circle if its end leads back to its start. The first member stands for all.
    let mut by_circle: BTreeMap<_, Vec<String>> = BTreeMap::new();
    for ([a, b], files) in graph.iter().filter(|([a, b], _)| leads(b, a)) {
        let first = reached[a].iter().find(|m| leads(m, b));
        by_circle.entry(first).or_default().push(files.join(" → "));
    }
    by_circle.into_values().collect()
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

    fn found(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let of = |(path, text): &(&str, &str)| (format!("crates/x/src/{path}"), (*text).to_owned());
        let mut found = circles(&files.iter().map(of).collect());
        let strings = found.iter_mut().flatten();
        strings.for_each(|i| *i = i.replace("crates/x/src/", ""));
        found
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
            assert_eq!(
                found(&[("lib.rs", lib), ("a.rs", a), ("b.rs", b)]),
                [["a.rs → b.rs", "b.rs → a.rs"]]
            );
        }
    }

    #[test]
    fn one_way_front_doors_and_tests_are_no_circles() {
        let lib = ("lib.rs", "mod a;\nmod b;\npub use a::f;\n");
        let b = (
            "b.rs",
            "// use crate::a;\nuse std::fmt;\n#[cfg(test)]\nmod tests {\n    use crate::a;\n}\n",
        );
        assert!(found(&[lib, ("a.rs", "use crate::b::T;\n"), b]).is_empty());
        assert!(found(&[lib, ("a.rs", "use crate::T;\n")]).is_empty());
    }

    #[test]
    fn parents_and_children_are_circles_too() {
        let parent = ("a/mod.rs", "mod c;\nuse c::f;\n");
        assert_eq!(
            found(&[parent, ("a/c.rs", "use super::T;\n")]),
            [["a/mod.rs → a/c.rs", "a/c.rs → a/mod.rs"]]
        );
    }

    #[test]
    fn longer_circles_are_found_and_what_only_leads_there_is_not_in_them() {
        let files = [
            ("lib.rs", ""),
            ("a.rs", "use crate::b::T;\n"),
            ("b.rs", "use crate::c::T;\nuse crate::e::T;\n"),
            ("c.rs", "use crate::a::T;\n"),
            ("d.rs", "use crate::a::T;\n"),
            ("e.rs", ""),
        ];
        let circle = ["a.rs → b.rs", "b.rs → c.rs", "c.rs → a.rs"];
        assert_eq!(found(&files), [circle]);
        assert!(found(&files[..3]).is_empty());
    }

    #[test]
    fn folders_form_circles_even_if_their_files_do_not() {
        let files = [
            ("lib.rs", ""),
            ("a/mod.rs", ""),
            ("a/p.rs", "use crate::b::T;\n"),
            ("a/q.rs", ""),
            ("b.rs", "mod r;\n"),
            ("b/r.rs", "use crate::a::q::T;\n"),
        ];
        assert_eq!(found(&files), [["a/p.rs → b.rs", "b/r.rs → a/q.rs"]]);
        assert!(found(&files[..5]).is_empty());
    }
}
