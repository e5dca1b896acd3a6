use rayburst_pipeline::{HitGroup, ShaderTable};

fn main() {
    let mut table = ShaderTable::new();
    let callable = table.callable(|_, _: &mut u32| {});
    let group = HitGroup::<u32, ()>::procedural("boxes", move |shader| {
        shader.call_shader(callable, &mut 0);
    });
    table.hit(&group, ());
}
