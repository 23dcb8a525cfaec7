/* The run-time of enfilade: which cells, triangles and objects are in view. `docs/your-engine.md` begins with it.
 * cbindgen writes this file from the functions; do not change it by hand. */

#ifndef ENFILADE_H
#define ENFILADE_H

#include <stddef.h>
#include <stdint.h>

/*
 Nothing: the point is in solid matter, the file has no such data.
 */
#define ENF_NONE -1

/*
 An argument is null, out of range or not finite.
 */
#define ENF_BAD_ARGUMENT -2

/*
 A file or a skeleton cannot be used.
 */
#define ENF_BAD_WORLD -3

/*
 A defect of this library; the handle must be closed.
 */
#define ENF_DEFECT -4

/*
 Stands for the absence of an id in structs.
 */
#define ENF_NO_ID UINT32_MAX

/*
 Counts of `enf_count`: cells.
 */
#define ENF_CELLS 0

/*
 Counts: portals.
 */
#define ENF_PORTALS 1

/*
 Counts: batches, the triangles of one material that exactly the same cells see.
 */
#define ENF_BATCHES 2

/*
 Counts: details, placed objects such as furniture and door leaves.
 */
#define ENF_DETAILS 3

/*
 Counts: chunks, ranges of the indices of batches that are culled as units.
 */
#define ENF_CHUNKS 4

/*
 Counts: special portals, such as mirrors.
 */
#define ENF_SPECIALS 5

/*
 Counts: places within a cell or without one about which something was decided.
 */
#define ENF_PLACES 6

/*
 Kind of a cell: a room.
 */
#define ENF_ROOM 0

/*
 Kind of a cell: the space around the building.
 */
#define ENF_OUTDOORS 1

/*
 Kind of a cell: a space in which nobody can stand, such as a shaft.
 */
#define ENF_VOID 2

/*
 Kind of a portal: an opening without a leaf.
 */
#define ENF_OPENING 0

/*
 Kind of a portal: an opening with a door leaf.
 */
#define ENF_DOOR 1

/*
 Kind of a portal: an opening with glass, or above a parapet.
 */
#define ENF_WINDOW 2

/*
 Kind of a portal: a gap of the model that is too narrow to be intended.
 */
#define ENF_CRACK 3

/*
 Motion of a leaf: about a hinge, in radians.
 */
#define ENF_TURN 0

/*
 Motion of a leaf: along a line, in meters.
 */
#define ENF_SLIDE 1

/*
 Target of a pick: a wall; `index` is its batch.
 */
#define ENF_WALL 0

/*
 Target of a pick: an object; `index` is its detail.
 */
#define ENF_DETAIL 1

/*
 Target of a pick: a portal that is closed there; `index` is the portal.
 */
#define ENF_CLOSED_PORTAL 2

/*
 An open world. Its contents are private to the library.
 */
typedef struct EnfWorld EnfWorld;

/*
 A cell.
 */
typedef struct EnfCell {
  /*
   Name in UTF-8, without a zero byte at its end.
   */
  const char *name;
  /*
   Portals of the cell, ascending.
   */
  const uint32_t *portals;
  /*
   Length of the name. [Units: bytes]
   */
  uint32_t name_length;
  /*
   Number of portals.
   */
  uint32_t n_portals;
  /*
   `ENF_ROOM`, `ENF_OUTDOORS` or `ENF_VOID`.
   */
  uint32_t kind;
  /*
   Minimum and maximum. [Units: m]
   */
  float aabb[6];
  /*
   Volume of its air. [Units: m³]
   */
  float volume;
} EnfCell;

/*
 Facts of a room.
 */
typedef struct EnfRoom {
  /*
   Names of the storeys that it stands on, from below, parted by blanks, in UTF-8, without a zero byte at their end.
   */
  const char *storeys;
  /*
   Length of these names. [Units: bytes]
   */
  uint32_t storeys_length;
  /*
   Area of its floors as seen from above, without the recesses of doors and windows. [Units: m²]
   */
  float floor_area;
  /*
   The part of that area where the room is 1.5 m high or more. [Units: m²]
   */
  float area_above_1_5;
  /*
   The part where it is 2.3 m high or more. [Units: m²]
   */
  float area_above_2_3;
  /*
   Clear height over most of that area. [Units: m]
   */
  float height;
  /*
   Number of its doors.
   */
  uint32_t n_doors;
  /*
   Number of its windows.
   */
  uint32_t n_windows;
} EnfRoom;

