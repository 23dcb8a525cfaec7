//! A world: its file, and its graph as arrays.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock};

use enfilade::cpg::wire::{decode_glb, encode_glb};
use enfilade::cpg::{Cell, CellId, PortalId, PortalKind, Pvs, Why, World as File};
use enfilade::geom::{DVec3, Triangle};
use enfilade::runtime::Sight;
use enfilade::vis::{VisConfig, VisContext, VisMode, see_world};
use enfilade::world::{Agent, Space, WalkMap};
use enfilade_report::{Verdict, room_facts};
use enfilade_verify::structural_triangles;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::{PyIndexError, PyKeyboardInterrupt};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::{Points, table};
use crate::errors::{EnfiladeError, WorldError, of_file};
use crate::watch::run;

/// Cell of points in matter, or outside of everything.
const MATTER: i32 = -1;

/// Facts of a room: cell, storeys, floor area, height, and the numbers of its doors and windows.
type RoomRow = (u32, Vec<String>, [f64; 4], (usize, usize));

/// A world, and what queries keep of it.
#[pyclass(frozen, module = "enfilade._native")]
pub(crate) struct World {
    pub(crate) world: Arc<File>,
    sight: OnceLock<Sight>,
    space: OnceLock<Space>,
    /// The floors of the last walker.
    pub(crate) map: Mutex<Option<KeptMap>>,
    pvs: OnceLock<Pvs>,
}

/// The floors of a walker, and whether objects are in the way.
pub(crate) struct KeptMap {
    pub(crate) walker: Agent,
    pub(crate) objects: bool,
    pub(crate) map: Arc<WalkMap>,
}

/// Rows of unequal length as in `scipy.sparse.csr_array`: ends of rows, and columns.
type SparseRows<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i32>>);

/// Counts, and texts, by name.
type AboutTables = (Vec<(String, f64)>, Vec<(String, String)>);

/// The reason of a decision, its margin, its limit, its facts by name, and all in words.
type ToldWhy = (
    &'static str,
    f32,
    Option<f32>,
    BTreeMap<&'static str, f32>,
    String,
);

/// Names, kinds, volumes, bounds (two rows each), triangles, and portals of each cell.
type CellTable<'py> = (
    Vec<String>,
    Vec<&'static str>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<i64>>,
    Vec<Vec<u32>>,
);

/// Pairs of cells, kinds, areas, sizes, centers, normals and outlines.
type PortalTable<'py> = (
    Bound<'py, PyArray2<i32>>,
    Vec<&'static str>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Vec<Bound<'py, PyArray2<f32>>>,
);

impl World {
    pub(crate) fn new(world: File) -> Self {
        let pvs = OnceLock::new();
        if let Some(known) = &world.pvs {
            let _ = pvs.set(known.clone());
        }
        Self {
            world: Arc::new(world),
            sight: OnceLock::new(),
            space: OnceLock::new(),
            map: Mutex::new(None),
            pvs,
        }
    }

    /// Returns what views need, made once.
    pub(crate) fn sight(&self) -> PyResult<&Sight> {
        if let Some(sight) = self.sight.get() {
            return Ok(sight);
        }
        let sight = Sight::build(&self.world).map_err(|e| WorldError::new_err(e.to_string()))?;
        Ok(self.sight.get_or_init(|| sight))
    }

    /// Returns what paths need, made once.
    pub(crate) fn space(&self) -> PyResult<&Space> {
        if let Some(space) = self.space.get() {
            return Ok(space);
        }
        let space = Space::new(Arc::clone(&self.world));
        let space = space.map_err(|e| WorldError::new_err(e.to_string()))?;
        Ok(self.space.get_or_init(|| space))
    }

    /// Returns portals by id.
    pub(crate) fn portals_of(&self, ids: &[i64]) -> PyResult<Vec<PortalId>> {
        let n = self.world.graph.portals.len();
        let known = |&id: &i64| {
            let id = u32::try_from(id).ok().filter(|&id| (id as usize) < n);
            id.map(PortalId)
        };
        ids.iter()
            .map(|id| {
                known(id).ok_or_else(|| {
                    let text = format!("portal {id}: the world has {n} portals, counted from 0");
                    PyIndexError::new_err(text)
                })
            })
            .collect()
    }

