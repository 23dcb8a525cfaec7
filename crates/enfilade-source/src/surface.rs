//! The surface of a field as triangles.
//!
//! A vertex in each cell of a lattice that the surface crosses, a quadrangle around each edge that it crosses: dual
//! contouring (Ju, Losasso, Schaefer & Warren 2002) where the field knows its normals, so that edges stay sharp, and surface nets
//! (Gibson 1998) where it does not. The result is closed: each edge has an even number of triangles.

use std::collections::HashMap;

use enfilade_geom::{Aabb, DMat4, DVec3, Sets};

use crate::blocks::{BLOCK, Lattice, Spent, for_blocks, forecast};
use crate::patches::{EDGES, NONE, Pieces};
use crate::qef::nearest_to_planes;
use crate::simplify::simplify;
use crate::{Field, SourceError, SourceLimits};

/// Where to look for a surface, and how exactly.
#[derive(Clone, Debug)]
pub struct ExtractOptions {
    /// Points at which the field is evaluated. All zeros lie between them.
    pub lattice: Lattice,
    /// Space of the field to that of the surface.
    pub placement: DMat4,
    /// Largest distance of the simplified surface from the extracted one, in the space of the surface; 0 simplifies nothing.
    pub tolerance: f64,
    /// Pieces of surface whose box is smaller than this along all axes are left out, as noise; in the space of the surface.
    pub least_piece: f64,
}

/// Steps of air or matter around the box of a field, and a fraction, so that planes at round coordinates do not pass
/// through points of the lattice.
const MARGIN: f64 = 2.372;
/// Largest distance of the simplified surface from the extracted one, in steps. Much less than what separates two surfaces that
/// the lattice tells apart, and so little that a tube of six steps across does not become a prism.
pub(crate) const TOLERANCE: f64 = 0.1;

impl ExtractOptions {
    /// Returns the usual options for a field with its surface in a box.
    #[must_use]
    pub fn of_step(bounds: Aabb, step: f64) -> Self {
        let n = (bounds.size() / step + 2.0 * MARGIN).ceil();
        Self {
            lattice: Lattice {
                origin: bounds.min - MARGIN * step,
                step,
                n_cells: n.to_array().map(|x| (x as i32).clamp(1, 1 << 30)),
            },
            placement: DMat4::IDENTITY,
            tolerance: step * TOLERANCE,
            least_piece: 0.0,
        }
    }
}

/// A closed surface; front faces, counter-clockwise, face the air.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Vertices.
    pub positions: Vec<DVec3>,
    /// Triangles as triples of vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// Largest distance between it and the surface of the field, found at each vertex and in the middle of each face before it
    /// was simplified, plus the largest distance that a vertex had from the simplified surface.
    pub distance: f64,
    /// Points at which the field was evaluated to find it.
    pub n_samples: u64,
    /// Triangles before it was simplified.
    pub n_extracted: u64,
    /// Pieces left out because they are as small as noise.
    pub n_dropped: u64,
}

/// Extracts the surface of a field.
///
/// Details that no edge of the lattice crosses are lost. Time grows with the surface, not with the volume around it.
///
/// # Errors
///
/// If a limit is exceeded, or nothing of a surface is found.
pub fn extract(
    field: &dyn Field,
    options: &ExtractOptions,
    limits: &SourceLimits,
) -> Result<Surface, SourceError> {
    let mut spent = Spent::new(limits);
    let unit = unit(&options.placement);
    forecast(field, &options.lattice, unit, &mut spent)?;
    let mut net = Net::new(options);
    for_blocks(
        field,
        &options.lattice,
        &mut spent,
        &mut |field, from, spent| net.add_block(field, from, spent),
    )?;
    net.add_faces(limits)?;
    if net.quads.is_empty() {
        let problem = "there is none: all is matter or all is air";
        return Err(SourceError::new("surface", problem));
    }
    let distance = net.distance(field, &mut spent)?;
    let mut surface = net.finish();
    surface.n_samples = spent.n_samples;
    if options.least_piece > 0.0 {
        surface.n_dropped = drop_small(
            &mut surface.triangles,
            &surface.positions,
            options.least_piece,
            limits,
        )?;
        if surface.triangles.is_empty() {
            let problem = "all pieces are as small as noise; check the level";
            return Err(SourceError::new("surface", problem));
        }
    }
    surface.n_extracted = surface.triangles.len() as u64;
    surface.distance = distance;
    if options.tolerance > 0.0 {
        surface.distance += simplify(
            &mut surface.positions,
            &mut surface.triangles,
            options.tolerance,
            limits.purse(),
        );
        limits.go_on()?;
    }
    Ok(surface)
}

