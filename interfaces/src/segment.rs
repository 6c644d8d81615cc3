//! The pieces a path consists of: straight lines and circular arcs.
//!
//! ```text
//!            ╭───╮                      bulge = tan(sweep/4), the sweep counter-clockwise positive:
//!       ╭────╯ s ╰────╮                 0 a line, 1 a half circle to the left, −1 to the right
//!   from ●─── chord ───● to             s = bulge · chord/2, the arc's height over its chord
//! ```
//!
//! Two end points and a bulge (the word and sign of the DXF format) say every line and every arc of
//! less than a full turn, without the cases a radius has: it cannot contradict the end points, its sign
//! is the turning sense, and 0 needs no special value for "straight".

use crate::geometry::WorldPoint;

/// The directed line or arc from `from` to `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Start.
    pub from: WorldPoint,
    /// End.
    pub to: WorldPoint,
    /// tan(sweep/4); 0 is a line.
    pub bulge: f64,
}

/// The place on a segment nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// The place; on a line possibly before its start or behind its end, on an arc likewise.
    pub point: WorldPoint,
    /// Direction of travel there, radians, not wrapped.
    pub heading_rad: f64,
    /// How far along, as a share of the segment's length: 0 at its start, 1 at its end.
    pub along: f64,
    /// Signed distance of the point, metres, positive to the left of the direction of travel.
    pub cross_track_m: f64,
}

impl Segment {
    /// The straight line between two points.
    pub const fn line(from: WorldPoint, to: WorldPoint) -> Self {
        Self { from, to, bulge: 0.0 }
    }

    /// A line (`bulge` 0) or an arc.
    pub const fn new(from: WorldPoint, to: WorldPoint, bulge: f64) -> Self {
        Self { from, to, bulge }
    }

    /// True for a straight line. Between two ends that coincide no bulge makes an arc: its radius would
    /// be 0, its curvature infinite.
    pub fn is_line(self) -> bool {
        self.bulge == 0.0 || self.from == self.to
    }

    /// Distance between its ends, metres.
    pub fn chord_m(self) -> f64 {
        self.from.distance_m(self.to)
    }

    /// Angle swept, radians, positive to the left; 0 for a line.
    pub fn sweep_rad(self) -> f64 {
        if self.is_line() { 0.0 } else { 4.0 * libm::atan(self.bulge) }
    }

    /// Signed curvature 1/R, 1/m, positive to the left; 0 for a line.
    pub fn curvature_per_m(self) -> f64 {
        if self.is_line() {
            return 0.0;
        }
        4.0 * self.bulge / (self.chord_m() * (1.0 + self.bulge * self.bulge))
    }

    /// Length along the segment, metres.
    pub fn length_m(self) -> f64 {
        if self.is_line() {
            return self.chord_m();
        }
        // sweep/curvature, written so that it does not divide by a small bulge.
        self.chord_m() * (1.0 + self.bulge * self.bulge) * libm::atan(self.bulge) / self.bulge
    }

    /// Centre of the arc; `None` for a line.
    pub fn centre(self) -> Option<WorldPoint> {
        (!self.is_line()).then(|| {
            let (dx, dy) = (self.to.x_m - self.from.x_m, self.to.y_m - self.from.y_m);
            let height = (1.0 - self.bulge * self.bulge) / (4.0 * self.bulge);
            WorldPoint::new(
                0.5 * (self.from.x_m + self.to.x_m) - height * dy,
                0.5 * (self.from.y_m + self.to.y_m) + height * dx,
            )
        })
    }

    /// Direction of travel at its end, radians, in (−π, π] for a line, not wrapped for an arc:
    /// `// [MH18] (6)`, heading of the segment that ends in waypoint k.
    pub fn heading_rad(self) -> f64 {
        let chord = libm::atan2(self.to.y_m - self.from.y_m, self.to.x_m - self.from.x_m);
        if self.is_line() { chord } else { chord + 2.0 * libm::atan(self.bulge) }
    }

