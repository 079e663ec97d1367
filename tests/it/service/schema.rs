//! Does a JSON value look as an OpenAPI document says? A small part of JSON Schema, with
//! one thing added: what a schema lists must be there, as `null` if need be, so that a
//! field which a handler drops or renames is missed. Further fields are free.

use serde_json::Value;

/// Fields that an answer leaves out where there is nothing to say.
const OMITTED: &[&str] = &["help", "errors"];

/// Every difference, with its place.
pub fn differences(document: &Value, schema: &Value, value: &Value) -> Vec<String> {
    let mut out = Vec::new();
    check(document, schema, value, "$", &mut out);
    out
}

fn check(document: &Value, schema: &Value, value: &Value, at: &str, out: &mut Vec<String>) {
    if let Some(name) = schema["$ref"].as_str() {
        let target = document.pointer(name.trim_start_matches('#'));
        return check(document, target.unwrap_or_else(|| panic!("nothing at {name}")), value, at, out);
    }
    for part in schema["allOf"].as_array().into_iter().flatten() {
        check(document, part, value, at, out);
    }
    for choice in ["oneOf", "anyOf"] {
        let Some(parts) = schema[choice].as_array() else { continue };
        let tries: Vec<Vec<String>> = parts.iter().map(|p| differences(document, p, value)).collect();
        if tries.iter().all(|t| !t.is_empty()) {
            out.push(format!("{at}: none of {choice}: {tries:?}"));
        }
    }
    let types: Vec<&str> = match &schema["type"] {
        Value::String(one) => vec![one],
        Value::Array(several) => several.iter().filter_map(Value::as_str).collect(),
        _ => vec![],
    };
    if !types.is_empty() && !types.iter().any(|t| is(value, t)) {
        return out.push(format!("{at}: {value} is no {types:?}"));
    }
    if let Some(allowed) = schema["enum"].as_array()
        && !allowed.contains(value)
    {
        out.push(format!("{at}: {value} is not among {allowed:?}"));
    }
    let beyond = |limit: &str, wrong: fn(f64, f64) -> bool| {
        value.as_f64().zip(schema[limit].as_f64()).is_some_and(|(v, l)| wrong(v, l))
    };
    if beyond("minimum", |v, l| v < l) || beyond("maximum", |v, l| v > l) {
        out.push(format!("{at}: {value} is out of range"));
    }
    if let Some(fields) = value.as_object() {
        for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            if !fields.contains_key(name) {
                out.push(format!("{at}: `{name}` is required and missing"));
            }
        }
        for (name, part) in schema["properties"].as_object().into_iter().flatten() {
            match fields.get(name) {
                Some(field) => check(document, part, field, &format!("{at}.{name}"), out),
                None if OMITTED.contains(&name.as_str()) => {}
                None => out.push(format!("{at}: `{name}` is listed and missing")),
            }
        }
        if schema["additionalProperties"].is_object() {
            let known = |name: &&String| schema["properties"].get(name.as_str()).is_none();
            for name in fields.keys().filter(known) {
                check(document, &schema["additionalProperties"], &fields[name], &format!("{at}.{name}"), out);
            }
        }
    }
    if let Some(items) = value.as_array().filter(|_| schema["items"].is_object()) {
        for (i, item) in items.iter().enumerate() {
            check(document, &schema["items"], item, &format!("{at}[{i}]"), out);
        }
    }
}

fn is(value: &Value, kind: &str) -> bool {
    match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("`{other}` is no type of JSON Schema"),
    }
}

#[test]
fn the_checker_sees_what_is_dropped_renamed_or_of_another_type() {
    use serde_json::json;
    let document = json!({ "components": { "schemas": { "Leaf": {
        "type": "object", "required": ["n"],
        "properties": { "n": { "type": "integer", "minimum": 0 }, "word": { "type": ["string", "null"] } }
    } } } });
    let leaf = json!({ "$ref": "#/components/schemas/Leaf" });
    let tree = json!({ "allOf": [leaf, { "type": "object", "properties": { "list": { "type": "array", "items":
        { "oneOf": [{ "type": "null" }, leaf] } } } }] });
    let found = |value: Value| differences(&document, &tree, &value);
    let well = json!({ "n": 1, "word": null, "list": [null, { "n": 2, "word": "b", "more": 1 }] });
    assert!(found(well).is_empty());
    for (bad, says) in [
        (json!({ "word": null, "list": [] }), "`n` is required"),
        (json!({ "n": 1, "wrod": null, "list": [] }), "`word` is listed"),
        (json!({ "n": 1, "word": null }), "`list` is listed"),
        (json!({ "n": 1.5, "word": null, "list": [] }), "no [\"integer\"]"),
        (json!({ "n": -1, "word": null, "list": [] }), "out of range"),
        (json!({ "n": 1, "word": null, "list": [{ "n": "2", "word": "b" }] }), "none of oneOf"),
        (json!([]), "no [\"object\"]"),
    ] {
        let all = found(bad.clone());
        assert!(all.iter().any(|d| d.contains(says)), "{bad}: {all:?}");
    }
}
