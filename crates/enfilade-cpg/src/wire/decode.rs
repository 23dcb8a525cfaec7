//! GLB → world, from untrusted bytes.
//!
//! Every count is checked against the available bytes before anything is allocated for it, and a file cannot have the
//! same bytes decoded again and again ([`Arrays::spend`]), so memory and time stay within a small factor of the
//! file's size. The result satisfies [`World::validate`].

use std::collections::BTreeMap;

use enfilade_geom::scene::{Image, Mesh, Primitive, Texture};
use enfilade_geom::{Aabb, DVec3};
use serde::Deserialize;
use serde_json::value::RawValue;

use super::arrays::Arrays;
use super::boxes;
use super::fitting;
use super::json::{self, LINE_STRIP, TEXTURE_EXTENSIONS};
use super::origin;
use super::rows::{eight, four, pairs, take_polygon};
use super::special;
use super::visible::read_pvs;
use super::{CHUNK_BIN, CHUNK_JSON, EXTENSION, GLB_MAGIC, GLB_VERSION, VERSION, WireError, broken};
use crate::look::material_of_text;
use crate::{
    Batch, Cell, CellId, CellPortalGraph, DetailObject, Locator, LocatorNode, Portal, PortalId,
    PortalKind, Provenance, Pvs, RoomFacts, SourceRuns, SpecialPortal, Statistics, World,
};

/// Decodes a world from one GLB.
///
/// Safe on hostile bytes: no panic, no allocation from an unchecked count, nesting of the JSON limited to 128. The
/// world returned satisfies [`World::validate`]. Takes time and memory linear in the bytes.
///
/// # Errors
///
/// The problem and its remedy: not a GLB, a GLB that was not baked, another version, damage.
pub fn decode_glb(bytes: &[u8]) -> Result<World, WireError> {
    let (text, bin) = chunks(bytes)?;
    check_version(text)?;
    let root: json::Root = serde_json::from_str(text).map_err(json_error)?;
    let mut reader = Reader {
        root: &root,
        arrays: Arrays::new(&root.accessors, &root.buffer_views, bin),
    };
    let world = reader.world()?;
    world.validate().map_err(WireError::Invalid)?;
    Ok(world)
}

/// Returns `false` for a GLB without our data: a scene that was not baked. Whatever else is wrong, [`decode_glb`] tells.
#[must_use]
pub fn is_world(bytes: &[u8]) -> bool {
    let version = chunks(bytes).and_then(|(text, _)| check_version(text));
    !matches!(version, Err(WireError::NotAWorld))
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
pub(super) fn json_error(error: serde_json::Error) -> WireError {
    WireError::Json(error.to_string())
}

/// Splits a GLB into the text of its JSON chunk and the bytes of its binary chunk.
pub(super) fn chunks(bytes: &[u8]) -> Result<(&str, &[u8]), WireError> {
    if !bytes.starts_with(&GLB_MAGIC) {
        return Err(WireError::NotGlb("it does not begin with `glTF`"));
    }
    let damaged = |at, problem| WireError::Damaged { at, problem };
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|w| w.try_into().ok());
        word.map(u32::from_le_bytes)
            .ok_or(damaged(bytes.len(), "it ends in the middle of a header"))
    };
    if word(4)? != GLB_VERSION {
        return Err(WireError::NotGlb("its container is not version 2"));
    }
    if word(8)? as usize != bytes.len() {
        return Err(damaged(8, "the length in its header is wrong"));
    }
    let chunk = |at: usize, kind: [u8; 4]| {
        let len = word(at)? as usize;
        if bytes.get(at + 4..at + 8) != Some(&kind) {
            return Err(damaged(at + 4, "an unexpected chunk"));
        }
        let body = bytes.get(at + 8..).and_then(|rest| rest.get(..len));
        Ok((
            body.ok_or(damaged(at, "a chunk is longer than the file"))?,
            at + 8 + len,
        ))
    };
    let (text, end) = chunk(12, CHUNK_JSON)?;
    let text = std::str::from_utf8(text).map_err(|e| WireError::Json(e.to_string()))?;
    if end == bytes.len() {
        return Ok((text, &[]));
    }
    let (bin, end) = chunk(end, CHUNK_BIN)?;
    if end != bytes.len() {
        return Err(damaged(end, "there is data after the binary chunk"));
    }
    Ok((text, bin))
}

/// Checks for our extension and its version before reading anything else.
fn check_version(text: &str) -> Result<(), WireError> {
    #[derive(Deserialize)]
    struct Probe<'a> {
        #[serde(borrow, default)]
        extensions: BTreeMap<String, &'a RawValue>,
    }
    #[derive(Deserialize)]
    struct Ours {
        version: u64,
    }
    let probe: Probe = serde_json::from_str(text).map_err(json_error)?;
    let ours = probe
        .extensions
        .get(EXTENSION)
        .ok_or(WireError::NotAWorld)?;
    let Ours { version } = serde_json::from_str(ours.get()).map_err(json_error)?;
    if (1..=VERSION).contains(&version) {
        Ok(())
    } else {
        Err(WireError::Version { found: version })
    }
}

