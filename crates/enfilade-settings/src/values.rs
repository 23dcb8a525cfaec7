//! Numbers of options and settings files, each checked where it is read.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;

use enfilade_bake::RoomAnswer;
use enfilade_geom::DVec3;
use enfilade_import::TextureMatter;
use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error, SeqAccess, Visitor};

use crate::SettingsError;

/// Upper limit of voxel edges and opening widths: beyond it, there are no rooms left to find. [Units: wu]
const LONGEST: f64 = 10.0;

/// Parses TOML; errors are one line with line and column.
///
/// # Errors
///
/// If the text is not TOML, or its keys and values are not those of `T`.
pub fn parse_toml<T: DeserializeOwned>(text: &str) -> Result<T, SettingsError> {
    toml::from_str(text).map_err(|error: toml::de::Error| {
        let before = error.span().and_then(|at| text.get(..at.start));
        let before = before.unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        let problem = error.message().replace('\n', ", ");
        let wrong = text.lines().nth(line - 1).unwrap_or_default().trim();
        let wrong: String = wrong.chars().take(80).collect();
        SettingsError::Text(format!(
            "line {line}, column {column}, `{wrong}`: {problem}"
        ))
    })
}

fn check_length(value: f64) -> Result<f64, String> {
    if value > 0.0 && value <= LONGEST {
        Ok(value)
    } else {
        Err(format!(
            "{value} is not a length in meters above 0 and up to {LONGEST}"
        ))
    }
}

/// Reads a length in meters, above 0 and up to 10. [Units: wu]
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn parse_length(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .map_err(|_| format!("'{text}' is not a number of meters"))?;
    check_length(number)
}

/// Reads a length in meters up to 10, or 0. [Units: wu]
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn parse_hole(text: &str) -> Result<f64, String> {
    let number: f64 = text
        .parse()
        .map_err(|_| format!("'{text}' is not a number of meters"))?;
    if number == 0.0 {
        Ok(0.0)
    } else {
        check_length(number)
    }
}

fn check_weld(value: f64) -> Result<f64, String> {
    if WELDS.contains(&value) {
        Ok(value)
    } else {
        Err(format!(
            "{value} is not a length in meters from 0.000001 to 0.1"
        ))
    }
}

/// Reads the distance of a repair, in meters from 0.000001 to 0.1. [Units: wu]
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn parse_weld(text: &str) -> Result<f64, String> {
    let number = text
        .parse()
        .map_err(|_| format!("'{text}' is not a number of meters"))?;
    check_weld(number)
}

/// Reads a unit of length: a name, or its meters. [Units: wu]
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn parse_unit(text: &str) -> Result<f64, String> {
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

/// Reads `x,y,z`. [Units: wu]
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn parse_point(text: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("give three numbers with commas between, such as 5000,0,-1200".into()),
    }
}

/// Reads a length, with serde. [Units: wu]
pub(crate) fn length<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, check_length)
}

/// Reads the distance of a repair, with serde. [Units: wu]
pub(crate) fn weld<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, check_weld)
}

/// Reads a length or 0, with serde. [Units: wu]
pub(crate) fn hole<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, |value| {
        if value == 0.0 {
            Ok(value)
        } else {
            check_length(value)
        }
    })
}

/// Reads a number of at least 0, with serde.
pub(crate) fn amount<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    checked(from, check_amount)
}

/// Reads numbers of at least 0 by name, with serde.
pub(crate) fn amounts<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<BTreeMap<String, f64>, D::Error> {
    /// Read one by one, so that an error has the line of its value.
    struct Amount(f64);
    impl<'de> Deserialize<'de> for Amount {
        fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            let value = Deserialize::deserialize(from)?;
            check_amount(value).map(Self).map_err(D::Error::custom)
        }
    }
    let read = BTreeMap::<String, Amount>::deserialize(from)?;
    Ok(read
        .into_iter()
        .map(|(name, Amount(v))| (name, v))
        .collect())
}

