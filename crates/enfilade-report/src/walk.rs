//! The page of a walk through a world in the browser, first person, from a static server.
//!
//! `integrations/web` builds `walk.html`, one file with its script, three.js and the run-time as WebAssembly inside;
//! `npm run page` there puts it here.

use crate::svg::escaped;

const PAGE: &str = include_str!("walk.html");

/// Returns the page of a walk through the world at an address, relative to that of the page: a world file, or a packed
/// world, of which it loads what comes into view.
#[must_use]
pub fn walk_html(world: &str) -> String {
    let address = format!("data-world=\"{}\"", escaped(world));
    PAGE.replacen("data-world=\"\"", &address, 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_names_its_world_and_needs_no_other_file() {
        let page = walk_html("a\"b & c.glb");
        assert!(page.contains("<html lang=\"en\" data-world=\"a&quot;b &amp; c.glb\">"));
        assert!(!page.contains("src=\"") && !page.contains("href=\""));
    }
}
