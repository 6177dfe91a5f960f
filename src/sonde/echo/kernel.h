// Inner loops of the image, one set per instruction set.
#ifndef SONDE_SRC_ECHO_KERNEL_H
#define SONDE_SRC_ECHO_KERNEL_H

#include "echo/kernel_looks.h"
#include "echo/plane.h"
#include "echo/psf.h"
#include "sonde/tissue_anatomy.h"

#include <stdint.h>

enum {
  SONDE_MOST_LINES = 512,
  ECHO_ALIGN = 16,  // lines and batches are padded to whole vectors
  LAYER_LEVELS = 5, // skin, dermis, deep fascia, cortex, superficial fascia; then walls, lesions
  TEXTURES = 15,    // one more than the last texture's salt
  KNOT_FLOATS = 11, // that a texture remembers per line
  MOST_LEVELS = LAYER_LEVELS + MOST_VESSELS + MOST_LESIONS,
  RING_PLANES = 2 * SONDE_RANK,
  SONDE_TILE_SIDE = 64,
  SONDE_TILES = 2, // fat, muscle
};

// Of a tile: x of the voxels that a step along z moves the pattern by, so that a plane through it
// does not meet the same place one period deeper; bytes per unit of amplitude.
#define SONDE_TILE_SHEAR 0.375f
#define SONDE_TILE_STEPS 42.0f

// Layers of a deep fascia, m below its upper face, and the double echo of an artery's wall.
enum { FASCIA_SHEETS = 3 };
static const float fascia_sheet_m[FASCIA_SHEETS] = {0, 0.35e-3f, 0.75e-3f};

// A lumen over one map: forms of its scatterers' coordinates, 1 on the wall at rest, and of the
// length along the vessel, m. Clot fills a part.
typedef struct splat_lumen {
  float along[4], across[4], axial[4];
  float solid, amplitude; // clot's share; of the scatterers in blood: what clutter shows of them
  uint32_t vessel;        // whose clot it is
  sonde_clot_form form;
} splat_lumen;

// Scatterers of one affine map: (column, elevation over its reach, sample) =
// m[0] + m[1] x + m[2] y + m[3] z.
typedef struct splat_map {
  float m[4][4];        // m[0][3] is the amplitude of the scatterers, the others' last are not used
  uint32_t from, count; // scatterers; the count is a multiple of ECHO_ALIGN
  uint32_t lumen, lumens; // first and number of those that it reaches into
} splat_map;

// Rows that scatterers may be nearest to: first <= row < last.
typedef struct splat_limits {
  float first, last;
} splat_limits;

typedef struct splat_job {
  const float *x, *y, *z, *sign;
  const splat_map *map; // [maps]
  const splat_lumen *lumen;
  uint32_t maps;
  bool cube;   // x, y and z lie within +-1/2
  float turns; // carrier periods per sample
  float right; // last column with a neighbour
  splat_limits rows;
  // [row][column][re, im]: row n of the image is row 1 + n & mask. The rows before the first and
  // behind the last are parts of the last and the first.
  float *grid;
  uint32_t stride; // floats per row
  uint32_t mask;
} splat_job;

// State of a vessel beside some points. Vectors of the cross-section are of unit length.
typedef enum wall_field {
  WALL_REST,                   // centre at rest, m
  WALL_SHIFT = WALL_REST + 3,  // displacement of the centre, m
  WALL_AXIS = WALL_SHIFT + 3,  // along the vessel
  WALL_FLAT = WALL_AXIS + 3,   // short axis
  WALL_ACROSS = WALL_FLAT + 3, // long axis
  WALL_RADIUS = WALL_ACROSS + 3,
  WALL_COUPLING, // 0..1: how firmly the wall leads; 0: no vessel
  WALL_SHORT,    // semi-axes, m
  WALL_LONG,
  WALL_ROTATION, // the tissue's gradient across the vessel, as sonde_vessel_state has it
  WALL_TISSUE_SHORT,
  WALL_SHEAR,
  WALL_TISSUE_LONG,
  WALL_SMOOTHING,
  WALL_FIELDS
} wall_field;

