//! All that is reached from the façade.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use anyhow::Context;
use serde_json::Value;

use super::signature::{Writer, each};

/// Traits that are listed with each type that has them; their loss breaks users.
const TRAITS: [&str; 17] = [
    "Clone",
    "Copy",
    "Debug",
    "Default",
    "Deref",
    "Display",
    "Drop",
    "Eq",
    "Error",
    "From",
    "Hash",
    "Index",
    "IntoIterator",
    "Iterator",
    "Ord",
    "PartialEq",
    "PartialOrd",
];

/// An item of one of our crates.
type Key<'a> = (&'a str, u64);

/// The documentation of our crates.
pub(super) struct Docs {
    crates: BTreeMap<String, Value>,
    /// Number of each item by crate and path in it.
    by_path: BTreeMap<(String, String), u64>,
}

/// One walk.
struct Walk<'a> {
    docs: &'a Docs,
    /// Path of each item of ours that has a name in the façade.
    names: BTreeMap<Key<'a>, String>,
    lines: BTreeSet<String>,
    faults: RefCell<BTreeSet<String>>,
}

impl Docs {
    pub(super) fn new(crates: BTreeMap<String, Value>) -> Self {
        let mut by_path = BTreeMap::new();
        for (name, json) in &crates {
            for (id, entry) in json["paths"].as_object().into_iter().flatten() {
                if entry["crate_id"] == 0
                    && let Ok(id) = id.parse()
                {
                    by_path.insert((name.clone(), path_of(entry)), id);
                }
            }
        }
        Self { crates, by_path }
    }

    /// Returns the lines of a crate, and its faults: types without `Debug`, and types that are reached but not named.
    pub(super) fn surface(&self, name: &str) -> anyhow::Result<(Vec<String>, Vec<String>)> {
        let (name, json) = self.crates.get_key_value(name).context("no such crate")?;
        let root = json["root"].as_u64().context("no root")?;
        let mut walk = Walk {
            docs: self,
            names: BTreeMap::new(),
            lines: BTreeSet::new(),
            faults: RefCell::default(),
        };
        walk.name(vec![((name, root), String::new())]);
        for (key, path) in walk.names.clone() {
            walk.describe(key, &path);
        }
        let faults = walk.faults.into_inner().into_iter().collect();
        Ok((walk.lines.into_iter().collect(), faults))
    }

    fn item(&self, (name, id): Key<'_>) -> &Value {
        &self.crates[name]["index"][id.to_string()]
    }

    /// Returns the item with a number in a crate, which may be an item of another one; `None` if it is not ours.
    fn resolve<'a>(&'a self, name: &'a str, id: &Value) -> Option<Key<'a>> {
        let id = id.as_u64()?;
        let json = &self.crates[name];
        if json["index"].get(id.to_string()).is_some() {
            return Some((name, id));
        }
        let path = path_of(&json["paths"][id.to_string()]);
        let name = path.split("::").next()?.to_owned();
        let id = *self.by_path.get(&(name.clone(), path))?;
        let (name, _) = self.crates.get_key_value(&name)?;
        Some((name, id))
    }
}

/// Returns the kind and the content of an item.
fn inner(item: &Value) -> (&str, &Value) {
    let kinds = item["inner"]
        .as_object()
        .and_then(|kinds| kinds.iter().next());
    kinds.map_or(("", &Value::Null), |(kind, it)| (kind, it))
}

/// Returns the path of an entry, with its kind, because a module and a function may share a name.
fn path_of(entry: &Value) -> String {
    let parts: Vec<&str> = each(&entry["path"]).filter_map(Value::as_str).collect();
    format!(
        "{} {}",
        parts.join("::"),
        entry["kind"].as_str().unwrap_or_default()
    )
}

