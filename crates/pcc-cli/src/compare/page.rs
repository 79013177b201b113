//! The comparison as one self-contained page.

use super::case_sets::CaseSet;
use super::charts;
use super::comparison::{Comparison, PlannerResult, SetResult};
use super::counterparts::{self, Counterpart};
use super::experiments::{Figure, Picture};
use super::figures::{Figures, Paired};
use super::given_options::GivenOptions;
use crate::bootstrap::Interval;
use crate::html::escaped;
use crate::sampler::name_of;

/// Planners whose shares are shown by number of balls.
const BY_BALLS: [&str; 9] = [
    "fast",
    "straight-drawn",
    "rrt-connect",
    "diffusion",
    "diffusion-post",
    "diffusion-guided",
    "c-rrt",
    "w-rrt",
    "apf",
];

const STYLE: &str = "
:root { --ink: #1c2733; --soft: #5b6875; --line: #d4dae0; }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: #fff; margin: 0 auto; max-width: 82rem; padding: 1rem; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; } h2 { margin-top: 2.5rem; border-top: 1px solid var(--line); padding-top: 1rem; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(32rem, 100%), 1fr)); gap: 1rem; }
svg { width: 100%; height: auto; display: block; } .table { overflow-x: auto; }
figure { margin: 2.5rem 0; } .pictures { display: flex; flex-wrap: wrap; gap: .75rem; align-items: flex-end; }
.pictures > .square { flex: 0 0 min(12.2rem, 47%); } .pictures > .upright { flex: 0 1 18rem; }
.pictures > .wide { flex: 1 1 26rem; max-width: 40rem; } .pictures > .broad { flex: 1 1 100%; overflow-x: auto; } .broad svg { min-width: 46rem; }
.pictures:has(> .wide) > .square { flex-basis: min(14.9rem, 47%); } .pictures > i + .square:last-child, .pictures > i + .square:has(+ .wide) { flex-basis: min(20rem, 100%); }
.pictures > i { flex-basis: 100%; height: 0; } polyline { stroke-linejoin: round; } @media (max-width: 40rem) { .pictures > .wide, .pictures > .upright { flex-basis: 100%; } }
.pictures p { margin: 0; font-size: .8rem; color: var(--soft); text-align: center; } figcaption { max-width: 60rem; }
pre { background: #f1f4f7; padding: .5rem .75rem; border-radius: 3px; font-size: .8rem; white-space: pre-wrap; overflow-wrap: anywhere; max-width: 60rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .85rem; white-space: nowrap; }
th, td { padding: .2rem .6rem; text-align: right; border-bottom: 1px solid var(--line); } th:first-child, td:first-child { text-align: left; }
.words td, .words th { text-align: left; white-space: normal; overflow-wrap: anywhere; }
td small { color: var(--soft); } code { background: #f1f4f7; padding: .05rem .3rem; border-radius: 3px; } li { margin: .2rem 0; }
";

/// # Errors
/// Where it is to be the whole page, and does not have all of the paper's figures.
pub(super) fn html(
    comparison: &Comparison,
    figures: &[Figure],
    given: &GivenOptions,
    is_whole: bool,
) -> anyhow::Result<String> {
    let Comparison {
        candidates,
        seed,
        sets,
        ..
    } = comparison;
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>Results</title><link rel=\"icon\" href=\"data:,\"><style>{STYLE}</style></head><body>\
         <h1>Results</h1><p>{}</p>",
        origin(comparison)
    );
    if is_whole {
        counterparts::check(figures)?;
        page += &paper_table()?;
    }
    page.extend(figures.iter().map(|it| figure(it, given)));
    if sets.is_empty() {
        return Ok(page + "</body></html>\n");
    }
    page += &format!(
        "<h2 id=\"planners\">Planners compared</h2><p>{candidates} candidates or attempts a case, seed {seed}, one request at a time. Every case of a \
         set is counted (what a set leaves out is said with it), and all planners answer the same ones; intervals are 95 % by the bootstrap over targets, each \
         with all of its cases. “Success” is the paper's \
         criterion: of the paths as they were drawn (of planners that draw none whole, RRT* and BIT* among them, as they were corrected), a tip within 0.1 L of the target \
         and nine points of the body clear at 64 waypoints. “Certified” is this project's: the whole body, the whole motion and all \
         tendon limits; tip length, smoothness and duration are of certified motions.</p>"
    );
    for set in sets {
        page += &section(comparison, set, given)?;
    }
    Ok(page + "</body></html>\n")
}

/// How the page was made, where, and how its commands are used.
fn origin(comparison: &Comparison) -> String {
    let Comparison {
        machines,
        program,
        measuring_s,
        ..
    } = comparison;
    let named: Vec<String> = machines.iter().map(|it| escaped(it)).collect();
    let named = named.join("; ");
    let place = match machines.len() {
        0 => String::new(),
        1 => format!(" on {named}"),
        count => format!(" on <b>{count} machines, whose times do not compare</b>: {named}"),
    };
    format!(
        "Made by <code>pcc compare</code> (SHA-256 of the program {program}) in {:.1} minutes of measuring{place}. Each command goes into a shell in the \
         repository's folder, after <code>cargo build --release --locked -p planner-daemon -p controller -p pcc-cli</code>, and makes what is above it \
         again in a folder of its own. On the same machine all numbers but times come out the same, except those of RRT* and BIT*, which end by the \
         clock, of what is executed, and of the best candidates at equal time, whose number the times decide.",
        measuring_s / 60.0
    )
}

/// The list of the paper's figures and their counterparts.
fn paper_table() -> anyhow::Result<String> {
    let row = |it: Counterpart| {
        let (label, shows, anchor) = (escaped(it.label), escaped(it.shows), it.anchor);
        format!(
            "<tr><td><code>{label}</code></td><td>{shows}</td><td><a href=\"#{anchor}\">{anchor}</a></td></tr>"
        )
    };
    let rows: String = counterparts::list()?.into_iter().map(row).collect();
    Ok(format!(
        "<h2 id=\"paper\">The paper's figures, and where they are here</h2><p>By their labels in the paper, which has no tables. Figures after these \
         are this project's own. L is the length of a section.</p><div class=\"table\"><table class=\"words\"><tr><th>paper</th><th>what it shows</th>\
         <th>here</th></tr>{rows}</table></div>"
    ))
}

fn figure(it: &Figure, given: &GivenOptions) -> String {
    let picture = |picture: &Picture| {
        let id = picture
            .id
            .map_or_else(String::new, |id| format!(" id=\"{id}\""));
        let Picture { svg, caption, .. } = picture;
        let break_before = if picture.begins_row { "<i></i>" } else { "" };
        format!(
            "{break_before}<div{id} class=\"{}\">{svg}<p>{}</p></div>",
            shape_of(svg),
            escaped(caption)
        )
    };
    let Figure { title, caption, .. } = it;
    let (id, command) = (name_of(&it.name), given.figure_command(it.name));
    let made_by = it.made_by.as_deref().map_or_else(String::new, |commands| {
        format!(
            "<p>Its numbers are from:</p><pre>{}</pre>",
            escaped(commands)
        )
    });
    let pictures: String = it.pictures.iter().map(picture).collect();
    format!(
        "<figure id=\"{id}\"><h3>{title}</h3><div class=\"pictures\">{pictures}</div><figcaption><p>{caption}</p></figcaption><pre>{}</pre>{made_by}</figure>",
        escaped(&command)
    )
}

/// How a picture is laid out, by the ratio of its sides.
fn shape_of(svg: &str) -> &'static str {
    let side = |name: &str| {
        let (_, rest) = svg.split_once(&format!("{name}=\""))?;
        rest.split('"').next()?.parse::<f64>().ok()
    };
    let ratio = side("width").zip(side("height"));
    match ratio.map_or(1.0, |(width, height)| width / height) {
        2.3.. => "broad",
        1.3.. => "wide",
        1.05.. => "upright",
        _ => "square",
    }
}

fn section(
    comparison: &Comparison,
    set: &SetResult,
    given: &GivenOptions,
) -> anyhow::Result<String> {
    let paired = set
        .planners
        .iter()
        .filter_map(|it| Some((it, it.paired.as_ref()?)));
    let against = &comparison.against;
    let paired: String = paired
        .map(|(it, paired)| sentence(against, it, paired))
        .collect();
    Ok(format!(
        "<h2 id=\"set-{}\">{}: {} cases</h2>{}<div class=\"charts\">{}</div>{}<h3><code>{against}</code> beside each other planner, case by case</h3><ul>{paired}</ul><pre>{}</pre>",
        escaped(&set.set),
        escaped(&set.set),
        set.cases,
        CaseSet::left_out_html(&set.set),
        charts_of(set)?
            .map(|svg| format!("<div>{svg}</div>"))
            .concat(),
        table(set),
        escaped(&given.set_command(&set.set)),
    ))
}

fn charts_of(set: &SetResult) -> anyhow::Result<[String; 8]> {
    Ok([
        charts::rows(set, "Success by the paper's criterion", false, |it| {
            it.figures.all.success
        })?,
        charts::rows(set, "Certified", false, |it| it.figures.all.certified)?,
        charts::rows(set, "Seconds a success (log)", true, |it| {
            it.figures.all.seconds_a_success
        })?,
        charts::rows(set, "Seconds a certified motion (log)", true, |it| {
            it.figures.all.seconds_a_certified
        })?,
        charts::rows(set, "Tip length ÷ distance (log)", true, |it| {
            it.figures.all.tip_length_ratio
        })?,
        charts::rows(
            set,
            "Tip smoothness ∫‖p‴‖² (log; less is smoother)",
            true,
            |it| it.figures.all.tip_smoothness,
        )?,
        charts::by_balls(set, "Success by number of balls", &BY_BALLS, |it| {
            it.success
        })?,
        charts::by_balls(set, "Certified by number of balls", &BY_BALLS, |it| {
            it.certified
        })?,
    ])
}

fn table(set: &SetResult) -> String {
    let row = |PlannerResult {
                   planner, figures, ..
               }: &PlannerResult| {
        let Figures {
            success,
            certified,
            answered,
            request_s,
            seconds_a_success,
            tip_length_ratio,
            tip_smoothness,
            duration_s,
            modes,
            ..
        } = &figures.all;
        let cells = [
            cell(success, 100.0, 1),
            cell(certified, 100.0, 1),
            cell(answered, 100.0, 1),
            cell(request_s, 1e3, 2),
            cell(seconds_a_success, 1e3, 2),
            cell(tip_length_ratio, 1.0, 3),
            cell(tip_smoothness, 1.0, 1),
            cell(duration_s, 1.0, 2),
            cell(modes, 1.0, 1),
        ];
        format!("<tr><td><code>{planner}</code></td>{}</tr>", cells.concat())
    };
    let names = [
        "success, %",
        "certified, %",
        "answered, %",
        "ms a request",
        "ms a success",
        "tip length ÷ distance",
        "tip smoothness",
        "duration, s",
        "modes",
    ];
    format!(
        "<div class=\"table\"><table><tr><th>planner</th>{}</tr>{}</table></div>",
        names.map(|name| format!("<th>{name}</th>")).concat(),
        set.planners.iter().map(row).collect::<String>()
    )
}

fn cell(interval: &Interval, scale: f64, digits: usize) -> String {
    let number = |value: Option<f64>| {
        value.map_or_else(
            || "–".to_owned(),
            |value| format!("{:.digits$}", scale * value),
        )
    };
    let [value, low, high] = [interval.value, interval.low, interval.high].map(number);
    format!("<td>{value} <small>[{low}, {high}]</small></td>")
}

/// What the planner that all are paired with has over another one, said the same way whether it is ahead or not.
fn sentence(against: &str, other: &PlannerResult, paired: &Paired) -> String {
    let over = |it: &Interval, scale: f64, digits: usize| {
        let text = |value: Option<f64>| {
            value.map_or_else(
                || "–".to_owned(),
                |it| format!("{:+.digits$}", 0.0 - scale * it),
            )
        };
        format!("{} [{}, {}]", text(it.value), text(it.high), text(it.low))
    };
    let points = |it: &Interval| over(it, 100.0, 1);
    let shares = |own: &Interval, other: &Interval| {
        let text = |it: &Interval| {
            let value = it.value;
            value.map_or_else(|| "–".to_owned(), |share| format!("{:.1}", 100.0 * share))
        };
        format!("{} % ({} % the other's)", text(own), text(other))
    };
    let ratio = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |it| format!("{it:.3}"));
    format!(
        "<li><code>{against}</code> and <code>{}</code>: certified {} points, success {} points, its request takes {} ms more and has {} modes more; of {} cases that both solve (and {} that only it does), its median motion has \
         the shorter tip in {}, the smoother tip in {}, and lasts shorter in {}; the other's tip length ÷ its own is {} in the mean, {} to {}. {}.</li>",
        other.planner,
        points(&paired.certified_ahead),
        points(&paired.success_ahead),
        over(&paired.request_longer_s, 1e3, 2),
        over(&paired.modes_ahead, 1.0, 1),
        paired.both,
        paired.only_other,
        shares(&paired.tip_longer, &paired.tip_shorter),
        shares(&paired.tip_rougher, &paired.tip_smoother),
        shares(&paired.slower, &paired.faster),
        ratio(paired.tip_length_ratio.value),
        ratio(paired.shortest_tip),
        ratio(paired.longest_tip),
        verdict(paired)
    )
}

