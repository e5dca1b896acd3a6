//! The planes of a frame by the names that users type, as layers of a file.

use rayburst_image::{Channel, Layer, Plane, Plane3, Precision};
use rayburst_math::Hit;

use super::renderer::Frame;

/// A plane, or some that belong together, of a frame's G-buffer or signals.
///
/// Where nothing is, values are 0 unless said otherwise. What is called light is in cd/m², divided by the
/// albedo of the lobes that scatter it; radiance is not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameLayer {
    /// Base colour, linear Rec. 709.
    Albedo,
    /// Unit normal of shading in the world, on the side of the eye.
    Normal,
    /// Distance from the eye along the pixel's ray, world units (not along the viewing direction).
    Depth,
    /// Position in the world.
    Position,
    /// Number of the node, from 0; −1 where nothing is.
    Instance,
    /// Number of the material, from 0; −1 where nothing is.
    Material,
    /// Variance of the luminance of all light in the 3×3 pixels around.
    Variance,
    /// Where the pixel's point was in the frame before, minus where it is now: X to the right and Y down,
    /// in pixels of the rendered size.
    Motion,
    /// Unit normal of the triangle in the world, on the side of the eye.
    GeometricNormal,
    /// Perceptual roughness.
    Roughness,
    /// Metalness.
    Metallic,
    /// Radiance that leaves towards the eye by itself; where nothing is, that of what lies behind.
    Emitted,
    /// Light from all other lights than polygons, broadly scattered.
    DirectDiffuse,
    /// The same, glossily scattered.
    DirectSpecular,
    /// Light of polygon lights as if nothing were in between, broadly scattered; what arrives is this times
    /// the shadow.
    AnalyticDiffuse,
    /// The same, glossily scattered.
    AnalyticSpecular,
    /// Share of the light of polygon lights that is not blocked, from one ray; 1 without any.
    Shadow,
    /// Distance to what blocked that ray, world units; infinite if nothing did.
    ShadowDistance,
    /// Light along sampled rays, broadly scattered.
    IndirectDiffuse,
    /// Light along sampled rays, glossily scattered.
    IndirectSpecular,
    /// Albedo of the broad lobes.
    DiffuseReflectance,
    /// Albedo of the glossy lobe.
    SpecularReflectance,
    /// Radiance of mirrors and glass.
    Transparency,
    /// Cosine-weighted share of the hemisphere that is open within a radius; 1 without that pass.
    AmbientOcclusion,
    /// Length of the ray that the broadly scattered indirect light came along, world units; infinite if it
    /// left the scene, 0 without a ray.
    DiffuseHitDistance,
    /// The same of the glossily scattered indirect light.
    SpecularHitDistance,
}

/// How a layer of several frames of one instant comes about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Merge {
    /// The mean of the frames.
    Mean,
    /// That of the first frame: what has no mean.
    First,
    /// The mean over the number of frames: the variance of a mean.
    VarianceOfMean,
}

impl FrameLayer {
    /// All of them with the names that users type and that layers carry.
    pub const ALL: [(&'static str, Self); 26] = [
        ("albedo", Self::Albedo),
        ("normal", Self::Normal),
        ("depth", Self::Depth),
        ("position", Self::Position),
        ("instance", Self::Instance),
        ("material", Self::Material),
        ("variance", Self::Variance),
        ("motion", Self::Motion),
        ("geometric_normal", Self::GeometricNormal),
        ("roughness", Self::Roughness),
        ("metallic", Self::Metallic),
        ("emitted", Self::Emitted),
        ("direct_diffuse", Self::DirectDiffuse),
        ("direct_specular", Self::DirectSpecular),
        ("analytic_diffuse", Self::AnalyticDiffuse),
        ("analytic_specular", Self::AnalyticSpecular),
        ("shadow", Self::Shadow),
        ("shadow_distance", Self::ShadowDistance),
        ("indirect_diffuse", Self::IndirectDiffuse),
        ("indirect_specular", Self::IndirectSpecular),
        ("diffuse_reflectance", Self::DiffuseReflectance),
        ("specular_reflectance", Self::SpecularReflectance),
        ("transparency", Self::Transparency),
        ("ambient_occlusion", Self::AmbientOcclusion),
        ("diffuse_hit_distance", Self::DiffuseHitDistance),
        ("specular_hit_distance", Self::SpecularHitDistance),
    ];

    /// The name that users type and that the layer carries.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, layer)| *layer == self).map_or("", |(name, _)| name)
    }

