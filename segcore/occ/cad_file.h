/* SPDX-License-Identifier: Apache-2.0 */
/* A CAD file as Open CASCADE understands it: its faces in order, in mm. */
#ifndef SEGCORE_OCC_CAD_FILE_H
#define SEGCORE_OCC_CAD_FILE_H

#include <IGESControl_Reader.hxx>
#include <STEPControl_Reader.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS_Face.hxx>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace cad
{

/* What ends in exit status 3: a file, or an entity in it, that is not usable. */
struct InputError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct CadFile {
    std::string path;
    std::string sha256; /* lower-case hex */
    double unit_mm = 1; /* one unit of the file */

    /* Every face once (IsSame), in the order of TopExp_Explorer over the whole file; the part
     * form, --faces and everything that is printed count them so, from 0. */
    TopTools_IndexedMapOfShape faces;

    std::unique_ptr<IGESControl_Reader> iges; /* set for an IGES file */

    TopoDS_Face face(int index) const; /* from 0 */
    int n_faces() const
    {
        return faces.Extent();
    }
};

/* Reads IGES or STEP, told by content. Throws InputError. */
CadFile read_cad_file(const std::string &path);

/* Entity numbers of an IGES face: directory entry numbers as in the file (odd); 0 is none. */
struct IgesEntity {
    int type = 0, de = 0;
};
struct IgesFace {
    IgesEntity face, surface;
    std::vector<IgesEntity> curves; /* 142, 102, 126, … of its boundary in file order */
};
IgesFace iges_face(const CadFile &file, const TopoDS_Face &face);

} // namespace cad

#endif
