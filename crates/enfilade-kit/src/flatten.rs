//! From instances to one world: cells, portals, locator and geometry of all, as a bake would have made them.

use std::collections::BTreeMap;
use std::sync::Arc;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, Fitting, Motion, MotionKind, Portal, PortalId,
    PortalKind, Provenance, SourceRuns, World, shifted_textures,
};
use enfilade_geom::scene::{Fixture, Primitive, SourceNode};
use enfilade_geom::{Aabb, DVec3, Triangle};
use enfilade_world::Pose;

use crate::assembly::Assembly;
use crate::fit::point;
use crate::instance::{End, Instance, InstanceId, Link};
use crate::piece::Piece;
use crate::prepare::{measure, part_of};
use crate::tree::{Planted, grown};

/// Distance from the outermost walls to the box of the locator. [Units: wu]
const AROUND: f64 = 1.0;
/// Distance within which walls touch the air beside them. [Units: wu]
const BESIDE: f64 = 1e-3;
/// The one outdoors.
const OUTDOORS: CellId = CellId(0);

/// Reason why an assembly cannot be a world in one piece.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{} was allowed to overlap others, and a world in one piece has one cell at each point; place it elsewhere, or use the assembly as a space", enfilade_geom::shown(.0))]
pub struct FlattenError(pub String);

impl Assembly {
    /// Returns the level as one world: the outdoors of all pieces are one cell, and openings that meet are one portal.
    ///
    /// O(n log n) in the instances, linear in their contents. Detail objects share their meshes, and all pieces' materials and images
    /// are there once; walls are copied, because cells hold them in world space. Cells are named by their instances.
    ///
    /// # Errors
    ///
    /// If an instance was allowed to overlap others.
    pub fn flattened(&self) -> Result<World, FlattenError> {
        let overlapping = self.instances().find(|(_, instance)| instance.overlaps);
        if let Some((_, instance)) = overlapping {
            return Err(FlattenError(instance.name.clone()));
        }
        let mut flat = Flat::new(self);
        for (id, instance) in self.instances() {
            flat.add_cells(id, instance);
        }
        for (id, instance) in self.instances() {
            flat.add_geometry(id, instance);
        }
        for (id, instance) in self.instances() {
            flat.add_portals(id, instance);
        }
        Ok(flat.finish())
    }
}

/// A world that grows by instances.
struct Flat<'a> {
    level: &'a Assembly,
    world: World,
    /// Per instance that stands, the number of its first cell less the place of its outdoors among its cells, and of its first
    /// detail object and source.
    firsts: BTreeMap<InstanceId, Firsts>,
    /// Per piece in use, the first of its materials and of its meshes.
    shared: BTreeMap<usize, [u32; 2]>,
}

#[derive(Clone, Copy, Default)]
struct Firsts {
    cell: u32,
    detail: u32,
    source: u32,
}

impl<'a> Flat<'a> {
    fn new(level: &'a Assembly) -> Self {
        let mut world = World::default();
        world.graph.cells.push(Cell {
            name: "outdoors".into(),
            outdoor: true,
            ..Cell::default()
        });
        Self {
            level,
            world,
            firsts: BTreeMap::new(),
            shared: BTreeMap::new(),
        }
    }

