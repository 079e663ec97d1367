//! Mistakes in rules and claims, also those that match nothing.

use super::HEAD;
use super::mistakes::{MATRIX, check};

#[test]
fn rules_that_match_nothing_are_mistakes() {
    let head = format!("{HEAD}{MATRIX}");
    check(
        &head,
        &[
            (
                "[[exclude]]\nstructure = \"octree\"\nwhy = \"x\"",
                15,
                1,
                "exclude.0",
                "selects no cell",
                "`structure` holds list",
            ),
            (
                "[[exclude]]\nstructure = \"list:leaf_size>64\"\nwhy = \"x\"",
                15,
                1,
                "exclude.0",
                "selects no cell",
                "`structure` holds list",
            ),
            ("[[exclude]]\nstructure = \"list\"\n", 15, 1, "exclude.0.why", "is missing", "why ="),
            ("[[exclude]]\nstructure = \"list\"\nwhy = \" \"", 17, 7, "exclude.0.why", "is empty", "why ="),
            ("[[exclude]]\nwhy = \"x\"", 15, 1, "exclude.0", "names no axis", "say which"),
            ("[[exclude]]\nstructure = \"list\"\nwhy = \"x\"", 12, 2, "matrix", "every cell is excluded", "narrow"),
            (
                "[[exclude]]\nstructur = \"list\"\nwhy = \"x\"",
                16,
                1,
                "exclude.0.structur",
                "unknown axis",
                "`structure`",
            ),
            (
                "[[exclude]]\nstructure = \"lst\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "unknown structure",
                "`list`",
            ),
            (
                "[[exclude]]\nstructure = \"octree:dpth>3\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "no parameter",
                "`depth`",
            ),
            (
                "[[exclude]]\nstructure = \"octree:depth>\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "not a condition",
                "key>=value",
            ),
            (
                "[[exclude]]\nstructure = \"octree:root=sphere\"\nwhy = \"x\"",
                16,
                13,
                "exclude.0.structure",
                "is never sphere",
                "aabb, cube",
            ),
            (
                "[[exclude]]\nculling = \"normal_mask:rays=view\"\nwhy = \"x\"",
                16,
                11,
                "exclude.0.culling",
                "is never view",
                "leave the condition out",
            ),
            (
                "[[exclude]]\nstructure = { kind = \"octree\", depth = { form = 3 } }\nwhy = \"x\"",
                16,
                42,
                "exclude.0.structure.depth.form",
                "unknown bound",
                "`from`",
            ),
            ("[[exclude]]\nscene = \"z9\"\nwhy = \"x\"", 16, 9, "exclude.0.scene", "there is no scene", "a, b"),
            ("[[include]]\nstructure = \"list\"", 15, 1, "include.0", "adds no cell", "remove"),
            ("[[include]]", 15, 1, "include.0", "fixes no axis", "cells to add"),
            ("[[include]]\nstructre = \"list\"", 16, 1, "include.0.structre", "unknown axis", "`structure`"),
            ("[[include]]\nstructure = \"octree:depht=3\"", 16, 21, "include.0.structure", "no parameter", "`depth`"),
            ("[[includes]]\nstructure = \"octree\"", 15, 3, "includes", "unknown key", "`include`"),
        ],
    );
}

