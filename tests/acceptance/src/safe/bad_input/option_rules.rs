//! What the help of `pcc` says that each option takes, and a good command line for each command.

use super::wanted::Wanted;

/// A command with a good line, by option.
pub(super) struct Command {
    pub(super) name: &'static str,
    pub(super) family: &'static str,
    /// Whether it needs the running processes, or a file (`made:`) that was made of them.
    pub(super) is_live: bool,
    /// Whether its good line ends in seconds.
    pub(super) runs: bool,
    pub(super) base: &'static [(&'static str, &'static [&'static str])],
    pub(super) options: &'static [(&'static str, Wanted)],
}

const WHOLE_64: [i128; 2] = [0, u64::MAX as i128];
const SEED: Wanted = Wanted::Whole(WHOLE_64, i128::MAX);
/// Bending angles, rad: beyond it no robot bends.
const ANGLES: Wanted = Wanted::Reals(std::f64::consts::PI, &["start", "goal", "configuration"]);
const ROBOT: (&str, &[&str]) = ("--robot", &["repository:config/robots/unit.toml"]);
const SAMPLE: (&str, &[&str]) = (
    "--dataset",
    &["repository:tests/data/reference-mixed-sample"],
);

/// All commands.
pub(super) const COMMANDS: &[Command] = &[
    Command {
        name: "plan",
        family: "options of plan",
        is_live: true,
        runs: true,
        base: &[
            ("--tip", &["0.9", "0.3", "2.4"]),
            ("--start", &["0", "0", "0", "0", "0", "0"]),
            ("--candidates", &["1"]),
            ("--sampler", &["straight"]),
            // On a busy machine the daemon's default is over before it is read.
            ("--deadline-ms", &["10000"]),
        ],
        options: &[
            ("--tip", Wanted::Reals(1e3, &["goal"])),
            ("--configuration", ANGLES),
            ("--start", ANGLES),
            ("--ball", Wanted::Ball(1e3)),
            // The daemon on which it is tried gives 16.
            ("--candidates", Wanted::Whole([1, 16], 16)),
            ("--seed", SEED),
            ("--sampler", Wanted::Choice(&[])),
            ("--select", Wanted::Choice(&[])),
            ("--index", Wanted::Whole([0, 0], 0)),
            // The longest deadline of a request is a minute.
            ("--deadline-ms", Wanted::Whole([0, 60_000], 60_000)),
            ("--limits-scale", Wanted::Real([1e-9, 1.0], [0.0, 1.0])),
            ("--append", Wanted::Flag),
            ("--execute", Wanted::Flag),
            ("--begin-in", Wanted::Real([0.0, 600.0], [0.0, 600.0])),
            ("--wait", Wanted::Flag),
            ("--json", Wanted::Flag),
        ],
    },
    Command {
        name: "goal",
        family: "options of goal",
        is_live: true,
        // A goal whose place another one takes meanwhile is told to have ended, which is no success.
        runs: false,
        base: &[("--tip", &["0.9", "0.3", "2.4"])],
        options: &[
            ("--tip", Wanted::Reals(1e3, &["goal"])),
            ("--configuration", ANGLES),
            ("--limits-scale", Wanted::Real([1e-9, 1.0], [0.0, 1.0])),
            ("--wait", Wanted::Flag),
        ],
    },
    Command {
        name: "execute",
        family: "options of execute",
        is_live: true,
        // Only a plan that the daemon has made can be executed.
        runs: false,
        base: &[("<PLAN_ID>", &["1"])],
        options: &[
            ("<PLAN_ID>", Wanted::Whole([1, u64::MAX as i128], 0)),
            ("[CANDIDATE]", Wanted::Whole([0, 63], -1)),
            ("--wait", Wanted::Flag),
        ],
    },
    Command {
        name: "home",
        family: "options of home",
        is_live: false,
        // No servos are there.
        runs: false,
        base: &[("--config", &["repository:config/dynamixel-robot.toml"])],
        options: &[("--config", Wanted::ReadFile)],
    },
    Command {
        name: "services",
        family: "options of services",
        is_live: true,
        runs: true,
        base: &[],
        options: &[("--json", Wanted::Flag)],
    },
    Command {
        name: "latency",
        family: "options of latency",
        is_live: true,
        runs: true,
        base: &[
            ("--requests", &["4"]),
            ("--warm-up", &["0"]),
            ("--candidates", &["1"]),
        ],
        options: &[
            // More than the daemon has places for are refused by it.
            ("--clients", Wanted::Whole([1, 64], 64)),
            ("--requests", Wanted::Whole([1, 10_000_000], 300)),
            ("--warm-up", Wanted::Whole([0, 1_000_000], 300)),
            ("--rate", Wanted::Real([0.1, 1e6], [1.0, 1e6])),
            ("--candidates", Wanted::Whole([1, 64], 64)),
            ("--deadline-ms", Wanted::Whole([1, 60_000], 60_000)),
            ("--seed", SEED),
            ("--json", Wanted::WriteFile),
            ("--plot", Wanted::WriteFile),
            ("--stamps", Wanted::WriteFile),
            ("--baselines", Wanted::Whole([1, 1_000_000], 300)),
            ("--compare", Wanted::ReadFile),
        ],
    },
    Command {
        name: "record",
        family: "options of record",
        is_live: true,
        runs: true,
        base: &[("--seconds", &["0.1"]), ("<FILE>", &["record.mcap"])],
        options: &[
            ("<FILE>", Wanted::WriteFile),
            ("--seconds", Wanted::Real([0.0, 1e9], [0.0, 2.0])),
        ],
    },
    Command {
        name: "replay",
        family: "options of replay",
        is_live: true,
        runs: true,
        base: &[("<FILE>", &["made:record.mcap"])],
        options: &[("<FILE>", Wanted::ReadFile), ("--robot", Wanted::ReadFile)],
    },
    Command {
        name: "view",
        family: "options of view",
        is_live: true,
        runs: true,
        base: &[
            ("[FILE]", &["made:evaluation/paths.npz"]),
            ROBOT,
            ("--out", &["view.html"]),
        ],
        options: &[
            ("[FILE]", Wanted::ReadFile),
            // Beside a file it is refused; alone it serves until it is interrupted.
            ("--live", Wanted::Flag),
            ("--port", Wanted::Whole([1, 0], 0)),
            ("--scene", Wanted::ReadFile),
            ("--case", Wanted::Whole([0, u64::MAX as i128], i128::MAX)),
            ("--robot", Wanted::ReadFile),
            ("--out", Wanted::WriteFile),
        ],
    },
    Command {
        name: "compare",
        family: "options of compare",
        is_live: false,
        runs: true,
        base: &[
            ("--planners", &["fast,straight"]),
            ("--sets", &["repository:tests/data/reference-mixed-sample"]),
            ("--cases", &["2"]),
            ("--candidates", &["1"]),
            ("--threads", &["1"]),
            ROBOT,
            ("--weights", &["repository:weights"]),
            ("--out", &["out"]),
        ],
        options: &[
            ("--planners", Wanted::Choice(&[])),
            ("--sets", Wanted::ReadFolder),
            // Beside planners and sets they are refused; alone they take minutes.
            ("--figures", Wanted::Choice(&[])),
            ("--cases", Wanted::Whole([2, 1_000_000], 4)),
            ("--quick", Wanted::Flag),
            ("--candidates", Wanted::Whole([1, 64], 64)),
            ("--seed", SEED),
            ("--against", Wanted::Choice(&[])),
            ("--threads", Wanted::Whole([0, 256], 256)),
            ("--robot", Wanted::ReadFile),
            ("--weights", Wanted::ReadFolder),
            ("--model", Wanted::Name("fast")),
            ("--evaluations", Wanted::Choice(&["1", "2", "4", "8"])),
            // What the planners of the good line do not read is refused.
            ("--steps", Wanted::Whole([1, 0], 0)),
            ("--solver", Wanted::Choice(&["ddim", "dpm-solver"])),
            ("--precision", Wanted::Choice(&["f32", "bf16"])),
            ("--out", Wanted::WriteFolder),
        ],
    },
    Command {
        name: "demo",
        family: "options of demo",
        is_live: true,
        runs: false,
        base: &[ROBOT],
        options: &[
            ("--record", Wanted::WriteFolder),
            ("--robot", Wanted::ReadFile),
            ("--seed", Wanted::Whole(WHOLE_64, -1)),
        ],
    },
    Command {
        name: "watch",
        family: "options of watch",
        is_live: true,
        runs: true,
        base: &[("--times", &["1"]), ("--rate-hz", &["100"])],
        options: &[
            // A picture a second and slower.
            ("--rate-hz", Wanted::Real([0.1, 100.0], [1.0, 100.0])),
            // 0 is without end.
            ("--times", Wanted::Whole([0, u64::MAX as i128], -1)),
        ],
    },
    Command {
        name: "stop",
        family: "options of orders",
        is_live: true,
        // A robot at rest has nothing to stop, which is said and no success.
        runs: false,
        base: &[],
        options: &[],
    },
    Command {
        name: "pause",
        family: "options of orders",
        is_live: true,
        // Nothing moves, which is said and no success.
        runs: false,
        base: &[],
        options: &[],
    },
    Command {
        name: "resume",
        family: "options of orders",
        is_live: true,
        // Nothing moves, which is said and no success.
        runs: false,
        base: &[],
        options: &[],
    },
    Command {
        name: "reset",
        family: "options of orders",
        is_live: true,
        runs: false,
        base: &[],
        options: &[],
    },
    Command {
        name: "speed",
        family: "options of orders",
        is_live: true,
        runs: true,
        base: &[("<RATE>", &["1"])],
        options: &[("<RATE>", Wanted::Real([0.0, 1.0], [0.0, 1.0]))],
    },
    Command {
        name: "scene",
        family: "options of scene",
        is_live: true,
        runs: false,
        base: &[],
        options: &[],
    },
    Command {
        name: "scene leave",
        family: "options of scene",
        is_live: true,
        // Only a source that is there can be signed off.
        runs: false,
        base: &[("<SOURCE>", &["nobody"])],
        options: &[("<SOURCE>", Wanted::Source)],
    },
    Command {
        name: "dataset",
        family: "options of dataset",
        is_live: false,
        runs: true,
        base: &[
            ("--setting", &["general"]),
            ("--targets", &["1"]),
            ("--starts", &["1"]),
            ("--ends", &["1"]),
            ("--threads", &["1"]),
            ROBOT,
            ("--out", &["out"]),
        ],
        options: &[
            ("--setting", Wanted::Choice(&[])),
            ("--method", Wanted::Choice(&[])),
            ("--balls", Wanted::Whole([0, 64], 4)),
            ("--targets", Wanted::Whole([1, 10_000_000], 4)),
            ("--starts", Wanted::Whole([1, 5], 5)),
            ("--ends", Wanted::Whole([1, 64], 2)),
            ("--trees", Wanted::Whole([1, 64], 1)),
            ("--seed", SEED),
            ("--test-only", Wanted::Flag),
            ("--shard", Wanted::Shard),
            ("--threads", Wanted::Whole([0, 256], 256)),
            ("--robot", Wanted::ReadFile),
            ("--out", Wanted::WriteFolder),
        ],
    },
    Command {
        name: "features",
        family: "options of features",
        is_live: false,
        runs: true,
        base: &[SAMPLE, ROBOT, ("--out", &["features.npz"])],
        options: &[
            ("--dataset", Wanted::ReadFolder),
            (
                "--first-group",
                Wanted::Whole([0, u32::MAX as i128], i128::MAX),
            ),
            ("--frame", Wanted::Choice(&[])),
            ("--robot", Wanted::ReadFile),
            ("--out", Wanted::WriteFile),
        ],
    },
    Command {
        name: "evaluate",
        family: "options of evaluate",
        is_live: false,
        runs: true,
        base: &[
            SAMPLE,
            ("--planner", &["fast"]),
            ("--cases", &["1"]),
            ("--candidates", &["1"]),
            ("--threads", &["1"]),
            ROBOT,
            ("--weights", &["repository:weights"]),
            ("--out", &["out"]),
        ],
        options: &[
            ("--dataset", Wanted::ReadFolder),
            ("--split", Wanted::Choice(&[])),
            ("--planner", Wanted::Choice(&[])),
            ("--proposals", Wanted::ReadFile),
            ("--records", Wanted::ReadFile),
            ("--candidates", Wanted::Whole([1, 64], 64)),
            ("--seed", SEED),
            ("--cases", Wanted::Whole([1, u64::MAX as i128], 4)),
            ("--threads", Wanted::Whole([0, 256], 256)),
            ("--corrections", Wanted::Whole([0, 2], 2)),
            ("--robot", Wanted::ReadFile),
            ("--weights", Wanted::ReadFolder),
            ("--model", Wanted::Name("fast")),
            ("--evaluations", Wanted::Choice(&["1", "2", "4", "8"])),
            // What the planner of the good line does not read is refused.
            ("--steps", Wanted::Whole([1, 0], 0)),
            ("--solver", Wanted::Choice(&["ddim", "dpm-solver"])),
            ("--precision", Wanted::Choice(&["f32", "bf16"])),
            ("--out", Wanted::WriteFolder),
        ],
    },
    Command {
        name: "trace",
        family: "options of trace",
        is_live: false,
        runs: true,
        base: &[
            ("--tip", &["0.9", "0.3", "2.4"]),
            ("--planner", &["diffusion"]),
            ("--steps", &["1"]),
            ROBOT,
            ("--weights", &["repository:weights"]),
            ("--out", &["trace.npz"]),
        ],
        options: &[
            ("--tip", Wanted::Reals(1e3, &["goal"])),
            ("--start", ANGLES),
            ("--random-start", Wanted::Flag),
            ("--ball", Wanted::Ball(1e7)),
            ("--planner", Wanted::Choice(&[])),
            ("--seed", SEED),
            ("--weights", Wanted::ReadFolder),
            ("--model", Wanted::Name("mixed")),
            ("--evaluations", Wanted::Choice(&["1", "2", "4", "8"])),
            ("--steps", Wanted::Whole([1, 1000], 4)),
            ("--solver", Wanted::Choice(&["ddim", "dpm-solver"])),
            ("--precision", Wanted::Choice(&["f32", "bf16"])),
            ("--robot", Wanted::ReadFile),
            ("--out", Wanted::WriteFile),
        ],
    },
];
