//! A stylised sky: one colour at the horizon, another at the zenith.

use std::sync::Arc;

use glam::Vec3;

use crate::{Environment, environment::EnvironmentMap, shapes::trig};

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
