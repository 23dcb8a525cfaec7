//! Checks that batches, meshes and objects have valid references and finite numbers.

use enfilade_geom::scene::{Mesh, Primitive};

use super::error::{Findings, GraphError};
use crate::{CellId, DetailObject};

pub(super) fn check_cell_list(
    owner: impl Fn() -> String,
    cells: &[CellId],
    n_cells: usize,
    found: &mut Findings,
) {
    let unsorted = cells.windows(2).find(|w| w[0] >= w[1]).map(|w| w[1]);
    let beyond = cells.last().copied().filter(|c| c.0 as usize >= n_cells);
    if let Some(CellId(cell)) = unsorted.or(beyond) {
        found.push(GraphError::CellList {
            owner: owner(),
            cell,
            n_cells,
        });
    }
}

pub(super) fn check_mesh(i: usize, mesh: &Mesh, n_materials: usize, found: &mut Findings) {
    for (j, primitive) in mesh.primitives.iter().enumerate() {
        let owner = || format!("detail mesh {i} ({}), primitive {j}", mesh.name);
        check_primitive(owner, primitive, n_materials, found);
    }
}

pub(super) fn check_primitive(
    owner: impl Fn() -> String,
    p: &Primitive,
    n_materials: usize,
    found: &mut Findings,
) {
    let mut problem = |problem: String| {
        found.push(GraphError::Primitive {
            owner: owner(),
            problem,
        });
    };
    let n = p.positions.len();
    if let Some(i) = p
        .positions
        .iter()
        .position(|p| !p.iter().all(|v| v.is_finite()))
    {
        problem(format!("position {i}, {:?}, is not finite", p.positions[i]));
    }
    let mut per_position = |what: &str, len: usize| {
        if len != 0 && len != n {
            problem(format!("{len} {what} for {n} positions"));
        }
    };
    per_position("normals", p.normals.len());
    per_position("tangents", p.tangents.len());
    per_position("colors", p.colors.len());
    for (set, uvs) in p.uvs.iter().enumerate() {
        if uvs.len() != n {
            problem(format!(
                "{} texture coordinates in set {set} for {n} positions",
                uvs.len()
            ));
        }
    }
    if !p.indices.len().is_multiple_of(3) {
        problem(format!(
            "{} indices are not a multiple of 3",
            p.indices.len()
        ));
    }
    if let Some(index) = p.indices.iter().find(|&&i| i as usize >= n) {
        problem(format!("index {index}, but there are {n} positions"));
    }
    if let Some(material) = p.material.filter(|&m| m as usize >= n_materials) {
        problem(format!(
            "refers to material {material}, but there are {n_materials}"
        ));
    }
}

pub(super) fn check_detail(
    i: usize,
    detail: &DetailObject,
    n_cells: usize,
    n_meshes: usize,
    found: &mut Findings,
) {
    let owner = || format!("detail {i} ({})", detail.name);
    check_cell_list(owner, &detail.cells, n_cells, found);
    let mut problem = |problem: String| {
        let (detail, name) = (i as u32, detail.name.clone());
        found.push(GraphError::Detail {
            detail,
            name,
            problem,
        });
    };
    if detail.mesh as usize >= n_meshes {
        problem(format!(
            "refers to mesh {}, but there are {n_meshes}",
            detail.mesh
        ));
    }
    let t = &detail.transform;
    if !t.iter().all(|v| v.is_finite()) {
        problem("the transform is not finite".into());
    } else if [t[3], t[7], t[11], t[15]] != [0.0, 0.0, 0.0, 1.0] {
        problem("the transform's last row is not 0 0 0 1".into());
    }
}
