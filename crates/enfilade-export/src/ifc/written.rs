//! The statements of spaces.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;
use std::ops::Range;

use enfilade_cpg::{CellId, FittingPart, PortalId, World};
use enfilade_geom::{DVec3, Plane};
use twox_hash::XxHash3_128;

use super::model::{Model, Schema, is_layer, representations};
use super::step::{StepFile, quoted, real};
use super::told::{IfcOptions, IfcSpaces};
use crate::names::Names;
use crate::surfaces::{Behind, BoundarySurface, RoomSurfaces, SurfaceCover, SurfaceLevel};
use crate::triangles::triangulated;

/// Farthest distance of a vertex from the plane of a face that is written as one, and not as triangles. [Units: wu]
const FLAT: f64 = 1e-5;

/// A space that was written.
pub(super) struct Space {
    cell: CellId,
    id: u64,
}

/// The element of a boundary.
#[derive(Clone, Copy)]
enum Element {
    /// A thing of the file.
    Thing(u64),
    /// Nothing but air; IFC4 has an element for it.
    Virtual(Option<u64>),
}

/// Collects new statements.
pub(super) struct IfcWriter<'w> {
    world: &'w World,
    model: &'w Model<'w>,
    options: &'w IfcOptions,
    names: Names,
    /// The point of the file that the bake moved to the origin. [Units: wu]
    origin: [f64; 3],
    text: String,
    next: u64,
    /// Texts that take the place of others in the file.
    edits: Vec<(Range<usize>, String)>,
    /// Old representations of spaces, and the new one.
    bodies: BTreeMap<u64, u64>,
    /// New spaces by storey.
    by_storey: BTreeMap<u64, Vec<u64>>,
    /// Axes of the file's world.
    axes: u64,
    /// Units of lengths, areas and volumes, whatever those of the file are.
    units: [u64; 3],
    history: String,
    virtual_elements: BTreeMap<PortalId, u64>,
    n_boundaries: usize,
    n_without_element: usize,
}

/// Returns the point of the model, in meters with +Y up, that the bake moved to the origin, as the world tells.
fn origin_of(world: &World) -> [f64; 3] {
    let told = world.graph.provenance.settings.get("origin");
    let numbers = told.map(|text| {
        text.split(' ')
            .map(str::parse)
            .collect::<Result<Vec<_>, _>>()
    });
    let numbers = numbers.and_then(Result::ok).unwrap_or_default();
    numbers.try_into().unwrap_or_default()
}

impl<'w> IfcWriter<'w> {
    pub(super) fn new(world: &'w World, model: &'w Model<'w>, options: &'w IfcOptions) -> Self {
        let mut writer = Self {
            world,
            model,
            options,
            names: Names::new(world),
            origin: origin_of(world),
            text: String::new(),
            next: model.file.last_id,
            edits: Vec::new(),
            bodies: BTreeMap::new(),
            by_storey: BTreeMap::new(),
            axes: 0,
            units: [0; 3],
            history: model.history.map_or("$".into(), |id| format!("#{id}")),
            virtual_elements: BTreeMap::new(),
            n_boundaries: 0,
            n_without_element: 0,
        };
        if model.history.is_none() && model.schema == Schema::Ifc2x3 {
            writer.add_history();
        }
        let origin = writer.add("IFCCARTESIANPOINT((0.,0.,0.))");
        writer.axes = writer.add(&format!("IFCAXIS2PLACEMENT3D(#{origin},$,$)"));
        writer.units = [
            ("LENGTHUNIT", "METRE"),
            ("AREAUNIT", "SQUARE_METRE"),
            ("VOLUMEUNIT", "CUBIC_METRE"),
        ]
        .map(|(kind, name)| writer.add(&format!("IFCSIUNIT(*,.{kind}.,$,.{name}.)")));
        writer
    }

    /// Adds what IFC2X3 wants to know of the owner of each thing.
    fn add_history(&mut self) {
        let person = self.add("IFCPERSON($,$,$,$,$,$,$,$)");
        let organization = self.add("IFCORGANIZATION($,'enfilade',$,$,$)");
        let both = self.add(&format!(
            "IFCPERSONANDORGANIZATION(#{person},#{organization},$)"
        ));
        let version = env!("CARGO_PKG_VERSION");
        let program = self.add(&format!(
            "IFCAPPLICATION(#{organization},'{version}','enfilade','enfilade')"
        ));
        let history = self.add(&format!(
            "IFCOWNERHISTORY(#{both},#{program},$,.ADDED.,$,$,$,0)"
        ));
        self.history = format!("#{history}");
    }

