//! The picture of a world in glTF viewers, which know nothing of cells: it must be that of the world.

use std::collections::BTreeMap;

use enfilade_cpg::wire::EXTENSION;
use serde_json::Value;

/// Most listed problems.
const LISTED: usize = 10;

/// Checks the file of a world that was decoded: nodes place each triangle once and where it is, those of a cell at the cell's node,
/// objects below nodes without a transform, and nothing else; and the smallest and largest positions that viewers fit their view
/// to are those of the vertices. Returns problems, a line each. Linear in the file.
#[must_use]
pub fn check_drawn(glb: &[u8]) -> Vec<String> {
    let Some((root, data)) = chunks(glb) else {
        return vec!["the file is not a GLB".to_owned()];
    };
    let mut out = Vec::new();
    check_extents(&root, data, &mut out);
    check_nodes(&root, &mut out);
    out.truncate(LISTED);
    out
}

/// Returns the JSON and the binary chunk.
fn chunks(glb: &[u8]) -> Option<(Value, &[u8])> {
    let chunk = |at: usize| {
        let n = glb.get(at..at.checked_add(4)?)?.try_into().ok()?;
        let start = at.checked_add(8)?;
        let end = start.checked_add(u32::from_le_bytes(n) as usize)?;
        Some((glb.get(start..end)?, end))
    };
    let (text, end) = chunk(12)?;
    let root = serde_json::from_slice(text).ok()?;
    Some((root, chunk(end).map_or(&[], |c| c.0)))
}

fn items(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn number(value: &Value) -> Option<usize> {
    usize::try_from(value.as_u64()?).ok()
}

fn check_extents(root: &Value, data: &[u8], out: &mut Vec<String>) {
    const FLOAT: u64 = 5126;
    for (i, accessor) in items(&root["accessors"]).iter().enumerate() {
        let is_positions = accessor["type"] == "VEC3" && accessor["componentType"] == FLOAT;
        let said = ["min", "max"].map(|end| items(&accessor[end]));
        if !is_positions || said.iter().any(|end| end.len() != 3) {
            continue;
        }
        let found = extent(root, accessor, data);
        let is_said = |ends: [[f32; 3]; 2]| {
            said.iter().zip(ends).all(|(said, found)| {
                let said = said.iter().map(|v| v.as_f64().map(|v| v as f32));
                said.eq(found.map(Some))
            })
        };
        if found.is_some_and(|found| !is_said(found)) {
            out.push(format!(
                "accessor {i}: its smallest and largest positions are not those of its vertices"
            ));
        }
    }
}

/// Returns the smallest and largest coordinates of an accessor; `None` if it has none.
fn extent(root: &Value, accessor: &Value, data: &[u8]) -> Option<[[f32; 3]; 2]> {
    const SIZE: usize = 12;
    let view = &root["bufferViews"][number(&accessor["bufferView"])?];
    let offset = |of: &Value| number(&of["byteOffset"]).unwrap_or(0);
    let start = offset(view).checked_add(offset(accessor))?;
    let stride = number(&view["byteStride"]).unwrap_or(SIZE);
    let mut ends: Option<[[f32; 3]; 2]> = None;
    for k in 0..number(&accessor["count"])? {
        let at = k.checked_mul(stride)?.checked_add(start)?;
        let bytes = data.get(at..at.checked_add(SIZE)?)?;
        let (words, _) = bytes.as_chunks::<4>();
        let point = [0, 1, 2].map(|axis| f32::from_le_bytes(words[axis]));
        let [low, high] = ends.get_or_insert([point; 2]);
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    ends
}

/// A node that the scene reaches.
#[derive(Clone, Copy, Default)]
struct Reached {
    n: usize,
    /// No node above it has a transform.
    is_below_still: bool,
}

fn check_nodes(root: &Value, out: &mut Vec<String>) {
    let nodes = items(&root["nodes"]);
    let graph = &root["extensions"][EXTENSION];
    let reached = reached(root, nodes);
    let is_placed = |node: usize| {
        let there = reached.get(node).copied().unwrap_or_default();
        there.n == 1 && there.is_below_still
    };
    // Nodes with a known purpose; the nodes of each mesh.
    let mut known = vec![false; nodes.len()];
    let mut of_mesh: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (i, node) in nodes.iter().enumerate() {
        if let Some(mesh) = number(&node["mesh"]).filter(|_| reached[i].n > 0) {
            of_mesh.entry(mesh).or_default().push(i);
        }
    }
    for (i, batch) in items(&graph["batches"]).iter().enumerate() {
        let Some(mesh) = number(&batch["mesh"]) else {
            continue;
        };
        let places = of_mesh.get(&mesh).map_or(&[][..], Vec::as_slice);
        let &[node] = places else {
            let n = places.len();
            out.push(format!(
                "batch {i}: {n} nodes of the scene place its triangles"
            ));
            continue;
        };
        known[node] = true;
        let own = match items(&batch["cells"]) {
            [cell] => number(cell).and_then(|c| number(&graph["cells"][c]["node"])),
            _ => Some(node),
        };
        if own != Some(node) {
            out.push(format!(
                "batch {i}: its triangles are at node {node}, not at that of its cell"
            ));
        } else if !is_placed(node) || !is_still(&nodes[node]) {
            out.push(format!("batch {i}: node {node} moves its triangles"));
        }
    }
    for (i, detail) in items(&graph["details"]).iter().enumerate() {
        let Some(node) = number(&detail["node"]).filter(|n| *n < nodes.len()) else {
            continue;
        };
        known[node] = true;
        if !is_placed(node) {
            out.push(format!(
                "detail {i}: nodes above node {node} move it, or draw it more or less than once"
            ));
        }
    }
    if let Some(node) = number(&graph["leakPath"]).filter(|n| *n < nodes.len()) {
        known[node] = true;
        if !is_placed(node) || !is_still(&nodes[node]) {
            out.push(format!("the leak path: node {node} moves it"));
        }
    }
    for node in of_mesh.into_values().flatten().filter(|n| !known[*n]) {
        out.push(format!(
            "node {node}: its mesh is of no batch and no detail"
        ));
    }
}

/// Returns how often the scene reaches each node, and what is above it.
fn reached(root: &Value, nodes: &[Value]) -> Vec<Reached> {
    let mut reached = vec![Reached::default(); nodes.len()];
    let scene = number(&root["scene"]).unwrap_or(0);
    let top = items(&root["scenes"][scene]["nodes"]).iter();
    let mut left: Vec<(Option<usize>, bool)> = top.map(|n| (number(n), true)).collect();
    while let Some((node, is_below_still)) = left.pop() {
        let Some(node) = node.filter(|n| *n < nodes.len()) else {
            continue;
        };
        let there = &mut reached[node];
        there.n += 1;
        if there.n == 1 {
            there.is_below_still = is_below_still;
            let is_still = is_below_still && is_still(&nodes[node]);
            let below = items(&nodes[node]["children"]).iter();
            left.extend(below.map(|n| (number(n), is_still)));
        }
    }
    reached
}

/// Returns `true` if a node has no transform.
fn is_still(node: &Value) -> bool {
    const UNIT: [f64; 16] = [
        1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0,
    ];
    let is = |name: &str, expected: &[f64]| {
        let field = &node[name];
        let numbers = items(field).iter().map(Value::as_f64);
        field.is_null() || numbers.eq(expected.iter().copied().map(Some))
    };
    is("matrix", &UNIT)
        && is("translation", &[0.0; 3])
        && is("rotation", &[0.0, 0.0, 0.0, 1.0])
        && is("scale", &[1.0; 3])
}
