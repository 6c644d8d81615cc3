//! zenoh: two peers that know each other's address. No scouting, no router, nothing off this machine.
//!
//! The responder answers in its subscriber's callback, and the driver takes the time in its own: as early as
//! zenoh gives a message to a program, on its receiving thread.

use super::{Driver, Place, now, responder_ready};
use crate::Result;
use crate::messages::{Command, Pose, answer, decode};
use bytemuck::Pod;
use std::fs;
use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use zenoh::config::Config;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

const POSE: &str = "peers/pose";
const COMMAND: &str = "peers/command";

/// How the two reach each other.
#[derive(Clone, Copy)]
enum Link {
    /// Pipes, and zenoh's low-latency transport: the fastest of what zenoh offers on one machine.
    Pipe,
    /// TCP on loopback, and the transport zenoh comes with.
    Tcp,
}

impl Link {
    /// An address to listen on.
    fn locator(self, place: &Place) -> Result<String> {
        match self {
            Self::Pipe => Ok(format!("unixpipe/{}", place.directory.join("zenoh.pipe").display())),
            Self::Tcp => {
                // Free now; should somebody take it in between, zenoh says so.
                let port = TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
                Ok(format!("tcp/127.0.0.1:{port}"))
            }
        }
    }

    fn configure(self, listen: &[&str], connect: &[&str]) -> Result<Config> {
        let mut config = Config::default();
        let mut set = |key: &str, value: &str| config.insert_json5(key, value);
        set("mode", "\"peer\"")?;
        set("listen/endpoints", &format!("{listen:?}"))?;
        set("connect/endpoints", &format!("{connect:?}"))?;
        set("scouting/multicast/enabled", "false")?;
        set("scouting/gossip/enabled", "false")?;
        // It copies what is this small anyway.
        set("transport/shared_memory/enabled", "false")?;
        if matches!(self, Self::Pipe) {
            // The one excludes the other.
            set("transport/unicast/qos/enabled", "false")?;
            set("transport/unicast/lowlatency", "true")?;
        }
        Ok(config)
    }
}

/// The file in which the responder tells the driver where it listens.
fn locator_file(place: &Place) -> PathBuf {
    place.directory.join(format!("{}.locator", place.peer))
}

fn publisher(session: &Session, key: &'static str) -> Result<Publisher<'static>> {
    let publisher = session.declare_publisher(key).congestion_control(CongestionControl::Block);
    publisher.priority(Priority::RealTime).express(true).wait()
}

fn put<T: Pod>(publisher: &Publisher, message: &T) -> Result<()> {
    publisher.put(bytemuck::bytes_of(message)).wait()
}

/// Fields are dropped, that is closed, in this order.
struct Ends {
    _subscriber: Subscriber<()>,
    publisher: Publisher<'static>,
    _session: Session,
    commands: Receiver<(Result<Command>, u64)>,
}

fn drive(place: &Place, link: Link) -> Result<Box<dyn Driver>> {
    let locator = fs::read_to_string(locator_file(place))?;
    let session = zenoh::open(link.configure(&[], &[&locator])?).wait()?;
    let (sender, commands) = channel();
    let subscriber = session.declare_subscriber(COMMAND).callback(move |sample| {
        let arrived = now();
        let _ = sender.send((decode(&sample.payload().to_bytes()), arrived));
    });
    let subscriber = subscriber.wait()?;
    let publisher = publisher(&session, POSE)?;
    // The other side's subscription has to be known before the first pose.
    while !publisher.matching_status().wait()?.matching() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    Ok(Box::new(Ends { _subscriber: subscriber, publisher, _session: session, commands }))
}

impl Driver for Ends {
    fn send(&mut self, pose: &Pose) -> Result<()> {
        put(&self.publisher, pose)
    }

    fn command(&mut self) -> Result<(Command, u64)> {
        let (command, arrived) = self.commands.recv()?;
        Ok((command?, arrived))
    }
}

fn serve(place: &Place, link: Link) -> Result<()> {
    let locator = link.locator(place)?;
    let session = zenoh::open(link.configure(&[&locator], &[])?).wait()?;
    let publisher = publisher(&session, COMMAND)?;
    let subscriber = session.declare_subscriber(POSE).callback(move |sample| {
        let received = now();
        let answered = decode::<Pose>(&sample.payload().to_bytes())
            .and_then(|pose| put(&publisher, &answer(&pose, received)));
        // Without an answer the driver stands still, and the conductor shows this line.
        if let Err(error) = answered {
            eprintln!("zenoh: {error}");
        }
    });
    let _subscriber = subscriber.wait()?;
    fs::write(locator_file(place), locator)?;
    responder_ready(place);
    place.page.await_dismissal();
    Ok(())
}

pub fn driver(place: &Place) -> Result<Box<dyn Driver>> {
    drive(place, Link::Pipe)
}

pub fn respond(place: &Place) -> Result<()> {
    serve(place, Link::Pipe)
}

pub fn tcp_driver(place: &Place) -> Result<Box<dyn Driver>> {
    drive(place, Link::Tcp)
}

pub fn tcp_respond(place: &Place) -> Result<()> {
    serve(place, Link::Tcp)
}
