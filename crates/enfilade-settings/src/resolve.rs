//! Settings in the form that import and bake take.

use enfilade_bake::bsp::{BspConfig, Guide, Heuristic, Rooms};
use enfilade_bake::simplify::{CostModel, SimplifySettings};
use enfilade_bake::{BakeConfig, Method, RoomDecision, SmallestHole};
use enfilade_geom::scene::{RoomName, Scene};
use enfilade_geom::{Aabb, DVec3, Plane};
use enfilade_import::{ImportOptions, RepairOptions, RoleRules, Up};

use crate::{BspTable, DecisionTable, Settings, SettingsError, SplitHeuristic, UpAxis};

/// Default bound below which cells are merged with a neighbor, in triangles: the merging threshold of Lefebvre &
/// Hornus 2003, table 2.
const MERGE_BELOW: f64 = 50.0;

/// Settings of a bake, resolved.
pub struct Resolved {
    /// Settings of the bake; [`Resolved::config_for`] returns them for a scene.
    pub config: BakeConfig,
    /// Names of rooms, beside those of the scene.
    pub names: Vec<RoomName>,
    /// No bound for merging was given: the default applies to levels of brushes alone.
    merges_brushes_only: bool,
}

impl Resolved {
    /// Returns the settings for a scene. A room of a building has few triangles, and the shape of its openings shows
    /// that it is a room: by default, small cells are merged only in a partition of brushes, and no rooms.
    #[must_use]
    pub fn config_for(&self, scene: &Scene) -> BakeConfig {
        let mut config = self.config.clone();
        let is_level = !scene.solids.is_empty() && !scene.is_open_world;
        let is_of_brushes = is_level && config.method.is_none_or(|m| m == Method::Bsp);
        if self.merges_brushes_only {
            config.costs.doorway = is_of_brushes.then_some(config.merge.threshold);
            if !is_of_brushes {
                config.costs.min_cost = 0.0;
            }
        }
        config
    }
}

impl Settings {
    /// Resolves the settings of a bake.
    ///
    /// # Errors
    ///
    /// If they contradict each other.
    pub fn resolve(self) -> Result<Resolved, SettingsError> {
        let mut config = BakeConfig {
            voxel: self.voxel,
            costs: self.bsp.costs()?,
            ..BakeConfig::default()
        };
        let merges_brushes_only = self.bsp.min_cost.is_none();
        if let Some(width) = self.smallest_hole {
            config.smallest_hole = SmallestHole::of_width(width);
        }
        if let Some(n) = self.max_voxels {
            config.max_voxels = n;
        }
        let (m, table) = (&mut config.merge, self.merge);
        for (field, given) in [
            (&mut config.min_opening, self.min_opening),
            (&mut config.noise, self.noise),
            (&mut m.threshold, table.threshold),
            (&mut m.wall_threshold, table.wall_threshold),
            (&mut m.wall_rim, table.wall_rim),
            (&mut m.radius_gain, table.radius_gain),
            (&mut m.reach, table.reach),
            (&mut m.surround, table.surround),
            (&mut m.outdoor_gain, table.outdoor_gain),
            (&mut m.closed_share, table.closed_share),
            (&mut m.min_radius, table.min_radius),
        ] {
            *field = given.unwrap_or(*field);
        }
        config.keeps_given = self.given.is_some();
        let decided = |DecisionTable { at, is }: DecisionTable| RoomDecision {
            at: DVec3::from_array(at),
            is,
        };
        config.decisions = self.decisions.into_iter().map(decided).collect();
        config.bsp = self.bsp.config()?;
        let named = self.names.into_iter();
        let named = named.map(|(name, at)| RoomName::at(name, DVec3::from_array(at)));
        Ok(Resolved {
            config,
            names: named.collect(),
            merges_brushes_only,
        })
    }

    /// Returns the settings of the import; no programs for IFC are set, and no references to files outside allowed.
    #[must_use]
    pub fn import_options(&self) -> ImportOptions {
        ImportOptions {
            unit: self.unit,
            up: self.up.map(|up| match up {
                UpAxis::Y => Up::Y,
                UpAxis::Z => Up::Z,
            }),
            origin: self.origin.map_or(DVec3::ZERO, DVec3::from_array),
            roles: RoleRules {
                structural: self.structural_names.clone(),
                detail: self.detail_names.clone(),
                is_automatic: self.auto_roles.unwrap_or(true),
                textures: self.textures.clone(),
                ..RoleRules::default()
            },
            scene: self.scene.clone(),
            ignores_marks: !self.marks.unwrap_or(true),
            leaves_missing: !self.put_back.unwrap_or(true),
            repair: self.repairs(),
            ..ImportOptions::default()
        }
    }

