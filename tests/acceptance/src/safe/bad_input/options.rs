//! Every option of every command of `pcc`, as its help lists them, with every kind of wrong value.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::os::unix::ffi::OsStringExt;
use std::path::Path;
use std::process::Command as Process;
use std::time::Duration;

use client::ScenePublisher;
use tests::programs::{program, repository};
use tests::stack::{PATIENCE, Stack};
use tests::trial::Start;

use super::damage;
use super::listed_option::Listed;
use super::made_files::{environment_of, made, make_files};
use super::option_rules::{COMMANDS, Command};
use super::variant::{Expected, Fault, Variant};
use super::wanted::Wanted;

/// All that is tried of the command line; what has no rule is named.
pub(super) fn variants(stack: &Stack) -> (Vec<Variant>, Vec<String>) {
    let (mut all, mut without_rule) = (Vec::new(), Vec::new());
    make_files(stack);
    for name in listed_commands("") {
        let Some(command) = COMMANDS.iter().find(|command| command.name == name) else {
            without_rule.push(name);
            continue;
        };
        let tried = Tried { command, stack };
        all.extend(tried.as_a_whole());
        for option in listed_options(&name) {
            let mut rules = command.options.iter();
            match rules.find(|(known, _)| *known == option.name) {
                Some((_, wanted)) => all.extend(tried.option(&option, wanted)),
                None => without_rule.push(format!("{name} {}", option.name)),
            }
        }
    }
    all.push(signed_off(stack));
    (all, without_rule)
}

/// A source that is there, whose program has ended, and that is signed off.
fn signed_off(stack: &Stack) -> Variant {
    const SOURCE: &str = "gone";
    let options = stack.world.options.clone();
    Variant {
        family: "options of scene",
        name: "pcc scene leave of a source that is there".to_owned(),
        make: Box::new(move |_| {
            let mut source = ScenePublisher::connect(&options, SOURCE).unwrap();
            source.publish(&[], Duration::from_secs(60)).unwrap();
            source.confirm(PATIENCE).unwrap();
            Start {
                environment: environment_of(&options),
                ..Start::new("pcc", &["scene", "leave", SOURCE])
            }
        }),
        expected: Expected::Taken,
    }
}

/// The short help of a command, whose name has several words where it is another one's.
fn help(command: &str) -> String {
    let output = Process::new(program("pcc"))
        .args(command.split_whitespace())
        .arg("-h")
        .output()
        .unwrap();
    String::from_utf8(output.stdout).unwrap()
}

/// The commands of a command, and theirs.
fn listed_commands(of: &str) -> Vec<String> {
    let help = help(of);
    let Some((_, commands)) = help.split_once("Commands:") else {
        return Vec::new();
    };
    let names = commands
        .split("Options:")
        .next()
        .unwrap()
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| *name != "help");
    let full = names.map(|name| format!("{of} {name}").trim().to_owned());
    full.flat_map(|name| [vec![name.clone()], listed_commands(&name)].concat())
        .collect()
}

fn listed_options(command: &str) -> Vec<Listed> {
    let mut listed: Vec<Listed> = Vec::new();
    for line in help(command).lines() {
        let text = line.trim_start();
        let is_option =
            line.starts_with("      --") || ["  <", "  ["].iter().any(|it| line.starts_with(it));
        if is_option {
            let words: Vec<&str> = text
                .split_whitespace()
                .take_while(|w| w.starts_with("--") || w.starts_with(['<', '[']))
                .collect();
            let is_named = text.starts_with("--");
            listed.push(Listed {
                name: words[0].to_owned(),
                values: words.len() - usize::from(is_named),
                choices: Vec::new(),
            });
        }
        if let (Some(last), Some((_, names))) =
            (listed.last_mut(), text.split_once("[possible values: "))
        {
            let names = names.split(']').next().unwrap().split(", ");
            last.choices = names.map(str::to_owned).collect();
        }
    }
    listed
}

/// A command on the running stack or on files.
struct Tried<'a> {
    command: &'static Command,
    stack: &'a Stack,
}

/// Values of an option, and what must come of them.
struct Given {
    values: Vec<OsString>,
    expected: Expected,
    /// Prepares the folder that it runs in.
    prepare: fn(&Path),
}