    /// Adds a statement; returns its number.
    fn add(&mut self, statement: &str) -> u64 {
        self.next += 1;
        let _ = writeln!(self.text, "#{}={statement};", self.next);
        self.next
    }

    /// Returns a GlobalId that follows from the project and what it is for, and is not in the file, with its quotes.
    fn global_id(&self, what: &str) -> String {
        let mut what = what.to_owned();
        loop {
            let id = hashed_id(self.model.project, &what);
            if !self.model.by_global_id.contains_key(id.as_str()) {
                return format!("'{id}'");
            }
            what.push('+');
        }
    }

    /// Adds a room, or gives its body to a space of the file.
    pub(super) fn space(&mut self, body: &RoomSurfaces, old: Option<u64>) -> Space {
        let room = &self.world.graph[body.cell];
        let key = self.names.of(body.cell).to_owned();
        let history = self.history.clone();
        let (representation, placement) = (self.body(body), self.placement());
        let shape = self.add(&format!(
            "IFCPRODUCTDEFINITIONSHAPE($,$,(#{representation}))"
        ));
        let id = match old {
            Some(id) => {
                self.replace(id, [placement, shape], representation);
                id
            }
            None => {
                let global_id = self.global_id(&format!("space {key}"));
                let floor = f64::from(room.aabb[0][1]) + self.origin[1];
                let elevation = real(floor / self.model.unit);
                let name = quoted(&room.name);
                let id = self.add(&format!(
                    "IFCSPACE({global_id},{history},{name},$,$,#{placement},#{shape},$,.ELEMENT.,.INTERNAL.,{elevation})"
                ));
                let storey = self.storey_at(floor);
                self.by_storey.entry(storey).or_default().push(id);
                id
            }
        };
        self.quantities(body, &key, id);
        Space {
            cell: body.cell,
            id,
        }
    }

    /// Adds a placement in the file's world: no two things may share one.
    fn placement(&mut self) -> u64 {
        self.add(&format!("IFCLOCALPLACEMENT($,#{})", self.axes))
    }

    /// Returns the storey on which a floor lies: the highest that is not above it by more than half a meter.
    fn storey_at(&self, floor: f64) -> u64 {
        let below = self.model.storeys.iter().rev();
        let mut below = below.filter(|s| s.height <= floor + 0.5);
        below.next().unwrap_or(&self.model.storeys[0]).id
    }

    /// Adds the body of a room; returns its representation.
    fn body(&mut self, body: &RoomSurfaces) -> u64 {
        let mut points: HashMap<[u64; 3], u64> = HashMap::new();
        let mut faces = Vec::new();
        for surface in &body.surfaces {
            let polygons = if is_simple(surface) {
                vec![surface.loops.clone()]
            } else {
                let all: Vec<[f64; 3]> = surface.loops.iter().flatten().copied().collect();
                let triangles = triangulated(&surface.loops, surface.normal).into_iter();
                triangles
                    .map(|t| vec![t.map(|i| all[i]).to_vec()])
                    .collect()
            };
            for loops in polygons {
                let mut bounds = Vec::new();
                for (i, ring) in loops.iter().enumerate() {
                    let ids: Vec<u64> = ring.iter().map(|&p| self.vertex(p, &mut points)).collect();
                    let ring = self.add(&format!("IFCPOLYLOOP({})", list(&ids)));
                    let class = if i == 0 {
                        "IFCFACEOUTERBOUND"
                    } else {
                        "IFCFACEBOUND"
                    };
                    bounds.push(self.add(&format!("{class}(#{ring},.T.)")));
                }
                faces.push(self.add(&format!("IFCFACE({})", list(&bounds))));
            }
        }
        let shell = self.add(&format!("IFCCLOSEDSHELL({})", list(&faces)));
        let solid = self.add(&format!("IFCFACETEDBREP(#{shell})"));
        let context = self.model.context;
        self.add(&format!(
            "IFCSHAPEREPRESENTATION(#{context},'Body','Brep',(#{solid}))"
        ))
    }

