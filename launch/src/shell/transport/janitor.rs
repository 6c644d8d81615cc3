//! Tidying up after processes that died.

use super::Ipc;
use crossbeam_channel::{Sender, bounded};
use iceoryx2::node::Node;
use std::thread::{Builder, JoinHandle};

/// iceoryx2 keeps whole directories of names on the stack.
const STACK: usize = 4 << 20;

/// A thread that frees what dead workers left in shared memory; it ends when this goes.
///
/// It takes file operations, tens of milliseconds on a busy disk, for which the lease on the robot cannot
/// wait.
pub struct Janitor {
    ring: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Janitor {
    /// Takes over launch's node.
    pub(super) fn start(node: Node<Ipc>) -> std::io::Result<Self> {
        let (ring, rung) = bounded(1);
        let thread = Builder::new().name("janitor".into()).stack_size(STACK).spawn(move || {
            crate::shell::realtime::leave_the_control_path();
            for () in &rung {
                // Failures are for the next time.
                let _ = node.try_cleanup_dead_nodes();
            }
        })?;
        Ok(Self { ring: Some(ring), thread: Some(thread) })
    }

    /// Somebody has died.
    pub fn call(&self) {
        // If it is called already, it will find this one too.
        let _ = self.ring.as_ref().map(|ring| ring.try_send(()));
    }
}

impl Drop for Janitor {
    fn drop(&mut self) {
        self.ring = None;
        let _ = self.thread.take().map(JoinHandle::join);
    }
}
