/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/occ/cad_file.h"

#include <IGESData_IGESModel.hxx>
#include <Interface_InterfaceModel.hxx>
#include <Interface_Static.hxx>
#include <STEPConstruct_UnitContext.hxx>
#include <StepGeom_GeomRepContextAndGlobUnitAssCtxAndGlobUncertaintyAssCtx.hxx>
#include <StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext.hxx>
#include <StepRepr_GlobalUnitAssignedContext.hxx>
#include <TopAbs_ShapeEnum.hxx>
#include <TopExp.hxx>
#include <TopoDS.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <glib.h>
#include <sys/stat.h>

namespace cad
{

enum class Format { iges, step };

static std::string read_bytes(const std::string &path);
static Format format_of(const std::string &path, const std::string &bytes);
static std::string sha256_of(const std::string &bytes);
static TopoDS_Shape read_iges(CadFile &file);
static TopoDS_Shape read_step(CadFile &file);

CadFile read_cad_file(const std::string &path)
{
    CadFile file;
    file.path = path;
    std::string bytes = read_bytes(path);
    Format format = format_of(path, bytes);
    file.sha256 = sha256_of(bytes);
    Interface_Static::SetCVal("xstep.cascade.unit", "MM");
    TopoDS_Shape shape = format == Format::iges ? read_iges(file) : read_step(file);
    if (!shape.IsNull())
        TopExp::MapShapes(shape, TopAbs_FACE, file.faces);
    if (file.n_faces() == 0)
        throw InputError(path + ": holds no face; export the part with its surfaces");
    return file;
}

TopoDS_Face CadFile::face(int index) const
{
    return TopoDS::Face(faces(index + 1));
}

static std::string read_bytes(const std::string &path)
{
    struct stat info;
    if (stat(path.c_str(), &info) != 0)
        throw InputError(path + ": " + std::strerror(errno));
    if (!S_ISREG(info.st_mode))
        throw InputError(path + ": is not a regular file");
    if (info.st_size == 0)
        throw InputError(path + ": is empty");
    std::string bytes(static_cast<size_t>(info.st_size), '\0');
    std::ifstream in(path, std::ios::binary);
    in.read(&bytes[0], static_cast<std::streamsize>(bytes.size()));
    if (!in)
        throw InputError(path + ": cannot be read: " + std::strerror(errno));
    return bytes;
}

/* ISO 10303-21 opens with its name; IGES (5.3, 2.2.4) has 80 columns, the section's letter in the
 * 73rd, the sequence number behind it. */
static Format format_of(const std::string &path, const std::string &bytes)
{
    size_t start = bytes.find_first_not_of(" \t\r\n");
    if (start != std::string::npos && bytes.compare(start, 12, "ISO-10303-21") == 0)
        return Format::step;
    std::string line = bytes.substr(0, bytes.find_first_of("\r\n"));
    if (line.size() >= 80 && std::strchr("BC", line[72]) &&
        line.find_first_not_of(" 0123456789", 73) == std::string::npos)
        throw InputError(path + ": IGES in binary or compressed form is not read; export it as "
                                "plain (ASCII) IGES");
    if (line.size() != 80 || line[72] != 'S')
        throw InputError(path + ": is neither STEP (ISO-10303-21 at its start) nor IGES (lines of "
                                "80 columns, S in column 73 of the first)");
    return Format::iges;
}

static std::string sha256_of(const std::string &bytes)
{
    g_autofree char *hex = g_compute_checksum_for_string(G_CHECKSUM_SHA256, bytes.data(),
                                                         static_cast<gssize>(bytes.size()));
    return hex;
}

static std::string status_text(IFSelect_ReturnStatus status)
{
    switch (status) {
    case IFSelect_RetVoid:
        return "there is nothing in it";
    case IFSelect_RetError:
        return "the file does not follow its format";
    case IFSelect_RetFail:
        return "the reader gave up";
    default:
        return "the reader was stopped";
    }
}

static TopoDS_Shape read_iges(CadFile &file)
{
    file.iges = std::make_unique<IGESControl_Reader>();
    IGESControl_Reader &reader = *file.iges;
    IFSelect_ReturnStatus status = reader.ReadFile(file.path.c_str());
    if (status != IFSelect_RetDone)
        throw InputError(file.path + ": IGES cannot be read: " + status_text(status));
    if (reader.NbRootsForTransfer() == 0)
        throw InputError(file.path + ": IGES without an entity");
    double unit = reader.IGESModel()->GlobalSection().UnitValue();
    file.unit_mm = std::isfinite(unit) && unit > 0 ? unit : 1;
    reader.TransferRoots();
    return reader.OneShape();
}

/* One unit of the file in mm: the first context that names a length unit. */
static double step_unit_mm(const Handle(Interface_InterfaceModel) & model)
{
    for (int i = 1; i <= model->NbEntities(); i++) {
        Handle(Standard_Transient) entity = model->Value(i);
        Handle(StepRepr_GlobalUnitAssignedContext) units;
        if (auto with = Handle(
                StepGeom_GeomRepContextAndGlobUnitAssCtxAndGlobUncertaintyAssCtx)::DownCast(entity))
            units = with->GlobalUnitAssignedContext();
        else if (auto plain =
                     Handle(StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext)::
                         DownCast(entity))
            units = plain->GlobalUnitAssignedContext();
        STEPConstruct_UnitContext context;
        if (!units.IsNull() && context.ComputeFactors(units) == 0 && context.LengthDone() &&
            std::isfinite(context.LengthFactor()) && context.LengthFactor() > 0)
            return context.LengthFactor();
    }
    return 1;
}

static TopoDS_Shape read_step(CadFile &file)
{
    STEPControl_Reader reader;
    IFSelect_ReturnStatus status = reader.ReadFile(file.path.c_str());
    if (status != IFSelect_RetDone)
        throw InputError(file.path + ": STEP cannot be read: " + status_text(status));
    if (reader.NbRootsForTransfer() == 0)
        throw InputError(file.path + ": STEP without a shape");
    file.unit_mm = step_unit_mm(reader.WS()->Model());
    reader.TransferRoots();
    return reader.OneShape();
}

} // namespace cad
