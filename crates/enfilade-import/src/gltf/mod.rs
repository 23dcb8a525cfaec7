//! glTF 2.0 and GLB (Khronos, *glTF 2.0 Specification*, version 2.0.1), read from untrusted bytes.
//!
//! Keeps triangles (strips and fans become lists), normals, tangents, texture coordinates, the first color set,
//! materials with all their extensions, textures, samplers, pictures, lights, cameras, names and extras. Node
//! transforms are flattened; a mesh placed several times stays one mesh. Notes everything else.

mod accessor;
mod draco;
mod json;
mod look;
mod meshopt;
mod morph;
mod origin;
mod primitive;

use crate::builder::{Builder, Placement};
use crate::{ImportError, files};
use accessor::Document;
use enfilade_geom::scene::Mesh;
use enfilade_geom::{DMat4, DVec3};
use json::{Node, Root};
pub(crate) use look::read_picture_file;
use std::borrow::Cow;
use std::collections::HashMap;

/// Required extensions that are supported, or that do not affect the supported parts.
const KNOWN_EXTENSIONS: [&str; 15] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "ENFILADE_cell_portal_graph",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_texture_dds",
];

/// Most ancestors whose names count for an object's role; also ends the walk up a cycle above the scene's own roots.
const MAX_NAMED_ANCESTORS: usize = 32;

const GLB_MAGIC: &[u8] = b"glTF";
const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// Returns `true` if the bytes look like GLB or a glTF document.
pub(crate) fn is_gltf(bytes: &[u8]) -> bool {
    bytes.starts_with(GLB_MAGIC)
        || bytes
            .iter()
            .find(|b| !b.is_ascii_whitespace() && !matches!(b, 0xEF | 0xBB | 0xBF))
            == Some(&b'{')
}

/// Returns the length in the header of a GLB.
pub(crate) fn length(head: &[u8]) -> Option<u64> {
    let length = head.strip_prefix(GLB_MAGIC)?.get(4..8)?;
    Some(u32::from_le_bytes(length.try_into().ok()?).into())
}

/// Reads one file into the builder.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    read_renamed(bytes, builder, &|_| None)
}

/// Works as [`read`], with other names for nodes and meshes where `rename` returns one.
pub(crate) fn read_renamed(
    bytes: &[u8],
    builder: &mut Builder<'_>,
    rename: &dyn Fn(&str) -> Option<String>,
) -> Result<(), ImportError> {
    builder.set_format("glTF");
    let (json, bin) = split_container(bytes, builder)?;
    let limit = builder.limits().max_json_bytes;
    if json.len() as u64 > limit {
        return Err(ImportError::TooMuch {
            path: builder.path.clone(),
            place: "JSON".into(),
            what: "bytes",
            n: json.len() as u64,
            limit,
        });
    }
    let mut root: Root = serde_json::from_slice(json)
        .map_err(|e| builder.malformed("JSON", format!("{e}; is the file whole?")))?;
    check_version(&root, builder)?;
    for node in &mut root.nodes.0 {
        let name = node.name.as_deref().and_then(rename);
        node.name = name.map(String::into_boxed_str).or(node.name.take());
    }
    let buffers = read_buffers(&root, bin, builder)?;
    let n_own = |b: &Option<Cow<'_, [u8]>>| match b {
        Some(Cow::Owned(bytes)) => bytes.len() as u64,
        _ => 0,
    };
    builder.add_read_bytes(buffers.iter().map(n_own).sum());
    let plain_views = meshopt::decode_views(&root, &buffers, builder)?;
    let document = Document {
        root,
        buffers,
        plain_views,
    };
    let materials = look::read_materials(&document, builder)?;
    GltfReader {
        meshes: HashMap::new(),
        document: &document,
        materials,
        builder,
    }
    .read_scene()
}

