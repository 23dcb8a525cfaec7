//! The text of a `.map` file: entities, their properties and their brushes' planes.

use std::fmt;

use enfilade_geom::DVec3;

/// Larger numbers are rejected as damage.
pub(super) const MAX_COORDINATE: f64 = 1e6;

/// A place in the text; line and column count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) line: u32,
    pub(super) column: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}:{}", self.line, self.column)
    }
}

/// Something wrong at a place in the text.
#[derive(Debug)]
pub(super) struct Problem {
    pub(super) place: Place,
    pub(super) text: String,
}

/// A side of a brush.
pub(super) struct Side<'t> {
    pub(super) points: [[f64; 3]; 3],
    pub(super) texture: &'t str,
    /// Marked as detail by Quake 2 or 3: it does not divide space.
    pub(super) is_detail: bool,
    pub(super) place: Place,
}

/// A convex solid, given by the planes around it.
pub(super) struct Brush<'t> {
    pub(super) sides: Vec<Side<'t>>,
    pub(super) place: Place,
}

/// A curved surface: a grid of quadratic Bezier patches.
pub(super) struct Patch<'t> {
    pub(super) texture: &'t str,
    /// Rows and columns, both odd and at least 3.
    pub(super) size: [usize; 2],
    /// Control points, row by row.
    pub(super) controls: Vec<[f64; 3]>,
    /// Segments per Bezier curve along columns and rows, if the file gives them.
    pub(super) n_segments: Option<[usize; 2]>,
    pub(super) place: Place,
}

/// An entity of the map.
pub(super) struct RawEntity<'t> {
    pub(super) properties: Vec<(&'t str, &'t str)>,
    pub(super) brushes: Vec<Brush<'t>>,
    pub(super) patches: Vec<Patch<'t>>,
    pub(super) place: Place,
}

impl<'t> RawEntity<'t> {
    /// Returns the last value of a property; later ones override earlier ones.
    pub(super) fn get(&self, key: &str) -> Option<&'t str> {
        let found = self.properties.iter().rev().find(|p| p.0 == key);
        found.map(|p| p.1)
    }
}

/// Reads all entities. Time and memory are linear in the text.
pub(super) fn parse(text: &str) -> Result<Vec<RawEntity<'_>>, Problem> {
    let mut words = Words::of(text);
    let mut entities = Vec::new();
    while let Some((place, word)) = words.next()? {
        if word == "Version" && entities.is_empty() {
            words.number("a version")?;
            continue;
        }
        if word != "{" {
            return Err(problem(
                place,
                format!("expected an entity's '{{', found '{}'", shown(word)),
            ));
        }
        entities.push(entity(&mut words, place)?);
    }
    Ok(entities)
}

fn entity<'t>(words: &mut Words<'t>, place: Place) -> Result<RawEntity<'t>, Problem> {
    let mut out = RawEntity {
        properties: Vec::new(),
        brushes: Vec::new(),
        patches: Vec::new(),
        place,
    };
    loop {
        let Some((at, word)) = words.next()? else {
            return Err(problem(
                place,
                "this entity has no '}'; the file may be cut off".into(),
            ));
        };
        if let Some(key) = word.strip_prefix('"') {
            let value = match words.next()? {
                Some((_, v)) if v.starts_with('"') => &v[1..],
                _ => {
                    return Err(problem(
                        at,
                        format!("the property \"{}\" has no quoted value", shown(key)),
                    ));
                }
            };
            out.properties.push((key, value));
            continue;
        }
        match word {
            "{" => match words.peek()? {
                Some("brushDef" | "brushDef3") => {
                    words.next()?;
                    words.expect("{", "a brush's")?;
                    out.brushes.push(brush(words, at)?);
                    words.expect("}", "a brush's")?;
                }
                Some("patchDef2" | "patchDef3") => out.patches.push(patch(words, at)?),
                _ => out.brushes.push(brush(words, at)?),
            },
            "}" => return Ok(out),
            _ => {
                return Err(problem(
                    at,
                    format!(
                        "expected a property, a brush or '}}', found '{}'",
                        shown(word)
                    ),
                ));
            }
        }
    }
}

fn brush<'t>(words: &mut Words<'t>, place: Place) -> Result<Brush<'t>, Problem> {
    let mut sides = Vec::new();
    loop {
        let Some((at, word)) = words.next()? else {
            return Err(problem(
                place,
                "this brush has no '}'; the file may be cut off".into(),
            ));
        };
        match word {
            "(" => sides.push(side(words, at)?),
            "}" => return Ok(Brush { sides, place }),
            "patchDefWS" | "patchTerrainDef3" | "curve" | "mesh" => {
                return Err(problem(
                    at,
                    format!(
                        "'{word}' belongs to another game; save the map in the format of Quake (Standard, Valve 220) or Quake 3"
                    ),
                ));
            }
            _ => {
                return Err(problem(
                    at,
                    format!("expected a side's '(' or '}}', found '{}'", shown(word)),
                ));
            }
        }
    }
}