    /// Gives a space of the file a placement and a shape.
    fn replace(&mut self, space: u64, new: [u64; 2], representation: u64) {
        let file = &self.model.file;
        let Some(statement) = file.get(space) else {
            return;
        };
        let places = file.places(statement).into_iter().skip(5);
        let new = new.map(|id| format!("#{id}"));
        self.edits.extend(places.zip(new));
        let old = representations(file, statement).into_iter();
        self.bodies.extend(old.map(|body| (body, representation)));
    }

    /// Puts new bodies where layers of the file list old ones.
    fn replace_in_layers(&mut self) {
        let file = &self.model.file;
        for layer in file.statements.iter().filter(|s| is_layer(s)) {
            let (places, attributes) = (file.places(layer), file.attributes(layer));
            let (Some(place), Some(items)) = (places.get(2), attributes.get(2)) else {
                continue;
            };
            let ids = StepFile::list(items)
                .into_iter()
                .filter_map(StepFile::reference);
            let ids: Vec<u64> = ids.collect();
            if ids.iter().any(|id| self.bodies.contains_key(id)) {
                let new = ids.iter().map(|id| *self.bodies.get(id).unwrap_or(id));
                let new: BTreeSet<u64> = new.collect();
                let new: Vec<u64> = new.into_iter().collect();
                self.edits.push((place.clone(), list(&new)));
            }
        }
    }

    fn vertex(&mut self, p: [f64; 3], known: &mut HashMap<[u64; 3], u64>) -> u64 {
        let key = p.map(f64::to_bits);
        if let Some(&id) = known.get(&key) {
            return id;
        }
        let [x, y, z] = self.turned(p).map(real);
        let id = self.add(&format!("IFCCARTESIANPOINT(({x},{y},{z}))"));
        known.insert(key, id);
        id
    }

    /// Returns a point of the world as the file has it.
    fn turned(&self, p: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = [0, 1, 2].map(|i| p[i] + self.origin[i]);
        [x, -z, y].map(|c| c / self.model.unit)
    }

    fn quantities(&mut self, body: &RoomSurfaces, key: &str, space: u64) {
        let mut facts = self.world.room_facts.iter().flatten();
        let facts = facts.find(|f| f.cell == body.cell);
        let [length, area, volume] = self.units;
        let formula = match self.model.schema {
            Schema::Ifc2x3 => "",
            Schema::Ifc4 => ",$",
        };
        let mut quantities = vec![self.add(&format!(
            "IFCQUANTITYVOLUME('NetVolume',$,#{volume},{}{formula})",
            real(body.volume)
        ))];
        if let Some(facts) = facts {
            quantities.push(self.add(&format!(
                "IFCQUANTITYAREA('NetFloorArea',$,#{area},{}{formula})",
                real(facts.floor_area)
            )));
            quantities.push(self.add(&format!(
                "IFCQUANTITYLENGTH('Height',$,#{length},{}{formula})",
                real(facts.height)
            )));
        }
        let history = self.history.clone();
        let global_id = self.global_id(&format!("quantities {key}"));
        let all = list(&quantities);
        let set = self.add(&format!(
            "IFCELEMENTQUANTITY({global_id},{history},'Qto_SpaceBaseQuantities',$,$,{all})"
        ));
        let global_id = self.global_id(&format!("quantities of {key}"));
        self.add(&format!(
            "IFCRELDEFINESBYPROPERTIES({global_id},{history},$,$,(#{space}),#{set})"
        ));
    }

    /// Puts the new spaces into their storeys.
    pub(super) fn aggregate(&mut self) {
        for (storey, spaces) in std::mem::take(&mut self.by_storey) {
            let global_id = self.global_id(&format!("spaces of {storey}"));
            let (history, spaces) = (self.history.clone(), list(&spaces));
            self.add(&format!(
                "IFCRELAGGREGATES({global_id},{history},$,$,#{storey},{spaces})"
            ));
        }
    }

    /// Adds the boundaries of all spaces.
    pub(super) fn boundaries(&mut self, rooms: &[(Space, &RoomSurfaces)]) {
        // Those of a pair refer to each other: numbers come first.
        let mut ids: HashMap<(CellId, usize), u64> = HashMap::new();
        let mut elements = Vec::new();
        for (space, room) in rooms {
            for (i, surface) in room.surfaces.iter().enumerate() {
                let Some(element) = self.element(surface) else {
                    self.n_without_element += 1;
                    continue;
                };
                self.next += 1;
                ids.insert((space.cell, i), self.next);
                elements.push((space, *room, i, element));
            }
        }
        for (space, room, i, element) in elements {
            self.boundary(space, room, i, element, &ids);
        }
    }

