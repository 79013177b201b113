//! Packets of protocol 2.0: what comes on the line, and what is sent.

/// How a packet begins.
const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Header, id, length and instruction.
const HEAD: usize = 8;
/// The id of all servos.
pub(super) const ALL: u8 = 0xFE;

pub(super) const PING: u8 = 0x01;
pub(super) const READ: u8 = 0x02;
pub(super) const WRITE: u8 = 0x03;
pub(super) const REBOOT: u8 = 0x08;
const STATUS: u8 = 0x55;
pub(super) const SYNC_READ: u8 = 0x82;
pub(super) const SYNC_WRITE: u8 = 0x83;

/// An instruction packet whose checksum is right.
#[derive(Debug, PartialEq)]
pub(super) struct Instruction {
    pub(super) id: u8,
    pub(super) code: u8,
    pub(super) parameters: Vec<u8>,
}

/// The bytes that have come and are no whole packet yet.
#[derive(Default)]
pub(super) struct Line {
    bytes: Vec<u8>,
}

impl Line {
    pub(super) fn receive(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next packet as it came on the line; bytes that belong to none are left out.
    pub(super) fn next_packet(&mut self) -> Option<Vec<u8>> {
        loop {
            let begin = self.bytes.windows(4).position(|bytes| bytes == HEADER)?;
            self.bytes.drain(..begin);
            let head = self.bytes.get(..HEAD)?;
            let length = 7 + usize::from(u16::from_le_bytes([head[5], head[6]]));
            if length < HEAD + 2 {
                self.bytes.drain(..4);
                continue;
            }
            let packet: Vec<u8> = self.bytes.get(..length)?.to_vec();
            self.bytes.drain(..length);
            return Some(packet);
        }
    }
}

impl Instruction {
    /// What a packet says; none where its checksum is wrong.
    pub(super) fn of(packet: &[u8]) -> Option<Self> {
        let (body, checksum) = packet.split_at_checked(packet.len().checked_sub(2)?)?;
        let is_whole = body.len() >= HEAD && checksum == checksum_of(body).to_le_bytes();
        is_whole.then(|| Self {
            id: body[4],
            code: body[7],
            parameters: unstuffed(&body[HEAD..]),
        })
    }
}

/// A status packet.
pub(super) fn status(id: u8, error: u8, parameters: &[u8]) -> Vec<u8> {
    let stuffed = stuffed(parameters);
    let length = stuffed.len() as u16 + 4;
    let mut packet = HEADER.to_vec();
    packet.push(id);
    packet.extend_from_slice(&length.to_le_bytes());
    packet.extend_from_slice(&[STATUS, error]);
    packet.extend_from_slice(&stuffed);
    packet.extend_from_slice(&checksum_of(&packet).to_le_bytes());
    packet
}

/// CRC-16 with the polynomial 0x8005, from 0, most significant bit first.
fn checksum_of(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |sum, byte| {
        (0..8).fold(sum ^ (u16::from(*byte) << 8), |sum, _| {
            if sum & 0x8000 == 0 {
                sum << 1
            } else {
                (sum << 1) ^ 0x8005
            }
        })
    })
}

/// Parameters with a byte 0xFD more after each 0xFF 0xFF 0xFD, so that none looks like a header.
fn stuffed(parameters: &[u8]) -> Vec<u8> {
    let mut stuffed = Vec::with_capacity(parameters.len());
    for byte in parameters {
        stuffed.push(*byte);
        if stuffed.ends_with(&HEADER[..3]) {
            stuffed.push(0xFD);
        }
    }
    stuffed
}

fn unstuffed(stuffed: &[u8]) -> Vec<u8> {
    let mut parameters = Vec::with_capacity(stuffed.len());
    let mut bytes = stuffed.iter();
    let mut last = [0; 3];
    while let Some(byte) = bytes.next() {
        parameters.push(*byte);
        last = [last[1], last[2], *byte];
        if last == HEADER[..3] {
            bytes.next();
            last = [0; 3];
        }
    }
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_packets_of_the_manual_are_understood() {
        // Ping of servo 1, and its answer, as the e-manual prints them.
        let ping = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];
        let mut line = Line::default();
        line.receive(&[0x00, 0xFF]);
        line.receive(&ping[..5]);
        assert_eq!(line.next_packet(), None);
        line.receive(&ping[5..]);
        let expected = Instruction {
            id: 1,
            code: PING,
            parameters: Vec::new(),
        };
        let packet = line.next_packet().unwrap();
        assert_eq!(packet, ping);
        assert_eq!(Instruction::of(&packet), Some(expected));
        let answered = [
            0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x07, 0x00, 0x55, 0x00, 0x06, 0x04, 0x26, 0x65, 0x5D,
        ];
        assert_eq!(status(1, 0, &[0x06, 0x04, 0x26]), answered);
    }

    #[test]
    fn parameters_that_look_like_a_header_are_stuffed_and_back() {
        let like_headers = [0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFF, 0xFD, 0xFD, 0x00];
        let on_the_line = stuffed(&like_headers);
        assert_eq!(on_the_line.len(), like_headers.len() + 2);
        assert_eq!(unstuffed(&on_the_line), like_headers);
    }

    #[test]
    fn a_damaged_packet_is_left_out_and_the_next_one_is_heard() {
        let mut line = Line::default();
        let ping = [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x03, 0x00, 0x01, 0x19, 0x4E];
        let mut damaged = ping;
        damaged[9] ^= 1;
        line.receive(&damaged);
        line.receive(&ping);
        let mut heard = || line.next_packet().map(|packet| Instruction::of(&packet));
        assert_eq!(heard(), Some(None));
        assert!(heard().is_some_and(|instruction| instruction.is_some()));
        assert_eq!(heard(), None);
    }
}
