//! Tests of the histogram filter against its definition, one bin and one taxel at a time.

use glam::DVec3;

use super::*;
use crate::occupancy::{ContactClass, GridShape};
use palpate_core::log_prob::normalize;
use palpate_core::rng::{Purpose, Stream};
use palpate_core::units::MM;

/// Two smooth maps of 20 mm: bumps in different places.
fn maps() -> Vec<OccupancyGrid> {
    let shape = GridShape::new(DVec3::new(-0.010, -0.012, 0.0), 1.0 * MM, [20, 24, 1]).unwrap();
    [(4.0, -3.0), (-5.0, 6.0)]
        .map(|(x, y)| {
            let value = |cell: usize| {
                let at = shape.center(cell).truncate() / MM - DVec2::new(x, y);
                (8.0 * (-at.length_squared() / 40.0).exp() - 3.0) as f32
            };
            OccupancyGrid::from_parts(shape, 0.5, (0..480).map(value).collect()).unwrap()
        })
        .to_vec()
}

fn bins() -> PlanarBins {
    PlanarBins { n: [9, 7, 6], center: DVec2::new(0.003, -0.002), half: DVec2::splat(0.01) }
}

/// A press of 36 taxels with the classes that the first map predicts under `pose`.
fn press(session_from_object: &Pose, stream: &mut Stream) -> ClassifiedPress {
    let center = DVec3::new(stream.uniform(-0.008, 0.008), stream.uniform(-0.008, 0.008), 0.0);
    let map = &maps()[0];
    let taxels = (0..36).map(|taxel| {
        let place = DVec3::new(f64::from(taxel % 6), f64::from(taxel / 6), 0.0) * 2.0 * MM;
        let point = *session_from_object * (center + place - 5.0 * MM);
        let log_odds = map.log_odds_at(session_from_object.inverse() * point);
        let class = match stream.index(10) {
            0 => ContactClass::Unknown,
            1 => ContactClass::NoContact,
            _ if log_odds > 0.0 => ContactClass::InContact,
            _ => ContactClass::NoContact,
        };
        (point, class)
    });
    ClassifiedPress::from_taxels(taxels.collect())
}

fn filter(extent: Extent) -> PlanarHistogram {
    let model = HistogramModel::new(maps(), ClassTable::literal(), &bins(), BinShare::Center);
    PlanarHistogram::new(Arc::new(model), bins(), extent, 1.0)
}

fn presses(seed: u64, n: usize) -> (Pose, Vec<ClassifiedPress>) {
    let mut stream = Stream::new(seed, Purpose::ObjectPose, 0);
    let pose = bins().session_from_object(stream.index(bins().count()));
    let presses = (0..n).map(|_| press(&pose, &mut stream)).collect();
    (pose, presses)
}

#[test]
fn bin_centers_follow_table_3_1() {
    let bins = PlanarBins { n: [5, 5, 4], center: DVec2::ZERO, half: DVec2::splat(10.0 * MM) };
    assert_eq!(bins.count(), 100);
    // Bin 1 + 5·(2 + 5·3): x −4 mm, y 0, angle 7/8 of a turn.
    let pose = bins.session_from_object(86);
    assert!(pose.translation.distance(DVec3::new(-4.0 * MM, 0.0, 0.0)) < 1e-12);
    let turned = Pose { rotation: DQuat::from_rotation_z(-45f64.to_radians()), ..pose };
    assert!(pose.angle_to(&turned) < 1e-9);
}

#[test]
fn the_literal_filter_is_the_product_of_all_presses() {
    let (pose, presses) = presses(3, 4);
    let mut belief = filter(Extent::Literal);
    presses.iter().for_each(|press| belief.add(press.clone()));
    let maps = maps();
    let naive: Vec<f64> = maps
        .iter()
        .map(|map| {
            let bin = |bin: usize| {
                let pose = bins().session_from_object(bin);
                let log = |press| log_likelihood(press, map, &ClassTable::literal(), &pose);
                presses.iter().map(log).sum::<f64>()
            };
            let logs: Vec<f64> = (0..bins().count()).map(bin).collect();
            log_sum_exp(logs.iter().copied())
        })
        .collect();
    let (found, expected) = (normalize(&belief.log_identities()), normalize(&naive));
    assert!((found[0] - expected[0]).abs() < 1e-4, "{found:?} {expected:?}");
    let (mode, _) = belief.mode(0).unwrap();
    assert!(mode.distance_to(&pose) < 1e-9 && mode.angle_to(&pose) < 1e-9);
}

