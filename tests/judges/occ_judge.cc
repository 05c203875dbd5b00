/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What Open CASCADE itself says of a CAD file, for tests to compare with. Shares no code with
 * segmill-cad. Lengths in mm; faces from 0 in the order of TopExp_Explorer, each once.
 *   occ_judge FILE [--eps E]      a line a face: index type area xmin ymin zmin xmax ymax zmax gap:
 *                                 area by BRepGProp (with E as its tolerance), box of the face's
 *                                 EDGES by BRepBndLib::AddOptimal (no triangles, no tolerances;
 *                                 still up to 1e-7 too large), widest gap between the ends of
 *                                 successive (u,v) curves, in space: BRepGProp integrates along
 *                                 them as they are, and errs by up to gap times size
 *   occ_judge --total FILE [--eps E]   faces, area and volume of all
 *   occ_judge --check FILE        "valid" or "invalid" a face by BRepCheck_Analyzer
 *   occ_judge --points FILE FACE  reads "u v" lines (parameters of the original surface), prints
 *                                 x y z nx ny nz k_min k_max: normal of the face's orientation,
 *                                 curvatures positive where the surface bends towards it
 */
#include <BRepBndLib.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepGProp.hxx>
#include <BRepTools_WireExplorer.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <GProp_GProps.hxx>
#include <GeomAdaptor_Surface.hxx>
#include <GeomLProp_SLProps.hxx>
#include <IGESControl_Reader.hxx>
#include <Interface_Static.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPControl_Reader.hxx>
#include <Standard_Failure.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Wire.hxx>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

static TopoDS_Shape load(const std::string &path)
{
    Interface_Static::SetCVal("xstep.cascade.unit", "MM");
    std::string first;
    std::ifstream in(path);
    std::getline(in, first);
    IGESControl_Reader iges;
    STEPControl_Reader step;
    XSControl_Reader *reader = &iges;
    if (first.find("ISO-10303-21") != std::string::npos)
        reader = &step;
    if (reader->ReadFile(path.c_str()) != IFSelect_RetDone)
        throw std::runtime_error(path + ": refused");
    reader->TransferRoots();
    return reader->OneShape();
}

static const char *type_name(const TopoDS_Face &face)
{
    static const char *const names[] = {"plane",     "cylinder", "cone",    "sphere",
                                        "torus",     "bspline",  "bspline", "revolution",
                                        "extrusion", "offset",   "other"};
    return names[GeomAdaptor_Surface(BRep_Tool::Surface(face)).GetType()];
}

static double area(const TopoDS_Shape &shape, double eps)
{
    GProp_GProps properties;
    if (eps > 0)
        BRepGProp::SurfaceProperties(shape, properties, eps);
    else
        BRepGProp::SurfaceProperties(shape, properties);
    return properties.Mass();
}

static void print_box_of_edges(const TopoDS_Face &face)
{
    TopoDS_Compound edges;
    BRep_Builder().MakeCompound(edges);
    for (TopExp_Explorer it(face, TopAbs_EDGE); it.More(); it.Next())
        BRep_Builder().Add(edges, it.Current());
    Bnd_Box box;
    BRepBndLib::AddOptimal(edges, box, false, false);
    double b[6] = {0, 0, 0, 0, 0, 0};
    if (!box.IsVoid())
        box.Get(b[0], b[1], b[2], b[3], b[4], b[5]);
    for (double x : b)
        std::printf(" %.17g", x);
}

static double widest_gap(const TopoDS_Face &face)
{
    Handle(Geom_Surface) surface = BRep_Tool::Surface(face);
    double widest = 0;
    for (TopExp_Explorer wires(face.Oriented(TopAbs_FORWARD), TopAbs_WIRE); wires.More();
         wires.Next()) {
        std::vector<gp_Pnt> ends; /* start and end of each edge in turn */
        TopoDS_Face forward = TopoDS::Face(face.Oriented(TopAbs_FORWARD));
        for (BRepTools_WireExplorer it(TopoDS::Wire(wires.Current()), forward); it.More();
             it.Next()) {
            double a, b;
            Handle(Geom2d_Curve) uv = BRep_Tool::CurveOnSurface(it.Current(), forward, a, b);
            if (uv.IsNull())
                continue;
            if (it.Current().Orientation() == TopAbs_REVERSED)
                std::swap(a, b);
            for (double t : {a, b})
                ends.push_back(surface->Value(uv->Value(t).X(), uv->Value(t).Y()));
        }
        for (size_t i = 1; i < ends.size(); i += 2)
            widest = std::max(widest, ends[i].Distance(ends[(i + 1) % ends.size()]));
    }
    return widest;
}

