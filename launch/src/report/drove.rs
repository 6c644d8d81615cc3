//! Who drove: every controller that was in charge and whose commands acted, each once, in order.

use hilare_interfaces::messages::{Drive, Steps};

/// Controllers kept at most; more in one run is no report any more.
const MAX_DRIVERS: usize = 64;

/// A controller's number and its epoch: a place can be another law's after a swap.
pub type Driver = (u64, u64);

/// Who drove so far.
#[derive(Clone, Debug, Default)]
pub struct Drove(Vec<Driver>);

impl Drove {
    /// Takes in a tick; says who drives in it, if nobody knew yet. A command that was borrowed for a cycle puts
    /// nobody in charge.
    pub fn note(&mut self, steps: &Steps) -> Option<Driver> {
        let driver = (steps.in_charge, steps.epoch);
        let drives = steps.drive == Drive::Command.code() && steps.source == steps.in_charge && driver.0 != 0;
        let is_new = drives && self.0.len() < MAX_DRIVERS && !self.0.contains(&driver);
        is_new.then(|| {
            self.0.push(driver);
            driver
        })
    }

    /// All of them, oldest first.
    pub fn drivers(&self) -> &[Driver] {
        &self.0
    }
}

/// `kanayama, then qp`: each name once.
pub fn in_words(names: impl Iterator<Item = String>) -> String {
    let mut each: Vec<String> = Vec::new();
    for name in names {
        if !each.contains(&name) {
            each.push(name);
        }
    }
    each.join(", then ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use hilare_interfaces::layout::WireField;

    #[test]
    fn every_driver_counts_once_and_a_borrowed_command_does_not() {
        let driving =
            Steps { drive: Drive::Command.code(), source: 3, in_charge: 3, epoch: 1, ..Steps::ZERO };
        let mut drove = Drove::default();
        assert_eq!(drove.note(&Steps { source: 0, in_charge: 0, ..driving }), None);
        assert_eq!(drove.note(&Steps { drive: Drive::Hold.code(), ..driving }), None);
        assert_eq!(drove.note(&driving), Some((3, 1)));
        assert_eq!(drove.note(&driving), None);
        assert_eq!(drove.note(&Steps { source: 4, ..driving }), None);
        assert_eq!(drove.note(&Steps { source: 4, in_charge: 4, epoch: 2, ..driving }), Some((4, 2)));
        assert_eq!(drove.drivers(), [(3, 1), (4, 2)]);
        let names = ["kanayama", "qp", "kanayama"].map(str::to_owned).into_iter();
        assert_eq!(in_words(names), "kanayama, then qp");
    }
}
