//! Sums of signals without the surfaces' colours, for filters that take broad and glossy light together.

use rayburst_image::{Band3, Plane3};
use rayburst_math::{
    glam::Vec3,
    lanes::{F32x16, LANES},
};
use rayburst_simd::{Isa, IsaLevel, Kernel};
use rayon::prelude::*;

use super::{
    gbuffer::BAND,
    signals::{LEAST_REFLECTANCE, Signals},
};

/// What is added up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Sum {
    /// Light that comes straight from lights.
    Direct,
    /// The same without that of polygon lights in closed form.
    DirectSampled,
    /// Light along sampled rays, and this radiance from everywhere where the hemisphere is open.
    Indirect(Vec3),
}

/// Adds up broad and glossy light, each with the albedo of its lobes, over the sum of the albedos: what
/// [`super::composite()`] makes of the result in place of both is what it makes of them.
pub(crate) fn demodulate(isa: IsaLevel, signals: &Signals, sum: Sum, out: &mut Plane3) {
    let bands: Vec<_> = out.bands_mut(BAND).collect();
    bands.into_par_iter().for_each(|rows| {
        isa.dispatch(Demodulate { signals, sum, rows });
    });
}

struct Demodulate<'a, 'r> {
    signals: &'a Signals,
    sum: Sum,
    rows: Band3<'r>,
}

impl Kernel for Demodulate<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self { signals, sum, mut rows } = self;
        let (broad, glossy) = match sum {
            Sum::Direct | Sum::DirectSampled => (&signals.direct_diffuse, &signals.direct_specular),
            Sum::Indirect(_) => (&signals.indirect_diffuse, &signals.indirect_specular),
        };
        let (top, bottom) = (rows.top(), rows.top() + rows.rows());
        let least = F32x16::splat(LEAST_REFLECTANCE);
        for y in top..bottom {
            for x in (0..broad.size().0).step_by(LANES) {
                let at = signals.shadow.index(x, y);
                let shadow = F32x16(signals.shadow.lanes(at));
                let out = rows.from_pixel_mut(x, y);
                for (channel, out) in out.into_iter().enumerate() {
                    let (mut b, mut g) = (load(broad, channel, at), load(glossy, channel, at));
                    if sum == Sum::Direct {
                        b += load(&signals.analytic_diffuse, channel, at) * shadow;
                        g += load(&signals.analytic_specular, channel, at) * shadow;
                    }
                    if let Sum::Indirect(ambient) = sum {
                        b += F32x16(signals.ambient_occlusion.lanes(at)) * ambient[channel];
                    }
                    let albedo_b = load(&signals.diffuse_reflectance, channel, at).max(least);
                    let albedo_g = load(&signals.specular_reflectance, channel, at).max(least);
                    ((albedo_b * b + albedo_g * g) / (albedo_b + albedo_g)).store(out);
                }
            }
        }
    }
}

#[inline(always)]
fn load(planes: &Plane3, channel: usize, at: usize) -> F32x16 {
    F32x16(planes.channels[channel].lanes(at))
}