#[test]
fn mistakes_in_claims_name_place_and_remedy() {
    let head = format!(
        "{HEAD}[matrix]\nstructure = [\"list\", \"octree\"]\nculling = [\"none\"]\n[[claim]]\nid = \"c\"\ntext = \"t\"\nsource = \"s\"\n"
    );
    let num = "numerator = { structure = \"list\" }\n";
    let den = "denominator = { structure = \"octree\" }\n";
    let metric = "metric = \"cull_ms\"\n";
    let own = |text: String| -> &'static str { Box::leak(text.into_boxed_str()) };
    check(
        &head,
        &[
            (own(format!("{metric}{num}{den}")), 15, 1, "claim.0.relation", "is missing", "\"best\""),
            (own(format!("{metric}{num}{den}relation = \"=\"")), 22, 12, "claim.0.relation", "one of", "\"<\""),
            (
                own(format!("{num}{den}relation = \"<\"\nmetric = \"cul_ms\"")),
                22,
                10,
                "claim.0.metric",
                "unknown metric",
                "\"cull_ms\"",
            ),
            (own(format!("{metric}{num}relation = \"<\"")), 15, 1, "claim.0.denominator", "is missing", "select runs"),
            (
                own(format!("{metric}{num}denominator = \"octree\"\nrelation = \"<\"")),
                21,
                15,
                "claim.0.denominator",
                "table of axes",
                "write {",
            ),
            (
                own(format!("{metric}{num}denominator = {{}}\nrelation = \"<\"")),
                21,
                15,
                "claim.0.denominator",
                "selects everything",
                "structure",
            ),
            (
                own(format!("{metric}{num}denominator = {{ structure = \"bsp\" }}\nrelation = \"<\"")),
                15,
                1,
                "claim.0.denominator",
                "selects no run",
                "[matrix]",
            ),
            (own(format!("{metric}{num}{den}relation = \"ratio\"")), 15, 1, "claim.0.published", "is missing", "3.35"),
            (own(format!("{metric}{num}relation = \"value\"")), 15, 1, "claim.0.published", "is missing", "3.35"),
            (
                own(format!("{metric}{num}{den}relation = \"zero\"")),
                21,
                15,
                "claim.0.denominator",
                "about one selection",
                "remove it",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"ratio\"\npublished = [4, 3]")),
                23,
                13,
                "claim.0.published",
                "must be a ratio",
                "[1.71, 1.79]",
            ),
            (
                // A share may be 0, a ratio not.
                own(format!("{metric}{num}{den}relation = \"ratio\"\npublished = [0, 3]")),
                23,
                13,
                "claim.0.published",
                "must be a ratio",
                "[1.71, 1.79]",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\npublished = {{ a = 3 }}")),
                23,
                13,
                "claim.0.published",
                "no groups",
                "for_each",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nfor_each = \"scene\"\npublished = {{ q = 3 }}")),
                24,
                15,
                "claim.0.published.q",
                "no scene `q`",
                "`a`",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"grows\"")),
                22,
                12,
                "claim.0.relation",
                "triangle count",
                "for_each",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nfor_each = \"scenes\"")),
                23,
                12,
                "claim.0.for_each",
                "unknown axis",
                "`scene`",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nfor_each = \"structure\"")),
                15,
                1,
                "claim.0",
                "compares nothing",
                "for_each",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\ntolerance = -1")),
                23,
                13,
                "claim.0.tolerance",
                "share",
                "0.25",
            ),
            (
                own(format!("{metric}{num}relation = \"best\"")),
                15,
                1,
                "claim.0.denominator",
                "is missing",
                "select runs",
            ),
            (
                own(format!("metric = \"fps_spread_model\"\n{num}{den}relation = \"best\"")),
                22,
                12,
                "claim.0.relation",
                "no value of `fps_spread_model` is better",
                "fps_mean_model",
            ),
            (
                own(format!("metric = \"fps_mean_modle\"\n{num}{den}relation = \"<\"")),
                19,
                10,
                "claim.0.metric",
                "unknown metric",
                "\"fps_mean_model\"",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"best\"\nfor_each = \"scene\"")),
                15,
                1,
                "claim.0.numerator",
                "no run that the denominator selects",
                "all that compete",
            ),
            (
                own(format!("{metric}{num}denominator = {{ structure = \"li*\" }}\nrelation = \"best\"")),
                15,
                1,
                "claim.0.denominator",
                "no run beside those of the numerator",
                "widen it",
            ),
            (
                own(format!("{metric}{num}denominator = {{ structure = \"*\" }}\nrelation = \"best\"")),
                15,
                1,
                "claim.0.relation",
                "a group holds several",
                "for_each = \"scene\"",
            ),
            (
                own(format!("{metric}{num}relation = \"value\"\npublished = \"high\"")),
                22,
                13,
                "claim.0.published",
                "must be a number",
                "[1.71, 1.79]",
            ),
            (
                own(format!("{metric}{num}{den}relation = \"<\"\nwhy = 1")),
                23,
                1,
                "claim.0.why",
                "unknown key",
                "known here",
            ),
        ],
    );
}
