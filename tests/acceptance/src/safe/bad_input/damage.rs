//! Damage that any file can have: cut, flipped, foreign, or not a file at all.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A file's new content and what was done.
pub(super) struct Damaged {
    pub(super) name: String,
    pub(super) content: Vec<u8>,
}

fn damaged(name: impl Into<String>, content: Vec<u8>) -> Damaged {
    Damaged {
        name: name.into(),
        content,
    }
}

/// Cut at `count` places, evenly spread and at the last bytes.
pub(super) fn truncated(content: &[u8], count: usize) -> Vec<Damaged> {
    let length = content.len();
    let mut places: Vec<usize> = (0..count).map(|i| i * length / count).collect();
    places.extend(
        [1, 2, 4, 16]
            .iter()
            .filter(|n| **n < length)
            .map(|n| length - n),
    );
    places.sort_unstable();
    places.dedup();
    let cut = |at: usize| {
        damaged(
            format!("cut to {at} of {length} bytes"),
            content[..at].to_vec(),
        )
    };
    places.into_iter().map(cut).collect()
}

/// One bit turned, at `count` seeded places.
pub(super) fn flipped(content: &[u8], count: usize, seed: u64) -> Vec<Damaged> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let flip = |_| {
        let (at, bit) = (rng.random_range(0..content.len()), rng.random_range(0..8));
        flip(content, at, bit)
    };
    (0..count).map(flip).collect()
}

/// One bit turned at a place.
pub(super) fn flip(content: &[u8], at: usize, bit: u32) -> Damaged {
    let mut fresh = content.to_vec();
    fresh[at] ^= 1 << bit;
    damaged(format!("bit {bit} of byte {at} flipped"), fresh)
}

/// What lies in front of, behind or within the content that does not belong there.
pub(super) fn with_surplus(content: &[u8], is_text: bool) -> Vec<Damaged> {
    let behind = |name: &str, tail: &[u8]| damaged(name, [content, tail].concat());
    let mut all = vec![
        behind("a NUL behind", &[0]),
        behind("4096 NULs behind", &[0; 4096]),
        behind("0xff behind", &[0xff]),
        behind("itself behind", content),
        damaged("a NUL in front", [&[0], content].concat()),
        damaged("a NUL within", {
            let mut fresh = content.to_vec();
            fresh.insert(content.len() / 2, 0);
            fresh
        }),
    ];
    if is_text {
        let crlf = String::from_utf8_lossy(content).replace('\n', "\r\n");
        all.push(damaged("with CRLF", crlf.into_bytes()));
        let cr = String::from_utf8_lossy(content).replace('\n', "\r");
        all.push(damaged("with CR alone", cr.into_bytes()));
        let utf16: Vec<u8> = String::from_utf8_lossy(content)
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        all.push(damaged("as UTF-16", utf16));
        all.push(behind("an empty line behind", b"\n"));
    }
    all
}

/// Content of other kinds of files.
pub(super) fn foreign() -> Vec<Damaged> {
    let png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90wS\xde".to_vec();
    let npy =
        b"\x93NUMPY\x01\0v\0{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }\n".to_vec();
    let header = br#"{"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}}"#;
    let tensors = [&(header.len() as u64).to_le_bytes()[..], header, &[0; 4]].concat();
    let program = fs::read("/proc/self/exe").unwrap();
    vec![
        damaged("empty", Vec::new()),
        damaged("one NUL", vec![0]),
        damaged("a PNG", png),
        damaged("an empty zip", [&b"PK\x05\x06"[..], &[0; 18]].concat()),
        damaged("an npy", npy),
        damaged("a safetensors", tensors),
        damaged("a program", program[..4096].to_vec()),
        damaged("JSON", br#"{"robot": {"name": 1}}"#.to_vec()),
        damaged("HTML", b"<html><body>404</body></html>\n".to_vec()),
        damaged("only a newline", b"\n".to_vec()),
        damaged("text", b"solid facts\nv 1 2 3\n".to_vec()),
        damaged("1 MB of 0xff", vec![0xff; 1 << 20]),
    ]
}

/// Puts something at a path.
type MakePlace = fn(&Path);

/// What may lie at a path instead of a file.
pub(super) const PLACES: &[(&str, MakePlace)] = &[
    ("is missing", |_| ()),
    ("is a folder", |path| fs::create_dir(path).unwrap()),
    ("is a pipe that nobody writes", pipe),
    ("is /dev/zero", |path| symlink("/dev/zero", path).unwrap()),
    ("is /dev/full", |path| symlink("/dev/full", path).unwrap()),
    ("is /dev/null", |path| symlink("/dev/null", path).unwrap()),
    ("is a link to itself", |path| symlink(path, path).unwrap()),
    ("leads nowhere", |path| {
        symlink("/nowhere/at/all", path).unwrap();
    }),
    ("is /proc/self/mem", |path| {
        symlink("/proc/self/mem", path).unwrap();
    }),
    ("is a socket", |path| {
        std::os::unix::net::UnixListener::bind(path).unwrap();
    }),
    ("is 200 MB of zeros", |path| {
        fs::File::create(path)
            .unwrap()
            .set_len(200_000_000)
            .unwrap();
    }),
    ("is 1 TB of zeros", |path| {
        // A tmpfs may refuse so large a hole: then it stays at nothing, which no reader wants either.
        let _ = fs::File::create(path).unwrap().set_len(1 << 40);
    }),
];

/// Makes a pipe.
pub(super) fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}
