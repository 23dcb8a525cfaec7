//! Reads Quake `.map` files: Standard and Valve 220, Quake 3 (brush primitives, patches), Doom 3, and Valve's `.vmf`. Brushes become
//! solids and their faces; entities are kept.
//!
//! A brush is the space behind all of its planes, so it is always convex; an impossible brush (planes that face
//! inwards, or that leave a way to infinity) is an error with line and column. World and `func_group` brushes are
//! structural. Detail are `func_detail*` and all other brush entities, brushes with the detail flag of Quake 2 and 3,
//! and patches, which close nothing for their compilers either. Sky is structural even as detail; liquids are
//! see-through detail; what has no matter by its texture ([`texture_matter`]) or its class is left out, and so are structural
//! faces that other structural brushes hide altogether.
//!
//! A unit is 1/32 m by default (19.05 mm in `.vmf`): a player of 56 units is 1.75 m tall, and coordinates stay exact. Up is z. Texture
//! sizes are in WAD files, which are not read, so maps have no texture coordinates.

mod given;
mod layers;
mod order;
mod parse;
mod patch;
mod vmf;

use std::collections::BTreeMap;

use enfilade_geom::scene::{Entity, Material, Mesh, Primitive, Role};
use enfilade_geom::solid::exposed_faces;
use enfilade_geom::{ConvexSolid, DMat3, DMat4, DVec3, Plane, SolidError};
use enfilade_prepare::{TextureMatter, is_sky_around, texture_matter};
use serde_json::json;

use crate::builder::Builder;
use crate::origins::extras_of;
use crate::{ImportError, Up};
use layers::{GroupNodes, Groups, node_of};
use parse::Place;
use parse::{Brush, MAX_COORDINATE, RawEntity};
use patch::Tessellation;

/// Default length of a map's unit. [Units: m]
const UNIT: f64 = 1.0 / 32.0;
/// … and of that of Source: three quarters of an inch, so that 16 are a foot. [Units: m]
const SOURCE_UNIT: f64 = 0.01905;
/// Vertices nearer than this are one. [Units: those of the map]
const WELD: f64 = 1e-3;
/// Most sides of a brush; clipping takes quadratic time. Editors make a few dozen at most.
const MAX_SIDES: usize = 256;

/// Returns `true` if the text looks like a map: it begins, comments aside, with a brace and a quote.
pub(crate) fn is_map(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1 << 16)];
    let mut lines = head
        .split(|&b| b == b'\n')
        .map(<[u8]>::trim_ascii)
        .filter(|l| !l.is_empty() && !l.starts_with(b"//"));
    if std::str::from_utf8(&head[..head.len().min(64)]).is_ok_and(vmf::is_vmf) {
        return true;
    }
    let second = |rest: &[u8]| rest.trim_ascii().starts_with(b"\"");
    match lines.next() {
        Some(b"{") => lines.next().is_some_and(second),
        _ => false,
    }
}

/// Role of a brush entity in the decomposition.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Structural,
    Detail,
    Nothing,
}

/// Beginnings of classes of brush entities that have no matter: they act on players, or mark openings and areas for compilers.
const NOTHING: [&str; 8] = [
    "trigger_",
    "info_",
    "func_areaportal",
    "func_occluder",
    "func_viscluster",
    "func_clip_",
    "func_buyzone",
    "func_bomb_target",
];

fn kind_of_class(class: &str) -> Kind {
    match class {
        "worldspawn" | "func_group" => Kind::Structural,
        _ if NOTHING.iter().any(|start| class.starts_with(start)) => Kind::Nothing,
        _ => Kind::Detail,
    }
}

/// Matter of a brush by its sides' textures, in whatever entity.
#[derive(Clone, Copy, PartialEq)]
enum BrushMatter {
    Solid,
    /// Closes the world everywhere, even as a detail brush, as for the compilers.
    Sky,
    Liquid,
    /// Controls games and compilers; has no matter.
    Tool,
}

