//! Tip length, tip smoothness and modes beside classical planners, at equal numbers of candidates and at equal time.

use crate::fast_candidates::{
    Candidates, LARGEST_CLEARANCE, Lead, NEAREST_END, Rule, SHORTEST_TIME, SHORTEST_TIP_PATH,
    SMOOTHEST, Summary, ahead, least, middle,
};
use crate::fast_cases::{Cases, GENERAL, HARD, PLANNERS, REFERENCE, count};
use crate::fast_equal_time::EqualTime;
use crate::fast_picture::{Curve, draw};
use crate::report::Report;
use crate::runs::{CANDIDATES, Unseen, folder};
use crate::scale::Scale;
use crate::second_look::Judged;
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
    let mut in_its_time = Vec::new();
    for rival in RIVALS {
        let equal = EqualTime::of(scale, &cases, fast.planner, rival)?;
        equal.check(report, name, fast.planner);
        in_its_time.push(equal.rival);
    }
    let terms = format!("{name}, {CANDIDATES} candidates each");
    for ours in [&fast, &default] {
        at_equal_number(report, &terms, ours, &rivals);
    }
    modes_beside(report, &terms, [&default, &fast], &rivals);
    at_equal_time(report, name, &fast, &in_its_time);
    // Where segments are clear, timing ten motions alone costs what RRT-Connect needs in all.
    if unseen.name == HARD.name {
        let terms = format!("{name}, equal time");
        modes_beside(report, &terms, [&default, &fast], &in_its_time);
    }
    for candidates in [&default, &fast]
        .into_iter()
        .chain(&rivals)
        .chain(&in_its_time)
    {
        let of = terms_of(name, candidates);
        candidates.judged.check(report, &of);
    }
    durations(report, name, [&default, &fast], &rivals);
    Ok(())
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
        let lead = ahead(ours, &pair, &BOTH, middle);
        let [line, figure] = both_at_once(ours, &pair, lead, middle);
        let line = format!("{terms}: {line}, by the medians of a case's candidates");
        if is_judged {
            let bar = format!(">= {AHEAD_AT_LEAST} %");
            report.check(&line, figure, &bar, lead.percent >= AHEAD_AT_LEAST);
        } else {
            report.shown(&line, figure);
        }
    }
}

/// The best candidate of each, by every rule by which a request can select one.
fn at_equal_time(report: &mut Report, name: &str, ours: &Candidates, rivals: &[Candidates]) {
    let terms = format!("{name}, equal time");
    for pair in rivals.chunks(2) {
        let pair: Vec<&Candidates> = pair.iter().collect();
        let lead = ahead(ours, &pair, &BOTH, least);
        let [line, figure] = both_at_once(ours, &pair, lead, least);
        let line = format!("{terms}: {line}, by the best of a case's candidates");
        let bar = format!(">= {AHEAD_AT_LEAST} %");
        report.check(&line, figure, &bar, lead.percent >= AHEAD_AT_LEAST);
    }
    for rule in OTHERS {
        for rival in rivals {
            let lead = ahead(ours, &[rival], &[rule], least);
            let line = format!(
                "{terms}: {}'s best ahead of {}'s by {}",
                ours.planner, rival.planner, rule.name
            );
            let figure = format!("{lead}; what is as good half");
            let bar = format!(">= {NOT_BEHIND} %");
            report.check(&line, figure, &bar, lead.percent >= NOT_BEHIND);
        }
    }
}

