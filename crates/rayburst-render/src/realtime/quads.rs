//! What is found once for every block of 2×2 pixels, and how pixels share it.
//!
//! One pixel of a block, another one in every frame, asks for its neighbours. What comes back is
//! demodulated, so that each pixel multiplies it with its own colour; a pixel whose block asked at another
//! surface takes the answer of the block around whose surface is most like its own.

use rayburst_image::{Band, Band3, Plane, Plane3};
use rayburst_math::glam::Vec3;
use rayon::prelude::*;

use super::{
    gbuffer::{BAND, GBuffer, PixelKind},
    pass::FrameContext,
    signals::{Lobe, Signals},
};
use crate::Result;

/// Rows of blocks in a band.
pub(crate) const QUAD_BAND: u32 = BAND / 2;

/// In [`Quads::chosen`]: no pixel of the block is a surface.
const NONE: u32 = 4;

/// Signals of a quarter of the pixels.
#[derive(Clone, Debug, Default)]
pub(crate) struct Quads {
    /// Which pixel of the block asked: 0 to 3, row by row; [`NONE`] if none.
    pub(crate) chosen: Plane<u32>,
    pub(crate) diffuse: Plane3,
    pub(crate) specular: Plane3,
    pub(crate) diffuse_distance: Plane,
    pub(crate) specular_distance: Plane,
    pub(crate) occlusion: Plane,
    pub(crate) occluder: Plane,
}

/// Rows of blocks that one thread fills in.
pub(crate) struct QuadRows<'a> {
    pub(crate) chosen: Band<'a, u32>,
    pub(crate) diffuse: Band3<'a>,
    pub(crate) specular: Band3<'a>,
    pub(crate) diffuse_distance: Band<'a>,
    pub(crate) specular_distance: Band<'a>,
    pub(crate) occlusion: Band<'a>,
    pub(crate) occluder: Band<'a>,
}

impl Quads {
    /// For pictures of a size in pixels.
    pub(crate) fn new(size: (u32, u32)) -> Result<Self> {
        let (width, height) = (size.0.div_ceil(2), size.1.div_ceil(2));
        let plane = || Plane::new(width, height);
        Ok(Self {
            chosen: Plane::new(width, height)?,
            diffuse: Plane3::new(width, height)?,
            specular: Plane3::new(width, height)?,
            diffuse_distance: plane()?,
            specular_distance: plane()?,
            occlusion: plane()?,
            occluder: plane()?,
        })
    }

    pub(crate) fn size(&self) -> (u32, u32) {
        self.chosen.size()
    }

