//! The files of the running processes and of a data set that good command lines of `pcc` read.

use std::ffi::OsString;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command as Process, Stdio};

use shared_types::ipc::IpcOptions;
use tests::programs::{program, repository};
use tests::stack::Stack;

/// What lets a program find the running processes.
pub(super) fn environment_of(options: &IpcOptions) -> Vec<(&'static str, OsString)> {
    vec![
        ("PCC_PREFIX", OsString::from(&options.prefix)),
        ("PCC_ROOT", options.root.clone().into_os_string()),
    ]
}

/// The folder of files that `pcc` has made of the running processes and of a data set.
pub(super) fn made(stack: &Stack) -> PathBuf {
    stack.world.folder().join("made")
}

/// Makes the files that good lines read: a record of a plan, and paths of an evaluation.
pub(super) fn make_files(stack: &Stack) {
    let folder = made(stack);
    fs::create_dir_all(&folder).unwrap();
    let pcc = |words: &str| {
        let words = words.replace("{repository}", repository().to_str().unwrap());
        let mut pcc = Process::new(program("pcc"));
        pcc.args(words.split_whitespace())
            .envs(environment_of(&stack.world.options))
            .current_dir(&folder);
        pcc
    };
    let mut recording = pcc("record --seconds 2 record.mcap");
    let mut recording = recording.stdout(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(recording.stdout.take().unwrap());
    said.read_line(&mut String::new()).unwrap();
    for words in [
        "plan --tip 0.9 0.3 2.4 --start 0 0 0 0 0 0 --candidates 1 --sampler straight --deadline-ms 10000",
        "evaluate --dataset {repository}/tests/data/reference-mixed-sample --planner straight --cases 2 --candidates 2 \
         --robot {repository}/config/robots/unit.toml --out evaluation",
    ] {
        let output = pcc(words).output().unwrap();
        assert!(output.status.success(), "{output:?}");
    }
    assert!(recording.wait().unwrap().success());
}
