//! Floor plans: a section of each storey with names, and sheets of several plans.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_cpg::{CellId, RoomFacts, World, cell_color};
use enfilade_geom::{DVec2, shown};

use crate::doubts::{Doubt, doubts, rings};
use crate::drawing::{Class, Drawing, Item, Path, Words};
use crate::floors::floor_samples;
use crate::label::{Sizes, fit, line_height, line_size, shortened, width};
use crate::marks::View;
use crate::relief::Relief;
use crate::rooms::facts_of_rooms;
use crate::section::{Label, Region, Section, cell_of, heights};
use crate::shafts::find_shafts;
use crate::sheet::{MARGIN, Sheet};
use crate::storeys::{Page, Storey, find_pages};

/// Largest height of the letters of names, in a small house. [Units: wu]
const NAME: f64 = 0.32;
/// The smallest letters as a fraction of the longer side of a sheet: 1.2 mm on A4, 6.5 pixels of 1600.
const LEGIBLE: f64 = 0.004;

/// The longer side of a plan on a page, and the height of the smallest letters there. [Units: pixels]
const PAGE: f64 = 1040.0;
const LETTERS: f64 = 11.0;

/// Settings for plans.
#[derive(Clone, Debug)]
pub struct PlanOptions {
    /// Height of the cut above each floor. [Units: wu] [Limit: above 0]
    pub cut_height: f64,
    /// Draws rings where the bake decided, and lists the reasons.
    pub has_reasons: bool,
}

impl Default for PlanOptions {
    fn default() -> Self {
        // The usual height in architectural plans: above sills, below lintels.
        Self {
            cut_height: 1.2,
            has_reasons: false,
        }
    }
}

/// The plans of all storeys of a world.
///
/// At least one plan shows and names each room: where its floor is; for a space without a floor, beside its
/// neighbors or on a plan of such spaces; for a cell thinner than the drawing resolves, as the outline of its box. Voids
/// are hatched where a cut passes through them.
pub struct Plans<'a> {
    world: &'a World,
    cut_height: f64,
    pages: Vec<Drawn>,
    /// Cells that plans show only as a box.
    thin: BTreeSet<CellId>,
    voids: Vec<CellId>,
    rooms: BTreeMap<CellId, RoomFacts>,
    doubts: Vec<Doubt>,
    min: DVec2,
    max: DVec2,
}

/// A storey with its section.
struct Drawn {
    page: Page,
    heights: Vec<f64>,
    section: Section,
    regions: Vec<(Label, Region)>,
    /// Objects and surfaces below the cut.
    objects: Vec<Item>,
    /// Walls and doorways.
    marks: Vec<Item>,
}

impl Drawn {
    fn new(world: &World, page: Page, cut_height: f64, (min, max): (DVec2, DVec2)) -> Self {
        let heights = heights(&page, cut_height);
        let mut section = Section::sample(world, &page, &heights, min, max);
        let regions: Vec<(Label, Region)> = section.regions().into_iter().collect();
        let view = View {
            world,
            page: &page,
            section: &section,
            heights: &heights,
        };
        let mut objects = view.details();
        let Relief { lines, is_floor } = view.relief();
        objects.push(Item::Path(Path {
            class: Class::Edge,
            fill: None,
            lines,
            is_closed: true,
            cell: None,
            hint: None,
        }));
        let mut marks: Vec<Item> = view.hatching().into_iter().collect();
        marks.push(view.walls());
        for id in world.graph.portal_ids() {
            let Some(portal) = view.portal(id) else {
                continue;
            };
            marks.extend(view.swings(id));
            marks.push(portal);
        }
        section.take(|i| !is_floor[i]);
        for mark in &marks {
            if let Item::Path(mark) = mark
                && matches!(mark.class, Class::Stair | Class::Swing | Class::Low)
            {
                for line in &mark.lines {
                    let ends = line.iter().zip(line.iter().cycle().skip(1));
                    ends.for_each(|(a, b)| section.take_line(*a, *b));
                }
            }
        }
        Self {
            page,
            heights,
            section,
            regions,
            objects,
            marks,
        }
    }
}

