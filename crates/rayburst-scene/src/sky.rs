//! A clear sky with its sun, computed once into an environment map.
//!
//! Single scattering by molecules, ozone and aerosol along each view ray, with light that scatters
//! more than once added as an isotropic term that is summed as a geometric series. After Nishita,
//! Sirai, Tadamura, Nakamae: "Display of the Earth Taking into Account Atmospheric Scattering",
//! SIGGRAPH 1993, and Hillaire: "A Scalable and Production Ready Sky and Atmosphere Rendering
//! Technique", EGSR 2020 (section 5 for the series). Aerosol follows turbidity by Ångström's law as
//! in Preetham, Shirley, Smits: "A Practical Analytic Model for Daylight", SIGGRAPH 1999, appendix.
//!
//! Ours: a plain ground below the horizon that fades into it, and no sun in the picture: the sun is a
//! directional light. Distances are in kilometres here, radiances in cd/m².

use std::f32::consts::PI;

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::{Light, LightKind, environment::EnvironmentMap};

/// Radii of the ground and of the top of the atmosphere, km.
const GROUND: f32 = 6360.0;
const TOP: f32 = 6420.0;
/// Height of the viewer above the ground, km.
const EYE: f32 = 0.1;
/// Illuminance of the sun outside the atmosphere, lux.
const SOLAR_ILLUMINANCE: f32 = 128_000.0;
/// Half the angle under which the sun is seen, radians.
const SUN_ANGULAR_RADIUS: f32 = 0.004_65;
/// Scattering by molecules at sea level per km, for red, green and blue (680, 550, 440 nm).
const RAYLEIGH: Vec3 = Vec3::new(5.802e-3, 13.558e-3, 33.1e-3);
/// Absorption by ozone at its peak, per km.
const OZONE: Vec3 = Vec3::new(0.650e-3, 1.881e-3, 0.085e-3);
/// Heights over which molecules and aerosol thin out by e, km.
const RAYLEIGH_HEIGHT: f32 = 8.0;
const MIE_HEIGHT: f32 = 1.2;
/// Asymmetry of the aerosol's phase function.
const MIE_G: f32 = 0.8;
/// Fraction of light that aerosol scatters rather than absorbs.
const MIE_ALBEDO: f32 = 0.9;
/// Size of the baked map.
const SIZE: (u32, u32) = (512, 256);
/// How far below the horizon the ground has fully taken over, as the sine of the angle.
const HORIZON_FADE: f32 = 0.15;

/// A clear sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Unit vector towards the sun; +Y is up. Below the horizon there is dusk and no sunlight.
    pub sun_direction: Vec3,
    /// Haziness: 1 pure air, 2–3 clear, 6 hazy.
    pub turbidity: f32,
    /// Reflectance of the ground.
    pub ground_albedo: f32,
}

impl Default for Sky {
    /// A clear day, the sun about 45° high.
    fn default() -> Self {
        Self {
            sun_direction: Vec3::new(0.55, 0.75, 0.5).normalize(),
            turbidity: 2.0,
            ground_albedo: 0.2,
        }
    }
}

/// What the air is made of, and tables over height and angle.
struct Atmosphere {
    /// Aerosol extinction at the ground per km.
    mie: Vec3,
    ground_albedo: f32,
    transmittance: Grid,
    /// Light scattered more than once, per unit of scattering and of solar illuminance.
    multiple: Grid,
}

/// A table over height and the sine of elevation, linearly interpolated.
struct Grid {
    values: Vec<Vec3>,
    columns: usize,
    rows: usize,
}

impl Grid {
    fn new(columns: usize, rows: usize, at: impl Fn(f32, f32) -> Vec3 + Sync) -> Self {
        let values = (0..columns * rows)
            .into_par_iter()
            .map(|i| {
                let x = (i % columns) as f32 / (columns - 1) as f32;
                let y = (i / columns) as f32 / (rows - 1) as f32;
                at(Self::height(y), Self::sine(x))
            })
            .collect();
        Self { values, columns, rows }
    }

    /// More entries near the ground.
    fn height(y: f32) -> f32 {
        (TOP - GROUND) * y * y
    }

    /// More entries near the horizon.
    fn sine(x: f32) -> f32 {
        let s = 2.0 * x - 1.0;
        s * s.abs()
    }

