//! PLY (Turk, *The PLY Polygon File Format*, 1994), ASCII and binary of either byte order.
//!
//! This reader replaces `ply-rs-bw`, which requires each ASCII element on a line of its own and silently drops the
//! first of two elements with one name (`docs/dependencies.md`).

use crate::builder::Builder;
use crate::polygon::Splitter;
use crate::soup::shortened;
use crate::{ImportError, scans, soup};
use enfilade_geom::DVec3;
use enfilade_geom::scene::{Mesh, Primitive};

/// Returns `true` if the bytes look like PLY.
pub(crate) fn is_ply(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")
}

/// Reads one file into the builder.
pub(crate) fn read(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("PLY");
    let (header, body) = read_header(bytes, builder)?;
    let mut source = Source {
        encoding: header.encoding,
        bytes: &bytes[body..],
        at: 0,
    };
    let mut cloud = Cloud::default();
    for element in &header.elements {
        read_element(element, &mut source, &mut cloud, builder)?;
    }
    if cloud.ends.is_empty() && cloud.strips.is_empty() && !cloud.positions.is_empty() {
        let points = cloud.positions.into_iter().map(DVec3::from_array).collect();
        return scans::read_points(points, cloud.station_of, header.stations, builder);
    }
    cloud.finish(builder)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Returns the number that stands for full intensity in a color of this type.
    fn most(self) -> f64 {
        match self {
            Self::I8 | Self::U8 => 255.0,
            Self::I16 | Self::U16 => 65535.0,
            Self::I32 | Self::U32 => 4_294_967_295.0,
            Self::F32 | Self::F64 => 1.0,
        }
    }

    /// Returns the value from its bytes, least significant first.
    fn read(self, b: [u8; 8]) -> f64 {
        match self {
            Self::I8 => f64::from(b[0] as i8),
            Self::U8 => b[0].into(),
            Self::I16 => i16::from_le_bytes([b[0], b[1]]).into(),
            Self::U16 => u16::from_le_bytes([b[0], b[1]]).into(),
            Self::I32 => i32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
            Self::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
            Self::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
            Self::F64 => f64::from_le_bytes(b),
        }
    }
}

struct Property {
    name: String,
    kind: Scalar,
    /// Type of the length of a list; `None` for a single value.
    length: Option<Scalar>,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Header {
    encoding: Encoding,
    /// Places of a scanner, from comments.
    stations: Vec<DVec3>,
    elements: Vec<Element>,
}

/// Returns the header, and the offset of the body.
fn read_header(bytes: &[u8], builder: &Builder<'_>) -> Result<(Header, usize), ImportError> {
    let mut encoding = None;
    let mut stations = Vec::new();
    let mut elements: Vec<Element> = Vec::new();
    let mut at = 0;
    let mut number = 0;
    while at < bytes.len() {
        number += 1;
        let bad = |problem: String| builder.malformed(format!("line {number}"), problem);
        // A line ends at \n, \r\n, or \r alone; a binary body may start with \n.
        let n = bytes[at..].iter().position(|&b| b == b'\n' || b == b'\r');
        let Some(n) = n else { break };
        let line = String::from_utf8_lossy(&bytes[at..at + n]);
        let is_crlf = bytes[at + n] == b'\r' && bytes.get(at + n + 1) == Some(&b'\n');
        at += n + 1 + usize::from(is_crlf);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        match words.as_slice() {
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| bad("no format line".into()))?;
                let header = Header {
                    encoding,
                    stations,
                    elements,
                };
                return Ok((header, at));
            }
            ["format", kind, _] => {
                encoding = Some(match *kind {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(bad(format!("unknown format '{}'", shortened(kind)))),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| bad("a bad count".into()))?;
                elements.push(Element {
                    name: (*name).into(),
                    count,
                    properties: Vec::new(),
                });
            }
            ["property", "list", length, kind, name] => {
                let length = Scalar::parse(length)
                    .filter(|l| !matches!(l, Scalar::F32 | Scalar::F64))
                    .ok_or_else(|| bad("a list's length must be an integer".into()))?;
                push_property(&mut elements, kind, name, Some(length)).map_err(bad)?;
            }
            ["property", kind, name] => {
                push_property(&mut elements, kind, name, None).map_err(bad)?;
            }
            ["comment" | "obj_info", "station", x, y, z] => {
                let number = |w: &str| w.parse().ok().filter(|x: &f64| x.is_finite());
                let (Some(x), Some(y), Some(z)) = (number(x), number(y), number(z)) else {
                    return Err(bad(
                        "a station needs three numbers: comment station X Y Z".into()
                    ));
                };
                stations.push(DVec3::new(x, y, z));
            }
            [] | ["ply" | "comment" | "obj_info", ..] => {}
            _ => return Err(bad(format!("'{}' is not a header line", shortened(&line)))),
        }
    }
    Err(builder.malformed("header", "the file is cut off"))
}

