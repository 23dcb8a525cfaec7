/* Compares the answers of the C library with those that `oracle` wrote: compare WORLD.glb ANSWERS
 *
 * Prints the number of views, and of lists and numbers that differ.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "enfilade.h"

static unsigned char *read_file(const char *path, size_t *n) {
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) exit(2);
    *n = (size_t)ftell(file);
    rewind(file);
    unsigned char *bytes = malloc(*n ? *n : 1);
    if (!bytes || fread(bytes, 1, *n, file) != *n) exit(2);
    fclose(file);
    return bytes;
}

static unsigned n_wrong;

/* Compares a list with the next one of the file; returns the place behind it. */
static const uint32_t *list(const char *what, const uint32_t *word, const uint32_t *ids, uint32_t n) {
    if (*word != n || (n && memcmp(word + 1, ids, n * sizeof *ids))) {
        if (!n_wrong) fprintf(stderr, "%s differ: %u of %u\n", what, n, *word);
        n_wrong++;
    }
    return word + 1 + *word;
}

static void number(const char *what, uint32_t expected, uint32_t found) {
    if (expected == found) return;
    if (!n_wrong) fprintf(stderr, "%s is %u, not %u\n", what, found, expected);
    n_wrong++;
}

static const uint32_t *compare_view(EnfWorld *world, const uint32_t *word) {
    const float *numbers = (const float *)word;
    if (word[0] != ENF_NO_ID) enf_set_openness(world, word[0], numbers[1]);
    const float *eye = numbers + 2, *matrix = numbers + 5;
    EnfSeen seen;
    if (enf_see(world, eye, matrix, &seen) < 0) {
        fprintf(stderr, "%s\n", enf_last_error());
        exit(1);
    }
    word += 21;
    word = list("cells", word, seen.cells, seen.n_cells);
    word = list("portals", word, seen.portals, seen.n_portals);
    word = list("chunks", word, seen.chunks, seen.n_chunks);
    word = list("batches", word, seen.batches, seen.n_batches);
    word = list("objects", word, seen.details, seen.n_details);
    int cell = enf_locate(world, eye);
    number("the cell", word[0], cell < 0 ? ENF_NO_ID : (uint32_t)cell);
    const float *end = (const float *)(word + 1);
    number("clear", word[4], (uint32_t)enf_is_clear(world, eye, end));
    EnfHit hit = {.target = ENF_NO_ID, .index = ENF_NO_ID};
    enf_pick(world, eye, end, &hit);
    number("the target", word[6], hit.target);
    number("the hit", word[7], hit.index);
    float t;
    memcpy(&t, word + 5, sizeof t);
    if (!(fabsf(t - hit.t) <= 1e-6f)) number("the place of the hit", 0, 1);
    return word + 8;
}

int main(int n_arguments, char **arguments) {
    if (n_arguments != 3) return 2;
    size_t n, n_answers;
    unsigned char *bytes = read_file(arguments[1], &n), *answers = read_file(arguments[2], &n_answers);
    EnfWorld *world = enf_open(bytes, n);
    if (!world) {
        fprintf(stderr, "%s\n", enf_last_error());
        return 1;
    }
    const uint32_t *word = (const uint32_t *)answers, *end = word + n_answers / 4;
    uint32_t n_views = *word++;
    for (uint32_t i = 0; i < n_views; i++) word = compare_view(world, word);
    if (word != end) number("the end of the file", 0, 1);
    printf("%u views, %u wrong\n", n_views, n_wrong);
    enf_close(world);
    free(bytes);
    free(answers);
    return n_wrong != 0;
}