struct Reader<'a> {
    root: &'a json::Root,
    arrays: Arrays<'a>,
}

impl<'a> Reader<'a> {
    fn world(&mut self) -> Result<World, WireError> {
        let graph = &self.root.extensions.graph;
        if let Some(buffer) = self.root.buffers.first()
            && buffer.uri.is_some()
        {
            return Err(broken(
                "buffer 0",
                "is in another file; a world is a single GLB",
            ));
        }
        let runs = self.arrays.optional_view(graph.source_runs, "sourceRuns")?;
        self.arrays.spend(runs.len() as u64)?;
        let runs =
            pairs(runs).ok_or_else(|| broken("sourceRuns", "their buffer view is cut off"))?;
        let mut runs = &runs[..];
        let batches = graph
            .batches
            .iter()
            .enumerate()
            .map(|(i, b)| self.batch(i, b, &mut runs));
        let batches = batches.collect::<Result<_, _>>()?;
        if !runs.is_empty() {
            return Err(broken("sourceRuns", "there are more than the batches use"));
        }
        let sources = graph.sources.iter().map(origin::source).collect();
        let fixtures = graph
            .fixtures
            .iter()
            .map(|&node| origin::fixture(self.root, node));
        let fixtures = fixtures.collect::<Result<_, _>>()?;
        let about = origin::about(self.root);
        let detail_meshes = graph.detail_meshes.iter().map(|m| match m {
            Some(mesh) => self.mesh(*mesh),
            None => Ok(Mesh::default()),
        });
        let detail_meshes = detail_meshes.collect::<Result<Vec<Mesh>, _>>()?;
        let boxes = detail_meshes.iter().map(|m| boxes::of_mesh(&m.primitives));
        let boxes: Vec<Aabb> = boxes.collect();
        let details = (graph.details.iter().enumerate()).map(|(i, d)| self.detail(i, d, &boxes));
        let details = details.collect::<Result<_, _>>()?;
        let materials = self.root.materials.iter().enumerate().map(|(i, text)| {
            material_of_text(text.get()).map_err(|why| broken(format!("material {i}"), why))
        });
        let materials = materials.collect::<Result<_, _>>()?;
        let textures = self
            .root
            .textures
            .iter()
            .enumerate()
            .map(|(i, t)| self.texture(i, t));
        let textures = textures.collect::<Result<_, _>>()?;
        let images = self.root.images.iter().enumerate().map(|(i, image)| {
            let bytes = self
                .arrays
                .view(image.buffer_view, || format!("image {i}"))?;
            self.arrays.spend(bytes.len() as u64)?;
            let (name, mime) = (image.name.clone(), image.mime_type.clone());
            Ok(Image {
                name,
                mime,
                bytes: bytes.to_vec(),
            })
        });
        let images = images.collect::<Result<_, _>>()?;
        let leak_path = self.leak_path()?;
        let pvs = self.pvs()?;
        let graph = self.graph()?;
        let room_facts = self.room_facts(&graph)?;
        Ok(World {
            graph,
            batches,
            details,
            detail_meshes,
            materials,
            textures,
            images,
            leak_path,
            sources,
            fixtures,
            about,
            pvs,
            room_facts,
        })
    }

    /// Reads the facts of rooms; their doors and windows are those of the graph.
    fn room_facts(&mut self, graph: &CellPortalGraph) -> Result<Option<Vec<RoomFacts>>, WireError> {
        let Some(rooms) = &self.root.extensions.graph.rooms else {
            return Ok(None);
        };
        let facts = rooms.iter().map(|room| {
            let cell = CellId(room.cell);
            if cell.idx() >= graph.cells.len() {
                return Err(broken(
                    "the facts of rooms",
                    format!("no cell {}", room.cell),
                ));
            }
            let n = |kind| graph.n_portals(cell, kind);
            Ok(RoomFacts {
                cell,
                storeys: room.storeys.clone(),
                floor_area: room.floor_area,
                area_above_1_5: room.area_above_1_5,
                area_above_2_3: room.area_above_2_3,
                height: room.height,
                n_doors: n(PortalKind::Door),
                n_windows: n(PortalKind::Window),
            })
        });
        facts.collect::<Result<_, _>>().map(Some)
    }

