//! dora: two Rust nodes of one dataflow. Its daemon starts them and wires them; the messages go from node to
//! node over zenoh on loopback, and each is reported to the daemon.

use super::{Driver, Place, now, responder_ready};
use crate::Result;
use crate::messages::{Command, Pose, answer, decode};
use bytemuck::Pod;
use dora_node_api::{DoraArray, DoraNode, Event, EventStream, MetadataParameters, into_vec};
use std::fs;
use std::path::{Path, PathBuf};

/// The conductor: writes the dataflow, whose nodes are this program, and gives its path.
pub fn write_dataflow(directory: &Path, program: &Path, driver: &str, responder: &str) -> Result<PathBuf> {
    let program = program.display();
    let text = format!(
        "nodes:\n\
         - id: driver\n  path: {program}\n  args: {driver}\n  inputs:\n    command: responder/command\n  outputs: [pose]\n\
         - id: responder\n  path: {program}\n  args: {responder}\n  inputs:\n    pose: driver/pose\n  outputs: [command]\n"
    );
    let path = directory.join("dataflow.yml");
    fs::write(&path, text)?;
    Ok(path)
}

struct Ends {
    node: DoraNode,
    events: EventStream,
    output: &'static str,
}

impl Ends {
    fn join(output: &'static str) -> Result<Self> {
        let (node, events) = DoraNode::init_from_env()?;
        Ok(Self { node, events, output })
    }

    fn send<T: Pod>(&mut self, message: &T) -> Result<()> {
        let bytes = bytemuck::bytes_of(message);
        let parameters = MetadataParameters::default();
        Ok(self.node.send_output_bytes(self.output.into(), parameters, bytes.len(), bytes)?)
    }

    /// The next message and when it came; `None` if there will be no more.
    fn receive<T: Pod>(&mut self) -> Result<Option<(T, u64)>> {
        while let Some(event) = self.events.recv() {
            match event {
                Event::Input { data, .. } => {
                    let arrived = now();
                    return Ok(Some((read(&data)?, arrived)));
                }
                Event::Stop(_) | Event::InputClosed { .. } => return Ok(None),
                Event::Error(error) => return Err(error.into()),
                _ => {}
            }
        }
        Ok(None)
    }
}

fn read<T: Pod>(data: &DoraArray) -> Result<T> {
    decode(&into_vec::<u8>(data)?)
}

pub fn driver(_: &Place) -> Result<Box<dyn Driver>> {
    Ok(Box::new(Ends::join("pose")?))
}

impl Driver for Ends {
    fn send(&mut self, pose: &Pose) -> Result<()> {
        Ends::send(self, pose)
    }

    fn command(&mut self) -> Result<(Command, u64)> {
        self.receive()?.ok_or_else(|| "dora: the dataflow ended".into())
    }
}

pub fn respond(place: &Place) -> Result<()> {
    let mut ends = Ends::join("command")?;
    responder_ready(place);
    while let Some((pose, received)) = ends.receive::<Pose>()? {
        ends.send(&answer(&pose, received))?;
    }
    Ok(())
}