#[test]
fn planes_match_the_definition_within_their_sampling() {
    // A taxel is looked up within 0.2 mm along each axis, where log-odds change by at most
    // 0.8 a millimetre: at most 0.2 nats a taxel, and the signs cancel over 36 of them.
    let (_, presses) = presses(5, 6);
    let (mut literal, mut planes) = (filter(Extent::Literal), filter(Extent::Exhaustive));
    for press in &presses {
        literal.add(press.clone());
        planes.add(press.clone());
    }
    for object in 0..2 {
        let ((a, log_a), (b, log_b)) =
            (literal.mode(object).unwrap(), planes.mode(object).unwrap());
        assert!((log_a - log_b).abs() < 1.0, "{log_a} {log_b}");
        assert!(a.distance_to(&b) < 1e-9 && a.angle_to(&b) < 1e-9);
    }
    let apart: f64 = literal
        .slabs
        .iter()
        .zip(&planes.slabs)
        .flat_map(|(a, b)| a.logs.iter().zip(&b.logs).map(|(a, b)| f64::from((a - b).abs())))
        .fold(0.0, f64::max);
    assert!(apart < 6.0 * 1.0, "{apart}");
}

#[test]
fn a_press_on_the_planes_samples_is_summed_exactly() {
    // Taxels whose distances from every bin are whole samples are not rounded.
    let bins = PlanarBins { n: [10, 10, 4], center: DVec2::ZERO, half: DVec2::splat(10.0 * MM) };
    let table = ClassTable::literal();
    let model = Arc::new(HistogramModel::new(maps(), table.clone(), &bins, BinShare::Center));
    let radius = DVec2::new(10.5, 12.5).length() * MM;
    // 2 mm bins are five samples of 0.4 mm; first + radius − place must be whole samples.
    let place = |samples: f64| -9.0 * MM + radius - samples * 0.4 * MM;
    let taxels = (0..36).map(|n| {
        let class = [ContactClass::InContact, ContactClass::NoContact][n % 2];
        (DVec3::new(place(20.0 + 2.0 * n as f64), place(71.0 - n as f64), 0.0), class)
    });
    let press = ClassifiedPress::from_taxels(taxels.collect());
    let [mut literal, mut planes] = [Extent::Literal, Extent::Exhaustive]
        .map(|extent| PlanarHistogram::new(model.clone(), bins, extent, 1.0));
    literal.add(press.clone());
    planes.add(press);
    for (a, b) in literal.slabs.iter().zip(&planes.slabs) {
        for (a, b) in a.logs.iter().zip(&b.logs) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }
}

#[test]
fn left_out_bins_return_when_no_other_bin_explains_a_press() {
    // Presses on a wrong place first, then many on the true one.
    let (_, wrong) = presses(7, 3);
    let (pose, right) = presses(8, 12);
    let lost = Extent::Sparse { nats: 2.0, reseed: Reseed::Never };
    let found = Extent::Sparse { nats: 2.0, reseed: Reseed::WhenWorseThanNothing };
    let [mut lost, mut found, mut all] = [lost, found, Extent::Exhaustive].map(filter);
    for press in wrong.iter().chain(&right) {
        lost.add(press.clone());
        found.add(press.clone());
        all.add(press.clone());
    }
    let (truth, _) = all.mode(0).unwrap();
    assert!(truth.distance_to(&pose) < 5.0 * MM);
    assert!(found.mode(0).unwrap().0.distance_to(&truth) < 1e-9);
    assert!(lost.mode(0).is_none_or(|(mode, _)| mode.distance_to(&truth) > 1e-9));
}

#[test]
fn a_wide_margin_keeps_the_answer() {
    for seed in 0..8 {
        let (_, presses) = presses(seed, 5);
        let sparse = Extent::Sparse { nats: 40.0, reseed: Reseed::Never };
        let (mut all, mut some) = (filter(Extent::Exhaustive), filter(sparse));
        for press in presses {
            all.add(press.clone());
            some.add(press);
        }
        assert!(some.n_active() < all.n_active());
        let (a, b) = (normalize(&all.log_identities()), normalize(&some.log_identities()));
        assert!((a[0] - b[0]).abs() < 1e-4, "{a:?} {b:?}");
        let best = usize::from(a[1] > a[0]);
        assert_eq!(all.mode(best).unwrap().0, some.mode(best).unwrap().0);
    }
}

