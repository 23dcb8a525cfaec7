//! A sheet under construction: its items, scale bar, legend, and names of numbered cells.

use std::collections::BTreeSet;

use enfilade_cpg::{CellId, World, cell_color};
use enfilade_geom::{DVec2, shown};

use crate::drawing::{Class, Item, Path, Words};
use crate::label::{Sizes, line_height, shortened, width};

/// Space around each plan, for its title. [Units: wu]
pub(crate) const MARGIN: f64 = 0.9;
/// Height of the legend's letters, in a small house. [Units: wu]
const SMALL: f64 = 0.24;
/// Width of a column of the legend, in a small house. [Units: wu]
pub(crate) const COLUMN: f64 = 4.9;

/// The part of the sheet drawn so far.
pub(crate) struct Sheet {
    pub(crate) items: Vec<Item>,
    pub(crate) zoom: f64,
    pub(crate) sizes: Sizes,
    /// Height of the letters of titles. [Units: wu]
    pub(crate) title: f64,
    /// Cells that are labeled only by a number somewhere on the sheet.
    pub(crate) numbered: BTreeSet<CellId>,
    /// Numbers and reasons of the rings on the sheet whose reasons are not written yet.
    pub(crate) doubts: Vec<(usize, String)>,
}

impl Sheet {
    pub(crate) fn words(&mut self, at: DVec2, size: f64, is_centered: bool, text: String) {
        self.items.push(Item::Words(Words {
            at,
            size,
            is_centered,
            is_turned: false,
            text,
            cell: None,
        }));
    }

    fn shape(&mut self, class: Class, lines: Vec<Vec<DVec2>>, is_closed: bool) {
        self.items.push(Item::Path(Path {
            class,
            fill: None,
            lines,
            is_closed,
            cell: None,
            hint: None,
        }));
    }

    /// Factor on the usual size of the legend, so that its letters are legible, too.
    pub(crate) fn legend(&self) -> f64 {
        self.zoom.max(self.sizes.least / SMALL)
    }

    /// Least width of the legend, with its margins. [Units: wu]
    pub(crate) fn legend_width(&self) -> f64 {
        2.0 * MARGIN * self.zoom + (5.0 * self.zoom).max(COLUMN * self.legend())
    }

    /// Draws the scale bar at the current place, and returns the y of its end. [Units: wu]
    pub(crate) fn bar(&mut self) -> f64 {
        let (zoom, grown) = (self.zoom, self.legend());
        for k in 0..5 {
            let class = if k % 2 == 0 { Class::Bar } else { Class::Gap };
            let (left, right) = (f64::from(k) * zoom, f64::from(k + 1) * zoom);
            let high = 0.12 * grown;
            let bar = [(left, 0.0), (right, 0.0), (right, high), (left, high)];
            let bar = bar.map(|(x, z)| DVec2::new(x, z)).to_vec();
            self.shape(class, vec![bar], true);
        }
        let under = 0.12 * grown + 1.2 * SMALL * grown;
        self.words(DVec2::new(0.0, under), SMALL * grown, true, "0".into());
        let words = format!("{} m", 5.0 * zoom);
        self.words(DVec2::new(5.0 * zoom, under), SMALL * grown, true, words);
        under + 0.6 * grown
    }