/*
 A portal.
 */
typedef struct EnfPortal {
  /*
   Vertices of the convex outline, three numbers each, counter-clockwise seen from the second cell. [Units: m]
   */
  const float *outline;
  /*
   Number of vertices of the outline.
   */
  uint32_t n_outline;
  /*
   The two cells; the normal points from the first to the second.
   */
  uint32_t cells[2];
  /*
   `ENF_OPENING`, `ENF_DOOR`, `ENF_WINDOW` or `ENF_CRACK`.
   */
  uint32_t kind;
  /*
   1 if anything passes it, 0 if it is closed.
   */
  uint32_t is_open;
  /*
   Position of its leaves, from 0 for shut to 1 for open. Without leaves, as `is_open`.
   */
  float openness;
  /*
   Number of its leaves.
   */
  uint32_t n_leaves;
  /*
   Unit normal.
   */
  float normal[3];
  /*
   Area of the opening. [Units: m²]
   */
  float area;
  /*
   Distance of the middle of its shut leaves from its plane, along the normal: a panel there that fills the outline is
   hidden by them. 0 without leaves. [Units: m]
   */
  float leaf_depth;
} EnfPortal;

/*
 A measured quantity behind a decision.
 */
typedef struct EnfFact {
  /*
   Name as in the file, such as `area`, in UTF-8, without a zero byte at its end.
   */
  const char *name;
  /*
   Length of the name. [Units: bytes]
   */
  uint32_t name_length;
  /*
   Its value.
   */
  float value;
} EnfFact;

/*
 A decision of the bake.
 */
typedef struct EnfWhy {
  /*
   The decision with its facts in words, in UTF-8, without a zero byte at its end.
   */
  const char *text;
  /*
   The reason as in the file, such as `narrow`, in UTF-8, without a zero byte at its end.
   */
  const char *reason;
  /*
   All that was measured.
   */
  const struct EnfFact *facts;
  /*
   Length of the text. [Units: bytes]
   */
  uint32_t text_length;
  /*
   Length of the reason. [Units: bytes]
   */
  uint32_t reason_length;
  /*
   Number of facts.
   */
  uint32_t n_facts;
  /*
   Index in `facts` of the fact that was compared with the limit, or `ENF_NO_ID` if nothing was weighed.
   */
  uint32_t compared;
  /*
   The number of the rule, or 0 if nothing was weighed.
   */
  float limit;
  /*
   Distance of that fact from the limit: 0 at it, 1 far from it and if nothing was weighed.
   */
  float margin;
  /*
   Middle of the cell's box or of the portal, or a point of the place. [Units: m]
   */
  float position[3];
} EnfWhy;

/*
 A leaf of a door and its motion, measured from its pose in the file.
 */
typedef struct EnfLeaf {
  /*
   The object.
   */
  uint32_t detail;
  /*
   `ENF_TURN` or `ENF_SLIDE`.
   */
  uint32_t motion;
  /*
   Motion to shut. [Units: rad of a turn, m of a slide]
   */
  float shut;
  /*
   Motion to fully open. [Units: rad of a turn, m of a slide]
   */
  float open;
  /*
   A point of the hinge; 0 for a slide. [Units: m]
   */
  float through[3];
  /*
   Unit direction of the hinge or of the slide.
   */
  float axis[3];
} EnfLeaf;

/*
 Triangles of one material that exactly the same cells see.
 */
typedef struct EnfBatch {
  /*
   Vertices, three numbers each. [Units: m]
   */
  const float *positions;
  /*
   Normals of the vertices, three numbers each; null if there are none.
   */
  const float *normals;
  /*
   Three indices of vertices for each triangle, in such an order that every chunk is a range.
   */
  const uint32_t *indices;
  /*
   Number of vertices.
   */
  uint32_t n_vertices;
  /*
   Number of indices.
   */
  uint32_t n_indices;
  /*
   Index of the material in the file, or `ENF_NO_ID`.
   */
  uint32_t material;
  /*
   1 if it is not part of the model but closes its gaps.
   */
  uint32_t is_seal;
} EnfBatch;

/*
 A placed object.
 */