    fn at(&self, height: f32, sine: f32) -> Vec3 {
        let y = (height.max(0.0) / (TOP - GROUND)).sqrt().min(1.0) * (self.rows - 1) as f32;
        let s = sine.clamp(-1.0, 1.0);
        let x = 0.5 * (s.abs().sqrt().copysign(s) + 1.0) * (self.columns - 1) as f32;
        let (i, j) = ((x as usize).min(self.columns - 2), (y as usize).min(self.rows - 2));
        let (fx, fy) = (x - i as f32, y - j as f32);
        let row = |j: usize| {
            let v = &self.values[j * self.columns + i..];
            v[0].lerp(v[1], fx)
        };
        row(j).lerp(row(j + 1), fy)
    }
}

/// Distance along a ray from `origin` to a sphere around the centre of the earth.
fn to_sphere(origin: Vec3, direction: Vec3, radius: f32) -> Option<f32> {
    let b = origin.dot(direction);
    let h = origin.length();
    let discriminant = b * b - (h - radius) * (h + radius);
    if discriminant < 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    [-b - root, -b + root].into_iter().find(|&t| t > 0.0)
}

fn rayleigh_phase(cos: f32) -> f32 {
    3.0 / (16.0 * PI) * (1.0 + cos * cos)
}

/// Cornette, Shanks: "Physically Reasonable Analytic Expression for the Single-Scattering Phase
/// Function", Applied Optics 1992.
fn mie_phase(cos: f32) -> f32 {
    let g2 = MIE_G * MIE_G;
    let k = 3.0 / (8.0 * PI) * (1.0 - g2) / (2.0 + g2);
    k * (1.0 + cos * cos) / (1.0 + g2 - 2.0 * MIE_G * cos).powf(1.5)
}

impl Atmosphere {
    fn new(sky: &Sky) -> Self {
        // Vertical optical depth of aerosol by Ångström's law: β λ^−1.3, λ in µm.
        let beta = (0.04608 * sky.turbidity - 0.04586).max(0.0);
        let depth = Vec3::new(0.68, 0.55, 0.44).map(|wavelength| beta * wavelength.powf(-1.3));
        let mut air = Self {
            mie: depth / MIE_HEIGHT,
            ground_albedo: sky.ground_albedo.clamp(0.0, 1.0),
            transmittance: Grid { values: Vec::new(), columns: 0, rows: 0 },
            multiple: Grid { values: Vec::new(), columns: 0, rows: 0 },
        };
        air.transmittance = Grid::new(128, 48, |height, sine| air.transmittance_of(height, sine));
        air.multiple = Grid::new(32, 16, |height, sine| air.multiple_of(height, sine));
        air
    }

    /// Scattering by molecules and by aerosol, and extinction, at a height.
    fn coefficients(&self, height: f32) -> (Vec3, Vec3, Vec3) {
        let rayleigh = RAYLEIGH * (-height / RAYLEIGH_HEIGHT).exp();
        let mie = self.mie * (-height / MIE_HEIGHT).exp();
        let ozone = OZONE * (1.0 - (height - 25.0).abs() / 15.0).max(0.0);
        (rayleigh, mie * MIE_ALBEDO, rayleigh + mie + ozone)
    }

    /// What reaches a height from outside; black behind the earth.
    fn transmittance_of(&self, height: f32, sine: f32) -> Vec3 {
        let origin = Vec3::Y * (GROUND + height.max(1e-3));
        let direction = Vec3::new((1.0 - sine * sine).max(0.0).sqrt(), sine, 0.0);
        if to_sphere(origin, direction, GROUND).is_some() {
            return Vec3::ZERO;
        }
        let length = to_sphere(origin, direction, TOP).unwrap_or(0.0);
        const STEPS: u32 = 64;
        let mut depth = Vec3::ZERO;
        for i in 0..STEPS {
            // Steps grow with the square, since air is thick where rays start.
            let (a, b) = (i as f32 / STEPS as f32, (i + 1) as f32 / STEPS as f32);
            let (a, b) = (a * a * length, b * b * length);
            let height = (origin + direction * (0.5 * (a + b))).length() - GROUND;
            depth += self.coefficients(height).2 * (b - a);
        }
        (-depth).exp()
    }

    /// Sunlight that arrives at a point.
    fn sunlight(&self, point: Vec3, sun: Vec3) -> Vec3 {
        let r = point.length();
        self.transmittance.at(r - GROUND, point.dot(sun) / r)
    }