/// Returns the length of the shortest axis of a placement.
fn unit(placement: &DMat4) -> f64 {
    let lengths = DVec3::AXES.map(|a| placement.transform_vector3(a).length());
    lengths.into_iter().fold(f64::INFINITY, f64::min)
}

/// A cell with surface in it.
struct NetCell {
    at: [i32; 3],
    /// Vertices of the cell in matter, as bits.
    matter: u8,
    /// Index of its first vertex.
    first: u32,
}

struct Net<'o> {
    options: &'o ExtractOptions,
    pieces: Pieces,
    cells: Vec<NetCell>,
    cell_at: HashMap<[i32; 3], u32>,
    /// In the space of the field.
    vertices: Vec<DVec3>,
    quads: Vec<[u32; 4]>,
    max_triangles: u64,
}

impl<'o> Net<'o> {
    fn new(options: &'o ExtractOptions) -> Self {
        Self {
            options,
            pieces: Pieces::new(),
            cells: Vec::new(),
            cell_at: HashMap::new(),
            vertices: Vec::new(),
            quads: Vec::new(),
            max_triangles: 0,
        }
    }

    fn add_block(
        &mut self,
        field: &dyn Field,
        from: [i32; 3],
        spent: &mut Spent<'_>,
    ) -> Result<(), SourceError> {
        const N: usize = BLOCK as usize + 1;
        self.max_triangles = spent.limits.max_triangles;
        let lattice = &self.options.lattice;
        spent.count(field, (N * N * N) as u64)?;
        let mut values = [0.0; N * N * N];
        let at_of = |i: usize| [i % N, i / N % N, i / (N * N)];
        for (i, value) in values.iter_mut().enumerate() {
            let at = at_of(i);
            *value = field.at(lattice.point([0, 1, 2].map(|a| from[a] + at[a] as i32)));
            if value.is_nan() {
                let p = lattice.point([0, 1, 2].map(|a| from[a] + at[a] as i32));
                let place = format!("point {}, {}, {}", p.x, p.y, p.z);
                return Err(SourceError::new(place, "the field has no value there"));
            }
        }
        for i in 0..values.len() {
            let at = at_of(i);
            if at.contains(&(N - 1)) {
                continue;
            }
            let corner = |v: usize| values[i + (v & 1) + (v >> 1 & 1) * N + (v >> 2) * N * N];
            let matter = (0..8).fold(0_u8, |m, v| m | u8::from(corner(v) < 0.0) << v);
            if matter != 0 && matter != u8::MAX {
                let cell = [0, 1, 2].map(|a| from[a] + at[a] as i32);
                spent.count(field, 48)?;
                self.add_cell(field, cell, matter, &corner)?;
            }
        }
        Ok(())
    }

