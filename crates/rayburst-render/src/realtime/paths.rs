//! Paths that go on from the first hits: what light comes along sampled rays.
//!
//! The estimator is that of the path tracer from its second vertex on; how the first ray was chosen, and
//! what its light is divided by, the passes decide that start paths.

use rayburst_math::{
    Hit, Ray, Sampler,
    glam::{Vec2, Vec3},
    lanes::{F32x16, Frame16, LANES, Mask16, Sampler16, Vec3x16, spawn_origin as spawn_origin16},
};
use rayburst_scene::{
    BsdfSample, ShadingModel, TextureLod,
    wide::{Footprint16, Lobes16, ShadingPoint16, Surface16},
};
use rayburst_simd::{Isa, Kernel};

use super::{
    gbuffer::refraction,
    pass::{FrameContext, isa_of},
    shadows::{ShadowRays, closest_hits},
};
use crate::{
    LightSampling, RayCounts,
    dimensions::Vertex,
    estimator,
    footprint::{Arrival, RayFootprint, Turn},
    integrators::{ray_key, shadow_key},
};

/// A path's next ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathRay {
    /// Factor between radiance at the ray's end and its share of the slot.
    pub(crate) throughput: Vec3,
    /// What it adds to.
    pub(crate) slot: u32,
    /// What a pixel sees at the ray's origin.
    pub(crate) footprint: RayFootprint,
    /// Density of the direction; infinite if nothing but this ray finds what is there.
    pub(crate) pdf: f32,
    /// Whether all before were perfect mirrors and glass.
    pub(crate) specular: bool,
    pub(crate) sampler: Sampler,
    /// The root of the path's alpha decisions.
    pub(crate) key: u32,
    /// The square whose polygon lights have a closed form.
    pub(crate) tile: u32,
    /// Whether that does not hold for the lobe that the first ray left by: it finds these lights, and
    /// nothing else does.
    pub(crate) sharp: bool,
}

/// What a path brought back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathResult {
    pub(crate) radiance: Vec3,
    /// Length of the first ray; infinite if it left the scene.
    pub(crate) distance: f32,
    /// Factor on the light that would have come by longer paths.
    pub(crate) tail: Vec3,
}

impl PathResult {
    const NONE: Self = Self { radiance: Vec3::ZERO, distance: f32::INFINITY, tail: Vec3::ZERO };
}

/// Paths of a band.
#[derive(Debug, Default)]
pub(crate) struct Paths {
    rays: Vec<Ray>,
    states: Vec<PathRay>,
    keys: Vec<u32>,
    hits: Vec<Hit>,
    next_rays: Vec<Ray>,
    next_states: Vec<PathRay>,
    shadows: ShadowRays<(Vec3, u32)>,
    /// One a slot.
    pub(crate) results: Vec<PathResult>,
}

impl Paths {
    pub(crate) fn clear(&mut self) {
        self.rays.clear();
        self.states.clear();
        self.results.clear();
    }

    /// Starts a path in a slot of its own.
    #[inline]
    pub(crate) fn start(&mut self, ray: Ray, state: PathRay) {
        self.rays.push(ray);
        self.states.push(PathRay { slot: self.results.len() as u32, ..state });
        self.results.push(PathResult::NONE);
    }

    /// Follows all paths to their ends; their first rays have depth 2. Returns the rays it took.
    pub(crate) fn run(&mut self, frame: &FrameContext<'_>) -> RayCounts {
        let mut counts = RayCounts::default();
        for depth in 2..=frame.settings.max_depth {
            if self.rays.is_empty() {
                break;
            }
            counts.indirect += self.rays.len() as u64;
            self.keys.clear();
            self.keys.extend(self.states.iter().map(|state| ray_key(state.key, depth)));
            closest_hits(frame.scene, frame.opaque, &self.rays, &self.keys, &mut self.hits);
            isa_of(frame.scene).dispatch(Vertices { paths: self, frame, depth });
            let results = &mut self.results;
            counts.shadow += self.shadows.resolve(
                frame.scene,
                frame.opaque,
                |(radiance, slot): (Vec3, u32), visible| {
                    if visible {
                        results[slot as usize].radiance += radiance;
                    }
                },
            );
            std::mem::swap(&mut self.rays, &mut self.next_rays);
            std::mem::swap(&mut self.states, &mut self.next_states);
            self.next_rays.clear();
            self.next_states.clear();
        }
        self.rays.clear();
        self.states.clear();
        counts
    }