impl<'a> Walk<'a> {
    /// Names all items of modules, level by level, so that a type that has several paths gets the shortest.
    fn name(&mut self, mut level: Vec<(Key<'a>, String)>) {
        while !level.is_empty() {
            let mut below = Vec::new();
            for (module, path) in level {
                let items = self.docs.item(module).pointer("/inner/module/items");
                for id in items.into_iter().flat_map(each) {
                    let (mut key, mut path) =
                        ((module.0, id.as_u64().unwrap_or_default()), path.clone());
                    let mut item = self.docs.item(key);
                    let used = inner(item);
                    let mut name = item["name"].as_str();
                    if used.0 == "use" {
                        name = used.1["name"].as_str();
                        let Some(target) = self.docs.resolve(key.0, &used.1["id"]) else {
                            let source = used.1["source"].as_str().unwrap_or_default();
                            self.lines.insert(format!(
                                "{path}{}: use {source}",
                                name.unwrap_or_default()
                            ));
                            continue;
                        };
                        key = target;
                        item = self.docs.item(key);
                    }
                    path += name.unwrap_or_default();
                    match (inner(item).0, self.names.get(&key)) {
                        (_, Some(first)) => {
                            self.lines.insert(format!("{path}: use {first}"));
                        }
                        ("module", _) => below.push((key, path + "::")),
                        _ => {
                            self.names.insert(key, path);
                        }
                    }
                }
            }
            level = below;
        }
    }

    fn line(&mut self, path: &str, text: &str) {
        self.lines.insert(format!("{path}: {text}"));
    }

    /// Adds the lines of an item and of its members.
    fn describe(&mut self, key: Key<'a>, path: &str) {
        let docs = self.docs;
        let item = docs.item(key);
        let (kind, it) = inner(item);
        let name = |id: &Value, written: &str| match docs.resolve(key.0, id) {
            Some(key) => self.names.get(&key).cloned().unwrap_or_else(|| {
                let fault =
                    format!("{written} is reached by {path}, but has no name in the façade");
                self.faults.borrow_mut().insert(fault);
                written.to_owned()
            }),
            None => written.rsplit("::").next().unwrap_or(written).to_owned(),
        };
        let writer = Writer { name: &name };
        let growing = match item["attrs"].to_string().contains("non_exhaustive") {
            true => ", non_exhaustive",
            false => "",
        };
        let (text, members) = match kind {
            "struct" | "enum" | "union" => {
                let traits = self.traits(key, it);
                if !traits.contains(&"Debug".to_owned()) {
                    self.faults
                        .borrow_mut()
                        .insert(format!("{path} has no Debug"));
                }
                let generics = writer.generics(&it["generics"]);
                let text = format!("{kind}{generics}{growing}: {}", traits.join(" + "));
                let text = text.trim_end_matches(": ").to_owned();
                (text, self.members(key, it))
            }
            "variant" => (format!("variant{growing}"), members_of(&it["kind"])),
            "trait" => (
                format!(
                    "trait{}: {}",
                    writer.generics(&it["generics"]),
                    writer.bounds(&it["bounds"])
                ),
                each(&it["items"]).collect(),
            ),
            "function" => (writer.function(it), Vec::new()),
            "struct_field" => (writer.ty(it), Vec::new()),
            "type_alias" => (format!("type = {}", writer.ty(&it["type"])), Vec::new()),
            "constant" => (format!("const {}", writer.ty(&it["type"])), Vec::new()),
            "assoc_const" => (format!("const {}", writer.ty(&it["type"])), Vec::new()),
            "assoc_type" => (format!("type {}", writer.ty(&it["type"])), Vec::new()),
            _ => (kind.to_owned(), Vec::new()),
        };
        self.line(path, &text);
        for id in members.iter().filter_map(|id| id.as_u64()) {
            let key = (key.0, id);
            let name = docs.item(key)["name"].as_str().unwrap_or_default();
            self.describe(key, &format!("{path}::{name}"));
        }
    }

    /// Returns public fields, variants, and what inherent implementations hold.
    fn members(&self, key: Key<'a>, it: &'a Value) -> Vec<&'a Value> {
        let mut out = members_of(&it["kind"]);
        out.extend(each(&it["variants"]));
        for id in each(&it["impls"]).filter_map(Value::as_u64) {
            let (_, block) = inner(self.docs.item((key.0, id)));
            if block["trait"].is_null() {
                out.extend(each(&block["items"]));
            }
        }
        out
    }

    /// Returns the traits of a type, and those of threads that it lacks.
    fn traits(&self, key: Key<'a>, it: &Value) -> Vec<String> {
        let mut out = BTreeSet::new();
        for id in each(&it["impls"]).filter_map(Value::as_u64) {
            let (_, block) = inner(self.docs.item((key.0, id)));
            let name = block["trait"]["path"].as_str().unwrap_or_default();
            let name = name.rsplit("::").next().unwrap_or_default();
            if ["Send", "Sync"].contains(&name) && block["is_negative"] == true {
                out.insert(format!("!{name}"));
            } else if block["blanket_impl"].is_null() && TRAITS.contains(&name) {
                out.insert(name.to_owned());
            }
        }
        out.into_iter().collect()
    }
}

/// Returns the fields of a struct or a variant.
fn members_of(kind: &Value) -> Vec<&Value> {
    let fields = ["/plain/fields", "/struct/fields", "/tuple"];
    let found = fields.iter().filter_map(|at| kind.pointer(at));
    found.flat_map(each).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn ty(name: &str, id: u64) -> Value {
        json!({"resolved_path": {"path": name, "id": id}})
    }

    #[test]
    fn names_are_those_of_the_facade_and_what_has_none_is_a_fault() {
        let used = |name: &str, id: u64| json!({"inner": {"use": {"source": format!("inner::{name}"), "name": name, "id": id}}});
        let path = |name: &str, kind: &str, of: u64| json!({"crate_id": of, "path": ["inner", name], "kind": kind});
        let sig = json!({"inputs": [["t", {"borrowed_ref": {"type": ty("crate::T", 3)}}]], "output": ty("U", 5)});
        let unit =
            |name: &str| json!({"name": name, "inner": {"struct": {"kind": "unit", "impls": []}}});
        let crates = [
            (
                "facade",
                json!({"root": 0, "index": {
                    "0": {"inner": {"module": {"items": [1, 2, 3]}}}, "1": used("T", 10), "2": used("f", 11), "3": used("T", 10),
                }, "paths": {"10": path("T", "struct", 1), "11": path("f", "function", 1)}}),
            ),
            (
                "inner",
                json!({"root": 0, "index": {
                    "3": unit("T"), "4": {"name": "f", "inner": {"function": {"sig": sig}}}, "5": unit("U"),
                }, "paths": {
                    "3": path("T", "struct", 0), "4": path("f", "function", 0), "5": path("U", "struct", 0),
                }}),
            ),
        ];
        let crates = crates.map(|(name, json)| (name.to_owned(), json));
        let (lines, faults) = Docs::new(crates.into()).surface("facade").unwrap();
        assert_eq!(lines, ["T: struct", "T: use T", "f: fn(t: &T) -> U"]);
        let unnamed = "U is reached by f, but has no name in the façade";
        assert_eq!(faults, ["T has no Debug", unnamed]);
    }
}
