//! A top-level structure: instances of BLASes in the world.

use std::{ops::ControlFlow, sync::Arc};

use glam::Affine3A;
use rayburst_math::{Aabb, Hit, HitKind, Ray};

use crate::{
    Blas, BuildError, BuildOptions, BuildStats, BvhDefect, Cull, Instance, TraceOptions,
    ValidationReport,
};

/// Instances of BLASes, ready to be traced.
#[derive(Clone, Debug)]
pub struct Tlas {
    blases: Vec<Arc<Blas>>,
    instances: Vec<Instance>,
    inverses: Vec<Affine3A>,
    stats: BuildStats,
}

impl Tlas {
    /// Builds over instances; their order gives the instance indices of hits.
    pub fn build(
        blases: Vec<Arc<Blas>>,
        instances: &[Instance],
        _options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        for (i, instance) in instances.iter().enumerate() {
            if instance.blas as usize >= blases.len() {
                return Err(BuildError::NoSuchBlas {
                    instance: i as u32,
                    blas: instance.blas,
                    blases: blases.len(),
                });
            }
        }
        let inverses: Vec<_> = instances.iter().map(|i| i.transform.inverse()).collect();
        let stats = BuildStats { primitives: instances.len(), ..Default::default() };
        Ok(Self { blases, instances: instances.to_vec(), inverses, stats })
    }

    /// What the build made.
    pub fn stats(&self) -> BuildStats {
        self.stats
    }

    /// The box around all instances that can be hit, in the world; empty if there are none.
    pub fn bounds(&self) -> Aabb {
        self.instances.iter().fold(Aabb::EMPTY, |bounds, instance| {
            bounds.union(
                self.blases[instance.blas as usize].bounds().transformed(&instance.transform),
            )
        })
    }

    /// The instances as given.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The BLASes as given.
    pub fn blases(&self) -> &[Arc<Blas>] {
        &self.blases
    }

    /// From an instance's space to the world.
    pub fn object_to_world(&self, instance: u32) -> Affine3A {
        self.instances[instance as usize].transform
    }

    /// From the world to an instance's space: the inverse by which rays are transformed.
    pub fn world_to_object(&self, instance: u32) -> Affine3A {
        self.inverses[instance as usize]
    }

    /// Proves the structure, not its BLASes.
    pub fn validate(&self) -> Result<ValidationReport, BvhDefect> {
        Ok(ValidationReport { primitives: self.instances.len(), ..Default::default() })
    }

    pub(crate) fn visit(
        &self,
        ray: &mut Ray,
        options: &TraceOptions,
        visitor: &mut dyn FnMut(&mut Ray, Hit, bool) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if !ray.is_valid() {
            return ControlFlow::Continue(());
        }
        for (index, instance) in self.instances.iter().enumerate() {
            if instance.mask & options.mask == 0 {
                continue;
            }
            let inverse = &self.inverses[index];
            let mut local = Ray {
                origin: inverse.transform_point3(ray.origin),
                direction: inverse.transform_vector3(ray.direction),
                ..*ray
            };
            let cull = match (instance.flags.cull_disable, instance.flags.front_clockwise) {
                (true, _) => Cull::None,
                (false, false) => options.cull,
                (false, true) => match options.cull {
                    Cull::None => Cull::None,
                    Cull::Front => Cull::Back,
                    Cull::Back => Cull::Front,
                },
            };
            self.blases[instance.blas as usize].visit(
                &mut local,
                cull,
                &mut |local, hit, opaque| {
                    let mut hit = Hit { instance: index as u32, ..hit };
                    if instance.flags.front_clockwise {
                        hit.kind = if hit.kind == HitKind::TRIANGLE_FRONT {
                            HitKind::TRIANGLE_BACK
                        } else {
                            HitKind::TRIANGLE_FRONT
                        };
                    }
                    let flow = visitor(ray, hit, instance.flags.force_opaque.unwrap_or(opaque));
                    local.t_max = ray.t_max;
                    flow
                },
            )?;
        }
        ControlFlow::Continue(())
    }
}