fn matter_of(brush: &Brush<'_>, own: &BTreeMap<String, TextureMatter>) -> BrushMatter {
    let matters: Vec<Option<TextureMatter>> = (brush.sides.iter())
        .map(|side| texture_matter(own, side.texture))
        .collect();
    let has = |wanted: TextureMatter| matters.contains(&Some(wanted));
    let is_nothing = |m: &Option<TextureMatter>| m.is_some_and(TextureMatter::is_nothing);
    if [
        TextureMatter::Air,
        TextureMatter::Portal,
        TextureMatter::Hint,
    ]
    .map(has)
    .contains(&true)
        || !matters.is_empty() && matters.iter().all(is_nothing)
    {
        BrushMatter::Tool
    } else if has(TextureMatter::Water) {
        BrushMatter::Liquid
    } else if has(TextureMatter::Sky) {
        BrushMatter::Sky
    } else {
        BrushMatter::Solid
    }
}

/// The parts of an entity that become one object each.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum EntityPart {
    Own,
    Sky,
    Liquid,
    /// Brushes with the detail flag.
    Detail,
    Patch,
}

/// A brush and its shape.
struct Shaped<'t> {
    solid: ConvexSolid,
    textures: Vec<&'t str>,
    entity: usize,
    matter: BrushMatter,
    /// It has the detail flag.
    is_detail: bool,
}

/// Reads one file into the builder.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    // Maps are Latin-1 or UTF-8; only names and texts depend on it.
    let text = String::from_utf8_lossy(bytes);
    let is_vmf = vmf::is_vmf(&text);
    builder.set_format(if is_vmf { "VMF" } else { "Quake map" });
    let failed =
        |builder: &Builder<'_>, p: parse::Problem| builder.malformed(p.place.to_string(), p.text);
    let parse = if is_vmf { vmf::parse_vmf } else { parse::parse };
    let mut entities = parse(&text).map_err(|p| failed(builder, p))?;
    layers::leave_out_omitted(&mut entities, builder);
    order::sort(&mut entities);
    if !entities
        .iter()
        .any(|e| e.get("classname") == Some("worldspawn"))
    {
        let place = entities
            .first()
            .map_or(Place { line: 1, column: 1 }, |e| e.place);
        return Err(builder.malformed(
            place.to_string(),
            "no entity is the world (\"classname\" \"worldspawn\"); save the map again",
        ));
    }
    let n_brushes: usize = entities.iter().map(|e| e.brushes.len()).sum();
    // A box brush has 6 faces of 4 vertices and 2 triangles; larger ones are charged when placed.
    builder.charge_memory("brushes", n_brushes as u64, 1024)?;
    let mut shaped: Vec<Shaped<'_>> = Vec::new();
    for (i, entity) in entities.iter().enumerate() {
        if entity.brushes.is_empty() && entity.patches.is_empty()
            || kind_of_class(entity.get("classname").unwrap_or("")) == Kind::Nothing
        {
            continue;
        }
        for brush in &entity.brushes {
            let matter = matter_of(brush, &builder.options.roles.textures);
            if matter == BrushMatter::Tool {
                continue;
            }
            let solid = solid_of(brush).map_err(|p| failed(builder, p))?;
            if solid.planes.len() < brush.sides.len() {
                builder.note(
                    brush.place.to_string(),
                    "sides that do not bound their brush; left out",
                );
            }
            let textures = solid
                .sources
                .iter()
                .map(|&s| brush.sides[s as usize].texture)
                .collect();
            shaped.push(Shaped {
                solid,
                textures,
                entity: i,
                matter,
                is_detail: brush.sides.iter().any(|s| s.is_detail),
            });
        }
    }
    let unit = if is_vmf { SOURCE_UNIT } else { UNIT };
    build(&entities, &shaped, unit, builder)
}

/// Returns the brush as a solid.
fn solid_of(brush: &Brush<'_>) -> Result<ConvexSolid, parse::Problem> {
    let problem = |place: Place, text: String| parse::Problem { place, text };
    if brush.sides.len() < 4 || brush.sides.len() > MAX_SIDES {
        let n = brush.sides.len();
        return Err(problem(
            brush.place,
            format!(
                "a brush with {n} sides; at least 4 are needed, and at most {MAX_SIDES} allowed"
            ),
        ));
    }
    let mut planes = Vec::with_capacity(brush.sides.len());
    for side in &brush.sides {
        let [a, b, c] = side.points.map(DVec3::from_array);
        let normal = (a - b).cross(c - b).try_normalize();
        let Some(normal) = normal.filter(|_| (a - b).cross(c - b).length() > 1e-6) else {
            return Err(problem(
                side.place,
                "the three points of this side lie on a line and do not define a plane; move one of them"
                    .into(),
            ));
        };
        planes.push(Plane::through(b, exact(normal)));
    }
    let reach = 2.0 * MAX_COORDINATE;
    ConvexSolid::from_planes(&planes, reach, WELD).map(snapped).map_err(|e| {
        let inward: Vec<Plane> = planes.iter().map(|p| p.flipped()).collect();
        let is_inverted = ConvexSolid::from_planes(&inward, reach, WELD).is_ok();
        problem(
            brush.place,
            match e {
                _ if is_inverted => {
                    "the brush is inside out: its sides face inwards; swap two points of each side".into()
                }
                SolidError::Empty => {
                    "the sides of this brush enclose nothing: they contradict each other, as when a solid that \
                     is not convex is written as one brush; split it into convex ones or delete it"
                        .into()
                }
                SolidError::Unbounded => {
                    "the sides of this brush leave a way to infinity; a side is missing".into()
                }
            },
        )
    })
}