static void print_points(const TopoDS_Face &face)
{
    Handle(Geom_Surface) surface = BRep_Tool::Surface(face);
    double sign = face.Orientation() == TopAbs_REVERSED ? -1 : 1;
    for (double u, v; std::scanf("%lf %lf", &u, &v) == 2;) {
        GeomLProp_SLProps at(surface, u, v, 2, 1e-12);
        gp_Pnt p = at.Value();
        std::printf("%.17g %.17g %.17g", p.X(), p.Y(), p.Z());
        if (at.IsNormalDefined() && at.IsCurvatureDefined()) {
            gp_XYZ n = at.Normal().XYZ() * sign;
            double a = sign * at.MinCurvature(), b = sign * at.MaxCurvature();
            std::printf(" %.17g %.17g %.17g %.17g %.17g\n", n.X(), n.Y(), n.Z(), std::min(a, b),
                        std::max(a, b));
        } else {
            std::printf(" undefined\n");
        }
    }
}

static int judge(const std::string &mode, const std::string &path, const std::string &argument,
                 double eps)
{
    TopoDS_Shape shape = load(path);
    TopTools_IndexedMapOfShape faces;
    TopExp::MapShapes(shape, TopAbs_FACE, faces);
    if (mode == "--total") {
        GProp_GProps volume;
        BRepGProp::VolumeProperties(shape, volume);
        double sum = 0;
        for (int i = 1; i <= faces.Extent(); i++)
            sum += area(faces(i), eps);
        std::printf("%d %.17g %.17g\n", faces.Extent(), sum, volume.Mass());
        return 0;
    }
    if (mode == "--points") {
        int index = std::atoi(argument.c_str());
        if (index < 0 || index >= faces.Extent())
            throw std::runtime_error(argument + ": no such face");
        print_points(TopoDS::Face(faces(index + 1)));
        return 0;
    }
    for (int i = 1; i <= faces.Extent(); i++) {
        const TopoDS_Face &face = TopoDS::Face(faces(i));
        if (mode == "--check") {
            std::printf("%d %s\n", i - 1, BRepCheck_Analyzer(face).IsValid() ? "valid" : "invalid");
            continue;
        }
        std::printf("%d %s %.17g", i - 1, type_name(face), area(face, eps));
        print_box_of_edges(face);
        std::printf(" %.3g\n", widest_gap(face));
    }
    return 0;
}

int main(int argc, char **argv)
{
    std::vector<std::string> arguments(argv + 1, argv + argc);
    std::string mode;
    double eps = 0;
    for (size_t i = 0; i < arguments.size();) {
        auto at = arguments.begin() + static_cast<long>(i);
        if (arguments[i] == "--eps" && i + 1 < arguments.size()) {
            eps = std::atof(arguments[i + 1].c_str());
            arguments.erase(at, at + 2);
        } else if (arguments[i].rfind("--", 0) == 0) {
            mode = arguments[i];
            arguments.erase(at);
        } else {
            i++;
        }
    }
    bool known = mode.empty() || mode == "--total" || mode == "--check" || mode == "--points";
    if (!known || arguments.size() != (mode == "--points" ? 2u : 1u)) {
        std::fprintf(stderr, "usage: occ_judge [--total | --check | --points] FILE [FACE] "
                             "[--eps E]\n");
        return 2;
    }
    Message::DefaultMessenger()->ChangePrinters().Clear();
    try {
        return judge(mode, arguments[0], arguments.size() > 1 ? arguments[1] : "", eps);
    } catch (const Standard_Failure &failure) {
        std::fprintf(stderr, "%s: %s\n", arguments[0].c_str(), failure.GetMessageString());
    } catch (const std::exception &failure) {
        std::fprintf(stderr, "%s\n", failure.what());
    }
    return 3;
}