impl Tried<'_> {
    fn option(&self, option: &Listed, wanted: &Wanted) -> Vec<Variant> {
        let mut all = wrong_counts(option, wanted);
        all.extend(match wanted {
            Wanted::Flag => Vec::new(),
            wanted => wrong_values(option, wanted),
        });
        all.into_iter()
            .map(|given| self.variant(&option.name, given))
            .collect()
    }

    /// Undamaged, with what no command knows, and with nothing.
    fn as_a_whole(&self) -> Vec<Variant> {
        let none = |_: &Path| ();
        let given = |values: Vec<OsString>, expected| Given {
            values,
            expected,
            prepare: none,
        };
        let unknown = |text: &str| {
            Expected::Refused(vec![
                Fault {
                    keys: vec![text.to_owned()],
                    is_unreadable: true,
                    ..Fault::default()
                },
                Fault::option(text, ""),
            ])
        };
        let mut all = Vec::new();
        if self.command.runs {
            all.push(self.variant("", given(Vec::new(), Expected::Taken)));
        }
        for text in ["--no-such-option", "--outt", "surplus", "--", "-x", "\u{0}"] {
            let values = vec![text.replace('\0', "--\u{1}").into()];
            // Nothing after a lone `--` is no mistake.
            if text != "--" {
                all.push(self.variant("", given(values, unknown(&text.replace('\0', "--")))));
            }
        }
        let bytes = OsString::from_vec(b"--\xff\xfe".to_vec());
        all.push(self.variant("", given(vec![bytes], unknown("--"))));
        all
    }

    fn variant(&self, option: &str, given: Given) -> Variant {
        let arguments = self.arguments(option, given.values.clone());
        let shown: Vec<String> = given
            .values
            .iter()
            .map(|v| v.to_string_lossy().chars().take(40).collect())
            .collect();
        let environment = match self.command.is_live {
            true => environment_of(&self.stack.world.options),
            false => Vec::new(),
        };
        let prepare = given.prepare;
        Variant {
            family: self.command.family,
            name: format!("pcc {} {option} {}", self.command.name, shown.join(" ")),
            make: Box::new(move |folder| {
                prepare(folder);
                Start {
                    program: "pcc",
                    arguments: arguments.clone(),
                    environment: environment.clone(),
                    user: None,
                }
            }),
            expected: given.expected,
        }
    }

    /// The command's good line with an option's values in place of its own.
    fn arguments(&self, option: &str, values: Vec<OsString>) -> Vec<OsString> {
        let repository = repository();
        let made = made(self.stack);
        let absolute = |text: &str| match text.split_once(':') {
            Some(("repository", path)) => repository.join(path).into_os_string(),
            Some(("made", path)) => made.join(path).into_os_string(),
            _ => OsString::from(text),
        };
        let words = self.command.name.split_whitespace();
        let mut arguments: Vec<OsString> = words.map(OsString::from).collect();
        let is_positional = option.starts_with(['<', '[']);
        for (name, good) in self.command.base {
            if *name != option {
                arguments.extend(name.starts_with('-').then(|| OsString::from(*name)));
                arguments.extend(good.iter().map(|text| absolute(text)));
            }
        }
        // Planners to which alone an option goes.
        let planners = [("--proposals", "proposed"), ("--records", "bit-star")];
        if let Some((_, planner)) = planners.iter().find(|it| it.0 == option) {
            arguments = without(arguments, "--planner");
            arguments.extend(["--planner".into(), planner.into()]);
        }
        // An option may leave the room to another one that excludes it.
        for (one, other) in [
            ("--configuration", "--tip"),
            ("--random-start", "--start"),
            ("--index", "--select"),
            ("--append", "--start"),
        ] {
            if option == one {
                arguments = without(arguments, other);
            }
        }
        if !option.is_empty()
            && !is_positional
            && self
                .command
                .options
                .iter()
                .any(|(known, _)| *known == option)
        {
            arguments.push(option.into());
        }
        arguments.extend(values);
        arguments
    }
}

/// The arguments without an option and its values.
fn without(arguments: Vec<OsString>, option: &str) -> Vec<OsString> {
    let mut is_inside = false;
    arguments
        .into_iter()
        .filter(|argument| {
            let text = argument.to_string_lossy();
            if text.starts_with("--") {
                is_inside = text == option;
            }
            !is_inside
        })
        .collect()
}

fn refused(option: &Listed, value: &str) -> Expected {
    Expected::Refused(vec![option.fault(value)])
}

/// Options that may be given several times.
const REPEATED: [&str; 5] = [
    "--ball",
    "--configuration",
    "--planners",
    "--sets",
    "--figures",
];

/// One value too few, one too many, the option twice, its values joined by `=`.
fn wrong_counts(option: &Listed, wanted: &Wanted) -> Vec<Given> {
    let good: Vec<OsString> = wanted
        .good(option.values, &option.choices)
        .iter()
        .map(OsString::from)
        .collect();
    let given = |values: Vec<OsString>| Given {
        values,
        expected: refused(option, ""),
        prepare: |_| (),
    };
    let mut all = Vec::new();
    let is_named = option.name.starts_with("--");
    if option.values > 0 && is_named {
        all.push(given(good[1..].to_vec()));
    }
    if option.values > 1 {
        all.push(given(Vec::new()));
    }
    let surplus = Given {
        expected: Expected::Refused(vec![Fault::option("", "surplus").or_key(&option.name)]),
        ..given([good.clone(), vec!["surplus".into()]].concat())
    };
    all.push(surplus);
    if is_named && !REPEATED.contains(&option.name.as_str()) {
        let twice = [good.clone(), vec![OsString::from(&option.name)], good].concat();
        all.push(given(twice));
    }
    all
}

