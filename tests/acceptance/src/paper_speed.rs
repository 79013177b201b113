//! Speed of the sampler beside PyTorch and ONNX Runtime on the same weights, and what candidates and balls cost.
//!
//! Everything that is compared takes turns, and medians of the ratios count: other load then falls on both.

use std::env;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, ensure};
use denoiser::Precision;
use tests::programs::repository;

use crate::paper_python::reference_python;
use crate::paper_runs::{MIXED, ablation_cases, evaluation};
use crate::runs::{Evaluation, Model, number, weights_folder};
use crate::spread::median;
use crate::timer::Timer;
use crate::{Report, Scale, paper_scenes};

/// Channels of the paper's first level.
const WIDTH: usize = 64;
/// Multiply-adds of the convolutions, ten candidates over 50 steps, width 64, in 10⁹; the reference's 55,753,216 count
/// transposed convolutions at their output, where half of the factors are zeros that nothing multiplies.
const MULTIPLY_ADDS: f64 = 51_277_824.0 * 10.0 * 50.0 / 1e9;
const CANDIDATES: [usize; 8] = [1, 2, 4, 8, 10, 16, 32, 64];
const BALLS: [usize; 8] = [0, 1, 2, 4, 8, 16, 32, 64];
/// Cases of a curve's point.
const CURVE_CASES: usize = 3;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "scripts/bench_unet.py; examples/unet_time";
    report.group("speed beside PyTorch", command, |report| {
        beside_the_others(report, scale)
    });
    let command = "pcc evaluate --planner diffusion-post --precision f32|bf16";
    report.group("success in bf16", command, |report| {
        if Precision::Bf16.available() {
            return success_in_bf16(report, scale);
        }
        report.shown(
            "bf16: speed and success",
            "not on this processor".to_owned(),
        );
        Ok(())
    });
    let command = "pcc evaluate --planner diffusion-post --candidates …";
    report.group("cost curves", command, |report| cost_curves(report, scale));
}

fn beside_the_others(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let model = MIXED.model()?;
    let width = model.width()?;
    ensure!(
        width == WIDTH,
        "the bars are for width {WIDTH}, {} have {width}",
        model.text
    );
    let mut ours = our_timer(&model)?;
    let mut others = other_timer(&model)?;
    report.shown("speed: the others", others.about.clone());
    let rounds = scale.pick(3, 15);
    let mut measure = |report: &mut Report, threads| {
        let mut turns = Turns::default();
        for round in 0..rounds {
            eprintln!(
                "  speed on {threads} threads, round {} of {rounds}",
                round + 1
            );
            turns.take(&mut ours, &mut others, threads)?;
        }
        turns.show(report, &model, threads);
        Ok::<_, anyhow::Error>(turns)
    };
    let [one, two] = [measure(report, 1)?, measure(report, 2)?];
    two.check(report);
    // Threads that wait for one that another program keeps from running would make everything else look fast.
    let gain = median(&two.torch) / median(&one.torch);
    let line = "speed: the machine is free for it, PyTorch's time on two threads ÷ on one";
    report.at_most(line, gain, 1.0);
    Ok(())
}

fn cargo() -> Command {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(repository());
    command
}

fn our_timer(model: &Model) -> anyhow::Result<Timer> {
    let build = ["build", "--release", "--locked", "-p", "denoiser"];
    let built = cargo()
        .args(build)
        .args(["--example", "unet_time"])
        .status()?;
    ensure!(built.success(), "examples/unet_time does not build");
    let target =
        env::var_os("CARGO_TARGET_DIR").map_or_else(|| repository().join("target"), PathBuf::from);
    let program = target.join("release/examples/unet_time");
    Timer::start(Command::new(program).arg(weights_folder()).arg(&model.name))
}

fn other_timer(model: &Model) -> anyhow::Result<Timer> {
    let mut command = Command::new(reference_python()?);
    let script = repository().join("scripts/bench_unet.py");
    command.arg(script).arg("--weights").arg(weights_folder());
    command.args(["--name", &model.name]);
    Timer::start(&mut command)
}

/// What was measured in turns, one value a round: s, and 10⁹ multiply-adds a second for the matrix product.
#[derive(Default)]
struct Turns {
    in_f32: Vec<f64>,
    in_bf16: Vec<f64>,
    torch: Vec<f64>,
    onnx: Vec<f64>,
    product_rate: Vec<f64>,
}

impl Turns {
    fn take(&mut self, ours: &mut Timer, others: &mut Timer, threads: usize) -> anyhow::Result<()> {
        self.in_f32.push(ours.ask(&format!("f32 {threads}"))?);
        self.torch.push(others.ask(&format!("torch {threads}"))?);
        if Precision::Bf16.available() {
            self.in_bf16.push(ours.ask(&format!("bf16 {threads}"))?);
        }
        self.onnx.push(others.ask(&format!("onnx {threads}"))?);
        self.product_rate
            .push(others.ask(&format!("sgemm {threads}"))?);
        Ok(())
    }

