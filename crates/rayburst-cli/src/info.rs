//! `rayburst info`.

use rayburst::{
    math::Aabb,
    scene::{Environment, Pose, Scene},
};
use serde_json::{Value, json};

use crate::{args::verbs::InfoArgs, camera, error::Result, load, terminal};

/// Tells what is in a scene.
pub(crate) fn run(args: &InfoArgs) -> Result<()> {
    let loaded = load::load(&args.scene, &args.instant)?;
    let scene = &loaded.scene;
    let animations = load::animations(scene, &args.instant)?;
    let pose = load::pose(scene, &animations, args.instant.time);
    let facts = Facts::new(scene, &pose);
    if args.json {
        return terminal::result(facts.json(&loaded.name).to_string());
    }
    for line in facts.lines(&loaded.name) {
        terminal::result(line)?;
    }
    Ok(())
}

struct Facts<'a> {
    scene: &'a Scene,
    instances: usize,
    lights: usize,
    cameras: Vec<String>,
    bounds: Aabb,
}

impl<'a> Facts<'a> {
    fn new(scene: &'a Scene, pose: &Pose) -> Self {
        let placed = scene.nodes.iter().filter(|n| n.mesh.is_some());
        let emitters = scene.materials.iter().filter(|m| m.is_emissive()).count();
        Self {
            scene,
            instances: placed.map(|n| n.instances.len().max(1)).sum(),
            lights: scene.world_lights.len()
                + scene.nodes.iter().filter(|n| n.light.is_some()).count()
                + emitters,
            cameras: camera::all(scene, pose).into_iter().map(|(name, _)| name).collect(),
            bounds: bounds(scene, pose),
        }
    }

    fn environment(&self) -> String {
        match &self.scene.environment {
            None => "not said".into(),
            Some(Environment::None) => "none".into(),
            Some(Environment::Constant(radiance)) => format!("constant {radiance}"),
            Some(Environment::Map(map)) => format!("map {}x{}", map.size.0, map.size.1),
        }
    }

    fn json(&self, name: &str) -> Value {
        let animations: Vec<Value> = self
            .scene
            .animations
            .iter()
            .map(|a| json!({ "name": a.name, "seconds": a.duration }))
            .collect();
        let bounds = (!self.bounds.is_empty()).then(
            || json!({ "min": self.bounds.lower.to_array(), "max": self.bounds.upper.to_array() }),
        );
        json!({
            "scene": name,
            "triangles": self.scene.placed_triangles(),
            "instances": self.instances,
            "meshes": self.scene.meshes.len(),
            "materials": self.scene.materials.len(),
            "textures": self.scene.textures.len(),
            "lights": self.lights,
            "cameras": self.cameras,
            "animations": animations,
            "bounds": bounds,
            "environment": self.environment(),
            "metres_per_unit": self.scene.metres_per_unit,
            "warnings": self.scene.warnings,
        })
    }

    fn lines(&self, name: &str) -> Vec<String> {
        let scene = self.scene;
        let names = |list: &[String]| {
            let shown: Vec<&str> =
                list.iter().map(|n| if n.is_empty() { "(no name)" } else { n }).collect();
            if shown.is_empty() { String::new() } else { format!(": {}", shown.join(", ")) }
        };
        let animations: Vec<String> =
            scene.animations.iter().map(|a| format!("{} ({:.2} s)", a.name, a.duration)).collect();
        let mut lines = vec![
            format!("scene        {name}"),
            format!("triangles    {}", scene.placed_triangles()),
            format!("instances    {}", self.instances),
            format!("meshes       {}", scene.meshes.len()),
            format!("materials    {}", scene.materials.len()),
            format!("textures     {}", scene.textures.len()),
            format!("lights       {}", self.lights),
            format!("cameras      {}{}", self.cameras.len(), names(&self.cameras)),
            format!("animations   {}{}", animations.len(), names(&animations)),
            format!("environment  {}", self.environment()),
        ];
        if !self.bounds.is_empty() {
            let (low, high) = (self.bounds.lower, self.bounds.upper);
            lines.push(format!("bounds       {low} to {high}"));
        }
        lines
    }
}

/// World bounds of all placed vertices, without building any structure.
fn bounds(scene: &Scene, pose: &Pose) -> Aabb {
    let mut all = Aabb::EMPTY;
    for (index, node) in scene.nodes.iter().enumerate() {
        let Some(mesh) = node.mesh else { continue };
        let joints = node.skin.map(|s| pose.joint_matrices(scene, s));
        for primitive in &scene.meshes[mesh as usize].primitives {
            let deforms = joints.is_some() || !primitive.targets.is_empty();
            let own = if deforms {
                let bent = rayburst::scene::deform::deform(
                    primitive,
                    &pose.weights[index],
                    joints.as_deref(),
                );
                Aabb::of_points(bent.positions.iter().copied().filter(|p| p.is_finite()))
            } else {
                Aabb::of_points(primitive.positions.iter().copied().filter(|p| p.is_finite()))
            };
            if joints.is_some() {
                all = all.union(own);
            } else if node.instances.is_empty() {
                all = all.union(own.transformed(&pose.world[index]));
            } else {
                for instance in &node.instances {
                    all = all.union(own.transformed(&(pose.world[index] * *instance)));
                }
            }
        }
    }
    all
}