/// Wrong values of the option's kind.
fn wrong_values(option: &Listed, wanted: &Wanted) -> Vec<Given> {
    let no_numbers = [
        "", " ", "nan", "inf", "-inf", "abc", "0x10", "1e", "１", "1,5", "1_000", "- 1", "--",
        "1 2",
    ];
    let numbers = [
        "-1",
        "-0",
        "0",
        "1",
        "0.5",
        "1.5",
        "5e-324",
        "1e308",
        "-1e308",
        "1e309",
        "255",
        "256",
        "65536",
        "2147483648",
        "4294967296",
        "9223372036854775807",
        "9223372036854775808",
        "18446744073709551615",
        "18446744073709551616",
        "-9223372036854775808",
        "-9223372036854775809",
        "340282366920938463463374607431768211456",
    ];
    let mut texts: Vec<String> = no_numbers
        .iter()
        .chain(&numbers)
        .map(|t| (*t).to_owned())
        .collect();
    texts.push("9".repeat(100_000));
    // Nothing after a lone `--` is no mistake where a value may be left out.
    texts.retain(|text| text != "--" || !option.name.starts_with('['));
    let mut all = Vec::new();
    for text in texts {
        for place in places_for(option.values) {
            let mut values = wanted.good(option.values, &option.choices);
            values[place].clone_from(&text);
            let expected = match wanted.opinion(&text, place, &option.choices) {
                Some(true) if wanted.is_long(&text) => continue,
                Some(true) => Expected::Either(vec![option.fault_of(wanted, &text)]),
                Some(false) => Expected::Refused(vec![option.fault_of(wanted, &text)]),
                None => continue,
            };
            let values = values.iter().map(OsString::from).collect();
            all.push(Given {
                values,
                expected,
                prepare: |_| (),
            });
        }
    }
    let mut bytes: Vec<OsString> = wanted
        .good(option.values, &option.choices)
        .iter()
        .map(OsString::from)
        .collect();
    bytes[0] = OsString::from_vec(b"1\xff\xfe".to_vec());
    if !wanted.is_path() {
        all.push(Given {
            values: bytes,
            expected: refused(option, ""),
            prepare: |_| (),
        });
    }
    all.extend(wrong_paths(option, wanted));
    all
}

/// The first and the last of an option's values.
fn places_for(values: usize) -> BTreeSet<usize> {
    BTreeSet::from([0, values - 1])
}

fn wrong_paths(option: &Listed, wanted: &Wanted) -> Vec<Given> {
    let at = |path: &str, prepare: fn(&Path)| Given {
        values: vec![path.into()],
        expected: Expected::Refused(vec![
            Fault {
                is_unreadable: true,
                ..Fault::file(path)
            },
            Fault::file(if path.is_empty() { "\0" } else { path }),
            // An empty path has no name but its option's.
            Fault {
                is_unreadable: true,
                ..option.fault(path)
            },
            option.fault(path),
        ]),
        prepare,
    };
    let nothing: fn(&Path) = |_| ();
    let long = "x".repeat(300);
    let mut all: Vec<Given> = Vec::new();
    match wanted {
        Wanted::ReadFile | Wanted::ReadFolder => {
            all.push(at("none", nothing));
            all.push(at("", nothing));
            all.push(at(&long, nothing));
            all.push(at("/dev/zero", nothing));
            all.push(at("/dev/null", nothing));
            all.push(at("/proc/self/mem", nothing));
            all.push(at("pipe", |folder| damage::pipe(&folder.join("pipe"))));
            all.push(at("folder", |folder| {
                fs::create_dir(folder.join("folder")).unwrap();
            }));
            all.push(at("file", |folder| {
                fs::write(folder.join("file"), "text").unwrap();
            }));
        }
        Wanted::WriteFolder => {
            all.push(at("file", |folder| {
                fs::write(folder.join("file"), "text").unwrap();
            }));
            all.push(at("file/below", |folder| {
                fs::write(folder.join("file"), "text").unwrap();
            }));
            all.push(at("/proc/none", nothing));
            all.push(at("/dev/null", nothing));
            all.push(at(&long, nothing));
            all.push(at("", nothing));
            all.push(at("loop", |folder| {
                std::os::unix::fs::symlink("loop", folder.join("loop")).unwrap();
            }));
        }
        Wanted::WriteFile => {
            all.push(at("folder", |folder| {
                fs::create_dir(folder.join("folder")).unwrap();
            }));
            all.push(at("file/below", |folder| {
                fs::write(folder.join("file"), "text").unwrap();
            }));
            all.push(at("/proc/none/file", nothing));
            all.push(at("/dev/full", nothing));
            all.push(at(&long, nothing));
            all.push(at("", nothing));
        }
        _ => {}
    }
    all
}
