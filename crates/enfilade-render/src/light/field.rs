//! The locator for shaders: its tree as a texture, and a grid of places to start in it.
//!
//! Each box of the grid stores the deepest node of the tree that contains it, so that locating a point takes a
//! few planes instead of twenty. Points are relative to the center of the locator's box, so that 32-bit floats
//! resolve millimeters.

use enfilade_cpg::Locator;
use glam::{DVec3, UVec3, Vec3};

/// Approximate number of boxes of the grid.
const BOXES: f64 = 260_000.0;
/// Margin around boxes: rounding may assign a point to a neighboring box. [Units: wu]
const MARGIN: f64 = 2e-3;

/// The locator in the layout that shaders read.
pub(crate) struct Field {
    /// Origin of its coordinates. [Units: wu]
    pub(super) origin: DVec3,
    /// Minimum of the grid, relative to the origin. [Units: wu]
    pub(super) low: Vec3,
    /// Boxes per meter.
    pub(super) density: Vec3,
    pub(super) n: UVec3,
    /// For each box, a node, or a leaf as [`Locator::leaf`] encodes it. x fastest, then y.
    pub(super) starts: Vec<i32>,
    /// Two texels of four words per node: its plane, then its children.
    pub(super) nodes: Vec<[u32; 4]>,
    /// Leaf of points outside.
    pub(super) outside: i32,
}

struct Filler<'l> {
    locator: &'l Locator,
    low: DVec3,
    size: DVec3,
    n: UVec3,
    starts: Vec<i32>,
}

impl Filler<'_> {
    /// Returns the deepest node that contains a box.
    fn descend(&self, mut at: i32, low: DVec3, high: DVec3) -> i32 {
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5 + MARGIN);
        while let Some(node) = usize::try_from(at).ok().map(|i| &self.locator.nodes[i]) {
            let [x, y, z, d] = self.locator.planes[node.plane as usize];
            let n = DVec3::new(x, y, z);
            let (to, reach) = (n.dot(middle) + d, n.abs().dot(half));
            at = if to > reach {
                node.children[0]
            } else if to < -reach {
                node.children[1]
            } else {
                break;
            };
        }
        at
    }

    fn fill(&mut self, from: UVec3, to: UVec3, at: i32) {
        let corner = |i: UVec3| self.low + i.as_dvec3() * self.size;
        let at = self.descend(at, corner(from), corner(to));
        let extent = to - from;
        if at < 0 || extent == UVec3::ONE {
            for z in from.z..to.z {
                for y in from.y..to.y {
                    let row = (z * self.n.y + y) * self.n.x;
                    self.starts[(row + from.x) as usize..(row + to.x) as usize].fill(at);
                }
            }
            return;
        }
        let axis = extent.max_position();
        let (mut middle_to, mut middle_from) = (to, from);
        middle_to[axis] = from[axis] + extent[axis] / 2;
        middle_from[axis] = middle_to[axis];
        self.fill(from, middle_to, at);
        self.fill(middle_from, to, at);
    }
}

impl Field {
    /// Converts a locator. O(boxes + nodes).
    pub(super) fn build(locator: &Locator, side: u32) -> Self {
        let bounds = &locator.bounds;
        let (low, high) = if bounds.min.x < bounds.max.x {
            (bounds.min, bounds.max)
        } else {
            (DVec3::ZERO, DVec3::ONE)
        };
        let origin = (low + high) * 0.5;
        let extent = (high - low).max(DVec3::splat(1e-3));
        let edge = (extent.element_product() / BOXES).cbrt();
        let n = (extent / edge)
            .ceil()
            .as_uvec3()
            .clamp(UVec3::ONE, UVec3::splat(side.min(256)));
        let size = extent / n.as_dvec3();
        let mut filler = Filler {
            locator,
            low,
            size,
            n,
            starts: vec![-1; n.element_product() as usize],
        };
        filler.fill(UVec3::ZERO, n, locator.root);
        let mut nodes = Vec::with_capacity(locator.nodes.len() * 2);
        for node in &locator.nodes {
            let [x, y, z, d] = locator.planes[node.plane as usize];
            let d = d + DVec3::new(x, y, z).dot(origin);
            nodes.push([x, y, z, d].map(|v| (v as f32).to_bits()));
            let [front, back] = node.children.map(|c| c as u32);
            nodes.push([front, back, 0, 0]);
        }
        Self {
            origin,
            low: (low - origin).as_vec3(),
            density: (1.0 / size).as_vec3(),
            n,
            starts: filler.starts,
            nodes,
            outside: Locator::leaf(locator.outside),
        }
    }

    /// Returns the shader's answer for a point of the world: a cell, or -1.
    pub(super) fn locate(&self, p: [f32; 3]) -> i32 {
        let leaf = self.leaf(p);
        if leaf < -1 { -2 - leaf } else { -1 }
    }

    fn leaf(&self, p: [f32; 3]) -> i32 {
        let p = (Vec3::from(p).as_dvec3() - self.origin).as_vec3();
        let q = ((p - self.low) * self.density).floor();
        if q.min_element() < 0.0 || (0..3).any(|k| q[k] >= self.n[k] as f32) {
            return self.outside;
        }
        let q = q.as_uvec3();
        let mut at = self.starts[((q.z * self.n.y + q.y) * self.n.x + q.x) as usize];
        while at >= 0 {
            let [x, y, z, d] = self.nodes[2 * at as usize].map(f32::from_bits);
            let side = Vec3::new(x, y, z).dot(p) + d < 0.0;
            at = self.nodes[2 * at as usize + 1][usize::from(side)] as i32;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::{GridParams, Rng, room_grid};

    #[test]
    fn the_texture_tells_the_cell_that_the_locator_tells() {
        let world = room_grid(&GridParams::offices(40, 3));
        let locator = &world.graph.locator;
        let field = Field::build(locator, 256);
        let mut rng = Rng::new(7);
        let (low, high) = (locator.bounds.min - 1.0, locator.bounds.max + 1.0);
        let (mut same, mut indoors) = (0, 0);
        for _ in 0..20_000 {
            let p = [0, 1, 2].map(|k| rng.range(low[k], high[k]) as f32);
            let want = Locator::leaf(locator.locate(DVec3::from(p.map(f64::from))));
            same += u32::from(field.leaf(p) == want);
            indoors += u32::from(want < -2);
        }
        assert!(indoors > 2000, "{indoors} points indoors");
        // On a plane, rounding may choose the other side.
        assert!(same >= 19_998, "{same} of 20000");
    }
}
