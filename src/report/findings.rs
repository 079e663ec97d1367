//! What the data say, in sentences computed from them.
//!
//! Culling times of methods that submit different sets are not comparable by
//! themselves, so frame times lead (always called modelled), and the speed of a
//! method that may lose triangles stands beside what it lost.

use super::claims::{Judged, Ratio, Verdict, ratio};
use super::format::{self, count};
use super::labels::Grid;
use super::metrics::{Metric, known};
use super::rows::may_lose;
use super::style::IDLE;
use super::table::{Cell, Column, Table, column, interval, number};
use crate::results::{RunResult, RunStatus};

/// A run with the index of its combination.
pub(super) type Of<'a> = (usize, &'a RunResult);

/// The key findings, one sentence each; plain text.
pub fn findings(grid: &Grid, judged: &[Judged]) -> Vec<String> {
    let mut out = Vec::new();
    out.extend(shortest(grid));
    out.extend(bolder(grid));
    out.extend(additions(grid));
    out.extend(memory(grid));
    out.extend(claims(judged));
    out.extend(exactness(grid));
    out
}

pub(super) fn done<'a>(grid: &'a Grid, place: usize) -> impl Iterator<Item = Of<'a>> + 'a {
    let cells = grid.cells[place].iter().enumerate();
    cells.filter_map(|(c, cell)| Some((c, (*cell)?))).filter(|(_, r)| r.status == RunStatus::Done)
}

fn frame() -> &'static Metric {
    known("frame_ms_model")
}

/// The shortest modelled frame at a place among the sound methods, or among the others.
pub(super) fn best<'a>(grid: &'a Grid, place: usize, sound: bool) -> Option<Of<'a>> {
    best_of(grid, place, &|r| may_lose(r) != sound)
}

/// The shortest modelled frame at a place among the runs that `keep` holds.
pub(super) fn best_of<'a>(grid: &'a Grid, place: usize, keep: &dyn Fn(&RunResult) -> bool) -> Option<Of<'a>> {
    let candidates = done(grid, place).filter(|(_, r)| keep(r));
    let timed = candidates.filter_map(|c| Some((c, frame().value(c.1)?)));
    timed.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(c, _)| c)
}

/// Whoever culls nothing at a place: over the flat list if that was run.
fn idle<'a>(grid: &'a Grid, place: usize) -> Option<Of<'a>> {
    let mut found: Vec<Of> = done(grid, place).filter(|(_, r)| r.culling == IDLE).collect();
    found.sort_by_key(|(_, r)| r.spec.structure.kind != "list");
    found.first().copied()
}

/// How many times `b` is faster than `a`.
fn faster(a: &RunResult, b: &RunResult) -> Ratio {
    ratio(&[(frame().values(a), frame().values(b))])
}

fn bracket((r, low, high): Ratio) -> String {
    if low == high {
        return format::ratio(r);
    }
    format!("{} [{}, {}]", format::ratio(r), format::number(low, 3), format::number(high, 3))
}

/// "1.05 × faster", "1.02 × slower": the number is never below 1, the word says which way.
fn change(faster: f64) -> String {
    let (ratio, word) = if faster < 1.0 { (1.0 / faster, "slower") } else { (faster, "faster") };
    if ratio < 1.005 { "as fast".into() } else { format!("{} {word}", format::ratio(ratio)) }
}