/// The rooms that are on no plan.
fn hidden_cells(world: &World, pages: &[Drawn]) -> BTreeSet<CellId> {
    let regions = pages.iter().flat_map(|p| &p.regions);
    let shown = regions.filter_map(|r| cell_of(r.0)).filter(|c| c.1);
    let shown: BTreeSet<CellId> = shown.map(|c| c.0).collect();
    let rooms = world.graph.places().map(|c| c.0);
    rooms.filter(|c| !shown.contains(c)).collect()
}

/// Draws the floor plans of all storeys as one SVG document; x points right and z down, as seen from above. One
/// drawing unit is a centimeter.
///
/// The world must be valid (`World::validate`). Time grows with the area drawn and the triangles.
#[must_use]
pub fn plan_svg(world: &World, options: &PlanOptions) -> String {
    let plans = Plans::new(world, options);
    let all: Vec<usize> = (0..plans.pages.len()).collect();
    plans.sheet(&all).to_svg()
}

impl<'a> Plans<'a> {
    /// Cuts all storeys. The world must be valid. Time grows with the area drawn and the triangles.
    #[must_use]
    pub fn new(world: &'a World, options: &PlanOptions) -> Self {
        let (min, max) = extent(world);
        let samples = floor_samples(world);
        let (pages, mut voids) = find_pages(world, &samples);
        voids.extend(
            world
                .graph
                .indoor_cells()
                .filter(|c| c.1.is_void)
                .map(|c| c.0),
        );
        voids.sort_unstable();
        let draw = |page: Page| Drawn::new(world, page, options.cut_height, (min, max));
        let mut pages: Vec<Drawn> = pages.into_iter().map(draw).collect();
        // A cell missed by its neighbors' cut, or hidden under one of them, is cut at a height of its own.
        let hidden: Vec<CellId> = hidden_cells(world, &pages).into_iter().collect();
        for drawn in &mut pages {
            let mut of_page = hidden.clone();
            of_page.retain(|c| drawn.page.storey.cells.binary_search(c).is_ok());
            if !of_page.is_empty() {
                let mut page = drawn.page.clone();
                for shaft in find_shafts(world, &of_page, page.tile) {
                    page.show_apart(&shaft);
                }
                *drawn = draw(page);
            }
        }
        let doubts = if options.has_reasons {
            doubts(world, pages.iter().map(|p| &p.page.storey))
        } else {
            Vec::new()
        };
        let storeys: Vec<&Storey> = pages.iter().map(|p| &p.page.storey).collect();
        let rooms = facts_of_rooms(world, &samples, &storeys).into_iter();
        Self {
            world,
            doubts,
            rooms: rooms.map(|room| (room.cell, room)).collect(),
            cut_height: options.cut_height,
            thin: hidden_cells(world, &pages),
            pages,
            voids,
            min,
            max,
        }
    }

    /// Voids and rooms without a floor to stand on, ascending: shafts, spaces above ceilings, cavities.
    pub fn voids(&self) -> impl ExactSizeIterator<Item = CellId> {
        self.voids.iter().copied()
    }

    /// The facts of rooms, by cell.
    pub fn rooms(&self) -> impl ExactSizeIterator<Item = &RoomFacts> {
        self.rooms.values()
    }

    /// The storeys, in the order of the plans.
    pub fn storeys(&self) -> impl ExactSizeIterator<Item = &Storey> {
        self.pages.iter().map(|p| &p.page.storey)
    }

    /// Returns the plans of a storey's name (`1`) or of a cell's name (`cell-3`), ascending; empty if the name is
    /// unknown.
    #[must_use]
    pub fn find(&self, name: &str) -> Vec<usize> {
        let by_name = self.storeys().position(|s| s.name == name);
        let cell = self.world.graph.cell_named(name);
        let has = |k: &usize| {
            let storey = &self.pages[*k].page.storey;
            Some(*k) == by_name || cell.is_some_and(|c| storey.cells.contains(&c))
        };
        (0..self.pages.len()).filter(has).collect()
    }

