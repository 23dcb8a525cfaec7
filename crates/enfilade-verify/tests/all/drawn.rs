//! Viewers of glTF draw what a world says.

use crate::common;

use common::house;
use enfilade_cpg::wire::{EXTENSION, encode_glb};
use enfilade_verify::check_drawn;
use serde_json::{Value, json};

type Change<'a> = &'a dyn Fn(&mut Value);

/// The file with another JSON chunk.
fn changed(glb: &[u8], change: Change<'_>) -> Vec<u8> {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let n = word(12);
    let mut root: Value = serde_json::from_slice(&glb[20..20 + n]).unwrap();
    change(&mut root);
    let mut text = serde_json::to_vec(&root).unwrap();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = (text.len() as u32).to_le_bytes();
    [&glb[..12], &length, b"JSON", &text, &glb[20 + n..]].concat()
}

#[test]
fn nodes_and_extents_that_lie_are_found() {
    let glb = encode_glb(&house()).unwrap();
    assert_eq!(check_drawn(&glb), [""; 0]);
    assert_eq!(check_drawn(&changed(&glb, &|_| ())), [""; 0]);
    let cell_node = |root: &Value, cell: usize| {
        root["extensions"][EXTENSION]["cells"][cell]["node"]
            .as_u64()
            .unwrap() as usize
    };
    let identity = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    let unmoved = changed(&glb, &|root| root["nodes"][0]["matrix"] = identity.clone());
    assert_eq!(check_drawn(&unmoved), [""; 0]);
    let lies: [(&str, Change<'_>); 8] = [
        ("moves its triangles", &|root| {
            let node = cell_node(root, 1);
            root["nodes"][node]["translation"] = json!([0.0, 0.5, 0.0]);
        }),
        ("moves", &|root| {
            root["nodes"][0]["scale"] = json!([2, 2, 2]);
        }),
        ("not at that of its cell", &|root| {
            let [a, b] = [0, 1].map(|cell| cell_node(root, cell));
            let first = root["nodes"][a]["mesh"].take();
            root["nodes"][a]["mesh"] = root["nodes"][b]["mesh"].take();
            root["nodes"][b]["mesh"] = first;
        }),
        ("0 nodes of the scene", &|root| {
            let node = cell_node(root, 1);
            root["nodes"][node].as_object_mut().unwrap().remove("mesh");
        }),
        ("nodes of the scene", &|root| {
            let again = root["nodes"][cell_node(root, 1)].clone();
            let nodes = root["nodes"].as_array_mut().unwrap();
            nodes.push(again);
            let n = nodes.len() - 1;
            root["nodes"][0]["children"]
                .as_array_mut()
                .unwrap()
                .push(n.into());
        }),
        ("nodes of the scene", &|root| {
            root["scenes"][0]["nodes"] = json!([]);
        }),
        ("smallest and largest", &|root| {
            let accessors = root["accessors"].as_array_mut().unwrap();
            let first = accessors.iter_mut().find(|a| a["max"].is_array());
            first.unwrap()["max"][1] = json!(99.0);
        }),
        ("of no batch", &|root| {
            let mesh = json!({"primitives": [{"attributes": {"POSITION": 0}}]});
            root["meshes"].as_array_mut().unwrap().push(mesh);
            let mesh = root["meshes"].as_array().unwrap().len() - 1;
            let nodes = root["nodes"].as_array_mut().unwrap();
            nodes.push(json!({"mesh": mesh}));
            let n = nodes.len() - 1;
            root["nodes"][0]["children"]
                .as_array_mut()
                .unwrap()
                .push(n.into());
        }),
    ];
    for (words, lie) in lies {
        let found = check_drawn(&changed(&glb, lie));
        assert!(
            found.iter().any(|f| f.contains(words)),
            "{words}: {found:?}"
        );
    }
}
