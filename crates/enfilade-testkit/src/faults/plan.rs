//! Buildings as CAD programs export them: every wall, slab and ceiling a separate closed solid.

use enfilade_geom::{Aabb, DVec3};

use enfilade_demo::furniture::{Palette, glaze, hang_door};
use enfilade_demo::solid::{MeshBuilder, aabb};
use enfilade_demo::{Convex, OpeningKind, Room, Side};
use enfilade_demo::{Generated, Site};

/// The side without a room.
pub(super) const OUT: Side = Side::Outside;

/// A building under construction.
pub(super) struct Plan {
    pub(super) site: Site,
    pub(super) palette: Palette,
    pub(super) plaster: u32,
    pub(super) storey: usize,
    /// Solids that stand in rooms and are modelled separately; no room has them as air.
    pub(super) obstacles: Vec<Aabb>,
}

/// A hole in a wall: along the wall, up, and the rooms in ascending order across it.
pub(super) struct Hole {
    pub(super) kind: OpeningKind,
    pub(super) along: [f64; 2],
    pub(super) up: [f64; 2],
    pub(super) rooms: [Side; 2],
    /// Opening angle of a door's leaf towards its second side. [Units: degrees]
    pub(super) swing: f64,
}

/// Default opening angle of leaves. [Units: degrees]
const SWING: f64 = 80.0;

/// Makes a door of 0.9 × 2.05 m with its middle `at` along the wall.
pub(super) fn door(at: f64, rooms: [Side; 2]) -> Hole {
    Hole {
        kind: OpeningKind::Door,
        along: [at - 0.45, at + 0.45],
        up: [0.0, 2.05],
        rooms,
        swing: SWING,
    }
}

/// Makes a window of 1.4 × 1.3 m above a sill of 0.9 m.
pub(super) fn window(at: f64, rooms: [Side; 2]) -> Hole {
    Hole {
        kind: OpeningKind::Window,
        along: [at - 0.7, at + 0.7],
        up: [0.9, 2.2],
        rooms,
        swing: 0.0,
    }
}

/// Returns the box between `faces` across `axis` (0: x, 2: z), over `along` and `up`.
pub(super) fn span(axis: usize, faces: [f64; 2], along: [f64; 2], up: [f64; 2]) -> Aabb {
    if axis == 0 {
        aabb([faces[0], up[0], along[0]], [faces[1], up[1], along[1]])
    } else {
        aabb([along[0], up[0], faces[0]], [along[1], up[1], faces[1]])
    }
}

impl Plan {
    pub(super) fn new(name: &str) -> Self {
        let mut site = Site::new(name);
        let palette = Palette::new(&mut site);
        let plaster = site.material("plaster", [0.82, 0.79, 0.72]);
        let storey = site.storey("ground floor", 0.0);
        Self {
            site,
            palette,
            plaster,
            storey,
            obstacles: Vec::new(),
        }
    }

    /// Adds a separate closed box.
    pub(super) fn solid(&mut self, name: &str, b: Aabb) {
        let mut mesh = MeshBuilder::new(self.plaster);
        mesh.cuboid(b);
        self.site.structure(name, mesh);
    }

    /// Adds a separate closed box that stands in rooms, and is solid.
    pub(super) fn obstacle(&mut self, name: &str, b: Aabb) {
        self.solid(name, b);
        self.site.matter(b.center());
        self.obstacles.push(b);
    }

    /// Adds a wall across `axis` with its holes, which get doors or glass.
    pub(super) fn wall(
        &mut self,
        axis: usize,
        faces: [f64; 2],
        along: [f64; 2],
        up: [f64; 2],
        holes: &[Hole],
    ) {
        let voids: Vec<Aabb> = holes
            .iter()
            .map(|h| span(axis, faces, h.along, h.up))
            .collect();
        let mut wall = MeshBuilder::new(self.plaster);
        wall.carved(&[span(axis, faces, along, up)], &voids);
        self.site.structure("wall", wall);
        for (hole, void) in holes.iter().zip(&voids) {
            self.opening(hole.kind, *void, axis, hole.rooms, hole.swing);
        }
    }

    /// Adds an opening to the truth, with an open leaf or a pane.
    pub(super) fn opening(
        &mut self,
        kind: OpeningKind,
        hole: Aabb,
        axis: usize,
        rooms: [Side; 2],
        swing: f64,
    ) {
        self.site.opening(kind, hole, axis, rooms);
        match kind {
            OpeningKind::Door => hang_door(&mut self.site, &self.palette, &hole, axis, swing),
            OpeningKind::Window => glaze(&mut self.site, &self.palette, &hole, axis),
            OpeningKind::Opening | OpeningKind::Virtual => {}
        }
    }

    /// Adds a room that fills a box except for the obstacles in it.
    pub(super) fn room(&mut self, name: &str, min: [f64; 3], max: [f64; 3]) -> Side {
        let air = aabb(min, max);
        let inside: Vec<(Aabb, f64)> = self
            .obstacles
            .iter()
            .map(|o| Aabb::new(o.min.max(air.min), o.max.min(air.max)))
            .filter(|o| (o.max - o.min).min_element() > 0.0)
            .map(|o| (o, o.volume()))
            .collect();
        let parts = vec![Convex::of_aabb(&air)];
        self.site
            .add_room(Room::new(name, self.storey, parts, &inside))
    }

