//! From where the scene is seen: the scene's cameras, the options, or a view that fits.

use std::f32::consts::FRAC_PI_4;

use rayburst::{
    glam::{Affine3A, Mat3A, Vec3},
    math::Aabb,
    scene::{Camera, Pose, Projection, Scene},
};

use crate::{
    args::scene::CameraArgs,
    error::{CliError, Result},
    load::pick,
    terminal,
};

/// The focus of cameras that do not say what they focus on.
const UNKNOWN: f32 = 0.0;

/// All cameras of a posed scene with their names: views first, then those that nodes place.
pub(crate) fn all(scene: &Scene, pose: &Pose) -> Vec<(String, Camera)> {
    let views = scene.views.iter().map(|v| (v.name.clone(), v.camera));
    let placed = scene.nodes.iter().zip(&pose.world).filter_map(|(node, world)| {
        let camera = &scene.cameras[node.camera? as usize];
        let name = if camera.name.is_empty() { &node.name } else { &camera.name };
        let transform = rigid(world)?;
        let camera =
            Camera { transform, projection: camera.projection, aperture: 0.0, focus: UNKNOWN };
        Some((name.clone(), camera))
    });
    views.chain(placed).collect()
}

/// A transform without scale and shear; `None` if it flattens space.
fn rigid(world: &Affine3A) -> Option<Affine3A> {
    let back = Vec3::from(world.matrix3.z_axis).try_normalize()?;
    let up = Vec3::from(world.matrix3.y_axis);
    let right = up.cross(back).try_normalize()?;
    let up = back.cross(right);
    Some(Affine3A {
        matrix3: Mat3A::from_cols(right.into(), up.into(), back.into()),
        translation: world.translation,
    })
}

/// The camera that the options ask for.
pub(crate) fn choose(
    scene: &Scene,
    pose: &Pose,
    bounds: &Aabb,
    size: (u32, u32),
    args: &CameraArgs,
) -> Result<Camera> {
    let all = all(scene, pose);
    let base = match (&args.camera, all.first()) {
        (Some(given), _) => {
            let names: Vec<&str> = all.iter().map(|(name, _)| name.as_str()).collect();
            Some(all[pick("camera", given, &names)?].1)
        }
        (None, first) => first.map(|(_, camera)| *camera),
    };
    let camera = match base {
        Some(camera) => camera,
        None => {
            let aspect = size.0 as f32 / size.1 as f32;
            let framed = rayburst::scene::framing::default_view(bounds, aspect).camera;
            if args.eye.is_none() {
                terminal::note(format!(
                    "the scene has no camera: --eye {} --target {} fits it",
                    shown(framed.eye()),
                    shown(framed.eye() + framed.focus * framed.frame()[2]),
                ));
            }
            framed
        }
    };
    adjust(camera, base.is_some(), bounds, scene.metres_per_unit, args)
}

/// The camera with the options' changes.
fn adjust(
    mut camera: Camera,
    own: bool,
    bounds: &Aabb,
    metres_per_unit: f32,
    args: &CameraArgs,
) -> Result<Camera> {
    if args.eye.is_some() || args.target.is_some() || args.up.is_some() {
        let [_, up, ahead] = camera.frame();
        let eye = args.eye.unwrap_or(camera.eye());
        let centre = if bounds.is_empty() { Vec3::ZERO } else { bounds.centre() };
        let target = match (args.target, args.eye) {
            (Some(target), _) => target,
            // A new place looks where the camera looked, or at the scene.
            (None, Some(_)) if !own => centre,
            (None, Some(_)) => eye + ahead * if camera.focus > 0.0 { camera.focus } else { 1.0 },
            (None, None) => eye + ahead,
        };
        if eye == target {
            return Err(CliError::usage("--eye and --target are the same point"));
        }
        let up = args.up.unwrap_or(if args.eye.is_some() { Vec3::Y } else { up });
        if up == Vec3::ZERO {
            return Err(CliError::usage("--up must not be zero"));
        }
        let fov = match camera.projection {
            Projection::Perspective { fov } => fov,
            Projection::Orthographic { .. } => FRAC_PI_4,
        };
        let looking = Camera::look_at(eye, target, up, fov);
        let projection = match camera.projection {
            Projection::Orthographic { .. } => camera.projection,
            Projection::Perspective { .. } => looking.projection,
        };
        camera = Camera { aperture: camera.aperture, projection, ..looking };
    }
    if camera.focus == UNKNOWN {
        let depth = (bounds.centre() - camera.eye()).dot(camera.frame()[2]);
        camera.focus = if depth > 0.0 { depth } else { 1.0 };
    }
    if let Some(degrees) = args.fov {
        camera.projection = Projection::Perspective { fov: degrees.to_radians() };
    }
    let units = 1.0 / if metres_per_unit > 0.0 { metres_per_unit } else { 1.0 };
    if let Some(metres) = args.aperture {
        camera.aperture = metres * units;
    }
    if let Some(metres) = args.focus {
        camera.focus = metres * units;
    }
    Ok(camera)
}

fn shown(p: Vec3) -> String {
    format!("{},{},{}", tidy(p.x), tidy(p.y), tidy(p.z))
}

fn tidy(x: f32) -> String {
    let digits = (3 - x.abs().max(1e-6).log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_move_a_camera() {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::new(0.0, 0.0, -5.0), Vec3::Y, 1.0);
        let bounds = Aabb { lower: Vec3::splat(-1.0), upper: Vec3::ONE };
        let args = CameraArgs {
            eye: Some(Vec3::new(4.0, 0.0, 0.0)),
            target: Some(Vec3::ZERO),
            fov: Some(90.0),
            aperture: Some(0.5),
            focus: Some(2.0),
            ..CameraArgs::default()
        };
        let moved = adjust(camera, true, &bounds, 0.5, &args).unwrap();
        assert!((moved.frame()[2] + Vec3::X).length() < 1e-6);
        assert_eq!((moved.aperture, moved.focus), (1.0, 4.0));
        let same = CameraArgs { target: Some(Vec3::ZERO), ..CameraArgs::default() };
        assert!(adjust(camera, true, &bounds, 1.0, &same).is_err());
    }

    #[test]
    fn a_camera_without_a_focus_takes_the_middle_of_the_scene() {
        let bounds = Aabb { lower: Vec3::new(-1.0, -1.0, -7.0), upper: Vec3::new(1.0, 1.0, -5.0) };
        let camera = Camera::look_at(Vec3::ZERO, -Vec3::Z, Vec3::Y, 1.0);
        let unknown = Camera { focus: UNKNOWN, ..camera };
        let with = |camera| adjust(camera, true, &bounds, 1.0, &CameraArgs::default()).unwrap();
        assert_eq!(with(unknown).focus, 6.0);
        assert_eq!(with(camera).focus, 1.0);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!(tidy(12.34567), "12.35");
        assert_eq!(tidy(-2.0), "-2");
        assert_eq!(tidy(0.012345), "0.01235");
        assert_eq!(tidy(12345.6), "12346");
    }
}
