//! Maps for robots: which ground is free over a band of heights, and the room of each pixel.
//!
//! As `map_server` of ROS reads them: a gray picture (0 occupied, 254 free, 205 unknown), a YAML file with resolution and origin, and
//! beside them a picture of labels and a table of rooms and doors. ROS has Z up: (x, y, z) of the world is (x, -z) on the map; the
//! first row is the farthest north. **Complexity:** O(pixels × depth of the tree) and O(triangles × pixels of each). Errs to occupied:
//! a pixel that a surface touches within the band is.

use enfilade_cpg::{CellId, FittingPart, PortalKind, World};
use enfilade_geom::poly::{self, Poly};
use enfilade_geom::{DVec2, DVec3, Plane, Triangle};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fmt;

use crate::names::Names;

/// Most pixels of a map: 64 million.
const MOST_PIXELS: f64 = 67_108_864.0;
/// Space around the rooms. [Units: wu]
const MARGIN: f64 = 0.5;
/// Gray of occupied pixels, as in maps of ROS.
const OCCUPIED: u8 = 0;
/// Gray of free pixels.
const FREE: u8 = 254;
/// Gray of pixels that no room has.
const UNKNOWN: u8 = 205;

/// Settings of [`FloorMap::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorMapOptions {
    /// Height of the floor. [Units: wu]
    pub floor: f64,
    /// Height below which things on the floor are driven over. [Units: wu] [Limit: at least 0]
    pub lowest: f64,
    /// Height above which things over the floor are driven under. [Units: wu] [Limit: above `lowest`]
    pub highest: f64,
    /// Side of a pixel. [Units: wu] [Limit: above 0]
    pub resolution: f64,
}

impl Default for FloorMapOptions {
    fn default() -> Self {
        Self {
            floor: 0.0,
            lowest: 0.1,
            highest: 1.2,
            resolution: 0.05,
        }
    }
}

/// Reason why there is no map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FloorMapError {
    /// The settings are not numbers within their limits.
    Settings,
    /// No room reaches into the band of heights. [Units: wu]
    NoRoom {
        /// Height of the floor that was asked for.
        floor: f64,
    },
    /// There are more pixels than 64 million.
    TooFine {
        /// The least resolution that does. [Units: wu]
        least: f64,
    },
}

impl fmt::Display for FloorMapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Settings => f.write_str(
                "the heights or the resolution make no sense: give a resolution above 0, and a band that ends above its start",
            ),
            Self::NoRoom { floor } => write!(
                f,
                "no room has its air over a floor at {floor} m; give the height of a storey, as `enfilade inspect` tells it"
            ),
            Self::TooFine { least } => write!(
                f,
                "the map would have more than 64 million pixels; give a resolution of {least:.3} m or more"
            ),
        }
    }
}

impl std::error::Error for FloorMapError {}

/// A map of one storey.
#[derive(Clone, Debug)]
pub struct FloorMap {
    /// Pixels of a row, along +x.
    pub width: usize,
    /// Rows, along +z: from the north to the south.
    pub height: usize,
    /// Side of a pixel. [Units: wu]
    pub resolution: f64,
    /// World x and z of the least point of the first pixel. [Units: wu]
    pub corner: [f64; 2],
    /// Height at which rooms are told apart. [Units: wu]
    pub level: f64,
    /// 0 occupied, 254 free, 205 unknown; row by row.
    pub occupancy: Vec<u8>,
    /// The room of each pixel's middle, as its cell's number plus 1; 0 for none.
    pub labels: Vec<u16>,
}

