//! One tile's share of a pass: batches of samples in, sums in the film out.

use rayburst_image::FilmTile;

use crate::{
    RayCounts,
    aov::MAX_VALUES,
    batch::{Batch, Context},
    integrators::Scratch,
};

/// Samples in a batch: enough for long queues, few enough that their state stays in the cache.
const BATCH: usize = 2048;

/// What a thread keeps from tile to tile.
#[derive(Debug, Default)]
pub(crate) struct Worker {
    batch: Batch,
    scratch: Scratch,
}

impl Worker {
    /// Adds `samples` samples to each pixel of the tile; returns the rays that took.
    pub(crate) fn render(
        &mut self,
        context: &Context<'_>,
        tile: &mut FilmTile<'_>,
        samples: u32,
    ) -> RayCounts {
        let batch = &mut self.batch;
        batch.counts = RayCounts::default();
        // All pixels at once, a few samples at a time; then the rest of the samples.
        let at_once = (BATCH / tile.len().max(1)).clamp(1, samples.max(1) as usize) as u32;
        let mut left = samples;
        while left > 0 {
            let now = at_once.min(left);
            batch.generate(context, tile, 0..tile.len(), now);
            self.scratch.integrate(context, batch);
            store(context, batch, tile, now as usize);
            left -= now;
        }
        batch.counts
    }
}

/// Adds the batch's samples to the tile, each pixel's in their order.
fn store(context: &Context<'_>, batch: &Batch, tile: &mut FilmTile<'_>, samples: usize) {
    let mut values = [0.0; MAX_VALUES];
    for pixel in 0..tile.len() {
        for slot in pixel * samples..(pixel + 1) * samples {
            let mut count = 0;
            if let Some(features) = batch.features.get(slot) {
                for aov in &context.settings.aovs {
                    count += aov.values(features, &mut values[count..]);
                }
            }
            tile.add(pixel, batch.radiance[slot], &values[..count]);
        }
    }
}