/// In what the planner that all are paired with is ahead, and in what behind, by the intervals.
fn verdict(paired: &Paired) -> String {
    let half = Verdict::by_half;
    let all = [
        ("certified share", Verdict::by_more(&paired.certified_ahead)),
        ("success", Verdict::by_more(&paired.success_ahead)),
        (
            "time of a request",
            Verdict::by_less(&paired.request_longer_s),
        ),
        ("modes", Verdict::by_more(&paired.modes_ahead)),
        ("tip length", half(&paired.tip_longer, &paired.tip_shorter)),
        (
            "smoothness",
            half(&paired.tip_rougher, &paired.tip_smoother),
        ),
        ("duration", half(&paired.slower, &paired.faster)),
    ];
    let named = |wanted: Verdict| {
        let names = all.iter().filter(|it| it.1 == wanted).map(|it| it.0);
        let names: Vec<&str> = names.collect();
        if names.is_empty() {
            "nothing".to_owned()
        } else {
            names.join(", ")
        }
    };
    format!(
        "<b>Ahead</b> in {}; <b>behind</b> in {}; no difference is shown in {}",
        named(Verdict::Ahead),
        named(Verdict::Behind),
        named(Verdict::Open)
    )
}

/// What an interval of 95 % shows.
#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    Ahead,
    Behind,
    Open,
}