/// Splits a GLB into JSON and binary chunk; a `.gltf` is all JSON.
fn split_container<'b>(
    bytes: &'b [u8],
    builder: &mut Builder<'_>,
) -> Result<(&'b [u8], Option<&'b [u8]>), ImportError> {
    if !bytes.starts_with(GLB_MAGIC) {
        return Ok((bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes), None));
    }
    let word = |at: usize| {
        bytes
            .get(at..at + 4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
    };
    let cut = |place: &str| ImportError::malformed(&builder.path, place, "the file is cut off");
    let version = word(4).ok_or_else(|| cut("GLB header"))?;
    if version != 2 {
        return Err(unsupported_version(builder, &version.to_string()));
    }
    let length = word(8).ok_or_else(|| cut("GLB header"))? as usize;
    if length > bytes.len() {
        return Err(builder.malformed(
            "GLB header",
            format!(
                "the file is cut off: it should have {length} bytes and has {}",
                bytes.len()
            ),
        ));
    }
    if length < bytes.len() {
        builder.note("GLB header", "bytes after the end of the GLB; left out");
    }
    let mut json = None;
    let mut bin = None;
    let mut at = 12;
    while at < length {
        let place = format!("GLB chunk at byte {at}");
        let cut = || ImportError::malformed(&builder.path, &place, "the chunk is cut off");
        let n = word(at).ok_or_else(cut)? as usize;
        let kind = word(at + 4).ok_or_else(cut)?;
        let body = bytes[..length].get(at + 8..at + 8 + n).ok_or_else(cut)?;
        match kind {
            CHUNK_JSON if json.is_none() => json = Some(body),
            CHUNK_BIN if bin.is_none() => bin = Some(body),
            _ => {}
        }
        at += 8 + n;
    }
    match json {
        Some(json) => Ok((json, bin)),
        None => Err(builder.malformed("GLB", "no JSON chunk")),
    }
}

fn unsupported_version(builder: &Builder<'_>, version: &str) -> ImportError {
    ImportError::Unsupported {
        path: builder.path.clone(),
        feature: format!("glTF version {version}"),
        advice: "export it as glTF 2.0 (`npx gltf-pipeline -i IN -o OUT.glb` upgrades)".into(),
    }
}

fn unsupported_extension(builder: &Builder<'_>, name: &str) -> ImportError {
    ImportError::Unsupported {
        path: builder.path.clone(),
        feature: format!("the required extension {name}"),
        advice: "export without it".into(),
    }
}

fn check_version(root: &Root, builder: &Builder<'_>) -> Result<(), ImportError> {
    if !root.asset.version.starts_with("2.") {
        return Err(unsupported_version(builder, &root.asset.version));
    }
    for name in root.extensions_required.iter() {
        let is_known =
            KNOWN_EXTENSIONS.contains(&name.as_str()) || name.starts_with("KHR_materials_");
        if !is_known {
            return Err(unsupported_extension(builder, name));
        }
    }
    Ok(())
}