    /// Draws the scale bar, if the sheet has plans, the legend of what is on the sheet, and the names of numbered cells, within
    /// `room`. Returns the y of their end. [Units: wu]
    pub(crate) fn foot(&mut self, world: &World, at: DVec2, room: f64, has_bar: bool) -> f64 {
        let grown = self.legend();
        let is_there = |class: Class| {
            let is = |i: &Item| matches!(i, Item::Path(p) if p.class == class);
            self.items.iter().any(is)
        };
        let entries: Vec<_> = [
            (Class::Door, "door"),
            (Class::Window, "window"),
            (Class::Open, "opening"),
            (Class::Low, "opening above or below the cut"),
            (Class::Stair, "hole in floor or ceiling"),
            (Class::Crack, "crack"),
            (Class::Beyond, "pale: floor on another plan"),
            (Class::Void, "void: nobody can stand there"),
            (Class::Thin, "too thin to draw"),
            (Class::Doubt, "a decision, ?1 most in doubt"),
        ]
        .into_iter()
        .filter(|(class, _)| is_there(*class))
        .collect();
        self.items.push(Item::Place { at, storey: None });
        let top = match has_bar {
            true => self.bar(),
            false => 0.0,
        };
        let columns = ((room / (COLUMN * grown)).floor() as usize).clamp(1, 3);
        let rows = entries.len().div_ceil(columns);
        for (k, (class, words)) in entries.iter().enumerate() {
            let down = 0.42 * (k % rows) as f64;
            let place = DVec2::new((k / rows) as f64 * COLUMN, top / grown + down);
            let line = [place - DVec2::Y * 0.08, place + DVec2::new(0.45, -0.08)];
            let line = line.map(|p| p * grown).to_vec();
            if *class == Class::Beyond {
                let up = DVec2::new(0.0, -0.12) * grown;
                let [a, b] = [line[0], line[1]];
                self.shape(*class, vec![vec![a, b, b + up, a + up]], true);
                // Any color of a cell.
                if let Some(Item::Path(path)) = self.items.last_mut() {
                    path.fill = Some(cell_color(CellId(0)));
                }
            } else {
                self.shape(*class, vec![line], false);
            }
            let at = (place + DVec2::X * 0.6) * grown;
            self.words(at, SMALL * grown, false, (*words).into());
        }
        let below = top + 0.42 * rows as f64 * grown;
        at.y + self.numbers(world, below, room)
    }

    /// Draws what numbers stand for: the names of cells, in columns, and the reasons of rings. Returns the y of their end, `below`
    /// without any. [Units: wu]
    pub(crate) fn numbers(&mut self, world: &World, below: f64, room: f64) -> f64 {
        let size = SMALL * self.legend();
        let below = self.names(world, below, room, size);
        self.reasons(below, room, size)
    }

    fn names(&mut self, world: &World, below: f64, room: f64, size: f64) -> f64 {
        if self.numbered.is_empty() {
            return below;
        }
        let mut rows: Vec<String> = Vec::new();
        for &cell in &self.numbered {
            let name = &world.graph[cell].name;
            if *name != format!("cell-{}", cell.0) {
                rows.push(format!("{}  {}", cell.0, shown(shortened(name))));
            }
        }
        // Default names contain their numbers.
        if let Some(cell) = self
            .numbered
            .iter()
            .find(|c| world.graph[**c].name == c.to_string())
        {
            let words = format!("A number alone stands for a cell: {} is {cell}.", cell.0);
            self.words(DVec2::new(0.0, below), size, false, words);
        }
        let widest = rows.iter().map(|r| width(r)).fold(1.0, f64::max) * size;
        let columns = ((room / (widest + size)).floor() as usize).max(1);
        let start = below + 1.6 * size;
        for (k, row) in rows.iter().enumerate() {
            let x = (k % columns) as f64 * (widest + size);
            let z = start + (k / columns) as f64 * 1.5 * size;
            self.words(DVec2::new(x, z), size, false, row.clone());
        }
        start + 1.5 * size * rows.len().div_ceil(columns) as f64
    }

    /// Writes the reasons of the rings, within `room`. Returns the y of their end. [Units: wu]
    fn reasons(&mut self, below: f64, room: f64, size: f64) -> f64 {
        let mut y = below;
        self.doubts.sort_unstable();
        for (number, text) in std::mem::take(&mut self.doubts) {
            let mut line = format!("?{number}");
            for word in text.split(' ') {
                if width(&line) * size + (width(word) + 1.0) * size > room {
                    y += line_height() * size;
                    let full = std::mem::replace(&mut line, "    ".to_owned());
                    self.words(DVec2::new(0.0, y), size, false, full);
                }
                line.push(' ');
                line.push_str(word);
            }
            y += 1.3 * line_height() * size;
            self.words(DVec2::new(0.0, y), size, false, line);
        }
        y
    }
}