    fn leak_path(&mut self) -> Result<Vec<[f32; 3]>, WireError> {
        let root = self.root;
        let Some(node) = root.extensions.graph.leak_path else {
            return Ok(Vec::new());
        };
        let mesh = root.nodes.get(node as usize).and_then(|n| n.mesh);
        let line = mesh
            .and_then(|m| root.meshes.get(m as usize))
            .and_then(|m| m.primitives.first())
            .filter(|p| p.mode == Some(LINE_STRIP) && p.indices.is_none())
            .and_then(|p| p.attributes.get("POSITION"));
        let line = line.ok_or_else(|| broken("the leak path", "its node is not a polyline"))?;
        self.arrays.rows(*line)
    }

    fn pvs(&mut self) -> Result<Option<Pvs>, WireError> {
        let Some(pvs) = &self.root.extensions.graph.pvs else {
            return Ok(None);
        };
        let of = "the potentially visible set";
        let view = |view| {
            let bytes = self.arrays.optional_view(view, of)?;
            self.arrays.spend(bytes.len() as u64)?;
            Ok(bytes)
        };
        read_pvs(pvs, view, &|| broken(of, "a buffer view is cut off")).map(Some)
    }

    fn graph(&mut self) -> Result<CellPortalGraph, WireError> {
        let graph = &self.root.extensions.graph;
        let nodes = &self.root.nodes;
        let cells = graph.cells.iter().enumerate().map(|(i, c)| {
            let at = || format!("cell {i}");
            let Some(node) = nodes.get(c.node as usize) else {
                return Err(broken(at(), format!("no node {}", c.node)));
            };
            if node.name != c.name {
                let names = format!("is named {:?}, but its node {:?}", c.name, node.name);
                return Err(broken(at(), names));
            }
            Ok(Cell {
                name: c.name.clone(),
                aabb: c.aabb.map(|corner| corner.map(|v| v as f32)),
                volume: c.volume as f32,
                n_triangles: c.triangles,
                n_detail_triangles: c.detail_triangles,
                portals: c.portals.iter().copied().map(PortalId).collect(),
                outdoor: c.outdoor,
                is_void: c.void,
                is_land: c.land,
                why: c.why.clone(),
            })
        });
        let cells = cells.collect::<Result<_, _>>()?;
        let portals = self.portals()?;
        let specials = self.specials()?;
        let locator = self.locator()?;
        let p = &graph.provenance;
        Ok(CellPortalGraph {
            cells,
            portals,
            specials,
            places: graph.places.clone(),
            locator: locator.into(),
            provenance: Provenance {
                generator: p.generator.clone(),
                method: p.method.clone(),
                settings: p.settings.clone(),
                input_hash: p.input_hash.clone(),
            },
            statistics: Statistics {
                counts: graph.statistics.clone(),
            },
        })
    }

    fn portals(&mut self) -> Result<Vec<Portal>, WireError> {
        let graph = &self.root.extensions.graph;
        let bytes = self
            .arrays
            .optional_view(graph.portal_corners, "the portals' vertices")?;
        let (mut corners, rest) = bytes.as_chunks::<12>();
        if !rest.is_empty() {
            return Err(broken(
                "the portals' vertices",
                "their buffer view is cut off",
            ));
        }
        self.arrays.spend(bytes.len() as u64)?;
        let mut portals = Vec::with_capacity(graph.portals.len());
        for (i, p) in graph.portals.iter().enumerate() {
            let mut take = |n| take_polygon(&mut corners, n, || format!("portal {i}"));
            let outline = take(p.outline)?;
            let pieces = p
                .pieces
                .iter()
                .map(|&n| take(n))
                .collect::<Result<_, _>>()?;
            portals.push(Portal {
                cells: p.cells.map(CellId),
                kind: p.kind.into(),
                normal: p.normal.map(|v| v as f32),
                outline,
                pieces,
                area: p.area as f32,
                fittings: (p.fittings.iter().map(|f| fitting::read(i, f)))
                    .collect::<Result<_, _>>()?,
                why: p.why.clone(),
            });
        }
        if !corners.is_empty() {
            return Err(broken(
                "the portals' vertices",
                "there are more than the portals use",
            ));
        }
        Ok(portals)
    }

    fn specials(&mut self) -> Result<Vec<SpecialPortal>, WireError> {
        let graph = &self.root.extensions.graph;
        let bytes = self
            .arrays
            .optional_view(graph.special_corners, special::CORNERS)?;
        self.arrays.spend(bytes.len() as u64)?;
        special::read_all(graph, bytes)
    }

