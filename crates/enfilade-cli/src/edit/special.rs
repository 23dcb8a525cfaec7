//! Mirrors, monitors, tinted panes and links, as arguments of `edit`.

use anyhow::{Context, bail};
use enfilade::bake::edit::special;
use enfilade::bake::edit::special::LinkOptions;
use enfilade::cpg::{CellPortalGraph, MonitorCamera, PortalId, SpecialId, World};
use enfilade::geom::{DMat4, Similarity, shown};
use enfilade::internals::bake::edit::special::SpecialSpot;

use super::{Polygon, parse_polygon};
use crate::inspect::cell_of;
use crate::specials::described;
use enfilade_cli::values::point;

// No doc comment: it would replace the command's description.
// Options for sides of portals, and parts of walls, that show something else than what is behind them.
#[derive(clap::Args)]
pub(super) struct Specials {
    /// Special portal to make plain again, by its number in the input or its name. Done first; later ones are renumbered.
    #[arg(long, value_name = "SPECIAL", group = "edits", help_heading = HEADING)]
    plain: Vec<String>,
    /// Side of a portal, or polygon on a wall, that becomes a mirror. PLACE is PORTAL[:CELL], such as 3:cell-0, or X,Y,Z;X,Y,Z;…;
    /// portals have the numbers that they have after all removals.
    #[arg(
        long, value_name = "PLACE", group = "edits", value_parser = parse_place, allow_hyphen_values = true,
        help_heading = HEADING
    )]
    mirror: Vec<Place>,
    /// Two places of one size and shape of which each leads to the other.
    #[arg(
        long, num_args = 2, value_names = ["PLACE", "PLACE"], group = "edits", value_parser = parse_place,
        allow_hyphen_values = true, help_heading = HEADING
    )]
    link: Vec<Place>,
    /// Only the first place of a link leads to the second; the second stays as it is.
    #[arg(long, requires = "link", help_heading = HEADING)]
    one_way: bool,
    /// Link places of one shape, but of different size: who enters the smaller one grows.
    #[arg(long, requires = "link", conflicts_with = "transform", help_heading = HEADING)]
    scaled: bool,
    /// Map from the first place of the only link to the second, as the 16 numbers of a glTF matrix, column by column: rotation, one
    /// scale, reflection, translation. Without it, the first opening is laid on the second, upright.
    #[arg(
        long, value_name = "NUMBERS", requires = "link", value_parser = parse_transform, allow_hyphen_values = true,
        help_heading = HEADING
    )]
    transform: Option<Similarity>,
    /// Side of a portal, or polygon on a wall, that shows the picture of a camera: its position, its direction of view, and its vertical
    /// field of view.
    #[arg(
        long, value_name = "PLACE=X,Y,Z;DX,DY,DZ;DEGREES", group = "edits", value_parser = parse_monitor,
        allow_hyphen_values = true, help_heading = HEADING
    )]
    monitor: Vec<(Place, MonitorCamera)>,
    /// Color of what is seen in a portal, or in a special portal: factors of red, green and blue from 0 to 1, linear, and the share of the
    /// color (1). Both sides of a portal, unless a cell is given.
    #[arg(long, value_name = "PLACE=R,G,B[,A]", group = "edits", value_parser = parse_tint, help_heading = HEADING)]
    tint: Vec<(Place, [f32; 4])>,
    /// Share of what is before a portal that it reflects, 0 to 1, like a pane. Both sides, unless a cell is given.
    #[arg(long, value_name = "PLACE=SHARE", group = "edits", value_parser = parse_reflect, help_heading = HEADING)]
    reflect: Vec<(Place, f32)>,
}

const HEADING: &str = "Mirrors, monitors and links";

/// A place as it is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Place {
    /// A portal, and the cell that it is seen from.
    Portal(u32, Option<String>),
    Wall(Polygon),
}

fn parse_place(text: &str) -> Result<Place, String> {
    if text.contains(';') {
        return parse_polygon(text).map(Place::Wall);
    }
    let (portal, cell) = match text.split_once(':') {
        Some((portal, cell)) => (portal, Some(cell.trim())),
        None => (text, None),
    };
    let number = portal.trim();
    let number = number.strip_prefix("portal-").unwrap_or(number).parse();
    match (number, cell) {
        (Ok(portal), cell) if cell != Some("") => {
            Ok(Place::Portal(portal, cell.map(str::to_owned)))
        }
        _ => Err(
            "a portal and a cell are needed, e.g. 3:cell-0, or a polygon, e.g. 0,1,0;0,2,0;0,2,1"
                .into(),
        ),
    }
}

fn parse_tint(text: &str) -> Result<(Place, [f32; 4]), String> {
    let parse = || {
        let (place, color) = text.split_once('=')?;
        let numbers: Result<Vec<f32>, _> = color.split(',').map(|n| n.trim().parse()).collect();
        let color = match numbers.as_deref() {
            Ok(&[r, g, b]) => [r, g, b, 1.0],
            Ok(&[r, g, b, a]) => [r, g, b, a],
            _ => return None,
        };
        let is_color = color.iter().all(|v| (0.0..=1.0).contains(v));
        is_color.then_some((place, color))
    };
    let (place, color) =
        parse().ok_or("three or four numbers from 0 to 1 are needed, e.g. 3=0.6,0.8,1")?;
    Ok((parse_place(place)?, color))
}

