"""Joins the services with iceoryx2's own Python bindings, by what shared-types/wire.json says and nothing else.

    wire = Wire()
    states = wire.service("controller_state").subscriber_builder().create()

A message is a ctypes structure with the fields of wire.json; units, clock and zero values: docs/wire.md. Needs Python 3.9 and iceoryx2 0.10.0.
"""

import ctypes
import fcntl
import json
import os
import re
import sys
import time
from pathlib import Path

import iceoryx2 as iox2

DESCRIPTION = Path(__file__).resolve().parents[2] / "shared-types" / "wire.json"
NUMBERS = {"u8": ctypes.c_uint8, "u32": ctypes.c_uint32, "u64": ctypes.c_uint64, "i64": ctypes.c_int64, "f64": ctypes.c_double}
# Settings of iceoryx2 whose method is called otherwise.
METHODS = {
    "safe_overflow": "enable_safe_overflow", "fire_and_forget_requests": "enable_fire_and_forget_requests",
    "safe_overflow_for_requests": "enable_safe_overflow_for_requests",
    "safe_overflow_for_responses": "enable_safe_overflow_for_responses",
}  # fmt: skip
# Errors of a service that is there and does not fit.
OPEN_ERRORS = (
    iox2.PublishSubscribeOpenOrCreateError, iox2.RequestResponseOpenOrCreateError, iox2.RequestResponseOpenError,
    iox2.EventOpenOrCreateError,
)  # fmt: skip
PATTERNS = {
    "publish_subscribe": iox2.MessagingPattern.PublishSubscribe, "request_response": iox2.MessagingPattern.RequestResponse,
    "event": iox2.MessagingPattern.Event,
}  # fmt: skip
# A message's type in the text of a service's details: name, bytes, alignment.
TYPE = r'\b(?:user_header|payload): TypeDetail \{.*?data: "([^"]*)".*?size: (\d+),\s*alignment: (\d+)'


class Wire:
    """The services of one prefix, and a node that joins them.

    `prefix` and `root` default to PCC_PREFIX and PCC_ROOT, then to what docs/wire.md says.
    """

    def __init__(self, description=DESCRIPTION, prefix=None, root=None):
        self.description = json.loads(Path(description).read_text())
        names = self.description["names"]
        self.prefix = prefix or os.environ.get("PCC_PREFIX", names["default_prefix"])
        self.root = str(root or os.environ.get("PCC_ROOT") or default_root(names["default_roots"]))
        self.services = {service["name"]: service for service in self.description["services"]}
        self.types = {}
        config = iox2.config.default()
        config.global_cfg.prefix = iox2.FileName.new(self.prefix + "_")
        config.global_cfg.root_path = iox2.Path.new(self.root)
        builder = iox2.NodeBuilder.new().config(config).signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self.node = builder.create(iox2.ServiceType.Ipc)

    def type(self, name):
        """The structure of a message, or the number of this name."""
        if name in NUMBERS:
            return NUMBERS[name]
        if name not in self.types:
            self.types[name] = self.structure(self.description["messages"][name])
        return self.types[name]

    def structure(self, message):
        fields = [(field["name"], self.field_type(field)) for field in message["fields"]]
        name = message["type_name"]
        made = type(name, (ctypes.Structure,), {"_fields_": fields, "type_name": staticmethod(lambda: name)})
        offsets = {field["name"]: field["offset"] for field in message["fields"]}
        here = {name: getattr(made, name).offset for name, _ in fields}
        expected = (message["bytes"], message["alignment"], offsets)
        found = (ctypes.sizeof(made), ctypes.alignment(made), here)
        if found != expected:
            raise TypeError(f"{name} is laid out otherwise on this machine: {found}, expected {expected}")
        return made

    def field_type(self, field):
        one = self.type(field["type"])
        return one * field["count"] if "count" in field else one

    def new(self, name, **fields):
        """A message of zeros but for the protocol's version and these fields."""
        message = self.type(name)()
        if hasattr(message, "protocol_version"):
            message.protocol_version = self.description["protocol_version"]
        for field, value in fields.items():
            if isinstance(value, (list, tuple, bytes)):
                getattr(message, field)[: len(value)] = list(value)
            else:
                setattr(message, field, value)
        return message

    def code(self, enumeration, name):
        """The number that a name has on the wire."""
        values = self.description["codes"][enumeration]["values"]
        return next(value["code"] for value in values if value["name"] == name)

    def text(self, enumeration, code):
        """What a number on the wire means, in words."""
        values = self.description["codes"][enumeration]["values"]
        return next((value["text"] for value in values if value["code"] == code), f"unknown ({code})")

    def service(self, name):
        """A service, opened or created with the settings that wire.json has; one that a process alone makes is opened."""
        service = self.services[name]
        builder = self.node.service_builder(iox2.ServiceName.new(f"{self.prefix}/{name}"))
        builder = getattr(self, service["pattern"])(builder, service)
        try:
            if "made_by" in service:
                return builder.open()
            for setting, value in service.items():
                method = getattr(builder, METHODS.get(setting, setting), None)
                builder = method(value) if method else builder
            return builder.open_or_create()
        except OPEN_ERRORS as error:
            if "Incompatible" not in str(error):
                raise
            expected, found = self.expected_types(service), self.found_types(service)
            raise TypeError(f"service {name} is another one ({error}): expected {expected}; found {found}") from error

    def expected_types(self, service):
        """The types of a service's messages as wire.json has them, in words."""
        names = [service[part] for part in ("payload", "request", "response_user_header", "response") if service.get(part)]
        messages = [self.description["messages"][name] for name in names]
        return in_words((message["type_name"], message["bytes"], message["alignment"]) for message in messages)

    def found_types(self, service):
        """Those of the service that is there, read from the text of its details: iceoryx2 0.10.0 has no other way in Python."""
        name = iox2.ServiceName.new(f"{self.prefix}/{service['name']}")
        details = iox2.Service.details(name, self.node.config, PATTERNS[service["pattern"]], iox2.ServiceType.Ipc)
        return in_words(found for found in re.findall(TYPE, str(details), re.DOTALL) if found[0] != "()")

    def publish_subscribe(self, builder, service):
        payload = self.type(service["payload"])
        return builder.publish_subscribe(iox2.Slice[payload] if service["payload_is_slice"] else payload)

    def request_response(self, builder, service):
        request, response = self.type(service["request"]), self.type(service["response"])
        builder = builder.request_response(request, iox2.Slice[response] if service["response_is_slice"] else response)
        header = service.get("response_user_header")
        return builder.response_header(self.type(header)) if header else builder

    def event(self, builder, _service):
        return builder.event()


