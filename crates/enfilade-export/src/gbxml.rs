//! Energy models as gbXML 6.01 (Green Building XML): spaces with closed shells, and surfaces with openings.
//!
//! A surface of second level is written once, with both spaces if two surfaces answer each other; what has only matter, a void or its
//! own room behind names its space twice, which means that no heat passes. An opening is in the face of its wall or, if it is in none,
//! all over a surface of its own. gbXML has no holes: a loop leads to each hole and back on the same line. Z is up: (x, y, z)
//! is written as (x, -z, y).

use std::fmt::Write;

use enfilade_cpg::{CellId, PortalKind, World};
use enfilade_geom::DVec3;

use crate::names::{Names, escaped, global_id, source_name};
use crate::surfaces::{
    Behind, BoundarySurface, HostedFace, RoomSurfaces, SurfaceCover, flat_openings, hosted_faces,
    room_surfaces,
};

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<gbXML xmlns=\"http://www.gbxml.org/schema\" temperatureUnit=\"C\" lengthUnit=\"Meters\" areaUnit=\"SquareMeters\" volumeUnit=\"CubicMeters\" useSIUnitsForResults=\"true\" version=\"6.01\">
 <Campus id=\"enfilade.campus\">
  <Location><ZipcodeOrPostalCode>00000</ZipcodeOrPostalCode></Location>
  <Building id=\"enfilade.building\" buildingType=\"Unknown\">
";
/// A construction that says nothing: the schema asks for one.
const TAIL: &str = " </Campus>
 <Construction id=\"enfilade.construction\"><Name>not known</Name></Construction>
</gbXML>
";
/// Vertical component of a normal beyond which a surface is a floor or a roof, and not a wall: 60 degrees.
const LEVEL: f64 = 0.5;

/// Returns the rooms as gbXML. The world must be valid. Time is that of [`room_surfaces`].
#[must_use]
pub fn gbxml(world: &World) -> String {
    let rooms: Vec<RoomSurfaces> = room_surfaces(world, &flat_openings())
        .into_iter()
        .filter(|r| world.graph[r.cell].is_room())
        .collect();
    let mut writer = GbxmlWriter {
        world,
        names: Names::new(world),
        out: HEAD.to_owned(),
    };
    let area: f64 = rooms.iter().map(|r| writer.floor_area(r)).sum();
    let _ = writeln!(writer.out, "   <Area>{area}</Area>");
    let faces = hosted_faces(&rooms, &|s| !writer.is_air(s));
    for (room, faces) in rooms.iter().zip(&faces) {
        writer.space(room, faces);
    }
    writer.out += "  </Building>\n";
    for (room, faces) in rooms.iter().zip(&faces) {
        for face in faces {
            writer.surface(room, face);
        }
    }
    writer.out + TAIL
}

struct GbxmlWriter<'w> {
    world: &'w World,
    names: Names,
    out: String,
}