    fn add_cell(
        &mut self,
        field: &dyn Field,
        at: [i32; 3],
        matter: u8,
        value: &dyn Fn(usize) -> f64,
    ) -> Result<(), SourceError> {
        let lattice = &self.options.lattice;
        let point = |v: usize| lattice.point([0, 1, 2].map(|a| at[a] + (v >> a & 1) as i32));
        let pieces = self.pieces.of(matter);
        let first = self.vertices.len() as u32;
        let n = pieces
            .iter()
            .filter(|&&p| p != NONE)
            .max()
            .map_or(0, |&p| p + 1);
        for piece in 0..n {
            let (mut points, mut normals) = (Vec::with_capacity(12), Vec::with_capacity(12));
            for (e, [a, b]) in EDGES.into_iter().enumerate() {
                if pieces[e] != piece {
                    continue;
                }
                let p = crossing(field, [point(a), point(b)], [value(a), value(b)]);
                points.push(p);
                normals.extend(field.normal(p));
            }
            let mean = points.iter().sum::<DVec3>() / points.len() as f64;
            let mut vertex = mean;
            if normals.len() == points.len() {
                let sharp = nearest_to_planes(&points, &normals);
                let limits = Aabb::new(point(0), point(7));
                if limits.contains(sharp) {
                    vertex = sharp;
                }
            }
            self.vertices.push(vertex);
        }
        // A closed surface has two triangles for each vertex.
        if self.vertices.len() as u64 * 2 > self.max_triangles {
            let most = self.max_triangles;
            let problem = format!("has more than {most} triangles; give a coarser step");
            return Err(SourceError::new("surface", problem));
        }
        self.cell_at.insert(at, self.cells.len() as u32);
        self.cells.push(NetCell { at, matter, first });
        Ok(())
    }

    /// Adds a quadrangle around each edge of the lattice that the surface crosses.
    fn add_faces(&mut self, limits: &SourceLimits) -> Result<(), SourceError> {
        for cell in &self.cells {
            limits.spend(4)?;
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                let is_in = cell.matter & 1 == 1;
                if is_in == (cell.matter >> (1 << axis) & 1 == 1) {
                    continue;
                }
                // The cells around the edge, and the vertex of each from which it starts.
                let around = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[du, dv]| {
                    let mut at = cell.at;
                    at[u] -= du;
                    at[v] -= dv;
                    let start = (du as usize) << u | (dv as usize) << v;
                    let found = self.cell_at.get(&at).map(|&i| &self.cells[i as usize])?;
                    let edge = EDGES
                        .iter()
                        .position(|e| *e == [start, start | 1 << axis])?;
                    Some(found.first + u32::from(self.pieces.of(found.matter)[edge]))
                });
                let [Some(a), Some(b), Some(c), Some(d)] = around else {
                    let p = self.options.lattice.point(cell.at);
                    let place = format!("point {}, {}, {}", p.x, p.y, p.z);
                    let problem = "the surface leaves the lattice; give a larger box";
                    return Err(SourceError::new(place, problem));
                };
                // From -u-v around to +u-v and on, it faces along the axis; the air lies ahead if the start is in matter.
                self.quads
                    .push(if is_in { [a, b, c, d] } else { [d, c, b, a] });
            }
        }
        Ok(())
    }

    /// Returns the largest distance of vertices and middles of faces from a zero of the field, in the space of the surface.
    fn distance(&self, field: &dyn Field, spent: &mut Spent<'_>) -> Result<f64, SourceError> {
        let step = self.options.lattice.step;
        let mut largest: f64 = 0.0;
        let (mut last, mut narrowed) = (None, None);
        let block_of = |p: DVec3| {
            let q = (p - self.options.lattice.origin) / (step * f64::from(BLOCK));
            q.to_array().map(|c| c.floor() as i32)
        };
        let middles = self
            .quads
            .iter()
            .map(|q| q.iter().map(|&i| self.vertices[i as usize]).sum::<DVec3>() * 0.25);
        for p in self.vertices.iter().copied().chain(middles) {
            let block = block_of(p);
            if last != Some(block) {
                let lattice = &self.options.lattice;
                let from = lattice.point(block.map(|c| c * BLOCK));
                let to = lattice.point(block.map(|c| (c + 1) * BLOCK));
                let within = Aabb::new(from, to).expanded(2.5 * step);
                (last, narrowed) = (Some(block), field.narrowed(&within));
            }
            let field = narrowed.as_deref().unwrap_or(field);
            spent.count(field, 16)?;
            largest = largest.max(self.distance_at(field, p));
        }
        Ok(largest)
    }

    /// Returns the length, in the space of the surface, of a straight way from a point to the other side of the surface.
    fn distance_at(&self, field: &dyn Field, p: DVec3) -> f64 {
        let step = self.options.lattice.step;
        let h = step * 0.01;
        let d = |axis: DVec3| field.at(p + axis * h) - field.at(p - axis * h);
        let up = DVec3::new(d(DVec3::X), d(DVec3::Y), d(DVec3::Z));
        let value = field.at(p);
        if value == 0.0 {
            return 0.0;
        }
        let length = |way: DVec3| self.options.placement.transform_vector3(way).length();
        // From matter along the gradient to the air, and back. Where edges meet, there is none.
        let steepest = up.normalize_or_zero() * -value.signum();
        let cube = Aabb::new(DVec3::NEG_ONE, DVec3::ONE).corners();
        let diagonals = cube.into_iter().map(DVec3::normalize);
        let ways: Vec<DVec3> = std::iter::once(steepest).chain(diagonals).collect();
        let mut at = step / 1024.0;
        while at < 2.0 * step {
            let is_across = |w: &&DVec3| (field.at(p + **w * at) < 0.0) != (value < 0.0);
            let (first, others) = ways.split_at(1);
            let found = first.iter().find(is_across);
            // More values only where the gradient does not lead across.
            let found = found.or_else(|| others.iter().find(|w| at > step * 0.1 && is_across(w)));
            if let Some(way) = found {
                return length(*way * at);
            }
            at *= 1.5;
        }
        // In a cell with a zero on one of its edges.
        length(DVec3::ONE * step)
    }

    fn finish(self) -> Surface {
        let place = |p: &DVec3| self.options.placement.transform_point3(*p);
        let positions: Vec<DVec3> = self.vertices.iter().map(place).collect();
        let is_mirrored = self.options.placement.determinant() < 0.0;
        let mut triangles = Vec::with_capacity(self.quads.len() * 2);
        for [a, b, c, d] in self.quads {
            // Along the shorter diagonal.
            let length =
                |i: u32, k: u32| positions[i as usize].distance_squared(positions[k as usize]);
            let mut pair = if length(a, c) <= length(b, d) {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            };
            if is_mirrored {
                pair.iter_mut().for_each(|t| t.swap(1, 2));
            }
            triangles.extend(pair);
        }
        Surface {
            positions,
            triangles,
            ..Surface::default()
        }
    }
}

