use rayburst_pipeline::HitGroup;

fn main() {
    HitGroup::<u32, [f32; 2]>::procedural("boxes", |shader| {
        shader.report_hit(1.0, 0, [0.0; 3]);
    });
}