    /// What comes along a ray that leaves the scene.
    fn miss(&mut self, frame: &FrameContext<'_>, depth: u32, i: usize) {
        let &FrameContext { scene, lights, settings, .. } = frame;
        let (ray, path) = (&self.rays[i], &self.states[i]);
        let result = &mut self.results[path.slot as usize];
        // What else could have found what is here: what the first hit asked for, or a later one.
        let sampler = if depth == 2 { &lights.primary } else { &lights.all };
        let (radiance, density) = sampler.environment_found(scene, ray.direction);
        if radiance != Vec3::ZERO {
            let alone = depth == 2 && !settings.passes.direct;
            let weight = if alone {
                1.0
            } else {
                estimator::found_weight(LightSampling::Both, path.pdf, || density)
            };
            result.radiance += path.throughput * radiance * weight;
        }
        if path.specular {
            result.radiance += path.throughput * lights.all.sun_radiance(scene, ray.direction);
        }
    }

    /// Adds what shines at a hit.
    fn emission(&mut self, frame: &FrameContext<'_>, depth: u32, i: usize, emitted: Vec3) {
        let &FrameContext { scene, lights, settings, .. } = frame;
        let (ray, hit, path) = (&self.rays[i], &self.hits[i], &self.states[i]);
        let triangle = [hit.instance, hit.geometry, hit.primitive];
        let closed_form = depth == 2 && frame.is_analytic(path.tile, triangle);
        if emitted == Vec3::ZERO || (closed_form && !path.sharp) {
            return;
        }
        let sampler = if depth == 2 { &lights.primary } else { &lights.all };
        let alone = closed_form || (depth == 2 && !settings.passes.direct);
        let weight = if alone {
            1.0
        } else {
            estimator::found_weight(LightSampling::Both, path.pdf, || {
                sampler.emitter_pdf(scene, hit, ray.origin, ray.direction)
            })
        };
        self.results[path.slot as usize].radiance += path.throughput * emitted * weight;
    }

    /// A hit: what shines there, what its lights bring, and where the path goes on.
    fn vertex(&mut self, frame: &FrameContext<'_>, depth: u32, i: usize) {
        let &FrameContext { scene, lights, settings, .. } = frame;
        let (surface, point, wo) = {
            let (ray, hit, path) = (&self.rays[i], &self.hits[i], &self.states[i]);
            let surface = scene.surface(hit);
            let wo = -ray.direction;
            let seen = path.footprint.at(ray, hit, &surface);
            let point = scene.shading_point(&surface, wo, seen, &frame.path_shading);
            (surface, point, wo)
        };
        self.emission(frame, depth, i, point.emitted);
        let (ray, hit, path) = (&self.rays[i], &self.hits[i], &self.states[i]);
        let result = &mut self.results[path.slot as usize];
        if depth == 2 {
            result.distance = hit.t;
        }
        let both = LightSampling::Both;
        if depth >= settings.max_depth {
            return;
        }
        let numbers = Vertex::at_depth(depth);
        // At the last vertex but one a ray of the BSDF would only find again what the shadow ray asks for.
        let last = depth + 1 == settings.max_depth && !point.bsdf.has_delta();
        if !point.bsdf.is_delta() {
            let u = path.sampler.get_2d(numbers.light_point());
            let choice = path.sampler.get_1d(numbers.light_choice());
            if let Some(light) = lights.all.sample(scene, &surface, choice, u) {
                let (f, pdf) = point.evaluate(wo, light.direction);
                let weight = if last { 1.0 } else { estimator::sampled_weight(both, &light, pdf) };
                let radiance = path.throughput * f * light.radiance * (weight / light.pdf);
                if radiance.max_element() > 0.0 && radiance.is_finite() {
                    let origin = surface.spawn(light.direction);
                    let shadow = Ray::with_interval(origin, light.direction, 0.0, light.distance);
                    let key = shadow_key(path.key, depth);
                    self.shadows.push(shadow, key, (radiance, path.slot));
                }
            }
        }
        if last {
            let wo = point.frame.to_local(wo);
            result.tail += path.throughput * point.bsdf.albedo(wo);
            return;
        }
        let direction = path.sampler.get_2d(numbers.direction());
        let u = direction.extend(path.sampler.get_1d(numbers.lobe()));
        let Some(sample) = point.sample(wo, u) else { return };
        let mut throughput = path.throughput * sample.weight;
        if depth >= estimator::ROULETTE_DEPTH {
            let survival = estimator::survival(throughput);
            if path.sampler.get_1d(numbers.survival()) >= survival {
                return;
            }
            throughput /= survival;
        }
        if throughput == Vec3::ZERO {
            return;
        }
        let arrival = Arrival { scene, ray, hit, surface: &surface };
        let state = PathRay {
            throughput,
            footprint: path.footprint.turned(&arrival, &Turn::of_sample(&point, &sample)),
            pdf: density(&sample),
            specular: path.specular && sample.delta,
            ..*path
        };
        self.next_rays.push(Ray::new(surface.spawn(sample.wi), sample.wi));
        self.next_states.push(state);
    }
}

