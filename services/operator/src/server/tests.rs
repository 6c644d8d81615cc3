use super::*;
use crate::connections::MAX_CONNECTIONS;
use crate::live::Live;
use std::io::{Read, Write};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};

#[path = "socket_tests.rs"]
mod socket;

#[derive(Default)]
struct Counted {
    looks: AtomicU64,
    refuses: bool,
    live: Live,
    /// What was ordered.
    orders: std::sync::Mutex<Vec<Order>>,
    /// Strangers at the door.
    admits_nobody: bool,
}

impl Source for Counted {
    fn look(&self) -> Result<Robot, String> {
        let tick = self.looks.fetch_add(1, Ordering::Relaxed);
        if self.refuses { Err("launch is gone".to_owned()) } else { Ok(Robot { tick, ..Robot::default() }) }
    }

    fn live(&self) -> &Live {
        &self.live
    }

    fn order(&self, order: &Order, cancelled: &AtomicBool) -> Answer {
        self.orders.lock().expect("nobody panics with it").push(order.clone());
        // A prediction that does not end by itself.
        while order.is_question() && !cancelled.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(1));
        }
        Answer::done(format!("{order:?}"))
    }

    fn admit(&self, _: SocketAddr, _: SocketAddr, verdict: crate::Verdict) {
        verdict(!self.admits_nobody);
    }
}

fn started(refuses: bool) -> (SocketAddr, Arc<Counted>) {
    begin(Counted { refuses, ..Counted::default() }, Rules::default())
}

fn begin(source: Counted, rules: Rules) -> (SocketAddr, Arc<Counted>) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    let source = Arc::new(source);
    let theirs = Arc::clone(&source);
    std::thread::spawn(move || serve(listener, theirs, rules));
    (address, source)
}

/// What comes back for some bytes.
fn answer(address: SocketAddr, request: impl AsRef<[u8]>) -> String {
    let mut stream = std::net::TcpStream::connect(address).expect("a connection");
    stream.set_read_timeout(Some(Duration::from_secs(30))).expect("a time-out");
    let mut answer = Vec::new();
    // Who sends too much may be cut off in the middle of it.
    let _ = stream.write_all(request.as_ref());
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn get(address: SocketAddr, path: &str, headers: &str) -> String {
    answer(address, format!("GET {path} HTTP/1.1\r\n{headers}\r\n"))
}

#[test]
fn metrics_are_told_to_who_asks_by_the_right_name() {
    let (address, _) = started(false);
    let text = get(address, "/metrics", "Host: localhost:1\r\n");
    assert!(text.starts_with("HTTP/1.1 200 OK\r\n") && text.contains("\nhilare_ticks_total 0\n"), "{text}");
    assert!(text.contains("content-type: text/plain; version=0.0.4") && text.contains("nosniff"), "{text}");
    let open = get(
        address,
        "/metrics",
        "Host: [::1]\r\nAccept: application/openmetrics-text;version=1.0.0,*/*;q=0.1\r\n",
    );
    assert!(open.contains("content-type: application/openmetrics-text; version=1.0.0"), "{open}");
    assert!(open.ends_with("# EOF\n"), "{open}");
    let page = get(address, "/", "Host: 127.0.0.1\r\n");
    assert!(page.contains("content-type: text/html") && page.contains("<title>hilare</title>"), "{page}");
    assert!(
        page.contains("content-security-policy: default-src 'self'") && page.contains("no-referrer"),
        "{page}"
    );
    for (path, headers, status) in [
        ("/metrics", "Host: evil.example\r\n", "403"),
        ("/metrics", "", "403"),
        ("/metrics", "Host: localhost\r\nHost: evil.example\r\n", "403"),
        ("http://evil.example/metrics", "Host: localhost\r\n", "403"),
        ("/", "Host: evil.example\r\n", "403"),
        ("/nothing", "Host: localhost\r\n", "404"),
        ("/../etc/passwd", "Host: localhost\r\n", "404"),
    ] {
        let text = get(address, path, headers);
        assert!(text.starts_with(&format!("HTTP/1.1 {status} ")), "{path} {headers:?}: {text}");
        assert!(!text.contains("hilare_"), "{text}");
    }
    let posted = answer(address, "POST /metrics HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n\r\nabc");
    assert!(posted.starts_with("HTTP/1.1 405 "), "{posted}");
}

#[test]
fn a_robot_that_does_not_answer_is_no_page() {
    let (address, _) = started(true);
    let text = get(address, "/metrics", "Host: localhost\r\n");
    assert!(text.starts_with("HTTP/1.1 503 ") && text.ends_with("hilare: launch is gone\n"), "{text}");
}

#[test]
fn many_readers_make_few_looks() {
    let (address, source) = started(false);
    let began = Instant::now();
    for _ in 0..40 {
        assert!(get(address, "/metrics", "Host: localhost\r\n").contains("hilare_ticks_total"));
    }
    let at_most = began.elapsed().as_millis() as u64 / FRESH.as_millis() as u64 + 1;
    let looks = source.looks.load(Ordering::Relaxed);
    assert!((1..=at_most).contains(&looks), "{looks} looks, {at_most} at most");
}

#[test]
fn who_says_too_much_or_nothing_keeps_nobody_out() {
    let (address, _) = started(false);
    let fine = || get(address, "/metrics", "Host: localhost\r\n").starts_with("HTTP/1.1 200 ");
    let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "x".repeat(1 << 20));
    let lines = format!("GET / HTTP/1.1\r\nHost: localhost\r\n{}\r\n", "X: y\r\n".repeat(1000));
    for request in [&long, &lines, "\r\n\r\n\0\0\u{16}\u{3}\u{1}garbage", "GET", "GET / HTTP/9.9\r\n\r\n"] {
        // Half of a request is the end of one here: its sender is not waited for.
        let mut stream = std::net::TcpStream::connect(address).expect("a connection");
        let _ = stream.write_all(request.as_bytes());
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert!(!String::from_utf8_lossy(&answer).contains(" 200 "), "{request:.40}");
        assert!(fine(), "after {request:.40}");
    }
    // More than there is room for, who never say anything.
    let silent: Vec<_> = (0..3 * MAX_CONNECTIONS)
        .map(|_| std::net::TcpStream::connect(address).expect("a connection"))
        .collect();
    assert!(fine(), "beside the silent");
    // The oldest of them had to go.
    silent[0].set_read_timeout(Some(Duration::from_secs(30))).expect("a time-out");
    assert_eq!((&silent[0]).read(&mut [0; 8]).ok(), Some(0));
}
