/* SPDX-License-Identifier: Apache-2.0 */
/* Adaptive piecewise interpolation; see nurbs.h. */
#include "segcore/occ/nurbs.h"

#include <cmath>
#include <math_Matrix.hxx>

namespace cad
{

static const int kDegree = 7;
static const int kMaxHalvings = 12;

struct Fitting {
    const std::function<gp_XYZ(double)> &f;
    const Deviation &deviation;
    double tolerance_mm;
    Spline result;
};

static bool fit_line(Fitting &fitting, const std::vector<double> &breaks);
static void fit_piece(Fitting &fitting, double a, double b, int halvings);

Spline fit(const std::function<gp_XYZ(double)> &f, const Deviation &deviation,
           const std::vector<double> &breaks, double tolerance_mm)
{
    Fitting fitting = {f, deviation, tolerance_mm, {}};
    if (fit_line(fitting, breaks))
        return fitting.result;
    fitting.result.degree = kDegree;
    fitting.result.knots.push_back(breaks.front());
    for (size_t i = 0; i + 1 < breaks.size(); i++)
        fit_piece(fitting, breaks[i], breaks[i + 1], 0);
    fitting.result.knots.insert(fitting.result.knots.end(), kDegree + 1, breaks.back());
    return fitting.result;
}

static Pole plain(const gp_XYZ &p)
{
    return {p.X(), p.Y(), p.Z(), 1};
}

static bool fit_line(Fitting &fitting, const std::vector<double> &breaks)
{
    double a = breaks.front(), b = breaks.back();
    gp_XYZ from = fitting.f(a), to = fitting.f(b);
    auto near = [&](double t) {
        gp_XYZ p = from + (to - from) * ((t - a) / (b - a));
        return fitting.deviation(t, p) <= fitting.tolerance_mm;
    };
    const int samples = 13;
    for (int i = 1; i < samples; i++)
        if (!near(a + (b - a) * i / samples))
            return false;
    for (double t : breaks)
        if (!near(t))
            return false;
    fitting.result.degree = 1;
    fitting.result.knots = {a, a, b, b};
    fitting.result.poles = {plain(from), plain(to)};
    return true;
}

/* Chebyshev–Lobatto points of [0, 1]. */
static double node(int i)
{
    return (1 - std::cos(M_PI * i / kDegree)) / 2;
}

static double bernstein(int i, double t)
{
    double value = 1;
    for (int k = 0; k < i; k++)
        value *= t * (kDegree - k) / (k + 1);
    return value * std::pow(1 - t, kDegree - i);
}

/* From values at the nodes to Bézier poles. */
static const math_Matrix &interpolation()
{
    static const math_Matrix inverse = [] {
        math_Matrix m(0, kDegree, 0, kDegree);
        for (int i = 0; i <= kDegree; i++)
            for (int j = 0; j <= kDegree; j++)
                m(i, j) = bernstein(j, node(i));
        return m.Inverse();
    }();
    return inverse;
}

static void fit_piece(Fitting &fitting, double a, double b, int halvings)
{
    gp_XYZ values[kDegree + 1], poles[kDegree + 1];
    for (int i = 0; i <= kDegree; i++)
        values[i] = fitting.f(a + (b - a) * node(i));
    for (int i = 1; i < kDegree; i++)
        for (int j = 0; j <= kDegree; j++)
            poles[i] += values[j] * interpolation()(i, j);
    poles[0] = values[0];
    poles[kDegree] = values[kDegree];

    for (int i = 0; i < kDegree && halvings < kMaxHalvings; i++) {
        double t = (node(i) + node(i + 1)) / 2;
        gp_XYZ p;
        for (int j = 0; j <= kDegree; j++)
            p += poles[j] * bernstein(j, t);
        if (fitting.deviation(a + (b - a) * t, p) <= fitting.tolerance_mm)
            continue;
        double middle = (a + b) / 2;
        fit_piece(fitting, a, middle, halvings + 1);
        fit_piece(fitting, middle, b, halvings + 1);
        return;
    }
    Spline &result = fitting.result;
    result.knots.insert(result.knots.end(), kDegree, a);
    if (result.poles.empty())
        result.poles.push_back(plain(poles[0]));
    for (int i = 1; i <= kDegree; i++)
        result.poles.push_back(plain(poles[i]));
}

} // namespace cad