    fn piece(&self, instance: &Instance) -> &'a Piece {
        &self.level.kit().pieces()[instance.piece]
    }

    /// Returns the number of an instance's cell in the whole.
    fn cell(&self, id: InstanceId, cell: CellId) -> CellId {
        let outdoors = self.level.piece(id).outdoors;
        cell_after(self.firsts[&id].cell, outdoors, cell)
    }

    fn add_cells(&mut self, id: InstanceId, instance: &Instance) {
        let piece = self.piece(instance);
        let graph = &piece.world().graph;
        let first = self.world.graph.cells.len() as u32;
        self.firsts.insert(
            id,
            Firsts {
                cell: first,
                ..Firsts::default()
            },
        );
        let is_one = graph.rooms().count() == 1;
        for (_, cell) in graph.indoor_cells() {
            let name = if is_one && cell.is_room() {
                instance.name.clone()
            } else {
                format!("{}.{}", instance.name, cell.name)
            };
            self.world.graph.cells.push(Cell {
                name,
                portals: Vec::new(),
                ..cell.clone()
            });
        }
    }

    /// Adds what all instances of a piece share; returns the first of its materials and meshes.
    fn shared(&mut self, number: usize) -> [u32; 2] {
        if let Some(known) = self.shared.get(&number) {
            return *known;
        }
        let from = self.level.kit().pieces()[number].world();
        let to = &mut self.world;
        let first_image = to.images.len() as u32;
        let first_texture = to.textures.len() as u32;
        let firsts = [to.materials.len() as u32, to.detail_meshes.len() as u32];
        to.images.extend_from_slice(&from.images);
        to.textures
            .extend(from.textures.iter().cloned().map(|mut texture| {
                texture.image = texture.image.map(|i| i + first_image);
                texture
            }));
        to.materials
            .extend(from.materials.iter().cloned().map(|mut material| {
                material.gltf = shifted_textures(&material.gltf, first_texture);
                material
            }));
        to.detail_meshes
            .extend(from.detail_meshes.iter().cloned().map(|mut mesh| {
                for primitive in &mut mesh.primitives {
                    primitive.material = primitive.material.map(|m| m + firsts[0]);
                }
                mesh
            }));
        let copyright = &from.about.copyright;
        if !copyright.is_empty() && !to.about.copyright.contains(copyright.as_str()) {
            if !to.about.copyright.is_empty() {
                to.about.copyright.push('\n');
            }
            to.about.copyright.push_str(copyright);
        }
        self.shared.insert(number, firsts);
        firsts
    }

    fn add_geometry(&mut self, id: InstanceId, instance: &Instance) {
        let piece = self.piece(instance);
        let [first_material, first_mesh] = self.shared(instance.piece);
        let from = piece.world();
        let first_detail = self.world.details.len() as u32;
        let top = self.world.sources.len() as u32;
        let has_sources = !from.sources.is_empty();
        let first_source = top + 1;
        if has_sources {
            self.world.sources.push(SourceNode {
                name: instance.name.clone(),
                ..SourceNode::default()
            });
            let nodes = from.sources.iter().cloned().map(|mut node| {
                node.parent = Some(node.parent.map_or(top, |p| p + first_source));
                node
            });
            self.world.sources.extend(nodes);
        }
        if let Some(firsts) = self.firsts.get_mut(&id) {
            (firsts.detail, firsts.source) = (first_detail, first_source);
        }
        let pose = &instance.pose;
        let cells = |cells: &[CellId]| {
            let mut cells: Vec<CellId> = cells.iter().map(|c| self.cell(id, *c)).collect();
            cells.sort_unstable();
            cells
        };
        let beside = self.level.beside(id);
        let mut batches: Vec<Batch> = Vec::with_capacity(from.batches.len());
        for batch in &from.batches {
            let runs = batch.sources.runs().iter();
            let runs = runs.map(|[s, n]| [s + first_source, *n]);
            let moved = Batch {
                cells: cells(&batch.cells),
                primitive: placed(&batch.primitive, pose, first_material),
                sources: SourceRuns::from_runs(runs.collect()),
                is_seal: batch.is_seal,
            };
            if moved.cells.contains(&OUTDOORS) {
                batches.extend(self.seen_beside(&beside, moved));
            } else {
                batches.push(moved);
            }
        }
        let mut details = Vec::with_capacity(from.details.len());
        for detail in &from.details {
            let mut detail = detail.clone();
            let transform = pose.matrix() * detail.placement();
            detail.transform = transform.to_cols_array().map(|x| x as f32);
            detail.cells = cells(&detail.cells);
            detail.mesh += first_mesh;
            detail.source = detail.source.map(|s| s + first_source);
            detail.part_of = detail.part_of.map(|d| d + first_detail);
            details.push(detail);
        }
        self.world.batches.append(&mut batches);
        self.world.details.append(&mut details);
        let fixtures = from.fixtures.iter().map(|fixture| Fixture {
            transform: pose.matrix() * fixture.transform,
            ..fixture.clone()
        });
        self.world.fixtures.extend(fixtures);
    }

    /// Returns the parts of a batch by the cells of instances beside it that its triangles touch, and lists these: rims of openings
    /// that meet, and walls that touch the air of others.
    fn seen_beside(&self, beside: &[InstanceId], batch: Batch) -> Vec<Batch> {
        let mut groups: BTreeMap<Vec<CellId>, Vec<usize>> = BTreeMap::new();
        for (k, t) in batch.primitive.triangles().enumerate() {
            let mut cells = batch.cells.clone();
            self.add_cells_beside(beside, &t, &mut cells);
            cells.sort_unstable();
            cells.dedup();
            groups.entry(cells).or_default().push(k);
        }
        if groups.len() == 1 && groups.contains_key(&batch.cells) {
            return vec![batch];
        }
        let part = |(cells, members): (Vec<CellId>, Vec<usize>)| Batch {
            cells,
            ..part_of(&batch, |k| members.binary_search(&k).is_ok())
        };
        groups.into_iter().map(part).collect()
    }

    /// Adds the cells of instances that a triangle touches.
    fn add_cells_beside(&self, beside: &[InstanceId], t: &Triangle, cells: &mut Vec<CellId>) {
        for &other in beside {
            let piece = self.level.piece(other);
            let own = t.map(|p| self.level.instance(other).pose.point_back(p));
            if !Aabb::of_points(&own).overlaps(&piece.shape.air_bounds.expanded(BESIDE)) {
                continue;
            }
            let mut touched = Vec::new();
            let locator = &piece.world().graph.locator;
            locator.cells_touching(&own, &mut touched);
            cells.extend(touched.into_iter().map(|c| self.cell(other, c)));
        }
    }

    /// Adds the portals of an instance. Of openings that meet, the instance placed first has the portal.
    fn add_portals(&mut self, id: InstanceId, instance: &Instance) {
        let piece = self.piece(instance);
        let graph = &piece.world().graph;
        let mut links: BTreeMap<PortalId, Link> = BTreeMap::new();
        for (attachment, link) in piece.attachments().iter().zip(&instance.links) {
            links.insert(attachment.portal, *link);
        }
        for number in graph.portal_ids() {
            let link = links.get(&number).copied().unwrap_or(Link::Open);
            let joined = match link {
                Link::Blocked(_) => continue,
                Link::Joined(other) if other.instance < id => continue,
                Link::Joined(other) => Some(other),
                Link::Open => None,
            };
            let own = &graph[number];
            let mut portal = moved_portal(own, &instance.pose);
            portal.cells = own.cells.map(|c| self.cell(id, c));
            portal.fittings = self.fittings(id, own);
            if let Some(other) = joined {
                self.join(&mut portal, other);
            }
            let added = PortalId(self.world.graph.portals.len() as u32);
            for cell in portal.cells {
                self.world.graph[cell].portals.push(added);
            }
            self.world.graph.portals.push(portal);
        }
    }

    /// Lets a portal to the outdoors lead to the cell behind another attachment.
    fn join(&self, portal: &mut Portal, other: End) {
        let its = &self.level.piece(other.instance).attachments()[other.attachment];
        let beyond = self.cell(other.instance, its.cell);
        for cell in portal.cells.iter_mut().filter(|c| **c == OUTDOORS) {
            *cell = beyond;
        }
        let graph = &self.level.piece(other.instance).world().graph;
        portal
            .fittings
            .extend(self.fittings(other.instance, &graph[its.portal]));
        portal.fittings.sort_by_key(|f| f.detail);
        portal.fittings.dedup_by_key(|f| f.detail);
        if its.kind == PortalKind::Door {
            portal.kind = PortalKind::Door;
        }
    }

    /// Returns the fittings of a portal of an instance.
    fn fittings(&self, id: InstanceId, portal: &Portal) -> Vec<Fitting> {
        let pose = &self.level.instance(id).pose;
        let first = self.firsts[&id].detail;
        let moved = portal.fittings.iter().map(|fitting| Fitting {
            detail: fitting.detail + first,
            motion: fitting.motion.map(|m| moved_motion(&m, pose)),
            ..fitting.clone()
        });
        moved.collect()
    }

    fn finish(self) -> World {
        let Self {
            level,
            mut world,
            firsts,
            ..
        } = self;
        let maps: Vec<Box<dyn Fn(CellId) -> Option<CellId>>> = (level.instances())
            .map(|(id, _)| {
                let (first, outdoors) = (firsts[&id].cell, level.piece(id).outdoors);
                let map = move |cell: CellId| {
                    (cell != outdoors).then(|| cell_after(first, outdoors, cell))
                };
                Box::new(map) as Box<dyn Fn(CellId) -> Option<CellId>>
            })
            .collect();
        let planted: Vec<Planted<'_>> = (level.instances().zip(&maps))
            .map(|((id, instance), cells)| {
                let corners = level.piece(id).bounds().corners();
                Planted {
                    locator: &level.piece(id).world().graph.locator,
                    pose: instance.pose,
                    bounds: Aabb::of_points(&corners.map(|p| instance.pose.point(p))),
                    cells,
                }
            })
            .collect();
        let bounds = planted.iter().fold(Aabb::EMPTY, |b, p| b.union(p.bounds));
        let drawn = world.batches.iter().flat_map(|b| &b.primitive.positions);
        let bounds = drawn.fold(bounds, |b, p| b.including(point(*p)));
        if !bounds.is_empty() {
            world.graph.locator = grown(bounds.expanded(AROUND), OUTDOORS, &planted).into();
        }
        Arc::make_mut(&mut world.graph.locator).outside = Some(OUTDOORS);
        list_objects(&mut world);
        (world.graph.provenance, world.graph.statistics.counts) = origin(level, &world.graph);
        measure(&mut world);
        world
    }
}

