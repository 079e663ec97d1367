//! Numbers as people read them, and text made safe for HTML, CSV, Markdown and LaTeX.

/// Between groups of three digits; narrow and unbreakable.
pub const THIN: char = '\u{202F}';

/// About `digits` significant digits, thousands set apart: `0.0123`, `4.57`, `12 345`.
/// Whole numbers below 100 000 000 keep all their digits.
pub fn number(x: f64, digits: i32) -> String {
    if !x.is_finite() {
        return if x.is_nan() {
            "n/a".into()
        } else if x > 0.0 {
            "∞".into()
        } else {
            "−∞".into()
        };
    }
    if x == 0.0 {
        return "0".into();
    }
    if x.fract() == 0.0 && x.abs() < 1e8 {
        return grouped(&format!("{x:.0}"));
    }
    let magnitude = x.abs().log10().floor() as i32;
    if !(-4..15).contains(&magnitude) {
        return scientific(x, digits);
    }
    // Rounding may lift 9.996 to 10.0; one digit more or less is no matter there.
    grouped(&format!("{x:.*}", (digits - 1 - magnitude).max(0) as usize))
}

fn scientific(x: f64, digits: i32) -> String {
    let text = format!("{x:.*e}", (digits - 1).max(0) as usize);
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!("{}·10^{}", mantissa.replace('-', "−"), exponent.replace('-', "−"))
}

/// Puts thin spaces between groups of three and a real minus in front.
pub fn grouped(plain: &str) -> String {
    let (sign, digits) = plain.strip_prefix('-').map_or(("", plain), |d| ("−", d));
    let (whole, fraction) = digits.split_once('.').map_or((digits, None), |(w, f)| (w, Some(f)));
    let mut out = String::from(sign);
    for (i, c) in whole.chars().enumerate() {
        // Four digits stay together: 2014 reads better than 2 014.
        if i > 0 && (whole.len() - i).is_multiple_of(3) && whole.len() > 4 {
            out.push(THIN);
        }
        out.push(c);
    }
    if let Some(f) = fraction {
        out.push('.');
        out += f;
    }
    out
}

/// Short tick labels: `0.5`, `20`, `1.5k`, `2M`, `1e−8`.
pub fn tick(x: f64) -> String {
    if x != 0.0 && x.abs() < 1e-3 {
        return format!("{x:e}").replace('-', "−");
    }
    let (scaled, suffix) = match x.abs() {
        a if a >= 1e9 => (x / 1e9, "G"),
        a if a >= 1e6 => (x / 1e6, "M"),
        a if a >= 1e4 => (x / 1e3, "k"),
        _ => (x, ""),
    };
    let text = format!("{scaled:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{}{suffix}", text.replace('-', "−"))
}

/// `1.23 [1.10, 1.40]`.
pub fn interval(value: f64, low: f64, high: f64) -> String {
    if low == high {
        return number(value, 3);
    }
    format!("{} [{}, {}]", number(value, 3), number(low, 3), number(high, 3))
}

/// `3.4 ×`.
pub fn ratio(x: f64) -> String {
    format!("{}\u{00A0}×", number(x, 3))
}

pub fn html(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&#39;",
            c => out.push(c),
        }
    }
    out
}

/// One CSV field (RFC 4180). A leading `=`, `+`, `-` or `@` in text would run as
/// a formula in a spreadsheet, so it gets an apostrophe in front.
pub fn csv(field: &str) -> String {
    let numeric = field.parse::<f64>().is_ok();
    let risky = !numeric && field.starts_with(['=', '+', '-', '@', '\t', '\r']);
    let field = if risky { format!("'{field}") } else { field.to_string() };
    if field.contains([',', '"', '\n', '\r']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field }
}

pub fn markdown(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '|' | '*' | '_' | '`' | '\\' | '<' | '>' | '[' | ']' => {
                out.push('\\');
                out.push(c);
            }
            '\n' | '\r' => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

pub fn latex(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => {
                out.push('\\');
                out.push(c);
            }
            '~' => out += "\\textasciitilde{}",
            '^' => out += "\\textasciicircum{}",
            '\\' => out += "\\textbackslash{}",
            '<' => out += "\\textless{}",
            '>' => out += "\\textgreater{}",
            '|' => out += "\\textbar{}",
            '†' => out += "\\dag{}",
            '–' => out += "--",
            '…' => out += "\\ldots{}",
            '“' => out += "``",
            '”' => out += "''",
            '’' => out.push('\''),
            '±' => out += "$\\pm$",
            '→' => out += "$\\to$",
            '×' => out += "$\\times$",
            '−' => out += "$-$",
            '·' => out += "$\\cdot$",
            '∞' => out += "$\\infty$",
            'µ' | 'μ' => out += "$\\mu$",
            '≥' => out += "$\\geq$",
            '≤' => out += "$\\leq$",
            THIN => out += "\\,",
            '\u{00A0}' => out.push('~'),
            '\n' | '\r' => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// Lower case, digits and hyphens: file names and anchors.
pub fn slug(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        if c.is_ascii_alphanumeric() {
            out.push(c.to_ascii_lowercase());
        } else if !out.ends_with('-') && !out.is_empty() {
            out.push('-');
        }
    }
    out.trim_end_matches('-').to_string()
}

/// With a capital first letter.
pub fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}

/// "1 frame", "2000 frames".
pub fn count(n: u64, one: &str, many: &str) -> String {
    format!("{} {}", grouped(&n.to_string()), if n == 1 { one } else { many })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_or_four_digits_and_group_thousands() {
        for (x, expected) in [
            (0.0, "0"),
            (0.012345, "0.0123"),
            (4.5678, "4.57"),
            (1234.5, "1234"),
            (12345.678, "12\u{202F}346"),
            (1234567.0, "1\u{202F}234\u{202F}567"),
            (-2.5, "−2.50"),
            (f64::INFINITY, "∞"),
            (f64::NAN, "n/a"),
            (1.5e-7, "1.50·10^−7"),
        ] {
            assert_eq!(number(x, 3), expected, "{x}");
        }
    }

    #[test]
    fn ticks_are_short_and_exact() {
        for (x, expected) in
            [(0.001, "0.001"), (5000.0, "5000"), (15000.0, "15k"), (2.5e6, "2.5M"), (-0.5, "−0.5"), (2e-8, "2e−8")]
        {
            assert_eq!(tick(x), expected);
        }
    }

    #[test]
    fn a_csv_field_is_quoted_when_it_must_be_and_never_a_formula() {
        assert_eq!(csv("a,b"), "\"a,b\"");
        assert_eq!(csv("say \"x\""), "\"say \"\"x\"\"\"");
        assert_eq!(csv("=HYPERLINK(1)"), "'=HYPERLINK(1)");
        assert_eq!(csv("-1.5"), "-1.5");
        assert_eq!(csv("two\nlines"), "\"two\nlines\"");
    }

    #[test]
    fn latex_and_html_specials_are_made_safe() {
        assert_eq!(latex("50% & a_b {x} \\ #1"), "50\\% \\& a\\_b \\{x\\} \\textbackslash{} \\#1");
        assert_eq!(html("<script>'\"&"), "&lt;script&gt;&#39;&quot;&amp;");
        assert_eq!(markdown("a|b_c"), "a\\|b\\_c");
    }
}