enum {
  WALL_GROUPS = 64,
  WALL_POINTS = 4 * WALL_GROUPS,
  WALL_ROOM = WALL_GROUPS + ECHO_ALIGN // whole vectors read beyond the last
};

// Points of the tissue, in groups of four that share the vessels beside them: where those warp
// them before the field moves them, and where they smooth the displacement.
typedef struct wall_job {
  uint32_t groups, walls;
  const float (*wall)[WALL_FIELDS][WALL_ROOM]; // [walls]
  const float (*rest)[WALL_POINTS];            // [3]
  float (*warped)[WALL_POINTS];                // [3] of warp(); read by smooth()
  float (*place)[WALL_POINTS];                 // [3] of smooth(): of the warped point by the field
                                               // alone; replaced
} wall_job;

// A row of the grid, times a gain, to even and odd columns; leaves zeros.
typedef struct merge_job {
  float *grid;
  const float *top, *low; // [count + 1] gains of even columns in the rows above and below; odd ones
                          // take the mean of their neighbours; NULL: 1
  float share;            // of the distance from top to low
  float *re[SONDE_FINE], *im[SONDE_FINE]; // [count]
  uint32_t count;                         // pairs of columns, multiple of ECHO_ALIGN
} merge_job;

// Blood on some streamlines: places along one segment, in segments, and amplitudes. Those of a
// streak, a bundle of streamlines and one segment long, differ by their signs only.
typedef struct stream_job {
  const float *z, *speed;      // [count] place at the start, speed over the mean
  const uint32_t *bundle;      // [count] of the streamline
  uint32_t count, first, salt; // first: number of the first streamline
  double flowed, streaks;      // mean flow, in segments; sizes are 1 +- streaks over their rms
  int32_t segment;
  float *at, *sign; // [count] place about the segment's middle; amplitude
} stream_job;

// What a vessel in view is made of.
typedef struct tissue_vessel {
  float wall_m, clot_fraction, clot_scatter;
  float sheath_m, clot_loss; // of bright fat around it, 0: none; dB/m/MHz one way
  float lumps_db, layers_db; // unevenness of the clot
  uint32_t number;           // among the leg's vessels
  sonde_clot_form form;
  float cusp_bend; // how far the cusps of its valves are closed, 0 to 1
} tissue_vessel;

typedef enum tissue_lesion_kind { TISSUE_NODE, TISSUE_CYST, TISSUE_HAEMATOMA } tissue_lesion_kind;

typedef struct tissue_lesion {
  tissue_lesion_kind kind;
  float per_half[3]; // one over the semi-axes, 1/m
  float scatter;
} tissue_lesion;

// A seed of a muscle's cell, or of fat between muscles.
typedef struct tissue_cell {
  float x_mm, y_mm; // in the section
  float cell;       // number: seeds of one cell have no boundary
  float section;    // number of the compartment: a septum parts two
} tissue_cell;

// A nerve, tendon or lymph node of a tissue map, or a valve's cusps.
typedef struct tissue_body {
  sonde_tissue kind;
  float half_m[3]; // semi-axes; along a cord 1
  float facing;    // how squarely the beam meets its fibres, 0..1
} tissue_body;

// Facts of the cells that points look up by the cell's place, a row each.
typedef enum cell_fact {
  CELL_MUSCLE, // 1, or 0: fat
  CELL_GAIN,   // of the backscatter
  CELL_LEAN,   // of the fibres: depth lost per length along the leg
  CELL_SHIFT,  // [3] of muscle's tile, voxels
  CELL_FACTS = CELL_SHIFT + 3
} cell_fact;

