//! Just enough of an XML reader to check an SVG: tags balance, attributes are
//! quoted, entities are known, and the texts come out.

/// Contents of all `<text>` elements.
pub fn texts(xml: &str) -> Result<Vec<String>, String> {
    let mut open: Vec<&str> = Vec::new();
    let mut texts = Vec::new();
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        let content = &rest[..start];
        if content.contains('>') {
            return Err(format!("a bare > in {content:?}"));
        }
        if open.last() == Some(&"text") {
            texts.push(unescape(content)?);
        }
        let end = tag_end(&rest[start..]).ok_or("a tag without end")? + start;
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name) {
                return Err(format!("</{name}> closes nothing"));
            }
            continue;
        }
        let body = tag.strip_suffix('/').unwrap_or(tag);
        attributes(body)?;
        if body.len() == tag.len() {
            open.push(body.split_whitespace().next().unwrap_or(""));
        }
    }
    if open.is_empty() { Ok(texts) } else { Err(format!("{open:?} never close")) }
}

/// The `>` that is not inside a quoted value.
fn tag_end(text: &str) -> Option<usize> {
    let mut quoted = false;
    text.char_indices().find_map(|(i, c)| {
        quoted ^= c == '"';
        (c == '>' && !quoted).then_some(i)
    })
}

fn attributes(tag: &str) -> Result<(), String> {
    let mut rest = tag.split_once(char::is_whitespace).map_or("", |(_, r)| r).trim();
    while !rest.is_empty() {
        let (name, after) = rest.split_once("=\"").ok_or_else(|| format!("no value in {rest:?}"))?;
        let (value, after) = after.split_once('"').ok_or_else(|| format!("no end of {name}"))?;
        unescape(value)?;
        if name.contains(char::is_whitespace) || value.contains('<') {
            return Err(format!("bad attribute {name}=\"{value}\""));
        }
        rest = after.trim_start();
    }
    Ok(())
}

fn unescape(text: &str) -> Result<String, String> {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('&') {
        out += &rest[..at];
        let end = rest[at..].find(';').ok_or_else(|| format!("a bare & in {text:?}"))? + at;
        out += match &rest[at + 1..end] {
            "amp" => "&",
            "lt" => "<",
            "gt" => ">",
            "quot" => "\"",
            "apos" | "#39" => "'",
            other => return Err(format!("unknown entity {other}")),
        };
        rest = &rest[end + 1..];
    }
    Ok((out + rest).trim().to_string())
}
