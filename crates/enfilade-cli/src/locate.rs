//! `enfilade locate`: finds the cells of points.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::PathBuf;

use anyhow::{Context, bail};
use enfilade::cpg::{CellId, CellPortalGraph, Locator, World};
use enfilade::geom::DVec3;
use enfilade::import::{Glob, GlobState};

use crate::limits::Limits;
use crate::screen::{print_json, printed_at_once};
use enfilade_cli::input::is_stream;
use enfilade_cli::world::read_world;

/// Reads `x y z` lines (meters, +Y up) and prints the id of each point's cell, or `-` if there is none.
#[derive(clap::Args)]
pub(crate) struct Locate {
    /// World written by `enfilade bake`.
    world: PathBuf,
    /// Instead of points: print the cells that see the object of this name, one id per line; in PATTERN, `*` and `?`
    /// match other letters, and it may include the nodes above, as in 'storey 2/*/IfcDoor*'.
    #[arg(long, value_name = "PATTERN")]
    object: Option<String>,
    /// Print the name of each cell behind its id.
    #[arg(long)]
    names: bool,
    /// Print JSON for machines: the ids of all points, `null` if there is no cell, once all lines are read; with
    /// `--object`, the ids of its cells.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// The output of `--json`.
#[derive(serde::Serialize)]
struct LocateReport<'a> {
    cells: Vec<Option<u32>>,
    /// With `--names`, the name of each.
    #[serde(skip_serializing_if = "Option::is_none")]
    names: Option<Vec<Option<&'a str>>>,
}

/// Cells as they are printed: their ids, and their names if these are wanted.
struct Printed<'a>(Option<&'a CellPortalGraph>);

impl<'a> Printed<'a> {
    fn line(&self, cell: CellId) -> String {
        match self.name(cell) {
            Some(name) => format!("{} {name}", cell.0),
            None => cell.0.to_string(),
        }
    }

    fn name(&self, cell: CellId) -> Option<&'a str> {
        self.0.map(|graph| graph[cell].name.as_str())
    }

    fn report(&self, cells: impl Iterator<Item = Option<CellId>>) -> LocateReport<'a> {
        let cells: Vec<Option<CellId>> = cells.collect();
        let named = || cells.iter().map(|c| c.and_then(|c| self.name(c)));
        LocateReport {
            names: self.0.map(|_| named().collect()),
            cells: cells.iter().map(|c| c.map(|c| c.0)).collect(),
        }
    }
}

/// Longest line: three numbers are always shorter, and a file without line ends must not fill the memory.
const MAX_LINE: u64 = 4096;

/// Longest pattern: matching keeps its state for each node of the tree of names.
const MAX_PATTERN: usize = 1000;

pub(crate) fn run(args: &Locate) -> anyhow::Result<()> {
    args.limits.begin()?;
    if let Some(pattern) = &args.object {
        let world = read_world(&args.world)?;
        let printed = Printed(args.names.then_some(&world.graph));
        return locate_object(&world, pattern, &printed, args.json);
    }
    if is_stream(&args.world) {
        bail!("standard input is for the points; give the world as a file, not '-'");
    }
    let world = read_world(&args.world)?;
    let input = BufReader::with_capacity(1 << 16, io::stdin().lock());
    let output = printed_at_once();
    let locator = &world.graph.locator;
    let printed = Printed(args.names.then_some(&world.graph));
    if args.json {
        let mut cells = Vec::new();
        each_point(input, |p, _| {
            cells.push(locator.locate(p));
            Ok(())
        })?;
        return print_json(output, &printed.report(cells.into_iter()));
    }
    locate_lines(locator, &printed, input, output)
}

/// Prints the cells of all sources whose name or path matches.
fn locate_object(
    world: &World,
    pattern: &str,
    printed: &Printed<'_>,
    json: bool,
) -> anyhow::Result<()> {
    if pattern.len() > MAX_PATTERN {
        bail!("--object: the pattern must have at most {MAX_PATTERN} letters");
    }
    let found = sources_named(world, pattern);
    if !found.contains(&true) {
        bail!(
            "no object is called '{pattern}'; `enfilade inspect --objects CELL` lists the objects that a cell sees"
        );
    }
    let cells = world.cells_of_sources(|source| found[source as usize]);
    let mut output = printed_at_once();
    if json {
        return print_json(output, &printed.report(cells.into_iter().map(Some)));
    }
    for cell in cells {
        writeln!(output, "{}", printed.line(cell))?;
    }
    output.flush().context("cannot write to standard output")
}

