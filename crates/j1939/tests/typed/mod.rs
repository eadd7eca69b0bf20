//! Frames of a log, and what a program does with each: it finds the type of the group and decodes.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    clippy::panic,
    reason = "helpers of tests"
)]

use std::hint::black_box;
use std::io::BufReader;

use flate2::read::GzDecoder;
use j1939::bus::candump::Reader;
use j1939::{Frame, Message, message};

/// All frames of a log.
pub fn frames(log: &str) -> Vec<Frame> {
    let path = format!("{}/../../tests/data/j1939/{log}.log.gz", env!("CARGO_MANIFEST_DIR"));
    let file = std::fs::File::open(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let reader = Reader::new(BufReader::new(GzDecoder::new(file)));
    reader.map(|entry| entry.unwrap().heard.value).collect()
}

macro_rules! typed {
    ($($ty:ident)*) => {
        #[allow(non_upper_case_globals)]
        mod pgn {
            $(pub const $ty: u32 = <super::message::$ty as super::Message>::TABLE.pgn;)*
        }

        /// Decodes a frame to its type; false for a group that is not in the table or a short frame.
        pub fn decode(frame: &Frame) -> bool {
            let (id, bytes) = (frame.id(), frame.bytes());
            match id.pgn() {
                $(pgn::$ty => black_box(message::$ty::decode(id, bytes)).is_ok(),)*
                _ => false,
            }
        }
    };
}
typed!(Tsc1 Tc1 Xbr Aebs1 Aebs2 Erc1 Ebc1 Ebc2 Ebc5 Etc1 Etc2 Etc8 Eec1 Eec2 Eec3 Vdc1 Vdc2 Sas Hrw
    Ccvs1 Cvw Vw Air1 Lfe1 Lfc1 Amb Vp1 Vds Acc1 Acc2 Adsc1 Adsc2 Adss Pcc1 As At1ig1 At1og1 At1t1i1
    Dd1 Eflp1 Egf1 Eoi Et1 Fd1 Hours Pto1 Tco1 Td Trf1 Vd Vdhr Vep1);