/// Who wins where: scenes with the same winner share a sentence.
fn shortest(grid: &Grid) -> Vec<String> {
    let mut winners: Vec<(usize, Vec<String>)> = Vec::new();
    for (place, name) in grid.places.iter().enumerate() {
        let Some((winner, run)) = best(grid, place, true) else { continue };
        let mut text = format!("{name} ({} ms", format::number(frame().value(run).unwrap_or(f64::NAN), 3));
        if let Some((_, base)) = idle(grid, place).filter(|(c, _)| *c != winner) {
            text += &format!(
                ", {} faster than {}",
                bracket(faster(base, run)),
                grid.combinations[idle(grid, place).map_or(0, |i| i.0)]
            );
        }
        // A winner that the trials cannot tell from the next is not one.
        let ties = done(grid, place).filter(|(c, r)| *c != winner && !may_lose(r) && frame().value(r).is_some());
        let ties: Vec<&str> = ties
            .filter(|(_, r)| {
                let (ratio, low, _) = faster(r, run);
                low <= 1.0 || ratio < 1.005
            })
            .map(|(c, _)| grid.combinations[c].as_str())
            .collect();
        text += &match ties.len() {
            0 => String::new(),
            1 => format!(", not told apart from {}", ties[0]),
            n => format!(", not told apart from {} and {} more", ties[0], n - 1),
        };
        text.push(')');
        match winners.iter_mut().find(|(w, _)| *w == winner) {
            Some((_, places)) => places.push(text),
            None => winners.push((winner, vec![text])),
        }
    }
    let sentence = |(w, places): (usize, Vec<String>)| {
        format!(
            "Shortest modelled frame among methods that must not lose visible triangles: {} on {}.",
            grid.combinations[w],
            places.join("; ")
        )
    };
    // Where every scene has a winner of its own, the table below says it better.
    winners.sort_by_key(|(_, places)| std::cmp::Reverse(places.len()));
    let rest = winners.get(3..).unwrap_or_default();
    let scenes = rest.iter().map(|(_, places)| places.len() as u64).sum();
    let more = (!rest.is_empty()).then(|| {
        let methods = count(rest.len() as u64, "more method", "more methods");
        format!("On {}, {methods}: see the table.", count(scenes, "other scene", "other scenes"))
    });
    winners.into_iter().take(3).map(sentence).chain(more).collect()
}

/// Where an aggressive method models a shorter frame still, and at what price.
fn bolder(grid: &Grid) -> Option<String> {
    let mut parts = Vec::new();
    for (place, name) in grid.places.iter().enumerate() {
        let (Some((_, sound)), Some((c, bold))) = (best(grid, place, true), best(grid, place, false)) else { continue };
        let gain = faster(sound, bold);
        if gain.1 <= 1.0 || gain.0 < 1.005 {
            continue;
        }
        let lost = known("false_cull_ppm").value(bold);
        let lost = lost.map_or_else(
            || "errors not judged".into(),
            |p| format!("losing {} pixels per million", format::number(p, 3)),
        );
        parts.push(format!("{} on {name} ({} faster, {lost})", grid.combinations[c], bracket(gain)));
    }
    let any = grid.runs().any(may_lose);
    match (parts.is_empty(), any) {
        (_, false) => None,
        (true, true) => Some("No aggressive method models a shorter frame than the best sound one.".into()),
        (false, true) => {
            Some(format!("Aggressive (†) and shorter still in modelled frame time: {}.", parts.join("; ")))
        }
    }
}

/// What one more test does: every pair of cullings of which the second has one
/// more term, over all scenes and structures that ran both.
fn additions(grid: &Grid) -> Vec<String> {
    let cullings = &grid.legend.cullings;
    let mut out = Vec::new();
    for with in cullings {
        let without = match with.rsplit_once('+') {
            Some((head, _)) => head,
            None if with != IDLE => IDLE,
            None => continue,
        };
        let term = with.rsplit('+').next().unwrap_or(with);
        let mut pairs: Vec<(usize, &RunResult, &RunResult)> = Vec::new();
        for place in 0..grid.places.len() {
            for (c, b) in done(grid, place).filter(|(_, r)| r.culling == *with) {
                let same = |x: &Of| x.1.culling == without && grid.variant_of[x.0] == grid.variant_of[c];
                pairs.extend(done(grid, place).find(same).map(|(_, a)| (place, a, b)));
            }
        }
        out.extend(addition(grid, term, without, &pairs));
    }
    out
}

