//! The page's port: taken, or who has it.

use crate::private::euid;
use hilare_operator::address::parse;
use std::fs;
use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};

/// A listening socket, in the state column of /proc/net/tcp.
const LISTENING: &str = "0A";
/// A socket that is connected.
const CONNECTED: &str = "01";
/// Sockets there are; a sandbox may hide all of /proc but what is of a process.
const TABLES: [&str; 2] = ["/proc/self/net/tcp", "/proc/self/net/tcp6"];

/// Binds the address of a text, or says why not and who has it.
pub fn bind(listen: &str) -> Result<TcpListener, String> {
    let address = parse(listen)?;
    TcpListener::bind(address).map_err(|error| {
        let place = format!("operator.listen {address}");
        match error.kind() {
            io::ErrorKind::AddrInUse => match holder(address) {
                Some(holder) => format!("{place}: {holder} has this port; end it, or choose another port"),
                None => format!(
                    "{place}: another program has this port; choose another (ss -ltnp tells whose it is)"
                ),
            },
            io::ErrorKind::PermissionDenied => {
                format!("{place}: {error}; ports below 1024 are the superuser's")
            }
            _ => format!("{place}: {error}; choose another address"),
        }
    })
}

/// Says why a robot's page could not listen. What only the process of the page can find out, it finds out.
pub fn check(listen: &str) -> Result<(), String> {
    if listen.is_empty() {
        return Ok(());
    }
    bind(listen).map(drop)
}

/// The process that listens where `address` would, as far as it can be seen by this user.
fn holder(address: SocketAddr) -> Option<String> {
    let tables = TABLES.map(|table| fs::read_to_string(table).unwrap_or_default());
    let inodes: Vec<u64> = tables.iter().flat_map(|table| listeners(table, address.port())).collect();
    let wanted: Vec<String> = inodes.iter().map(|inode| format!("socket:[{inode}]")).collect();
    let pids =
        fs::read_dir("/proc").ok()?.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    pids.into_iter().find_map(|pid: u32| {
        let files = fs::read_dir(format!("/proc/{pid}/fd")).ok()?;
        let is_wanted =
            |target: std::path::PathBuf| wanted.iter().any(|socket| target.as_os_str() == &**socket);
        let holds = files.flatten().filter_map(|file| fs::read_link(file.path()).ok()).any(is_wanted);
        holds.then(|| format!("{} (pid {pid})", command(pid)))
    })
}

/// True if the other end of a connection from this machine is a process of this user, or of the superuser: a port is
/// open to everybody, a robot is not.
pub fn is_ours(peer: SocketAddr, own: SocketAddr) -> bool {
    let tables = TABLES.map(|table| fs::read_to_string(table).unwrap_or_default());
    let owner = tables.iter().find_map(|table| owner(table, peer, own));
    owner.is_some_and(|uid| uid == euid() || uid == 0)
}

/// Account of the socket that is connected from `from` to `to`. One whose process has closed it has none any more.
fn owner(table: &str, from: SocketAddr, to: SocketAddr) -> Option<u32> {
    let wanted = [[from, to].map(in_table), [from, to].map(|end| in_table(mapped(end)))];
    let row = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let ends = [*fields.get(1)?, *fields.get(2)?];
        let is_it = wanted.iter().any(|wanted| *wanted == ends) && fields.get(3) == Some(&CONNECTED);
        is_it.then(|| fields.get(7)?.parse().ok()).flatten()
    };
    table.lines().skip(1).find_map(row)
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

/// Inodes of the sockets that listen on a port, from the text of /proc/net/tcp or tcp6. On which of its addresses
/// does not matter: that it could not be bound is known.
fn listeners(table: &str, port: u16) -> Vec<u64> {
    let listener = |line: &str| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let (_, of) = fields.get(1)?.rsplit_once(':')?;
        let listens = u16::from_str_radix(of, 16) == Ok(port) && fields.get(3) == Some(&LISTENING);
        listens.then(|| fields.get(9)?.parse().ok()).flatten()
    };
    table.lines().skip(1).filter_map(listener).collect()
}

/// Name and first arguments of a process, in a line.
fn command(pid: u32) -> String {
    let bytes = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let words = String::from_utf8_lossy(&bytes).replace('\0', " ");
    let line = crate::logging::plain(words.trim());
    if line.is_empty() { "a program".to_owned() } else { line.chars().take(80).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_that_is_taken_is_told_with_its_holder() {
        let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = taken.local_addr().expect("its address");
        let why = check(&address.to_string()).expect_err("it is taken");
        let us = format!("(pid {}) has this port", std::process::id());
        assert!(why.contains(&us) && why.contains(&address.to_string()), "{why}");
        drop(taken);
        assert_eq!(check(&address.to_string()), Ok(()));
        assert_eq!(check(""), Ok(()));
    }

    #[test]
    fn who_is_at_the_other_end_is_known_until_it_is_closed() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let stream =
            std::net::TcpStream::connect(listener.local_addr().expect("its address")).expect("connected");
        let (accepted, peer) = listener.accept().expect("it came");
        let own = accepted.local_addr().expect("its address");
        assert!(is_ours(peer, own) && !is_ours(own, listener.local_addr().expect("its address")));
        drop(stream);
        assert!(!is_ours(peer, own), "nobody is there any more");
        let table = "head\n   1: 0100007F:C000 0100007F:1B9E 01 0:0 00:0 0  1001 0 42\n\
            \x20  2: 0000000000000000FFFF00000100007F:C001 0000000000000000FFFF00000100007F:1B9E 01 0:0 00:0 0 1002 0 43\n\
            \x20  3: 0100007F:C002 0100007F:1B9E 05 0:0 00:0 0  0 0 0\n";
        let at = |port| SocketAddr::from(([127, 0, 0, 1], port));
        let owners = [0xC000, 0xC001, 0xC002, 0xC003].map(|port| owner(table, at(port), at(0x1B9E)));
        assert_eq!(owners, [Some(1001), Some(1002), None, None]);
    }

    #[test]
    fn listeners_are_found_among_other_sockets() {
        let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n\
            \x20  0: 0100007F:1B9E 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1000        0 41 1 f 100\n\
            \x20  1: 0100007F:1B9E 0100007F:C000 01 00000000:00000000 00:00000000 00000000  1000        0 42 1 f 100\n\
            \x20  2: 00000000000000000000000001000000:1B9F 00000000000000000000000000000000:0000 0A 0:0 00:0 0 0 0 43 1\n\
            nonsense\n";
        assert_eq!((listeners(table, 7070), listeners(table, 7071)), (vec![41], vec![43]));
        assert_eq!(listeners("", 7070), [0_u64; 0]);
    }
}
