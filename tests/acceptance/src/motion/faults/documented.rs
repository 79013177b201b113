//! The table "Faults while joining" of docs/control.md.

use tests::programs::repository;

/// A row of the table.
pub(super) struct Documented {
    /// The fault, without what is said of it in parentheses.
    pub(super) name: String,
    /// What the controller does, with what "the same" refers to.
    pub(super) done: String,
    /// How far the set-point moves until rest, mm, and for how long, s; none where it moves as planned.
    pub(super) movement: Option<[f64; 2]>,
    pub(super) recovery: String,
}

/// All rows.
pub(super) fn table() -> anyhow::Result<Vec<Documented>> {
    let text = std::fs::read_to_string(repository().join("docs/control.md"))?;
    let table = text.split_once("### Faults while joining");
    let (_, table) = table.ok_or_else(|| anyhow::anyhow!("docs/control.md has no such table"))?;
    let rows = table.lines().skip_while(|line| !line.starts_with("| ---"));
    let rows = rows.skip(1).take_while(|line| line.starts_with('|'));
    let mut documented: Vec<Documented> = Vec::new();
    for line in rows {
        let row = row(line, documented.last())?;
        documented.push(row);
    }
    Ok(documented)
}

fn row(line: &str, before: Option<&Documented>) -> anyhow::Result<Documented> {
    let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
    let [fault, done, movement, recovery] = cells[..] else {
        anyhow::bail!("not four cells: {line}");
    };
    let meant = before.filter(|_| done.starts_with("the same"));
    Ok(Documented {
        name: without_detail(fault).to_owned(),
        done: format!("{}{done}", meant.map_or("", |it| &it.done)),
        movement: match movement.starts_with("as planned") {
            true => None,
            false => Some(millimetres_and_seconds(movement)?),
        },
        recovery: recovery.to_owned(),
    })
}

impl Documented {
    /// Whether it says why a motion ended that ended like this, where there is a reason: what is last in its parentheses.
    pub(super) fn says_why(&self, end: &str) -> bool {
        let reason = end
            .strip_suffix(')')
            .and_then(|it| it.rsplit(['(', ',']).next());
        reason.is_none_or(|reason| self.done.contains(reason.trim()))
    }
}

/// A name up to its first parenthesis.
pub(super) fn without_detail(name: &str) -> &str {
    name.split(" (").next().unwrap_or(name)
}

fn millimetres_and_seconds(cell: &str) -> anyhow::Result<[f64; 2]> {
    let figures = cell
        .strip_suffix(" s")
        .and_then(|it| it.split_once(" mm, "));
    let (way, time) = figures.ok_or_else(|| anyhow::anyhow!("no way and time: {cell}"))?;
    Ok([way.parse()?, time.parse()?])
}