    /// Draws some of the plans, by index, on one sheet with a legend.
    ///
    /// # Panics
    ///
    /// If an index is not less than the number of storeys.
    #[must_use]
    pub fn sheet(&self, which: &[usize]) -> Drawing {
        self.arranged(which, true)
    }

    /// The length of a pixel of a page, so that the longer side of a plan has [`PAGE`] of them. [Units: wu]
    pub(crate) fn on_page(&self) -> f64 {
        let margin = MARGIN * lettering(self.max - self.min, 1);
        (self.max - self.min + 2.0 * margin).max_element() / PAGE
    }

    /// Draws one plan with a scale bar, but without a legend, for a page that has one.
    pub(crate) fn bare(&self, index: usize) -> Drawing {
        self.arranged(&[index], false)
    }

    /// Draws the legend of all plans.
    #[cfg(feature = "page")]
    pub(crate) fn legend(&self) -> Drawing {
        let zoom = lettering(self.max - self.min, 1);
        let items = self.pages.iter().flat_map(|p| p.marks.iter().cloned());
        let mut sheet = Sheet {
            items: items.collect(),
            zoom,
            numbered: BTreeSet::new(),
            doubts: Vec::new(),
            title: 0.0,
            sizes: Sizes {
                least: self.on_page() * LETTERS,
                most: 0.0,
            },
        };
        let n = sheet.items.len();
        let margin = DVec2::splat(MARGIN * zoom);
        let room = 3.0 * crate::sheet::COLUMN * sheet.legend();
        let end = sheet.foot(self.world, margin, room, false);
        Drawing {
            title: "Legend".into(),
            size: DVec2::new(room + 2.0 * margin.x, end),
            zoom,
            items: sheet.items.split_off(n),
        }
    }

    fn arranged(&self, which: &[usize], has_legend: bool) -> Drawing {
        let zoom = lettering(self.max - self.min, which.len());
        let margin = MARGIN * zoom;
        let size = self.max - self.min + 2.0 * margin;
        // Rows and columns for a sheet about three wide by two high.
        let n = which.len().max(1);
        let columns = ((n as f64 * 1.5 * size.y / size.x).sqrt().round() as usize).clamp(1, n);
        let rows = n.div_ceil(columns);
        let mut sheet = Sheet {
            items: Vec::new(),
            zoom,
            numbered: BTreeSet::new(),
            doubts: Vec::new(),
            title: 0.45 * zoom,
            sizes: Sizes {
                least: match has_legend {
                    true => LEGIBLE * (size.x * columns as f64).max(size.y * rows as f64),
                    false => self.on_page() * LETTERS,
                },
                most: NAME * zoom,
            },
        };
        sheet.sizes.most = sheet.sizes.most.max(2.6 * sheet.sizes.least);
        // All titles have one size, and none reaches the next plan.
        let room = self.max.x - self.min.x + margin;
        for &index in which {
            let title = self.title(&self.pages[index]);
            sheet.title = sheet.title.min(room / width(&title));
        }
        let mut beside = 0.0;
        if !has_legend {
            // Legible, and rather beyond a narrow plan than cut off.
            let least = sheet.sizes.least;
            sheet.title = sheet.title.clamp(least, 2.0 * least);
            let titles = which.iter().map(|&k| width(&self.title(&self.pages[k])));
            let widest = titles.fold(0.0, f64::max) * sheet.title;
            beside = (widest + 2.0 * margin - size.x).max(0.0);
        }
        for (k, &index) in which.iter().enumerate() {
            let place = DVec2::new((k % columns) as f64, (k / columns) as f64) * size;
            self.draw(index, place + margin - self.min, &mut sheet);
        }
        let whole = size * DVec2::new(columns as f64, rows as f64);
        if !has_legend {
            let at = DVec2::new(margin, whole.y);
            sheet.items.push(Item::Place { at, storey: None });
            let bar = sheet.bar();
            let names = sheet.numbers(self.world, bar, whole.x - 2.0 * margin);
            return Drawing {
                title: "Floor plan".into(),
                size: whole + DVec2::new(beside, names),
                zoom,
                items: sheet.items,
            };
        }
        // The legend takes the place of a missing plan, or else a strip below all.
        let last = n % columns;
        let is_beside = last > 0 && size.x * (columns - last) as f64 > sheet.legend_width();
        let (corner, room) = if is_beside {
            let corner = DVec2::new(last as f64, rows as f64 - 1.0) * size;
            (corner + margin, whole.x - corner.x)
        } else {
            (
                DVec2::new(margin, whole.y),
                whole.x.max(sheet.legend_width()),
            )
        };
        let end = sheet.foot(self.world, corner, room - 2.0 * margin, true) + margin;
        Drawing {
            title: "Floor plans".into(),
            size: DVec2::new(whole.x.max(corner.x - margin + room), end.max(whole.y)),
            zoom,
            items: sheet.items,
        }
    }