typedef struct EnfDetail {
  /*
   Name in UTF-8, without a zero byte at its end.
   */
  const char *name;
  /*
   Length of the name. [Units: bytes]
   */
  uint32_t name_length;
  /*
   Index of its mesh among the meshes of objects.
   */
  uint32_t mesh;
  /*
   Number of its triangles.
   */
  uint32_t n_triangles;
  /*
   Mesh to world, as in the file.
   */
  float transform[16];
  /*
   Minimum and maximum as in the file; all 0 without vertices. [Units: m]
   */
  float aabb[6];
} EnfDetail;

/*
 A range of a batch's indices that is culled as a unit.
 */
typedef struct EnfChunk {
  /*
   The batch.
   */
  uint32_t batch;
  /*
   First index, three for each triangle, in `EnfBatch.indices`.
   */
  uint32_t first_index;
  /*
   Number of indices.
   */
  uint32_t n_indices;
  /*
   Minimum and maximum. [Units: m]
   */
  float aabb[6];
} EnfChunk;

/*
 Ids in a buffer of the handle.
 */
typedef struct EnfList {
  /*
   The ids.
   */
  const uint32_t *ids;
  /*
   Number of ids.
   */
  uint32_t n;
} EnfList;

/*
 A place to begin a walk.
 */
typedef struct EnfStart {
  /*
   The eye, 1.6 m above the floor. [Units: m]
   */
  float eye[3];
  /*
   Direction in which the way is free farthest: 0 along -z, counter-clockwise seen from above. [Units: rad]
   */
  float yaw;
} EnfStart;

/*
 The end of a step.
 */
typedef struct EnfStep {
  /*
   Portals crossed, in order; at most 16.
   */
  const uint32_t *crossed;
  /*
   Number of portals crossed.
   */
  uint32_t n_crossed;
  /*
   Cell at the end, or that of the start if the end is in solid matter; `ENF_NO_ID` if both are.
   */
  uint32_t cell;
  /*
   1 if the portals on the way do not lead to the end, which was located anew.
   */
  uint32_t is_relocated;
} EnfStep;

/*
 One cell seen through one part of the screen.
 */
typedef struct EnfVisit {
  /*
   The cell.
   */
  uint32_t cell;
  /*
   The portal entered by, or `ENF_NO_ID` for the eye's own cell.
   */
  uint32_t via;
  /*
   Left, bottom, right and top of the part of the screen, from -1 to 1.
   */
  float rectangle[4];
  /*
   Depth of the nearest point of that portal along the view's direction. [Units: m]
   */
  float depth;
  /*
   Face of a view that looks all around, otherwise 0.
   */
  uint32_t face;
  /*
   Index of its first plane in `EnfSeen.planes`.
   */
  uint32_t first_plane;
  /*
   Number of its planes.
   */
  uint32_t n_planes;
} EnfVisit;

/*
 The answer to one view: everything that may be visible, near to far.
 */
typedef struct EnfSeen {
  /*
   Visible cells, each once.
   */
  const uint32_t *cells;
  /*
   For each of `cells` its share of the screen, 0 to 1.
   */
  const float *shares;
  /*
   Portals through which anything is seen, each once.
   */
  const uint32_t *portals;
  /*
   Visible chunks, each once, by cells.
   */
  const uint32_t *chunks;
  /*
   Batches of these chunks, each once, in order of their first chunk.
   */
  const uint32_t *batches;
  /*
   Visible objects, each once, by cells.
   */
  const uint32_t *details;
  /*
   Special portals in view, each once.
   */
  const uint32_t *specials;
  /*
   Cells through parts of the screen.
   */
  const struct EnfVisit *visits;
  /*
   Planes of visits, four numbers each: inside is `n · p + d >= 0`.
   */
  const float *planes;
  /*
   Number of cells, and of shares.
   */
  uint32_t n_cells;
  /*
   Number of portals.
   */
  uint32_t n_portals;
  /*
   Number of chunks.
   */
  uint32_t n_chunks;
  /*
   Number of batches.
   */
  uint32_t n_batches;
  /*
   Number of objects.
   */
  uint32_t n_details;
  /*
   Number of special portals.
   */
  uint32_t n_specials;
  /*
   Number of visits.
   */
  uint32_t n_visits;
  /*
   Number of planes.
   */
  uint32_t n_planes;
  /*
   Number of triangles of the chunks and objects.
   */
  uint32_t n_triangles;
  /*
   The eye's cell, or `ENF_NO_ID` in solid matter, where everything in the view counts as visible.
   */
  uint32_t eye_cell;
} EnfSeen;

