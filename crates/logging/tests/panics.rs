//! What a panic does to a process that logs: each in a process of its own.

use std::os::unix::process::ExitStatusExt;
use std::process::{Command, ExitStatus, exit};
use std::thread;

/// Status of a process that outlives the panic.
const ALIVE: i32 = 7;
const SIGABRT: i32 = 6;

/// Runs one of the ignored tests below in a process of its own.
fn status_of(test: &str) -> ExitStatus {
    let own = std::env::current_exe().expect("a test has a program");
    let mut command = Command::new(own);
    let output = command.args(["--exact", test, "--ignored"]).output();
    output.expect("the program can be run").status
}

fn panic_in_a_thread(begin: impl FnOnce() + Send + 'static) -> ! {
    logging::start().expect("the log begins");
    let thread = thread::spawn(move || {
        begin();
        panic!("as wanted");
    });
    assert!(thread.join().is_err());
    exit(ALIVE);
}

#[test]
fn a_panic_of_any_thread_ends_the_process() {
    assert_eq!(status_of("panics_unnoticed").signal(), Some(SIGABRT));
}

#[test]
fn a_panic_that_is_caught_does_not() {
    assert_eq!(status_of("panics_where_it_is_caught").code(), Some(ALIVE));
}

#[test]
#[ignore = "its process is to die"]
fn panics_unnoticed() {
    panic_in_a_thread(|| ());
}

#[test]
#[ignore = "its process is to exit"]
fn panics_where_it_is_caught() {
    panic_in_a_thread(logging::do_not_abort_on_panic);
}
