//! What stands in where a scene says nothing: a view that fits its bounds, and daylight.

use glam::{DVec3, Vec3};
use rayburst_math::Aabb;

use crate::{Camera, Environment, Scene, View, sky::Sky};

/// Vertical field of view of the default view, degrees.
const FOV: f64 = 40.0;

/// How much of the picture the bounds may fill.
const FILL: f64 = 0.92;

/// A view of everything in `bounds` for pictures of an aspect ratio (width over height), from the
/// front, a little above and to the right. Flat bounds are seen from their broad side.
pub fn default_view(bounds: &Aabb, aspect: f32) -> View {
    let (centre, half) = centre_and_half_extents(bounds);
    let direction = direction_of_view(half);
    let up = Vec3::Y;

    // The frame of a camera that looks at the centre.
    let view = -direction;
    let right = view.cross(up.as_dvec3()).normalize();
    let upward = right.cross(view);
    let slope = (FOV.to_radians() * 0.5).tan() * FILL;
    let aspect = if aspect.is_finite() && aspect > 0.0 { f64::from(aspect) } else { 1.0 };
    // The nearest distance from which each corner lies inside the picture.
    let distance = (0..8)
        .map(|i| {
            let sign = |bit: i32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let corner = half * DVec3::new(sign(0), sign(1), sign(2));
            let across = corner.dot(right).abs() / (slope * aspect);
            let along = corner.dot(upward).abs() / slope;
            across.max(along) - corner.dot(view)
        })
        .fold(0.0, f64::max);
    let eye = (centre + direction * distance).as_vec3();
    let camera = Camera::look_at(eye, centre.as_vec3(), up, FOV.to_radians() as f32);
    View { name: "default".to_owned(), camera }
}

/// One line that says where the default view looks from, and how to choose another.
pub fn describe_view(view: &View) -> String {
    let eye = view.camera.eye();
    let target = eye + view.camera.frame()[2] * view.camera.focus;
    format!(
        "no camera in the scene: looking from {:.4},{:.4},{:.4} at {:.4},{:.4},{:.4} \
         (--eye and --target choose another view)",
        eye.x, eye.y, eye.z, target.x, target.y, target.z
    )
}

/// What the default daylight is dimmed by: the ground then lies under an illuminance of about π, and
/// white surfaces have a radiance of about 1.
const DEFAULT_DIMMING: f32 = std::f32::consts::PI / 80_000.0;

/// Adds a sky with its sun if nothing shines and the scene does not ask for darkness
/// ([`Environment::None`]). Returns what to say then.
///
/// The daylight is not as bright as the sun: files without lights give the strength of what glows in
/// them relative to the white of a screen.
pub fn default_light(scene: &mut Scene) -> Option<&'static str> {
    if scene.environment.is_some() || scene.has_light() {
        return None;
    }
    let (mut map, mut sun) = Sky::default().bake();
    map.intensity *= DEFAULT_DIMMING;
    sun.intensity *= DEFAULT_DIMMING;
    scene.environment = Some(Environment::Map(map));
    scene.world_lights.push(sun);
    Some("no light in the scene: a sky with a sun lights it (--environment chooses another)")
}

/// In double precision, so that bounds far from the origin or near the largest number keep their
/// size. Bounds without extent get one that fits their distance from the origin.
fn centre_and_half_extents(bounds: &Aabb) -> (DVec3, DVec3) {
    if bounds.is_empty() || !bounds.lower.is_finite() || !bounds.upper.is_finite() {
        return (DVec3::ZERO, DVec3::ONE);
    }
    let (lower, upper) = (bounds.lower.as_dvec3(), bounds.upper.as_dvec3());
    let (centre, half) = ((lower + upper) * 0.5, (upper - lower) * 0.5);
    // Nearer than this, eye and centre would round to the same place.
    let smallest = (centre.length() * 1e-4).max(f64::from(f32::MIN_POSITIVE) * 1e4);
    if half.max_element() >= smallest {
        return (centre, half);
    }
    (centre, DVec3::splat(if centre == DVec3::ZERO { 1.0 } else { smallest }))
}

