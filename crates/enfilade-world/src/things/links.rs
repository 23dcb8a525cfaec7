//! Links between things and cells, each in two lists at once, of a thing and of a cell, from one pool.

pub(super) const NONE: u32 = u32::MAX;

/// A thing in a cell.
#[derive(Clone, Copy, Debug)]
struct Link {
    thing: u32,
    /// Index among all parts' cells.
    cell: u32,
    next_in_cell: u32,
    previous_in_cell: u32,
    next_of_thing: u32,
}

/// All links. A thing stores its first.
#[derive(Clone, Debug)]
pub(super) struct Links {
    links: Vec<Link>,
    free: u32,
    /// Per cell of all parts.
    first_in_cell: Vec<u32>,
}

impl Default for Links {
    fn default() -> Self {
        Self {
            links: Vec::new(),
            free: NONE,
            first_in_cell: Vec::new(),
        }
    }
}

impl Links {
    /// Makes room for a number of cells.
    pub(super) fn grow(&mut self, n_cells: usize) {
        if self.first_in_cell.len() < n_cells {
            self.first_in_cell.resize(n_cells, NONE);
        }
    }

    /// Returns the things in a cell, latest first.
    pub(super) fn in_cell(&self, cell: u32) -> impl Iterator<Item = u32> + use<'_> {
        let first = self.first_in_cell.get(cell as usize).copied();
        let mut at = first.unwrap_or(NONE);
        std::iter::from_fn(move || {
            let link = self.links.get(at as usize)?;
            at = link.next_in_cell;
            Some(link.thing)
        })
    }

    /// Returns the cells of a thing, from its first link on.
    pub(super) fn of_thing(&self, first: u32) -> impl Iterator<Item = u32> + use<'_> {
        let mut at = first;
        std::iter::from_fn(move || {
            let link = self.links.get(at as usize)?;
            at = link.next_of_thing;
            Some(link.cell)
        })
    }

    /// Adds a cell to a thing before its first link; returns the new first link.
    pub(super) fn add(&mut self, thing: u32, cell: u32, first: u32) -> u32 {
        let next_in_cell = self.first_in_cell[cell as usize];
        let link = Link {
            thing,
            cell,
            next_in_cell,
            previous_in_cell: NONE,
            next_of_thing: first,
        };
        let at = if self.free == NONE {
            self.links.push(link);
            self.links.len() as u32 - 1
        } else {
            let at = self.free;
            self.free = self.links[at as usize].next_of_thing;
            self.links[at as usize] = link;
            at
        };
        if let Some(next) = self.links.get_mut(next_in_cell as usize) {
            next.previous_in_cell = at;
        }
        self.first_in_cell[cell as usize] = at;
        at
    }

    /// Removes a thing from all its cells.
    pub(super) fn drop_all(&mut self, first: u32) {
        let mut at = first;
        while let Some(&link) = self.links.get(at as usize) {
            match self.links.get_mut(link.previous_in_cell as usize) {
                Some(previous) => previous.next_in_cell = link.next_in_cell,
                None => self.first_in_cell[link.cell as usize] = link.next_in_cell,
            }
            if let Some(next) = self.links.get_mut(link.next_in_cell as usize) {
                next.previous_in_cell = link.previous_in_cell;
            }
            self.links[at as usize].next_of_thing = self.free;
            self.free = at;
            at = link.next_of_thing;
        }
    }
}
