//! Server that reads a client's packets of SNPX with fanuc_ucl, and answers with it.
//!
//! It prints its port, then each command and each kind of question once. Words have the values that the
//! client's assignments give: a position, the version, and empty alarms; others are 0.

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};

use fanuc_ucl::hmi::asg::HmiWireable;
use fanuc_ucl::hmi::server::{
    HmiRequest, ack_resp, empty_alarm_registers, ext_resp_bits, ext_resp_regs, init_ack, parse_request,
};

const AXES: [f32; 9] = [10.0, 20.0, -30.0, 40.0, -50.0, 60.0, 0.0, 0.0, 0.0];
const WORDS: usize = 16_384;
const SYSTEM_READY: u8 = 2;

fn main() -> std::io::Result<()> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    println!("{}", listener.local_addr()?.port());
    loop {
        serve(listener.accept()?.0)?;
    }
}

fn serve(mut client: TcpStream) -> std::io::Result<()> {
    let (mut buffer, mut words, mut said) = (Vec::new(), vec![0i16; WORDS], BTreeSet::new());
    let mut chunk = [0u8; 4096];
    loop {
        while let Some((request, consumed)) = parse_request(&buffer) {
            buffer.drain(..consumed);
            let (line, answer) = answer(&request, &mut words);
            if said.insert(line.clone()) {
                println!("{line}");
            }
            client.write_all(&answer)?;
        }
        match client.read(&mut chunk)? {
            0 => return Ok(()),
            count => buffer.extend_from_slice(&chunk[..count]),
        }
    }
}

fn answer(request: &HmiRequest, words: &mut [i16]) -> (String, Vec<u8>) {
    match request {
        HmiRequest::Init { .. } => ("init".into(), init_ack()),
        HmiRequest::Magic { seq } => ("session".into(), ack_resp(*seq)),
        HmiRequest::Command { seq, text } => {
            assign(text, words);
            (text.clone(), ack_resp(*seq))
        }
        HmiRequest::ReadRegs { seq, index, count } => {
            let (first, last) = (*index as usize, *index as usize + *count as usize);
            let data = &words[first..last.min(WORDS)];
            (format!("read words {index} {count}"), ext_resp_regs(*seq, data))
        }
        HmiRequest::ReadBits { seq, segment, index, count } => {
            let data = vec![if *index == 6000 { SYSTEM_READY } else { 0 }; *count as usize / 8];
            (format!("read {segment:?} {index} {count}"), ext_resp_bits(*seq, &data))
        }
        other => (format!("not a read: {other:?}"), ack_resp(other.seq())),
    }
}

fn assign(text: &str, words: &mut [i16]) {
    let parts: Vec<&str> = text.split(' ').collect();
    let [_, first, size, name, multiply] = parts[..] else { return };
    let first = first.parse::<usize>().expect("a number") - 1;
    let target = &mut words[first..first + size.parse::<usize>().expect("a number")];
    let mut bytes = vec![0u8; target.len() * 2];
    match name {
        "$SNPX_PARAM.$VERSION" => {
            (2 * multiply.parse::<i32>().expect("a number")).pack(&mut bytes);
        }
        "POS[G1:0]" => {
            for (number, value) in AXES.iter().enumerate() {
                value.pack(&mut bytes[52 + 4 * number..]);
            }
            // As fanuc_ucl places the flag.
            bytes[89] = 1;
        }
        "ALM[1]" => {
            for line in target.chunks_mut(100) {
                line.copy_from_slice(&empty_alarm_registers()[..line.len()]);
            }
            return;
        }
        _ => {}
    }
    for (word, pair) in target.iter_mut().zip(bytes.chunks(2)) {
        *word = i16::from_le_bytes([pair[0], pair[1]]);
    }
}
