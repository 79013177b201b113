//! A program that measures what it is told to, line by line, so that two of them can take turns.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};

/// Threads of the one that measured before may still spin.
const PAUSE: Duration = Duration::from_millis(100);

/// The running program; it ends when dropped.
pub(crate) struct Timer {
    child: Child,
    orders: Option<ChildStdin>,
    figures: BufReader<ChildStdout>,
    /// What it says of itself.
    pub(crate) about: String,
}

impl Timer {
    /// Starts it; its first line says what it is.
    pub(crate) fn start(command: &mut Command) -> anyhow::Result<Self> {
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command
            .spawn()
            .with_context(|| format!("{} does not start", command.get_program().display()))?;
        let orders = child.stdin.take();
        let figures = BufReader::new(child.stdout.take().context("no output")?);
        let mut timer = Self {
            child,
            orders,
            figures,
            about: String::new(),
        };
        timer.about = timer.line()?;
        Ok(timer)
    }

    /// The figure for an order.
    pub(crate) fn ask(&mut self, order: &str) -> anyhow::Result<f64> {
        std::thread::sleep(PAUSE);
        let orders = self.orders.as_mut().context("it is ending")?;
        writeln!(orders, "{order}").context("it has ended")?;
        let answer = self.line()?;
        answer
            .parse()
            .with_context(|| format!("{order}: {answer} is not a number"))
    }

    fn line(&mut self) -> anyhow::Result<String> {
        let mut line = String::new();
        if self.figures.read_line(&mut line)? == 0 {
            bail!("a timer ended without an answer: its error is above");
        }
        Ok(line.trim().to_owned())
    }
}

impl Drop for Timer {
    fn drop(&mut self) {
        // Without further orders it ends by itself.
        self.orders = None;
        let _ = self.child.wait();
    }
}