    fn boundary(
        &mut self,
        space: &Space,
        room: &RoomSurfaces,
        i: usize,
        element: Element,
        ids: &HashMap<(CellId, usize), u64>,
    ) {
        let surface = &room.surfaces[i];
        let geometry = self.connection(surface);
        let global_id = self.global_id(&format!("boundary {} {i}", self.names.of(space.cell)));
        let is_second = self.options.level == SurfaceLevel::Second;
        let (element, physical) = match element {
            Element::Thing(id) => (Some(id), ".PHYSICAL."),
            Element::Virtual(id) => (id, ".VIRTUAL."),
        };
        let outside = match surface.behind {
            Behind::Ground if self.model.schema == Schema::Ifc4 => ".EXTERNAL_EARTH.",
            Behind::Ground => ".EXTERNAL.",
            Behind::Cell(cell) if self.world.graph[cell].outdoor => ".EXTERNAL.",
            Behind::Cell(_) => ".INTERNAL.",
            Behind::Matter => ".NOTDEFINED.",
        };
        let about = match (is_second, surface.behind) {
            (false, _) => "'1stLevel',$",
            (true, Behind::Matter) => "'2ndLevel','2b'",
            (true, _) => "'2ndLevel','2a'",
        };
        let reference = |id: Option<u64>| id.map_or("$".to_owned(), |id| format!("#{id}"));
        let mut class = "IFCRELSPACEBOUNDARY";
        let mut more = String::new();
        if self.model.schema == Schema::Ifc4 && is_second {
            class = "IFCRELSPACEBOUNDARY2NDLEVEL";
            let host = surface
                .host
                .and_then(|h| ids.get(&(space.cell, h)).copied());
            let pair = match (surface.behind, surface.pair) {
                (Behind::Cell(cell), Some(pair)) => ids.get(&(cell, pair)).copied(),
                _ => None,
            };
            more = format!(",{},{}", reference(host), reference(pair));
        }
        let id = ids[&(space.cell, i)];
        let (history, element) = (&self.history, reference(element));
        let _ = writeln!(
            self.text,
            "#{id}={class}({global_id},{history},{about},#{},{element},#{geometry},{physical},{outside}{more});",
            space.id
        );
        self.n_boundaries += 1;
    }

    /// Adds the polygon of a boundary in its plane.
    fn connection(&mut self, surface: &BoundarySurface) -> u64 {
        let all: Vec<Vec<DVec3>> = surface
            .loops
            .iter()
            .map(|ring| ring.iter().map(|&p| self.turned(p).into()).collect())
            .collect();
        let [x, y, z] = surface.normal;
        let normal = DVec3::new(x, -z, y);
        let origin = all[0][0];
        let (u, v) = Plane::through(origin, normal).basis();
        // Outlines turn left about the normal.
        let u = if u.cross(v).dot(normal) < 0.0 { -u } else { u };
        let point = |p: DVec3| p.to_array().map(real).join(",");
        let at = self.add(&format!("IFCCARTESIANPOINT(({}))", point(origin)));
        let axis = self.add(&format!("IFCDIRECTION(({}))", point(normal)));
        let along = self.add(&format!("IFCDIRECTION(({}))", point(u)));
        let axes = self.add(&format!("IFCAXIS2PLACEMENT3D(#{at},#{axis},#{along})"));
        let plane = self.add(&format!("IFCPLANE(#{axes})"));
        let across = normal.cross(u);
        let mut lines = Vec::new();
        for ring in &all {
            let mut ids = Vec::new();
            for p in ring {
                let d = *p - origin;
                let (s, t) = (real(d.dot(u)), real(d.dot(across)));
                ids.push(self.add(&format!("IFCCARTESIANPOINT(({s},{t}))")));
            }
            ids.push(ids[0]);
            lines.push(self.add(&format!("IFCPOLYLINE({})", list(&ids))));
        }
        let (outer, inner) = (lines[0], list(&lines[1..]));
        let face = self.add(&format!("IFCCURVEBOUNDEDPLANE(#{plane},#{outer},{inner})"));
        self.add(&format!("IFCCONNECTIONSURFACEGEOMETRY(#{face},$)"))
    }