fn addition(grid: &Grid, term: &str, without: &str, pairs: &[(usize, &RunResult, &RunResult)]) -> Option<String> {
    let timed: Vec<_> =
        pairs.iter().filter(|(_, a, b)| frame().value(a).is_some() && frame().value(b).is_some()).collect();
    let values: Vec<_> = timed.iter().map(|(_, a, b)| (frame().values(a), frame().values(b))).collect();
    if values.is_empty() {
        return None;
    }
    let overall = ratio(&values);
    let (r, low, high) = overall;
    let to = if without == IDLE { "over no culling".to_string() } else { format!("added to {without}") };
    let mut text = format!("{term} {to}: ");
    text += &match (low > 1.0 && r >= 1.005, high < 1.0 && r <= 1.0 / 1.005) {
        (true, _) => format!("the modelled frame is {} faster", bracket(overall)),
        (_, true) => format!("the modelled frame is {} slower", bracket((1.0 / r, 1.0 / high, 1.0 / low))),
        _ => "no difference in modelled frame time beyond 0.5 % or the spread of the trials".into(),
    };
    if values.len() > 1 {
        let medians = |v: &[f64]| crate::stats::median(v);
        let single = |i: usize| medians(&values[i].0) / medians(&values[i].1);
        let mut order: Vec<usize> = (0..values.len()).collect();
        order.sort_by(|a, b| single(*a).total_cmp(&single(*b)));
        let (least, most) = (order[0], order[order.len() - 1]);
        // Away from the mean's side: what is slower is told from the least slow on.
        let (least, most) = if r < 1.0 { (most, least) } else { (least, most) };
        // Each with its own word: pairs may differ in direction from their mean.
        let at = |i: usize| format!("{} on {} in {}", change(single(i)), grid.places[timed[i].0], timed[i].2.structure);
        text += &format!(" (geometric mean of {} pairs, from {} to {})", values.len(), at(least), at(most));
    }
    let share = |name: &str| {
        let of = |r: &RunResult| known(name).value(r).filter(|v| *v > 0.0);
        let logs: Vec<f64> = timed.iter().filter_map(|(_, a, b)| Some((of(b)? / of(a)?).ln())).collect();
        (!logs.is_empty()).then(|| crate::stats::mean(&logs).exp())
    };
    text += &share("mean_triangles")
        .map_or_else(String::new, |s| format!("; triangles submitted × {}", format::number(s, 3)));
    if without != IDLE {
        text +=
            &share("total_cull_ms").map_or_else(String::new, |s| format!(", culling time × {}", format::number(s, 3)));
    }
    let bold = || timed.iter().map(|(_, _, b)| *b).filter(|b| may_lose(b));
    if bold().next().is_some() {
        let worst = bold().filter_map(|b| known("false_cull_ppm").value(b)).max_by(f64::total_cmp);
        text += &worst.map_or_else(
            || "; aggressive (†), its errors were not judged".to_string(),
            |ppm| format!("; aggressive (†), it loses up to {} pixels per million", format::number(ppm, 3)),
        );
    }
    Some(text + ".")
}

fn memory(grid: &Grid) -> Option<String> {
    let metric = known("structure_mib");
    let widest = (0..grid.places.len()).filter_map(|place| {
        let sized = || done(grid, place).filter_map(|(c, r)| Some((c, metric.value(r)?))).filter(|(_, v)| *v > 0.0);
        let small = sized().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let large = sized().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((place, small, large))
    });
    let (place, small, large) = widest.max_by(|a, b| (a.2.1 / a.1.1).total_cmp(&(b.2.1 / b.1.1)))?;
    let (small_c, large_c) = (&grid.combinations[small.0], &grid.combinations[large.0]);
    (large.1 > 1.01 * small.1).then(|| {
        format!(
            "Memory of structure and tests differs most on {}: {} MiB for {small_c}, {} MiB for {large_c} ({}).",
            grid.places[place],
            format::number(small.1, 3),
            format::number(large.1, 3),
            format::ratio(large.1 / small.1),
        )
    })
}

