//! Pages that behave badly while it is measured, by turns: what they cost the tick.
//!
//! A visitor opens the page's WebSocket and is a nuisance in one of four ways for a tenth of a second: a megabyte of
//! garbage, orders as fast as it can, half a frame, or nothing read at all. Then it goes and comes again.

use super::bare::{BarePage, Stage};
use crate::look::Told;
use crate::manager::robot_dir::SOCKET;
use crate::shell::realtime;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How long a visitor stays.
const STAY: Duration = Duration::from_millis(100);
/// Time between two of its looks.
const LOOK: Duration = Duration::from_millis(10);
/// Bytes of garbage.
const GARBAGE: usize = 1 << 20;
/// Orders at once.
const ORDERS: u64 = 200;

/// A visitor's process. What it has been told is counted in kilobytes.
pub(super) fn come_and_go(page: &BarePage, runtime_dir: &Path) -> Result<(), String> {
    realtime::leave_the_control_path();
    let told = Told::by(&runtime_dir.join(SOCKET))?;
    let url = told.status.page.ok_or("the robot has no page")?;
    let (address, query) =
        url.strip_prefix("http://").and_then(|rest| rest.split_once('/')).ok_or("the page has no address")?;
    page.note_ready();
    let mut visits = std::process::id();
    while page.stage() != Stage::Over {
        if !page.observed() {
            sleep(LOOK);
            continue;
        }
        visits = visits.wrapping_add(1);
        // Who is turned away comes again.
        page.note_observer(visit(address, query, visits % 4).unwrap_or(0) / 1024);
        sleep(LOOK);
    }
    Ok(())
}

/// One visit; bytes that were read.
fn visit(address: &str, query: &str, way: u32) -> io::Result<u64> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(LOOK))?;
    stream.set_write_timeout(Some(STAY))?;
    write!(
        stream,
        "GET /ws{query} HTTP/1.1\r\nHost: {address}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )?;
    match way {
        0 => stream.write_all(&frame(&[b'x'; GARBAGE]))?,
        1 => {
            for id in 0..ORDERS {
                let path = "[[0,0,0,0],[5,0,0,0],[5,5,0,0]]";
                stream.write_all(&frame(
                    format!(r#"{{"id":{id},"do":"predict","waypoints":{path}}}"#).as_bytes(),
                ))?;
            }
        }
        2 => stream.write_all(&[0x81, 0xff, 0, 0, 0])?,
        _ => {
            sleep(STAY);
            return Ok(0);
        }
    }
    let (came, mut bytes, mut buffer) = (Instant::now(), 0, vec![0; 64 << 10]);
    while came.elapsed() < STAY {
        match stream.read(&mut buffer) {
            Ok(0) => break,
            Ok(read) => bytes += read as u64,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error),
        }
    }
    Ok(bytes)
}

/// A frame of text, masked with nothing.
fn frame(text: &[u8]) -> Vec<u8> {
    [&[0x81, 0xff][..], &(text.len() as u64).to_be_bytes(), &[0; 4], text].concat()
}