/// Reads a number of voxels, with serde.
pub(crate) fn voxels<'de, D: Deserializer<'de>>(from: D) -> Result<Option<usize>, D::Error> {
    checked(from, |value| {
        if value >= LEAST_VOXELS {
            Ok(value)
        } else {
            Err(format!(
                "{value} voxels are too few: at least {LEAST_VOXELS}"
            ))
        }
    })
}

/// Reads what textures are made of, with serde.
pub(crate) fn matters<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<BTreeMap<String, TextureMatter>, D::Error> {
    /// Read by itself, so that an error has its line.
    struct SettingsMatter(TextureMatter);
    impl<'de> Deserialize<'de> for SettingsMatter {
        fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
            let name = String::deserialize(from)?;
            let matter = TextureMatter::of_name(&name).map_err(D::Error::custom)?;
            Ok(Self(matter))
        }
    }
    let read = BTreeMap::<String, SettingsMatter>::deserialize(from)?.into_iter();
    Ok(read.map(|(glob, SettingsMatter(m))| (glob, m)).collect())
}

/// Reads points by name, with serde. [Units: wu]
pub(crate) fn named_points<'de, D: Deserializer<'de>>(
    from: D,
) -> Result<BTreeMap<String, [f64; 3]>, D::Error> {
    let read = BTreeMap::<String, SettingsPoint>::deserialize(from)?;
    if read.keys().any(|name| name.trim().is_empty()) {
        return Err(D::Error::custom("a name in [names] is empty"));
    }
    let points = read.into_iter();
    Ok(points.map(|(name, SettingsPoint(p))| (name, p)).collect())
}

/// Reads a point, with serde. [Units: wu]
pub(crate) fn point<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    SettingsPoint::deserialize(from).map(|p| p.0)
}

/// Reads a decision about rooms, with serde.
pub(crate) fn room_answer<'de, D: Deserializer<'de>>(from: D) -> Result<RoomAnswer, D::Error> {
    let name = String::deserialize(from)?;
    let known = RoomAnswer::ALL.into_iter().find(|a| a.name() == name);
    known.ok_or_else(|| {
        let [a, b, c] = RoomAnswer::ALL.map(RoomAnswer::name);
        D::Error::custom(format!("'{name}' is none of '{a}', '{b}', '{c}'"))
    })
}

/// A point, `[x, y, z]`. [Units: wu]
struct SettingsPoint([f64; 3]);

impl<'de> Deserialize<'de> for SettingsPoint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ThreeNumbers;
        impl<'de> Visitor<'de> for ThreeNumbers {
            type Value = SettingsPoint;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a point: three numbers of meters, [x, y, z]")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<SettingsPoint, A::Error> {
                let mut numbers: Vec<f64> = Vec::new();
                while let Some(number) = list.next_element()? {
                    numbers.push(number);
                }
                match numbers[..] {
                    [x, y, z] if numbers.iter().all(|n| n.is_finite()) => {
                        Ok(SettingsPoint([x, y, z]))
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

fn check_amount(value: f64) -> Result<f64, String> {
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("{value} is not a number of at least 0"))
    }
}

fn checked<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
    check: impl Fn(T) -> Result<T, String>,
) -> Result<Option<T>, D::Error> {
    let value = T::deserialize(from)?;
    check(value).map(Some).map_err(D::Error::custom)
}

/// The least number of voxels that the bake accepts. [Units: vx]
const LEAST_VOXELS: usize = 1000;

/// Reads a unit, a name or a number, with serde. [Units: wu]
pub(crate) fn unit<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    struct NameOrNumber;
    impl Visitor<'_> for NameOrNumber {
        type Value = f64;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(
                f,
                "\"m\", \"cm\", \"mm\", \"in\", \"ft\" or a number of meters"
            )
        }
        fn visit_str<E: Error>(self, text: &str) -> Result<f64, E> {
            parse_unit(text).map_err(E::custom)
        }
        fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
            self.visit_str(&value.to_string())
        }
        fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
            self.visit_str(&value.to_string())
        }
        fn visit_u64<E: Error>(self, value: u64) -> Result<f64, E> {
            self.visit_str(&value.to_string())
        }
    }
    from.deserialize_any(NameOrNumber).map(Some)
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