/// The line and the figure of a share of cases on which a planner is ahead in all that a learned path is for.
fn both_at_once(ours: &Candidates, pair: &[&Candidates], lead: Lead, of: Summary) -> [String; 2] {
    let names: Vec<&str> = pair.iter().map(|rival| rival.planner).collect();
    let of_each = pair.iter().copied().map(|rival| {
        let [length, smoothness] = BOTH.map(|rule| ahead(ours, &[rival], &[rule], of).percent);
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
        format!("{lead} ({})", of_each.join("; ")),
    ]
}

/// `fast` is judged beside the tree, by its certified draws.
fn modes_beside(
    report: &mut Report,
    terms: &str,
    [default, fast]: [&Candidates; 2],
    rivals: &[Candidates],
) {
    let [default, fast, tree] = [default, fast, &rivals[0]].map(Candidates::mean_modes);
    let others = rivals[1..].iter().map(|rival| {
        let count = &rival.result["candidates"];
        format!(
            "{} with {count} candidates {:.3}",
            rival.planner,
            rival.mean_modes()
        )
    });
    let others: Vec<String> = others.collect();
    let line = format!("{terms}: modes of fast's certified draws, mean");
    let figure = format!(
        "{fast:.3} (default delivers {default:.3}; {})",
        others.join(", ")
    );
    let count = &rivals[0].result["candidates"];
    let bar = format!(">= {tree:.3} ({TREE} with {count} candidates)");
    report.check(&line, figure, &bar, fast >= tree);
}

/// `pcc evaluate` selects by `shortest time`: a case's fastest candidate. Ratios are to the straight segments of the second rival.
fn durations(
    report: &mut Report,
    name: &str,
    [default, fast]: [&Candidates; 2],
    rivals: &[Candidates],
) {
    let straight = &rivals[1];
    for candidates in [default, fast].into_iter().chain(rivals) {
        let ratios = fastest(candidates).zip(fastest(straight));
        let ratios: Vec<f64> = ratios.map(|(a, b)| a / b).collect();
        let line = format!(
            "{name}: {}, fastest motion ÷ straight's fastest, median",
            candidates.planner
        );
        report.shown(&line, median_of_finite(&ratios));
    }
    for rival in rivals {
        let both = fastest(default).zip(fastest(rival)).enumerate();
        let slower = both.filter(|(_, (ours, theirs))| *ours > theirs + 1e-9);
        let slower = slower
            .map(|(case, (ours, theirs))| format!("case {case}: {ours:.6} s beside {theirs:.6} s"));
        let slower: Vec<String> = slower.collect();
        let line = format!(
            "{name}: default selects by shortest time a motion slower than {}'s fastest",
            rival.planner
        );
        if rival.planner == straight.planner {
            report.none_of(&line, &slower);
        } else {
            let figure = format!("{} of {} cases", slower.len(), rival.cases.len());
            report.shown(&line, figure);
        }
    }
}

/// Duration of each case's fastest motion, s; infinite where there is none.
fn fastest(candidates: &Candidates) -> impl Iterator<Item = f64> {
    candidates.cases.iter().map(|case| least(&case.duration))
}

/// The median of figures that not every case has, and of how many.
fn median_of_finite(all: &[f64]) -> String {
    let finite: Vec<f64> = all.iter().copied().filter(|x| x.is_finite()).collect();
    let (kept, cases) = (finite.len(), all.len());
    format!("{:.3} ({kept} of {cases} cases have one)", median(&finite))
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
        let (mut texts, mut judged) = (Vec::new(), Judged::default());
        for number in POINTS {
            let candidates = Candidates::of(report, scale, &cases, planner, number)?;
            let ratios = candidates.cases.iter();
            let ratios = ratios.map(|case| least(&case.tip_length_ratio));
            let solved: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
            let point = (candidates.median_ms()?, median(&solved));
            let (count, of) = (solved.len(), candidates.cases.len());
            let (ms, ratio) = point;
            texts.push(format!(
                "{number}: {ms:.2} ms, {ratio:.3} of {count} solved of {of}"
            ));
            curve.points.push(point);
            judged.merge(candidates.judged);
        }
        let line = format!(
            "{}: {planner}, time and shortest tip length ÷ distance by candidates",
            cases.name
        );
        report.shown(&line, texts.join("; "));
        let line = format!("{}: {planner}, of all numbers of candidates", cases.name);
        judged.check(report, &line);
        curves.push(curve);
    }
    let file = folder().join(format!("{}.svg", cases.label));
    draw(&file, &format!("{} scenes", cases.name), &curves)?;
    let line = format!("{}: picture of time and tip length", cases.name);
    report.shown(&line, file.display().to_string());
    Ok(())
}
