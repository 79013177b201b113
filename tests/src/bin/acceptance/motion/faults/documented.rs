//! The table "Faults while joining" of docs/control.md.

use tests::programs::repository;

/// A row of the table.
pub(super) struct Documented {
    /// The fault, without what is said of it in parentheses.
    pub(super) name: String,
    /// How far the set-point moves until rest, mm, and for how long, s; none where it moves as planned.
    pub(super) movement: Option<[f64; 2]>,
}

/// All rows.
pub(super) fn table() -> anyhow::Result<Vec<Documented>> {
    let text = std::fs::read_to_string(repository().join("docs/control.md"))?;
    let table = text.split_once("### Faults while joining");
    let (_, table) = table.ok_or_else(|| anyhow::anyhow!("docs/control.md has no such table"))?;
    let rows = table.lines().skip_while(|line| !line.starts_with("| ---"));
    let rows = rows.skip(1).take_while(|line| line.starts_with('|'));
    rows.map(row).collect()
}

fn row(line: &str) -> anyhow::Result<Documented> {
    let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
    let [fault, _, movement, _] = cells[..] else {
        anyhow::bail!("not four cells: {line}");
    };
    Ok(Documented {
        name: without_detail(fault).to_owned(),
        movement: match movement.starts_with("as planned") {
            true => None,
            false => Some(millimetres_and_seconds(movement)?),
        },
    })
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
