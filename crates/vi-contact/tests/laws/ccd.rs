//! Tests continuous collision detection: every certificate is proved again in exact rational arithmetic.

use crate::support::{Numbers, Vec3};
use num_bigint::BigInt;
use vi_contact::{Certificate, Shape, separated_until};

type Points = [Vec3; 4];

/// mantissa · 2^exponent, exactly.
#[derive(Clone)]
struct Dyadic(BigInt, i32);

impl Dyadic {
    fn new(value: f64) -> Self {
        let bits = value.to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i32;
        let fraction = (bits & ((1 << 52) - 1)) as i64;
        let mantissa = if exponent == 0 { fraction } else { fraction | (1 << 52) };
        Self(BigInt::from(if value < 0.0 { -mantissa } else { mantissa }), exponent.max(1) - 1075)
    }

    fn times(&self, other: &Self) -> Self {
        Self(&self.0 * &other.0, self.1 + other.1)
    }

    fn plus(&self, other: &Self) -> Self {
        let exponent = self.1.min(other.1);
        Self((&self.0 << (self.1 - exponent)) + (&other.0 << (other.1 - exponent)), exponent)
    }

    fn minus(&self, other: &Self) -> Self {
        self.plus(&Self(-&other.0, other.1))
    }

    fn is_positive(&self) -> bool {
        self.0 > BigInt::ZERO
    }
}

/// Returns whether direction w keeps all nodes of the pair more than ξ apart at time t. Exactly: w·Δ > 0 and (w·Δ)² >
/// ξ² |w|² for Δ = (1−t) Δ₀ + t Δ₁.
fn holds(shape: Shape, x: [&Points; 2], thickness: f64, certificate: &Certificate, t: f64) -> bool {
    let first = if shape == Shape::EdgeEdge { 2 } else { 1 };
    let w = [0, 1, 2].map(|k| Dyadic::new(certificate.direction[k]));
    let square = w.iter().fold(Dyadic::new(0.0), |sum, w| sum.plus(&w.times(w)));
    let (thick, t) = (Dyadic::new(thickness), Dyadic::new(t));
    let bound = thick.times(&thick).times(&square);
    let rest = Dyadic::new(1.0).minus(&t);
    (0..first).all(|i| {
        (first..shape.arity()).all(|j| {
            let mut height = Dyadic::new(0.0);
            for k in 0..3 {
                let [start, end] = x.map(|x| Dyadic::new(x[i][k]).minus(&Dyadic::new(x[j][k])));
                height = height.plus(&w[k].times(&rest.times(&start).plus(&t.times(&end))));
            }
            height.is_positive() && height.times(&height).minus(&bound).is_positive()
        })
    })
}

/// Returns a path of the pair: far apart, near (gaps 1e-8 … 1e-2), nearly parallel, or degenerate.
fn query(numbers: &mut Numbers, shape: Shape, round: usize) -> (Points, Points, f64) {
    let gap = 10_f64.powf(-8.0 + 6.0 * numbers.unit());
    let mut x0 = [(); 4].map(|()| numbers.vector());
    let mut motion = [(); 4].map(|()| numbers.vector());
    match round % 4 {
        0 => {}
        1 => {
            // Flat, with a small gap, and a motion of about its size or much larger.
            for x in &mut x0 {
                x.z = 0.0;
            }
            let above = if shape == Shape::EdgeEdge { 2 } else { 1 };
            x0.iter_mut().take(above).for_each(|x| x.z = gap);
            let size = 10_f64.powf(-4.0 * numbers.unit()) * if round % 8 < 4 { gap } else { 1.0 };
            motion = motion.map(|v| v * size);
            let fall = gap * (0.5 + 3.0 * numbers.unit());
            motion.iter_mut().take(above).for_each(|v| v.z -= fall);
        }
        2 => {
            // Nearly parallel edges, and needle-like triangles.
            let tilt = 10_f64.powf(-10.0 * numbers.unit());
            let along = x0[1] - x0[0];
            x0[3] = x0[2] + along + numbers.vector() * tilt;
            motion = motion.map(|v| v * gap.sqrt());
        }
        _ => {
            // Degenerate: coincident nodes, no motion, or all nodes in one plane.
            match round % 12 {
                3 => x0[3] = x0[2],
                7 => motion = [Vec3::zeros(); 4],
                _ => x0.iter_mut().chain(&mut motion).for_each(|x| x.z = 0.0),
            }
        }
    }
    let shift = numbers.vector() * if round.is_multiple_of(3) { 1e3 } else { 0.0 };
    let x0 = x0.map(|x| x + shift);
    let x1 = [0, 1, 2, 3].map(|a: usize| x0[a] + motion[a]);
    let thickness = if round.is_multiple_of(5) { 0.3 * gap } else { 0.0 };
    (x0, x1, thickness)
}