fn side<'t>(words: &mut Words<'t>, place: Place) -> Result<Side<'t>, Problem> {
    let mut points = [[0.0; 3]; 3];
    for (i, point) in points.iter_mut().enumerate() {
        if i > 0 {
            words.expect("(", "a point's")?;
        }
        for c in point.iter_mut() {
            *c = words.number("a coordinate")?;
        }
        if i == 0 && words.peek()? != Some(")") {
            // Doom 3: the plane's outward normal, and the offset added to its product with a point.
            let offset = words.number("a plane's offset")?;
            let normal = *point;
            points = points_of_plane(normal, offset).ok_or_else(|| {
                problem(
                    place,
                    "a plane without a direction; delete its brush".into(),
                )
            })?;
            words.expect(")", "a plane's")?;
            break;
        }
        words.expect(")", "a point's")?;
    }
    // Brush primitives: a matrix, before the texture.
    let has_matrix = words.peek()? == Some("(");
    if has_matrix {
        words.expect("(", "a texture matrix'")?;
        for _ in 0..2 {
            words.expect("(", "a texture matrix'")?;
            for _ in 0..3 {
                words.number("a texture matrix")?;
            }
            words.expect(")", "a texture matrix'")?;
        }
        words.expect(")", "a texture matrix'")?;
    }
    let texture = words.raw("a texture's name")?;
    // Standard: two shifts, an angle, two scales. Valve 220: two axes in brackets, then the last three. Quake 2's
    // additional numbers follow on the same line and do not affect the shape.
    if has_matrix {
    } else if words.peek()? == Some("[") {
        for _ in 0..2 {
            words.expect("[", "a texture axis'")?;
            for _ in 0..4 {
                words.number("a texture axis")?;
            }
            words.expect("]", "a texture axis'")?;
        }
        for _ in 0..3 {
            words.number("a texture's angle or scale")?;
        }
    } else {
        for _ in 0..5 {
            words.number("a texture's shift, angle or scale")?;
        }
    }
    let mut contents = None;
    while let Some(number) = words.peek()?.and_then(|w| w.parse::<f64>().ok()) {
        contents = contents.or(Some(number));
        words.next()?;
    }
    Ok(Side {
        points,
        texture,
        is_detail: contents.is_some_and(|c| c as i64 & CONTENTS_DETAIL != 0),
        place,
    })
}

/// Flag of Quake 2 and 3 for brushes that are visible but do not divide space.
const CONTENTS_DETAIL: i64 = 0x0800_0000;

/// Returns three points of a plane, in the order that gives its normal.
fn points_of_plane(normal: [f64; 3], offset: f64) -> Option<[[f64; 3]; 3]> {
    let normal = DVec3::from_array(normal);
    let length = normal.length();
    if length < 1e-6 {
        return None;
    }
    let (normal, offset) = (normal / length, offset / length);
    let (u, v) = normal.any_orthonormal_pair();
    let (u, v) = if u.cross(v).dot(normal) > 0.0 {
        (u, v)
    } else {
        (v, u)
    };
    let origin = normal * -offset;
    // Far apart, as an editor's points are.
    Some([origin + u * 64.0, origin, origin + v * 64.0].map(|p| p.to_array()))
}

/// Reads a patch, from the word behind its first brace to its last one.
fn patch<'t>(words: &mut Words<'t>, place: Place) -> Result<Patch<'t>, Problem> {
    let is_def3 = words.next()?.is_some_and(|(_, word)| word == "patchDef3");
    words.expect("{", "a patch's")?;
    let texture = words.raw("a texture's name")?;
    words.expect("(", "a patch's")?;
    let count = |words: &mut Words<'t>, what| words.number(what).map(|n| n as usize);
    let size = [
        count(words, "a patch's width")?,
        count(words, "a patch's height")?,
    ];
    let is_grid = |n: usize| n % 2 == 1 && (3..=MAX_PATCH).contains(&n);
    if !size.into_iter().all(is_grid) {
        let [w, h] = size;
        return Err(problem(
            place,
            format!("a patch of {w} x {h} points; both must be odd, and from 3 to {MAX_PATCH}"),
        ));
    }
    let mut n_segments = None;
    if is_def3 {
        n_segments = Some([
            count(words, "a patch's subdivision")?,
            count(words, "a patch's subdivision")?,
        ]);
    }
    for _ in 0..3 {
        words.number("a patch's flag")?;
    }
    words.expect(")", "a patch's")?;
    words.expect("(", "a patch's")?;
    let mut controls = Vec::new();
    for _ in 0..size[0] {
        words.expect("(", "a patch's row's")?;
        for _ in 0..size[1] {
            words.expect("(", "a patch's point's")?;
            let mut point = [0.0; 3];
            for c in &mut point {
                *c = words.number("a coordinate")?;
            }
            controls.push(point);
            // Its texture coordinates.
            for _ in 0..2 {
                words.number("a texture coordinate")?;
            }
            words.expect(")", "a patch's point's")?;
        }
        words.expect(")", "a patch's row's")?;
    }
    for bracket in [")", "}", "}"] {
        words.expect(bracket, "a patch's")?;
    }
    Ok(Patch {
        texture,
        size,
        controls,
        n_segments,
        place,
    })
}

