/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Open CASCADE's curves and surfaces as B-splines, exactly where they are rational.
 *
 * A circle has no rational parametrisation by its angle. Everything round is therefore written as
 * rational quadratic arcs over the quarters of the full turn, [0, 90°], [90°, 180°] and so on, and
 * its B-spline parameter is arc_parameter(angle): one fixed function, the same for every circle,
 * cylinder, cone, sphere, torus and surface of revolution. All other parameters stay as they are.
 */
#ifndef SEGCORE_OCC_NURBS_H
#define SEGCORE_OCC_NURBS_H

#include <Geom2d_Curve.hxx>
#include <Geom_Curve.hxx>
#include <Geom_Surface.hxx>
#include <array>
#include <functional>
#include <gp_XYZ.hxx>
#include <vector>

namespace cad
{

/* (w·x, w·y, w·z, w). */
using Pole = std::array<double, 4>;

struct Spline {
    int degree = 0;
    std::vector<double> knots;
    std::vector<Pole> poles;
    bool rational = false;
    bool angular = false; /* its parameter is arc_parameter of the original curve's */
};

struct SplineSurface {
    Spline u, v;             /* degrees, knots and angular; their poles are not used */
    std::vector<Pole> poles; /* v running fastest */
    int n_u = 0, n_v = 0;
    bool rational = false;
};

/* The parameter of the quarter arcs at an angle, and back; both monotone, equal at every 45°. */
double arc_parameter(double angle);
double arc_angle(double parameter);

/* A parameter of the original as the spline's, and back. */
double to_spline(const Spline &spline, double parameter);
double from_spline(const Spline &spline, double parameter);

/* The curve over at least [first, last] of its own parameter. */
Spline convert(const Handle(Geom_Curve) & curve, double first, double last);
Spline convert(const Handle(Geom2d_Curve) & curve, double first, double last);

/* The surface over at least [u0, u1] × [v0, v1] of its own parameters. Throws Standard_Failure
 * where it cannot be approximated. */
SplineSurface convert(const Handle(Geom_Surface) & surface, double u0, double u1, double v0,
                      double v1);

/* The distance in space, in mm, between what a curve should be at t and the given point. */
using Deviation = std::function<double(double t, const gp_XYZ &point)>;

/*
 * A polynomial spline through f over the ascending `breaks` (both ends included; f is smooth
 * between them) that keeps `deviation` within `tolerance_mm`: a straight line where that does, else
 * pieces of degree 7, halved as often as needed.
 */
Spline fit(const std::function<gp_XYZ(double)> &f, const Deviation &deviation,
           const std::vector<double> &breaks, double tolerance_mm);

} // namespace cad

#endif
