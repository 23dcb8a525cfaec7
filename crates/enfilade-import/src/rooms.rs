//! Names of rooms: the spaces of an IFC model, and nodes called `room:NAME`.
//!
//! A body with such a name does not become an object. Points inside it name the rooms around them, each for its share of
//! the body's volume. An empty node names the room in which it stands.

use std::cmp::Ordering;

use enfilade_geom::scene::{Fixture, FixtureKind, RoomName, SourceNode};
use enfilade_geom::{Aabb, DMat4, DVec2, DVec3, Triangle};
use serde_json::Value;

use crate::ImportError;
use crate::builder::{Builder, Placement};
use crate::ifc::is_guid;
use crate::marks::{asked, without_number};
use crate::origins::rigid;

/// Columns of points along either side of a body's box.
const N_COLUMNS: usize = 8;
/// Place of a point in its column's square, off the middle, where edges of triangles are less likely.
const OFF_MIDDLE: DVec2 = DVec2::new(0.4871, 0.5237);

/// Returns the name of the room that a node stands for, by its name and its `extras`.
///
/// That of `room:NAME` (also as the value `enfilade` of its extras), and the number and name of an `IfcSpace`: `101 Office`.
pub(crate) fn name_of(name: &str, extras: &str) -> Option<String> {
    let of_mark = |text: &str| {
        let (kind, name) = text.split_once(':')?;
        let name = without_number(name.trim());
        let is_room = kind.trim().eq_ignore_ascii_case("room") && !name.is_empty();
        is_room.then(|| name.to_owned())
    };
    if let Some(text) = asked(extras) {
        return of_mark(&text);
    }
    of_mark(name).or_else(|| of_space(name, extras))
}

/// Returns the name of an `IfcSpace/...`: its short and its long name, or what is behind the slash if that is not a global id.
fn of_space(name: &str, extras: &str) -> Option<String> {
    let own = name.strip_prefix("IfcSpace/")?.trim();
    let extras: Value = serde_json::from_str(extras).unwrap_or_default();
    let text = |key: &str| extras["ifc"][key].as_str().map(str::trim);
    let mut parts: Vec<&str> = [text("Name"), text("LongName")]
        .into_iter()
        .flatten()
        .filter(|t| !t.is_empty())
        .collect();
    // Many programs write the same into both, or the number into the long name, too.
    if let [short, long] = parts[..]
        && let Some(repeated) = [short, long]
            .into_iter()
            .find(|t| t.contains(short) && t.contains(long))
    {
        parts = vec![repeated];
    }
    if parts.is_empty() && !is_guid(own) && !own.is_empty() {
        parts.push(without_number(own));
    }
    (!parts.is_empty()).then(|| parts.join(" "))
}

impl Builder<'_> {
    /// Returns the name of the room that a node stands for; without marks, only spaces of IFC have one.
    pub(crate) fn room_of(&self, name: &str, extras: &str) -> Option<String> {
        if self.options.ignores_marks {
            of_space(name, extras)
        } else {
            name_of(name, extras)
        }
    }

    /// Keeps the bodies of a room as its name, and its node as a marked place inside it.
    pub(crate) fn place_room(
        &mut self,
        name: &str,
        placement: &Placement<'_>,
        source: &SourceNode,
    ) -> Result<(), ImportError> {
        for &transform in placement.transforms {
            let primitives = self.primitives(placement.mesh).iter();
            let triangles = primitives.flat_map(|p| p.placed_triangles(transform));
            let (points, volume) = points_inside(triangles);
            let Some(middle) = middle(&points) else {
                self.note(
                    placement.place,
                    "a room without a body; its name is left out",
                );
                continue;
            };
            let n_bytes = (N_COLUMNS * N_COLUMNS * size_of::<DVec3>() + name.len()) as u64;
            self.charge_memory(placement.place, 1, n_bytes)?;
            self.keep_fixture(
                placement.place,
                Fixture {
                    kind: FixtureKind::Marker,
                    name: source.name.clone(),
                    transform: rigid(&DMat4::from_translation(middle)),
                    gltf: String::new(),
                    extras: source.extras.clone(),
                },
            )?;
            self.push_room(RoomName {
                name: name.to_owned(),
                points,
                volume,
            });
        }
        Ok(())
    }
}

/// Returns the point next to the mean of all.
fn middle(points: &[DVec3]) -> Option<DVec3> {
    let mean = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    let distance = |p: &&DVec3| p.distance_squared(mean);
    let nearest = points
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    nearest.copied()
}

