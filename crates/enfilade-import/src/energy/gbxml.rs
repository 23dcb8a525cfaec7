//! gbXML, the schema of greenbuildingxml.org.

use std::collections::HashMap;

use enfilade_geom::DVec3;
use roxmltree::{Document, Node, ParsingOptions};

use super::model::{Class, EnergyModel, Loop, Sheet, Space};
use super::text;
use super::thick::thicken;
use crate::ImportError;
use crate::builder::Builder;

/// Fewest bytes of an element: `<a/>`.
const NODE_BYTES: usize = 4;

/// Returns the model of a file. Linear.
pub(super) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<EnergyModel, ImportError> {
    let text = text(bytes);
    let options = ParsingOptions {
        nodes_limit: u32::try_from(text.len() / NODE_BYTES + 16).unwrap_or(u32::MAX),
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(&text, options)
        .map_err(|e| builder.malformed(format!("line {}", e.pos().row), e.to_string()))?;
    let root = document.root_element();
    if root.tag_name().name() != "gbXML" {
        let problem = format!("its first element is {}, not gbXML", root.tag_name().name());
        return Err(builder.malformed("root", problem));
    }
    let unit = unit(root, builder)?;
    let mut sheets = Vec::new();
    // Polygons around each space, for those without a shell of their own.
    let mut around: HashMap<&str, Vec<Loop>> = HashMap::new();
    for surface in root.descendants().filter(|n| is(*n, "Surface")) {
        add_surface(surface, &mut sheets, &mut around, builder)?;
    }
    let mut spaces = Vec::new();
    let mut has_shells = true;
    for space in root.descendants().filter(|n| is(*n, "Space")) {
        has_shells &= child(space, "ShellGeometry").is_some();
        spaces.push(read_space(space, &mut around, builder)?);
    }
    let mut model = EnergyModel {
        format: "gbXML",
        unit,
        sheets,
        spaces,
    };
    if has_shells {
        thicken(&mut model);
    }
    Ok(model)
}

fn is(node: Node<'_, '_>, name: &str) -> bool {
    node.tag_name().name() == name
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|n| is(*n, name))
}

/// Returns meters per unit of the file.
fn unit(root: Node<'_, '_>, builder: &Builder<'_>) -> Result<f64, ImportError> {
    Ok(match root.attribute("lengthUnit") {
        None | Some("Meters") => 1.0,
        Some("Kilometers") => 1000.0,
        Some("Centimeters") => 0.01,
        Some("Millimeters") => 0.001,
        Some("Feet") => 0.3048,
        Some("Inches") => 0.0254,
        Some("Yards") => 0.9144,
        Some("Miles") => 1609.344,
        Some(other) => {
            let problem = format!("the lengthUnit '{other}' is not known; write Meters or Feet");
            return Err(builder.malformed("gbXML", problem));
        }
    })
}

/// Returns the id of an element, or its line where it has none.
fn id_of(node: Node<'_, '_>) -> String {
    let line = || {
        let line = node.document().text_pos_at(node.range().start).row;
        format!("line-{line}")
    };
    node.attribute("id").map_or_else(line, str::to_owned)
}

fn class_of(surface_type: &str) -> Class {
    match surface_type {
        "Air" => Class::Air,
        "Roof" => Class::Roof,
        "Shade" => Class::Shade,
        "FreestandingColumn" | "EmbeddedColumn" => Class::Column,
        "InteriorFloor" | "ExposedFloor" | "RaisedFloor" | "SlabOnGrade" | "UndergroundSlab"
        | "Ceiling" | "UndergroundCeiling" => Class::Slab,
        _ => Class::Wall,
    }
}

/// Adds a surface and its openings, and the surface to the spaces that it bounds.
fn add_surface<'a>(
    surface: Node<'a, '_>,
    sheets: &mut Vec<Sheet>,
    around: &mut HashMap<&'a str, Vec<Loop>>,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    let (id, class) = (id_of(surface), surface.attribute("surfaceType"));
    builder.go_on(&id)?;
    let Some(outline) = planar(surface, builder)? else {
        builder.note(format!("surface '{id}'"), "has no PlanarGeometry; left out");
        return Ok(());
    };
    let mut spaces = Vec::new();
    for space in surface.children().filter(|n| is(*n, "AdjacentSpaceId")) {
        if let Some(space) = space.attribute("spaceIdRef") {
            around.entry(space).or_default().push(outline.clone());
            spaces.push(space.to_owned());
        }
    }
    let mut openings = Vec::new();
    for opening in surface.children().filter(|n| is(*n, "Opening")) {
        let Some(hole) = planar(opening, builder)? else {
            builder.note(
                format!("opening '{}'", id_of(opening)),
                "has no PlanarGeometry; left out",
            );
            continue;
        };
        let class = match opening.attribute("openingType").unwrap_or_default() {
            "Air" => Class::Air,
            kind if kind.ends_with("Door") => Class::Door,
            _ => Class::Window,
        };
        openings.push(sheets.len());
        sheets.push(Sheet {
            spaces: spaces.clone(),
            ..Sheet::new(id_of(opening), class, hole)
        });
    }
    sheets.push(Sheet {
        openings,
        spaces,
        ..Sheet::new(id, class_of(class.unwrap_or_default()), outline)
    });
    Ok(())
}

/// Returns a space with its shell, or else the surfaces around it.
fn read_space(
    space: Node<'_, '_>,
    around: &mut HashMap<&str, Vec<Loop>>,
    builder: &Builder<'_>,
) -> Result<Space, ImportError> {
    let id = id_of(space);
    let mut shell = Vec::new();
    if let Some(geometry) = child(space, "ShellGeometry") {
        for polygon in geometry.descendants().filter(|n| is(*n, "PolyLoop")) {
            shell.push(poly_loop(polygon, builder)?);
        }
    }
    if shell.is_empty() {
        shell = around.remove(id.as_str()).unwrap_or_default();
    }
    let name = child(space, "Name").and_then(|n| n.text());
    let name = name.map(str::trim).filter(|n| !n.is_empty());
    let name = name.unwrap_or(&id).to_owned();
    Ok(Space {
        id,
        name,
        shell,
        walls: Vec::new(),
    })
}

/// Returns the polygon of a surface or an opening.
fn planar(node: Node<'_, '_>, builder: &Builder<'_>) -> Result<Option<Loop>, ImportError> {
    let polygon = child(node, "PlanarGeometry").and_then(|g| child(g, "PolyLoop"));
    polygon.map(|p| poly_loop(p, builder)).transpose()
}

fn poly_loop(polygon: Node<'_, '_>, builder: &Builder<'_>) -> Result<Loop, ImportError> {
    let points = polygon.children().filter(|n| is(*n, "CartesianPoint"));
    let read = |point| {
        at(point).ok_or_else(|| {
            let line = point.document().text_pos_at(point.range().start).row;
            let problem = "a CartesianPoint needs three Coordinates that are finite numbers";
            builder.malformed(format!("line {line}"), problem)
        })
    };
    points.map(read).collect()
}

/// Returns the place of a point.
fn at(point: Node<'_, '_>) -> Option<DVec3> {
    let numbers = point.children().filter(|n| is(*n, "Coordinate"));
    let numbers = numbers.map(|n| n.text()?.trim().parse::<f64>().ok());
    let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
    let place = DVec3::from_array(numbers.try_into().ok()?);
    place.is_finite().then_some(place)
}