/// Returns the normal, exact if it is axis-aligned up to rounding.
fn exact(normal: DVec3) -> DVec3 {
    let axis = [DVec3::X, DVec3::Y, DVec3::Z]
        .into_iter()
        .find(|a| normal.dot(*a).abs() > 1.0 - 1e-14);
    axis.map_or(normal, |a| a * normal.dot(a).signum())
}

/// Rounds vertices that are whole numbers up to numerical error.
fn snapped(mut solid: ConvexSolid) -> ConvexSolid {
    for c in solid.faces.iter_mut().flat_map(|f| &mut f.points) {
        let whole = c.round();
        *c = DVec3::select((*c - whole).abs().cmplt(DVec3::splat(1e-6)), whole, *c);
    }
    solid
}

/// Faces by entity and part, then by texture. Each entity and part becomes one object, to keep its identity.
type Faces<'t> = BTreeMap<(usize, EntityPart), BTreeMap<&'t str, Primitive>>;

fn build(
    entities: &[RawEntity<'_>],
    shaped: &[Shaped<'_>],
    unit: f64,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    let mut options = builder.options.clone();
    options.unit = options.unit.or(Some(unit));
    options.up = options.up.or(Some(Up::Z));
    let base = options.base_transform()?;
    let scale = options.unit.unwrap_or(unit);
    let rotation = DMat3::from_mat4(base) * (1.0 / scale);
    let offset = base.w_axis.truncate();
    let origin_of = |e: &RawEntity<'_>| {
        let mut numbers = e
            .get("origin")?
            .split_ascii_whitespace()
            .map(str::parse::<f64>);
        let mut next = || numbers.next()?.ok().filter(|v| v.is_finite());
        Some(base.transform_point3(DVec3::new(next()?, next()?, next()?)))
    };
    let placed = |s: &ConvexSolid| s.placed(scale, &rotation, offset);
    let solid = |brush: &Brush<'_>| Some(placed(&solid_of(brush).ok()?));
    let given = given::portals(entities, &builder.options.roles, solid);
    builder.add_given_portals(given);
    let mut brushwork = Brushwork {
        entities,
        shaped,
        groups: Groups::of(entities),
        roles: roles_of(entities, builder),
        is_open: false,
    };
    let (sky, walls): (Vec<&Shaped<'_>>, _) =
        (shaped.iter().filter(|s| brushwork.is_structural(s)))
            .partition(|s| s.matter == BrushMatter::Sky);
    let [walls, sky] =
        [walls, sky].map(|of| of.iter().map(|s| placed(&s.solid)).collect::<Vec<_>>());
    brushwork.is_open = is_sky_around(&sky, &walls);
    if brushwork.is_open {
        let reason = "a sky around everything else: outdoors to its end";
        builder
            .report
            .leave_out(reason, "brushes of the sky", sky.len() as u64);
        builder.add_sky(sky);
    }
    let structural = brushwork.structural();
    let faces = brushwork.visible_faces(&structural, builder)?;
    let object_of = brushwork.place(faces, base, builder)?;
    builder.add_solids(structural.iter().map(|s| placed(s)));
    for (i, e) in entities.iter().enumerate() {
        builder.add_entity(Entity {
            position: origin_of(e),
            object: object_of.get(&i).copied(),
            ..entity_of(e)
        });
    }
    if structural.is_empty() {
        builder.note("world", "no structural brush");
    }
    Ok(())
}

/// Returns the class and the properties of an entity.
fn entity_of(entity: &RawEntity<'_>) -> Entity {
    let properties = entity.properties.iter();
    Entity {
        class: entity.get("classname").unwrap_or("").to_owned(),
        properties: properties
            .map(|&(k, v)| (k.to_owned(), v.to_owned()))
            .collect(),
        ..Entity::default()
    }
}

fn class_of<'t>(entity: &RawEntity<'t>) -> &'t str {
    entity.get("classname").unwrap_or("brushes")
}

