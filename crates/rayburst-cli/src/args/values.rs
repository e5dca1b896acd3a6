//! Values as users type them: sizes, vectors, ranges, names.

use std::{ops::RangeInclusive, str::FromStr};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use rayburst::{glam::Vec3, image::check_size};

/// A parser of one of the names of a table; clap lists them and finds the nearest.
pub(crate) fn choice<T: Copy + Send + Sync + 'static>(
    all: &'static [(&'static str, T)],
) -> impl TypedValueParser<Value = T> {
    let names = all.iter().map(|(name, _)| *name);
    PossibleValuesParser::new(names).try_map(move |given| {
        let found = all.iter().find(|(name, _)| *name == given).map(|(_, value)| *value);
        found.ok_or("not one of the possible values")
    })
}

/// A parser of a comma-separated list of names of a table.
pub(crate) fn choices<T: Copy + PartialEq>(
    kind: &str,
    all: &[(&'static str, T)],
    given: &str,
) -> Result<Vec<T>, String> {
    let mut list = Vec::new();
    for name in given.split(',').map(str::trim).filter(|n| !n.is_empty()) {
        let Some((_, value)) = all.iter().find(|(known, _)| *known == name) else {
            let known: Vec<&str> = all.iter().map(|(n, _)| *n).collect();
            return Err(crate::names::unknown(kind, name, &known));
        };
        if !list.contains(value) {
            list.push(*value);
        }
    }
    if list.is_empty() { Err(format!("no {kind} is named")) } else { Ok(list) }
}

/// Width and height in pixels, `960x540`.
pub(crate) fn size(given: &str) -> Result<(u32, u32), String> {
    let parts = given.split_once(['x', 'X', '×']).and_then(|(w, h)| {
        let side = |s: &str| s.trim().parse::<u64>().ok();
        Some((side(w)?, side(h)?))
    });
    let Some((width, height)) = parts else {
        return Err("a size is WIDTHxHEIGHT in pixels, such as 960x540".into());
    };
    check_size("the picture", width, height).map_err(|e| e.to_string())?;
    // The check leaves sides of 31 bits at most.
    Ok((width as u32, height as u32))
}

/// A point or direction, `1,2.5,-3`.
pub(crate) fn vector(given: &str) -> Result<Vec3, String> {
    let parts: Vec<f32> = given.split(',').map(|p| number(p.trim())).collect::<Result<_, _>>()?;
    match parts[..] {
        [x, y, z] => Ok(Vec3::new(x, y, z)),
        _ => Err("three numbers with commas are needed, such as 1,2.5,-3".into()),
    }
}

/// Any finite number.
pub(crate) fn number(given: &str) -> Result<f32, String> {
    match f32::from_str(given) {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("'{given}' is not a finite number")),
    }
}

/// A number above 0.
pub(crate) fn positive(given: &str) -> Result<f32, String> {
    number(given).and_then(|v| if v > 0.0 { Ok(v) } else { Err("must be above 0".into()) })
}

/// A number from 0 up.
pub(crate) fn not_negative(given: &str) -> Result<f32, String> {
    number(given).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("must not be below 0".into()) })
}

/// A full vertical angle in degrees.
pub(crate) fn field_of_view(given: &str) -> Result<f32, String> {
    let degrees = number(given)?;
    if degrees > 0.0 && degrees < 180.0 {
        Ok(degrees)
    } else {
        Err("a field of view is between 0 and 180 degrees".into())
    }
}

/// A number of threads.
pub(crate) fn threads(given: &str) -> Result<usize, String> {
    match given.parse() {
        Ok(n @ 1..=1024) => Ok(n),
        _ => Err("a number from 1 to 1024 is needed".into()),
    }
}

/// Frames `0..23`, both included.
pub(crate) fn frames(given: &str) -> Result<RangeInclusive<u32>, String> {
    let parts = given.split_once("..").and_then(|(a, b)| {
        let b = b.strip_prefix('=').unwrap_or(b);
        Some((a.trim().parse::<u32>().ok()?, b.trim().parse::<u32>().ok()?))
    });
    match parts {
        Some((first, last)) if first <= last && last - first < 1_000_000 => Ok(first..=last),
        Some((first, last)) if first > last => Err(format!("frame {last} comes before {first}")),
        Some(_) => Err("at most a million frames".into()),
        None => Err("frames are FIRST..LAST, both included, such as 0..47".into()),
    }
}

/// How bright a picture is developed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Exposure {
    /// What suits the picture.
    Auto,
    /// So many stops up.
    Stops(f32),
}

/// `auto` or stops.
pub(crate) fn exposure(given: &str) -> Result<Exposure, String> {
    if given == "auto" {
        return Ok(Exposure::Auto);
    }
    match number(given) {
        Ok(stops) if stops.abs() <= 64.0 => Ok(Exposure::Stops(stops)),
        _ => Err("an exposure is 'auto' or a number of stops from -64 to 64".into()),
    }
}

/// A column and row, `320,180`.
pub(crate) fn pixel(given: &str) -> Result<(u32, u32), String> {
    let parts = given.split_once(',');
    let parsed = parts.and_then(|(x, y)| Some((x.trim().parse().ok()?, y.trim().parse().ok()?)));
    parsed.ok_or_else(|| "a pixel is COLUMN,ROW from the top left, such as 320,180".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_checked() {
        assert_eq!(size("960x540"), Ok((960, 540)));
        assert!(size("0x0").unwrap_err().contains("empty"));
        let error = size("100000x100000").unwrap_err();
        assert!(error.contains("10000000000 pixels, the limit is"), "{error}");
        assert!(size("99999999999999999999x1").is_err());
        assert!(size("960").is_err() && size("-1x5").is_err() && size("ax5").is_err());
    }

    #[test]
    fn numbers_are_finite() {
        assert_eq!(vector("1, -2.5,3e2"), Ok(Vec3::new(1.0, -2.5, 300.0)));
        assert!(vector("1,2").is_err() && vector("nan,0,0").is_err() && vector("inf,0,0").is_err());
        assert!(positive("0").is_err() && not_negative("0").is_ok() && not_negative("-1").is_err());
        assert!(field_of_view("180").is_err() && field_of_view("45").is_ok());
        assert_eq!(exposure("auto"), Ok(Exposure::Auto));
        assert_eq!(exposure("-1.5"), Ok(Exposure::Stops(-1.5)));
    }

    #[test]
    fn ranges_include_both_ends() {
        assert_eq!(frames("0..3"), Ok(0..=3));
        assert_eq!(pixel("3,4"), Ok((3, 4)));
        assert!(pixel("3").is_err() && pixel("-3,4").is_err());
        assert_eq!(frames("5..=5"), Ok(5..=5));
        assert!(
            frames("3..2").is_err() && frames("3").is_err() && frames("0..4294967295").is_err()
        );
    }
}
