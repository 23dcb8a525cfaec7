//! The page of a walk through a world in the browser, first person, from a static server.
//!
//! `integrations/web` builds `walk/`: the page, its script with three.js, and the run-time as WebAssembly; `npm run page` there puts
//! them here. The page shows its [first picture](WalkPage::first) as soon as that and the script are there, and asks for the rest
//! afterwards.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use crate::svg::escaped;

const PAGE: &str = include_str!("walk/index.html");
const CODE: (&str, &[u8]) = ("walk-code.bin", include_bytes!("walk/walk-code.bin"));
const MODULE: (&str, &[u8]) = ("walk-module.bin", include_bytes!("walk/walk-module.bin"));
const FIRST: &str = "walk-first.bin";

/// A walk through one world.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct WalkPage {
    /// Address of the world, relative to that of the page: a world file, or a packed world, of which it loads what comes into
    /// view.
    pub world: String,
    /// Title, for people.
    pub title: String,
    /// Storeys to choose, from below.
    pub storeys: Vec<WalkStorey>,
    /// Packed model of what is seen from the beginning: `enfilade_stream::first_picture`. Without one, the page begins with the
    /// world itself.
    #[serde(skip)]
    pub first: Option<Vec<u8>>,
}

/// A storey, and a place on it.
#[derive(Clone, Debug, Serialize)]
pub struct WalkStorey {
    /// Name as on plans: `1`, `2`, …
    pub name: String,
    /// The eye. [Units: wu]
    pub eye: [f32; 3],
    /// Direction of the view: 0 along -z, counter-clockwise seen from above. [Units: rad]
    pub yaw: f32,
}

impl WalkPage {
    /// Returns the walk as one page with all parts inside.
    #[must_use]
    pub fn html(&self) -> String {
        let inside = |(name, bytes): (&str, &[u8])| {
            let text = STANDARD.encode(bytes);
            format!("<script id=\"{name}\" type=\"text/plain\">{text}</script>\n")
        };
        let mut before = inside(CODE);
        if let Some(first) = &self.first {
            before += &inside((FIRST, first));
        }
        // The module comes last: the script begins to work while it is on its way.
        let page = self.page().replacen("<!--parts-->\n", &before, 1);
        page.replacen("<!--last part-->\n", &inside(MODULE), 1)
    }

    /// Returns the files of the walk, by name: a page, and parts that belong beside it.
    #[must_use]
    pub fn files(&self) -> Vec<(&'static str, Vec<u8>)> {
        let page = self.page().replacen("<!--parts-->\n", "", 1);
        let page = page.replacen("<!--last part-->\n", "", 1);
        let mut files = vec![("index.html", page.into_bytes())];
        files.extend([CODE, MODULE].map(|(name, bytes)| (name, bytes.to_vec())));
        files.extend(self.first.clone().map(|first| (FIRST, first)));
        files
    }

    fn page(&self) -> String {
        let made = serde_json::json!({
            "page": self,
            "hasFirst": self.first.is_some(),
            "bytes": CODE.1.len() + self.first.as_ref().map_or(0, Vec::len),
        });
        let made = format!("data-walk=\"{}\"", escaped(&made.to_string()));
        let title = format!("<title>{}</title>", escaped(&self.title));
        PAGE.replacen("data-walk=\"\"", &made, 1)
            .replacen("<title></title>", &title, 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page() -> WalkPage {
        WalkPage {
            world: "a\"b & c.glb".into(),
            title: "Mill <1>".into(),
            storeys: Vec::new(),
            first: Some(vec![1, 2, 3]),
        }
    }

    #[test]
    fn a_page_alone_names_its_world_and_needs_no_other_file() {
        let page = page().html();
        assert!(page.contains("&quot;world&quot;:&quot;a\\&quot;b &amp; c.glb&quot;"));
        assert!(page.contains("<title>Mill &lt;1&gt;</title>"));
        assert!(!page.contains("src=\"") && !page.contains("href=\""));
        for name in [CODE.0, MODULE.0, FIRST] {
            assert_eq!(page.matches(&format!("<script id=\"{name}\"")).count(), 1);
        }
        assert!(page.find(MODULE.0).unwrap() > page.find("<!doctype").unwrap());
    }

    #[test]
    fn a_page_with_files_beside_it_is_small() {
        let files = page().files();
        let names: Vec<_> = files.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["index.html", CODE.0, MODULE.0, FIRST]);
        assert!(files[0].1.len() < 10_000);
        let without = WalkPage {
            first: None,
            ..page()
        };
        assert_eq!(without.files().len(), 3);
    }
}
