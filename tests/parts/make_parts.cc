/* SPDX-License-Identifier: Apache-2.0 */
/* make_parts FOLDER: writes every test part into FOLDER; the same bytes each time. */
#include "segcore/occ/write_iges.h"
#include "tests/parts/parts.h"

#include <APIHeaderSection_MakeHeader.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <STEPControl_Writer.hxx>
#include <Standard_Failure.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp.hxx>
#include <iostream>

static void save_igs(const TopoDS_Shape &shape, const char *unit, const std::string &path)
{
    TopTools_IndexedMapOfShape faces;
    TopExp::MapShapes(shape, TopAbs_FACE, faces);
    cad::save_iges(faces, unit, path);
}

static void save_step(const TopoDS_Shape &shape, const std::string &path)
{
    STEPControl_Writer writer;
    if (writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone)
        throw std::runtime_error(path + ": cannot be translated");
    APIHeaderSection_MakeHeader header(writer.Model());
    header.SetTimeStamp(new TCollection_HAsciiString("2000-01-01T00:00:00"));
    header.SetName(new TCollection_HAsciiString("segmill test part"));
    if (writer.Write(path.c_str()) != IFSelect_RetDone)
        throw std::runtime_error(path + ": cannot be written");
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        std::cerr << "usage: make_parts FOLDER\n";
        return 2;
    }
    std::string folder = std::string(argv[1]) + "/";
    Message::DefaultMessenger()->ChangePrinters().Clear();
    try {
        save_igs(make_p0_piece(), "MM", folder + "p0_piece.igs");
        save_igs(make_impeller(), "MM", folder + "impeller.igs");
        save_igs(make_blade(), "MM", folder + "blade.igs");
        TopoDS_Shape analytic = make_analytic();
        save_igs(analytic, "MM", folder + "analytic.igs");
        save_igs(analytic, "INCH", folder + "analytic_inch.igs");
        save_igs(analytic, "M", folder + "analytic_metre.igs");
        save_step(analytic, folder + "analytic.step");
    } catch (const Standard_Failure &failure) {
        std::cerr << "make_parts: " << failure.DynamicType()->Name() << ": "
                  << failure.GetMessageString() << "\n";
        return 1;
    } catch (const std::exception &failure) {
        std::cerr << "make_parts: " << failure.what() << "\n";
        return 1;
    }
    return 0;
}
