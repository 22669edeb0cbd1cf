//! A Lagrangian with accelerations, the Pais–Uhlenbeck oscillator with frequencies 1 and 2, integrated with Hermite
//! cubics and compared with the exact motion. Prints `t,q,exact,error`.

use nalgebra::DVector;
use vi_core::discrete::HermiteLagrangian;
use vi_core::problems::PaisUhlenbeck;
use vi_core::{CoreError, Quadrature};

fn main() -> Result<(), CoreError> {
    let h = 0.05;
    let lagrangian = PaisUhlenbeck(1.0, 2.0);
    let discrete = HermiteLagrangian::new(&lagrangian, Quadrature::gauss_legendre(4)?, h)?;
    let exact = |t: f64| 0.7 * t.cos() + 0.3 * (2.0 * t).sin();
    // At t = 0: q = 0.7, q̇ = 0.6, π = q̈ = −0.7, p = −5 q̇ − q⃛ = −3 + 2.4.
    let mut z = DVector::from_vec(vec![0.7, 0.6]);
    let mut momentum = DVector::from_vec(vec![-5.0 * 0.6 + 2.4, -0.7]);
    println!("t,q,exact,error");
    for k in 0..800 {
        let t = k as f64 * h;
        println!("{t},{},{},{}", z[0], exact(t), z[0] - exact(t));
        (z, momentum) = discrete.step(t, &z, &momentum)?;
    }
    Ok(())
}
