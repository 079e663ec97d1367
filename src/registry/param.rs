//! Parameters as data: name, type, default, what is allowed, and where it is asked for.

use super::{Spec, Value};
use crate::error::{Error, Result, did_you_mean};

/// A declared parameter.
#[derive(Debug)]
pub struct Param {
    pub name: &'static str,
    pub default: Default,
    pub about: &'static str,
}

/// Type, default and allowed values in one.
#[derive(Debug)]
pub enum Default {
    Int {
        value: i64,
        min: i64,
        max: i64,
    },
    Float {
        value: f64,
        min: f64,
        max: f64,
    },
    Bool(bool),
    /// The first choice is the default.
    Choice(&'static [&'static str]),
    /// Any of the others, but [`Spec::resolve`] leaves the default out, given or not: for
    /// a parameter that came after runs were stored, whose ids must not change.
    Later(&'static Default),
    /// As `of`; but where the parameter `with` is none of `is`, nothing asks for it, and
    /// [`Spec::resolve`] refuses all but its default.
    Only {
        with: &'static str,
        is: &'static [&'static str],
        of: &'static Default,
    },
    /// One of these names. Not given, it is taken from the axis of the same name,
    /// and [`Spec::resolve`] leaves it out.
    Axis(&'static [&'static str]),
}

impl Default {
    pub fn value(&self) -> Value {
        match self {
            Default::Int { value, .. } => Value::Int(*value),
            Default::Float { value, .. } => Value::Float(*value),
            Default::Bool(b) => Value::Bool(*b),
            Default::Choice(c) => Value::Text(c[0].to_string()),
            Default::Later(d) | Default::Only { of: d, .. } => d.value(),
            Default::Axis(_) => Value::Text("the axis' value".to_string()),
        }
    }
}

impl Default {
    /// What is allowed, whenever it came and wherever it is asked for.
    pub fn plain(&self) -> &Default {
        match self {
            Default::Later(d) | Default::Only { of: d, .. } => d.plain(),
            other => other,
        }
    }

    /// Parameters, and what they must be for this one to have an effect.
    pub fn conditions(&self) -> Vec<(&'static str, &'static [&'static str])> {
        let (mut out, mut default) = (Vec::new(), self);
        while let Default::Later(of) | Default::Only { of, .. } = default {
            if let Default::Only { with, is, .. } = default {
                out.push((*with, *is));
            }
            default = of;
        }
        out
    }

    /// Whether the default stays unnamed.
    pub fn is_later(&self) -> bool {
        match self {
            Default::Later(_) => true,
            Default::Only { of, .. } => of.is_later(),
            _ => false,
        }
    }
}

impl Param {
    /// # Errors
    /// When `spec` gives it a value that the other parameters leave without effect.
    pub(super) fn is_asked_for(&self, spec: &Spec, params: &[Param]) -> Result<()> {
        let Some(value) = spec.params.get(self.name).filter(|v| **v != self.default.value()) else { return Ok(()) };
        for (with, is) in self.default.conditions() {
            let other = params.iter().find(|p| p.name == with).expect("a condition names a parameter");
            let stated = spec.params.get(with).cloned();
            // What an axis will say is not known yet.
            let unknown = stated.is_none() && matches!(other.default.plain(), Default::Axis(_));
            let stated = stated.unwrap_or_else(|| other.default.value()).to_string();
            if !unknown && !is.contains(&stated.as_str()) {
                let list = is.iter().map(|c| format!("`{with}={c}`")).collect::<Vec<_>>().join(" or ");
                return Err(Error::new(format!("is {value}, which has no effect with `{with}={stated}`"))
                    .key(self.name)
                    .help(format!(
                        "leave `{}` out there, or take {list}; where `{with}` is a list, give `{stated}` an entry of its own",
                        self.name
                    )));
            }
        }
        Ok(())
    }

    pub(super) fn check(&self, value: &Value) -> Result<Value> {
        let name = self.name;
        let wrong = |want: String| Err(Error::new(format!("is {value}, but must be {want}")).key(name));
        match (self.default.plain(), value) {
            (Default::Later(_) | Default::Only { .. }, _) => unreachable!("`plain` looks into it"),
            (Default::Int { min, max, .. }, Value::Int(i)) if (min..=max).contains(&i) => Ok(value.clone()),
            (Default::Int { min, max, .. }, _) => wrong(format!("a whole number from {min} to {max}")),
            (Default::Float { min, max, .. }, Value::Float(x)) if (min..=max).contains(&x) => Ok(value.clone()),
            (Default::Float { min, max, .. }, Value::Int(i)) if *min <= *i as f64 && *i as f64 <= *max => {
                Ok(Value::Float(*i as f64))
            }
            (Default::Float { min, max, .. }, _) => wrong(format!("a number from {min} to {max}")),
            (Default::Bool(_), Value::Bool(_)) => Ok(value.clone()),
            (Default::Bool(_), _) => wrong("true or false".to_string()),
            // By its printed form, so that a choice may be a number: `sectors=8`.
            (Default::Choice(c) | Default::Axis(c), _) if c.contains(&value.to_string().as_str()) => {
                Ok(Value::Text(value.to_string()))
            }
            (Default::Choice(c) | Default::Axis(c), _) => {
                let list = c.iter().map(|c| format!("\"{c}\"")).collect::<Vec<_>>().join(", ");
                let near = did_you_mean(&value.to_string(), c.iter().copied());
                let mut e = Error::new(format!("is {value}, but must be one of {list}")).key(name);
                e.help = near.map(|n| format!("did you mean \"{n}\"?"));
                Err(e)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nothing_asks_for_is_refused() {
        static PARAMS: &[Param] = &[
            Param { name: "arithmetic", default: Default::Axis(&["f32", "f64"]), about: "" },
            Param { name: "split", default: Default::Choice(&["sah", "median"]), about: "" },
            Param {
                name: "bins",
                default: Default::Only {
                    with: "split",
                    is: &["sah"],
                    of: &Default::Only {
                        with: "arithmetic",
                        is: &["f32"],
                        of: &Default::Later(&Default::Int { value: 16, min: 2, max: 32 }),
                    },
                },
                about: "",
            },
        ];
        let resolved = |text: &str| Spec::parse(text).unwrap().resolve(PARAMS).map(|s| s.to_string());
        assert_eq!(resolved("bvh:bins=8").unwrap(), "bvh:bins=8,split=sah");
        assert_eq!(resolved("bvh:split=median,bins=16").unwrap(), "bvh:split=median", "the default is harmless");
        assert_eq!(resolved("bvh:arithmetic=f32,bins=8").unwrap(), "bvh:arithmetic=f32,bins=8,split=sah");
        let e = resolved("bvh:split=median,bins=8").unwrap_err();
        assert!(e.to_string().contains("is 8, which has no effect with `split=median`"), "{e}");
        assert_eq!(
            e.help.as_deref(),
            Some(
                "leave `bins` out there, or take `split=sah`; where `split` is a list, give `median` an entry of its own"
            )
        );
        assert!(resolved("bvh:arithmetic=f64,bins=8").unwrap_err().to_string().contains("`arithmetic=f64`"));
        assert!(resolved("bvh:bins=33,split=median").unwrap_err().to_string().contains("from 2 to 32"));
    }
}
