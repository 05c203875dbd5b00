/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SEGCORE_OCC_WRITE_IGES_H
#define SEGCORE_OCC_WRITE_IGES_H

#include "segcore/occ/cad_file.h"

#include <string>
#include <vector>

namespace cad
{

/* "0,3,5"; "@FILE" a file of numbers; "-" standard input. Numbers are separated by commas or
 * white space. Throws InputError. */
std::vector<int> parse_faces(const std::string &list);

/* Writes the faces in mm. Throws as save_iges; a number that the file does not have is an
 * InputError. */
void write_iges(const CadFile &file, const std::vector<int> &faces, const std::string &out);

/* Writes shapes, whose lengths are in mm, as IGES trimmed surfaces (144) in `unit` ("MM", "INCH",
 * "M"), beside `out` and renamed. The bytes depend on the shapes alone: no date, name or path.
 * Throws InputError; std::runtime_error on writing. */
void save_iges(const TopTools_IndexedMapOfShape &shapes, const char *unit, const std::string &out);

} // namespace cad

#endif
