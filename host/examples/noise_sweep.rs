//! Scratch.
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, SMatrix, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::fit::{FitOptions, Silent, fit};
use rigident::problem::body::BodySource;
use rigident::problem::body::Input;
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::regressor;
use rigident_shared::screening::Limits;
use rigident_shared::spatial::*;
use std::f64::consts::TAU;

struct Motion {
    t_end: f64,
    terms: Vec<(usize, f64, f64, f64)>,
}
impl Motion {
    fn rot(&self, t: f64) -> Matrix3<f64> {
        let mut e = [0.0; 3];
        for (axis, amp, k, ph) in &self.terms {
            e[*axis] += amp * (TAU * k / self.t_end * t + ph).sin();
        }
        *Rotation3::from_euler_angles(e[0], e[1], e[2]).matrix()
    }
    fn omega(&self, t: f64) -> Vector3<f64> {
        let h = 1e-4;
        let d = (self.rot(t + h) - self.rot(t - h)) * (8.0 / (12.0 * h))
            - (self.rot(t + 2.0 * h) - self.rot(t - 2.0 * h)) / (12.0 * h);
        let s = self.rot(t).transpose() * d;
        Vector3::new(s[(2, 1)] - s[(1, 2)], s[(0, 2)] - s[(2, 0)], s[(1, 0)] - s[(0, 1)]) / 2.0
    }
    fn state(&self, t: f64) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let h = 1e-3;
        let a = (self.omega(t + h) - self.omega(t - h)) * (8.0 / (12.0 * h))
            - (self.omega(t + 2.0 * h) - self.omega(t - 2.0 * h)) / (12.0 * h);
        (self.rot(t).transpose() * Vector3::new(0.0, 0.0, 9.81), self.omega(t), a)
    }
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let runs: u64 = args[1].parse().unwrap();
    let slow = args[2] == "slow";
    let stated = args[3] == "stated";
    let (rate, t_end) = if args.len() > 4 && args[4] == "long" { (1000.0, 60.0) } else { (200.0, 20.0) };
    let f = |hz: f64| (hz * t_end).round();
    let motion = Motion {
        t_end,
        terms: if slow {
            vec![
                (0, 0.3, 1.0 * f(0.05), 0.1),
                (0, 0.2, f(0.1), 1.0),
                (1, 0.3, f(0.05) + 1.0, 2.0),
                (1, 0.2, f(0.15), 0.3),
                (2, 0.4, f(0.1) + 1.0, 0.7),
                (2, 0.1, f(0.15), 1.7),
            ]
        } else {
            vec![
                (0, 0.25, f(0.2), 0.1),
                (0, 0.15, f(0.7), 1.0),
                (0, 0.1, f(1.6), 1.3),
                (1, 0.25, f(0.3), 2.0),
                (1, 0.15, f(0.9), 0.3),
                (1, 0.1, f(1.4), 0.5),
                (2, 0.25, f(0.4), 0.7),
                (2, 0.15, f(0.8), 1.7),
                (2, 0.1, f(1.2), 2.7),
            ]
        },
    };
    let n = (rate * t_end) as usize;
    let m = 3.2;
    let c = Vector3::new(0.03, -0.02, 0.08);
    let ic = Matrix3::new(0.02, 0.002, -0.001, 0.002, 0.025, 0.0015, -0.001, 0.0015, 0.015);
    let io: Matrix3<f64> = ic + (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * m;
    let phi = [
        m,
        m * c.x,
        m * c.y,
        m * c.z,
        io[(0, 0)],
        io[(1, 1)],
        io[(2, 2)],
        io[(1, 2)],
        io[(0, 2)],
        io[(0, 1)],
    ];
    let states: Vec<_> = (0..n).map(|k| motion.state(k as f64 / rate)).collect();
    let wrench = |a: &Vector3<f64>, w: &Vector3<f64>, al: &Vector3<f64>| {
        let force = (a + al.cross(&c) + w.cross(&w.cross(&c))) * m;
        let moment = io * al + w.cross(&(io * w)) + c.cross(a) * m;
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    };
    let cell = [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015];
    // rows for the bound
    let rows: Vec<SMatrix<f64, 6, 16>> = states
        .iter()
        .map(|(a, w, al)| {
            let mut s = regressor::signals((*a).into(), (*w).into(), [0.0; 6]);
            s[15..].copy_from_slice(al.as_slice());
            let b = regressor::block(&s, &Position::from_array([0.0; 3]));
            SMatrix::<f64, 6, 16>::from_fn(|i, j| {
                if j < 10 {
                    b.columns[j][i]
                } else if j - 10 == i {
                    1.0
                } else {
                    0.0
                }
            })
        })
        .collect();
    // DFT up to 12 Hz, the rest by Parseval at its floor
    let most = (12.0 * t_end) as usize;
    let spectra: Vec<(f64, SMatrix<f64, 6, 16>, SMatrix<f64, 6, 16>)> = (0..=most)
        .map(|k| {
            let (mut re, mut im) = (SMatrix::<f64, 6, 16>::zeros(), SMatrix::<f64, 6, 16>::zeros());
            for (i, row) in rows.iter().enumerate() {
                let (s, c) = (TAU * ((k * i) % n) as f64 / n as f64).sin_cos();
                re += row * c;
                im += row * s;
            }
            let both = if k == 0 { 1.0 } else { 2.0 };
            let scale = (both / n as f64).sqrt();
            (k as f64 / t_end, re * scale, im * scale)
        })
        .collect();
    let skew = |v: &Vector3<f64>| Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0);
    let mut ja = SMatrix::<f64, 6, 3>::zeros();
    ja.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * m));
    ja.fixed_view_mut::<3, 3>(3, 0).copy_from(&(skew(&c) * m));
    let mut jal = SMatrix::<f64, 6, 3>::zeros();
    jal.fixed_view_mut::<3, 3>(0, 0).copy_from(&(-skew(&c) * m));
    jal.fixed_view_mut::<3, 3>(3, 0).copy_from(&io);
    println!(
        "accel gyro | bound/rms m mc I c Ic | bias/sd max | coverage m mc I (worst) | median sd ratio predicted/true"
    );
    let cases: Vec<(f64, f64)> = if args.len() > 5 {
        vec![(args[5].parse().unwrap(), args[6].parse().unwrap())]
    } else {
        vec![(0.003, 0.0002), (0.03, 0.002), (0.1, 0.006), (0.3, 0.02), (0.01, 0.02), (0.3, 0.0002)]
    };
    for (sa, sg) in cases {
        let mut info = SMatrix::<f64, 16, 16>::zeros();
        for (hz, re, im) in &spectra {
            let mut s =
                SMatrix::<f64, 6, 6>::from_diagonal(&SMatrix::<f64, 6, 1>::from_fn(|i, _| cell[i] * cell[i]));
            s +=
                ja * ja.transpose() * (sa * sa) + jal * jal.transpose() * (sg * sg * (TAU * hz) * (TAU * hz));
            let w = s.try_inverse().unwrap();
            info += re.transpose() * w * re + im.transpose() * w * im;
        }
        let d = info.diagonal().map(|v| 1.0 / v.sqrt());
        let sc = SMatrix::<f64, 16, 16>::from_fn(|i, j| info[(i, j)] * d[i] * d[j]);
        let inv = sc.try_inverse().unwrap();
        let crb: Vec<f64> = (0..10).map(|j| inv[(j, j)].sqrt() * d[j]).collect();
        let (mut err, mut cov, mut pred) = (vec![vec![]; 10], vec![0.0; 10], vec![0.0; 10]);
        let started = std::time::Instant::now();
        let mut ratio = 0.0;
        for seed in 0..runs {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut g = |s: f64| -> f64 {
                let v: f64 = StandardNormal.sample(&mut rng);
                v * s
            };
            let readings: Vec<Reading<f64>> = states
                .iter()
                .enumerate()
                .map(|(k, (a, w, al))| {
                    let mut y = wrench(a, w, al);
                    for (v, s) in y.iter_mut().zip(cell) {
                        *v += g(s);
                    }
                    let a = a + Vector3::new(g(sa), g(sa), g(sa));
                    let w = w + Vector3::new(g(sg), g(sg), g(sg));
                    Reading {
                        time_ns: (k as f64 * 1e9 / rate) as u64,
                        wrench: Wrench::from_array(y),
                        specific_force: SpecificForce::from_array(a.into()),
                        angular_rate: AngularRate::from_array(w.into()),
                    }
                })
                .collect();
            let input = Input {
                readings,
                is_static: false,
                rate_hz: rate,
                mounting: ImuMounting::default(),
                channel_sigma: stated.then_some(cell),
                gyro_sigma: stated.then_some(sg),
                known_offset: None,
                nuisances: Vec::new(),
                limits: Limits { frozen_after: 50, ..Limits::none() },
            };
            let imu = stated.then(|| rigident::rig::ImuTable {
                accel_noise_mps2: Some(sa),
                gyro_noise_radps: Some(sg),
                ..Default::default()
            });
            let source = BodySource::new(input, imu.as_ref());
            let found = match fit(&source, &FitOptions::default(), &Silent) {
                Ok(f) => f,
                Err(e) => {
                    println!("{e}");
                    continue;
                }
            };
            ratio += found.noise.variance_ratio;
            for j in 0..10 {
                if let Some(mm) = found.estimate.measured(j) {
                    let e = mm.value - phi[j];
                    err[j].push(e);
                    if e.abs() <= mm.u95 {
                        cov[j] += 1.0;
                    }
                    pred[j] += (mm.u95 / 1.96_f64).powi(2);
                }
            }
        }
        print!("{sa} {sg} |");
        let mut biases = vec![];
        let mut sds = vec![];
        for j in 0..10 {
            let k = err[j].len() as f64;
            let mean = err[j].iter().sum::<f64>() / k;
            let rms = (err[j].iter().map(|e| e * e).sum::<f64>() / k).sqrt();
            let sd = (rms * rms - mean * mean).sqrt();
            biases.push(mean / sd);
            sds.push((pred[j] / k).sqrt() / sd);
            print!(" {:.2}", crb[j] / rms);
        }
        println!("\n   bias/sd {}", biases.iter().map(|b| format!("{b:.2}")).collect::<Vec<_>>().join(" "));
        println!(
            "   cover {}  n {}",
            cov.iter()
                .zip(&err)
                .map(|(c, e)| format!("{:.0}", 100.0 * c / e.len() as f64))
                .collect::<Vec<_>>()
                .join(" "),
            err.iter().map(|e| e.len().to_string()).collect::<Vec<_>>().join(" ")
        );
        println!(
            "   pred/sd {}  ratio {:.3}  {:.2} s",
            sds.iter().map(|b| format!("{b:.2}")).collect::<Vec<_>>().join(" "),
            ratio / runs as f64,
            started.elapsed().as_secs_f64()
        );
    }
    let _ = (DMatrix::<f64>::zeros(0, 0), DVector::<f64>::zeros(0));
}