// A row of the coarse plane, per line.
typedef struct widen_job {
  const float *in;       // [columns], readable for a whole vector more
  const int32_t *column; // [lines] to the left of each line, ascending
  const float *share;    // [lines] of the distance to the next
  float *out;            // [lines]
  uint32_t lines;        // multiple of ECHO_ALIGN
} widen_job;

// Rows of the fields of plane.h at one depth, in; tissue out.
typedef struct tissue_job {
  const float *top, *low;    // [fields][lines] at the coarse rows above and below, where gates let
  float share;               // of the way from top to low
  const tissue_gate *gate;   // [lines / ECHO_ALIGN]
  uint32_t lines;            // multiple of ECHO_ALIGN
  uint32_t vessels, lesions; // in view; the first two are the femoral vein and artery
  tissue_vessel vessel[MOST_VESSELS]; // branches after their parents
  tissue_lesion lesion[MOST_LESIONS];
  uint32_t cells; // 0: the layers alone
  tissue_cell cell[MOST_CELLS];
  float fact[CELL_FACTS][MOST_CELLS];
  uint32_t bodies;
  tissue_body body[MOST_BODIES];
  const uint32_t *tile[SONDE_TILES]; // [SIDE][SIDE][SIDE], kernel_texture.h
  float beam_x, beam_y;              // direction of the beam in the section
  float bone_radius_m;               // of the cylinder about the leg's axis
  float webs, oedema;                // 0..1
  float rough_bone, rough_m; // amplitude over muscle on a level cortex, fading over so far from it
  float periosteum;          // the same of the soft tissue on the cortex
  float rows_per_m;          // of the march, 0 in its first row
  bool plain;
  float *memory; // [lines][TEXTURES][KNOT_FLOATS], of one set of kernels; all bits set: empty
  float *scatter, *loss; // amplitude over muscle, dB/m/MHz one way
  float *rough;          // what the cortex's facets scatter besides
  float *level;          // [levels][lines] signed: sign changes are interfaces
  const float *before;   // the same of the row above
  // [lines] signed distance to the nearest of the fat's coherent septa, which jumps half-way
  // between two, and their strength there
  float *septum, *septum_size;
  const float *septum_before; // the distance in the row above
  uint16_t *crossed, *parted; // [lines / ECHO_ALIGN] a bit per line: a level, a septum is crossed
} tissue_job;

// Gain of a row of the march: what scatters there and is left behind the losses, and clutter.
typedef struct fade_job {
  const float *scatter, *rough, *loss_db; // [lines]; facets send nothing back that comes late
  float *tail;       // [lines] power that reverberates above this row; moves on to the next
  float *gain;       // [lines] amplitude
  float clutter;     // share of the power that comes late
  float fresh, kept; // of the tail per row: what joins it, what losses leave of it
  uint32_t lines;    // multiple of ECHO_ALIGN
} fade_job;

typedef struct echo_kernels {
  const char *name;
  void (*splat)(const splat_job *job);
  void (*warp)(const wall_job *job);
  void (*smooth)(const wall_job *job);
  void (*stream)(const stream_job *job);
  void (*lateral)(const lateral_job *job);
  void (*axial)(const axial_job *job);
  void (*tissue)(const tissue_job *job);
  void (*merge)(const merge_job *job);
  void (*widen)(const widen_job *job);
  void (*fade)(const fade_job *job);
  void (*convert)(const convert_job *job);
  void (*look)(const look_job *job);
  void (*compress)(const compress_job *job);
  void (*smooth_lines)(const smooth_job *job);
  void (*show)(const show_job *job);
} echo_kernels;

// The widest kernels that this processor runs, or those called `name`: avx512, avx2, sse4, base,
// plain.
const echo_kernels *sonde_echo_kernels_find(const char *name);
extern const echo_kernels sonde_echo_kernels_plain, sonde_echo_kernels_base;
#ifdef __x86_64__
extern const echo_kernels sonde_echo_kernels_sse4, sonde_echo_kernels_avx2,
    sonde_echo_kernels_avx512;
#endif

#endif