#[test]
fn extent_bins_average_over_their_extent() {
    // One angle only would turn the map around; 360 angles turn it by a third of a degree.
    let bins = PlanarBins { n: [4, 4, 360], center: DVec2::ZERO, half: DVec2::splat(4.0 * MM) };
    let table = ClassTable::literal();
    let model = HistogramModel::new(maps(), table.clone(), &bins, BinShare::Extent);
    let mut belief = PlanarHistogram::new(Arc::new(model), bins, Extent::Exhaustive, 1.0);
    // first + radius − place is a whole number of samples of 0.4 mm.
    let radius = DVec2::new(10.5, 12.5).length() * MM;
    let place = |samples: f64| -3.0 * MM + radius - samples * 0.4 * MM;
    let point = DVec3::new(place(45.0), place(30.0), 0.0);
    belief.add(ClassifiedPress::from_taxels(vec![(point, ContactClass::InContact)]));
    let expected = |bin: usize| {
        let pose = bins.session_from_object(bin);
        let (mut sum, thirds) = (0.0, [-1.0, 0.0, 1.0]);
        for (x, y) in thirds.iter().flat_map(|x| thirds.map(|y| (*x, y))) {
            let moved = pose.translation + DVec3::new(x, y, 0.0) * 2.0 * MM / 3.0;
            let at = pose.rotation.conjugate() * (point - moved);
            sum += table.probability(ContactClass::InContact, maps()[0].log_odds_at(at)) / 9.0;
        }
        sum.ln()
    };
    // Against bin 0, all of the first angle.
    for bin in 1..16 {
        let found = f64::from(belief.slabs[0].logs[bin] - belief.slabs[0].logs[0]);
        let expected = expected(bin) - expected(0);
        assert!((found - expected).abs() < 1e-3, "{bin}: {found} {expected}");
    }
}

#[test]
fn narrow_bins_share_samples_and_memory() {
    // Bins of 0.02 mm: a taxel is looked up within 0.05 mm, where log-odds change by at most
    // 0.8 a millimetre.
    let n = [20, 16, 6];
    let bins = PlanarBins { n, half: DVec2::new(0.2 * MM, 0.16 * MM), ..bins() };
    let table = ClassTable::literal();
    let model = Arc::new(HistogramModel::new(maps(), table.clone(), &bins, BinShare::Center));
    // 31.4 mm across at 0.1 mm: at most 330 samples a side, three classes and six angles.
    assert!(model.bytes() <= 2 * 330 * 330 * 3 * 6 * 4, "{}", model.bytes());
    let foretold: usize = maps().iter().map(|map| HistogramModel::bytes_of(map, &bins)).sum();
    assert_eq!(model.bytes(), foretold);
    let sparse = Extent::Sparse { nats: 0.02, reseed: Reseed::Never };
    let [mut literal, mut planes, mut sparse] = [Extent::Literal, Extent::Exhaustive, sparse]
        .map(|extent| PlanarHistogram::new(model.clone(), bins, extent, 1.0));
    let mut stream = Stream::new(9, Purpose::ObjectPose, 1);
    for _ in 0..4 {
        let press = press(&bins.session_from_object(700), &mut stream);
        literal.add(press.clone());
        planes.add(press.clone());
        sparse.add(press);
    }
    for object in 0..2 {
        for ((bin, a), (_, b)) in literal.logs(object).iter().zip(planes.logs(object)) {
            assert!((a - b).abs() < 1.0, "{object} {bin}: {a} {b}");
        }
    }
    assert!(sparse.n_active() < planes.n_active() / 8, "looked up one by one in the end");
    // Logarithms are relative to the best active bin, which may be another one.
    let all = planes.logs(0);
    let apart: Vec<f64> = sparse.logs(0).iter().map(|(bin, log)| all[*bin].1 - log).collect();
    assert!(apart.iter().all(|one| (one - apart[0]).abs() < 1e-3), "{apart:?}");
}
