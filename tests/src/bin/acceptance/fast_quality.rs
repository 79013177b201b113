//! Tip length, tip smoothness and modes beside classical planners, at equal numbers of candidates and at equal time.

use crate::fast_candidates::{
    Candidates, LARGEST_CLEARANCE, NEAREST_END, Rule, SHORTEST_TIME, SHORTEST_TIP_PATH, SMOOTHEST,
    Summary, ahead, least, middle,
};
use crate::fast_cases::{Cases, GENERAL, HARD, PLANNERS, REFERENCE, count};
use crate::fast_picture::{Curve, draw};
use crate::report::Report;
use crate::runs::{CANDIDATES, Unseen, folder};
use crate::scale::Scale;
use crate::spread::median;

/// Share of the cases on which `fast` is ahead of a rival in tip length and tip smoothness at once, %.
const AHEAD_AT_LEAST: f64 = 90.0;
/// Share of the cases on which it is ahead by any other rule, %: it is not behind.
const NOT_BEHIND: f64 = 50.0;
const TREE: &str = "rrt-connect";
/// What `fast` is compared with, the planners first that get nothing of what its paths get after sampling.
const RIVALS: [&str; 4] = [TREE, "straight", "rrt-smooth", "straight-drawn"];
/// What a learned path is for.
const BOTH: [&Rule; 2] = [&SHORTEST_TIP_PATH, &SMOOTHEST];
const OTHERS: [&Rule; 3] = [&SHORTEST_TIME, &LARGEST_CLEARANCE, &NEAREST_END];
/// Most candidates of a request.
const MOST_CANDIDATES: usize = 64;
/// Candidates at the points of the picture.
const POINTS: [usize; 5] = [1, 2, 4, 10, 32];

pub(crate) fn run(report: &mut Report, scale: Scale) {
    for unseen in [REFERENCE, GENERAL, HARD] {
        let command = format!("{}; pcc evaluate --planner …", unseen.command());
        report.group(&format!("quality, {}", unseen.name), &command, |report| {
            quality(report, scale, &unseen)
        });
    }
    let command = "pcc evaluate --planner … --candidates …";
    report.group("time and tip length", command, |report| {
        for unseen in [GENERAL, HARD] {
            picture(report, scale, &unseen)?;
        }
        Ok(())
    });
}

fn quality(report: &mut Report, scale: Scale, unseen: &Unseen) -> anyhow::Result<()> {
    let cases = Cases::unseen(unseen, count(scale))?;
    let name = cases.name;
    let of = |planner| Candidates::of(report, scale, &cases, planner, CANDIDATES);
    let (default, fast) = (of("default")?, of("fast")?);
    let rivals: Vec<Candidates> = RIVALS.map(of).into_iter().collect::<anyhow::Result<_>>()?;
    let in_its_time = rivals
        .iter()
        .map(|rival| in_the_time_of(report, scale, &cases, &fast, rival));
    let in_its_time: Vec<Candidates> = in_its_time.collect::<anyhow::Result<_>>()?;
    let terms = format!("{name}, {CANDIDATES} candidates each");
    for ours in [&fast, &default] {
        at_equal_number(report, &terms, ours, &rivals);
    }
    modes_beside(report, &terms, [&default, &fast], &rivals[0]);
    at_equal_time(report, name, &fast, &in_its_time)?;
    // Where segments are clear, timing ten motions alone costs what RRT-Connect needs in all.
    if unseen.name == HARD.name {
        let terms = terms_of(name, &in_its_time[0]);
        modes_beside(report, &terms, [&default, &fast], &in_its_time[0]);
    }
    for candidates in [&default, &fast]
        .into_iter()
        .chain(&rivals)
        .chain(&in_its_time)
    {
        let of = terms_of(name, candidates);
        candidates.judged.check(report, &of);
    }
    durations(report, name, [&default, &fast, &rivals[0]], &rivals[1]);
    Ok(())
}

/// A rival's candidates where a request takes it as long as one of ours, the number that its time for ten suggests and another one that
/// its time for these does.
fn in_the_time_of(
    report: &Report,
    scale: Scale,
    cases: &Cases,
    ours: &Candidates,
    rival: &Candidates,
) -> anyhow::Result<Candidates> {
    let (mut count, mut ms) = (CANDIDATES, rival.median_ms()?);
    let mut candidates = None;
    for _ in 0..2 {
        count = (count as f64 * ours.median_ms()? / ms).round() as usize;
        count = count.clamp(1, MOST_CANDIDATES);
        let found = Candidates::of(report, scale, cases, rival.planner, count)?;
        ms = found.median_ms()?;
        candidates = Some(found);
    }
    Ok(candidates.expect("two were made"))
}

fn terms_of(name: &str, rival: &Candidates) -> String {
    let count = &rival.result["candidates"];
    format!("{name}, {} with {count} candidates", rival.planner)
}

/// `fast` is judged beside the planners that get nothing of what its paths get, by the medians of a case's candidates; everything else is
/// shown.
fn at_equal_number(report: &mut Report, terms: &str, ours: &Candidates, rivals: &[Candidates]) {
    let planner = ours.planner;
    for (pair, is_judged) in rivals.chunks(2).zip([planner == "fast", false]) {
        let pair: Vec<&Candidates> = pair.iter().collect();
        let share = ahead(ours, &pair, &BOTH, middle);
        let [line, figure] = both_at_once(ours, &pair, share, middle);
        let line = format!("{terms}: {line}, by the medians of a case's candidates");
        if is_judged {
            let bar = format!(">= {AHEAD_AT_LEAST} %");
            report.check(&line, figure, &bar, share >= AHEAD_AT_LEAST);
        } else {
            report.shown(&line, figure);
        }
    }
}

