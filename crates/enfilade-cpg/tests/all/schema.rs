//! Encoded worlds follow the published JSON schema.
//!
//! The interpreter below supports the keywords that our schema uses and panics on any other. A full schema crate
//! would add some forty crates to the build for this one test.

use crate::common;

use common::{
    nasty_rooms, room_facts, two_rooms, two_rooms_with_parts, two_rooms_with_pvs,
    two_rooms_with_specials,
};
use enfilade_cpg::wire::{EXTENSION, encode_glb};
use enfilade_cpg::{Fact, Reason, World};
use serde_json::{Value, json};

const SCHEMA: &str = include_str!("../../../../docs/schema/ENFILADE_cell_portal_graph.schema.json");

/// Checks `value` against `schema`, a part of `root`; returns the first difference.
fn check(root: &Value, schema: &Value, value: &Value, at: &str) -> Result<(), String> {
    let fail = |why: &str| Err(format!("{at}: {value} {why}"));
    let number = |v: &Value| v.as_f64().expect("a number in the schema");
    let count = |v: &Value| v.as_u64().expect("a count in the schema") as usize;
    for (keyword, rule) in schema.as_object().expect("a schema is an object") {
        match keyword.as_str() {
            "$schema" | "$id" | "$defs" | "title" | "description" => {}
            "$ref" => {
                let pointer = rule
                    .as_str()
                    .and_then(|r| r.strip_prefix('#'))
                    .expect("a local $ref");
                check(
                    root,
                    root.pointer(pointer).expect("$ref leads somewhere"),
                    value,
                    at,
                )?;
            }
            "type" => {
                let is = match rule.as_str().expect("one type") {
                    "object" => value.is_object(),
                    "array" => value.is_array(),
                    "string" => value.is_string(),
                    "number" => value.is_number(),
                    "integer" => value.is_i64() || value.is_u64(),
                    "boolean" => value.is_boolean(),
                    "null" => value.is_null(),
                    other => panic!("type {other}"),
                };
                if !is {
                    return fail(&format!("is not of type {rule}"));
                }
            }
            "const" if value != rule => return fail(&format!("is not {rule}")),
            "enum" if !rule.as_array().unwrap().contains(value) => {
                return fail(&format!("is none of {rule}"));
            }
            "const" | "enum" => {}
            "anyOf" => {
                let mut any = rule.as_array().unwrap().iter();
                if !any.any(|s| check(root, s, value, at).is_ok()) {
                    return fail("fits none");
                }
            }
            "minimum" if value.as_f64().is_some_and(|v| v < number(rule)) => {
                return fail("is too small");
            }
            "maximum" if value.as_f64().is_some_and(|v| v > number(rule)) => {
                return fail("is too large");
            }
            "minItems" if value.as_array().is_some_and(|v| v.len() < count(rule)) => {
                return fail("is too short");
            }
            "maxItems" if value.as_array().is_some_and(|v| v.len() > count(rule)) => {
                return fail("is too long");
            }
            "minimum" | "maximum" | "minItems" | "maxItems" => {}
            "uniqueItems" => {
                let items = value.as_array().map_or(&[][..], |v| v);
                if (0..items.len()).any(|i| items[..i].contains(&items[i])) {
                    return fail("repeats an item");
                }
            }
            "items" => {
                for (i, item) in value.as_array().into_iter().flatten().enumerate() {
                    check(root, rule, item, &format!("{at}/{i}"))?;
                }
            }
            "properties" => {
                for (key, inner) in value.as_object().into_iter().flatten() {
                    if let Some(rule) = rule.get(key) {
                        check(root, rule, inner, &format!("{at}/{key}"))?;
                    }
                }
            }
            "additionalProperties" => {
                let known = schema.get("properties");
                for (key, inner) in value.as_object().into_iter().flatten() {
                    if known.is_some_and(|k| k.get(key).is_some()) {
                        continue;
                    }
                    match rule {
                        Value::Bool(false) => return fail(&format!("has an unknown {key:?}")),
                        rule => check(root, rule, inner, &format!("{at}/{key}"))?,
                    }
                }
            }
            "required" => {
                for key in rule.as_array().unwrap() {
                    if value
                        .as_object()
                        .is_some_and(|v| !v.contains_key(key.as_str().unwrap()))
                    {
                        return fail(&format!("lacks {key}"));
                    }
                }
            }
            "dependentRequired" => {
                for (key, needs) in rule.as_object().unwrap() {
                    let lacks = |n: &Value| value.get(n.as_str().unwrap()).is_none();
                    if value.get(key).is_some() && needs.as_array().unwrap().iter().any(lacks) {
                        return fail(&format!("has {key:?} without {needs}"));
                    }
                }
            }
            other => panic!("the schema uses {other}, which this test does not support"),
        }
    }
    Ok(())
}

