use std::rc::Rc;

use rayburst_pipeline::{HitGroup, ShaderTable};

fn main() {
    let colour = Rc::new(1.0f32);
    let mut table = ShaderTable::new();
    let group =
        HitGroup::triangles("triangles").closest_hit(move |_, payload: &mut f32| *payload = *colour);
    table.hit(&group, ());
}
