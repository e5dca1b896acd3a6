//! View files, `NAME.view.json` beside a scene: cameras, light and exposure for scenes that bring none.
//!
//! ```json
//! {
//!   "metres_per_unit": 0.001,
//!   "cameras": [{ "name": "door", "eye": [7750, 1032, -9630], "target": [10025, 1032, -6131],
//!                 "up": [0, 1, 0], "fov": 80, "aperture": 25, "focus": 4000 }],
//!   "environment": "sky",
//!   "sun": { "direction": [0.25, -1, 0.12], "illuminance": 100000 },
//!   "lights": [{ "type": "spot", "position": [0, 2000, 0], "direction": [0, -1, 0],
//!                "intensity": 300, "color": [1, 0.9, 0.8], "inner": 20, "outer": 35 }],
//!   "exposure": "auto"
//! }
//! ```
//! Lengths (positions, `aperture`, `focus`) are in the scene's own units, angles in degrees: `fov` is
//! the full vertical one, `inner` and `outer` are a spot's half angles. `environment` is `sky`, `none`
//! or a picture (.hdr, .exr) relative to the view file. Directions are those in which light travels.
//! `illuminance`, and the `intensity` of directional lights, is in lux; other intensities are in
//! candela.
//!
//! Candela are lumens per steradian, and a lux is a lumen per *square metre*: a lamp of I cd makes
//! E = I / (d m)² lux at a distance of d units of m metres. Rendering computes E = I′ / d², so the
//! intensity that is stored is I′ = I / m². Lux and emitted radiance do not depend on the unit.

mod fields;

use std::path::Path;

use glam::Vec3;
use rayburst_image::colour::luminance;
use serde_json::Value;

use super::{ImportError, environment::load_environment, read_limited};
use crate::{Camera, Environment, Light, LightKind, Scene, View, sky::Sky};
use fields::{Fields, nearest};

/// The place of the outermost object.
const ROOT: &str = "the view";

/// Most bytes of a view file.
const MAX_BYTES: u64 = 16 << 20;

/// Illuminance of a sun that does not say it, lux.
const SUN_ILLUMINANCE: f32 = 100_000.0;

/// Half the angle under which the sun is seen, radians.
const SUN_ANGULAR_RADIUS: f32 = 0.004_65;

/// Reads a view file into a scene: its cameras come first, its lights are added, its environment,
/// exposure and unit take the place of the scene's. Nothing is changed when it is in error.
pub fn apply_view(scene: &mut Scene, path: &Path) -> Result<(), ImportError> {
    let bytes =
        read_limited(path, MAX_BYTES).map_err(|e| ImportError::unresolved(path, "the file", e))?;
    let value: Value = serde_json::from_slice(&bytes).map_err(|e| {
        let text = e.to_string();
        let reason = text.split(" at line ").next().unwrap_or(&text);
        ImportError::malformed(path, format!("line {} column {}", e.line(), e.column()), reason)
    })?;
    let known = ["metres_per_unit", "cameras", "environment", "sun", "lights", "exposure"];
    let root = Fields::new(path, ROOT, &value, &known)?;

    let metres = root.number_where("metres_per_unit", "above 0", |x| x > 0.0)?;
    let metres_per_unit = metres.unwrap_or(scene.metres_per_unit);
    let views = read_cameras(path, &root)?;
    let lights = read_lights(path, &root, metres_per_unit)?;
    let sun = read_sun(path, &root)?;
    let exposure = read_exposure(&root)?;
    let (environment, warning) = read_environment(path, &root, sun.as_ref())?;

    scene.metres_per_unit = metres_per_unit;
    scene.views.splice(0..0, views);
    scene.world_lights.extend(lights);
    match environment {
        Some((environment, sky_sun)) => {
            scene.environment = Some(environment);
            scene.world_lights.extend(sky_sun.or(sun.map(Sun::light)));
        }
        None => scene.world_lights.extend(sun.map(Sun::light)),
    }
    if let Some(exposure) = exposure {
        scene.exposure = exposure;
    }
    scene.warnings.extend(warning);
    Ok(())
}

fn read_cameras(path: &Path, root: &Fields<'_>) -> Result<Vec<View>, ImportError> {
    let known = ["name", "eye", "target", "up", "fov", "aperture", "focus"];
    let read = |(number, (place, value)): (usize, (String, &Value))| {
        let fields = Fields::new(path, &place, value, &known)?;
        let name = fields.text("name")?.map_or_else(|| number.to_string(), str::to_owned);
        let eye = fields.required("eye", fields.vector("eye")?)?;
        let target = fields.required("target", fields.vector("target")?)?;
        if eye == target {
            return fields.error("target", "must not be the same point as eye");
        }
        let up = fields.direction("up")?.unwrap_or(Vec3::Y);
        let fov = fields.number_where("fov", "above 0 and below 180", |x| x > 0.0 && x < 180.0)?;
        let mut camera = Camera::look_at(eye, target, up, fov.unwrap_or(45.0).to_radians());
        let aperture = fields.number_where("aperture", "at least 0", |x| x >= 0.0)?;
        camera.aperture = aperture.unwrap_or(0.0);
        if let Some(focus) = fields.number_where("focus", "above 0", |x| x > 0.0)? {
            camera.focus = focus;
        }
        Ok(View { name, camera })
    };
    root.list("cameras")?.into_iter().enumerate().map(read).collect()
}