    /// Repairs to make: none unless they are requested.
    fn repairs(&self) -> Option<RepairOptions> {
        let default = RepairOptions::default();
        (self.repair.is_some() || self.repair_holes.is_some()).then(|| RepairOptions {
            weld: self.repair.unwrap_or(default.weld),
            hole: self.repair_holes.unwrap_or(default.hole),
        })
    }
}

impl BspTable {
    /// Bounds on the costs of cells.
    fn costs(&self) -> Result<SimplifySettings, SettingsError> {
        let default = || self.max_cost.unwrap_or(MERGE_BELOW).min(MERGE_BELOW);
        let min = self.min_cost.unwrap_or_else(default);
        if let Some(max) = self.max_cost.filter(|max| *max < min) {
            return Err(SettingsError::Costs { max, min });
        }
        Ok(SimplifySettings {
            min_cost: min,
            max_cost: self.max_cost,
            outdoors: self.split_outdoors == Some(true),
            max_cells: self.max_cells,
            max_portals: self.max_portals,
            cost: CostModel {
                triangle: self.triangle_cost.unwrap_or(1.0),
                area: self.area_cost.unwrap_or(0.0),
                detail: self.detail_cost.unwrap_or(1.0),
                materials: self.material_costs.clone().into_iter().collect(),
            },
            ..SimplifySettings::default()
        })
    }

    /// Settings of the partition alone.
    fn config(self) -> Result<BspConfig, SettingsError> {
        let plane = |[x, y, z, nx, ny, nz]: [f64; 6]| {
            let normal = DVec3::new(nx, ny, nz).try_normalize();
            let normal = normal.ok_or(SettingsError::Normal)?;
            Ok(Plane::through(DVec3::new(x, y, z), normal))
        };
        let cuboid = |[a, b, c, x, y, z]: [f64; 6]| {
            let (p, q) = (DVec3::new(a, b, c), DVec3::new(x, y, z));
            Aabb::new(p.min(q), p.max(q))
        };
        Ok(BspConfig {
            heuristic: match self.heuristic {
                None => Heuristic::Default,
                Some(SplitHeuristic::MinCut) => Heuristic::MinCut,
                Some(SplitHeuristic::MaxArea) => Heuristic::MaxArea,
                Some(SplitHeuristic::MaxOrtho) => Heuristic::MaxOrtho,
            },
            guide: Guide {
                grid: self.grid,
                tetrahedra: self.tetrahedra,
                planes: (self.planes.into_iter().map(plane)).collect::<Result<_, _>>()?,
                boxes: self.boxes.into_iter().map(cuboid).collect(),
            },
            rooms: match self.rooms {
                None => Rooms::Auto,
                Some(true) => Rooms::Always,
                Some(false) => Rooms::Never,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_toml;
    use enfilade_geom::ConvexSolid;

    fn of(text: &str) -> Result<Resolved, SettingsError> {
        parse_toml::<Settings>(text)?.resolve()
    }

    #[test]
    fn bounds_that_no_cell_can_keep_are_refused() {
        let both = "[bsp]\nmin_cost = 60\nmax_cost = 40";
        let error = of(both).err().unwrap();
        assert_eq!(
            error.to_string(),
            "max_cost 40 is below min_cost 60; no cell can be within both"
        );
        // The default gives way.
        let one = of("[bsp]\nmax_cost = 40").unwrap();
        assert_eq!(one.config.costs.min_cost, 40.0);
    }

    #[test]
    fn small_cells_are_merged_in_levels_of_brushes_or_if_that_is_wanted() {
        let scene = Scene::default();
        let cost = |text| of(text).unwrap().config_for(&scene).costs.min_cost;
        assert_eq!(cost(""), 0.0);
        assert_eq!(cost("[bsp]\nmin_cost = 30"), 30.0);
        let mut level = Scene::default();
        level.solids.push(ConvexSolid {
            planes: Vec::new(),
            faces: Vec::new(),
            sources: Vec::new(),
        });
        let costs = |text: &str| of(text).unwrap().config_for(&level).costs;
        assert!(costs("").min_cost == 50.0 && costs("").doorway == Some(0.7));
        assert!(costs("[bsp]\nmin_cost = 50").doorway.is_none());
    }

    #[test]
    fn a_plane_needs_a_normal() {
        let flat = of("[bsp]\nplanes = [[0, 0, 0, 0, 0, 0]]").err();
        assert_eq!(flat, Some(SettingsError::Normal));
    }
}
