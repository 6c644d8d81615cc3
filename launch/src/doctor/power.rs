//! Heat and power: what makes a small computer slow in the middle of a drive.

use super::{Finding, Machine};

const CHECK: &str = "heat and power";
/// A thermal zone from which on it is warm, thousandths of a degree: small computers slow down at 80 to 85 °C.
const WARM: i64 = 80_000;
/// What the firmware of a Raspberry Pi tells in `get_throttled`; what has happened since it was started is 16 bits higher.
const FIRMWARE: [(u32, &str); 4] = [
    (0, "too low a voltage"),
    (1, "its frequency is capped"),
    (2, "it is throttled"),
    (3, "it is near its temperature limit"),
];

pub(super) fn heat(machine: &Machine) -> Finding {
    if let Some(bits) = firmware(machine).filter(|bits| *bits != 0) {
        let now: Vec<&str> =
            FIRMWARE.iter().filter(|(bit, _)| bits >> bit & 1 == 1).map(|(_, what)| *what).collect();
        let ever = |bit: u32| (bits >> (bit + 16) | bits >> bit) & 1 == 1;
        let when = if now.is_empty() { "since it was started" } else { "now" };
        let all = FIRMWARE.iter().filter(|(bit, _)| ever(*bit)).map(|(_, what)| *what);
        let what = if now.is_empty() { all.collect::<Vec<_>>() } else { now };
        let cure = match (ever(0), ever(2) || ever(3)) {
            (true, _) => "a supply (and a cable) that gives 5.1 V under load; motors on another one",
            (_, true) => "a heat sink or a fan",
            _ => "a better supply or more cooling",
        };
        return Finding::warning(CHECK, format!("{}, {when}", what.join(", ")), cure);
    }
    let throttled =
        format!("/sys/devices/system/cpu/cpu{}/thermal_throttle/core_throttle_count", machine.control_cpu);
    let throttled = machine.number::<u64>(&throttled);
    if let Some(times) = throttled.filter(|times| *times > 0) {
        let found = format!("cpu {} was slowed down by its heat {times} times", machine.control_cpu);
        return Finding::warning(CHECK, found, "more cooling, or less load");
    }
    const ZONES: &str = "/sys/class/thermal";
    let zones = machine.names(ZONES).into_iter().filter(|name| name.starts_with("thermal_zone"));
    let warmest =
        zones.filter_map(|zone| Some((machine.number::<i64>(&format!("{ZONES}/{zone}/temp"))?, zone))).max();
    match warmest {
        Some((temperature, zone)) if temperature >= WARM => Finding::warning(
            CHECK,
            format!("{} °C ({zone}): it will be slowed down", temperature / 1000),
            "more cooling, or less load",
        ),
        Some((temperature, _)) => Finding::good(CHECK, format!("{} °C at the warmest", temperature / 1000)),
        None if throttled.is_some() => Finding::good(CHECK, "never slowed down"),
        None => Finding::unknown(CHECK, "no sensor that this kernel can read"),
    }
}

/// The bits of a Raspberry Pi's firmware, hexadecimal.
fn firmware(machine: &Machine) -> Option<u32> {
    let text = machine.text("/sys/devices/platform/soc/soc:firmware/get_throttled")?;
    u32::from_str_radix(text.trim_start_matches("0x"), 16).ok()
}

#[cfg(test)]
mod tests {
    use super::super::Verdict::{Good, Unknown, Warning};
    use super::super::machine::fake::Fake;
    use super::*;

    #[test]
    fn a_raspberry_tells_what_has_happened() {
        const FILE: &str = "/sys/devices/platform/soc/soc:firmware/get_throttled";
        let of = |text: &str| {
            heat(&Fake::new(&[(FILE, text), ("/sys/class/thermal/thermal_zone0/temp", "51000")]).machine)
        };
        assert_eq!((of("0").verdict, of("nonsense").verdict), (Good, Good));
        let now = of("50005\n");
        assert!(now.verdict == Warning && now.found == "too low a voltage, it is throttled, now", "{now:?}");
        assert!(now.cure.contains("5.1 V"), "{now:?}");
        let before = of("0xc0000");
        assert!(before.found.ends_with("temperature limit, since it was started"), "{before:?}");
        assert!(before.cure.contains("fan"), "{before:?}");
    }

    #[test]
    fn warm_is_told_before_it_is_slow_and_slow_in_any_case() {
        const COUNT: &str = "/sys/devices/system/cpu/cpu1/thermal_throttle/core_throttle_count";
        let fake = Fake::new(&[]);
        assert_eq!(heat(&fake.machine).verdict, Unknown);
        fake.put(COUNT, "0\n");
        assert_eq!(heat(&fake.machine).found, "never slowed down");
        fake.put("/sys/class/thermal/thermal_zone0/temp", "40000");
        fake.put("/sys/class/thermal/thermal_zone1/temp", "79999");
        fake.put("/sys/class/thermal/cooling_device0/temp", "99999");
        assert_eq!(heat(&fake.machine).found, "79 °C at the warmest");
        fake.put("/sys/class/thermal/thermal_zone1/temp", "81000");
        let warm = heat(&fake.machine);
        assert!(warm.verdict == Warning && warm.found.contains("81 °C (thermal_zone1)"), "{warm:?}");
        fake.put(COUNT, "7\n");
        assert!(heat(&fake.machine).found.contains("7 times"));
    }
}