    fn show(&self, report: &mut Report, model: &Model, threads: usize) {
        let ms = |values: &[f64]| format!("{:.0} ms", 1e3 * median(values));
        let line = format!(
            "speed: ten candidates, 50 steps, {threads} threads, {}, medians",
            model.text
        );
        let figure = format!(
            "f32 {}, bf16 {}, PyTorch {}, ONNX Runtime {}; matrix product {:.1} G multiply-adds/s",
            ms(&self.in_f32),
            ms(&self.in_bf16),
            ms(&self.torch),
            ms(&self.onnx),
            median(&self.product_rate)
        );
        report.shown(&line, figure);
    }

    fn check(&self, report: &mut Report) {
        let ratio = |of: &[f64], to: &[f64]| {
            let ratios: Vec<f64> = of.iter().zip(to).map(|(a, b)| a / b).collect();
            median(&ratios)
        };
        let mut times_faster = |name: &str, others: &[f64], ours: &[f64], bar: f64| {
            let found = ratio(others, ours);
            let line = format!("speed on two threads: {name}");
            report.check(
                &line,
                format!("{found:.2} × as fast"),
                &format!(">= {bar} ×"),
                found >= bar,
            );
        };
        times_faster("f32 beside PyTorch eager", &self.torch, &self.in_f32, 1.4);
        times_faster("f32 beside ONNX Runtime", &self.onnx, &self.in_f32, 1.0);
        if Precision::Bf16.available() {
            times_faster("bf16 beside PyTorch f32", &self.torch, &self.in_bf16, 2.5);
        }
        let rates: Vec<f64> = self.in_f32.iter().map(|s| MULTIPLY_ADDS / s).collect();
        let share = 100.0 * ratio(&rates, &self.product_rate);
        let line = "speed on two threads: f32, share of the measured matrix product's rate";
        report.check(line, format!("{share:.0} %"), ">= 70 %", share >= 70.0);
    }
}

/// The same cases and noise in both precisions.
fn success_in_bf16(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    const TOLERANCE: f64 = 0.5;
    let (cases, model) = (ablation_cases(scale), MIXED.model()?);
    let dataset = MIXED.make(cases)?;
    let success = |precision| {
        let evaluation = evaluation(MIXED.name, &dataset, &model, "diffusion-post", cases);
        let evaluation = evaluation.with("--precision", precision);
        let result = evaluation.run(report, scale)?;
        Ok::<_, anyhow::Error>(100.0 * number(&result, "/sampled/success")?)
    };
    let [in_f32, in_bf16] = [success("f32")?, success("bf16")?];
    let line = format!(
        "mixed: diffusion-post in bf16, success by the paper's criterion, {}",
        model.text
    );
    let bar = format!("f32's {in_f32:.2} % ± {TOLERANCE}");
    // Both are counts of candidates: half a point is half a point, whatever the last bit says.
    let passed = (in_f32 - in_bf16).abs() <= TOLERANCE + 1e-9;
    report.check(&line, format!("{in_bf16:.2} %"), &bar, passed);
    Ok(())
}

fn cost_curves(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let model = MIXED.model()?;
    let dataset = MIXED.make(CURVE_CASES)?;
    let mut points = Vec::new();
    for candidates in CANDIDATES {
        let evaluation = evaluation("curve", &dataset, &model, "diffusion-post", CURVE_CASES);
        let evaluation = evaluation.candidates(candidates);
        points.push(point(report, scale, &evaluation, candidates)?);
    }
    report.shown(
        &format!(
            "cost of a request with post correction by candidates, mixed, fastest of {CURVE_CASES}"
        ),
        points.join(", "),
    );
    points.clear();
    for balls in BALLS {
        let setting = format!("curve-{balls}-balls");
        let dataset = paper_scenes::with_balls(balls, CURVE_CASES)?;
        let evaluation = evaluation(&setting, &dataset, &model, "diffusion-post", CURVE_CASES);
        points.push(point(report, scale, &evaluation, balls)?);
    }
    report.shown(
        &format!("cost of a request with post correction by balls, ten candidates, fastest of {CURVE_CASES}"),
        points.join(", "),
    );
    Ok(())
}

fn point(
    report: &Report,
    scale: Scale,
    evaluation: &Evaluation,
    at: usize,
) -> anyhow::Result<String> {
    let result = evaluation.run(report, scale)?;
    let sampling = number(&result, "/stage_seconds/sample/p5");
    let sampling = sampling.with_context(|| format!("nothing was sampled at {at}"))?;
    Ok(format!("{at}: {:.0} ms", 1e3 * sampling))
}
