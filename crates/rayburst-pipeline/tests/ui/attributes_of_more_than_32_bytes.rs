use rayburst_pipeline::{HitGroup, ShaderTable};

fn main() {
    let mut table = ShaderTable::new();
    let group = HitGroup::<u32, [u8; 33]>::procedural("boxes", |shader| {
        shader.report_hit(1.0, 0, [0; 33]);
    });
    table.hit(&group, ());
}