/// Most rows or columns of a patch; Quake 3 takes 31.
const MAX_PATCH: usize = 1023;

pub(super) fn problem(place: Place, text: String) -> Problem {
    Problem { place, text }
}

/// Returns the beginning of a word, short enough for a message.
fn shown(word: &str) -> String {
    word.trim_start_matches('"').chars().take(24).collect()
}

/// Splits a text into words, brackets and quoted texts (with their opening quote).
pub(super) struct Words<'t> {
    text: &'t str,
    at: usize,
    line: u32,
    line_start: usize,
}

impl<'t> Words<'t> {
    pub(super) fn of(text: &'t str) -> Self {
        Self {
            text,
            at: 0,
            line: 1,
            line_start: 0,
        }
    }

    fn place(&self) -> Place {
        Place {
            line: self.line,
            column: (self.at - self.line_start) as u32 + 1,
        }
    }

    /// Skips blanks and comments.
    fn skip(&mut self) {
        let bytes = self.text.as_bytes();
        while let Some(&b) = bytes.get(self.at) {
            if b == b'\n' {
                self.line += 1;
                self.line_start = self.at + 1;
            } else if b == b'/' && bytes.get(self.at + 1) == Some(&b'/') {
                while bytes.get(self.at).is_some_and(|&b| b != b'\n') {
                    self.at += 1;
                }
                continue;
            } else if !b.is_ascii_whitespace() && b != 0 {
                return;
            }
            self.at += 1;
        }
    }

    pub(super) fn next(&mut self) -> Result<Option<(Place, &'t str)>, Problem> {
        self.skip();
        let place = self.place();
        let rest = &self.text[self.at..];
        let Some(first) = rest.bytes().next() else {
            return Ok(None);
        };
        if first == b'"' {
            let end = rest[1..]
                .find(['"', '\n'])
                .filter(|&i| rest.as_bytes()[i + 1] == b'"');
            let Some(end) = end else {
                return Err(problem(
                    place,
                    "a quote that does not end on its line".into(),
                ));
            };
            self.at += end + 2;
            return Ok(Some((place, &rest[..=end])));
        }
        if b"{}()[]".contains(&first) {
            self.at += 1;
            return Ok(Some((place, &rest[..1])));
        }
        let end = rest
            .find(|c: char| c.is_ascii_whitespace() || "{}()[]\"".contains(c))
            .unwrap_or(rest.len());
        self.at += end;
        Ok(Some((place, &rest[..end])))
    }

    /// Reads up to the next blank, whatever the characters: names of textures may begin with a brace.
    fn raw(&mut self, what: &str) -> Result<&'t str, Problem> {
        self.skip();
        let rest = &self.text[self.at..];
        if let Some(quoted) = rest.strip_prefix('"')
            && let Some(end) = quoted.find(['"', '\n'])
        {
            self.at += end + 2;
            return Ok(&quoted[..end]);
        }
        let end = rest
            .find(|c: char| c.is_ascii_whitespace())
            .unwrap_or(rest.len());
        if end == 0 {
            return Err(problem(
                self.place(),
                format!("the file ends before {what}"),
            ));
        }
        self.at += end;
        Ok(&rest[..end])
    }

    fn peek(&mut self) -> Result<Option<&'t str>, Problem> {
        self.skip();
        let at = self.at;
        let word = self.next()?;
        self.at = at;
        Ok(word.map(|w| w.1))
    }

    pub(super) fn expect(&mut self, bracket: &str, what: &str) -> Result<(), Problem> {
        self.skip();
        let end = self.place();
        match self.next()? {
            Some((_, word)) if word == bracket => Ok(()),
            Some((place, word)) => Err(problem(
                place,
                format!("expected {what} '{bracket}', found '{}'", shown(word)),
            )),
            None => Err(problem(
                end,
                format!("the file ends before {what} '{bracket}'"),
            )),
        }
    }

    fn number(&mut self, what: &str) -> Result<f64, Problem> {
        self.skip();
        let end = self.place();
        let Some((place, word)) = self.next()? else {
            return Err(problem(end, format!("the file ends before {what}")));
        };
        match word.parse::<f64>() {
            Ok(v) if v.is_finite() && v.abs() <= MAX_COORDINATE => Ok(v),
            Ok(v) => Err(problem(place, format!("{v} is out of range for {what}"))),
            Err(_) => Err(problem(
                place,
                format!("expected {what}, found '{}'", shown(word)),
            )),
        }
    }
}