/// Lists objects that were outdoors in the cells where they are now: leaves and frames of doors that lead to others, and what
/// sticks out of one instance into another.
fn list_objects(world: &mut World) {
    let locator = &world.graph.locator;
    for detail in (world.details.iter_mut()).filter(|d| d.cells.contains(&OUTDOORS)) {
        let placement = detail.placement();
        let mesh = &world.detail_meshes[detail.mesh as usize].primitives;
        let mut cells = Vec::new();
        for t in mesh.iter().flat_map(|p| p.placed_triangles(placement)) {
            locator.cells_touching(&t, &mut cells);
        }
        // Within a wall, it keeps those around it.
        if !cells.is_empty() {
            detail.cells = cells;
        }
    }
}

/// Returns the number in the whole of a cell of an instance whose cells but the outdoors begin at `first`.
fn cell_after(first: u32, outdoors: CellId, cell: CellId) -> CellId {
    match cell.cmp(&outdoors) {
        std::cmp::Ordering::Less => CellId(first + cell.0),
        std::cmp::Ordering::Equal => OUTDOORS,
        std::cmp::Ordering::Greater => CellId(first + cell.0 - 1),
    }
}

fn rounded(p: DVec3) -> [f32; 3] {
    p.as_vec3().to_array()
}

fn placed(primitive: &Primitive, pose: &Pose, first_material: u32) -> Primitive {
    let turned = |v: &[f32; 3]| rounded(pose.direction(point(*v)));
    Primitive {
        positions: (primitive.positions.iter())
            .map(|p| rounded(pose.point(point(*p))))
            .collect(),
        normals: primitive.normals.iter().map(turned).collect(),
        tangents: (primitive.tangents.iter())
            .map(|[x, y, z, w]| {
                let [x, y, z] = turned(&[*x, *y, *z]);
                [x, y, z, *w]
            })
            .collect(),
        material: primitive.material.map(|m| m + first_material),
        ..primitive.clone()
    }
}