/// Returns for each source `true` if its name or path, or that of one above it, matches the pattern: the cells of a
/// storey are those of its contents.
///
/// Matching continues from the state of the source above, not from the top: linear in the names, however deep they
/// are nested.
fn sources_named(world: &World, pattern: &str) -> Vec<bool> {
    let glob = Glob::new(pattern);
    let mut is_parent = vec![false; world.sources.len()];
    for parent in world.sources.iter().filter_map(|node| node.parent) {
        is_parent[parent as usize] = true;
    }
    let mut is_found: Vec<bool> = Vec::with_capacity(world.sources.len());
    // States of sources that have others below and do not match yet: `true` once a path has begun, and the state of
    // its match.
    let mut paths: Vec<Option<(bool, GlobState)>> = Vec::with_capacity(world.sources.len());
    for (i, node) in world.sources.iter().enumerate() {
        let parent = node.parent.map(|p| p as usize);
        if parent.is_some_and(|p| is_found[p]) {
            is_found.push(true);
            paths.push(None);
            continue;
        }
        let above = parent.and_then(|p| paths[p].clone());
        let (mut has_begun, mut path) = above.unwrap_or_else(|| (false, glob.start()));
        if !node.name.is_empty() {
            glob.read(&mut path, if has_begun { "/" } else { "" });
            glob.read(&mut path, &node.name);
            has_begun = true;
        }
        let mut name = glob.start();
        glob.read(&mut name, &node.name);
        is_found.push(glob.fits(&name) || glob.fits(&path));
        paths.push((is_parent[i] && !is_found[i]).then_some((has_begun, path)));
    }
    is_found
}

fn locate_lines<R: Read>(
    locator: &Locator,
    printed: &Printed<'_>,
    input: BufReader<R>,
    mut output: impl Write,
) -> anyhow::Result<()> {
    let done = each_point(input, |p, is_waiting| {
        match locator.locate(p) {
            Some(cell) => writeln!(output, "{}", printed.line(cell))?,
            None => output.write_all(b"-\n")?,
        }
        // A user who queries one point at a time waits for the answer.
        if is_waiting {
            output.flush()?;
        }
        Ok(())
    });
    // Print the answers before a malformed line.
    output.flush()?;
    done
}

/// Calls `answer` for the point of each line; the flag is `true` if no further line has arrived yet.
fn each_point<R: Read>(
    mut input: BufReader<R>,
    mut answer: impl FnMut(DVec3, bool) -> io::Result<()>,
) -> anyhow::Result<()> {
    let mut line = Vec::new();
    for number in 1_u64.. {
        line.clear();
        let read = (&mut input).take(MAX_LINE).read_until(b'\n', &mut line);
        if read.context("cannot read standard input")? == 0 {
            break;
        }
        let Some(p) = parse_point(&line) else {
            bail!("standard input, line {number}: expected three numbers `x y z`");
        };
        answer(p, input.buffer().is_empty())?;
    }
    Ok(())
}

fn parse_point(line: &[u8]) -> Option<DVec3> {
    let mut words = std::str::from_utf8(line).ok()?.split_ascii_whitespace();
    let mut number = || words.next()?.parse::<f64>().ok();
    let p = DVec3::new(number()?, number()?, number()?);
    words.next().is_none().then_some(p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_three_numbers_and_nothing_else() {
        assert_eq!(
            parse_point(b"1 -2.5\t3e2\r\n"),
            Some(DVec3::new(1.0, -2.5, 300.0))
        );
        for line in ["", "1 2", "1 2 3 4", "1 2 x", "1,2,3", "\u{fc} 1 2"] {
            assert_eq!(parse_point(line.as_bytes()), None, "{line:?}");
        }
    }

    #[test]
    fn a_line_without_an_end_is_refused() {
        let endless = BufReader::new(io::repeat(b'1'));
        let error =
            locate_lines(&Locator::default(), &Printed(None), endless, Vec::new()).unwrap_err();
        assert!(error.to_string().contains("line 1"), "{error}");
    }
}
