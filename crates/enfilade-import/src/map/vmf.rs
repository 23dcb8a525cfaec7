//! The text of Valve's maps (`.vmf`): named blocks of quoted keys and values. The world and the entities hold solids, whose sides
//! are planes as in other maps. A displacement counts as the side that it is made of; what is hidden in the editor is not compiled.

use super::parse::{Brush, MAX_COORDINATE, Place, Problem, RawEntity, Side, Words, problem};

/// Returns `true` if the text begins as the editor writes it.
pub(super) fn is_vmf(text: &str) -> bool {
    let rest = text.trim_start();
    let rest = rest.strip_prefix("versioninfo");
    rest.is_some_and(|rest| rest.trim_start().starts_with('{'))
}

/// Reads all entities. Time and memory are linear in the text.
pub(super) fn parse_vmf(text: &str) -> Result<Vec<RawEntity<'_>>, Problem> {
    let mut words = Words::of(text);
    let mut entities = Vec::new();
    while let Some((place, name)) = words.next()? {
        words.expect("{", "a block's")?;
        match name {
            "world" | "entity" => entities.push(entity(&mut words, place)?),
            _ => skip(&mut words, place)?,
        }
    }
    Ok(entities)
}

/// A part of a block.
enum Part<'t> {
    Property(&'t str, &'t str),
    /// The name of a block whose brace has been read.
    Block(&'t str),
    End,
}

fn part<'t>(words: &mut Words<'t>, block: Place) -> Result<(Place, Part<'t>), Problem> {
    let cut = || {
        problem(
            block,
            "this block has no '}'; the file may be cut off".into(),
        )
    };
    let (place, word) = words.next()?.ok_or_else(cut)?;
    if let Some(key) = word.strip_prefix('"') {
        return match words.next()? {
            Some((_, value)) if value.starts_with('"') => {
                Ok((place, Part::Property(key, &value[1..])))
            }
            _ => Err(problem(place, "a key without a quoted value".into())),
        };
    }
    if word == "}" {
        return Ok((place, Part::End));
    }
    words.expect("{", "a block's")?;
    Ok((place, Part::Block(word)))
}

/// Reads to the end of a block and of all blocks in it.
fn skip(words: &mut Words<'_>, block: Place) -> Result<(), Problem> {
    let mut depth = 1;
    while depth > 0 {
        match part(words, block)?.1 {
            Part::Property(..) => {}
            Part::Block(_) => depth += 1,
            Part::End => depth -= 1,
        }
    }
    Ok(())
}

fn entity<'t>(words: &mut Words<'t>, place: Place) -> Result<RawEntity<'t>, Problem> {
    let mut out = RawEntity {
        properties: Vec::new(),
        brushes: Vec::new(),
        patches: Vec::new(),
        place,
    };
    loop {
        match part(words, place)? {
            (_, Part::Property(key, value)) => out.properties.push((key, value)),
            (at, Part::Block("solid")) => out.brushes.push(solid(words, at)?),
            (at, Part::Block(_)) => skip(words, at)?,
            (_, Part::End) => return Ok(out),
        }
    }
}

fn solid<'t>(words: &mut Words<'t>, place: Place) -> Result<Brush<'t>, Problem> {
    let mut sides = Vec::new();
    loop {
        match part(words, place)? {
            (_, Part::Property(..)) => {}
            (at, Part::Block("side")) => sides.push(side(words, at)?),
            (at, Part::Block(_)) => skip(words, at)?,
            (_, Part::End) => return Ok(Brush { sides, place }),
        }
    }
}

fn side<'t>(words: &mut Words<'t>, place: Place) -> Result<Side<'t>, Problem> {
    let (mut points, mut texture) = (None, "");
    loop {
        match part(words, place)? {
            (at, Part::Property("plane", value)) => points = Some(plane(value, at)?),
            (_, Part::Property("material", value)) => texture = value,
            (_, Part::Property(..)) => {}
            (at, Part::Block(_)) => skip(words, at)?,
            (_, Part::End) => break,
        }
    }
    let points = points.ok_or_else(|| problem(place, "a side without a plane".into()))?;
    Ok(Side {
        points,
        texture,
        is_detail: false,
        place,
    })
}

/// Reads three points in brackets.
fn plane(text: &str, place: Place) -> Result<[[f64; 3]; 3], Problem> {
    let words = text.split(|c: char| c.is_ascii_whitespace() || "()[]".contains(c));
    let numbers = words.filter(|word| !word.is_empty()).map(str::parse::<f64>);
    let numbers: Vec<f64> = numbers
        .map(|n| n.ok().filter(|n| n.abs() <= MAX_COORDINATE))
        .collect::<Option<_>>()
        .unwrap_or_default();
    match numbers[..] {
        [a, b, c, d, e, f, g, h, i] => Ok([[a, b, c], [d, e, f], [g, h, i]]),
        _ => Err(problem(place, "a plane that is not three points".into())),
    }
}