impl FloorMap {
    /// Draws the map of a storey. The world must be valid.
    ///
    /// # Errors
    ///
    /// If no room is there, or the settings are out of their limits.
    pub fn new(world: &World, options: &FloorMapOptions) -> Result<Self, FloorMapError> {
        let o = options;
        let numbers = [o.floor, o.lowest, o.highest, o.resolution];
        let is_sound = numbers.iter().all(|x| x.is_finite())
            && o.resolution > 0.0
            && o.lowest >= 0.0
            && o.highest > o.lowest;
        if !is_sound {
            return Err(FloorMapError::Settings);
        }
        let level = o.floor + 0.5 * (o.lowest + o.highest);
        let reaches =
            |cell: &[[f32; 3]; 2]| f64::from(cell[0][1]) < level && f64::from(cell[1][1]) > level;
        let rooms = world.graph.places().filter(|(_, c)| reaches(&c.aabb));
        let (mut min, mut max) = (DVec2::MAX, DVec2::MIN);
        for (_, cell) in rooms {
            let flat = |p: [f32; 3]| DVec2::new(f64::from(p[0]), f64::from(p[2]));
            min = min.min(flat(cell.aabb[0]));
            max = max.max(flat(cell.aabb[1]));
        }
        if min.x > max.x {
            return Err(FloorMapError::NoRoom { floor: o.floor });
        }
        let corner = ((min - MARGIN) / o.resolution).floor() * o.resolution;
        let size = ((max + MARGIN - corner) / o.resolution).ceil();
        if size.x * size.y > MOST_PIXELS {
            let area = (max - min + 2.0 * MARGIN).element_product();
            let least = (area / MOST_PIXELS).sqrt() * 1.01;
            return Err(FloorMapError::TooFine { least });
        }
        let (width, height) = (size.x as usize, size.y as usize);
        let mut map = Self {
            width,
            height,
            resolution: o.resolution,
            corner: corner.to_array(),
            level,
            occupancy: vec![UNKNOWN; width * height],
            labels: vec![0; width * height],
        };
        map.label(world);
        map.occupy(world, o);
        Ok(map)
    }

    /// Returns the middle of a pixel in the world, at the map's level. [Units: wu]
    #[must_use]
    pub fn middle(&self, pixel: usize) -> [f64; 3] {
        let (row, column) = (pixel / self.width, pixel % self.width);
        let at = |corner: f64, k: usize| corner + (k as f64 + 0.5) * self.resolution;
        [
            at(self.corner[0], column),
            self.level,
            at(self.corner[1], row),
        ]
    }

    fn label(&mut self, world: &World) {
        for i in 0..self.labels.len() {
            let p = DVec3::from(self.middle(i));
            match world.graph.locator.locate(p) {
                Some(cell) if world.graph[cell].is_place() => {
                    self.labels[i] = u16::try_from(cell.0 + 1).unwrap_or(u16::MAX);
                    self.occupancy[i] = FREE;
                }
                Some(_) => {}
                None => self.occupancy[i] = OCCUPIED,
            }
        }
    }

    /// Draws all surfaces within the band but door leaves, which open.
    fn occupy(&mut self, world: &World, options: &FloorMapOptions) {
        let band = [
            options.floor + options.lowest,
            options.floor + options.highest,
        ];
        for batch in &world.batches {
            for triangle in batch.primitive.triangles() {
                self.draw(&triangle, band);
            }
        }
        let fittings = world.graph.portals.iter().flat_map(|p| &p.fittings);
        let leaves = fittings.filter(|f| f.part == FittingPart::Leaf);
        let leaves: BTreeSet<u32> = leaves.map(|f| f.detail).collect();
        for (id, detail) in (0..).zip(&world.details) {
            if leaves.contains(&id) {
                continue;
            }
            for primitive in &world.detail_meshes[detail.mesh as usize].primitives {
                for triangle in primitive.placed_triangles(detail.placement()) {
                    self.draw(&triangle, band);
                }
            }
        }
    }

    /// Marks the pixels that a triangle touches within a band of heights.
    fn draw(&mut self, triangle: &Triangle, [low, high]: [f64; 2]) {
        let mut part: Poly = triangle.as_slice().into();
        let bottom = Plane::through(DVec3::Y * low, DVec3::Y);
        let top = Plane::through(DVec3::Y * high, DVec3::NEG_Y);
        if !poly::clip_in_place(&mut part, &bottom, 0.0)
            || !poly::clip_in_place(&mut part, &top, 0.0)
        {
            return;
        }
        let flat = |p: &DVec3| {
            let at = DVec2::new(p.x - self.corner[0], p.z - self.corner[1]);
            at / self.resolution
        };
        let points: Vec<DVec2> = part.iter().map(flat).collect();
        let (mut min, mut max) = (DVec2::MAX, DVec2::MIN);
        for &p in &points {
            min = min.min(p);
            max = max.max(p);
        }
        let size = DVec2::new(self.width as f64, self.height as f64);
        let (min, max) = (min.floor().max(DVec2::ZERO), max.ceil().min(size));
        for row in min.y as usize..(max.y.max(0.0)) as usize {
            for column in min.x as usize..(max.x.max(0.0)) as usize {
                let pixel = DVec2::new(column as f64, row as f64);
                if touches(&points, pixel) {
                    self.occupancy[row * self.width + column] = OCCUPIED;
                }
            }
        }
    }

