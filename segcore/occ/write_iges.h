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

/* Writes the faces as IGES (trimmed surfaces 144, mm), beside `out` and renamed. The bytes depend
 * on the faces alone: no date, name or path. Throws InputError; std::runtime_error on writing. */
void write_iges(const CadFile &file, const std::vector<int> &faces, const std::string &out);

} // namespace cad

#endif