    /// Computes what is seen from each cell, unless it is known.
    fn computed_pvs(
        &self,
        py: Python<'_>,
        is_fast: bool,
        threads: Option<usize>,
        max_memory: Option<u64>,
    ) -> PyResult<Pvs> {
        if let Some(pvs) = self.pvs.get() {
            return Ok(pvs.clone());
        }
        let mut config = VisConfig::default();
        if is_fast {
            config.mode = VisMode::Fast;
        }
        config.max_memory = max_memory.unwrap_or(config.max_memory);
        let world = Arc::clone(&self.world);
        let found = run(py, threads, None, move |watcher| {
            let walls: Vec<Triangle> = (structural_triangles(&world).into_iter())
                .map(|(triangle, _)| triangle)
                .collect();
            let mut context = VisContext {
                on_round: &mut |_, _| !watcher.is_cancelled(),
                walls: Some(&walls),
                checkpoint: None,
            };
            let found = see_world(&world.graph, &config, &mut context);
            if watcher.is_cancelled() {
                return Err(PyKeyboardInterrupt::new_err(()));
            }
            let found = found.map_err(|e| EnfiladeError::new_err(e.to_string()))?;
            let mut pvs = found.vis.cells;
            (pvs.parts, pvs.volumes) = (None, None);
            Ok(pvs)
        })??;
        // The quick answer is larger than the exact one, and so not kept.
        Ok(if is_fast {
            found
        } else {
            self.pvs.get_or_init(|| found).clone()
        })
    }
}

