/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/contacts.h"

#include <stdlib.h>

static int compare(double a, double b)
{
    return (a > b) - (a < b);
}

/* The longest first, and of equal ones always the same. */
static int by_block(const void *a, const void *b)
{
    const NcContact *p = a, *q = b;
    int order = (p->cut > q->cut) - (p->cut < q->cut);
    if (order == 0)
        order = p->kind - q->kind;
    if (order == 0)
        order = p->rubs - q->rubs;
    if (order == 0)
        order = p->axis - q->axis;
    if (order == 0)
        order = compare(q->length_mm, p->length_mm);
    if (order == 0)
        order = compare(p->position.x, q->position.x);
    if (order == 0)
        order = compare(p->position.y, q->position.y);
    return order ? order : compare(p->position.z, q->position.z);
}

void nc_contacts_merge(GArray *contacts)
{
    guint kept = 0;
    g_array_sort(contacts, by_block);
    for (guint i = 0; i < contacts->len; i++) {
        NcContact *c = &g_array_index(contacts, NcContact, i);
        NcContact *last = kept > 0 ? &g_array_index(contacts, NcContact, kept - 1) : NULL;
        if (!last || last->cut != c->cut || last->kind != c->kind || last->rubs != c->rubs ||
            last->axis != c->axis)
            g_array_index(contacts, NcContact, kept++) = *c;
    }
    g_array_set_size(contacts, kept);
}

typedef struct {
    NcCollision collision;
    bool rubs;
} Found;

static int by_line(const void *a, const void *b)
{
    const Found *found = a, *other = b;
    const NcCollision *p = &found->collision, *q = &other->collision;
    int order = (p->line > q->line) - (p->line < q->line);
    if (order == 0)
        order = (int)p->kind - (int)q->kind;
    if (order == 0)
        order = found->rubs - other->rubs;
    return order ? order : compare(q->depth_mm, p->depth_mm);
}

void nc_contacts_collisions(const GArray *contacts, const NcStock *stock, GArray *collisions)
{
    g_autoptr(GArray) found = g_array_new(FALSE, FALSE, sizeof(Found));
    for (guint i = 0, next; i < contacts->len; i = next) {
        const NcContact *first = &g_array_index(contacts, NcContact, i), *least = first;
        for (next = i + 1; next < contacts->len; next++) {
            const NcContact *c = &g_array_index(contacts, NcContact, next);
            if (c->cut != first->cut || c->kind != first->kind || c->rubs != first->rubs)
                break;
            if (c->length_mm < least->length_mm)
                least = c;
        }
        Found one = {{(NcCollisionKind)first->kind, stock->cuts[first->cut].line, least->position,
                      least->length_mm},
                     first->rubs};
        g_array_append_val(found, one);
    }
    g_array_sort(found, by_line);
    for (guint i = 0; i < found->len; i++) {
        const Found *f = &g_array_index(found, Found, i);
        const NcCollision *c = &f->collision;
        if (i == 0 || f[-1].collision.line != c->line || f[-1].collision.kind != c->kind)
            g_array_append_vals(collisions, c, 1);
    }
}

const char *nc_collision_name(NcCollisionKind kind)
{
    static const char *const names[] = {"rapid", "holder", "shank", "spindle"};
    return names[kind];
}
