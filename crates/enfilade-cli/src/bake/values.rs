//! Numbers of the command line and the settings file, each checked where it is read.

use std::fmt;
use std::ops::RangeInclusive;

use enfilade::geom::DVec3;
use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error};

/// Upper limit of voxel edges and opening widths: beyond it, there are no rooms left to find. [Units: wu]
const LONGEST: f64 = 10.0;

/// Parses TOML; errors are one line with line and column.
pub(super) fn parse_toml<T: DeserializeOwned>(text: &str) -> anyhow::Result<T> {
    toml::from_str(text).map_err(|error: toml::de::Error| {
        let before = error.span().and_then(|at| text.get(..at.start));
        let before = before.unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        let problem = error.message().replace('\n', ", ");
        let wrong = text.lines().nth(line - 1).unwrap_or_default().trim();
        let wrong: String = wrong.chars().take(80).collect();
        anyhow::anyhow!("line {line}, column {column}, `{wrong}`: {problem}")
    })
}

pub(super) fn check_length(value: f64) -> Result<f64, String> {
    if value > 0.0 && value <= LONGEST {
        Ok(value)
    } else {
        Err(format!(
            "{value} is not a length in meters above 0 and up to {LONGEST}"
        ))
    }
}

pub(super) fn parse_length(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .map_err(|_| format!("'{text}' is not a number of meters"))?;
    check_length(number)
}

pub(super) fn parse_hole(text: &str) -> Result<f64, String> {
    let number: f64 = text
        .parse()
        .map_err(|_| format!("'{text}' is not a number of meters"))?;
    if number == 0.0 {
        Ok(0.0)
    } else {
        check_length(number)
    }
}

pub(super) fn check_weld(value: f64) -> Result<f64, String> {
    if WELDS.contains(&value) {
        Ok(value)
    } else {
        Err(format!(
            "{value} is not a length in meters from 0.000001 to 0.1"
        ))
    }
}

pub(super) fn parse_weld(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .map_err(|_| format!("'{text}' is not a number of meters"))?;
    check_weld(number)
}

pub(super) fn parse_unit(text: &str) -> Result<f64, String> {
    Ok(match text {
        "m" => 1.0,
        "cm" => 0.01,
        "mm" => 0.001,
        "in" => 0.0254,
        "ft" => 0.3048,
        _ => text
            .parse()
            .ok()
            .filter(|u| UNITS.contains(u))
            .ok_or("give m, cm, mm, in, ft, or the meters of one unit, such as 0.001")?,
    })
}

/// Range of a repair's distance. [Units: wu]
const WELDS: RangeInclusive<f64> = 1e-6..=0.1;

/// Range of units that the importer accepts. [Units: wu]
const UNITS: RangeInclusive<f64> = 1e-9..=1e9;

pub(super) fn parse_point(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("give three numbers with commas between, such as 5000,0,-1200".into()),
    }
}

/// A length in the settings file. [Units: wu]
pub(super) struct Length(pub(super) f64);

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Deserialize::deserialize(deserializer)?;
        check_length(value).map(Self).map_err(D::Error::custom)
    }
}

/// A repair's distance in the settings file. [Units: wu]
pub(super) struct Weld(pub(super) f64);

impl<'de> Deserialize<'de> for Weld {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Deserialize::deserialize(deserializer)?;
        check_weld(value).map(Self).map_err(D::Error::custom)
    }
}

/// A repair's largest hole in the settings file. [Units: wu]
pub(super) struct Hole(pub(super) f64);

impl<'de> Deserialize<'de> for Hole {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value: f64 = Deserialize::deserialize(deserializer)?;
        if value == 0.0 {
            return Ok(Self(value));
        }
        check_length(value).map(Self).map_err(D::Error::custom)
    }
}

/// A number of at least 0 in the settings file.
pub(super) struct Amount(pub(super) f64);

impl<'de> Deserialize<'de> for Amount {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value: f64 = Deserialize::deserialize(deserializer)?;
        if value >= 0.0 && value.is_finite() {
            Ok(Self(value))
        } else {
            Err(D::Error::custom(format!(
                "{value} is not a number of at least 0"
            )))
        }
    }
}

/// A number of voxels in the settings file.
pub(super) struct Budget(pub(super) usize);

impl<'de> Deserialize<'de> for Budget {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Deserialize::deserialize(deserializer)?;
        if value >= LEAST_VOXELS {
            Ok(Self(value))
        } else {
            Err(D::Error::custom(format!(
                "{value} voxels are too few: at least {LEAST_VOXELS}"
            )))
        }
    }
}

/// The least budget that the bake accepts. [Units: vx]
const LEAST_VOXELS: usize = 1000;

/// A point in the settings file, `[x, y, z]`. [Units: wu]
pub(super) struct SettingsPoint(pub(super) DVec3);

impl<'de> Deserialize<'de> for SettingsPoint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ThreeNumbers;
        impl<'de> serde::de::Visitor<'de> for ThreeNumbers {
            type Value = SettingsPoint;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a point: three numbers of meters, [x, y, z]")
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(
                self,
                mut list: A,
            ) -> Result<SettingsPoint, A::Error> {
                let mut numbers: Vec<f64> = Vec::new();
                while let Some(number) = list.next_element()? {
                    numbers.push(number);
                }
                match numbers[..] {
                    [x, y, z] if numbers.iter().all(|n| n.is_finite()) => {
                        Ok(SettingsPoint(DVec3::new(x, y, z)))
                    }
                    [_, _, _] => Err(A::Error::custom("a point needs finite numbers")),
                    _ => Err(A::Error::custom(format!(
                        "a point has three numbers of meters, [x, y, z], not {}",
                        numbers.len()
                    ))),
                }
            }
        }
        deserializer.deserialize_seq(ThreeNumbers)
    }
}

/// A unit in the settings file: a name or a number.
pub(super) struct Unit(pub(super) f64);

impl<'de> Deserialize<'de> for Unit {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrNumber;
        impl serde::de::Visitor<'_> for NameOrNumber {
            type Value = Unit;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(
                    f,
                    "\"m\", \"cm\", \"mm\", \"in\", \"ft\" or a number of meters"
                )
            }
            fn visit_str<E: Error>(self, text: &str) -> Result<Unit, E> {
                parse_unit(text).map(Unit).map_err(E::custom)
            }
            fn visit_f64<E: Error>(self, value: f64) -> Result<Unit, E> {
                self.visit_str(&value.to_string())
            }
            fn visit_i64<E: Error>(self, value: i64) -> Result<Unit, E> {
                self.visit_str(&value.to_string())
            }
        }
        deserializer.deserialize_any(NameOrNumber)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_names() {
        assert_eq!(parse_unit("mm"), Ok(0.001));
        assert_eq!(parse_unit("0.5"), Ok(0.5));
        for bad in ["feet", "", "0", "-1", "NaN", "inf", "1e99"] {
            assert!(parse_unit(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn points_are_three_finite_numbers() {
        assert_eq!(parse_point("1,-2, 3e2"), Ok(DVec3::new(1.0, -2.0, 300.0)));
        for bad in ["", "1,2", "1,2,3,4", "1 2 3", "1,2,NaN", "1,2,inf"] {
            assert!(parse_point(bad).is_err(), "{bad}");
        }
    }
}
