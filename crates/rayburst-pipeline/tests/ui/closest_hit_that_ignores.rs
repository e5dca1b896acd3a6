use rayburst_pipeline::HitGroup;

fn main() {
    HitGroup::<u32, _, ()>::triangles("triangles").closest_hit(|hit, _| {
        hit.ignore_hit();
    });
}