/// How the published claims fared, and which fell.
fn claims(judged: &[Judged]) -> Option<String> {
    let with = |v: Verdict| judged.iter().filter(move |j| j.verdict == v);
    let outcomes = [Verdict::Reproduced, Verdict::ModelOnly, Verdict::Undecided, Verdict::Contradicted];
    let parts: Vec<String> = outcomes
        .into_iter()
        .filter(|v| with(*v).next().is_some())
        .map(|v| {
            let ids: Vec<&str> = with(v).map(|j| j.claim.id.as_str()).collect();
            format!("{} {} ({})", ids.len(), v.word(), ids.join(", "))
        })
        .collect();
    (!judged.is_empty()).then(|| format!("Of {}: {}.", count(judged.len() as u64, "claim", "claims"), parts.join("; ")))
}

/// One sentence on errors over the whole study.
fn exactness(grid: &Grid) -> Option<String> {
    let judged: Vec<&RunResult> = grid.runs().filter(|r| !r.errors.is_empty()).collect();
    if judged.is_empty() {
        return Some("No run was judged against the truth: speeds here stand without their errors.".into());
    }
    let lost = |r: &&&RunResult| known("false_culls").value(r).is_some_and(|v| v > 0.0);
    let culprits = judged.iter().filter(lost).count();
    let worst = grid
        .named()
        .filter_map(|(r, n)| Some((n, known("false_cull_ppm").value(r)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .filter(|(_, ppm)| *ppm > 0.0);
    let mut text = format!("{} judged against the truth: ", count(judged.len() as u64, "run was", "runs were"));
    text += &match (culprits, worst) {
        (0, _) => "none lost a visible triangle.".into(),
        (n, None) => format!("{} lost visible triangles, none a sampled pixel.", count(n as u64, "run", "runs")),
        (n, Some((names, ppm))) => format!(
            "{} lost visible triangles; the worst is {} on {} with {} pixels per million.",
            count(n as u64, "run", "runs"),
            names.combination,
            names.place,
            format::number(ppm, 3)
        ),
    };
    Some(text)
}

/// By scene: the shortest modelled frame among sound methods and among the others.
pub fn best_table(grid: &Grid) -> Table {
    let time = |name: &str| column(name, frame().unit, frame().about).with_interval();
    let mut columns = vec![
        Column::text("scene"),
        Column::text("best sound method"),
        time("frame, modelled"),
        column("of it culling", "ms", "measured").with_interval(),
        column("triangles a frame", "triangles", ""),
    ];
    let any_bold = grid.runs().any(may_lose);
    if any_bold {
        columns.extend([
            Column::text("best aggressive method (†)"),
            time("frame, modelled (†)"),
            column("false-cull pixels (†)", "px/M", "pixels that lost their triangle, per million"),
        ]);
    }
    let mut table = Table::new("best", "Shortest modelled frame, scene by scene", 1, columns);
    for (place, name) in grid.places.iter().enumerate() {
        let named = |c: usize| Cell::Named(grid.combinations[c].clone(), grid.legend.entries[c].look);
        let mut row = vec![Cell::Text(name.clone())];
        match best(grid, place, true) {
            Some((c, r)) => row.extend([
                named(c),
                interval(frame().interval(r)),
                interval(known("cull_ms").interval(r)),
                number(known("mean_triangles").value(r)),
            ]),
            None => row.extend(std::iter::repeat_n(Cell::Missing, 4)),
        }
        if any_bold {
            match best(grid, place, false) {
                Some((c, r)) => {
                    row.extend([named(c), interval(frame().interval(r)), number(known("false_cull_ppm").value(r))]);
                }
                None => row.extend(std::iter::repeat_n(Cell::Missing, 3)),
            }
        }
        table.rows.push(row);
    }
    table.caption =
        "Sound: exact or conservative, it must not lose visible triangles. Brackets: 95 % bootstrap interval \
                     over trials. “Modelled” is derived, not measured."
            .into();
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_has_a_number_above_one_and_a_word_for_its_direction() {
        let plain = |x: f64| change(x).replace('\u{A0}', " ");
        assert_eq!(plain(1.25), "1.25 × faster");
        assert_eq!(plain(0.956), "1.05 × slower");
        assert_eq!(plain(0.974), "1.03 × slower");
        assert_eq!((plain(1.0).as_str(), plain(0.997).as_str()), ("as fast", "as fast"));
    }
}
