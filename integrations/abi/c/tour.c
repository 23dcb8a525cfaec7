/* Opens a world, stands in the middle of each room, and tells what is in view and what a closed door hides.
 *
 *     cc tour.c -I ../include -L ../target/release -lenfilade_abi -o tour && ./tour world.glb
 */
#include <stdio.h>
#include <stdlib.h>

#include "enfilade.h"

static unsigned char *read_file(const char *path, size_t *n) {
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) return NULL;
    *n = (size_t)ftell(file);
    rewind(file);
    unsigned char *bytes = malloc(*n ? *n : 1);
    if (bytes && fread(bytes, 1, *n, file) != *n) *n = 0;
    fclose(file);
    return bytes;
}

int main(int n_arguments, char **arguments) {
    size_t n = 0;
    unsigned char *bytes = n_arguments == 2 ? read_file(arguments[1], &n) : NULL;
    if (!bytes) {
        fprintf(stderr, "usage: tour WORLD.glb\n");
        return 2;
    }
    EnfWorld *world = enf_open(bytes, n);
    free(bytes);
    if (!world) {
        fprintf(stderr, "%s: %s\n", arguments[1], enf_last_error());
        return 1;
    }
    int n_cells = enf_count(world, ENF_CELLS);
    printf("%d cells, %d portals\n", n_cells, enf_count(world, ENF_PORTALS));
    for (int i = 0; i < n_cells; i++) {
        EnfCell cell;
        enf_cell(world, (uint32_t)i, &cell);
        float eye[3];
        for (int k = 0; k < 3; k++) eye[k] = (cell.aabb[k] + cell.aabb[k + 3]) / 2;
        /* The middle of the box of an L-shaped room may be in another one, or in a wall. */
        if (cell.kind != ENF_ROOM || enf_locate(world, eye) != i) continue;
        EnfSeen seen;
        if (enf_see_around(world, eye, &seen) < 0) continue;
        printf("%.*s: %u cells, %u triangles and %u objects in view", (int)cell.name_length, cell.name,
               seen.n_cells, seen.n_triangles, seen.n_details);
        for (uint32_t p = 0; p < cell.n_portals; p++) enf_set_closed(world, cell.portals[p], 1);
        enf_see_around(world, eye, &seen);
        printf("; %u cells with all its doors shut\n", seen.n_cells);
        for (uint32_t p = 0; p < cell.n_portals; p++) enf_set_closed(world, cell.portals[p], 0);
    }
    enf_close(world);
    return 0;
}