fn push_property(
    elements: &mut [Element],
    kind: &str,
    name: &str,
    length: Option<Scalar>,
) -> Result<(), String> {
    let element = elements.last_mut().ok_or("a property before any element")?;
    let kind = Scalar::parse(kind).ok_or_else(|| format!("unknown type '{}'", shortened(kind)))?;
    element.properties.push(Property {
        name: name.into(),
        kind,
        length,
    });
    Ok(())
}

/// The body, read value by value.
struct Source<'b> {
    encoding: Encoding,
    bytes: &'b [u8],
    at: usize,
}

impl Source<'_> {
    /// Returns the next value; `None` at the end or without a number.
    fn next(&mut self, kind: Scalar) -> Option<f64> {
        if self.encoding == Encoding::Ascii {
            let rest = &self.bytes[self.at..];
            let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
            let n = rest[start..].iter().position(u8::is_ascii_whitespace);
            let end = n.map_or(rest.len(), |n| start + n);
            self.at += end;
            return std::str::from_utf8(&rest[start..end]).ok()?.parse().ok();
        }
        let n = kind.size();
        let bytes = self.bytes.get(self.at..self.at + n)?;
        self.at += n;
        let mut value = [0; 8];
        value[..n].copy_from_slice(bytes);
        if self.encoding == Encoding::Big {
            value[..n].reverse();
        }
        Some(kind.read(value))
    }

    /// Returns the most elements of this kind that the rest of the body can hold.
    fn most_elements(&self, element: &Element) -> u64 {
        let least: usize = element
            .properties
            .iter()
            .map(|p| match self.encoding {
                // A digit and a blank; the last one may lack its blank.
                Encoding::Ascii => 2,
                _ => p.length.unwrap_or(p.kind).size(),
            })
            .sum();
        let rest = self.bytes.len() - self.at;
        ((rest + 1) / least.max(1)) as u64
    }
}

/// Vertices and faces read so far.
#[derive(Default)]
struct Cloud {
    positions: Vec<[f64; 3]>,
    /// Number of the station that saw each point, or empty.
    station_of: Vec<u16>,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    colors: Vec<[f32; 4]>,
    /// Vertices of all polygons, one after the other.
    corners: Vec<u32>,
    /// End of each polygon in `corners`, and its number in the file.
    ends: Vec<(usize, u64)>,
    strips: Vec<Vec<i64>>,
}

/// Meaning of a vertex property.
#[derive(Clone, Copy)]
enum Slot {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Color(usize, f64),
    Station,
    Other,
}

fn slot(property: &Property) -> Slot {
    match property.name.as_str() {
        _ if property.length.is_some() => Slot::Other,
        "x" => Slot::Position(0),
        "y" => Slot::Position(1),
        "z" => Slot::Position(2),
        "nx" => Slot::Normal(0),
        "ny" => Slot::Normal(1),
        "nz" => Slot::Normal(2),
        "u" | "s" | "texture_u" | "texture_s" => Slot::Uv(0),
        "v" | "t" | "texture_v" | "texture_t" => Slot::Uv(1),
        "red" | "r" | "diffuse_red" => Slot::Color(0, property.kind.most()),
        "green" | "g" | "diffuse_green" => Slot::Color(1, property.kind.most()),
        "blue" | "b" | "diffuse_blue" => Slot::Color(2, property.kind.most()),
        "station" | "scan" | "scan_index" => Slot::Station,
        "alpha" | "a" | "diffuse_alpha" => Slot::Color(3, property.kind.most()),
        _ => Slot::Other,
    }
}

