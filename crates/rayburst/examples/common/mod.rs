//! What the programs of the tutorial share: their arguments, rays through pixels, and the way from
//! colours to a file.
#![allow(dead_code, reason = "not every program needs all of it")]

use std::{error::Error, path::PathBuf};

use rayburst::{
    glam::UVec3,
    image::{
        FilterKind, PixelFilter, exposure,
        quantise::{Dither, to_srgb8},
        write_png,
    },
    math::Sampler,
    pipeline::ClosestHit,
    prelude::*,
};

pub(crate) mod daylight;

pub(crate) type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Where the picture goes and how large it is: `PROGRAM [PICTURE.png [WIDTH]]`.
// ANCHOR: arguments
pub(crate) fn arguments(name: &str, size: (u32, u32)) -> Result<(PathBuf, (u32, u32))> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| format!("{name}.png"));
    let Some(width) = arguments.next() else { return Ok((path.into(), size)) };
    let width: u32 = width.parse()?;
    let height = u64::from(width) * u64::from(size.1) / u64::from(size.0);
    Ok((path.into(), (width, height as u32)))
}
// ANCHOR_END: arguments

// ANCHOR: eye
/// A camera that sees smooth edges: each sample of a pixel goes through another point of it.
pub(crate) struct Eye {
    camera: Camera,
    filter: PixelFilter,
    numbers: SamplerKind,
}

impl Eye {
    pub(crate) fn new(camera: Camera) -> Self {
        let filter = PixelFilter::new(FilterKind::default());
        Self { camera, filter, numbers: SamplerKind::Sobol }
    }

    pub(crate) fn look_at(eye: Vec3, target: Vec3, degrees: f32) -> Self {
        Self::new(Camera::look_at(eye, target, Vec3::Y, degrees.to_radians()))
    }

    /// The same with other random numbers.
    pub(crate) fn with_numbers(self, numbers: SamplerKind) -> Self {
        Self { numbers, ..self }
    }

    /// The ray of a sample, and random numbers for what becomes of it, from dimension 4 on.
    pub(crate) fn ray(&self, pixel: UVec3, size: UVec3, sample: u32) -> (Ray, Sampler) {
        let sampler = Sampler::new(self.numbers, 0, pixel.y * size.x + pixel.x, sample);
        let centre = pixel.truncate().as_vec2() + 0.5;
        let at = centre + self.filter.sample(sampler.get_2d(0));
        (self.camera.ray(at, (size.x, size.y), sampler.get_2d(2)).0, sampler)
    }
}
// ANCHOR_END: eye

// ANCHOR: normal
/// The normal of the triangle that was hit, on the side where the ray comes from.
pub(crate) fn normal_of<R>(hit: &ClosestHit<'_, Barycentrics, R>) -> Vec3 {
    let tlas = hit.structure();
    let blas = tlas.instances()[hit.instance_index() as usize].blas;
    let corners =
        tlas.blases()[blas as usize].triangle(hit.geometry_index(), hit.primitive_index());
    let [a, b, c] = corners.unwrap_or_default();
    // Normals are transformed by the inverse transpose.
    let to_world = hit.world_to_object().matrix3.transpose();
    let normal = (to_world * (b - a).cross(c - a)).normalize_or(Vec3::Y);
    if normal.dot(hit.world_ray().direction) > 0.0 { -normal } else { normal }
}
// ANCHOR_END: normal

// ANCHOR: save
/// What shaders have written, as a picture.
pub(crate) fn picture(texels: &RwTexture<Vec3>, (width, height): (u32, u32)) -> RgbImage {
    RgbImage { width, height, pixels: texels.to_vec() }
}

/// Radiance as colours for the eye: exposed automatically and tone-mapped.
pub(crate) fn develop(radiance: &RgbImage) -> RgbImage {
    ToneMap::default().apply_image(radiance, exposure::auto_exposure(radiance))
}

/// A picture of the means of squares of so many pixels.
pub(crate) fn shrink(picture: &RgbImage, side: u32) -> RgbImage {
    RgbImage::from_fn(picture.width / side, picture.height / side, |x, y| {
        let pixels =
            (0..side * side).map(|i| picture.get(side * x + i % side, side * y + i / side));
        pixels.sum::<Vec3>() / (side * side) as f32
    })
}

/// Pictures of one size beside each other, so many in a row.
pub(crate) fn contact_sheet(pictures: &[RgbImage], columns: usize) -> RgbImage {
    let Some(RgbImage { width, height, .. }) = pictures.first() else {
        return RgbImage::new(0, 0, Vec3::ZERO);
    };
    let rows = pictures.len().div_ceil(columns);
    RgbImage::from_fn(columns as u32 * width, rows as u32 * height, |x, y| {
        let index = (y / height) as usize * columns + (x / width) as usize;
        pictures.get(index).map_or(Vec3::ONE, |picture| picture.get(x % width, y % height))
    })
}

/// Writes colours from 0 to 1, linear, as a PNG file.
pub(crate) fn save(colours: &RgbImage, path: PathBuf) -> Result<()> {
    Ok(write_png(&path, &to_srgb8(colours, Dither::None))?)
}
// ANCHOR_END: save

/// Prints a line of results.
#[allow(clippy::print_stdout, reason = "this is what the programs have to say")]
pub(crate) fn say(line: String) {
    println!("{line}");
}
