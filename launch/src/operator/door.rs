//! Who is at the other end of a connection from this machine: a port is open to everybody, a robot is not.
//!
//! The kernel's tables tell the account of a socket. To read one takes milliseconds, whatever is in it: so a thread
//! does it for all who have come meanwhile, and rests in between, and nobody can keep it busy by coming often.

use super::port::TABLES;
use super::thread;
use crate::private::euid;
use crossbeam_channel::{Receiver, Sender, bounded};
use hilare_operator::Verdict;
use std::collections::HashMap;
use std::fs;
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

/// A socket that is connected, in the state column of the tables. One whose process has closed it is not, and has no
/// account any more.
const CONNECTED: &str = "01";
/// Connections that may wait to be looked at.
const WAITING: usize = 256;
/// Rest between two looks.
const REST: Duration = Duration::from_millis(10);

struct Knock {
    peer: SocketAddr,
    own: SocketAddr,
    verdict: Verdict,
}

/// Judges connections.
pub struct Door(Sender<Knock>);

impl Door {
    /// With a thread of its own.
    pub fn open() -> Result<Self, String> {
        let (sender, knocks) = bounded(WAITING);
        thread("door", move || watch(&knocks))?;
        Ok(Self(sender))
    }

    /// Tells `verdict` whether the other end of a connection is a process of this user, or of the superuser.
    pub fn ask(&self, peer: SocketAddr, own: SocketAddr, verdict: Verdict) {
        if let Err(full) = self.0.try_send(Knock { peer, own, verdict }) {
            (full.into_inner().verdict)(false);
        }
    }
}

fn watch(knocks: &Receiver<Knock>) {
    for first in knocks {
        let mut open: Vec<Knock> = std::iter::once(first).chain(knocks.try_iter()).collect();
        // Most are in the first one.
        for table in TABLES {
            let text =
                if open.is_empty() { String::new() } else { fs::read_to_string(table).unwrap_or_default() };
            let owners = owners(&text);
            for Knock { peer, own, verdict } in std::mem::take(&mut open) {
                match owner(&owners, peer, own) {
                    Some(uid) => verdict(uid == euid() || uid == 0),
                    None => open.push(Knock { peer, own, verdict }),
                }
            }
        }
        open.into_iter().for_each(|knock| (knock.verdict)(false));
        std::thread::sleep(REST);
    }
}

/// Account of every socket that is connected, by its ends.
fn owners(table: &str) -> HashMap<(&str, &str), u32> {
    let row = |line| {
        let fields: Vec<&str> = str::split_whitespace(line).collect();
        let ends = (*fields.get(1)?, *fields.get(2)?);
        let connected = fields.get(3) == Some(&CONNECTED);
        connected.then(|| Some((ends, fields.get(7)?.parse().ok()?))).flatten()
    };
    table.lines().skip(1).filter_map(row).collect()
}

fn owner(owners: &HashMap<(&str, &str), u32>, from: SocketAddr, to: SocketAddr) -> Option<u32> {
    let of = |from, to| owners.get(&(&*in_table(from), &*in_table(to))).copied();
    of(from, to).or_else(|| of(mapped(from), mapped(to)))
}

/// An address as the tables have it: words of the machine's own order.
fn in_table(address: SocketAddr) -> String {
    let bytes = match address.ip() {
        IpAddr::V4(ip) => ip.octets().to_vec(),
        IpAddr::V6(ip) => ip.octets().to_vec(),
    };
    let (words, _) = bytes.as_chunks::<4>();
    let words: String = words.iter().map(|word| format!("{:08X}", u32::from_ne_bytes(*word))).collect();
    format!("{words}:{:04X}", address.port())
}

/// The same address as a socket for both kinds has it.
fn mapped(address: SocketAddr) -> SocketAddr {
    match address.ip() {
        IpAddr::V4(ip) => SocketAddr::new(ip.to_ipv6_mapped().into(), address.port()),
        IpAddr::V6(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::{TcpListener, TcpStream};

    /// Whether somebody gets in.
    fn admits(door: &Door, peer: SocketAddr, own: SocketAddr) -> bool {
        let (sender, verdict) = bounded(1);
        door.ask(peer, own, Box::new(move |admitted| sender.send(admitted).expect("it is waited for")));
        verdict.recv_timeout(Duration::from_secs(30)).expect("a verdict")
    }

    #[test]
    fn who_is_at_the_other_end_is_known_until_it_is_closed() {
        let door = Door::open().expect("a thread");
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let own = listener.local_addr().expect("its address");
        let stream = TcpStream::connect(own).expect("connected");
        let (_accepted, peer) = listener.accept().expect("it came");
        assert!(admits(&door, peer, own) && !admits(&door, own, own));
        drop(stream);
        assert!(!admits(&door, peer, own), "nobody is there any more");
    }

    #[test]
    fn accounts_are_found_whatever_kind_the_socket_is() {
        let table = "head\n   1: 0100007F:C000 0100007F:1B9E 01 0:0 00:0 0  1001 0 42\n\
            \x20  2: 0000000000000000FFFF00000100007F:C001 0000000000000000FFFF00000100007F:1B9E 01 0:0 00:0 0 1002 0 43\n\
            \x20  3: 0100007F:C002 0100007F:1B9E 05 0:0 00:0 0  0 0 0\nnonsense\n";
        let (owners, at) = (owners(table), |port| SocketAddr::from(([127, 0, 0, 1], port)));
        let found = [0xC000, 0xC001, 0xC002, 0xC003].map(|port| owner(&owners, at(port), at(0x1B9E)));
        assert_eq!(found, [Some(1001), Some(1002), None, None]);
    }
}
