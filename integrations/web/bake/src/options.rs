//! Requests of callers, as JSON.

use std::time::Duration;

use enfilade_bake::Method;
use enfilade_geom::MemoryProbe;
use enfilade_import::ImportOptions;
use enfilade_settings::{Resolved, Settings, parse_toml};
use serde::Deserialize;

use crate::Failure;

/// Settings of one bake.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default, rename_all = "camelCase")]
pub struct BakeRequest {
    /// Settings as in the settings file; they take precedence over its text.
    pub settings: Option<Settings>,
    /// A settings file as TOML.
    pub toml: Option<String>,
    /// The method, if one is wanted.
    pub method: Option<String>,
    /// Most memory. [Units: bytes]
    pub max_memory: Option<u64>,
    /// Most time. [Units: s]
    pub max_time: Option<f64>,
    /// Returns worlds without a room.
    pub allow_empty: bool,
    /// Returns worlds of maps that leak.
    pub allow_leak: bool,
    /// Measures memory.
    #[serde(skip)]
    pub probe: Option<MemoryProbe>,
}

impl BakeRequest {
    /// Reads a request.
    ///
    /// # Errors
    ///
    /// If a name or a value is not known; the text says which.
    pub fn of_json(text: &str) -> Result<Self, Failure> {
        serde_json::from_str(text).map_err(|e| {
            let text = e.to_string();
            // The place in a text that nobody saw.
            let text = text.split(" at line ").next().unwrap_or_default();
            Failure::settings(text)
        })
    }

    pub(crate) fn resolve(&self) -> Result<(ImportOptions, Resolved), Failure> {
        let mut settings = match &self.toml {
            Some(toml) => {
                parse_toml::<Settings>(toml).map_err(|e| Failure::settings(&e.to_string()))?
            }
            None => Settings::default(),
        };
        if let Some(own) = self.settings.clone() {
            settings = match self.toml {
                None => own,
                Some(_) => over(settings, own),
            };
        }
        let import = settings.import_options();
        let resolved = settings.resolve();
        let mut resolved = resolved.map_err(|e| Failure::settings(&e.to_string()))?;
        resolved.config.method = match self.method.as_deref() {
            None | Some("auto") => None,
            Some("watershed") => Some(Method::Watershed),
            Some("bsp") => Some(Method::Bsp),
            Some("delaunay") => Some(Method::Delaunay),
            Some(other) => {
                let text = format!(
                    "method is '{other}', must be 'auto', 'watershed', 'bsp' or 'delaunay'"
                );
                return Err(Failure::settings(&text));
            }
        };
        let budget = &mut resolved.config.budget;
        budget.memory = self.max_memory;
        budget.time = match self.max_time.map(Duration::try_from_secs_f64) {
            Some(Err(_)) => {
                let text = "maxTime must be a number of seconds of at least 0";
                return Err(Failure::settings(text));
            }
            time => time.and_then(Result::ok),
        };
        Ok((import, resolved))
    }
}

/// Those of a page over those of a file: the few that a page asks for.
fn over(file: Settings, own: Settings) -> Settings {
    let mut all = Settings {
        unit: own.unit.or(file.unit),
        up: own.up.or(file.up),
        scene: own.scene.or(file.scene),
        voxel: own.voxel.or(file.voxel),
        min_opening: own.min_opening.or(file.min_opening),
        smallest_hole: own.smallest_hole.or(file.smallest_hole),
        repair: own.repair.or(file.repair),
        repair_holes: own.repair_holes.or(file.repair_holes),
        ..file
    };
    all.detail_names.extend(own.detail_names);
    all.structural_names.extend(own.structural_names);
    all.names.extend(own.names);
    all.decisions.extend(own.decisions);
    all
}
