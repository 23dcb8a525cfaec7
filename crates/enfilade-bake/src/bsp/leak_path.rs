//! The path out of a map that leaks.

use enfilade_geom::DVec3;
use enfilade_geom::scene::Scene;

/// A path through open space from a point inside to the void.
#[derive(Clone, Debug, PartialEq)]
pub struct LeakPath {
    /// Index of the point inside where it begins.
    pub from: usize,
    /// Its vertices, from that point to beyond the outermost surface. [Units: wu]
    pub points: Vec<DVec3>,
}

/// Points that a text lists.
const SHOWN: usize = 8;

impl LeakPath {
    /// Returns a sentence about it, without a remedy: the class of the entity in the scene, and the first points.
    #[must_use]
    pub fn says(&self, scene: &Scene) -> String {
        let points = self.points.iter().take(SHOWN);
        let shown: Vec<String> = points
            .map(|p| format!("{:.2} {:.2} {:.2}", p.x, p.y, p.z))
            .collect();
        let entities = scene.entities.iter();
        let mut entities = entities.filter(|e| e.object.is_none() && e.position.is_some());
        let class = entities.nth(self.from).map_or("an entity", |e| &e.class);
        let more = if self.points.len() > SHOWN {
            ", …"
        } else {
            ""
        };
        format!(
            "the map leaks: {class} reaches the void in {} steps, by {}{more}",
            self.points.len(),
            shown.join(", "),
        )
    }
}
