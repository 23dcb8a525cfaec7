//! Options of the Delaunay builder, and the file that holds a person's choices.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use enfilade::bake::delaunay::{Choices, DelaunayConfig, Weight};
use enfilade::geom::DVec3;
use enfilade_cli::input::{name_of, read_text};

use enfilade_settings::parse_toml;

#[derive(Clone, clap::Args)]
pub(crate) struct DelaunayOptions {
    /// With the Delaunay builder: weight of a portal.
    #[arg(long, value_enum, default_value_t = WeightName::ScaleFree)]
    weight: WeightName,
    /// With the Delaunay builder: remove portals of less weight; a default of the weight if not given.
    #[arg(long, value_name = "WEIGHT", value_parser = parse_stop)]
    stop: Option<f64>,
    /// With the Delaunay builder: file of choices, as saved by `decimate`.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) choices: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, clap::ValueEnum)]
enum WeightName {
    /// Ratio of the balls that fit into a cell and through the portal.
    ScaleFree,
    /// Projected area of a cell ÷ area of the portal (Gjørup 1999).
    Aspect,
    /// The same, corrected by the size of the cell; depends on the unit.
    SizeCorrected,
}

fn parse_stop(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|w: &f64| *w > 0.0 && w.is_finite())
        .ok_or_else(|| format!("'{text}' is not a number above 0"))
}

impl DelaunayOptions {
    pub(crate) fn resolve(&self) -> anyhow::Result<DelaunayConfig> {
        Ok(DelaunayConfig {
            weight: match self.weight {
                WeightName::ScaleFree => Weight::ScaleFree,
                WeightName::Aspect => Weight::Aspect,
                WeightName::SizeCorrected => Weight::SizeCorrected,
            },
            stop: self.stop,
            choices: match &self.choices {
                None => Choices::default(),
                Some(path) => read_choices(path)?,
            },
        })
    }
}

/// Positions of portals that a person decided on. [Units: m]
#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct ChoicesFile {
    keep: Vec<[f64; 3]>,
    join: Vec<[f64; 3]>,
}

fn read_choices(path: &Path) -> anyhow::Result<Choices> {
    let text = read_text("choices", path)?;
    let file: ChoicesFile = parse_toml(&text).with_context(|| {
        format!(
            "choices {} are not understood; correct or remove the line",
            name_of(path)
        )
    })?;
    let points = |list: Vec<[f64; 3]>| list.into_iter().map(DVec3::from_array).collect();
    Ok(Choices {
        keep: points(file.keep),
        join: points(file.join),
    })
}

/// Returns choices as the text of their file.
pub(crate) fn choices_text(choices: &Choices) -> String {
    let mut text = String::from(
        "# Portals that stay, and portals whose two rooms become one, by their middles in meters.\n",
    );
    for (name, list) in [("keep", &choices.keep), ("join", &choices.join)] {
        _ = writeln!(text, "{name} = [");
        for p in list {
            _ = writeln!(text, "  [{:?}, {:?}, {:?}],", p.x, p.y, p.z);
        }
        _ = writeln!(text, "]");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_come_back_as_they_were_written() {
        let choices = Choices {
            keep: vec![DVec3::new(1.0, -0.1, 1e-7)],
            join: vec![DVec3::ZERO, DVec3::splat(1.0 / 3.0)],
        };
        let file: ChoicesFile = toml::from_str(&choices_text(&choices)).unwrap();
        let back = |list: Vec<[f64; 3]>| -> Vec<DVec3> {
            list.into_iter().map(DVec3::from_array).collect()
        };
        assert_eq!(back(file.keep), choices.keep);
        assert_eq!(back(file.join), choices.join);
    }
}