/// Drops pieces whose box is smaller than `least` along all axes, and returns how many.
fn drop_small(
    triangles: &mut Vec<[u32; 3]>,
    positions: &[DVec3],
    least: f64,
    limits: &SourceLimits,
) -> Result<u64, SourceError> {
    let mut pieces = Sets::new(positions.len());
    for [a, b, c] in &*triangles {
        limits.spend(1)?;
        pieces.join(*a, *b);
        pieces.join(*a, *c);
    }
    let mut boxes: HashMap<u32, Aabb> = HashMap::new();
    for [a, b, c] in &*triangles {
        limits.spend(1)?;
        let bounds = boxes.entry(pieces.find(*a)).or_insert(Aabb::EMPTY);
        *bounds = [a, b, c]
            .iter()
            .fold(*bounds, |t, &&i| t.including(positions[i as usize]));
    }
    let is_small = |b: &Aabb| b.size().max_element() < least;
    triangles.retain(|t| !boxes.get(&pieces.find(t[0])).is_some_and(is_small));
    Ok(boxes.values().filter(|b| is_small(b)).count() as u64)
}

/// Returns the place where a field changes its sign between two points.
fn crossing(field: &dyn Field, [mut a, mut b]: [DVec3; 2], [mut va, mut vb]: [f64; 2]) -> DVec3 {
    // The rule of false position, by the variant of Illinois: halves the value that stays.
    let mut side = 0;
    for _ in 0..16 {
        let t = va / (va - vb);
        let p = a.lerp(b, t.clamp(0.0, 1.0));
        if a.distance_squared(b) < 1e-20 * p.length_squared() {
            return p;
        }
        let v = field.at(p);
        if v == 0.0 || v.abs() < 1e-13 * (va.abs() + vb.abs()) {
            return p;
        }
        if (v < 0.0) == (va < 0.0) {
            (a, va) = (p, v);
            if side == 1 {
                vb *= 0.5;
            }
            side = 1;
        } else {
            (b, vb) = (p, v);
            if side == -1 {
                va *= 0.5;
            }
            side = -1;
        }
    }
    a.lerp(b, va / (va - vb))
}
