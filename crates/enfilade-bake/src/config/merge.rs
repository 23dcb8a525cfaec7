//! Settings that decide where rooms end.

use std::collections::BTreeMap;

/// Settings of merging. Lengths are in world units, all else is dimensionless.
#[derive(Clone, Debug)]
pub struct MergeSettings {
    /// Two cells are one room if the opening between them reaches this share of the space beside it.
    /// [Limit: 0 to 1] Doors have 0.15–0.6, open plan 0.9 and more.
    pub threshold: f64,
    /// The threshold for an opening in a wall: next to its rim, one cell is on one side and the other on the
    /// other, with something thin in between.
    pub wall_threshold: f64,
    /// Share of the rim that must be wall for `wall_threshold` to apply fully.
    pub wall_rim: f64,
    /// Weight of the radius ratio: radii are coarser than areas, so they get the benefit of the doubt.
    pub radius_gain: f64,
    /// Distance from the opening's plane within which cross-sections are measured. [Units: wu]
    pub reach: f64,
    /// Margin around the opening's rim within which cross-sections are counted. [Units: wu]
    pub surround: f64,
    /// Weight of an opening to the outdoors, compared with one between rooms.
    pub outdoor_gain: f64,
    /// Share of an opening that a door leaf or pane must fill to close it.
    pub closed_share: f64,
    /// Least radius of the largest ball in a room. [Units: wu] A cell narrower everywhere is a crevice, and
    /// belongs to the room it opens to most.
    pub min_radius: f64,
    /// A cell with this share of its sides open is a bay of its neighbor. [Limit: 0 to 1] A square of columns a fifth
    /// as thick as their spacing is open by 0.8, a vestibule of 1.5 m with a doorway on each side by 0.5.
    pub bay_share: f64,
}

impl Default for MergeSettings {
    fn default() -> Self {
        Self {
            threshold: 0.7,
            // Higher, and lobbies are cut where they bend (janesville, 0.81); lower, and air shafts join rooms (edu-school, 0.76).
            wall_threshold: 0.8,
            wall_rim: 0.3,
            radius_gain: 1.15,
            reach: 0.6,
            surround: 1.5,
            outdoor_gain: 0.8,
            closed_share: 0.6,
            min_radius: 0.3,
            bay_share: 0.7,
        }
    }
}

impl MergeSettings {
    /// Returns all settings as text, by name, for the provenance of the file.
    pub(crate) fn to_settings(&self) -> BTreeMap<String, String> {
        // Complete by construction: a setting that is not named here does not compile.
        let Self {
            threshold,
            wall_threshold,
            wall_rim,
            radius_gain,
            reach,
            surround,
            outdoor_gain,
            closed_share,
            min_radius,
            bay_share,
        } = self;
        [
            ("threshold", threshold),
            ("wall_threshold", wall_threshold),
            ("wall_rim", wall_rim),
            ("radius_gain", radius_gain),
            ("reach", reach),
            ("surround", surround),
            ("outdoor_gain", outdoor_gain),
            ("closed_share", closed_share),
            ("min_radius", min_radius),
            ("bay_share", bay_share),
        ]
        .map(|(k, v)| (format!("merge.{k}"), v.to_string()))
        .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BakeConfig;

    #[test]
    fn every_setting_of_merging_changes_what_a_world_records() {
        let as_is = MergeSettings::default().to_settings();
        let with_bays = MergeSettings {
            bay_share: 0.6,
            ..MergeSettings::default()
        };
        assert_ne!(as_is, with_bays.to_settings());
        let recorded = BakeConfig::default().voxel_settings();
        assert!(as_is.keys().all(|k| recorded.contains_key(k)));
    }
}