    /// How it is made of several frames of one instant.
    pub fn merge(self) -> Merge {
        match self {
            Self::Depth | Self::Position | Self::Instance | Self::Material | Self::Motion => {
                Merge::First
            }
            // Distances of rays that meet nothing are infinite.
            Self::DiffuseHitDistance | Self::SpecularHitDistance | Self::ShadowDistance => {
                Merge::First
            }
            Self::Variance => Merge::VarianceOfMean,
            _ => Merge::Mean,
        }
    }

    /// The layer of a frame, at the size that is rendered.
    pub fn layer(self, frame: &Frame<'_>) -> Layer {
        let (gbuffer, signals) = (frame.gbuffer, frame.signals);
        match self {
            Self::Albedo => self.colour(&gbuffer.albedo, Precision::Half),
            Self::Normal => self.vector(&gbuffer.normal, Precision::Half),
            Self::Depth => {
                // The rays of pixels have unit directions.
                let distance = |hit: &Hit| if hit.is_hit() { hit.t } else { 0.0 };
                let distances = gbuffer.hits.iter().map(distance).collect();
                Layer::from_scalar(self.name(), "Z", distances)
            }
            Self::Position => self.vector(&gbuffer.position, Precision::Float),
            Self::Instance => self.ids(&gbuffer.instance),
            Self::Material => self.ids(&gbuffer.material),
            Self::Variance => self.scalar(&signals.variance),
            Self::Motion => {
                let [x, y] = &gbuffer.motion;
                self.channels(&[("X", x), ("Y", y)], Precision::Float)
            }
            Self::GeometricNormal => self.vector(&gbuffer.geometric_normal, Precision::Half),
            Self::Roughness => self.scalar(&gbuffer.roughness),
            Self::Metallic => self.scalar(&gbuffer.metallic),
            Self::Emitted => self.colour(&gbuffer.emitted, Precision::Float),
            Self::DirectDiffuse => self.colour(&signals.direct_diffuse, Precision::Float),
            Self::DirectSpecular => self.colour(&signals.direct_specular, Precision::Float),
            Self::AnalyticDiffuse => self.colour(&signals.analytic_diffuse, Precision::Float),
            Self::AnalyticSpecular => self.colour(&signals.analytic_specular, Precision::Float),
            Self::Shadow => self.scalar(&signals.shadow),
            Self::ShadowDistance => self.scalar(&signals.shadow_distance),
            Self::IndirectDiffuse => self.colour(&signals.indirect_diffuse, Precision::Float),
            Self::IndirectSpecular => self.colour(&signals.indirect_specular, Precision::Float),
            Self::DiffuseReflectance => self.colour(&signals.diffuse_reflectance, Precision::Half),
            Self::SpecularReflectance => {
                self.colour(&signals.specular_reflectance, Precision::Half)
            }
            Self::Transparency => self.colour(&signals.transparency, Precision::Float),
            Self::AmbientOcclusion => self.scalar(&signals.ambient_occlusion),
            Self::DiffuseHitDistance => self.scalar(&signals.diffuse_hit_distance),
            Self::SpecularHitDistance => self.scalar(&signals.specular_hit_distance),
        }
    }

    fn colour(self, planes: &Plane3, precision: Precision) -> Layer {
        let [r, g, b] = &planes.channels;
        self.channels(&[("R", r), ("G", g), ("B", b)], precision)
    }

    fn vector(self, planes: &Plane3, precision: Precision) -> Layer {
        let [x, y, z] = &planes.channels;
        self.channels(&[("X", x), ("Y", y), ("Z", z)], precision)
    }

    fn scalar(self, plane: &Plane) -> Layer {
        self.channels(&[("Y", plane)], Precision::Float)
    }

    /// Of numbers plus one, 0 for nothing.
    fn ids(self, plane: &Plane<u32>) -> Layer {
        let ids = values(plane).map(|id| id as f32 - 1.0).collect();
        Layer::from_scalar(self.name(), "id", ids)
    }

    fn channels(self, planes: &[(&str, &Plane)], precision: Precision) -> Layer {
        let channels = planes.iter().map(|(name, plane)| Channel {
            name: (*name).to_owned(),
            values: values(plane).collect(),
            precision,
        });
        Layer { name: self.name().to_owned(), channels: channels.collect() }
    }
}

