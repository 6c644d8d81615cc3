use super::*;
use crate::hypervolume;
use crate::random::Random;

fn offer(archive: &mut Archive, objectives: &[f64], violation: f64, evaluation: u64) {
    let coordinates = [evaluation as f64];
    archive.offer(Found { objectives, violation, coordinates: &coordinates, evaluation });
}

fn points(archive: &Archive) -> Vec<Vec<f64>> {
    archive.members().map(|member| member.objectives.to_vec()).collect()
}

fn dominated(a: &[f64], b: &[f64]) -> bool {
    b.iter().zip(a).all(|(b, a)| b <= a)
}

/// Feeds the archive and a plain list that forgets nothing the same points.
fn feed(objectives: usize, capacity: usize, count: u64, seed: u64) -> (Archive, Vec<Vec<f64>>) {
    let mut random = Random::new(seed);
    let mut archive = Archive::new(objectives, 1, capacity, None);
    let mut all: Vec<Vec<f64>> = Vec::new();
    for n in 0..count {
        // Coarse, so that ties and equal points come up.
        let point: Vec<f64> = (0..objectives).map(|_| (random.unit() * 50.0).floor() / 50.0).collect();
        offer(&mut archive, &point, 0.0, n);
        if !all.iter().any(|other| dominated(&point, other)) {
            all.retain(|other| !dominated(other, &point));
            all.push(point);
        }
        assert!(archive.len() <= capacity);
    }
    (archive, all)
}

#[test]
fn with_room_it_is_the_front_of_all_that_was_offered() {
    for objectives in [2, 3] {
        for seed in 0..20 {
            let (archive, mut all) = feed(objectives, 400, 300, seed);
            let mut ours = points(&archive);
            ours.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
            all.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
            assert_eq!(ours, all, "{objectives} objectives, seed {seed}");
        }
    }
}

#[test]
fn without_room_its_members_stay_mutually_non_dominated() {
    for objectives in [2, 3] {
        for seed in 0..20 {
            let (archive, _) = feed(objectives, 10, 500, seed);
            let ours = points(&archive);
            for (n, a) in ours.iter().enumerate() {
                assert!(ours.iter().enumerate().all(|(m, b)| n == m || !dominated(a, b)), "{ours:?}");
            }
            for member in archive.members() {
                assert_eq!(member.coordinates[0], member.evaluation as f64, "slots got mixed up");
            }
        }
    }
}

#[test]
fn what_the_staircase_calls_worth_is_the_hypervolume_that_goes() {
    let limits = [1.0, 1.0];
    let mut archive = Archive::new(2, 1, 50, Some(&limits));
    let mut random = Random::new(5);
    for n in 0..200 {
        let x = random.unit();
        offer(&mut archive, &[x, (1.0 - x) * (1.0 - x)], 0.0, n);
    }
    let all = points(&archive);
    let volume = |points: &[Vec<f64>]| hypervolume(points.iter().map(Vec::as_slice), &limits);
    let Keeper::Two(stairs) = &archive.keeper else { panic!("two objectives") };
    for rank in 0..all.len() {
        let mut rest = all.clone();
        rest.remove(rank);
        let lost = volume(&all) - volume(&rest);
        assert!((stairs.worth(rank) - lost).abs() < 1e-12, "rank {rank}");
    }
}

#[test]
fn nearest_neighbours_are_kept_right() {
    let mut random = Random::new(11);
    let mut archive = Archive::new(3, 1, 30, None);
    for n in 0..2_000 {
        // On a sphere that shrinks, so that members are dominated as well as crowded out.
        let size = 1.0 + 500.0 / (n as f64 + 100.0);
        let direction: [f64; 3] = std::array::from_fn(|_| random.unit());
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt();
        offer(&mut archive, &direction.map(|x| size * (1.0 - x / length)), 0.0, n);
        let Keeper::Three(keeper) = &archive.keeper else { panic!("three objectives") };
        keeper.check();
    }
    assert_eq!(archive.len(), 30);
}

#[test]
fn what_is_beyond_the_reference_goes_first() {
    for objectives in [2, 3] {
        let reference = vec![1.0; objectives];
        let mut archive = Archive::new(objectives, 1, 4, Some(&reference));
        let point = |x: f64, y: f64| if objectives == 2 { vec![x, y] } else { vec![x, y, 0.5] };
        // Far beyond, at the ends, where nothing is crowded.
        for (n, (x, y)) in [(0.0, 9.0), (9.0, 0.0), (8.0, 0.01)].into_iter().enumerate() {
            offer(&mut archive, &point(x, y), 0.0, n as u64);
        }
        for n in 0..4 {
            let x = 0.2 + 0.1 * f64::from(n);
            offer(&mut archive, &point(x, 0.9 - x), 0.0, 10);
        }
        assert!(points(&archive).iter().all(|point| point.iter().all(|value| *value < 1.0)), "{archive:?}");
    }
}

#[test]
fn the_first_feasible_one_ends_the_reign_of_the_least_infeasible() {
    let mut archive = Archive::new(2, 1, 10, None);
    assert_eq!(archive.leader(2, &mut Random::new(1)), None);
    offer(&mut archive, &[0.0, 0.0], 3.0, 1);
    offer(&mut archive, &[0.0, 0.0], 2.0, 2);
    offer(&mut archive, &[0.0, 0.0], 2.5, 3);
    assert!(archive.is_empty());
    assert_eq!(archive.leader(2, &mut Random::new(1)), Some(&[2.0][..]));
    offer(&mut archive, &[5.0, 5.0], 0.0, 4);
    offer(&mut archive, &[0.0, 0.0], 1.0, 5);
    assert_eq!(points(&archive), [[5.0, 5.0]]);
    assert_eq!(archive.leader(2, &mut Random::new(1)), Some(&[4.0][..]));
}

#[test]
fn while_all_are_beyond_the_reference_the_nearest_stay() {
    for objectives in [2, 3] {
        let reference = vec![1.0; objectives];
        let mut archive = Archive::new(objectives, 1, 4, Some(&reference));
        let mut random = Random::new(9);
        for n in 0..500 {
            // On a front that ends short of the reference.
            let x = random.between(0.0, 9.0);
            let point = if objectives == 2 { vec![x, 9.0 - x] } else { vec![x, 9.0 - x, 0.5] };
            offer(&mut archive, &point, 0.0, n);
        }
        let far = |point: &Vec<f64>| point.iter().copied().fold(0.0, f64::max);
        assert!(points(&archive).iter().all(|point| far(point) < 4.7), "{:?}", points(&archive));
    }
}
