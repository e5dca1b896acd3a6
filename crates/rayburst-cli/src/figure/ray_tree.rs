//! Recursive ray tracing in a slice (Whitted 1980): `trace()` finds the nearest hit, `shade()` sends
//! shadow, reflection and refraction rays, each of which is traced again.

use rayburst::glam::Vec2;

use super::slice::{Slice, SliceHit};

/// What a ray is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RayKind {
    Eye,
    Shadow,
    Reflection,
    Refraction,
}

/// A ray of the tree, as traced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeRay {
    pub(crate) kind: RayKind,
    pub(crate) from: Vec2,
    /// Where it ends; for a miss, a point on its way out.
    pub(crate) to: Vec2,
    /// The eye ray has depth 1.
    pub(crate) depth: u32,
    /// Share of the eye ray's light that it stands for.
    pub(crate) weight: f32,
    /// Whether it met something; for a shadow ray, something before the light.
    pub(crate) hit: bool,
}

/// The tree of one eye ray or several, and how well its laws hold.
#[derive(Default)]
pub(crate) struct RayTree {
    pub(crate) rays: Vec<TreeRay>,
    /// Calls of `trace()` and `shade()`.
    pub(crate) traced: u32,
    pub(crate) shaded: u32,
    /// Rays whose hit differs from that of testing every triangle in 64 bits.
    pub(crate) differing: u32,
    /// Largest difference of the angles of incidence and reflection, radians.
    pub(crate) reflection_error: f32,
    /// Largest `|n₁ sin θ₁ − n₂ sin θ₂|`.
    pub(crate) snell_error: f32,
    /// Light that left the scene, met something opaque, or was cut off with depth.
    pub(crate) leaving: f64,
    pub(crate) cut: f64,
    /// Total internal reflections.
    pub(crate) total_reflections: u32,
}

/// The limits of a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    pub(crate) max_depth: u32,
    pub(crate) light: Option<Vec2>,
    /// Length drawn of rays that leave the scene.
    pub(crate) escape: f32,
}

impl RayTree {
    /// Follows an eye ray and all that it spawns.
    pub(crate) fn grow(&mut self, slice: &Slice, rules: &Rules, eye: Vec2, direction: Vec2) {
        let ray = rayburst::math::Ray::new(eye.extend(0.0), direction.extend(0.0));
        let hit = slice.trace(eye, direction);
        self.check(slice, &ray, hit.as_ref());
        self.record(RayKind::Eye, eye, direction, hit, 1, 1.0, rules);
        self.follow(slice, rules, direction, hit, 1, 1.0);
    }

    fn follow(
        &mut self,
        slice: &Slice,
        rules: &Rules,
        direction: Vec2,
        hit: Option<SliceHit>,
        depth: u32,
        weight: f32,
    ) {
        self.traced += 1;
        let Some(hit) = hit else {
            self.leaving += f64::from(weight);
            return;
        };
        self.shaded += 1;
        if let (true, Some(light)) = (hit.substance.diffuse, rules.light) {
            self.shadow(slice, &hit, light, depth);
        }
        let mut spawned = Vec::new();
        if hit.substance.mirror {
            spawned.push((RayKind::Reflection, reflect(direction, hit.normal), 1.0));
        }
        if let Some(ior) = hit.substance.ior {
            spawned.extend(self.interface(direction, hit.normal, ior));
        }
        if spawned.is_empty() {
            self.leaving += f64::from(weight);
        }
        for (kind, along, share) in spawned {
            if kind == RayKind::Reflection {
                let angle = |d: Vec2| d.normalize().dot(hit.normal).abs().clamp(0.0, 1.0).acos();
                let error = (angle(direction) - angle(along)).abs();
                self.reflection_error = self.reflection_error.max(error);
            }
            if depth >= rules.max_depth {
                self.cut += f64::from(weight * share);
                continue;
            }
            let next = slice.trace_from(&hit, along);
            self.check(slice, &slice.leaving(&hit, along), next.as_ref());
            self.record(kind, hit.position, along, next, depth + 1, weight * share, rules);
            self.follow(slice, rules, along, next, depth + 1, weight * share);
        }
    }

    fn shadow(&mut self, slice: &Slice, hit: &SliceHit, light: Vec2, depth: u32) {
        let blocker = slice.blocker(hit, light);
        let mut ray = slice.leaving(hit, light - hit.position);
        ray.t_max = 1.0;
        self.check(slice, &ray, blocker.as_ref());
        self.rays.push(TreeRay {
            kind: RayKind::Shadow,
            from: hit.position,
            to: blocker.map_or(light, |b| b.position),
            depth: depth + 1,
            weight: 1.0,
            hit: blocker.is_some(),
        });
    }

    /// The rays of a smooth boundary with their Fresnel shares.
    fn interface(&mut self, d: Vec2, normal: Vec2, ior: f32) -> Vec<(RayKind, Vec2, f32)> {
        let d = d.normalize();
        let entering = d.dot(normal) < 0.0;
        let (n, from, into) = if entering { (normal, 1.0, ior) } else { (-normal, ior, 1.0) };
        let cos1 = -d.dot(n);
        let sin2 = from / into * (1.0 - cos1 * cos1).max(0.0).sqrt();
        let mirrored = reflect(d, n);
        if sin2 >= 1.0 {
            self.total_reflections += 1;
            return vec![(RayKind::Reflection, mirrored, 1.0)];
        }
        let cos2 = (1.0 - sin2 * sin2).sqrt();
        let refracted = from / into * d + (from / into * cos1 - cos2) * n;
        let snell = from * d.perp_dot(n).abs() - into * refracted.perp_dot(n).abs();
        self.snell_error = self.snell_error.max(snell.abs());
        let rs = (from * cos1 - into * cos2) / (from * cos1 + into * cos2);
        let rp = (from * cos2 - into * cos1) / (from * cos2 + into * cos1);
        let share = 0.5 * (rs * rs + rp * rp);
        vec![(RayKind::Reflection, mirrored, share), (RayKind::Refraction, refracted, 1.0 - share)]
    }

    fn record(
        &mut self,
        kind: RayKind,
        from: Vec2,
        direction: Vec2,
        hit: Option<SliceHit>,
        depth: u32,
        weight: f32,
        rules: &Rules,
    ) {
        let to = hit.map_or(from + direction.normalize() * rules.escape, |h| h.position);
        self.rays.push(TreeRay { kind, from, to, depth, weight, hit: hit.is_some() });
    }

    fn check(&mut self, slice: &Slice, ray: &rayburst::math::Ray, hit: Option<&SliceHit>) {
        let same = match (slice.brute_force_t(ray), hit) {
            (None, None) => true,
            (Some(t), Some(hit)) => (t - f64::from(hit.raw.t)).abs() <= 1e-5 * t.max(1.0),
            _ => false,
        };
        self.differing += u32::from(!same);
    }
}

/// The mirror direction.
fn reflect(d: Vec2, n: Vec2) -> Vec2 {
    d - 2.0 * d.dot(n) * n
}
