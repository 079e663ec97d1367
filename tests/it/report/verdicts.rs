//! From intervals to verdicts.

use cullmark::claim::Relation;
use cullmark::report::claims::{Verdict, combine, decide};

#[test]
fn an_interval_decides_a_claim_only_when_it_lies_on_one_side() {
    use Verdict::{Contradicted, Reproduced, Undecided};
    let published = Some([3.5, 3.9]);
    for (relation, (low, high), expected) in [
        (Relation::Less, (0.7, 0.9), Reproduced),
        (Relation::Less, (0.9, 1.1), Undecided),
        (Relation::Less, (1.1, 1.2), Contradicted),
        (Relation::Less, (1.0, 1.0), Contradicted),
        (Relation::Greater, (1.2, 1.5), Reproduced),
        (Relation::Greater, (0.8, 0.99), Contradicted),
        // 2.8 to 4.68 with a tolerance of a fifth.
        (Relation::Ratio, (2.9, 4.6), Reproduced),
        (Relation::Ratio, (2.7, 3.0), Undecided),
        (Relation::Ratio, (1.0, 2.0), Contradicted),
        (Relation::Ratio, (5.0, 6.0), Contradicted),
        (Relation::Grows, (0.2, 0.9), Reproduced),
        (Relation::Grows, (-0.2, 0.9), Undecided),
        (Relation::Greater, (f64::NAN, f64::NAN), Undecided),
        (Relation::Best, (0.7, 0.99), Reproduced),
        (Relation::Best, (0.9, 1.1), Undecided),
        // Level with the best of the rest.
        (Relation::Best, (1.0, 1.0), Undecided),
        (Relation::Best, (1.01, 1.2), Contradicted),
    ] {
        let found = decide(relation, published, 0.2, ((low + high) / 2.0, low, high));
        assert_eq!(found, expected, "{relation:?} [{low}, {high}]");
    }
    assert_eq!(decide(Relation::Ratio, None, 0.2, (1.0, 1.0, 1.0)), Undecided, "nothing was published");
}

#[test]
fn agreement_of_the_model_alone_is_called_that() {
    use Verdict::{Contradicted, ModelOnly, Reproduced, Undecided};
    for (claim_is_modelled, measured, model, expected) in [
        (false, Some(Reproduced), Some(Contradicted), Reproduced),
        // A claim about culling alone: the model of the frame has no say in it.
        (false, Some(Contradicted), Some(Reproduced), Contradicted),
        (false, Some(Undecided), Some(Reproduced), Undecided),
        (false, Some(Contradicted), Some(Undecided), Contradicted),
        (false, None, Some(Reproduced), Undecided),
        (true, Some(Undecided), Some(Reproduced), ModelOnly),
        (true, None, Some(Reproduced), ModelOnly),
        (true, Some(Reproduced), Some(Reproduced), Reproduced),
        (true, Some(Contradicted), Some(Reproduced), ModelOnly),
        (true, Some(Reproduced), Some(Contradicted), Contradicted),
        (false, None, None, Undecided),
    ] {
        assert_eq!(combine(claim_is_modelled, measured, model), expected);
    }
}
