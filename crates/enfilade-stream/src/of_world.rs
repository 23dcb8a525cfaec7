//! The pieces of a world that is whole in memory.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, World};
use enfilade_geom::scene::Primitive;
use serde_json::Value;

use crate::{Catalog, PieceId, PieceSizes};

/// The pieces into which a world falls apart: one per set of cells that see the same triangles, one per mesh of objects, one
/// per picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WorldPieces {
    /// The pieces and the cells that need them.
    pub catalog: Catalog,
    /// The piece of each batch.
    pub of_batch: Vec<PieceId>,
    /// The piece of each mesh of objects.
    pub of_mesh: Vec<PieceId>,
    /// The piece of each picture.
    pub of_image: Vec<PieceId>,
}

impl WorldPieces {
    /// Divides a world.
    ///
    /// A cell needs the triangles that it sees, the meshes of the objects that touch it or stand in one of its portals (a leaf
    /// swings to both sides), and the pictures that `images_of` lists for the materials of these (ids that do not exist are
    /// ignored). Sizes in memory are those of the vertices, indices and files. Sizes in transit are a third of them for
    /// geometry and equal for pictures, which are compressed already: an assumption until a packer has measured them.
    /// O(n log n) in batches, objects and what they need.
    #[must_use]
    pub fn of_world(world: &World, images_of: &dyn Fn(u32) -> Vec<u32>) -> Self {
        let mut pieces = Pieces::new(world.graph.cells.len());
        let mut of_cells: BTreeMap<&[CellId], PieceId> = BTreeMap::new();
        let mut of_batch = Vec::with_capacity(world.batches.len());
        for batch in &world.batches {
            let piece = *of_cells
                .entry(&batch.cells)
                .or_insert_with(|| pieces.push(&batch.cells));
            pieces.grow(piece, size_of(&batch.primitive));
            of_batch.push(piece);
        }
        let meshes = world.detail_meshes.iter();
        let of_mesh: Vec<PieceId> = meshes
            .map(|mesh| {
                let piece = pieces.push(&[]);
                for primitive in &mesh.primitives {
                    pieces.grow(piece, size_of(primitive));
                }
                piece
            })
            .collect();
        let images = world.images.iter();
        let of_image: Vec<PieceId> = images
            .map(|image| {
                let piece = pieces.push(&[]);
                let size = image.bytes.len() as u64;
                pieces.pieces[piece.idx()] = PieceSizes {
                    n_packed: size,
                    n_resident: size,
                };
                piece
            })
            .collect();
        // The cells of each object, those at its portal included.
        let mut cells: Vec<Vec<CellId>> = world.details.iter().map(|d| d.cells.clone()).collect();
        for portal in &world.graph.portals {
            for fitting in &portal.fittings {
                if let Some(cells) = cells.get_mut(fitting.detail as usize) {
                    cells.extend(portal.cells);
                }
            }
        }
        let materials: Vec<Vec<u32>> = (0..world.materials.len() as u32).map(images_of).collect();
        let need_images = |cells: &[CellId], primitive: &Primitive, pieces: &mut Pieces| {
            let material = primitive.material.and_then(|m| materials.get(m as usize));
            for &image in material.into_iter().flatten() {
                if let Some(&piece) = of_image.get(image as usize) {
                    pieces.need(cells, piece);
                }
            }
        };
        for batch in &world.batches {
            need_images(&batch.cells, &batch.primitive, &mut pieces);
        }
        for (detail, cells) in world.details.iter().zip(&cells) {
            let mesh = detail.mesh as usize;
            if let (Some(&piece), Some(mesh)) = (of_mesh.get(mesh), world.detail_meshes.get(mesh)) {
                pieces.need(cells, piece);
                for primitive in &mesh.primitives {
                    need_images(cells, primitive, &mut pieces);
                }
            }
        }
        Self {
            catalog: Catalog::new(pieces.pieces, &pieces.rows),
            of_batch,
            of_mesh,
            of_image,
        }
    }
}

/// Returns the pictures that a material of a world shows, for [`WorldPieces::of_world`]: those of every texture that its glTF names.
#[must_use]
pub fn images_of(world: &World, material: u32) -> Vec<u32> {
    fn visit(value: &Value, textures: &mut Vec<u64>) {
        if let Value::Object(fields) = value {
            for (name, field) in fields {
                if name.ends_with("exture") {
                    textures.extend(field["index"].as_u64());
                }
                visit(field, textures);
            }
        }
    }
    let material = world.materials.get(material as usize);
    let json = material.and_then(|m| serde_json::from_str(&m.gltf).ok());
    let mut textures = Vec::new();
    if let Some(json) = json {
        visit(&json, &mut textures);
    }
    let image = |t: u64| world.textures.get(usize::try_from(t).ok()?)?.image;
    textures.into_iter().filter_map(image).collect()
}

/// Pieces so far, and the pieces that each cell needs.
struct Pieces {
    pieces: Vec<PieceSizes>,
    rows: Vec<Vec<PieceId>>,
}

impl Pieces {
    fn new(n_cells: usize) -> Self {
        Self {
            pieces: Vec::new(),
            rows: vec![Vec::new(); n_cells],
        }
    }

    fn push(&mut self, cells: &[CellId]) -> PieceId {
        let piece = PieceId(self.pieces.len() as u32);
        self.pieces.push(PieceSizes {
            n_packed: 0,
            n_resident: 0,
        });
        self.need(cells, piece);
        piece
    }

    fn need(&mut self, cells: &[CellId], piece: PieceId) {
        for cell in cells {
            if let Some(row) = self.rows.get_mut(cell.idx()) {
                row.push(piece);
            }
        }
    }

    fn grow(&mut self, piece: PieceId, n_resident: u64) {
        let piece = &mut self.pieces[piece.idx()];
        piece.n_resident += n_resident;
        piece.n_packed = piece.n_resident.div_ceil(3);
    }
}

/// Returns the memory of a primitive. [Units: bytes]
fn size_of(primitive: &Primitive) -> u64 {
    let uvs: usize = primitive.uvs.iter().map(Vec::len).sum();
    let floats = 3 * (primitive.positions.len() + primitive.normals.len())
        + 4 * (primitive.tangents.len() + primitive.colors.len())
        + 2 * uvs
        + primitive.indices.len();
    4 * floats as u64
}
