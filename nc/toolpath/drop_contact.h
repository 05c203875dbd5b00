/* SPDX-License-Identifier: Apache-2.0 */
/* The cutter lowered onto one triangle. */
#ifndef NC_TOOLPATH_DROP_CONTACT_H
#define NC_TOOLPATH_DROP_CONTACT_H

#include "nc/toolpath/terrain.h"

typedef struct {
    double tip_mm;    /* height of the tip; -INFINITY where the triangle is out of reach */
    SegVec3 point;    /* touched; where out of reach, the nearest in (x,y) */
    double rate;      /* the cutter's h' at the point, towards which the tip height rises */
    double beyond_mm; /* by how much the point lies outside the cutter's radius; else 0 */
} NcContact;

/*
 * The highest tip over (x,y) at which the cutter touches the triangle: the maximum over its points
 * p of p.z - h(|p - (x,y)|), both sides of the triangle alike. The height is always computed at the
 * point reported, which lies on the triangle; formulas only say which point that is.
 */
NcContact nc_contact(const NcFacet *facet, NcCutter cutter, double x_mm, double y_mm);

#endif