    /// Integrates along a ray: light scattered once (with the true phase function or an isotropic
    /// one, plus what the ground reflects), and the fraction of an isotropic glow that arrives.
    fn march(&self, origin: Vec3, direction: Vec3, sun: Vec3, isotropic: bool) -> (Vec3, Vec3) {
        const STEPS: u32 = 48;
        let ground = to_sphere(origin, direction, GROUND);
        let Some(length) = ground.or_else(|| to_sphere(origin, direction, TOP)) else {
            return (Vec3::ZERO, Vec3::ZERO);
        };
        let cos = direction.dot(sun);
        let phases =
            if isotropic { [0.25 / PI, 0.25 / PI] } else { [rayleigh_phase(cos), mie_phase(cos)] };
        let (mut light, mut glow, mut through) = (Vec3::ZERO, Vec3::ZERO, Vec3::ONE);
        for i in 0..STEPS {
            let (a, b) = (i as f32 / STEPS as f32, (i + 1) as f32 / STEPS as f32);
            let (a, b) = (a * a * length, b * b * length);
            let point = origin + direction * (0.5 * (a + b));
            let height = point.length() - GROUND;
            let (rayleigh, mie, extinction) = self.coefficients(height);
            let step = (-extinction * (b - a)).exp();
            // The integral of the transmittance over the step.
            let share = (Vec3::ONE - step) / extinction.max(Vec3::splat(1e-9)) * through;
            let scattering = rayleigh + mie;
            let mut source = self.sunlight(point, sun) * (rayleigh * phases[0] + mie * phases[1]);
            if !isotropic {
                source += self.multiple.at(height, point.dot(sun) / point.length()) * scattering;
            }
            light += source * share;
            glow += scattering * share;
            through *= step;
        }
        if let Some(t) = ground {
            let point = origin + direction * t;
            let normal = point.normalize();
            let lit = self.sunlight(point + normal * 1e-2, sun) * normal.dot(sun).max(0.0);
            light += through * lit * (self.ground_albedo / PI);
        }
        (light, glow)
    }

    /// Light scattered twice or more, arriving evenly: second-order light L₂ over one minus the
    /// fraction f that each further order keeps.
    fn multiple_of(&self, height: f32, sine: f32) -> Vec3 {
        let origin = Vec3::Y * (GROUND + height.max(1e-2));
        let sun = Vec3::new((1.0 - sine * sine).max(0.0).sqrt(), sine, 0.0);
        const SIDE: u32 = 8;
        let (mut second, mut kept) = (Vec3::ZERO, Vec3::ZERO);
        for i in 0..SIDE * SIDE {
            let u = Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5) / SIDE as f32;
            let direction = rayburst_math::warp::uniform_sphere(u);
            let (light, glow) = self.march(origin, direction, sun, true);
            second += light;
            kept += glow;
        }
        let mean = 1.0 / (SIDE * SIDE) as f32;
        second * mean / (Vec3::ONE - kept * mean).max(Vec3::splat(0.05))
    }
}