    fn draw(&self, index: usize, origin: DVec2, sheet: &mut Sheet) {
        let drawn = &self.pages[index];
        let storey = &drawn.page.storey;
        sheet.items.push(Item::Place {
            at: origin,
            storey: Some(storey.name.clone()),
        });
        let filled = drawn.regions.iter().filter(|r| r.0 != Label::Void);
        let (walls, floors): (Vec<_>, Vec<_>) = filled.partition(|r| r.0 == Label::Solid);
        let fill = |(label, region): &(Label, Region)| self.region(*label, region);
        sheet.items.extend(floors.into_iter().map(fill));
        // Under the walls: the box around an object may reach into one.
        sheet.items.extend_from_slice(&drawn.objects);
        sheet.items.extend(walls.into_iter().map(fill));
        sheet.items.extend_from_slice(&drawn.marks);
        for (label, region) in &drawn.regions {
            let Some((cell, is_own)) = cell_of(*label) else {
                continue;
            };
            let name = shown(&shortened(&self.world.graph[cell].name)).to_string();
            let area = match self.rooms.get(&cell) {
                Some(room) if is_own && room.storeys.len() == 1 => room.floor_area,
                _ => region.area,
            };
            let area = match is_own {
                true => format!("{area:.1} m²"),
                false => String::new(),
            };
            let number = cell.0.to_string();
            let words = [&*name, area.as_str(), number.as_str()];
            let fitted = fit(&drawn.section, *label, region, words, sheet.sizes);
            if fitted.is_number {
                sheet.numbered.insert(cell);
            }
            let n = fitted.lines.len();
            let sizes: Vec<f64> = (0..n).map(|i| line_size(&fitted, i)).collect();
            let height: f64 = sizes.iter().sum::<f64>() * line_height();
            // Along the downward direction of the lines.
            let mut down = -0.5 * height;
            for (line, size) in fitted.lines.iter().zip(sizes) {
                // The base line lies above the line's end by about a quarter of the letters' height.
                down += size * line_height();
                let base = down - 0.28 * size;
                let offset = if fitted.is_turned {
                    DVec2::new(base, 0.0)
                } else {
                    DVec2::new(0.0, base)
                };
                if !line.is_empty() {
                    sheet.items.push(Item::Words(Words {
                        at: fitted.at + offset,
                        size,
                        is_centered: true,
                        is_turned: fitted.is_turned,
                        text: line.clone(),
                        cell: Some(cell),
                    }));
                }
            }
        }
        rings(&self.doubts, index, sheet);
        for &cell in self.thin.iter().filter(|c| storey.cells.contains(c)) {
            self.draw_thin(cell, sheet);
        }
        let at = self.min - DVec2::new(0.0, 0.4 * sheet.zoom);
        sheet.words(at, sheet.title, false, self.title(drawn));
    }