/// Unit direction from the centre to the eye.
fn direction_of_view(half: DVec3) -> DVec3 {
    let thin = 0.1;
    let direction = if half.z < thin * half.x.min(half.y) {
        // A picture on a wall.
        DVec3::new(0.25, 0.15, 1.0)
    } else if half.x < thin * half.y.min(half.z) {
        DVec3::new(1.0, 0.15, 0.25)
    } else if half.y < thin * half.x.min(half.z) {
        // A floor.
        DVec3::new(0.4, 0.9, 0.9)
    } else {
        DVec3::new(0.55, 0.45, 1.0)
    };
    direction.normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Light, LightKind};

    fn assert_fits(bounds: Aabb, aspect: f32) {
        let view = default_view(&bounds, aspect);
        let size = ((500.0 * aspect) as u32, 500);
        let (mut lower, mut upper) = (glam::Vec2::INFINITY, glam::Vec2::NEG_INFINITY);
        for i in 0..8 {
            let pick = |bit: i32, axis: usize| {
                if i >> bit & 1 == 0 { bounds.lower[axis] } else { bounds.upper[axis] }
            };
            let corner = Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2));
            let (pixel, _) = view.camera.project(corner, size).expect("in front of the camera");
            lower = lower.min(pixel);
            upper = upper.max(pixel);
        }
        let size = glam::Vec2::new(size.0 as f32, size.1 as f32);
        assert!(lower.min_element() >= 0.0 && (upper - size).max_element() <= 0.0, "{bounds:?}");
        assert!(((upper - lower) / size).max_element() > 0.5, "{bounds:?} {lower} {upper}");
    }

    #[test]
    fn bounds_fill_the_picture_and_stay_inside() {
        let shapes = [
            Vec3::ONE,
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::new(0.0, 1.0, 1.0),
            Vec3::new(1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.001, 1.0),
            Vec3::new(0.01, 0.01, 5.0),
            Vec3::new(30.0, 12.0, 18.0),
            Vec3::new(0.0, 3.0, 0.0),
        ];
        for half in shapes {
            for scale in [1e-6, 1.0, 1e6] {
                for aspect in [0.5, 1.0, 16.0 / 9.0] {
                    let half = half * scale;
                    assert_fits(Aabb { lower: -half, upper: half }, aspect);
                    let centre = Vec3::new(20.0, -5.0, 3.0) * half.max_element();
                    assert_fits(Aabb { lower: centre - half, upper: centre + half }, aspect);
                }
            }
        }
    }

    #[test]
    fn degenerate_bounds_still_have_a_view() {
        let points = [Vec3::ZERO, Vec3::splat(1e6), Vec3::new(0.0, 1e-30, 0.0), Vec3::splat(1e30)];
        let boxes = points.map(Aabb::of_point).into_iter().chain([
            Aabb::EMPTY,
            Aabb { lower: Vec3::splat(-3e38), upper: Vec3::splat(3e38) },
            Aabb { lower: Vec3::splat(-1.0), upper: Vec3::splat(f32::INFINITY) },
        ]);
        for bounds in boxes {
            let camera = default_view(&bounds, 1.5).camera;
            assert!(camera.focus > 0.0, "{bounds:?}");
            assert!(camera.transform.matrix3.determinant() > 0.99, "{bounds:?}");
        }
        assert!(default_view(&Aabb::EMPTY, f32::NAN).camera.eye().is_finite());
    }

    #[test]
    fn daylight_comes_only_into_the_dark() {
        let mut dark = Scene::default();
        assert!(default_light(&mut dark).is_some());
        assert!(matches!(dark.environment, Some(Environment::Map(_))));
        assert_eq!(dark.world_lights.len(), 1);
        assert!(default_light(&mut dark).is_none());

        let mut night = Scene { environment: Some(Environment::None), ..Scene::default() };
        assert!(default_light(&mut night).is_none());
        let lamp = Light { intensity: Vec3::ONE, kind: LightKind::Point { position: Vec3::ZERO } };
        let mut lit = Scene { world_lights: vec![lamp], ..Scene::default() };
        assert!(default_light(&mut lit).is_none() && lit.environment.is_none());
    }

    #[test]
    fn the_description_names_eye_and_target() {
        let view = default_view(&Aabb { lower: Vec3::ZERO, upper: Vec3::splat(2.0) }, 1.0);
        let text = describe_view(&view);
        assert!(text.contains("at 1.0000,1.0000,1.0000"), "{text}");
    }
}
