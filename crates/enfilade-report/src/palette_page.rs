//! The palette of a kit: a page with the plan of each piece.

use std::fmt::Write;

use enfilade_cpg::World;

use crate::drawing::Drawing;
use crate::plan::{PlanOptions, Plans};
use crate::svg::escaped;

/// A piece on the page.
#[derive(Clone, Debug)]
pub struct PaletteEntry<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its world, of which the plans are drawn.
    pub world: &'a World,
    /// Facts, a line each.
    pub facts: Vec<String>,
}

/// Returns the plan of a piece as the palette shows it, without a legend: that of its lowest storey. `None` without storeys.
#[must_use]
pub fn palette_plan(world: &World) -> Option<Drawing> {
    let plans = Plans::new(world, &PlanOptions::default());
    (plans.storeys().len() > 0).then(|| plans.bare(0))
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2rem;color:#222;background:#fff}\
    main{display:grid;grid-template-columns:repeat(auto-fill,minmax(20rem,1fr));gap:1.2rem}\
    article{border:1px solid #ccc;border-radius:6px;padding:.8rem 1rem}\
    article svg{width:100%;height:auto;max-height:18rem}h1{font-size:1.5rem}h2{margin:0 0 .4rem;font-size:1.1rem}\
    ul{margin:.4rem 0 0;padding-left:1.1rem}.fault{color:#a00}";

/// Writes a page that shows pieces. Their worlds must be valid. Equal entries give equal bytes.
#[must_use]
pub fn palette_html(title: &str, entries: &[PaletteEntry<'_>], faults: &[String]) -> String {
    let mut out = String::new();
    let title = escaped(title);
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}: pieces</title>\n\
         <style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    );
    for fault in faults {
        let _ = writeln!(out, "<p class=\"fault\">{}</p>", escaped(fault));
    }
    out.push_str("<main>\n");
    for entry in entries {
        let _ = writeln!(out, "<article><h2>{}</h2>", escaped(entry.name));
        let plans = Plans::new(entry.world, &PlanOptions::default());
        for storey in 0..plans.storeys().len() {
            let svg = plans.bare(storey).to_svg();
            let svg = svg.split_once("?>").map_or(svg.as_str(), |(_, svg)| svg);
            let _ = writeln!(out, "<div>{svg}</div>");
        }
        out.push_str("<ul>");
        for fact in &entry.facts {
            let _ = write!(out, "<li>{}</li>", escaped(fact));
        }
        out.push_str("</ul></article>\n");
    }
    out.push_str("</main></body></html>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_from_files_cannot_break_the_page() {
        let world = World::default();
        let entry = PaletteEntry {
            name: "<b>",
            world: &world,
            facts: vec!["a & b".into()],
        };
        let page = palette_html("\"x\"", &[entry], &["<i>".into()]);
        assert!(
            page.contains("&lt;b&gt;") && page.contains("a &amp; b") && page.contains("&lt;i&gt;")
        );
        assert!(!page.contains("<b>") && !page.contains("<i>"));
    }
}
