//! Vertex normals for meshes that have none.
//!
//! A face adds its unit normal to each of its vertices, weighted by its area times the angle at the
//! vertex: the angle makes the result independent of how a polygon was cut (Thürmer and Wüthrich,
//! "Computing Vertex Normals from Polygonal Facets", 1998), the area lets large flat faces keep their shape
//! beside small bevels. Sums run in the order of the triangles, so they are reproducible.

use glam::Vec3;

/// Smooth unit normals of a triangle list, one a vertex. Vertices without a face of positive area
/// point up. Indices must be in range.
pub fn smooth_normals(positions: &[Vec3], indices: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; positions.len()];
    for triangle in indices {
        let corners = triangle.map(|i| positions[i as usize]);
        let weighted = corner_normals(corners);
        for (&index, normal) in triangle.iter().zip(weighted) {
            sums[index as usize] += normal;
        }
    }
    for sum in &mut sums {
        *sum = unit_or(*sum, Vec3::Y);
    }
    sums
}

/// What a triangle adds to the normals at its corners: its unit normal by area and angle. Zero for
/// triangles without area and for corners that are not finite.
#[inline]
pub(crate) fn corner_normals([a, b, c]: [Vec3; 3]) -> [Vec3; 3] {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    // Half the length of the cross product is the area; the factor is common to all.
    let weighted = ab.cross(-ca);
    let lengths = [ab.length(), bc.length(), ca.length()];
    let result = [
        weighted * angle_between(ab, -ca, lengths[0] * lengths[2]),
        weighted * angle_between(bc, -ab, lengths[1] * lengths[0]),
        weighted * angle_between(ca, -bc, lengths[2] * lengths[1]),
    ];
    if result.iter().all(|n| n.is_finite()) { result } else { [Vec3::ZERO; 3] }
}

/// The angle in radians between two edges of a corner.
#[inline]
pub(crate) fn corner_angle(p: Vec3, q: Vec3) -> f32 {
    angle_between(p, q, p.length() * q.length())
}

/// The angle between two edges whose lengths' product is given.
#[inline]
fn angle_between(p: Vec3, q: Vec3, lengths: f32) -> f32 {
    let cosine = p.dot(q) / lengths.max(f32::MIN_POSITIVE);
    // Abramowitz and Stegun 4.4.45: |error| ≤ 7e-5, plenty for a weight.
    let x = cosine.abs().min(1.0);
    let root = (1.0 - x).sqrt();
    let acos = root * (1.5707288 + x * (-0.2121144 + x * (0.0742610 - 0.0187293 * x)));
    if cosine < 0.0 { std::f32::consts::PI - acos } else { acos }
}

/// `v` as a unit vector, or `fallback` where it has no direction. Scales first, so that neither tiny nor
/// huge vectors are lost.
#[inline]
pub(crate) fn unit_or(v: Vec3, fallback: Vec3) -> Vec3 {
    let largest = v.abs().max_element();
    if largest > 0.0 && v.is_finite() { (v / largest).normalize() } else { fallback }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_has_diagonal_normals_however_its_faces_are_cut() {
        let positions: Vec<Vec3> = (0..8)
            .map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32))
            .collect();
        let quads =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        for flip in 0..64_u32 {
            let indices: Vec<[u32; 3]> = quads
                .iter()
                .enumerate()
                .flat_map(|(i, &[a, b, c, d])| {
                    if flip >> i & 1 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
                })
                .collect();
            for (p, n) in positions.iter().zip(smooth_normals(&positions, &indices)) {
                let diagonal = (*p - Vec3::splat(0.5)).normalize();
                assert!(n.dot(diagonal) > 0.9999, "{n} {diagonal}");
            }
        }
    }

    #[test]
    fn normals_are_unit_for_tiny_huge_and_degenerate_meshes() {
        for scale in [1e-18, 1e-6, 1.0, 1e6, 1e12] {
            let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * scale);
            let normals = smooth_normals(&positions, &[[0, 1, 2], [0, 2, 3], [1, 1, 2]]);
            assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-5), "{scale} {normals:?}");
            assert!(normals[1].dot(Vec3::Z) > 0.999);
        }
        let broken = [Vec3::splat(f32::NAN), Vec3::splat(f32::INFINITY), Vec3::ZERO];
        assert_eq!(smooth_normals(&broken, &[[0, 1, 2]]), [Vec3::Y; 3]);
    }

    #[test]
    fn angles_are_close() {
        for i in 0..=100 {
            let angle = i as f32 * std::f32::consts::PI / 100.0;
            let q = Vec3::new(angle.cos(), angle.sin(), 0.0) * 3.0;
            assert!((angle_between(Vec3::X * 2.0, q, 6.0) - angle).abs() < 2e-3, "{angle}");
        }
    }
}