/// The extension object of an encoded world.
fn extension(world: &World) -> Value {
    let bytes = encode_glb(world).unwrap();
    let len = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut root: Value = serde_json::from_slice(&bytes[20..20 + len]).unwrap();
    assert!(
        root["extensionsUsed"]
            .as_array()
            .unwrap()
            .contains(&json!(EXTENSION))
    );
    assert_eq!(root.get("extensionsRequired"), None);
    root["extensions"][EXTENSION].take()
}

#[test]
fn encoded_worlds_follow_the_schema() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let leaking = World {
        leak_path: vec![[0.0; 3], [1.0; 3]],
        ..two_rooms()
    };
    let mut measured = two_rooms();
    measured.room_facts = Some(room_facts(&measured));
    let seen = two_rooms_with_pvs();
    let parts = two_rooms_with_parts();
    for world in [
        two_rooms(),
        nasty_rooms(),
        World::default(),
        leaking,
        measured,
        seen,
        parts,
        two_rooms_with_specials(),
    ] {
        assert_eq!(check(&schema, &schema, &extension(&world), ""), Ok(()));
    }
}

#[test]
fn the_schema_names_every_field_that_is_written() {
    // Removing any field, or adding one, is detected unless the schema makes it optional.
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let mut world = World {
        leak_path: vec![[0.0; 3], [1.0; 3]],
        pvs: two_rooms_with_parts().pvs,
        ..two_rooms_with_specials()
    };
    world.graph.cells[0].is_void = true;
    world.room_facts = Some(room_facts(&world));
    let good = extension(&world);
    for (pointer, optional) in [
        (
            "",
            &[
                "portalCorners",
                "specials",
                "specialCorners",
                "sources",
                "sourceRuns",
                "fixtures",
                "leakPath",
                "pvs",
                "rooms",
                "places",
            ][..],
        ),
        ("/cells/0", &["void", "why"]),
        ("/cells/2", &["outdoor", "why"]),
        ("/portals/1", &["fittings", "why"]),
        ("/portals/1/fittings/1", &["slide"]),
        ("/portals/1/fittings/1/slide", &[]),
        ("/portals/0/fittings/0/turn", &[]),
        ("/batches/0", &["sources"]),
        ("/sources/3", &["name", "parent", "extras"]),
        ("/details/1", &["aabb", "source", "partOf"]),
        ("/specials/0", &["name"]),
        ("/specials/1", &[]),
        ("/specials/3/passes/1", &["tint"]),
        ("/specials/4/passes/0", &[]),
        (
            "/specials/5/passes/0",
            &["translation", "rotation", "scale"],
        ),
        ("/specials/2/passes/0", &["translation", "rotation", "back"]),
        ("/locator", &["bounds", "outside", "planes", "nodes"]),
        ("/provenance", &[]),
        ("/rooms/0", &[]),
        ("/pvs", &["parts", "volumes"]),
        ("/pvs/parts", &["runs"]),
        ("/pvs/volumes", &["planes"]),
    ] {
        let keys: Vec<String> = good
            .pointer(pointer)
            .unwrap()
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect();
        for key in keys {
            let mut bad = good.clone();
            bad.pointer_mut(pointer)
                .unwrap()
                .as_object_mut()
                .unwrap()
                .remove(&key);
            let fits = check(&schema, &schema, &bad, "").is_ok();
            assert_eq!(fits, optional.contains(&key.as_str()), "{pointer}/{key}");
        }
        let mut bad = good.clone();
        bad.pointer_mut(pointer).unwrap()["typo"] = json!(1);
        assert!(check(&schema, &schema, &bad, "").is_err(), "{pointer}");
    }
}

/// The names of an enum's variants in files, from the error about a name that it has not.
fn names<T: serde::de::DeserializeOwned + std::fmt::Debug>() -> Vec<String> {
    let error = serde_json::from_str::<T>("\"?\"").unwrap_err().to_string();
    let (_, expected) = error.split_once("expected one of").unwrap();
    let quoted = expected.split('`').skip(1).step_by(2);
    let mut names: Vec<String> = quoted.map(String::from).collect();
    names.sort();
    names
}

#[test]
fn the_schema_names_all_reasons_and_facts() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let why = &schema["$defs"]["why"]["properties"];
    let listed = why["reason"]["enum"].as_array().unwrap();
    let mut reasons: Vec<String> = listed
        .iter()
        .map(|name| name.as_str().unwrap().into())
        .collect();
    reasons.sort();
    assert_eq!(reasons, names::<Reason>());
    let facts = why["facts"]["properties"].as_object().unwrap();
    let mut facts: Vec<String> = facts.keys().cloned().collect();
    facts.sort();
    assert_eq!(facts, names::<Fact>());
}