/// Returns the role of each entity, with the reason.
fn roles_of(entities: &[RawEntity<'_>], builder: &Builder<'_>) -> Vec<(Role, String)> {
    let groups = Groups::of(entities);
    let role = |(e, entity): (usize, &RawEntity<'_>)| {
        let class = class_of(entity);
        let told = || match kind_of_class(class) {
            _ if builder.is_detail_file => (Role::Detail, "from a detail file".to_owned()),
            Kind::Structural => (Role::Structural, format!("map: brushes of {class}")),
            _ => (Role::Detail, format!("map: brushes of {class}")),
        };
        let rules = &builder.options.roles;
        let of_group = || {
            let around = groups.around(entities, e);
            around.into_iter().find_map(|name| rules.forced(name))
        };
        let forced = rules.forced(&format!("{class} {e}")).or_else(of_group);
        forced.unwrap_or_else(told)
    };
    entities.iter().enumerate().map(role).collect()
}

/// All brushes of a map, with their shapes.
struct Brushwork<'s, 't> {
    entities: &'s [RawEntity<'t>],
    shaped: &'s [Shaped<'t>],
    groups: Groups<'t>,
    /// Role of each entity, with the reason.
    roles: Vec<(Role, String)>,
    /// The sky is around an open world, and left out.
    is_open: bool,
}

impl<'s, 't> Brushwork<'s, 't> {
    /// Returns `true` if a brush is sky, which closes the world though it is detail.
    fn seals(&self, s: &Shaped<'_>) -> bool {
        let class = class_of(&self.entities[s.entity]);
        s.matter == BrushMatter::Sky && (class.starts_with("func_detail") || s.is_detail)
    }

    /// Returns `true` for the sky of an open world.
    fn is_gone(&self, s: &Shaped<'_>) -> bool {
        self.is_open && s.matter == BrushMatter::Sky
    }

    fn is_structural(&self, s: &Shaped<'_>) -> bool {
        let is_of_structure = self.roles[s.entity].0 == Role::Structural && !s.is_detail;
        s.matter != BrushMatter::Liquid && !self.is_gone(s) && (is_of_structure || self.seals(s))
    }

