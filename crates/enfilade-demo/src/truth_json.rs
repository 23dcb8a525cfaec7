//! [`Truth`] as `truth.json`, in the format of the scoring script.

use std::fmt::Write;

use enfilade_geom::{Aabb, DVec3};

use crate::truth::{OpeningKind, Side, Truth};

impl Truth {
    /// Returns the truth as JSON, `schema_version` 1 of the shared scenes: rooms, openings, storeys, bounds and counts, and in
    /// addition `matter`, points inside closed solids. `occluder_triangles` is the number of structural triangles.
    #[must_use]
    pub fn to_json(&self, occluder_triangles: usize) -> String {
        let mut out = String::new();
        let count = |k| self.openings.iter().filter(|o| o.kind == k).count();
        let bounds = self
            .rooms
            .iter()
            .fold(Aabb::EMPTY, |b, r| b.union(r.aabb()));
        let storeys = list(&self.storeys, |(name, elevation)| {
            format!(
                "{{\"name\":{},\"elevation\":{}}}",
                text(name),
                number(*elevation)
            )
        });
        let rooms = self.rooms.iter().enumerate().map(|(i, r)| {
            let parts = &r.parts;
            let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
            for part in parts {
                let first = vertices.len() as u32;
                vertices.extend_from_slice(&part.corners);
                triangles.extend(part.triangles().iter().map(|t| t.map(|v| v + first)));
            }
            format!(
                "{{\"id\":\"room-{i}\",\"name\":{},\"storey\":{},\"aabb\":{},\"volume\":{},\
                 \"mesh\":{{\"vertices\":{},\"triangles\":{}}},\"sample_points\":{}}}",
                text(&r.name),
                text(self.storeys.get(r.storey).map_or("", |s| s.0.as_str())),
                bounds_json(&r.aabb()),
                number(r.volume),
                list(&vertices, |v| point(*v)),
                list(&triangles, |t| format!("[{},{},{}]", t[0], t[1], t[2])),
                list(&r.sample_points, |p| point(*p)),
            )
        });
        let rooms: Vec<String> = rooms.collect();
        let side = |s: &Side| match s {
            Side::Room(i) => format!("\"room-{i}\""),
            Side::Outside => "\"outside\"".into(),
        };
        let openings = self.openings.iter().enumerate().map(|(i, o)| {
            let area = match o.kind {
                OpeningKind::Virtual => format!(",\"area\":{}", number(o.area())),
                _ => String::new(),
            };
            format!(
                "{{\"id\":\"opening-{i}\",\"kind\":\"{}\",\"name\":{},\"centre\":{},\"normal\":{},\
                 \"width\":{},\"height\":{},\"thickness\":{},\"corners\":{},\"rooms\":{},\
                 \"usable\":true{area}}}",
                o.kind.as_str(),
                text(&o.name),
                point(o.center),
                point(o.normal),
                number(o.width),
                number(o.height),
                number(o.thickness),
                list(&o.corners, |c| point(*c)),
                list(&o.rooms, side),
            )
        });
        let openings: Vec<String> = openings.collect();
        let _ = write!(
            out,
            "{{\"scene\":{},\"schema_version\":1,\"units\":\"metre\",\"up\":\"+Y\",\
             \"handedness\":\"right\",\"bounds\":{},\"counts\":{{\"rooms\":{},\
             \"occluder_triangles\":{occluder_triangles},\"door\":{},\"window\":{},\"opening\":{},\
             \"virtual\":{}}},\"storeys\":{storeys},\"matter\":{},\n\"rooms\":[\n{}\n],\n\"openings\":[\n{}\n]}}\n",
            text(&self.scene),
            bounds_json(&bounds),
            self.rooms.len(),
            count(OpeningKind::Door),
            count(OpeningKind::Window),
            count(OpeningKind::Opening),
            count(OpeningKind::Virtual),
            list(&self.matter, |p| point(*p)),
            rooms.join(",\n"),
            openings.join(",\n"),
        );
        out
    }
}

/// Formats a number to the micrometer; `null` if JSON cannot represent it.
fn number(x: f64) -> String {
    if x.is_finite() {
        // Adding zero turns -0.0 into 0.0.
        format!("{}", (x * 1e6).round() / 1e6 + 0.0)
    } else {
        "null".into()
    }
}

fn point(p: DVec3) -> String {
    format!("[{},{},{}]", number(p.x), number(p.y), number(p.z))
}

fn bounds_json(b: &Aabb) -> String {
    format!("{{\"min\":{},\"max\":{}}}", point(b.min), point(b.max))
}

fn list<T>(items: &[T], item: impl Fn(&T) -> String) -> String {
    format!("[{}]", items.iter().map(item).collect::<Vec<_>>().join(","))
}

fn text(s: &str) -> String {
    let mut out = String::from("\"");
    for c in s.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c < ' ' => {
                let _ = write!(out, "\\u{:04x}", c as u32);
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}
