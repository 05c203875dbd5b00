/* SPDX-License-Identifier: Apache-2.0 */
#include "segcore/occ/write_iges.h"

#include <IGESControl_Controller.hxx>
#include <IGESControl_Writer.hxx>
#include <IGESData_GlobalSection.hxx>
#include <IGESData_IGESModel.hxx>
#include <TCollection_HAsciiString.hxx>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>
#include <iterator>
#include <unistd.h>

namespace cad
{

static const double kResolution_mm = 1e-5;

static void fix_global_section(const Handle(IGESData_IGESModel) & model);

std::vector<int> parse_faces(const std::string &list)
{
    std::string text = list;
    if (list == "-") {
        text.assign(std::istreambuf_iterator<char>(std::cin), {});
    } else if (!list.empty() && list[0] == '@') {
        std::ifstream in(list.substr(1));
        if (!in)
            throw InputError(list.substr(1) + ": " + std::strerror(errno));
        text.assign(std::istreambuf_iterator<char>(in), {});
    }
    std::vector<int> faces;
    const char separators[] = ", \t\r\n";
    for (size_t at = text.find_first_not_of(separators); at != std::string::npos;) {
        size_t end = text.find_first_of(separators, at);
        std::string word = text.substr(at, end == std::string::npos ? end : end - at);
        if (word.size() > 9 || word.find_first_not_of("0123456789") != std::string::npos)
            throw InputError("face list: '" + word + "' is not a face number (0, 1, 2 …)");
        faces.push_back(std::stoi(word));
        at = text.find_first_not_of(separators, end);
    }
    if (faces.empty())
        throw InputError("face list: no face is named");
    return faces;
}

void write_iges(const CadFile &file, const std::vector<int> &faces, const std::string &out)
{
    TopTools_IndexedMapOfShape shapes;
    for (int index : faces) {
        if (index >= file.n_faces())
            throw InputError(file.path + ": face " + std::to_string(index) +
                             " does not exist: there are " + std::to_string(file.n_faces()) +
                             ", counted from 0");
        shapes.Add(file.face(index));
    }
    save_iges(shapes, "MM", out);
}

void save_iges(const TopTools_IndexedMapOfShape &shapes, const char *unit, const std::string &out)
{
    IGESControl_Controller::Init();
    IGESControl_Writer writer(unit, 0);
    for (int i = 1; i <= shapes.Extent(); i++)
        if (!writer.AddShape(shapes(i)))
            throw InputError(out + ": shape " + std::to_string(i - 1) +
                             " of those asked for cannot be written as IGES");
    fix_global_section(writer.Model());
    writer.ComputeModel();

    std::string beside = out + ".part" + std::to_string(getpid());
    bool done = writer.Write(beside.c_str()) && std::rename(beside.c_str(), out.c_str()) == 0;
    if (!done) {
        int error = errno;
        unlink(beside.c_str());
        throw std::runtime_error(out + ": cannot be written: " + std::strerror(error));
    }
}

static Handle(TCollection_HAsciiString) text(const char *value)
{
    return new TCollection_HAsciiString(value);
}

/* What Open CASCADE would take from the clock and the machine. And from the faces' tolerances: a
 * reader closes gaps up to the resolution, which may tilt whole edges. */
static void fix_global_section(const Handle(IGESData_IGESModel) & model)
{
    IGESData_GlobalSection global = model->GlobalSection();
    global.SetSendName(text("segmill"));
    global.SetReceiveName(text("segmill"));
    global.SetFileName(text("faces.igs"));
    global.SetSystemId(text("segmill"));
    global.SetInterfaceVersion(text("segmill"));
    global.SetDate(text("20000101.000000"));
    global.SetLastChangeDate(text("20000101.000000"));
    global.SetResolution(kResolution_mm / global.UnitValue());
    global.SetAuthorName(text(""));
    global.SetCompanyName(text(""));
    model->SetGlobalSection(global);
}

} // namespace cad