impl Sky {
    /// The sky as an environment map in cd/m² and the sun as a directional light in lux.
    ///
    /// Takes about a tenth of a second. The sun is not in the map.
    pub fn bake(&self) -> (EnvironmentMap, Light) {
        let sun = self.sun_direction.normalize_or(Vec3::Y);
        let air = Atmosphere::new(self);
        let eye = Vec3::Y * (GROUND + EYE);
        let (width, height) = SIZE;
        let mut map =
            EnvironmentMap { texels: Vec::new().into(), size: SIZE, rotation: 0.0, intensity: 1.0 };
        let sunlight = air.sunlight(eye, sun) * SOLAR_ILLUMINANCE;
        let at = |x: u32, y: u32| {
            let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            map.direction_of(uv)
        };
        let above = |d: Vec3| air.march(eye, d, sun, false).0 * SOLAR_ILLUMINANCE;
        // The upper half, and the row at the horizon that the ground fades from.
        let mut rows: Vec<Vec<Vec3>> = (0..height / 2)
            .into_par_iter()
            .map(|y| (0..width).map(|x| above(at(x, y))).collect())
            .collect();
        // What the sky sheds on the ground.
        let texel = PI / height as f32 * (2.0 * PI / width as f32);
        let skylight: Vec3 = rows
            .iter()
            .enumerate()
            .map(|(y, row)| {
                let theta = (y as f32 + 0.5) / height as f32 * PI;
                row.iter().sum::<Vec3>() * (theta.sin() * theta.cos() * texel)
            })
            .sum();
        let ground = (skylight + sunlight * sun.y.max(0.0)) * (air.ground_albedo / PI);
        let horizon = rows[height as usize / 2 - 1].clone();
        for y in height / 2..height {
            let depth = -at(0, y).y;
            let t = (depth / HORIZON_FADE).clamp(0.0, 1.0);
            let t = t * t * (3.0 - 2.0 * t);
            rows.push(horizon.iter().map(|h| h.lerp(ground, t)).collect());
        }
        map.texels = rows.concat().into();
        let light = Light {
            intensity: sunlight,
            kind: LightKind::Directional { direction: -sun, angular_radius: SUN_ANGULAR_RADIUS },
        };
        (map, light)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance(c: Vec3) -> f32 {
        c.dot(Vec3::new(0.2126, 0.7152, 0.0722))
    }

    /// Illuminance of the upper half of a map on a horizontal plane, lux.
    fn illuminance(map: &EnvironmentMap) -> Vec3 {
        let (w, h) = map.size;
        let mut sum = Vec3::ZERO;
        for y in 0..h / 2 {
            let theta = (y as f32 + 0.5) / h as f32 * PI;
            let weight = theta.sin() * theta.cos() * (PI / h as f32) * (2.0 * PI / w as f32);
            for x in 0..w {
                sum += map.texels[(y * w + x) as usize] * weight;
            }
        }
        sum
    }

    #[test]
    fn a_clear_day_has_plausible_light() {
        let sky = Sky::default();
        let (map, sun) = sky.bake();
        assert!(map.texels.iter().all(|t| t.is_finite() && t.min_element() > 0.0));
        let from_sky = illuminance(&map);
        let (sky_lux, sun_lux) = (luminance(from_sky), luminance(sun.intensity));
        assert!((5_000.0..25_000.0).contains(&sky_lux), "{sky_lux}");
        assert!((60_000.0..105_000.0).contains(&sun_lux), "{sun_lux}");
        // Blue overhead, paler near the horizon; the sun is warmer than white.
        let zenith = map.texels[256];
        let horizon = map.texels[(126 * 512 + 10) as usize];
        assert!(zenith.z > 1.5 * zenith.x, "{zenith}");
        assert!(horizon.z / horizon.x < 0.8 * zenith.z / zenith.x, "{horizon}");
        assert!(sun.intensity.x > sun.intensity.z);
        let LightKind::Directional { direction, .. } = sun.kind else { panic!("not directional") };
        assert!((direction + sky.sun_direction).length() < 1e-6);
    }

    #[test]
    fn evenings_are_dim_and_red_and_nights_dark() {
        let at =
            |y: f32| Sky { sun_direction: Vec3::new(1.0, y, 0.0).normalize(), ..Sky::default() };
        let (evening, sun) = at(0.05).bake();
        assert!(sun.intensity.x > 3.0 * sun.intensity.z, "{}", sun.intensity);
        let (day, _) = Sky::default().bake();
        assert!(luminance(illuminance(&evening)) < 0.5 * luminance(illuminance(&day)));
        let (night, sun) = at(-0.5).bake();
        assert_eq!(sun.intensity, Vec3::ZERO);
        assert!(luminance(illuminance(&night)) < 100.0);
        assert!(night.texels.iter().all(|t| t.is_finite()));
    }

    #[test]
    fn haze_scatters_forward() {
        let clear = Sky { turbidity: 1.5, ..Sky::default() };
        let hazy = Sky { turbidity: 6.0, ..clear };
        let (a, sun_a) = clear.bake();
        let (b, sun_b) = hazy.bake();
        assert!(luminance(sun_b.intensity) < luminance(sun_a.intensity));
        let near = |m: &EnvironmentMap| {
            let uv = m.uv_of((clear.sun_direction + Vec3::Y * 0.1).normalize());
            let (x, y) = ((uv.x * 512.0) as usize, (uv.y * 256.0) as usize);
            luminance(m.texels[y * 512 + x])
        };
        assert!(near(&b) > near(&a));
    }
}