/// The best candidate of each, by every rule by which a request can select one.
fn at_equal_time(
    report: &mut Report,
    name: &str,
    ours: &Candidates,
    rivals: &[Candidates],
) -> anyhow::Result<()> {
    let terms = format!("{name}, equal time");
    for rival in rivals {
        let line = format!(
            "{terms}: {}, ms beside {}",
            terms_of(name, rival),
            ours.planner
        );
        let figure = format!("{:.3} and {:.3}", rival.median_ms()?, ours.median_ms()?);
        report.shown(&line, figure);
    }
    for pair in rivals.chunks(2) {
        let pair: Vec<&Candidates> = pair.iter().collect();
        let share = ahead(ours, &pair, &BOTH, least);
        let [line, figure] = both_at_once(ours, &pair, share, least);
        let line = format!("{terms}: {line}, by the best of a case's candidates");
        let bar = format!(">= {AHEAD_AT_LEAST} %");
        report.check(&line, figure, &bar, share >= AHEAD_AT_LEAST);
    }
    for rule in OTHERS {
        for rival in rivals {
            let share = ahead(ours, &[rival], &[rule], least);
            let line = format!(
                "{terms}: {}'s best ahead of {}'s by {}",
                ours.planner, rival.planner, rule.name
            );
            let figure = format!("{share:.1} % of the cases, what is as good half");
            let bar = format!(">= {NOT_BEHIND} %");
            report.check(&line, figure, &bar, share >= NOT_BEHIND);
        }
    }
    Ok(())
}

/// The line and the figure of a share of cases on which a planner is ahead in all that a learned path is for.
fn both_at_once(ours: &Candidates, pair: &[&Candidates], share: f64, of: Summary) -> [String; 2] {
    let names: Vec<&str> = pair.iter().map(|rival| rival.planner).collect();
    let of_each = pair.iter().copied().map(|rival| {
        let [length, smoothness] = BOTH.map(|rule| ahead(ours, &[rival], &[rule], of));
        let planner = rival.planner;
        format!("{planner}: tip length {length:.1} %, tip smoothness {smoothness:.1} %")
    });
    let of_each: Vec<String> = of_each.collect();
    [
        format!(
            "{} ahead of {} in tip length and tip smoothness at once",
            ours.planner,
            names.join(" and ")
        ),
        format!("{share:.1} % of the cases ({})", of_each.join("; ")),
    ]
}

/// `fast` is judged, by its certified draws.
fn modes_beside(
    report: &mut Report,
    terms: &str,
    [default, fast]: [&Candidates; 2],
    tree: &Candidates,
) {
    let [default, fast, theirs] = [default, fast, tree].map(Candidates::mean_modes);
    let line = format!("{terms}: modes of fast's certified draws, mean");
    let figure = format!("{fast:.3} (default delivers {default:.3})");
    let bar = format!(">= {theirs:.3} ({TREE})");
    report.check(&line, figure, &bar, fast >= theirs);
}

/// `pcc evaluate` selects by `shortest time`: a case's fastest candidate.
fn durations(report: &mut Report, name: &str, all: [&Candidates; 3], straight: &Candidates) {
    let fastest = |candidates: &Candidates, case: usize| least(&candidates.cases[case].duration);
    let cases = 0..straight.cases.len();
    for candidates in all {
        let ratios = cases
            .clone()
            .map(|case| fastest(candidates, case) / fastest(straight, case));
        let ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
        let line = format!(
            "{name}: {}, fastest motion ÷ straight's fastest, median",
            candidates.planner
        );
        report.shown(&line, format!("{:.3}", median(&ratios)));
    }
    let default = all[0];
    let is_slower = |case: &usize| fastest(default, *case) > fastest(straight, *case) + 1e-9;
    let slower = cases.filter(is_slower).map(|case| {
        let [ours, theirs] = [default, straight].map(|candidates| fastest(candidates, case));
        format!("case {case}: {ours:.6} s beside {theirs:.6} s")
    });
    let slower: Vec<String> = slower.collect();
    let line =
        format!("{name}: default selects by shortest time a motion slower than straight's fastest");
    report.none_of(&line, &slower);
}

/// Time of a request against the shortest tip among its candidates, for more and more of them.
fn picture(report: &mut Report, scale: Scale, unseen: &Unseen) -> anyhow::Result<()> {
    let cases = Cases::unseen(unseen, count(scale))?.first(scale.pick(10, 100));
    let mut curves = Vec::new();
    for planner in PLANNERS {
        let mut curve = Curve {
            name: planner,
            points: Vec::new(),
        };
        let mut texts = Vec::new();
        for number in POINTS {
            let candidates = Candidates::of(report, scale, &cases, planner, number)?;
            let solved = candidates
                .cases
                .iter()
                .map(|case| least(&case.tip_length_ratio));
            let solved: Vec<f64> = solved.filter(|ratio| ratio.is_finite()).collect();
            let point = (candidates.median_ms()?, median(&solved));
            texts.push(format!("{number}: {:.2} ms, {:.3}", point.0, point.1));
            curve.points.push(point);
        }
        let line = format!(
            "{}: {planner}, time and shortest tip length ÷ distance by candidates",
            cases.name
        );
        report.shown(&line, texts.join("; "));
        curves.push(curve);
    }
    let file = folder().join(format!("fast-{}.svg", cases.name));
    draw(&file, &format!("{} scenes", cases.name), &curves)?;
    let line = format!("{}: picture of time and tip length", cases.name);
    report.shown(&line, file.display().to_string());
    Ok(())
}