fn parse_reflect(text: &str) -> Result<(Place, f32), String> {
    let parse = || {
        let (place, share) = text.split_once('=')?;
        let share = share.trim().parse::<f32>().ok()?;
        (0.0..=1.0).contains(&share).then_some((place, share))
    };
    let (place, share) = parse().ok_or("a share from 0 to 1 is needed, e.g. 3=0.2")?;
    Ok((parse_place(place)?, share))
}

fn parse_monitor(text: &str) -> Result<(Place, MonitorCamera), String> {
    const NEEDED: &str =
        "a place, a point, a direction and degrees are needed, e.g. 3:cell-0=1,2,3;0,0,-1;60";
    let (place, camera) = text.split_once('=').ok_or(NEEDED)?;
    let [eye, toward, degrees] = camera.split(';').collect::<Vec<_>>()[..] else {
        return Err(NEEDED.into());
    };
    let (eye, toward) = (point(eye)?, point(toward)?);
    let degrees: f32 = degrees.trim().parse().map_err(|_| NEEDED)?;
    if !(degrees > 0.0 && degrees < 180.0) {
        return Err(format!(
            "a field of view above 0° and below 180° is needed, not {degrees}"
        ));
    }
    let [x, y, z] = toward;
    // A camera that looks straight up or down has no upright.
    let is_steep = x.abs().max(z.abs()) < 1e-3 * y.abs();
    let up = if is_steep {
        [0.0, 0.0, 1.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let fov_y = degrees.to_radians();
    let camera = MonitorCamera {
        eye,
        toward,
        up,
        fov_y,
    };
    Ok((parse_place(place)?, camera))
}

fn parse_transform(text: &str) -> Result<Similarity, String> {
    let numbers = text
        .split([',', ' '])
        .filter(|n| !n.is_empty())
        .map(str::parse);
    let numbers: Option<Vec<f64>> = numbers.map(Result::ok).collect();
    let matrix = numbers.and_then(|n| <[f64; 16]>::try_from(n).ok());
    let matrix = matrix
        .ok_or("16 numbers are needed, column by column, e.g. 1,0,0,0,0,1,0,0,0,0,1,0,2,0,0,1")?;
    Similarity::of_matrix(&DMat4::from_cols_array(&matrix)).ok_or_else(|| {
        "a rotation, one scale from 1e-6 to 1e6 for all axes, and a translation are needed: this matrix shears, stretches, \
         flattens or projects"
            .into()
    })
}

impl Specials {
    pub(super) fn removes(&self) -> bool {
        !self.plain.is_empty()
    }

    pub(super) fn makes(&self) -> bool {
        let counts = [self.mirror.len(), self.link.len(), self.monitor.len()];
        let more = [self.tint.len(), self.reflect.len()];
        counts.iter().chain(&more).any(|&n| n > 0)
    }

    /// Makes special portals plain, whose numbers are those of the input.
    pub(super) fn remove(&self, world: &mut World, notes: &mut Vec<String>) -> anyhow::Result<()> {
        let mut gone = Vec::new();
        for text in &self.plain {
            let special = special_of(&world.graph, text)?;
            if !gone.contains(&special) {
                gone.push(special);
                notes.push(format!(
                    "{special} is plain: {}",
                    described(&world.graph, special)
                ));
            }
        }
        // The last first, so that numbers stay.
        gone.sort();
        for special in gone.into_iter().rev() {
            special::plain(world, special)?;
        }
        Ok(())
    }

    /// Makes all others, in the order of the options' help.
    pub(super) fn make(&self, world: &mut World, notes: &mut Vec<String>) -> anyhow::Result<()> {
        let mut made = Vec::new();
        for (place, n) in self.mirror.iter().zip(1..) {
            let spot = spot_of(&world.graph, place)?;
            let mirror = special::mirror(world, &spot);
            made.push(mirror.with_context(|| format!("--mirror number {n} changes nothing"))?);
        }
        if self.transform.is_some() && self.link.len() > 2 {
            bail!("--transform is for a single --link; link the others in another call");
        }
        let options = LinkOptions {
            is_one_way: self.one_way,
            is_scaled: self.scaled,
            map: self.transform,
        };
        for (pair, n) in self.link.chunks(2).zip(1..) {
            let [from, into] = pair else {
                continue;
            };
            let [from, into] = [spot_of(&world.graph, from)?, spot_of(&world.graph, into)?];
            let linked = special::link(world, &from, &into, &options);
            let (one, other) =
                linked.with_context(|| format!("--link number {n} changes nothing"))?;
            made.extend([Some(one), other].into_iter().flatten());
        }
        for ((place, camera), n) in self.monitor.iter().zip(1..) {
            let spot = spot_of(&world.graph, place)?;
            let monitor = special::monitor(world, &spot, *camera);
            made.push(monitor.with_context(|| format!("--monitor number {n} changes nothing"))?);
        }
        for ((place, [r, g, b, share]), n) in self.tint.iter().zip(1..) {
            for spot in sides_of(&world.graph, place)? {
                let tinted = special::tint(world, &spot, [*r, *g, *b], *share);
                made.push(tinted.with_context(|| format!("--tint number {n} changes nothing"))?);
            }
        }
        for ((place, share), n) in self.reflect.iter().zip(1..) {
            for spot in sides_of(&world.graph, place)? {
                let pane = special::reflect(world, &spot, *share);
                made.push(pane.with_context(|| format!("--reflect number {n} changes nothing"))?);
            }
        }
        made.sort();
        made.dedup();
        let said = made
            .iter()
            .map(|&s| format!("{s}: {}", described(&world.graph, s)));
        notes.extend(said);
        Ok(())
    }
}

/// Finds a special portal by number or name.
fn special_of(graph: &CellPortalGraph, text: &str) -> anyhow::Result<SpecialId> {
    let number = text.strip_prefix("special-").unwrap_or(text).parse().ok();
    let named = || {
        graph
            .specials
            .iter()
            .position(|s| !text.is_empty() && s.name == text)
    };
    let found = number.or_else(|| named().map(|i| i as u32));
    let found = found.filter(|&i| (i as usize) < graph.specials.len());
    found.map(SpecialId).with_context(|| {
        let n = graph.specials.len();
        format!("--plain '{}': there is no such special portal; there are {n}, and `enfilade inspect` lists them", shown(text))
    })
}

fn spot_of(graph: &CellPortalGraph, place: &Place) -> anyhow::Result<SpecialSpot> {
    Ok(match place {
        Place::Wall(polygon) => SpecialSpot::Wall(polygon.0.clone()),
        Place::Portal(portal, cell) => SpecialSpot::Doorway {
            portal: PortalId(*portal),
            cell: cell.as_deref().map(|c| cell_of(graph, c)).transpose()?,
        },
    })
}

/// Returns both sides of a portal for which no cell is given.
fn sides_of(graph: &CellPortalGraph, place: &Place) -> anyhow::Result<Vec<SpecialSpot>> {
    let cells = match place {
        Place::Portal(portal, None) => graph
            .portals
            .get(*portal as usize)
            .map(|p| (*portal, p.cells)),
        _ => None,
    };
    Ok(match cells {
        Some((portal, cells)) => (cells.into_iter())
            .map(|cell| SpecialSpot::Doorway {
                portal: PortalId(portal),
                cell: Some(cell),
            })
            .collect(),
        None => vec![spot_of(graph, place)?],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::geom::DVec3;

    #[test]
    fn places_colors_cameras_and_maps_are_read_and_others_refused() {
        assert_eq!(
            parse_place("3:cell-0"),
            Ok(Place::Portal(3, Some("cell-0".into())))
        );
        assert_eq!(parse_place("portal-3"), Ok(Place::Portal(3, None)));
        assert!(matches!(
            parse_place("-1,2,3;0,0,0;1,1,1"),
            Ok(Place::Wall(_))
        ));
        for bad in ["", "door", "3:", ":cell-0", "-1", "1,2,3", "1,2,3;4,5,6"] {
            assert!(parse_place(bad).is_err(), "{bad}");
        }
        let all = Place::Portal(3, None);
        assert_eq!(
            parse_tint("3=0.5,1,0"),
            Ok((all.clone(), [0.5, 1.0, 0.0, 1.0]))
        );
        assert_eq!(
            parse_tint("3=0.5,1,0,0.25"),
            Ok((all.clone(), [0.5, 1.0, 0.0, 0.25]))
        );
        for bad in ["3", "3=1,1", "3=2,1,1", "3=nan,1,1", "x=1,1,1", "=1,1,1"] {
            assert!(parse_tint(bad).is_err(), "{bad}");
        }
        assert_eq!(parse_reflect("3=0.25"), Ok((all, 0.25)));
        for bad in ["3", "3=1.5", "3=", "=0.5"] {
            assert!(parse_reflect(bad).is_err(), "{bad}");
        }
        let (_, camera) = parse_monitor("3:1=1,2,-3;0,-1,0;90").unwrap();
        assert_eq!((camera.eye, camera.up), ([1.0, 2.0, -3.0], [0.0, 0.0, 1.0]));
        assert!((camera.fov_y - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
        for bad in [
            "3",
            "3=1,2,3;0,0,1",
            "3=1,2,3;0,0,1;180",
            "3=1,2,3;0,0,1;0",
            "3=1,2;0,0,1;60",
        ] {
            assert!(parse_monitor(bad).is_err(), "{bad}");
        }
        let map = parse_transform("0,0,-1,0, 0,1,0,0, 1,0,0,0, 5,6,7,1").unwrap();
        assert!(map.point(DVec3::X).distance(DVec3::new(5.0, 6.0, 6.0)) < 1e-9);
        for bad in ["1 2 3", "1,0,0,0,0,2,0,0,0,0,1,0,0,0,0,1", "a"] {
            assert!(parse_transform(bad).is_err(), "{bad}");
        }
    }
}