    /// Returns the picture of occupancy as PGM.
    #[must_use]
    pub fn occupancy_pgm(&self) -> Vec<u8> {
        let mut out = format!("P5\n{} {}\n255\n", self.width, self.height).into_bytes();
        out.extend(&self.occupancy);
        out
    }

    /// Returns the picture of labels as PGM of 16 bits.
    #[must_use]
    pub fn labels_pgm(&self) -> Vec<u8> {
        let mut out = format!("P5\n{} {}\n65535\n", self.width, self.height).into_bytes();
        out.extend(self.labels.iter().flat_map(|l| l.to_be_bytes()));
        out
    }

    /// Returns the YAML file beside the picture `image`.
    #[must_use]
    pub fn yaml(&self, image: &str) -> String {
        let south = self.corner[1] + self.height as f64 * self.resolution;
        format!(
            "image: {}\nmode: trinary\nresolution: {}\norigin: [{}, {}, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
            Value::from(image),
            self.resolution,
            self.corner[0],
            0.0 - south,
        )
    }

    /// Returns the table of the rooms on the map, with their doors and the poses in them, as JSON. Angles are in radians,
    /// counter-clockwise from +x, through the door out of the room.
    #[must_use]
    pub fn rooms_json(&self, world: &World) -> String {
        let names = Names::new(world);
        let mut sums = std::collections::BTreeMap::<u16, (usize, DVec2)>::new();
        for (i, &label) in self.labels.iter().enumerate().filter(|l| *l.1 != 0) {
            let [x, _, z] = self.middle(i);
            let sum = sums.entry(label).or_default();
            sum.0 += 1;
            sum.1 += DVec2::new(x, -z);
        }
        let rooms = sums.iter().map(|(&label, &(n, sum))| {
            let cell = CellId(u32::from(label) - 1);
            let exits = world.graph.exits(cell);
            let ways = exits.filter(|e| {
                let heights = e.portal.outline.iter().map(|p| f64::from(p[1]));
                let (low, high) =
                    heights.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
                let is_way = matches!(e.portal.kind, PortalKind::Door | PortalKind::Open);
                is_way && low < self.level && high > self.level
            });
            let doors = ways.map(|e| {
                let n = e.portal.outline.len().max(1) as f32;
                let middle = |k: usize| e.portal.outline.iter().map(|p| p[k]).sum::<f32>() / n;
                let sign = if e.portal.cells[0] == cell { 1.0 } else { -1.0 };
                let out = e.portal.normal.map(|x| x * sign);
                json!({
                    "portal": e.id.0,
                    "to": names.of(e.to),
                    "x": middle(0),
                    "y": 0.0 - middle(2),
                    "yaw": f32::atan2(0.0 - out[2], out[0]),
                })
            });
            let centroid = sum / n as f64;
            json!({
                "label": label,
                "id": names.of(cell),
                "name": world.graph[cell].name,
                "centroid": [centroid.x, centroid.y],
                "area": n as f64 * self.resolution * self.resolution,
                "doors": doors.collect::<Vec<_>>(),
            })
        });
        let table = json!({
            "frame": "x east, y north; y is -z of the world",
            "level": self.level,
            "rooms": rooms.collect::<Vec<_>>(),
        });
        table.to_string() + "\n"
    }
}

/// Returns `true` if a convex polygon touches the unit square: no edge of either separates them.
fn touches(points: &[DVec2], pixel: DVec2) -> bool {
    let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|d| pixel + d);
    let n = points.len();
    (0..n).all(|i| {
        let along = points[(i + 1) % n] - points[i];
        let across = along.perp();
        let range = |list: &[DVec2]| {
            let at = list.iter().map(|&p| across.dot(p));
            at.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)))
        };
        let (a, b) = (range(points), range(&corners));
        a.0 <= b.1 && b.0 <= a.1
    })
}
