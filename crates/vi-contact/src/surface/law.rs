//! Constants of bodies and of pairs of bodies.

use std::collections::BTreeMap;

use crate::error::ContactError;

/// The contact constants of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Half the thickness of a sheet, or the radius of a sphere or wire; 0 for the surface of a solid, m.
    pub radius: f64,
    /// Activation distance d̂, m. A pair uses the smaller one of its two bodies.
    pub distance: f64,
    /// Layer modulus κ, Pa. A pair uses the smaller one of its two bodies.
    pub stiffness: f64,
    /// Whether the body is searched for contact with itself.
    pub meets_itself: bool,
}

/// Constants of a pair of bodies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law {
    /// Activation distance d̂, m.
    pub distance: f64,
    /// Layer modulus κ, Pa.
    pub stiffness: f64,
    /// Coulomb's coefficient μ.
    pub friction: f64,
    /// Damping time τ, s.
    pub damping: f64,
    /// Whether something joins the bodies: parts that start within d̂ of each other are then not a pair.
    pub joined: bool,
}

/// Parameters of one pair of bodies that differ from the defaults.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PairRule {
    /// Whether the bodies never meet.
    pub excluded: bool,
    /// Whether something joins the bodies: parts that start within d̂ of each other are then not a pair. For a body joined
    /// to itself, this applies to parts that start at the same position.
    pub joined: bool,
    /// Activation distance d̂, m.
    pub distance: Option<f64>,
    /// Layer modulus κ, Pa.
    pub stiffness: Option<f64>,
    /// Coulomb's coefficient μ.
    pub friction: Option<f64>,
    /// Damping time τ, s.
    pub damping: Option<f64>,
}

/// The laws of all pairs of bodies.
#[derive(Debug, Clone)]
pub(crate) struct Laws {
    pub(crate) bodies: Vec<Body>,
    pub(crate) rules: BTreeMap<(u32, u32), PairRule>,
    pub(crate) friction: f64,
    pub(crate) damping: f64,
    /// Half of the largest d̂ of each body; the d̂ of a pair is at most the sum of both.
    pub(crate) half_reach: Vec<f64>,
}

impl Laws {
    pub(crate) fn of(&self, a: u32, b: u32) -> Option<Law> {
        let (first, second) = (&self.bodies[a as usize], &self.bodies[b as usize]);
        if a == b && !first.meets_itself {
            return None;
        }
        let rule = if self.rules.is_empty() { None } else { self.rules.get(&(a.min(b), a.max(b))) };
        let rule = rule.copied().unwrap_or_default();
        if rule.excluded {
            return None;
        }
        Some(Law {
            distance: rule.distance.unwrap_or(first.distance.min(second.distance)),
            stiffness: rule.stiffness.unwrap_or(first.stiffness.min(second.stiffness)),
            friction: rule.friction.unwrap_or(self.friction),
            damping: rule.damping.unwrap_or(self.damping),
            joined: rule.joined,
        })
    }

    /// Checks all numbers and computes the reach of each body.
    pub(crate) fn finish(&mut self) -> Result<(), ContactError> {
        let check = |body: u32, quantity: &'static str, value: f64, positive: bool| {
            let sound = value.is_finite() && if positive { value > 0.0 } else { value >= 0.0 };
            let domain =
                if positive { "must be positive and finite" } else { "must be zero or positive, and finite" };
            if sound { Ok(()) } else { Err(ContactError::Value { body, quantity, value, domain }) }
        };
        for (number, body) in (0..).zip(&self.bodies) {
            check(number, "distance", body.distance, true)?;
            check(number, "stiffness", body.stiffness, true)?;
            check(number, "radius", body.radius, false)?;
        }
        check(0, "friction", self.friction, false)?;
        check(0, "damping", self.damping, false)?;
        self.half_reach = self.bodies.iter().map(|body| 0.5 * body.distance).collect();
        for (&(a, b), rule) in &self.rules {
            for (quantity, value, positive) in [
                ("distance", rule.distance, true),
                ("stiffness", rule.stiffness, true),
                ("friction", rule.friction, false),
                ("damping", rule.damping, false),
            ] {
                value.map_or(Ok(()), |value| check(a, quantity, value, positive))?;
            }
            for body in [a, b] {
                let reach = &mut self.half_reach[body as usize];
                *reach = reach.max(0.5 * rule.distance.unwrap_or(0.0));
            }
        }
        Ok(())
    }
}