/// The ends of the rays of one depth, sixteen at a time.
struct Vertices<'a> {
    paths: &'a mut Paths,
    frame: &'a FrameContext<'a>,
    depth: u32,
}

impl Kernel for Vertices<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        let Self { paths, frame, depth } = self;
        for first in (0..paths.rays.len()).step_by(LANES) {
            paths.sixteen(frame, depth, first);
        }
    }
}

/// Rays and what they carry, where they hit something.
struct Arrivals {
    /// Those that hit what is shaded in vectors; hits of other lanes are copies.
    some: Mask16,
    hits: [Hit; LANES],
    direction: Vec3x16,
    throughput: Vec3x16,
    footprint: Footprint16,
    samplers: Sampler16,
}

/// One light for each of sixteen points.
struct Lights {
    some: Mask16,
    direction: Vec3x16,
    distance: F32x16,
    /// Radiance over density.
    radiance: Vec3x16,
}

impl Paths {
    /// What is at the ends of sixteen rays. In vectors if paths end there: nothing but their lights is asked
    /// for.
    #[inline(always)]
    fn sixteen(&mut self, frame: &FrameContext<'_>, depth: u32, first: usize) {
        let Some(mut arrivals) = self.arrivals(frame, depth, first) else { return };
        let surface = frame.scene.surface16(&arrivals.hits);
        let wo = -arrivals.direction;
        if frame.path_shading.lod == TextureLod::Differentials {
            self.differentials(&mut arrivals, &surface, first);
        }
        let options = &frame.path_shading;
        let point = frame.scene.shading_point16(&surface, wo, &arrivals.footprint, options);
        let mut ior = F32x16::ONE;
        let mut materials = surface.material;
        for lane in 0..LANES {
            materials[lane] += 1;
        }
        refraction(frame.scene, &materials, &mut ior);
        let frame16 = Frame16::from_normal(point.normal);
        let lobes = Lobes16::new(
            point.base_color,
            point.metallic,
            point.roughness,
            ior,
            frame.path_shading.energy_compensation,
            frame16.to_local(point.geometric_normal),
        );
        let some = self.ends(frame, depth, first, &arrivals, &lobes.is_smooth(), &point);
        if !some.any() {
            return;
        }
        let wo = frame16.to_local(wo);
        let (broad, glossy) = lobes.albedos_apart(wo.z);
        let tail = arrivals.throughput * (broad + glossy);
        let lights = lights_of(frame, depth, &arrivals.samplers, &surface.position, some);
        let values = lobes.evaluate_apart(wo, frame16.to_local(lights.direction));
        let f = values.broad + values.glossy;
        let radiance = arrivals.throughput * f * lights.radiance;
        let fine = ((radiance.x + radiance.y) + radiance.z).is_finite();
        let lit = radiance.max_element().is_greater(F32x16::ZERO);
        let asked = lights.some & fine & lit;
        let origin = spawn_origin16(
            surface.position,
            surface.error,
            surface.geometric_normal,
            lights.direction,
        );
        self.ask(depth, first, some, asked, &origin, &lights, &radiance, &tail);
    }

    /// Looks at sixteen rays: those that leave the scene are done with, those whose hits are not for vectors,
    /// too. `None` if none are left.
    #[inline(never)]
    fn arrivals(&mut self, frame: &FrameContext<'_>, depth: u32, first: usize) -> Option<Arrivals> {
        let count = LANES.min(self.rays.len() - first);
        let ends = depth + 1 == frame.settings.max_depth;
        let mut some = Mask16::NONE;
        let mut any = None;
        for lane in 0..count {
            let i = first + lane;
            let hit = self.hits[i];
            if !hit.is_hit() {
                self.miss(frame, depth, i);
                continue;
            }
            let material = frame.scene.records(&hit).1.material;
            let model = frame.scene.materials[material as usize].model();
            if ends && model == ShadingModel::MetallicRoughness {
                some.set_lane(lane, true);
                any = any.or(Some(i));
            } else {
                self.vertex(frame, depth, i);
            }
        }
        let any = any?;
        let mut arrivals = Arrivals {
            some,
            hits: [self.hits[any]; LANES],
            direction: Vec3x16::ZERO,
            throughput: Vec3x16::ZERO,
            footprint: Footprint16::NONE,
            samplers: Sampler16::of(&[self.states[any].sampler; LANES]),
        };
        let mut samplers = [self.states[any].sampler; LANES];
        let mut widths = F32x16::ZERO;
        for lane in 0..LANES {
            let i = if some.lane(lane) { first + lane } else { any };
            let (ray, path) = (&self.rays[i], &self.states[i]);
            arrivals.hits[lane] = self.hits[i];
            arrivals.direction.set_lane(lane, ray.direction);
            arrivals.throughput.set_lane(lane, path.throughput);
            samplers[lane] = path.sampler;
            if let RayFootprint::Cone(cone) = &path.footprint {
                widths.0[lane] = cone.width_at(self.hits[i].t);
                arrivals.footprint = Footprint16::cones(widths);
            }
        }
        arrivals.samplers = Sampler16::of(&samplers);
        Some(arrivals)
    }

