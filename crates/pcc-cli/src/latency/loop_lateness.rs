//! How late the controller's loop was woken meanwhile.

use std::time::Duration;

use client::ControllerView;
use serde_json::{Value, json};
use shared_types::capacity::HISTOGRAM_BINS;
use shared_types::ipc::IpcOptions;
use shared_types::lateness::quantile_ns;
use shared_types::message::ControllerState;

/// How long a controller may take to be heard.
const TIMEOUT: Duration = Duration::from_millis(300);

/// The loop's histogram before the load.
pub(super) struct LoopLateness {
    view: ControllerView,
    before: Option<ControllerState>,
}

/// What the loop did during the load.
pub(super) enum Lateness {
    /// No controller ran.
    None,
    /// The controller that ran ended, or another one took its place.
    Lost,
    Of(Box<Figures>),
}

/// What is told of a loop.
pub(super) struct Figures {
    cycles: u64,
    late_cycles: u32,
    histogram: [u32; HISTOGRAM_BINS],
}

impl LoopLateness {
    pub(super) fn watch(options: &IpcOptions) -> anyhow::Result<Self> {
        let mut view = ControllerView::connect(options)?;
        let before = view.next_state(TIMEOUT)?.map(|state| state.values);
        Ok(Self { view, before })
    }

    /// The loop's figures since then.
    pub(super) fn figures(mut self) -> anyhow::Result<Lateness> {
        let Some(before) = self.before else {
            return Ok(Lateness::None);
        };
        let now = self
            .view
            .next_state(TIMEOUT)?
            .map(|state| state.values)
            .filter(|now| now.instance == before.instance);
        Ok(now.map_or(Lateness::Lost, |now| {
            Lateness::Of(Box::new(Figures {
                cycles: now.cycle - before.cycle,
                late_cycles: now.late_cycles - before.late_cycles,
                histogram: std::array::from_fn(|bin| {
                    now.lateness_histogram[bin] - before.lateness_histogram[bin]
                }),
            }))
        }))
    }
}

impl Figures {
    fn at_us(&self, share: f64) -> f64 {
        quantile_ns(&self.histogram, share).map_or(f64::NAN, |ns| ns as f64 * 1e-3)
    }
}

impl Lateness {
    pub(super) fn show(&self) {
        match self {
            Self::None => say!("controller's loop: none runs"),
            Self::Lost => say!("controller's loop: lost meanwhile"),
            Self::Of(figures) => say!(
                "controller's loop: {} cycles, woken late by p50 {:.1}, p99 {:.1}, p99.9 {:.1}, at most {:.1} us; {} late cycles",
                figures.cycles,
                figures.at_us(0.5),
                figures.at_us(0.99),
                figures.at_us(0.999),
                figures.at_us(1.0),
                figures.late_cycles
            ),
        }
    }

    /// Fails where the controller was lost.
    pub(super) fn check(&self) -> anyhow::Result<()> {
        let is_lost = matches!(self, Self::Lost);
        anyhow::ensure!(
            !is_lost,
            "the controller ended under the load, or another one took its place"
        );
        Ok(())
    }

    pub(super) fn json(&self) -> Value {
        match self {
            Self::None => Value::Null,
            Self::Lost => json!("lost"),
            Self::Of(figures) => json!({
                "cycles": figures.cycles,
                "late_cycles": figures.late_cycles,
                "woken_late_us": {
                    "p50": figures.at_us(0.5),
                    "p99": figures.at_us(0.99),
                    "p99.9": figures.at_us(0.999),
                    "max": figures.at_us(1.0),
                },
            }),
        }
    }
}