#[test]
fn every_interval_is_proved_again_in_rationals() {
    let mut numbers = Numbers::new(11);
    let (mut certificates, mut whole, mut part) = (0, 0, 0);
    for round in 0..4800 {
        let shape =
            [Shape::PointTriangle, Shape::EdgeEdge, Shape::PointTriangle, Shape::EdgeEdge, Shape::PointEdge]
                [(round / 4) % 5];
        let (x0, x1, thickness) = query(&mut numbers, shape, round);
        let (mut found, mut last) = (Vec::new(), 0.0);
        let until = separated_until(shape, &x0, &x1, thickness, |certificate| found.push(certificate));
        for certificate in &found {
            assert_eq!(certificate.from, last, "intervals follow each other");
            last = certificate.to;
            for t in [certificate.from, certificate.to] {
                assert!(
                    holds(shape, [&x0, &x1], thickness, certificate, t),
                    "round {round}: {certificate:?}"
                );
            }
        }
        assert_eq!(last, until);
        certificates += found.len();
        whole += usize::from(until == 1.0);
        part += usize::from(until > 0.0 && until < 1.0);
    }
    assert!(certificates > 4000 && whole > 1000 && part > 200, "{certificates} {whole} {part}");
}

/// For a point that falls straight on a triangle, and for edges that cross, the proved time is just before touch.
#[test]
fn head_on_impacts_are_found_to_round_off() {
    let mut numbers = Numbers::new(12);
    for _ in 0..500 {
        let gap = 10_f64.powf(-8.0 + 7.0 * numbers.unit());
        let toi = 0.05 + 0.9 * numbers.unit();
        let flat = |v: Vec3, z: f64| Vec3::new(v.x, v.y, z);
        let triangle = [Vec3::new(-2.0, -2.0, 0.0), Vec3::new(4.0, -2.0, 0.0), Vec3::new(-2.0, 4.0, 0.0)];
        let place = flat(numbers.vector() * 0.5, gap);
        let slide = flat(numbers.vector() * 0.4, -gap / toi);
        let x0 = [place, triangle[0], triangle[1], triangle[2]];
        let mut x1 = x0;
        x1[0] += slide;
        let found = separated_until(Shape::PointTriangle, &x0, &x1, 0.0, |_| {});
        assert!(found <= toi * (1.0 + 1e-9) && found > toi - 2e-13 / gap, "{gap:e} {toi} {found}");
        let x0 = [
            Vec3::new(-1.0, 0.0, gap),
            Vec3::new(1.0, 0.1, gap),
            Vec3::new(0.1, -1.0, 0.0),
            Vec3::new(0.0, 1.0, 0.0),
        ];
        let x1 = [x0[0] + slide, x0[1] + slide, x0[2], x0[3]];
        let found = separated_until(Shape::EdgeEdge, &x0, &x1, 0.0, |_| {});
        assert!(found <= toi * (1.0 + 1e-9) && found > toi - 2e-13 / gap, "{gap:e} {toi} {found}");
    }
}

/// On random paths the proved time is near the time of touch, which bisection over distances finds.
#[test]
fn proved_times_are_near_the_times_of_impact() {
    let mut numbers = Numbers::new(13);
    let (mut sum, mut count, mut iterations) = (0.0, 0, 0);
    for round in 0..4000 {
        let shape = if round % 2 == 0 { Shape::PointTriangle } else { Shape::EdgeEdge };
        let x0 = [(); 4].map(|()| numbers.vector());
        let x1 = [(); 4].map(|()| numbers.vector());
        let at = |t: f64| [0, 1, 2, 3].map(|a: usize| x0[a] + (x1[a] - x0[a]) * t);
        let touch =
            (0..=2000).map(|k| f64::from(k) / 2000.0).find(|&t| shape.closest(&at(t)).distance() < 2e-3);
        let until = separated_until(shape, &x0, &x1, 0.0, |_| iterations += 1);
        if let Some(touch) = touch
            && touch > 0.0
        {
            sum += (until / touch).min(1.0);
            count += 1;
        } else if touch.is_none() {
            assert!(until > 0.5, "{until}");
        }
    }
    let mean = sum / f64::from(count);
    println!("mean part of the time of impact {mean}, directions {}", f64::from(iterations) / 4000.0);
    assert!(count > 100 && mean > 0.9, "{mean} of {count}");
}
