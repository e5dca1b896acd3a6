//! Daylight of the built-in scenes: a sky that pales towards the horizon, and a sun.

use std::sync::Arc;

use glam::Vec3;

use crate::{Environment, Light, LightKind, Scene, environment::EnvironmentMap, shapes::trig};

/// Rows of the sky's picture; it is the same in every column.
const ROWS: u32 = 512;
const COLUMNS: u32 = 8;

/// Radiances of a sky, cd/m².
pub(super) struct Gradient {
    pub(super) zenith: Vec3,
    pub(super) horizon: Vec3,
    /// Below the horizon.
    pub(super) ground: Vec3,
}

impl Gradient {
    /// A clear day.
    pub(super) const CLEAR: Self = Self {
        zenith: Vec3::new(1300.0, 2700.0, 6200.0),
        horizon: Vec3::new(6200.0, 7600.0, 9600.0),
        ground: Vec3::new(2300.0, 2100.0, 1800.0),
    };

    /// As an environment.
    pub(super) fn environment(&self) -> Environment {
        let mut texels = Vec::with_capacity((ROWS * COLUMNS) as usize);
        for row in 0..ROWS {
            // From the zenith, half a turn down.
            let (_, height) = trig::turn(2 * row + 1, 4 * ROWS);
            let radiance = if height >= 0.0 {
                // Air mass falls quickly above the horizon.
                let clear = 1.0 - (1.0 - height) * (1.0 - height) * (1.0 - height);
                self.horizon.lerp(self.zenith, clear)
            } else {
                // A soft edge hides the seam between the end of the ground and the sky.
                self.horizon.lerp(self.ground, (-height * 12.0).min(1.0))
            };
            texels.extend([radiance; COLUMNS as usize]);
        }
        Environment::Map(EnvironmentMap {
            texels: Arc::from(texels),
            size: (COLUMNS, ROWS),
            rotation: 0.0,
            intensity: 1.0,
        })
    }
}

/// Adds a clear sky and a sun that stands in the direction `towards_sun`.
pub(super) fn add_daylight(scene: &mut Scene, towards_sun: Vec3) {
    scene.environment = Some(Gradient::CLEAR.environment());
    scene.world_lights.push(Light {
        // 80 000 lx, warm against the sky.
        intensity: Vec3::new(88_000.0, 80_000.0, 66_000.0),
        kind: LightKind::Directional {
            direction: -towards_sun.normalize(),
            angular_radius: 0.004_65,
        },
    });
}