    /// Direction of travel at its start, radians, not wrapped.
    pub fn start_heading_rad(self) -> f64 {
        self.heading_rad() - self.sweep_rad()
    }

    /// Signed distance of `point` to the infinite line or the full circle, metres, positive to the left
    /// of the direction of travel. For a segment of no length, the distance to the point.
    pub fn cross_track_m(self, point: WorldPoint) -> f64 {
        if let Some(centre) = self.centre() {
            return self.side_of_circle_m(centre, point);
        }
        let (dx, dy) = (self.to.x_m - self.from.x_m, self.to.y_m - self.from.y_m);
        let length = libm::hypot(dx, dy);
        if length == 0.0 {
            return self.to.distance_m(point);
        }
        (dx * (point.y_m - self.from.y_m) - dy * (point.x_m - self.from.x_m)) / length
    }

    fn side_of_circle_m(self, centre: WorldPoint, point: WorldPoint) -> f64 {
        let inside = self.from.distance_m(centre) - point.distance_m(centre);
        if self.bulge > 0.0 { inside } else { -inside }
    }

    /// The place nearest to `point` on the infinite line or the full circle. Seen from an arc's centre
    /// `along` is counted from the middle of the arc, half a turn either way.
    pub fn nearest(self, point: WorldPoint) -> Station {
        match self.centre() {
            None => self.nearest_on_line(point),
            Some(centre) => self.nearest_on_circle(centre, point),
        }
    }

    fn nearest_on_line(self, point: WorldPoint) -> Station {
        let (dx, dy) = (self.to.x_m - self.from.x_m, self.to.y_m - self.from.y_m);
        let square = dx * dx + dy * dy;
        let along = if square > 0.0 {
            ((point.x_m - self.from.x_m) * dx + (point.y_m - self.from.y_m) * dy) / square
        } else {
            1.0
        };
        Station {
            point: WorldPoint::new(self.from.x_m + along * dx, self.from.y_m + along * dy),
            heading_rad: self.heading_rad(),
            along,
            cross_track_m: self.cross_track_m(point),
        }
    }

    fn nearest_on_circle(self, centre: WorldPoint, point: WorldPoint) -> Station {
        let radius = self.from.distance_m(centre);
        let side = if self.bulge > 0.0 { 1.0 } else { -1.0 };
        // From the centre to the middle of the arc: to the right of the chord for an arc to the left.
        let chord = libm::atan2(self.to.y_m - self.from.y_m, self.to.x_m - self.from.x_m);
        let middle = chord - side * core::f64::consts::FRAC_PI_2;
        let (dx, dy) = (point.x_m - centre.x_m, point.y_m - centre.y_m);
        let turn = crate::geometry::wrap_angle_rad(libm::atan2(dy, dx) - middle);
        let (sin, cos) = libm::sincos(middle + turn);
        Station {
            point: WorldPoint::new(centre.x_m + radius * cos, centre.y_m + radius * sin),
            heading_rad: chord + turn,
            along: 0.5 + turn / self.sweep_rad(),
            cross_track_m: self.side_of_circle_m(centre, point),
        }
    }

