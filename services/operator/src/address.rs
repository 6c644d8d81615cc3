//! Where the page listens, and under which names it is asked for.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

/// The address of a text such as `127.0.0.1:7070`, `[::1]:7070` or `localhost:7070`, or what is wrong with it.
pub fn parse(text: &str) -> Result<SocketAddr, String> {
    let example = "for example 127.0.0.1:7070";
    let address = match text.strip_prefix("localhost:").map(str::parse) {
        Some(Ok(port)) => SocketAddr::from((Ipv4Addr::LOCALHOST, port)),
        Some(Err(_)) => {
            return Err(format!("{text:?} has no port number; write address and port, {example}"));
        }
        None => text.parse().map_err(|_| {
            format!("{text:?} is no address with a port; write {}", &example["for example ".len()..])
        })?,
    };
    if address.port() == 0 {
        return Err(format!("{text}: nobody would know the port; name one, {example}"));
    }
    Ok(address)
}

/// Who else may be at the other end than this machine: then only those get in who have the token.
pub fn is_open(address: SocketAddr) -> bool {
    !address.ip().is_loopback()
}

/// The names of the machine by which its page may be asked for.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Also by the numbers of any address of its, and by the machine's name.
    pub open: bool,
    /// The machine's name.
    pub machine: String,
}

impl Names {
    /// True if a `Host` header names this machine as it names itself. Another name that leads here is that of a
    /// web page which wants to reach the robot through its visitor's browser (DNS rebinding); a number cannot be
    /// such a name.
    pub fn include(&self, host: &str) -> bool {
        let Some(name) = name_of(host) else { return false };
        if name.eq_ignore_ascii_case("localhost") {
            return true;
        }
        match name.parse::<IpAddr>() {
            Ok(ip) => self.open || ip.is_loopback(),
            Err(_) => {
                let (machine, local) = (self.machine.as_str(), format!("{}.local", self.machine));
                self.open
                    && !machine.is_empty()
                    && (name.eq_ignore_ascii_case(machine) || name.eq_ignore_ascii_case(&local))
            }
        }
    }
}

/// The name in a `Host` header, without the port; `None` if it is not one.
fn name_of(host: &str) -> Option<&str> {
    let (name, port) = match host.strip_prefix('[') {
        Some(rest) => match rest.split_once(']')? {
            (name, "") => (name, None),
            (name, port) => (name, Some(port.strip_prefix(':')?)),
        },
        None => match host.split_once(':') {
            Some((name, port)) => (name, Some(port)),
            None => (host, None),
        },
    };
    port.is_none_or(|port| port.parse::<u16>().is_ok()).then_some(name)
}

/// True if an `Origin` header is that of a page that came from `host`: no other site may speak to the robot.
pub fn is_same_origin(origin: &str, host: &str) -> bool {
    let authority = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
    authority.is_some_and(|authority| !authority.is_empty() && authority.eq_ignore_ascii_case(host))
}

/// True if two texts are the same; takes as long wherever they differ.
pub fn same_secret(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let differ = one.iter().zip(other).fold(0, |differ, (a, b)| differ | (a ^ b));
    std::hint::black_box(differ) == 0 && one.len() == other.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_taken_and_nonsense_is_not() {
        for (text, is, open) in [
            ("127.0.0.1:7070", "127.0.0.1:7070", false),
            ("localhost:80", "127.0.0.1:80", false),
            ("127.1.2.3:65535", "127.1.2.3:65535", false),
            ("[::1]:7070", "[::1]:7070", false),
            ("0.0.0.0:7070", "0.0.0.0:7070", true),
            ("192.168.1.2:80", "192.168.1.2:80", true),
            ("[::]:7070", "[::]:7070", true),
        ] {
            let address = parse(text).expect(text);
            assert_eq!((address.to_string().as_str(), is_open(address)), (is, open), "{text}");
        }
        for (text, said) in [
            ("127.0.0.1:0", "name one"),
            ("127.0.0.1", "no address with a port; write 127.0.0.1:7070"),
            ("7070", "no address"),
            ("localhost:", "no port number"),
            ("localhost:99999", "no port number"),
            ("robot.local:7070", "no address"),
            ("", "no address"),
        ] {
            let why = parse(text).expect_err(text);
            assert!(why.contains(said) && !why.contains('\n'), "{text}: {why}");
        }
    }

    #[test]
    fn only_its_own_names_lead_to_the_page() {
        let (own, open) = (Names::default(), Names { open: true, machine: "mule".to_owned() });
        for host in ["localhost", "LocalHost:7070", "127.0.0.1", "127.0.0.1:7070", "[::1]", "[::1]:7070"] {
            assert!(own.include(host) && open.include(host), "{host}");
        }
        for host in ["192.168.1.2:7070", "[::2]:7070", "mule:7070", "MULE.local"] {
            assert!(!own.include(host) && open.include(host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "evil.example:7070",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "127.0.0.1:7070@evil.example",
            "mule.evil.example",
            "[::1",
            "[::1]7070",
            "localhost:x",
            "::1",
        ] {
            assert!(!own.include(host) && !open.include(host), "{host}");
        }
        assert!(!Names { open: true, machine: String::new() }.include(".local"));
    }

    #[test]
    fn no_other_site_is_the_page() {
        let host = "127.0.0.1:7070";
        assert!(
            is_same_origin("http://127.0.0.1:7070", host) && is_same_origin("https://127.0.0.1:7070", host)
        );
        for origin in [
            "null",
            "",
            "http://",
            "http://127.0.0.1",
            "http://127.0.0.1:7071",
            "http://localhost:7070",
            "http://evil.example",
            "http://127.0.0.1:7070.evil.example",
            "http://evil.example/127.0.0.1:7070",
            "file://127.0.0.1:7070",
        ] {
            assert!(!is_same_origin(origin, host), "{origin}");
        }
    }

    #[test]
    fn a_secret_is_the_same_or_it_is_not() {
        assert!(same_secret("", "") && same_secret("a1b2", "a1b2"));
        for (one, other) in [("a1b2", "a1b3"), ("a1b2", "a1b"), ("a1b", "a1b2"), ("", "a"), ("a", "")] {
            assert!(!same_secret(one, other), "{one} {other}");
        }
    }
}
