//! The servers of the baselines: processes of their own, which end with the one that measures.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::{env, io, process, thread};

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use realtime::Pages;
use shared_types::ipc::IpcOptions;
use shared_types::message::Knot;

use super::copying::{self, Answer};
use super::raw;

/// What a server says once it serves.
const READY: &str = "ready";

/// A way to ask and to answer.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Transport {
    /// iceoryx2, answered by the thread that receives.
    Raw,
    /// iceoryx2, with one hand-over to another thread and back.
    RawHandedOver,
    /// A Unix socket and a serialiser.
    Copying,
}

/// Arguments of a server, which `pcc latency --baselines` starts.
#[derive(Args)]
pub(crate) struct Arguments {
    /// How it is asked and answers.
    #[arg(value_enum)]
    transport: Transport,
}

/// Serves one client the answer that comes on standard input, until that ends.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let answer = Answer::read(&mut io::stdin())?;
    let is_over = Arc::<AtomicBool>::default();
    let at_the_end = Arc::clone(&is_over);
    thread::spawn(move || {
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        at_the_end.store(true, Ordering::Relaxed);
    });
    let options = IpcOptions::from_env();
    let is_handed_over = matches!(arguments.transport, Transport::RawHandedOver);
    let is_ready = || {
        prepare(&options);
        say!("{READY}");
    };
    match arguments.transport {
        Transport::Raw | Transport::RawHandedOver => raw::serve(
            &options,
            &answer.knots(),
            is_handed_over,
            is_ready,
            &is_over,
        ),
        Transport::Copying => copying::serve(&options, &answer, is_ready, &is_over),
    }
}

/// Asks of the system what the daemon does, of which some may be refused here as there.
fn prepare(options: &IpcOptions) {
    let _ = realtime::reduce_timer_slack();
    if realtime::lock_memory(Pages::Touched).is_ok() {
        let _ = realtime::prefault_shared_memory(&options.prefix);
    }
}

/// A server's process; it ends when this is dropped.
pub(super) struct Server {
    process: Child,
    /// Where it serves.
    pub(super) options: IpcOptions,
}

impl Server {
    /// Starts a server that answers with these knots, and waits until it serves.
    pub(super) fn start(
        options: &IpcOptions,
        transport: Transport,
        knots: &[Knot],
    ) -> anyhow::Result<Self> {
        let name = transport.to_possible_value().expect("none is skipped");
        let name = name.get_name();
        let options = IpcOptions {
            prefix: format!("{}-{}-{}", options.prefix, transport as u8, process::id()),
            root: options.root.clone(),
        };
        let process = Command::new(env::current_exe()?)
            .args(["latency-server", name])
            .env("PCC_PREFIX", &options.prefix)
            .env("PCC_ROOT", &options.root)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let mut server = Self { process, options };
        server
            .hand_over(knots)
            .context("a server of the baselines")?;
        Ok(server)
    }

    fn hand_over(&mut self, knots: &[Knot]) -> anyhow::Result<()> {
        let input = self.process.stdin.as_mut().context("no input")?;
        input.write_all(&Answer::of(knots).to_bytes()?)?;
        input.flush()?;
        let output = self.process.stdout.as_mut().context("no output")?;
        let mut said = String::new();
        BufReader::new(output.take(64)).read_line(&mut said)?;
        ensure!(said.trim() == READY, "it does not serve");
        Ok(())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It ends with its input, and leaves nothing behind then.
        drop(self.process.stdin.take());
        let _ = self.process.wait();
        self.options.remove_node_counter();
    }
}