fn moved_portal(portal: &Portal, pose: &Pose) -> Portal {
    let polygon = |p: &Vec<[f32; 3]>| p.iter().map(|p| rounded(pose.point(point(*p)))).collect();
    Portal {
        normal: rounded(pose.direction(point(portal.normal))),
        outline: polygon(&portal.outline),
        pieces: portal.pieces.iter().map(polygon).collect(),
        ..portal.clone()
    }
}

fn moved_motion(motion: &Motion, pose: &Pose) -> Motion {
    let kind = match motion.kind {
        MotionKind::Turn { through, axis } => MotionKind::Turn {
            through: rounded(pose.point(point(through))),
            axis: rounded(pose.direction(point(axis))),
        },
        MotionKind::Slide { along } => MotionKind::Slide {
            along: rounded(pose.direction(point(along))),
        },
    };
    Motion { kind, ..*motion }
}

/// Returns the origin of a level: the settings that its pieces agree on.
fn origin(level: &Assembly, graph: &CellPortalGraph) -> (Provenance, BTreeMap<String, f64>) {
    let used: std::collections::BTreeSet<usize> = level.instances().map(|i| i.1.piece).collect();
    let mut settings: Option<BTreeMap<String, String>> = None;
    let mut holes: f64 = 0.0;
    for piece in used.iter().map(|k| &level.kit().pieces()[*k]) {
        let own = &piece.world().graph.provenance.settings;
        let hole = own.get("smallest_hole").and_then(|s| s.parse().ok());
        holes = holes.max(hole.unwrap_or(0.0));
        match &mut settings {
            None => settings = Some(own.clone()),
            Some(common) => common.retain(|name, value| own.get(name) == Some(value)),
        }
    }
    let mut settings = settings.unwrap_or_default();
    settings.insert("smallest_hole".into(), holes.to_string());
    let n_joined = graph
        .portals
        .iter()
        .filter(|p| !p.cells.contains(&OUTDOORS))
        .count();
    let counts = [
        ("instances", level.len()),
        ("pieces", used.len()),
        ("portals_indoors", n_joined),
    ];
    let provenance = Provenance {
        generator: concat!("enfilade ", env!("CARGO_PKG_VERSION"), " (kit)").into(),
        method: "kit".into(),
        settings,
        input_hash: String::new(),
    };
    let counts = counts.map(|(name, n)| (name.to_owned(), n as f64));
    (provenance, counts.into_iter().collect())
}
