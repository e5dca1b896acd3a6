//! Cameras of the built-in scenes.

use glam::{Affine3A, Vec3};

use crate::{Camera, Projection, View};

/// A pinhole view from `eye` at `target`, +Y up, with a vertical field of view in degrees. In focus
/// at the target.
pub(super) fn view(name: &str, eye: Vec3, target: Vec3, fov_degrees: f32) -> View {
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let camera = Camera {
        transform: Affine3A::from_cols(
            right.into(),
            back.cross(right).into(),
            back.into(),
            eye.into(),
        ),
        projection: Projection::Perspective { fov: fov_degrees.to_radians() },
        aperture: 0.0,
        focus: eye.distance(target),
    };
    View { name: name.to_owned(), camera }
}

/// The view through a lens of a diameter, sharp at the distance of a point along the viewing
/// direction.
pub(super) fn with_lens(mut view: View, aperture: f32, sharp_at: Vec3) -> View {
    let inverse = view.camera.transform.inverse();
    view.camera.aperture = aperture;
    view.camera.focus = -inverse.transform_point3(sharp_at).z;
    view
}
