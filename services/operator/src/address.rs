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
    if !address.ip().is_loopback() {
        return Err(format!(
            "{text}: others than this machine may not reach the robot; listen on 127.0.0.1 or [::1], and come from \
             elsewhere by ssh -L {port}:127.0.0.1:{port}",
            port = address.port()
        ));
    }
    if address.port() == 0 {
        return Err(format!("{text}: nobody would know the port; name one, {example}"));
    }
    Ok(address)
}

/// True if a `Host` header names this machine as it names itself. Another name that leads here is that of a web
/// page which wants to reach the robot through its visitor's browser (DNS rebinding).
pub fn is_own_name(host: &str) -> bool {
    let (name, port) = match host.strip_prefix('[') {
        Some(rest) => match rest.split_once(']') {
            Some((name, "")) => (name, None),
            Some((name, port)) => (name, port.strip_prefix(':').or(Some("x"))),
            None => return false,
        },
        None => match host.split_once(':') {
            Some((name, port)) => (name, Some(port)),
            None => (host, None),
        },
    };
    let numbered = port.is_none_or(|port| port.parse::<u16>().is_ok());
    let own =
        name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok_and(|ip| ip.is_loopback());
    numbered && own
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_of_this_machine_are_taken_and_no_others() {
        for (text, is) in [
            ("127.0.0.1:7070", "127.0.0.1:7070"),
            ("localhost:80", "127.0.0.1:80"),
            ("127.1.2.3:65535", "127.1.2.3:65535"),
            ("[::1]:7070", "[::1]:7070"),
        ] {
            assert_eq!(parse(text).map(|address| address.to_string()), Ok(is.to_owned()), "{text}");
        }
        for (text, said) in [
            ("0.0.0.0:7070", "ssh -L 7070:127.0.0.1:7070"),
            ("192.168.1.2:80", "others than this machine"),
            ("[::]:7070", "others than this machine"),
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
        for host in ["localhost", "LocalHost:7070", "127.0.0.1", "127.0.0.1:7070", "[::1]", "[::1]:7070"] {
            assert!(is_own_name(host), "{host}");
        }
        for host in [
            "",
            "evil.example",
            "evil.example:7070",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "127.0.0.1:7070@evil.example",
            "192.168.1.2:7070",
            "[::2]:7070",
            "[::1",
            "[::1]7070",
            "localhost:x",
            "::1",
        ] {
            assert!(!is_own_name(host), "{host}");
        }
    }
}