fn read_element(
    element: &Element,
    source: &mut Source<'_>,
    cloud: &mut Cloud,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    if element.properties.is_empty() {
        // Takes no bytes, whatever its count.
        return Ok(());
    }
    let name = shortened(&element.name);
    let most = source.most_elements(element);
    if element.count > most {
        return Err(builder.malformed(
            format!("element {name}"),
            format!(
                "the header promises {} and the file can hold {most} at most; it is cut off",
                element.count
            ),
        ));
    }
    match element.name.as_str() {
        "vertex" => read_vertices(element, source, cloud, builder),
        "face" | "tristrips" => read_faces(element, source, cloud, builder),
        _ => {
            builder.note(
                format!("element {name}"),
                "an element of another kind; left out",
            );
            for i in 0..element.count {
                for property in &element.properties {
                    let place = || format!("{name} {i}");
                    read_property(property, source, builder, &place, |_| ())?;
                }
            }
            Ok(())
        }
    }
}

/// Reads a property's one value, or each value of a list, and returns their number.
fn read_property(
    property: &Property,
    source: &mut Source<'_>,
    builder: &Builder<'_>,
    place: &impl Fn() -> String,
    mut take: impl FnMut(f64),
) -> Result<(), ImportError> {
    let bad = |problem: &str| {
        let name = shortened(&property.name);
        Err(builder.malformed(place(), format!("{name}: {problem}")))
    };
    let cut = "no number; is the file cut off?";
    builder.spend("body", 1)?;
    let n = match property.length {
        None => 1,
        Some(length) => match source.next(length) {
            None => return bad(cut),
            Some(n) if n >= 0.0 && n.fract() == 0.0 => n as u64,
            Some(n) => return bad(&format!("a list of {n}")),
        },
    };
    for k in 0..n {
        // Lists of four or fewer are paid already.
        if k % 4 == 3 {
            builder.spend("body", 1)?;
        }
        match source.next(property.kind) {
            None => return bad(cut),
            Some(value) => take(value),
        }
    }
    Ok(())
}

fn read_vertices(
    element: &Element,
    source: &mut Source<'_>,
    cloud: &mut Cloud,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    // Colors of only some vertices would not do for all.
    if !cloud.positions.is_empty() {
        return Err(builder.malformed("element vertex", "appears twice"));
    }
    builder.charge_vertices("element vertex", element.count)?;
    let slots: Vec<Slot> = element.properties.iter().map(slot).collect();
    let has = |want: fn(&Slot) -> bool| slots.iter().any(want);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if !slots
            .iter()
            .any(|s| matches!(s, Slot::Position(k) if *k == axis))
        {
            return Err(builder.malformed("element vertex", format!("has no {name}")));
        }
    }
    let has_normals = has(|s| matches!(s, Slot::Normal(_)));
    let has_stations = has(|s| matches!(s, Slot::Station));
    let has_uvs = has(|s| matches!(s, Slot::Uv(_)));
    let has_colors = has(|s| matches!(s, Slot::Color(..)));
    if has(|s| matches!(s, Slot::Other)) {
        builder.note(
            "element vertex",
            "vertex properties of other kinds; left out",
        );
    }
    for i in 0..element.count {
        let mut position = [0.0; 3];
        let mut normal = [0.0; 3];
        let mut uv = [0.0; 2];
        let mut color = [0.0, 0.0, 0.0, 1.0];
        let mut station = 0;
        for (property, slot) in element.properties.iter().zip(&slots) {
            let place = || format!("vertex {i}");
            read_property(property, source, builder, &place, |value| match *slot {
                Slot::Position(k) => position[k] = value,
                Slot::Normal(k) => normal[k] = finite(value),
                Slot::Uv(k) => uv[k] = finite(value),
                Slot::Color(k, most) => color[k] = finite(value / most).clamp(0.0, 1.0),
                // Beyond 65,535 it is none of the file's, and refused as such.
                Slot::Station => station = value.clamp(0.0, 65_535.0) as u16,
                Slot::Other => {}
            })?;
        }
        cloud.positions.push(position);
        if has_stations {
            cloud.station_of.push(station);
        }
        if has_normals {
            let n = DVec3::from_array(normal.map(f64::from));
            let n = n.try_normalize().unwrap_or(DVec3::Y);
            cloud.normals.push(n.to_array().map(|c| c as f32));
        }
        if has_uvs {
            // As in OBJ, from the bottom of the picture.
            cloud.uvs.push([uv[0], 1.0 - uv[1]]);
        }
        if has_colors {
            let [r, g, b, a] = color;
            let [r, g, b] = [r, g, b].map(soup::srgb_to_linear);
            cloud.colors.push([r, g, b, a]);
        }
    }
    Ok(())
}

