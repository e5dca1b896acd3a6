//! What a ray carries to know how much a pixel sees of the surface that it meets: nothing, a cone, or a
//! differential; and what becomes of it where the path turns.
//!
//! Cones: Akenine-Möller et al., "Improved Shader and Texture Level of Detail Using Ray Cones", JCGT
//! 2021. Differentials: Igehy, "Tracing Ray Differentials", SIGGRAPH 1999. Narrow lobes reflect like a
//! mirror at the halfway vector and open by the lobe's width; wide ones keep the footprint and forget
//! where it came from.

use rayburst_math::{
    Hit, Ray, RayCone, RayDifferential,
    glam::{Vec2, Vec3},
};
use rayburst_scene::{BsdfSample, Camera, FlatScene, Footprint, ShadingPoint, Surface, TextureLod};

/// Lobes narrower than this show the curvature; wider ones hide it.
const NARROW: f32 = 0.2;

/// The footprint of a ray, from its origin on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum RayFootprint {
    /// None is kept ([`TextureLod::Mip0`]).
    #[default]
    None,
    /// 8 bytes ([`TextureLod::Cones`]).
    Cone(RayCone),
    /// 48 bytes ([`TextureLod::Differentials`]).
    Differential(RayDifferential),
}

/// How a path goes on from a hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    /// Where to: a unit vector in the world.
    pub wi: Vec3,
    /// Whether it goes on on the other side.
    pub transmitted: bool,
    /// Unit normal that the surface was shaded with, on the side of the ray that came.
    pub normal: Vec3,
    /// Index of refraction on the side of the ray that came over the other side's.
    pub eta: f32,
    /// Width of the scattering lobe, radians; 0 for mirrors and glass.
    pub spread: f32,
}

impl Turn {
    /// That of a sampled direction.
    #[inline]
    pub fn of_sample(point: &ShadingPoint, sample: &BsdfSample) -> Self {
        let turn = Self::specular(point, sample.wi, sample.transmitted);
        Self { spread: sample.spread, ..turn }
    }

    /// That of a perfect mirror, or of clear glass.
    #[inline]
    pub fn specular(point: &ShadingPoint, wi: Vec3, transmitted: bool) -> Self {
        let (normal, eta) = (point.frame.normal, point.bsdf.relative_ior());
        Self { wi, transmitted, normal, eta, spread: 0.0 }
    }
}

/// A ray at its hit.
#[derive(Clone, Copy, Debug)]
pub struct Arrival<'a> {
    /// The scene.
    pub scene: &'a FlatScene,
    /// The ray; its direction is a unit vector.
    pub ray: &'a Ray,
    /// What it hit.
    pub hit: &'a Hit,
    /// The surface there.
    pub surface: &'a Surface,
}

impl RayFootprint {
    /// That of an eye ray: one pixel. `pixel` and `lens` are as in [`Camera::ray`], `cone` is what came
    /// with the ray.
    #[inline]
    pub fn of_eye(
        lod: TextureLod,
        camera: &Camera,
        pixel: Vec2,
        size: (u32, u32),
        lens: Vec2,
        cone: RayCone,
    ) -> Self {
        match lod {
            TextureLod::Mip0 => Self::None,
            TextureLod::Cones => Self::Cone(cone),
            TextureLod::Differentials => {
                Self::Differential(camera.ray_differential(pixel, size, lens))
            }
        }
    }

    /// The footprint on the surface that the ray meets.
    #[inline]
    pub fn at(&self, ray: &Ray, hit: &Hit, surface: &Surface) -> Footprint {
        match self {
            Self::None => Footprint::NONE,
            Self::Cone(cone) => Footprint::cone(cone.width_at(hit.t)),
            Self::Differential(differential) => Footprint::differential(&differential.transfer(
                ray.direction,
                hit.t,
                surface.geometric_normal,
            )),
        }
    }

    /// The footprint of the ray that goes on.
    #[inline]
    pub fn turned(&self, arrival: &Arrival<'_>, turn: &Turn) -> Self {
        match self {
            Self::None => Self::None,
            Self::Cone(cone) => Self::Cone(turned_cone(arrival, *cone, turn)),
            Self::Differential(differential) => {
                Self::Differential(turned_differential(arrival, differential, turn))
            }
        }
    }
}

#[inline]
fn turned_cone(arrival: &Arrival<'_>, cone: RayCone, turn: &Turn) -> RayCone {
    let Arrival { scene, ray, hit, surface } = arrival;
    if turn.spread >= NARROW {
        return cone.propagate(hit.t, turn.spread);
    }
    let facing = surface.shading_normal.dot(ray.direction);
    let curvature = scene.mean_curvature(hit, surface);
    // As seen from the side of the ray.
    let curvature = if facing > 0.0 { -curvature } else { curvature };
    if turn.transmitted {
        let cosines = (facing, surface.shading_normal.dot(turn.wi));
        cone.refract(hit.t, curvature, cosines, turn.eta)
    } else {
        cone.reflect(hit.t, curvature, turn.spread)
    }
}

fn turned_differential(
    arrival: &Arrival<'_>,
    differential: &RayDifferential,
    turn: &Turn,
) -> RayDifferential {
    let Arrival { scene, ray, hit, surface } = arrival;
    let d = ray.direction;
    let at_hit = differential.transfer(d, hit.t, surface.geometric_normal);
    if turn.spread >= NARROW {
        return at_hit.scatter(turn.wi, turn.spread);
    }
    let steps = [at_hit.origin_dx, at_hit.origin_dy];
    let mut bends = scene.normal_change(hit, surface, steps);
    if surface.shading_normal.dot(d) > 0.0 {
        bends = bends.map(|bend| -bend);
    }
    if turn.transmitted {
        at_hit.refract(d, turn.normal, bends, turn.eta)
    } else if turn.spread > 0.0 {
        let facet = (turn.wi - d).normalize_or(turn.normal);
        at_hit.reflect(d, facet, bends).widen(turn.wi, turn.spread)
    } else {
        at_hit.reflect(d, turn.normal, bends)
    }
}

/// The footprints of rays in a queue: as many of one kind as there are rays, and none of the others.
#[derive(Debug, Default)]
pub(crate) struct Footprints {
    cones: Vec<RayCone>,
    differentials: Vec<RayDifferential>,
}

impl Footprints {
    pub(crate) fn clear(&mut self) {
        self.cones.clear();
        self.differentials.clear();
    }

    #[inline]
    pub(crate) fn push(&mut self, footprint: &RayFootprint) {
        match footprint {
            RayFootprint::None => {}
            RayFootprint::Cone(cone) => self.cones.push(*cone),
            RayFootprint::Differential(differential) => self.differentials.push(*differential),
        }
    }

    /// That of a ray.
    #[inline]
    pub(crate) fn get(&self, ray: usize) -> RayFootprint {
        match (self.cones.get(ray), self.differentials.get(ray)) {
            (Some(cone), _) => RayFootprint::Cone(*cone),
            (_, Some(differential)) => RayFootprint::Differential(*differential),
            _ => RayFootprint::None,
        }
    }
}
