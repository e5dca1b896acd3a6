//! Environment maps as programs in the wild write them.

use std::path::PathBuf;

use rayburst_image::colour::luminance;
use rayburst_image::exposure::{auto_exposure, scale};
use rayburst_image::read_picture;

#[test]
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn environment_maps_are_read() {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/scenes/env"));
    if !folder.is_dir() {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    }
    for name in ["kloppenheim_05_1k", "studio_small_03_1k", "venice_sunset_1k"] {
        let picture = read_picture(&folder.join(format!("{name}.hdr"))).unwrap();
        assert_eq!((picture.width, picture.height), (1024, 512), "{name}");
        let brightest = picture.pixels.iter().map(|&p| luminance(p)).fold(0.0, f32::max);
        assert!(brightest > 5.0 && picture.pixels.iter().all(|p| p.is_finite()), "{name}");
        let exposed = scale(auto_exposure(&picture));
        assert!((0.01..100.0).contains(&exposed), "{name} {exposed}");
    }
}
