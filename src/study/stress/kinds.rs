//! The kinds of scenes of `variational stress`.

macro_rules! violence {
    ($($(#[doc = $doc:literal])* $name:ident;)*) => {
        /// Action on a body.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Violence { $($(#[doc = $doc])* $name,)* }

        impl Violence {
            /// All kinds.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// Returns the kind in words.
            pub fn words(self) -> &'static str {
                match self { $(Self::$name => concat!($($doc),*).trim_start(),)* }
            }
        }
    };
}

violence! {
    /// collapsed to a plane
    Plane;
    /// collapsed to a line
    Line;
    /// collapsed to a point
    Point;
    /// inverted (mirrored)
    Inverted;
    /// nodes scrambled in their box
    Scrambled;
    /// stretched twentyfold
    Stretched;
    /// stiffness ratio 1e8 in one body
    Stiffness;
    /// density ratio 1e6 in one body
    Density;
    /// Poisson's ratio from -0.9 to 0.4999
    Poisson;
    /// slivers, aspect up to 1e6
    Slivers;
    /// steps from 1e-8 to 1 s
    Steps;
    /// spinning near the wave speed
    Spinning;
    /// struck
    Struck;
    /// twisted ten turns
    Twisted;
    /// pulled by clamps at violent speed
    Pulled;
    /// gravity up to 1e6 g
    Gravity;
    /// moderate: nothing but its own weight
    Moderate;
    /// thrown at an obstacle
    Thrown;
    /// stacked
    Stacked;
    /// crumpled sheets
    Crumpled;
    /// masses of 1 : 1000 in contact
    Masses;
    /// knives
    Knives;
    /// needles
    Needles;
    /// obstacles driven through bodies
    Driven;
    /// starts with a gap of 1e-9
    Close;
    /// round bodies that spin and rub
    Round;
    /// joined bodies that fold
    Folded;
    /// at rest: piled on a floor
    Piled;
    /// at rest: pressed by a moved side
    Pressed;
    /// at rest: pressed by a load
    Loaded;
    /// at rest: indented by a moved rigid body
    Indented;
    /// at rest: balls on soft bodies
    Balls;
    /// at rest: on a slope
    Tilted;
    /// at rest: brought together
    BroughtTogether;
    /// at rest: dragged along a body
    Dragged;
}

/// Number of kinds, from the start of the list, that act on one body. In the others bodies meet.
const OF_ONE_BODY: usize = 17;
/// Number of kinds, from the end of the list, in which bodies come to rest.
const OF_EQUILIBRIA: usize = 8;

impl Violence {
    /// Returns the kinds that act on one body.
    pub fn of_one_body() -> &'static [Self] {
        &Self::ALL[..OF_ONE_BODY]
    }

    /// Returns the kinds in which bodies meet in motion.
    pub fn of_contact() -> &'static [Self] {
        &Self::ALL[OF_ONE_BODY..Self::ALL.len() - OF_EQUILIBRIA]
    }

    /// Returns the kinds in which bodies meet and come to rest.
    pub fn of_equilibria() -> &'static [Self] {
        &Self::ALL[Self::ALL.len() - OF_EQUILIBRIA..]
    }
}
