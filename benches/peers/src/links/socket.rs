//! Unix sockets, datagram and stream, blocking: a system call to send, one to wait and receive.

use super::{Driver, Place, now, responder_ready};
use crate::Result;
use crate::messages::{Command, Pose, answer, decode};
use std::io::{Read, Write};
use std::os::unix::net::{UnixDatagram, UnixListener, UnixStream};
use std::path::PathBuf;

fn address(place: &Place, of: &str) -> PathBuf {
    place.directory.join(format!("{}.{of}", place.peer))
}

struct Datagrams(UnixDatagram);

pub fn datagram_driver(place: &Place) -> Result<Box<dyn Driver>> {
    let socket = UnixDatagram::bind(address(place, "driver"))?;
    socket.connect(address(place, "responder"))?;
    // Tells the responder that there is somebody to connect to.
    socket.send(&[])?;
    Ok(Box::new(Datagrams(socket)))
}

impl Driver for Datagrams {
    fn send(&mut self, pose: &Pose) -> Result<()> {
        self.0.send(bytemuck::bytes_of(pose))?;
        Ok(())
    }

    fn command(&mut self) -> Result<(Command, u64)> {
        let mut bytes = [0; size_of::<Command>()];
        let length = self.0.recv(&mut bytes)?;
        let arrived = now();
        Ok((decode(&bytes[..length])?, arrived))
    }
}

pub fn datagram_respond(place: &Place) -> Result<()> {
    let socket = UnixDatagram::bind(address(place, "responder"))?;
    responder_ready(place);
    socket.recv(&mut [])?;
    socket.connect(address(place, "driver"))?;
    let mut bytes = [0; size_of::<Pose>()];
    loop {
        let length = socket.recv(&mut bytes)?;
        let received = now();
        let command = answer(&decode(&bytes[..length])?, received);
        socket.send(bytemuck::bytes_of(&command))?;
    }
}

struct Stream(UnixStream);

pub fn stream_driver(place: &Place) -> Result<Box<dyn Driver>> {
    Ok(Box::new(Stream(UnixStream::connect(address(place, "responder"))?)))
}

impl Driver for Stream {
    fn send(&mut self, pose: &Pose) -> Result<()> {
        self.0.write_all(bytemuck::bytes_of(pose))?;
        Ok(())
    }

    fn command(&mut self) -> Result<(Command, u64)> {
        let mut bytes = [0; size_of::<Command>()];
        self.0.read_exact(&mut bytes)?;
        let arrived = now();
        Ok((decode(&bytes)?, arrived))
    }
}

pub fn stream_respond(place: &Place) -> Result<()> {
    let listener = UnixListener::bind(address(place, "responder"))?;
    responder_ready(place);
    let (mut stream, _) = listener.accept()?;
    let mut bytes = [0; size_of::<Pose>()];
    loop {
        stream.read_exact(&mut bytes)?;
        let received = now();
        let command = answer(&decode(&bytes)?, received);
        stream.write_all(bytemuck::bytes_of(&command))?;
    }
}
