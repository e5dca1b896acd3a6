//! The mean of several frames of one instant; the last of them where filters average.

use rayburst::{
    glam::DVec3,
    image::{Layer, RgbImage},
    render::realtime::{Frame, FrameLayer, Merge},
};

/// Sums of frames.
pub(super) struct Mean {
    size: (u32, u32),
    /// Whether the picture is the last frame's.
    last: bool,
    frames: u32,
    picture: Vec<DVec3>,
    layers: Vec<LayerSum>,
}

/// A layer, and where its frames have a mean the sums of its channels.
struct LayerSum {
    layer: FrameLayer,
    /// Of the frames.
    size: (u32, u32),
    first: Option<Layer>,
    sums: Vec<Vec<f64>>,
}

impl Mean {
    /// Nothing yet, of a size.
    pub(super) fn new(size: (u32, u32), last: bool, layers: &[FrameLayer]) -> Self {
        let pixels = size.0 as usize * size.1 as usize;
        let layers = layers.iter().map(|&layer| LayerSum {
            layer,
            size: (0, 0),
            first: None,
            sums: Vec::new(),
        });
        Self { size, last, frames: 0, picture: vec![DVec3::ZERO; pixels], layers: layers.collect() }
    }

    /// Frames so far.
    pub(super) fn frames(&self) -> u32 {
        self.frames
    }

    /// Adds a frame.
    pub(super) fn add(&mut self, frame: &Frame<'_>) {
        let width = self.size.0 as usize;
        let [r, g, b] = &frame.picture.channels;
        for (sums, y) in self.picture.chunks_mut(width.max(1)).zip(0..) {
            let colours = r.row(y).iter().zip(g.row(y)).zip(b.row(y));
            for (sum, ((&r, &g), &b)) in sums.iter_mut().zip(colours) {
                let before = if self.last { DVec3::ZERO } else { *sum };
                *sum = before + DVec3::new(r.into(), g.into(), b.into());
            }
        }
        for sum in &mut self.layers {
            sum.add(frame);
        }
        self.frames += 1;
    }

    /// The picture.
    pub(super) fn picture(&self) -> RgbImage {
        let scale = if self.last { 1.0 } else { 1.0 / f64::from(self.frames.max(1)) };
        let pixels = self.picture.iter().map(|sum| (*sum * scale).as_vec3()).collect();
        RgbImage { width: self.size.0, height: self.size.1, pixels }
    }

    /// The other layers.
    pub(super) fn layers(&self) -> impl Iterator<Item = Layer> {
        let finished = |sum: &LayerSum| {
            let layer = sum.finished(self.frames)?;
            Some(if sum.size == self.size { layer } else { stretch(layer, sum.size, self.size) })
        };
        self.layers.iter().filter_map(finished)
    }
}

/// A layer of another size, whose pixels take the values of those at the same place.
fn stretch(mut layer: Layer, from: (u32, u32), to: (u32, u32)) -> Layer {
    let place = |at: u32, from: u32, to: u32| {
        (u64::from(at) * u64::from(from) / u64::from(to.max(1))) as usize
    };
    for channel in &mut layer.channels {
        let row = |y: u32| {
            let first = place(y, from.1, to.1) * from.0 as usize;
            (0..to.0).map(move |x| first + place(x, from.0, to.0))
        };
        let values = (0..to.1).flat_map(row).map(|at| channel.values[at]).collect();
        channel.values = values;
    }
    layer
}

impl LayerSum {
    fn add(&mut self, frame: &Frame<'_>) {
        self.size = frame.gbuffer.size();
        let Some(first) = &self.first else {
            self.first = Some(self.layer.layer(frame));
            return;
        };
        if self.layer.merge() == Merge::First {
            return;
        }
        if self.sums.is_empty() {
            let widened = |values: &Vec<f32>| values.iter().map(|&v| f64::from(v)).collect();
            self.sums = first.channels.iter().map(|c| widened(&c.values)).collect();
        }
        for (sums, channel) in self.sums.iter_mut().zip(self.layer.layer(frame).channels) {
            for (sum, value) in sums.iter_mut().zip(channel.values) {
                *sum += f64::from(value);
            }
        }
    }

    fn finished(&self, frames: u32) -> Option<Layer> {
        let mut layer = self.first.clone()?;
        let frames = f64::from(frames);
        let scale = match self.layer.merge() {
            Merge::First => return Some(layer),
            Merge::Mean => 1.0 / frames,
            Merge::VarianceOfMean => 1.0 / (frames * frames),
        };
        // Without sums there is one frame, whose values are the mean.
        for (channel, sums) in layer.channels.iter_mut().zip(&self.sums) {
            channel.values = sums.iter().map(|sum| (sum * scale) as f32).collect();
        }
        Some(layer)
    }
}