/*
 The end of a picked segment.
 */
typedef struct EnfHit {
  /*
   Parameter along the segment, 0 to 1.
   */
  float t;
  /*
   Position. [Units: m]
   */
  float position[3];
  /*
   Unit normal on the side of the segment's start.
   */
  float normal[3];
  /*
   `ENF_WALL`, `ENF_DETAIL` or `ENF_CLOSED_PORTAL`.
   */
  uint32_t target;
  /*
   The batch, detail or portal.
   */
  uint32_t index;
  /*
   Index of the primitive in an object's mesh, otherwise 0.
   */
  uint32_t primitive;
  /*
   Index of the triangle in its batch or primitive, otherwise 0.
   */
  uint32_t triangle;
  /*
   The cell from which the segment hit, or `ENF_NO_ID`.
   */
  uint32_t cell;
  /*
   For a leaf, the first portal that it shuts; for a closed portal, itself; otherwise `ENF_NO_ID`.
   */
  uint32_t portal;
} EnfHit;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Returns the version of the ABI.
 */
uint32_t enf_abi_version(void);

/*
 Returns the version of the library as text, such as `0.1.0`.
 */
const char *enf_version(void);

/*
 Returns the reason of this thread's last failure as text, empty if there was none; valid until the next failure.
 */
const char *enf_last_error(void);

/*
 Allocates `n` bytes for input, for callers that cannot share their own memory, such as browsers. Null if there is not
 enough memory, or `n` is 0.
 */
uint8_t *enf_alloc(size_t n);

/*
 Frees the `n` bytes of `enf_alloc(n)`. Null is ignored.
 */
void enf_free(uint8_t *bytes, size_t n);

/*
 Opens a world from the bytes of its file, which are not needed afterwards. Null on failure.
 */
struct EnfWorld *enf_open(const uint8_t *glb, size_t n);

/*
 Opens a world whose triangles come later, from sections 2 and 3 of the head of a packed world: a world file and the
 skeleton of its sight. Answers of `enf_see` are those of the whole world. Null on failure.
 */
struct EnfWorld *enf_open_hollow(const uint8_t *glb,
                                 size_t n,
                                 const uint8_t *skeleton,
                                 size_t n_skeleton);

/*
 Closes a world. Null is ignored.
 */
void enf_close(struct EnfWorld *world);

/*
 Returns the number of cells, portals, batches, …: `what` is `ENF_CELLS`, `ENF_PORTALS`, ….
 */
int32_t enf_count(struct EnfWorld *handle, uint32_t what);

/*
 Describes a cell.
 */
int32_t enf_cell(struct EnfWorld *handle, uint32_t cell, struct EnfCell *out);

/*
 Tells the facts of a room: floor area, height, storeys, doors, windows. Returns `ENF_NONE`, and writes nothing, for other
 cells and where the file has none: those that the command bakes have them.
 */
int32_t enf_room(struct EnfWorld *handle,
                 uint32_t cell,
                 struct EnfRoom *out);

/*
 Describes a portal and its present state.
 */
int32_t enf_portal(struct EnfWorld *handle, uint32_t portal, struct EnfPortal *out);

/*
 Tells why the bake made a cell, a portal or a place: decision number `decision`, from 0 on. `of` is `ENF_CELLS`,
 `ENF_PORTALS` or `ENF_PLACES`. Returns `ENF_NONE` after the last decision; older files have none.
 */
int32_t enf_why(struct EnfWorld *handle,
                uint32_t of,
                uint32_t index,
                uint32_t decision,
                struct EnfWhy *out);

/*
 Describes leaf number `leaf` of a portal.
 */
int32_t enf_leaf(struct EnfWorld *handle, uint32_t portal, uint32_t leaf, struct EnfLeaf *out);

/*
 Describes a batch and its triangles.
 */
int32_t enf_batch(struct EnfWorld *handle, uint32_t batch, struct EnfBatch *out);

/*
 Describes a placed object.
 */
int32_t enf_detail(struct EnfWorld *handle, uint32_t detail, struct EnfDetail *out);

/*
 Describes a chunk.
 */