impl GbxmlWriter<'_> {
    fn floor_area(&self, room: &RoomSurfaces) -> f64 {
        let mut facts = self.world.room_facts.iter().flatten();
        let known = facts.find(|f| f.cell == room.cell).map(|f| f.floor_area);
        let floors = room.surfaces.iter().filter(|s| s.normal[1] < -LEVEL);
        known.unwrap_or_else(|| floors.map(|s| s.area).sum())
    }

    /// Returns the room and the number of the surface that answer one.
    fn answer(&self, surface: &BoundarySurface) -> Option<(CellId, usize)> {
        let (Behind::Cell(other), Some(pair)) = (surface.behind, surface.pair) else {
            return None;
        };
        self.world.graph[other].is_room().then_some((other, pair))
    }

    /// Returns the id of a surface; of two that answer each other, that of the first.
    fn id_of(&self, cell: CellId, number: usize, surface: &BoundarySurface) -> String {
        match self.answer(surface) {
            Some((other, pair)) if other < cell => format!("{}.s{pair}", self.names.of(other)),
            _ => format!("{}.s{number}", self.names.of(cell)),
        }
    }

    fn space(&mut self, room: &RoomSurfaces, faces: &[HostedFace]) {
        let id = self.names.of(room.cell).to_owned();
        let name = escaped(&self.world.graph[room.cell].name);
        let (area, volume) = (self.floor_area(room), room.volume);
        let _ = writeln!(
            self.out,
            "   <Space id=\"{id}\"><Name>{name}</Name><Area>{area}</Area><Volume>{volume}</Volume>\n    \
             <ShellGeometry id=\"{id}.shell\"><ClosedShell>"
        );
        for face in faces {
            self.poly_loop(&face.loops);
        }
        self.out += "    </ClosedShell></ShellGeometry>\n";
        for face in faces {
            let surface = &room.surfaces[face.surface];
            let surface_id = self.id_of(room.cell, face.surface, surface);
            let _ = writeln!(
                self.out,
                "    <SpaceBoundary isSecondLevelBoundary=\"true\" surfaceIdRef=\"{surface_id}\"><PlanarGeometry>"
            );
            self.poly_loop(&face.loops);
            self.out += "    </PlanarGeometry></SpaceBoundary>\n";
        }
        self.out += "   </Space>\n";
    }

    /// Returns `true` for a way to another room: all of it is air.
    fn is_air(&self, surface: &BoundarySurface) -> bool {
        let kind = surface.opening().map(|p| self.world.graph[p].kind);
        matches!(kind, Some(PortalKind::Open | PortalKind::Crack)) && self.answer(surface).is_some()
    }

    fn surface(&mut self, room: &RoomSurfaces, face: &HostedFace) {
        let number = face.surface;
        let surface = &room.surfaces[number];
        let own = self.names.of(room.cell);
        let id = self.id_of(room.cell, number, surface);
        let answer = self.answer(surface);
        if answer.is_some_and(|(other, _)| other < room.cell) {
            return;
        }
        let other = match answer {
            Some((other, _)) => Some(self.names.of(other)),
            None if self.is_outside(surface) => None,
            None => Some(own),
        };
        let is_air = self.is_air(surface);
        let surface_type = if is_air {
            "Air"
        } else {
            self.surface_type(surface, other.is_some())
        };
        let sun = other.is_none() && surface.behind != Behind::Ground;
        let _ = write!(
            self.out,
            "  <Surface id=\"{id}\" surfaceType=\"{surface_type}\" constructionIdRef=\"enfilade.construction\" exposedToSun=\"{sun}\">\n   "
        );
        for space in [Some(own), other].into_iter().flatten() {
            let _ = write!(self.out, "<AdjacentSpaceId spaceIdRef=\"{space}\"/>");
        }
        self.out += "\n   <PlanarGeometry>\n";
        self.poly_loop(&face.loops);
        self.out += "   </PlanarGeometry>\n";
        let whole = surface.opening().filter(|_| !is_air).map(|_| number);
        for opening in face.openings.iter().copied().chain(whole) {
            self.opening(room, opening);
        }
        if let SurfaceCover::Object { source, .. } = surface.cover
            && let Some(name) = source_name(self.world, source)
        {
            let object = escaped(global_id(name).unwrap_or(name));
            let _ = writeln!(self.out, "   <CADObjectId>{object}</CADObjectId>");
        }
        self.out += "  </Surface>\n";
    }

    fn opening(&mut self, room: &RoomSurfaces, number: usize) {
        let surface = &room.surfaces[number];
        let Some(portal) = surface.opening() else {
            return;
        };
        let opening = match self.world.graph[portal].kind {
            PortalKind::Door => "NonSlidingDoor",
            PortalKind::Window if surface.normal[1] > LEVEL => "FixedSkylight",
            PortalKind::Window => "FixedWindow",
            PortalKind::Open | PortalKind::Crack => "Air",
        };
        let id = self.id_of(room.cell, number, surface);
        let _ = writeln!(
            self.out,
            "   <Opening id=\"{id}.o\" openingType=\"{opening}\"><PlanarGeometry>"
        );
        self.poly_loop(&surface.loops);
        self.out += "   </PlanarGeometry></Opening>\n";
    }

    fn is_outside(&self, surface: &BoundarySurface) -> bool {
        match surface.behind {
            Behind::Ground => true,
            Behind::Cell(cell) => !self.world.graph[cell].is_indoors(),
            Behind::Matter => false,
        }
    }

    fn surface_type(&self, surface: &BoundarySurface, is_inner: bool) -> &'static str {
        let up = surface.normal[1];
        let is_ground = surface.behind == Behind::Ground;
        match (is_inner, is_ground) {
            (true, _) if up > LEVEL => "Ceiling",
            (true, _) if up < -LEVEL => "InteriorFloor",
            (true, _) => "InteriorWall",
            (false, true) if up < -LEVEL => "SlabOnGrade",
            (false, true) => "UndergroundWall",
            (false, false) if up > LEVEL => "Roof",
            (false, false) if up < -LEVEL => "RaisedFloor",
            (false, false) => "ExteriorWall",
        }
    }

    fn poly_loop(&mut self, loops: &[Vec<[f64; 3]>]) {
        self.out += "    <PolyLoop>";
        for [x, y, z] in keyholed(loops) {
            let _ = write!(
                self.out,
                "<CartesianPoint><Coordinate>{x}</Coordinate><Coordinate>{}</Coordinate><Coordinate>{y}</Coordinate></CartesianPoint>",
                0.0 - z
            );
        }
        self.out += "</PolyLoop>\n";
    }
}

/// Returns one loop around a polygon and its holes: to each hole from the nearest vertex so far, around it, and back. O(vertices²).
fn keyholed(loops: &[Vec<[f64; 3]>]) -> Vec<[f64; 3]> {
    let Some((outer, holes)) = loops.split_first() else {
        return Vec::new();
    };
    let mut ring = outer.clone();
    let mut left: Vec<&Vec<[f64; 3]>> = holes.iter().collect();
    let between = |a: &[f64; 3], b: &[f64; 3]| DVec3::from(*a).distance_squared(DVec3::from(*b));
    while !left.is_empty() {
        let mut best = (f64::INFINITY, 0, 0, 0);
        for (h, hole) in left.iter().enumerate() {
            for (i, a) in ring.iter().enumerate() {
                for (k, b) in hole.iter().enumerate() {
                    let d = between(a, b);
                    if d < best.0 {
                        best = (d, h, i, k);
                    }
                }
            }
        }
        let (_, h, i, k) = best;
        let hole = left.swap_remove(h);
        let around = hole[k..].iter().chain(&hole[..=k]).copied();
        let back = ring[i];
        let bridge: Vec<[f64; 3]> = around.chain([back]).collect();
        ring.splice(i + 1..i + 1, bridge);
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_keyhole_has_the_area_without_the_hole() {
        let square = |h: f64| vec![[-h, -h, 0.0], [h, -h, 0.0], [h, h, 0.0], [-h, h, 0.0]];
        let mut hole = square(1.0);
        hole.reverse();
        let ring = keyholed(&[square(2.0), hole]);
        assert_eq!(ring.len(), 10);
        let points: Vec<DVec3> = ring.into_iter().map(DVec3::from).collect();
        assert!((enfilade_geom::poly::area(&points) - 12.0).abs() < 1e-12);
    }
}
