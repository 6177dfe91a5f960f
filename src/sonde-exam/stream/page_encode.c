// Binary messages to the page, little-endian whatever the machine.
#include "base/bytes.h"
#include "stream/page_message.h"

#include "base/maths.h"

static const double MM = 1e3; // mm per m

static void put_header(bytes_cursor *out, page_type type, uint32_t id, size_t size) {
  SONDE_ASSERT(size <= UINT32_MAX);
  bytes_put(out, "SNDE", 4);
  bytes_u16(out, PAGE_VERSION);
  bytes_u16(out, (uint16_t)type);
  bytes_u32(out, id);
  bytes_u32(out, (uint32_t)size);
  SONDE_ASSERT(out->count == PAGE_HEADER_BYTES);
}

static void put_point_mm(bytes_cursor *out, sonde_vec3 p_m) {
  bytes_f32(out, p_m.x * MM);
  bytes_f32(out, p_m.y * MM);
  bytes_f32(out, p_m.z * MM);
}

size_t page_encode_mesh(const sonde_mesh *mesh, uint32_t part, unsigned char *bytes,
                        size_t capacity) {
  SONDE_ASSERT(mesh && (bytes || capacity == 0));
  size_t size = PAGE_MESH_FIXED_BYTES + 12 * ((size_t)mesh->vertex_count + mesh->face_count);
  if (size > capacity) return size;
  bytes_cursor out = {bytes, capacity, 0};
  put_header(&out, PAGE_MESH, part, size);
  bytes_u32(&out, mesh->vertex_count);
  bytes_u32(&out, mesh->face_count);
  for (uint32_t i = 0; i < mesh->vertex_count; ++i) put_point_mm(&out, mesh->vertices[i]);
  for (uint32_t i = 0; i < mesh->face_count; ++i)
    for (int k = 0; k < 3; ++k) bytes_u32(&out, mesh->faces[i][k]);
  SONDE_ASSERT(out.count == size);
  return size;
}

size_t page_encode_line(const sonde_vessel *vessel, uint32_t part, unsigned char *bytes,
                        size_t capacity) {
  SONDE_ASSERT(vessel && vessel->count <= SONDE_VESSEL_POINTS);
  size_t size = PAGE_MESH_FIXED_BYTES + 16 * (size_t)vessel->count;
  if (size > capacity) return size;
  bytes_cursor out = {bytes, capacity, 0};
  put_header(&out, PAGE_LINE, part, size);
  bytes_u32(&out, vessel->count);
  bytes_u32(&out, 0);
  for (uint32_t i = 0; i < vessel->count; ++i) {
    put_point_mm(&out, vessel->point[i].centre_m);
    bytes_f32(&out, vessel->point[i].radius_m * MM);
  }
  SONDE_ASSERT(out.count == size);
  return size;
}

static void put_force(bytes_cursor *out, sonde_vec3 force_n) {
  bytes_f32(out, force_n.x);
  bytes_f32(out, force_n.y);
  bytes_f32(out, force_n.z);
}

// Nearest count of quanta; beyond the range the end of the range, not a number as 0.
static uint16_t quantise(double displacement_m) {
  double steps = displacement_m / PAGE_QUANTUM_M;
  if (!isfinite(steps)) steps = 0;
  return (uint16_t)(int16_t)lrint(clamp(steps, -32767, 32767));
}

// The spectrum behind a frame's image and colours.
static void put_spectrum(bytes_cursor *out, const sonde_gate_spectrum *heard) {
  const sonde_gate_settings *gate = &heard->settings;
  const double cm_s = 100;
  bytes_u16(out, PAGE_SPECTRUM);
  bytes_u16(out, (uint16_t)heard->count);
  bytes_u16(out, SONDE_DOPPLER_BINS);
  bytes_u16(out, 0);
  bytes_f32(out, gate->x_m * MM);
  bytes_f32(out, gate->z_m * MM);
  bytes_f32(out, gate->length_m * MM);
  bytes_f32(out, gate->steer_rad * 180 / SONDE_PI);
  bytes_f32(out, gate->angle_rad * 180 / SONDE_PI);
  bytes_f32(out, heard->limit_m_s * cm_s);
  bytes_f32(out, heard->low_m_s * cm_s);
  bytes_f32(out, heard->pulse_hz);
  bytes_f32(out, heard->slowest_m_s * cm_s);
  bytes_f32(out, SONDE_GATE_COLUMN_S);
  bytes_u64(out, heard->count > 0 ? heard->column[0].number : 0);
  for (uint32_t n = 0; n < heard->count; ++n) {
    const sonde_gate_column *column = &heard->column[n];
    bytes_f32(out, (double)column->mean_m_s * cm_s);
    bytes_f32(out, (double)column->peak_m_s * cm_s);
    bytes_put(out, column->power, sizeof column->power);
  }
}

