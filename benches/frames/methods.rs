//! The methods of the sweep: every registered walk that leaves out what is hidden, with its
//! defaults before several tests and on several structures, and with every parameter once
//! at another value.

use cullmark::culling::{WALKS, make_walk};
use cullmark::registry::{Default as Allowed, Param, Spec, Value};

/// Walks with their defaults run over all of these that they accept; variants over the first.
pub const STRUCTURES: &[&str] = &["bvh", "octree", "bsp", "portal_octree"];

/// Variants run with the second.
pub const CULLINGS: &[&str] = &["none", "frustum", "frustum+back_face:arithmetic=filtered"];

/// Combinations beside those that the registry suggests; of walks that are there.
const MORE: &[&str] = &["portals:clip=false,still=true"];

/// A walk, what stands before it, and whether all structures or the first one that will do.
pub struct Method {
    pub walk: Spec,
    pub culling: &'static str,
    pub everywhere: bool,
}

impl Method {
    pub fn name(&self) -> String {
        format!("{} {}", self.walk, self.culling)
    }
}

/// Values of a parameter other than its default: the other side of a switch, the other
/// choices, the least number.
fn others(param: &Param) -> Vec<Value> {
    let default = param.default.value();
    let all = match param.default.plain() {
        Allowed::Bool(b) => vec![Value::Bool(!b)],
        Allowed::Choice(names) => names.iter().map(|n| Value::Text(n.to_string())).collect(),
        Allowed::Int { min, .. } => vec![Value::Int(*min)],
        Allowed::Float { min, .. } => vec![Value::Float(*min)],
        _ => Vec::new(),
    };
    all.into_iter().filter(|v| *v != default).collect()
}

/// All methods whose walk's text contains `wanted`.
///
/// # Errors
/// When [`MORE`] names a parameter that a registered walk does not have.
pub fn all(wanted: &str) -> cullmark::Result<Vec<Method>> {
    let mut methods = Vec::new();
    let mut variants: Vec<Spec> = Vec::new();
    for walk in WALKS {
        let (made, plain) = make_walk(&Spec::new(walk.name))?;
        if !made.removes().occluded {
            continue;
        }
        methods.extend(CULLINGS.iter().map(|c| Method { walk: plain.clone(), culling: c, everywhere: true }));
        for param in walk.params {
            let with = |v| Spec::new(walk.name).with(param.name, v);
            // What another parameter leaves without effect is refused, and is no variant.
            variants.extend(others(param).into_iter().filter_map(|v| Some(make_walk(&with(v)).ok()?.1)));
        }
    }
    for more in MORE {
        let spec = Spec::parse(more)?;
        if WALKS.iter().any(|w| w.name == spec.kind) {
            variants.push(make_walk(&spec)?.1);
        }
    }
    methods.extend(variants.into_iter().map(|walk| Method { walk, culling: CULLINGS[1], everywhere: false }));
    methods.retain(|m| m.walk.to_string().contains(wanted));
    // What the frustum alone submits, beside them.
    let frustum = make_walk(&Spec::new("depth_first"))?.1;
    methods.push(Method { walk: frustum, culling: CULLINGS[1], everywhere: false });
    Ok(methods)
}
