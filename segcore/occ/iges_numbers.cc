/* SPDX-License-Identifier: Apache-2.0 */
/* Which IGES entities a face came from. */
#include "segcore/occ/cad_file.h"

#include <IGESData_IGESEntity.hxx>
#include <IGESData_IGESModel.hxx>
#include <IGESSolid_EdgeList.hxx>
#include <IGESSolid_Face.hxx>
#include <IGESSolid_Loop.hxx>
#include <Interface_EntityIterator.hxx>
#include <Interface_Graph.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <map>
#include <set>

namespace cad
{

using Entity = Handle(IGESData_IGESEntity);

/* A face's curves by directory entry number, so in file order. */
struct Curves {
    std::map<int, int> types;
    std::set<int> seen; /* every entity met: a damaged file may hold a circle of them */
};

static void collect(const CadFile &file, const Entity &entity, IgesFace &face, Curves &curves);

IgesFace iges_face(const CadFile &file, const TopoDS_Face &face)
{
    IgesFace result;
    if (!file.iges)
        return result;
    /* Mode 1 looks among sub-transfers too; it knows nearly every face, and no other mode is safe
     * with several roots. */
    auto entity =
        Entity::DownCast(file.iges->WS()->TransferReader()->EntityFromShapeResult(face, 1));
    if (entity.IsNull())
        return result;
    Curves curves;
    collect(file, entity, result, curves);
    for (const auto &curve : curves.types)
        result.curves.push_back({curve.second, curve.first});
    return result;
}

static IgesEntity number_of(const CadFile &file, const Entity &entity)
{
    return {entity->TypeNumber(), 2 * file.iges->IGESModel()->Number(entity) - 1};
}

static bool is_surface(int type)
{
    return type == 108 || type == 114 || type == 118 || type == 120 || type == 122 || type == 128 ||
           type == 140 || (type >= 190 && type <= 198);
}

static bool is_bounded(int type)
{
    return type == 143 || type == 144 || type == 510;
}

static bool is_curve(int type)
{
    return (type >= 100 && type <= 112 && type != 108) || type == 126 || type == 130 ||
           type == 141 || type == 142 || type == 508;
}

/* A loop (508) names its curves by an index into an edge list (504) that many loops share. */
static void collect_loop(const CadFile &file, const Handle(IGESSolid_Loop) & loop, IgesFace &face,
                         Curves &curves)
{
    for (int i = 1; i <= loop->NbEdges(); i++) {
        auto edges = Handle(IGESSolid_EdgeList)::DownCast(loop->Edge(i));
        int index = loop->ListIndex(i);
        if (!edges.IsNull() && index >= 1 && index <= edges->NbEdges())
            collect(file, edges->Curve(index), face, curves);
        for (int k = 1; k <= loop->NbParameterCurves(i); k++)
            collect(file, loop->ParametricCurve(i, k), face, curves);
    }
}

/* Walks down from the face's entity: the first surface met is the face's; a surface's own
 * generators are not the face's curves. */
static void collect(const CadFile &file, const Entity &entity, IgesFace &face, Curves &curves)
{
    if (entity.IsNull() || file.iges->IGESModel()->Number(entity) == 0)
        return;
    IgesEntity number = number_of(file, entity);
    if (!curves.seen.insert(number.de).second)
        return;
    if (face.face.de == 0)
        face.face = number;
    if (is_surface(number.type)) {
        if (face.surface.de == 0)
            face.surface = number;
        return;
    }
    if (is_curve(number.type))
        curves.types[number.de] = number.type;
    else if (!is_bounded(number.type))
        return;
    if (auto loop = Handle(IGESSolid_Loop)::DownCast(entity)) {
        collect_loop(file, loop, face, curves);
        return;
    }
    const Interface_Graph &graph = file.iges->WS()->Graph();
    for (Interface_EntityIterator it = graph.Shareds(entity); it.More(); it.Next())
        collect(file, Entity::DownCast(it.Value()), face, curves);
}

} // namespace cad