    pub(super) fn finish(self) -> Generated {
        self.site.finish()
    }
}

/// Inner size of [`office`] in plan, along x and z. [Units: wu]
pub(super) const OFFICE: [f64; 2] = [12.0, 8.0];
/// Thickness of its outer walls. [Units: wu]
pub(super) const OUTER: f64 = 0.3;

/// Parameters of offices; heights are above the floor. [Units: wu]
pub(super) struct Office {
    /// Lower end of the walls.
    pub(super) foot: f64,
    /// Upper end of the rooms' air, at a slab or a hung ceiling.
    pub(super) ceiling: f64,
    /// Upper end of the inner walls.
    pub(super) inner: f64,
    /// Underside of the slab above, which is the upper end of the outer walls.
    pub(super) slab: f64,
    /// True if leaves stand open into the corridor, not into the rooms beside it.
    pub(super) has_leaves_in_corridor: bool,
}

impl Default for Office {
    fn default() -> Self {
        Self {
            foot: 0.0,
            ceiling: CEILING,
            inner: CEILING,
            slab: CEILING,
            has_leaves_in_corridor: false,
        }
    }
}

/// Height of rooms. [Units: wu]
pub(super) const CEILING: f64 = 2.7;

/// Faces of the walls beside the corridor, and of the walls between the rooms on its two sides.
pub(super) const BESIDE: [[f64; 2]; 2] = [[3.08, 3.2], [4.8, 4.92]];
pub(super) const BETWEEN: [[f64; 2]; 2] = [[5.94, 6.06], [3.94, 4.06]];

/// Adds a storey with a corridor from end to end and two rooms on either side of it: four doors inside, a
/// front door at the corridor's end, one window per room. The floor is at 0.
///
/// Returns the floor areas of the five rooms, as minimum and maximum (x, z).
pub(super) fn office(plan: &mut Plan, h: &Office) -> [[[f64; 2]; 2]; 5] {
    let [length, depth] = OFFICE;
    let areas = [
        [[0.0, BESIDE[0][1]], [length, BESIDE[1][0]]],
        [[0.0, 0.0], [BETWEEN[0][0], BESIDE[0][0]]],
        [[BETWEEN[0][1], 0.0], [length, BESIDE[0][0]]],
        [[0.0, BESIDE[1][1]], [BETWEEN[1][0], depth]],
        [[BETWEEN[1][1], BESIDE[1][1]], [length, depth]],
    ];
    let names = [
        "corridor",
        "north west",
        "north east",
        "south west",
        "south east",
    ];
    let rooms: Vec<Side> = areas
        .iter()
        .zip(names)
        .map(|([low, high], name)| {
            plan.room(name, [low[0], 0.0, low[1]], [high[0], h.ceiling, high[1]])
        })
        .collect();
    let [corridor, nw, ne, sw, se] = [0, 1, 2, 3, 4].map(|i| rooms[i]);
    let (west, east) = ([-OUTER, 0.0], [length, length + OUTER]);
    let all = [-OUTER, length + OUTER];
    let inner = [0.0, depth];
    let outer_up = [h.foot, h.slab];
    let inner_up = [h.foot, h.inner];

    plan.wall(
        2,
        [-OUTER, 0.0],
        all,
        outer_up,
        &[window(3.0, [OUT, nw]), window(9.0, [OUT, ne])],
    );
    plan.wall(
        2,
        [depth, depth + OUTER],
        all,
        outer_up,
        &[window(2.0, [sw, OUT]), window(8.0, [se, OUT])],
    );
    plan.wall(0, west, inner, outer_up, &[door(4.0, [OUT, corridor])]);
    plan.wall(0, east, inner, outer_up, &[]);
    let mut north = [door(1.5, [nw, corridor]), door(10.0, [ne, corridor])];
    let mut south = [door(2.5, [corridor, sw]), door(6.0, [corridor, se])];
    let doors = if h.has_leaves_in_corridor {
        &mut south
    } else {
        &mut north
    };
    for door in doors {
        door.swing = -door.swing;
    }
    plan.wall(2, BESIDE[0], [0.0, length], inner_up, &north);
    plan.wall(2, BESIDE[1], [0.0, length], inner_up, &south);
    plan.wall(0, BETWEEN[0], [0.0, BESIDE[0][0]], inner_up, &[]);
    plan.wall(0, BETWEEN[1], [BESIDE[1][1], depth], inner_up, &[]);
    for [low, high] in [[-0.3, 0.0], [h.slab, h.slab + 0.3]] {
        let b = aabb([all[0], low, -OUTER], [all[1], high, depth + OUTER]);
        plan.solid("floor slab", b);
    }
    areas
}

/// Returns a point of the plan at a height.
pub(super) fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}