    /// What differentials are on the surfaces, if rays carry them.
    #[inline(never)]
    fn differentials(&self, arrivals: &mut Arrivals, surface: &Surface16, first: usize) {
        let mut axes = None;
        for lane in arrivals.some.lanes() {
            let (ray, path) = (&self.rays[first + lane], &self.states[first + lane]);
            if let RayFootprint::Differential(differential) = &path.footprint {
                let t = arrivals.hits[lane].t;
                let normal = surface.geometric_normal.lane(lane);
                let at_hit = differential.transfer(ray.direction, t, normal);
                let axes = axes.get_or_insert([Vec3x16::ZERO; 2]);
                axes[0].set_lane(lane, at_hit.origin_dx);
                axes[1].set_lane(lane, at_hit.origin_dy);
            }
        }
        if let Some(axes) = axes {
            arrivals.footprint = Footprint16::axes(axes);
        }
    }

    /// Adds what shines, and sends perfect mirrors on; what is left are the ends of paths.
    #[inline(never)]
    fn ends(
        &mut self,
        frame: &FrameContext<'_>,
        depth: u32,
        first: usize,
        arrivals: &Arrivals,
        smooth: &Mask16,
        point: &ShadingPoint16,
    ) -> Mask16 {
        let mut some = arrivals.some;
        for lane in arrivals.some.lanes() {
            if smooth.lane(lane) {
                some.set_lane(lane, false);
                self.vertex(frame, depth, first + lane);
            } else {
                self.emission(frame, depth, first + lane, point.emitted.lane(lane));
            }
        }
        some
    }

    /// Lists shadow rays, and notes what longer paths would have brought.
    #[inline(never)]
    fn ask(
        &mut self,
        depth: u32,
        first: usize,
        some: Mask16,
        asked: Mask16,
        origin: &Vec3x16,
        lights: &Lights,
        radiance: &Vec3x16,
        tail: &Vec3x16,
    ) {
        for lane in some.lanes() {
            let path = &self.states[first + lane];
            let result = &mut self.results[path.slot as usize];
            result.tail += tail.lane(lane);
            if depth == 2 {
                result.distance = self.hits[first + lane].t;
            }
            if asked.lane(lane) {
                let (direction, distance) = (lights.direction.lane(lane), lights.distance.0[lane]);
                let ray = Ray::with_interval(origin.lane(lane), direction, 0.0, distance);
                let key = shadow_key(path.key, depth);
                self.shadows.push(ray, key, (radiance.lane(lane), path.slot));
            }
        }
    }
}

/// One of all lights for each of sixteen points.
#[inline(always)]
fn lights_of(
    frame: &FrameContext<'_>,
    depth: u32,
    samplers: &Sampler16,
    position: &Vec3x16,
    some: Mask16,
) -> Lights {
    let numbers = Vertex::at_depth(depth);
    let choice = samplers.get_1d(numbers.light_choice());
    let (u, v) =
        (samplers.get_1d(numbers.light_point()), samplers.get_1d(numbers.light_point() + 1));
    one_by_one(frame, position, some, &choice, [&u, &v])
}

#[inline(never)]
fn one_by_one(
    frame: &FrameContext<'_>,
    position: &Vec3x16,
    some: Mask16,
    choice: &F32x16,
    [u, v]: [&F32x16; 2],
) -> Lights {
    let mut lights = Lights {
        some: Mask16::NONE,
        direction: Vec3x16::splat(Vec3::Z),
        distance: F32x16::ZERO,
        radiance: Vec3x16::ZERO,
    };
    for lane in some.lanes() {
        let at = Vec2::new(u.0[lane], v.0[lane]);
        let (from, choice) = (position.lane(lane), choice.0[lane]);
        if let Some(light) = frame.lights.all.sample_from(frame.scene, from, choice, at) {
            lights.some.set_lane(lane, true);
            lights.direction.set_lane(lane, light.direction);
            lights.distance.0[lane] = light.distance;
            lights.radiance.set_lane(lane, light.radiance / light.pdf);
        }
    }
    lights
}

/// The density of a sample's direction as [`PathRay::pdf`] has it.
#[inline]
pub(crate) fn density(sample: &BsdfSample) -> f32 {
    if sample.delta { f32::INFINITY } else { sample.pdf }
}
