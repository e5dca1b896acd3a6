//! The colour spaces of ꟻLIP: linear Rec. 709, CIE XYZ, Y Cx Cz, and CIE L*a*b* (D65 throughout).

use glam::{Mat3, Vec3};

/// Linear Rec. 709 to XYZ.
const TO_XYZ: Mat3 = Mat3::from_cols(
    Vec3::new(0.412_386_56, 0.212_636_82, 0.019_330_62),
    Vec3::new(0.357_591_49, 0.715_182_98, 0.119_197_16),
    Vec3::new(0.180_450_49, 0.072_180_2, 0.950_372_59),
);

const FROM_XYZ: Mat3 = Mat3::from_cols(
    Vec3::new(3.241_003_3, -0.969_224_33, 0.055_639_423),
    Vec3::new(-1.537_398_9, 1.875_930_1, -0.204_011_2),
    Vec3::new(-0.498_615_86, 0.041_554_224, 1.057_148_9),
);

/// XYZ of white.
const WHITE: Vec3 = Vec3::new(0.950_428_55, 1.0, 1.088_900_4);

/// The opponent space of the contrast sensitivity filters: linear, with L*a*b*'s scales.
pub(super) fn linear_to_opponent(linear: Vec3) -> Vec3 {
    let v = TO_XYZ * linear / WHITE;
    Vec3::new(116.0 * v.y - 16.0, 500.0 * (v.x - v.y), 200.0 * (v.y - v.z))
}

pub(super) fn opponent_to_linear(opponent: Vec3) -> Vec3 {
    let y = (opponent.x + 16.0) / 116.0;
    let v = Vec3::new(y + opponent.y / 500.0, y, y - opponent.z / 200.0);
    FROM_XYZ * (v * WHITE)
}

fn linear_to_lab(linear: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |v: f32| {
        if v > DELTA * DELTA * DELTA { v.cbrt() } else { v / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let [x, y, z] = (TO_XYZ * linear / WHITE).to_array().map(f);
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

/// L*a*b* with chroma scaled by lightness: Hunt's effect.
pub(super) fn linear_to_hunt_lab(linear: Vec3) -> Vec3 {
    let lab = linear_to_lab(linear);
    Vec3::new(lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z)
}

/// The HyAB distance (Abasi, Tehran, Fairchild 2020): city block in lightness, Euclid in chroma.
pub(super) fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + (d.y * d.y + d.z * d.z).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spaces_lead_back_and_white_is_white() {
        let c = Vec3::new(0.2, 0.7, 0.1);
        assert!((opponent_to_linear(linear_to_opponent(c)) - c).abs().max_element() < 1e-4);
        let white = linear_to_lab(Vec3::ONE);
        assert!((white - Vec3::new(100.0, 0.0, 0.0)).abs().max_element() < 1e-2, "{white}");
    }
}
