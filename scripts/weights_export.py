"""Weights files and their manifest, as `crates/denoiser` reads them (weights/README.md)."""

import hashlib
import json
import platform
import re
from pathlib import Path

import torch
from safetensors.torch import save_file


def processor_name():
    """The processor's model name where /proc/cpuinfo tells it."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*:\s*(.+)", info.read_text()) if info.exists() else None
    return found.group(1) if found else platform.machine()


def this_machine():
    """The processor, or the accelerator if there is one, and the version of PyTorch."""
    name = torch.cuda.get_device_name() if torch.cuda.is_available() else processor_name()
    return f"{name}, torch {torch.__version__}"


def record_of(state, recipe, measured, machine):
    """How a training run made its weights; safetensors wants strings."""
    facts = state["facts"]
    return {
        "recipe": recipe,
        "seed": str(facts["seed"]),
        "updates": str(state["updates"]),
        "batch": str(facts["batch"]),
        "training_rows": str(facts["rows"]),
        "training_seconds": str(round(state["seconds"])),
        "machine": machine,
        "validation": json.dumps(state["record"]),
        "measured": measured,
    }


def toml_value(value):
    """A JSON value, null apart, as inline TOML; strings, numbers and lists are written alike in both."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml_value(v)}" for key, v in value.items()) + " }"
    return json.dumps(value, ensure_ascii=False)


def manifest_entry(name, file, metadata):
    """The manifest's table of one weights file."""
    content = file.read_bytes()
    fields = {
        "file": file.name,
        "sha256": hashlib.sha256(content).hexdigest(),
        "bytes": len(content),
        "architecture": metadata["architecture"],
        "description": metadata["recipe"],
        "training_seeds": sorted({made["seed"] for made in json.loads(metadata.get("data", "[]"))}),
        "updates": int(metadata["updates"]),
        "training_seconds": int(metadata["training_seconds"]),
        "measured": json.loads(metadata["measured"]),
    }
    return f"[{name}]\n" + "".join(f"{key} = {toml_value(value)}\n" for key, value in fields.items())


def update_manifest(manifest, name, entry):
    """Replaces or adds one table, leaving the others as they are."""
    text = manifest.read_text() if manifest.exists() else ""
    tables = [t for t in re.split(r"(?m)^(?=\[)", text) if t.strip() and not t.startswith(f"[{name}]")]
    manifest.write_text("\n".join(t.strip() + "\n" for t in [*tables, entry]))


def write_weights(folder, name, tensors, metadata):
    """Writes NAME.safetensors in f32 and its entry in the folder's MANIFEST.toml; returns the entry."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.safetensors"
    save_file({key: value.float().contiguous() for key, value in tensors.items()}, file, metadata)
    file.chmod(0o644)
    entry = manifest_entry(name, file, metadata)
    update_manifest(folder / "MANIFEST.toml", name, entry)
    return entry