#[pymethods]
impl World {
    /// Reads a world.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let world = py.detach(|| enfilade::open(&path));
        world.map(Self::new).map_err(|e| of_file(&e))
    }

    /// Reads a world from memory.
    #[staticmethod]
    fn of_bytes(py: Python<'_>, bytes: &[u8]) -> PyResult<Self> {
        let world = py.detach(|| decode_glb(bytes));
        let bad = |e: enfilade::cpg::wire::WireError| WorldError::new_err(format!("bytes: {e}"));
        world.map(Self::new).map_err(bad)
    }

    /// Writes it, with what is seen from each cell if that is known and wanted.
    fn save(&self, py: Python<'_>, path: PathBuf, has_pvs: bool) -> PyResult<()> {
        py.detach(|| enfilade::save(&path, &self.whole(has_pvs)))
            .map_err(|e| of_file(&e))
    }

    /// Returns its file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = py.detach(|| encode_glb(&self.world));
        let bytes = bytes.map_err(|e| WorldError::new_err(e.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Returns the verdict as a sentence.
    fn verdict(&self) -> String {
        Verdict::of(&self.world, &[]).untried().to_string()
    }

    /// Returns counts of the bake by name, and its provenance.
    fn about(&self) -> AboutTables {
        let graph = &self.world.graph;
        let made = &graph.provenance;
        let mut about = vec![
            ("generator".to_owned(), made.generator.clone()),
            ("method".to_owned(), made.method.clone()),
            ("input_hash".to_owned(), made.input_hash.clone()),
        ];
        about.extend(made.settings.clone());
        let counts = graph.statistics.counts.clone();
        (counts.into_iter().collect(), about)
    }

    /// Returns all cells as columns.
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<CellTable<'py>> {
        let cells = &self.world.graph.cells;
        let portals = |c: &Cell| c.portals.iter().map(|p| p.0).collect();
        Ok((
            cells.iter().map(|c| c.name.clone()).collect(),
            cells.iter().map(cell_kind).collect(),
            PyArray1::from_iter(py, cells.iter().map(|c| c.volume)),
            table(py, cells.iter().flat_map(|c| c.aabb))?,
            PyArray1::from_iter(py, cells.iter().map(|c| i64::from(c.n_triangles))),
            cells.iter().map(portals).collect(),
        ))
    }

    /// Returns all portals as columns.
    fn portals<'py>(&self, py: Python<'py>) -> PyResult<PortalTable<'py>> {
        let portals = &self.world.graph.portals;
        let outline = |p: &enfilade::Portal| table(py, p.outline.iter().copied());
        let ends = portals.iter().map(|p| p.cells.map(|c| c.0 as i32));
        Ok((
            table(py, ends)?,
            portals.iter().map(|p| portal_kind(p.kind)).collect(),
            PyArray1::from_iter(py, portals.iter().map(|p| p.area)),
            table(py, portals.iter().map(enfilade::Portal::size))?,
            table(py, portals.iter().map(enfilade::Portal::center))?,
            table(py, portals.iter().map(|p| p.normal))?,
            portals.iter().map(outline).collect::<PyResult<_>>()?,
        ))
    }

    /// Returns the decisions about each cell.
    fn cell_whys(&self) -> Vec<Vec<ToldWhy>> {
        let cells = self.world.graph.cells.iter();
        cells.map(|c| c.why.iter().map(told).collect()).collect()
    }

    /// Returns the decisions about each portal.
    fn portal_whys(&self) -> Vec<Vec<ToldWhy>> {
        let portals = self.world.graph.portals.iter();
        portals.map(|p| p.why.iter().map(told).collect()).collect()
    }

    /// Returns the facts of rooms: cell, storeys; floor area, its parts above 1.5 m and 2.3 m, height; doors, windows.
    fn rooms(&self, py: Python<'_>) -> Vec<RoomRow> {
        let facts = py.detach(|| room_facts(&self.world).into_owned());
        let rows = facts.into_iter().map(|room| {
            let counts = (room.n_doors, room.n_windows);
            let measures = [
                room.floor_area,
                room.area_above_1_5,
                room.area_above_2_3,
                room.height,
            ];
            (room.cell.0, room.storeys, measures, counts)
        });
        rows.collect()
    }

    /// Returns points of places, and the decision about each.
    fn places(&self) -> Vec<([f32; 3], ToldWhy)> {
        let places = self.world.graph.places.iter();
        places.map(|place| (place.at, told(&place.why))).collect()
    }

    /// Returns the cells of points.
    fn locate<'py>(
        &self,
        py: Python<'py>,
        points: Points<'py>,
    ) -> PyResult<Bound<'py, PyArray1<i32>>> {
        let points = points.rows("points")?;
        let locator = &self.world.graph.locator;
        let cell = |p: [f64; 3]| locator.locate(DVec3::from_array(p));
        let cells: Vec<i32> = py.detach(|| {
            let found = points.into_iter().map(cell);
            found.map(|c| c.map_or(MATTER, |c| c.0 as i32)).collect()
        });
        Ok(PyArray1::from_vec(py, cells))
    }

    /// Returns for each cell the cells that may be seen from it.
    fn pvs<'py>(
        &self,
        py: Python<'py>,
        is_fast: bool,
        threads: Option<usize>,
        max_memory: Option<u64>,
    ) -> PyResult<SparseRows<'py>> {
        let pvs = self.computed_pvs(py, is_fast, threads, max_memory)?;
        let (mut ends, mut columns) = (vec![0], Vec::new());
        for cell in 0..pvs.n_cells() as u32 {
            columns.extend(pvs.visible_from(CellId(cell)).map(|c| c.0 as i32));
            ends.push(columns.len() as i64);
        }
        Ok((
            PyArray1::from_vec(py, ends),
            PyArray1::from_vec(py, columns),
        ))
    }
}

impl World {
    /// Returns the world as it is written.
    fn whole(&self, has_pvs: bool) -> Cow<'_, File> {
        match self.pvs.get() {
            Some(pvs) if has_pvs && self.world.pvs.is_none() => {
                let pvs = Some(pvs.clone());
                Cow::Owned(File {
                    pvs,
                    ..File::clone(&self.world)
                })
            }
            _ => Cow::Borrowed(&self.world),
        }
    }
}

fn told(why: &Why) -> ToldWhy {
    let facts = why.facts.iter().map(|(fact, &value)| (fact.name(), value));
    (
        why.reason.name(),
        why.margin(),
        why.limit,
        facts.collect(),
        why.to_string(),
    )
}

fn cell_kind(cell: &Cell) -> &'static str {
    match (cell.outdoor, cell.is_void) {
        (true, _) => "outdoors",
        (_, true) => "void",
        _ => "room",
    }
}

fn portal_kind(kind: PortalKind) -> &'static str {
    match kind {
        PortalKind::Open => "open",
        PortalKind::Door => "door",
        PortalKind::Window => "window",
        PortalKind::Crack => "crack",
    }
}
