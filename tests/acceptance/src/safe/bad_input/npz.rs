//! NumPy archives byte by byte: writing them with lies in their headers, and finding what each byte of one is.

use std::fmt::Write;
use std::ops::Range;

/// One array of an archive, as bytes.
#[derive(Clone)]
pub(super) struct Member {
    pub(super) name: String,
    pub(super) npy: Vec<u8>,
}

/// An npy file of a type (`<f4`), order, shape and content, which need not fit each other.
pub(super) fn npy(descr: &str, fortran: bool, shape: &str, content: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut header =
        format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    while (header.len() + 11) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let length = u16::try_from(header.len()).unwrap().to_le_bytes();
    [
        &b"\x93NUMPY\x01\x00"[..],
        &length,
        header.as_bytes(),
        content,
    ]
    .concat()
}

/// A shape as NumPy writes it.
pub(super) fn shape(counts: &[usize]) -> String {
    let mut text = String::from("(");
    for count in counts {
        let _ = write!(text, "{count}, ");
    }
    text + ")"
}

/// How a message may tell a shape that stands in a header: as a list of counts, as it stands there, or by what is no count.
pub(super) fn told_shapes(text: &str) -> Vec<String> {
    let counts = text.trim_matches(['(', ')', ' ', ',']);
    let words: Vec<&str> = counts.split(',').map(str::trim).collect();
    let mut told = vec![format!("[{}]", words.join(", "))];
    let wrong = words.iter().find(|word| word.parse::<u128>().is_err());
    match wrong {
        Some(word) if !word.is_empty() => told.push((*word).to_owned()),
        _ if !text.ends_with(')') => told.push(text.to_owned()),
        _ => {}
    }
    told
}

/// The bytes of numbers.
pub(super) fn reals(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A member of an archive as it lies there, with what the archive says of it.
#[derive(Clone)]
pub(super) struct Packed {
    pub(super) name: String,
    /// 0 for stored, 8 for deflated.
    method: u8,
    crc: u32,
    /// Bytes that it has, as the archive says.
    pub(super) size: u32,
    pub(super) packed: Vec<u8>,
}

impl Packed {
    /// A member that is stored as it is.
    pub(super) fn of(name: &str, npy: &[u8]) -> Self {
        Self {
            name: name.to_owned(),
            method: 0,
            crc: crc32(npy),
            size: u32_of(npy.len()),
            packed: npy.to_vec(),
        }
    }

    /// A deflated member: `header`, and so many zeros behind it.
    pub(super) fn zeros_behind(name: &str, header: &[u8], zeros: usize) -> Self {
        let begin = header
            .iter()
            .fold(u32::MAX, |crc, byte| crc_step(crc, *byte));
        Self {
            name: name.to_owned(),
            method: 8,
            crc: !crc_of_zeros(begin, zeros),
            size: u32_of(header.len() + zeros),
            packed: deflated(header, zeros),
        }
    }
}

/// A deflate stream of a block that is stored, and one of zeros in the fixed code (RFC 1951).
fn deflated(header: &[u8], zeros: usize) -> Vec<u8> {
    /// Bytes that the longest reference stands for.
    const LONGEST: usize = 258;
    let length = u16::try_from(header.len()).unwrap();
    let mut stream = vec![0];
    stream.extend(length.to_le_bytes());
    stream.extend((!length).to_le_bytes());
    stream.extend(header);
    let mut bits = Bits::default();
    bits.push(0b11, 3);
    let first = usize::from(zeros > 0);
    let literals = first + zeros.saturating_sub(first) % LONGEST;
    for _ in 0..literals {
        bits.push_code(0x30, 8);
    }
    for _ in 0..(zeros - literals) / LONGEST {
        // Symbol 285, and a distance of 1.
        bits.push_code(0b1100_0101, 8);
        bits.push_code(0, 5);
    }
    bits.push_code(0, 7);
    stream.extend(bits.bytes);
    stream
}

/// Bits from the lowest of the first byte on.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    count: usize,
}

impl Bits {
    /// Adds bits, the lowest first.
    fn push(&mut self, value: u32, count: usize) {
        for i in 0..count {
            if self.count.is_multiple_of(8) {
                self.bytes.push(0);
            }
            let bit = u8::try_from(value >> i & 1).unwrap();
            *self.bytes.last_mut().unwrap() |= bit << (self.count % 8);
            self.count += 1;
        }
    }

    /// Adds a code, the highest bit first.
    fn push_code(&mut self, code: u32, count: usize) {
        self.push(code.reverse_bits() >> (32 - count), count);
    }
}

