//! `pcc services`: the services that are there, who uses them, and who is daemon, controller and robot.

use clap::Args;
use shared_types::ipc::{
    COMMAND, EVENTS, IpcOptions, LiveService, Role, RoleLock, TOPICS, live_services,
};
use shared_types::message::{Command, Payload, PlanRequest};

/// Arguments of `pcc services`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Write one JSON object in place of tables.
    #[arg(long)]
    json: bool,
}

/// Who has a role.
struct Holder {
    role: &'static str,
    pid: Option<u32>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let options = IpcOptions::from_env();
    let services = live_services(&options)?;
    let roles = [Role::PlannerDaemon, Role::Controller, Role::Robot];
    let holders = roles.map(|role| Holder {
        role: role.name(),
        pid: RoleLock::holder(&options, role),
    });
    if arguments.json {
        say!("{}", json(&options, &services, &holders));
    } else {
        show(&options, &services, &holders);
    }
    Ok(())
}

fn show(options: &IpcOptions, services: &[LiveService], holders: &[Holder]) {
    say!("prefix {}, root {}", options.prefix, options.root.display());
    for Holder { role, pid } in holders {
        let pid = pid.map_or("nobody".to_owned(), |pid| format!("process {pid}"));
        say!("{role}: {pid}");
    }
    if services.is_empty() {
        say!("no services: neither daemon nor controller nor robot was started under this prefix");
        return;
    }
    say!("");
    say!("{:<18} {:<26} used by", "service", "type");
    for service in services {
        let users = service.users.join(", ");
        let dead = match service.dead {
            0 => String::new(),
            dead => format!(" and {dead} killed, not cleaned up yet"),
        };
        let fault = fault(service).map_or(String::new(), |fault| format!("  {fault}"));
        say!(
            "{:<18} {:<26} {users}{dead}{fault}",
            service.name,
            service.type_name
        );
    }
}

/// What makes a service one that this version cannot join.
fn fault(service: &LiveService) -> Option<String> {
    let topics = TOPICS
        .iter()
        .map(|topic| (topic.settings.name, topic.layout.type_name));
    let exchanges = [
        ("plan", PlanRequest::LAYOUT.type_name),
        (COMMAND.name, Command::LAYOUT.type_name),
    ];
    let events = EVENTS.iter().map(|event| (event.name, ""));
    let mut known = topics.chain(exchanges).chain(events);
    match known.find(|(name, _)| *name == service.name) {
        None => Some("(not of this protocol)".to_owned()),
        Some((_, expected)) if expected != service.type_name => {
            Some(format!("(of another version: {expected} is expected)"))
        }
        Some(_) => None,
    }
}

fn json(options: &IpcOptions, services: &[LiveService], holders: &[Holder]) -> serde_json::Value {
    let services = services.iter().map(|service| {
        serde_json::json!({
            "name": service.name,
            "type_name": service.type_name,
            "users": service.users,
            "dead": service.dead,
            "fault": fault(service),
        })
    });
    let holders = holders
        .iter()
        .map(|holder| serde_json::json!({ "role": holder.role, "pid": holder.pid }));
    serde_json::json!({
        "prefix": options.prefix,
        "root": options.root,
        "roles": holders.collect::<Vec<_>>(),
        "services": services.collect::<Vec<_>>(),
    })
}