def in_words(types):
    """Names, bytes and alignments of types, after the protocol's version in their names."""
    types = list(types)
    if not types:
        return "no type"
    versions = {match[1] if (match := re.match(r"pcc\.v(\d+)\.", name)) else None for name, *_ in types}
    version = versions.pop() if len(versions) == 1 else None
    protocol = f"protocol version {version}" if version else "another protocol"
    return f"{protocol}: " + ", ".join(f"{name} ({size} bytes, alignment {alignment})" for name, size, alignment in types)


def default_root(roots):
    """The first of these folders that is there, or else the last."""
    roots = [Path(root.replace("UID", str(os.getuid()))).expanduser() for root in roots]
    return next((root for root in roots if root.is_dir()), roots[-1])


def take_role(wire, role):
    """The lock of a role, `robot` or `controller`, which one process has at a time; it is held for as long as it is kept."""
    parts = {"ROOT": wire.root, "PREFIX": wire.prefix, "ROLE": role}
    lock = open(re.sub("|".join(parts), lambda part: parts[part[0]], wire.description["names"]["role_lock"]), "a+")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.seek(0)
        sys.exit(f"a {role} already runs here (process {lock.read().strip()})")
    lock.truncate(0)
    lock.write(f"{os.getpid()}\n")
    lock.flush()
    return lock


def every(subscriber):
    """Copies of all messages that have arrived, the oldest first."""
    while (sample := subscriber.receive()) is not None:
        contents = sample.payload().contents
        message = type(contents).from_buffer_copy(contents)
        sample.delete()
        yield message


def newest(subscriber):
    """A copy of the newest message that has arrived, or None."""
    message = None
    for message in every(subscriber):
        pass
    return message


def first(subscriber):
    """A copy of the newest message, once there is one."""
    while (message := newest(subscriber)) is None:
        time.sleep(0.05)
    return message


def reason(text):
    """A ReasonText as a string."""
    return bytes(text.utf8[: text.length]).decode("utf-8", "replace")
