use rayburst_pipeline::{HitGroup, ShaderTable};

fn main() {
    let mut table = ShaderTable::new();
    let group = HitGroup::<u32, ()>::procedural("boxes", |shader| {
        if let Some(payload) = shader.payload() {
            *payload += 1;
        }
    });
    table.hit(&group, ());
}