fn read_buffers<'b>(
    root: &Root,
    bin: Option<&'b [u8]>,
    builder: &mut Builder<'_>,
) -> Result<Vec<Option<Cow<'b, [u8]>>>, ImportError> {
    let mut buffers = Vec::new();
    let mut budget = builder.limits().max_file_bytes;
    for (i, def) in root.buffers.iter().enumerate() {
        let place = format!("buffer {i}");
        let bytes = match &def.uri {
            _ if def.is_fallback() => None,
            None if i == 0 => bin.map(Cow::Borrowed),
            None => None,
            Some(uri) => Some(Cow::Owned(match files::decode_data_uri(uri) {
                Some(Ok((_, bytes))) => bytes,
                Some(Err(problem)) => return Err(builder.malformed(place, problem)),
                None => {
                    let bytes = builder
                        .read_reference(uri, budget)
                        .map_err(|problem| builder.malformed(&place, problem))?;
                    budget -= bytes.len() as u64;
                    bytes
                }
            })),
        };
        if let Some(bytes) = &bytes
            && (bytes.len() as u64) < def.byte_length
        {
            return Err(builder.malformed(
                place,
                format!("has {} bytes of {}", bytes.len(), def.byte_length),
            ));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

struct GltfReader<'r, 'a, 'b> {
    document: &'r Document<'b>,
    /// Scene material of each document material.
    materials: Vec<u32>,
    /// Scene meshes by document mesh and the bits of its weights, as far as used.
    meshes: HashMap<(u32, Vec<u64>), u32>,
    builder: &'r mut Builder<'a>,
}

/// A node still to be visited.
struct Visit {
    node: u32,
    parent: DMat4,
    depth: u32,
    moves: Option<&'static str>,
    /// Its parent in the tree of names.
    source: Option<u32>,
}

impl GltfReader<'_, '_, '_> {
    fn read_scene(mut self) -> Result<(), ImportError> {
        let root = &self.document.root;
        let parents = self.parents()?;
        let starts = self.starts(&parents)?;
        let animated = self.animated_nodes();
        let is_joint = origin::joints(root);
        origin::add_about(root, self.builder);
        let mut is_visited = vec![false; root.nodes.len()];
        let mut stack: Vec<Visit> = Vec::new();
        for &start in starts.iter().rev() {
            if start >= root.nodes.len() {
                return Err(self.builder.malformed("scene", format!("no node {start}")));
            }
            stack.push(Visit {
                node: start as u32,
                parent: self.builder.base,
                depth: 1,
                moves: None,
                source: None,
            });
        }
        while let Some(visit) = stack.pop() {
            let i = visit.node as usize;
            self.check_visit(&visit, &mut is_visited)?;
            let node = &root.nodes[i];
            if let Some(reason) = why_dropped(node) {
                let name = node.name.as_deref().unwrap_or("");
                self.builder.note(
                    format!("node {i} '{name}'"),
                    format!("left out with all below it: {reason}"),
                );
                continue;
            }
            let local = local_transform(node)
                .map_err(|problem| self.builder.malformed(format!("node {i}"), problem))?;
            let world = visit.parent * local;
            let moves = visit
                .moves
                .or(if animated[i] { Some("animated") } else { None });
            let source = origin::add_node(root, i, visit.source, self.builder)?;
            if let Some(mesh) = node.mesh {
                self.place_node(i, mesh, world, moves, &parents, source)?;
            }
            origin::add_fixtures(root, i, &world, is_joint[i], self.builder)?;
            for &child in node.children.iter().rev() {
                stack.push(Visit {
                    node: child,
                    parent: world,
                    depth: visit.depth + 1,
                    moves,
                    source,
                });
            }
        }
        Ok(())
    }

    /// Returns the parent of each node, or `u32::MAX`.
    fn parents(&self) -> Result<Vec<u32>, ImportError> {
        let nodes = &self.document.root.nodes;
        let mut parents = vec![u32::MAX; nodes.len()];
        let edges = nodes
            .iter()
            .enumerate()
            .flat_map(|(i, node)| node.children.iter().map(move |&child| (i, child)));
        for (i, child) in edges {
            let problem = match parents.get_mut(child as usize) {
                None => format!("no child node {child}"),
                Some(parent) if *parent != u32::MAX => {
                    format!("child node {child} has another parent, node {parent}")
                }
                Some(parent) => {
                    *parent = i as u32;
                    continue;
                }
            };
            return Err(self.builder.malformed(format!("node {i}"), problem));
        }
        Ok(parents)
    }

    /// Returns the root nodes of the scene.
    fn starts(&mut self, parents: &[u32]) -> Result<Vec<usize>, ImportError> {
        let root = &self.document.root;
        let wanted = self.builder.options.scene.as_deref();
        if root.scenes.is_empty() && wanted.is_none() {
            let tops = (0..parents.len()).filter(|&i| parents[i] == u32::MAX);
            return Ok(tops.collect());
        }
        let named = |wanted: &str| {
            let mut scenes = root.scenes.iter();
            let by_name = scenes.position(|s| s.name.as_deref() == Some(wanted));
            by_name.or_else(|| wanted.parse().ok())
        };
        let index = wanted.map_or_else(|| Some(root.scene.unwrap_or(0)), named);
        let Some((index, scene)) = index.and_then(|i| Some((i, root.scenes.get(i)?))) else {
            let problem = match wanted {
                None => format!("no scene {}", root.scene.unwrap_or(0)),
                Some(wanted) => format!("no scene '{wanted}'; it has {}", self.scene_names()),
            };
            return Err(self.builder.malformed("scene", problem));
        };
        if root.scenes.len() > 1 && wanted.is_none() {
            let all = self.scene_names();
            self.builder.note(
                format!("scene {index}"),
                format!("several scenes, of which only the default one is read: {all}; --scene NAME or --scene N reads another"),
            );
        }
        Ok(scene.nodes.to_vec())
    }

    /// Returns the first few scenes by number and name, for messages.
    fn scene_names(&self) -> String {
        const TOLD: usize = 10;
        let scenes = self.document.root.scenes.iter();
        let told = scenes.enumerate().map(|(i, scene)| match &scene.name {
            Some(name) => format!("{i} '{name}'"),
            None => i.to_string(),
        });
        let mut told: Vec<String> = told.take(TOLD + 1).collect();
        if told.len() > TOLD {
            told[TOLD] = "…".to_owned();
        } else if told.is_empty() {
            return "none".to_owned();
        }
        told.join(", ")
    }

    /// Marks the node as visited; an error at a cycle, and at too great a depth.
    fn check_visit(&self, visit: &Visit, is_visited: &mut [bool]) -> Result<(), ImportError> {
        let place = || format!("node {}", visit.node);
        // With one parent per node, a second visit means a cycle or a root listed twice.
        if std::mem::replace(&mut is_visited[visit.node as usize], true) {
            return Err(self
                .builder
                .malformed(place(), "is reached twice: the node tree has a cycle"));
        }
        let limit = self.builder.limits().max_node_depth;
        if visit.depth > limit {
            return Err(ImportError::TooMuch {
                path: self.builder.path.clone(),
                place: place(),
                what: "levels of nodes",
                n: visit.depth.into(),
                limit: limit.into(),
            });
        }
        Ok(())
    }

    /// Returns `true` for each node that an animation moves.
    fn animated_nodes(&self) -> Vec<bool> {
        let mut animated = vec![false; self.document.root.nodes.len()];
        for channel in self
            .document
            .root
            .animations
            .iter()
            .flat_map(|a| a.channels.iter())
        {
            let target = &channel.target;
            let is_move = matches!(
                target.path.as_str(),
                "translation" | "rotation" | "scale" | "weights"
            );
            if let Some(slot) = target.node.and_then(|n| animated.get_mut(n as usize))
                && is_move
            {
                *slot = true;
            }
        }
        animated
    }

    fn place_node(
        &mut self,
        i: usize,
        mesh: u32,
        world: DMat4,
        moves: Option<&'static str>,
        parents: &[u32],
        source: Option<u32>,
    ) -> Result<(), ImportError> {
        let document = self.document;
        let root = &document.root;
        let node = &root.nodes[i];
        let name = node.name.as_deref().unwrap_or("");
        let place = format!("node {i} '{name}'");
        let Some(def) = root.meshes.get(mesh as usize) else {
            return Err(self.builder.malformed(place, format!("no mesh {mesh}")));
        };
        let has_targets = def.primitives.iter().any(|p| !p.targets.is_empty());
        let weights: &[f64] = match &node.weights {
            _ if !has_targets => &[],
            Some(weights) => weights,
            None => &def.weights,
        };
        let key = (mesh, weights.iter().map(|w| w.to_bits()).collect());
        let scene_mesh = match self.meshes.get(&key) {
            Some(&made) => made,
            None => {
                let made = self.read_mesh(mesh, weights)?;
                self.meshes.insert(key, made);
                made
            }
        };
        let mut ancestors = Vec::new();
        let mut at = parents[i];
        while at != u32::MAX && ancestors.len() < MAX_NAMED_ANCESTORS {
            ancestors.push(root.nodes[at as usize].name.as_deref().unwrap_or(""));
            at = parents[at as usize];
        }
        let moves = if node.skin.is_some() {
            self.builder.note(
                place.clone(),
                "a skinned mesh; read in its unposed shape, as detail",
            );
            Some("skinned")
        } else {
            moves
        };
        let instancing = node.extensions.as_ref().and_then(|e| e.instancing.as_ref());
        let instances = match instancing {
            None => vec![DMat4::IDENTITY],
            Some(instancing) => {
                primitive::read_instances(document, instancing, &place, self.builder)?
            }
        };
        let mesh_name = root.meshes[mesh as usize].name.as_deref().unwrap_or("");
        let transforms: Vec<DMat4> = instances.into_iter().map(|m| world * m).collect();
        self.builder.place(&Placement {
            mesh: scene_mesh,
            names: [name, mesh_name],
            ancestors: &ancestors,
            transforms: &transforms,
            moves,
            place: &place,
            source,
        })
    }

    fn read_mesh(&mut self, index: u32, weights: &[f64]) -> Result<u32, ImportError> {
        let def = &self.document.root.meshes[index as usize];
        let mut mesh = Mesh {
            name: def.name.clone().unwrap_or_default(),
            primitives: Vec::new(),
        };
        let mut steps = Vec::new();
        for (k, primitive) in def.primitives.iter().enumerate() {
            let place = format!("mesh {index} '{}' primitive {k}", mesh.name);
            let read = primitive::read_primitive(
                self.document,
                primitive,
                weights,
                &self.materials,
                &place,
                self.builder,
            )?;
            if let Some((primitive, step)) = read {
                mesh.primitives.push(primitive);
                steps.push(step);
            }
        }
        Ok(self.builder.push_quantized_mesh(mesh, steps))
    }
}