size_t page_encode_frame(const sonde_frame *frame, const sonde_mesh *rest, uint32_t sequence,
                         unsigned char *bytes, size_t capacity) {
  SONDE_ASSERT(frame && rest && frame->skin_m && frame->pixels);
  SONDE_ASSERT(frame->width <= 0xffff && frame->height <= 0xffff);
  size_t pixels = (size_t)frame->width * frame->height;
  size_t size = PAGE_FRAME_FIXED_BYTES + 6 * (size_t)rest->vertex_count + pixels;
  const sonde_colour_overlay *over = &frame->colour.over;
  if (frame->radius_m > 0) size += PAGE_FAN_BYTES;
  if (frame->colour.shown) size += PAGE_COLOUR_FIXED_BYTES + (size_t)over->width * over->height;
  const sonde_gate_spectrum *heard = &frame->spectrum;
  if (heard->on)
    size += PAGE_SPECTRUM_FIXED_BYTES + (size_t)heard->count * (8 + SONDE_DOPPLER_BINS);
  if (size > capacity) return size;
  bytes_cursor out = {bytes, capacity, 0};
  put_header(&out, PAGE_FRAME, sequence, size);
  const sonde_snapshot *s = &frame->snapshot;
  bytes_u64(&out, s->tick);
  bytes_f64(&out, s->time_s);
  bytes_u32(&out, rest->vertex_count);
  bytes_u16(&out, (uint16_t)frame->width);
  bytes_u16(&out, (uint16_t)frame->height);
  bytes_u16(&out, (uint16_t)s->probe);
  bytes_u16(&out, (uint16_t)s->fault);
  SONDE_ASSERT(s->flags < PAGE_SOLID);
  bytes_u16(&out, (uint16_t)(s->flags | (s->solid ? PAGE_SOLID : 0)));
  bytes_u16(&out, (uint16_t)(s->solver_iterations > 0xffff ? 0xffff : s->solver_iterations));
  bytes_u32(&out, s->awake_nodes);
  put_point_mm(&out, s->world_from_probe.position);
  bytes_f32(&out, s->world_from_probe.rotation.w);
  bytes_f32(&out, s->world_from_probe.rotation.x);
  bytes_f32(&out, s->world_from_probe.rotation.y);
  bytes_f32(&out, s->world_from_probe.rotation.z);
  put_force(&out, s->force_n);
  put_force(&out, s->rendered_force_n);
  bytes_f32(&out, s->force_normal_n);
  bytes_f32(&out, s->penetration_m * MM);
  bytes_f32(&out, s->contact_area_m2 * MM * MM);
  bytes_f32(&out, s->vein_area_ratio);
  bytes_f32(&out, s->artery_area_ratio);
  bytes_f32(&out, s->vein_short_m * MM);
  bytes_f32(&out, frame->width_m * MM);
  bytes_f32(&out, frame->height_m * MM);
  bytes_f32(&out, PAGE_QUANTUM_M * MM);
  SONDE_ASSERT(out.count == PAGE_FRAME_FIXED_BYTES);
  for (uint32_t i = 0; i < rest->vertex_count; ++i) {
    sonde_vec3 p = rest->vertices[i];
    bytes_u16(&out, quantise((double)frame->skin_m[3 * i] - p.x));
    bytes_u16(&out, quantise((double)frame->skin_m[3 * i + 1] - p.y));
    bytes_u16(&out, quantise((double)frame->skin_m[3 * i + 2] - p.z));
  }
  bytes_put(&out, frame->pixels, pixels);
  if (frame->radius_m > 0) {
    bytes_u16(&out, PAGE_FAN);
    bytes_u16(&out, 0);
    bytes_f32(&out, frame->radius_m * MM);
    bytes_f32(&out, frame->top_m * MM);
  }
  if (frame->colour.shown) {
    const sonde_colour_box *box = &frame->colour.box;
    SONDE_ASSERT(over->left + over->width <= 0xffff && over->top + over->height <= 0xffff);
    bytes_u16(&out, (uint16_t)frame->colour.shown);
    bytes_u16(&out, (uint16_t)over->left);
    bytes_u16(&out, (uint16_t)over->top);
    bytes_u16(&out, (uint16_t)over->width);
    bytes_u16(&out, (uint16_t)over->height);
    bytes_u16(&out, 0);
    bytes_f32(&out, frame->colour.limit_m_s * 100);
    bytes_f32(&out, box->left_m * MM);
    bytes_f32(&out, box->right_m * MM);
    bytes_f32(&out, box->top_m * MM);
    bytes_f32(&out, box->bottom_m * MM);
    bytes_f32(&out, box->steer_rad * 180 / SONDE_PI);
    bytes_put(&out, over->pixels, (size_t)over->width * over->height);
  }
  if (heard->on) put_spectrum(&out, heard);
  SONDE_ASSERT(out.count == size);
  return size;
}
