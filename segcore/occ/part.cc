/* SPDX-License-Identifier: Apache-2.0 */
/* From a CAD file to the part form: faces, and the stream. Loops are in loops.cc, triangles in
 * tessellate.cc. */
#include "segcore/occ/part.h"

#include <BRepTools.hxx>
#include <BRep_Tool.hxx>
#include <GeomAdaptor_Surface.hxx>
#include <Geom_OffsetSurface.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <Precision.hxx>
#include <Standard_Failure.hxx>
#include <TopoDS.hxx>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>

namespace cad
{

static FaceSurface face_surface(const TopoDS_Face &face);
static SegFace face_record(const FaceSurface &surface, const IgesFace &iges, bool reversed,
                           PartTables &tables);
static std::string serialize(const CadFile &file, double chord_mm, const PartTables &tables);

static std::string face_name(const CadFile &file, int index)
{
    std::string name = file.path + ": face " + std::to_string(index);
    IgesFace iges = iges_face(file, file.face(index));
    if (iges.face.de)
        name += " (IGES " + std::to_string(iges.face.type) + " at D" +
                std::to_string(iges.face.de) + ")";
    return name;
}

std::string part_form(const CadFile &file, double chord_mm, double angle_rad)
{
    std::vector<TopoDS_Face> faces;
    for (int i = 0; i < file.n_faces(); i++)
        faces.push_back(heal(file.face(i)));
    try {
        chord_mm = tessellate(faces, chord_mm, angle_rad);
    } catch (const InputError &error) {
        throw InputError(file.path + ": " + error.what());
    }

    PartTables tables;
    TopTools_IndexedMapOfShape edges;
    std::vector<EdgeCurve> curves;
    for (int i = 0; i < file.n_faces(); i++) {
        try {
            bool reversed = faces[static_cast<size_t>(i)].Orientation() == TopAbs_REVERSED;
            FaceSurface surface = face_surface(faces[static_cast<size_t>(i)]);
            SegFace record = face_record(surface, iges_face(file, file.face(i)), reversed, tables);
            record.first_loop = static_cast<int32_t>(tables.loops.size());
            append_loops(surface, i, edges, curves, tables);
            record.n_loops = static_cast<int32_t>(tables.loops.size()) - record.first_loop;
            record.first_triangle = static_cast<int32_t>(tables.triangles.size());
            if (!append_triangles(surface, i, reversed, tables))
                std::cerr << face_name(file, i) << ": could not be tessellated\n";
            record.n_triangles =
                static_cast<int32_t>(tables.triangles.size()) - record.first_triangle;
            tables.faces.push_back(record);
        } catch (const Standard_Failure &failure) {
            throw InputError(face_name(file, i) + ": " + failure.GetMessageString());
        } catch (const InputError &failure) {
            throw InputError(face_name(file, i) + ": " + failure.what());
        }
    }
    return serialize(file, chord_mm, tables);
}

/* -------------------------------------------------------------------- faces */

static FaceSurface face_surface(const TopoDS_Face &face)
{
    FaceSurface surface;
    surface.face = TopoDS::Face(face.Oriented(TopAbs_FORWARD));
    surface.native = BRep_Tool::Surface(face);
    if (surface.native.IsNull())
        throw InputError("has no surface");
    double u0, u1, v0, v1;
    BRepTools::UVBounds(surface.face, u0, u1, v0, v1);
    for (double bound : {u0, u1, v0, v1})
        if (!std::isfinite(bound) || Precision::IsInfinite(bound))
            throw InputError("has no finite bounds");
    if (!(u1 > u0 && v1 > v0))
        throw InputError("has no extent in its surface's parameters");
    surface.spline = convert(surface.native, u0, u1, v0, v1);
    return surface;
}

static SegSurfaceType surface_type(const Handle(Geom_Surface) & surface)
{
    if (surface->IsKind(STANDARD_TYPE(Geom_OffsetSurface)))
        return SEG_SURFACE_OFFSET;
    switch (GeomAdaptor_Surface(surface).GetType()) {
    case GeomAbs_Plane:
        return SEG_SURFACE_PLANE;
    case GeomAbs_Cylinder:
        return SEG_SURFACE_CYLINDER;
    case GeomAbs_Cone:
        return SEG_SURFACE_CONE;
    case GeomAbs_Sphere:
        return SEG_SURFACE_SPHERE;
    case GeomAbs_Torus:
        return SEG_SURFACE_TORUS;
    case GeomAbs_BezierSurface:
    case GeomAbs_BSplineSurface:
        return SEG_SURFACE_BSPLINE;
    case GeomAbs_SurfaceOfRevolution:
        return SEG_SURFACE_REVOLUTION;
    case GeomAbs_SurfaceOfExtrusion:
        return SEG_SURFACE_EXTRUSION;
    default:
        return SEG_SURFACE_OTHER;
    }
}

static void set_position(SegFace &record, const gp_Ax3 &at)
{
    record.origin = vec(at.Location().XYZ());
    record.axis = vec(at.Direction().XYZ());
    record.x_axis = vec(at.XDirection().XYZ());
}

static void set_elementary(SegFace &record, const GeomAdaptor_Surface &surface)
{
    switch (record.type) {
    case SEG_SURFACE_PLANE: {
        gp_Ax3 at = surface.Plane().Position();
        set_position(record, at);
        if (!at.Direct()) /* the normal is Su × Sv */
            record.axis = vec(at.Direction().Reversed().XYZ());
        break;
    }
    case SEG_SURFACE_CYLINDER:
        set_position(record, surface.Cylinder().Position());
        record.radius_mm = surface.Cylinder().Radius();
        break;
    case SEG_SURFACE_CONE:
        set_position(record, surface.Cone().Position());
        record.radius_mm = surface.Cone().RefRadius();
        record.half_angle_rad = surface.Cone().SemiAngle();
        break;
    case SEG_SURFACE_SPHERE:
        set_position(record, surface.Sphere().Position());
        record.radius_mm = surface.Sphere().Radius();
        break;
    case SEG_SURFACE_TORUS:
        set_position(record, surface.Torus().Position());
        record.radius_mm = surface.Torus().MajorRadius();
        record.minor_radius_mm = surface.Torus().MinorRadius();
        break;
    default:
        break;
    }
}

static SegSurface append_surface(const SplineSurface &spline, std::vector<double> &reals)
{
    SegSurface s = {};
    s.data = static_cast<int64_t>(reals.size());
    s.degree_u = spline.u.degree;
    s.degree_v = spline.v.degree;
    s.n_u = spline.n_u;
    s.n_v = spline.n_v;
    s.rational = spline.rational;
    reals.insert(reals.end(), spline.u.knots.begin(), spline.u.knots.end());
    reals.insert(reals.end(), spline.v.knots.begin(), spline.v.knots.end());
    for (const Pole &p : spline.poles)
        for (size_t k = 0; k < 3; k++)
            reals.push_back(p[k] / p[3]);
    if (spline.rational)
        for (const Pole &p : spline.poles)
            reals.push_back(p[3]);
    return s;
}

SegCurve append_curve(const Spline &spline, int dim, std::vector<double> &reals)
{
    SegCurve c = {};
    c.data = static_cast<int64_t>(reals.size());
    c.degree = spline.degree;
    c.n_poles = static_cast<int32_t>(spline.poles.size());
    c.dim = dim;
    c.rational = spline.rational;
    reals.insert(reals.end(), spline.knots.begin(), spline.knots.end());
    for (const Pole &p : spline.poles)
        for (size_t k = 0; k < static_cast<size_t>(dim); k++)
            reals.push_back(p[k] / p[3]);
    if (spline.rational)
        for (const Pole &p : spline.poles)
            reals.push_back(p[3]);
    return c;
}

static SegFace face_record(const FaceSurface &surface, const IgesFace &iges, bool reversed,
                           PartTables &tables)
{
    SegFace record = {};
    Handle(Geom_Surface) basis = surface.native;
    if (auto trimmed = Handle(Geom_RectangularTrimmedSurface)::DownCast(basis))
        basis = trimmed->BasisSurface();
    record.type = surface_type(basis);
    set_elementary(record, GeomAdaptor_Surface(basis));
    record.surface = append_surface(surface.spline, tables.reals);
    record.reversed = reversed;
    record.iges_type = iges.face.type;
    record.iges_de = iges.face.de;
    record.iges_surface_type = iges.surface.type;
    record.iges_surface_de = iges.surface.de;
    record.first_iges_curve = static_cast<int32_t>(tables.iges_curves.size());
    record.n_iges_curves = static_cast<int32_t>(iges.curves.size());
    for (const IgesEntity &curve : iges.curves)
        tables.iges_curves.push_back({curve.type, curve.de});
    return record;
}

/* ------------------------------------------------------------------- stream */

template <typename Record> static void append(std::string &form, const std::vector<Record> &table)
{
    if (table.size() > SEG_FORM_MAX_COUNT)
        throw InputError("the part has more than " + std::to_string(SEG_FORM_MAX_COUNT) +
                         " entries in one table; ask for a coarser chord");
    form.append(reinterpret_cast<const char *>(table.data()), table.size() * sizeof(Record));
    form.append((8 - form.size() % 8) % 8, '\0');
}

static bool in_range(const PartTables &tables)
{
    auto fits = [](double x) { return std::abs(x) <= SEG_FORM_MAX_REAL; };
    for (const SegVertex &v : tables.vertices)
        for (double x : {v.position.x, v.position.y, v.position.z, v.normal.x, v.normal.y,
                         v.normal.z, v.u, v.v})
            if (!fits(x))
                return false;
    return std::all_of(tables.reals.begin(), tables.reals.end(), fits);
}

static std::string serialize(const CadFile &file, double chord_mm, const PartTables &tables)
{
    if (!in_range(tables))
        throw InputError(file.path + ": its geometry has numbers that are not finite, or absurd");
    SegPartHeader header = {};
    std::memcpy(header.magic, SEG_FORM_MAGIC, sizeof SEG_FORM_MAGIC);
    header.version = SEG_FORM_VERSION;
    header.byte_order = SEG_FORM_BYTE_ORDER;
    header.chord_mm = chord_mm;
    header.unit_mm = file.unit_mm;
    std::memcpy(header.sha256, file.sha256.data(), sizeof header.sha256);
    header.n_faces = static_cast<int64_t>(tables.faces.size());
    header.n_loops = static_cast<int64_t>(tables.loops.size());
    header.n_coedges = static_cast<int64_t>(tables.coedges.size());
    header.n_edges = static_cast<int64_t>(tables.edges.size());
    header.n_iges_curves = static_cast<int64_t>(tables.iges_curves.size());
    header.n_vertices = static_cast<int64_t>(tables.vertices.size());
    header.n_triangles = static_cast<int64_t>(tables.triangles.size());
    header.n_reals = static_cast<int64_t>(tables.reals.size());
    std::string form(reinterpret_cast<const char *>(&header), sizeof header);
    append(form, tables.faces);
    append(form, tables.loops);
    append(form, tables.coedges);
    append(form, tables.edges);
    append(form, tables.iges_curves);
    append(form, tables.vertices);
    append(form, tables.triangles);
    append(form, tables.reals);
    return form;
}

} // namespace cad
