//! `pcc view --live`: what a page is told, before the processes are there, while they run and while they are away.
#![allow(clippy::unwrap_used)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;

use serde_json::Value;
use tests::process::{Process, wait_for};
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

/// Asks for a path; what comes after the head of the answer, and the head's first line.
fn get(host: &str, path: &str) -> (String, BufReader<TcpStream>) {
    let mut connection = TcpStream::connect(host).unwrap();
    connection.set_read_timeout(Some(PATIENCE)).unwrap();
    write!(connection, "GET {path} HTTP/1.0\r\nHost: {host}\r\n\r\n").unwrap();
    let mut answer = BufReader::new(connection);
    let mut first = String::new();
    answer.read_line(&mut first).unwrap();
    let mut line = String::new();
    while answer.read_line(&mut line).unwrap() > 2 {
        line.clear();
    }
    (first.trim().to_owned(), answer)
}

/// The next event of a name of which something holds.
fn next(
    events: &mut BufReader<TcpStream>,
    name: &str,
    is_wanted: impl Fn(&Value) -> bool,
) -> Value {
    let (wanted, mut event, mut line) = (format!("event: {name}"), String::new(), String::new());
    loop {
        line.clear();
        assert!(events.read_line(&mut line).unwrap() > 0, "no {name} came");
        match line.trim_end().strip_prefix("data: ") {
            Some(data) if event == wanted => {
                let value = serde_json::from_str(data).unwrap();
                if is_wanted(&value) {
                    return value;
                }
            }
            Some(_) => {}
            None if line.starts_with("event") => event = line.trim_end().to_owned(),
            None => {}
        }
    }
}

fn says(status: &Value, line: &str) -> bool {
    let lines = status["lines"].as_array().unwrap();
    lines.iter().any(|it| it == line)
}

fn serve(world: &World) -> (Process, String, String) {
    let served = Process::start(world, "pcc", &["view", "--live"]);
    let address = wait_for("an address", PATIENCE, || {
        let log = served.log();
        let (_, rest) = log.split_once("serving http://")?;
        let (address, _) = rest.split_once(' ')?;
        let (host, folder) = address.split_once('/')?;
        Some((host.to_owned(), format!("/{folder}")))
    });
    let (host, folder) = address.unwrap();
    (served, host, folder)
}

#[test]
fn pages_are_told_what_happens_and_who_is_not_there() {
    let mut stack = Stack::new(&Settings::fast_robot().patient());
    let (mut served, host, folder) = serve(&stack.world);
    let mut events = get(&host, &format!("{folder}live")).1;
    next(&mut events, "status", |it| {
        says(it, "planner-daemon: not there")
    });
    for part in Part::ALL {
        stack.start(part);
    }
    stack.wait_until_ready().unwrap();
    let view = next(&mut events, "view", |_| true);
    assert_eq!(
        view["robot"]["section_lengths"],
        serde_json::json!([1.0, 1.0, 1.0])
    );
    stack.move_tip([0.0, -1.55, 2.25]).unwrap();
    let motion = next(&mut events, "motion", |_| true);
    let begins_s = motion["begins_s"].as_f64().unwrap();
    let commanded = stack.commanded();
    let frame = next(&mut events, "frame", |it| {
        let first = it["configurations_rad"][0][0].as_f64().unwrap();
        (first - commanded[0]).abs() < 1e-9
    });
    assert!(frame["time_s"].as_f64().unwrap() >= begins_s);
    let tendons = &frame["curves"][0];
    assert_eq!(tendons.as_array().unwrap().len(), 9);
    // One that comes later is told of the robot and of the motion, too.
    let mut later = get(&host, &format!("{folder}live")).1;
    assert_eq!(next(&mut later, "view", |_| true), view);
    assert_eq!(next(&mut later, "motion", |_| true), motion);
    stack.kill9(Part::Controller);
    next(&mut events, "status", |it| {
        says(it, "controller: not there")
    });
    stack.start(Part::Controller);
    next(&mut events, "status", |it| says(it, "controller: holding"));
    next(&mut events, "frame", |_| true);
    served.signal(libc::SIGINT);
    assert!(served.wait(PATIENCE).unwrap().success());
    assert!(
        served
            .log()
            .contains("waiting for planner-daemon, controller, robot")
    );
}

#[test]
fn the_page_is_whole_and_at_no_address_that_can_be_guessed() {
    let world = World::new(&Settings::default());
    let (_served, host, folder) = serve(&world);
    let (first, mut page) = get(&host, &folder);
    let mut text = String::new();
    page.read_to_string(&mut text).unwrap();
    assert!(first.ends_with("200 OK"), "{first}");
    assert!(text.contains("<canvas id=\"scene\"") && text.contains("</html>"));
    for path in ["/", "/live", "/../live", &folder[..9]] {
        let (first, _) = get(&host, path);
        assert!(first.contains("404"), "{path}: {first}");
    }
}
