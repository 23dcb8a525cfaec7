//! Argument values shared by several commands.

use std::time::Duration;

/// Reads `x,y,z`. [Units: wu]
///
/// # Errors
///
/// For anything but three finite numbers; the text says what is needed.
pub fn point(text: &str) -> Result<[f32; 3], String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(|w| w.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok([x, y, z]),
        _ => Err("three numbers of meters are needed, e.g. 1,1.6,-2.5".into()),
    }
}

/// Reads `WxH`, the size of a picture in pixels, neither of them 0.
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let parse = || {
        let (w, h) = text.split_once('x')?;
        let (w, h) = (w.parse::<u32>().ok()?, h.parse::<u32>().ok()?);
        (w > 0 && h > 0).then_some([w, h])
    };
    parse().ok_or_else(|| "a width and a height are needed, e.g. 1280x720".into())
}

/// Reads a number of seconds of at least 0.
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn seconds(text: &str) -> Result<Duration, String> {
    text.parse()
        .ok()
        .and_then(|s| Duration::try_from_secs_f64(s).ok())
        .ok_or_else(|| "a number of seconds of at least 0 is needed".into())
}

/// Reads `ID=SHARE`: a portal, and the fraction by which its leaves are open, 0 to 1.
///
/// # Errors
///
/// For anything else; the text says what is needed.
pub fn door(text: &str) -> Result<(u32, f32), String> {
    let parse = || {
        let (id, share) = text.split_once('=')?;
        let (id, share) = (id.trim().parse().ok()?, share.trim().parse::<f32>().ok()?);
        (0.0..=1.0).contains(&share).then_some((id, share))
    };
    parse().ok_or_else(|| {
        "a portal and a share from 0 (shut) to 1 (open) are needed, e.g. 12=0.5".into()
    })
}

/// Reads a limit of memory: an amount as for [`bytes`], or `0`, which stands for more than there is. [Units: bytes]
///
/// # Errors
///
/// As [`bytes`].
pub fn memory_limit(text: &str) -> Result<u64, String> {
    const NO_LIMIT: u64 = 1 << 62;
    if text == "0" {
        return Ok(NO_LIMIT);
    }
    bytes(text).map_err(|problem| format!("{problem}, or 0 for no limit"))
}

/// Reads an amount of memory: a number and its unit, `4G`, `1.5 GiB`, `800M`. A K is 1,024. [Units: bytes]
///
/// # Errors
///
/// For anything else, and a number without a unit; the text says what is needed.
pub fn bytes(text: &str) -> Result<u64, String> {
    let parse = || {
        let split = text.find(|c: char| c.is_ascii_alphabetic())?;
        let number: f64 = text[..split].trim().parse().ok()?;
        let unit = text[split..].to_ascii_uppercase();
        let unit = unit.trim_end_matches("IB").trim_end_matches('B');
        let power = ["", "K", "M", "G", "T"].iter().position(|&u| u == unit)?;
        let value = number * 1024f64.powi(power as i32);
        (value >= 1.0 && value < 2f64.powi(63)).then_some(value as u64)
    };
    parse().ok_or_else(|| "an amount of memory with its unit is needed, e.g. 4G or 800M".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_door_is_open_by_a_share() {
        assert_eq!(door("12=0.5"), Ok((12, 0.5)));
        assert_eq!(door("0=1"), Ok((0, 1.0)));
        for bad in ["", "12", "12=", "=1", "12=1.5", "12=-0.1", "12=nan", "a=1"] {
            assert!(door(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn an_amount_of_memory_has_a_unit() {
        assert_eq!(bytes("4G"), Ok(4 << 30));
        assert_eq!(bytes("1.5 GiB"), Ok(3 << 29));
        assert_eq!(bytes("800m"), Ok(800 << 20));
        assert_eq!(bytes("12B"), Ok(12));
        assert!(bytes("0").is_err());
        assert!(memory_limit("0").is_ok_and(|n| n > 1 << 60));
        for bad in [
            "", "4", "G", "-1G", "0G", "nanG", "infG", "1e30T", "4X", "4GG",
        ] {
            assert!(bytes(bad).is_err(), "{bad}");
            assert!(memory_limit(bad).is_err(), "{bad}");
        }
    }
}