    fn locator(&mut self) -> Result<Locator, WireError> {
        let l = &self.root.extensions.graph.locator;
        let planes = self
            .arrays
            .optional_view(l.planes, "the locator's planes")?;
        let nodes = self.arrays.optional_view(l.nodes, "the locator's nodes")?;
        self.arrays
            .spend(planes.len() as u64 + nodes.len() as u64)?;
        let (planes, planes_rest) = planes.as_chunks::<32>();
        let (nodes, nodes_rest) = nodes.as_chunks::<12>();
        if !planes_rest.is_empty() || !nodes_rest.is_empty() {
            return Err(broken("the locator", "a buffer view is cut off"));
        }
        let bounds = l.bounds.map_or(Aabb::EMPTY, |[min, max]| {
            Aabb::new(DVec3::from_array(min), DVec3::from_array(max))
        });
        let plane = |p: &[u8; 32]| std::array::from_fn(|i| f64::from_le_bytes(eight(p, 8 * i)));
        let node = |n: &[u8; 12]| LocatorNode {
            plane: u32::from_le_bytes(four(n, 0)),
            children: [4, 8].map(|at| i32::from_le_bytes(four(n, at))),
        };
        Ok(Locator {
            bounds,
            outside: l.outside.map(CellId),
            planes: planes.iter().map(plane).collect(),
            nodes: nodes.iter().map(node).collect(),
            root: l.root,
        })
    }

    /// Reads a batch; takes its runs of sources from the front of `runs`.
    fn batch(
        &mut self,
        i: usize,
        batch: &json::BatchJson,
        runs: &mut &[[u32; 2]],
    ) -> Result<Batch, WireError> {
        let (own, rest) = runs
            .split_at_checked(batch.sources as usize)
            .ok_or_else(|| broken(format!("batch {i}"), "has more sources than the file holds"))?;
        *runs = rest;
        let cells = batch.cells.iter().copied().map(CellId).collect();
        let primitive = match (batch.mesh, batch.primitive) {
            (None, None) => Primitive::default(),
            (Some(mesh), Some(primitive)) => {
                let found = self
                    .root
                    .meshes
                    .get(mesh as usize)
                    .and_then(|m| m.primitives.get(primitive as usize));
                let found = found.ok_or_else(|| {
                    broken(
                        format!("batch {i}"),
                        format!("no primitive {primitive} in mesh {mesh}"),
                    )
                })?;
                self.arrays.primitive(found)?
            }
            _ => {
                return Err(broken(
                    format!("batch {i}"),
                    "must have both a mesh and a primitive, or neither",
                ));
            }
        };
        Ok(Batch {
            cells,
            primitive,
            sources: SourceRuns::from_runs(own.to_vec()),
            is_seal: batch.seal,
        })
    }

    fn mesh(&mut self, mesh: u32) -> Result<Mesh, WireError> {
        let found = self.root.meshes.get(mesh as usize);
        let found = found.ok_or_else(|| broken("detailMeshes", format!("no mesh {mesh}")))?;
        let primitives = found.primitives.iter().map(|p| self.arrays.primitive(p));
        Ok(Mesh {
            name: found.name.clone(),
            primitives: primitives.collect::<Result<_, _>>()?,
        })
    }

    /// Reads a detail object; `boxes` are those of the meshes.
    fn detail(
        &self,
        i: usize,
        detail: &json::Detail,
        boxes: &[Aabb],
    ) -> Result<DetailObject, WireError> {
        let at = || format!("detail {i}");
        let node = self.root.nodes.get(detail.node as usize);
        let node = node.ok_or_else(|| broken(at(), format!("no node {}", detail.node)))?;
        let meshes = &self.root.extensions.graph.detail_meshes;
        if meshes.get(detail.mesh as usize) != Some(&node.mesh) {
            return Err(broken(at(), "its mesh differs from its node's"));
        }
        let transform = super::transform::of_node(node).map_err(|why| broken(at(), why))?;
        if let Some(said) = &detail.aabb
            && !boxes::agree(said, &boxes[detail.mesh as usize], &transform)
        {
            return Err(broken(
                at(),
                "does not fit its box; one of the two was changed",
            ));
        }
        Ok(DetailObject {
            name: node.name.clone(),
            mesh: detail.mesh,
            transform,
            cells: detail.cells.iter().copied().map(CellId).collect(),
            source: detail.source,
            part_of: detail.part_of,
        })
    }

    fn texture(&self, i: usize, texture: &json::Texture) -> Result<Texture, WireError> {
        let sampler = match texture.sampler {
            None => String::new(),
            Some(sampler) => {
                let text = self.root.samplers.get(sampler as usize);
                let missing = || broken(format!("texture {i}"), format!("no sampler {sampler}"));
                text.ok_or_else(missing)?.get().to_owned()
            }
        };
        let extended = TEXTURE_EXTENSIONS
            .iter()
            .filter_map(|(_, e)| texture.extensions.get(*e));
        let image = texture
            .source
            .or_else(|| extended.filter_map(|e| e.source).next());
        Ok(Texture { image, sampler })
    }
}
