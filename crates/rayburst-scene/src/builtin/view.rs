//! Cameras of the built-in scenes.

use glam::Vec3;

use crate::{Camera, View};

/// A pinhole view from `eye` at `target`, +Y up, with a vertical field of view in degrees. In focus
/// at the target.
pub(super) fn view(name: &str, eye: Vec3, target: Vec3, fov_degrees: f32) -> View {
    let camera = Camera::look_at(eye, target, Vec3::Y, fov_degrees.to_radians());
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
