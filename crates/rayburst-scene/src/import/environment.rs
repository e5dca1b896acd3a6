//! Environment maps from files.

use std::{path::Path, sync::Arc};

use glam::Vec3;
use rayburst_image::decode_picture;

use super::{ImportError, read_limited};
use crate::environment::EnvironmentMap;

/// Most bytes of an environment's file: 1 GiB.
const MAX_BYTES: u64 = 1 << 30;

/// Reads an equirectangular picture (.hdr, .exr) as an environment without rotation, of intensity 1,
/// and what was mended in it, if anything.
///
/// Texels that are not numbers or are negative become black; infinite ones take the brightest
/// finite value of the picture.
pub fn load_environment(path: &Path) -> Result<(EnvironmentMap, Option<String>), ImportError> {
    let bytes =
        read_limited(path, MAX_BYTES).map_err(|e| ImportError::unresolved(path, "the file", e))?;
    let name = path.display().to_string();
    let mut picture = decode_picture(&bytes, &name).map_err(|error| {
        // The picture's errors begin with its name, as this one will.
        let text = error.to_string();
        let reason = text.strip_prefix(&format!("{name}: ")).unwrap_or(&text);
        ImportError::malformed(path, "the picture", reason)
    })?;
    let size = (picture.width, picture.height);
    let mended = mend(&mut picture.pixels);
    let warning = (mended > 0).then(|| {
        format!("{name}: {mended} texels were negative, infinite or no numbers; they are mended")
    });
    let texels: Arc<[Vec3]> = picture.pixels.into();
    Ok((EnvironmentMap { texels, size, rotation: 0.0, intensity: 1.0 }, warning))
}

/// Makes all texels finite and not negative; returns how many were not.
fn mend(texels: &mut [Vec3]) -> usize {
    let is_sound = |t: &Vec3| t.is_finite() && t.min_element() >= 0.0;
    if texels.iter().all(is_sound) {
        return 0;
    }
    let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
    let brightest = texels.iter().flat_map(|t| t.to_array()).map(finite).fold(0.0, f32::max);
    let mut mended = 0;
    for texel in texels.iter_mut().filter(|t| !is_sound(t)) {
        *texel = texel.map(|x| if x >= 0.0 { x.min(brightest) } else { 0.0 });
        mended += 1;
    }
    mended
}

#[cfg(test)]
mod tests {
    use rayburst_image::{RgbImage, write_hdr};

    use super::*;

    #[test]
    fn texels_are_mended() {
        let mut texels = [
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(f32::NAN, 0.5, f32::INFINITY),
            Vec3::new(-1.0, f32::NEG_INFINITY, 0.25),
        ];
        assert_eq!(mend(&mut texels), 2);
        assert_eq!(texels[0], Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(texels[1], Vec3::new(0.0, 0.5, 3.0));
        assert_eq!(texels[2], Vec3::new(0.0, 0.0, 0.25));
    }

    #[test]
    fn pictures_keep_size_and_orientation() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("a.hdr");
        let picture = RgbImage::from_fn(8, 4, |x, y| Vec3::new(x as f32, y as f32, 0.5));
        write_hdr(&path, &picture).expect("file");
        let (map, warning) = load_environment(&path).expect("map");
        assert_eq!((map.size, warning), ((8, 4), None));
        assert!(map.texels[0].abs_diff_eq(Vec3::new(0.0, 0.0, 0.5), 0.01));
        assert!(map.texels[8 * 3 + 7].abs_diff_eq(Vec3::new(7.0, 3.0, 0.5), 0.05));
    }

    #[test]
    fn hostile_files_are_refused_with_their_name() {
        let dir = tempfile::tempdir().expect("temporary folder");
        let path = dir.path().join("bad.hdr");
        let huge = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 100000 +X 100000\n";
        for bytes in [&b""[..], b"#?RADIANCE\n", huge, b"\x76\x2f\x31\x01aaaaaaaa", b"nonsense"] {
            std::fs::write(&path, bytes).expect("file");
            let error = load_environment(&path).expect_err("refused").to_string();
            assert!(error.contains("bad.hdr"), "{error}");
            assert_eq!(error.matches("bad.hdr").count(), 1, "{error}");
        }
        let missing = load_environment(&dir.path().join("missing.exr"));
        assert!(matches!(missing, Err(ImportError::Io { .. })));
        assert!(load_environment(dir.path()).is_err());
    }
}