    /// Returns what makes a surface; `None` if that is not in the file.
    fn element(&mut self, surface: &BoundarySurface) -> Option<Element> {
        match surface.cover {
            SurfaceCover::Object { source, .. } => self.object_above(source).map(Element::Thing),
            SurfaceCover::Bare => None,
            SurfaceCover::Opening(portal) => {
                let fittings = &self.world.graph[portal].fittings;
                let leaves = fittings.iter().filter(|f| f.part == FittingPart::Leaf);
                let details = leaves.chain(fittings).map(|f| f.detail as usize);
                let mut details = details.filter_map(|d| self.world.details.get(d));
                let thing = details.find_map(|detail| self.object_above(detail.source));
                Some(match thing {
                    Some(id) => Element::Thing(id),
                    None => Element::Virtual(self.virtual_element(portal)),
                })
            }
        }
    }

    /// Returns the thing of the file that a node, or the nearest above it, is named after.
    fn object_above(&self, source: Option<u32>) -> Option<u64> {
        let mut at = source;
        while let Some(node) = at.and_then(|i| self.world.sources.get(i as usize)) {
            if let Some(id) = self.model.object(&node.name) {
                return Some(id);
            }
            at = node.parent;
        }
        None
    }

    /// Returns the element of an opening without anything in it, which IFC4 wants.
    fn virtual_element(&mut self, portal: PortalId) -> Option<u64> {
        if self.model.schema == Schema::Ifc2x3 {
            return None;
        }
        if let Some(&id) = self.virtual_elements.get(&portal) {
            return Some(id);
        }
        let what = format!("opening {}", portal.0);
        let known = hashed_id(self.model.project, &what);
        if let Some(&id) = self.model.by_global_id.get(known.as_str()) {
            // Written into the file before.
            return Some(id);
        }
        let global_id = self.global_id(&what);
        let (history, placement) = (self.history.clone(), self.placement());
        let id = self.add(&format!(
            "IFCVIRTUALELEMENT({global_id},{history},$,$,$,#{placement},$,$)"
        ));
        self.virtual_elements.insert(portal, id);
        Some(id)
    }

    /// Returns the file with all changes.
    pub(super) fn finish(mut self, ifc: &[u8], removed: &BTreeSet<u64>) -> IfcSpaces {
        self.replace_in_layers();
        let file = &self.model.file;
        let mut edits = self.edits;
        let gone = removed.iter().filter_map(|&id| file.get(id));
        edits.extend(gone.map(|statement| (statement.place.clone(), String::new())));
        edits.push((file.end..file.end, self.text));
        edits.sort_by_key(|(place, _)| place.start);
        let mut out = Vec::with_capacity(ifc.len());
        let mut done = 0;
        for (place, text) in edits {
            out.extend_from_slice(&ifc[done..place.start]);
            out.extend_from_slice(text.as_bytes());
            done = place.end;
        }
        out.extend_from_slice(&ifc[done..]);
        IfcSpaces {
            bytes: out,
            n_boundaries: self.n_boundaries,
            n_without_element: self.n_without_element,
            ..IfcSpaces::default()
        }
    }
}

/// Returns a GlobalId: 2 bits, then 21 times 6, as digits of IFC.
fn hashed_id(project: &str, what: &str) -> String {
    const DIGITS: &[u8; 64] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$";
    let hash = XxHash3_128::oneshot(format!("{project} {what}").as_bytes());
    let digit = |i: u32| char::from(DIGITS[(hash >> (6 * (21 - i)) & 63) as usize]);
    (0..22).map(digit).collect()
}

/// Returns references as a list.
fn list(ids: &[u64]) -> String {
    let all: Vec<String> = ids.iter().map(|id| format!("#{id}")).collect();
    format!("({})", all.join(","))
}

/// Returns `true` for a flat polygon whose loops do not touch.
fn is_simple(surface: &BoundarySurface) -> bool {
    let mut known = BTreeSet::new();
    let normal = DVec3::from(surface.normal);
    let origin = DVec3::from(surface.loops[0][0]);
    surface.loops.iter().flatten().all(|p| {
        let off = (DVec3::from(*p) - origin).dot(normal).abs();
        off <= FLAT && known.insert(p.map(f64::to_bits))
    })
}