    pub(crate) fn rows(&mut self) -> Vec<QuadRows<'_>> {
        let mut chosen = self.chosen.bands_mut(QUAD_BAND);
        let mut diffuse = self.diffuse.bands_mut(QUAD_BAND);
        let mut specular = self.specular.bands_mut(QUAD_BAND);
        let mut diffuse_distance = self.diffuse_distance.bands_mut(QUAD_BAND);
        let mut specular_distance = self.specular_distance.bands_mut(QUAD_BAND);
        let mut occlusion = self.occlusion.bands_mut(QUAD_BAND);
        let mut occluder = self.occluder.bands_mut(QUAD_BAND);
        std::iter::from_fn(|| {
            Some(QuadRows {
                chosen: chosen.next()?,
                diffuse: diffuse.next()?,
                specular: specular.next()?,
                diffuse_distance: diffuse_distance.next()?,
                specular_distance: specular_distance.next()?,
                occlusion: occlusion.next()?,
                occluder: occluder.next()?,
            })
        })
        .collect()
    }

    /// Chooses which pixel of each block asks in this frame.
    pub(crate) fn choose(&mut self, frame: &FrameContext<'_>, gbuffer: &GBuffer) {
        let (width, height) = gbuffer.size();
        let bands: Vec<_> = self.chosen.bands_mut(QUAD_BAND).collect();
        bands.into_par_iter().for_each(|mut rows| {
            for y in rows.top()..rows.top() + rows.rows() {
                for x in 0..width.div_ceil(2) {
                    let first = rayburst_math::hash::combine(x, y).wrapping_add(frame.number);
                    let found = (0..4).map(|i| first.wrapping_add(i) % 4).find(|&i| {
                        let (x, y) = pixel_of((x, y), i);
                        x < width
                            && y < height
                            && gbuffer.kind.get(x, y) == PixelKind::Surface as u32
                    });
                    rows.set(x, y, found.unwrap_or(NONE));
                }
            }
        });
    }

    /// The pixel that asks for a block, if one does.
    #[inline]
    pub(crate) fn asking(&self, at: (u32, u32)) -> Option<(u32, u32)> {
        asking(self.chosen.get(at.0, at.1), at)
    }

    /// Gives every pixel the answers of its block or of one near it.
    pub(crate) fn share(&self, gbuffer: &GBuffer, signals: &mut Signals, found: Found) {
        let (width, height) = gbuffer.size();
        let mut vectors =
            [signals.indirect_diffuse.bands_mut(BAND), signals.indirect_specular.bands_mut(BAND)];
        let mut planes = [
            signals.diffuse_hit_distance.bands_mut(BAND),
            signals.specular_hit_distance.bands_mut(BAND),
            signals.ambient_occlusion.bands_mut(BAND),
            signals.occluder_distance.bands_mut(BAND),
        ];
        let bands: Vec<_> = std::iter::from_fn(|| {
            let ([a, b], [c, d, e, f]) = (&mut vectors, &mut planes);
            Some(([a.next()?, b.next()?], [c.next()?, d.next()?, e.next()?, f.next()?]))
        })
        .collect();
        bands.into_par_iter().enumerate().for_each(|(band, (vectors, planes))| {
            let band = band as u32;
            let [mut diffuse, mut specular] = vectors;
            let [mut diffuse_distance, mut specular_distance, mut occlusion, mut occluder] = planes;
            for y in band * BAND..(band * BAND + BAND).min(height) {
                for x in 0..width {
                    if gbuffer.kind.get(x, y) != PixelKind::Surface as u32 {
                        continue;
                    }
                    let Some((i, j)) = self.likest(gbuffer, (x, y)) else { continue };
                    if found.indirect {
                        diffuse.set(x, y, self.diffuse.get(i, j));
                        diffuse_distance.set(x, y, self.diffuse_distance.get(i, j));
                    }
                    if found.reflections {
                        specular.set(x, y, self.specular.get(i, j));
                        specular_distance.set(x, y, self.specular_distance.get(i, j));
                    }
                    if found.occlusion {
                        occlusion.set(x, y, self.occlusion.get(i, j));
                        occluder.set(x, y, self.occluder.get(i, j));
                    }
                }
            }
        });
    }

    /// The block whose asking pixel is most like a pixel: its own if that is alike.
    #[inline]
    fn likest(&self, gbuffer: &GBuffer, (x, y): (u32, u32)) -> Option<(u32, u32)> {
        let own = (x / 2, y / 2);
        let normal = gbuffer.normal.get(x, y);
        let position = gbuffer.position.get(x, y);
        // Surfaces farther apart than a few pixels are others.
        let near = 4.0 * gbuffer.footprint.get(x, y).max(f32::MIN_POSITIVE);
        let likeness = |block: (u32, u32)| {
            let at = self.asking(block)?;
            if at == (x, y) {
                return Some(2.0);
            }
            let along = gbuffer.normal.get(at.0, at.1).dot(normal);
            let off = (gbuffer.position.get(at.0, at.1) - position).dot(normal).abs() / near;
            Some(along - off)
        };
        let mut best = likeness(own).map(|like| (like, own));
        if best.is_some_and(|(like, _)| like > 0.7) {
            return Some(own);
        }
        let (columns, rows) = self.size();
        for j in own.1.saturating_sub(1)..=(own.1 + 1).min(rows - 1) {
            for i in own.0.saturating_sub(1)..=(own.0 + 1).min(columns - 1) {
                if let Some(like) = likeness((i, j))
                    && best.is_none_or(|(other, _)| like > other)
                {
                    best = Some((like, (i, j)));
                }
            }
        }
        best.map(|(_, block)| block)
    }
}

/// What blocks have answers of.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Found {
    pub(crate) indirect: bool,
    pub(crate) reflections: bool,
    pub(crate) occlusion: bool,
}

#[inline]
fn pixel_of((x, y): (u32, u32), chosen: u32) -> (u32, u32) {
    (2 * x + chosen % 2, 2 * y + chosen / 2)
}

/// The pixel that asks for a block.
#[inline]
pub(crate) fn asking(chosen: u32, at: (u32, u32)) -> Option<(u32, u32)> {
    (chosen != NONE).then(|| pixel_of(at, chosen))
}

impl QuadRows<'_> {
    /// The blocks of these rows, two by two rows of squares.
    pub(crate) fn blocks(&self, width: u32) -> impl Iterator<Item = (u32, u32)> + use<> {
        let rows = self.chosen.top()..self.chosen.top() + self.chosen.rows();
        (0..width).step_by(QUAD_BAND as usize).flat_map(move |left| {
            rows.clone()
                .flat_map(move |y| (left..(left + QUAD_BAND).min(width)).map(move |x| (x, y)))
        })
    }

    /// What a ray of a block brought, and how far it went.
    #[inline]
    pub(crate) fn set(&mut self, lobe: Lobe, (x, y): (u32, u32), radiance: Vec3, distance: f32) {
        let (light, distances) = match lobe {
            Lobe::Broad => (&mut self.diffuse, &mut self.diffuse_distance),
            Lobe::Glossy => (&mut self.specular, &mut self.specular_distance),
        };
        light.set(x, y, radiance);
        distances.set(x, y, distance);
    }
}
