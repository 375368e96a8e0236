//! Print the state of every robot's controller: a plain Zenoh client with the mesh's protobuf schema.
//!
//!     cargo run -- [tcp/127.0.0.1:7447] [keys.pem]
//!
//! Get, then subscribe: the reply to a get is the last value, of unknown age; later samples are live.

use std::io::{self, ErrorKind, Write};

use prost::Message;
use robomesh::{controller_state::Activity, controller_state::Link, controller_state::Mode, ControllerState};
use zenoh::{Config, Wait};

#[allow(dead_code)] // the whole schema, of which this program uses one message
mod robomesh {
    include!(concat!(env!("OUT_DIR"), "/robomesh.rs"));
}

const STATES: &str = "robomesh/*/*/controller";

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    match watch() {
        // The reader has closed the pipe: `| head`.
        Err(error) if error.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == ErrorKind::BrokenPipe) => Ok(()),
        ended => ended,
    }
}

fn watch() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let mut arguments = std::env::args().skip(1);
    let router = arguments.next().unwrap_or_else(|| "tcp/127.0.0.1:7447".to_string());

    let mut config = Config::default();
    config.insert_json5("mode", "\"client\"")?;
    config.insert_json5("connect/endpoints", &format!("[\"{router}\"]"))?;
    if let Some(keys) = arguments.next() {
        // One file of `robomesh keys` holds the certificate, its key and the authority.
        config.insert_json5("transport/link/tls/enable_mtls", "true")?;
        config.insert_json5("transport/link/tls/verify_name_on_connect", "false")?;
        for part in ["root_ca_certificate", "connect_certificate", "connect_private_key"] {
            config.insert_json5(&format!("transport/link/tls/{part}"), &format!("\"{keys}\""))?;
        }
    }

    let session = zenoh::open(config).wait()?;
    let live = session.declare_subscriber(STATES).wait()?;
    for reply in session.get(STATES).wait()? {
        if let Ok(last) = reply.result() {
            print_state(last, "last")?;
        }
    }
    while let Ok(sample) = live.recv() {
        print_state(&sample, "live")?;
    }
    Ok(())
}

fn print_state(sample: &zenoh::sample::Sample, how: &str) -> io::Result<()> {
    // Attached to every publication: publisher, sequence, source time [ns], little-endian.
    let sequence = sample
        .attachment()
        .and_then(|bytes| Some(u64::from_le_bytes(bytes.to_bytes().get(8..16)?.try_into().ok()?)));
    match ControllerState::decode(&*sample.payload().to_bytes()) {
        Ok(state) => writeln!(
            io::stdout(),
            "{how} {} #{} link {} mode {} {}{}",
            sample.key_expr(),
            sequence.unwrap_or(0),
            Link::try_from(state.link).map_or("?", |link| link.as_str_name()),
            Mode::try_from(state.mode).map_or("?", |mode| mode.as_str_name()),
            Activity::try_from(state.activity).map_or("?", |activity| activity.as_str_name()),
            state.last_unit_age_s.map_or(String::new(), |age| format!(", {age:.2} s old")),
        ),
        Err(error) => writeln!(io::stderr(), "{}: {error}", sample.key_expr()),
    }
}
