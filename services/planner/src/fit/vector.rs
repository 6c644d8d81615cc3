//! Plane vectors, metres.

use hilare_interfaces::geometry::WorldPoint;
use std::ops::{Add, Mul, Sub};

/// A vector or a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Vector {
    pub x: f64,
    pub y: f64,
}

impl Vector {
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    pub const fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// Positive when `other` points to the left of this.
    pub const fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    pub fn length(self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Turned by a quarter to the left.
    pub const fn left(self) -> Self {
        Self::new(-self.y, self.x)
    }

    pub fn distance(self, other: Self) -> f64 {
        (other - self).length()
    }

    pub fn towards(self, other: Self, share: f64) -> Self {
        self + (other - self) * share
    }

    pub const fn world(self) -> WorldPoint {
        WorldPoint::new(self.x, self.y)
    }
}

impl From<WorldPoint> for Vector {
    fn from(point: WorldPoint) -> Self {
        Self::new(point.x_m, point.y_m)
    }
}

impl Add for Vector {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y)
    }
}

impl Sub for Vector {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y)
    }
}

impl Mul<f64> for Vector {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self::new(self.x * factor, self.y * factor)
    }
}
