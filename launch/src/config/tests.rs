use super::*;
#[test]
fn show() {
    let sys = |t: &str| match System::parse("robot.toml", t) {
        Ok(_) => println!("OK!!! {t}"),
        Err(e) => println!("{e}"),
    };
    for t in [
        "\n[chassis]\nwheel_raduis_m = 1",
        "[chassis]\ntrack_m = 54",
        "[chassis]\ntrack_mm = 54",
        "[chassis]\ntrack = 54",
        "[chassis]\nhalf_track_m = 1",
        "[chasis]\na=1",
        "[limits.v_max_mps]\nx=1",
        "limits=3",
        "track_m=1",
        "v_max_mps=1",
        "foo=1",
        "[foo]",
        "[[limits]]\nv_max_mps=1",
        "[realtime]\ncpu=1",
        "[realtime.foo]\ncpu=1",
        "[realtime.controler]\ncpu=1",
        "[limits]\nv_max_mps=\"1\"",
        "[limits]\nv_max_mps=true",
        "[limits]\nv_max_mps=nan",
        "[limits]\nv_max_mps=inf",
        "[limits]\nv_max_mps=1e999",
        "[limits]\nv_max_mps=-1",
        "[limits]\nv_max_mps=[1]",
        "[limits]\nv_max_mps=1979-05-27",
        "[limits]\nv_max_mps=1\nv_max_mps=2",
        "[limits]\nv_max_mps=1\n[limits]\n",
        "[limits\n",
        "[limits]\nv_max_mps=",
        "[limits]\nv_max_mps=1_0__0",
        "x = \"abc",
        "[timing]\nperiod_ticks=1.5",
        "[timing]\nperiod_ticks=0",
        "[timing]\nperiod_ms=5",
        "[supervision]\narm_on_start=1",
        "[start]\ntheta_rad=90",
        "[start]\ntheta_deg=90",
        "[start]\nx_m=1e6",
        "robot=\"Big Bot\"",
        "robot=3",
        "robot=\"\"",
        "[chassis]\nkind=\"diferential\"",
        "[chassis]\nkind=\"mecanum\"",
        "[controller]\nlaw=\"kanayma\"",
        "[controller]\nkanayama=1",
        "[controller.kanayama]\nk1=0.1\n[controller]",
        "[controller.kanayama]\nk2_per_mm2=2.9",
        "[controller.qpp]\na=1",
        "[limits]\nv_min_mps=0.05",
        "[limits]\nv_min_mps=0.05\nv_max_mps=0.04\nomega_max_radps=1",
        "[limits]\nomega_min_radps=1",
        "[chassis]\nwheel_speed_max_left_radps=10",
        "[stepper]\nstep_length_m=0.00001",
        "\"controller.kanayama\"={k1_per_s=1}",
        "[plant]\nseed=1e20",
        "[plant]\nstart_sd_deg=1",
        "[plant]\nstart_sd_mm=1",
        "[limits]\n\"a\\nb\"=1",
        "controller.kanayama.k1_per_s=-1",
        "[plant]\nseed=99999999999999999999999999999999999999999999",
    ] {
        sys(t);
    }
    println!("---");
    for t in [
        "plant.slip_men=0.1",
        "plant.slip_mean=abc",
        "plant.slip_mean=nan",
        "plant.slip_mean",
        "slip_mean=0.1",
        "limits=3",
        "limits.v_min_mps=1",
        "controller.law=foo",
        "robot=7",
        "supervision.arm_on_start=true",
        "supervision.arm_on_start=1",
        "=1",
        "a.b.c=1",
        "realtime.cpu=1",
        "plant.=1",
        ".=1",
    ] {
        match System::default().set(t) {
            Ok(_) => println!("OK {t}"),
            Err(e) => println!("{e}"),
        }
    }
    for t in ["epuk", "missing.toml", "/", "/tmp/sim/"] {
        println!("{}", System::load(t).map(|_| ()).unwrap_err());
    }
    for t in ["rectangel", "missing.toml", "x"] {
        println!("{}", Scenario::load(t).map(|_| ()).unwrap_err());
    }
    for t in Scenario::builtin_names() {
        println!("{:?}", Scenario::load(t).map(|s| (s.waypoints.len(), s.published)));
    }
    println!("{}", System::default().to_toml());
}