    /// The point a share `along` of its length from its start.
    pub fn point_at(self, along: f64) -> WorldPoint {
        let (dx, dy) = (self.to.x_m - self.from.x_m, self.to.y_m - self.from.y_m);
        let Some(centre) = self.centre() else {
            return WorldPoint::new(self.from.x_m + along * dx, self.from.y_m + along * dy);
        };
        let (sin, cos) = libm::sincos(along * self.sweep_rad());
        let (rx, ry) = (self.from.x_m - centre.x_m, self.from.y_m - centre.y_m);
        WorldPoint::new(centre.x_m + cos * rx - sin * ry, centre.y_m + sin * rx + cos * ry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI};
    use proptest::prelude::*;

    const fn point(x: f64, y: f64) -> WorldPoint {
        WorldPoint::new(x, y)
    }

    #[test]
    fn cross_track_is_positive_to_the_left() {
        let line = Segment::line(point(0.0, 0.0), point(2.0, 0.0));
        assert_eq!(line.cross_track_m(point(5.0, 0.25)), 0.25);
        assert_eq!(line.cross_track_m(point(-1.0, -0.5)), -0.5);
        let still = Segment::line(point(1.0, 1.0), point(1.0, 1.0));
        assert_eq!(still.cross_track_m(point(4.0, 5.0)), 5.0);
    }

    #[test]
    fn a_half_circle_to_the_left_by_hand() {
        // From (0, 0) to (0, 2) counter-clockwise about (0, 1): out to x = 1.
        let arc = Segment::new(point(0.0, 0.0), point(0.0, 2.0), 1.0);
        let centre = arc.centre().unwrap();
        assert!(centre.distance_m(point(0.0, 1.0)) < 1e-15);
        assert!((arc.length_m() - PI).abs() < 1e-12 && (arc.curvature_per_m() - 1.0).abs() < 1e-15);
        assert!((arc.start_heading_rad() - 0.0).abs() < 1e-12 && (arc.heading_rad() - PI).abs() < 1e-12);
        let station = arc.nearest(point(1.5, 1.0));
        assert!((station.along - 0.5).abs() < 1e-12 && (station.heading_rad - FRAC_PI_2).abs() < 1e-12);
        assert!((station.cross_track_m + 0.5).abs() < 1e-12, "outside a left turn is to the right");
        assert!(station.point.distance_m(point(1.0, 1.0)) < 1e-12);
        assert!(arc.nearest(point(-0.1, 2.0)).along > 1.0 && arc.nearest(point(-0.1, 0.0)).along < 0.0);
    }

    proptest! {
        #[test]
        fn points_of_a_segment_lie_on_it(
            x in -2.0..2.0f64, y in -2.0..2.0f64, bulge in -2.0..2.0f64, along in 0.0..1.0f64, line: bool,
        ) {
            prop_assume!(libm::hypot(x, y) > 0.01 && bulge.abs() > 1e-3);
            let segment = Segment::new(point(0.3, -0.2), point(0.3 + x, -0.2 + y), if line { 0.0 } else { bulge });
            let on = segment.point_at(along);
            let station = segment.nearest(on);
            prop_assert!((station.along - along).abs() < 1e-9, "{} {along}", station.along);
            prop_assert!(station.cross_track_m.abs() < 1e-12 * segment.length_m().max(1.0) * 10.0);
            prop_assert!(station.point.distance_m(on) < 1e-9);
            // The heading is the direction in which the points move.
            let ahead = segment.point_at(along + 1e-6);
            let moved = libm::atan2(ahead.y_m - on.y_m, ahead.x_m - on.x_m);
            prop_assert!(crate::geometry::wrap_angle_rad(station.heading_rad - moved).abs() < 1e-4);
            prop_assert!((segment.point_at(1.0).distance_m(segment.to)) < 1e-9);
        }

        #[test]
        fn the_left_of_an_arc_is_the_left_of_its_tangent(
            bulge in 0.05..2.0f64, right: bool, along in 0.1..0.9f64, off in -0.05..0.05f64,
        ) {
            let segment = Segment::new(point(0.0, 0.0), point(1.0, 0.4), if right { -bulge } else { bulge });
            let on = segment.nearest(segment.point_at(along));
            let (sin, cos) = libm::sincos(on.heading_rad);
            let beside = point(on.point.x_m - off * sin, on.point.y_m + off * cos);
            let station = segment.nearest(beside);
            prop_assert!((station.cross_track_m - off).abs() < 1e-9);
            prop_assert!((segment.cross_track_m(beside) - off).abs() < 1e-9);
            prop_assert!((station.along - along).abs() < 1e-9);
        }
    }
}
