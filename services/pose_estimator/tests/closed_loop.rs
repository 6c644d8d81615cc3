mod support;
use hilare_pose_estimator::EstimatorKind;
use hilare_pose_estimator::ekf::params::EkfParams;
use support::rectangle::drive;
use support::{Wrong, differential};
fn stat(kind: EstimatorKind, p: EkfParams, wrong: Wrong, n: u64) -> (f64, f64, f64, f64, bool) {
    let v: Vec<_> = (0..n).map(|s| drive(kind, differential(p), wrong, s)).collect();
    let m = |f: &dyn Fn(&support::rectangle::Driven) -> f64| v.iter().map(f).sum::<f64>() / n as f64 * 1e3;
    (
        m(&|d| d.cross_track_mean_m),
        m(&|d| d.cross_track_max_m),
        m(&|d| d.estimate_rms_m),
        m(&|d| d.ticks as f64) / 1e6,
        v.iter().all(|d| d.arrived),
    )
}
#[test]
fn explore() {
    let p = EkfParams::default();
    let slip = Wrong { scale: [-0.05, 0.01, 0.0], slip_noise: 0.0, start: [0.01, 0.01, 0.052] };
    let noisy = Wrong { slip_noise: 0.001, ..slip };
    println!("{:?}", drive(EstimatorKind::DeadReckoning, differential(p), Wrong::default(), 0));
    for (name, w) in [("none", Wrong::default()), ("slip", slip), ("noisy", noisy)] {
        for kind in EstimatorKind::ALL {
            println!("{name} {} {:.3?}", kind.name(), stat(kind, p, w, 20));
        }
    }
    for q in [0.0, 1e-4, 3e-4, 5e-4, 1e-3] {
        for drift in [0.0, 0.001, 0.002, 0.005, 0.01] {
            let p = EkfParams { slip_noise: q, scale_drift: drift, ..p };
            println!(
                "q {q} drift {drift}: none {:.3?} slip {:.3?} noisy {:.3?}",
                stat(EstimatorKind::Ekf, p, Wrong::default(), 20),
                stat(EstimatorKind::Ekf, p, slip, 20),
                stat(EstimatorKind::Ekf, p, noisy, 20)
            );
        }
    }
    for s in [0.001, 0.005, 0.01, 0.02, 0.05] {
        for r in [0.005, 0.02, 0.05, 0.1] {
            let p = EkfParams { start_sd_m: s, start_sd_rad: r, ..p };
            println!(
                "start {s} {r}: none {:.3?} slip {:.3?}",
                stat(EstimatorKind::Ekf, p, Wrong::default(), 20),
                stat(EstimatorKind::Ekf, p, slip, 20)
            );
        }
    }
}
