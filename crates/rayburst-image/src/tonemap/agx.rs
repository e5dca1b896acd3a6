//! Troy Sobotka's AgX (2022), base look, by Benjamin Wrensch's "Minimal AgX Implementation"
//! (2023): an inset matrix, a logarithm over 16.5 stops, a sixth-degree fit of the sigmoid, the
//! outset matrix and the display's gamma.

use glam::{Mat3, Vec3};

const INSET: Mat3 = Mat3::from_cols(
    Vec3::new(0.842_479_06, 0.042_328_24, 0.042_375_655),
    Vec3::new(0.078_433_6, 0.878_468_6, 0.078_433_6),
    Vec3::new(0.079_223_745, 0.079_166_13, 0.879_142_97),
);

const OUTSET: Mat3 = Mat3::from_cols(
    Vec3::new(1.196_879, -0.052_896_85, -0.052_971_635),
    Vec3::new(-0.098_020_88, 1.151_903_1, -0.098_043_45),
    Vec3::new(-0.099_029_74, -0.098_961_18, 1.151_073_7),
);

/// Stops relative to 1 that become 0 and 1: 0.18 × 2^-10 and 0.18 × 2^6.5.
const DARKEST: f32 = -12.473_93;
const BRIGHTEST: f32 = 4.026_069;

pub(super) fn map(c: Vec3) -> Vec3 {
    let v = (INSET * c).max(Vec3::splat(1e-10));
    let log = Vec3::new(v.x.log2(), v.y.log2(), v.z.log2());
    let x = ((log - DARKEST) / (BRIGHTEST - DARKEST)).clamp(Vec3::ZERO, Vec3::ONE);
    let signal = (OUTSET * sigmoid(x)).clamp(Vec3::ZERO, Vec3::ONE);
    signal.powf(2.2)
}

fn sigmoid(x: Vec3) -> Vec3 {
    let high = ((15.5 * x - 40.14) * x + 31.96) * x - 6.868;
    ((high * x + 0.429_8) * x + 0.119_1) * x - 0.002_32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middle_grey_and_the_ends() {
        // Middle grey lies 10 of 16.5 stops up and comes out near middle grey.
        let grey = map(Vec3::splat(0.18)).y;
        assert!((0.15..0.25).contains(&grey), "{grey}");
        assert!(map(Vec3::splat(1e-9)).y < 1e-4);
        assert!(map(Vec3::splat(100.0)).y > 0.97);
        // A pure bright blue neither clips to a flat blue nor turns purple.
        let blue = map(Vec3::new(0.0, 0.0, 40.0));
        assert!(blue.x < blue.z && blue.y > 0.1, "{blue}");
    }
}
