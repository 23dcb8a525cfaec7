//! Indoor navigation: rooms and ways between them as IndoorGML 1.1 (OGC 19-011r4), core module.
//!
//! Each room is a cell space, a solid of first-level surfaces, with a state in it; each portal between two rooms a boundary with a
//! transition, whose line leads through the middle of the opening. The outdoors is a state without a solid where a portal leads
//! there. Z is up: (x, y, z) is written as (x, -z, y). Rooms whose boundary does not close have no solid.

use std::collections::BTreeSet;
use std::fmt::Write;

use enfilade_cpg::{CellId, PortalId, PortalKind, World};
use enfilade_geom::DVec3;

use crate::names::{Names, escaped};
use crate::surfaces::{RoomSurfaces, SurfaceLevel, SurfaceOptions, room_surfaces};
use crate::triangles::triangulated;

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<core:IndoorFeatures xmlns:core=\"http://www.opengis.net/indoorgml/1.0/core\" xmlns:gml=\"http://www.opengis.net/gml/3.2\" \
xmlns:xlink=\"http://www.w3.org/1999/xlink\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
xsi:schemaLocation=\"http://www.opengis.net/indoorgml/1.0/core http://schemas.opengis.net/indoorgml/1.0/indoorgmlcore.xsd\" \
gml:id=\"enfilade.building\">
";

/// Returns the rooms and ways as IndoorGML. The world must be valid. Time is that of [`room_surfaces`].
#[must_use]
pub fn indoor_gml(world: &World) -> String {
    let options = SurfaceOptions {
        level: SurfaceLevel::First,
        by_object: false,
        ..SurfaceOptions::default()
    };
    let rooms: Vec<RoomSurfaces> = room_surfaces(world, &options)
        .into_iter()
        .filter(|r| world.graph[r.cell].is_room())
        .collect();
    let ways = ways(world);
    let mut writer = IndoorWriter {
        world,
        names: Names::new(world),
        out: HEAD.to_owned(),
        n_polygons: 0,
    };
    writer.spaces(&rooms, &ways);
    writer.graph(&rooms, &ways);
    writer.out + "</core:IndoorFeatures>\n"
}

/// Portals that people pass, and their cells: at least one is a room, and the other a room or the outdoors.
fn ways(world: &World) -> Vec<(PortalId, [CellId; 2])> {
    let graph = &world.graph;
    let is_end = |c: CellId| graph[c].is_room() || graph[c].outdoor;
    let is_way = |id: &PortalId| {
        let portal = &graph[*id];
        matches!(portal.kind, PortalKind::Door | PortalKind::Open)
            && portal.cells.iter().all(|&c| is_end(c))
    };
    let ids = graph.portal_ids().filter(is_way);
    ids.map(|id| (id, graph[id].cells)).collect()
}

struct IndoorWriter<'w> {
    world: &'w World,
    names: Names,
    out: String,
    /// Numbers polygons: their ids are unique in the file.
    n_polygons: usize,
}

