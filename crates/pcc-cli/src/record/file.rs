//! The MCAP file: channels of our messages, byte by byte as they are on the wire, and one of Foxglove's.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use foxglove::Encode;
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use serde_json::{Value, json};
use shared_types::clock::mono_now_ns;
use shared_types::message::{LAYOUTS, Layout};

/// How our messages are encoded, and how their layouts are described: as in `shared-types/wire.json`.
pub(crate) const ENCODING: &str = "pcc-wire";
const SCHEMA_ENCODING: &str = "pcc-wire-json";
/// Topic of a record's last message: how many messages each topic has, a JSON object.
pub(crate) const COUNTS: &str = "/message_counts";
const COUNTS_SCHEMA: &str =
    r#"{"type": "object", "additionalProperties": {"type": "integer", "minimum": 0}}"#;

/// An instant as MCAP has it: nanoseconds since 1970.
#[derive(Clone, Copy)]
pub(super) struct RealTime(u64);

impl RealTime {
    pub(super) fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let since_ns = since.map_or(0, |since| since.as_nanos());
        Self(u64::try_from(since_ns).unwrap_or(u64::MAX))
    }

    /// The instant of a stamp by `CLOCK_MONOTONIC`, nanoseconds.
    pub(super) fn of(stamp_mono_ns: i64) -> Self {
        Self(
            Self::now()
                .0
                .saturating_add_signed(stamp_mono_ns.saturating_sub(mono_now_ns())),
        )
    }

    pub(super) fn seconds_and_rest(self) -> (u32, u32) {
        let second = 1_000_000_000;
        let whole = u32::try_from(self.0 / second).unwrap_or(u32::MAX);
        (whole, (self.0 % second) as u32)
    }
}

/// A channel of a file.
#[derive(Clone, Copy)]
pub(super) struct Channel(u16);

/// A file under way; what was flushed can be read whatever becomes of the recorder.
pub(super) struct McapFile {
    writer: Writer<BufWriter<File>>,
    /// Topic and messages so far of each channel.
    channels: BTreeMap<u16, (String, u32)>,
}

impl McapFile {
    pub(super) fn create(path: &Path) -> anyhow::Result<Self> {
        let file = File::create_new(path).with_context(|| path.display().to_string())?;
        let library = concat!("pcc ", env!("CARGO_PKG_VERSION"));
        // Without seeking, chunks are written whole: what was flushed is a file that any reader reads.
        let options = WriteOptions::new()
            .compression(None)
            .disable_seeking(true)
            .library(library);
        Ok(Self {
            writer: options.create(BufWriter::new(file))?,
            channels: BTreeMap::new(),
        })
    }

    /// A channel of messages of this layout.
    pub(super) fn channel(&mut self, topic: &str, layout: &Layout) -> anyhow::Result<Channel> {
        let schema = serde_json::to_vec(&described(layout))?;
        let schema = self
            .writer
            .add_schema(layout.type_name, SCHEMA_ENCODING, &schema)?;
        self.add_channel(schema, topic, ENCODING)
    }

    /// A channel of Foxglove's messages.
    pub(super) fn foxglove<T: Encode>(&mut self, topic: &str) -> anyhow::Result<Channel> {
        let schema = T::get_schema().context("no schema")?;
        let schema = self
            .writer
            .add_schema(&schema.name, &schema.encoding, &schema.data)?;
        self.add_channel(schema, topic, &T::get_message_encoding())
    }

    fn add_channel(&mut self, schema: u16, topic: &str, encoding: &str) -> anyhow::Result<Channel> {
        let channel = self
            .writer
            .add_channel(schema, topic, encoding, &BTreeMap::new())?;
        self.channels.insert(channel, (topic.to_owned(), 0));
        Ok(Channel(channel))
    }

    pub(super) fn write(
        &mut self,
        Channel(channel_id): Channel,
        RealTime(log_time): RealTime,
        bytes: &[u8],
    ) -> anyhow::Result<()> {
        let (_, count) = self.channels.get_mut(&channel_id).context("no channel")?;
        let header = MessageHeader {
            channel_id,
            sequence: *count,
            log_time,
            publish_time: log_time,
        };
        *count = count.wrapping_add(1);
        Ok(self.writer.write_to_known_channel(&header, bytes)?)
    }

    pub(super) fn flush(&mut self) -> anyhow::Result<()> {
        Ok(self.writer.flush()?)
    }

    /// Writes how many messages there are, so that a reader knows whether it has all, and ends the file.
    pub(super) fn finish(&mut self) -> anyhow::Result<()> {
        let counts: BTreeMap<_, _> = self.channels.values().cloned().collect();
        let schema = COUNTS_SCHEMA.as_bytes();
        let schema = self
            .writer
            .add_schema("pcc.MessageCounts", "jsonschema", schema)?;
        let channel = self.add_channel(schema, COUNTS, "json")?;
        self.write(channel, RealTime::now(), &serde_json::to_vec(&counts)?)?;
        self.writer.finish()?;
        Ok(())
    }
}

/// A message's layout with those of the messages in it.
fn described(layout: &Layout) -> Value {
    let field = |field: &shared_types::message::Field| {
        json!({
            "name": field.name,
            "type": field.element,
            "count": field.count,
            "offset": field.offset,
            "bytes": field.bytes,
        })
    };
    let fields: Vec<Value> = layout.fields.iter().map(field).collect();
    let within = |inner: &&Layout| layout.fields.iter().any(|it| it.element == inner.type_name);
    let parts: Vec<Value> = LAYOUTS.iter().filter(within).map(described).collect();
    json!({
        "name": layout.type_name,
        "bytes": layout.bytes,
        "byte_order": "little",
        "fields": fields,
        "types": parts,
    })
}