/// Returns up to 64 points inside a body, each halfway up the highest air of its column, and the volume for which each
/// stands. A body that encloses nothing has the middle of its box. Linear in the triangles.
///
/// Does not depend on the order of triangles and vertices.
fn points_inside(triangles: impl Iterator<Item = Triangle>) -> (Vec<DVec3>, f64) {
    let triangles: Vec<Triangle> = triangles.map(sorted).collect();
    let bounds = triangles
        .iter()
        .flatten()
        .fold(Aabb::EMPTY, |b, &p| b.including(p));
    let size = bounds.size();
    if !size.is_finite() || triangles.is_empty() {
        return (Vec::new(), 0.0);
    }
    let square = DVec2::new(size.x, size.z) / N_COLUMNS as f64;
    let low = DVec2::new(bounds.min.x, bounds.min.z);
    let mut crossed = vec![Vec::new(); N_COLUMNS * N_COLUMNS];
    for triangle in &triangles {
        let flat = triangle.map(|p| DVec2::new(p.x, p.z));
        let [from, to] = [
            flat[0].min(flat[1]).min(flat[2]),
            flat[0].max(flat[1]).max(flat[2]),
        ];
        let first = ((from - low) / square).floor().max(DVec2::ZERO);
        let last = ((to - low) / square)
            .floor()
            .min(DVec2::splat(N_COLUMNS as f64 - 1.0));
        for row in first.y as usize..=last.y as usize {
            for column in first.x as usize..=last.x as usize {
                let at = low + (DVec2::new(column as f64, row as f64) + OFF_MIDDLE) * square;
                crossed[row * N_COLUMNS + column]
                    .extend(height(triangle, flat, at).map(|y| (at, y)));
            }
        }
    }
    let mut points = Vec::new();
    let mut air = 0.0;
    for column in &mut crossed {
        column.sort_by(|a, b| a.1.total_cmp(&b.1));
        // An odd number: the body is open here.
        if column.len() % 2 == 1 {
            continue;
        }
        let pairs = column.as_chunks::<2>().0.iter();
        let highest = pairs.max_by(|a, b| (a[1].1 - a[0].1).total_cmp(&(b[1].1 - b[0].1)));
        if let Some(&[(at, floor), (_, ceiling)]) = highest
            && ceiling > floor
        {
            points.push(DVec3::new(at.x, floor.midpoint(ceiling), at.y));
            air += ceiling - floor;
        }
    }
    if points.is_empty() {
        return (vec![bounds.center()], size.element_product());
    }
    let volume = square.element_product() * air / points.len() as f64;
    (points, volume)
}

/// Returns the triangle with its vertices in an order of their own.
fn sorted(mut triangle: Triangle) -> Triangle {
    let order = |a: &DVec3, b: &DVec3| {
        let pairs = a.to_array().into_iter().zip(b.to_array());
        let mut orders = pairs.map(|(a, b)| a.total_cmp(&b));
        orders.find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
    };
    triangle.sort_by(order);
    triangle
}

/// Returns the height at which the vertical line at a point crosses a triangle.
fn height(triangle: &Triangle, flat: [DVec2; 3], at: DVec2) -> Option<f64> {
    let area = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a);
    let whole = area(flat[0], flat[1], flat[2]);
    let parts = [
        area(at, flat[1], flat[2]),
        area(flat[0], at, flat[2]),
        area(flat[0], flat[1], at),
    ];
    let is_inside = whole != 0.0 && parts.iter().all(|part| part * whole >= 0.0);
    let weighed = triangle
        .iter()
        .zip(parts)
        .map(|(p, part)| p.y * part / whole);
    is_inside.then(|| weighed.sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_from_marks_from_spaces_and_from_what_stands_behind_the_class() {
        let space = "IfcSpace/0iEHWY1$XA8eQeeULq4jE6";
        let ifc = |short: &str, long: &str| {
            format!(r#"{{"ifc":{{"Name":"{short}","LongName":"{long}"}}}}"#)
        };
        for (name, extras, expected) in [
            ("room:Kitchen", String::new(), Some("Kitchen")),
            ("Room: Kitchen 2.001", String::new(), Some("Kitchen 2")),
            ("Cube", r#"{"enfilade":"room:Hall"}"#.into(), Some("Hall")),
            ("room:Kitchen", r#"{"enfilade":"plain"}"#.into(), None),
            ("room:", String::new(), None),
            ("bedroom", String::new(), None),
            ("room", String::new(), None),
            (space, ifc("101", "Office"), Some("101 Office")),
            (space, ifc("101", "Office 101"), Some("Office 101")),
            (space, ifc("Office", "Office"), Some("Office")),
            (space, ifc(" ", "Office"), Some("Office")),
            (space, ifc("", ""), None),
            (space, String::new(), None),
            ("IfcSpace/Hall.001", String::new(), Some("Hall")),
            ("IfcWall/Hall", String::new(), None),
        ] {
            assert_eq!(
                name_of(name, &extras).as_deref(),
                expected,
                "{name} {extras}"
            );
        }
    }

    /// The triangles of a box.
    fn block(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
        let vertex = |i: usize| {
            DVec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 1 { high[k] } else { low[k] }))
        };
        let quads = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let halves = quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]);
        halves.map(|t| t.map(vertex)).collect()
    }

    #[test]
    fn points_lie_inside_a_body_and_stand_for_its_volume() {
        // An L of two boxes: its middle is outside.
        let mut body = block([0.0, 0.0, 0.0], [6.0, 3.0, 1.0]);
        body.extend(block([0.0, 0.0, 1.0], [1.0, 3.0, 6.0]));
        let (points, volume) = points_inside(body.iter().copied());
        assert!(
            points
                .iter()
                .all(|p| (p.y - 1.5).abs() < 1e-9 && (p.x < 1.0 || p.z < 1.0))
        );
        let whole = volume * points.len() as f64;
        assert!((whole - 33.0).abs() < 9.0, "{whole}");
        let inside = middle(&points).unwrap();
        assert!(points.contains(&inside));
        let mut turned = body.clone();
        turned.reverse();
        turned.iter_mut().for_each(|t| t.rotate_left(1));
        assert_eq!(points_inside(turned.into_iter()), (points, volume));
    }

    #[test]
    fn a_body_without_an_inside_has_the_middle_of_its_box() {
        let floor = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0]].map(|[x, z]| DVec3::new(x, 0.0, z));
        let (points, _) = points_inside([floor].into_iter());
        assert_eq!(points, [DVec3::new(2.0, 0.0, 1.0)]);
        assert_eq!(points_inside([].into_iter()), (Vec::new(), 0.0));
        let broken = [floor.map(|p| p / 0.0)];
        assert_eq!(points_inside(broken.into_iter()).0, []);
    }
}
