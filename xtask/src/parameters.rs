//! Parameters: a tuple of unlike things has no names at the call.

use std::collections::BTreeMap;

use crate::lengths::{is_test, without_literals};

/// Returns a line for each parameter in `sources` (path in the repository, text), outside tests, whose type is a tuple of
/// unlike types. Pairs of like things, such as ends, are left alone. O(length of all files).
pub(crate) fn problems(sources: &BTreeMap<String, String>) -> Vec<String> {
    let mut out = Vec::new();
    for (file, text) in sources {
        if is_test(file) {
            continue;
        }
        let end = text.find("\n#[cfg(test)]\nmod ").unwrap_or(text.len());
        let code = without_literals(&text[..end]);
        for (at, _) in code.match_indices("fn ") {
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            if code[..at].ends_with(is_word) {
                continue;
            }
            let rest = &code[at + 3..];
            let name = &rest[..rest.find(|c| !is_word(c)).unwrap_or(rest.len())];
            let packed = parameters(rest).into_iter().find(|p| is_packed(p));
            if let Some(parameter) = packed.filter(|_| !name.is_empty()) {
                let parameter: Vec<&str> = parameter.split_whitespace().collect();
                out.push(format!(
                    "{file}: {name}: `{}` packs unlike things; give each a parameter, or make a type of them",
                    parameter.join(" ")
                ));
            }
        }
    }
    out
}

/// Returns the parameters of the function whose name begins `code`.
fn parameters(code: &str) -> Vec<&str> {
    let open = code.find(['(', '{', ';']).unwrap_or(code.len());
    let Some(inner) = code[open..].strip_prefix('(') else {
        return Vec::new();
    };
    parts(inner)
}

/// Splits a list at commas, up to the bracket that closes it.
fn parts(list: &str) -> Vec<&str> {
    let (mut out, mut start, mut depth) = (Vec::new(), 0, 0_usize);
    let mut before = ' ';
    for (i, c) in list.char_indices() {
        let ends = match c {
            '(' | '[' | '{' | '<' => {
                depth += 1;
                false
            }
            // The arrow of a function's type closes nothing.
            '>' if "-=".contains(before) => false,
            ')' | ']' | '}' | '>' if depth > 0 => {
                depth -= 1;
                false
            }
            ')' | ']' | '}' => true,
            ',' => depth == 0,
            _ => false,
        };
        before = c;
        if ends {
            out.push(list[start..i].trim());
            start = i + 1;
        }
        if ends && c != ',' {
            break;
        }
    }
    out.retain(|part| !part.is_empty());
    out
}

/// Returns `true` for a parameter of the type of a tuple, or of a reference to one, with unlike members.
fn is_packed(parameter: &str) -> bool {
    // The pattern of a parameter may have brackets, but no colon beside those of its fields.
    let Some((_, kind)) = parameter.rsplit_once(": (").or_else(|| {
        let (pattern, kind) = parameter.split_once(": &")?;
        Some((pattern, kind.trim_start_matches("mut ").strip_prefix('(')?))
    }) else {
        return false;
    };
    let members = parts(kind);
    members.iter().any(|m| *m != members[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tuple_of_unlike_things_is_found_and_pairs_of_like_ones_are_not() {
        let text = "
            fn a((cell, at): (CellId, DVec3)) {}
            fn b(best: &mut (f64, usize)) {}
            fn c<T: Fn(u32) -> (u8, u16)>(ends: (u32, u32), f: impl Fn(u8, (u8, u16)), t: [(u8, u16); 2]) {}
            fn d(x: u8, // (a): (u8, u16)
                all: &[(u8, u16)]) {}
            #[cfg(test)]\nmod tests { fn e(x: (u8, u16)) {} }";
        let text = text.replace("            ", "");
        let sources = BTreeMap::from([("a/src/x.rs".to_owned(), text)]);
        let found = problems(&sources);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("a/src/x.rs: a: `(cell, at): (CellId, DVec3)` packs"));
        assert!(found[1].starts_with("a/src/x.rs: b: `best: &mut (f64, usize)` packs"));
    }
}