fn finite(value: f64) -> f32 {
    let value = value as f32;
    if value.is_finite() { value } else { 0.0 }
}

fn read_faces(
    element: &Element,
    source: &mut Source<'_>,
    cloud: &mut Cloud,
    builder: &mut Builder<'_>,
) -> Result<(), ImportError> {
    builder.check_triangles("element face", element.count)?;
    let is_strip = element.name == "tristrips";
    let is_outline = |p: &Property| {
        p.length.is_some() && matches!(p.name.as_str(), "vertex_indices" | "vertex_index")
    };
    if !element.properties.iter().any(is_outline) {
        return Err(builder.malformed("element face", "has no list of vertex_indices"));
    }
    let mut is_done_note = false;
    for i in 0..element.count {
        let mut outline: Vec<i64> = Vec::new();
        let place = || format!("face {i}");
        for property in &element.properties {
            if is_outline(property) {
                // The last list counts if a face has two.
                outline.clear();
                read_property(property, source, builder, &place, |v| {
                    outline.push(v as i64);
                })?;
            } else {
                read_property(property, source, builder, &place, |_| ())?;
                if !is_done_note {
                    builder.note("element face", "face properties of other kinds; left out");
                    is_done_note = true;
                }
            }
        }
        if is_strip {
            cloud.strips.push(outline);
            continue;
        }
        if outline.len() < 3 {
            builder.note(place(), "a face with fewer than three vertices; left out");
            continue;
        }
        for index in outline {
            // Checked against the vertices at the end, as they may follow the faces.
            let index = u32::try_from(index).map_err(|_| bad_index(builder, i, index))?;
            cloud.corners.push(index);
        }
        cloud.ends.push((cloud.corners.len(), i));
    }
    Ok(())
}

fn bad_index(builder: &Builder<'_>, face: u64, index: i64) -> ImportError {
    builder.malformed(
        format!("face {face}"),
        format!("vertex {index} is out of range"),
    )
}

impl Cloud {
    fn finish(mut self, builder: &mut Builder<'_>) -> Result<(), ImportError> {
        let offset = soup::recenter(&mut self.positions);
        let unit = soup::unit(builder);
        let n = self.positions.len();
        let mut indices = Vec::new();
        let mut splitter = Splitter::new();
        let mut shape = Vec::new();
        let mut first = 0;
        for &(end, face) in &self.ends {
            let corners = &self.corners[first..end];
            first = end;
            if let Some(&bad) = corners.iter().find(|&&i| i as usize >= n) {
                return Err(bad_index(builder, face, bad.into()));
            }
            if corners.len() == 3 {
                indices.extend(corners);
                continue;
            }
            shape.clear();
            shape.extend(
                corners
                    .iter()
                    .map(|&i| DVec3::from_array(self.positions[i as usize]) + offset),
            );
            let split = splitter.split(&shape, unit, builder, || format!("face {face}"))?;
            indices.extend(split.iter().map(|&i| corners[i as usize]));
        }
        for (s, strip) in self.strips.iter().enumerate() {
            // A negative number ends a strip.
            for piece in strip.split(|&i| i < 0) {
                for (k, t) in piece.windows(3).enumerate() {
                    let t = if k % 2 == 0 {
                        [t[0], t[1], t[2]]
                    } else {
                        [t[1], t[0], t[2]]
                    };
                    if let Some(&bad) = t.iter().find(|&&i| i as usize >= n) {
                        return Err(bad_index(builder, s as u64, bad));
                    }
                    if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
                        indices.extend(t.map(|i| i as u32));
                    }
                }
            }
        }
        builder.check_triangles("element face", indices.len() as u64 / 3)?;
        if indices.is_empty() {
            builder.note("element face", "points without faces; left out");
        }
        let mut primitive = Primitive {
            positions: self.positions.iter().map(|p| p.map(|c| c as f32)).collect(),
            normals: self.normals,
            colors: self.colors,
            uvs: if self.uvs.is_empty() {
                vec![]
            } else {
                vec![self.uvs]
            },
            indices,
            ..Primitive::default()
        };
        builder.drop_nonfinite("element vertex", &mut primitive);
        let name = soup::stem(builder);
        let mesh = Mesh {
            name: name.clone(),
            primitives: vec![primitive],
        };
        soup::place(builder, mesh, [&name, ""], offset, "element face")
    }
}
