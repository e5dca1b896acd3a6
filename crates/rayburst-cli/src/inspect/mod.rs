//! `rayburst inspect`: the paths of one pixel, vertex by vertex.

mod path;

use rayburst::{
    accel::BuildOptions,
    glam::Vec3,
    render::{IntegratorKind, Reference, RenderSettings},
    scene::{FlatScene, Flattener, Scene},
};

use crate::{
    args::verbs::InspectArgs,
    camera,
    error::{CliError, Result},
    light, load, terminal,
};
use path::{Lookup, Place, Segment, Tracer, Vertex};

/// The picture's size unless the scene suggests one.
const DEFAULT_SIZE: (u32, u32) = (960, 540);

/// Tells the paths of a pixel.
pub(crate) fn run(args: &InspectArgs) -> Result<()> {
    let mut loaded = load::load(&args.scene.scene, &args.scene.instant)?;
    light::apply(&mut loaded.scene, &args.light)?;
    let size = args.size.or(loaded.size).unwrap_or(DEFAULT_SIZE);
    let (x, y) = args.pixel;
    if x >= size.0 || y >= size.1 {
        return Err(CliError::usage(format!(
            "pixel {x},{y} lies outside the picture of {}x{}",
            size.0, size.1
        )));
    }
    let scene = &loaded.scene;
    let animations = load::animations(scene, &args.scene.instant)?;
    let pose = load::pose(scene, &animations, args.scene.instant.time);
    let flat = Flattener::new(scene, BuildOptions::default()).at(&pose)?;
    let camera = camera::choose(scene, &pose, &flat.bounds, size, &args.camera)?;
    let settings = RenderSettings {
        size,
        integrator: IntegratorKind::Path,
        max_depth: args.max_depth,
        seed: args.seed,
        sampler: args.sampler,
        ..RenderSettings::default()
    };
    let tracer = Tracer::new(&flat, &camera, &settings);
    let reference = Reference::new(&flat, &camera, &settings);
    let teller = Teller { scene, flat: &flat };
    for sample in args.sample..args.sample.saturating_add(args.samples) {
        let (vertices, radiance) = tracer.path((x, y), sample);
        let (width, height) = size;
        terminal::result(format!("pixel {x},{y} of {width}x{height}, sample {sample}"))?;
        for vertex in &vertices {
            for line in teller.vertex(vertex) {
                terminal::result(format!("  {line}"))?;
            }
        }
        let told = reference.sample(x, y, sample);
        terminal::result(format!(
            "  radiance {} (reference path tracer: {})",
            vector(radiance),
            vector(told)
        ))?;
    }
    Ok(())
}

/// Puts vertices into words.
struct Teller<'a> {
    scene: &'a Scene,
    flat: &'a FlatScene,
}

impl Teller<'_> {
    fn vertex(&self, vertex: &Vertex) -> Vec<String> {
        let mut lines = vec![self.ray(vertex)];
        match &vertex.place {
            Some(place) => lines.extend(self.place(place, &vertex.segment)),
            None => lines.push("   leaves the scene".into()),
        }
        if vertex.met != Vec3::ZERO {
            lines.push(format!(
                "   meets light {}, weight {:.4}: adds {}",
                vector(vertex.met),
                vertex.met_weight,
                vector(vertex.met_adds)
            ));
        }
        if let Some(lookup) = &vertex.lookup {
            lines.extend(self.lookup(lookup));
        }
        match &vertex.turn {
            Some(turn) => {
                let way = if turn.transmitted { "is transmitted" } else { "is reflected" };
                let density = if turn.delta {
                    "without a choice (mirror or glass)".into()
                } else {
                    format!("pdf {:.5}", turn.pdf)
                };
                lines.push(format!(
                    "   {way} to {}, {density}, f·cos/pdf {}",
                    vector(turn.wi),
                    vector(turn.weight)
                ));
                if vertex.survival < 1.0 {
                    lines.push(format!("   goes on with probability {:.4}", vertex.survival));
                }
                if vertex.throughput == Vec3::ZERO {
                    lines.push("   ends here by chance".into());
                } else {
                    lines.push(format!("   throughput {}", vector(vertex.throughput)));
                }
            }
            None if vertex.place.is_some() => lines.push("   ends here".into()),
            None => {}
        }
        lines
    }

    fn ray(&self, vertex: &Vertex) -> String {
        let Segment { ray, counts, .. } = &vertex.segment;
        let kind = if vertex.depth == 1 { "eye ray" } else { "ray" };
        format!(
            "{}. {kind} from {} to {}: {} nodes, {} leaves, {} triangles tested",
            vertex.depth,
            vector(ray.origin),
            vector(ray.direction),
            counts.nodes,
            counts.leaves,
            counts.triangles
        )
    }

    fn place(&self, place: &Place, segment: &Segment) -> Vec<String> {
        let (hit, surface) = (&segment.hit, &place.surface);
        let side = if surface.front { "front" } else { "back" };
        vec![
            format!(
                "   hits the {side} of {} at t {:.6}, {}: instance {}, geometry {}, triangle {}",
                self.node(surface.node),
                hit.t,
                vector(surface.position),
                hit.instance,
                hit.geometry,
                hit.primitive
            ),
            format!(
                "   barycentric ({:.4}, {:.4}), normal {}, shading normal {}, uv ({:.4}, {:.4})",
                hit.u,
                hit.v,
                vector(surface.geometric_normal),
                vector(surface.shading_normal),
                surface.uv[0].x,
                surface.uv[0].y
            ),
            format!(
                "   {}: {:?}, base colour {}, metallic {:.3}, roughness {:.3}",
                self.material(surface.material),
                self.flat.materials[surface.material as usize].model(),
                vector(place.base_color),
                place.metallic,
                place.roughness
            ),
        ]
    }

    fn lookup(&self, lookup: &Lookup) -> Vec<String> {
        let Lookup { light, shadow, f, pdf, weight, adds } = lookup;
        let distance = if light.distance.is_finite() {
            format!("{:.4} away", light.distance)
        } else {
            "infinitely far".into()
        };
        let seen = if shadow.hit.is_hit() {
            let node = self.flat.surface(&shadow.hit).node;
            format!("hidden by {} at t {:.4}", self.node(node), shadow.hit.t)
        } else {
            "seen".into()
        };
        let kind = if light.delta { "probability" } else { "pdf" };
        vec![
            format!(
                "   looks for light towards {}, {distance}, {kind} {:.5}, radiance {}: {seen} ({} nodes, {} triangles)",
                vector(light.direction),
                light.pdf,
                vector(light.radiance),
                shadow.counts.nodes,
                shadow.counts.triangles
            ),
            format!(
                "   f·cos {}, pdf of the surface {pdf:.5}, weight {weight:.4}: adds {}",
                vector(*f),
                vector(*adds)
            ),
        ]
    }

    fn node(&self, index: u32) -> String {
        match self.scene.nodes.get(index as usize).map(|n| n.name.as_str()) {
            Some(name) if !name.is_empty() => format!("'{name}' (node {index})"),
            _ => format!("node {index}"),
        }
    }

    fn material(&self, index: u32) -> String {
        match self.scene.material_names.get(index as usize) {
            Some(name) if !name.is_empty() => format!("material '{name}'"),
            _ => format!("material {index}"),
        }
    }
}

fn vector(v: Vec3) -> String {
    format!("({:.5}, {:.5}, {:.5})", v.x, v.y, v.z)
}