impl IndoorWriter<'_> {
    fn spaces(&mut self, rooms: &[RoomSurfaces], ways: &[(PortalId, [CellId; 2])]) {
        self.out +=
            " <core:primalSpaceFeatures><core:PrimalSpaceFeatures gml:id=\"enfilade.spaces\">\n";
        for room in rooms {
            let id = self.names.of(room.cell).to_owned();
            let name = escaped(&self.world.graph[room.cell].name);
            let _ = writeln!(
                self.out,
                "  <core:cellSpaceMember><core:CellSpace gml:id=\"{id}\"><gml:name>{name}</gml:name>"
            );
            if room.n_open_edges == 0 {
                let _ = writeln!(
                    self.out,
                    "   <core:cellSpaceGeometry><core:Geometry3D><gml:Solid gml:id=\"{id}.solid\"><gml:exterior><gml:Shell>"
                );
                for surface in &room.surfaces {
                    self.out += "    <gml:surfaceMember>";
                    self.polygon(&surface.loops);
                    self.out += "</gml:surfaceMember>\n";
                }
                self.out += "   </gml:Shell></gml:exterior></gml:Solid></core:Geometry3D></core:cellSpaceGeometry>\n";
            }
            let _ = writeln!(self.out, "   <core:duality xlink:href=\"#{id}.state\"/>");
            for (portal, _) in ways.iter().filter(|w| w.1.contains(&room.cell)) {
                let _ = writeln!(
                    self.out,
                    "   <core:partialboundedBy xlink:href=\"#{portal}.boundary\"/>"
                );
            }
            self.out += "  </core:CellSpace></core:cellSpaceMember>\n";
        }
        for &(portal, _) in ways {
            let _ = write!(
                self.out,
                "  <core:cellSpaceBoundaryMember><core:CellSpaceBoundary gml:id=\"{portal}.boundary\"><core:duality xlink:href=\"#{portal}.way\"/>\
                 <core:cellSpaceBoundaryGeometry><core:geometry3D>"
            );
            let outline = &self.world.graph[portal].outline;
            let ring = outline.iter().map(|p| p.map(f64::from)).collect();
            self.polygon(&[ring]);
            self.out += "</core:geometry3D></core:cellSpaceBoundaryGeometry></core:CellSpaceBoundary></core:cellSpaceBoundaryMember>\n";
        }
        self.out += " </core:PrimalSpaceFeatures></core:primalSpaceFeatures>\n";
    }

    fn graph(&mut self, rooms: &[RoomSurfaces], ways: &[(PortalId, [CellId; 2])]) {
        self.out += " <core:multiLayeredGraph><core:MultiLayeredGraph gml:id=\"enfilade.graph\"><core:spaceLayers gml:id=\"enfilade.layers\">\
                     <core:spaceLayerMember><core:SpaceLayer gml:id=\"enfilade.layer\">\n  <core:nodes gml:id=\"enfilade.nodes\">\n";
        let mut states: Vec<(CellId, Option<DVec3>)> = rooms
            .iter()
            .map(|r| (r.cell, self.inner_point(r)))
            .collect();
        let others: BTreeSet<CellId> = (ways.iter().flat_map(|w| w.1))
            .filter(|&c| !self.world.graph[c].is_room())
            .collect();
        states.extend(others.into_iter().map(|c| (c, None)));
        for &(cell, at) in &states {
            let id = self.names.of(cell);
            let _ = write!(
                self.out,
                "   <core:stateMember><core:State gml:id=\"{id}.state\">"
            );
            if self.world.graph[cell].is_room() {
                let _ = write!(self.out, "<core:duality xlink:href=\"#{id}\"/>");
            }
            for (portal, _) in ways.iter().filter(|w| w.1.contains(&cell)) {
                let _ = write!(self.out, "<core:connects xlink:href=\"#{portal}.way\"/>");
            }
            if let Some(at) = at {
                let _ = write!(
                    self.out,
                    "<core:geometry><gml:Point gml:id=\"{id}.point\">{}</gml:Point></core:geometry>",
                    position(at)
                );
            }
            self.out += "</core:State></core:stateMember>\n";
        }
        self.out += "  </core:nodes>\n  <core:edges gml:id=\"enfilade.edges\">\n";
        for &(portal, cells) in ways {
            self.transition(portal, cells, &states);
        }
        self.out += "  </core:edges>\n </core:SpaceLayer></core:spaceLayerMember></core:spaceLayers></core:MultiLayeredGraph></core:multiLayeredGraph>\n";
    }

    fn transition(
        &mut self,
        portal: PortalId,
        cells: [CellId; 2],
        states: &[(CellId, Option<DVec3>)],
    ) {
        let outline = &self.world.graph[portal].outline;
        let sum: DVec3 = outline.iter().map(|p| DVec3::from(p.map(f64::from))).sum();
        let middle = sum / outline.len().max(1) as f64;
        let normal = DVec3::from(self.world.graph[portal].normal.map(f64::from));
        let ends = [(cells[0], -1.0), (cells[1], 1.0)].map(|(cell, sign)| {
            let state = states.iter().find(|s| s.0 == cell);
            // A step outdoors, where no point stands for all.
            state.and_then(|s| s.1).unwrap_or(middle + normal * sign)
        });
        let line: String = [ends[0], middle, ends[1]].map(position).concat();
        let length = ends[0].distance(middle) + middle.distance(ends[1]);
        let [a, b] = cells.map(|c| self.names.of(c));
        let _ = writeln!(
            self.out,
            "   <core:transitionMember><core:Transition gml:id=\"{portal}.way\"><core:weight>{length}</core:weight>\
             <core:connects xlink:href=\"#{a}.state\"/><core:connects xlink:href=\"#{b}.state\"/>\
             <core:duality xlink:href=\"#{portal}.boundary\"/>\
             <core:geometry><gml:LineString gml:id=\"{portal}.line\">{line}</gml:LineString></core:geometry>\
             </core:Transition></core:transitionMember>"
        );
    }

    /// Returns a point in a room, as high over its largest floor as people's eyes if it is that high.
    fn inner_point(&self, room: &RoomSurfaces) -> Option<DVec3> {
        let mut floors: Vec<_> = room
            .surfaces
            .iter()
            .filter(|s| s.normal[1] < -0.7)
            .collect();
        floors.sort_by(|a, b| b.area.total_cmp(&a.area));
        for floor in floors {
            let points: Vec<DVec3> = floor.loops.iter().flatten().map(|&p| p.into()).collect();
            let mut triangles: Vec<(f64, DVec3)> = triangulated(&floor.loops, floor.normal)
                .into_iter()
                .map(|t| {
                    let [a, b, c] = t.map(|i| points[i]);
                    ((b - a).cross(c - a).length(), (a + b + c) / 3.0)
                })
                .collect();
            triangles.sort_by(|a, b| b.0.total_cmp(&a.0));
            for (_, at) in triangles {
                for height in [1.2, 0.6, 0.2, 0.02] {
                    let p = at + DVec3::Y * height;
                    if self.world.graph.locator.locate(p) == Some(room.cell) {
                        return Some(p);
                    }
                }
            }
        }
        None
    }

    fn polygon(&mut self, loops: &[Vec<[f64; 3]>]) {
        self.n_polygons += 1;
        let _ = write!(
            self.out,
            "<gml:Polygon gml:id=\"polygon.{}\">",
            self.n_polygons
        );
        for (i, ring) in loops.iter().enumerate() {
            let side = if i == 0 { "exterior" } else { "interior" };
            let _ = write!(self.out, "<gml:{side}><gml:LinearRing>");
            // A ring ends where it begins.
            for &p in ring.iter().chain(ring.first()) {
                self.out += &position(p.into());
            }
            let _ = write!(self.out, "</gml:LinearRing></gml:{side}>");
        }
        self.out += "</gml:Polygon>";
    }
}

fn position(p: DVec3) -> String {
    format!("<gml:pos>{} {} {}</gml:pos>", p.x, 0.0 - p.z, p.y)
}