    fn structural(&self) -> Vec<&'s ConvexSolid> {
        let structural = self.shaped.iter().filter(|s| self.is_structural(s));
        structural.map(|s| &s.solid).collect()
    }

    /// Returns the faces of all brushes, without those that other structural brushes hide altogether.
    fn visible_faces(
        &self,
        structural: &[&ConvexSolid],
        builder: &mut Builder<'_>,
    ) -> Result<Faces<'t>, ImportError> {
        let exposed = exposed_faces(structural, WELD, enfilade_geom::Purse::endless());
        let mut exposed = exposed.iter();
        let mut faces = Faces::new();
        for s in self.shaped.iter().filter(|s| !self.is_gone(s)) {
            let visible = self.is_structural(s).then(|| exposed.next()).flatten();
            let part = match s.matter {
                BrushMatter::Liquid => EntityPart::Liquid,
                BrushMatter::Sky if self.seals(s) => EntityPart::Sky,
                _ if s.is_detail => EntityPart::Detail,
                _ => EntityPart::Own,
            };
            let parts = faces.entry((s.entity, part)).or_default();
            for (f, face) in s.solid.faces.iter().enumerate() {
                if visible.is_some_and(|v| v[f].is_empty()) {
                    continue;
                }
                let to = parts.entry(s.textures[f]).or_default();
                let first = to.positions.len() as u32;
                let n = face.points.len() as u32;
                builder.charge_vertices("faces", u64::from(n))?;
                let normal = s.solid.planes[f].normal.as_vec3().to_array();
                to.positions
                    .extend(face.points.iter().map(|p| p.as_vec3().to_array()));
                to.normals.extend(face.points.iter().map(|_| normal));
                to.indices
                    .extend((1..n - 1).flat_map(|k| [first, first + k, first + k + 1]));
            }
        }
        for (e, entity) in self.entities.iter().enumerate() {
            if kind_of_class(class_of(entity)) == Kind::Nothing {
                continue;
            }
            for patch in &entity.patches {
                let shape = Tessellation::new(patch);
                let place = patch.place.to_string();
                let n = shape.n_vertices() as u64;
                builder.charge_vertices(&place, n)?;
                // A vertex with its normal, and the two triangles that begin at it.
                builder.charge_memory(&place, n, 48)?;
                let parts = faces.entry((e, EntityPart::Patch)).or_default();
                shape.append(parts.entry(patch.texture).or_default());
            }
        }
        Ok(faces)
    }

    /// Places an object for each entity and part; returns the first of each entity.
    fn place(
        &self,
        faces: Faces<'_>,
        base: DMat4,
        builder: &mut Builder<'_>,
    ) -> Result<BTreeMap<usize, u32>, ImportError> {
        let mut material_of: BTreeMap<(&str, Look), u32> = BTreeMap::new();
        let mut object_of: BTreeMap<usize, u32> = BTreeMap::new();
        let mut nodes = GroupNodes::new();
        for ((e, part), parts) in faces {
            if parts.is_empty() {
                continue;
            }
            let class = class_of(&self.entities[e]);
            let (role, reason) = &self.roles[e];
            let (suffix, told) = match part {
                EntityPart::Own => ("", None),
                EntityPart::Sky => (
                    " sky",
                    Some((Role::Structural, "map: sky closes the world")),
                ),
                EntityPart::Liquid => (" liquid", Some((Role::Detail, "map: a liquid"))),
                EntityPart::Detail => (" detail", Some((Role::Detail, "map: detail brushes"))),
                EntityPart::Patch => (" patches", Some((Role::Detail, "map: patches"))),
            };
            let name = format!("{class} {e}{suffix}");
            let (role, reason) = told.unwrap_or((*role, reason));
            let is_liquid = part == EntityPart::Liquid;
            let look = Look {
                is_liquid,
                is_double_sided: is_liquid || part == EntityPart::Patch,
            };
            let mut primitives = Vec::new();
            for (texture, mut primitive) in parts {
                let material = *material_of
                    .entry((texture, look))
                    .or_insert_with(|| builder.push_material(material(texture, look)));
                primitive.material = Some(material);
                primitives.push(primitive);
            }
            let mesh = builder.push_mesh(Mesh {
                name: name.clone(),
                primitives,
            });
            let object = builder.place_as(mesh, base, &name, role, reason)?;
            let around = self.groups.around(self.entities, e);
            if let Some(group) = node_of(&around, &mut nodes, builder)? {
                let node = builder.add_source(
                    &name,
                    Some(group),
                    &name,
                    &extras_of(&entity_of(&self.entities[e])),
                )?;
                builder.put_at(object, node);
            }
            object_of.entry(e).or_insert(object);
        }
        Ok(object_of)
    }
}

/// Properties of a material besides its texture's name.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Look {
    is_liquid: bool,
    is_double_sided: bool,
}

/// Returns a plain material with a texture's name, in a color of its own.
fn material(texture: &str, look: Look) -> Material {
    let Look {
        is_liquid,
        is_double_sided,
    } = look;
    // FNV-1a, for a stable color.
    let hash = texture.bytes().fold(0x811c_9dc5_u32, |h, b| {
        (h ^ u32::from(b.to_ascii_lowercase())).wrapping_mul(0x0100_0193)
    });
    let channel = |shift: u32| 0.25 + 0.5 * ((hash >> shift) & 255) as f32 / 255.0;
    let base_color = [
        channel(0),
        channel(8),
        channel(16),
        if is_liquid { 0.5 } else { 1.0 },
    ];
    let mut fields = json!({
        "name": texture,
        "pbrMetallicRoughness": {
            "baseColorFactor": base_color, "metallicFactor": 0.0, "roughnessFactor": 1.0
        }
    });
    if is_liquid {
        fields["alphaMode"] = json!("BLEND");
    }
    if is_double_sided {
        fields["doubleSided"] = json!(true);
    }
    Material {
        name: texture.to_owned(),
        gltf: fields.to_string(),
        double_sided: is_double_sided,
        transparent: is_liquid,
        base_color,
    }
}