int32_t enf_chunk(struct EnfWorld *handle, uint32_t chunk, struct EnfChunk *out);

/*
 Lists the cells that see a batch, ascending.
 */
int32_t enf_cells_of_batch(struct EnfWorld *handle, uint32_t batch, struct EnfList *out);

/*
 Lists the cells that an object touches, ascending; for a door leaf, all that it sweeps.
 */
int32_t enf_cells_of_detail(struct EnfWorld *handle, uint32_t detail, struct EnfList *out);

/*
 Lists the portals of which an object is a leaf, ascending; for most objects none.
 */
int32_t enf_portals_of_detail(struct EnfWorld *handle, uint32_t detail, struct EnfList *out);

/*
 Lists the cells that may be visible from a cell, ascending. Returns `ENF_NONE` if the file holds no such sets.
 */
int32_t enf_pvs_row(struct EnfWorld *handle,
                    uint32_t cell,
                    struct EnfList *out);

/*
 Returns the cell of a point (three numbers), or `ENF_NONE` in solid matter.
 */
int32_t enf_locate(struct EnfWorld *handle, const float *point);

/*
 Finds a place to begin a walk, in a room with many ways out. Returns `ENF_NONE`, and writes nothing, in a world without cells.
 */
int32_t enf_start(struct EnfWorld *handle,
                  struct EnfStart *out);

/*
 Follows a step in a straight line from cell to cell.
 */
int32_t enf_step(struct EnfWorld *handle, const float *from, const float *to, struct EnfStep *out);

/*
 Moves the leaves of a portal to a position from 0 for shut to 1 for fully open. A portal without leaves is closed at 0
 and open above. Shut leaves of glass are seen through: see `enf_set_closed`.
 */
int32_t enf_set_openness(struct EnfWorld *handle,
                         uint32_t portal,
                         float share);

/*
 Closes a portal for sight, whatever its leaves are made of, if `is_closed` is not 0; otherwise opens it fully.
 */
int32_t enf_set_closed(struct EnfWorld *handle,
                       uint32_t portal,
                       uint32_t is_closed);

/*
 Locks a cell if `is_locked` is not 0, so that it is never seen from others; otherwise unlocks it.
 */
int32_t enf_lock(struct EnfWorld *handle, uint32_t cell, uint32_t is_locked);

/*
 Writes the transform (16 numbers) from an object's pose in the file to its present one, to be applied after its own
 transform. Returns 0, and writes nothing, if it was not moved.
 */
int32_t enf_pose(struct EnfWorld *handle,
                 uint32_t detail,
                 float (*out)[16]);

/*
 Answers a view by an engine's camera: the eye (three numbers) and the matrix (16) from world to clip space. Near and far
 planes and the direction of depth do not matter.
 */
int32_t enf_see(struct EnfWorld *handle,
                const float *eye,
                const float *view_projection,
                struct EnfSeen *out);

/*
 Answers a view by its parts: eye, direction and upward direction (three numbers each), vertical angle in radians, and
 width divided by height.
 */
int32_t enf_see_perspective(struct EnfWorld *handle,
                            const float *eye,
                            const float *toward,
                            const float *up,
                            float fov_y,
                            float aspect,
                            struct EnfSeen *out);

/*
 Answers what is seen in all directions from the eye (three numbers).
 */
int32_t enf_see_around(struct EnfWorld *handle, const float *eye, struct EnfSeen *out);

/*
 Returns 1 if a box (six numbers: minimum and maximum) that is in `n` cells may be visible in the last view, otherwise 0.
 For moving things that are not in the file.
 */
int32_t enf_sees_box(struct EnfWorld *handle,
                     const uint32_t *cells,
                     size_t n,
                     const float *aabb);

/*
 Returns 1 if neither wall nor closed portal is between two points (three numbers each), otherwise 0. Objects do not
 count. The first call takes as long as the world has triangles.
 */
int32_t enf_is_clear(struct EnfWorld *handle,
                     const float *from,
                     const float *to);

/*
 Finds the first wall, object or closed portal between two points (three numbers each). Returns 0, and writes nothing, if
 there is none. The first call takes as long as the world has triangles.
 */
int32_t enf_pick(struct EnfWorld *handle,
                 const float *from,
                 const float *to,
                 struct EnfHit *out);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* ENFILADE_H */