/// Returns the reason why a node and its descendants are left out, if they are.
fn why_dropped(node: &Node) -> Option<String> {
    let extensions = node.extensions.as_ref();
    let visibility = extensions.and_then(|e| e.visibility.as_ref());
    if visibility.is_some_and(|v| v.visible == Some(false)) {
        return Some("hidden by KHR_node_visibility".to_owned());
    }
    enfilade_prepare::drops_subtree(node.name.as_deref().unwrap_or(""))
}

fn local_transform(node: &Node) -> Result<DMat4, String> {
    if let Some(matrix) = &node.matrix {
        let matrix = DMat4::from_cols_array(matrix);
        let last_row = matrix.row(3);
        if last_row.truncate() != DVec3::ZERO || last_row.w != 1.0 {
            return Err("its matrix is not affine: the last row must be 0 0 0 1".into());
        }
        return Ok(matrix);
    }
    let translation = node
        .translation
        .as_ref()
        .map_or(DVec3::ZERO, |t| DVec3::from_array(**t));
    let scale = node
        .scale
        .as_ref()
        .map_or(DVec3::ONE, |s| DVec3::from_array(**s));
    let rotation = node.rotation.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |r| **r);
    Ok(compose(translation, rotation, scale))
}

/// Returns translation times rotation (quaternion `x y z w`, normalized here) times scale.
fn compose(translation: DVec3, q: [f64; 4], scale: DVec3) -> DMat4 {
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    let [x, y, z, w] = if length > 0.0 {
        q.map(|c| c / length)
    } else {
        [0.0, 0.0, 0.0, 1.0]
    };
    let right = DVec3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + w * z),
        2.0 * (x * z - w * y),
    );
    let up = DVec3::new(
        2.0 * (x * y - w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z + w * x),
    );
    let back = DVec3::new(
        2.0 * (x * z + w * y),
        2.0 * (y * z - w * x),
        1.0 - 2.0 * (x * x + y * y),
    );
    DMat4::from_cols(
        (right * scale.x).extend(0.0),
        (up * scale.y).extend(0.0),
        (back * scale.z).extend(0.0),
        translation.extend(1.0),
    )
}
