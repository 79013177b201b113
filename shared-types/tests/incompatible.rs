//! A service that is there is another one than a program expects: refused by name.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot set up its world has to stop"
)]

mod world;

use iceoryx2::prelude::*;
use shared_types::PROTOCOL_VERSION;
use shared_types::ipc::*;
use world::{daemon_and_user, world};

#[test]
fn a_daemon_that_wants_more_than_a_living_service_has_is_refused() {
    let world = world();
    let [living, next] = daemon_and_user(&world);
    let capacity = PlanServiceCapacity::default();
    let _service = plan_service(&living, &capacity).unwrap();
    let larger = PlanServiceCapacity {
        clients: capacity.clients + 1,
        ..capacity
    };
    let error = plan_service(&next, &larger).unwrap_err();
    assert!(matches!(error, IpcError::Incompatible { .. }), "{error}");
    assert!(error.to_string().contains("other capacities"), "{error}");
}

#[test]
fn a_service_of_another_version_is_refused_with_expected_and_found() {
    #[derive(Clone, Copy, Debug, ZeroCopySend)]
    #[type_name("pcc.v5.Heartbeat")]
    #[repr(C)]
    struct Old(u64);
    let world = world();
    let node = IpcNode::create(&world.options, "test").unwrap();
    let mut config = iceoryx2::config::Config::default();
    let root = world.options.root.to_str().unwrap().as_bytes();
    config.global.set_root_path(&Path::new(root).unwrap());
    let prefix = format!("{}_", world.options.prefix);
    config.global.prefix = FileName::new(prefix.as_bytes()).unwrap();
    let builder = NodeBuilder::new().config(&config);
    let other = builder.create::<ipc::Service>().unwrap();
    let name = ServiceName::new(&world.options.service_name("heartbeat")).unwrap();
    let service = other.service_builder(&name).publish_subscribe::<Old>();
    let _service = service.open_or_create().unwrap();
    let error = heartbeat_service(&node).unwrap_err().to_string();
    let version = PROTOCOL_VERSION;
    for told in [
        format!(
            "expected protocol version {version}: pcc.v{version}.Heartbeat (32 bytes, alignment 8)"
        ),
        "found protocol version 5: pcc.v5.Heartbeat (8 bytes, alignment 8)".to_owned(),
    ] {
        assert!(error.contains(&told), "{error}");
    }
}