/// A zip archive of members that are stored as they are.
pub(super) fn archive(members: &[Member]) -> Vec<u8> {
    let stored = members.iter().map(|m| Packed::of(&m.name, &m.npy));
    packed_archive(&stored.collect::<Vec<_>>())
}

/// A zip archive.
pub(super) fn packed_archive(members: &[Packed]) -> Vec<u8> {
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for member in members {
        let name = format!("{}.npy", member.name);
        let offset = u32_of(file.len());
        // Version, flags, method, time, date (1 January 1980), CRC, both sizes, lengths of name and extra field.
        let mut common = vec![20, 0, 0, 0, member.method, 0, 0, 0, 33, 0];
        common.extend(member.crc.to_le_bytes());
        let sizes = [u32_of(member.packed.len()), member.size];
        common.extend(sizes.iter().flat_map(|n| n.to_le_bytes()));
        common.extend(u16::try_from(name.len()).unwrap().to_le_bytes());
        common.extend([0, 0]);
        file.extend(b"PK\x03\x04");
        file.extend(&common);
        file.extend(name.as_bytes());
        file.extend(&member.packed);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let count = u16::try_from(members.len()).unwrap().to_le_bytes();
    let (begin, size) = (
        u32_of(file.len()).to_le_bytes(),
        u32_of(directory.len()).to_le_bytes(),
    );
    file.extend(directory);
    file.extend(b"PK\x05\x06\0\0\0\0");
    file.extend([count, count].concat());
    file.extend([size, begin].concat());
    file.extend([0, 0]);
    file
}

fn u32_of(length: usize) -> u32 {
    u32::try_from(length).unwrap()
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes
        .iter()
        .fold(u32::MAX, |crc, byte| crc_step(crc, *byte))
}

/// The register after another byte.
fn crc_step(crc: u32, byte: u8) -> u32 {
    (0..8).fold(crc ^ u32::from(byte), |crc, _| {
        (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg())
    })
}

/// The register after so many zeros: a step is linear over its bits, so that its square takes twice as many.
fn crc_of_zeros(mut crc: u32, mut zeros: usize) -> u32 {
    let apply = |matrix: &[u32; 32], crc: u32| {
        let bits = (0..32).filter(|bit| crc >> bit & 1 == 1);
        bits.fold(0, |sum, bit: usize| sum ^ matrix[bit])
    };
    let mut step: [u32; 32] = std::array::from_fn(|bit| crc_step(1 << bit, 0));
    while zeros > 0 {
        if zeros % 2 == 1 {
            crc = apply(&step, crc);
        }
        step = step.map(|column| apply(&step, column));
        zeros /= 2;
    }
    crc
}

/// Name and place of the content of each member, compressed or not, by the archive's directory.
pub(super) fn contents(archive: &[u8]) -> Vec<(String, Range<usize>)> {
    let end = archive
        .windows(4)
        .rposition(|w| w == b"PK\x05\x06")
        .unwrap();
    let mut at = number(archive, end + 16, 4);
    let mut found = Vec::new();
    for _ in 0..number(archive, end + 10, 2) {
        let (size, offset) = (number(archive, at + 20, 4), number(archive, at + 42, 4));
        let lengths = [28, 30, 32].map(|field| number(archive, at + field, 2));
        let name = String::from_utf8_lossy(&archive[at + 46..][..lengths[0]]).into_owned();
        let begin = offset + 30 + number(archive, offset + 26, 2) + number(archive, offset + 28, 2);
        found.push((name, begin..begin + size));
        at += 46 + lengths.iter().sum::<usize>();
    }
    found
}

fn number(bytes: &[u8], at: usize, length: usize) -> usize {
    bytes[at..at + length]
        .iter()
        .rev()
        .fold(0, |sum, byte| (sum << 8) | usize::from(*byte))
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn an_archive_is_found_again() {
        let members = ["a", "bc"].map(|name| Member {
            name: name.to_owned(),
            npy: npy("<f4", false, &shape(&[2]), &reals(&[1.0, 2.0])),
        });
        let bytes = archive(&members);
        let found = contents(&bytes);
        assert_eq!(found[1].0, "bc.npy");
        assert_eq!(bytes[found[1].1.clone()], members[1].npy);
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
        let zeros = crc_of_zeros(crc_step(u32::MAX, 7), 1000);
        assert_eq!(!zeros, crc32(&[&[7][..], &[0; 1000]].concat()));
    }
}