fn read_lights(
    path: &Path,
    root: &Fields<'_>,
    metres_per_unit: f32,
) -> Result<Vec<Light>, ImportError> {
    let known = ["type", "position", "direction", "intensity", "color", "inner", "outer"];
    let types = ["point", "spot", "directional"];
    let read = |(place, value): (String, &Value)| {
        let fields = Fields::new(path, &place, value, &known)?;
        let kind = fields.required("type", fields.text("type")?)?;
        let not_negative = |x: f32| x >= 0.0;
        let intensity = fields.number_where("intensity", "at least 0", not_negative)?;
        let intensity = fields.required("intensity", intensity)?;
        let color = fields.vector("color")?.unwrap_or(Vec3::ONE);
        if color.min_element() < 0.0 {
            return fields.error("color", "must not be negative");
        }
        let position = || fields.required("position", fields.vector("position")?);
        let direction = || fields.required("direction", fields.direction("direction")?);
        let kind = match kind {
            "point" => LightKind::Point { position: position()? },
            "spot" => {
                let angle = |name: &str| {
                    fields.number_where(name, "from 0 to 90", |x| (0.0..=90.0).contains(&x))
                };
                let outer = angle("outer")?.unwrap_or(45.0);
                let inner = angle("inner")?.unwrap_or(0.0).min(outer);
                LightKind::Spot {
                    position: position()?,
                    direction: direction()?,
                    cos_inner: inner.to_radians().cos(),
                    cos_outer: outer.to_radians().cos(),
                }
            }
            "directional" => {
                LightKind::Directional { direction: direction()?, angular_radius: 0.0 }
            }
            other => {
                let reason = format!(
                    "unknown type '{other}', did you mean '{}'? Known types: {}",
                    nearest(other, &types),
                    types.join(", ")
                );
                return fields.error("type", reason);
            }
        };
        let scale = match kind {
            LightKind::Directional { .. } => 1.0,
            _ => 1.0 / (f64::from(metres_per_unit) * f64::from(metres_per_unit)),
        };
        let intensity = color * (f64::from(intensity) * scale) as f32;
        if !intensity.is_finite() {
            return fields.error("intensity", "is too large for this metres_per_unit");
        }
        Ok(Light { intensity, kind })
    };
    root.list("lights")?.into_iter().map(read).collect()
}

/// The sun of a view.
#[derive(Clone, Copy, Debug)]
struct Sun {
    /// Unit vector, the way light travels.
    direction: Vec3,
    illuminance: Option<f32>,
}

impl Sun {
    /// White light, for a sun without a sky.
    fn light(self) -> Light {
        let kind = LightKind::Directional {
            direction: self.direction,
            angular_radius: SUN_ANGULAR_RADIUS,
        };
        Light { intensity: Vec3::splat(self.illuminance.unwrap_or(SUN_ILLUMINANCE)), kind }
    }
}

fn read_sun(path: &Path, root: &Fields<'_>) -> Result<Option<Sun>, ImportError> {
    let Some(value) = root.get("sun") else { return Ok(None) };
    let fields = Fields::new(path, "sun", value, &["direction", "illuminance"])?;
    let direction = fields.required("direction", fields.direction("direction")?)?;
    let illuminance = fields.number_where("illuminance", "at least 0", |x| x >= 0.0)?;
    Ok(Some(Sun { direction, illuminance }))
}

/// `Some(None)` is automatic.
fn read_exposure(root: &Fields<'_>) -> Result<Option<Option<f32>>, ImportError> {
    match root.get("exposure") {
        None => Ok(None),
        Some(Value::String(text)) if text == "auto" => Ok(Some(None)),
        Some(Value::Number(_)) => Ok(Some(root.number("exposure")?)),
        Some(_) => root.wrong("exposure", "a number of stops or \"auto\""),
    }
}

type ReadEnvironment = (Option<(Environment, Option<Light>)>, Option<String>);

/// The environment, the sun of a sky, and a warning.
fn read_environment(
    path: &Path,
    root: &Fields<'_>,
    sun: Option<&Sun>,
) -> Result<ReadEnvironment, ImportError> {
    match root.text("environment")? {
        None => Ok((None, None)),
        Some("none") => Ok((Some((Environment::None, None)), None)),
        Some("sky") => {
            let sky = match sun {
                Some(sun) => Sky { sun_direction: -sun.direction, ..Sky::default() },
                None => Sky::default(),
            };
            let (map, mut light) = sky.bake();
            if let Some(sun) = sun {
                // The view's brightness in the colour that the air leaves.
                let baked = luminance(light.intensity);
                if let Some(illuminance) = sun.illuminance {
                    let color = if baked > 0.0 { light.intensity / baked } else { Vec3::ONE };
                    light.intensity = color * illuminance;
                }
            }
            Ok((Some((Environment::Map(map), Some(light))), None))
        }
        Some(file) => {
            let written = file.replace('\\', "/");
            let relative = Path::new(&written);
            let extension = relative.extension().and_then(|e| e.to_str()).unwrap_or("");
            let is_picture = ["hdr", "exr"].iter().any(|e| extension.eq_ignore_ascii_case(e));
            if !is_picture {
                let reason = format!("must be sky, none or a .hdr or .exr file, not '{file}'");
                return root.error("environment", reason);
            }
            if relative.is_absolute() || written.contains(':') {
                let reason = format!("'{file}' must be a path relative to the view file");
                return root.error("environment", reason);
            }
            let folder = path.parent().unwrap_or(Path::new(""));
            let (map, warning) = load_environment(&folder.join(relative))?;
            Ok((Some((Environment::Map(map), None)), warning))
        }
    }
}