/// The values of a plane, row by row without padding.
fn values<T: Copy + Default>(plane: &Plane<T>) -> impl Iterator<Item = T> {
    (0..plane.height()).flat_map(|y| plane.row(y).iter().copied())
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rayburst_accel::BuildOptions;
    use rayburst_math::glam::Vec3;
    use rayburst_scene::{Camera, Flattener, Pose};

    use super::*;
    use crate::realtime::{FrameMode, FrameRenderer, FrameSettings, History, guarded};

    const SIZE: (u32, u32) = (19, 7);

    /// A frame of the Cornell box, in the middle of a picture that it does not fill.
    fn with_frame(mode: FrameMode, check: impl FnOnce(&Frame<'_>, &[Layer], Vec3)) {
        let scene = rayburst_scene::builtin::build("cornell").unwrap();
        let pose = Pose::rest(&scene);
        let flat = Flattener::new(&scene, BuildOptions::default()).at(&pose).unwrap();
        let centre = flat.bounds.centre();
        let eye = centre - Vec3::Z * flat.bounds.extent().length();
        let camera = Camera::look_at(eye, centre, Vec3::Y, 0.8);
        let settings = FrameSettings { size: SIZE, mode, ..FrameSettings::default() };
        let mut renderer = FrameRenderer::new(settings).unwrap();
        let frame = renderer.frame(&Arc::new(flat), &camera, &mut History::new()).unwrap();
        let layers = FrameLayer::ALL.map(|(_, layer)| layer.layer(&frame));
        check(&frame, &layers, eye);
    }

    fn of<'a>(layers: &'a [Layer], name: &str, channel: &str) -> &'a [f32] {
        let layer = layers.iter().find(|layer| layer.name == name).unwrap();
        layer.channel(channel).unwrap()
    }

    #[test]
    fn every_layer_has_a_name_and_all_pixels() {
        with_frame(FrameMode::Hybrid, |frame, layers, eye| {
            for (made, (name, layer)) in layers.iter().zip(FrameLayer::ALL) {
                assert_eq!((made.name.as_str(), layer.name()), (name, name));
                assert!(made.channels.iter().all(|c| c.values.len() == 19 * 7), "{name}");
            }
            let of = |name, channel| of(layers, name, channel);
            let (depth, instance) = (of("depth", "Z"), of("instance", "id"));
            let (middle, corner) = (3 * 19 + 9, 0);
            assert!(!frame.gbuffer.hits[corner].is_hit() && frame.gbuffer.hits[middle].is_hit());
            let nothing = (depth[corner], instance[corner], of("material", "id")[corner]);
            assert_eq!(nothing, (0.0, -1.0, -1.0));
            assert_eq!(instance[middle], frame.gbuffer.instance.get(9, 3) as f32 - 1.0);
            let position = ["X", "Y", "Z"].map(|c| of("position", c)[middle]);
            assert!((depth[middle] - eye.distance(position.into())).abs() < 1e-4 * depth[middle]);
            assert_eq!(of("motion", "Y")[middle], 0.0, "nothing moves in the first frame");
        });
    }

    #[test]
    fn layers_make_up_the_picture() {
        with_frame(FrameMode::Path, |frame, layers, _| {
            let mut lit = 0;
            for (at, (x, y)) in (0..7).flat_map(|y| (0..19).map(move |x| (x, y))).enumerate() {
                let colour =
                    |name: &str| Vec3::from(["R", "G", "B"].map(|c| of(layers, name, c)[at]));
                let light = |kind: &str| {
                    let [direct, analytic, indirect] = ["direct", "analytic", "indirect"]
                        .map(|part| colour(&format!("{part}_{kind}")));
                    direct + analytic * of(layers, "shadow", "Y")[at] + indirect
                };
                let reflected = |kind: &str| {
                    let albedo = colour(&format!("{kind}_reflectance"));
                    guarded(albedo) * light(kind)
                };
                let mut sum = colour("emitted") + colour("transparency");
                if of(layers, "instance", "id")[at] >= 0.0 {
                    sum += reflected("diffuse") + reflected("specular");
                }
                let picture = frame.picture.get(x, y);
                assert!((sum - picture).abs().max_element() <= 1e-4 * picture.length(), "{x} {y}");
                lit += u32::from(picture != Vec3::ZERO);
            }
            assert!(lit > 20, "{lit}");
        });
    }
}
