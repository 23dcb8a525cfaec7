//! Absorption of the materials of a world: assumed by their names, or given by `--absorption`.

use std::io::Write;

use anyhow::bail;
use enfilade::cpg::World;
use enfilade::world::{Assumed, OCTAVES, Reverb};

use crate::screen::Told;

/// Coefficients in octave bands.
type Bands = [f64; OCTAVES.len()];

/// A value of `--absorption`.
#[derive(Clone, Debug)]
pub(super) struct Given {
    name: String,
    bands: Bands,
}

/// Parses `NAME=0.1`, or `NAME=` and a coefficient for each octave band, separated by commas.
pub(super) fn given(text: &str) -> Result<Given, String> {
    // Names may contain the sign.
    let (name, numbers) = text
        .rsplit_once('=')
        .ok_or("give NAME=COEFFICIENT, as in IfcSlab=0.1")?;
    let mut bands = Vec::new();
    for number in numbers.split(',') {
        match number.trim().parse::<f64>() {
            Ok(x) if (0.0..=1.0).contains(&x) => bands.push(x),
            _ => return Err(format!("`{number}` is not a coefficient from 0 to 1")),
        }
    }
    let n = bands.len();
    let bands = match bands[..] {
        [all] => [all; OCTAVES.len()],
        _ => bands.try_into().map_err(|_| {
            format!("{n} coefficients; give one, or one for each octave band from 125 Hz to 4 kHz")
        })?,
    };
    let name = name.to_owned();
    Ok(Given { name, bands })
}

/// Absorption of one material.
#[derive(serde::Serialize)]
pub(super) struct Absorption {
    /// `null` for triangles without a material.
    material: Option<String>,
    surface: &'static str,
    bands: Bands,
    /// True if the name says nothing.
    is_guess: bool,
    /// Area indoors; set once it is known. [Units: wu²]
    area: f64,
}

/// Absorption of all materials of a world.
pub(super) struct Absorptions {
    by_material: Vec<Absorption>,
    without: Absorption,
}

impl Absorptions {
    /// Assumes what names say, unless it is given. An error if no material has a given name.
    pub(super) fn new(world: &World, given: &[Given]) -> anyhow::Result<Self> {
        let named = |name: Option<&str>| {
            let assumed = Assumed::of_name(name.unwrap_or_default());
            Absorption {
                material: name.map(str::to_owned),
                surface: assumed.surface,
                bands: assumed.bands,
                is_guess: assumed.is_guess,
                area: 0.0,
            }
        };
        let mut by_material: Vec<_> = (world.materials.iter())
            .map(|m| named(Some(m.name.as_str())))
            .collect();
        for given in given {
            let is_meant = |a: &&mut Absorption| {
                let own = a.material.as_deref().unwrap_or_default();
                own.to_lowercase() == given.name.to_lowercase()
            };
            let mut n = 0;
            for absorption in by_material.iter_mut().filter(is_meant) {
                n += 1;
                absorption.surface = "given";
                absorption.bands = given.bands;
                absorption.is_guess = false;
            }
            if n == 0 {
                let names: Vec<&str> = world.materials.iter().map(|m| m.name.as_str()).collect();
                bail!(
                    "--absorption {}: no material has this name; the world has {}",
                    given.name,
                    if names.is_empty() {
                        "no materials".to_owned()
                    } else {
                        names.join(", ")
                    }
                );
            }
        }
        let without = named(None);
        Ok(Self {
            by_material,
            without,
        })
    }

    /// Returns the coefficients of a material.
    pub(super) fn of(&self, material: Option<u32>) -> Bands {
        let known = material.and_then(|m| self.by_material.get(m as usize));
        known.unwrap_or(&self.without).bands
    }

    /// Returns those with walls indoors, the largest first.
    pub(super) fn by_area(mut self, reverb: &Reverb) -> Vec<Absorption> {
        for (_, material, area) in reverb.surfaces() {
            let known = material.and_then(|m| self.by_material.get_mut(m as usize));
            known.unwrap_or(&mut self.without).area += area;
        }
        let mut all = self.by_material;
        all.push(self.without);
        all.retain(|a| a.area > 0.0);
        all.sort_by(|a, b| b.area.total_cmp(&a.area));
        all
    }
}

/// Tells what was assumed.
pub(super) fn tell(absorptions: &[Absorption]) -> anyhow::Result<()> {
    let whole: f64 = absorptions.iter().map(|a| a.area).sum();
    let guessed = absorptions.iter().filter(|a| a.is_guess);
    // From 0 up: an empty sum is -0, which is printed so.
    let guessed = guessed.fold(0.0, |sum, a| sum + a.area);
    writeln!(Told, "absorption of walls indoors, at 125 Hz to 4 kHz:")?;
    for a in absorptions {
        let numbers: Vec<String> = a.bands.iter().map(|x| format!("{x:.2}")).collect();
        writeln!(
            Told,
            "  {:<28} {:>8.1} m²  {}  {}{}",
            a.material.as_deref().unwrap_or("(no material)"),
            a.area,
            numbers.join(" "),
            a.surface,
            if a.is_guess { " (guessed)" } else { "" }
        )?;
    }
    writeln!(
        Told,
        "  guessed by default: {:.0} % of the area; `--absorption NAME=0.1` sets another",
        100.0 * guessed / whole.max(1e-9)
    )?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_one_or_six_from_0_to_1() {
        let wide = given("a=b=0.25").map(|g| (g.name, g.bands));
        assert_eq!(wide, Ok(("a=b".to_owned(), [0.25; 6])));
        let bands = given("IfcSlab=0,0.1,0.2,0.3,0.4,1").map(|g| g.bands);
        assert_eq!(bands, Ok([0.0, 0.1, 0.2, 0.3, 0.4, 1.0]));
        for bad in [
            "IfcSlab",
            "IfcSlab=",
            "IfcSlab=1.1",
            "IfcSlab=nan",
            "IfcSlab=0.1,0.2",
        ] {
            assert!(given(bad).is_err(), "{bad}");
        }
    }
}