impl Verdict {
    /// From what the other one has more, where more is better.
    fn by_more(other: &Interval) -> Self {
        match (other.low, other.high) {
            (_, Some(high)) if high < 0.0 => Self::Ahead,
            (Some(low), _) if low > 0.0 => Self::Behind,
            _ => Self::Open,
        }
    }

    /// From what the other one has more, where less is better.
    fn by_less(other: &Interval) -> Self {
        match Self::by_more(other) {
            Self::Ahead => Self::Behind,
            Self::Behind => Self::Ahead,
            Self::Open => Self::Open,
        }
    }

    /// From the shares of cases in which its own motion and the other's is better.
    fn by_half(own: &Interval, other: &Interval) -> Self {
        match (own.low, other.low) {
            (Some(low), _) if low > 0.5 => Self::Ahead,
            (_, Some(low)) if low > 0.5 => Self::Behind,
            _ => Self::Open,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_says_what_is_ahead_and_what_is_behind() {
        let of = |low: f64, high: f64| Interval {
            value: Some(0.5 * (low + high)),
            low: Some(low),
            high: Some(high),
        };
        let paired = Paired {
            certified_ahead: of(-0.3, -0.1),
            success_ahead: of(0.1, 0.2),
            request_longer_s: of(0.001, 0.002),
            modes_ahead: of(-0.1, 0.1),
            tip_shorter: of(0.6, 0.8),
            tip_smoother: of(0.1, 0.2),
            faster: of(0.4, 0.6),
            tip_longer: of(0.2, 0.4),
            tip_rougher: of(0.7, 0.9),
            slower: of(0.4, 0.6),
            tip_length_ratio: of(0.9, 1.1),
            tip_shorter_and_smoother: of(0.1, 0.2),
            shortest_tip: Some(0.8),
            longest_tip: Some(1.2),
            both: 20,
            only_other: 1,
        };
        let expected = "<b>Ahead</b> in certified share, time of a request, smoothness; <b>behind</b> in success, tip length; \
                        no difference is shown in modes, duration";
        assert_eq!(verdict(&paired), expected);
    }

    #[test]
    fn a_page_of_two_machines_says_so() {
        let mut comparison = Comparison {
            against: "fast".to_owned(),
            candidates: 10,
            seed: 0,
            threads: 0,
            program: "ab12".to_owned(),
            machines: vec!["one, 2 cores".to_owned()],
            measuring_s: 90.0,
            sets: Vec::new(),
        };
        let said = origin(&comparison);
        assert!(said.contains("program ab12"), "{said}");
        let expected = "in 1.5 minutes of measuring on one, 2 cores. ";
        assert!(said.contains(expected), "{said}");
        comparison
            .machines
            .push("another & more, 8 cores".to_owned());
        let said = origin(&comparison);
        let expected = "2 machines, whose times do not compare</b>: one, 2 cores; another &amp; more, 8 cores.";
        assert!(said.contains(expected), "{said}");
    }
}