    fn region(&self, label: Label, region: &Region) -> Item {
        let cell = cell_of(label).map(|c| c.0);
        Item::Path(Path {
            class: match label {
                Label::Cell(_) => Class::Cell,
                Label::Beyond(_) => Class::Beyond,
                Label::Solid | Label::Outdoor | Label::Void => Class::Solid,
            },
            fill: cell.map(cell_color),
            lines: region.borders.clone(),
            is_closed: true,
            cell,
            hint: cell.map(|c| shortened(&self.world.graph[c].name).into_owned()),
        })
    }

    /// Draws a cell thinner than the grid: the box around it, and its number.
    fn draw_thin(&self, cell: CellId, sheet: &mut Sheet) {
        let [low, high] = self.world.graph[cell]
            .aabb
            .map(|p| DVec2::new(p[0].into(), p[2].into()));
        let corners = vec![
            low,
            DVec2::new(high.x, low.y),
            high,
            DVec2::new(low.x, high.y),
        ];
        sheet.items.push(Item::Path(Path {
            class: Class::Thin,
            fill: None,
            lines: vec![corners],
            is_closed: true,
            cell: Some(cell),
            hint: Some(shortened(&self.world.graph[cell].name).into_owned()),
        }));
        sheet.numbered.insert(cell);
        sheet.items.push(Item::Words(Words {
            at: (low + high) * 0.5,
            size: sheet.sizes.least,
            is_centered: true,
            is_turned: false,
            text: cell.0.to_string(),
            cell: Some(cell),
        }));
    }

    fn title(&self, drawn: &Drawn) -> String {
        // Avoids "-0.00".
        let height = |h: f64| {
            let h = (h * 100.0).round() / 100.0;
            format!("{:+.2}", if h == 0.0 { 0.0 } else { h })
        };
        let storey = &drawn.page.storey;
        let n = self.storeys().filter(|s| !s.is_between).count();
        let low = drawn.heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = drawn
            .heights
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        if storey.is_between {
            return if high - low < 0.05 {
                format!(
                    "{} · spaces without a floor, cut {} m",
                    storey.name,
                    height(low)
                )
            } else {
                format!(
                    "{} · spaces without a floor, cut {} to {} m",
                    storey.name,
                    height(low),
                    height(high)
                )
            };
        }
        let name = format!("Storey {} of {n}", storey.name);
        let [low, high] = storey.range;
        if high > low {
            return format!(
                "{name} · floors {} to {} m, cut {:.2} m above each",
                height(low),
                height(high),
                self.cut_height
            );
        }
        format!(
            "{name} · floor {} m, cut {} m",
            height(storey.floor),
            height(storey.floor + self.cut_height)
        )
    }
}

/// Factor on the usual size of letters and margins: a sheet is viewed as a whole, whatever the size of the building.
/// Whole numbers keep the scale bar round.
fn lettering(plan: DVec2, n_storeys: usize) -> f64 {
    let side = (plan.x * plan.y * n_storeys.max(1) as f64).sqrt();
    [40.0, 20.0, 10.0, 4.0, 2.0]
        .into_iter()
        .find(|zoom| side > 20.0 * zoom)
        .unwrap_or(1.0)
}

/// The rectangle (x and z) around all rooms; around the triangles if there are none.
fn extent(world: &World) -> (DVec2, DVec2) {
    let rooms = world.graph.places().flat_map(|(_, c)| c.aabb);
    let mut corners: Vec<[f32; 3]> = rooms.collect();
    if corners.is_empty() {
        corners.extend(
            world
                .batches
                .iter()
                .flat_map(|b| b.primitive.positions.iter().copied()),
        );
    }
    if corners.is_empty() {
        return (DVec2::ZERO, DVec2::ONE);
    }
    let mut bounds = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for c in corners {
        let p = DVec2::new(c[0].into(), c[2].into());
        bounds = (bounds.0.min(p), bounds.1.max(p));
    }
    // Leaves space for the thickness of outer walls.
    (bounds.0 - 0.5, bounds.1 + 0.5)
}
