/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What Open CASCADE says of points of B-spline surfaces, by GeomLProp_SLProps, for tests and
 * benches to compare with. Shares no code with segmill. On standard input, in doubles of this
 * machine, any number of surfaces: degree_u n_u degree_v n_v rational; the knots in u, in v, the
 * poles (v fastest), the weights if rational; the number of points, then u v of each. occ_surface
 * out, 31 doubles a point: position, du, dv, duu, duv, dvv, normal, gauss, mean, k_min, k_max,
 * direction of k_min, of k_max; the normal and what follows NaN where there is none, the directions
 * where all are principal occ_surface --time S  evaluates the points of the first surface, all of
 * that, over and over for S seconds, and prints points/s
 */
#include <GeomLProp_SLProps.hxx>
#include <Geom_BSplineSurface.hxx>
#include <Standard_Failure.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColStd_Array2OfReal.hxx>
#include <TColgp_Array2OfPnt.hxx>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <stdexcept>
#include <string>
#include <vector>

static std::vector<double> take(size_t n)
{
    std::vector<double> values(n);
    if (n > 0 && std::fread(values.data(), sizeof(double), n, stdin) != n)
        throw std::runtime_error("the input ends within a surface");
    return values;
}

struct Knots {
    std::vector<double> values;
    std::vector<int> times;

    explicit Knots(const std::vector<double> &flat)
    {
        for (double t : flat) {
            if (values.empty() || t != values.back()) {
                values.push_back(t);
                times.push_back(0);
            }
            times.back()++;
        }
    }
};

static Handle(Geom_BSplineSurface) read_surface(const std::vector<double> &head)
{
    int p = int(head[0]), n_u = int(head[1]), q = int(head[2]), n_v = int(head[3]);
    Knots u(take(size_t(n_u + p + 1))), v(take(size_t(n_v + q + 1)));
    std::vector<double> xyz = take(size_t(3 * n_u * n_v));
    std::vector<double> w = take(head[4] != 0 ? size_t(n_u * n_v) : 0);
    TColgp_Array2OfPnt poles(1, n_u, 1, n_v);
    TColStd_Array2OfReal weights(1, n_u, 1, n_v);
    for (int i = 0; i < n_u; i++)
        for (int j = 0; j < n_v; j++) {
            size_t k = size_t(i * n_v + j);
            poles(i + 1, j + 1) = gp_Pnt(xyz[3 * k], xyz[3 * k + 1], xyz[3 * k + 2]);
            weights(i + 1, j + 1) = w.empty() ? 1 : w[k];
        }
    TColStd_Array1OfReal ku(u.values[0], 1, int(u.values.size()));
    TColStd_Array1OfReal kv(v.values[0], 1, int(v.values.size()));
    TColStd_Array1OfInteger mu(u.times[0], 1, int(u.times.size()));
    TColStd_Array1OfInteger mv(v.times[0], 1, int(v.times.size()));
    if (w.empty())
        return new Geom_BSplineSurface(poles, ku, kv, mu, mv, p, q);
    return new Geom_BSplineSurface(poles, weights, ku, kv, mu, mv, p, q);
}

static void put(double *&out, const gp_XYZ &v)
{
    *out++ = v.X(), *out++ = v.Y(), *out++ = v.Z();
}

static void evaluate(GeomLProp_SLProps &at, double u, double v, bool directions, double out[31])
{
    for (int i = 0; i < 31; i++)
        out[i] = std::nan("");
    at.SetParameters(u, v);
    put(out, at.Value().XYZ());
    put(out, at.D1U().XYZ());
    put(out, at.D1V().XYZ());
    put(out, at.D2U().XYZ());
    put(out, at.DUV().XYZ());
    put(out, at.D2V().XYZ());
    if (!at.IsNormalDefined() || !at.IsCurvatureDefined())
        return;
    put(out, at.Normal().XYZ());
    *out++ = at.GaussianCurvature();
    *out++ = at.MeanCurvature();
    *out++ = at.MinCurvature();
    *out++ = at.MaxCurvature();
    if (!directions || at.IsUmbilic())
        return;
    gp_Dir max, min;
    at.CurvatureDirections(max, min);
    put(out, min.XYZ());
    put(out, max.XYZ());
}

static void measure(const Handle(Geom_BSplineSurface) & surface, const std::vector<double> &uv,
                    double seconds, bool directions)
{
    GeomLProp_SLProps at(surface, 2, 1e-12);
    double out[31], sum = 0, taken = 0, points = 0;
    std::clock_t start = std::clock(); /* the processor's time */
    do {
        for (size_t i = 0; i < uv.size(); i += 2) {
            evaluate(at, uv[i], uv[i + 1], directions, out);
            sum += out[0];
        }
        points += double(uv.size() / 2);
        taken = double(std::clock() - start) / CLOCKS_PER_SEC;
    } while (taken < seconds);
    std::printf("%.17g\n", std::isfinite(sum) ? points / taken : 0.0);
}

static int judge(double seconds, bool directions)
{
    for (double head[5]; std::fread(head, sizeof head, 1, stdin) == 1;) {
        Handle(Geom_BSplineSurface) surface = read_surface(std::vector<double>(head, head + 5));
        std::vector<double> uv = take(size_t(2 * take(1)[0]));
        if (seconds > 0) {
            measure(surface, uv, seconds, directions);
            return 0;
        }
        GeomLProp_SLProps at(surface, 2, 1e-12);
        for (size_t i = 0; i < uv.size(); i += 2) {
            double out[31];
            evaluate(at, uv[i], uv[i + 1], true, out);
            std::fwrite(out, sizeof out, 1, stdout);
        }
    }
    return 0;
}

int main(int argc, char **argv)
{
    bool directions = argc != 4 || std::string(argv[3]) != "--no-directions";
    bool timed = (argc == 3 || !directions) && std::string(argv[1]) == "--time";
    double seconds = timed ? std::atof(argv[2]) : 0;
    if (argc != 1 && !(seconds > 0)) {
        std::fprintf(stderr, "usage: occ_surface [--time SECONDS [--no-directions]] <SURFACES\n");
        return 2;
    }
    try {
        return judge(seconds, directions);
    } catch (const Standard_Failure &failure) {
        std::fprintf(stderr, "occ_surface: %s\n", failure.GetMessageString());
    } catch (const std::exception &failure) {
        std::fprintf(stderr, "occ_surface: %s\n", failure.what());
    }
    return 3;
}
